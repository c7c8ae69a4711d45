//! Numerical tolerances of shadow maps, and the terms of the error bound that all marches of light rays share.
//! `docs/bound.md` derives each.

use super::bound::Bound;
use crate::field::{BuildContext, LightSpace, SHORT_PIECE};

/// Optical depth at which the march of a light ray ends (a transmittance of 2^-11).
pub const OPAQUE_DEPTH: f32 = 7.6246;
/// Largest difference in transmittance between the exact curve of a light ray and the piecewise linear curve from its
/// march.
pub const CHORD_TOLERANCE: f64 = 0.0023;

/// Shader module of the greedy compression of transmittance curves (Lokovic and Veach 2000).
pub const GREEDY: &str = "shadow/greedy.wgsl";

/// Bound on the error in transmittance of four-point Gauss quadrature over intervals of a light ray on which `1 -
/// opacity` changes by a factor of 2 at most. It applies at a transmittance of 1/e, where an error in optical depth
/// weighs most. It includes the error of intervals on which opacity nears 1.
const QUADRATURE: f64 = 6e-4;
/// Bound on the error in transmittance from rounding in float32: of summed optical depth
/// ([`MOST_ROUNDINGS`](crate::field::MOST_ROUNDINGS)) at a transmittance of 1/e, where it weighs most, and of `exp`.
const SUMS: f64 = 2e-4;

/// Bound on the error in transmittance of a march of a light ray, cell by cell.
pub const MARCH_ERROR: f64 = QUADRATURE + SUMS;

/// Returns the largest optical depth over which a chord of the transmittance curve stays within [`CHORD_TOLERANCE`]
/// at transmittance 1. A chord of length `h` deviates by at most `h^2 sigma^2 / 8`.
pub fn longest_depth() -> f32 {
    (8.0 * CHORD_TOLERANCE).sqrt() as f32
}

/// Returns the error bound of light rays that are marched cell by cell, before any compression.
pub fn march_bound(context: &BuildContext<'_>, light_space: &LightSpace) -> Bound {
    let rounding = light_space.rounding(context.volume, context.transfer.clips);
    Bound {
        transmittance: MARCH_ERROR,
        depth_mm: SHORT_PIECE * context.volume.min_spacing_mm() + rounding.position_mm,
        lateral_mm: rounding.position_mm,
        value: context.transfer.value_rounding(),
        reach_mm: rounding.position_mm,
        ..Bound::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{GAUSS, MOST_ROUNDINGS, UNEVEN_DEPTH};

    #[test]
    fn a_ray_is_over_at_the_stated_transmittance() {
        assert!((f64::from(-OPAQUE_DEPTH).exp() * 2048.0 - 1.0).abs() < 1e-4);
    }

    /// Returns monotone cubics, as models of opacity along an interval of a ray, by the Bernstein coefficients of
    /// their slopes. The middle coefficient may be negative.
    fn monotone_cubics() -> Vec<[f64; 3]> {
        let ends: Vec<f64> =
            (0..=24).map(|i| if i == 0 { 0.0 } else { 10f64.powf(f64::from(i - 24) / 8.0) }).collect();
        let mut all = Vec::new();
        for (a, b) in ends.iter().flat_map(|a| ends.iter().map(move |b| (*a, *b))) {
            let below = (0..=16).map(|i| -(a * b).sqrt() * f64::from(i) / 16.0);
            for middle in below.chain(ends.iter().copied()) {
                let rise = (a + middle + b) / 3.0;
                if rise > 1e-9 {
                    all.push([a, middle, b].map(|slope| slope / rise));
                }
            }
        }
        all
    }

    #[test]
    fn four_points_take_the_logarithm_of_any_even_piece() {
        let cubic = |[a, m, b]: [f64; 3], u: f64| {
            let v = 1.0 - u;
            // The integral of a v² + 2 m u v + b u².
            (a * (1.0 - v * v * v) + m * u * u * (3.0 - 2.0 * u) + b * u * u * u) / 3.0
        };
        let four: Vec<[f64; 2]> = GAUSS.iter().flat_map(|&[u, w]| [[u, w], [1.0 - u, w]]).collect();
        let mut worst = 0f64;
        for shape in monotone_cubics() {
            assert!((cubic(shape, 1.0) - 1.0).abs() < 1e-9);
            for (from, to) in [(1.0, 0.5), (0.5, 1.0), (0.9, 0.45), (0.3, 0.6), (1.0, 0.7), (1e-3, 2e-3)] {
                let depth = |u: f64| -f64::ln(from + (to - from) * cubic(shape, u));
                let exact: f64 = (0..64)
                    .flat_map(|i| four.iter().map(move |[u, w]| (f64::from(i) + u, w)))
                    .map(|(u, w)| w / 64.0 * depth(u / 64.0))
                    .sum();
                let taken: f64 = four.iter().map(|[u, w]| w * depth(*u)).sum();
                worst = worst.max((taken / exact - 1.0).abs());
            }
        }
        let lost = worst * (-1f64).exp() + 0.1 * 3.0 * UNEVEN_DEPTH;
        assert!((1e-3..1.4e-3).contains(&worst) && lost < QUADRATURE, "{worst:e}, {lost:e}");
    }

    /// Rounding errors of float32 sums and of WGSL's `exp` (3 + 2 x units in the last place) stay within the error
    /// bound.
    #[test]
    fn sums_have_room_for_their_roundings() {
        let unit = f64::from(f32::EPSILON);
        let sums = 0.5 * unit * f64::from(MOST_ROUNDINGS) * (-1f64).exp();
        let exponential = unit
            * (0..80).map(|i| 0.1 * f64::from(i)).map(|x| (3.0 + 2.0 * x) * (-x).exp()).fold(0.0, f64::max);
        assert!(sums + exponential < SUMS, "{sums:e} + {exponential:e}");
    }
}
