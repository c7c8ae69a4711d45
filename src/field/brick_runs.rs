//! Runs of adjacent bricks along x, and the convex hull of bricks. With them the host visits few points of a volume when a
//! light or a camera moves, instead of every brick.

use crate::volume::BRICK_CELLS;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Run of adjacent bricks (blocks of voxel cells) along x.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BrickRun {
    /// Grid positions of the first and the last brick of the run along x (inclusive).
    pub x: [u32; 2],
    /// Grid position of the run of bricks along y.
    pub y: u32,
    /// Grid position of the run of bricks along z.
    pub z: u32,
}

impl BrickRun {
    /// Returns the lower and upper corner of the bricks at positions `x` (first and last) in the row of this run. They
    /// are in grid space (voxel index coordinates plus one) of a volume of `dims` voxels.
    pub fn bounds_of(&self, x: [u32; 2], dims: [usize; 3]) -> [DVec3; 2] {
        let at = |x: u32| [x, self.y, self.z].map(|n| n as usize);
        brick_box(at(x[0]), at(x[1]), dims)
    }
}

/// Returns the box that contains the bricks (blocks of voxel cells) from `first` to `last`, in voxel index
/// coordinates plus one. The box is clipped to the volume's domain `[0.5, n + 0.5]`.
pub fn brick_box(first: [usize; 3], last: [usize; 3], dims: [usize; 3]) -> [DVec3; 2] {
    let low = first.map(|b| ((BRICK_CELLS * b) as f64).max(0.5));
    let high = std::array::from_fn(|a| ((BRICK_CELLS * (last[a] + 1)) as f64).min(dims[a] as f64 + 0.5));
    [low, high].map(DVec3::from_array)
}

/// Convex hulls of all slices of bricks across z, in grid space (voxel index coordinates plus one). Every linear function
/// has its smallest and largest value over the bricks at a corner of these hulls, and so has every perspective projection
/// of bricks in front of the light.
#[derive(Debug, Clone)]
pub struct BrickHull {
    /// Corners of the convex hulls of all slices of bricks.
    pub corners: Vec<DVec3>,
    /// Centroid of the bricks in the hull.
    pub center: DVec3,
}

impl BrickHull {
    /// Computes the hull of runs of bricks, which are in row-major order; `None` without bricks.
    pub fn of(runs: &[BrickRun], dims: [usize; 3]) -> Option<Self> {
        let slices: Vec<&[BrickRun]> = runs.chunk_by(|a, b| a.z == b.z).collect();
        let parts: Vec<_> = slices.into_par_iter().map(|slice| slice_hull(slice, dims)).collect();
        let weight: f64 = parts.iter().map(|(_, _, weight)| weight).sum();
        let center = parts.iter().map(|(_, moment, _)| *moment).sum::<DVec3>() / weight;
        let corners = parts.into_iter().flat_map(|(corners, _, _)| corners).collect();
        (!runs.is_empty()).then_some(Self { corners, center })
    }
}

/// Returns the corners of the convex hull of one slice of bricks, and the sums of weighted centres and weights of its
/// runs. The weight of a run is its volume.
fn slice_hull(slice: &[BrickRun], dims: [usize; 3]) -> (Vec<DVec3>, DVec3, f64) {
    let (mut moment, mut weight) = (DVec3::ZERO, 0.0);
    for run in slice {
        let [low, high] = run.bounds_of(run.x, dims);
        let own = (high - low).element_product();
        moment += own * (0.5 * (low + high));
        weight += own;
    }
    let rows = slice.chunk_by(|a, b| a.y == b.y);
    let rows: Vec<_> =
        rows.map(|row| row[0].bounds_of([row[0].x[0], row[row.len() - 1].x[1]], dims)).collect();
    let side = |x: fn(&[DVec3; 2]) -> f64, turn: f64| {
        let ends = rows.iter().flat_map(|row| row.map(|corner| DVec2::new(x(row), corner.y)));
        convex_chain(ends, turn)
    };
    let outline = side(|row| row[0].x, 1.0).into_iter().chain(side(|row| row[1].x, -1.0));
    let [low, high] = rows[0].map(|corner| corner.z);
    (outline.flat_map(|p| [p.extend(low), p.extend(high)]).collect(), moment, weight)
}

/// Returns one side of the convex hull of points with rising y (monotone chain, Andrew 1979): the side of small x for
/// `turn` 1, of large x for -1.
fn convex_chain(points: impl Iterator<Item = DVec2>, turn: f64) -> Vec<DVec2> {
    let mut chain: Vec<DVec2> = Vec::new();
    for point in points {
        while let [.., a, b] = chain[..]
            && turn * (b - a).perp_dot(point - a) >= 0.0
        {
            chain.pop();
        }
        chain.push(point);
    }
    chain
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Extremes over the hull are those over all corners of all bricks, for volumes that end inside a brick.
    #[test]
    fn a_hull_has_the_extremes_of_all_bricks() {
        let mut random = fastrand::Rng::with_seed(7);
        for round in 0..200 {
            let dims = [0; 3].map(|_| random.usize(1..40));
            let counts = dims.map(|n| ((n + 1).div_ceil(BRICK_CELLS)) as u32);
            let mut runs = Vec::new();
            for (z, y) in (0..counts[2]).flat_map(|z| (0..counts[1]).map(move |y| (z, y))) {
                let mut x = random.u32(0..3);
                while x < counts[0] {
                    let last = random.u32(x..counts[0]);
                    runs.push(BrickRun { x: [x, last], y, z });
                    x = last + random.u32(2..5);
                }
            }
            let Some(hull) = BrickHull::of(&runs, dims) else { continue };
            for _ in 0..20 {
                let normal = DVec3::from_array([0; 3].map(|_| random.f64() - 0.5));
                let extreme = |points: &mut dyn Iterator<Item = DVec3>| {
                    points.map(|p| normal.dot(p)).fold(f64::NEG_INFINITY, f64::max)
                };
                let corner = |run: &BrickRun, c: usize| {
                    let ends = run.bounds_of(run.x, dims);
                    DVec3::new(ends[c & 1].x, ends[c >> 1 & 1].y, ends[c >> 2].z)
                };
                let all = extreme(&mut runs.iter().flat_map(|run| (0..8).map(move |c| corner(run, c))));
                let found = extreme(&mut hull.corners.iter().copied());
                assert!((all - found).abs() < 1e-12, "{round}: {all} {found}");
            }
            let volume = |run: &BrickRun| {
                let [low, high] = run.bounds_of(run.x, dims);
                ((high - low).element_product(), 0.5 * (low + high))
            };
            let weight: f64 = runs.iter().map(|run| volume(run).0).sum();
            let center = runs.iter().map(|run| volume(run).0 * volume(run).1).sum::<DVec3>() / weight;
            assert!(center.distance(hull.center) < 1e-10);
        }
    }
}
