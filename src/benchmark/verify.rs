//! Verification of archived results of the benchmark: measures the recorded settings again, without a search.

use super::answer::{Answer, CellResult};
use super::folder::Conditions;
use super::measure::CellJob;
use super::pages;
use crate::error::{Error, Result};
use crate::measure::facts::Facts;
use crate::render::Session;
use crate::report::verify::{Recorder, Verified, read_texts};
use crate::shadow::Entry;
use std::collections::HashSet;
use std::path::Path;

impl CellJob<'_> {
    /// Measures the recorded settings of a cell again, and compares errors and memory. Answers of external programs are
    /// not compared. `facts` has the adapter and driver here, `before` those of the record. `open` opens the session of a
    /// method that has its own.
    ///
    /// # Errors
    /// A recorded setting does not parse, or the device is lost.
    pub fn verify(
        &self,
        recorded: &CellResult,
        (before, facts): (&Conditions, &Facts),
        open: &dyn Fn(&Entry) -> Result<Option<Session>>,
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
            let own = open(method.entry())?;
            let job = own.as_ref().map(|session| self.on(session));
            let method = (method.as_ref(), answer.light_samples);
            job.as_ref().unwrap_or(self).measure(method, None, with_picture, &mut measured)?;
            for ((name, recorded), (_, measured)) in answer.values().into_iter().zip(measured.values()) {
                verified.compare(&title(answer), name, [&recorded, &measured], by);
            }
        }
        Ok(())
    }
}

/// Compares the tables of a result folder with those that the results of their cells give. The folder may have results of
/// more cells, whose settings start searches. Columns that a later version added are not compared.
///
/// # Errors
/// A table cannot be read, or the temporary folder cannot be written.
pub fn verify_tables(results: &[CellResult], folder: &Path, verified: &mut Verified) -> Result<()> {
    let failed = |e: std::io::Error| Error::runtime("cannot verify", folder.display(), e);
    let made = tempfile::tempdir().map_err(failed)?;
    let rows = read_texts(&folder.join("benchmark.csv"))?;
    let listed: HashSet<&str> = rows.iter().filter_map(|row| row.get("cell").map(String::as_str)).collect();
    let results: Vec<_> = results.iter().filter(|result| listed.contains(&*result.cell)).cloned().collect();
    pages::write(&results, "", made.path())?;
    // Means and logarithms may round otherwise in another program.
    for (name, by) in [("benchmark.csv", Recorder::Same), ("ranking.csv", Recorder::OtherRevision)] {
        let [recorded, made] = [folder, made.path()].map(|folder| read_texts(&folder.join(name)));
        let (recorded, made) = (recorded?, made?);
        let counts = [recorded.len(), made.len()].map(|count| count.to_string());
        verified.compare(name, "number of rows", counts.each_ref().map(String::as_str), by);
        for (recorded, made) in recorded.iter().zip(&made) {
            let title = ["cell", "budget", "method"].map(|key| recorded.get(key).map_or("", String::as_str));
            let title = format!("{name}: {}", title.join(" "));
            for (column, text) in recorded {
                let made = made.get(column).map_or("", String::as_str);
                verified.compare(&title, column, [text, made], by);
            }
        }
    }
    Ok(())
}
