//! The rows that `compare` makes, and their Pareto front.

pub use super::cell::Cell;
use super::cell::FromText;
use super::defaults::setting_columns;
use crate::gpu::Clock;
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::LazyLock;

/// A column of the table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name in the header line.
    pub name: &'static str,
    /// Unit of the numbers; empty without a unit.
    pub unit: &'static str,
    /// Description in one line.
    pub about: String,
}

/// One list gives the fields, the columns, their order, and what each is.
macro_rules! columns {
    ($($(#[doc = $about:literal])+ $name:ident [$unit:literal]: $t:ty,)*) => {
        /// One method and setting. The fields are the first columns, in the order in which every writer puts them, each
        /// with what belongs to it right after it, and last on what and by what the row was measured.
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct Row {
            $($(#[doc = $about])+ pub $name: $t,)*
            /// Settings of the method by key; each is a column of its own after the others.
            pub settings: Vec<(&'static str, Cell)>,
        }

        /// Every column, in order: the fields of [`Row`], then a column for each key of every method.
        pub static COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| {
            let fields = [$((stringify!($name), $unit, concat!($($about),+).trim().to_owned())),*];
            let settings = setting_columns().into_iter().map(|(name, about)| (name, "", about));
            fields.into_iter().chain(settings).map(|(name, unit, about)| Column { name, unit, about }).collect()
        });

        impl Row {
            /// The row's values, one a column of [`COLUMNS`].
            pub fn cells(&self) -> Vec<Cell> {
                let mut cells = vec![$(self.$name.clone().into()),*];
                cells.extend(COLUMNS[cells.len()..].iter().map(|c| self.setting(c.name)));
                cells
            }

            /// The row whose cells, written as text, are these by their columns; a missing one has its default.
            ///
            /// # Errors
            /// The first column whose text is no value of it.
            pub fn from_texts(texts: &BTreeMap<String, String>) -> Result<Self, &'static str> {
                let given = |key: &str| texts.get(key).filter(|text| !text.is_empty());
                let setting = |(key, _)| Some((key, Cell::from_text(given(key)?)?));
                Ok(Self {
                    $($name: match texts.get(stringify!($name)) {
                        Some(text) => FromText::from_text(text).ok_or(stringify!($name))?,
                        None => Default::default(),
                    },)*
                    settings: setting_columns().into_iter().filter_map(setting).collect(),
                })
            }
        }
    };
}

columns! {
    /// Volume and transfer function, or the name of the scene file.
    scene [""]: String,
    /// Graphics adapter that the times are from.
    adapter [""]: String,
    /// Shadow method.
    method [""]: String,
    /// Settings of the method as `key=value` texts separated by spaces, as far as they distinguish it from other rows
    /// of the method.
    params [""]: String,
    /// Texels a side of the shadow map.
    map ["texels"]: Option<u32>,
    /// Width of the picture.
    width ["pixels"]: u32,
    /// Height of the picture.
    height ["pixels"]: u32,
    /// Time to make the shadow structure for a light that has moved, median of the repeats: host and device together,
    /// with all repetitions and choices.
    build_ms ["ms"]: Option<f64>,
    /// Fastest repeat of `build_ms`.
    build_ms_min ["ms"]: Option<f64>,
    /// Slowest repeat of `build_ms`.
    build_ms_max ["ms"]: Option<f64>,
    /// Time of one picture with a built structure, median of the repeats.
    frame_ms ["ms"]: Option<f64>,
    /// Fastest repeat of `frame_ms`.
    frame_ms_min ["ms"]: Option<f64>,
    /// Slowest repeat of `frame_ms`.
    frame_ms_max ["ms"]: Option<f64>,
    /// Clock of these times: `gpu` (timestamps of the adapter) or `wall` (the host's clock).
    clock [""]: Option<Clock>,
    /// Time of the row's first build of all, by the host's clock: shaders that no row before has used are compiled, and
    /// what has to be guessed once is guessed.
    build_first_ms ["ms"]: Option<f64>,
    /// The device's part of `build_ms` by the adapter's timestamps; empty where it has none.
    build_gpu_ms ["ms"]: Option<f64>,
    /// Time from the request of the shadow structure to its completion, by the host's clock.
    build_wall_ms ["ms"]: Option<f64>,
    /// `frame_ms` by the adapter's timestamps and, of the host, what finds where rays are cast; empty where there are none.
    frame_gpu_ms ["ms"]: Option<f64>,
    /// Time from the submission of a picture to its completion, with the passes that find the tiles of rays, by the
    /// host's clock.
    frame_wall_ms ["ms"]: Option<f64>,
    /// Time to classify the bricks anew after the transfer function was edited, by the host's clock.
    bricks_ms ["ms"]: Option<f64>,
    /// Time to make the tables anew after the transfer function was edited, by the host's clock.
    tables_ms ["ms"]: Option<f64>,
    /// Timed rounds that the medians are of.
    repeats [""]: Option<u32>,
    /// Pictures a second while the light stands still: `1000 / frame_ms`.
    fps_static ["1/s"]: Option<f64>,
    /// Pictures a second while the light moves: `1000 / (build_ms + frame_ms)`.
    fps_moving ["1/s"]: Option<f64>,
    /// Memory that is allocated for the shadow structure, in bytes, once the first build has shown how much it takes.
    bytes [""]: Option<u64>,
    /// Bytes of the structure that a lookup can reach.
    bytes_used [""]: Option<u64>,
    /// Nodes stored, where the method has nodes.
    nodes_total [""]: Option<u64>,
    /// Nodes of the fullest texel.
    nodes_max [""]: Option<u64>,
    /// Largest `|T_method - T_exact|` at depths along light rays through texel centres (T: transmittance, 0 to 1).
    ray_err_max [""]: Option<f64>,
    /// Largest `|T_method - T_exact|` at points that the camera sees.
    point_err_max [""]: Option<f64>,
    /// Root mean square of `T_method - T_exact` at points that the camera sees, weighted as it sees them.
    point_err_rms [""]: Option<f64>,
    /// 99th percentile of `|T_method - T_exact|` at the points that the camera sees, weighted by visibility.
    point_err_p99 [""]: Option<f64>,
    /// Mean of `T_method - T_exact` at the points that the camera sees, weighted by visibility; negative where the
    /// method is too dark.
    point_err_mean_signed [""]: Option<f64>,
    /// The root mean square there against strands themselves (beams through cylinders), not voxels; empty without strands.
    strand_err_rms [""]: Option<f64>,
    /// Root mean square difference from the exact picture, which has about 1,500 pixels, over all channels of linear RGBA.
    image_rmse [""]: Option<f64>,
    /// Peak signal-to-noise ratio to that picture of about 1,500 pixels, for a peak of 1; infinite for identical pictures.
    image_psnr ["dB"]: Option<f64>,
    /// Mean structural similarity with that picture of about 1,500 pixels, of sRGB-encoded channels; 1 for identical pictures.
    image_ssim [""]: Option<f64>,
    /// Estimated error of the exact picture itself: the largest change of a linear channel at a finer integration.
    image_exact_err [""]: Option<f64>,
    /// Error bound on light rays: tolerance in transmittance; empty for methods without a bound.
    bound [""]: Option<f64>,
    /// Error bound on light rays: tolerance in depth.
    bound_depth_mm ["mm"]: Option<f64>,
    /// Error bound on light rays: lateral tolerance of the ray, within which float32 cannot place it.
    bound_lateral_mm ["mm"]: Option<f64>,
    /// Error bound on light rays: tolerance in the volume's values along the ray.
    bound_value [""]: Option<f64>,
    /// Depths that satisfy the bound only by its tolerances sideways or in value.
    bound_limited [""]: Option<u64>,
    /// Whether the bound is satisfied at every depth tested; empty for methods without a bound.
    bound_held [""]: Option<bool>,
    /// Texels whose light rays were marched by regular samples and compared with the same map marched by cells; empty
    /// where rays are marched by cells.
    check_n [""]: Option<u64>,
    /// Smallest tolerance in transmittance that all tested texels satisfy, where curves may be a step of depth
    /// apart.
    check_max [""]: Option<f64>,
    /// The tolerance that is stated: 0.1, or twice what one such map may be off by itself where that is more.
    check_tolerance [""]: Option<f64>,
    /// Whether it is satisfied in all of them at 24 random depths each: with 99 % confidence fewer than `4.6 / check_n` of texels
    /// that meet extinction, tested so, violate it.
    check_ok [""]: Option<bool>,
    /// Work of a picture, counted and not timed on the picture that `image_rmse` is of: samples of the volume by its filter,
    /// a pixel.
    work_samples [""]: Option<f64>,
    /// Counted work: lookups of the light at a point, per pixel.
    work_lookups [""]: Option<f64>,
    /// Counted work: texture reads of all kinds, per pixel.
    work_loads [""]: Option<f64>,
    /// Counted work of a build, with searches for splits: cells, or samples with `march=samples`, of the light rays,
    /// per texel of the tiles that are built.
    work_cells [""]: Option<f64>,
    /// Counted work: pieces of light rays with an integrated optical depth, per texel of the tiles that are built.
    work_pieces [""]: Option<f64>,
    /// Light rays tested.
    rays_tested [""]: Option<u64>,
    /// Number of depths tested on the light rays, those of nodes included.
    depths_tested [""]: Option<u64>,
    /// Whether no other row of the scene is at once faster (`fps_moving`) and closer (`point_err_rms`).
    pareto [""]: Option<bool>,
    /// Whether a search within a budget chose the settings; empty where there was none.
    tuned [""]: Option<bool>,
    /// The budgets, and the errors that were to be least within them, for which the search chose the row.
    tuned_for [""]: String,
    /// Work that the plan skipped because the scene does not need it, why, and what that saved.
    left_out [""]: String,
    /// Lights that shine; times, bytes and errors are of all of them together.
    lights [""]: Option<u32>,
    /// Number of the only light of the row (`--each-light`), from 1; empty for a row of all lights.
    light [""]: Option<u32>,
    /// Driver of the adapter with its version.
    driver [""]: String,
    /// Threads of the host's parallel work.
    threads [""]: Option<u32>,
    /// Build profile of the program: `release` or `debug`.
    profile [""]: String,
    /// Version of the program.
    version [""]: String,
    /// Commit that the program was built from.
    revision [""]: String,
    /// `ok` or `failed`.
    status [""]: String,
    /// Why it failed, or what else a reader of the row should know.
    note [""]: String,
}

/// JSON object with a key for each column.
impl Serialize for Row {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(COLUMNS.len()))?;
        for (column, cell) in COLUMNS.iter().zip(self.cells()) {
            map.serialize_entry(column.name, &cell)?;
        }
        map.end()
    }
}

/// Value of the column `status` for a measured row.
pub const OK: &str = "ok";
/// Value of the column `status` for a failed row.
pub const FAILED: &str = "failed";

impl Row {
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
        let map = self.map.map_or(String::new(), |map| format!("map={map}"));
        let settings: Vec<_> =
            [self.params.replace(' ', ","), map].into_iter().filter(|s| !s.is_empty()).collect();
        let colon = if settings.is_empty() { "" } else { ":" };
        format!("{}{colon}{}", self.method, settings.join(","))
    }

    /// Value of a column by its name; empty for a name that is no column's.
    pub fn cell(&self, column: &str) -> Cell {
        let place = COLUMNS.iter().position(|c| c.name == column);
        place.map_or(Cell::Empty, |i| self.cells().swap_remove(i))
    }

    /// Value of a setting of the method, by its key.
    pub fn setting(&self, key: &str) -> Cell {
        self.settings.iter().find(|(k, _)| *k == key).map_or(Cell::Empty, |(_, value)| value.clone())
    }

    /// Scene and adapter: rows that share them have one scale, one drawing and one front.
    pub fn group(&self) -> (&str, &str) {
        (&self.scene, &self.adapter)
    }

    /// Scene, adapter and size of the picture: rows that share them are compared with each other.
    pub fn place(&self) -> (&str, &str, u32, u32) {
        (&self.scene, &self.adapter, self.width, self.height)
    }

    /// Whether the method failed.
    pub fn has_failed(&self) -> bool {
        self.status == FAILED
    }

    /// The cells that are not empty, as text, by their columns; [`Self::from_texts`] reads them back.
    pub fn texts(&self) -> BTreeMap<String, String> {
        let texts =
            COLUMNS.iter().zip(self.cells()).map(|(column, cell)| (column.name.into(), cell.to_string()));
        texts.filter(|(_, text): &(_, String)| !text.is_empty()).collect()
    }

    /// Median time with the light moving, `build_ms + frame_ms`; a missing `build_ms` counts as 0.
    pub fn moving_ms(&self) -> Option<f64> {
        self.frame_ms.map(|frame| self.build_ms.unwrap_or(0.0) + frame)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::measure::bound_check::BoundReport;
    use crate::measure::defaults::{settings, settings_of};
    use crate::measure::pareto::mark_pareto;
    use crate::measure::stats::Spread;
    use crate::measure::timing::Timing;
    use crate::shadow::{Bound, METHODS, parse, parse_list};

    /// Rows as `compare` would make them, every kind of cell among them.
    pub(crate) fn sample_rows() -> Vec<Row> {
        let row = |method: &str, params: &str, build: f64, frame: f64, error: f64| {
            let mut row = Row {
                scene: "CT_AVM vessels".into(),
                adapter: "llvmpipe (LLVM 19.1, 256 bits)".into(),
                method: method.into(),
                params: params.into(),
                settings: settings_of(method, params),
                width: 512,
                height: 512,
                ..Row::default()
            };
            let spread = |ms: f64| Spread { median: ms, min: 0.9 * ms, max: 1.25 * ms };
            let timing = Timing {
                build_ms: spread(build),
                frame_ms: spread(frame),
                clock: Clock::Wall,
                tables_ms: None,
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
            &BoundReport::of_ray(
                0,
                &|_: f64| 1.0,
                &[0.0],
                &[0.95],
                Some(Bound { transmittance: 0.06, depth_mm: 0.1, ..Bound::default() }),
                |_| None,
            ),
            Some(Bound { transmittance: 0.06, depth_mm: 0.1, ..Bound::default() }),
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
        let names: Vec<&str> = COLUMNS.iter().map(|c| c.name).collect();
        let without: Vec<&str> = names.iter().copied().filter(|c| contract.contains(c)).collect();
        assert_eq!(without, contract);
        let distinct: std::collections::HashSet<_> = names.iter().collect();
        assert_eq!(distinct.len(), names.len());
        assert!(COLUMNS.iter().all(|c| c.about.ends_with('.') && !c.about.contains('\n')));
        assert_eq!(
            names[7..14],
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
                settings: settings(method.as_ref()),
                ..Row::default()
            };
            for key in
                METHODS.iter().find(|e| e.name == row.method).unwrap().keys.iter().filter(|k| k.name != "map")
            {
                assert_ne!(row.setting(key.name), Cell::Empty, "{} has a column of its own", key.name);
            }
            assert_eq!(parse(&row.spec()).unwrap().spec(), method.spec());
        }
    }

    #[test]
    fn rates_follow_from_the_times() {
        let rows = sample_rows();
        assert_eq!((rows[2].fps_static, rows[2].fps_moving), (Some(1000.0 / 85.0), Some(1000.0 / 145.0)));
        assert_eq!((rows[2].frame_ms_min, rows[2].frame_ms_max), (Some(76.5), Some(106.25)));
        assert_eq!(rows[2].moving_ms(), Some(145.0));
    }
}
