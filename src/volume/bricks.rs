//! Minimum and maximum over bricks of cells, for passing over empty space without loss.
//!
//! Cells are numbered `c = floor(p + 1)` along each axis for index positions `p` in `[-0.5, n - 0.5]`, so `c` is in
//! `0..=n`; cell `c` interpolates voxels `c - 1` and `c`, clamped to the grid. Brick `b` holds cells
//! `BRICK_CELLS * b ..= BRICK_CELLS * b + BRICK_CELLS - 1` and so voxels `BRICK_CELLS * b - 1 ..=
//! BRICK_CELLS * b + BRICK_CELLS - 1`: neighbouring bricks share the voxels that both interpolate, and every value
//! that occurs in a brick lies within its minimum and maximum.

use super::{Scaling, Volume, Voxel};
use crate::transfer::TransferFunction;
use crate::with_voxels;
use glam::DVec3;
use rayon::prelude::*;

/// Cells along each side of a brick.
pub const BRICK_CELLS: usize = 4;

/// Smallest and largest scaled value in every brick, x fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Bricks {
    /// Bricks along each axis: `ceil((n + 1) / BRICK_CELLS)`.
    pub counts: [usize; 3],
    pub min: Vec<f64>,
    pub max: Vec<f64>,
}

/// Which bricks a transfer function gives any extinction, and how far the next of them is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ActiveBricks {
    /// Bricks along each axis.
    pub counts: [usize; 3],
    /// Chebyshev distance in bricks to the nearest active brick, x fastest: 0 is active; 255 also stands for more.
    pub distance: Vec<u8>,
    /// Number of active bricks.
    pub active: usize,
    /// First and last brick (inclusive) of the smallest box around the active ones.
    pub bounds: Option<[[usize; 3]; 2]>,
}

/// Voxels that brick `b` of an axis with `n` voxels interpolates.
fn voxel_span(b: usize, n: usize) -> std::ops::Range<usize> {
    (BRICK_CELLS * b).saturating_sub(1).min(n - 1)..(BRICK_CELLS * (b + 1)).min(n)
}

impl Bricks {
    /// Brick counts for a grid.
    pub fn counts_for(dims: [usize; 3]) -> [usize; 3] {
        dims.map(|n| (n + 1).div_ceil(BRICK_CELLS))
    }

    /// Finds every brick's range; stored types are compared and only the results scaled.
    pub fn build(volume: &Volume) -> Self {
        let dims = volume.dims();
        with_voxels!(volume.voxels(), a => build(a.as_slice().unwrap_or_default(), dims, volume.scaling()))
    }

    /// Number of bricks.
    pub fn len(&self) -> usize {
        self.min.len()
    }

    /// Whether there are none (there is always one in a volume's bricks).
    pub fn is_empty(&self) -> bool {
        self.min.is_empty()
    }

    /// Whether some brick's values reach into `[low, high]`.
    pub fn have_values(&self, low: f64, high: f64) -> bool {
        self.min.iter().zip(&self.max).any(|(&min, &max)| min <= high && max >= low)
    }

    /// Finds the bricks with extinction anywhere in their range.
    pub fn classify(&self, tf: &TransferFunction) -> ActiveBricks {
        self.classify_blurred(tf, 0.0)
    }

    /// As [`Self::classify`], for a renderer whose tables blur the function by `blur` value units: gaps between values
    /// with extinction shrink by it on both sides. Outside of the first and the last such value nothing is blurred.
    pub fn classify_blurred(&self, tf: &TransferFunction, blur: f64) -> ActiveBricks {
        let mut intervals = extinction_intervals(tf);
        for gap in 1..intervals.len() {
            intervals[gap - 1][1] += blur;
            intervals[gap][0] -= blur;
        }
        let distance: Vec<u8> = self
            .min
            .par_iter()
            .zip(&self.max)
            .with_min_len(1 << 12)
            .map(|(&min, &max)| {
                // The first interval that does not lie wholly below the brick decides.
                let next = intervals.partition_point(|[_, hi]| *hi < min);
                let active = intervals.get(next).is_some_and(|[lo, _]| *lo <= max);
                if active { 0 } else { u8::MAX }
            })
            .collect();
        ActiveBricks::from_seeds(self.counts, distance)
    }
}

fn build<T: Voxel>(values: &[T], dims: [usize; 3], scaling: Scaling) -> Bricks {
    let counts = Bricks::counts_for(dims);
    let [nx, ny, nz] = dims;
    let mut min = vec![0.0; counts.iter().product()];
    let mut max = min.clone();
    min.par_chunks_mut(counts[0]).zip(max.par_chunks_mut(counts[0])).enumerate().for_each_init(
        // One row of voxels: the range over the brick row's y and z, still apart in x.
        || (Vec::with_capacity(nx), Vec::with_capacity(nx)),
        |(low, high), (row, (min, max))| {
            let (by, bz) = (row % counts[1], row / counts[1]);
            let mut first = true;
            for z in voxel_span(bz, nz) {
                for y in voxel_span(by, ny) {
                    let line = &values[(z * ny + y) * nx..][..nx];
                    if first {
                        low.clear();
                        low.extend_from_slice(line);
                        high.clear();
                        high.extend_from_slice(line);
                        first = false;
                    } else {
                        for ((lo, hi), &v) in low.iter_mut().zip(high.iter_mut()).zip(line) {
                            *lo = if v < *lo { v } else { *lo };
                            *hi = if v > *hi { v } else { *hi };
                        }
                    }
                }
            }
            for (bx, (min, max)) in min.iter_mut().zip(max).enumerate() {
                let span = voxel_span(bx, nx);
                let lo = low[span.clone()].iter().fold(low[span.start], |a, &v| if v < a { v } else { a });
                let hi = high[span.clone()].iter().fold(high[span.start], |a, &v| if v > a { v } else { a });
                let [a, b] = [lo, hi].map(|v| scaling.apply(v.to_f64()));
                (*min, *max) = (a.min(b), a.max(b));
            }
        },
    );
    Bricks { counts, min, max }
}

