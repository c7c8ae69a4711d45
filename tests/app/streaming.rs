//! Volumes whose pages exceed the device memory: a reduced copy while something moves, and the whole volume at rest.

use super::Bench;
use eframe::egui::{Modifiers, vec2};
use egui_kittest::kittest::Queryable;
use umbravox::app::App;

const LINE: &[&str] = &["phantom:struts:128", "--shadow=dsm:map=64"];
/// Holds half the pages of the volume, bytes.
const LIMIT: u64 = 3_600_000;

#[test]
fn a_picture_at_rest_shows_the_whole_volume() {
    let Some(mut whole) = Bench::open(LINE) else { return };
    let Some(mut bench) = Bench::open_within(LINE, LIMIT) else { return };
    let pages = bench.app().model.pages.unwrap();
    assert!(pages.resident < pages.needed && pages.loads.is_some_and(|n| n > 2), "{pages:?}");
    assert_eq!(whole.app().model.pages, None);
    // Pages are interpolated with float32 weights, whole textures with those of the device.
    let (whole, paged) = (whole.pixels(), bench.pixels());
    assert!(whole.len() == paged.len() && whole.iter().zip(&paged).all(|(a, b)| a.abs_diff(*b) <= 1));
    bench.harness.get_by_label_contains(&format!("of {} pages resident", pages.needed));
}

#[test]
fn a_moving_picture_shows_a_reduced_copy() {
    let Some(mut bench) = Bench::open_within(LINE, LIMIT) else { return };
    let before = bench.pixels();
    let centre = bench.app().model.view.unwrap().center();
    let drag = |bench: &mut Bench| bench.drag(centre, centre + vec2(60.0, 10.0), Modifiers::NONE);
    let is_coarse = |app: &App| app.model.frame.as_ref().is_some_and(|frame| frame.is_reduced);
    drag(&mut bench);
    bench.wait_for("a coarse picture", is_coarse);
    let frames = bench.app().model.frames;
    // A drawing of the whole volume that has begun ends for the next coarse picture.
    let loads = |app: &App| app.model.pages.and_then(|pages| pages.loads).unwrap_or_default();
    let begun = loads(bench.app());
    bench.wait_for("a block", move |app| loads(app) > begun);
    drag(&mut bench);
    bench.wait_for("another coarse picture", move |app| app.model.frames > frames && is_coarse(app));
    bench.settle();
    assert!(before != bench.pixels());
    assert!(bench.app().model.messages.iter().all(|message| !message.is_error));
}
