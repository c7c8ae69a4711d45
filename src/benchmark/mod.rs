//! Frozen benchmark: searches the best settings of every shadow method within equal budgets, in many cells, and ranks the
//! methods.
//!
//! A cell is a volume, a transfer function, a light and a view (`definition`). Its visible points and their exact
//! transmittances are fixed by a hash (`exact`). In each cell all methods are searched in the same way (`measure`), and
//! external programs may answer the same points (`external`). Each cell is recorded in a file of its own (`folder`).
//! Tables and plots are made from these files alone (`ranking`, `pages`).

pub mod answer;
pub mod definition;
pub mod exact;
pub mod external;
pub mod folder;
mod measure;
pub mod pages;
mod plot;
pub mod ranking;
mod run;
mod settings;
pub mod verify;

pub use run::Run;
