//! Imports of a crate's source files, read from their tokens: `use` trees, and paths in code and macros.

use super::{INTERFACES, LAYERS};
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};

type Module = Vec<String>;

/// References of one source file to other files.
#[derive(Default)]
struct Source {
    /// Names of the modules that the file declares with `mod NAME;`.
    children: BTreeSet<String>,
    /// Names that a `use` brings into the file's scope, with their paths from the crate's root.
    aliases: BTreeMap<String, Module>,
    /// Names that the file only re-exports (`pub use`) and does not use itself, as far as tokens show.
    handed_on: BTreeSet<String>,
    /// Paths from the crate's root that the file mentions outside of tests.
    paths: BTreeSet<Module>,
    /// Identifiers of the file outside of `use`.
    words: BTreeSet<String>,
}

/// All source files of a crate by their modules.
pub struct Crate(BTreeMap<Module, Source>);

impl Crate {
    /// Reads the source files, given as pairs of a path below `src` and the text.
    pub fn new(files: &[(String, String)]) -> Self {
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
        // A macro that `#[macro_export]` puts at the root belongs to the module that defines it.
        let root: &mut Source = sources.entry(Module::new()).or_default();
        root.aliases.extend(macros);
        for module in tests {
            sources.remove(&module);
        }
        Self(sources)
    }

    /// Module in which the item of a path is defined, as far as `use` shows.
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

    /// Top-level module of a path, resolved through re-exports at the crate's root.
    fn layer_of(&self, path: &[String]) -> Option<String> {
        let first = path.first()?;
        let root = &self.0[&Module::new()];
        root.aliases.get(first).map_or_else(|| Some(first.clone()), |alias| alias.first().cloned())
    }

    /// Every import from a higher or equal layer: the file, the imported top-level module and the path.
    pub fn upward(&self) -> Vec<(String, String, String)> {
        let rank = |layer: &str| LAYERS.iter().position(|r| r.0 == layer);
        let mut found = Vec::new();
        for (module, source) in self.0.iter().filter(|(module, _)| !module.is_empty()) {
            let own = &module[0];
            let (_, _, only) = LAYERS
                .iter()
                .find(|r| r.0 == own)
                .unwrap_or_else(|| panic!("src/{own} has no layer: LAYERS lists the top-level modules"));
            for path in &source.paths {
                let Some(layer) = self.layer_of(path).filter(|layer| layer != own) else { continue };
                let sideways = INTERFACES.contains(&own.as_str()) && INTERFACES.contains(&layer.as_str());
                let down = rank(&layer).is_some_and(|r| Some(r) > rank(own)) && !sideways;
                if !down || only.is_some_and(|only| !only.contains(&layer.as_str())) {
                    found.push((self.name_of(module), layer, path.join("::")));
                }
            }
        }
        found
    }

    /// Every file that imports itself through other files of its top-level module, with a shortest cycle.
    pub fn cycles(&self) -> BTreeMap<String, String> {
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

/// Collects the references from the tokens of one source file.
struct Reader<'a> {
    source: &'a mut Source,
    /// Modules that are compiled for tests only.
    tests: &'a mut Vec<Module>,
    /// Exported macros, with the module that defines them.
    macros: &'a mut Vec<(String, Module)>,
}

impl Reader<'_> {
    fn children(&mut self, tokens: &[TokenTree]) {
        for t in tokens.windows(3).filter(|t| is_word(&t[0], "mod") && is_punct(Some(&t[2]), ';')) {
            self.source.children.insert(t[1].to_string());
        }
    }

    /// Reads tokens. `file` is the module of the file, `here` that of the tokens: another one within `mod NAME { ...
    /// }`.
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

    /// Resolves a path from the crate's root; `None` for items of other crates, or for a name in scope whose `use`
    /// was read.
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

/// Collects the leaves of a `use` tree: the whole path, and the name that it gets.
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

/// Whether an attribute's brackets are a `cfg` for tests only.
fn is_test(brackets: Option<&TokenTree>) -> bool {
    let text = brackets.map(ToString::to_string).unwrap_or_default();
    text.starts_with("[cfg") && text.contains("test") && !text.contains("not")
}

/// Index behind the item that begins at token `from`.
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

/// Whether the attribute directly before an item exports it as a macro.
fn exported(before: &[TokenTree]) -> bool {
    before.last().is_some_and(|t| t.to_string().contains("macro_export"))
}