/// The values with extinction above 0, as disjoint closed intervals of `f64` in rising order; outer ends may be
/// infinite. The value of a point with extinction belongs to them even where a jump leaves it.
pub fn extinction_intervals(tf: &TransferFunction) -> Vec<[f64; 2]> {
    let points = &tf.points;
    let mut intervals: Vec<[f64; 2]> = Vec::new();
    let mut add = |lo: f64, hi: f64| match intervals.last_mut() {
        _ if lo > hi => {}
        Some(last) if lo <= last[1].next_up() => last[1] = last[1].max(hi),
        _ => intervals.push([lo, hi]),
    };
    if let Some(first) = points.first().filter(|p| p.amount > 0.0) {
        add(f64::NEG_INFINITY, first.value);
    }
    for (i, a) in points.iter().enumerate() {
        if a.amount > 0.0 {
            add(a.value, a.value);
        }
        if let Some(b) = points.get(i + 1).filter(|b| a.amount > 0.0 || b.amount > 0.0) {
            // Open: where an end has extinction itself, its own point adds it.
            add(a.value.next_up(), b.value.next_down());
        }
    }
    if let Some(last) = points.last().filter(|p| p.amount > 0.0) {
        add(last.value, f64::INFINITY);
    }
    intervals
}

impl ActiveBricks {
    /// From 0 for every active and 255 for every other brick.
    fn from_seeds(counts: [usize; 3], mut distance: Vec<u8>) -> Self {
        let (active, bounds) = count_and_bounds(counts, &distance);
        // With none or all active the distances already stand.
        if active > 0 && active < distance.len() {
            chebyshev(counts, &mut distance);
        }
        Self { counts, distance, active, bounds }
    }

    /// The active bricks' box in index coordinates of a grid of `dims` voxels, cut to its domain `[-0.5, n - 0.5]`.
    pub fn index_box(&self, dims: [usize; 3]) -> Option<[DVec3; 2]> {
        let [first, last] = self.bounds?;
        let corner = |b: [usize; 3], ends: usize| {
            // Cell c spans [c - 1, c].
            DVec3::from_array(std::array::from_fn(|axis| {
                let p = (BRICK_CELLS * (b[axis] + ends)) as f64 - 1.0;
                p.clamp(-0.5, dims[axis] as f64 - 0.5)
            }))
        };
        Some([corner(first, 0), corner(last, 1)])
    }
}

fn count_and_bounds(counts: [usize; 3], distance: &[u8]) -> (usize, Option<[[usize; 3]; 2]>) {
    let mut active = 0;
    let (mut first, mut last) = ([usize::MAX; 3], [0; 3]);
    for (row, line) in distance.chunks_exact(counts[0]).enumerate() {
        let in_row = line.iter().filter(|d| **d == 0).count();
        let ends = line.iter().position(|d| *d == 0).zip(line.iter().rposition(|d| *d == 0));
        if let Some((x0, x1)) = ends {
            active += in_row;
            let (y, z) = (row % counts[1], row / counts[1]);
            for (axis, (a, b)) in [(x0, x1), (y, y), (z, z)].into_iter().enumerate() {
                first[axis] = first[axis].min(a);
                last[axis] = last[axis].max(b);
            }
        }
    }
    (active, (active > 0).then_some([first, last]))
}

/// Chebyshev distance transform in place, from 0 for seeds and 255 elsewhere; exact up to 255.
///
/// Along x two sweeps count steps; along y and then z, `d(i) = min over i' of max(|i - i'|, d'(i'))`, because the
/// largest of the three axes' distances is what counts. Whole rows are compared at once, which vectorises.
fn chebyshev([nx, ny, nz]: [usize; 3], distance: &mut [u8]) {
    distance.par_chunks_mut(nx).with_min_len(64).for_each(|row| {
        let step = |before: &mut u8, d: &mut u8| {
            *d = (*d).min(before.saturating_add(1));
            *before = *d;
        };
        row.iter_mut().fold(u8::MAX, |mut before, d| {
            step(&mut before, d);
            before
        });
        row.iter_mut().rev().fold(u8::MAX, |mut before, d| {
            step(&mut before, d);
            before
        });
    });
    // Rows of one xy plane are nx apart, those of one xz plane nx * ny.
    for (stride, n) in [(nx, ny), (nx * ny, nz)] {
        let before = distance.to_vec();
        distance.par_chunks_mut(nx).enumerate().with_min_len(16).for_each(|(row, out)| {
            let start = row * nx;
            let i = start / stride % n;
            for r in 1..n.min(usize::from(u8::MAX)) {
                let mut merge = |from: usize| {
                    for (d, &g) in out.iter_mut().zip(&before[from..from + nx]) {
                        *d = (*d).min(g.max(r as u8));
                    }
                };
                if i >= r {
                    merge(start - r * stride);
                }
                if i + r < n {
                    merge(start + r * stride);
                }
                // Nothing further away can be nearer than what every brick of the row has.
                if out.iter().all(|&d| usize::from(d) <= r) {
                    break;
                }
            }
        });
    }
}
