//! Shadow maps whose light rays are marched by regular samples.

use super::*;
use umbravox::measure::check::check;
use umbravox::render::Optimization;

const LIGHT: Light = Light::Directional { toward: DVec3::new(0.4, -0.3, 0.9) };

/// Points spread over the volume, on no lattice.
pub(super) fn points(volume: &Volume) -> Vec<DVec3> {
    let size = DVec3::from_array(volume.dims().map(|n| n as f64));
    let share = |i: u32, base: f64| (f64::from(i) * base).fract();
    let index = |i| DVec3::new(share(i, 0.754_877), share(i, 0.569_840), share(i, 0.380_319)) * size - 0.5;
    (1..4000).map(|i| volume.world_from_index().transform_point3(index(i))).collect()
}

fn rms(a: &[f32], b: &[f32]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
    (squares / a.len() as f64).sqrt()
}

#[test]
fn samples_come_to_what_cells_give_as_their_step_shrinks() {
    let Some(setup) = Setup::open(&phantom("thorax:48"), &opacity(&[(-200.0, 0.0), (300.0, 0.2)])) else {
        return;
    };
    let points = points(setup.volume());
    let maps = ["dsm:epsilon=0,map=96", "osm:map=96,bits=32", "dom:map=96,bits=32", "bom:map=96,bits=32"];
    for method in maps.into_iter().chain(["rays:lookup=shared"]) {
        let cells = setup.query(&setup.shadow(method, LIGHT), &points);
        let off = |step: &str| {
            let spec = format!("{method},march=samples,step={step}");
            rms(&setup.query(&setup.shadow(&spec, LIGHT), &points), &cells)
        };
        let [coarse, default, fine] = ["2", "0.5", "0.1"].map(off);
        println!("{method}: {coarse:.5} {default:.5} {fine:.5}");
        assert!(fine < 1e-3 && default < 0.3 * coarse && fine < default, "{method}");
    }
}

#[test]
fn the_check_tells_fine_samples_from_coarse_ones() {
    let Some(setup) = Setup::open(&phantom("thorax:64"), &opacity(&[(100.0, 0.0), (300.0, 0.8)])) else {
        return;
    };
    let scene = Scene { lights: vec![LIGHT.into()], ..setup.scene(32, 32) };
    let found = |spec: &str| {
        let method = shadow::parse(spec).unwrap();
        let map = setup.session.shadow(method.as_ref(), LIGHT).unwrap();
        check(&setup.session, method.as_ref(), &map, &scene).unwrap()
    };
    for method in ["dsm", "osm", "dom", "bom"] {
        let [fine, coarse] = ["0.1", "6"]
            .map(|step| found(&format!("{method}:map=128,march=samples,step={step}")).expect("a check"));
        println!("{method}: {fine:?} {coarse:?}");
        assert!(fine.ok() && !coarse.ok() && fine.max < 0.5 * coarse.max, "{method}");
        assert!(fine.texels == 1024 && coarse.depth_mm > fine.depth_mm);
        assert_eq!(found(&format!("{method}:map=128")), None, "cells need none");
    }
    assert_eq!(found("dsm:map=128,precompress=off"), None);
    assert_eq!(found("rays"), None);
    // Shadow rays by samples are compared at the points of an assumed map.
    let [fine, coarse] =
        ["0.1", "6"].map(|step| found(&format!("rays:march=samples,step={step}")).expect("a check"));
    assert!(fine.ok() && !coarse.ok(), "{fine:?}, {coarse:?}");
}

/// Wall one voxel thick between two halves, visible only by a transfer function with a peak between their values.
fn wall() -> (Arc<Volume>, TransferFunction) {
    let value = |(x, _, _): (usize, usize, usize)| if x < 20 { 0.0 } else { 1.0 };
    let voxels = Voxels::F32(Array3::from_shape_fn((24, 24, 48), |(k, j, i)| value((i, j, k))));
    let tf = extinction(&[(0.3, 0.0), (0.5, 5.0), (0.7, 0.0)]);
    (Arc::new(volume_of(voxels, DAffine3::IDENTITY)), tf)
}

