//! The bound on the mean error of a picture's shadows, from random points.

use super::*;
use umbravox::measure::mean_error::{MeanError, MeanErrorSample};

#[test]
fn the_bound_covers_the_mean_error_of_methods() {
    let volume = phantom("shell:24");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    let field = setup.exact();
    let scene = Scene { width: 64, height: 48, ..Scene::framing(&volume) };
    let sample = MeanErrorSample::new(&field, &scene, 4000);
    let of = |spec: &str| -> MeanError {
        let map = setup.shadow(spec, scene.light());
        sample.of(&[&map], |map, points| setup.session.query(map, points)).unwrap()
    };
    // Without shadows the error is 1 - T: its mean over the picture, from ten times as many other points.
    let others = field.random_visible_points(&scene, 40_000, 99);
    let dark = |position: DVec3| 1.0 - field.transmittance_to_light(position, &scene.light());
    let mean = others.iter().flatten().map(|p| p.weight * dark(p.position)).sum::<f64>() / 40_000.0;
    let none = of("none");
    assert!(mean > 0.05 && none.bound > mean && none.bound < mean + 0.04, "{none:?}, {mean}");
    assert!((none.estimate - mean).abs() < 0.02, "{none:?}, {mean}");
    // With rays, chance takes 7 ln(200) / (3 * 3999), and the rays next to nothing.
    let rays = of("rays");
    assert!(rays.estimate < 1e-4 && rays.bound > 0.003 && rays.bound < 0.0033, "{rays:?}");
    let [coarse, fine] = ["dsm:map=8,near=0", "dsm:map=64,near=4,epsilon=0.002"].map(of);
    assert!(fine.bound < coarse.estimate && coarse.bound < none.estimate, "{fine:?}, {coarse:?}");
}
