//! Rows and columns of the comparison table (`compare.csv`): one row per shadow method and setting.

pub use super::cell::Cell;
use super::cell::FromText;
use super::columns::columns;
use super::defaults::setting_columns;
use crate::gpu::Clock;
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::LazyLock;

/// Column of the comparison table: name, unit and description.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name of the comparison table column, as in the CSV header.
    pub name: &'static str,
    /// Unit of the numbers in the comparison table column. Empty for numbers without a unit.
    pub unit: &'static str,
    /// One-line description of the comparison table column.
    pub about: String,
}

columns! {
    /// Name of the scene: volume and transfer function, or the scene file.
    scene [""]: String,
    /// Name of the graphics adapter on which the times were measured.
    adapter [""]: String,
    /// Name of the shadow method.
    method [""]: String,
    /// Settings of the shadow method as `key=value` texts separated by spaces: its main ones, such as `epsilon`, and
    /// those that differ from their defaults. The map size has its own column.
    params [""]: String,
    /// Paper of the shadow method, in the row with the settings that this paper states. Empty for other rows.
    published [""]: String,
    /// Number of texels per side of the shadow map.
    map ["texels"]: Option<u32>,
    /// Width of the rendered picture, in pixels.
    width ["pixels"]: u32,
    /// Height of the rendered picture, in pixels.
    height ["pixels"]: u32,
    /// Time to build the shadow map after the light has moved, median of the repeats. It includes work on host and
    /// device, repeated passes, and automatic choices such as the spacing of layers.
    build_ms ["ms"]: Option<f64>,
    /// Build time of the shadow map (`build_ms`) in the fastest repeat.
    build_ms_min ["ms"]: Option<f64>,
    /// Build time of the shadow map (`build_ms`) in the slowest repeat.
    build_ms_max ["ms"]: Option<f64>,
    /// Time to render one picture with the shadow map already built, median of the repeats.
    frame_ms ["ms"]: Option<f64>,
    /// Time to render one picture (`frame_ms`) in the fastest repeat.
    frame_ms_min ["ms"]: Option<f64>,
    /// Time to render one picture (`frame_ms`) in the slowest repeat.
    frame_ms_max ["ms"]: Option<f64>,
    /// Clock of `build_ms` and `frame_ms`: `gpu` (timestamps of the adapter) or `wall` (the host's clock).
    clock [""]: Option<Clock>,
    /// Clock rate of the graphics card before the timed runs, while it is kept busy, median, as the system reports it.
    /// Empty for software adapters, and where the system reports none.
    gpu_mhz ["MHz"]: Option<f64>,
    /// Lower end of the 95 % interval of `build_ms`, from the order of the repeats. Empty with fewer than six repeats.
    build_ms_lo ["ms"]: Option<f64>,
    /// Upper end of the 95 % interval of `build_ms`.
    build_ms_hi ["ms"]: Option<f64>,
    /// Lower end of the 95 % interval of `frame_ms`, from the order of the repeats. Empty with fewer than six repeats.
    frame_ms_lo ["ms"]: Option<f64>,
    /// Upper end of the 95 % interval of `frame_ms`.
    frame_ms_hi ["ms"]: Option<f64>,
    /// Time of the first build of the shadow map, by the host's clock, with the compilation of new shaders.
    build_first_ms ["ms"]: Option<f64>,
    /// Part of `build_ms` outside the GPU passes: fitting the map, listing its tiles, buffers and read-backs.
    build_host_ms ["ms"]: Option<f64>,
    /// Part of `build_ms` that the GPU passes take, by the adapter's timestamps. Empty for an adapter without
    /// timestamps or a method without GPU passes.
    build_gpu_ms ["ms"]: Option<f64>,
    /// Time from requesting the shadow map to its completion, by the host's clock.
    build_wall_ms ["ms"]: Option<f64>,
    /// Part of `frame_ms` that the host takes: it finds the tiles of the picture to render, and their depths.
    frame_host_ms ["ms"]: Option<f64>,
    /// Time to render one picture by the adapter's timestamps, plus the host's time to find the tiles to render.
    /// Empty for an adapter without timestamps.
    frame_gpu_ms ["ms"]: Option<f64>,
    /// Time from submitting a picture to its completion, by the host's clock. It includes the passes that find the
    /// tiles to render.
    frame_wall_ms ["ms"]: Option<f64>,
    /// Time to classify the bricks of the volume again after an edit of the transfer function, by the host's clock.
    bricks_ms ["ms"]: Option<f64>,
    /// Time to compute the transfer function's lookup tables again after an edit, by the host's clock.
    tables_ms ["ms"]: Option<f64>,
    /// Number of timed runs of the shadow method, from which the median times are taken.
    repeats [""]: Option<u32>,
    /// Pictures per second while the light does not move: `1000 / frame_ms`.
    fps_static ["1/s"]: Option<f64>,
    /// Pictures per second while the light moves, so that the shadow map is rebuilt for each: `1000 / (build_ms +
    /// frame_ms)`.
    fps_moving ["1/s"]: Option<f64>,
    /// Time of a picture while the light moves, in frames without shadows: `build_ms + frame_ms` divided by that of `none`
    /// in the same scene. Empty without a row of `none`.
    frames [""]: Option<f64>,
    /// Memory allocated for the shadow map, in bytes.
    bytes [""]: Option<u64>,
    /// Memory of the shadow map that queries for transmittance can access, in bytes.
    bytes_used [""]: Option<u64>,
    /// Memory that only the build of the shadow map needs, in bytes, for methods that free it afterwards. A buffer that
    /// grows during the build counts once.
    build_bytes [""]: Option<u64>,
    /// Number of transmittance curve nodes stored in the shadow map, for methods that store nodes.
    nodes_total [""]: Option<u64>,
    /// Largest number of transmittance curve nodes in any texel of the shadow map.
    nodes_max [""]: Option<u64>,
    /// Largest `|T_method - T_exact|` at depths along light rays through texel centres (T: transmittance, 0 to 1).
    ray_err_max [""]: Option<f64>,
    /// 99.9th percentile of `|T_method - T_exact|` over the tested depths along light rays, to 1 %. A larger sample
    /// changes it less than the maximum.
    ray_err_p999 [""]: Option<f64>,
    /// Largest transmittance error `|T_method - T_exact|` at points visible to the camera.
    point_err_max [""]: Option<f64>,
    /// Root mean square of the transmittance error `T_method - T_exact` at points visible to the camera, weighted by
    /// visibility.
    point_err_rms [""]: Option<f64>,
    /// Lower end of the 95 % interval of `point_err_rms` by a bootstrap over the points. All rows of a scene resample the
    /// points alike. Empty with fewer than 30 points.
    point_err_rms_lo [""]: Option<f64>,
    /// Upper end of the 95 % interval of `point_err_rms`.
    point_err_rms_hi [""]: Option<f64>,
    /// 99th percentile of the transmittance error `|T_method - T_exact|` at points visible to the camera, weighted by
    /// visibility.
    point_err_p99 [""]: Option<f64>,
    /// Mean of the transmittance error `T_method - T_exact` at points visible to the camera, weighted by visibility.
    /// Negative where the method is too dark.
    point_err_mean_signed [""]: Option<f64>,
    /// Mean of the error `T_method - T_exact` of a random method, at points visible to the camera and over 32 seeds,
    /// weighted by visibility. Empty for other methods.
    point_bias [""]: Option<f64>,
    /// Standard error of `point_bias`, from the means of the seeds.
    point_bias_se [""]: Option<f64>,
    /// Variance of the transmittance of a random method at a point, over 32 seeds: mean over points visible to the camera,
    /// weighted by visibility.
    point_variance [""]: Option<f64>,
    /// Efficiency of a random method: `1000 / (point_variance * frame_ms)`. Empty without variance.
    efficiency ["1/s"]: Option<f64>,
    /// Root mean square transmittance error against the strands as cylinders, not the voxel field, at points visible
    /// to the camera. Empty for volumes without strands.
    strand_err_rms [""]: Option<f64>,
    /// Root mean square difference between the method's picture and the exact picture, over all channels of linear
    /// RGBA. Both pictures have about 1,500 pixels.
    image_rmse [""]: Option<f64>,
    /// Peak signal-to-noise ratio of the method's picture against the exact picture, for a peak of 1. Both have about
    /// 1,500 pixels; infinite for identical pictures.
    image_psnr ["dB"]: Option<f64>,
    /// Mean structural similarity (SSIM) of the method's picture and the exact picture, of sRGB-encoded channels.
    /// Both have about 1,500 pixels; 1 for identical pictures.
    image_ssim [""]: Option<f64>,
    /// Root mean square difference between the method's picture and one by shadow rays with the same integration along eye
    /// rays, over all channels of linear RGBA, at full size: the error that the shadows alone cause.
    shadow_rmse [""]: Option<f64>,
    /// Peak signal-to-noise ratio of the method's picture against that by shadow rays, for a peak of 1; infinite for
    /// identical pictures.
    shadow_psnr ["dB"]: Option<f64>,
    /// Mean structural similarity (SSIM) of the method's picture and that by shadow rays, of sRGB-encoded channels; 1 for
    /// identical pictures.
    shadow_ssim [""]: Option<f64>,
    /// Mean FLIP of the method's picture against that by shadow rays, as a display of 8 bits shows them: 0 for pictures that
    /// look the same, at most 1.
    flip [""]: Option<f64>,
    /// Flicker while the light turns about the volume in steps of 0.1 degrees (`--flicker`): root mean square, over points
    /// visible to the camera, of the standard deviation of `T_method - T_exact` at a point over the steps.
    flicker_rms [""]: Option<f64>,
    /// Flicker while the camera turns about its target in steps of 0.1 degrees (`--flicker`), at points that stay in the
    /// picture; otherwise like `flicker_rms`.
    flicker_camera_rms [""]: Option<f64>,
    /// Upper bound, at 99 % confidence, on the mean error of the picture's shadows: the mean over pixels of
    /// `sum over lights of (1 - ambient) light integral(T_eye sigma |T_method - T_exact| dt)`. From 10,000 random points;
    /// no assumption about the errors.
    image_mean_err_bound [""]: Option<f64>,
    /// Estimated error of the exact picture: largest change of a colour channel under finer integration.
    image_exact_err [""]: Option<f64>,
    /// Error bound that the shadow method states along light rays: tolerance in transmittance. Empty for methods
    /// without a bound.
    bound [""]: Option<f64>,
    /// Error bound that the shadow method states along light rays: tolerance in depth along the ray.
    bound_depth_mm ["mm"]: Option<f64>,
    /// Error bound that the shadow method states along light rays: tolerance in lateral position, because float32
    /// cannot locate the ray more exactly.
    bound_lateral_mm ["mm"]: Option<f64>,
    /// Error bound that the shadow method states along light rays: tolerance in the scalar values of the volume.
    bound_value [""]: Option<f64>,
    /// Number of depths on light rays at which the error bound is satisfied only by its tolerances in lateral
    /// position and scalar value.
    bound_limited [""]: Option<u64>,
    /// Whether the shadow method's error bound is satisfied at every tested depth on the light rays. Empty for
    /// methods without a bound.
    bound_held [""]: Option<bool>,
    /// Error bound of the shadow method at points between the light rays of texels: distance from a point to the light
    /// rays whose exact transmittances, widened by `bound` and `point_bound_depth_mm`, enclose the method's result.
    point_bound_lateral_mm ["mm"]: Option<f64>,
    /// Error bound of the shadow method at points between the light rays of texels: tolerance in depth.
    point_bound_depth_mm ["mm"]: Option<f64>,
    /// Whether the method's transmittance lies within the error bound of the texels around the point, at every tested
    /// point. Empty for methods without a bound.
    point_bound_held [""]: Option<bool>,
    /// Number of points between the light rays of texels at which the error bound was tested.
    point_bound_n [""]: Option<u64>,
    /// Number of points at which the error bound is satisfied only by its tolerances in lateral position and scalar
    /// value.
    point_bound_limited [""]: Option<u64>,
    /// Mean width `U - L` of the enclosure of the exact transmittance (`enclose=on`) at points visible to the camera,
    /// weighted by visibility.
    enclosure_width [""]: Option<f64>,
    /// Largest width `U - L` of the enclosure of the exact transmittance at points visible to the camera.
    enclosure_width_max [""]: Option<f64>,
    /// Whether `L <= T_exact <= U` at every tested point. Empty without `enclose=on`.
    enclosure_held [""]: Option<bool>,
    /// Number of points at which `L <= T_exact <= U` was tested.
    enclosure_n [""]: Option<u64>,
    /// Number of points at which the enclosure contains the exact transmittance only if float32 rounding of the light
    /// rays and of the volume's values is allowed for.
    enclosure_limited [""]: Option<u64>,
    /// Largest bound on the error of a pixel, partly estimated, in the certified picture of the size of `image_rmse` with
    /// ETA 0.03 (`render --certify 0.03`).
    certified_err [""]: Option<f64>,
    /// Mean bound on the error of a pixel in the certified picture.
    certified_err_mean [""]: Option<f64>,
    /// Whether the errors of all pixels of the certified picture against the exact one are within their bounds.
    certified_held [""]: Option<bool>,
    /// Share of the lookups of light in the certified picture that shadow rays answered.
    certified_rays [""]: Option<f64>,
    /// Memory of the enclosing curves, which pictures do not read.
    enclosure_bytes ["bytes"]: Option<u64>,
    /// Number of shadow map texels at which marching light rays by regular samples was compared with marching cell by
    /// cell. Empty for methods that march by cells.
    check_n [""]: Option<u64>,
    /// Smallest tolerance in transmittance within which marching by samples agrees with marching by cells at all
    /// compared texels. Curves may be displaced by one step in depth.
    check_max [""]: Option<f64>,
    /// Largest difference in transmittance allowed between marching light rays by samples and by cells: 0.1, or twice
    /// the method's error bound where that is larger.
    check_tolerance [""]: Option<f64>,
    /// Whether marching by samples and by cells agree within `check_tolerance` at all compared texels, at 24 random
    /// depths each. If so, with 99 % confidence, they disagree in such a test at fewer than `4.6 / check_n` of all
    /// texels with extinction.
    check_ok [""]: Option<bool>,
    /// GPU work to render the picture of `image_rmse`: number of filtered samples of the volume, per pixel.
    work_samples [""]: Option<f64>,
    /// GPU work to render a picture: number of queries for the transmittance from the light at a point, per pixel.
    work_lookups [""]: Option<f64>,
    /// GPU work to render a picture: number of texture reads of all kinds, per pixel.
    work_loads [""]: Option<f64>,
    /// GPU work to build a shadow map: number of volume cells (or samples with `march=samples`) along light rays, per
    /// texel of the map's built tiles. Searches for the spacing of layers are included.
    work_cells [""]: Option<f64>,
    /// GPU work to build a shadow map: number of intervals of light rays whose optical depth was integrated, per
    /// texel of the map's built tiles.
    work_pieces [""]: Option<f64>,
    /// Divergence of the march that builds a shadow map: share of steps for which a lane of a subgroup would be idle,
    /// if each block of 8 x 4 texels took as many steps as its longest light ray. Empty without a map.
    work_divergence_build [""]: Option<f64>,
    /// Largest number of steps of a light ray in the march that builds a shadow map.
    work_longest_build [""]: Option<u64>,
    /// Divergence of the march along eye rays: share of steps for which a lane of a subgroup would be idle, if each
    /// block of 8 x 4 pixels took as many steps as its longest eye ray. Light rays that a query marches are included.
    work_divergence_frame [""]: Option<f64>,
    /// Largest number of steps of an eye ray in the picture, with those of the light rays that its queries march.
    work_longest_frame [""]: Option<u64>,
    /// Number of light rays along which the shadow method's transmittance was tested.
    rays_tested [""]: Option<u64>,
    /// Number of depths on light rays at which the shadow method's transmittance was tested, including depths of
    /// curve nodes.
    depths_tested [""]: Option<u64>,
    /// Whether no other row of the scene is both faster (`fps_moving`) and more accurate (`point_err_rms`).
    pareto [""]: Option<bool>,
    /// Whether a search within a memory or time budget chose the method's settings. Empty where there was no search.
    tuned [""]: Option<bool>,
    /// Memory or time budgets, each with the minimized error, for which a search chose the method's settings.
    tuned_for [""]: String,
    /// Rendering work that the renderer skipped because the scene does not need it, with the reason and the saving.
    left_out [""]: String,
    /// Number of lights with nonzero intensity. Times, bytes and errors apply to all of them together.
    lights [""]: Option<u32>,
    /// Index, from 1, of the only light of the row (`--each-light`). Empty for a row with all lights.
    light [""]: Option<u32>,
    /// Driver of the graphics adapter, with its version.
    driver [""]: String,
    /// Number of CPU threads that the program used for parallel work.
    threads [""]: Option<u32>,
    /// Build profile of this program: `release` or `debug`.
    profile [""]: String,
    /// Version of this program (umbravox).
    version [""]: String,
    /// Git commit that this program was built from.
    revision [""]: String,
    /// Status of the method's measurement: `ok` or `failed`.
    status [""]: String,
    /// Error message of a failed measurement, or remarks for the reader of the table row.
    note [""]: String,
}

