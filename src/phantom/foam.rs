//! Foams: walls or struts between the cells of a random Voronoi diagram (Worley 1996, *A cellular texture basis function*).
//!
//! Positions are in units of half the cube's edge, so that the cube is `[-1, 1]^3`.

use super::grid::{INSIDE, by_slices, centred};
use crate::files::loading::Loading;
use crate::random::{Chance, mix};
use crate::volume::IndexBox;
use glam::{DVec3, I64Vec3};
use ndarray::Array3;
use rayon::prelude::*;

/// Seed of the random cells. Another seed changes the frozen benchmark.
const SEED: u64 = 103;
/// Number of cells of the foam along each side of the cube, and radius of the ball that the foam fills.
const CELLS: i64 = 9;
const RADIUS: f64 = 0.92;
/// Number of seeds whose distances decide the value: a strut lies between three cells.
const NEAREST: usize = 3;
/// Number of subcells along each side of a cell for which the seeds are chosen together; a power of 2.
const SUBCELLS: i64 = 8;
/// Number of voxels along x that are tested together for material.
const RUN: usize = 8;
/// Margin for rounding of that test, in cells.
const MARGIN: f64 = 1e-6;
/// Distance in cells of a position of a subcell from its middle, with a margin for rounding.
const REACH: f64 = 0.87 / SUBCELLS as f64;

/// Foam in the cube, in cells.
#[derive(Debug)]
pub(super) struct Foam {
    /// Index of the seed, by distance, whose difference from the nearest one is 0 in the material.
    farther: usize,
    /// Half thickness of walls or struts.
    thickness: f64,
    /// Seed of each cell within two cells of the cube, x fastest.
    seeds: Vec<DVec3>,
    /// Indices of the seeds that may be the nearest ones, for each subcell, x fastest; none without material.
    candidates: Vec<Box<[u16]>>,
}

impl Foam {
    /// Closed-cell foam: walls between the cells.
    pub fn closed() -> Self {
        Self::new(1, 0.03)
    }

    /// Open-cell foam: struts along the edges of the cells.
    pub fn open() -> Self {
        Self::new(2, 0.04)
    }

    fn new(farther: usize, thickness: f64) -> Self {
        let foam = Self { farther, thickness, seeds: seeds(), candidates: Vec::new() };
        let side = CELLS * SUBCELLS;
        let subcell = |n: i64| I64Vec3::new(n % side, n / side % side, n / (side * side));
        let candidates = (0..side.pow(3)).into_par_iter().map(|n| foam.candidates_of(subcell(n))).collect();
        Self { candidates, ..foam }
    }

    /// Chooses the seeds that may be nearest to positions in a subcell.
    fn candidates_of(&self, subcell: I64Vec3) -> Box<[u16]> {
        let middle = (subcell.as_dvec3() + 0.5) / SUBCELLS as f64;
        let cell = subcell / SUBCELLS;
        // Two cells around: a nearer seed cannot lie farther away.
        let offsets = (0..125).map(|o| I64Vec3::new(o % 5, o / 5 % 5, o / 25) - 2);
        let around: Vec<u16> = offsets.map(|offset| place(cell + offset) as u16).collect();
        let nearest = self.nearest(middle, &around);
        let third = nearest[NEAREST - 1];
        if (nearest[self.farther] - nearest[0] - 2.0 * REACH) / CELLS as f64 > self.thickness {
            return Box::default();
        }
        let is_near = |seed: &u16| self.squared_distance(middle, *seed).sqrt() <= third + 2.0 * REACH;
        around.into_iter().filter(is_near).collect()
    }

