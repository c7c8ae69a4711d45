//! Verification of archived results of the benchmark: measures the recorded settings again, without a search.

use super::answer::{Answer, CellResult};
use super::measure::CellJob;
use crate::error::Result;
use crate::report::verify::Verified;

impl CellJob<'_> {
    /// Measures the recorded settings of a cell again, and compares errors and memory. Answers of external programs are
    /// not compared. `is_same_adapter` says that the results were recorded on this adapter and driver.
    ///
    /// # Errors
    /// A recorded setting does not parse, or the device is lost.
    pub fn verify(
        &self,
        recorded: &CellResult,
        is_same_adapter: bool,
        verified: &mut Verified,
    ) -> Result<()> {
        let title = |answer: &Answer| format!("{} {} {}", recorded.cell, answer.budget, answer.method);
        verified.compare(&recorded.cell, "exact_hash", [&recorded.exact_hash, &self.hash], true);
        for answer in &recorded.answers {
            let Some(method) = answer.own_method()? else { continue };
            let mut measured = Answer::default();
            let with_picture = answer.image_rmse.is_some();
            self.measure((method.as_ref(), answer.light_samples), None, with_picture, &mut measured)?;
            for ((name, recorded), (_, measured)) in answer.values().into_iter().zip(measured.values()) {
                verified.compare(&title(answer), name, [&recorded, &measured], is_same_adapter);
            }
        }
        Ok(())
    }
}
