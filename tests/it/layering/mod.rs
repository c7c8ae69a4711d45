//! Layering of the crate: top-level modules import only lower ones, and files of one module do not import each other
//! in a cycle.

mod imports;

use imports::Crate;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Every top-level module, the highest first: name, purpose, and the modules that it may import if these are fewer
/// than all lower ones.
const LAYERS: [(&str, &str, Option<&[&str]>); 24] = [
    ("app", "The window.", None),
    ("cli", "The commands.", None),
    ("benchmark", "The frozen benchmark: cells, searches, rankings.", None),
    ("engine", "Interactive session without a window toolkit: shadow cache, requests, render thread.", None),
    ("open", "From what a user names to what the program works on.", None),
    ("replication", "Claims of the papers, and the stability suite.", None),
    ("page", "HTML pages that draw a scene in a browser.", None),
    ("report", "From rows to what a reader gets.", None),
    ("measure", "Rows: errors, times and facts of every method.", None),
    ("render", "Eye rays: plan, ray caster, display, queries.", None),
    ("shadow", "The shadow methods, a folder each.", None),
    ("field", "The scalar field on a device, and what marches through it.", None),
    ("gpu", "Device and limits, buffers, pipelines, timestamps.", Some(&["error"])),
    ("exact", "The float64 reference.", Some(&["scene", "mesh", "transfer", "volume", "random", "error"])),
    ("formats", "Readers and writers of volumes.", None),
    ("phantom", "Built-in volumes.", None),
    ("strands", "Polylines with a thickness, and the volume that stands for them.", None),
    ("scene", "Camera, light and picture settings.", None),
    ("mesh", "Opaque triangles, rays that meet them, and the files that hold them.", None),
    ("transfer", "Extinction and colour as functions of the value.", None),
    ("volume", "Values on a grid with an affine.", None),
    ("files", "Text in, whole files and pictures out, progress of reading.", None),
    ("random", "Pseudo-random numbers from a seed.", None),
    ("error", "The one error type.", None),
];

/// Top-level modules at the same height: neither imports the other.
const INTERFACES: [&str; 2] = ["app", "cli"];

/// Known imports of a higher or equal layer, as a file and the module it imports. This list may only become shorter.
const KNOWN_IMPORTS: &[(&str, &str)] = &[];

/// Folders of shaders, the lowest layer first.
const SHADER_LAYERS: [&str; 3] = ["field", "shadow", "render"];

/// Shader modules that a lower shader imports and every method above it defines (interfaces that are composed in).
const SHADER_CONTRACTS: &[&str] = &["umbravox::sink"];

/// Paths of the files below a folder, with their texts.
fn texts(folder: &Path, ending: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for path in fs::read_dir(next).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == ending) {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap().replace('\\', "/");
                found.push((name, fs::read_to_string(path).unwrap()));
            }
        }
    }
    found
}

fn this_crate() -> Crate {
    let mut files = texts(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), "rs");
    files.retain(|(path, _)| path != "main.rs");
    Crate::new(&files)
}

#[test]
fn imports_go_down() {
    let known: BTreeSet<_> = KNOWN_IMPORTS.iter().map(|(f, r)| (f.to_string(), r.to_string())).collect();
    let found = this_crate().upward();
    let new: Vec<_> = found.iter().filter(|(f, r, _)| !known.contains(&(f.clone(), r.clone()))).collect();
    assert!(new.is_empty(), "these go up or sideways:\n{new:#?}");
    let left: BTreeSet<_> = found.into_iter().map(|(file, layer, _)| (file, layer)).collect();
    let gone: Vec<_> = known.difference(&left).collect();
    assert!(gone.is_empty(), "these exceptions are no longer needed: {gone:#?}");
}

#[test]
fn files_of_a_module_do_not_import_each_other_in_a_cycle() {
    let found = this_crate().cycles();
    assert!(found.is_empty(), "these are in cycles:\n{found:#?}");
}

