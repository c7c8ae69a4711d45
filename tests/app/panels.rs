//! Side panels of the window: strands, flicker, and that nothing is cut at their edges.

use super::Bench;
use eframe::egui::{self, Modifiers, vec2};
use egui_kittest::kittest::{NodeT, Queryable};
use std::time::Duration;
use umbravox::app::curve::Edit;
use umbravox::files::loading::Loading;
use umbravox::open::SceneRequest;
use umbravox::scene::Shading;
use umbravox::strands::Kernel;

#[test]
fn strands_are_voxelised_again_and_other_settings_stay() {
    let line = ["phantom:hair-curly:2000", "--resolution=24", "--shadow=dom:map=64"];
    let Some(mut bench) = Bench::open(&line) else { return };
    bench.app().model.look_from(2);
    bench.app().model.edit(Edit::Color { index: 1, color: [0.1, 0.6, 0.2] });
    bench.settle();
    let before = bench.app().model.document.clone().unwrap();
    assert_eq!(before.volume.dims().into_iter().max(), Some(24));
    let picture = bench.pixels();

    // Invalid values are reported beside their field.
    bench.type_into("strands resolution", "5000");
    assert!(bench.harness.query_by_label_contains("from 4 to 1024").is_some());
    bench.click("Voxelise again");
    assert!(bench.app().model.loading().is_none());
    bench.type_into("strands resolution", "40");
    bench.type_into("strands thickness", "-1");
    assert!(bench.harness.query_by_label_contains("above 0").is_some());
    bench.type_into("strands thickness", "0.75");
    bench.click("strands kernel tent");
    assert_eq!(bench.app().model.document.as_ref().unwrap().volume.dims(), before.volume.dims(), "not yet");

    bench.click("Voxelise again");
    bench.wait_for("voxelised", |app| {
        app.model.document.as_ref().unwrap().volume.dims().into_iter().max() == Some(40)
    });
    bench.settle();
    let after = bench.app().model.document.clone().unwrap();
    let flags = after.spec.flags.strands;
    assert_eq!((flags.resolution, flags.kernel, flags.thickness), (Some(40), Some(Kernel::Tent), Some(0.75)));
    assert_eq!((&after.tf, &after.method), (&before.tf, &before.method));
    assert_eq!((after.scene.camera, &after.scene.lights), (before.scene.camera, &before.scene.lights));
    assert_ne!(bench.pixels(), picture);
    let text = after.scene_text("hair").unwrap();
    for key in ["resolution = 40", "kernel = \"tent\"", "thickness = 0.75"] {
        assert!(text.lines().any(|l| l == key), "{text}");
    }
    // The scene file has the same volume and function.
    let dir = tempfile::tempdir().unwrap();
    let scene = dir.path().join("scene.toml");
    bench.app().model.save_scene(&scene);
    let settings = SceneRequest::read(&scene).unwrap().settings;
    let read = settings.load(&Loading::default()).unwrap();
    assert_eq!(read.volume.resident().unwrap(), after.volume.resident().unwrap());
    assert_eq!(read.tf, *after.tf);
}

#[test]
fn a_fitted_preset_is_saved_unchanged() {
    let Some(mut bench) = Bench::open(&["phantom:hair-fur:600", "--resolution=16", "--shadow=none"]) else {
        return;
    };
    let before = bench.app().model.document.clone().unwrap();
    assert!(!before.tf_edited());
    bench.type_into("strands resolution", "32");
    bench.click("Voxelise again");
    bench.wait_for("voxelised", |app| {
        app.model.document.as_ref().unwrap().spec.flags.strands.resolution == Some(32)
    });
    let after = bench.app().model.document.clone().unwrap();
    assert_eq!(after.tf, before.tf);
    assert!(after.tf_edited(), "the preset would be stretched to the new values");
}

#[test]
fn only_strands_have_the_strands_section() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:16", "--shadow=none"]) else { return };
    assert!(bench.harness.query_by_label("Voxelise again").is_none());
    bench.app().model.open_source("phantom:hair-fur:200");
    bench.wait_for("opened", |app| app.model.document.as_ref().unwrap().spec.source.contains("hair"));
    bench.settle();
    assert!(bench.harness.query_by_label("Voxelise again").is_some());
}

