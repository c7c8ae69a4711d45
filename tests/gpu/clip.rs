//! Clip planes: the volume beyond them has no extinction, for every shadow method, with and without skipping.

use super::*;
use crate::bound::along_light_rays;
use umbravox::transfer::ClipPlane;

fn plane(normal: DVec3, through: DVec3) -> ClipPlane {
    let normal = normal.normalize();
    ClipPlane { normal, offset_mm: normal.dot(through) }
}

fn clipped(tf: &TransferFunction, planes: &[ClipPlane]) -> TransferFunction {
    TransferFunction { clip: planes.to_vec(), ..tf.clone() }
}

/// Sets of clip planes: one oblique plane through the middle, a wedge, a thin oblique slab.
fn cuts(volume: &Volume) -> Vec<(&'static str, Vec<ClipPlane>)> {
    let corners = volume.corners_mm();
    let center = corners.iter().sum::<DVec3>() / 8.0;
    let size = corners[0].distance(corners[7]);
    let oblique = DVec3::new(0.3, -0.5, 0.8);
    vec![
        ("halved", vec![plane(oblique, center)]),
        ("wedge", vec![plane(DVec3::X, center), plane(DVec3::new(-1.0, 2.0, 0.1), center)]),
        (
            "slab",
            vec![
                plane(oblique, center - 0.04 * size * oblique),
                plane(-oblique, center + 0.02 * size * oblique),
            ],
        ),
    ]
}

/// In a clipped homogeneous medium, transmittance is the exponential of the path length inside the clip planes.
#[test]
fn a_clipped_homogeneous_medium_has_its_depth() {
    let n = 24usize;
    let volume = Arc::new(volume_of(Array3::<u8>::from_elem((n, n, n), 100).into(), DAffine3::IDENTITY));
    let sigma = 0.07;
    let tf = TransferFunction::new(Quantity::Extinction, &[(50.0, sigma), (200.0, sigma)]);
    let cut = plane(DVec3::new(0.2, 0.3, 1.0), DVec3::splat(11.5));
    let tf = clipped(&tf, &[cut, plane(DVec3::NEG_Y, DVec3::new(0.0, 19.2, 0.0))]);
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let toward = DVec3::new(-0.2, 0.35, -0.9).normalize();
    let light = Light::Directional { toward };
    // Points behind the cut, before it, and above the second plane, seen from the light below.
    let points: Vec<DVec3> = (0..400)
        .map(|i| {
            DVec3::new(8.0 + f64::from(i % 8), 6.0 + f64::from(i / 8 % 10), f64::from(i / 80) * 4.5 + 0.7)
        })
        .collect();
    let depth = |from: &DVec3| {
        let mut span = [0.0, f64::INFINITY];
        for plane in &tf.clip {
            span = plane.cut(*from, toward, span);
        }
        for (axis, sign) in (0..3).flat_map(|axis| [(axis, 1.0), (axis, -1.0)]) {
            let normal = sign * DVec3::AXES[axis];
            let side = ClipPlane { normal, offset_mm: if sign > 0.0 { -0.5 } else { -(n as f64 - 0.5) } };
            span = side.cut(*from, toward, span);
        }
        sigma * (span[1] - span[0]).max(0.0)
    };
    let wanted: Vec<f64> = points.iter().map(|p| (-depth(p)).exp()).collect();
    assert!(wanted.iter().any(|t| *t < 0.5) && wanted.iter().filter(|t| **t == 1.0).count() > 20);
    let methods = [
        ("rays", 2e-6),
        ("dsm:epsilon=0.002,map=256", 0.012),
        ("dsm:epsilon=0.002,map=256,march=samples", 0.012),
        ("osm:layers=128,map=256", 0.02),
        ("fourier:map=256,range=texel", 0.02),
        ("avsm:map=256,nodes=16", 0.02),
        ("lightvolume", 0.04),
        ("lightvolume:build=sweep", 0.08),
        ("sat:scale=1,boxes=256", 0.06),
    ];
    checks::answers_are(&setup, light, &points, &wanted, &methods);
}

/// Error bounds of light rays hold for clipped volumes, too.
#[test]
fn error_bounds_are_satisfied() {
    let whole = phantom("thorax:48");
    for (what, planes) in cuts(&whole) {
        for (n, tf) in transfer_functions([-900.0, 1200.0]).iter().enumerate() {
            let Some(setup) = Setup::open(&whole, &clipped(tf, &planes)) else { return };
            checks::promises_hold(&setup, &format!("{what}, function {n}"));
        }
    }
}

/// Light rays within rounding of a clip plane: their side of it may be that of a neighbouring ray.
#[test]
fn light_along_the_plane() {
    let whole = phantom("thorax:48");
    let center = whole.corners_mm().iter().sum::<DVec3>() / 8.0;
    let [_, jumps, _] = transfer_functions([-900.0, 1200.0]);
    let normal = DVec3::new(0.3, -0.5, 0.8);
    let across = normal.cross(DVec3::new(1.0, 0.2, 0.4)).normalize();
    for tilt in [0.0, 1e-7, 1e-4] {
        let tf = clipped(&jumps, &[plane(normal + tilt * across, center)]);
        let Some(setup) = Setup::open(&whole, &tf) else { return };
        let light = Light::Directional { toward: across };
        for method in ["rays", "dsm:epsilon=0.01,map=64"] {
            let (report, sanity) = along_light_rays(&setup, method, light);
            assert_eq!(
                (report.satisfied(), sanity.non_finite),
                (Some(true), 0),
                "{tilt} {method}: {report:?}"
            );
        }
    }
}

/// Pictures of clipped volumes agree with the exact picture, and do not change without skipping.
#[test]
fn pictures_are_exact_and_skipping_changes_nothing() {
    let whole = phantom("thorax:64");
    let [ramp, jumps, _] = transfer_functions([-900.0, 1200.0]);
    for (what, planes) in cuts(&whole) {
        for tf in [&ramp, &jumps] {
            let Some(setup) = Setup::open(&whole, &clipped(tf, &planes)) else { return };
            checks::pictures_are_exact_and_skipping_changes_nothing(&setup, what);
        }
    }
}

/// Bricks that are clipped away are not marched; a volume that is clipped away completely is empty.
#[test]
fn clipped_regions_cost_nothing() {
    let whole = phantom("thorax:64");
    let [ramp, ..] = transfer_functions([-900.0, 1200.0]);
    let center = whole.corners_mm().iter().sum::<DVec3>() / 8.0;
    let Some(all) = Setup::open(&whole, &ramp) else { return };
    let half = Setup::open(&whole, &clipped(&ramp, &[plane(DVec3::X, center)])).unwrap();
    let [all_active, half_active] = [&all, &half].map(|s| s.session.transfer.active.active as f64);
    assert!((0.4..0.65).contains(&(half_active / all_active)), "{half_active} of {all_active}");
    let none = Setup::open(&whole, &clipped(&ramp, &[plane(DVec3::X, center + 1e4 * DVec3::X)])).unwrap();
    assert!(none.session.transfer.empty);
    let scene = none.scene(8, 8);
    let picture = none.picture("dsm", &scene);
    assert!((0..64).all(|i| picture[[i / 8, i % 8, 3]] == 0.0));
}
