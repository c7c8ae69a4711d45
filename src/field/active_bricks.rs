//! Active bricks: blocks of voxel cells with nonzero extinction under a transfer function. The distance of every
//! brick to the nearest active one lets rays skip empty space without loss.

use super::brick_runs::{BrickHull, BrickRun, brick_box};
use crate::transfer::{LabelClass, TransferFunction};
use crate::volume::{BRICK_CELLS, Bricks, RankSet};
use glam::{DAffine3, DVec3, IVec3, USizeVec3};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Active bricks of a volume (blocks of voxel cells with extinction under a transfer function), and the distance of
/// every brick to them.
#[derive(Debug, Clone)]
pub struct ActiveBricks {
    /// Number of bricks (blocks of voxel cells) along each axis of the volume.
    pub counts: [usize; 3],
    /// Chebyshev distance of each brick to the nearest active brick (block of cells with extinction), in bricks, x
    /// fastest. An active brick has 0; 255 means 255 or more.
    pub distance: Vec<u8>,
    /// Number of active bricks: blocks of voxel cells with extinction under the transfer function.
    pub active: usize,
    /// Grid positions of the first and last brick (inclusive) in the bounding box of all active bricks; `None` if no
    /// brick is active.
    pub bounds: Option<[[usize; 3]; 2]>,
    outer: OnceLock<Vec<IVec3>>,
    runs: OnceLock<Vec<BrickRun>>,
    hull: OnceLock<Option<BrickHull>>,
}

/// Returns the intervals of voxel values to which a transfer function gives extinction. The intervals are closed,
/// disjoint and in rising order; the outermost ends may be infinite. Where extinction jumps to 0 at a control point,
/// the interval includes the point.
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
            // Open interval: a point with extinction adds its own value.
            add(a.value.next_up(), b.value.next_down());
        }
    }
    if let Some(last) = points.last().filter(|p| p.amount > 0.0) {
        add(last.value, f64::INFINITY);
    }
    intervals
}

/// Distance by which a brick (block of voxel cells) must lie beyond a clip plane to count as clipped, in brick
/// widths. It exceeds the float32 error of clip planes.
const CLIP_MARGIN: f64 = 0.01;

/// Returns the clip planes of a transfer function as normals and offsets in brick coordinates, where each brick
/// (block of voxel cells) is a unit cube.
fn planes_over_bricks(bricks: &Bricks, tf: &TransferFunction) -> Vec<(DVec3, f64)> {
    // Cell c begins at index c - 1.
    let world_from_bricks = bricks.world_from_index
        * DAffine3::from_translation(DVec3::NEG_ONE)
        * DAffine3::from_scale(DVec3::splat(BRICK_CELLS as f64));
    tf.clip.iter().map(|plane| plane.in_coordinates(world_from_bricks)).collect()
}

/// Whether a clip plane removes a whole brick (block of voxel cells) of the volume.
fn is_clipped(brick: usize, [nx, ny, _]: [usize; 3], planes: &[(DVec3, f64)]) -> bool {
    let low = DVec3::new((brick % nx) as f64, (brick / nx % ny) as f64, (brick / (nx * ny)) as f64);
    planes.iter().any(|&(normal, offset)| {
        // Corner farthest along the normal.
        let farthest = low + DVec3::select(normal.cmpgt(DVec3::ZERO), DVec3::ONE, DVec3::ZERO);
        normal.dot(farthest) + CLIP_MARGIN * normal.abs().element_sum() < offset
    })
}

/// Returns, for each transfer function in use, the segmentation labels that use it and its intervals of voxel values
/// with extinction. Each interval grows by `blur` into the gap between it and the next one.
fn intervals_of_labels(bricks: &Bricks, tf: &TransferFunction, blur: f64) -> Vec<(RankSet, Vec<[f64; 2]>)> {
    let is_one_of_several = bricks.labels.is_some() && !tf.rules.is_empty();
    let blurred = |tf: &TransferFunction| {
        let mut intervals = extinction_intervals(tf);
        for gap in 1..intervals.len() {
            intervals[gap - 1][1] += blur;
            intervals[gap][0] -= blur;
        }
        // In a table of several functions, the ends of a function are gaps too.
        if is_one_of_several {
            intervals.first_mut().into_iter().for_each(|first| first[0] -= blur);
            intervals.last_mut().into_iter().for_each(|last| last[1] += blur);
        }
        intervals
    };
    let ids = bricks.labels.as_ref().map_or(&[][..], |labels| &labels.ids);
    let labels_of = |function: usize| {
        let mut ranks = RankSet::default();
        let labels =
            ids.iter().enumerate().filter(|(_, id)| tf.class_of(**id) == LabelClass::Function(function));
        labels.for_each(|(rank, _)| ranks.insert(rank));
        ranks
    };
    // Without labels, all voxels use the function itself.
    let used = if bricks.labels.is_some() { tf.functions().collect() } else { vec![tf] };
    used.into_iter().enumerate().map(|(i, tf)| (labels_of(i), blurred(tf))).collect()
}

impl ActiveBricks {
    /// Finds the active bricks of a volume: blocks of cells whose range of voxel values has extinction under a
    /// transfer function.
    pub fn of(bricks: &Bricks, tf: &TransferFunction) -> Self {
        Self::blurred(bricks, tf, 0.0)
    }

