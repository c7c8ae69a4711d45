//! Assertions for any kind of volume: error bounds, known transmittances, pictures.

use super::*;
use crate::bound::along_light_rays;
use umbravox::scene::{Shading, Skip};

/// Asserts the error bounds of `rays` and `dsm` under every light; `what` names the volume.
pub fn promises_hold(setup: &Setup, what: &str) {
    for (place, light) in lights(setup.volume()) {
        for method in ["rays", "dsm:epsilon=0.005,map=64", "dsm:epsilon=0.02,compress=optimal,map=64"] {
            let (report, sanity) = along_light_rays(setup, method, light);
            let wrong = sanity.monotone_violations + sanity.non_finite + sanity.out_of_range;
            assert!(
                report.satisfied() == Some(true) && wrong == 0,
                "{what}, {place}, {method}: {report:?} {sanity:?}"
            );
        }
    }
}

/// Asserts the exact transmittance at points, and that of each shadow method within its tolerance.
pub fn answers_are(setup: &Setup, light: Light, points: &[DVec3], wanted: &[f64], methods: &[(&str, f64)]) {
    let exact = setup.exact();
    for (p, want) in points.iter().zip(wanted) {
        let got = exact.transmittance_to_light(*p, &light);
        assert!((got - want).abs() < 1e-12, "{p}: {got} {want}");
    }
    for (method, allowed) in methods {
        let got = setup.query(&setup.shadow(method, light), points);
        let off = got.iter().zip(wanted).map(|(t, want)| (f64::from(*t) - want).abs()).fold(0.0, f64::max);
        println!("{method}: {off:.5}");
        assert!(off <= *allowed, "{method}: {off}");
    }
}

/// Asserts that pictures agree with the exact picture, and do not change without skipping.
pub fn pictures_are_exact_and_skipping_changes_nothing(setup: &Setup, what: &str) {
    let scene = setup.scene(32, 24);
    let exact = setup.exact().picture(&scene);
    for (method, allowed) in
        [("rays", tolerance::RAYS_PICTURE_RMS), ("dsm:epsilon=0.005", tolerance::DSM_PICTURE_RMS)]
    {
        let map = setup.shadow(method, scene.light());
        let picture = setup.picture_of(&map, &scene);
        let rms = rms_difference(&picture, &exact);
        println!("{what}, {method}: rms {rms:.5}");
        assert!(rms <= allowed, "{what}, {method}: rms {rms}");
        let plain = setup.picture_of(&map, &Scene { skip: Skip::None, ..scene.clone() });
        let off = largest_difference(&picture, &plain);
        assert!(off <= tolerance::SKIPPING, "{what}, {method}: {off}");
    }
    // Shaded pictures take additional samples along the ray.
    let scene = Scene { shading: Shading::Lambert, ..scene };
    let map = setup.shadow("rays", scene.light());
    let picture = setup.picture_of(&map, &scene);
    let rms = rms_difference(&picture, &setup.exact().picture(&scene));
    println!("{what}, shaded: rms {rms:.5}");
    assert!(rms <= tolerance::SHADED_PICTURE_RMS, "{what}, shaded: rms {rms}");
    let plain = setup.picture_of(&map, &Scene { skip: Skip::None, ..scene });
    let off = largest_difference(&picture, &plain);
    assert!(off <= tolerance::SKIPPING, "{what}, shaded: {off}");
}
