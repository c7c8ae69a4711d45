//! Style rules: how doc comments open, and how long files and functions are.

use std::fs;
use std::path::{Path, PathBuf};

/// Largest number of lines of a source file.
const LONGEST_FILE: usize = 450;
/// Largest number of lines of a function. A longer one needs a comment `// Long: REASON` above it.
const LONGEST_FUNCTION: usize = 80;

/// Opening words of a comment that leave the subject of the sentence unclear.
const RIDDLES: [&str; 5] = ["What", "Of", "As", "The same", "Those"];

/// Files with one extension below some folders, with their texts.
fn files(folders: &[&str], ending: &str) -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut open: Vec<PathBuf> = folders.iter().map(|folder| root.join(folder)).collect();
    let mut found = Vec::new();
    while let Some(folder) = open.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == ending) {
                let name = path.strip_prefix(root).unwrap().display().to_string();
                found.push((name, fs::read_to_string(&path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

fn assert_none(rule: &str, offenders: &[String]) {
    assert!(offenders.is_empty(), "{} offenders: {rule}\n{}", offenders.len(), offenders.join("\n"));
}

/// First lines of comments that open with such words, as `line number: text`. `markers` begin a comment.
fn riddles(text: &str, markers: &[&str]) -> Vec<String> {
    let comment = |line: &str| {
        let line = line.trim_start();
        markers.iter().find_map(|marker| Some((*marker, line.strip_prefix(marker)?.trim().to_owned())))
    };
    let mut before = None;
    let mut found = Vec::new();
    for (n, line) in text.lines().enumerate() {
        let here = comment(line);
        let marker = here.as_ref().map(|(marker, _)| *marker);
        if let Some((_, words)) = here.filter(|_| marker != before) {
            let rest = RIDDLES.iter().find_map(|riddle| words.strip_prefix(riddle));
            if rest.is_some_and(|rest| rest.starts_with([' ', ','])) {
                found.push(format!("{}: {words}", n + 1));
            }
        }
        before = marker;
    }
    found
}

/// Functions that are too long and give no reason, as `line number: name, lines`. The text is formatted by rustfmt.
fn long_functions(text: &str) -> Vec<String> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (n, line) in lines.iter().enumerate() {
        let code = line.trim_start();
        let words = ["pub ", "pub(crate) ", "pub(super) ", "const ", "async ", "unsafe "];
        let mut rest = code;
        while let Some(shorter) = words.iter().find_map(|word| rest.strip_prefix(word)) {
            rest = shorter;
        }
        let Some(name) = rest.strip_prefix("fn ") else { continue };
        let indent = &line[..line.len() - code.len()];
        let signature = lines[n..].iter().find(|l| l.ends_with(['{', ';', '}']));
        if signature.is_some_and(|l| l.ends_with(';')) {
            continue;
        }
        let closes = |l: &&str| l.strip_prefix(indent).is_some_and(|rest| rest.starts_with('}'));
        let length = lines[n..].iter().position(closes).map_or(0, |end| end + 1);
        if length <= LONGEST_FUNCTION {
            continue;
        }
        let above = lines[..n].iter().rev().take_while(|l| {
            let l = l.trim_start();
            l.starts_with("//") || l.starts_with("#[")
        });
        if !above.into_iter().any(|l| l.contains("// Long: ")) {
            let name: String = name.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            found.push(format!("{}: {name}, {length} lines", n + 1));
        }
    }
    found
}

#[test]
fn doc_comments_open_with_their_subject() {
    let mut offenders = Vec::new();
    for (name, text) in files(&["src", "python/src", "tests"], "rs") {
        offenders.extend(riddles(&text, &["///", "//!"]).iter().map(|found| format!("{name}:{found}")));
    }
    for (name, text) in files(&["shaders"], "wgsl") {
        offenders.extend(riddles(&text, &["///", "//!", "//"]).iter().map(|found| format!("{name}:{found}")));
    }
    assert_none(&format!("no first line opens with {RIDDLES:?}"), &offenders);
}

#[test]
fn files_are_short() {
    let mut all = files(&["src", "python/src", "tests", "benches", "examples"], "rs");
    all.extend(files(&["shaders"], "wgsl"));
    let lengths = all.iter().map(|(name, text)| (name, text.lines().count()));
    let offenders: Vec<_> = lengths
        .filter(|(_, lines)| *lines > LONGEST_FILE)
        .map(|(name, lines)| format!("{name}: {lines} lines"))
        .collect();
    assert_none(&format!("no file is longer than {LONGEST_FILE} lines"), &offenders);
}

#[test]
fn functions_are_short_or_say_why_not() {
    let mut offenders = Vec::new();
    for (name, text) in files(&["src", "python/src", "tests"], "rs") {
        offenders.extend(long_functions(&text).iter().map(|found| format!("{name}:{found}")));
    }
    assert_none(
        &format!("no function has more than {LONGEST_FUNCTION} lines without `// Long: REASON`"),
        &offenders,
    );
}

#[test]
fn planted_offenders_are_found() {
    let text =
        "/// Of two things.\n/// What follows is fine.\nfn a() {}\n//! Officially fine.\n/// As [`b`].\n";
    assert_eq!(riddles(text, &["///", "//!"]), ["1: Of two things.", "5: As [`b`]."]);
    let body = "    x();\n".repeat(LONGEST_FUNCTION - 1);
    let function = format!("pub const fn f(\n) -> u32 {{\n{body}}}\n");
    assert_eq!(long_functions(&function), [format!("1: f, {} lines", LONGEST_FUNCTION + 2)]);
    let body = "    x();\n".repeat(LONGEST_FUNCTION - 2);
    assert_eq!(long_functions(&format!("fn f() {{\n{body}}}\n")), Vec::<String>::new());
    assert_eq!(long_functions(&format!("// Long: a table.\n#[test]\n{function}")), Vec::<String>::new());
}
