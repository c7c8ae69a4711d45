//! `sat` where its result is known: along axes, in layers, at the limits of its numbers, and under lights with a size.

use super::*;
use umbravox::engine::{CachedSession, MapCoverage, ReusePolicy, ShadowCache, Work};
use umbravox::measure::errors::VisiblePointsByLight;
use umbravox::scene::{Extent, LightSource};
use umbravox::shadow::BuildReport;

/// Volume of `n` voxels a side, 1 mm wide, with the values of a function of the voxel.
fn cube(n: usize, value: impl Fn([usize; 3]) -> f32) -> Arc<Volume> {
    let values = Array3::from_shape_fn((n, n, n), |(k, j, i)| value([i, j, k]));
    Arc::new(volume_of(Voxels::F32(values), DAffine3::IDENTITY))
}

/// Largest and root mean square difference from the exact transmittance at some points, which is the mean over the light
/// if it has a size.
fn errors(setup: &Setup, method: &str, light: LightSource, points: &[DVec3]) -> [f64; 2] {
    let map = setup.shadow(&format!("{method},near=0"), light.light);
    let field = setup.exact();
    let off: Vec<f64> = points
        .iter()
        .zip(setup.query(&map, points))
        .map(|(p, t)| (f64::from(t) - field.transmittance_from(*p, &light).value).abs())
        .map(|e| if e.is_nan() { f64::INFINITY } else { e })
        .collect();
    let rms = (off.iter().map(|e| e * e).sum::<f64>() / off.len() as f64).sqrt();
    [off.iter().copied().fold(0.0, f64::max), rms]
}

fn toward(x: f64, y: f64, z: f64) -> LightSource {
    Light::Directional { toward: DVec3::new(x, y, z) }.into()
}

/// Points in a cube of `n` voxels that are no centres of voxels.
fn between_voxels(n: usize) -> impl Iterator<Item = DVec3> {
    let share = move |i: u32, rate: f64| (f64::from(i) * rate).fract() * n as f64 - 0.5;
    (0..600).map(move |i| DVec3::new(share(i, 0.618_034), share(i, 0.754_878), share(i, 0.569_840)))
}

/// Layers of whole cells with jumps of extinction between them: light across them is exact, whatever the number of
/// cuboids. At the sides of the volume a beam one cell wide is partly outside.
#[test]
fn layers_are_exact_along_axes() {
    let tf = extinction(&[(0.0, 0.02), (50.0, 0.02), (50.0, 0.3), (150.0, 0.3), (150.0, 0.0), (200.0, 0.0)]);
    let level = |i: usize| [0.0f32, 100.0, 200.0, 100.0][i / 4 % 4];
    for axis in 0..3 {
        let volume = cube(24, |voxel| level(voxel[axis]));
        let Some(setup) = Setup::open(&volume, &tf) else { return };
        let away_from_sides = |p: &DVec3| (0..3).all(|side| side == axis || (p[side] - 11.5).abs() < 9.5);
        let points: Vec<_> = between_voxels(24).filter(away_from_sides).collect();
        for sense in [1.0, -1.0] {
            let light: LightSource = Light::Directional { toward: sense * DVec3::AXES[axis] }.into();
            for settings in [
                "scale=1,boxes=2",
                "scale=1,boxes=5",
                "scale=1,boxes=64,filter=nearest",
                "scale=2,boxes=16",
                "scale=0.5",
                "scale=4,boxes=3,filter=nearest",
            ] {
                let [largest, _] = errors(&setup, &format!("sat:{settings}"), light.clone(), &points);
                println!("axis {axis}, {sense}, {settings}: {largest:.6}");
                assert!(largest < 1e-4, "axis {axis}, {sense}, {settings}: {largest}");
            }
        }
    }
}

/// An even medium whose sums wrap around: 120^3 cells of 4094 steps are more than 2^32. Points far from the sides.
#[test]
fn sums_wrap_around() {
    let Some(setup) = Setup::open(&cube(60, |_| 100.0), &extinction(&[(0.0, 0.0), (100.0, 0.05)])) else {
        return;
    };
    let points: Vec<_> = (0..60).map(|k| DVec3::new(29.6, 30.2, f64::from(k) - 0.2)).collect();
    let inside = LightSource::from(Light::Point { position: DVec3::new(29.6, 30.2, 40.3) });
    for settings in ["boxes=16", "boxes=4,filter=nearest", "boxes=3,angle=10"] {
        for light in [toward(0.0, 0.0, 1.0), toward(0.0, 0.0, -1.0), inside.clone()] {
            let method = format!("sat:scale=0.5,{settings}");
            let [largest, _] = errors(&setup, &method, light.clone(), &points);
            println!("{settings}, {}: {largest:.6}", light.text());
            // A cone leaves the volume at its sides, where a cuboid still covers a part of it.
            assert!(largest < 1e-3, "{settings}, {}: {largest}", light.text());
        }
    }
}

