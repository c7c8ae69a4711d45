//! Steps to add a method, checked on the example: with its folders and its line of the registry it is
//! everywhere (`docs/adding-a-method.md`).

#[path = "common/mod.rs"]
mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use umbravox::shadow::{COMPARED, METHODS, entry, parse_list};

fn root() -> PathBuf {
    env!("CARGO_MANIFEST_DIR").into()
}

fn umbravox(args: &[&str]) -> String {
    let run = Command::new(env!("CARGO_BIN_EXE_umbravox")).args(args).output().unwrap();
    assert!(run.status.success(), "{args:?}: {}", String::from_utf8_lossy(&run.stderr));
    String::from_utf8(run.stdout).unwrap()
}

/// Files under a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

#[test]
fn nothing_but_its_folders_and_its_lines_knows_it() {
    let own = ["src/shadow/half", "shaders/shadow/half"].map(|f| root().join(f));
    for path in [root().join("src"), root().join("shaders")].iter().flat_map(|f| files(f)) {
        let Ok(text) = fs::read_to_string(&path) else { continue };
        let named = ["shadow::half", "super::half", "mod half;", "shadow/half/"];
        let lines = text.lines().filter(|l| named.iter().any(|n| l.contains(n))).count();
        let allowed = match path.strip_prefix(root()).unwrap().to_str().unwrap() {
            "src/shadow/mod.rs" | "src/shadow/registry.rs" => 1,
            _ => 0,
        };
        assert!(own.iter().any(|f| path.starts_with(f)) || lines == allowed, "{}: {lines}", path.display());
    }
}

#[test]
fn it_is_in_the_help_and_the_default_comparison() {
    assert!(umbravox(&["render", "--help"]).contains(" half;"));
    assert!(umbravox(&["methods"]).contains("\nhalf "));
    let settings = umbravox(&["methods", "half"]);
    for word in ["half", "share=0..1", "[default: 0.5]"] {
        assert!(settings.contains(word), "{word}: {settings}");
    }
    assert!(COMPARED.contains("half:share=0.25,0.5") && METHODS.iter().any(|m| m.name == "half"));
    let params: Vec<_> = parse_list("half:share=0.25,0.5").unwrap().iter().map(|m| m.params()).collect();
    assert_eq!(params, ["share=0.25", "share=0.5"]);
    assert_eq!(parse_list("half:share=2").unwrap_err().exit_status(), 2);
}

#[test]
fn a_table_has_its_rows_its_column_and_its_mark() {
    if !common::has_adapter() {
        return;
    }
    let out = std::env::temp_dir().join(format!("umbravox-half-{}", std::process::id()));
    let folder = out.to_str().unwrap();
    let few = ["--repeats", "1", "--points", "200", "--rays", "20", "--size", "48x48"];
    let methods = ["compare", "phantom:sphere:24", "--methods", "half;none", "-o", folder];
    umbravox(&[&methods[..], &few].concat());
    let mut table = csv::Reader::from_path(out.join("compare.csv")).unwrap();
    let share = table.headers().unwrap().iter().position(|c| c == "share").expect("a column of its own");
    let rows: Vec<_> = table.records().map(|r| r.unwrap()[share].to_owned()).collect();
    assert_eq!(rows, ["0.5", ""]);
    let [r, g, b] = entry("half").unwrap().style.color;
    let plot = fs::read_to_string(out.join("compare.svg")).unwrap().to_lowercase();
    let hex = format!("#{r:02x}{g:02x}{b:02x}");
    assert!(plot.contains(&hex) || plot.contains(&format!("rgb({r},{g},{b})")), "{hex}");
    fs::remove_dir_all(out).unwrap();
}
