//! Maps whose light rays are marched by regular samples.

use super::*;
use umbravox::measure::check::check;

const LIGHT: Light = Light::Directional { toward: DVec3::new(0.4, -0.3, 0.9) };

/// Points all over the volume, on no lattice.
fn points(volume: &Volume) -> Vec<DVec3> {
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
    for method in ["dsm:epsilon=0,map=96", "osm:map=96,bits=32", "dom:map=96,bits=32", "bom:map=96,bits=32"] {
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
    let scene = Scene { light: LIGHT, ..setup.scene(32, 32) };
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
}
