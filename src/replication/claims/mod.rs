//! Claims of the methods' papers, tried: each statement with a figure or a comparison in it is a row.
//!
//! The claims are data, one TOML file a paper: the statement, the methods to measure, and a formula for the verdict
//! ([`claim`], [`formula`]). [`figures`] measures every method once for all claims, in one comparison a scene, so that
//! times that are divided by each other were taken in turn. [`scenes`] has stand-ins for the papers' data. A claim that
//! cannot be tried is a row that says why and has no verdict.

pub mod claim;
pub mod figures;
pub mod formula;
pub mod rules;
mod run;
pub mod scenes;
pub mod table;
mod turns;

pub use claim::{Claim, Figure, Finding, Measured, Need, Row, all, find_paper};
pub use run::{run, scene_names};
