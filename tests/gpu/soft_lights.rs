//! Lights with a size: means over their samples, known answers, and exact pictures.

use super::*;
use umbravox::measure::errors::{VisiblePointsByLight, mean_of_maps};
use umbravox::measure::mean_error::MeanErrorSample;
use umbravox::scene::{Extent, LightSource, SkyMap, SkyRadiance};

fn sun(angle_deg: f64, samples: u32) -> LightSource {
    LightSource { extent: Extent::Cone { angle_deg }, samples, ..LightSource::default() }
}

impl Setup {
    fn maps(&self, method: &str, scene: &Scene) -> Vec<ShadowMap> {
        self.session.shadows_of(shadow::parse(method).unwrap().as_ref(), scene).unwrap()
    }
}

/// A picture under a light with a size is the mean of those under its samples, and its shadows have their mean.
#[test]
fn a_soft_light_is_the_mean_of_its_samples() {
    let [ramp, ..] = transfer_functions([-900.0, 1200.0]);
    let volume = phantom("thorax:32");
    let Some(setup) = Setup::open(&volume, &ramp) else { return };
    let base = Scene { shading: umbravox::scene::Shading::Lambert, ..setup.scene(40, 28) };
    let scene = base.under(sun(40.0, 5));
    for method in ["rays", "dsm:map=32", "fourier:map=32"] {
        let soft = setup.session.render(&setup.maps(method, &scene), &scene).unwrap().pixels;
        let mut mean = Array3::<f64>::zeros(soft.dim());
        for light in scene.lights[0].lattice(5, [0.0; 2]) {
            let hard = scene.under(light);
            let picture = setup.session.render(&setup.maps(method, &hard), &hard).unwrap().pixels;
            mean += &(picture.mapv(f64::from) / 5.0);
        }
        let off = largest_difference(&soft, &mean.mapv(|x| x as f32));
        assert!(off < 2e-6, "{method}: {off}");
    }
}

/// Rays from ever more samples approach the exact mean at visible points, and the picture the exact picture.
#[test]
fn rays_from_many_samples_are_the_exact_soft_shadow() {
    let volume = phantom("shell:24");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    let field = setup.exact();
    let disc = |samples| LightSource {
        extent: Extent::Disc { radius_mm: 60.0, facing_mm: volume.center_mm() },
        samples,
        ..Light::Point { position: volume.center_mm() + DVec3::new(60.0, 60.0, 90.0) }.into()
    };
    for light in [&sun as &dyn Fn(f64, u32) -> LightSource, &|_, samples| disc(samples)] {
        let mut last = f64::INFINITY;
        for samples in [1, 8, 32] {
            let scene =
                Scene { width: 16, height: 10, ..Scene::framing(&volume) }.under(light(60.0, samples));
            let visible = VisiblePointsByLight::new(&field, &scene, 300);
            let maps = setup.maps("rays", &scene);
            assert_eq!(maps.len(), samples as usize);
            let rms = visible.errors(&setup.session, &maps).unwrap().unwrap().rms;
            println!("{samples} samples: {rms:.1e}, exact within {:.1e}", visible.exact_error());
            assert!(rms < 0.5 * last && visible.exact_error() < 1e-3, "{samples}: {rms}, {last}");
            last = rms;
            let sample = MeanErrorSample::new(&field, &scene, 200);
            let query = |map: &ShadowMap, points: &[DVec3]| setup.session.query(map, points);
            let mean = sample.of(&maps.iter().collect::<Vec<_>>(), query).unwrap();
            assert!(mean.estimate <= 1.5 * rms, "{mean:?}, {rms}");
            if samples == 32 {
                let picture = setup.session.render(&maps, &scene).unwrap().pixels;
                let exact = field.picture(&scene);
                let off = umbravox::measure::stats::image_error(picture.view(), exact.view()).unwrap().rmse;
                assert!(off < 0.004, "{off}");
            }
        }
        assert!(last < 0.01, "{last}");
    }
}

