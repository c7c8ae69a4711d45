//! Float64 reference on the CPU, against which errors of all methods are measured.
//!
//! A ray is traversed cell by cell. Within a cell the trilinear value is a cubic of the distance. The cubic is cut where
//! it passes a point of the transfer function, and each smooth piece is integrated to a relative error of about 1e-12. For an
//! extinction ramp the rule is exact; for an opacity ramp (the logarithm of a cubic) its order is proved to be high
//! enough. Blocks of cells without extinction are skipped, which changes no bit of the result. The module shares no
//! table and no code with the GPU path.

mod blocks;
mod cubic;
mod curve;
mod law;
mod picture;
mod shading;
mod traversal;
mod visible_points;

pub use curve::OpticalDepthCurve;
pub use visible_points::VisiblePoint;

use crate::scene::Light;
use crate::transfer::{LabelClass, TransferFunction};
use crate::volume::{DirectionMoments, Volume};
use crate::with_voxels;
use blocks::{Blocks, Labelled};
use glam::DVec3;
use law::Laws;
use ndarray::Array3;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::Arc;
use traversal::{Ray, RayPiece, VoxelGrid};

/// Optical depth whose transmittance is negligible beside 1 in `f64`.
const OPAQUE: f64 = 40.0;

/// Volume with a transfer function, evaluated exactly.
#[derive(Debug, Clone)]
pub struct ExactField<'a> {
    volume: &'a Volume,
    transfer_function: &'a TransferFunction,
    /// Laws of each of the transfer function's functions.
    laws: Vec<Laws>,
    /// Function of each label in the order of [`crate::volume::Labels::ids`]; `None` for hidden labels.
    functions: Vec<Option<usize>>,
    blocks: Blocks,
    directions: Option<Arc<DirectionMoments>>,
}

