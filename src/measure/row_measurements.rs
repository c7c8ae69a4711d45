//! Copies measured times, errors and counts of GPU work into the columns of a comparison table row.

use super::bound_check::BoundReport;
use super::certified::{Certificate, CertifiedPicture};
use super::check::Check;
use super::point_report::PointReport;
use super::random_error::RandomError;
use super::shadow_error::ShadowError;
use super::stats::{ErrorStats, ImageError};
use super::table::Row;
use super::timing::Timing;
use crate::gpu::Work;
use crate::shadow::{Bound, Method as _, NoShadows};
use ndarray::Array3;

/// Sets the column `frames` of all rows whose scene, adapter and picture size have a row of `none`.
pub fn set_frames<'a>(rows: impl IntoIterator<Item = &'a mut Row>) {
    let mut rows: Vec<&mut Row> = rows.into_iter().collect();
    let is_none = |row: &&&mut Row| row.method == NoShadows.name() && !row.has_failed();
    let of_none: Vec<Row> = rows.iter().filter(is_none).map(|row| (**row).clone()).collect();
    for row in &mut rows {
        if let Some(none) = of_none.iter().find(|none| none.place() == row.place()) {
            row.set_frames(none);
        }
    }
}

fn ends(interval: Option<[f64; 2]>) -> [Option<f64>; 2] {
    interval.map_or([None; 2], |ends| ends.map(Some))
}

impl Row {
    /// Sets the columns of shadow map build times, frame times and frame rates in a comparison table row.
    pub fn set_timing(&mut self, timing: &Timing) {
        let (build, frame) = (timing.build_ms, timing.frame_ms);
        [self.build_ms, self.build_ms_min, self.build_ms_max] =
            [build.median, build.min, build.max].map(Some);
        [self.frame_ms, self.frame_ms_min, self.frame_ms_max] =
            [frame.median, frame.min, frame.max].map(Some);
        [self.build_ms_lo, self.build_ms_hi] = ends(timing.intervals_ms[0]);
        [self.frame_ms_lo, self.frame_ms_hi] = ends(timing.intervals_ms[1]);
        self.clock = Some(timing.clock);
        [self.build_host_ms, self.frame_host_ms] = [timing.build_host_ms, timing.frame_host_ms].map(Some);
        [self.build_gpu_ms, self.frame_gpu_ms] = [timing.build_gpu_ms, timing.frame_gpu_ms];
        [self.build_wall_ms, self.frame_wall_ms] = [timing.build_wall_ms, timing.frame_wall_ms].map(Some);
        self.gpu_mhz = timing.gpu_mhz;
        self.repeats = u32::try_from(timing.repeats).ok();
        self.fps_static = Some(1000.0 / frame.median);
        self.fps_moving = Some(1000.0 / (build.median + frame.median));
        let variance = self.point_variance.filter(|variance| *variance > 0.0);
        self.efficiency = variance.map(|variance| 1000.0 / (variance * frame.median));
    }

    /// Sets the column `frames` from the row of `none` in the same scene. Both times are of the same clock.
    pub fn set_frames(&mut self, none: &Self) {
        let is_same = self.clock == none.clock;
        let wall_ms = |row: &Self| Some(row.build_wall_ms.unwrap_or(0.0) + row.frame_wall_ms?);
        let ms = |row: &Self| if is_same { row.moving_ms() } else { wall_ms(row) };
        self.frames = ms(self).zip(ms(none)).map(|(ms, of_none)| ms / of_none);
    }

    /// Adds a note if device times of repeated runs did not agree.
    pub fn note_unsteady(&mut self, timing: &Timing) {
        if timing.unsteady > 0 {
            let note =
                format!("{} of {} timed runs were not steady within 5 %", timing.unsteady, timing.repeats);
            self.add_note(&note);
        }
    }

    /// Sets the comparison table columns `point_err_*`, the transmittance errors at points visible to the camera.
    pub fn set_point_errors(&mut self, stats: &ErrorStats) {
        [self.point_err_max, self.point_err_rms, self.point_err_p99] =
            [stats.max_abs, stats.rms, stats.p99_abs].map(Some);
        self.point_err_mean_signed = Some(stats.mean);
        [self.point_err_rms_lo, self.point_err_rms_hi] = ends(stats.rms_interval);
    }

    /// Sets the comparison table columns `point_bias`, `point_bias_se` and `point_variance` of a shadow method with random results.
    pub(super) fn set_random_error(&mut self, error: &RandomError) {
        [self.point_bias, self.point_bias_se, self.point_variance] =
            [error.bias, error.bias_se, error.variance].map(Some);
    }

