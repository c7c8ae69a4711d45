//! Environment variables that replace the system's graphics drivers, and leave the window without any.
#![cfg(target_os = "linux")]

use crate::common::Requirement;
use std::process::{Command, Stdio};

/// Runs a program without the system's graphics drivers; it must fail. Returns its messages, or `None` if it does not start.
fn failure(program: &str, args: &[&str], has_display: bool) -> Option<String> {
    let mut command = Command::new(program);
    command.args(args).env("VK_DRIVER_FILES", "/missing/driver.json").stdin(Stdio::null());
    command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
    if !has_display {
        command.env_remove("DISPLAY");
    }
    let output = command.output().ok()?;
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{args:?}: {said}");
    Some(said)
}

/// Asserts that the only error names the variable.
fn check(said: &str) {
    // Debug builds print the messages of the Vulkan loader too.
    let errors: Vec<_> = said.lines().filter(|line| line.starts_with("error: ")).collect();
    let [error] = errors[..] else { panic!("{said}") };
    let expected = ["error: no graphics adapter", "VK_DRIVER_FILES", "/missing/driver.json does not exist"];
    assert!(expected.iter().all(|part| error.contains(part)), "{said}");
    assert!(said.contains("hint: unset VK_DRIVER_FILES"), "{said}");
}

#[test]
fn a_variable_that_hides_the_drivers_is_named_as_the_cause() {
    let umbravox = env!("CARGO_BIN_EXE_umbravox");
    let view = ["view", "--clean", "phantom:thorax:16"];
    check(&failure(umbravox, &["render", "phantom:thorax:16", "-o", "-"], false).unwrap());
    check(&failure(umbravox, &view, false).unwrap());
    check(&failure(umbravox, &[&view[..], &["--adapter", "radeon"]].concat(), false).unwrap());
    let on_display = [&["-a", umbravox][..], &view].concat();
    match failure("xvfb-run", &on_display, true) {
        Some(said) if !said.contains("command not found") => check(&said),
        _ => Requirement::Window.missing("there is no xvfb-run"),
    }
}
