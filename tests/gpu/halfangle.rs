//! `halfangle`: pictures and points against planes that are all stored, under lights on all sides of the camera.

use super::*;
use umbravox::measure::errors::VisiblePoints;
use umbravox::scene::LightSource;
use umbravox::shadow::BuildReport;

/// Lights in front of the volume, beside it and behind it, as seen from the camera.
fn lights_around(scene: &Scene, volume: &Volume) -> Vec<(&'static str, Light)> {
    let frame = scene.camera.frame();
    let toward = |forward: f64, right: f64, up: f64| Light::Directional {
        toward: -forward * frame.forward + right * frame.right + up * frame.up,
    };
    let center = volume.center_mm();
    let behind = center + 2.5 * (center - volume.corners_mm()[0]).length() * (frame.forward + 0.3 * frame.up);
    vec![
        ("front", toward(1.0, 0.2, 0.3)),
        ("side", toward(0.1, 1.0, 0.2)),
        ("side, from behind", toward(-0.1, -1.0, 0.3)),
        ("back", toward(-1.0, 0.1, 0.2)),
        ("lamp behind", Light::Point { position: behind }),
    ]
}

fn picture(setup: &Setup, method: &str, scene: &Scene) -> Array3<f32> {
    let maps = setup.session.shadows_of(shadow::parse(method).unwrap().as_ref(), scene).unwrap();
    setup.session.render(&maps, scene).unwrap().pixels
}

/// Light buffers answer about as well as a map that stores as many planes, whether eye rays cross the slices
/// with the light or against it. Opacity is that of pictures without shadows.
#[test]
fn pictures_are_those_of_stored_planes() {
    let volume = phantom("thorax:48");
    let Some(setup) = Setup::open(&volume, &opacity(&[(-600.0, 0.0), (600.0, 0.08)])) else { return };
    let base = Scene { background: [0.2, 0.4, 0.1], ..setup.scene(72, 56) };
    for (place, light) in lights_around(&base, &volume) {
        let scene = base.under(light.into());
        let exact = picture(&setup, "rays", &scene);
        let [fine, planes, coarse] = [
            "halfangle:slices=40,map=128",
            "osm:layers=40,bits=32,map=128,near=0",
            "halfangle:slices=6,map=128",
        ]
        .map(|method| rms_difference(&picture(&setup, method, &scene), &exact));
        let constant =
            rms_difference(&picture(&setup, "halfangle:slices=40,between=constant,map=128", &scene), &exact);
        println!("{place}: {fine:.5}, constant {constant:.5}, 6 slices {coarse:.5}; osm {planes:.5}");
        assert!(fine < 2.0 * planes + 1e-3, "{place}: {fine} {planes}");
        assert!(coarse > 2.0 * fine && constant > 1.4 * fine, "{place}: {fine} {constant} {coarse}");
        let opacity = picture(&setup, "halfangle", &scene);
        let without = picture(&setup, "none", &scene);
        let off = opacity.iter().zip(&without).skip(3).step_by(4).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f32::max) < 1e-3, "{place}");
    }
}

/// Several lights on both sides of the volume, with colours and shading: the picture is the sum of the pictures of each.
#[test]
fn lights_add_up() {
    let volume = phantom("shell:32");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    let base = Scene {
        shading: umbravox::scene::Shading::BlinnPhong,
        ambient: 0.0,
        background: [0.0; 3],
        ..setup.scene(48, 40)
    };
    let colors = [[1.0, 0.2, 0.1], [0.1, 0.9, 0.3], [0.2, 0.3, 1.0]];
    let lights = lights_around(&base, &volume).into_iter().step_by(2).zip(colors);
    let lights: Vec<_> =
        lights.map(|((_, light), color)| LightSource { color, intensity: 0.7, ..light.into() }).collect();
    let scene = Scene { lights: lights.clone(), ..base.clone() };
    let together = picture(&setup, "halfangle:slices=24", &scene);
    let mut sum = Array3::<f32>::zeros(together.dim());
    for light in lights {
        sum += &picture(&setup, "halfangle:slices=24", &base.under(light));
    }
    let off = together
        .indexed_iter()
        .filter(|((_, _, channel), _)| *channel < 3)
        .map(|(at, a)| (a - sum[at]).abs());
    let off = off.fold(0.0, f32::max);
    assert!(off < 2e-5, "{off}");
}

/// Points are answered by a sweep of their own, in any order. Memory does not depend on the number of slices.
#[test]
fn points_have_the_transmittance_of_their_slices() {
    let volume = phantom("thorax:48");
    let Some(setup) = Setup::open(&volume, &opacity(&[(-600.0, 0.0), (600.0, 0.08)])) else { return };
    let scene = setup.scene(40, 30);
    let field = setup.exact();
    for (place, light) in lights_around(&scene, &volume) {
        let scene = scene.under(light.into());
        let visible = VisiblePoints::new(&field, &scene, 3000);
        let mut last = f64::INFINITY;
        let mut bytes = Vec::new();
        for slices in [4, 16, 256] {
            let method = shadow::parse(&format!("halfangle:slices={slices},map=256")).unwrap();
            let maps = setup.session.shadows_of(method.as_ref(), &scene).unwrap();
            let rms = visible.errors(&setup.session, &maps).unwrap().unwrap().rms;
            println!("{place}, {slices} slices: {rms:.5}");
            assert!(rms < last, "{place}, {slices}: {rms} {last}");
            last = rms;
            bytes.push(BuildReport::of_all(&maps).bytes);
        }
        assert!(last < 0.02, "{place}: {last}");
        assert!(bytes.iter().all(|n| *n == bytes[0]), "{bytes:?}");
    }
}

/// A lamp inside the volume, or a camera that looks out of it with a wide angle, crosses slices in both directions.
#[test]
fn slices_that_are_crossed_twice_are_refused() {
    let volume = phantom("thorax:32");
    let Some(setup) = Setup::open(&volume, &opacity(&[(-600.0, 0.0), (600.0, 0.08)])) else { return };
    let method = shadow::parse("halfangle").unwrap();
    let scene = setup.scene(40, 30).under(Light::Point { position: volume.center_mm() }.into());
    let error = setup.session.shadows_of(method.as_ref(), &scene).map(|_| ()).unwrap_err();
    assert!(error.exit_status() == 2 && error.to_string().contains("crossed in both directions"), "{error}");
    // A picture of another view than that of the slices.
    let scene = setup.scene(40, 30);
    let maps = setup.session.shadows_of(method.as_ref(), &scene).unwrap();
    let camera = umbravox::scene::Camera { fov_deg: 20.0, ..scene.camera };
    assert!(setup.session.render(&maps, &Scene { camera, ..scene }).is_err());
}