#[test]
fn shaders_import_down() {
    let files = texts(&Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders"), "wgsl");
    assert_eq!(upward_shaders(&files), Vec::<String>::new());
}

/// Every `#import` of a shader from a higher layer.
fn upward_shaders(files: &[(String, String)]) -> Vec<String> {
    let rank = |path: &str| {
        let layer = match path.split_once('/') {
            Some(("common", _)) => "field",
            Some((layer, _)) => layer,
            None => "render",
        };
        let layer = SHADER_LAYERS.iter().position(|r| *r == layer);
        layer.unwrap_or_else(|| panic!("shaders/{path} is in no layer of shaders"))
    };
    let after = |line: &str, word: &str| line.trim().strip_prefix(word).map(|rest| rest.trim().to_owned());
    let defined: Vec<(String, usize)> = files
        .iter()
        .flat_map(|(path, text)| text.lines().map(move |line| (path, line)))
        .filter_map(|(path, line)| Some((after(line, "#define_import_path")?, rank(path))))
        .collect();
    let mut found = Vec::new();
    for (path, text) in files {
        for import in text.lines().filter_map(|line| after(line, "#import")) {
            let names = |name: &str| import.strip_prefix(name).is_some_and(|rest| rest.starts_with("::"));
            let up = defined.iter().filter(|(name, _)| names(name)).all(|(_, layer)| *layer > rank(path))
                && defined.iter().any(|(name, _)| names(name));
            if up && !SHADER_CONTRACTS.iter().any(|contract| names(contract)) {
                found.push(format!("{path}: {import}"));
            }
        }
    }
    found
}

/// Violations of every kind are found in a small crate that contains them.
#[test]
fn planted_violations_are_found() {
    let files = |list: &[(&str, &str)]| -> Vec<(String, String)> {
        list.iter().map(|(path, text)| (path.to_string(), text.to_string())).collect()
    };
    let planted = Crate::new(&files(&[
        ("lib.rs", "pub mod cli; pub mod error; pub use error::{Error, Result};"),
        ("error.rs", "pub struct Error;"),
        (
            "volume/mod.rs",
            "mod load; mod raw; #[cfg(test)] mod odd; pub use load::{load, Spec as Wanted}; pub struct Volume;
             #[macro_export] macro_rules! each { () => { $crate::volume::Volume } }
             #[cfg(test)] mod tests { use crate::app::Window; }",
        ),
        ("volume/odd.rs", "use crate::app::Window;"),
        ("volume/load.rs", "use super::raw::read; use crate::{error::Error, transfer::{self, Table}};"),
        ("volume/raw.rs", "use super::Wanted; fn read() { let c = format!(\"{}\", crate::cli::NAME); }"),
        ("transfer/mod.rs", "use crate::each; use crate::Result; use crate::volume as v; fn f(v: v::Volume) {}"),
        ("cli/mod.rs", "mod one { fn f() -> super::super::app::Window { super::super::exact::field() } }"),
        ("app/mod.rs", "pub(crate) mod a; pub(crate) use a::A; use std::fs; pub struct Window;"),
        ("app/a.rs", "impl super::Window {} pub struct A;"),
        ("exact.rs", "use crate::strands::Strands; use crate::scene::Light;"),
        ("gpu.rs", "use crate::nothing::Of;"),
    ]));
    let upward: BTreeSet<_> = planted.upward().into_iter().map(|(file, layer, _)| (file, layer)).collect();
    let expected = [
        ("cli.rs", "app"),
        ("exact.rs", "strands"),
        ("gpu.rs", "nothing"),
        ("volume/load.rs", "transfer"),
        ("volume/raw.rs", "cli"),
    ];
    assert_eq!(upward, expected.map(|(file, layer)| (file.to_owned(), layer.to_owned())).into());
    let cycles: Vec<_> = planted.cycles().into_keys().collect();
    assert_eq!(cycles, ["volume/load.rs", "volume/raw.rs"], "`app/mod.rs` only hands on what `app/a.rs` has");

    let shaders = files(&[
        ("field/march.wgsl", "#define_import_path umbravox::march\n#import umbravox::sink::Sink"),
        ("shadow/a/sink.wgsl", "#define_import_path umbravox::sink\n#import umbravox::march::march"),
        ("shadow/a/layout.wgsl", "#define_import_path umbravox::layout"),
        ("render/raycast.wgsl", "#import umbravox::layout::{a, b}"),
        ("field/light.wgsl", "#import umbravox::layout::row"),
    ]);
    assert_eq!(upward_shaders(&shaders), ["field/light.wgsl: umbravox::layout::row"]);
}