impl<'a> ExactField<'a> {
    /// Prepares the transfer function, and finds the blocks with extinction.
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
        let blocks = with_voxels!(volume.voxels(), array => {
            Blocks::new(contiguous(array), volume.dims(), volume.scaling(), &laws, labels)
        });
        Self { volume, transfer_function, laws, functions, blocks, directions: None }
    }

    /// Sets the directions of the strands from which the volume was made.
    #[must_use]
    pub fn with_directions(self, directions: Option<Arc<DirectionMoments>>) -> Self {
        Self { directions, ..self }
    }

    /// The volume.
    pub fn volume(&self) -> &'a Volume {
        self.volume
    }

    /// The transfer function.
    pub fn transfer_function(&self) -> &'a TransferFunction {
        self.transfer_function
    }

    /// Optical depth of the segment from `a` to `b`, world mm; NaN if they are not finite or too far apart
    /// for `f64`.
    pub fn optical_depth(&self, a: DVec3, b: DVec3) -> f64 {
        match direction_and_length(a, b) {
            Some((direction, length_mm)) => self.optical_depth_along(a, direction, length_mm, f64::INFINITY),
            None => f64::NAN,
        }
    }

    /// [`Self::optical_depth`] of many segments at once.
    pub fn optical_depths(&self, segments: &[(DVec3, DVec3)]) -> Vec<f64> {
        segments.par_iter().map(|&(a, b)| self.optical_depth(a, b)).collect()
    }

    /// Cumulative optical depth along the segment from `a` to `b`, world mm, over depths `[0, |b - a|]` from `a`;
    /// without any extinction where the ends are not finite.
    pub fn curve(&self, a: DVec3, b: DVec3) -> OpticalDepthCurve<'_> {
        match direction_and_length(a, b) {
            Some((direction, length_mm)) => self.curve_along(a, direction, length_mm),
            None => OpticalDepthCurve::new(&self.laws, 0.0),
        }
    }

    /// Cumulative optical depth from `origin` along the unit `direction`, world mm; `length_mm` may be infinite.
    pub fn curve_along(&self, origin: DVec3, direction: DVec3, length_mm: f64) -> OpticalDepthCurve<'_> {
        let mut curve = OpticalDepthCurve::new(&self.laws, length_mm);
        self.traverse(origin, direction, length_mm, |piece| {
            curve.push(piece);
            ControlFlow::Continue(())
        });
        curve
    }

    /// Distances (mm) at which the ray from `origin` in the unit `direction`, world mm, enters (0 if it starts inside) and leaves
    /// the unclipped part of the domain; `None` where it misses.
    pub fn span_in_domain(&self, origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let ray = self.ray(origin, direction, f64::INFINITY)?;
        Some([ray.enter_mm, ray.exit_mm])
    }

    /// Ray from `origin` in the unit `direction`, world mm, clipped to the domain and by the clip planes.
    fn ray(&self, origin: DVec3, direction: DVec3, length_mm: f64) -> Option<Ray> {
        let planes = self.transfer_function.clip.iter();
        let interval =
            planes.fold([0.0, length_mm], |interval, plane| plane.cut(origin, direction, interval));
        let to_index = self.volume.index_from_world();
        let (origin, direction) = (to_index.transform_point3(origin), to_index.transform_vector3(direction));
        Ray::clipped(origin, direction, interval, self.volume.dims())
    }

    /// Whether there is any extinction along the ray from `origin` in the unit `direction`, world mm; `length_mm` may
    /// be infinite.
    pub fn meets_extinction(&self, origin: DVec3, direction: DVec3, length_mm: f64) -> bool {
        let mut met = false;
        self.traverse(origin, direction, length_mm, |_| {
            met = true;
            ControlFlow::Break(())
        });
        met
    }

    /// Transmittance between `x` (world mm) and the light: to a point light's position, or out of the domain for
    /// a directional one; NaN where either is not finite. Below 1e-17 it may be given as any number from 0 to 1e-17.
    pub fn transmittance_to_light(&self, x: DVec3, light: &Light) -> f64 {
        let (direction, length_mm) = light.from_point(x);
        (-self.optical_depth_along(x, direction, length_mm, OPAQUE)).exp()
    }

    /// Optical depth along a ray; the sum may stop beyond `enough`.
    fn optical_depth_along(&self, origin: DVec3, direction: DVec3, length_mm: f64, enough: f64) -> f64 {
        if !(origin.is_finite() && direction.is_finite()) {
            return f64::NAN;
        }
        let mut sum = 0.0;
        self.traverse(origin, direction, length_mm, |piece| {
            let law = &self.laws[piece.function].laws[piece.law];
            sum += law.integral(&piece.value, 0.0, 1.0) * (piece.end_mm - piece.start_mm);
            if sum < enough { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        sum
    }

    /// Visits the pieces of a ray that have extinction, in order.
    fn traverse(
        &self,
        origin: DVec3,
        direction: DVec3,
        length_mm: f64,
        visit: impl FnMut(RayPiece) -> ControlFlow<()>,
    ) {
        let Some(ray) = self.ray(origin, direction, length_mm) else { return };
        let dims = self.volume.dims();
        with_voxels!(self.volume.voxels(), array => {
            let (voxels, scaling) = (contiguous(array), self.volume.scaling());
            let labels = labelled(self.volume, &self.functions);
            let grid = VoxelGrid { voxels, dims, scaling, blocks: &self.blocks, labels };
            grid.traverse(&self.laws, &ray, visit)
        });
    }
}

/// Labels of a volume with the function of each.
fn labelled<'a>(volume: &'a Volume, functions: &'a [Option<usize>]) -> Option<Labelled<'a>> {
    volume.labels().map(|labels| Labelled { ranks: labels.ranks(), functions })
}

/// Voxels in memory order.
fn contiguous<V>(voxels: &Array3<V>) -> &[V] {
    voxels.as_slice().expect("a Volume refuses voxels that are not contiguous")
}

/// Unit direction from `a` to `b` and their distance; `None` where it is not finite.
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
