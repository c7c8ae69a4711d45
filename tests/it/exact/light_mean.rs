//! Mean transmittance from lights with a size: closed forms, the limit without a size, and plain Monte Carlo.

use super::*;
use rayon::prelude::*;
use std::sync::Arc;
use umbravox::exact::{ExactField, MeanTransmittance};
use umbravox::phantom::Phantom;
use umbravox::scene::{Extent, Light, LightSource, Scene, SkyMap, SkyRadiance};

/// Standard error at which the quadrature stops.
const STOPS: f64 = 5e-4;

fn sun(toward: DVec3, angle_deg: f64) -> LightSource {
    LightSource { extent: Extent::Cone { angle_deg }, ..Light::Directional { toward }.into() }
}

fn disc(position: DVec3, radius_mm: f64) -> LightSource {
    LightSource {
        extent: Extent::Disc { radius_mm, facing_mm: DVec3::ZERO },
        ..Light::Point { position }.into()
    }
}

/// Integrates over `[0, 1]` by the midpoint rule.
fn integral(f: impl Fn(f64) -> f64) -> f64 {
    let n = 100_000;
    (0..n).map(|i| f((f64::from(i) + 0.5) / f64::from(n))).sum::<f64>() / f64::from(n)
}

/// A point `depth` mm below the top of a wide, uniform slab sees light at the angle `a` from the vertical through
/// `depth / cos a` mm of it.
#[test]
fn light_through_a_uniform_slab() {
    let wide =
        volume([200, 200, 10], DAffine3::from_translation(DVec3::new(-99.5, -99.5, 0.0)), |_, _, _| 1.0);
    let field_tf = extinction(&[(0.0, 0.2), (2.0, 0.2)]);
    let field = ExactField::new(&wide, &field_tf);
    let (depth, x) = (4.0, DVec3::new(0.0, 0.0, 5.5));
    let through = |cos: f64| (-0.2 * depth / cos).exp();
    for angle_deg in [5.0, 60.0, 120.0] {
        let lowest = (0.5_f64 * angle_deg).to_radians().cos();
        let expected = integral(|u| through(lowest + (1.0 - lowest) * u));
        let found = field.transmittance_from(x, &sun(DVec3::Z, angle_deg));
        let off = (found.value - expected).abs();
        assert!(off < 4.0 * found.standard_error, "{angle_deg}: {found:?}, {expected}");
        assert!(found.standard_error < STOPS, "{found:?}");
    }
    let (height, radius) = (50.0, 30.0);
    let expected = integral(|area| through(height / (height * height + radius * radius * area).sqrt()));
    let found = field.transmittance_from(x, &disc(x + DVec3::Z * height, radius));
    assert!((found.value - expected).abs() < 4.0 * found.standard_error, "{found:?}, {expected}");
}

#[test]
fn small_lights_become_lights_without_a_size() {
    let (volume, tf) = (Phantom::Thorax.build(24).unwrap(), opacity(&[(-700.0, 0.0), (100.0, 0.3)]));
    let field = ExactField::new(&volume, &tf);
    let points = field.visible_points(&Scene::framing(&volume), 50, 3);
    for light in [Light::default(), Light::Point { position: DVec3::new(40.0, 300.0, 500.0) }] {
        let hard = LightSource::from(light);
        let small = match light {
            Light::Directional { toward } => sun(toward, 1e-6),
            Light::Point { position } => disc(position, 1e-6),
        };
        for point in &points {
            let [hard, soft] = [&hard, &small].map(|source| field.transmittance_from(point.position, source));
            assert!((hard.value - soft.value).abs() < 1e-6, "{hard:?}, {soft:?}");
            assert_eq!(hard.standard_error, 0.0);
        }
    }
}

