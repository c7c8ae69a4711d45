//! Pointer and keyboard in the window: drags, text input, shortcuts, undo.

use super::{Bench, brightness};
use eframe::egui::{self, Modifiers, vec2};
use egui_kittest::kittest::Queryable;
use umbravox::app::curve::Edit;
use umbravox::render::VisibleBounds;
use umbravox::transfer::TransferChange;
use umbravox::transfer::TransferFunction;

const SMALL: &[&str] = &["phantom:thorax:32", "--shadow=dsm:map=64"];

#[test]
fn a_dragged_point_changes_picture_and_file_and_can_be_undone() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    let before = bench.app().model.document.clone().unwrap();
    let picture = bench.pixels();
    // The highest point in the histogram's range has no neighbour nearby.
    let range = before.volume.value_range();
    let last = before.tf.points.iter().rposition(|p| p.value < range[1]).unwrap();
    let grip = bench.harness.get_by_label(&format!("point {}", last + 1)).rect().center();
    bench.drag(grip, grip + vec2(0.0, 30.0), Modifiers::NONE);
    bench.settle();
    let edited = bench.app().model.document.clone().unwrap().tf;
    assert!(edited.points[last].amount < before.tf.points[last].amount, "the point went down");
    assert_ne!(bench.pixels(), picture);
    let frame = bench.app().model.frame.clone().unwrap();
    assert!(frame.is_final && frame.main.report.bytes > 0);

    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("mine.json");
    bench.click("Save…");
    bench.type_into("path", path.to_str().unwrap());
    bench.click("Save");
    assert_eq!(TransferFunction::read(&path).unwrap(), *edited);
    assert!(!bench.app().model.document.as_ref().unwrap().tf_edited());

    bench.click("Undo");
    bench.settle();
    assert_eq!(bench.app().model.document.as_ref().unwrap().tf, before.tf, "a drag is one step");
    assert_eq!(bench.pixels(), picture);
    bench.click("Redo");
    assert_eq!(bench.app().model.document.as_ref().unwrap().tf, edited);
}

#[test]
fn an_edit_rebuilds_only_its_dependents() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    let range = bench.app().model.document.as_ref().unwrap().volume.value_range();
    // A colour edit needs new tables, but no shadow map.
    let picture = bench.pixels();
    bench.app().model.edit(Edit::Color { index: 1, color: [0.0, 1.0, 0.0] });
    bench.settle();
    let work = bench.app().model.frame.as_ref().unwrap().work;
    assert!(work.table_ms.is_some() && work.build_ms.is_none(), "{work:?}");
    assert_ne!(bench.pixels(), picture);
    // An edit beyond all values of the volume needs nothing, not even a picture.
    bench.app().model.edit(Edit::Add { value: range[1] + 1000.0, amount: 0.0 });
    bench.settle();
    let (frames, unchanged) = (bench.app().model.frames, bench.app().model.unchanged);
    let before = bench.app().model.document.clone().unwrap();
    bench.app().model.edit(Edit::Add { value: range[1] + 2000.0, amount: 0.7 });
    bench.settle();
    let after = bench.app().model.document.clone().unwrap();
    assert_eq!(before.scene, after.scene);
    assert_eq!(
        TransferChange::between(&before.tf, &after.tf, |[lo, hi]| lo <= range[1] && hi >= range[0]),
        TransferChange::Nothing,
        "{:?} {:?}",
        before.tf,
        after.tf
    );
    let now = (bench.app().model.frames, bench.app().model.unchanged);
    assert_eq!(now, (frames, unchanged + 1), "no voxel has such a value");
    // A camera change needs neither tables nor a map.
    bench.app().model.look_from(2);
    bench.settle();
    assert_eq!(bench.app().model.frame.as_ref().unwrap().work, Default::default());
}

#[test]
fn methods_are_switched_by_their_list_and_bad_values_show_errors() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    let shadowed = brightness(&bench.pixels());
    bench.click("method");
    bench.click("none");
    bench.settle();
    assert_eq!(bench.app().model.frame.as_ref().unwrap().main.spec, "none");
    let lit = brightness(&bench.pixels());
    assert!(lit > shadowed * 1.02, "without shadows it is brighter: {lit} {shadowed}");

    bench.click("method");
    bench.click("dsm");
    bench.settle();
    let picture = bench.pixels();
    bench.type_into("method epsilon", "-3");
    assert_eq!(format!("{:#}", bench.app().model.document.as_ref().unwrap().method), "dsm");
    assert!(
        bench.harness.query_by_label_contains("epsilon:").is_some()
            || bench.harness.query_by_label_contains("-3").is_some()
    );
    assert_eq!(bench.pixels(), picture, "what was shown stays");
    bench.type_into("method epsilon", "0.1");
    bench.settle();
    assert_eq!(bench.app().model.frame.as_ref().unwrap().main.spec, "dsm:epsilon=0.1");
}

