//! A setting as a search tries it: cheaply.

use super::{Budget, By};
use serde::{Deserialize, Serialize};

/// Measurements of one setting tried by a search. Its times are the slower of two runs where any were asked for.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Trial {
    /// Volume and transfer function, or the name of the scene file.
    pub scene: String,
    /// Graphics adapter that the times are from.
    #[serde(default)]
    pub adapter: String,
    /// Shadow method.
    pub method: String,
    /// Its settings, as in the table.
    pub params: String,
    /// Texels a side of the shadow map.
    pub map: Option<u32>,
    /// Memory of the shadow structure.
    pub bytes: Option<u64>,
    /// To make the structure.
    pub build_ms: Option<f64>,
    /// One picture with it made.
    pub frame_ms: Option<f64>,
    /// At the points that the camera sees; empty where no budget holds the setting.
    pub point_err_rms: Option<f64>,
    /// Against the exact picture; empty where no budget holds the setting.
    pub image_rmse: Option<f64>,
    /// The budgets and errors that it was chosen for.
    pub tuned_for: String,
    /// Why it failed.
    pub note: String,
}

impl Trial {
    /// Bytes or milliseconds of a budget that the trial needs; `None` where unknown.
    pub fn need(&self, budget: Budget) -> Option<f64> {
        match budget {
            Budget::Bytes(_) => self.bytes.map(|n| n as f64),
            Budget::Ms(_) => Some(self.build_ms? + self.frame_ms?),
        }
    }

    /// Its error, where it is a number.
    pub fn error(&self, by: By) -> Option<f64> {
        let error = match by {
            By::Points => self.point_err_rms,
            By::Picture => self.image_rmse,
        };
        error.filter(|e| !e.is_nan())
    }

    /// Whether it says what a search within these budgets asks: what it needs of each, and errors where one holds it.
    pub fn answers(&self, budgets: &[Budget]) -> bool {
        let failed = !self.note.is_empty();
        let known = budgets.iter().all(|b| self.need(*b).is_some());
        let held = budgets.iter().any(|b| self.need(*b).is_some_and(|need| need <= b.amount()));
        failed || known && (!held || By::ALL.iter().any(|by| self.error(*by).is_some()))
    }
}
