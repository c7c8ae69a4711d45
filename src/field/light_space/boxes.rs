//! Boxes around active bricks (blocks of cells with extinction) in voxel index coordinates plus one, and rectangles
//! in the projection plane of a shadow map.

use crate::field::ActiveBricks;
use crate::field::brick_runs::brick_box;
use glam::{DVec2, DVec3};

/// Box of volume cells in grid space: voxel index coordinates plus one.
#[derive(Clone, Copy)]
pub struct GridBox {
    pub center: DVec3,
    pub half: DVec3,
}

impl GridBox {
    /// Returns the box that contains the bricks (blocks of voxel cells) from `first` to `last` in grid space, clipped
    /// to the volume.
    pub fn of_bricks(first: [usize; 3], last: [usize; 3], dims: [usize; 3]) -> Self {
        let [low, high] = brick_box(first, last, dims);
        Self { center: 0.5 * (low + high), half: 0.5 * (high - low) }
    }

    /// Returns the box around all active bricks (blocks of cells with extinction), or around the whole volume if no
    /// brick is active.
    pub fn of_active(active: &ActiveBricks, dims: [usize; 3]) -> Self {
        let [first, last] = active.bounds.unwrap_or([[0; 3], active.counts.map(|n| n - 1)]);
        Self::of_bricks(first, last, dims)
    }

    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|c| {
            let sign = |bit: usize| if c >> bit & 1 == 0 { -1.0 } else { 1.0 };
            self.center + self.half * DVec3::new(sign(0), sign(1), sign(2))
        })
    }
}

/// Rectangle in the projection plane of a shadow map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    pub lo: DVec2,
    pub hi: DVec2,
}

impl Region {
    /// Returns the smallest rectangle around points in the projection plane of a shadow map.
    pub fn around(points: impl IntoIterator<Item = DVec2>) -> Self {
        let empty = Self { lo: DVec2::INFINITY, hi: DVec2::NEG_INFINITY };
        points.into_iter().fold(empty, |r, p| Self { lo: r.lo.min(p), hi: r.hi.max(p) })
    }

    pub fn size(self) -> DVec2 {
        (self.hi - self.lo).max(DVec2::splat(1e-9))
    }

    pub fn area(self) -> f64 {
        self.size().element_product()
    }

    /// Returns the intersection of two rectangles in the projection plane of a shadow map.
    pub fn within(self, other: Self) -> Self {
        Self { lo: self.lo.max(other.lo), hi: self.hi.min(other.hi) }
    }

    /// Returns a rectangle in the projection plane of a shadow map, extended on each side by a share of its size.
    pub fn grown(self, share: f64) -> Self {
        Self { lo: self.lo - share * self.size(), hi: self.hi + share * self.size() }
    }

    /// Returns the smallest square around a rectangle in the projection plane of a shadow map, with the same centre.
    pub fn squared(self) -> Self {
        let half = DVec2::splat(0.5 * self.size().max_element());
        let middle = 0.5 * (self.lo + self.hi);
        Self { lo: middle - half, hi: middle + half }
    }

    /// Whether a rectangle in the projection plane of a shadow map contains another rectangle, up to rounding.
    pub fn contains(self, other: Self) -> bool {
        let rounding = 1e-9 * self.size();
        (self.lo - rounding).cmple(other.lo).all() && (self.hi + rounding).cmpge(other.hi).all()
    }
}
