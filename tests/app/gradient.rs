//! Window of the gradient opacity: points over the joint histogram, their effect on the picture, and the scene file.

use super::Bench;
use eframe::egui::{Key, Modifiers, vec2};
use egui_kittest::kittest::Queryable;
use umbravox::files::loading::Loading;
use umbravox::open::SceneRequest;

/// Gradient opacity of the open volume, in the syntax of `--gradient-opacity`.
fn opacity(bench: &mut Bench) -> String {
    let document = bench.app().model.document.as_ref().unwrap();
    document.tf.gradient_opacity.as_ref().map_or("none".into(), ToString::to_string)
}

#[test]
fn points_change_the_picture_and_are_undone_as_one_drag() {
    let Some(mut bench) = Bench::open(&["phantom:thorax:32", "--shadow=none", "--tf=bone"]) else { return };
    let plain = bench.pixels();
    bench.click("Gradient…");
    bench.wait_for("counted", |app| app.windows.gradient.is_counted());
    bench.click("Boundaries");
    bench.settle();
    let boundaries = opacity(&mut bench);
    assert!(boundaries.starts_with("0:0,") && boundaries.ends_with(":1"), "{boundaries}");
    let clear = bench.pixels();
    assert!(clear != plain, "the same picture");

    let point = bench.harness.get_by_label("gradient point 2").rect().center();
    bench.drag(point, point + vec2(-40.0, -30.0), Modifiers::NONE);
    bench.settle();
    let dragged = opacity(&mut bench);
    let factor: f64 = dragged.rsplit(':').next().unwrap().parse().unwrap();
    assert!(dragged != boundaries && factor < 0.95 && factor > 0.5, "{dragged}");
    assert!(bench.harness.query_by_label("gradient factor").is_some(), "its numbers are shown");
    bench.app().model.undo();
    assert_eq!(opacity(&mut bench), boundaries);
    bench.settle();
    assert!(bench.pixels() == clear);

    // The Delete key removes the point that was clicked last, in this editor or in that of the transfer function.
    let points = |bench: &mut Bench| bench.app().model.document.as_ref().unwrap().tf.points.len();
    let before = points(&mut bench);
    bench.click("point 2");
    bench.click("gradient point 2");
    bench.harness.key_press(Key::Delete);
    bench.settle();
    assert_eq!((points(&mut bench), &*opacity(&mut bench)), (before, "0:0"));
    bench.click("gradient point 1");
    bench.click("point 2");
    bench.harness.key_press(Key::Delete);
    bench.settle();
    assert_eq!((points(&mut bench), &*opacity(&mut bench)), (before - 1, "0:0"));
    bench.app().model.undo();

    bench.click("None");
    bench.settle();
    assert_eq!(opacity(&mut bench), "none");
    assert!(bench.pixels() == plain);
}

#[test]
fn points_are_added_and_saved_in_the_scene() {
    let Some(mut bench) = Bench::open(&["phantom:thorax:24", "--shadow=none", "--tf=bone"]) else { return };
    bench.click("Gradient…");
    bench.wait_for("counted", |app| app.windows.gradient.is_counted());
    let canvas = bench.harness.get_by_label("gradient opacity curve").rect().center();
    // A step of the interface takes 0.25 s. With a longer delay, the click before would make this a triple one.
    bench.harness.ctx.options_mut(|options| options.input_options.max_double_click_delay = 1.0);
    bench.click_at(canvas);
    bench.click_at(canvas);
    bench.harness.run_steps(2);
    assert_eq!(opacity(&mut bench).split(',').count(), 3, "{}", opacity(&mut bench));
    let dir = tempfile::tempdir().unwrap();
    let scene = dir.path().join("scene.toml");
    bench.app().model.save_scene(&scene);
    let read = SceneRequest::read(&scene).unwrap().settings.load(&Loading::default()).unwrap();
    let shown = bench.app().model.document.clone().unwrap().tf;
    assert_eq!(read.tf.gradient_opacity, shown.gradient_opacity);

    // A file's gradient opacity that was taken away stays away.
    bench.app().model.save_tf(&dir.path().join("own.json"));
    bench.app().model.load_tf(dir.path().join("own.json").to_str().unwrap());
    assert_ne!(opacity(&mut bench), "none");
    bench.app().model.document.as_mut().unwrap().set_gradient_opacity(None, true);
    bench.app().model.save_scene(&scene);
    let read = SceneRequest::read(&scene).unwrap().settings.load(&Loading::default()).unwrap();
    assert_eq!(read.tf.gradient_opacity, None);
}
