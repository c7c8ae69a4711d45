//! Joint histogram of values and gradient magnitudes.

use super::{Volume, Voxel, VoxelBlock};
use crate::with_voxels;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// Bins of gradient magnitudes that find the top of the histogram.
const FINE_BINS: usize = 4096;
/// Share of the cells whose gradient magnitudes the histogram covers.
const COVERED: f64 = 0.999;

/// Joint histogram of the value and the gradient magnitude of the interpolated field, at the centres of its cells.
#[derive(Debug, Clone, PartialEq)]
pub struct JointHistogram {
    /// Start of the first column of values and end of the last.
    pub values: [f64; 2],
    /// Gradient magnitude at the end of the last row, value units per mm. A thousandth of the cells may be above it.
    /// The first row starts at 0.
    pub top_gradient: f64,
    /// Numbers of columns and rows.
    pub bins: [usize; 2],
    /// Number of cells in each bin, row by row.
    pub counts: Vec<u64>,
}

impl JointHistogram {
    /// Computes the joint histogram of a volume with the given numbers of columns and rows, at least 1 each. Returns
    /// `None` when `goes_on` returns false, or if voxels that are read in parts cannot be read.
    pub fn of(volume: &Volume, bins: [usize; 2], goes_on: &(dyn Fn() -> bool + Sync)) -> Option<Self> {
        let values = volume.value_range();
        let [columns, rows] = bins.map(|n| n.max(1));
        let largest = slabs(volume, goes_on, || 0.0_f64, |most, [_, g]| *most = most.max(g), f64::max)?;
        let empty = || vec![0_u64; FINE_BINS];
        let fine =
            slabs(volume, goes_on, empty, |counts, [_, g]| counts[place(g, largest, FINE_BINS)] += 1, sum)?;
        let top_gradient = largest * covered_bins(&fine) as f64 / FINE_BINS as f64;
        let add = |counts: &mut Vec<u64>, [value, gradient]: [f64; 2]| {
            if gradient <= top_gradient {
                let column = place(value - values[0], values[1] - values[0], columns);
                counts[place(gradient, top_gradient, rows) * columns + column] += 1;
            }
        };
        let counts = slabs(volume, goes_on, || vec![0_u64; columns * rows], add, sum)?;
        Some(Self { values, top_gradient, bins: [columns, rows], counts })
    }
}

fn sum(mut a: Vec<u64>, b: Vec<u64>) -> Vec<u64> {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
    a
}

/// Returns the index of the bin of equal width that has `x`, from 0 to `range`.
fn place(x: f64, range: f64, bins: usize) -> usize {
    if range > 0.0 { ((x / range * bins as f64) as usize).min(bins - 1) } else { 0 }
}

/// Returns the number of lowest bins that have the share [`COVERED`] of all cells; at least 1.
fn covered_bins(counts: &[u64]) -> usize {
    let needed = COVERED * counts.iter().sum::<u64>() as f64;
    let mut below = 0;
    let is_needed = |count: &&u64| {
        let is_needed = (below as f64) < needed;
        below += **count;
        is_needed
    };
    counts.iter().take_while(is_needed).count().max(1)
}

/// Folds value and gradient magnitude (value units per mm) at the centres of all cells, in parallel by slabs of cells.
/// Gradients beyond float64 are left out.
fn slabs<T: Send>(
    volume: &Volume,
    goes_on: &(dyn Fn() -> bool + Sync),
    empty: impl Fn() -> T + Sync,
    add: impl Fn(&mut T, [f64; 2]) + Sync,
    join: impl Fn(T, T) -> T + Sync,
) -> Option<T> {
    let mut all = empty();
    for slab in volume.slabs(1, 1) {
        let (slices, block) = slab.ok().filter(|_| goes_on())?;
        // Cells lie between two slices: those above the last slice of a slab are left to the next slab.
        let cells = slices.start.saturating_sub(1)..slices.end - 1;
        all = join(all, of_block(volume, &block, cells, goes_on, &empty, &add, &join));
    }
    goes_on().then_some(all)
}

