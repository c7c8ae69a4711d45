//! Results folder of a comparison table: no file is lost silently, and its record reproduces the table.

use super::{TF, read_csv};
use crate::common;
use crate::program::{succeed, umbravox};
use std::collections::BTreeSet;
use std::path::Path;
use umbravox::report::run::{Run, SceneRecord};

const EFFORT: [&str; 5] = ["--size=32x32", "--points=400", "--rays=40", "--depths=30", "--repeats=1"];

/// Columns that do not depend on the speed of the machine.
const ERRORS: [&str; 16] = [
    "scene",
    "method",
    "params",
    "ray_err_max",
    "point_err_max",
    "point_err_rms",
    "point_err_rms_lo",
    "point_err_rms_hi",
    "point_err_p99",
    "image_rmse",
    "image_ssim",
    "shadow_rmse",
    "flip",
    "bound",
    "bound_held",
    "nodes_total",
];

fn names(folder: &Path) -> BTreeSet<String> {
    std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect()
}

fn refused(folder: &Path, args: &[&str]) -> String {
    let output = umbravox(folder, args);
    assert_eq!(output.status.code(), Some(2), "{args:?}");
    String::from_utf8(output.stderr).unwrap()
}

fn errors(table: &Path) -> Vec<Vec<String>> {
    read_csv(table).iter().map(|row| ERRORS.iter().map(|c| row[*c].clone()).collect()).collect()
}

#[test]
fn a_used_folder_is_refused_and_overwriting_removes_its_table_alone() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let args = [&["compare", "phantom:sphere:16", "-o", "out"], &EFFORT[..]].concat();
    let of = |more: &[&'static str]| [&args[..], more].concat();
    succeed(folder, &of(&["--methods", "none;dsm:map=32"]));
    let out = folder.join("out");
    let first = names(&out);
    assert!(first.contains("picture_dsm-map-32-epsilon-0.02.png"));
    // The record names every file that is there.
    let run = Run::read(&out).unwrap().unwrap();
    assert!(run.finished && first.iter().all(|name| run.files.contains(name)), "{first:?} {:?}", run.files);

    std::fs::write(out.join("mine.txt"), "notes").unwrap();
    std::fs::write(folder.join("elsewhere.txt"), "precious").unwrap();
    let table = std::fs::read(out.join("compare.csv")).unwrap();
    let stderr = refused(folder, &of(&["--methods", "none"]));
    assert!(stderr.contains("holds a table already") && stderr.contains("hint: --resume"), "{stderr}");
    assert_eq!(std::fs::read(out.join("compare.csv")).unwrap(), table);
    assert!(
        refused(folder, &of(&["--methods=none", "--resume", "--overwrite"])).contains("cannot be used with")
    );

    // A record that names files outside the folder must not remove them.
    let mut run = run;
    run.files.extend(["../elsewhere.txt".into(), folder.join("elsewhere.txt").display().to_string()]);
    run.write(&out).unwrap();
    succeed(folder, &of(&["--methods", "none;osm:map=32,layers=4", "--overwrite"]));
    let second = names(&out);
    assert!(!second.iter().any(|name| name.contains("dsm")), "{second:?}");
    assert!(second.contains("mine.txt") && folder.join("elsewhere.txt").is_file());
    assert!(second.contains("picture_osm-map-32-layers-4.png"), "{second:?}");

    // A table without a record is not overwritten.
    std::fs::remove_file(out.join("run.json")).unwrap();
    for how in ["--overwrite", "--resume"] {
        let stderr = refused(folder, &of(&["--methods=none", how]));
        assert!(stderr.contains("without run.json"), "{stderr}");
    }
    assert_eq!(names(&out).len(), second.len() - 1);
}

