//! Traversal of a grid's unit cells along a line segment (3D DDA).

/// Line segment `from + step t`, `t` in `[0, 1]`, in cell coordinates, where grid cell `c` spans `[c, c + 1]` along
/// each axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellRay {
    pub from: [f64; 3],
    pub step: [f64; 3],
    /// Reciprocal of each component of the line segment's direction, `1 / step`; infinite where `step` is 0.
    per_step: [f64; 3],
}

/// Box of grid cells in which a line segment is traversed, with the limits of the whole grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellBox {
    /// Indices of the first and the last cell of the whole grid along each axis; the first is 0 or -1. A line segment
    /// that lies in an outermost face of the grid belongs to these cells.
    pub whole: [[i64; 2]; 3],
    /// Indices of the first and the last grid cell inside the traversed box along each axis.
    pub part: [[i64; 2]; 3],
    /// Lower and upper end of the grid's domain along each axis, cell coordinates. The domain may end inside the
    /// outermost cells.
    pub domain: [[f64; 2]; 3],
}

/// Returns the largest integer `<= x` for `x >= -1`. A conversion to an integer alone would round towards 0.
#[inline]
fn floor(x: f64) -> i64 {
    (x + 1.0) as i64 - 1
}

impl CellRay {
    #[inline]
    pub fn new(from: [f64; 3], to: [f64; 3]) -> Self {
        let step: [f64; 3] = std::array::from_fn(|axis| to[axis] - from[axis]);
        Self { from, step, per_step: step.map(|d| 1.0 / d) }
    }

    /// Returns the parameter `t` at which the line segment crosses a cell face. All callers share this expression, so
    /// that rounding leaves no gap between neighbouring cells.
    #[inline]
    fn at_face(&self, axis: usize, face: f64) -> f64 {
        (face - self.from[axis]) * self.per_step[axis]
    }
}

impl CellBox {
    /// Returns the interval of the parameter `t` at which the line segment lies inside this box of grid cells; `None`
    /// if it misses the box.
    #[inline]
    pub fn clip(&self, line: &CellRay) -> Option<[f64; 2]> {
        let (mut enter, mut exit) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            let [first, last] = self.part[axis];
            let [low, high] = self.domain[axis];
            if line.per_step[axis].is_finite() {
                let a = line.at_face(axis, low.max(first as f64));
                let b = line.at_face(axis, high.min((last + 1) as f64));
                enter = enter.max(a.min(b));
                exit = exit.min(a.max(b));
            } else {
                let p = line.from[axis];
                if p < low || p > high {
                    return None;
                }
                let [start, end] = self.whole[axis];
                if !(first..=last).contains(&floor(p).clamp(start, end)) {
                    return None;
                }
            }
        }
        (exit > enter).then_some([enter, exit])
    }

    /// Calls `visit(cell, t0, t1)` for every grid cell that the line segment crosses between its parameters `t0` and
    /// `t1`, from the segment's start to its end.
    #[inline]
    pub fn traverse(&self, line: &CellRay, mut visit: impl FnMut([i64; 3], f64, f64)) {
        let Some([mut at, end]) = self.clip(line) else { return };
        let mut cell = [0; 3];
        let mut next = [f64::INFINITY; 3];
        let mut stride = [0; 3];
        for axis in 0..3 {
            let d = line.step[axis];
            let q = line.from[axis] + d * at;
            let below = floor(q);
            // A line that descends from a face is in the cell below it.
            let c = if d < 0.0 && below as f64 == q { below - 1 } else { below };
            let [first, last] = self.part[axis];
            cell[axis] = c.clamp(first, last);
            if line.per_step[axis].is_finite() {
                stride[axis] = if d > 0.0 { 1 } else { -1 };
                next[axis] = line.at_face(axis, (cell[axis] + i64::from(d > 0.0)) as f64);
            }
        }
        loop {
            let [x, y, z] = next;
            let axis = if x <= y && x <= z {
                0
            } else if y <= z {
                1
            } else {
                2
            };
            let to = next[axis].min(end);
            if to > at {
                visit(cell, at, to);
                at = to;
            }
            if next[axis] >= end {
                return;
            }
            cell[axis] += stride[axis];
            let [first, last] = self.part[axis];
            if cell[axis] < first || cell[axis] > last {
                return;
            }
            // Computed from the line's start, so that no error accumulates.
            next[axis] = line.at_face(axis, (cell[axis] + i64::from(stride[axis] > 0)) as f64);
        }
    }
}