/// Folds value and gradient magnitude at the centres of the cells of a block above some slices.
fn of_block<T: Send>(
    volume: &Volume,
    block: &VoxelBlock<'_>,
    slices: Range<usize>,
    goes_on: &(dyn Fn() -> bool + Sync),
    empty: &(impl Fn() -> T + Sync),
    add: &(impl Fn(&mut T, [f64; 2]) + Sync),
    join: &(impl Fn(T, T) -> T + Sync),
) -> T {
    let [nx, ny, _] = volume.dims();
    let scaling = volume.scaling();
    // Columns are the gradients in world space of the indices i, j and k.
    let gradients = volume.index_from_world().matrix3.transpose();
    let cells = |n: usize| n.saturating_sub(1);
    with_voxels!(block.voxels(), array => {
        let stored = array.as_slice().unwrap_or_default();
        let sum = |x: usize, y: usize, z: usize, steps: [usize; 4]| {
            let first = block.place([x, y, z]);
            steps.iter().map(|step| stored[first + step].to_f64()).sum::<f64>()
        };
        let (i, j, k) = (1, nx, nx * ny);
        let cell = |x: usize, y: usize, z: usize| {
            let low = sum(x, y, z, [0, i, j, i + j]);
            let high = sum(x, y, z, [k, k + i, k + j, k + i + j]);
            let across = |step: usize, others: [usize; 4]| {
                0.25 * (sum(x, y, z, others.map(|o| o + step)) - sum(x, y, z, others))
            };
            let by_index = DVec3::new(across(i, [0, j, k, j + k]), across(j, [0, i, k, i + k]), 0.25 * (high - low));
            let gradient = (gradients * by_index).length() * scaling.slope.abs();
            [scaling.apply(0.125 * (low + high)), gradient]
        };
        slices
            .into_par_iter()
            .fold(empty, |mut all, z| {
                if goes_on() {
                    for y in 0..cells(ny) {
                        let finite = (0..cells(nx)).map(|x| cell(x, y, z)).filter(|[_, g]| g.is_finite());
                        finite.for_each(|cell| add(&mut all, cell));
                    }
                }
                all
            })
            .reduce(empty, join)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;
    use crate::volume::{Provenance, Scaling};
    use glam::DAffine3;
    use ndarray::Array3;

    fn volume(voxels: Array3<f32>, affine: DAffine3) -> Volume {
        let provenance = Provenance::new("test", "formula", "float32");
        Volume::new(voxels.into(), Scaling::IDENTITY, affine, provenance).unwrap()
    }

    fn always() -> bool {
        true
    }

    #[test]
    fn a_linear_field_has_one_gradient() {
        // Value 2 i + 3 j + 6 k, with spacings of 1, 1 and 2 mm: gradient (2, 3, 3) per mm.
        let voxels = Array3::from_shape_fn((5, 6, 7), |(k, j, i)| (2 * i + 3 * j + 6 * k) as f32);
        let affine = DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0));
        let volume = volume(voxels, affine);
        let joint = JointHistogram::of(&volume, [4, 3], &always).unwrap();
        assert!((joint.top_gradient - 22_f64.sqrt()).abs() < 1e-12, "{}", joint.top_gradient);
        assert_eq!(joint.counts.iter().sum::<u64>(), 4 * 5 * 6);
        let upper: u64 = joint.counts[8..].iter().sum();
        assert_eq!(upper, 4 * 5 * 6, "all cells are in the last row: {:?}", joint.counts);
        assert_eq!(joint.values, volume.value_range());
    }

    #[test]
    fn a_step_has_two_values_without_gradient_and_one_between_them() {
        let voxels = Array3::from_shape_fn((16, 16, 16), |(_, _, i)| if i < 8 { 0.0 } else { 100.0 });
        let joint = JointHistogram::of(&volume(voxels, DAffine3::IDENTITY), [3, 2], &always).unwrap();
        let layer = 15 * 15;
        assert_eq!(joint.counts, [7 * layer, 0, 7 * layer, 0, layer, 0]);
        assert_eq!((joint.top_gradient, joint.values), (100.0, [0.0, 100.0]));
    }

    #[test]
    fn nearly_all_cells_of_a_phantom_are_counted() {
        let volume = Phantom::Thorax.build(24).unwrap();
        let joint = JointHistogram::of(&volume, [16, 12], &always).unwrap();
        let cells: usize = volume.dims().iter().map(|n| n - 1).product();
        let counted = joint.counts.iter().sum::<u64>() as f64;
        assert!(counted >= COVERED * cells as f64 && counted <= cells as f64, "{counted} of {cells}");
    }

    #[test]
    fn flat_volumes_have_no_cells_and_counting_can_be_cancelled() {
        let flat = volume(Array3::zeros((1, 4, 4)), DAffine3::IDENTITY);
        let joint = JointHistogram::of(&flat, [4, 4], &always).unwrap();
        assert_eq!((joint.counts.iter().sum::<u64>(), joint.top_gradient >= 0.0), (0, true));
        assert_eq!(JointHistogram::of(&Phantom::Thorax.build(8).unwrap(), [4, 4], &|| false), None);
    }
}
