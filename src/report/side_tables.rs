//! Column names, units and descriptions of all result tables except the comparison table `compare.csv`.

use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// Description of a result table other than the comparison table `compare.csv`: its file and its columns.
#[derive(Debug, Deserialize)]
pub struct SideTable {
    /// File name of the result table, for example `ablation.csv`.
    pub file: String,
    /// Description of the result table's rows and of the command that writes it.
    pub about: String,
    /// Name, unit and meaning of each column of the result table, in order.
    pub columns: Vec<[String; 3]>,
}

/// Descriptions of all result tables except the comparison table `compare.csv`, read from `side_tables.toml`.
pub static SIDE_TABLES: LazyLock<Vec<SideTable>> = LazyLock::new(|| {
    // A test reads the built-in file.
    let file: Option<BTreeMap<String, Vec<SideTable>>> =
        toml::from_str(include_str!("side_tables.toml")).ok();
    file.and_then(|mut file| file.remove("table")).unwrap_or_default()
});

impl SideTable {
    /// Column names of the result table with a given file name.
    pub fn names(file: &str) -> impl Iterator<Item = &'static str> {
        let table = SIDE_TABLES.iter().find(|table| table.file == file);
        table.into_iter().flat_map(|table| table.columns.iter().map(|[name, ..]| name.as_str()))
    }
}
