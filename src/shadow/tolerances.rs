//! What maps take for granted of light rays and surfaces, and the terms of what is promised of them, in one place.
//! `docs/bound.md` derives each.

use super::method::Bound;
use crate::field::{BuildContext, LightSpace, SHORT_PIECE};

/// Optical depth at which a light ray is over (a transmittance of 2^-11).
pub const OPAQUE_DEPTH: f32 = 7.6246;
/// What the polyline that a march hands to a sink may stray from the curve between its points, in transmittance.
pub const CHORD_TOLERANCE: f64 = 0.0023;
/// Slope against the light up to which neighbouring texels are taken to see one surface.
pub const STEEPEST_SURFACE: f64 = 4.0;

/// Two-point Gauss over a stretch on which what opacity lets through changes by a factor of 2 at most: 1e-3 of its optical
/// depth, at the transmittance at which that is worth most (1/e); and a tenth of what is left where opacity nears 1, four
/// times a cell.
const QUADRATURE: f64 = 6e-4;
/// Sums in float32 ([`MOST_ROUNDINGS`](crate::field::MOST_ROUNDINGS)), at the transmittance at which they are worth most (1/e), and the rounding of
/// `exp`.
const SUMS: f64 = 2e-4;

/// Optical depth whose chord stays within [`CHORD_TOLERANCE`] at transmittance 1: a chord of length `h` strays by at
/// most `h^2 sigma^2 / 8`.
pub fn longest_depth() -> f32 {
    (8.0 * CHORD_TOLERANCE).sqrt() as f32
}

/// What every march cell by cell promises, whatever is made of it.
pub fn march_bound(context: &BuildContext<'_>, light_space: &LightSpace) -> Bound {
    let rounding = light_space.rounding(context.volume);
    Bound {
        transmittance: QUADRATURE + SUMS,
        depth_mm: SHORT_PIECE * context.volume.min_spacing_mm() + rounding.position_mm,
        lateral_mm: rounding.position_mm,
        value: context.transfer.value_rounding(),
        from_light_mm: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::MOST_ROUNDINGS;

    #[test]
    fn a_ray_is_over_at_the_stated_transmittance() {
        assert!((f64::from(-OPAQUE_DEPTH).exp() * 2048.0 - 1.0).abs() < 1e-4);
    }

    /// `exp` may be off by 3 + 2 x units in the last place (WGSL), which `T` makes little of.
    #[test]
    fn sums_have_room_for_their_roundings() {
        let unit = f64::from(f32::EPSILON);
        let sums = 0.5 * unit * f64::from(MOST_ROUNDINGS) * (-1f64).exp();
        let exponential = unit
            * (0..80).map(|i| 0.1 * f64::from(i)).map(|x| (3.0 + 2.0 * x) * (-x).exp()).fold(0.0, f64::max);
        assert!(sums + exponential < SUMS, "{sums:e} + {exponential:e}");
    }
}
