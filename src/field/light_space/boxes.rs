//! Boxes of bricks in grid space.

use crate::field::ActiveBricks;
use crate::volume::BRICK_CELLS;
use glam::DVec3;

/// A box of cells in grid space (`index + 1`).
#[derive(Clone, Copy)]
pub struct GridBox {
    pub center: DVec3,
    pub half: DVec3,
}

impl GridBox {
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|c| {
            let sign = |bit: usize| if c >> bit & 1 == 0 { -1.0 } else { 1.0 };
            self.center + self.half * DVec3::new(sign(0), sign(1), sign(2))
        })
    }
}

fn clipped(lo: [usize; 3], hi: [usize; 3], dims: [usize; 3]) -> GridBox {
    let low = DVec3::from_array(lo.map(|b| ((b * BRICK_CELLS) as f64).max(0.5)));
    let high = DVec3::from_array(std::array::from_fn(|a| {
        (((hi[a] + 1) * BRICK_CELLS) as f64).min(dims[a] as f64 + 0.5)
    }));
    GridBox { center: 0.5 * (low + high), half: 0.5 * (high - low) }
}

/// Box of all active bricks (of the whole domain where there is none).
pub fn active_box(active: &ActiveBricks, dims: [usize; 3]) -> GridBox {
    let [lo, hi] = active.bounds.unwrap_or([[0; 3], active.counts.map(|n| n - 1)]);
    clipped(lo, hi, dims)
}

pub fn active_boxes(active: &ActiveBricks, dims: [usize; 3]) -> impl Iterator<Item = GridBox> + '_ {
    let [nx, ny, _] = active.counts;
    active.distance.iter().enumerate().filter(|(_, d)| **d == 0).map(move |(i, _)| {
        let at = [i % nx, i / nx % ny, i / (nx * ny)];
        clipped(at, at, dims)
    })
}

/// Active bricks that are wanted, those side by side along x as one box.
pub fn active_rows(
    active: &ActiveBricks,
    dims: [usize; 3],
    wanted: impl Fn(&GridBox) -> bool,
) -> Vec<GridBox> {
    let mut rows: Vec<([usize; 3], [usize; 3])> = Vec::new();
    let [nx, ny, nz] = active.counts;
    let mut at = 0;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                if active.distance[at] == 0 && wanted(&clipped([x, y, z], [x, y, z], dims)) {
                    match rows.last_mut() {
                        Some((_, last)) if *last == [x.wrapping_sub(1), y, z] => last[0] = x,
                        _ => rows.push(([x, y, z], [x, y, z])),
                    }
                }
                at += 1;
            }
        }
    }
    rows.into_iter().map(|(lo, hi)| clipped(lo, hi, dims)).collect()
}
