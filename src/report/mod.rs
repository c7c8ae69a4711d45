//! From rows to what a reader gets.
//!
//! [`mod@make`] orders the comparison of one or several scenes and writes a folder: every column as CSV and JSON
//! ([`writers`]), Markdown and LaTeX for reading ([`tables`]) with what is closest within [`budgets`], error
//! against time and memory ([`plot`]), where pictures differ ([`heat`]), and all of it with the figures of [`nodes`]
//! in one file ([`mod@html`]). [`ablation`], [`claims`] and [`mod@stability`] write up the
//! other tables.

pub mod ablation;
pub mod budgets;
mod canvas;
pub mod claims;
pub mod heat;
pub mod html;
pub mod make;
pub mod nodes;
pub mod number;
pub mod plot;
pub mod stability;
pub mod tables;
pub mod writers;
