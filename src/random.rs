//! Pseudo-random numbers that depend only on a seed: `splitmix64` (Steele, Lea and Flood 2014, *Fast splittable
//! pseudorandom number generators*), with the same bits on every machine.

use glam::DVec3;
use std::f64::consts::TAU;

/// Increment of the generator's state.
pub const INCREMENT: u64 = 0x9e37_79b9_7f4a_7c15;

/// Hashes an integer: the first bits of a generator with the state `seed`.
pub fn mix(seed: u64) -> u64 {
    let z = seed.wrapping_add(INCREMENT);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Hashes an integer to a number that is uniform in `[0, 1)`.
pub fn mix_to_unit(seed: u64) -> f64 {
    unit_of(mix(seed))
}

fn unit_of(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// Returns point `index` of a three-dimensional low-discrepancy sequence: an additive recurrence whose steps are
/// powers of the root of `x^4 = x + 1`.
pub fn low_discrepancy(index: u64, shift: [f64; 3]) -> [f64; 3] {
    const ROOT: f64 = 1.220_744_084_605_759_5;
    let mut step = 1.0;
    shift.map(|s| {
        step /= ROOT;
        (s + step * (index + 1) as f64).fract()
    })
}

/// Random number generator.
#[derive(Debug, Clone)]
pub struct Chance(u64);

impl Chance {
    /// Creates a random number generator for a `seed`. Each `index` gives an independent sequence.
    pub fn new(seed: u64, index: u64) -> Self {
        let mut mixed = Self(seed.wrapping_mul(0xd134_2543_de82_ef95) ^ index);
        Self(mixed.bits() ^ index.rotate_left(32))
    }

    /// Returns the next 64 bits of the random number generator.
    pub fn bits(&mut self) -> u64 {
        let bits = mix(self.0);
        self.0 = self.0.wrapping_add(INCREMENT);
        bits
    }

    /// Returns a uniform random number in `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        unit_of(self.bits())
    }

    /// Returns a uniform random number in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns a uniform random integer in `0..count`.
    pub fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// Returns a random unit vector, uniform over all directions with `z >= lowest_z`.
    pub fn direction(&mut self, lowest_z: f64) -> DVec3 {
        let (z, angle) = (self.between(lowest_z, 1.0), TAU * self.unit());
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * angle.cos(), r * angle.sin(), z)
    }
}
