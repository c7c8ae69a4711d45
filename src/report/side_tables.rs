//! Columns of all tables but `compare.csv`: name, unit, and description.

use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// Table besides the comparison: its file and the meaning of its columns.
#[derive(Debug, Deserialize)]
pub struct SideTable {
    /// Name of the table's file.
    pub file: String,
    /// Description of the table's rows and of the command that writes it.
    pub about: String,
    /// Name, unit and meaning of each column, in order.
    pub columns: Vec<[String; 3]>,
}

/// Every one that a command writes, from `side_tables.toml`.
pub static SIDE_TABLES: LazyLock<Vec<SideTable>> = LazyLock::new(|| {
    // A test reads the built-in file.
    let file: Option<BTreeMap<String, Vec<SideTable>>> =
        toml::from_str(include_str!("side_tables.toml")).ok();
    file.and_then(|mut file| file.remove("table")).unwrap_or_default()
});

impl SideTable {
    /// Names of the columns of a table's file.
    pub fn names(file: &str) -> impl Iterator<Item = &'static str> {
        let table = SIDE_TABLES.iter().find(|table| table.file == file);
        table.into_iter().flat_map(|table| table.columns.iter().map(|[name, ..]| name.as_str()))
    }
}
