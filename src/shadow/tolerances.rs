//! What maps take for granted of light rays and surfaces, in one place.

/// Optical depth at which a light ray is over (a transmittance of 2^-11).
pub const OPAQUE_DEPTH: f32 = 7.6246;
/// What the polyline that a march hands to a sink may stray from the curve between its points, in transmittance.
pub const CHORD_TOLERANCE: f64 = 0.002;
/// Slope against the light up to which neighbouring texels are taken to see one surface.
pub const STEEPEST_SURFACE: f64 = 4.0;

/// Optical depth whose chord stays within [`CHORD_TOLERANCE`] at transmittance 1: a chord of length `h` strays by at
/// most `h^2 sigma^2 / 8`.
pub fn longest_depth() -> f32 {
    (8.0 * CHORD_TOLERANCE).sqrt() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_is_over_at_the_stated_transmittance() {
        assert!((f64::from(-OPAQUE_DEPTH).exp() * 2048.0 - 1.0).abs() < 1e-4);
    }
}
