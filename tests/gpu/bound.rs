//! Transmittance along light rays through texel centres: within the error bound of the shadow map, monotone, in
//! range.

use super::*;
use glam::{DMat3, DVec2};
use umbravox::measure::bound_check::{BoundReport, Sanity};
use umbravox::measure::errors::{RayTest, meets_extinction};
use umbravox::measure::rays::pick_texels;

const RAYS: usize = 32;
const DEPTHS: usize = 64;

/// Number of candidate texels along each side of the map, spread over it.
const CANDIDATES: u32 = 16;

/// Queries a shadow method along light rays, and reports its error bound and the range and monotony of transmittance.
pub(super) fn along_light_rays(setup: &Setup, method: &str, light: Light) -> (BoundReport, Sanity) {
    let map = setup.shadow(method, light);
    let field = setup.exact();
    let stride = map.light_space.map_size / CANDIDATES;
    let texel = |c: u32, r: u32| [c * stride + c % stride, r * stride + r % stride];
    let meets = |c: u32, r: u32| {
        let [column, row] = texel(c, r).map(f64::from);
        meets_extinction(&field, light, &map.light_space, DVec2::new(column, row))
    };
    let texels: Vec<_> = pick_texels(CANDIDATES, RAYS, meets).into_iter().map(|[c, r]| texel(c, r)).collect();
    let taps = shadow::parse(method).unwrap().taps();
    let test = RayTest { texels: &texels, taps, depths: DEPTHS, default_depth_mm: 0.1, nodes_mm: &[] };
    let rise = if method == "rays" { tolerance::RAYS_RISE } else { tolerance::MAP_RISE };
    let (mut report, mut sanity) = (BoundReport::default(), Sanity::default());
    let visit = |own, depths: &[f64], values: &[f32]| {
        report.add(own);
        sanity = sanity.merge(Sanity::of_ray(depths, values, [tolerance::RANGE, rise], 0.0));
    };
    let query = |points: &[DVec3]| setup.session.query(&map, points);
    test.visit(&field, light, &map, query, visit).unwrap();
    (report, sanity)
}

