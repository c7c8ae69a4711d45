//! Chebyshev distances of bricks (blocks of voxel cells) to the nearest active brick, and the bounding box of active
//! bricks.
//!
//! Distances along rows of x come first, and rows are independent. Two sweeps over the rows then spread them along y
//! and z (Rosenfeld and Pfaltz 1966: the distance is one more than the least of the 26 neighbours, and each sweep
//! visits half of them before the brick). Neighbours in a row differ by at most 1 from the start, and this stays so:
//! a sweep therefore only compares whole rows with each other, which compilers turn into vector instructions.

use glam::USizeVec3;

/// Number and bounding box of the active bricks (blocks of cells with extinction) in a part of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Extent {
    /// Number of active bricks (blocks of cells with extinction).
    pub active: usize,
    /// Grid positions of the first and last brick (inclusive) in the bounding box; `None` without active bricks.
    pub bounds: Option<[[usize; 3]; 2]>,
}

impl Extent {
    /// Returns the number and the bounding box of the active bricks in one row along x. `line` holds 0 for active
    /// bricks.
    pub fn of_row([_, ny, _]: [usize; 3], row: usize, line: &[u8]) -> Self {
        let is_active = |d: &u8| *d == 0;
        let ends = line.iter().position(is_active).zip(line.iter().rposition(is_active));
        let bounds = ends.map(|ends| <[usize; 2]>::from(ends).map(|x| [x, row % ny, row / ny]));
        Self { active: line.iter().filter(|d| is_active(d)).count(), bounds }
    }

    /// Returns the number and the bounding box of the active bricks of two parts of a volume.
    pub fn with(self, other: Self) -> Self {
        let vectors = |bounds: [[usize; 3]; 2]| bounds.map(USizeVec3::from_array);
        let bounds = match (self.bounds, other.bounds) {
            (Some(own), Some(other)) => {
                let ([first, last], [other_first, other_last]) = (vectors(own), vectors(other));
                Some([first.min(other_first), last.max(other_last)].map(|at| at.to_array()))
            }
            (own, other) => own.or(other),
        };
        Self { active: self.active + other.active, bounds }
    }
}

/// Computes the distance of each brick in a row to the nearest active brick of the row. `line` holds 0 for active
/// bricks and 255 for others.
pub(super) fn distances_along_row(line: &mut [u8]) {
    let mut before = u8::MAX;
    let mut step = |d: &mut u8| {
        *d = (*d).min(before.saturating_add(1));
        before = *d;
    };
    line.iter_mut().for_each(&mut step);
    line.iter_mut().rev().for_each(step);
}

/// Computes the Chebyshev distance of each brick to the nearest active brick from the distances along rows, in place.
/// Distances are exact up to 255, which means 255 or more.
pub(super) fn spread_across_rows([nx, ny, nz]: [usize; 3], distance: &mut [u8]) {
    let rows = ny * nz;
    // Least distance of neighbouring rows, with one more brick at both ends.
    let mut nearest = vec![u8::MAX; nx + 2];
    for forward in [true, false] {
        for i in 0..rows {
            let row = if forward { i } else { rows - 1 - i };
            // Position counted from the end at which the sweep starts.
            let (y, z) = (i % ny, i / ny);
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
            for (x, d) in own.iter_mut().enumerate() {
                let near = nearest[x].min(nearest[x + 1]).min(nearest[x + 2]);
                *d = (*d).min(near.saturating_add(1));
            }
        }
    }
}
