//! Verification of archived results of the benchmark: measures the recorded settings again, without a search.

use super::answer::{Answer, CellResult};
use super::folder::Conditions;
use super::measure::CellJob;
use crate::error::Result;
use crate::measure::facts::Facts;
use crate::report::verify::{Recorder, Verified};

impl CellJob<'_> {
    /// Measures the recorded settings of a cell again, and compares errors and memory. Answers of external programs are
    /// not compared. `facts` has the adapter and driver here, `before` those of the record.
    ///
    /// # Errors
    /// A recorded setting does not parse, or the device is lost.
    pub fn verify(
        &self,
        recorded: &CellResult,
        (before, facts): (&Conditions, &Facts),
        verified: &mut Verified,
    ) -> Result<()> {
        let here = [facts.adapter.as_str(), &facts.driver, facts.revision];
        let by = Recorder::of([&before.adapter, &before.driver, &recorded.revision], here);
        let title = |answer: &Answer| format!("{} {} {}", recorded.cell, answer.budget, answer.method);
        verified.compare(&recorded.cell, "exact_hash", [&recorded.exact_hash, &self.hash], Recorder::Same);
        for answer in &recorded.answers {
            let Some(method) = answer.own_method()? else { continue };
            let mut measured = Answer::default();
            let with_picture = answer.image_rmse.is_some();
            self.measure((method.as_ref(), answer.light_samples), None, with_picture, &mut measured)?;
            for ((name, recorded), (_, measured)) in answer.values().into_iter().zip(measured.values()) {
                verified.compare(&title(answer), name, [&recorded, &measured], by);
            }
        }
        Ok(())
    }
}
