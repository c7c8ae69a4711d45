//! Choice of the depths on a light ray at which a shadow method's transmittance is tested.

use crate::random::mix;

/// Offsets of test depths from a jump in transmittance, in units of the depth tolerance. Offsets near 0 test the jump
/// itself; offsets near 1 detect a jump misplaced by more than the tolerance.
const JUMP_OFFSETS: [f64; 17] =
    [0.0, -1e-6, 1e-6, -1e-3, 1e-3, -0.1, 0.1, -0.5, 0.5, -1.0, 1.0, -1.01, 1.01, -1.1, 1.1, -1.5, 1.5];

/// Lower limit for the unit of test depth offsets around a jump in transmittance, as a fraction of the depth range.
/// It applies where the depth tolerance is smaller.
const SMALLEST_OFFSET: f64 = 1e-6;

/// Returns `n` sorted, distinct depths in `range_mm` at which a light ray is tested. Up to half of them lie around
/// `jumps_mm` at multiples of the depth tolerance `d_mm`; there the exact transmittance curve drops or kinks. The
/// rest is one depth in each of equal strata, both ends of the range included.
///
/// Equal arguments always give the same depths. Where there are too many jumps, each gets only some of the offsets,
/// or only evenly chosen jumps get one. The chosen offsets vary with the range.
///
/// Fewer than `n` depths result only where the range contains too few distinct numbers. The result is empty for a
/// reversed or infinite range.
pub fn test_depths(range_mm: [f64; 2], jumps_mm: &[f64], n: usize, d_mm: f64) -> Vec<f64> {
    let [start, end] = range_mm;
    let length = end - start;
    if !length.is_finite() || length < 0.0 || n == 0 {
        return Vec::new();
    }
    let unit = d_mm.max(SMALLEST_OFFSET * length);
    let jumps: Vec<f64> = jumps_mm.iter().copied().filter(|z| (start..=end).contains(z)).collect();
    let mut depths = Vec::with_capacity(2 * n);
    let slots = (n / 2).min(jumps.len() * JUMP_OFFSETS.len());
    // If not every jump can have every offset, different rays get different offsets.
    let phase = (mix(start.to_bits() ^ end.to_bits()) % JUMP_OFFSETS.len() as u64) as usize;
    for slot in 0..slots {
        let jump = jumps[slot * jumps.len() / slots];
        let z = jump + JUMP_OFFSETS[(slot + phase) % JUMP_OFFSETS.len()] * unit;
        if (start..=end).contains(&z) {
            depths.push(z);
        }
    }
    sort_distinct(&mut depths);

    // Depths may coincide, so the strata are refined until there are enough; surplus depths are dropped evenly.
    let wanted = n - depths.len();
    let mut uniform = stratified(range_mm, wanted);
    uniform.retain(|z| depths.binary_search_by(|a| a.total_cmp(z)).is_err());
    let mut strata = wanted;
    while uniform.len() < wanted && strata < 64 * n {
        strata *= 2;
        uniform = stratified(range_mm, strata);
        uniform.retain(|z| depths.binary_search_by(|a| a.total_cmp(z)).is_err());
    }
    let available = uniform.len();
    let taken = wanted.min(available);
    depths.extend((0..taken).map(|i| uniform[i * available / taken]));
    sort_distinct(&mut depths);
    depths
}

/// Draws one depth on a light ray at random from each of `n` equal intervals of a depth range, with both ends
/// included. The result is sorted and distinct.
fn stratified([start, end]: [f64; 2], n: usize) -> Vec<f64> {
    let mut seed = start.to_bits() ^ end.to_bits().rotate_left(32);
    let mut depths: Vec<f64> = (0..n)
        .map(|i| {
            seed = mix(seed);
            // 53 bits make a double in [0, 1).
            let jitter = (seed >> 11) as f64 / (1_u64 << 53) as f64;
            match i {
                0 => start,
                _ if i == n - 1 => end,
                _ => (start + (end - start) * (i as f64 + jitter) / n as f64).clamp(start, end),
            }
        })
        .collect();
    sort_distinct(&mut depths);
    depths
}

pub(super) fn sort_distinct(depths: &mut Vec<f64>) {
    depths.sort_by(f64::total_cmp);
    depths.dedup();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_sorted_distinct_inside_and_as_many_as_asked() {
        let many: Vec<f64> = (0..500).map(|i| 0.1 * f64::from(i)).collect();
        for jumps in [&[][..], &[1.0], &[0.0, 50.0], &[-3.0, 99.0], &many] {
            for (n, d) in [(200, 0.1), (200, 0.0), (7, 0.1), (1, 0.1), (2, 1e9)] {
                let z = test_depths([0.0, 50.0], jumps, n, d);
                assert_eq!(z.len(), n, "{} jumps, n {n}, d {d}", jumps.len());
                assert!(z.windows(2).all(|w| w[0] < w[1]));
                assert!(z[0] >= 0.0 && z[n - 1] <= 50.0);
                assert_eq!(z, test_depths([0.0, 50.0], jumps, n, d), "deterministic");
            }
        }
        assert!(test_depths([1.0, 0.0], &[], 9, 0.1).is_empty());
        assert!(test_depths([0.0, f64::NAN], &[], 9, 0.1).is_empty());
        assert_eq!(test_depths([2.0, 2.0], &[2.0], 9, 0.1), [2.0]);
    }

    #[test]
    fn depths_are_dense_around_jumps_and_cover_the_range() {
        let z = test_depths([0.0, 14.0], &[1.0, 2.0, 12.0], 200, 0.1);
        for jump in [1.0, 2.0, 12.0] {
            for offset in [0.0, -1e-7, 1e-7, -0.01, 0.01, -0.05, 0.05, -0.1, 0.1, -0.11, 0.11, -0.15, 0.15] {
                assert!(z.iter().any(|z| (z - jump - offset).abs() < 1e-12), "{jump} {offset:+}");
            }
        }
        assert_eq!((z[0], z[199]), (0.0, 14.0));
        let widest = z.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        assert!(widest < 2.0 * 14.0 / 100.0, "no gap wider than two strata: {widest}");
    }

    #[test]
    fn jumps_share_the_room_where_there_is_too_little() {
        let jumps: Vec<f64> = (1..=10).map(f64::from).collect();
        let z = test_depths([0.0, 11.0], &jumps, 60, 0.1);
        for jump in jumps {
            assert!(z.iter().any(|z| (z - jump).abs() <= 0.15 + 1e-12), "none near {jump}");
        }
        // Another range, other offsets.
        assert_ne!(z[..30], test_depths([0.0, 11.5], &[1.0], 60, 0.1)[..30]);
    }
}