/// Stated error of the stored numbers: one step times the length of the ray. Thresholds that vary keep far below it.
#[test]
fn faint_matter_beside_opaque_matter_keeps_its_extinction() {
    let volume = cube(60, |voxel| if voxel == [5, 5, 5] { 200.0 } else { 100.0 });
    let tf = extinction(&[(0.0, 0.01), (100.0, 0.01), (200.0, 10.0)]);
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let points: Vec<_> = between_voxels(60).filter(|p| p.x.min(p.y) > 9.0 && p.x.max(p.y) < 58.0).collect();
    let [largest, rms] = errors(&setup, "sat:scale=0.5,boxes=64", toward(0.0, 0.0, 1.0), &points);
    let stated = 10.0 / 4094.0 * 60.0;
    println!("largest {largest:.5}, rms {rms:.5}, stated {stated:.3} in optical depth");
    assert!(largest < 0.1 * stated && rms < 0.02 * stated, "{largest} {rms}");
}

/// Oblique rays and lamps on every side and inside: more cuboids and finer cells are closer.
#[test]
fn finer_tables_and_more_cuboids_are_nearer() {
    let tf = extinction(&[(250.0, 0.0), (900.0, 0.12)]);
    let volume = grains();
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let place = |p: DVec3| (p + 0.5) * DVec3::new(44.0, 36.0, 30.0) - 0.5;
    let points: Vec<_> =
        between_voxels(1).map(|p| volume.world_from_index().transform_point3(place(p))).collect();
    for (name, light) in lights(&volume) {
        let rms = ["scale=4,boxes=8", "scale=2,boxes=32", "scale=1,boxes=128", "scale=0.5,boxes=256"]
            .map(|settings| errors(&setup, &format!("sat:{settings}"), light.into(), &points)[1]);
        let few = ["boxes=2", "boxes=6", "boxes=128"]
            .map(|boxes| errors(&setup, &format!("sat:scale=1,{boxes}"), light.into(), &points)[1]);
        println!("{name}: {rms:.4?}, {few:.4?}");
        assert!(rms[0] > rms[1] && rms[1] > rms[2] && rms[3] < 0.01, "{name}: {rms:?}");
        assert!(few[0] > few[1] && few[1] > few[2], "{name}: {few:?}");
    }
}

/// Half-plane below a sun, and a ball below a disc: one query of the cone is closer to the mean over the light than one of
/// a narrow beam.
#[test]
fn a_cone_is_closer_to_the_mean_over_a_soft_light() {
    let half_plane = cube(48, |[i, _, k]| if k >= 40 && i < 24 { 100.0 } else { 0.0 });
    let tf = extinction(&[(0.0, 0.0), (50.0, 0.0), (100.0, 0.06)]);
    let Some(setup) = Setup::open(&half_plane, &tf) else { return };
    let points: Vec<_> =
        (0..64).map(|i| DVec3::new(0.7 * f64::from(i) + 1.0, 24.0, f64::from(i % 4) * 6.0)).collect();
    let sun = sun(30.0, 1, toward(0.0, 0.0, 1.0));
    let [narrow, cone] = [0, 30]
        .map(|angle| errors(&setup, &format!("sat:scale=1,boxes=64,angle={angle}"), sun.clone(), &points)[1]);
    println!("half-plane: {narrow:.4} {cone:.4}");
    assert!(cone < 0.4 * narrow, "{narrow} {cone}");

    let ball = cube(48, |voxel| {
        let place = DVec3::from(voxel.map(|i| i as f64));
        if place.distance(DVec3::new(24.0, 24.0, 36.0)) < 8.0 { 100.0 } else { 0.0 }
    });
    let setup = Setup::open(&ball, &tf).unwrap();
    let position = DVec3::new(24.0, 24.0, 120.0);
    let extent = Extent::Disc { radius_mm: 20.0, facing_mm: DVec3::splat(24.0) };
    let disc = LightSource { extent, ..Light::Point { position }.into() };
    // The disc is 20 degrees wide from the points.
    let points: Vec<_> = (0..45).map(|i| DVec3::new(f64::from(i) + 1.5, 24.3, 4.0)).collect();
    let [narrow, cone] = [0, 20].map(|angle| {
        errors(&setup, &format!("sat:scale=1,boxes=64,angle={angle}"), disc.clone(), &points)[1]
    });
    println!("ball: {narrow:.4} {cone:.4}");
    assert!(cone < 0.6 * narrow, "{narrow} {cone}");
}