/// Compares the mean with that of many independent random directions, at points of a phantom with opaque and translucent
/// tissue.
#[test]
fn the_mean_is_that_of_plain_monte_carlo() {
    let full = std::env::var("UMBRAVOX_TESTS").is_ok_and(|value| value == "full");
    let (count, rays) = if full { (200, 100_000) } else { (24, 20_000) };
    let (volume, tf) =
        (Phantom::Thorax.build(48).unwrap(), opacity(&[(-700.0, 0.0), (50.0, 0.02), (300.0, 0.9)]));
    let field = ExactField::new(&volume, &tf);
    let points = field.visible_points(&Scene::framing(&volume), count, 7);
    let toward = DVec3::new(0.3, 0.7, 0.648);
    let lights = [sun(toward, 5.0), sun(toward, 360.0), disc(volume.center_mm() + 500.0 * toward, 120.0)];
    let worst: Vec<f64> = (0..points.len())
        .into_par_iter()
        .map(|i| {
            let (x, source) = (points[i].position, &lights[i % lights.len()]);
            let mut random = Rng::with_seed(i as u64);
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..rays {
                let t = field.transmittance_to_light(x, &source.sample([random.f64(), random.f64()]).light);
                (sum, squares) = (sum + t, squares + t * t);
            }
            let n = f64::from(rays);
            let mean = sum / n;
            let error = ((squares / n - mean * mean).max(0.0) / n).sqrt();
            let found = field.transmittance_from(x, source);
            assert!(found.standard_error < 2.0 * STOPS, "{found:?}");
            (found.value - mean).abs() / error.hypot(found.standard_error).max(1e-9)
        })
        .collect();
    let largest = worst.iter().copied().fold(0.0, f64::max);
    println!("{} points, {rays} rays: at most {largest:.2} standard errors", points.len());
    assert!(largest < 4.0, "{largest}");
}

/// A sky with a map whose upper half shines is a cone of 180 degrees.
#[test]
fn half_of_a_map_is_half_of_the_sky() {
    let (volume, tf) = (Phantom::Thorax.build(24).unwrap(), opacity(&[(-700.0, 0.0), (100.0, 0.3)]));
    let field = ExactField::new(&volume, &tf);
    let rgb = (0..32 * 16).map(|i| if i < 32 * 8 { [0.0, 3.0, 0.0] } else { [0.0; 3] }).collect();
    let radiance = Some(Arc::new(SkyRadiance::new(32, rgb).unwrap()));
    let map = SkyMap { path: String::new(), turn_deg: 30.0, radiance };
    let sky = LightSource { extent: Extent::Map(map), ..LightSource::default() };
    assert!((sky.radiance()[1] - 1.5).abs() < 1e-12);
    let half = sun(DVec3::Z, 180.0);
    for point in field.visible_points(&Scene::framing(&volume), 20, 5) {
        let [a, b] = [&sky, &half].map(|source| field.transmittance_from(point.position, source));
        let error = a.standard_error.hypot(b.standard_error).max(1e-9);
        assert!((a.value - b.value).abs() < 4.5 * error, "{a:?} {b:?}");
    }
}

/// A thin rod hides a small share of the sky. Over many seeds, which are given by the last digits of the point, the errors
/// have the stated size and no common sign, and about as many exceed multiples of their own standard error as those of a
/// mean of eight values: 2 % of them three times theirs (Student's distribution with 7 degrees of freedom).
#[test]
fn the_stated_error_is_that_of_small_occluders() {
    let rod = volume([3, 3, 60], DAffine3::IDENTITY, |i, j, _| f64::from(u8::from(i == 1.0 && j == 1.0)));
    let tf = extinction(&[(0.0, 0.0), (0.5, 0.0), (0.5, 50.0), (2.0, 50.0)]);
    let field = ExactField::new(&rod, &tf);
    let sky = sun(DVec3::Z, 360.0);
    let (places, seeds, directions) = (8, 80, 1_000_000);
    let errors_at = |place: i32| {
        let x = DVec3::new(8.0 + 3.0 * f64::from(place), 3.0, 20.0);
        let lights = sky.lattice(directions, [0.37, 0.71]);
        let mean = lights.map(|sample| field.transmittance_to_light(x, &sample.light)).sum::<f64>()
            / directions as f64;
        let with_seed = |seed| field.transmittance_from(x + DVec3::X * (1e-9 * f64::from(seed)), &sky);
        let error = move |found: MeanTransmittance| (found.value - mean, found.standard_error);
        (0..seeds).map(with_seed).map(error).collect::<Vec<_>>()
    };
    let errors: Vec<(f64, f64)> = (0..places).into_par_iter().flat_map(errors_at).collect();
    let n = errors.len() as f64;
    let rms = |of: fn(&(f64, f64)) -> f64| (errors.iter().map(|e| of(e).powi(2)).sum::<f64>() / n).sqrt();
    let [error, stated] = [rms(|e| e.0), rms(|e| e.1)];
    let bias = errors.iter().map(|e| e.0).sum::<f64>() / n;
    let share = errors.iter().filter(|e| e.0.abs() > 3.0 * e.1).count() as f64 / n;
    println!("error {error:.1e}, stated {stated:.1e}, mean {bias:.1e}, beyond three errors {share:.3}");
    assert!((0.75..1.33).contains(&(error / stated)) && error < STOPS, "{error}, {stated}");
    assert!(bias.abs() < 4.0 * error / n.sqrt(), "{bias}");
    assert!(share < 0.045, "{share}");
}
