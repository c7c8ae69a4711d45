//! Which bricks have extinction under a transfer function, and how far every brick is from the next of them: what
//! rays leap over without loss.

use crate::transfer::{LabelClass, TransferFunction};
use crate::volume::{BRICK_CELLS, Bricks, RankSet};
use glam::{DAffine3, DVec3, IVec3};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Which bricks a transfer function gives any extinction, and how far the next of them is.
#[derive(Debug, Clone)]
pub struct ActiveBricks {
    /// Bricks along each axis.
    pub counts: [usize; 3],
    /// Chebyshev distance in bricks to the nearest active brick, x fastest: 0 is active; 255 also stands for more.
    pub distance: Vec<u8>,
    /// Number of active bricks.
    pub active: usize,
    /// First and last brick (inclusive) of the smallest box around the active ones.
    pub bounds: Option<[[usize; 3]; 2]>,
    /// See [`Self::outer`].
    outer: OnceLock<Vec<IVec3>>,
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

/// How far outside of a plane a brick must lie, in bricks, before it counts as clipped: more than float32 makes of planes.
const CLIP_ROOM: f64 = 0.01;

/// The function's clip planes as normals and offsets in brick coordinates, in which a brick is a unit cube.
fn planes_over_bricks(bricks: &Bricks, tf: &TransferFunction) -> Vec<(DVec3, f64)> {
    // Cell c begins at index c - 1.
    let world_from_bricks = bricks.world_from_index
        * DAffine3::from_translation(DVec3::NEG_ONE)
        * DAffine3::from_scale(DVec3::splat(BRICK_CELLS as f64));
    tf.clip.iter().map(|plane| plane.in_coordinates(world_from_bricks)).collect()
}

/// Whether some plane keeps nothing of a brick.
fn is_clipped(brick: usize, [nx, ny, _]: [usize; 3], planes: &[(DVec3, f64)]) -> bool {
    let low = DVec3::new((brick % nx) as f64, (brick / nx % ny) as f64, (brick / (nx * ny)) as f64);
    planes.iter().any(|&(normal, offset)| {
        // The corner that lies farthest along the normal.
        let farthest = low + DVec3::select(normal.cmpgt(DVec3::ZERO), DVec3::ONE, DVec3::ZERO);
        normal.dot(farthest) + CLIP_ROOM * normal.abs().element_sum() < offset
    })
}

/// For each function of `tf` the labels that are seen through it, and the values at which it has extinction; gaps between
/// those are `blur` smaller on both sides.
fn intervals_of_labels(bricks: &Bricks, tf: &TransferFunction, blur: f64) -> Vec<(RankSet, Vec<[f64; 2]>)> {
    let is_one_of_several = bricks.labels.is_some() && !tf.rules.is_empty();
    let blurred = |tf: &TransferFunction| {
        let mut intervals = extinction_intervals(tf);
        for gap in 1..intervals.len() {
            intervals[gap - 1][1] += blur;
            intervals[gap][0] -= blur;
        }
        // Side by side in one table the ends of a function are gaps, too.
        if is_one_of_several {
            intervals.first_mut().into_iter().for_each(|first| first[0] -= blur);
            intervals.last_mut().into_iter().for_each(|last| last[1] += blur);
        }
        intervals
    };
    let ids = bricks.labels.as_ref().map_or(&[][..], |labels| &labels.ids);
    let seen_through = |function: usize| {
        let mut ranks = RankSet::default();
        let of_it =
            ids.iter().enumerate().filter(|(_, id)| tf.class_of(**id) == LabelClass::Function(function));
        of_it.for_each(|(rank, _)| ranks.insert(rank));
        ranks
    };
    // Without labels all voxels are seen through the function itself.
    let used = if bricks.labels.is_some() { tf.functions().collect() } else { vec![tf] };
    used.into_iter().enumerate().map(|(i, tf)| (seen_through(i), blurred(tf))).collect()
}

impl ActiveBricks {
    /// Finds the bricks with extinction anywhere in their range.
    pub fn of(bricks: &Bricks, tf: &TransferFunction) -> Self {
        Self::blurred(bricks, tf, 0.0)
    }

