//! Measurement of the errors, times and memory of shadow methods, as rows of a comparison table.
//!
//! **Errors** are differences in transmittance from the light, `T_method - T_exact`, measured in two places. Along
//! light rays through texel centres they show whether a method satisfies its error bound. [`rays`] picks the texels,
//! [`test_depths`] the depths, and [`bound_check`] compares with the exact curve, widened by the tolerances in
//! transmittance and in depth. `ray_err_max` is the largest difference without tolerances. At points visible to the
//! camera, weighted by visibility, errors show what a user notices ([`stats::ErrorStats`]).
//!
//! The **picture** is compared with the exact one in linear RGBA ([`stats::image_error`]) and by structural
//! similarity ([`similarity::ssim`]). What the shadows alone change is measured at full size against a picture by shadow
//! rays, also by [`flip::flip`]. [`mod@error_map`] has errors pixel by pixel.
//!
//! **Times** are medians of repeats after a warm-up, with minimum and maximum. Methods are timed in turn
//! ([`timing::interleave`]). `build_ms` is the time to build the shadow map, `frame_ms` the time to render one
//! picture with it. The column `clock` names the clock.
//!
//! [`errors`] compares a built shadow map with the exact field. [`mod@compare`] measures the [`Row`](table::Row)s of
//! a scene, one per method and setting. [`mod@ablate`] measures the effect of each renderer optimization. [`budget`]
//! searches settings within limits of memory or time. [`stability`](crate::replication::stability) runs every method
//! on extreme cases. [`light_curve`] follows a single light ray.
//!
//! [`journal`] records measurements on disk at once. [`progress`] reports steps to an observer, which can cancel.
//! [`report`](crate::report) makes tables and figures of the rows.

pub mod ablate;
pub mod bound_check;
pub mod budget;
mod cell;
pub mod certified;
pub mod check;
mod columns;
pub mod compare;
pub mod comparison;
pub mod cylinders;
pub mod defaults;
pub mod enclosure_check;
pub mod error_map;
pub mod errors;
mod exact_rays;
pub mod facts;
mod flicker;
pub mod flip;
mod histogram;
pub mod job;
pub mod journal;
pub mod light_curve;
pub mod map_slices;
pub mod mean_error;
pub mod pareto;
pub mod picture_errors;
pub mod point_bound;
mod point_checks;
pub mod point_report;
pub mod progress;
pub mod random_error;
pub mod rays;
mod reference;
pub mod rounding_envelope;
mod rounds;
pub(crate) mod row_measurements;
mod shadow_error;
pub mod similarity;
pub mod small_scene;
pub mod stats;
mod strand_errors;
pub mod table;
pub mod test_depths;
pub mod timing;
pub mod trial_times;
