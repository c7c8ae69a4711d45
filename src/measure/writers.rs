//! Rows of any kind as CSV and JSON.

use crate::error::{Error, Result};
use serde::Serialize;
use std::fmt;

/// Every column of all rows with a header line; what was not measured is empty.
///
/// # Errors
/// The writer's own, which memory does not give.
pub fn csv<T: Serialize>(rows: &[T]) -> Result<Vec<u8>> {
    let failed = |e: &dyn fmt::Display| Error::runtime("cannot write table", "CSV", e);
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).map_err(|e| failed(&e))?;
    }
    writer.into_inner().map_err(|e| failed(&e))
}

/// The same as a JSON array of objects, keys in the order of the fields: what was not measured is `null`, and so is an
/// infinite value, which JSON has not, such as the PSNR of identical pictures.
///
/// # Errors
/// The writer's own, which memory does not give.
pub fn json<T: Serialize>(rows: &[T]) -> Result<String> {
    let text =
        serde_json::to_string_pretty(rows).map_err(|e| Error::runtime("cannot write table", "JSON", e))?;
    Ok(text + "\n")
}