#[test]
fn a_folder_is_run_again_from_what_is_in_it_to_the_same_errors() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (folder, away) = (dir.path(), tempfile::tempdir().unwrap());
    std::fs::write(folder.join("tf.json"), TF).unwrap();
    succeed(folder, &["phantom", "sphere:16", "-o", "ball.nii"]);
    let scene = [
        "--tf=tf.json",
        "--light=point:40.5,-31.25,60.125",
        "--eye=-33.3,44.4,21.7",
        "--fov=31.7",
        "--ambient=0.2",
        "--background=#203040",
        "--shading=none",
    ];
    let methods = ["--methods", "none;dsm:map=32;osm:map=32,layers=4;bom:map=32"];
    let command = [&["compare", "ball.nii", "-o", "out"], &EFFORT[..], &scene, &methods].concat();
    succeed(folder, &command);
    let out = folder.join("out");
    let run = Run::read(&out).unwrap().unwrap();
    assert_eq!(run.command[1..], command);
    assert_eq!(run.scenes[0].volume_sha256.as_ref().map(String::len), Some(64));
    let page = std::fs::read_to_string(out.join("compare.md")).unwrap();
    assert!(page.contains(&run.again) && page.contains(run.scenes[0].volume_sha256.as_ref().unwrap()));

    // The table is reproduced elsewhere from its folder and the volume; a transfer function of the same name there is
    // another one.
    std::fs::copy(folder.join("ball.nii"), away.path().join("ball.nii")).unwrap();
    std::fs::create_dir(away.path().join("out")).unwrap();
    for name in ["scene.toml", "transfer_function.json"] {
        std::fs::copy(out.join(name), away.path().join("out").join(name)).unwrap();
    }
    std::fs::write(away.path().join("transfer_function.json"), TF.replace("0.1", "0.7")).unwrap();
    let words = shell_words(&run.again);
    assert_eq!(words[0], "umbravox");
    let stderr = succeed(away.path(), &words[1..].iter().map(String::as_str).collect::<Vec<_>>()).stderr;
    assert!(!stderr.contains("SHA-256"), "{stderr}");
    let again = away.path().join("again");
    assert_eq!(errors(&out.join("compare.csv")), errors(&again.join("compare.csv")));
    let pictures = |f: &Path| std::fs::read(f.join("picture_osm-map-32-layers-4.exr")).unwrap();
    assert_eq!(pictures(&out), pictures(&again));
    // Both records identify the same scene, wherever it was read from.
    let [first, second] = [&run, &Run::read(&again).unwrap().unwrap()].map(|run| run.scenes[0].clone());
    assert_eq!(second, SceneRecord { tf: second.tf.clone(), ..first });

    // The picture file records its scene.
    let reader = png::Decoder::new(std::io::BufReader::new(
        std::fs::File::open(out.join("picture_osm-map-32-layers-4.png")).unwrap(),
    ));
    let reader = reader.read_info().unwrap();
    let text = |key: &str| {
        let chunk = reader.info().utf8_text.iter().find(|c| c.keyword == key).unwrap();
        chunk.get_text().unwrap()
    };
    assert_eq!(text("umbravox:scene"), std::fs::read_to_string(out.join("scene.toml")).unwrap());
    assert_eq!(text("Description"), "osm:layers=4,map=32");
    assert!(text("Software").contains(env!("CARGO_PKG_VERSION")));

    // Another volume under that name gives a warning, and is measured.
    succeed(away.path(), &["phantom", "slab:16", "-o", "ball.nii"]);
    let other = [&words[1..words.len() - 1], &["other".to_owned()]].concat();
    let stderr = succeed(away.path(), &other.iter().map(String::as_str).collect::<Vec<_>>()).stderr;
    assert!(stderr.contains("warning: ball.nii is not the file that was meant: its SHA-256"), "{stderr}");
}

/// Splits a command line into words as a shell does; only single quotes occur.
fn shell_words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quoted) = (Vec::new(), String::new(), false);
    for c in line.chars() {
        match c {
            '\'' => quoted = !quoted,
            ' ' if !quoted => words.push(std::mem::take(&mut word)),
            c => word.push(c),
        }
    }
    words.push(word);
    words
}

#[test]
#[cfg(unix)]
fn an_interrupt_reports_how_to_resume() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let more = ["--methods=none;rays;dsm:map=64,epsilon=0.06,0.02;osm:map=64", "--size=64x64"];
    let args = [&["compare", "phantom:sphere:24", "-o", "out", "--repeats=200"], &more[..]].concat();
    let child = Command::new(env!("CARGO_BIN_EXE_umbravox"))
        .args(&args)
        .current_dir(dir.path())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let journal = dir.path().join("out").join(umbravox::measure::journal::JOURNAL);
    let start = Instant::now();
    while !std::fs::read_to_string(&journal).is_ok_and(|text| text.contains('\n')) {
        assert!(start.elapsed() < Duration::from_secs(120), "no row came");
        std::thread::sleep(Duration::from_millis(5));
    }
    crate::program::signal(&child, "TERM");
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(
        stderr.contains("error: interrupted (out): ") && stderr.contains(" of 5 rows are finished"),
        "{stderr}"
    );
    assert!(stderr.contains("hint: the same command line with --resume"), "{stderr}");
    assert!(!Run::read(&dir.path().join("out")).unwrap().unwrap().finished);
}

#[test]
fn pages_stand_beside_the_table_and_belong_to_it() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let args = [&["compare", "phantom:sphere:16", "-o", "out"], &EFFORT[..]].concat();
    let of = |more: &[&'static str]| [&args[..], more].concat();
    // There are no strands: the row of the second method fails, and the page has the others.
    let page = ["--methods", "none;dsm:map=32,from=lines;dsm:map=32", "--page"];
    let output = umbravox(folder, &of(&page));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && stderr.contains("page: out/page.html"), "{stderr}");
    let text = std::fs::read_to_string(folder.join("out/page.html")).unwrap();
    assert!(text.contains("dsm:epsilon=0.02,map=32,fit=volume") && !text.contains("from=lines"));
    assert!(Run::read(&folder.join("out")).unwrap().unwrap().files.contains(&"page.html".into()));
    succeed(folder, &of(&["--methods", "none", "--overwrite"]));
    assert!(!folder.join("out/page.html").exists());
    let scan = folder.join("scan.nii.gz");
    succeed(folder, &["phantom", "sphere:16", "-o", scan.to_str().unwrap()]);
    let error = refused(folder, &["compare", "scan.nii.gz", "-o", "other", "--page"]);
    assert!(error.contains("data of this file") && !folder.join("other").exists(), "{error}");
}