fn sun(angle_deg: f64, samples: u32, toward: LightSource) -> LightSource {
    LightSource { extent: Extent::Cone { angle_deg }, samples, ..toward }
}

fn balls() -> Arc<Volume> {
    let centres = [DVec3::new(24.0, 24.0, 34.0), DVec3::new(14.0, 30.0, 14.0)];
    cube(48, |voxel| {
        let place = DVec3::from(voxel.map(|i| i as f64));
        if centres.iter().any(|centre| place.distance(*centre) < 8.0) { 100.0 } else { 0.0 }
    })
}

/// One map answers for a whole light with a size, beside the maps of other lights. A sky is sampled.
#[test]
fn one_map_answers_for_a_light_with_a_size() {
    let Some(setup) = Setup::open(&balls(), &extinction(&[(0.0, 0.0), (50.0, 0.0), (100.0, 0.06)])) else {
        return;
    };
    let maps = |method: &str, lights: &[LightSource]| {
        let scene = Scene { lights: lights.to_vec(), ..setup.scene(24, 16) };
        setup.session.shadows_of(shadow::parse(method).unwrap().as_ref(), &scene).unwrap()
    };
    let (soft, hard) = (sun(30.0, 8, toward(0.3, 0.0, 1.0)), toward(0.0, 1.0, 0.2));
    let sky = LightSource { extent: Extent::SKY, samples: 5, ..LightSource::default() };
    let samples = |maps: &[ShadowMap]| maps.iter().map(ShadowMap::samples).collect::<Vec<_>>();
    assert_eq!(samples(&maps("sat", &[soft.clone(), hard.clone(), sky.clone()])), [8, 1, 1, 1, 1, 1, 1]);
    assert_eq!(samples(&maps("sat:angle=0", &[soft.clone(), hard.clone()])), [1; 9]);
    assert_eq!(samples(&maps("dsm:map=32", std::slice::from_ref(&soft))), [1; 8]);

    // The cone is that of the light: with its angle, and with the angle of a disc from the point.
    let points: Vec<_> = between_voxels(48).step_by(7).collect();
    let answers = |method: &str, light: LightSource| setup.query(&maps(method, &[light])[0], &points);
    assert_eq!(answers("sat", soft.clone()), answers("sat:angle=30", soft.light.into()));
    assert_ne!(answers("sat", soft.clone()), answers("sat", soft.light.into()));
    let position = DVec3::new(1000.0, 0.0, 10_000.0);
    let extent = Extent::Disc { radius_mm: 10_000.0 * 15_f64.to_radians().tan(), facing_mm: DVec3::ZERO };
    let disc = LightSource { extent, ..Light::Point { position }.into() };
    let far = answers("sat:angle=30", disc.light.into());
    let off = answers("sat", disc).iter().zip(&far).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(off < 0.01, "{off}");

    // The map is compared with the exact mean over the light, and draws its light once.
    let scene = Scene { background: [0.0; 3], ambient: 0.0, ..setup.scene(40, 30) };
    let visible = VisiblePointsByLight::new(&setup.exact(), &scene.under(soft.clone()), 400);
    let rms = |method: &str| {
        let method = shadow::parse(method).unwrap();
        let maps = setup.session.shadows_of(method.as_ref(), &scene.under(soft.clone())).unwrap();
        visible.errors(&setup.session, &maps).unwrap().unwrap().rms
    };
    let beam = LightSource { samples: 1, extent: Extent::Cone { angle_deg: 0.01 }, ..soft };
    let narrow = {
        let maps = maps("sat:scale=1,boxes=64,angle=0", &[beam]);
        visible.errors(&setup.session, &maps).unwrap().unwrap().rms
    };
    let [cone, sampled] = ["sat:scale=1,boxes=64", "rays"].map(rms);
    println!("visible points: cone {cone:.4}, narrow beam {narrow:.4}, 8 shadow rays {sampled:.4}");
    assert!(cone < 0.7 * narrow, "{cone} {narrow}");
    let draw = |lights: &[LightSource]| {
        let scene = Scene { lights: lights.to_vec(), ..scene.clone() };
        let maps = setup.session.shadows_of(shadow::parse("sat").unwrap().as_ref(), &scene).unwrap();
        setup.session.render(&maps, &scene).unwrap().pixels.slice_move(ndarray::s![.., .., ..3]).to_owned()
    };
    let sum = draw(std::slice::from_ref(&soft)) + draw(std::slice::from_ref(&hard));
    let off = largest_difference(&draw(&[soft, hard]), &sum);
    assert!(off < 2e-6, "{off}");
}

