//! Registry of public data sets, `data/datasets.toml`: its tables in `data/README.md`, and hashes of the files.

use crate::common::scan_if_present;
use serde::Deserialize;
use std::fs;
use std::path::{Path, PathBuf};
use umbravox::files::hash::sha256;
use umbravox::open::{self, VolumeSpec};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Registry {
    dataset: Vec<Dataset>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Dataset {
    name: String,
    content: String,
    format: String,
    voxels: Option<[usize; 3]>,
    spacing_mm: Option<[f64; 3]>,
    licence: String,
    address: String,
    file: Option<String>,
    sha256: Option<String>,
    open: String,
}

fn in_data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

fn registry() -> Vec<Dataset> {
    let text = fs::read_to_string(in_data("datasets.toml")).unwrap();
    toml::from_str::<Registry>(&text).unwrap_or_else(|error| panic!("data/datasets.toml: {error}")).dataset
}

fn joined(numbers: &[impl ToString], by: &str) -> String {
    numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(by)
}

/// Table of all data sets.
fn sources(sets: &[Dataset]) -> String {
    let mut table =
        String::from("| where | content | format | licence | how to open it |\n|---|---|---|---|---|\n");
    for set in sets {
        let Dataset { name, content, format, licence, address, open, .. } = set;
        table += &format!("| [{name}]({address}) | {content} | {format} | {licence} | `{open}` |\n");
    }
    table
}

/// Table of the single files with their hashes.
fn files(sets: &[Dataset]) -> String {
    let mut table = String::from("| file | voxels | spacing (mm) | SHA-256 |\n|---|---|---|---|\n");
    for set in sets {
        let Some(file) = &set.file else { continue };
        let voxels = set.voxels.map_or(String::new(), |voxels| joined(&voxels, "x"));
        let spacing = set.spacing_mm.map_or(String::new(), |spacing| joined(&spacing, "x"));
        let hash = set.sha256.as_ref().map_or("to be computed".into(), |hash| format!("`{hash}`"));
        table += &format!("| `{file}` | {voxels} | {spacing} | {hash} |\n");
    }
    table
}

/// Replaces the table that has the same heads of columns, up to the next empty line.
fn with_table(page: &str, table: &str) -> String {
    let (before, rest) = page.split_once(table.lines().next().unwrap()).expect("the heads of columns");
    let (_, after) = rest.split_once("\n\n").expect("an empty line behind the table");
    format!("{before}{table}\n{after}")
}

#[test]
fn the_tables_of_the_page_are_those_of_the_registry() {
    let sets = registry();
    let path = in_data("README.md");
    let page = fs::read_to_string(&path).unwrap();
    let made = with_table(&page, &sources(&sets));
    let made = with_table(&made, &files(&sets));
    if std::env::var_os("UMBRAVOX_REWRITE").is_some() {
        fs::write(&path, &made).unwrap();
    }
    assert!(fs::read_to_string(&path).unwrap() == made, "run this test with UMBRAVOX_REWRITE=1");
}

#[test]
fn every_command_of_the_registry_is_accepted() {
    for set in registry() {
        umbravox::cli::command().try_get_matches_from(set.open.split(' ')).expect("a command");
        assert!(set.address.starts_with("http"), "{}: {}", set.name, set.address);
        let is_hash = |hash: &String| hash.len() == 64 && hash.bytes().all(|b| b.is_ascii_hexdigit());
        assert!(set.sha256.as_ref().is_none_or(is_hash), "{}: sha256", set.name);
        assert!(set.sha256.is_none() || set.file.is_some(), "{}: a hash without a file", set.name);
    }
}

/// Files that are not there are no fault: other tests say that scans are missing.
#[test]
fn files_that_are_there_are_those_of_the_registry() {
    for set in registry() {
        let Some(name) = set.file.as_deref().and_then(|file| file.strip_suffix(".nii.gz")) else { continue };
        let Some(path) = scan_if_present(name) else { continue };
        let bytes = fs::read(&path).unwrap();
        assert_eq!(Some(sha256(&bytes)), set.sha256, "{}: another file", path.display());
        let volume = open::load(&VolumeSpec::new(path.to_str().unwrap())).unwrap();
        assert_eq!(Some(volume.dims()), set.voxels, "{name}");
    }
}
