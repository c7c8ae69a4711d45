//! Orientation cube in the corner of the view.

use super::Bench;
use eframe::egui::{Key, Modifiers, Pos2, vec2};
use egui_kittest::kittest::Queryable;
use umbravox::scene::{AXIS_VIEWS, Camera};

const SMALL: &[&str] = &["phantom:sphere:16", "--tf=uniform", "--shadow=none"];

fn middle(bench: &Bench) -> Pos2 {
    bench.harness.get_by_label("orientation cube").rect().center()
}

fn camera(bench: &mut Bench) -> Camera {
    bench.app().model.document.as_ref().unwrap().scene.camera
}

/// Unit vector from the camera's target to the eye.
fn away(camera: &Camera) -> glam::DVec3 {
    (camera.eye - camera.target).normalize()
}

#[test]
fn a_click_looks_from_a_face_and_a_drag_rotates() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    let center = middle(&bench);
    // The front face stays in front and becomes parallel to the picture.
    let before = camera(&mut bench);
    bench.click_at(center);
    let front = camera(&mut bench);
    let nearest = AXIS_VIEWS.iter().max_by(|a, b| {
        let facing = |v: &umbravox::scene::AxisView| v.away.dot(away(&before));
        facing(a).total_cmp(&facing(b))
    });
    assert!((away(&front) - nearest.unwrap().away).length() < 1e-12);
    assert!((front.eye.distance(front.target) - before.eye.distance(before.target)).abs() < 1e-9);
    assert!(bench.app().model.probe.is_none(), "the view behind it was not clicked");
    // The front face belongs to the present view; its right edge is half way to the next view.
    for (i, view) in AXIS_VIEWS.iter().enumerate() {
        bench.app().model.look_from(i);
        bench.harness.run_steps(2);
        bench.click_at(center);
        assert!((away(&camera(&mut bench)) - view.away).length() < 1e-12, "{}", view.name);
        let right = camera(&mut bench).frame().right;
        bench.click_at(center + vec2(19.0, 0.0));
        let edge = (view.away + right).normalize();
        assert!((away(&camera(&mut bench)) - edge).length() < 1e-9, "{}", view.name);
    }
    // A click beside the cube does nothing; a drag on the cube rotates the view.
    bench.app().model.look_from(0);
    bench.harness.run_steps(2);
    bench.click_at(center + vec2(30.0, 30.0));
    assert!((away(&camera(&mut bench)) - AXIS_VIEWS[0].away).length() < 1e-12);
    bench.drag(center, center + vec2(21.0, 0.0), Modifiers::NONE);
    let turned = away(&camera(&mut bench));
    assert!(turned.dot(AXIS_VIEWS[0].away) < 0.4, "about a quarter of a turn: {turned}");
    bench.settle();
}

#[test]
fn it_can_be_hidden_and_covers_no_other_widget() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    for (width, height) in [(900.0, 560.0), (1200.0, 800.0), (640.0, 480.0)] {
        bench.harness.set_size(vec2(width, height));
        bench.harness.run_steps(4);
        let Some(cube) = bench.harness.query_by_label("orientation cube").map(|node| node.rect()) else {
            assert!(width < 700.0, "{width} x {height}");
            continue;
        };
        let view = bench.app().model.view.unwrap();
        assert!(view.contains_rect(cube), "{view} {cube}");
        // Letters at the centres of the borders stay uncovered.
        for at in [view.center_top() + vec2(0.0, 10.0), view.right_center() - vec2(10.0, 0.0)] {
            assert!(!cube.expand(8.0).contains(at), "{at} {cube}");
        }
    }
    bench.harness.set_size(super::SIZE);
    bench.harness.run_steps(4);
    bench.harness.key_press(Key::O);
    bench.harness.run_steps(2);
    assert!(bench.harness.query_by_label("orientation cube").is_none());
    bench.harness.key_press(Key::O);
    bench.harness.run_steps(2);
    assert!(bench.harness.query_by_label("orientation cube").is_some());
}
