//! Exact reference on the CPU in float64, against which the errors of all shadow methods are measured.
//!
//! A ray is traversed cell by cell. Within a cell the trilinear value is a cubic of the distance. The cubic is cut
//! where it passes a control point of the transfer function, and each smooth interval of the ray is integrated to a
//! relative error of about 1e-12. If extinction is linear in the value, the quadrature is exact. If opacity is linear
//! (so that extinction is the logarithm of a cubic), the order of the quadrature is proved to be high enough. With a
//! gradient opacity, adaptive quadrature integrates to a relative error of about 1e-10. Blocks of cells without
//! extinction are skipped, which changes no bit of the result. The module shares no table and no code with the GPU path.

mod batch;
mod blocks;
mod cell;
mod cubic;
mod curve;
mod eye_samples;
mod gradient;
mod law;
mod light_mean;
mod picture;
mod shading;
mod traversal;
mod visible_points;
mod voxel_access;

pub use curve::OpticalDepthCurve;
pub use eye_samples::{EyeRay, EyeSample};
pub use light_mean::MeanTransmittance;
pub use visible_points::VisiblePoint;

use crate::scene::Light;
use crate::transfer::{LabelClass, TransferFunction};
use crate::volume::{DirectionMoments, Volume};
use blocks::{Blocks, Labelled};
use glam::DVec3;
use gradient::{Factor, GradientLaws};
use law::Laws;
use std::ops::ControlFlow;
use std::sync::Arc;
use traversal::{Ray, RayPiece, VoxelGrid};
use voxel_access::with_access;

/// Optical depth at which transmittance is negligible beside 1 in `f64`.
const OPAQUE: f64 = 40.0;

/// Volume with a transfer function, for which optical depth, transmittance and pictures are computed exactly in
/// float64.
#[derive(Debug, Clone)]
pub struct ExactField<'a> {
    volume: &'a Volume,
    transfer_function: &'a TransferFunction,
    /// Extinction formulas of each transfer function: the main one, then those of segmentation labels.
    laws: Vec<Laws>,
    /// Factor on the extinction by the gradient magnitude; `None` if it is 1 everywhere.
    gradient: Option<GradientLaws>,
    /// Index of the transfer function of each segmentation label, in the order of [`crate::volume::Labels::ids`];
    /// `None` for hidden labels.
    functions: Vec<Option<usize>>,
    blocks: Blocks,
    directions: Option<Arc<DirectionMoments>>,
}

impl<'a> ExactField<'a> {
    /// Prepares exact results for a volume with a transfer function, and finds the blocks of cells with extinction.
    pub fn new(volume: &'a Volume, transfer_function: &'a TransferFunction) -> Self {
        let laws: Vec<Laws> = match volume.labels() {
            Some(_) => transfer_function.functions().map(Laws::new).collect(),
            None => vec![Laws::new(transfer_function)],
        };
        let functions: Vec<Option<usize>> = (volume.labels().iter().flat_map(|labels| labels.ids()))
            .map(|id| match transfer_function.class_of(*id) {
                LabelClass::Hidden => None,
                LabelClass::Function(function) => Some(function),
            })
            .collect();
        let labels = labelled(volume, &functions);
        let blocks = Blocks::new(volume, &laws, labels);
        let index_from_world = volume.index_from_world().matrix3;
        let opacity = transfer_function.gradient_opacity.as_ref();
        let gradient =
            opacity.map(|opacity| GradientLaws::new(&opacity.per_mm(volume.spacing_mm()), index_from_world));
        Self { volume, transfer_function, laws, gradient, functions, blocks, directions: None }
    }

    /// Sets the directions of the strands from which the volume was made, which Kajiya-Kay shading needs.
    #[must_use]
    pub fn with_directions(self, directions: Option<Arc<DirectionMoments>>) -> Self {
        Self { directions, ..self }
    }

    /// Returns the directions of strands, if any.
    pub fn directions(&self) -> Option<&Arc<DirectionMoments>> {
        self.directions.as_ref()
    }

