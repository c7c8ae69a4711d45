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
    assert!(pages.resident < pages.needed && pages.blocks.is_some_and(|n| n > 2), "{pages:?}");
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
    let blocks = |app: &App| app.model.pages.and_then(|pages| pages.blocks).unwrap_or_default();
    let begun = blocks(bench.app());
    bench.wait_for("a block", move |app| blocks(app) > begun);
    drag(&mut bench);
    bench.wait_for("another coarse picture", move |app| app.model.frames > frames && is_coarse(app));
    let ended = blocks(bench.app());
    bench.settle();
    let whole = blocks(bench.app()) - ended;
    assert!(ended - begun < whole, "{begun} {ended}, and {whole} blocks of a whole picture");
    assert!(before != bench.pixels());
    bench.app().model.open_source("phantom:sphere:16");
    bench.wait_for("another volume", |app| {
        app.model.document.as_ref().is_some_and(|document| document.spec.source == "phantom:sphere:16")
    });
    bench.settle();
    assert!(bench.app().model.pages.is_none());
    assert!(bench.app().model.messages.iter().all(|message| !message.is_error));
}

/// A copy has no directions of strands.
#[test]
fn strands_are_streamed_without_a_shaded_copy() {
    let line = ["phantom:hair-curly:5000", "--resolution=160", "--shading=kajiya-kay", "--shadow=dsm:map=32"];
    let Some(mut bench) = Bench::open_within(&line, 8_000_000) else { return };
    assert!(bench.app().model.pages.is_some_and(|pages| pages.blocks.is_some()));
    assert!(bench.app().model.messages.iter().all(|message| !message.is_error));
}
