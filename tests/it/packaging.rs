//! Packages: the crate holds what a build needs and no more, and every packaging file names this version.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Largest size of one packaged file, bytes.
const LARGEST_FILE: u64 = 1 << 20;
/// Largest size of all packaged files, bytes before compression. The limit of crates.io is 10 MiB after it.
const LARGEST_PACKAGE: u64 = 8 << 20;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(name: &str) -> String {
    fs::read_to_string(root().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Files of the package of the crate; cargo makes some of them, which are not in the repository.
fn packaged() -> BTreeSet<PathBuf> {
    let output = Command::new(env!("CARGO"))
        .args(["package", "--list", "--allow-dirty", "--offline"])
        .current_dir(root())
        .output()
        .expect("cargo starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let list = String::from_utf8(output.stdout).unwrap();
    list.lines().map(PathBuf::from).filter(|path| root().join(path).is_file()).collect()
}

/// Files below a folder of the repository, relative to its root.
fn files_below(folder: &str) -> Vec<PathBuf> {
    let files = walkdir::WalkDir::new(root().join(folder)).into_iter().map(Result::unwrap);
    let files = files.filter(|entry| entry.file_type().is_file());
    files.map(|entry| entry.path().strip_prefix(root()).unwrap().to_owned()).collect()
}

/// Joins a path that may begin with `..` to a folder.
fn join(folder: &Path, path: &str) -> PathBuf {
    let mut joined = folder.to_owned();
    for part in Path::new(path).components() {
        match part {
            std::path::Component::ParentDir => _ = joined.pop(),
            part => joined.push(part),
        }
    }
    joined
}

#[test]
fn the_package_is_small() {
    let sizes: Vec<_> =
        packaged().into_iter().map(|path| (root().join(&path).metadata().unwrap().len(), path)).collect();
    let large: Vec<_> = sizes.iter().filter(|(size, _)| *size > LARGEST_FILE).collect();
    assert!(large.is_empty(), "`include` of Cargo.toml has large files: {large:?}");
    let sum: u64 = sizes.iter().map(|(size, _)| size).sum();
    assert!(sum <= LARGEST_PACKAGE, "the package has {sum} bytes");
}

#[test]
fn the_package_has_every_file_of_a_build() {
    let packaged = packaged();
    let sources = ["src", "shaders", "transfer_functions"].into_iter().flat_map(files_below);
    let mut needed: Vec<PathBuf> = sources.collect();
    for path in needed.clone().iter().filter(|path| path.extension().is_some_and(|e| e == "rs")) {
        let text = read(path.to_str().unwrap());
        for included in text.split("include_str!(\"").skip(1).filter_map(|rest| rest.split('"').next()) {
            needed.push(join(path.parent().unwrap(), included));
        }
    }
    needed
        .extend(["build.rs", "Cargo.lock", "Cargo.toml", "LICENSE-MIT", "LICENSE-APACHE"].map(PathBuf::from));
    let missing: Vec<_> = needed.iter().filter(|path| !packaged.contains(*path)).collect();
    assert!(missing.is_empty(), "`include` of Cargo.toml lacks {missing:?}");
}

#[test]
fn packaging_files_name_this_version() {
    let version = env!("CARGO_PKG_VERSION");
    for (name, line) in [
        ("CITATION.cff", format!("version: {version}")),
        ("packaging/conda/recipe.yaml", format!("  version: \"{version}\"")),
        ("python/Cargo.toml", format!("version = \"{version}\"")),
    ] {
        assert!(read(name).lines().any(|l| l == line), "{name}: no line `{line}`");
    }
}

/// Names behind a mark in a text.
fn names(text: &str, mark: &str) -> BTreeSet<String> {
    let name = |rest: &str| rest.chars().take_while(|c| c.is_ascii_alphanumeric()).collect();
    text.split(mark).skip(1).map(name).collect()
}

#[test]
fn the_draft_of_the_paper_cites_its_references() {
    let entries = read("packaging/joss/paper.bib");
    let lines = entries.lines().filter(|line| line.starts_with('@'));
    let defined: BTreeSet<String> =
        lines.filter_map(|line| line.split_once('{')?.1.strip_suffix(',').map(str::to_owned)).collect();
    assert_eq!(names(&read("packaging/joss/paper.md"), "[@"), defined);
}

#[test]
fn the_desktop_entry_is_that_of_the_window() {
    let entry = read("packaging/umbravox.desktop");
    let value = |key: &str| {
        let found = entry.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        found.unwrap_or_else(|| panic!("no {key}"))
    };
    // A desktop finds the entry of a window by its app id, which is the name of the entry's file.
    assert!(read("src/app/window.rs").contains(".with_app_id(\"umbravox\")"));
    assert_eq!(value("StartupWMClass"), "umbravox");
    assert!(root().join(format!("packaging/{}.svg", value("Icon"))).exists());
    let command = value("Exec").replace("%f", "ct.nii.gz");
    umbravox::cli::command().try_get_matches_from(command.split(' ')).unwrap();
    // Types that are not registered come with the program.
    let types = read("packaging/umbravox-mime.xml");
    for mime in value("MimeType").split_terminator(';').filter(|mime| *mime != "application/dicom") {
        assert!(types.contains(&format!("<mime-type type=\"{mime}\">")), "{mime}");
    }
}
