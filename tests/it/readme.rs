//! README and pages of `docs/`: tables equal those of the program, links have targets, sentences are short.

use std::fs;
use std::path::{Path, PathBuf};
use umbravox::transfer::TransferFunction;
use umbravox::transfer::presets::{PRESETS, Scale};

const FILES: &str = include_str!("../../docs/files.md");
const METHODS: &str = include_str!("../../docs/methods.md");

/// Markdown files of a folder and its subfolders.
pub fn markdown(folder: &Path) -> Vec<PathBuf> {
    let paths = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let files = paths.flat_map(|path| if path.is_dir() { markdown(&path) } else { vec![path] });
    files.filter(|path| path.extension().is_some_and(|e| e == "md")).collect()
}

/// Every documentation page with its text.
pub fn pages() -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let single = [
        "README.md",
        "CONTRIBUTING.md",
        "CHANGELOG.md",
        "data/README.md",
        "packaging/README.md",
        "python/README.md",
        "shaders/README.md",
    ];
    let paths = single.into_iter().map(|page| root.join(page)).chain(markdown(&root.join("docs")));
    paths.map(|path| (path.clone(), fs::read_to_string(path).unwrap())).collect()
}

/// Fenced code blocks of a page: the info string behind the opening fence, and the text.
pub fn blocks(page: &str) -> impl Iterator<Item = (&str, &str)> {
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

/// Anchor by which a link finds a heading.
pub fn anchor(heading: &str) -> String {
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

/// Prose of a page without code, tables, headings and pictures, one entry for each paragraph or list item.
fn paragraphs(page: &str) -> Vec<String> {
    let text: String = page.split("```").step_by(2).collect::<Vec<_>>().join("\n\n");
    let mut paragraphs = vec![String::new()];
    for line in text.lines().map(str::trim) {
        let is_prose =
            !line.is_empty() && !["|", "#", "![", "<!--"].iter().any(|start| line.starts_with(start));
        let number = line.trim_start_matches(|c: char| c.is_ascii_digit());
        if !is_prose || line.starts_with("- ") || (number != line && number.starts_with(". ")) {
            paragraphs.push(String::new());
        }
        if is_prose {
            *paragraphs.last_mut().unwrap() += &format!(" {line}");
        }
    }
    paragraphs
}

/// Number of words of each sentence of a paragraph.
fn sentence_lengths(paragraph: &str) -> Vec<usize> {
    let mut lengths = vec![0];
    for word in paragraph.replace("et al.", "et al").split_whitespace() {
        let last = lengths.last_mut().unwrap();
        *last += usize::from(word.contains(char::is_alphanumeric));
        if word.trim_end_matches(['*', ')', '"']).ends_with(['.', '!', '?']) && *last > 0 {
            lengths.push(0);
        }
    }
    lengths.retain(|n| *n > 0);
    lengths
}

#[test]
fn sentences_of_the_pages_are_short() {
    let mut all = Vec::new();
    for (path, page) in pages() {
        for paragraph in paragraphs(&page) {
            let lengths = sentence_lengths(&paragraph);
            assert!(lengths.iter().all(|n| *n <= 35), "{}: {paragraph}", path.display());
            all.extend(lengths);
        }
    }
    let mean = all.iter().sum::<usize>() as f64 / all.len() as f64;
    assert!(mean <= 18.0, "mean words a sentence: {mean}");
}

/// Escapes a text for a cell of a Markdown table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}

/// Text of the page with all settings of the shadow methods.
fn settings_page() -> String {
    let mut page = String::from(
        "# Settings of the methods\n\
         This page lists every setting of every shadow method. It is made from the code. How the methods work:\n\
         [methods](methods.md).\n\n\
         A method is written `NAME[:key=value,...]`, such as `dsm:epsilon=0.01,map=1024`.\n",
    );
    for method in umbravox::shadow::METHODS.iter().filter(|method| method.name != "half") {
        page += &format!("\n## `{}`\n{}.\n", method.name, method.summary);
        if method.keys.is_empty() {
            continue;
        }
        page += "\n| key | values | default | meaning |\n|---|---|---|---|\n";
        for key in method.keys {
            let values = cell(&key.values());
            page += &format!("| `{}` | `{values}` | `{}` | {} |\n", key.name, key.default, cell(key.help));
        }
    }
    page
}

/// Markdown table of flags with their values and help.
fn flag_table<'a>(flags: impl Iterator<Item = &'a clap::Arg>) -> String {
    let mut table = String::from("\n| flag | value | meaning |\n|---|---|---|\n");
    for flag in flags {
        let names = flag.get_value_names().unwrap_or_default().join(" ");
        let long = flag.get_long().map(|long| format!("--{long}"));
        let short = flag.get_short().map(|short| format!("-{short}"));
        let written = short.into_iter().chain(long).collect::<Vec<_>>().join("`, `");
        let (written, value) = match (written.is_empty(), flag.get_action().takes_values()) {
            (true, _) => (names, String::new()),
            (false, true) => (written, format!("`{}`", cell(&names))),
            (false, false) => (written, String::new()),
        };
        let help = flag.get_help().map(ToString::to_string).unwrap_or_default();
        let defaults: Vec<_> = flag.get_default_values().iter().filter_map(|d| d.to_str()).collect();
        let default = match flag.get_action().takes_values() && !defaults.is_empty() {
            true => format!(" [default: `{}`]", defaults.join(" ")),
            false => String::new(),
        };
        table += &format!("| `{written}` | {value} | {}{} |\n", cell(&help), cell(&default));
    }
    table
}

/// Text of the page with all flags of the commands; flags of a scene are listed once.
fn flags_page() -> String {
    let mut page = String::from(
        "# Flags\n\
         This page lists every flag of every command. It is made from the code. Examples: [commands](commands.md).\n\n\
         `umbravox COMMAND --help` prints the same with more detail.\n",
    );
    let mut command = umbravox::cli::command();
    command.build();
    let find = |name: &str| command.find_subcommand(name).expect("a command");
    let everywhere = ["help", "version", "verbose"];
    let is_own = |flag: &&clap::Arg| !flag.is_hide_set() && !everywhere.contains(&flag.get_id().as_str());
    let shared: Vec<_> = find("render")
        .get_arguments()
        .filter(|flag| {
            ["compare", "probe"].iter().all(|c| find(c).get_arguments().any(|f| f.get_id() == flag.get_id()))
        })
        .filter(|flag| flag.get_id() != "output" && is_own(flag))
        .collect();
    page += "\n## Scene\nThese flags are shared by all commands that take a scene. They are also keys of scene files, except `--scene`.\n";
    page += &flag_table(shared.iter().copied());
    for command in command.get_subcommands().filter(|c| c.get_name() != "help") {
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        page += &format!("\n## `{}`\n{about}.\n", command.get_name());
        let takes_scene = command.get_arguments().any(|flag| flag.get_id() == "shadow");
        let own = |flag: &&clap::Arg| {
            is_own(flag) && !(takes_scene && shared.iter().any(|s| s.get_id() == flag.get_id()))
        };
        if command.get_arguments().any(|flag| own(&flag)) {
            page += &flag_table(command.get_arguments().filter(own));
        }
        if takes_scene {
            page += "\nAlso the flags of a [scene](#scene).\n";
        }
        for part in command.get_subcommands().filter(|c| c.get_name() != "help") {
            let about = part.get_about().map(ToString::to_string).unwrap_or_default();
            page += &format!("\n### `{} {}`\n{about}.\n", command.get_name(), part.get_name());
            page += &flag_table(part.get_arguments().filter(is_own));
        }
    }
    page
}

#[test]
fn generated_pages_are_up_to_date() {
    for (name, page) in [("settings.md", settings_page()), ("flags.md", flags_page())] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(name);
        if std::env::var_os("UMBRAVOX_REWRITE").is_some() {
            fs::write(&path, &page).unwrap();
        }
        let written = fs::read_to_string(&path).unwrap_or_default();
        assert!(written == page, "run this test with UMBRAVOX_REWRITE=1 to write {} again", path.display());
    }
}
