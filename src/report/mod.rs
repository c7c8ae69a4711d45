//! Writes tables, figures and reports from the measured rows of a comparison of shadow methods.
//!
//! [`mod@make`] measures a comparison of one or several scenes and writes a result folder. The folder contains every
//! column as CSV and JSON ([`writers`]), readable tables as Markdown and LaTeX ([`tables`]) with the most accurate
//! shadow method within each budget ([`budgets`]), plots of error against time and memory ([`plot`]), difference
//! images ([`heat`]), a figure of all pictures ([`grid`]), and one HTML report with all of these and the figures of
//! [`nodes`] ([`mod@html`]). All figures are drawn on a [`canvas`]. [`run`] describes how the table was measured, and
//! [`mod@merge`] merges shards. [`ablation`] writes the ablation table.

pub mod ablation;
pub mod annotate;
pub mod budgets;
pub mod canvas;
mod folder;
pub mod grid;
pub mod heat;
pub mod html;
mod made;
pub mod make;
pub mod markdown;
pub mod merge;
pub mod mitsuba;
mod names;
pub mod nodes;
pub mod number;
pub mod plot;
pub mod run;
pub mod side_tables;
pub mod tables;
pub mod verify;
pub mod writers;

pub use folder::Start;
