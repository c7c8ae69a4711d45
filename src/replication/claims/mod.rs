//! What the papers of the methods claim, tried: each claim with a figure or a comparison in it is a row, with what was
//! claimed, what is measured here and whether it holds.
//!
//! A [`Claim`] names the settings that it needs on a scene ([`Claim::needs`]), and judges their figures by a rule that it
//! states. No verdict is a constant: [`rules`] has the rules, [`figures`] what is measured, once for all claims and in one
//! comparison a scene, so that times that are divided by each other were taken in turn. [`scenes`] has what stands in for
//! the papers' data. What cannot be tried here is a row that says why and has no verdict.

pub mod claim;
pub mod figures;
mod hadwiger;
mod kim_neumann;
mod later;
pub mod rules;
mod run;
pub mod scenes;
mod splits;
pub mod table;
mod turns;
mod voicu;
mod yuksel_keyser;

pub use claim::{Claim, Figure, Finding, Measured, Need, Paper, Row, Trial};
pub use run::{all, run, scene_names};