#[test]
fn only_strands_have_kajiya_kay_shading() {
    let Some(mut bench) = Bench::open(&["phantom:hair-curly:2000", "--resolution=24", "--shadow=none"])
    else {
        return;
    };
    let plain = bench.pixels();
    bench.click("shading kajiya-kay");
    bench.settle();
    assert_eq!(bench.app().model.document.as_ref().unwrap().scene.shading, Shading::KajiyaKay);
    assert!(bench.pixels() != plain, "the same picture");
    let text = bench.app().model.document.as_ref().unwrap().scene_text("hair").unwrap();
    assert!(text.lines().any(|line| line == "shading = \"kajiya-kay\""), "{text}");
    // Strands keep the shading; other volumes drop it.
    for (source, shading) in
        [("phantom:hair-fur:200", Shading::KajiyaKay), ("phantom:sphere:16", Shading::None)]
    {
        bench.app().model.open_source(source);
        bench.wait_for("opened", |app| app.model.document.as_ref().unwrap().spec.source == source);
        bench.settle();
        let model = &bench.app().model;
        assert_eq!(model.document.as_ref().unwrap().scene.shading, shading);
        assert!(model.messages.iter().all(|message| !message.is_error), "{:?}", model.messages);
    }
    assert!(bench.harness.query_by_label("shading kajiya-kay").is_none());
    assert!(bench.harness.query_by_label("shading lambert").is_some());
}

#[test]
fn flicker_alternates_two_pictures_without_drawing() {
    let Some(mut bench) = Bench::open(&["phantom:thorax:32", "--shadow=dsm:map=64"]) else { return };
    bench.app().model.settings.flicker_hz = 1.0;
    bench.harness.key_press(egui::Key::F);
    bench.settle();
    assert!(bench.app().model.split.share.is_some(), "there must be two pictures");
    let (frames, frame) = (bench.app().model.frames, bench.app().model.frame.clone().unwrap());
    let other = frame.other.unwrap().spec;
    assert_eq!((frame.main.spec.as_str(), other.as_str()), ("dsm:map=64", "none"));
    // A step is 0.25 s of the interface's clock: four per change at 1 Hz.
    let (mut shown, mut delays) = (Vec::new(), Vec::new());
    for _ in 0..40 {
        bench.harness.step();
        let label = |spec: &str| bench.harness.query_by_label(&format!("shown: {spec}")).is_some();
        assert_ne!(label(&frame.main.spec), label(&other), "one of them");
        shown.push(label(&other));
        let delay = bench.harness.output().viewport_output[&egui::ViewportId::ROOT].repaint_delay;
        delays.push(delay);
    }
    // The second method makes the panel longer, so its scroll bar may move once.
    let due = |d: &Duration| *d > Duration::from_millis(1) && *d <= Duration::from_secs(1);
    assert!(delays[4..].iter().all(due), "{delays:?} {:?}", bench.harness.ctx.repaint_causes());
    let runs: Vec<usize> = shown.chunk_by(|a, b| a == b).map(<[bool]>::len).collect();
    assert!(runs[1..runs.len() - 1].iter().all(|n| *n == 4), "{runs:?}");
    assert!(runs.len() >= 10, "{runs:?}");
    assert_eq!(bench.app().model.frames, frames, "nothing was drawn for it");
    // Without flicker the split line is back and nothing wakes the interface.
    bench.harness.key_press(egui::Key::F);
    bench.harness.run_steps(4);
    assert!(bench.harness.query_by_label_contains("shown: ").is_none());
    assert!(bench.app().model.split.share.is_some());
}

