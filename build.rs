//! Sets the revision of the program: `BUILT_REVISION` is the commit, with `+changes` and a hash of them where the sources
//! differ from it. Outside a git checkout it is `UMBRAVOX_REVISION` of the environment, or `unknown`.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::process::Command;

/// Sources of the program.
const SOURCES: [&str; 6] = ["build.rs", "Cargo.toml", "Cargo.lock", "shaders", "src", "transfer_functions"];

fn main() {
    println!("cargo:rerun-if-env-changed=UMBRAVOX_REVISION");
    let given = || std::env::var("UMBRAVOX_REVISION").ok().filter(|given| !given.is_empty());
    // Of another name than the variable above: cargo sets this one for tests too, and a test that calls cargo would build
    // the library again.
    println!(
        "cargo:rustc-env=BUILT_REVISION={}",
        revision().or_else(given).unwrap_or_else(|| "unknown".into())
    );
    for path in SOURCES {
        println!("cargo:rerun-if-changed={path}");
    }
    // A missing path would make cargo run this every time. The index is not watched, since `git add` changes no source.
    let watched =
        ["HEAD", "packed-refs"].map(String::from).into_iter().chain(git(&["symbolic-ref", "-q", "HEAD"]));
    for name in watched {
        if let Some(path) = git(&["rev-parse", "--git-path", &name]).filter(|p| Path::new(p).exists()) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
}

/// Revision of the sources; `None` outside a checkout of this crate: a source archive may lie inside another repository.
fn revision() -> Option<String> {
    git(&["ls-files", "--error-unmatch", "Cargo.toml"])?;
    let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
    let changes = git(&[&["status", "--porcelain", "--"], &SOURCES[..]].concat())?;
    if changes.is_empty() {
        return Some(commit);
    }
    let mut hasher = DefaultHasher::new();
    (changes, git(&[&["diff", "HEAD", "--"], &SOURCES[..]].concat())?).hash(&mut hasher);
    Some(format!("{commit}+changes.{:08x}", hasher.finish() as u32))
}

/// Output of a git command, if it succeeds.
fn git(args: &[&str]) -> Option<String> {
    // Without the optional lock a status does not touch the index.
    let output = Command::new("git").args(args).env("GIT_OPTIONAL_LOCKS", "0").output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
