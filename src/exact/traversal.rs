//! Traversal of a ray through the volume cell by cell. The value within a cell is a cubic, which is cut where the
//! value passes from one interval of the transfer function to the next.

use super::blocks::{Blocks, Labelled, block_of, cells_of};
use super::cell::CellChord;
use super::cubic::Cubic;
use super::gradient::{Factor, GradientLaws};
use super::law::{Law, Laws};
use super::voxel_access::VoxelAccess;
use crate::volume::{Scaling, Voxel};
use glam::DVec3;
use std::ops::ControlFlow;

/// Ray in index space, clipped to the volume's domain `[-0.5, n - 0.5]^3`; its parameter is the distance in mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    origin: [f64; 3],
    /// Direction of the ray in index units per mm.
    direction: [f64; 3],
    pub enter_mm: f64,
    pub exit_mm: f64,
}

impl Ray {
    /// Clips a ray to the volume's domain and to the distances `[from_mm, to_mm]`. Returns `None` if no part of the
    /// ray is left or a number is not finite.
    pub fn clipped(
        origin: DVec3,
        direction: DVec3,
        [from_mm, to_mm]: [f64; 2],
        dims: [usize; 3],
    ) -> Option<Self> {
        let (origin, direction) = (origin.to_array(), direction.to_array());
        let (mut enter_mm, mut exit_mm) = (from_mm, to_mm);
        for axis in 0..3 {
            let (p, d) = (origin[axis], direction[axis]);
            let (low, high) = (-0.5, dims[axis] as f64 - 0.5);
            if !(p.is_finite() && d.is_finite()) {
                return None;
            }
            if d == 0.0 {
                if !(low..=high).contains(&p) {
                    return None;
                }
            } else {
                let (a, b) = ((low - p) / d, (high - p) / d);
                enter_mm = enter_mm.max(a.min(b));
                exit_mm = exit_mm.min(a.max(b));
            }
        }
        let ray = Self { origin, direction, enter_mm, exit_mm };
        (exit_mm > enter_mm && exit_mm.is_finite() && enter_mm.is_finite()).then_some(ray)
    }

    /// Returns the point at a distance, in voxel index coordinates.
    pub fn at(&self, mm: f64) -> [f64; 3] {
        std::array::from_fn(|axis| self.origin[axis] + self.direction[axis] * mm)
    }
}

/// Interval of a ray on which extinction is smooth: within one volume cell and one interval of the transfer function.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayPiece {
    pub start_mm: f64,
    pub end_mm: f64,
    /// Index of the transfer function that applies to this interval of the ray.
    pub function: usize,
    /// Index of the extinction formula of this ray interval in [`Laws::laws`] of its transfer function; never
    /// [`Law::Clear`].
    pub law: usize,
    /// Volume value along this interval of the ray, as a cubic over `[0, 1]` from start to end.
    pub value: Cubic,
}

/// Grid of voxels with their labels, and the blocks of cells that rays may skip.
#[derive(Clone, Copy)]
pub(super) struct VoxelGrid<'a> {
    pub dims: [usize; 3],
    pub scaling: Scaling,
    pub blocks: &'a Blocks,
    pub labels: Option<Labelled<'a>>,
    pub gradient: Option<&'a GradientLaws>,
}

