//! Runs the built program in tests.

use std::path::Path;
use std::process::{Command, Output};

/// Runs `umbravox ARGS` in a folder.
pub fn umbravox(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_umbravox"))
        .args(args)
        .current_dir(folder)
        .output()
        .expect("the program starts")
}

/// Text that a program printed.
pub struct Printed {
    pub stdout: String,
    pub stderr: String,
}

/// Runs `umbravox ARGS` in a folder, which must succeed.
pub fn succeed(folder: &Path, args: &[&str]) -> Printed {
    let output = umbravox(folder, args);
    let [stdout, stderr] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("UTF-8"));
    assert!(output.status.success(), "{args:?}: {stderr}");
    Printed { stdout, stderr }
}

/// Sends a process a signal by its name. `TERM` is used for an interrupt, which a test in the background may have to
/// ignore.
#[cfg(unix)]
#[allow(dead_code, reason = "not every test program ends one")]
pub fn signal(child: &std::process::Child, name: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status();
    assert!(sent.unwrap().success());
}

/// Runs a command line in a folder, and interrupts it when its messages satisfy `is_ready`. Returns all messages.
///
/// # Panics
/// The program ends before, or with another status than 1.
#[cfg(unix)]
#[allow(dead_code, reason = "not every test program interrupts one")]
pub fn interrupted(folder: &Path, args: &[&str], is_ready: impl Fn(&str) -> bool) -> String {
    let (status, messages) = ended_by("TERM", folder, args, is_ready);
    assert_eq!(status, Some(1), "{messages}");
    messages
}

/// Runs a command line in a folder, and sends it a signal when its messages satisfy `is_ready`. Returns its exit status
/// (`None` if it was killed), and all messages.
///
/// # Panics
/// The program ends before.
#[cfg(unix)]
#[allow(dead_code, reason = "not every test program ends one")]
pub fn ended_by(
    name: &str,
    folder: &Path,
    args: &[&str],
    is_ready: impl Fn(&str) -> bool,
) -> (Option<i32>, String) {
    use std::io::{BufRead, BufReader, Read};
    use std::process::Stdio;
    let mut child = Command::new(env!("CARGO_BIN_EXE_umbravox"))
        .args(args)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut messages = String::new();
    while !is_ready(&messages) {
        let read = stderr.read_line(&mut messages).unwrap();
        assert!(read > 0, "it ended before it could be interrupted: {messages}");
    }
    signal(&child, name);
    stderr.read_to_string(&mut messages).unwrap();
    (child.wait().unwrap().code(), messages)
}

/// Runs a command line that must be refused and must not change its folder; returns the `error:` line.
pub fn refused(folder: &Path, args: &[&str]) -> String {
    let before = names(folder);
    let output = umbravox(folder, args);
    let stderr = String::from_utf8(output.stderr).expect("stderr is UTF-8");
    assert_eq!(output.status.code(), Some(2), "{args:?}: {stderr}");
    assert!(output.stdout.is_empty(), "{args:?} printed a result");
    assert_eq!(names(folder), before, "{args:?} left files behind");
    let errors: Vec<&str> = stderr.lines().filter(|l| l.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{args:?}: {stderr}");
    for line in stderr.lines() {
        let known = ["error: ", "hint: ", "note: ", "warning: "].iter().any(|k| line.starts_with(k));
        assert!(known, "{args:?} printed a stray line: {line}");
    }
    errors[0].into()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("the folder can be read");
    let mut names: Vec<String> =
        entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}
