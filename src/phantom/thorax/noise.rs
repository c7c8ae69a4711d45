//! Deterministic noise of the chest phantom: hashes of integers by the finaliser of splitmix64.

use crate::random::{INCREMENT, mix};

/// Hashes an integer to a number that is uniform in `[0, 1)`.
pub fn uniform(seed: u64) -> f32 {
    (bits_of(seed) >> 40) as f32 / (1u64 << 24) as f32
}

/// Hashes an integer to a number with a triangular distribution in `(-1, 1)`.
pub fn triangular(seed: u64) -> f32 {
    let bits = bits_of(seed);
    let scale = 1.0 / (1u64 << 24) as f32;
    ((bits >> 40) as f32 - (bits & 0xff_ffff) as f32) * scale
}

/// Returns the first bits of the `seed`-th state of `splitmix64`.
fn bits_of(seed: u64) -> u64 {
    mix(seed.wrapping_mul(INCREMENT))
}
