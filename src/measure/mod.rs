//! How wrong a shadow method is and how long it takes.
//!
//! Errors are of transmittance from the light, `T_method - T_exact`, and taken in two places that answer two
//! questions. Along **light rays** through texel centres ([`rays`] picks the texels, [`band::test_depths`] the
//! depths) they say whether a method keeps its promise: [`band`] compares it with the exact curve, widened by
//! the promised tolerance in value and in depth, and `ray_err_max` is the plain largest difference. At **points
//! that the camera sees**, weighted as it sees them, they say what a user notices ([`stats::ErrorStats`]). The
//! **picture** itself is compared with the exact one in linear RGBA ([`stats::image_error`]) and as a viewer sees
//! it ([`similarity::ssim`]), and [`heat`] shows where errors are.
//!
//! Times are medians of repeats after a warm-up, with smallest and largest beside them, the methods taking
//! turns ([`timing::interleave`]); `build_ms` makes the shadow structure, `frame_ms` one picture with it made,
//! and the column `clock` says whose clock it was.
//!
//! [`table`] holds one [`Row`](table::Row) a method and setting and writes it as CSV (every column, at
//! full precision), [`report`] as Markdown and LaTeX for reading, with what is [`best`] at equal bytes and time, and
//! [`plot`] draws error against time and memory. [`mod@html`] puts all of it, with the pictures and the figures of
//! [`nodes`], into one file, and [`light_curve`] follows a single light ray. None of these knows of a GPU; measuring
//! itself is tested with planted errors and planted times. [`errors`] asks a built method and the exact field the same
//! questions, [`mod@compare`] makes the whole table of a scene, [`mod@make`] that of several with all their files, [`progress`] tells
//! who watches and lets them end it, [`mod@ablate`] measures what the plan has left out, [`journal`] keeps what is measured on
//! disk as soon as it is, and [`stability`] takes every method through stiff and extreme cases.

pub mod ablate;
pub mod band;
pub mod best;
mod canvas;
mod cell;
pub mod compare;
pub mod error_map;
pub mod errors;
pub mod facts;
pub mod heat;
pub mod html;
pub mod journal;
pub mod light_curve;
pub mod make;
pub mod nodes;
pub mod plot;
mod prepare;
pub mod progress;
pub mod rays;
pub mod report;
pub mod similarity;
pub mod stability;
pub mod stats;
pub mod table;
pub mod timing;
pub mod writers;
