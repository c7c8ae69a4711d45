//! Writes result tables as CSV and JSON, and a description of their columns.

use super::markdown::table_line;
use super::run::Run;
use super::side_tables::{SIDE_TABLES, SideTable};
use crate::error::{Error, Result};
use crate::files::output::write_whole;
use crate::measure::table::{COLUMNS, Cell, Column, Row};
use serde::Serialize;
use std::borrow::Borrow;
use std::fmt;
use std::path::{Path, PathBuf};

/// Returns the rows of a result table as CSV with a header line; unmeasured values are empty.
///
/// # Errors
/// Serialization fails.
pub fn csv<T: Serialize>(rows: &[T]) -> Result<Vec<u8>> {
    written(|writer| rows.iter().try_for_each(|row| writer.serialize(row)))
}

/// Calls the function `write` with a CSV writer and returns the bytes of the CSV file.
fn written(write: impl FnOnce(&mut csv::Writer<Vec<u8>>) -> csv::Result<()>) -> Result<Vec<u8>> {
    let failed = |e: &dyn fmt::Display| Error::runtime("cannot write table", "CSV", e);
    let mut writer = csv::Writer::from_writer(Vec::new());
    write(&mut writer).map_err(|e| failed(&e))?;
    writer.into_inner().map_err(|e| failed(&e))
}

/// Returns the rows of a result table as a JSON array of objects, with keys in column order. Unmeasured values are
/// `null`, and so are infinite ones (for example the PSNR of identical pictures), since JSON has no infinity.
///
/// # Errors
/// Serialization fails.
pub fn json<T: Serialize>(rows: &[T]) -> Result<String> {
    let text =
        serde_json::to_string_pretty(rows).map_err(|e| Error::runtime("cannot write table", "JSON", e))?;
    Ok(text + "\n")
}

/// Row of `compare.json`: the columns of the comparison table, scene file and SHA-256 of the scene's input.
#[derive(Serialize)]
struct JsonRow<'a> {
    #[serde(flatten)]
    row: &'a Row,
    scene_file: Option<&'a str>,
    volume_sha256: Option<&'a str>,
    transfer_function_sha256: Option<&'a str>,
}

impl<'a> JsonRow<'a> {
    fn of(row: &'a Row, run: &'a Run) -> Self {
        let record = run.scenes.iter().find(|s| s.name == row.scene);
        let filled = |text: &'a String| Some(text.as_str()).filter(|t| !t.is_empty());
        Self {
            row,
            scene_file: record.and_then(|s| filled(&s.file)),
            volume_sha256: record.and_then(|s| s.volume_sha256.as_deref()),
            transfer_function_sha256: record.and_then(|s| filled(&s.tf_sha256)),
        }
    }
}

/// Returns the comparison table of a run as JSON, each row with its scene file and the SHA-256 of volume and transfer
/// function. See [`json`] for the format.
///
/// # Errors
/// See [`json`].
pub fn table_json(rows: &[Row], run: &Run) -> Result<String> {
    json(&rows.iter().map(|row| JsonRow::of(row, run)).collect::<Vec<_>>())
}

/// Returns the comparison table with all columns as CSV. Unmeasured values are empty, flags are `true` or `false`,
/// and reals have the fewest digits that read back as the same number (`inf` for infinity).
///
/// # Errors
/// See [`csv()`].
pub fn table_csv(rows: &[Row]) -> Result<Vec<u8>> {
    written(|writer| {
        writer.write_record(COLUMNS.iter().map(|c| c.name))?;
        rows.iter().try_for_each(|row| writer.write_record(row.cells().iter().map(Cell::to_string)))
    })
}

/// Returns a result table other than the comparison table as CSV, with the columns of its [`SideTable`] description.
/// `own` returns the value of a column by name; for `None`, the value is from the comparison-table row.
///
/// # Errors
/// See [`csv()`].
pub(super) fn side_table_csv<T: Borrow<Row>>(
    file: &str,
    rows: &[T],
    own: impl Fn(&T, &str) -> Option<String>,
) -> Result<Vec<u8>> {
    written(|writer| {
        writer.write_record(SideTable::names(file))?;
        rows.iter().try_for_each(|row| {
            let cell = |name| own(row, name).unwrap_or_else(|| row.borrow().cell(name).to_string());
            writer.write_record(SideTable::names(file).map(cell))
        })
    })
}

/// Writes files, given by names and contents, into an existing folder; each file appears only when it is complete.
/// Returns their paths.
///
/// # Errors
/// A file cannot be written.
pub fn write_files<N: AsRef<Path>>(
    folder: &Path,
    files: impl IntoIterator<Item = (N, Vec<u8>)>,
) -> Result<Vec<PathBuf>> {
    let write = |(name, bytes): (N, Vec<u8>)| {
        let path = folder.join(name);
        write_whole(&path, |file| file.write_all(&bytes)).map(|()| path)
    };
    files.into_iter().map(write).collect()
}