impl VoxelGrid<'_> {
    /// Calls `visit` with every interval of the ray that has extinction, in order, until `visit` returns `Break`. Its
    /// second argument is the factor of the gradient opacity along the interval; `None` if it is 1.
    #[inline]
    pub fn traverse(
        &self,
        voxels: &mut impl VoxelAccess,
        laws: &[Laws],
        ray: &Ray,
        mut visit: impl FnMut(RayPiece, Option<&Factor>) -> ControlFlow<()>,
    ) {
        let mut cell = CellTraversal::new(ray, self.dims);
        loop {
            if std::mem::take(&mut cell.entered_block) && !self.blocks.is_active(cell.block) {
                if !cell.leap() {
                    return;
                }
                continue;
            }
            let (start, end) = cell.advance();
            if end > start {
                let corner = voxels.corners(cell.cell, &cell.offset);
                let flow = match self.labels {
                    None => self.visit(&cell, (0, &laws[0]), &corner, [start, end], &mut visit),
                    Some(labels) => {
                        self.visit_labelled(&cell, laws, labels, &corner, [start, end], &mut visit)
                    }
                };
                if flow.is_break() {
                    return;
                }
            }
            if !cell.step() {
                return;
            }
        }
    }

    /// Calls `visit` with the ray intervals in a volume cell that is split halfway between voxels of different
    /// segmentation labels.
    fn visit_labelled<V: Voxel>(
        &self,
        cell: &CellTraversal<'_>,
        laws: &[Laws],
        labels: Labelled<'_>,
        corner: &[V; 8],
        [start, end]: [f64; 2],
        visit: &mut impl FnMut(RayPiece, Option<&Factor>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let mut from = start;
        for to in cell.middles().map(|t| t.clamp(start, end)).into_iter().chain([end]) {
            if to <= from {
                continue;
            }
            let nearest = cell.nearest(0.5 * (from + to));
            if let Some(function) = labels.functions[usize::from(labels.ranks[nearest])] {
                self.visit(cell, (function, &laws[function]), corner, [from, to], visit)?;
            }
            from = to;
        }
        ControlFlow::Continue(())
    }

    /// Calls `visit` with the ray intervals in a volume cell to which a single transfer function applies.
    #[inline]
    fn visit<V: Voxel>(
        &self,
        cell: &CellTraversal<'_>,
        (function, laws): (usize, &Laws),
        corner: &[V; 8],
        [start_mm, end_mm]: [f64; 2],
        visit: &mut impl FnMut(RayPiece, Option<&Factor>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let (min, max) = self.range(corner);
        let Some((first, last)) = laws.active(min, max) else { return ControlFlow::Continue(()) };
        let corner = corner.map(|v| self.scaling.apply(v.to_f64()));
        let chord = cell.chord(&corner, start_mm, end_mm);
        let value = chord.value();
        if let Some(gradient) = self.gradient {
            let intervals = factor_intervals(gradient, &chord, [start_mm, end_mm]);
            let mut visit = |piece: RayPiece| visit_with_factor(&piece, &intervals, visit);
            return cut((function, laws), [first, last], value, [start_mm, end_mm], &mut visit);
        }
        if first == last {
            return visit(RayPiece { start_mm, end_mm, function, law: first, value }, None);
        }
        cut((function, laws), [first, last], value, [start_mm, end_mm], &mut |piece| visit(piece, None))
    }

    /// Returns the smallest and largest value at the corners of a volume cell, after the mapping from stored to
    /// physical values.
    #[inline]
    fn range<V: Voxel>(&self, corner: &[V; 8]) -> (f64, f64) {
        let (mut min, mut max) = (corner[0], corner[0]);
        for &v in &corner[1..] {
            min = if v < min { v } else { min };
            max = if v > max { v } else { max };
        }
        let (a, b) = (self.scaling.apply(min.to_f64()), self.scaling.apply(max.to_f64()));
        (a.min(b), a.max(b))
    }
}

/// State of the traversal of a ray through volume cells. Cell `c` on an axis lies between the voxel centres `c` and
/// `c + 1`, from -1 (before the first centre) to `n - 1` (beyond the last).
struct CellTraversal<'r> {
    ray: &'r Ray,
    dims: [i64; 3],
    cell: [i64; 3],
    /// Distances along the ray at which it reaches the far face of the current volume cell on each axis, mm.
    next_mm: [f64; 3],
    at_mm: f64,
    axis: usize,
    stride: [i64; 3],
    offset: [[usize; 2]; 3],
    block: [i64; 3],
    /// Whether the ray has just entered another block of volume cells.
    entered_block: bool,
}

impl<'r> CellTraversal<'r> {
    fn new(ray: &'r Ray, dims: [usize; 3]) -> Self {
        let dims = dims.map(|n| n as i64);
        let mut traversal = Self {
            ray,
            dims,
            cell: [0; 3],
            next_mm: [f64::INFINITY; 3],
            at_mm: ray.enter_mm,
            axis: 0,
            stride: [1, dims[0], dims[0] * dims[1]],
            offset: [[0; 2]; 3],
            block: [0; 3],
            entered_block: true,
        };
        for (axis, n) in dims.into_iter().enumerate() {
            let p = ray.origin[axis] + ray.direction[axis] * ray.enter_mm;
            // A ray that starts on a face with negative direction is in the cell below the face.
            let cell = if ray.direction[axis] < 0.0 { p.ceil() - 1.0 } else { p.floor() };
            traversal.set(axis, (cell as i64).clamp(-1, n - 1));
        }
        traversal
    }