    /// Sets the comparison table columns `image_rmse` and `image_psnr`, the errors of the rendered picture.
    pub fn set_image_error(&mut self, error: &ImageError) {
        [self.image_rmse, self.image_psnr] = [error.rmse, error.psnr_db].map(Some);
    }

    /// Sets the comparison table columns `shadow_*` and `flip`, the errors of the rendered picture that the shadows
    /// alone cause.
    pub(super) fn set_shadow_error(&mut self, error: &ShadowError) {
        [self.shadow_rmse, self.shadow_psnr] = [error.image.rmse, error.image.psnr_db].map(Some);
        [self.shadow_ssim, self.flip] = [error.ssim, error.flip];
    }

    /// Sets the comparison table columns of transmittance errors along light rays: `ray_err_max`, `bound*`,
    /// `rays_tested` and `depths_tested`.
    pub fn set_ray_errors(&mut self, report: &BoundReport, bound: Option<Bound>) {
        [self.ray_err_max, self.ray_err_p999] = [report.ray_err_max(), report.ray_err_p999()];
        self.bound = bound.map(|p| p.transmittance);
        self.bound_depth_mm = bound.map(|p| p.depth_mm);
        self.bound_lateral_mm = bound.map(|p| p.lateral_mm);
        self.bound_value = bound.map(|p| p.value);
        self.bound_limited = bound.map(|_| report.limited as u64);
        self.bound_held = report.satisfied();
        self.rays_tested = Some(report.rays as u64);
        self.depths_tested = Some(report.depths as u64);
    }

    /// Sets the comparison table columns `point_bound_*`: the error bound at points between the light rays of texels.
    pub fn set_point_bound(&mut self, report: &PointReport, bound: Option<Bound>) {
        self.point_bound_lateral_mm = bound.map(|p| p.reach_mm);
        self.point_bound_depth_mm = bound.map(|p| p.depth_mm + p.align_mm);
        self.point_bound_held = bound.and_then(|_| report.satisfied());
        self.point_bound_n = bound.map(|_| report.points as u64);
        self.point_bound_limited = bound.map(|_| report.limited as u64);
    }

    /// Sets the comparison table columns `enclosure_*` except the memory: the widths of the enclosures at points visible
    /// to the camera, and whether they contain the exact transmittance.
    pub fn set_enclosure(&mut self, widths: &ErrorStats, report: &PointReport) {
        [self.enclosure_width, self.enclosure_width_max] = [widths.mean, widths.max_abs].map(Some);
        self.enclosure_held = report.satisfied();
        self.enclosure_n = Some(report.points as u64);
        self.enclosure_limited = Some(report.limited as u64);
    }

    /// Sets the comparison table columns `certified_*`: the bounds on the errors of the pixels of a certified picture.
    pub fn set_certified(&mut self, picture: &CertifiedPicture, exact: &Array3<f32>) {
        let Certificate { largest, mean, share_of_rays } = picture.certificate();
        [self.certified_err, self.certified_err_mean, self.certified_rays] =
            [largest, mean, share_of_rays].map(Some);
        self.certified_held = Some(picture.excess(exact) <= 0.0);
    }

    /// Sets the comparison table columns `work_*`, the counts of GPU operations: per texel for building a shadow map,
    /// and per pixel for rendering a picture.
    pub fn set_work(&mut self, (build, texels): (Work, u64), (picture, pixels): (Work, u64)) {
        let each = |work: u64, of: u64| (of > 0).then_some(work as f64 / of as f64);
        self.work_samples = each(picture.samples, pixels);
        self.work_lookups = each(picture.lookups, pixels);
        self.work_loads = each(picture.loads, pixels);
        self.work_cells = each(build.cells + build.samples, texels);
        self.work_pieces = each(build.pieces, texels);
        self.work_divergence_build = build.divergence();
        self.work_longest_build = build.divergence().map(|_| build.longest_ray);
    }

    /// Sets the comparison table columns of the divergence of eye rays, from counts of a picture of the full size.
    pub fn set_frame_divergence(&mut self, picture: Work) {
        self.work_divergence_frame = picture.divergence();
        self.work_longest_frame = picture.divergence().map(|_| picture.longest_ray);
    }

    /// Sets the comparison table columns `check_*`, the differences in transmittance between marching light rays by
    /// samples and by cells.
    pub fn set_check(&mut self, check: &Check) {
        self.check_n = Some(check.texels);
        [self.check_max, self.check_tolerance] = [check.max, check.tolerance].map(Some);
        self.check_ok = Some(check.ok());
    }
}