#[test]
fn less_common_settings_of_a_method_are_folded_until_one_differs() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:16", "--shadow=dsm:map=64,epsilon=0.1"]) else {
        return;
    };
    let shown = |bench: &Bench, setting: &str| bench.harness.query_by_label(setting).is_some();
    for setting in ["method epsilon", "method map", "method near"] {
        assert!(shown(&bench, setting), "{setting}");
    }
    assert!(!shown(&bench, "method offset") && !shown(&bench, "compress"));
    bench.click("More");
    bench.harness.run_steps(2);
    assert!(shown(&bench, "method offset") && shown(&bench, "compress"));
    bench.type_into("method offset", "0.5");
    bench.settle();
    assert_eq!(bench.app().model.frame.as_ref().unwrap().main.spec, "dsm:epsilon=0.1,map=64,offset=0.5");
    // The title counts changed settings, also while they are folded.
    bench.click("More (1 changed)");
    bench.harness.run_steps(2);
    assert!(!shown(&bench, "method offset") && shown(&bench, "More (1 changed)"));
    // A method that comes with changed settings shows them.
    bench.app().model.document.as_mut().unwrap().method = "bom:map=64,ratio=0.25,bits=16".parse().unwrap();
    bench.settle();
    bench.harness.run_steps(2);
    assert!(shown(&bench, "method ratio") && shown(&bench, "More (2 changed)"));
    bench.app().model.document.as_mut().unwrap().method = "none".parse().unwrap();
    bench.settle();
    assert!(bench.harness.query_by_label_contains("More").is_none(), "it has no settings");
}

/// Asserts that every widget in the side panel lies within it.
fn nothing_is_cut(bench: &Bench, what: &str) {
    let view = bench.harness.state().model.view.unwrap();
    let mut seen = 0;
    for node in bench.harness.root().children_recursive() {
        // The root of the tree has no rectangle.
        let Some(rect) = node.accesskit_node().raw_bounds() else { continue };
        let (left, right) = (rect.x0 as f32, rect.x1 as f32);
        if left >= view.right() && rect.height() < 400.0 {
            seen += 1;
            // Margins of the harness and of the panel.
            assert!(right <= super::SIZE.x - 16.0, "{what}: {:?} {rect:?}", node.accesskit_node().label());
        }
    }
    assert!(seen > 40, "{what}: only {seen}");
}

#[test]
fn nothing_in_the_side_panel_is_cut() {
    let Some(mut bench) = Bench::open(&["phantom:hair-straight:500", "--resolution=16"]) else { return };
    bench.type_into("strands resolution", "99999");
    for spec in
        ["dsm:epsilon=0.0123,map=96,prefilter=5,precompress=off", "bom:map=96,layers=16", "osm:map=64"]
    {
        let document = bench.app().model.document.as_mut().unwrap();
        document.method = spec.parse().unwrap();
        document.other = "dom:map=96,layers=12".parse().unwrap();
        bench.app().model.split.share = Some(0.5);
        bench.settle();
        // The layout settles one frame after its contents.
        bench.harness.run_steps(4);
        nothing_is_cut(&bench, spec);
    }
}

#[test]
fn overlapping_points_yield_the_one_under_the_pointer() {
    let Some(mut bench) = Bench::open(&["phantom:thorax:32", "--shadow=none"]) else { return };
    let document = bench.app().model.document.clone().unwrap();
    let range = document.volume.value_range();
    let first = document.tf.points.iter().rposition(|p| p.value < range[1]).unwrap();
    let beside = document.tf.points[first];
    // A second point four screen points to the right of the first.
    let width = bench.harness.get_by_label("opacity curve").rect().width();
    let value = beside.value + 4.0 * 1.04 * (range[1] - range[0]) / f64::from(width);
    bench.app().model.edit(Edit::Add { value, amount: beside.amount });
    bench.settle();
    let place = |bench: &Bench, n: usize| bench.harness.get_by_label(&format!("point {n}")).rect().center();
    let (left, right) = (place(&bench, first + 1), place(&bench, first + 2));
    assert!((right.x - left.x - 4.0).abs() < 1.0 && (right.y - left.y).abs() < 1.0, "{left} {right}");
    let all = document.tf.points.len() + 1;
    let selected =
        |bench: &Bench, n: usize| bench.harness.query_by_label(&format!("Point {n} of {all}")).is_some();
    bench.click_at(left - vec2(3.0, 0.0));
    bench.harness.step();
    assert!(selected(&bench, first + 1));
    // The selected point is picked even a little beyond the centre of the other one.
    bench.drag(right, right + vec2(0.0, 20.0), Modifiers::NONE);
    assert!(selected(&bench, first + 1));
    let tf = bench.app().model.document.clone().unwrap().tf;
    assert!(tf.points[first].amount < beside.amount && tf.points[first + 1].amount == beside.amount);
    bench.click_at(place(&bench, first + 2));
    bench.harness.step();
    assert!(selected(&bench, first + 2));
}