/// Serializes a comparison table row as a JSON object with one key per column.
impl Serialize for Row {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(COLUMNS.len()))?;
        for (column, cell) in COLUMNS.iter().zip(self.cells()) {
            map.serialize_entry(column.name, &cell)?;
        }
        map.end()
    }
}

/// Value of the comparison table column `status` for a shadow method that was measured.
pub const OK: &str = "ok";
/// Value of the comparison table column `status` for a shadow method that failed.
pub const FAILED: &str = "failed";

impl Row {
    /// Marks a comparison table row as failed and adds the error to its note. Values measured before are retained.
    pub fn set_failed(&mut self, why: &dyn fmt::Display) {
        self.status = FAILED.into();
        self.add_note(why);
    }

    /// Appends a text to the note of a comparison table row, after a semicolon.
    pub fn add_note(&mut self, note: &dyn fmt::Display) {
        let before = if self.note.is_empty() { String::new() } else { format!("{}; ", self.note) };
        self.note = format!("{before}{note}");
    }

    /// Returns the shadow method of a comparison table row with its settings as `METHOD[:key=value,...]`, the syntax
    /// of [`crate::shadow::parse`].
    pub fn spec(&self) -> String {
        let map = self.map.map_or(String::new(), |map| format!("map={map}"));
        let settings: Vec<_> =
            [self.params.replace(' ', ","), map].into_iter().filter(|s| !s.is_empty()).collect();
        let colon = if settings.is_empty() { "" } else { ":" };
        format!("{}{colon}{}", self.method, settings.join(","))
    }