    /// Computes the voxels of a box for `size` voxels along each side of the cube: [`INSIDE`] in the middle of walls or struts,
    /// falling to 0 within their thickness. They are incomplete if `loading` was cancelled.
    pub fn voxels(&self, size: usize, part: &IndexBox, loading: &Loading) -> Array3<i16> {
        let [xs, ys, _] = part;
        by_slices(part, loading, |k, slice| {
            let z = centred(k, size);
            for (j, row) in ys.clone().zip(slice.chunks_exact_mut(xs.len())) {
                let y = centred(j, size);
                for (first, run) in xs.clone().step_by(RUN).zip(row.chunks_mut(RUN)) {
                    let ends = [first, first + run.len() - 1].map(|i| DVec3::new(centred(i, size), y, z));
                    if self.may_have_material(ends) {
                        for (i, voxel) in (first..).zip(run) {
                            *voxel = (INSIDE * self.share(DVec3::new(centred(i, size), y, z))).round() as i16;
                        }
                    }
                }
            }
        })
    }

    /// Whether there may be material between two positions on a line along x.
    fn may_have_material(&self, ends: [DVec3; 2]) -> bool {
        let [from, to] = ends.map(in_cells);
        let subcells = [from, to].map(subcell_of);
        let candidates = &self.candidates[subcells[0]];
        if subcells[0] != subcells[1] || candidates.is_empty() {
            return subcells[0] != subcells[1];
        }
        let nearest = self.nearest(0.5 * (from + to), candidates);
        let reach = 0.5 * (to.x - from.x) + MARGIN;
        (nearest[self.farther] - nearest[0] - 2.0 * reach) / CELLS as f64 <= self.thickness
    }

    /// Share of the largest density at a position, in `[0, 1]`.
    fn share(&self, at: DVec3) -> f64 {
        let scaled = in_cells(at);
        let candidates = &self.candidates[subcell_of(scaled)];
        if candidates.is_empty() || at.length() > RADIUS {
            return 0.0;
        }
        let nearest = self.nearest(scaled, candidates);
        // Half the difference of the two distances is about the distance from the wall between them.
        let from_wall = (nearest[self.farther] - nearest[0]) / CELLS as f64;
        (1.0 - from_wall / self.thickness).max(0.0)
    }

    /// Returns the distances of the nearest seeds, ascending.
    fn nearest(&self, scaled: DVec3, seeds: &[u16]) -> [f64; NEAREST] {
        let mut nearest = [f64::INFINITY; NEAREST];
        for seed in seeds {
            let mut squared = self.squared_distance(scaled, *seed);
            // Without branches, which would be unpredictable.
            for kept in &mut nearest {
                let (a, b) = (*kept, squared);
                *kept = if b < a { b } else { a };
                squared = if b < a { a } else { b };
            }
        }
        nearest.map(f64::sqrt)
    }

    fn squared_distance(&self, scaled: DVec3, seed: u16) -> f64 {
        (self.seeds[usize::from(seed)] - scaled).length_squared()
    }
}

/// Converts a position to units of cells, from a corner of the cube.
fn in_cells(at: DVec3) -> DVec3 {
    (at + 1.0) * (0.5 * CELLS as f64)
}

/// Returns the index of the subcell that holds a position in cells.
fn subcell_of(scaled: DVec3) -> usize {
    let [x, y, z] = (scaled * SUBCELLS as f64).as_i64vec3().to_array();
    let side = CELLS * SUBCELLS;
    (x + side * (y + side * z)) as usize
}

/// Number of cells along each side with seeds that matter: those of the cube, and two more at each end.
const SIDE: i64 = CELLS + 4;

/// Returns the index of a cell in the list of seeds. Cells beyond those that matter count as the last ones.
fn place(cell: I64Vec3) -> usize {
    let [x, y, z] = (cell + 2).clamp(I64Vec3::ZERO, I64Vec3::splat(SIDE - 1)).to_array();
    (x + SIDE * (y + SIDE * z)) as usize
}

/// Returns the seed of each cell, at a random position in it.
fn seeds() -> Vec<DVec3> {
    let seed = |n: i64| {
        let cell = I64Vec3::new(n % SIDE, n / SIDE % SIDE, n / (SIDE * SIDE)) - 2;
        let index = cell.to_array().iter().fold(0_u64, |index, n| mix(index ^ *n as u64));
        let mut chance = Chance::new(SEED, index);
        cell.as_dvec3() + DVec3::from_array([(); 3].map(|()| chance.unit()))
    };
    (0..SIDE * SIDE * SIDE).map(seed).collect()
}