/// A cached map of a light is not that of the light with another size, or with another number of samples.
#[test]
fn another_size_of_a_light_is_another_map() {
    let Some(renderer) = renderer() else { return };
    let cache = ShadowCache::new(ShadowCache::INTERACTIVE, ReusePolicy::Covering);
    let mut session = CachedSession::new(Arc::clone(renderer), DisabledOptimizations::NONE, cache);
    let volume = balls();
    session.load(Arc::clone(&volume), None).unwrap();
    session.set_transfer(&extinction(&[(50.0, 0.0), (100.0, 0.2)]), &mut Work::default()).unwrap();
    let method = shadow::parse("sat").unwrap();
    let mut built = |light: LightSource| {
        let scene = Scene { width: 20, height: 16, ..Scene::framing(&volume) }.under(light);
        let mut work = Work::default();
        let prepared = session.prepare(method.as_ref(), (&scene, MapCoverage::Picture), &mut work).unwrap();
        prepared.render(&scene).unwrap();
        work.built
    };
    let light = toward(0.2, 0.1, 1.0);
    let lights =
        [sun(10.0, 8, light.clone()), sun(30.0, 8, light.clone()), sun(30.0, 9, light.clone()), light];
    assert_eq!(lights.clone().map(&mut built), [1; 4]);
    assert_eq!([built(lights[3].clone()), built(lights[0].clone())], [0, 0]);
}

/// One table serves all lights, and its memory counts once; other cells or another transfer function need a new one.
#[test]
fn a_moved_light_builds_nothing() {
    let tf = extinction(&[(0.0, 0.0), (100.0, 0.05)]);
    let Some(setup) = Setup::open(&cube(24, |_| 100.0), &tf) else { return };
    let build = |method: &str, light: LightSource| setup.shadow(method, light.light);
    let maps = [build("sat:scale=2", toward(0.0, 0.0, 1.0)), build("sat:scale=2", toward(0.0, 1.0, 0.3))];
    assert!(maps[0].report.device.is_some() && maps[1].report.device.is_none());
    assert_eq!(maps[0].report.bytes, 4 * 12 * 12 * 12);
    assert_eq!(BuildReport::of_all(&maps).bytes, maps[0].report.bytes);
    // Cuboids do not change the table, cells do.
    let [same, finer] =
        ["sat:scale=2,boxes=3,angle=20", "sat:scale=1"].map(|m| build(m, toward(1.0, 0.0, 0.0)));
    assert!(same.report.device.is_none() && finer.report.device.is_some());
    assert_eq!(finer.report.bytes, 8 * maps[0].report.bytes);
    // Both tables remain, in which turns of methods are timed.
    assert!(build("sat:scale=2", toward(1.0, 1.0, 1.0)).report.device.is_none());
    // The maps of two lights are right.
    let point = [DVec3::new(12.1, 11.7, 5.5)];
    let answers = maps.each_ref().map(|map| setup.query(map, &point)[0]);
    assert!((f64::from(answers[0]) - (-0.05 * 18.0_f64).exp()).abs() < 1e-4, "{answers:?}");
    let other = Setup::open(&cube(24, |_| 100.0), &extinction(&[(0.0, 0.0), (100.0, 0.1)])).unwrap();
    let map = other.shadow("sat:scale=2", toward(0.0, 0.0, 1.0).light);
    assert!(map.report.device.is_some());
    assert!((f64::from(other.query(&map, &point)[0]) - (-0.1 * 18.0_f64).exp()).abs() < 1e-4);
}
