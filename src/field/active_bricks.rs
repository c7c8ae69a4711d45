//! Active bricks: blocks of voxel cells with nonzero extinction under a transfer function. The distance of every
//! brick to the nearest active one lets rays skip empty space without loss.

use super::brick_distances::{Extent, distances_along_row, spread_across_rows};
use super::brick_runs::{BrickHull, BrickRun, brick_box};
use crate::transfer::{LabelClass, TransferFunction};
use crate::volume::{BRICK_CELLS, BrickLabels, Bricks, RankSet};
use glam::{DAffine3, DVec3, IVec3};
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

/// Bricks without extinction, told apart by where their values lie: between which intervals with extinction.
pub(super) struct EmptyBricks<'a> {
    bricks: &'a Bricks,
    /// Segmentation labels of the bricks, if they have transfer functions of their own.
    pub labels: Option<&'a BrickLabels>,
    active: &'a ActiveBricks,
    classes: Vec<(RankSet, Vec<[f64; 2]>)>,
    planes: Vec<(DVec3, f64)>,
}

impl<'a> EmptyBricks<'a> {
    /// Takes the active bricks of a volume under a transfer function, which were found with the same `blur`.
    pub fn of(bricks: &'a Bricks, active: &'a ActiveBricks, tf: &TransferFunction, blur: f64) -> Self {
        let classes = intervals_of_labels(bricks, tf, blur);
        let labels = bricks.labels.as_ref().filter(|_| !tf.rules.is_empty());
        Self { bricks, labels, active, classes, planes: planes_over_bricks(bricks, tf) }
    }

    /// Returns the number of intervals below the values of a brick, and its smallest value, if the brick is empty and not
    /// behind a clip plane. Values between two intervals have no extinction for the label with this index.
    pub fn gap(&self, brick: usize, rank: usize) -> Option<(usize, f64)> {
        let is_empty =
            self.active.distance[brick] > 0 && !is_clipped(brick, self.bricks.counts, &self.planes);
        let [value, _] = self.bricks.range(brick);
        let own = self.classes.iter().find(|(ranks, _)| self.labels.is_none() || ranks.has(rank));
        let below = |(_, intervals): &(_, Vec<[f64; 2]>)| intervals.partition_point(|[_, hi]| *hi < value);
        is_empty.then(|| (own.map_or(0, below), value))
    }
}

/// Smallest number of rows of bricks (blocks of voxel cells) in one parallel task.
const LEAST_ROWS: usize = 64;

/// Whether the range of values of a brick (block of voxel cells) overlaps one of the disjoint, rising intervals.
fn overlaps(intervals: &[[f64; 2]], min: f64, max: f64) -> bool {
    // Only the first interval that does not lie below the brick can overlap it.
    let next = intervals.partition_point(|[_, hi]| *hi < min);
    intervals.get(next).is_some_and(|[lo, _]| *lo <= max)
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
        let [nx, ..] = bricks.counts;
        let mut distance = vec![u8::MAX; bricks.len()];
        let rows = distance.par_chunks_exact_mut(nx).with_min_len(LEAST_ROWS).enumerate();
        let parts = rows.map(|(row, line)| {
            let first = row * nx;
            for (ranks, intervals) in &classes {
                let mut places = line.iter_mut().enumerate();
                bricks.for_ranges(first..first + nx, |[min, max]| {
                    let Some((x, distance)) = places.next() else { return };
                    let occurs = || bricks.labels.as_ref().is_none_or(|l| l.sets[first + x].meets(ranks));
                    if overlaps(intervals, min, max) && occurs() {
                        *distance = 0;
                    }
                });
            }
            if !planes.is_empty() {
                let kept = |x: usize| !is_clipped(first + x, bricks.counts, &planes);
                line.iter_mut().enumerate().filter(|(x, _)| !kept(*x)).for_each(|(_, d)| *d = u8::MAX);
            }
            let extent = Extent::of_row(bricks.counts, row, line);
            distances_along_row(line);
            extent
        });
        let Extent { active, bounds } = parts.reduce(Extent::default, Extent::with);
        // With no or only active bricks, these are the distances.
        if active > 0 && active < distance.len() {
            spread_across_rows(bricks.counts, &mut distance);
        }
        Self {
            counts: bricks.counts,
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
            let row_at = |row: usize| &self.distance[row * nx..][..nx];
            let outer_of = |(row, line): (usize, &[u8])| {
                let (y, z) = (row % ny, row / ny);
                let edge = y == 0 || z == 0 || y + 1 == ny || z + 1 == nz;
                let beside =
                    if edge { [line; 4] } else { [row - 1, row + 1, row - ny, row + ny].map(row_at) };
                let bare = |x: &usize| {
                    let ends = edge || *x == 0 || x + 1 == nx;
                    ends || line[x - 1] | line[x + 1] != 0 || beside.iter().any(|row| row[*x] != 0)
                };
                let outer = (0..nx).filter(|x| line[*x] == 0).filter(bare);
                outer.map(|x| IVec3::new(x as i32, y as i32, z as i32)).collect::<Vec<_>>()
            };
            self.distance
                .par_chunks_exact(nx)
                .enumerate()
                .with_min_len(LEAST_ROWS)
                .flat_map_iter(outer_of)
                .collect()
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
            self.distance
                .par_chunks_exact(nx)
                .enumerate()
                .with_min_len(LEAST_ROWS)
                .flat_map_iter(runs_of)
                .collect()
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
