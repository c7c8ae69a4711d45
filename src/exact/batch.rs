//! Order of many rays through a volume that is read in parts. Rays that meet the same chunks follow each other, so that
//! most of them find their chunks in memory.

use super::ExactField;
use crate::volume::{CHUNK_CELLS, VoxelStorage};
use glam::DVec3;
use rayon::prelude::*;

impl ExactField<'_> {
    /// Computes `value` for each of `count` rays in parallel, and returns the results in the order of the rays. `ray`
    /// returns the origin (world mm), the unit direction and the length (mm) of a ray.
    pub(super) fn of_rays<T: Send>(
        &self,
        count: usize,
        ray: impl Fn(usize) -> (DVec3, DVec3, f64) + Sync,
        value: impl Fn(usize) -> T + Sync,
    ) -> Vec<T> {
        let numbers = 0..count;
        if let VoxelStorage::Resident(_) = self.volume.storage() {
            return numbers.into_par_iter().map(&value).collect();
        }
        let key = |number: usize| {
            let (origin, direction, length_mm) = ray(number);
            let ray = self.ray(origin, direction, length_mm);
            ray.map(|ray| [ray.exit_mm, ray.enter_mm].map(|mm| chunk_code(ray.at(mm))))
        };
        let mut order: Vec<usize> = numbers.collect();
        order.par_sort_by_cached_key(|number| key(*number));
        let mut found: Vec<(usize, T)> =
            order.into_par_iter().map(|number| (number, value(number))).collect();
        found.par_sort_unstable_by_key(|(number, _)| *number);
        found.into_iter().map(|(_, value)| value).collect()
    }
}

/// Returns the Morton code of the chunk with a point (voxel index coordinates): neighbours have similar codes.
fn chunk_code(index: [f64; 3]) -> u64 {
    let bits = |axis: usize| {
        let chunk = (index[axis].max(0.0) as u64) / CHUNK_CELLS as u64;
        (0..u64::BITS / 3).map(move |bit| (chunk >> bit & 1) << (3 * bit + axis as u32))
    };
    (0..3).flat_map(bits).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_interleave_the_bits_of_chunks() {
        let side = CHUNK_CELLS as f64;
        let code = |x: f64, y: f64, z: f64| chunk_code([x * side, y * side, z * side]);
        assert_eq!([code(-1.0, 0.9, 0.0), code(1.0, 0.0, 0.0), code(0.0, 1.5, 0.0)], [0, 1, 2]);
        assert_eq!([code(0.0, 0.0, 1.0), code(3.0, 3.0, 3.0), code(4.0, 0.0, 0.0)], [4, 63, 64]);
    }
}
