//! The crate's rooms are a stack: imports go down only, and files of one room do not import each other in a circle.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Every room, the topmost first: its name, what it is for, and where it is narrower than "whatever is below" the rooms
/// that it may import.
const ROOMS: [(&str, &str, Option<&[&str]>); 16] = [
    ("app", "The window: a front door.", None),
    ("cli", "The commands: a front door.", None),
    ("open", "From what a user names to what the program works on.", None),
    ("report", "From rows to what a reader gets.", None),
    ("measure", "Rows: errors, times and facts of every method.", None),
    ("render", "Eye rays: plan, ray caster, display, queries.", None),
    ("shadow", "The shadow methods, a folder each.", None),
    ("field", "The scalar field on a device, and what marches through it.", None),
    ("gpu", "Device and limits, buffers, pipelines, timestamps.", Some(&["error"])),
    ("exact", "The float64 reference.", Some(&["scene", "transfer", "volume", "error"])),
    ("strands", "Polylines with a thickness, and the volume that stands for them.", None),
    ("scene", "Camera, light and picture settings.", None),
    ("transfer", "Extinction and colour as functions of the value.", None),
    ("volume", "Values on a grid with an affine, and the files that hold them.", None),
    ("files", "Text in, whole files and pictures out, progress of reading.", None),
    ("error", "The one error type.", None),
];

/// Rooms beside and not above each other: neither imports the other.
const FRONT_DOORS: [&str; 2] = ["app", "cli"];

/// What still goes up or sideways, as a file and the room that it imports: to become shorter, never longer.
const KNOWN_IMPORTS: &[(&str, &str)] = &[
    ("app/open.rs", "cli"),
    ("app/opening.rs", "cli"),
    ("app/window.rs", "cli"),
    ("cli/view.rs", "app"),
    ("shadow/deep_count.rs", "render"),
    ("shadow/layers/mod.rs", "render"),
    ("shadow/mod.rs", "render"),
    ("shadow/parts.rs", "render"),
    ("transfer/presets.rs", "strands"),
    ("volume/bricks.rs", "transfer"),
    ("volume/load.rs", "strands"),
];

/// Files that still lie in a circle of their room: to become fewer, never more.
const KNOWN_CIRCLES: &[&str] = &[
    "app/camera.rs",
    "app/comparison/mod.rs",
    "app/comparison/task.rs",
    "app/difference/mod.rs",
    "app/document.rs",
    "app/engine.rs",
    "app/flicker.rs",
    "app/jobs.rs",
    "app/mod.rs",
    "app/open.rs",
    "app/presets.rs",
    "app/settings.rs",
    "app/viewport.rs",
    "app/worker.rs",
    "cli/compare.rs",
    "cli/info.rs",
    "cli/mod.rs",
    "cli/probe.rs",
    "cli/probe_curve.rs",
    "cli/render.rs",
    "cli/scene_args.rs",
    "cli/scene_file.rs",
    "cli/stability.rs",
    "cli/view.rs",
    "cli/voxelise.rs",
    "measure/compare/mod.rs",
    "measure/compare/rounds.rs",
    "measure/facts.rs",
    "report/plot/front.rs",
    "report/plot/mod.rs",
    "measure/prepare.rs",
    "report/tables/columns.rs",
    "report/tables/mod.rs",
    "render/device_transfer.rs",
    "render/display.rs",
    "render/mod.rs",
    "render/picture.rs",
    "shadow/deep.rs",
    "shadow/layers/bounding_opacity.rs",
    "shadow/layers/deep_opacity.rs",
    "shadow/layers/keys.rs",
    "shadow/layers/mod.rs",
    "shadow/layers/opacity.rs",
    "shadow/layers/ratio.rs",
    "shadow/mod.rs",
    "shadow/plain.rs",
];

/// Rooms of shaders, the lowest first.
const SHADER_ROOMS: [&str; 3] = ["field", "shadow", "render"];

