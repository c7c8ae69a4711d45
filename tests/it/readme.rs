//! The README and the pages of `docs/` say what the program does: their tables are its own, their commands are accepted,
//! their links lead somewhere.

use std::fs;
use std::path::{Path, PathBuf};
use umbravox::transfer::TransferFunction;
use umbravox::transfer::presets::{PRESETS, Scale};

const FILES: &str = include_str!("../../docs/files.md");
const METHODS: &str = include_str!("../../docs/methods.md");

/// Every page with its text.
fn pages() -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths: Vec<_> =
        ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "data/README.md"].map(|p| root.join(p)).into();
    let docs = fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path());
    paths.extend(docs.filter(|p| p.extension().is_some_and(|e| e == "md")));
    paths.into_iter().map(|p| (p.clone(), fs::read_to_string(p).unwrap())).collect()
}

/// The fenced blocks of a page: what stands behind the opening fence, and the text.
fn blocks(page: &str) -> impl Iterator<Item = (&str, &str)> {
    page.split("```").skip(1).step_by(2).map(|block| block.split_once('\n').unwrap_or((block, "")))
}

fn block<'a>(page: &'a str, language: &str) -> &'a str {
    blocks(page).find(|(l, _)| *l == language).expect("a block of that language").1
}

#[test]
fn the_preset_table_is_the_programs() {
    for preset in PRESETS {
        let units = match preset.scale {
            Scale::Hounsfield => "HU",
            Scale::Fraction => "fraction",
            Scale::Extinction => "1/mm",
        };
        let row = format!("| `{}` | {units} | {} |", preset.name, preset.about);
        assert!(FILES.contains(&row), "missing: {row}");
    }
}

#[test]
fn the_transfer_function_shown_can_be_read() {
    TransferFunction::from_json(block(FILES, "json")).expect("it is valid");
}

#[test]
fn the_method_table_has_every_method_and_key() {
    for method in umbravox::shadow::METHODS {
        let row = METHODS.lines().find(|l| l.starts_with(&format!("| `{}` |", method.name)));
        let row = row.unwrap_or_else(|| panic!("{} is missing", method.name));
        for key in method.keys {
            let named = [format!("`{}`", key.name), format!("`{}=", key.name)];
            assert!(named.iter().any(|n| row.contains(n)), "{}: {} is missing", method.name, key.name);
        }
    }
}

/// The words of a command line, as a shell tells them apart; what follows a `#` is not of it.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut quoted) = (vec![String::new()], false);
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            '#' if !quoted && words.last().is_some_and(String::is_empty) => break,
            ' ' if !quoted => words.push(String::new()),
            _ => words.last_mut().unwrap().push(c),
        }
    }
    words.retain(|w| !w.is_empty());
    words
}

#[test]
fn every_command_shown_is_accepted() {
    let mut count = 0;
    for (path, page) in pages() {
        for line in blocks(&page).flat_map(|(_, text)| text.lines()) {
            for part in line.split(" && ").map(words).filter(|w| w.first().is_some_and(|w| w == "umbravox")) {
                let parsed = umbravox::cli::command().try_get_matches_from(&part);
                let error = parsed.err().map_or(String::new(), |e| e.to_string());
                assert!(error.is_empty(), "{}: {line}\n{error}", path.display());
                count += 1;
            }
        }
    }
    assert!(count > 20, "only {count} commands found");
}

/// The name by which a link finds a heading.
fn anchor(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase().replace(' ', "-");
    text.chars().filter(|c| c.is_alphanumeric() || "-_".contains(*c)).collect()
}

#[test]
fn every_link_leads_to_a_file_and_a_heading_of_it() {
    for (path, page) in pages() {
        for link in page.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if link.contains("://") {
                continue;
            }
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { path.clone() } else { path.with_file_name(file) };
            assert!(target.exists(), "{}: {link}", path.display());
            if !heading.is_empty() {
                let text = fs::read_to_string(&target).unwrap();
                let found = text.lines().any(|l| l.starts_with('#') && anchor(l) == heading);
                assert!(found, "{}: {link}", path.display());
            }
        }
    }
}
