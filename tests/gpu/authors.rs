//! Figures that the authors' own code gives, beside those of this program.

use super::map_methods::{ABOVE, DEEP, even, slabs};
use super::*;

/// Transmittance behind three slabs at shares 0.1 to 0.9 of the depth, by the published shader functions of Münstermann et al.
/// (2018) for 4, 6 and 8 power moments, evaluated in float64 with the bias and the overestimation of their paper. The
/// moments of the slabs are in closed form.
const MOMENTS: [(u32, [f64; 9]); 3] = [
    (4, [0.92435, 0.80027, 0.67655, 0.47887, 0.38768, 0.33648, 0.28481, 0.22921, 0.12270]),
    (6, [0.96894, 0.80034, 0.53074, 0.43224, 0.38251, 0.33558, 0.27452, 0.20796, 0.11259]),
    (8, [0.98315, 0.79912, 0.51926, 0.42940, 0.36943, 0.32557, 0.27433, 0.19609, 0.11075]),
];

#[test]
fn moments_give_the_transmittance_of_the_authors_shaders() {
    let medium = slabs(&[[0.125, 0.3125], [0.5, 0.5625], [0.6875, 0.9375]]);
    let Some(setup) = Setup::open(&medium, &even(0.04)) else { return };
    for (moments, expected) in MOMENTS {
        let map = setup.shadow(&format!("moments:moments={moments},near=0,map=32,fit=volume"), ABOVE);
        let depth = |tenth: usize| (1.0 - tenth as f64 / 10.0) * DEEP as f64 - 0.5;
        let points: Vec<_> = (1..10).map(|tenth| DVec3::new(7.5, 7.5, depth(tenth))).collect();
        for (got, expected) in setup.query(&map, &points).into_iter().zip(expected) {
            let rounding = if moments == 8 { 1e-3 } else { 5e-5 };
            assert!((f64::from(got) - expected).abs() < rounding, "{moments} moments: {got}, {expected}");
        }
    }
}
