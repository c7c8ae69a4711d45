//! Rectangles of the plane across the light.

use glam::DVec2;

/// A rectangle of plane coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    pub lo: DVec2,
    pub hi: DVec2,
}

impl Region {
    /// Nothing, to which points are added.
    pub const EMPTY: Self = Self { lo: DVec2::INFINITY, hi: DVec2::NEG_INFINITY };

    pub fn with(self, p: DVec2) -> Self {
        Self { lo: self.lo.min(p), hi: self.hi.max(p) }
    }

    pub fn size(self) -> DVec2 {
        (self.hi - self.lo).max(DVec2::splat(1e-9))
    }

    pub fn area(self) -> f64 {
        self.size().element_product()
    }

    /// No more than what lies in both.
    pub fn within(self, other: Self) -> Self {
        Self { lo: self.lo.max(other.lo), hi: self.hi.min(other.hi) }
    }

    /// By a share of its size on each side.
    pub fn grown(self, share: f64) -> Self {
        Self { lo: self.lo - share * self.size(), hi: self.hi + share * self.size() }
    }

    /// The square around it.
    pub fn squared(self) -> Self {
        let half = DVec2::splat(0.5 * self.size().max_element());
        let middle = 0.5 * (self.lo + self.hi);
        Self { lo: middle - half, hi: middle + half }
    }

    /// Whether another lies in it, but for rounding.
    pub fn holds(self, other: Self) -> bool {
        let rounding = 1e-9 * self.size();
        (self.lo - rounding).cmple(other.lo).all() && (self.hi + rounding).cmpge(other.hi).all()
    }
}
