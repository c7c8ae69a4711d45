//! The columns of the readable tables.

use crate::measure::table::Row;
use crate::measure::timing::clock_name;
use crate::report::number::significant;

/// A column of the readable tables.
pub struct Shown {
    pub heading: &'static str,
    pub unit: &'static str,
    /// Numbers are aligned to the right.
    pub number: bool,
    /// LaTeX tables must fit a page, so they show fewer columns.
    pub on_paper: bool,
    /// It goes into the caption where every row has the same in it.
    pub caption: bool,
    pub value: fn(&Row) -> String,
}

const fn text(heading: &'static str, value: fn(&Row) -> String) -> Shown {
    Shown { heading, unit: "", number: false, on_paper: true, caption: false, value }
}

const fn number(heading: &'static str, unit: &'static str, value: fn(&Row) -> String) -> Shown {
    Shown { heading, unit, number: true, on_paper: true, caption: false, value }
}

const fn wide(heading: &'static str, unit: &'static str, value: fn(&Row) -> String) -> Shown {
    Shown { heading, unit, number: true, on_paper: false, caption: false, value }
}

/// On what and by what rows are measured.
const fn conditions(heading: &'static str, on_paper: bool, value: fn(&Row) -> String) -> Shown {
    Shown { heading, unit: "", number: false, on_paper, caption: true, value }
}

/// Every column of the readable tables, in order.
pub const SHOWN: &[Shown] = &[
    conditions("scene", true, |r| r.scene.clone()),
    conditions("adapter", true, |r| r.adapter.clone()),
    conditions("picture", true, |r| format!("{} x {}", r.width, r.height)),
    conditions("clock", true, |r| r.clock.map_or(String::new(), |c| clock_name(c).into())),
    conditions("driver", false, |r| r.driver.clone()),
    conditions("threads", false, |r| r.threads.map_or(String::new(), |n| n.to_string())),
    conditions("program", false, |r| [&*r.version, &*r.revision, &*r.profile].join(" ").trim().to_string()),
    text("method", |r| r.method.clone()),
    text("params", |r| r.params.clone()),
    number("map", "texels", |r| r.map.map_or(String::new(), |n| n.to_string())),
    number("build", "ms", |r| real(r.build_ms)),
    number("frame", "ms", |r| real(r.frame_ms)),
    wide("fps static", "1/s", |r| real(r.fps_static)),
    number("fps moving", "1/s", |r| real(r.fps_moving)),
    number("memory", "MiB", |r| real(r.bytes.map(|b| b as f64 / f64::from(1 << 20)))),
    wide("nodes", "", |r| r.nodes_total.map_or(String::new(), |n| n.to_string())),
    wide("nodes max", "", |r| r.nodes_max.map_or(String::new(), |n| n.to_string())),
    number("ray err max", "", |r| real(r.ray_err_max)),
    wide("point err max", "", |r| real(r.point_err_max)),
    number("point err rms", "", |r| real(r.point_err_rms)),
    number("point err p99", "", |r| real(r.point_err_p99)),
    wide("point err mean", "", |r| real(r.point_err_mean_signed)),
    number("strand err rms", "", |r| real(r.strand_err_rms)),
    wide("image rmse", "", |r| real(r.image_rmse)),
    number("PSNR", "dB", |r| real(r.image_psnr)),
    wide("SSIM", "", |r| real(r.image_ssim)),
    number("bound", "", |r| real(r.bound)),
    wide("bound depth", "mm", |r| real(r.bound_depth_mm)),
    text("bound held", |r| flag(r.bound_held)),
    text("Pareto", |r| flag(r.pareto)),
    text("tuned", |r| flag(r.tuned)),
    text("status", |r| if r.has_failed() { r.status.clone() } else { String::new() }),
];

fn flag(value: Option<bool>) -> String {
    value.map_or(String::new(), |yes| yes.to_string())
}

fn real(value: Option<f64>) -> String {
    value.map_or(String::new(), |x| significant(x, 3))
}
