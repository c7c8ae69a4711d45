//! Transmittance along light rays through texel centres: within the band that the map promises, monotone, in range.

use super::*;
use glam::{DMat3, DVec2};
use umbravox::exact::OpticalDepthCurve;
use umbravox::measure::band::{Band, BandReport, Curve, MeanCurve, Sanity, test_depths};
use umbravox::measure::rays::pick_texels;

const RAYS: usize = 32;
const DEPTHS: usize = 64;

/// A light ray's exact curve in the map's depths.
struct Shifted<'a> {
    curve: OpticalDepthCurve<'a>,
    /// Depth at which the curve starts, mm.
    from: f64,
}

impl Curve for Shifted<'_> {
    fn transmittance(&self, z: f64) -> f64 {
        self.curve.transmittance_at(z - self.from)
    }
}

/// The exact curve of the light ray through texel coordinates, from the light (or from far outside) on.
fn light_curve<'a>(field: &'a ExactField<'_>, map: &ShadowMap, light: Light, texel: DVec2) -> Shifted<'a> {
    let (origin, direction) = map.light_space.world_ray(texel);
    let from = match light {
        Light::Point { position } => (position - origin).dot(direction),
        Light::Directional { .. } => {
            let depths = field.volume().corners_mm().map(|c| (c - origin).dot(direction));
            depths.into_iter().fold(f64::INFINITY, f64::min) - 1.0
        }
    };
    Shifted { curve: field.curve_along(origin + from * direction, direction, f64::INFINITY), from }
}

fn tap_offsets(taps: u32) -> Vec<DVec2> {
    match taps {
        1 => vec![DVec2::ZERO],
        5 => [(0.0, 0.0), (-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)].map(DVec2::from).into(),
        _ => (0..9).map(|t| DVec2::new(f64::from(t % 3) - 1.0, f64::from(t / 3) - 1.0) / 3.0).collect(),
    }
}

/// Candidate texels a side: spread over the map, whatever its size.
const CANDIDATES: u32 = 16;

/// Queries a method along light rays; the band report and what holds of any transmittance.
pub(super) fn along_light_rays(setup: &Setup, method: &str, light: Light) -> (BandReport, Sanity) {
    let map = setup.shadow(method, light);
    let offsets = tap_offsets(shadow::parse(method).unwrap().taps());
    let field = setup.exact();
    let band = map.bound.map(|b| Band { bound: b.transmittance, depth_mm: b.depth_mm });
    let stride = map.light_space.map_size / CANDIDATES;
    let texel =
        |c: u32, r: u32| DVec2::new(f64::from(c * stride + c % stride), f64::from(r * stride + r % stride));
    let meets = |c: u32, r: u32| light_curve(&field, &map, light, texel(c, r)).curve.total() > 0.0;
    let rays = pick_texels(CANDIDATES, RAYS, meets).into_iter().map(|[c, r]| {
        let center = texel(c, r);
        let curves: Vec<_> = offsets.iter().map(|t| light_curve(&field, &map, light, center + *t)).collect();
        let depths = depths_to_test(setup, &map, &curves, band.map_or(0.1, |b| b.depth_mm));
        let (origin, direction) = map.light_space.world_ray(center);
        let points: Vec<DVec3> = depths.iter().map(|z| origin + *z * direction).collect();
        (MeanCurve(curves), depths, points)
    });
    let rays: Vec<_> = rays.collect();
    let points: Vec<DVec3> = rays.iter().flat_map(|r| r.2.iter().copied()).collect();
    let values = setup.query(&map, &points);
    let rise = if method == "rays" { tolerance::RAYS_RISE } else { tolerance::MAP_RISE };
    let (mut report, mut sanity) = (BandReport::default(), Sanity::default());
    let mut rest = &values[..];
    for (ray, (curve, depths, points)) in rays.iter().enumerate() {
        let (values, after) = rest.split_at(points.len());
        rest = after;
        report = report.merge(BandReport::of_ray(ray, curve, depths, values, band));
        sanity = sanity.merge(Sanity::of_ray(values, rise));
        sanity.out_of_range += Sanity::of_ray(values, tolerance::RANGE).out_of_range;
    }
    (report, sanity)
}

/// Depths from a little before the first to a little past the last extinction of any tap, dense around jumps.
fn depths_to_test(setup: &Setup, map: &ShadowMap, curves: &[Shifted<'_>], tolerance_mm: f64) -> Vec<f64> {
    let mut jumps: Vec<f64> =
        curves.iter().flat_map(|c| c.curve.jumps().into_iter().map(|z| z + c.from)).collect();
    jumps.sort_by(f64::total_cmp);
    let margin = 3.0 * setup.volume().min_spacing_mm();
    let [near, far] = map.light_space.z_range;
    let [first, last] =
        jumps.first().zip(jumps.last()).map_or([near, far], |(a, b)| [a - margin, b + margin]);
    // Nothing is asked of places behind the light.
    let light = curves.iter().map(|c| c.from).fold(f64::NEG_INFINITY, f64::max);
    test_depths([first.max(light), last], &jumps, DEPTHS, tolerance_mm)
}

fn check(volume: &Arc<Volume>, tf: &TransferFunction, methods: &[&str], what: &str) {
    let Some(setup) = Setup::open(volume, tf) else { return };
    let mut failures = Vec::new();
    for (place, light) in lights(volume) {
        for method in methods {
            let (report, sanity) = along_light_rays(&setup, method, light);
            assert_eq!(report.rays, RAYS);
            if report.held() != Some(true)
                || sanity.monotone_violations + sanity.non_finite + sanity.out_of_range > 0
            {
                failures.push(format!("{what}, {place}, {method}: {report:?} {sanity:?}"));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

const METHODS: [&str; 3] = ["rays", "dsm:epsilon=0.005,map=64", "dsm:epsilon=0.02,map=64"];

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

/// Anisotropic, oblique, flipped and sheared: lengths along light rays stay world millimetres.
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

/// Pre-filtered maps answer to the mean of their taps' exact curves.
#[test]
fn prefilter() {
    let volume = phantom("thorax:40");
    for tf in &transfer_functions([-900.0, 1200.0])[..2] {
        check(
            &volume,
            tf,
            &["dsm:epsilon=0.02,map=48,prefilter=5", "dsm:epsilon=0.01,map=48,prefilter=9"],
            "prefilter",
        );
    }
}
