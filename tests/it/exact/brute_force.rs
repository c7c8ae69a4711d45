//! Float64 reference against sums over many samples, and against an independent implementation.

use super::*;
use std::sync::Arc;
use umbravox::exact::ExactField;
use umbravox::transfer::{ClipPlane, LabelRule, LabelVisibility};
use umbravox::volume::Labels;

/// Trilinear value of a volume at index coordinates, clamped at the edge; `None` outside the domain.
fn value_at(volume: &Volume, p: DVec3) -> Option<f64> {
    let n = volume.dims();
    let mut near = [[(0, 0.0); 2]; 3];
    for axis in 0..3 {
        let last = (n[axis] - 1) as f64;
        if !(-0.5..=last + 0.5).contains(&p[axis]) {
            return None;
        }
        let q = p[axis].clamp(0.0, last);
        let w = q - q.floor();
        near[axis] = [(q.floor() as usize, 1.0 - w), ((q.floor() + 1.0).min(last) as usize, w)];
    }
    let corner = |c: usize| {
        let [i, j, k] = [near[0][c & 1], near[1][c >> 1 & 1], near[2][c >> 2]];
        i.1 * j.1 * k.1 * volume.value(i.0, j.0, k.0)
    };
    Some((0..8).map(corner).sum())
}

#[test]
fn midpoint_sums() {
    const STEPS: usize = 40_000;
    let volume = rough_volume(oblique());
    let mut random = Rng::with_seed(5);
    for _ in 0..40 {
        let [a, b] =
            std::array::from_fn(|_| in_box(&mut random, DVec3::splat(-2.0), DVec3::new(10.0, 8.0, 7.0)));
        let values: Vec<_> =
            (0..STEPS).map(|i| value_at(&volume, a.lerp(b, (i as f64 + 0.5) / STEPS as f64))).collect();
        let [a, b] = [a, b].map(|p| oblique().transform_point3(p));
        let step_mm = a.distance(b) / STEPS as f64;
        for tf in transfer_functions() {
            let sum: f64 = values.iter().flatten().map(|s| tf.extinction(*s)).sum();
            // A jump is misplaced by up to half a step, and a ray crosses dozens.
            let tolerance = 20.0 * step_mm * tf.max_extinction(0.0, 101.0);
            assert!((ExactField::new(&volume, &tf).optical_depth(a, b) - sum * step_mm).abs() <= tolerance);
        }
    }
}

/// Optical depths of the rough volume under the oblique affine agree with a Python implementation (numpy; roots of
/// each cell's cubic by companion matrix, 12-point Gauss-Legendre halved to 1e-13). Rows are those of
/// `transfer_functions()`.
#[test]
fn independent_implementation() {
    let segments = [
        [-21.45, 29.35, 5.275, -13.15, 40.4, 21.95],
        [-14.48, 30.86, 20.895, -19.52, 38.24, 5.345],
        [-17.47, 33.2, 9.975, -16.2, 35.93, 16.3],
        [-23.075, 35.275, 13.388, -11.075, 32.275, 15.638],
        [-15.3, 31.9, -1.85, -19.2, 37.1, 28.05],
        [-19.4, 32.3, 9.7, -17.0, 37.5, 18.5],
    ];
    let want = [
        [
            4.419397254079984,
            3.7575499358269,
            1.2376752716538473,
            1.5007649415109434,
            0.143585523119962,
            2.1785258066994286,
        ],
        [
            3.514732278942704,
            2.8571778503924246,
            1.6264060582588102,
            1.6175277038154214,
            0.2118348413269183,
            2.6349801383400773,
        ],
        [
            3.9825323893910243,
            3.050878142420372,
            0.2966863198633755,
            1.4194401149678824,
            0.09462272448038665,
            2.3635930027146146,
        ],
        [
            2.8466783379469343,
            3.7471730595596013,
            1.5994752350365486,
            1.4291161019345628,
            2.353720459188119,
            2.115822707698562,
        ],
        [
            8.380496533421082,
            7.305670163179069,
            2.3271704762245293,
            2.846272827893606,
            1.0057614827440668,
            4.038174877260566,
        ],
    ];
    let volume = rough_volume(oblique());
    for (tf, want) in transfer_functions().iter().zip(want) {
        let field = ExactField::new(&volume, tf);
        for ([a, b, c, d, e, f], want) in segments.into_iter().zip(want) {
            assert_close(field.optical_depth(DVec3::new(a, b, c), DVec3::new(d, e, f)), want, 1e-11);
        }
    }
}

/// Labels, which end half-way between voxels, and clip planes agree with midpoint sums over many points.
#[test]
fn midpoint_sums_of_intervals() {
    const STEPS: usize = 40_000;
    let whole = rough_volume(oblique());
    let [nx, ny, nz] = whole.dims();
    let mut random = Rng::with_seed(11);
    let labels = Array3::from_shape_fn((nz, ny, nx), |_| random.u8(0..4));
    let provenance = Provenance::new("labels", "phantom", "uint8");
    let segmentation = Volume::new(labels.clone().into(), Scaling::IDENTITY, oblique(), provenance).unwrap();
    let labelled = Arc::new(Labels::sampled(&segmentation, &whole).unwrap());
    let volume = whole.labelled(labelled).unwrap();
    let center = oblique().transform_point3(DVec3::new(4.0, 3.0, 2.5));
    let normal = DVec3::new(0.4, -0.3, 0.8).normalize();
    let plane = ClipPlane { normal, offset_mm: normal.dot(center) };
    let functions = transfer_functions();
    for (n, tf) in functions.iter().enumerate() {
        let other = &functions[(n + 1) % functions.len()];
        let rules = vec![
            LabelRule { labels: vec![2], visibility: LabelVisibility::Hidden },
            LabelRule { labels: vec![3], visibility: LabelVisibility::Visible(Box::new(other.clone())) },
        ];
        let tf = TransferFunction { rules, clip: vec![plane], ..tf.clone() };
        let field = ExactField::new(&volume, &tf);
        for _ in 0..15 {
            let [a, b] =
                std::array::from_fn(|_| in_box(&mut random, DVec3::splat(-2.0), DVec3::new(10.0, 8.0, 7.0)));
            let step_mm = oblique().transform_vector3(b - a).length() / STEPS as f64;
            let extinction = |i: usize| {
                let p = a.lerp(b, (i as f64 + 0.5) / STEPS as f64);
                let Some(value) = value_at(&volume, p) else { return 0.0 };
                if normal.dot(oblique().transform_point3(p)) < plane.offset_mm {
                    return 0.0;
                }
                let last = DVec3::new(nx as f64, ny as f64, nz as f64) - 1.0;
                let nearest = (p + 0.5).floor().clamp(DVec3::ZERO, last).as_usizevec3();
                match labels[[nearest.z, nearest.y, nearest.x]] {
                    2 => 0.0,
                    3 => other.extinction(value),
                    _ => tf.extinction(value),
                }
            };
            let sum: f64 = (0..STEPS).map(extinction).sum();
            let [a, b] = [a, b].map(|p| oblique().transform_point3(p));
            let most = functions.iter().map(|tf| tf.max_extinction(0.0, 101.0)).fold(0.0, f64::max);
            // Every border is misplaced by up to half a step.
            let tolerance = 30.0 * step_mm * most;
            let got = field.optical_depth(a, b);
            assert!((got - sum * step_mm).abs() <= tolerance, "{n}: {got} {} {tolerance}", sum * step_mm);
        }
    }
}