/// Names that a lower shader imports and each method above it defines: they are composed in, and contracts.
const SHADER_CONTRACTS: &[&str] = &["umbravox::sink"];

type Module = Vec<String>;

/// What one file says about others.
#[derive(Default)]
struct Source {
    /// Names of the modules that it declares with `mod NAME;`.
    children: BTreeSet<String>,
    /// Names that a `use` brings into its scope, and what they stand for, from the crate's root.
    aliases: BTreeMap<String, Module>,
    /// Names that it hands on (`pub use`) and does not use itself as far as can be told.
    handed_on: BTreeSet<String>,
    /// Paths from the crate's root, outside of tests.
    paths: BTreeSet<Module>,
    /// Words outside of `use`.
    words: BTreeSet<String>,
}

/// All files of a crate by their modules.
struct Crate(BTreeMap<Module, Source>);

impl Crate {
    /// From pairs of a path below `src` and the text.
    fn new(files: &[(String, String)]) -> Self {
        let mut sources = BTreeMap::new();
        let (mut tests, mut macros) = (Vec::new(), Vec::new());
        for (path, text) in files {
            let module = module_of(path);
            let tokens: Vec<TokenTree> = text.parse::<TokenStream>().expect(path).into_iter().collect();
            let mut source = Source::default();
            let mut reader = Reader { source: &mut source, tests: &mut tests, macros: &mut macros };
            reader.children(&tokens);
            reader.read(&tokens, &module, &module);
            source.handed_on.retain(|name| !source.words.contains(name));
            sources.insert(module, source);
        }
        // What `#[macro_export]` puts at the root is the room's in which it is written.
        let root: &mut Source = sources.entry(Module::new()).or_default();
        root.aliases.extend(macros);
        for module in tests {
            sources.remove(&module);
        }
        Self(sources)
    }

    /// The file in which the item of a path is written, as far as `use` tells.
    fn home_of(&self, path: &[String], depth: usize) -> Module {
        let mut at = Module::new();
        for (i, name) in path.iter().enumerate() {
            let next: Module = at.iter().chain([name]).cloned().collect();
            let alias = self.0.get(&at).and_then(|source| source.aliases.get(name));
            match alias {
                _ if self.0.contains_key(&next) => at = next,
                Some(alias) if depth < 8 => {
                    let whole: Module = alias.iter().chain(&path[i + 1..]).cloned().collect();
                    return self.home_of(&whole, depth + 1);
                }
                _ => break,
            }
        }
        at
    }

    /// The room that a path names, behind what stands at the crate's root.
    fn room_of(&self, path: &[String]) -> Option<String> {
        let first = path.first()?;
        let root = &self.0[&Module::new()];
        root.aliases.get(first).map_or_else(|| Some(first.clone()), |alias| alias.first().cloned())
    }

    /// Every import that goes up or sideways: the file, the room and the path.
    fn upward(&self) -> Vec<(String, String, String)> {
        let rank = |room: &str| ROOMS.iter().position(|r| r.0 == room);
        let mut found = Vec::new();
        for (module, source) in self.0.iter().filter(|(module, _)| !module.is_empty()) {
            let own = &module[0];
            let (_, _, only) = ROOMS.iter().find(|r| r.0 == own).unwrap_or_else(|| {
                panic!("src/{own} is no room: the top of src holds lib.rs, main.rs and rooms only")
            });
            for path in &source.paths {
                let Some(room) = self.room_of(path).filter(|room| room != own) else { continue };
                let sideways = FRONT_DOORS.contains(&own.as_str()) && FRONT_DOORS.contains(&room.as_str());
                let down = rank(&room).is_some_and(|r| Some(r) > rank(own)) && !sideways;
                if !down || only.is_some_and(|only| !only.contains(&room.as_str())) {
                    found.push((self.name_of(module), room, path.join("::")));
                }
            }
        }
        found
    }