    #[inline]
    fn set(&mut self, axis: usize, cell: i64) {
        let d = self.ray.direction[axis];
        self.cell[axis] = cell;
        let last = self.dims[axis] - 1;
        self.offset[axis] = [cell, cell + 1].map(|c| (c.clamp(0, last) * self.stride[axis]) as usize);
        let block = block_of(cell);
        self.entered_block |= block != self.block[axis];
        self.block[axis] = block;
        if d != 0.0 {
            // Computed from the ray's origin, so that rounding errors do not accumulate.
            self.next_mm[axis] = ((cell + i64::from(d > 0.0)) as f64 - self.ray.origin[axis]) / d;
        }
    }

    /// Returns the start and end of the ray within the current volume cell; the interval is empty where the ray
    /// passes through an edge or a corner.
    #[inline]
    fn advance(&mut self) -> (f64, f64) {
        let [x, y, z] = self.next_mm;
        self.axis = if x <= y && x <= z {
            0
        } else if y <= z {
            1
        } else {
            2
        };
        let start = self.at_mm;
        self.at_mm = self.next_mm[self.axis].min(self.ray.exit_mm).max(start);
        (start, self.at_mm)
    }

    /// Moves to the next volume cell along the ray; returns false at the end of the ray.
    #[inline]
    fn step(&mut self) -> bool {
        let axis = self.axis;
        let cell = self.cell[axis] + if self.ray.direction[axis] > 0.0 { 1 } else { -1 };
        if self.next_mm[axis] >= self.ray.exit_mm || cell < -1 || cell >= self.dims[axis] {
            return false;
        }
        self.set(axis, cell);
        true
    }

    /// Moves along the ray to the first volume cell behind the current block of cells; returns false at the end of
    /// the ray.
    fn leap(&mut self) -> bool {
        let (mut exit_mm, mut exit_axis) = (f64::INFINITY, 0);
        for axis in 0..3 {
            let [first, last] = cells_of(self.block[axis]);
            let d = self.ray.direction[axis];
            let face = if d > 0.0 { last + 1 } else { first };
            let t = (face as f64 - self.ray.origin[axis]) / d;
            if d != 0.0 && t < exit_mm {
                (exit_mm, exit_axis) = (t, axis);
            }
        }
        if exit_mm >= self.ray.exit_mm {
            return false;
        }
        self.at_mm = self.at_mm.max(exit_mm);
        for axis in 0..3 {
            let d = self.ray.direction[axis];
            if d == 0.0 {
                continue;
            }
            let [first, last] = cells_of(self.block[axis]);
            let cell = if axis == exit_axis {
                if d > 0.0 { last + 1 } else { first - 1 }
            } else {
                // Rounding must not move the cell backwards or out of the block.
                let [low, high] = if d > 0.0 { [self.cell[axis], last] } else { [first, self.cell[axis]] };
                ((self.ray.origin[axis] + d * self.at_mm).floor() as i64).clamp(low, high)
            };
            if cell < -1 || cell >= self.dims[axis] {
                return false;
            }
            self.set(axis, cell);
        }
        self.entered_block = true;
        true
    }

    /// Returns the distances at which the ray is halfway between the cell's two voxels on each axis, ascending. Some
    /// lie outside of the cell; they are infinite on axes along which the ray does not move.
    fn middles(&self) -> [f64; 3] {
        let mut middles: [f64; 3] = std::array::from_fn(|axis| {
            let d = self.ray.direction[axis];
            if d == 0.0 { f64::INFINITY } else { (self.cell[axis] as f64 + 0.5 - self.ray.origin[axis]) / d }
        });
        middles.sort_by(f64::total_cmp);
        middles
    }

    /// Returns the index of the cell's voxel that is nearest to a point of the ray.
    fn nearest(&self, t: f64) -> usize {
        let side = |axis: usize| {
            let p = self.ray.origin[axis] + self.ray.direction[axis] * t - self.cell[axis] as f64;
            self.offset[axis][usize::from(p >= 0.5)]
        };
        side(0) + side(1) + side(2)
    }

    /// Returns the part of the ray from `start` to `end` (mm) within the current volume cell.
    #[inline]
    fn chord<'c>(&self, corner: &'c [f64; 8], start: f64, end: f64) -> CellChord<'c> {
        let within = |axis: usize, t: f64| {
            (self.ray.origin[axis] + self.ray.direction[axis] * t - self.cell[axis] as f64).clamp(0.0, 1.0)
        };
        let [x, y, z] = std::array::from_fn(|axis| within(axis, start));
        let [p, q, r] = std::array::from_fn(|axis| within(axis, end));
        CellChord { corner, start: [x, y, z], displacement: [p - x, q - y, r - z] }
    }
}