#[test]
fn the_split_view_shows_two_methods() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    assert!(bench.app().model.frame.as_ref().unwrap().other.is_none());
    bench.harness.key_press(egui::Key::C);
    bench.settle();
    let frame = bench.app().model.frame.clone().unwrap();
    let other = frame.other.expect("a second picture");
    assert_eq!((frame.main.spec.as_str(), other.spec.as_str()), ("dsm:map=64", "none"));
    assert_ne!(bench.read(&frame.main.texture), bench.read(&other.texture));
    bench.harness.key_press(egui::Key::X);
    bench.settle();
    assert_eq!(bench.app().model.frame.as_ref().unwrap().main.spec, "none");
}

#[test]
fn drags_move_the_light_and_the_camera() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    let before = bench.app().model.document.as_ref().unwrap().scene.clone();
    let center = bench.app().model.view.unwrap().center();
    bench.drag(center, center + vec2(60.0, 20.0), Modifiers::SHIFT);
    bench.settle();
    let lit = bench.app().model.document.as_ref().unwrap().scene.clone();
    assert!(lit.lights != before.lights && lit.camera == before.camera);
    bench.drag(center, center + vec2(60.0, 20.0), Modifiers::NONE);
    bench.settle();
    let turned = bench.app().model.document.as_ref().unwrap().scene.clone();
    assert!(turned.lights == lit.lights && turned.camera != lit.camera);
    let sphere = bench.harness.get_by_label("light direction").rect().center();
    bench.drag(sphere, sphere + vec2(20.0, -10.0), Modifiers::NONE);
    bench.settle();
    assert_ne!(bench.app().model.document.as_ref().unwrap().scene.lights, turned.lights);
}

#[test]
fn a_probe_during_refinement_leaves_the_final_picture() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    for turn in 0..4 {
        let middle = bench.app().model.view.unwrap().center();
        let to = middle + vec2(40.0, 25.0 - 12.0 * turn as f32);
        bench.drag(middle, to, Modifiers::SHIFT);
        bench.click_at(middle);
        bench.settle();
        assert!(bench.app().model.frame.as_ref().unwrap().is_final);
    }
}

#[test]
fn a_click_probes_the_visible_point() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:32", "--tf=uniform", "--shadow=rays"]) else {
        return;
    };
    let center = bench.app().model.view.unwrap().center();
    bench.click_at(center);
    bench.wait_for("an answer", |app| app.model.probe.is_some());
    let probe = bench.app().model.probe.clone().expect("an answer");
    assert!(probe.exact.windows(2).all(|w| w[1][1] <= w[0][1] + 1e-12), "transmittance never rises");
    let rays = &probe.methods[0];
    assert!(
        (rays.at_point - probe.exact_at_point).abs() < 0.005,
        "{} {}",
        rays.at_point,
        probe.exact_at_point
    );
    assert!(probe.exact_at_point > 0.0 && probe.exact_at_point < 1.0);
}

#[test]
fn a_second_light_is_added_edited_moved_and_removed() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    let lights = |bench: &mut Bench| bench.app().model.document.as_ref().unwrap().scene.lights.clone();
    let first = lights(&mut bench);
    assert_eq!(first.len(), 1);
    let one = bench.pixels();
    bench.click("add light");
    bench.settle();
    let two = lights(&mut bench);
    assert_eq!((two.len(), &two[0]), (2, &first[0]));
    assert!(brightness(&bench.pixels()) > brightness(&one), "two lights are brighter");

    // The new light is the edited one, and drags move it alone.
    bench.type_into("light intensity", "0.25");
    bench.settle();
    let center = bench.app().model.view.unwrap().center();
    bench.drag(center, center + vec2(60.0, 20.0), Modifiers::SHIFT);
    bench.settle();
    let moved = lights(&mut bench);
    assert_eq!((&moved[0], moved[1].intensity), (&first[0], 0.25));
    assert_ne!(moved[1].light, two[1].light);

    bench.click("light 1");
    bench.drag(center, center + vec2(-40.0, 20.0), Modifiers::SHIFT);
    bench.settle();
    let back = lights(&mut bench);
    assert!(back[1] == moved[1] && back[0].light != first[0].light);

    // A scene file contains both, to the last bit.
    let document = bench.app().model.document.clone().unwrap();
    let read = umbravox::open::SceneRequest::from_toml(&document.scene_text("ct").unwrap()).unwrap().settings;
    assert_eq!(read.scene(&VisibleBounds::whole(&document.volume)).unwrap().lights, back);

    // The command line draws the same picture.
    bench.click("light 2");
    bench.click("remove light");
    bench.settle();
    assert_eq!(lights(&mut bench), back[..1]);
    bench.click("remove light");
    assert_eq!(lights(&mut bench).len(), 1, "the last one stays");
}
