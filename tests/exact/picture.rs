//! What the camera sees: points and pictures.

use super::*;
use umbravox::exact::ExactField;
use umbravox::scene::{Camera, Light, Scene, Shading};

fn scene(volume: &Volume) -> Scene {
    let camera = Camera { up: DVec3::Z, ..Camera::framing(volume, DVec3::Z, 35.0) };
    Scene {
        camera,
        width: 12,
        height: 8,
        ambient: 0.2,
        background: [0.1, 0.2, 0.3],
        ..Scene::framing(volume)
    }
}

/// With the light at the eye, light and sight pass the same way: the integral of `exp(-2 tau) d tau`.
#[test]
fn picture_lit_from_the_eye() {
    let volume = rough_volume(oblique());
    for mut tf in transfer_functions() {
        let color = [0.9, 0.5, 0.25];
        tf.points.iter_mut().for_each(|p| p.color = color);
        let field = ExactField::new(&volume, &tf);
        let mut scene = scene(&volume);
        scene.light = Light::Point { position: scene.camera.eye };
        let picture = field.picture(&scene).unwrap();
        assert_eq!(picture.dim(), (8, 12, 4));
        let mut seen = 0;
        for ((row, column, channel), got) in picture.indexed_iter() {
            let direction = scene.camera.ray_direction(column as f64, row as f64, 12, 8);
            let t = (-field.curve_along(scene.camera.eye, direction, f64::INFINITY).total()).exp();
            let want = match channel {
                3 => 1.0 - t,
                c => color[c] * (0.2 * (1.0 - t) + 0.8 * 0.5 * (1.0 - t * t)) + t * scene.background[c],
            };
            assert!((f64::from(*got) - want).abs() < 1e-4, "{row} {column} {channel}: {got} {want}");
            seen += usize::from(t < 0.9);
        }
        assert!(seen > 40, "{seen}");
        // Of every pixel: the picture is as near to its limit as it says, and one that is not shows.
        assert!(field.picture_change(&scene, &picture, 96) < 1e-4);
        let mut off = picture.clone();
        off[[3, 5, 1]] += 0.01;
        assert!((field.picture_change(&scene, &off, 96) - 0.01).abs() < 2e-4);
    }
}

/// A colour ramp over a linear field, seen along it, ambient light only: the mean of the value under `exp(-t)`.
#[test]
fn picture_of_a_color_ramp() {
    let volume = volume([11, 40, 40], DAffine3::from_translation(DVec3::new(0.0, -19.5, -19.5)), |i, _, _| i);
    let mut tf = extinction(&[(0.0, 0.3), (10.0, 0.3)]);
    tf.points[0].color = [0.0, 1.0, 0.5];
    tf.points[1].color = [1.0, 0.0, 0.5];
    let eye = DVec3::new(-60.0, 0.0, 0.0);
    let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::Z, fov_deg: 1e-3 };
    let base = Scene::framing(&volume);
    let scene = Scene { camera, width: 1, height: 1, ambient: 1.0, background: [0.0; 3], ..base };
    let picture = ExactField::new(&volume, &tf).picture(&scene).unwrap();
    // Clamped half a voxel at both ends; sigma = 0.3 and t from the entry.
    let t = |mm: f64| (-0.3 * mm).exp();
    let red = 0.1 * ((1.0 / 0.3) * (t(0.5) - t(10.5)) - 10.0 * t(10.5)) + (t(10.5) - t(11.0));
    let opacity = 1.0 - t(11.0);
    for (got, want) in picture.iter().zip([red, opacity - red, 0.5 * opacity, opacity]) {
        assert!((f64::from(*got) - want).abs() < 5e-5, "{got} {want}");
    }
}

#[test]
fn only_shading_none_is_exact() {
    let volume = rough_volume(DAffine3::IDENTITY);
    let tf = &transfer_functions()[0];
    let scene = Scene { shading: Shading::Lambert, ..scene(&volume) };
    assert_eq!(ExactField::new(&volume, tf).picture(&scene).unwrap_err().exit_status(), 2);
}

/// The weighted mean over seen points is the mean over the picture.
#[test]
fn seen_points_are_distributed_as_the_camera_sees() {
    let volume = rough_volume(oblique());
    let quantities: [fn(DVec3) -> f64; 3] =
        [|x| x.x, |x| (x.z / 3.0).sin(), |x| f64::from(u8::from(x.y > 35.0))];
    for tf in transfer_functions() {
        let field = ExactField::new(&volume, &tf);
        let scene = scene(&volume);
        let points = field.seen_points(&scene, 20_000, 7);
        assert_eq!(points.len(), 20_000);
        assert_eq!(points, field.seen_points(&scene, 20_000, 7));
        assert_ne!(points[..10], field.seen_points(&scene, 10, 8));
        // The same means by 400 quantiles of every pixel.
        let (mut opacities, mut sums) = (0.0, [0.0; 3]);
        for index in 0..12 * 8 {
            let (column, row) = (f64::from(index % 12), f64::from(index / 12));
            let direction = scene.camera.ray_direction(column, row, 12, 8);
            let curve = field.curve_along(scene.camera.eye, direction, f64::INFINITY);
            let opacity = 1.0 - (-curve.total()).exp();
            if opacity > 0.0 {
                opacities += opacity;
                for q in 0..400 {
                    let tau = -(-opacity * (f64::from(q) + 0.5) / 400.0).ln_1p();
                    let x = scene.camera.eye + direction * curve.depth_of_optical_depth(tau).unwrap();
                    quantities.iter().zip(&mut sums).for_each(|(g, s)| *s += opacity * g(x) / 400.0);
                }
            }
        }
        let weights: f64 = points.iter().map(|p| p.weight).sum();
        for (g, sum) in quantities.iter().zip(sums) {
            let got = points.iter().map(|p| p.weight * g(p.position)).sum::<f64>() / weights;
            assert!((got - sum / opacities).abs() < 0.02, "{got} {}", sum / opacities);
        }
        assert!(points.iter().all(|p| p.weight > 0.0 && p.weight <= 1.0));
    }
}

#[test]
fn nothing_to_see() {
    let volume = rough_volume(DAffine3::IDENTITY);
    let tf = extinction(&[(0.0, 0.0)]);
    let field = ExactField::new(&volume, &tf);
    let scene = scene(&volume);
    assert!(field.seen_points(&scene, 100, 1).is_empty());
    assert!(field.seen_points(&scene, 0, 1).is_empty());
    let picture = field.picture(&scene).unwrap();
    assert_eq!(picture[[3, 3, 0]], 0.1f32);
    assert_eq!(picture[[3, 3, 3]], 0.0);
}
