//! The bound on the mean error of a picture's shadows, from random points.

use super::*;
use umbravox::measure::mean_error::{MeanError, MeanErrorSample};
use umbravox::scene::LightSource;
use umbravox::shadow::parse;

/// A translucent shell, and a small picture of it without ambient light.
fn shell() -> Option<(Setup, Scene)> {
    let volume = phantom("shell:24");
    let setup = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)]))?;
    Some((setup, Scene { width: 64, height: 48, ambient: 0.0, ..Scene::framing(&volume) }))
}

#[test]
fn the_bound_covers_the_mean_error_of_methods() {
    let Some((setup, scene)) = shell() else { return };
    let field = setup.exact();
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

/// Ambient light takes its share of the error, and every light adds its own with its colour and intensity.
#[test]
fn the_mean_error_is_that_of_all_lights() {
    let Some((setup, scene)) = shell() else { return };
    let field = setup.exact();
    let source = |light: Light, color, intensity| LightSource { color, intensity, ..light.into() };
    let lit = |lights: &[LightSource], ambient| Scene { lights: lights.to_vec(), ambient, ..scene.clone() };
    let of = |scene: &Scene| {
        let maps = setup.session.shadows_of(parse("none").unwrap().as_ref(), scene).unwrap();
        let sample = MeanErrorSample::new(&field, scene, 20_000);
        let query = |map: &ShadowMap, points: &[DVec3]| setup.session.query(map, points);
        sample.of(&maps.iter().collect::<Vec<_>>(), query).unwrap()
    };
    let [above, side] = [DVec3::Z, DVec3::X].map(|toward| Light::Directional { toward });
    let (white, blue) = (source(above, [1.0; 3], 0.5), source(side, [0.0, 0.0, 1.0], 2.0));
    let alone = [white.clone(), blue.clone()].map(|light| of(&lit(&[light], 0.0)).estimate);
    let both = of(&lit(&[white.clone(), blue.clone()], 0.0));
    let sum = alone[0] + alone[1];
    assert!(sum > 0.1 && (both.estimate - sum).abs() < 0.05 * sum, "{both:?}, {alone:?}");
    let dimmed = of(&lit(&[white.clone(), blue], 0.75));
    let [estimate, bound] = [both.estimate, both.bound].map(|error| 0.25 * error);
    assert!((dimmed.estimate - estimate).abs() < 1e-12 && (dimmed.bound - bound).abs() < 1e-12, "{dimmed:?}");
    for none in [of(&lit(&[white], 1.0)), of(&lit(&[], 0.0))] {
        assert_eq!(none, MeanError { estimate: 0.0, bound: 0.0 });
        assert!(none.estimate.is_sign_positive(), "printed as -0");
    }
}
