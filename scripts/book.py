#!/usr/bin/env python3
"""Builds the documentation as a website with search, and checks its links.

usage: book.py [--mdbook mdbook]
Copies the pages of packaging/book/SUMMARY.md, and the files that they link to, to out/book/src. Each file has the path
of the repository there, so that links work as they are. mdBook serves README.md as index.html, so these pages are
renamed. Then it runs mdBook, and finds every relative link of out/book/html that has no target. Exit status 1 if there
is one.
"""
import argparse, html.parser, re, shutil, subprocess, sys
from pathlib import Path
from urllib.parse import unquote, urldefrag

ROOT = Path(__file__).resolve().parent.parent
BOOK = ROOT / "packaging" / "book"
OUT = ROOT / "out" / "book"
LINK = re.compile(r"\]\(([^)#\s]+)")
README = re.compile(r"(\]\([^):]*)README\.md")


def lay_out(source):
    summary = (BOOK / "SUMMARY.md").read_text(encoding="utf-8")
    source.mkdir(parents=True)
    (source / "SUMMARY.md").write_text(README.sub(r"\1index.md", summary), encoding="utf-8")
    for page in map(Path, LINK.findall(summary)):
        text = (ROOT / page).read_text(encoding="utf-8")
        copy = source / page.with_name("index.md" if page.name == "README.md" else page.name)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(README.sub(r"\1index.md", text), encoding="utf-8")
        for link in LINK.findall(text):
            target = (ROOT / page.parent / link).resolve()
            if "://" not in link and target.suffix != ".md" and target.is_file():
                copy = source / target.relative_to(ROOT)
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(target, copy)


class Page(html.parser.HTMLParser):
    """Links and anchors of a page."""

    def __init__(self, path):
        super().__init__()
        self.links, self.anchors = [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.anchors.update(filter(None, [attributes.get("id"), attributes.get("name")]))
        self.links += filter(None, [attributes.get("href") if tag == "a" else None, attributes.get("src")])


def broken_links(folder):
    own = {"print.html", "toc.html", "404.html"}
    pages = {path: Page(path) for path in folder.rglob("*.html") if path.name not in own}
    for path, page in pages.items():
        for link in page.links:
            target, anchor = urldefrag(link)
            if re.match(r"[a-z]+:", target):
                continue
            target = (path.parent / unquote(target)).resolve() if target else path
            if not target.is_file() or (anchor and target in pages and unquote(anchor) not in pages[target].anchors):
                yield f"{path.relative_to(folder)}: {link}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--mdbook", default="mdbook")
    arguments = parser.parse_args()
    if not shutil.which(arguments.mdbook):
        sys.exit(f"book.py: there is no program {arguments.mdbook}: `cargo install mdbook --locked` installs it")
    shutil.rmtree(OUT, ignore_errors=True)
    lay_out(OUT / "src")
    (OUT / "theme").mkdir()
    shutil.copyfile(ROOT / "packaging" / "umbravox.svg", OUT / "theme" / "favicon.svg")
    subprocess.run([arguments.mdbook, "build", BOOK], check=True)
    broken = sorted(set(broken_links(OUT / "html")))
    if broken:
        sys.exit("links without a target:\n" + "\n".join(broken))
    print(f"book: {OUT / 'html' / 'index.html'}")


main()
