//! Visible points and pictures of the float64 reference.

use super::*;
use std::f64::consts::PI;
use std::sync::Arc;
use umbravox::exact::ExactField;
use umbravox::scene::{Camera, Light, Scene, Shading};
use umbravox::volume::DirectionMoments;

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

/// With the light at the eye, light and eye rays coincide: the picture is the integral of `exp(-2 tau) d tau`.
#[test]
fn picture_lit_from_the_eye() {
    let volume = rough_volume(oblique());
    for mut tf in transfer_functions() {
        let color = [0.9, 0.5, 0.25];
        tf.points.iter_mut().for_each(|p| p.color = color);
        let field = ExactField::new(&volume, &tf);
        let mut scene = scene(&volume);
        scene.lights = vec![Light::Point { position: scene.camera.eye }.into()];
        let picture = field.picture(&scene);
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
        // The picture is as close to its limit as it claims, for every pixel, and a picture that is not is detected.
        assert!(field.picture_change(&scene, &picture, 96) < 1e-4);
        let mut off = picture.clone();
        off[[3, 5, 1]] += 0.01;
        assert!((field.picture_change(&scene, &off, 96) - 0.01).abs() < 2e-4);
    }
}

/// A colour ramp over a linear field, viewed along the field with ambient light: the mean of the value under
/// `exp(-t)`.
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
    let picture = ExactField::new(&volume, &tf).picture(&scene);
    // Clamped half a voxel at both ends; sigma = 0.3 and t from the entry.
    let t = |mm: f64| (-0.3 * mm).exp();
    let red = 0.1 * ((1.0 / 0.3) * (t(0.5) - t(10.5)) - 10.0 * t(10.5)) + (t(10.5) - t(11.0));
    let opacity = 1.0 - t(11.0);
    for (got, want) in picture.iter().zip([red, opacity - red, 0.5 * opacity, opacity]) {
        assert!((f64::from(*got) - want).abs() < 5e-5, "{got} {want}");
    }
}

/// A linear field has one gradient, and thus one shading factor under a directional light, for any affine.
#[test]
fn shading_of_a_linear_field_is_one_factor() {
    let slope = DVec3::new(3.0, -2.0, 1.0);
    let volume = volume([12, 12, 12], oblique(), |i, j, k| slope.dot(DVec3::new(i, j, k)));
    let tf = extinction(&[(-20.0, 0.05), (40.0, 0.1)]);
    let field = ExactField::new(&volume, &tf);
    // s = slope . index and index = M world, so that the gradient in world is M^T slope.
    let gradient = volume.index_from_world().matrix3.transpose() * slope;
    let n = gradient.normalize();
    let base = Scene { ambient: 0.0, background: [0.0; 3], ..scene(&volume) };
    let middle = volume.world_from_index().transform_point3(DVec3::splat(5.3));
    assert!((field.gradient(middle) - gradient).length() < 1e-12 * gradient.length());
    for toward in [DVec3::new(0.3, 0.2, 0.9), -n, n.any_orthonormal_vector() + 0.2 * n] {
        let light = Light::Directional { toward };
        let diffuse = n.dot(toward.normalize()).abs();
        let sight = (middle - base.camera.eye).normalize();
        let halfway = (toward.normalize() - sight).normalize();
        let gloss = 0.3 * n.dot(halfway).abs().powf(32.0);
        for (shading, factor) in
            [(Shading::None, 1.0), (Shading::Lambert, diffuse), (Shading::BlinnPhong, diffuse + gloss)]
        {
            assert_close(
                field.shading_factor(middle, sight, &light, &Scene { shading, ..base.clone() }),
                factor,
                1e-12,
            );
        }
        // The edge is clamped half a voxel wide: a pixel through the middle alone has the one factor nearly
        // everywhere.
        let camera = Camera { target: middle, fov_deg: 1e-3, ..base.camera };
        let one = Scene { lights: vec![light.into()], camera, width: 1, height: 1, ..base.clone() };
        let red = |shading| field.picture(&Scene { shading, ..one.clone() })[[0, 0, 0]];
        let (plain, lambert) = (f64::from(red(Shading::None)), f64::from(red(Shading::Lambert)));
        assert!(
            plain > 0.1 && (lambert - diffuse * plain).abs() < 0.1 * plain,
            "{toward}: {lambert}, {plain}"
        );
    }
}