#[test]
fn steps_longer_than_bricks_leap_over_no_active_one() {
    let (volume, tf) = wall();
    let Some(lean) = Setup::open(&volume, &tf) else { return };
    let Some(forced) = Setup::forced(&volume, &tf, DisabledOptimizations::only(Optimization::Bricks)) else {
        return;
    };
    let points = points(&volume);
    for step in [0.5, 4.0, 5.0, 6.0, 8.0] {
        let scene = Scene { step, ..lean.scene(40, 40) };
        let [a, b] = [&lean, &forced].map(|s| s.picture("none", &scene));
        let off = a.iter().zip(&b).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max);
        assert!(off <= tolerance::SKIPPING, "eye step {step}: {off}");
        assert!(b.iter().any(|v| *v > 0.5), "the wall is seen");
        let spec = format!("osm:bits=32,map=32,march=samples,step={step}");
        let light = Light::Directional { toward: DVec3::new(-1.0, 0.02, 0.03) };
        let [a, b] = [&lean, &forced].map(|s| s.query(&s.shadow(&spec, light), &points));
        assert!(rms(&a, &b) < 1e-6, "light step {step}: {}", rms(&a, &b));
        assert!(b.iter().any(|t| *t < 0.5), "the wall casts a shadow");
    }
}

/// Thin matter is not lost beside a peak of the transfer function that is millions of times as dense.
#[test]
fn little_extinction_beside_a_tall_peak_survives() {
    let ramp = Array3::from_shape_fn((16, 16, 24), |(_, _, i)| 0.2 + 0.03 * i as f32);
    let volume = Arc::new(volume_of(Voxels::F32(ramp), DAffine3::IDENTITY));
    for peak in [1.0, 1e3, 1e6] {
        let tf = extinction(&[(0.01, 0.0), (0.05, peak), (0.1, 0.05), (1.0, 0.05)]);
        let Some(setup) = Setup::open(&volume, &tf) else { return };
        let points = points(&volume);
        let [cells, samples] = ["cells", "samples"]
            .map(|by| setup.query(&setup.shadow(&format!("osm:bits=32,map=64,march={by}"), LIGHT), &points));
        let off = rms(&cells, &samples);
        println!("peak {peak:e}: {off:e}");
        assert!(off < 1e-3 && cells.iter().any(|t| *t < 0.8), "{peak}: {off}");
    }
}

/// Loops end with extinction at the far end of a long stretch, and with more samples than loops may have iterations.
#[test]
fn loops_end_where_stretches_are_long_and_where_steps_are_short() {
    let two = Array3::from_shape_fn((1, 1, 2), |(_, _, i)| i as f32);
    let volume = Arc::new(volume_of(Voxels::F32(two), DAffine3::IDENTITY));
    let late = extinction(&[(0.999, 0.0), (1.0, 1e4)]);
    let long = Array3::from_shape_fn((200, 8, 8), |(k, _, _)| (k % 2) as f32);
    let apart = DAffine3::from_scale(DVec3::new(1.0, 1.0, 100.0));
    let long = Arc::new(volume_of(Voxels::F32(long), apart));
    let thin = extinction(&[(0.0, 0.0), (1.0, 1e-5)]);
    for (volume, tf, step) in
        [(&volume, &late, 8.0), (&volume, &late, 0.5), (&long, &thin, 0.5), (&long, &thin, 0.01)]
    {
        let Some(setup) = Setup::open(volume, tf) else { return };
        for method in ["dsm", "osm", "dom", "bom"] {
            let spec = format!("{method}:map=16,march=samples,step={step}");
            let map = setup.shadow(&spec, Light::Directional { toward: DVec3::new(-0.001, 0.01, 1.0) });
            assert!(setup.query(&map, &[DVec3::ZERO])[0].is_finite(), "{spec}");
        }
    }
}

/// Shadow rays by samples share their march with eye rays that search for surfaces. They come to the picture of rays that
/// are marched cell by cell, on opaque surfaces too.
#[test]
fn shadow_rays_by_samples_draw_what_cells_draw_as_their_step_shrinks() {
    let volume = phantom("thorax:48");
    let presets =
        ["isosurface", "ct"].map(|name| umbravox::open::presets::resolve(name, &volume).unwrap().tf);
    let [_, jumps, peaks] = transfer_functions([-900.0, 1200.0]);
    for (n, tf) in presets.into_iter().chain([jumps, peaks]).enumerate() {
        let Some(setup) = Setup::open(&volume, &tf) else { return };
        let scene = setup.scene(60, 45);
        let cells = setup.picture("rays", &scene);
        let off = |step: &str| {
            rms_difference(&setup.picture(&format!("rays:march=samples,step={step}"), &scene), &cells)
        };
        let [coarse, fine] = ["2", "0.05"].map(off);
        println!("function {n}: {coarse:.5} {fine:.5}");
        assert!(fine < 5e-3 && fine < 0.5 * coarse, "function {n}: {coarse}, {fine}");
    }
}