    /// Returns the volume for which results are computed exactly.
    pub fn volume(&self) -> &'a Volume {
        self.volume
    }

    /// Returns the transfer function with which results are computed exactly.
    pub fn transfer_function(&self) -> &'a TransferFunction {
        self.transfer_function
    }

    /// Returns the exact optical depth of the segment from `a` to `b` (world mm). It is NaN if the points are not
    /// finite or too far apart for `f64`.
    pub fn optical_depth(&self, a: DVec3, b: DVec3) -> f64 {
        match direction_and_length(a, b) {
            Some((direction, length_mm)) => self.optical_depth_along(a, direction, length_mm, f64::INFINITY),
            None => f64::NAN,
        }
    }

    /// Returns the exact optical depths of many segments (world mm) in parallel ([`Self::optical_depth`]).
    pub fn optical_depths(&self, segments: &[(DVec3, DVec3)]) -> Vec<f64> {
        let ray = |number: usize| {
            let (a, b) = segments[number];
            let (direction, length_mm) = direction_and_length(a, b).unwrap_or((DVec3::NAN, 0.0));
            (a, direction, length_mm)
        };
        let depth = |number: usize| self.optical_depth(segments[number].0, segments[number].1);
        self.of_rays(segments.len(), ray, depth)
    }

    /// Returns the exact optical depth as a function of depth along the segment from `a` to `b` (world mm), over
    /// depths `[0, |b - a|]`. It has no extinction if the ends are not finite.
    pub fn curve(&self, a: DVec3, b: DVec3) -> OpticalDepthCurve<'_> {
        match direction_and_length(a, b) {
            Some((direction, length_mm)) => self.curve_along(a, direction, length_mm),
            None => OpticalDepthCurve::new(&self.laws, 0.0),
        }
    }

    /// Returns the exact optical depth as a function of depth along the ray from `origin` in the unit `direction`
    /// (world mm). `length_mm` may be infinite.
    pub fn curve_along(&self, origin: DVec3, direction: DVec3, length_mm: f64) -> OpticalDepthCurve<'_> {
        let mut curve = OpticalDepthCurve::new(&self.laws, length_mm);
        self.traverse(origin, direction, length_mm, |piece, factor| {
            curve.push(piece, factor);
            ControlFlow::Continue(())
        });
        curve
    }

    /// Returns the distances (mm) at which the ray from `origin` in the unit `direction` (world mm) enters and leaves
    /// the volume's domain, after clip planes. The first distance is 0 if the ray starts inside. The result is `None`
    /// if the ray misses the domain.
    pub fn span_in_domain(&self, origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let ray = self.ray(origin, direction, f64::INFINITY)?;
        Some([ray.enter_mm, ray.exit_mm])
    }

    /// Returns the ray from `origin` in the unit `direction` (world mm), clipped to the volume's domain and by the
    /// clip planes.
    fn ray(&self, origin: DVec3, direction: DVec3, length_mm: f64) -> Option<Ray> {
        let planes = self.transfer_function.clip.iter();
        let interval =
            planes.fold([0.0, length_mm], |interval, plane| plane.cut(origin, direction, interval));
        let to_index = self.volume.index_from_world();
        let (origin, direction) = (to_index.transform_point3(origin), to_index.transform_vector3(direction));
        Ray::clipped(origin, direction, interval, self.volume.dims())
    }

    /// Whether the ray from `origin` in the unit `direction` (world mm) meets any extinction; `length_mm` may be
    /// infinite.
    pub fn meets_extinction(&self, origin: DVec3, direction: DVec3, length_mm: f64) -> bool {
        let mut met = false;
        self.traverse(origin, direction, length_mm, |_, _| {
            met = true;
            ControlFlow::Break(())
        });
        met
    }

    /// Returns the exact transmittance between the point `x` (world mm) and a light. The light ray ends at a point
    /// light's position, or leaves the domain for a directional light. The result is NaN if the point or the light is
    /// not finite. Below 1e-17 it may be any number from 0 to 1e-17.
    pub fn transmittance_to_light(&self, x: DVec3, light: &Light) -> f64 {
        let (direction, length_mm) = light.from_point(x);
        (-self.optical_depth_along(x, direction, length_mm, OPAQUE)).exp()
    }

    /// Returns the exact optical depth along a ray; the summation may stop once it exceeds `enough`.
    fn optical_depth_along(&self, origin: DVec3, direction: DVec3, length_mm: f64, enough: f64) -> f64 {
        if !(origin.is_finite() && direction.is_finite()) {
            return f64::NAN;
        }
        let mut sum = 0.0;
        self.traverse(origin, direction, length_mm, |piece, factor| {
            let law = &self.laws[piece.function].laws[piece.law];
            let integral = match factor {
                None => law.integral(&piece.value, 0.0, 1.0),
                Some(factor) => factor.integral(law, &piece.value, 0.0, 1.0),
            };
            sum += integral * (piece.end_mm - piece.start_mm);
            if sum < enough { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        sum
    }

    /// Calls `visit` with each interval of a ray that has extinction, in order along the ray, and with the factor of the
    /// gradient opacity along it; `None` if there is no gradient opacity.
    fn traverse(
        &self,
        origin: DVec3,
        direction: DVec3,
        length_mm: f64,
        visit: impl FnMut(RayPiece, Option<&Factor>) -> ControlFlow<()>,
    ) {
        let Some(ray) = self.ray(origin, direction, length_mm) else { return };
        let (dims, scaling) = (self.volume.dims(), self.volume.scaling());
        let labels = labelled(self.volume, &self.functions);
        let gradient = self.gradient.as_ref();
        let grid = VoxelGrid { dims, scaling, blocks: &self.blocks, labels, gradient };
        with_access!(self.volume, voxels => grid.traverse(voxels, &self.laws, &ray, visit));
    }
}

/// Returns the labels of the volume's voxels with the transfer function of each label; `None` without a segmentation.
fn labelled<'a>(volume: &'a Volume, functions: &'a [Option<usize>]) -> Option<Labelled<'a>> {
    volume.labels().map(|labels| Labelled { ranks: labels.ranks(), functions })
}

/// Returns the unit direction from point `a` to point `b` and their distance; `None` if they are not finite.
fn direction_and_length(a: DVec3, b: DVec3) -> Option<(DVec3, f64)> {
    let d = b - a;
    let largest = d.abs().max_element();
    if !d.is_finite() || !a.is_finite() {
        return None;
    }
    if largest == 0.0 {
        return Some((DVec3::Z, 0.0));
    }
    // Scaled first, so that squares neither overflow nor vanish.
    let scaled = d / largest;
    Some((scaled.normalize(), scaled.length() * largest))
}
