//! The rows that `compare` makes, and their Pareto front.

use super::band::{Band, BandReport};
pub use super::cell::Cell;
use super::cell::FromText;
use super::stats::{ErrorStats, ImageError};
use super::timing::{ClockSource, Timing};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// One list gives the fields, the columns and their order.
macro_rules! columns {
    ($($(#[$doc:meta])* $name:ident: $t:ty,)*) => {
        /// One method and setting. The fields are the columns, in the order in which every writer puts them:
        /// each main one with what belongs to it right after it, and last on what and by what the row was measured.
        #[derive(Debug, Clone, PartialEq, Default, Serialize)]
        pub struct Row {
            $($(#[$doc])* pub $name: $t,)*
        }

        /// Column names, in order.
        pub const COLUMNS: &[&str] = &[$(stringify!($name)),*];

        impl Row {
            /// The row's values, one a column of [`COLUMNS`].
            pub fn cells(&self) -> Vec<Cell> {
                vec![$(self.$name.clone().into()),*]
            }

            /// The row whose cells, written as text, are these by their columns; a missing one is empty.
            ///
            /// # Errors
            /// The first column whose text is no value of it.
            pub fn from_texts(texts: &BTreeMap<String, String>) -> Result<Self, &'static str> {
                let text = |column: &str| texts.get(column).map_or("", String::as_str);
                Ok(Self { $($name: FromText::from_text(text(stringify!($name))).ok_or(stringify!($name))?,)* })
            }
        }
    };
}

columns! {
    /// Volume and transfer function.
    scene: String,
    /// Name of the adapter that the times are from.
    adapter: String,
    method: String,
    /// `key=value` texts separated by spaces.
    params: String,
    /// Texels a side of the shadow map.
    map: Option<u32>,
    /// Picture size in pixels.
    width: u32,
    height: u32,
    /// Median time to make the shadow structure.
    build_ms: Option<f64>,
    build_ms_min: Option<f64>,
    build_ms_max: Option<f64>,
    /// Median time of one picture with the structure made.
    frame_ms: Option<f64>,
    frame_ms_min: Option<f64>,
    frame_ms_max: Option<f64>,
    /// Whose clock these times are from.
    clock: Option<ClockSource>,
    /// The device's part of `build_ms`, and `frame_ms`, by the GPU's timestamps; empty where the adapter has none.
    build_gpu_ms: Option<f64>,
    /// By the host's clock: from asking for the structure to having it, and from submitting a picture's work to its end.
    build_wall_ms: Option<f64>,
    frame_gpu_ms: Option<f64>,
    frame_wall_ms: Option<f64>,
    /// Median host times of what a transfer-function edit makes anew: classes of bricks, tables.
    bricks_ms: Option<f64>,
    tables_ms: Option<f64>,
    /// Timed rounds that the medians are of.
    repeats: Option<u32>,
    /// `1000 / frame_ms`: the light stands still.
    fps_static: Option<f64>,
    /// `1000 / (build_ms + frame_ms)`: the light moves.
    fps_moving: Option<f64>,
    /// Memory of the shadow structure.
    bytes: Option<u64>,
    /// Nodes in all, and in the fullest texel, where the method has nodes.
    nodes_total: Option<u64>,
    nodes_max: Option<u64>,
    /// Largest `|T_method - T_exact|` along light rays.
    ray_err_max: Option<f64>,
    /// `|T_method - T_exact|` at points that the camera sees, weighted as it sees them.
    point_err_max: Option<f64>,
    point_err_rms: Option<f64>,
    point_err_p99: Option<f64>,
    /// Weighted mean of `T_method - T_exact`: negative where the method is too dark.
    point_err_mean_signed: Option<f64>,
    /// Against the exact picture, linear RGBA.
    image_rmse: Option<f64>,
    /// Peak 1, in dB; infinite for identical pictures.
    image_psnr: Option<f64>,
    /// Mean structural similarity of the sRGB-encoded pictures, 1 for identical ones.
    image_ssim: Option<f64>,
    /// How far the exact picture itself may be off: the largest change of a channel, linear, when it is made finer.
    image_exact_err: Option<f64>,
    /// What the method promises on light rays: tolerance in transmittance, and in depth (mm).
    bound: Option<f64>,
    bound_depth_mm: Option<f64>,
    /// Whether it held at every depth tested; empty where nothing is promised.
    bound_held: Option<bool>,
    /// Whether no other row is at once faster and closer, see [`mark_pareto`].
    pareto: Option<bool>,
    /// What the plan left out, and what that saved.
    left_out: String,
    /// The adapter's driver with its version.
    driver: String,
    /// Threads of the host's parallel work.
    threads: Option<u32>,
    /// `release` or `debug`.
    profile: String,
    /// Of this program, and the commit that it was built from.
    version: String,
    revision: String,
    /// `ok` or `failed`.
    status: String,
    /// Why it failed, or what else a reader of the row should know.
    note: String,
}

/// The column `status`.
pub const OK: &str = "ok";
pub const FAILED: &str = "failed";

impl Row {
    /// Fills the times and the frame rates that follow from them.
    pub fn set_timing(&mut self, timing: &Timing) {
        let (build, frame) = (timing.build_ms, timing.frame_ms);
        [self.build_ms, self.build_ms_min, self.build_ms_max] =
            [build.median, build.min, build.max].map(Some);
        [self.frame_ms, self.frame_ms_min, self.frame_ms_max] =
            [frame.median, frame.min, frame.max].map(Some);
        self.clock = Some(timing.clock);
        [self.build_gpu_ms, self.frame_gpu_ms] = [timing.build_gpu_ms, timing.frame_gpu_ms];
        [self.build_wall_ms, self.frame_wall_ms] = [timing.build_wall_ms, timing.frame_wall_ms].map(Some);
        self.repeats = u32::try_from(timing.repeats).ok();
        self.fps_static = Some(1000.0 / frame.median);
        self.fps_moving = Some(1000.0 / (build.median + frame.median));
    }

    /// Fills `point_err_*`.
    pub fn set_point_errors(&mut self, stats: &ErrorStats) {
        [self.point_err_max, self.point_err_rms, self.point_err_p99] =
            [stats.max_abs, stats.rms, stats.p99_abs].map(Some);
        self.point_err_mean_signed = Some(stats.mean);
    }

    /// Fills `image_rmse` and `image_psnr`.
    pub fn set_image_error(&mut self, error: &ImageError) {
        [self.image_rmse, self.image_psnr] = [error.rmse, error.psnr_db].map(Some);
    }

    /// Says that the row failed, and why; what was measured before stays.
    pub fn set_failed(&mut self, why: &dyn fmt::Display) {
        self.status = FAILED.into();
        self.add_note(why);
    }

    /// Adds to `note`.
    pub fn add_note(&mut self, note: &dyn fmt::Display) {
        let before = if self.note.is_empty() { String::new() } else { format!("{}; ", self.note) };
        self.note = format!("{before}{note}");
    }

    /// `METHOD[:key=value,...]` that the row is of, as [`crate::shadow::parse`] takes it.
    pub fn spec(&self) -> String {
        let map = self.map.map(|map| format!("map={map}"));
        let settings: Vec<_> = self.params.split_whitespace().map(String::from).chain(map).collect();
        let colon = if settings.is_empty() { "" } else { ":" };
        format!("{}{colon}{}", self.method, settings.join(","))
    }

    /// Whether the row is not what was asked for.
    pub fn has_failed(&self) -> bool {
        self.status == FAILED
    }

    /// The cells that are not empty, as text, by their columns; [`Self::from_texts`] reads them back.
    pub fn texts(&self) -> BTreeMap<String, String> {
        let texts =
            COLUMNS.iter().zip(self.cells()).map(|(column, cell)| (column.to_string(), cell.to_string()));
        texts.filter(|(_, text)| !text.is_empty()).collect()
    }

    /// Fills `ray_err_max`, `bound`, `bound_depth_mm` and `bound_held`.
    pub fn set_ray_errors(&mut self, report: &BandReport, promise: Option<Band>) {
        self.ray_err_max = report.ray_err_max();
        self.bound = promise.map(|p| p.bound);
        self.bound_depth_mm = promise.map(|p| p.depth_mm);
        self.bound_held = report.held();
    }

    /// Median time with the light moving, `build_ms + frame_ms`; a missing `build_ms` counts as 0.
    pub fn moving_ms(&self) -> Option<f64> {
        self.frame_ms.map(|frame| self.build_ms.unwrap_or(0.0) + frame)
    }
}

/// Fills `pareto`: a row is on the front unless another of the same scene, adapter and picture size is at once
/// faster (greater `fps_moving`) and closer (smaller `point_err_rms`).
///
/// Both are strict: of two equally fast rows, or two equally close ones, neither puts the other off the front.
/// Rows that lack either figure (or hold NaN) get no answer and put nobody off.
pub fn mark_pareto(rows: &mut [Row]) {
    let place = |row: &Row| (row.scene.clone(), row.adapter.clone(), row.width, row.height);
    let points: Vec<_> = rows
        .iter()
        .map(|row| {
            let (fps, error) = (row.fps_moving?, row.point_err_rms?);
            (!fps.is_nan() && !error.is_nan()).then(|| (place(row), fps, error))
        })
        .collect();
    for (row, point) in rows.iter_mut().zip(&points) {
        row.pareto = point.as_ref().map(|(here, fps, error)| {
            !points.iter().flatten().any(|(there, other_fps, other_error)| {
                here == there && other_fps > fps && other_error < error
            })
        });
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::measure::stats::Spread;
    use crate::shadow::{parse, parse_list};

    /// Rows as `compare` would make them, every kind of cell among them.
    pub(crate) fn sample_rows() -> Vec<Row> {
        let row = |method: &str, params: &str, build: f64, frame: f64, error: f64| {
            let mut row = Row {
                scene: "CT_AVM vessels".into(),
                adapter: "llvmpipe (LLVM 19.1, 256 bits)".into(),
                method: method.into(),
                params: params.into(),
                width: 512,
                height: 512,
                ..Row::default()
            };
            let spread = |ms: f64| Spread { median: ms, min: 0.9 * ms, max: 1.25 * ms };
            let timing = Timing {
                build_ms: spread(build),
                frame_ms: spread(frame),
                clock: ClockSource::Wall,
                build_gpu_ms: None,
                build_wall_ms: build,
                frame_gpu_ms: None,
                frame_wall_ms: frame,
                repeats: 5,
            };
            row.set_timing(&timing);
            row.point_err_rms = Some(error);
            row
        };
        let mut rows = vec![
            row("none", "", 0.0, 80.0, 0.5),
            row("rays", "", 0.0, 1500.0, 0.0),
            row("dsm", "epsilon=0.06 prefilter=1", 60.0, 85.0, 0.01),
            row("dsm", "epsilon=0.005 prefilter=1", 70.0, 90.0, 0.001),
            row("osm", "layers=8 slicing=uniform", 70.0, 90.0, 0.05),
        ];
        rows[1].image_psnr = Some(f64::INFINITY);
        rows[2].set_ray_errors(
            &BandReport::of_ray(0, &|_: f64| 1.0, &[0.0], &[0.95], Some(Band { bound: 0.06, depth_mm: 0.1 })),
            Some(Band { bound: 0.06, depth_mm: 0.1 }),
        );
        rows[2].map = Some(512);
        rows[2].bytes = Some(3_355_443);
        rows[2].nodes_total = Some(1_234_567);
        rows[2].left_out = "gradients, \"shading none\"; 12 bricks | 3 MiB".into();
        mark_pareto(&mut rows);
        rows
    }

    #[test]
    fn columns_are_those_of_the_contract_in_its_order() {
        let contract = "scene, adapter, method, params, map, width, height, build_ms, frame_ms, fps_static, \
            fps_moving, bytes, nodes_total, nodes_max, ray_err_max, point_err_max, point_err_rms, point_err_p99, \
            image_rmse, image_psnr, bound, bound_depth_mm, bound_held, pareto, left_out";
        let contract: Vec<&str> = contract.split(", ").collect();
        let without: Vec<&str> = COLUMNS.iter().copied().filter(|c| contract.contains(c)).collect();
        assert_eq!(without, contract);
        let distinct: std::collections::HashSet<_> = COLUMNS.iter().collect();
        assert_eq!(distinct.len(), COLUMNS.len());
        assert_eq!(
            COLUMNS[7..14],
            ["build_ms", "build_ms_min", "build_ms_max", "frame_ms", "frame_ms_min", "frame_ms_max", "clock"]
        );
    }

    #[test]
    fn rows_read_back_from_their_texts() {
        let mut rows = sample_rows();
        rows[0].point_err_max = Some(0.1 + 0.2);
        rows[0].point_err_p99 = Some(f64::NEG_INFINITY);
        rows[2].set_failed(&"lost, \"planted\"");
        for row in &rows {
            assert_eq!(Row::from_texts(&row.texts()).unwrap(), *row);
        }
        let mut texts = rows[0].texts();
        texts.insert("clock".into(), "sundial".into());
        assert_eq!(Row::from_texts(&texts), Err("clock"));
    }

    #[test]
    fn a_row_names_its_method() {
        let methods = "none;rays;dsm;dsm:epsilon=0.005,prefilter=5,precompress=off,filter=nearest,step=0.25,offset=-1,map=64;\
            osm:layers=8,slicing=gamma,bits=8,map=32;dom:layers=5,beyond=cover,filter=nearest;bom:split=log,layers=3";
        for method in parse_list(methods).unwrap() {
            let row = Row {
                method: method.name().into(),
                params: method.params(),
                map: method.map_size(),
                ..Row::default()
            };
            let again = parse(&row.spec()).unwrap();
            assert_eq!(format!("{again:?}"), format!("{method:?}"));
        }
    }

    #[test]
    fn rates_follow_from_the_times() {
        let rows = sample_rows();
        assert_eq!((rows[2].fps_static, rows[2].fps_moving), (Some(1000.0 / 85.0), Some(1000.0 / 145.0)));
        assert_eq!((rows[2].frame_ms_min, rows[2].frame_ms_max), (Some(76.5), Some(106.25)));
        assert_eq!(rows[2].moving_ms(), Some(145.0));
    }

    #[test]
    fn pareto_front_by_hand() {
        // Faster and closer rows: none (80 ms) is fastest, rays closest, dsm 145 and 160 ms between them;
        // osm is as fast as the second dsm and worse than the first.
        let marks: Vec<_> = sample_rows().iter().map(|r| r.pareto).collect();
        assert_eq!(marks, [true, true, true, true, false].map(Some));
    }

    #[test]
    fn pareto_ties_gaps_and_other_scenes() {
        let row = |scene: &str, fps, error| Row {
            scene: scene.into(),
            fps_moving: fps,
            point_err_rms: error,
            ..Row::default()
        };
        let mut rows = [
            row("a", Some(10.0), Some(0.1)),
            row("a", Some(10.0), Some(0.2)), // as fast, worse: not beaten
            row("a", Some(5.0), Some(0.1)),  // as close, slower: not beaten
            row("a", Some(5.0), Some(0.2)),  // beaten by the first
            row("a", Some(10.0), Some(0.1)), // the same as the first
            row("a", None, Some(0.0)),
            row("a", Some(99.0), None),
            row("a", Some(99.0), Some(f64::NAN)),
            row("b", Some(1.0), Some(0.9)), // another scene
        ];
        mark_pareto(&mut rows);
        let marks: Vec<_> = rows.iter().map(|r| r.pareto).collect();
        let (yes, no) = (Some(true), Some(false));
        assert_eq!(marks, [yes, yes, yes, no, yes, None, None, None, yes]);
    }
}
