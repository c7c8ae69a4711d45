//! List of transfer-function presets with thumbnails.

use super::Bench;
use umbravox::app::curve::Edit;
use umbravox::transfer::TransferFunction;
use umbravox::transfer::presets::PRESETS;

#[test]
fn presets_have_thumbnails_and_are_loaded_by_a_click() {
    let Some(mut bench) = Bench::open(&["phantom:thorax:32", "--tf=bone", "--shadow=none"]) else { return };
    let (work, picture) = (bench.app().model.frames, bench.pixels());
    bench.click("preset");
    bench.wait_for("all pictures", |app| app.presets.thumbnails.len() == PRESETS.len());
    assert_eq!(bench.app().model.frames, work, "the view is not drawn again for them");
    let pixels = |bench: &mut Bench, name: &str| {
        let index = PRESETS.iter().position(|p| p.name == name).unwrap();
        let texture = bench.app().presets.thumbnails[&index].texture.clone();
        bench.read(&texture)
    };
    let [bone, skin, lung] = ["bone", "skin", "lung"].map(|name| pixels(&mut bench, name));
    assert!(bone != skin && skin != lung && bone != lung);
    let lit = bone.chunks(4).filter(|p| p[..3].iter().any(|c| *c > 40)).count();
    assert!(lit > 100, "there is bone to be seen: {lit} pixels");
    bench.click("skin");
    bench.settle();
    assert_eq!(bench.app().model.document.as_ref().unwrap().tf_source.0, "skin");
    assert_ne!(bench.pixels(), picture);
}

#[test]
fn files_of_other_programs_load_and_opacity_is_rescaled_once() {
    let line = ["phantom:thorax:32", "--tf=bone", "--shadow=none", "--opacity-scale=2"];
    let Some(mut bench) = Bench::open(&line) else { return };
    let dir = tempfile::tempdir().unwrap();
    let text = |bench: &mut Bench| {
        let scene = dir.path().join("scene.toml");
        bench.app().model.save_scene(&scene);
        std::fs::read_to_string(scene).unwrap()
    };
    let extinction = |bench: &mut Bench| bench.app().model.document.as_ref().unwrap().tf.extinction(800.0);
    let bone = PRESETS.iter().find(|p| p.name == "bone").unwrap().transfer_function();
    let asked = extinction(&mut bench);
    assert!((asked / bone.extinction(800.0) - 2.0).abs() < 1e-12);
    assert!(text(&mut bench).contains("opacity-scale = 2.0"));
    // An edited transfer function is written unchanged, and not scaled again when it is read.
    bench.app().model.edit(Edit::Scale { factor: 3.0 });
    assert!((extinction(&mut bench) / asked - 3.0).abs() < 1e-12);
    let edited = text(&mut bench);
    assert!(!edited.contains("opacity-scale") && edited.contains("scene.tf.json"), "{edited}");
    let tf = TransferFunction::read(&dir.path().join("scene.tf.json")).unwrap();
    assert!((tf.extinction(800.0) / asked - 3.0).abs() < 1e-12);
    bench.app().model.undo();
    assert_eq!(extinction(&mut bench), asked);
    let path = dir.path().join("slicer.vp");
    std::fs::write(&path, "1\n0\n1\n0\n0\n1\n4 0 0 1000 0.5\n4 0 1 1 1\n4 0 1 0 0\n").unwrap();
    bench.app().model.load_tf(path.to_str().unwrap());
    let document = bench.app().model.document.as_ref().unwrap();
    assert!(
        (document.tf.extinction(500.0) + 2.0 * 0.75_f64.ln()).abs() < 1e-12,
        "what was asked for goes on"
    );
    bench.settle();
}
