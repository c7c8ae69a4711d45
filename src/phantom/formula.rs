//! Voxels of a phantom, computed for any box of the volume.

use super::foam::Foam;
use super::grid::{CUBE_MM, INSIDE, by_slices, centred};
use super::media::{Metaballs, sheets};
use super::thorax;
use crate::error::Result;
use crate::files::loading::Loading;
use crate::volume::{Element, IndexBox, VoxelSource, Voxels};
use glam::DVec3;
use ndarray::Array3;

/// Phantom of a given size, whose voxels are computed where they are needed.
#[derive(Debug)]
pub(super) struct Formula {
    /// Number of voxels along the longest side.
    size: usize,
    shape: Shape,
}

/// Shape of a phantom, with what is the same for all of its voxels.
#[derive(Debug)]
pub(super) enum Shape {
    Chest(Vec<thorax::Solid>),
    Slab,
    Sphere,
    Shell,
    Step,
    Comb,
    Balls(Metaballs),
    Foam(Foam),
    Sheets,
}

impl VoxelSource for Formula {
    fn dims(&self) -> [usize; 3] {
        match self.shape {
            Shape::Chest(_) => thorax::dims(self.size),
            _ => [self.size; 3],
        }
    }

    fn element(&self) -> Element {
        match self.shape {
            Shape::Sphere | Shape::Shell => Element::F32,
            _ => Element::I16,
        }
    }

    fn read(&self, part: &IndexBox) -> Result<Voxels> {
        Ok(self.voxels(part, &Loading::default()))
    }
}

impl Formula {
    /// Phantom of a shape with `size` voxels along the longest side.
    pub fn new(shape: Shape, size: usize) -> Self {
        Self { size, shape }
    }

    /// Returns the distance between voxels, mm.
    pub fn spacing_mm(&self) -> [f64; 3] {
        match self.shape {
            Shape::Chest(_) => thorax::spacing_mm(self.size),
            _ => [CUBE_MM / self.size as f64; 3],
        }
    }

    /// Computes the voxels of a box; they are incomplete if `loading` was cancelled.
    pub fn voxels(&self, part: &IndexBox, loading: &Loading) -> Voxels {
        let size = self.size;
        match &self.shape {
            Shape::Chest(solids) => thorax::build(size, solids, part, loading).into(),
            Shape::Slab => solid(part, loading, |[_, _, k]| (size / 4..size - size / 4).contains(&k)),
            Shape::Step => solid(part, loading, |[i, _, _]| i >= size / 2),
            Shape::Comb => solid(part, loading, |[_, _, k]| k % 4 == 2),
            Shape::Sphere => self.radial(part, loading, |r| 1.0 - (r / (CUBE_MM / 2.0)).powi(2)),
            Shape::Shell => self.radial(part, loading, |r| (1.0 - (r - 20.0).abs() / 8.0).max(0.0)),
            Shape::Balls(balls) => self.medium(part, loading, |at| balls.share(at)),
            Shape::Foam(foam) => foam.voxels(size, part, loading).into(),
            Shape::Sheets => self.medium(part, loading, sheets),
        }
    }

    /// Computes voxels that are [`INSIDE`] times a function of the distance from the centre in mm.
    fn radial(&self, part: &IndexBox, loading: &Loading, share: impl Fn(f64) -> f64 + Sync) -> Voxels {
        let size = self.size;
        let centred = |i: usize| (i as f64 - (size as f64 - 1.0) / 2.0) * (CUBE_MM / size as f64);
        let value = |at: [usize; 3]| (INSIDE * share(DVec3::from_array(at.map(centred)).length())) as f32;
        fill(part, loading, value).into()
    }

    /// Computes voxels that are [`INSIDE`] times a function of the position, rounded to integers. Positions are in units of
    /// half the cube's edge.
    fn medium(&self, part: &IndexBox, loading: &Loading, share: impl Fn(DVec3) -> f64 + Sync) -> Voxels {
        let position = |at: [usize; 3]| DVec3::from_array(at.map(|i| centred(i, self.size)));
        fill(part, loading, |at| (INSIDE * share(position(at))).round() as i16).into()
    }
}

/// Computes voxels that are [`INSIDE`] where `inside` returns true, and 0 elsewhere.
fn solid(part: &IndexBox, loading: &Loading, inside: impl Fn([usize; 3]) -> bool + Sync) -> Voxels {
    fill(part, loading, |at| if inside(at) { INSIDE as i16 } else { 0 }).into()
}

/// Computes the voxels of a box from a function of the voxel index `[i, j, k]`; they are incomplete if `loading` was
/// cancelled.
fn fill<T: Copy + Default + Send + Sync>(
    part: &IndexBox,
    loading: &Loading,
    value: impl Fn([usize; 3]) -> T + Sync,
) -> Array3<T> {
    by_slices(part, loading, |k, slice| {
        let [xs, ys, _] = part;
        for (j, row) in ys.clone().zip(slice.chunks_exact_mut(xs.len())) {
            xs.clone().zip(row).for_each(|(i, v)| *v = value([i, j, k]));
        }
    })
}