    /// As [`Self::of`], for a renderer whose tables blur the function by `blur` value units: gaps between values
    /// with extinction shrink by it on both sides. Outside of the first and the last such value nothing is blurred.
    pub fn blurred(bricks: &Bricks, tf: &TransferFunction, blur: f64) -> Self {
        let classes = intervals_of_labels(bricks, tf, blur);
        let planes = planes_over_bricks(bricks, tf);
        let is_active = |brick: usize| {
            if is_clipped(brick, bricks.counts, &planes) {
                return false;
            }
            let (min, max) = (bricks.min[brick], bricks.max[brick]);
            classes.iter().any(|(ranks, intervals)| {
                let occurs = bricks.labels.as_ref().is_none_or(|labels| labels.sets[brick].meets(ranks));
                // The first interval that does not lie wholly below the brick decides.
                let next = intervals.partition_point(|[_, hi]| *hi < min);
                occurs && intervals.get(next).is_some_and(|[lo, _]| *lo <= max)
            })
        };
        let distance = (0..bricks.len()).into_par_iter().with_min_len(1 << 12);
        let distance = distance.map(|brick| if is_active(brick) { 0 } else { u8::MAX }).collect();
        Self::from_seeds(bricks.counts, distance)
    }

    /// From 0 for every active and 255 for every other brick.
    fn from_seeds(counts: [usize; 3], mut distance: Vec<u8>) -> Self {
        let (active, bounds) = count_and_bounds(counts, &distance);
        // With none or all active the distances already stand.
        if active > 0 && active < distance.len() {
            chebyshev(counts, &mut distance);
        }
        Self { counts, distance, active, bounds, outer: OnceLock::new() }
    }

    /// [`Self::distance`] of a brick, where there is one.
    pub fn distance_at(&self, brick: IVec3) -> Option<u8> {
        let counts = IVec3::from_array(self.counts.map(|n| n as i32));
        let there = brick.cmpge(IVec3::ZERO).all() && brick.cmplt(counts).all();
        there.then(|| self.distance[((brick.z * counts.y + brick.y) * counts.x + brick.x) as usize])
    }

    /// The active bricks that have an inactive one, or nothing, beside one of their faces: what is seen of all active ones
    /// from outside of them.
    pub fn outer(&self) -> &[IVec3] {
        self.outer.get_or_init(|| {
            let [nx, ny, nz] = self.counts;
            let mut outer = Vec::new();
            for (row, line) in self.distance.chunks_exact(nx).enumerate() {
                let (y, z) = (row % ny, row / ny);
                let edge = y == 0 || z == 0 || y + 1 == ny || z + 1 == nz;
                for x in (0..nx).filter(|x| line[*x] == 0) {
                    let i = row * nx + x;
                    let beside = [1, nx, nx * ny];
                    let bare = |step: &usize| self.distance[i - step] != 0 || self.distance[i + step] != 0;
                    if edge || x == 0 || x + 1 == nx || beside.iter().any(bare) {
                        outer.push(IVec3::new(x as i32, y as i32, z as i32));
                    }
                }
            }
            outer
        })
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
/// Two sweeps over rows, one from each end (Rosenfeld and Pfaltz 1966): a brick is one further than the nearest of its 26
/// neighbours, of which each sweep knows the half that lies before it.
fn chebyshev([nx, ny, nz]: [usize; 3], distance: &mut [u8]) {
    let rows = ny * nz;
    // The nearest of neighbouring rows, with a brick more at both ends.
    let mut nearest = vec![u8::MAX; nx + 2];
    for forward in [true, false] {
        for turn in 0..rows {
            let row = if forward { turn } else { rows - 1 - turn };
            let (y, z) = (row % ny, row / ny);
            // Rows before this one, counted from the end that the sweep starts at.
            let (y, z) = if forward { (y, z) } else { (ny - 1 - y, nz - 1 - z) };
            let known = [
                (y > 0).then_some(1),
                (z > 0 && y + 1 < ny).then(|| ny - 1),
                (z > 0).then_some(ny),
                (z > 0 && y > 0).then(|| ny + 1),
            ];
            nearest[1..=nx].fill(u8::MAX);
            for back in known.into_iter().flatten() {
                let neighbour = if forward { row - back } else { row + back };
                let values = &distance[neighbour * nx..][..nx];
                nearest[1..=nx].iter_mut().zip(values).for_each(|(near, d)| *near = (*near).min(*d));
            }
            let own = &mut distance[row * nx..][..nx];
            for (d, near) in own.iter_mut().zip(nearest.windows(3)) {
                *d = (*d).min(near[0].min(near[1]).min(near[2]).saturating_add(1));
            }
            let mut before = u8::MAX;
            let mut step = |d: &mut u8| {
                *d = (*d).min(before.saturating_add(1));
                before = *d;
            };
            if forward {
                own.iter_mut().for_each(&mut step)
            } else {
                own.iter_mut().rev().for_each(&mut step)
            }
        }
    }
}
