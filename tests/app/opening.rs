//! Opening of volumes in the window: dropped files, progress and cancellation.

use super::Bench;
use eframe::egui;
use egui_kittest::kittest::Queryable;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use umbravox::app::App;
use umbravox::formats::write_nifti;
use umbravox::phantom::Phantom;

#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|e| e.to_string())
    }
}

fn drop_files(bench: &mut Bench, paths: &[&Path]) {
    bench.app().model.messages.clear();
    for path in paths {
        bench.harness.input_mut().dropped_files.push(Arc::new(Dropped(path.to_path_buf())));
    }
    bench.harness.step();
}

#[test]
fn dropped_files_open_by_their_kind() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:16", "--shadow=none"]) else { return };
    let dir = tempfile::tempdir().unwrap();
    let source = |app: &App| app.model.document.as_ref().unwrap().spec.source.clone();

    let volume = dir.path().join("shell.nii.gz");
    write_nifti(&Phantom::Shell.build(12).unwrap(), &volume).unwrap();
    drop_files(&mut bench, &[&volume]);
    let name = volume.display().to_string();
    bench.wait_for("a volume", |app| source(app) == name);
    bench.settle();
    assert_eq!(bench.app().model.document.as_ref().unwrap().volume.dims(), [12; 3]);
    assert_eq!(bench.app().model.settings.recent[0], name);

    let tf = dir.path().join("mine.JSON");
    let text = r#"{"name": "mine", "units": "", "points": [{"value": 1, "extinction": 0}, {"value": 900, "extinction": 0.5}]}"#;
    std::fs::write(&tf, text).unwrap();
    drop_files(&mut bench, &[&tf]);
    let document = bench.app().model.document.clone().unwrap();
    assert_eq!((document.tf.name.as_str(), document.spec.source.as_str()), ("mine", name.as_str()));

    let scene = dir.path().join("scene.toml");
    std::fs::write(
        &scene,
        "volume = 'phantom:comb:14'\nshadow = 'rays'\nambient = 0.25\nbackground = 'none'\n",
    )
    .unwrap();
    drop_files(&mut bench, &[&scene]);
    bench.wait_for("a scene", |app| source(app) == "phantom:comb:14");
    bench.settle();
    let document = bench.app().model.document.clone().unwrap();
    assert_eq!((document.method.entry().name, document.scene.ambient), ("rays", 0.25));
    assert!(document.transparent && document.scene_text("ct").unwrap().contains("background = \"none\""));

    // Broken files are reported and the old volume stays.
    let picture = bench.pixels();
    for (name, text, reason) in [
        ("broken.nii", "no volume at all", "NIfTI"),
        ("broken.json", "{\"points\": 5}", "expected a sequence"),
        ("broken.toml", "volume = [", "broken.toml"),
        ("broken.hair", "HAIR", "header"),
    ] {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        drop_files(&mut bench, &[&path]);
        bench.wait_for(name, |app| app.model.messages.iter().any(|m| m.is_error && m.text.contains(reason)));
        assert_eq!(source(bench.harness.state()), "phantom:comb:14", "{name}");
    }
    assert_eq!(bench.pixels(), picture);

    // Tracks without thickness get a default, with a note.
    let tracks = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/strands/little.tck");
    drop_files(&mut bench, &[&tracks]);
    bench.wait_for("tracks", |app| source(app).ends_with("little.tck"));
    let document = bench.app().model.document.clone().unwrap();
    assert_eq!(document.spec.flags.strands.thickness, Some(1.0));
    assert!(bench.app().model.messages.iter().any(|m| m.text.contains("1 mm is assumed")));
    bench.settle();

    // Only the first of several files is opened, with a note.
    drop_files(&mut bench, &[&volume, &tf]);
    assert!(bench.app().model.messages.iter().any(|m| m.text.starts_with("2 files were dropped")));
    bench.wait_for("the first of two", |app| source(app) == name);
}

#[test]
fn reading_shows_progress_and_can_be_cancelled() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:16", "--shadow=none"]) else { return };
    bench.app().model.open_source("phantom:thorax:700");
    let loading = bench.app().model.loading().expect("it is being read");
    let start = Instant::now();
    while loading.progress().share < 0.02 {
        bench.harness.step();
        assert!(start.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(5));
    }
    bench.harness.step();
    assert!(bench.harness.query_by_label("phantom:thorax:700: building").is_some());
    assert!(bench.harness.query_by_label("share read").is_some());
    bench.click("Cancel");
    let cancelled = Instant::now();
    assert!(bench.app().model.loading().is_none());
    // The thread releases its volume at its end.
    while Arc::strong_count(&loading) > 1 {
        assert!(cancelled.elapsed() < Duration::from_secs(10), "it reads on");
        std::thread::sleep(Duration::from_millis(1));
    }
    println!("ended {:.1} ms after Cancel", cancelled.elapsed().as_secs_f64() * 1e3);
    assert!(loading.progress().share < 0.85, "{:?}", loading.progress());
    bench.harness.run_steps(3);
    let app = bench.app();
    assert!(app.model.messages.iter().all(|m| !m.is_error), "{:?}", app.model.messages);
    assert_eq!(app.model.document.as_ref().unwrap().spec.source, "phantom:sphere:16");
    // Another volume cancels the first in the same way.
    bench.app().model.open_source("phantom:thorax:700");
    let first = bench.app().model.loading().unwrap();
    bench.app().model.open_source("phantom:step:12");
    assert!(first.is_cancelled());
    bench.wait_for("the second", |app| app.model.document.as_ref().unwrap().spec.source == "phantom:step:12");
}