/// A point below the surface of a ball has less matter on one side. All maps count, also of several lights.
#[test]
fn maps_of_several_lights_answer_together() {
    let volume = phantom("sphere:32");
    let Some(setup) = Setup::open(&volume, &opacity(&[(-100.0, 0.0), (300.0, 0.05)])) else { return };
    let sky = LightSource { extent: Extent::SKY, ..LightSource::default() };
    let field = setup.exact();
    let x = volume.center_mm() + 0.3 * (volume.corners_mm()[7] - volume.center_mm());
    let exact = field.transmittance_from(x, &sky);
    for method in ["rays", "dsm:map=64,fit=volume", "osm:map=64,fit=volume"] {
        let method = shadow::parse(method).unwrap();
        let build = |source: LightSource| setup.session.shadow(method.as_ref(), source.light).unwrap();
        let maps: Vec<ShadowMap> = sky.samples().map(build).collect();
        let points = [x];
        let found = mean_of_maps(&maps, &points, |map, points| setup.session.query(map, points)).unwrap();
        assert!(exact.value > 0.05 && exact.value < 0.95, "{exact:?}");
        assert!((found[0] - exact.value).abs() < 0.02, "{}, {exact:?}", found[0]);
        let first = setup.session.query(&maps[0], &points).unwrap()[0];
        assert!((f64::from(first) - exact.value).abs() > 0.02, "one map does not suffice: {first}");
    }
    // Errors at visible points of a light without a size between two with one.
    let hard = LightSource::from(Light::Directional { toward: DVec3::X });
    let lights = vec![sun(30.0, 32), hard, LightSource { samples: 48, ..sky }];
    let scene = Scene { lights, width: 24, height: 16, ..Scene::framing(&volume) };
    let visible = VisiblePointsByLight::new(&field, &scene, 300);
    let maps = setup.maps("rays", &scene);
    assert_eq!(maps.len(), 81);
    let rms = visible.errors(&setup.session, &maps).unwrap().unwrap().rms;
    assert!(rms < 0.01, "{rms}");
}

/// Under a sky of two colours, a picture with shadow rays to many samples is the exact one, in each channel.
#[test]
fn a_sky_with_a_map_colours_shadows() {
    let volume = phantom("shell:24");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    let field = setup.exact();
    // Red from above, blue from the right side; a dim green from everywhere.
    let pixel = |i: usize| match (i / 16, i % 16) {
        (0..2, _) => [6.0, 0.1, 0.0],
        (2..6, 11..14) => [0.0, 0.1, 9.0],
        _ => [0.0, 0.1, 0.0],
    };
    let radiance = Some(Arc::new(SkyRadiance::new(16, (0..128).map(pixel).collect()).unwrap()));
    let map = SkyMap { path: "sky.hdr".into(), turn_deg: 0.0, radiance };
    let sky = LightSource { extent: Extent::Map(map), samples: 192, ..LightSource::default() };
    let scene = Scene { width: 20, height: 14, ambient: 0.0, ..Scene::framing(&volume) }.under(sky);
    let picture = setup.session.render(&setup.maps("rays", &scene), &scene).unwrap().pixels;
    let exact = field.picture(&scene);
    let off = umbravox::measure::stats::image_error(picture.view(), exact.view()).unwrap().rmse;
    let mean = |c| exact.slice(ndarray::s![.., .., c]).mean().unwrap();
    println!("rmse {off:.1e}, mean {} {} {}", mean(0), mean(1), mean(2));
    assert!(mean(0) > 0.01 && mean(2) > 0.01 && mean(1) > 0.001, "{} {} {}", mean(0), mean(1), mean(2));
    assert!(off < 0.006, "{off}");
    // A uniform map is the sky without one.
    let uniform = Some(Arc::new(SkyRadiance::new(16, vec![[1.0; 3]; 128]).unwrap()));
    let map = SkyMap { path: "white.hdr".into(), turn_deg: 40.0, radiance: uniform };
    let [mapped, plain] = [Extent::Map(map), Extent::SKY].map(|extent| {
        let scene = scene.under(LightSource { extent, samples: 192, ..LightSource::default() });
        setup.session.render(&setup.maps("rays", &scene), &scene).unwrap().pixels
    });
    assert!(largest_difference(&mapped, &plain) < 0.02);
}
