//! Result of one cell of the benchmark, as a JSON file records it.

use crate::error::Result;
use crate::measure::budget::Budget;
use crate::measure::stats::ErrorStats;
use crate::measure::table::Row;
use crate::shadow::{Method, MethodSpec, entry};
use serde::{Deserialize, Serialize};

/// Best answer of a shadow method, or the answer of an external program, in one cell of the benchmark.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Answer {
    /// Budget within which the settings were searched, in the syntax of `--budget`; empty for an external program.
    pub budget: String,
    /// Name of the shadow method or external program.
    pub method: String,
    /// Shadow method with the settings that the search found, in the syntax of `--shadow`; empty if none is within the
    /// budget, or the command of an external program.
    pub settings: String,
    /// Number of samples of a light with a size, each with a shadow map; `None` for a light without a size, or where
    /// one map answers for all of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_samples: Option<u32>,
    /// Memory of the shadow maps, bytes.
    pub bytes: Option<u64>,
    /// Time to build the shadow map, ms; only for budgets of time.
    pub build_ms: Option<f64>,
    /// Time to draw one picture with the shadow map, ms; the whole time of an external program.
    pub frame_ms: Option<f64>,
    /// `build_ms + frame_ms` divided by that of `none`; only for budgets in frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<f64>,
    /// Root mean square error of transmittance at the visible points of the cell, weighted by visibility.
    pub point_err_rms: Option<f64>,
    /// Lower end of the 95 % interval of `point_err_rms`.
    pub point_err_rms_lo: Option<f64>,
    /// Upper end of the 95 % interval of `point_err_rms`.
    pub point_err_rms_hi: Option<f64>,
    /// 99th percentile of the absolute errors of transmittance.
    pub point_err_p99: Option<f64>,
    /// Largest absolute error of transmittance.
    pub point_err_max: Option<f64>,
    /// Root mean square difference of the small picture from the exact one: of external programs that draw it, and of
    /// methods beside such programs.
    #[serde(default)]
    pub image_rmse: Option<f64>,
    /// Number of settings that the searches for all budgets of this method tried in the cell; 0 where the settings of
    /// another view were taken as they are.
    pub trials: usize,
    /// Whether the search ended because no step lowered the error, and not after its largest number of trials.
    #[serde(default)]
    pub converged: Option<bool>,
    /// Whether a paired bootstrap distinguishes `point_err_rms` from the least of the budget; `None` for that least
    /// itself.
    pub separated: Option<bool>,
    /// Reason why a trial or an external program failed.
    #[serde(default)]
    pub note: String,
}

impl Answer {
    /// Shadow method with these settings; `None` for an external program or if no settings are within the budget.
    ///
    /// # Errors
    /// The settings do not parse.
    pub fn own_method(&self) -> Result<Option<Box<dyn Method>>> {
        let is_own = !self.settings.is_empty() && entry(&self.method).is_some();
        is_own.then(|| self.settings.parse::<MethodSpec>()?.method()).transpose()
    }

    /// Columns of a comparison table that budgets limit.
    pub fn needs(&self) -> Row {
        let &Self { bytes, build_ms, frame_ms, frames, .. } = self;
        Row { bytes, build_ms, frame_ms, frames, ..Row::default() }
    }

    /// Root mean square error of transmittance; infinite where there is no answer.
    pub fn error(&self) -> f64 {
        self.point_err_rms.unwrap_or(f64::INFINITY)
    }

    /// Returns the names and texts of the values that do not depend on time.
    pub fn values(&self) -> [(&'static str, String); 7] {
        let text = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        [
            ("bytes", self.bytes.map_or(String::new(), |bytes| bytes.to_string())),
            ("point_err_rms", text(self.point_err_rms)),
            ("point_err_rms_lo", text(self.point_err_rms_lo)),
            ("point_err_rms_hi", text(self.point_err_rms_hi)),
            ("point_err_p99", text(self.point_err_p99)),
            ("point_err_max", text(self.point_err_max)),
            ("image_rmse", text(self.image_rmse)),
        ]
    }

    /// Sets the columns of transmittance errors from pairs of error and weight. Errors that are not finite are noted.
    ///
    /// # Errors
    /// A weight is not valid.
    pub fn set_errors(&mut self, errors: &[(f64, f64)]) -> Result<()> {
        let Some(stats) = ErrorStats::of(errors.iter().copied())? else { return Ok(()) };
        if stats.non_finite > 0 {
            self.note = format!("{} of {} transmittances are not finite", stats.non_finite, stats.count);
            return Ok(());
        }
        self.point_err_rms = Some(stats.rms);
        self.point_err_rms_lo = stats.rms_interval.map(|[low, _]| low);
        self.point_err_rms_hi = stats.rms_interval.map(|[_, high]| high);
        self.point_err_p99 = Some(stats.p99_abs);
        self.point_err_max = Some(stats.max_abs);
        Ok(())
    }
}

/// Result of one cell of the benchmark: its points, and the answers of all methods.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct CellResult {
    /// Name of the cell.
    pub cell: String,
    /// Name of the volume of the cell.
    pub volume: String,
    /// Name of the transfer function of the cell.
    pub function: String,
    /// Number of visible points at which transmittance is compared.
    pub points: usize,
    /// Hash of the visible points and their exact transmittances, see [`super::exact::fingerprint`].
    pub exact_hash: String,
    /// Revision of the program that measured the cell.
    pub revision: String,
    /// Time that the cell took with all searches, s; `None` in results of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elapsed_s: Option<f64>,
    /// Text of the scene file of the cell. Its transfer function is `transfer_function`.
    pub scene: String,
    /// Text of the transfer function of the cell, JSON.
    #[serde(default)]
    pub transfer_function: String,
    /// Answers of the methods, budget by budget, then those of external programs.
    pub answers: Vec<Answer>,
}

impl CellResult {
    /// Returns the name of the light and that of the view, which end the name of the cell.
    pub fn light_and_view(&self) -> (&str, &str) {
        let (rest, view) = self.cell.rsplit_once('-').unwrap_or_default();
        (rest.rsplit_once('-').map_or("", |(_, light)| light), view)
    }

    /// Returns the answer of a method within a budget.
    pub fn answer(&self, method: &str, budget: &Budget) -> Option<&Answer> {
        let budget = budget.to_string();
        self.answers.iter().find(|answer| answer.method == method && answer.budget == budget)
    }

    /// Whether there is an answer of a method within each budget, and none failed.
    pub fn has(&self, method: &str, budgets: &[Budget]) -> bool {
        let is_known = |answer: &Answer| !answer.settings.is_empty() || answer.note.is_empty();
        budgets.iter().all(|budget| self.answer(method, budget).is_some_and(is_known))
    }
}