    /// Every file that reaches itself through files of its room, with a shortest way around.
    fn circles(&self) -> BTreeMap<String, String> {
        let edges = |module: &Module| -> BTreeSet<Module> {
            let source = &self.0[module];
            let handed_on: BTreeSet<_> =
                source.handed_on.iter().filter_map(|name| source.aliases.get(name)).collect();
            let paths = source.paths.iter().filter(|path| !handed_on.contains(path));
            let homes = paths.map(|path| self.home_of(path, 0));
            homes.filter(|home| home != module && home.first() == module.first()).collect()
        };
        let mut found = BTreeMap::new();
        for module in self.0.keys().filter(|module| !module.is_empty()) {
            let mut ways: Vec<Vec<Module>> = edges(module).into_iter().map(|next| vec![next]).collect();
            let mut seen = BTreeSet::new();
            let mut at = 0;
            while at < ways.len() {
                let last = &ways[at][ways[at].len() - 1];
                if last == module {
                    let way: Vec<_> = ways[at].iter().map(|m| self.name_of(m)).collect();
                    found.insert(self.name_of(module), way.join(" -> "));
                    break;
                }
                if seen.insert(last.clone()) {
                    let next: Vec<_> = edges(last)
                        .into_iter()
                        .map(|next| ways[at].iter().cloned().chain([next]).collect())
                        .collect();
                    ways.extend(next);
                }
                at += 1;
            }
        }
        found
    }

    fn name_of(&self, module: &Module) -> String {
        let folder = self.0.keys().any(|m| m.len() > module.len() && m.starts_with(module));
        format!("{}{}", module.join("/"), if folder { "/mod.rs" } else { ".rs" })
    }
}

fn module_of(path: &str) -> Module {
    let stem = path.trim_end_matches(".rs").trim_end_matches("/mod");
    if stem == "lib" { Module::new() } else { stem.split('/').map(Into::into).collect() }
}

/// Reads one file's tokens.
struct Reader<'a> {
    source: &'a mut Source,
    /// Modules for tests only.
    tests: &'a mut Vec<Module>,
    /// Exported macros, with the path that says where they are written.
    macros: &'a mut Vec<(String, Module)>,
}

