//! Book of the documentation: its table of contents is made from `docs/README.md`, and links have targets in the book.

use crate::readme::{anchor, markdown};
use std::fs;
use std::path::{Component, Path, PathBuf};

const SUMMARY: &str = "packaging/book/SUMMARY.md";
const RESULTS: &str = "docs/results/README.md";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(page: &Path) -> String {
    fs::read_to_string(root().join(page)).unwrap_or_else(|error| panic!("{}: {error}", page.display()))
}

/// Targets of the relative links in a text of a page: file, relative to the root of the repository, and anchor.
fn links(page: &Path, text: &str) -> Vec<(PathBuf, String)> {
    let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let resolve = |link: &str| {
        let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
        let mut target = if file.is_empty() { page.to_owned() } else { page.parent().unwrap().to_owned() };
        for part in Path::new(file).components() {
            match part {
                Component::ParentDir => assert!(target.pop(), "{}: {link}", page.display()),
                part => target.push(part),
            }
        }
        (target, anchor.to_owned())
    };
    links.filter(|link| !link.contains("://")).map(resolve).collect()
}

fn is_page(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "md")
}

/// Path with `/` on every system.
fn slashed(path: &Path) -> String {
    path.iter().map(|part| part.to_str().unwrap()).collect::<Vec<_>>().join("/")
}

/// Table of contents while it is made.
#[derive(Default)]
struct Contents {
    text: String,
    pages: Vec<PathBuf>,
}

impl Contents {
    /// Adds a page that is not listed yet, below `depth` others; its title is its heading. `None` is a page before the list.
    fn add(&mut self, page: &Path, depth: Option<usize>) {
        if self.pages.iter().any(|listed| listed == page) {
            return;
        }
        let text = read(page);
        let title =
            text.lines().find_map(|line| line.strip_prefix("# ")).expect("a heading").replace('`', "");
        let start = depth.map_or(String::new(), |depth| format!("{}- ", "  ".repeat(depth)));
        self.text += &format!("{start}[{title}]({})\n", slashed(page));
        self.pages.push(page.to_owned());
    }

    /// Adds a result, and the other pages of its folder below it.
    fn add_result(&mut self, page: &Path) {
        self.add(page, Some(1));
        let folder = page.parent().unwrap();
        if page.file_name().is_some_and(|name| name == "README.md") {
            let mut others = markdown(&root().join(folder));
            others.sort();
            for other in others {
                self.add(other.strip_prefix(root()).unwrap(), Some(2));
            }
        }
    }
}

/// Contents of the book: README, and the pages of `docs/README.md` in their order. Results stand below their page.
fn contents() -> Contents {
    let mut contents = Contents { text: "# Summary\n\n".into(), ..Contents::default() };
    contents.add(Path::new("README.md"), None);
    let index = Path::new("docs/README.md");
    contents.add(index, None);
    contents.text += "\n";
    for line in read(index).lines() {
        if let Some(part) = line.strip_prefix("## ") {
            contents.text += &format!("\n# {part}\n\n");
        }
        for (page, _) in links(index, line) {
            contents.add(&page, Some(0));
            if page == Path::new(RESULTS) {
                for (result, _) in links(&page, &read(&page)) {
                    if result != page
                        && ["docs/results", "benches"].iter().any(|folder| result.starts_with(folder))
                    {
                        contents.add_result(&result);
                    }
                }
            }
        }
    }
    contents
}

#[test]
fn the_table_of_contents_is_up_to_date() {
    let contents = contents();
    let path = root().join(SUMMARY);
    if std::env::var_os("UMBRAVOX_REWRITE").is_some() {
        fs::write(&path, &contents.text).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    assert!(written == contents.text, "run this test with UMBRAVOX_REWRITE=1 to write {SUMMARY} again");
}

#[test]
fn every_page_of_the_documentation_is_listed() {
    let pages = contents().pages;
    for page in markdown(&root().join("docs")) {
        let page = page.strip_prefix(root()).unwrap();
        assert!(pages.iter().any(|listed| listed == page), "docs/README.md does not list {}", page.display());
    }
}

#[test]
fn links_of_the_book_have_targets_in_it() {
    let pages = contents().pages;
    for page in &pages {
        for (target, heading) in links(page, &read(page)) {
            // Other files are copied into the book.
            let found = match is_page(&target) {
                true => pages.contains(&target),
                false => root().join(&target).is_file(),
            };
            assert!(found, "{}: {} is not in the book", page.display(), target.display());
            let text = if heading.is_empty() { String::new() } else { read(&target) };
            let named = text.lines().any(|line| line.starts_with('#') && anchor(line) == heading);
            assert!(heading.is_empty() || named, "{}: no heading {heading}", page.display());
        }
    }
}