/// Returns a Markdown description of every column of `compare.csv` and of the other result tables.
pub fn columns_markdown() -> String {
    let mut out = String::from(
        "# Columns of compare.csv\n\n\
        One row for each method and setting. `compare.json` has the same columns as keys, and after them `scene_file`, \
        `volume_sha256` and `transfer_function_sha256`. What was not measured is empty (`null` in JSON), and a setting is empty where the method has no such key. Errors are of transmittance from the \
        light, 0 to 1.\n",
    );
    out += &page(COLUMNS.iter().map(|Column { name, unit, about }| [*name, *unit, about.as_str()]));
    for SideTable { file, about, columns } in SIDE_TABLES.iter() {
        out += &format!("\n# Columns of {file}\n\n{about}\n");
        out += &page(columns.iter().map(|column| column.each_ref().map(String::as_str)));
    }
    out
}

fn page<'a>(columns: impl Iterator<Item = [&'a str; 3]>) -> String {
    let line =
        |[name, unit, about]: [&str; 3]| table_line([format!("`{name}`"), unit.to_owned(), about.to_owned()]);
    "\n| column | unit | what it is |\n| --- | --- | --- |\n".to_owned()
        + &columns.map(line).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::table::tests::sample_rows;
    use crate::report::run::SceneRecord;

    #[test]
    fn csv_reads_back_to_the_same_values() {
        let mut rows = sample_rows();
        rows[0].point_err_max = Some(0.1 + 0.2);
        rows[0].point_err_p99 = Some(5e-324);
        rows[0].image_rmse = Some(1.0 / 3.0);
        let written = table_csv(&rows).unwrap();
        let mut reader = csv::Reader::from_reader(written.as_slice());
        let names: Vec<_> = COLUMNS.iter().map(|c| c.name).collect();
        assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>(), names);
        let records: Vec<_> = reader.records().map(|r| r.unwrap()).collect();
        assert_eq!(records.len(), rows.len());
        for (record, row) in records.iter().zip(&rows) {
            for ((text, cell), column) in record.iter().zip(row.cells()).zip(&names) {
                let same = match cell {
                    Cell::Empty => text.is_empty(),
                    Cell::Text(t) => text == t,
                    Cell::Integer(n) => text.parse() == Ok(n),
                    Cell::Real(x) => text.parse::<f64>().is_ok_and(|y| y.to_bits() == x.to_bits()),
                    Cell::Flag(yes) => text == yes.to_string(),
                };
                assert!(same, "{column}: {text}");
            }
        }
        let column = |name: &str| COLUMNS.iter().position(|c| c.name == name).unwrap();
        let held: Vec<&str> = records.iter().map(|r| &r[column("bound_held")]).collect();
        assert_eq!(held, ["", "", "true", "", ""]);
        assert_eq!(&records[1][column("image_psnr")], "inf");
        assert_eq!(&records[2][column("left_out")], rows[2].left_out);
    }

    #[test]
    fn json_holds_the_same_rows_in_the_same_order() {
        let rows = sample_rows();
        let scene = SceneRecord {
            name: rows[0].scene.clone(),
            volume_sha256: Some("5a".into()),
            tf_sha256: "7f".into(),
            ..SceneRecord::default()
        };
        let text = table_json(&rows, &Run { scenes: vec![scene], ..Run::default() }).unwrap();
        let parsed: Vec<serde_json::Map<String, serde_json::Value>> = serde_json::from_str(&text).unwrap();
        for (object, row) in parsed.iter().zip(&rows) {
            assert_eq!(object.len(), COLUMNS.len() + 3);
            assert_eq!(
                (&object["volume_sha256"], &object["transfer_function_sha256"]),
                (&"5a".into(), &"7f".into())
            );
            assert!(object["scene_file"].is_null());
            for (cell, column) in row.cells().into_iter().zip(COLUMNS.iter().map(|c| c.name)) {
                let value = &object[column];
                match cell {
                    Cell::Empty => assert!(value.is_null(), "{column}"),
                    Cell::Text(t) => assert_eq!(value, &t),
                    Cell::Integer(n) => assert_eq!(value, &n),
                    Cell::Real(x) if x.is_infinite() => assert!(value.is_null(), "{column}"),
                    Cell::Real(x) => assert_eq!(value, &x),
                    Cell::Flag(yes) => assert_eq!(value, &yes),
                }
            }
        }
        let places: Vec<_> =
            COLUMNS.iter().map(|c| text.find(&format!("\"{}\":", c.name)).unwrap()).collect();
        assert!(places.is_sorted());
    }

    #[test]
    fn the_page_of_columns_is_what_the_code_says() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/columns.md");
        if std::env::var_os("UMBRAVOX_REWRITE").is_some() {
            std::fs::write(path, columns_markdown()).unwrap();
        }
        let written = std::fs::read_to_string(path).unwrap_or_default();
        assert!(written == columns_markdown(), "run this test with UMBRAVOX_REWRITE=1 to write {path} anew");
    }
}
