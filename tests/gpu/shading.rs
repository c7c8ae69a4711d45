//! Shading factors against closed forms: at the point of a ball that faces the eye, the normal is the eye's
//! direction.

use super::*;
use umbravox::scene::{Shading, Skip};

#[test]
fn a_ball_is_shaded_by_its_normal() {
    // Opaque from the surface on, so that one normal makes the pixel.
    let Some(setup) = Setup::open(&phantom("sphere:48"), &extinction(&[(500.0, 0.0), (500.0, 60.0)])) else {
        return;
    };
    for (toward_eye, skip) in [(0.0_f64, Skip::Bricks), (0.5, Skip::None), (0.9, Skip::Bricks)] {
        let base = Scene { ambient: 0.0, background: [0.0; 3], skip, ..setup.scene(31, 31) };
        let eye = (base.camera.eye - base.camera.target).normalize();
        let toward = toward_eye * eye + (1.0 - toward_eye * toward_eye).sqrt() * eye.any_orthonormal_vector();
        let light = Light::Directional { toward };
        let halfway = toward.normalize() + eye;
        let diffuse = toward.normalize().dot(eye).abs();
        let gloss = 0.3 * halfway.normalize().dot(eye).abs().powi(32);
        // Shadows darken alike with and without shading.
        for method in ["none", "dsm:map=64", "rays"] {
            let red = |shading| {
                setup.picture(method, &Scene { lights: vec![light.into()], shading, ..base.clone() })
                    [[15, 15, 0]]
            };
            let [plain, lambert, blinn_phong] =
                [Shading::None, Shading::Lambert, Shading::BlinnPhong].map(red);
            for (got, factor) in [(lambert, diffuse), (blinn_phong, diffuse + gloss)] {
                let expected = f64::from(plain) * factor;
                assert!(
                    (f64::from(got) - expected).abs() < 0.02,
                    "{toward_eye}, {method}: {got}, not {expected}"
                );
            }
        }
    }
}

/// With the light behind the eye ray's end there is no halfway vector, and so no highlight.
#[test]
fn a_light_along_the_eye_ray_has_no_highlight() {
    let Some(setup) = Setup::open(&phantom("sphere:48"), &extinction(&[(500.0, 0.0), (500.0, 60.0)])) else {
        return;
    };
    let mut scene = Scene { ambient: 0.0, background: [0.0; 3], ..setup.scene(31, 31) };
    let distance = (scene.camera.eye - scene.camera.target).length();
    scene.camera.eye = scene.camera.target + distance * DVec3::X;
    scene.camera.up = DVec3::Z;
    scene.lights = vec![Light::Directional { toward: -DVec3::X }.into()];
    let [lambert, blinn_phong] = [Shading::Lambert, Shading::BlinnPhong]
        .map(|shading| setup.picture("none", &Scene { shading, ..scene.clone() }));
    assert!(blinn_phong.iter().all(|channel| channel.is_finite()));
    assert!(lambert[[15, 15, 0]] > 0.1);
    assert_eq!(blinn_phong[[15, 15, 0]].to_bits(), lambert[[15, 15, 0]].to_bits());
}

/// A phase function multiplies the light of a pixel by one factor under a light at infinity: that of the angle between the
/// light's direction and the eye ray.
#[test]
fn a_phase_function_is_that_of_henyey_and_greenstein() {
    let Some(setup) = Setup::open(&phantom("sphere:48"), &extinction(&[(0.0, 0.0), (500.0, 0.02)])) else {
        return;
    };
    let base = Scene { ambient: 0.0, background: [0.0; 3], ..setup.scene(31, 31) };
    let sight = base.camera.frame().forward;
    for (angle_deg, g) in [(0.0_f64, 0.8), (40.0, 0.8), (90.0, -0.5), (180.0, 0.8), (120.0, 0.0)] {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        let toward = cos * sight + sin * sight.any_orthonormal_vector();
        let expected = (1.0 - g * g) / (1.0 + g * g - 2.0 * g * cos).powf(1.5);
        for method in ["none", "rays"] {
            let red = |shading| {
                let light = Light::Directional { toward };
                let scene = Scene { lights: vec![light.into()], shading, mean_cosine: g, ..base.clone() };
                f64::from(setup.picture(method, &scene)[[15, 15, 0]])
            };
            let (plain, scattered) = (red(Shading::None), red(Shading::Phase));
            let factor = scattered / plain;
            assert!(
                (factor - expected).abs() < 1e-4 * expected,
                "{angle_deg}, {g}, {method}: {factor}, not {expected}"
            );
        }
    }
}
