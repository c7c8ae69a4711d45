//! The rows of the stability table.

use super::judge::Status;
use serde::Serialize;

/// One case and method; the fields are the columns, in order. Where a case has several lights,
/// counts are their sums, and errors and costs those of the worst.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Name of the case.
    pub case: String,
    /// Name of the method.
    pub method: String,
    /// `key=value` texts separated by spaces.
    pub params: String,
    /// The worst that is wrong.
    pub status: Status,
    /// Largest `|T_method - T_exact|` along light rays.
    pub ray_err_max: Option<f64>,
    /// Guaranteed bound on the transmittance error along light rays, besides `bound_depth_mm` of depth.
    pub bound: Option<f64>,
    /// Depths at which transmittance rises.
    pub monotone_violations: Option<usize>,
    /// Finite values outside `[0, 1]`.
    pub out_of_range: Option<usize>,
    /// Values that are not finite.
    pub non_finite: Option<usize>,
    /// Time to make the shadow structure, ms.
    pub build_ms: Option<f64>,
    /// Memory of the shadow structure.
    pub bytes: Option<u64>,
    /// Remarks on faults, and on costs far above the ordinary.
    pub note: String,
}

impl Row {
    /// A row of which nothing was measured.
    pub fn new(case: &str, method: &str, params: String, status: Status) -> Self {
        Self {
            case: case.into(),
            method: method.into(),
            params,
            status,
            ray_err_max: None,
            bound: None,
            monotone_violations: None,
            out_of_range: None,
            non_finite: None,
            build_ms: None,
            bytes: None,
            note: String::new(),
        }
    }
}
