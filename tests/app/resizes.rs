//! Native window under repeated resizes while its picture refines.

use crate::common::{self, Requirement, SIZES};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Command line of a scene slow enough to be still refining at the next resize.
const SCENE: [&str; 4] = ["phantom:thorax:64", "--shadow=rays", "--tf=bone", "--clean"];
const LAST: [u32; 2] = [1100, 740];
/// Pixel rectangle that belongs to the view in any layout; side panel, menus and editor show times.
const VIEW: [u32; 4] = [0, 40, 700, 440];

/// Path of the example `window_shots`, which is built if only this test program was built.
fn window_shots() -> PathBuf {
    let folder = Path::new(env!("CARGO_BIN_EXE_umbravox")).parent().unwrap().join("examples");
    let path = folder.join("window_shots");
    if !path.is_file() {
        let build = ["build", "--locked", "--example", "window_shots"];
        assert!(Command::new(env!("CARGO")).args(build).status().unwrap().success());
    }
    path
}

/// Replays a script in the window under an X server; `None` and a printed line if there is none.
fn replay(script: &str, folder: &Path) -> Option<()> {
    let file = folder.join("script.txt");
    std::fs::write(&file, script).unwrap();
    let run = Command::new("xvfb-run")
        .args(["-a", "-s", "-screen 0 1400x1000x24"])
        .args([&window_shots(), &file])
        .args(SCENE)
        .env_remove("WAYLAND_DISPLAY")
        .stdin(Stdio::null())
        .output();
    let Ok(run) = run else {
        Requirement::Window.missing("there is no xvfb-run");
        return None;
    };
    let said = String::from_utf8_lossy(&run.stderr);
    // Xvfb and the window libraries are optional packages.
    if said.contains("command not found") || said.contains("cannot open the window") {
        Requirement::Window.missing(&said);
        return None;
    }
    assert!(run.status.success(), "{said}");
    Some(())
}

fn view(path: &Path) -> image::RgbImage {
    let [x, y, width, height] = VIEW;
    let shot = image::open(path).unwrap().to_rgb8();
    assert_eq!([shot.width(), shot.height()], LAST);
    image::imageops::crop_imm(&shot, x, y, width, height).to_image()
}

#[test]
fn resizes_while_a_picture_refines_alarm_nobody_and_end_in_the_right_picture() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (resized, fresh) = (dir.path().join("resized.png"), dir.path().join("fresh.png"));
    let [width, height] = LAST;
    let mut script = String::from("window 900 640\npause 1\n");
    for i in 1..SIZES.window_resizes {
        writeln!(script, "resize {} {}\npause 0.1", 800 + i * 37 % 500, 600 + i * 53 % 300).unwrap();
    }
    writeln!(script, "resize {width} {height}\npause 0.3\nsilent\nsettle\nsilent").unwrap();
    writeln!(script, "shot {}", resized.display()).unwrap();
    let Some(()) = replay(&script, dir.path()) else { return };
    let Some(()) =
        replay(&format!("window {width} {height}\nsettle\nshot {}\n", fresh.display()), dir.path())
    else {
        return;
    };
    let [resized, fresh] = [view(&resized), view(&fresh)];
    let bright = fresh.pixels().filter(|p| p.0.iter().any(|c| *c > 60)).count();
    assert!(bright > 5000, "there is something to see: {bright}");
    let differ = resized.pixels().zip(fresh.pixels()).filter(|(a, b)| a != b).count();
    assert_eq!(differ, 0, "pixels differ from those of a window that was never resized");
}
