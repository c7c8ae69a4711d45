//! Exact optical depth as a function of depth along one ray, and its inverse.

use super::gradient::Factor;
use super::law::{Law, Laws};
use super::traversal::RayPiece;

/// Exact optical depth along a ray, accumulated from its origin. The ray is divided into smooth intervals, each
/// integrated from its own start, so that the value is exact at every depth.
///
/// Depths are mm from the ray's origin.
#[derive(Debug, Clone)]
pub struct OpticalDepthCurve<'a> {
    laws: &'a [Laws],
    pieces: Vec<CurvePiece>,
    /// Factor of the gradient opacity along each interval; empty if there is no gradient opacity.
    factors: Vec<Factor>,
    total: f64,
    /// Length of the ray, mm. Extinction that ends there does not count as a jump of extinction.
    length_mm: f64,
}

#[derive(Debug, Clone, Copy)]
struct CurvePiece {
    piece: RayPiece,
    /// Optical depth from the origin of the ray to the start of this smooth interval of the ray.
    before: f64,
}

/// Point of a ray at which the accumulated optical depth reaches a given value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CurvePoint {
    pub depth_mm: f64,
    /// Scalar value of the volume at this point of a ray.
    pub value: f64,
    /// Index of the transfer function that applies at this point of a ray, in
    /// [`crate::transfer::TransferFunction::functions`].
    pub function: usize,
}

impl<'a> OpticalDepthCurve<'a> {
    pub(super) fn new(laws: &'a [Laws], length_mm: f64) -> Self {
        Self { laws, pieces: Vec::new(), factors: Vec::new(), total: 0.0, length_mm }
    }

    pub(super) fn push(&mut self, piece: RayPiece, factor: Option<&Factor>) {
        self.pieces.push(CurvePiece { piece, before: self.total });
        self.factors.extend(factor);
        self.total += self.within(self.pieces.len() - 1, 1.0);
    }

    /// Returns the exact optical depth of the whole ray.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Returns the optical depth from the ray's origin to `depth_mm`; 0 before the origin and the total beyond the
    /// ray's end.
    pub fn optical_depth_at(&self, depth_mm: f64) -> f64 {
        let after = self.pieces.partition_point(|p| p.piece.start_mm < depth_mm);
        let Some(index) = after.checked_sub(1) else { return 0.0 };
        let CurvePiece { piece, before } = &self.pieces[index];
        let x = (depth_mm - piece.start_mm) / (piece.end_mm - piece.start_mm);
        before + self.within(index, x.min(1.0))
    }

    /// Returns the transmittance from the ray's origin to `depth_mm`.
    pub fn transmittance_at(&self, depth_mm: f64) -> f64 {
        (-self.optical_depth_at(depth_mm)).exp()
    }

    /// Returns the smallest depth along the ray (mm) at which the optical depth reaches `tau`; `None` if it never
    /// does, 0 for `tau <= 0`.
    pub fn depth_of_optical_depth(&self, tau: f64) -> Option<f64> {
        if tau <= 0.0 {
            return Some(0.0);
        }
        self.find(tau).map(|f| f.depth_mm)
    }

    /// Returns the point of the ray at which the optical depth reaches `tau > 0`; `None` if the whole ray has less.
    pub(super) fn find(&self, tau: f64) -> Option<CurvePoint> {
        if tau.is_nan() || tau > self.total {
            return None;
        }
        let after = self.pieces.partition_point(|p| p.before < tau);
        let index = after.checked_sub(1)?;
        let CurvePiece { piece, before } = &self.pieces[index];
        let x = self.invert(index, tau - before);
        let depth_mm =
            if x < 1.0 { piece.start_mm + (piece.end_mm - piece.start_mm) * x } else { piece.end_mm };
        Some(CurvePoint { depth_mm, value: piece.value.at(x), function: piece.function })
    }

    /// Returns the depths along the ray (mm, ascending) at which extinction jumps or bends. There the value passes a
    /// control point of the transfer function next to extinction, or the ray enters or leaves the volume within
    /// extinction. With a gradient opacity, these are the ends of all intervals.
    pub fn jumps(&self) -> Vec<f64> {
        let mut jumps = Vec::new();
        let mut last: Option<&RayPiece> = None;
        for CurvePiece { piece, .. } in &self.pieces {
            match last {
                Some(p) if p.end_mm < piece.start_mm => jumps.extend([p.end_mm, piece.start_mm]),
                Some(p) if (p.function, p.law) != (piece.function, piece.law) => jumps.push(piece.start_mm),
                // The gradient of a trilinear value jumps at every cell face.
                Some(_) if !self.factors.is_empty() => jumps.push(piece.start_mm),
                None if piece.start_mm > 0.0 => jumps.push(piece.start_mm),
                _ => {}
            }
            last = Some(piece);
        }
        jumps.extend(last.map(|p| p.end_mm).filter(|end| *end < self.length_mm));
        jumps
    }

    fn law(&self, piece: &RayPiece) -> &Law {
        &self.laws[piece.function].laws[piece.law]
    }

    /// Returns the optical depth from the start of a smooth interval of the ray, given by its index, to the fraction `x` of
    /// the interval's length.
    #[inline]
    fn within(&self, index: usize, x: f64) -> f64 {
        let piece = &self.pieces[index].piece;
        let integral = match self.factors.get(index) {
            None => self.law(piece).integral(&piece.value, 0.0, x),
            Some(factor) => factor.integral(self.law(piece), &piece.value, 0.0, x),
        };
        integral * (piece.end_mm - piece.start_mm)
    }

    /// Returns the fraction of the length of a smooth ray interval, given by its index, at which the optical depth within
    /// the interval reaches `tau`.
    fn invert(&self, index: usize, tau: f64) -> f64 {
        const MOST_STEPS: usize = 100;
        let piece = &self.pieces[index].piece;
        let length_mm = piece.end_mm - piece.start_mm;
        let (law, factor) = (self.law(piece), self.factors.get(index));
        let constant_factor = factor.map_or(Some(1.0), Factor::constant);
        if let (Law::Constant(sigma), Some(factor)) = (law, constant_factor) {
            return (tau / (factor * sigma * length_mm)).min(1.0);
        }
        let extinction = |x: f64| law.extinction(piece.value.at(x)) * factor.map_or(1.0, |f| f.at(x));
        // Newton's method within a shrinking bracket; the integral increases with x.
        let (mut low, mut high) = (0.0, 1.0);
        let mut x = 0.5;
        for _ in 0..MOST_STEPS {
            let residual = self.within(index, x) - tau;
            if residual < 0.0 {
                low = x;
            } else {
                high = x;
            }
            if residual.abs() <= f64::EPSILON * tau {
                break;
            }
            let newton = x - residual / (extinction(x) * length_mm);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let done = (next - x).abs() <= f64::EPSILON;
            x = next;
            if done {
                break;
            }
        }
        x
    }
}