    /// Finds the active bricks of a volume, like [`Self::of`]. Each interval of voxel values with extinction grows by
    /// `blur` towards its neighbours, since lookup tables blur the transfer function by one bin. The outermost ends
    /// grow only if labels use several transfer functions.
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
                // Only the first interval that does not lie below the brick can overlap it.
                let next = intervals.partition_point(|[_, hi]| *hi < min);
                occurs && intervals.get(next).is_some_and(|[lo, _]| *lo <= max)
            })
        };
        let distance = (0..bricks.len()).into_par_iter().with_min_len(1 << 12);
        let distance = distance.map(|brick| if is_active(brick) { 0 } else { u8::MAX }).collect();
        Self::from_seeds(bricks.counts, distance)
    }

    /// Computes the distances of all bricks to the nearest active brick (block of cells with extinction). `distance`
    /// holds 0 for active bricks and 255 for others.
    fn from_seeds(counts: [usize; 3], mut distance: Vec<u8>) -> Self {
        let (active, bounds) = count_and_bounds(counts, &distance);
        // With no or only active bricks, these are the distances.
        if active > 0 && active < distance.len() {
            chebyshev(counts, &mut distance);
        }
        Self {
            counts,
            distance,
            active,
            bounds,
            outer: OnceLock::new(),
            runs: OnceLock::new(),
            hull: OnceLock::new(),
        }
    }

    /// Returns the distance from a brick to the nearest active brick (block of cells with extinction), in bricks;
    /// `None` outside the volume.
    pub fn distance_at(&self, brick: IVec3) -> Option<u8> {
        let counts = IVec3::from_array(self.counts.map(|n| n as i32));
        let there = brick.cmpge(IVec3::ZERO).all() && brick.cmplt(counts).all();
        there.then(|| self.distance[((brick.z * counts.y + brick.y) * counts.x + brick.x) as usize])
    }

    /// Returns the active bricks (blocks of cells with extinction) on the surface: a neighbour across a face is
    /// empty, or the brick lies at the border of the volume.
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

    /// Returns the active bricks (blocks of cells with extinction) as runs along x, in row-major order.
    pub fn runs(&self) -> &[BrickRun] {
        self.runs.get_or_init(|| {
            let [nx, ny, _] = self.counts;
            let runs_of = |(row, line): (usize, &[u8])| {
                let (y, z) = ((row % ny) as u32, (row / ny) as u32);
                let mut end = 0;
                let mut runs = Vec::new();
                for part in line.chunk_by(|a, b| (*a == 0) == (*b == 0)) {
                    let first = end;
                    end += part.len() as u32;
                    if part[0] == 0 {
                        runs.push(BrickRun { x: [first, end - 1], y, z });
                    }
                }
                runs
            };
            self.distance.par_chunks_exact(nx).enumerate().flat_map_iter(runs_of).collect()
        })
    }

    /// Returns the convex hull of the active bricks (blocks of cells with extinction) in a volume of `dims` voxels;
    /// `None` if no brick is active.
    pub fn hull(&self, dims: [usize; 3]) -> Option<&BrickHull> {
        self.hull.get_or_init(|| BrickHull::of(self.runs(), dims)).as_ref()
    }

    /// Returns the bounding box of the active bricks (blocks of cells with extinction) in voxel index coordinates. It
    /// is clipped to the domain `[-0.5, n - 0.5]` of a volume of `dims` voxels.
    pub fn index_box(&self, dims: [usize; 3]) -> Option<[DVec3; 2]> {
        let [first, last] = self.bounds?;
        // Grid space is index space plus one.
        Some(brick_box(first, last, dims).map(|p| p - 1.0))
    }
}

fn count_and_bounds([nx, ny, _]: [usize; 3], distance: &[u8]) -> (usize, Option<[[usize; 3]; 2]>) {
    let (mut active, mut first, mut last) = (0, USizeVec3::MAX, USizeVec3::ZERO);
    let is_active = |d: &u8| *d == 0;
    for (row, line) in distance.chunks_exact(nx).enumerate() {
        let ends = line.iter().position(is_active).zip(line.iter().rposition(is_active));
        if let Some((x0, x1)) = ends {
            active += line[x0..=x1].iter().filter(|d| is_active(d)).count();
            let (y, z) = (row % ny, row / ny);
            first = first.min(USizeVec3::new(x0, y, z));
            last = last.max(USizeVec3::new(x1, y, z));
        }
    }
    (active, (active > 0).then(|| [first, last].map(|at| at.to_array())))
}

/// Computes a Chebyshev distance transform of the bricks in place. Active bricks start with 0 and all others with
/// 255; distances are exact up to 255.
///
/// Two sweeps over rows, one from each end (Rosenfeld and Pfaltz 1966): the distance of a brick is one more than the
/// least of its 26 neighbours, and each sweep visits half of them before the brick.
fn chebyshev([nx, ny, nz]: [usize; 3], distance: &mut [u8]) {
    let rows = ny * nz;
    // Least distance of neighbouring rows, with one more brick at both ends.
    let mut nearest = vec![u8::MAX; nx + 2];
    for forward in [true, false] {
        for i in 0..rows {
            let row = if forward { i } else { rows - 1 - i };
            let (y, z) = (row % ny, row / ny);
            // Position counted from the end at which the sweep starts.
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