impl Reader<'_> {
    fn children(&mut self, tokens: &[TokenTree]) {
        for t in tokens.windows(3).filter(|t| is_word(&t[0], "mod") && is_punct(Some(&t[2]), ';')) {
            self.source.children.insert(t[1].to_string());
        }
    }

    /// `file` is the module of the file, `here` that of the tokens: another one within `mod NAME { ... }`.
    fn read(&mut self, tokens: &[TokenTree], file: &Module, here: &Module) {
        let mut i = 0;
        while i < tokens.len() {
            let follows_colon = i > 0 && is_punct(tokens.get(i - 1), ':');
            match &tokens[i] {
                TokenTree::Punct(p) if p.as_char() == '#' && is_test(tokens.get(i + 1)) => {
                    let end = end_of_item(tokens, i + 2);
                    if let Some(at) = (i..end).find(|&at| is_word(&tokens[at], "mod")) {
                        self.tests.push(here.iter().cloned().chain([tokens[at + 1].to_string()]).collect());
                    }
                    i = end;
                    continue;
                }
                TokenTree::Ident(word) if *word == "use" && !follows_colon => {
                    let end = (i..tokens.len()).find(|&at| is_punct(tokens.get(at), ';'));
                    let end = end.unwrap_or(tokens.len());
                    let mut leaves = Vec::new();
                    use_tree(&tokens[i + 1..end], &mut Vec::new(), &mut leaves);
                    let public = i > 0 && is_public(&tokens[..i]);
                    for (path, name) in leaves {
                        if let Some(path) = self.absolute(&path, file, here) {
                            if public {
                                self.source.handed_on.insert(name.clone());
                            }
                            self.source.aliases.insert(name, path.clone());
                            self.source.paths.insert(path);
                        }
                    }
                    i = end;
                    continue;
                }
                TokenTree::Ident(word) => {
                    if *word == "macro_rules" && exported(&tokens[..i]) {
                        let name = tokens[i + 2].to_string();
                        self.macros.push((name.clone(), file.iter().cloned().chain([name]).collect()));
                    }
                    if *word == "mod" && matches!(tokens.get(i + 2), Some(TokenTree::Group(_))) {
                        let inner = here.iter().cloned().chain([tokens[i + 1].to_string()]).collect();
                        let TokenTree::Group(group) = &tokens[i + 2] else { unreachable!() };
                        self.read(&group.stream().into_iter().collect::<Vec<_>>(), file, &inner);
                        i += 3;
                        continue;
                    }
                    if *word == "mod" {
                        i += 3;
                        continue;
                    }
                    let mut path = vec![word.to_string()];
                    let mut at = i + 1;
                    while is_punct(tokens.get(at), ':') && is_punct(tokens.get(at + 1), ':') {
                        let Some(TokenTree::Ident(next)) = tokens.get(at + 2) else { break };
                        path.push(next.to_string());
                        at += 3;
                    }
                    if !follows_colon && path.len() > 1 {
                        self.source.paths.extend(self.absolute(&path, file, here));
                    }
                    self.source.words.insert(word.to_string());
                }
                TokenTree::Group(group) => {
                    self.read(&group.stream().into_iter().collect::<Vec<_>>(), file, here);
                }
                _ => {}
            }
            i += 1;
        }
    }

    /// A path from the crate's root; `None` for what is another crate's, or a name in scope whose `use` was seen.
    fn absolute(&self, path: &[String], file: &Module, here: &Module) -> Option<Module> {
        let up = path.iter().take_while(|name| *name == "super").count();
        let mut base = match path[0].as_str() {
            "crate" => return Some(path[1..].to_vec()).filter(|p| !p.is_empty()),
            "self" => here.clone(),
            "super" => here[..here.len() - up].to_vec(),
            name if self.source.children.contains(name) => file.clone(),
            _ => return None,
        };
        let skipped = if path[0] == "self" { 1 } else { up };
        base.extend_from_slice(&path[skipped..]);
        Some(base)
    }
}

/// The leaves of a `use` tree: whole path, and the name that it gets.
fn use_tree(tokens: &[TokenTree], before: &mut Vec<String>, leaves: &mut Vec<(Vec<String>, String)>) {
    for branch in tokens.split(|t| is_punct(Some(t), ',')).filter(|b| !b.is_empty()) {
        let length = before.len();
        let renamed = branch.iter().position(|t| is_word(t, "as"));
        for token in &branch[..renamed.unwrap_or(branch.len())] {
            match token {
                TokenTree::Ident(name) if *name != "self" || before.is_empty() => {
                    before.push(name.to_string())
                }
                TokenTree::Group(group) => {
                    use_tree(&group.stream().into_iter().collect::<Vec<_>>(), before, leaves);
                }
                _ => {}
            }
        }
        if !matches!(branch.last(), Some(TokenTree::Group(_))) {
            let name = renamed.map(|at| branch[at + 1].to_string()).or_else(|| before.last().cloned());
            leaves.push((before.clone(), name.unwrap_or_default()));
        }
        before.truncate(length);
    }
}

fn is_word(token: &TokenTree, word: &str) -> bool {
    matches!(token, TokenTree::Ident(ident) if *ident == word)
}

fn is_punct(token: Option<&TokenTree>, c: char) -> bool {
    matches!(token, Some(TokenTree::Punct(p)) if p.as_char() == c)
}

/// Whether an attribute's brackets are a `cfg` that only tests meet.
fn is_test(brackets: Option<&TokenTree>) -> bool {
    let text = brackets.map(ToString::to_string).unwrap_or_default();
    text.starts_with("[cfg") && text.contains("test") && !text.contains("not")
}

/// Behind the item that begins at `from`.
fn end_of_item(tokens: &[TokenTree], from: usize) -> usize {
    let ends = |t: &TokenTree| {
        is_punct(Some(t), ';') || matches!(t, TokenTree::Group(g) if g.delimiter() == Delimiter::Brace)
    };
    tokens[from..].iter().position(ends).map_or(tokens.len(), |at| from + at + 1)
}