/// Parallel strands have the Kajiya-Kay factor of their two angles. Strands of all directions have the root mean
/// square of all sines.
#[test]
fn strands_are_shaded_by_their_directions() {
    let volume = volume([4, 3, 5], oblique(), |i, _, _| 1.0 + i);
    let tf = extinction(&[(0.0, 0.1)]);
    let field = |moments: [f32; 6]| {
        let moments = DirectionMoments::new([4, 3, 5], volume.world_from_index(), vec![moments; 60]).unwrap();
        ExactField::new(&volume, &tf).with_directions(Some(Arc::new(moments)))
    };
    let x = volume.world_from_index().transform_point3(DVec3::new(1.3, 1.1, 2.4));
    let factor = |field: &ExactField, l: DVec3, e: DVec3| {
        let scene = Scene { shading: Shading::KajiyaKay, ..scene(&volume) };
        field.shading_factor(x, -e, &Light::Directional { toward: l }, &scene)
    };
    let (along_z, all) = (field([0.0, 0.0, 0.7, 0.0, 0.0, 0.0]), field([0.25, 0.25, 0.25, 0.0, 0.0, 0.0]));
    let nowhere = field([0.0; 6]);
    let at = |angle: f64, around: f64| {
        let (across, along) = angle.sin_cos();
        DVec3::new(across * around.cos(), across * around.sin(), along)
    };
    for (from_light, from_eye) in
        [(0.9, 1.4), (0.7, PI - 0.7), (0.7, 0.7), (1.2, PI - 1.1), (2.5, 0.8), (PI / 2.0, 1.5)]
    {
        let (l, e) = (at(from_light, 0.3), at(from_eye, 2.1));
        let gloss = (PI - from_light - from_eye).cos().max(0.0).powi(32);
        assert_close(factor(&along_z, l, e), from_light.sin() + 0.3 * gloss, 1e-12);
        let sines = 2.0 / 3.0;
        let gloss = (sines - l.dot(e) / 3.0).powi(32);
        assert_close(factor(&all, l, e), f64::sqrt(sines) + 0.3 * gloss, 1e-12);
        assert_eq!(factor(&nowhere, l, e), 1.0);
        assert_eq!(factor(&ExactField::new(&volume, &tf), l, e), 1.0);
    }
    // The highlight lies where the light would continue along the strand, all around it, and not where it comes from.
    let l = at(0.7, 0.0);
    let behind = |around: f64| factor(&along_z, l, at(PI - 0.7, around));
    assert_close(behind(0.0), behind(2.0), 1e-12);
    assert!(behind(1.0) > factor(&along_z, l, l) + 0.29);
}

/// At the edge of the volume values are clamped: outside its voxels the gradient across that axis is zero.
#[test]
fn gradients_at_edges_and_in_flat_regions() {
    let volume =
        volume([8, 8, 8], DAffine3::IDENTITY, |i, j, _| if i < 4.0 { 7.0 / 3.0 } else { 2.0 * i + j });
    let tf = extinction(&[(0.0, 0.1)]);
    let field = ExactField::new(&volume, &tf);
    // Constant values have no gradient, and thus the full light.
    let flat = DVec3::new(1.3, 3.7, 2.2);
    assert_eq!(field.gradient(flat), DVec3::ZERO);
    let light = Light::Point { position: DVec3::new(9.0, -30.0, 4.0) };
    assert_eq!(
        field.shading_factor(
            flat,
            DVec3::X,
            &light,
            &Scene { shading: Shading::BlinnPhong, ..scene(&volume) }
        ),
        1.0
    );
    // Half of the difference across the last half voxel is clamped away.
    let close = |at: [f64; 3], want: [f64; 3]| {
        let got = field.gradient(DVec3::from_array(at));
        assert!((got - DVec3::from_array(want)).length() < 1e-12, "{at:?}: {got}");
    };
    close([6.0, 3.5, 3.5], [2.0, 1.0, 0.0]);
    close([7.0, 3.5, 3.5], [1.0, 1.0, 0.0]);
    close([7.5, 7.5, 3.5], [0.0, 0.0, 0.0]);
    close([6.0, 7.25, 7.0], [2.0, 0.25, 0.0]);
}

/// The weighted mean over visible points equals the mean over the picture.
#[test]
fn visible_points_are_distributed_like_camera_rays() {
    let volume = rough_volume(oblique());
    let quantities: [fn(DVec3) -> f64; 3] =
        [|x| x.x, |x| (x.z / 3.0).sin(), |x| f64::from(u8::from(x.y > 35.0))];
    for tf in transfer_functions() {
        let field = ExactField::new(&volume, &tf);
        let scene = scene(&volume);
        let points = field.visible_points(&scene, 20_000, 7);
        assert_eq!(points.len(), 20_000);
        assert_eq!(points, field.visible_points(&scene, 20_000, 7));
        assert_ne!(points[..10], field.visible_points(&scene, 10, 8));
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
    assert!(field.visible_points(&scene, 100, 1).is_empty());
    assert!(field.visible_points(&scene, 0, 1).is_empty());
    let picture = field.picture(&scene);
    assert_eq!(picture[[3, 3, 0]], 0.1f32);
    assert_eq!(picture[[3, 3, 3]], 0.0);
}
