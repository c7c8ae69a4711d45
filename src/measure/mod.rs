//! Measurement of errors, times and memory of shadow methods, as rows of a table.
//!
//! Errors are of transmittance from the light, `T_method - T_exact`, and are measured in two places. Along **light rays** through texel centres ([`rays`] picks the texels, [`test_depths`] the
//! depths) they say whether a method satisfies its error bound: [`bound_check`] compares it with the exact curve, widened
//! by the tolerances in transmittance and in depth, and `ray_err_max` is the plain largest difference. At **points
//! that the camera sees**, weighted by visibility, they say what a user notices ([`stats::ErrorStats`]). The
//! **picture** itself is compared with the exact one in linear RGBA ([`stats::image_error`]) and as a viewer sees
//! it ([`similarity::ssim`]); [`mod@error_map`] has errors pixel by pixel.
//!
//! Times are medians of repeats after a warm-up, with smallest and largest beside them, the methods taking
//! turns ([`timing::interleave`]); `build_ms` makes the shadow structure, `frame_ms` one picture with it made,
//! and the column `clock` says whose clock it was.
//!
//! [`errors`] compares a built method with the exact field; [`mod@compare`] makes the
//! [`Row`](table::Row)s of a scene, one a method and setting, and [`mod@ablate`] those of what the plan leaves out;
//! [`budget`] searches settings within so many bytes or milliseconds;
//! [`mod@stability`] takes every method through stiff and extreme cases, and [`light_curve`] follows a single light ray.
//! [`journal`] records measurements on disk at once; [`progress`] reports steps to an observer, which can cancel.
//! Tables and figures of the rows are made by [`report`](crate::report).

pub mod ablate;
pub mod bound_check;
pub mod budget;
mod cell;
pub mod check;
pub mod compare;
pub mod comparison;
pub mod cylinders;
pub mod defaults;
pub mod error_map;
pub mod errors;
pub mod facts;
pub mod job;
pub mod journal;
pub mod light_curve;
pub mod pareto;
pub mod progress;
pub mod rays;
mod reference;
pub mod rounding_envelope;
mod rounds;
mod row_measurements;
pub mod similarity;
pub mod stats;
mod strand_errors;
pub mod table;
pub mod test_depths;
pub mod timing;