fn check(volume: &Arc<Volume>, tf: &TransferFunction, methods: &[&str], what: &str) {
    let Some(setup) = Setup::open(volume, tf) else { return };
    let mut failures = Vec::new();
    for (place, light) in lights(volume) {
        for method in methods {
            let (report, sanity) = along_light_rays(&setup, method, light);
            assert_eq!(report.rays, RAYS);
            if report.satisfied() != Some(true)
                || sanity.monotone_violations + sanity.non_finite + sanity.out_of_range > 0
            {
                failures.push(format!("{what}, {place}, {method}: {report:?} {sanity:?}"));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

const METHODS: [&str; 6] = [
    "rays",
    "dsm:epsilon=0.005,map=64",
    "dsm:epsilon=0.02,map=64,near=0",
    "dsm:epsilon=0.02,map=64,segments=transmittance",
    "dsm:epsilon=0.005,compress=optimal,map=64",
    "dsm:epsilon=0.03,compress=optimal,map=64,near=0,align=on",
];

#[test]
fn analytic_phantoms() {
    for name in ["slab:32", "sphere:32", "shell:32", "step:32", "comb:32"] {
        let volume = phantom(name);
        for (n, tf) in transfer_functions([0.0, 1000.0]).iter().enumerate() {
            check(&volume, tf, &METHODS, &format!("{name}, function {n}"));
        }
    }
}

#[test]
fn thorax() {
    let volume = phantom("thorax:64");
    for (n, tf) in transfer_functions([-900.0, 1200.0]).iter().enumerate() {
        check(&volume, tf, &METHODS, &format!("thorax, function {n}"));
    }
}

/// Opacity 0 gives transmittance 1 for every driver's logarithm.
#[test]
fn samples_with_zero_extinction_do_not_attenuate_light() {
    let volume = phantom("thorax:32");
    let Some(setup) = Setup::open(&volume, &opacity(&[(200.0, 0.0), (900.0, 0.9)])) else { return };
    let light = Light::Directional { toward: DVec3::new(0.4, -0.5, 0.75) };
    let field = setup.exact();
    let mut points = samples::points(&volume);
    points.retain(|x| field.transmittance_to_light(*x, &light) == 1.0);
    assert!(points.len() > 1000, "{}", points.len());
    let least = setup.query(&setup.shadow("rays", light), &points).into_iter().fold(1.0, f32::min);
    assert!(least > 1.0 - 1e-6, "{least}");
    let map = setup.shadow("dsm:fit=volume,map=64", light);
    let side = map.light_space.map_size;
    let meets = |i: u32| {
        let texel = DVec2::new(f64::from(i % side), f64::from(i / side));
        meets_extinction(&field, light, &map.light_space, texel)
    };
    let met = (0..side * side).filter(|i| meets(*i)).count() as u64;
    let hit = map.report.texels_hit.unwrap();
    assert!(hit.abs_diff(met) <= met / 100, "{hit} texels have nodes, {met} rays meet extinction");
}

/// Error bounds hold for anisotropic, oblique, flipped and sheared volumes: lengths along light rays stay world mm.
#[test]
fn affines() {
    let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 1.1);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.3, 1.0, 0.0), DVec3::new(-0.2, 0.45, 1.0));
    let affine = |m: DMat3| DAffine3::from_mat3_translation(m, DVec3::new(-31.0, 47.0, 112.5));
    for (what, matrix) in [
        ("anisotropic", DMat3::from_diagonal(DVec3::new(0.5, 0.9, 4.0))),
        ("oblique", turn * DMat3::from_diagonal(DVec3::new(0.7, 0.7, 1.9))),
        ("flipped", DMat3::from_diagonal(DVec3::new(-0.8, 0.8, 1.2))),
        ("sheared", turn * shear * DMat3::from_diagonal(DVec3::new(1.1, 0.8, 1.6))),
    ] {
        let [ramp, jumps, _] = transfer_functions([-900.0, 1200.0]);
        check(&under(affine(matrix), "thorax:40"), &jumps, &METHODS[..2], &format!("{what} thorax"));
        check(&under(affine(matrix), "thorax:40"), &ramp, &METHODS[1..], &format!("{what} thorax"));
    }
}

/// Pre-filtered shadow maps are compared with the mean of the exact curves of their taps.
/// A node stores at most the optical depth 8. That must not raise a line whose end would lie beyond.
#[test]
fn ends_of_lines_of_optical_depth() {
    // Extinction (1/mm) of voxels along z, each as often as stated.
    let scenes: [(&str, usize, &[f32]); 2] = [
        ("0.002", 3, &[0.0, 1.9039, 0.8675, 0.1088, 1.1202, 7.7603, 0.8884, 0.2441]),
        (
            "0.0012",
            2,
            &[0.0, 0.0396, 0.0631, 2.8587, 1.5219, 0.0796, 1.2456, 5.0879, 0.0327, 3.4583, 0.4451, 1.4736],
        ),
    ];
    for (epsilon, times, layers) in scenes {
        let value = |(k, _, _): (usize, usize, usize)| layers[k / times];
        let voxels = Voxels::F32(Array3::from_shape_fn((times * layers.len(), 4, 4), value));
        let volume = Arc::new(volume_of(voxels, DAffine3::IDENTITY));
        let Some(setup) = Setup::open(&volume, &extinction(&[(0.0, 0.0), (8.0, 8.0)])) else { return };
        let light = Light::Directional { toward: DVec3::new(0.0, 0.0, -1.0) };
        let method = format!("dsm:epsilon={epsilon},map=4,fit=volume,near=0");
        let map = setup.shadow(&method, light);
        let end = (times * layers.len()) as f64 - 1.0;
        let points: Vec<DVec3> =
            (0..4000).map(|i| DVec3::new(1.5, 1.5, end * f64::from(i) / 4000.0)).collect();
        let (exact, bound) = (setup.exact(), map.bound.unwrap());
        for (point, got) in points.iter().zip(setup.query(&map, &points)) {
            let at = |by: f64| exact.transmittance_to_light(*point + DVec3::Z * by, &light);
            let amount = bound.distance(f64::from(got), [at(bound.depth_mm), at(-bound.depth_mm)]);
            assert!(amount <= 0.0, "{method}, {point}: {got}, exact {}, {bound:?}", at(0.0));
        }
    }
}

#[test]
fn prefilter() {
    let volume = phantom("thorax:40");
    for tf in &transfer_functions([-900.0, 1200.0])[..2] {
        check(
            &volume,
            tf,
            &[
                "dsm:epsilon=0.02,map=48,prefilter=5",
                "dsm:epsilon=0.01,map=48,prefilter=9",
                "dsm:epsilon=0.01,compress=optimal,map=48,prefilter=5",
            ],
            "prefilter",
        );
    }
}
