//! Heat maps of the error of two shadow methods.

use super::Bench;
use eframe::egui::Key;
use umbravox::measure::error_map::Quantity;
use umbravox::scene::Shading;

#[test]
fn heat_maps_follow_methods_and_lights() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:32", "--tf=uniform", "--shadow=rays"]) else {
        return;
    };
    // The second method has no shadows.
    bench.harness.key_press(Key::C);
    bench.settle();
    bench.harness.key_press(Key::D);
    bench.harness.step();
    assert_eq!(bench.app().difference.shows, Some(Quantity::Light));
    bench.wait_for("the finest heat map", |app| app.difference.is_done());
    let scene = bench.app().model.document.as_ref().unwrap().scene.clone();
    let found = bench.app().difference.found.as_ref().unwrap();
    assert_eq!(
        (found.request.view.scene.width, found.request.view.scene.height),
        (scene.width, scene.height)
    );
    let [rays, none] = &found.sides[..] else { panic!("two methods") };
    assert_eq!((rays.spec.as_str(), none.spec.as_str()), ("rays", "none"));
    let (rays, none) = (rays.map.stats.unwrap(), none.map.stats.unwrap());
    assert!(rays.max_abs < 0.005 && rays.count > 1000, "{rays:?}");
    assert!(none.rms > 0.1 && none.mean > 0.1, "it is too bright: {none:?}");
    assert!(found.largest > 0.5);
    // Nothing is visible beside the sphere.
    assert!(found.sides[0].map.errors[[2, 2]].is_nan());

    // A changed light needs a new exact picture; the old one disappears at once.
    let before = none;
    bench.app().model.document.as_mut().unwrap().scene.lights = vec![
        umbravox::scene::Light::Directional { toward: glam::DVec3::new(-1.0, 0.2, 0.1).normalize() }.into(),
    ];
    bench.harness.step();
    assert!(bench.app().difference.found.is_none());
    bench.settle();
    bench.wait_for("the finest heat map", |app| app.difference.is_done());
    let after = bench.app().difference.found.as_ref().unwrap().sides[1].map.stats.unwrap();
    assert_ne!(before.rms, after.rms);

    // A changed method is compared with the same exact picture.
    let answer = std::sync::Arc::as_ptr(&bench.app().difference.found.as_ref().unwrap().request.view);
    bench.harness.key_press(Key::X);
    bench.settle();
    bench.wait_for("the other method's", |app| {
        app.difference.found.as_ref().is_some_and(|f| f.sides[0].spec == "none")
    });
    assert_eq!(answer, std::sync::Arc::as_ptr(&bench.app().difference.found.as_ref().unwrap().request.view));

    bench.app().difference.shows = None;
    bench.harness.step();
    assert!(bench.app().difference.found.is_none());
}

#[test]
fn picture_errors_include_shading() {
    let shown = ["phantom:sphere:16", "--tf=uniform", "--shadow=dsm:map=128", "--shading=lambert"];
    let Some(mut bench) = Bench::open(&shown) else { return };
    bench.app().difference.shows = Some(Quantity::Picture);
    // The coarsest result is enough; the finest would take a minute.
    bench.wait_for("the coarsest heat map", |app| app.difference.found.is_some());
    let found = bench.app().difference.found.as_ref().unwrap();
    assert_eq!(found.request.view.scene.shading, Shading::Lambert);
    let stats = found.sides[0].map.stats.unwrap();
    assert!(stats.rms < 0.02 && stats.count > 20, "{stats:?}");
    bench.app().difference.shows = None;
    bench.settle();
}

#[test]
fn bounds_are_those_of_methods_that_have_them() {
    let shown = ["phantom:sphere:16", "--tf=uniform", "--shadow=dsm:map=32"];
    let Some(mut bench) = Bench::open(&shown) else { return };
    bench.app().difference.shows = Some(Quantity::Bound);
    bench.wait_for("the coarsest bounds", |app| app.difference.found.is_some());
    let width = bench.app().model.document.as_ref().unwrap().scene.width;
    let found = bench.app().difference.found.as_ref().unwrap();
    let coarse = found.request.view.scene.width;
    assert!(coarse < width / 8, "{coarse} of {width}: the first result is a coarse one");
    let side = &found.sides[0];
    assert!(side.spec.contains("enclose=on"), "{}", side.spec);
    let stats = side.map.stats.unwrap();
    // Rounding alone is 5e-4; far from everything the bound is not shown.
    assert!(stats.mean > 5e-4 && stats.max_abs < 0.2 && stats.count > 20, "{stats:?}");
    assert!(side.map.errors[[0, 0]].is_nan());

    bench.wait_for("finer bounds", |app| {
        app.difference.found.as_ref().is_some_and(|found| found.request.view.scene.width > coarse)
    });

    // A method without bounds is refused in words, and the picture is shown again.
    bench.app().model.document.as_mut().unwrap().method = "osm:map=32".parse().unwrap();
    bench.wait_for("the refusal", |app| app.difference.shows.is_none());
    let messages = &bench.app().model.messages;
    assert!(messages.iter().any(|m| m.text.contains("only dsm")), "{}", messages.len());
}