/// Whether the tokens before an item end in `pub` or `pub(...)`.
fn is_public(before: &[TokenTree]) -> bool {
    let [.., last] = before else { return false };
    is_word(last, "pub")
        || matches!(before, [.., word, TokenTree::Group(g)] if is_word(word, "pub") && g.delimiter() == Delimiter::Parenthesis)
}

/// Whether the attribute right before an item exports it.
fn exported(before: &[TokenTree]) -> bool {
    before.last().is_some_and(|t| t.to_string().contains("macro_export"))
}

/// Paths below a folder, with the texts.
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
    let left: BTreeSet<_> = found.into_iter().map(|(file, room, _)| (file, room)).collect();
    let gone: Vec<_> = known.difference(&left).collect();
    assert!(gone.is_empty(), "these exceptions are no longer needed: {gone:#?}");
}

#[test]
fn files_of_a_room_do_not_import_each_other_in_a_circle() {
    let found = this_crate().circles();
    let new: Vec<_> = found.iter().filter(|(file, _)| !KNOWN_CIRCLES.contains(&file.as_str())).collect();
    assert!(new.is_empty(), "these are in circles:\n{new:#?}");
    let gone: Vec<_> = KNOWN_CIRCLES.iter().filter(|file| !found.contains_key(**file)).collect();
    assert!(gone.is_empty(), "these exceptions are no longer needed: {gone:#?}");
}

#[test]
fn shaders_import_down() {
    let files = texts(&Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders"), "wgsl");
    assert_eq!(upward_shaders(&files), Vec::<String>::new());
}

/// Every `#import` of a shader that goes up.
fn upward_shaders(files: &[(String, String)]) -> Vec<String> {
    let rank = |path: &str| {
        let room = match path.split_once('/') {
            Some(("common", _)) => "field",
            Some((room, _)) => room,
            None => "render",
        };
        let room = SHADER_ROOMS.iter().position(|r| *r == room);
        room.unwrap_or_else(|| panic!("shaders/{path} is in no room of shaders"))
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
            let up = defined.iter().filter(|(name, _)| names(name)).all(|(_, room)| *room > rank(path))
                && defined.iter().any(|(name, _)| names(name));
            if up && !SHADER_CONTRACTS.iter().any(|contract| names(contract)) {
                found.push(format!("{path}: {import}"));
            }
        }
    }
    found
}

/// A small crate with one violation of every kind in it.
#[test]
fn a_planted_violation_is_seen() {
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
    let upward: BTreeSet<_> = planted.upward().into_iter().map(|(file, room, _)| (file, room)).collect();
    let expected = [
        ("cli.rs", "app"),
        ("exact.rs", "strands"),
        ("gpu.rs", "nothing"),
        ("volume/load.rs", "transfer"),
        ("volume/raw.rs", "cli"),
    ];
    assert_eq!(upward, expected.map(|(file, room)| (file.to_owned(), room.to_owned())).into());
    let circles: Vec<_> = planted.circles().into_keys().collect();
    assert_eq!(
        circles,
        ["volume/load.rs", "volume/raw.rs"],
        "`app/mod.rs` only hands on what `app/a.rs` has"
    );

    let shaders = files(&[
        ("field/march.wgsl", "#define_import_path umbravox::march\n#import umbravox::sink::Sink"),
        ("shadow/a/sink.wgsl", "#define_import_path umbravox::sink\n#import umbravox::march::march"),
        ("shadow/a/layout.wgsl", "#define_import_path umbravox::layout"),
        ("render/raycast.wgsl", "#import umbravox::layout::{a, b}"),
        ("field/light.wgsl", "#import umbravox::layout::row"),
    ]);
    assert_eq!(upward_shaders(&shaders), ["field/light.wgsl: umbravox::layout::row"]);
}
