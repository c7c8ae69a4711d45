//! Deterministic noise of the chest phantom: hashes of integers by the finaliser of splitmix64.

/// Hashes an integer to a number that is uniform in `[0, 1)`.
pub fn uniform(seed: u64) -> f32 {
    (mix(seed) >> 40) as f32 / (1u64 << 24) as f32
}

/// Hashes an integer to a number with a triangular distribution in `(-1, 1)`.
pub fn triangular(seed: u64) -> f32 {
    let bits = mix(seed);
    let scale = 1.0 / (1u64 << 24) as f32;
    ((bits >> 40) as f32 - (bits & 0xff_ffff) as f32) * scale
}

fn mix(seed: u64) -> u64 {
    let mut bits = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}