/// Interval of a ray (mm) on which the factor of the gradient opacity has one formula, with the factor along it.
type FactorInterval = ([f64; 2], Factor);

/// Returns the intervals of a ray in a volume cell on which the gradient opacity is not 0, in order.
fn factor_intervals(
    gradient: &GradientLaws,
    chord: &CellChord<'_>,
    [start_mm, end_mm]: [f64; 2],
) -> Vec<FactorInterval> {
    let mut intervals = Vec::new();
    let at = |x: f64| if x < 1.0 { start_mm + (end_mm - start_mm) * x } else { end_mm };
    gradient.intervals(chord, |[from, to], factor| {
        intervals.push(([at(from), at(to)], factor.restrict(from, to)));
    });
    intervals
}

/// Visits the parts of a ray interval in each of the intervals with a factor.
fn visit_with_factor(
    piece: &RayPiece,
    intervals: &[FactorInterval],
    visit: &mut impl FnMut(RayPiece, Option<&Factor>) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let length_mm = piece.end_mm - piece.start_mm;
    for ([from_mm, to_mm], factor) in intervals {
        let (start_mm, end_mm) = (piece.start_mm.max(*from_mm), piece.end_mm.min(*to_mm));
        if end_mm <= start_mm {
            continue;
        }
        let in_piece = |mm: f64| ((mm - piece.start_mm) / length_mm).clamp(0.0, 1.0);
        let in_interval = |mm: f64| ((mm - from_mm) / (to_mm - from_mm)).clamp(0.0, 1.0);
        let value = piece.value.restrict(in_piece(start_mm), in_piece(end_mm));
        let factor = factor.restrict(in_interval(start_mm), in_interval(end_mm));
        visit(RayPiece { start_mm, end_mm, value, ..*piece }, Some(&factor))?;
    }
    ControlFlow::Continue(())
}

/// Cuts the ray in a volume cell where the value passes from one interval of the transfer function to another, and
/// visits the parts with extinction.
///
/// `lowest` and `highest` are the transfer function intervals of the smallest and largest value at the corners of the
/// cell. Rounding of the value cannot lead outside of them.
fn cut(
    (function, laws): (usize, &Laws),
    [lowest, highest]: [usize; 2],
    value: Cubic,
    [start_mm, end_mm]: [f64; 2],
    visit: &mut impl FnMut(RayPiece) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let [turn0, turn1] = value.turning_points();
    let mut emit = |from: f64, to: f64, law: usize| {
        if to <= from || laws.laws[law] == Law::Clear {
            return ControlFlow::Continue(());
        }
        let at = |x: f64| if x < 1.0 { start_mm + (end_mm - start_mm) * x } else { end_mm };
        let (start_mm, end_mm) = (at(from), at(to));
        visit(RayPiece { start_mm, end_mm, function, law, value: value.restrict(from, to) })
    };
    let mut piece_from = 0.0;
    let mut law = None;
    let mut span_from = 0.0;
    for span_to in [turn0, turn1, 1.0] {
        if span_to <= span_from {
            continue;
        }
        let (a, b) = (value.at(span_from), value.at(span_to));
        let rising = b >= a;
        // From a value on a cut, the ray enters the interval above or below it.
        let (first, last) = if rising {
            (laws.interval(a), laws.interval_below(b))
        } else {
            (laws.interval_below(a), laws.interval(b))
        };
        let [first, last] = [first, last].map(|law| law.clamp(lowest, highest));
        let mut now = *law.get_or_insert(first);
        if now != first {
            emit(piece_from, span_from, now)?;
            (piece_from, now) = (span_from, first);
        }
        while if rising { now < last } else { now > last } {
            let crossed = laws.cuts[if rising { now } else { now - 1 }];
            let root = value.solve(crossed, piece_from.max(span_from), span_to, rising);
            emit(piece_from, root, now)?;
            piece_from = root;
            now = if rising { now + 1 } else { now - 1 };
        }
        law = Some(now);
        span_from = span_to;
    }
    match law {
        Some(law) => emit(piece_from, 1.0, law),
        None => ControlFlow::Continue(()),
    }
}
