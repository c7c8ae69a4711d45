//! The rows of the stability table.

use super::judge::Status;
use serde::Serialize;

/// One case and method; the fields are the columns, in order. Where a case has several lights,
/// counts are their sums, and errors and costs those of the worst.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    pub case: String,
    pub method: String,
    /// `key=value` texts separated by spaces.
    pub params: String,
    pub status: Status,
    /// Largest `|T_method - T_exact|` along light rays.
    pub ray_err_max: Option<f64>,
    /// What the method promises of it, but for `bound_depth_mm` of depth.
    pub bound: Option<f64>,
    pub monotone_violations: Option<usize>,
    pub out_of_range: Option<usize>,
    pub non_finite: Option<usize>,
    pub build_ms: Option<f64>,
    pub bytes: Option<u64>,
    /// What is wrong, and what costs much more than ordinarily.
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
