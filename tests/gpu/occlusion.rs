//! Ambient occlusion: closed forms, the exact mean over directions, and exact pictures.

use super::*;
use umbravox::measure::stats::image_error;
use umbravox::scene::{AmbientOcclusion, Extent, LightSource};

impl Setup {
    fn occlusion(&self, radius_mm: f64, samples: u32, points_mm: &[DVec3]) -> Vec<f64> {
        let Session { renderer, loaded, transfer, .. } = &self.session;
        let occlusion = AmbientOcclusion { radius_mm, samples };
        let mut sums = vec![0.0; points_mm.len()];
        for (map, share) in renderer.occlusion((loaded, transfer), occlusion).unwrap() {
            let found = self.query(&map, points_mm);
            sums.iter_mut().zip(found).for_each(|(sum, t)| *sum += share * f64::from(t));
        }
        sums
    }
}

/// Mean over directions of the exact transmittance within a radius.
fn exact_mean(field: &ExactField, x: DVec3, radius_mm: f64) -> f64 {
    let sky = LightSource { extent: Extent::SKY, ..LightSource::default() };
    let count = 2000;
    let along = |sample: LightSource| {
        let (toward, _) = sample.light.from_point(x);
        (-field.optical_depth(x, x + radius_mm * toward)).exp()
    };
    sky.lattice(count, [0.3, 0.7]).map(along).sum::<f64>() / count as f64
}

#[test]
fn matter_of_one_extinction_occludes_by_its_radius() {
    let (side, mu) = (33, 0.08);
    let voxels = Voxels::F32(Array3::from_elem([side; 3], 1.0));
    let volume = Arc::new(volume_of(voxels, DAffine3::IDENTITY));
    let Some(setup) = Setup::open(&volume, &extinction(&[(0.0, mu), (2.0, mu)])) else { return };
    let (center, top) = (DVec3::splat(16.0), DVec3::new(16.0, 16.0, 32.499));
    for radius_mm in [0.5, 4.0, 10.0] {
        let found = setup.occlusion(radius_mm, 64, &[center, top]);
        let inside = (-mu * radius_mm).exp();
        // Half of the directions at the surface meet no matter.
        for (t, expected) in found.into_iter().zip([inside, 0.5 + 0.5 * inside]) {
            assert!((t - expected).abs() < 5e-4, "{radius_mm} mm: {t}, {expected}");
        }
    }
}

#[test]
fn occlusion_is_the_exact_mean_over_directions() {
    let volume = phantom("thorax:48");
    let Some(setup) = Setup::open(&volume, &opacity(&[(-100.0, 0.0), (300.0, 0.2)])) else { return };
    let field = setup.exact();
    let points: Vec<DVec3> =
        field.visible_points(&setup.scene(40, 30), 200, 3).into_iter().map(|p| p.position).collect();
    for radius_mm in [5.0, 30.0] {
        let exact: Vec<f64> = points.iter().map(|x| exact_mean(&field, *x, radius_mm)).collect();
        let mut last = f64::INFINITY;
        for samples in [8, 32, 128] {
            let found = setup.occlusion(radius_mm, samples, &points);
            let squares = found.iter().zip(&exact).map(|(t, e)| (t - e).powi(2)).sum::<f64>();
            let rms = (squares / points.len() as f64).sqrt();
            println!("{radius_mm} mm, {samples} rays: rms {rms:.4}");
            assert!(points.len() > 100 && rms < 0.6 * last, "{radius_mm} mm, {samples} rays: {rms}");
            last = rms;
        }
        assert!(last < 0.01, "{last}");
    }
}

#[test]
fn pictures_with_occluded_ambient_light_are_exact_ones() {
    let volume = phantom("shell:32");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    let field = setup.exact();
    for (method, ambient) in [("dsm:map=128", 0.4), ("none", 0.4), ("rays", 1.0)] {
        let open = Scene { ambient, ..setup.scene(24, 16) };
        let draw = |scene: &Scene| {
            let maps = setup.session.shadows_of(shadow::parse(method).unwrap().as_ref(), scene).unwrap();
            setup.session.render(&maps, scene).unwrap().pixels
        };
        let within = |radius_mm| Scene {
            ambient_occlusion: Some(AmbientOcclusion { radius_mm, samples: 128 }),
            ..open.clone()
        };
        let occluded = within(12.0);
        let [with, without] = [&occluded, &open].map(draw);
        let darker = largest_difference(&with, &without);
        assert!(darker > 0.05, "{method}: {darker}");
        assert!(with.iter().zip(&without).all(|(a, b)| *a < *b + 1e-4), "{method}: brighter");
        if method != "none" {
            let exact = field.picture(&occluded);
            let off = image_error(with.view(), exact.view()).unwrap().rmse;
            let ignored = image_error(without.view(), exact.view()).unwrap().rmse;
            println!("{method}: rmse {off:.4}, without occlusion {ignored:.4}");
            assert!(off < 0.005 && off < 0.15 * ignored, "{method}: {off}, {ignored}");
        }
        // Hardly anything lies within a small radius.
        assert!(largest_difference(&draw(&within(1e-4)), &without) < 1e-4, "{method}");
    }
    // Nothing occludes light that is not there.
    let occlusion = Some(AmbientOcclusion { radius_mm: 12.0, samples: 8 });
    let dark = Scene { ambient: 0.0, ambient_occlusion: occlusion, ..setup.scene(24, 16) };
    assert_eq!(dark.occlusion(), None);
}