    /// Returns the value of a comparison table row in the column of a given name; an empty cell for an unknown name.
    pub fn cell(&self, column: &str) -> Cell {
        let place = COLUMNS.iter().position(|c| c.name == column);
        place.map_or(Cell::Empty, |i| self.cells().swap_remove(i))
    }

    /// Returns the value of one setting of the comparison table row's shadow method, by its name; an empty cell where
    /// the method has no such setting.
    pub fn setting(&self, key: &str) -> Cell {
        self.settings.iter().find(|(k, _)| *k == key).map_or(Cell::Empty, |(_, value)| value.clone())
    }

    /// Returns scene and adapter of a comparison table row. Rows with equal pairs share scale, figure and Pareto
    /// front.
    pub fn group(&self) -> (&str, &str) {
        (&self.scene, &self.adapter)
    }

    /// Returns scene, adapter and picture size of a table row. Only rows with equal values are compared.
    pub fn place(&self) -> (&str, &str, u32, u32) {
        (&self.scene, &self.adapter, self.width, self.height)
    }

    /// Whether the measurement of this table row's shadow method failed.
    pub fn has_failed(&self) -> bool {
        self.status == FAILED
    }

    /// Returns the nonempty cells of a comparison table row as texts, by column name; see [`Self::from_texts`].
    pub fn texts(&self) -> BTreeMap<String, String> {
        let texts =
            COLUMNS.iter().zip(self.cells()).map(|(column, cell)| (column.name.into(), cell.to_string()));
        texts.filter(|(_, text): &(_, String)| !text.is_empty()).collect()
    }

    /// Returns the median time of a picture while the light moves, `build_ms + frame_ms` (ms). A missing `build_ms`
    /// counts as 0.
    pub fn moving_ms(&self) -> Option<f64> {
        self.frame_ms.map(|frame| self.build_ms.unwrap_or(0.0) + frame)
    }
}

#[cfg(test)]
pub(crate) mod tests;
