//! Claims of papers: measures each quantitative statement in the papers of the shadow methods and gives a verdict.
//!
//! The claims are TOML files, one per paper. An entry has the statement, the methods to measure, and a formula for
//! the verdict ([`claim`], [`formula`]). [`figures`] measures every method once for all claims, in one comparison per
//! scene, so that times in a ratio come from interleaved rounds. [`scenes`] has built-in substitutes for the papers'
//! data. A claim that cannot be tested gets a row with the reason and no verdict.

pub mod claim;
pub mod figures;
pub mod formula;
pub mod rules;
mod run;
pub mod scenes;
pub mod table;
mod turns;
pub mod verify;

pub use claim::{Claim, Figure, Finding, Measured, Need, Row, all, find_paper};
pub use run::{run, scene_names, unrequested};
