//! Tables, figures and reports from measured rows.
//!
//! [`mod@make`] orders the comparison of one or several scenes and writes a folder: every column as CSV and JSON
//! ([`writers`]), Markdown and LaTeX for reading ([`tables`]) with what is closest within [`budgets`], error
//! against time and memory ([`plot`]), where pictures differ ([`heat`]), all of it with the figures of [`nodes`]
//! in one file ([`mod@html`]), and a [`grid`] of all pictures for a paper; all of that is drawn on a [`canvas`]. [`run`] says how it was
//! made, and [`mod@merge`] puts shards together. [`ablation`] and [`mod@stability`] write up the other two
//! tables.

pub mod ablation;
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
mod names;
pub mod nodes;
pub mod number;
pub mod plot;
pub mod run;
pub mod side_tables;
pub mod tables;
pub mod writers;

pub use folder::Start;
