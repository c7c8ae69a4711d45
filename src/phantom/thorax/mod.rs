//! CT-like chest phantom in HU: lungs with vessels and airways, a heart with contrast, ribs, spine and sternum, on a
//! scanner table. It is centred in RAS+ mm, and made for pictures, not for diagnosis.
//!
//! Large regions are implicit functions of position. Bones and vessels are tubes, plates and ellipsoids painted over
//! them in order. Detector and reconstruction of a scanner each average over about one voxel. Every edge is therefore
//! a step filtered by a tent two voxels wide, as a function of the distance along the surface normal. On curved
//! surfaces the error is a few hundredths of the step (see the test); supersampling would be more exact at a hundred
//! times the cost.

mod anatomy;
mod noise;
mod regions;
mod shape;

use crate::files::loading::{Loading, ReadingStage};
use anatomy::solids;
use glam::{Vec3, vec3};
use ndarray::Array3;
use noise::triangular;
use rayon::prelude::*;
use regions::{AIR, over, tissue};
use shape::{Part, Solid};
use std::ops::Range;

/// Default number of voxels of the chest phantom along x. Voxels are then 1.41 mm in plane, and slices 2 mm.
pub const DEFAULT_SIZE: usize = 256;
/// Extent of the chest phantom along x, y and z, mm.
const EXTENT_MM: Vec3 = vec3(360.0, 270.0, 256.0);
/// Amplitude of the noise of the chest phantom, HU. The distribution is triangular, with a standard deviation of
/// about 10.
const NOISE_HU: f32 = 24.0;

/// Builds the chest phantom with `size` voxels along x; returns the voxels in HU and the voxel size in mm. The volume
/// is incomplete if `loading` was cancelled.
pub fn build(size: usize, loading: &Loading) -> (Array3<i16>, [f64; 3]) {
    let dims = [size, (3 * size / 4).max(1), (size / 2).max(1)];
    let [nx, ny, nz] = dims;
    let spacing_mm: [f64; 3] = std::array::from_fn(|axis| f64::from(EXTENT_MM[axis]) / dims[axis] as f64);
    let spacing = Vec3::from_array(spacing_mm.map(|s| s as f32));
    let first = -0.5 * spacing * vec3(nx as f32 - 1.0, ny as f32 - 1.0, nz as f32 - 1.0);
    let solids = solids();

    let mut voxels = Array3::default((nz, ny, nx));
    let planes = voxels.as_slice_mut().unwrap_or_default().par_chunks_mut(nx * ny);
    let pieces = loading.pieces(ReadingStage::Building, nz);
    planes.enumerate().for_each(|(k, plane)| {
        if pieces.is_cancelled() {
            return;
        }
        let z = first.z + k as f32 * spacing.z;
        let mut slice =
            Slice { hu: vec![AIR; nx * ny], nearest: vec![0.0; nx * ny], sides: [nx, ny], first, spacing, z };
        for (j, row) in slice.hu.chunks_exact_mut(nx).enumerate() {
            // The largest slices take a tenth of a second.
            if pieces.is_cancelled() {
                return;
            }
            let y = first.y + j as f32 * spacing.y;
            for (i, hu) in row.iter_mut().enumerate() {
                *hu = tissue(vec3(first.x + i as f32 * spacing.x, y, z), spacing);
            }
        }
        for solid in &solids {
            slice.paint(solid);
        }
        let hu = slice.hu;
        for (at, (voxel, hu)) in plane.iter_mut().zip(&hu).enumerate() {
            let noise = NOISE_HU * triangular((k * nx * ny + at) as u64);
            // Rounds to nearest: the sum is within +-4096, where a truncating cast is quicker than `round`.
            *voxel = ((hu + noise + 4096.5) as i32 - 4096).max(-1024) as i16;
        }
        pieces.done();
    });
    (voxels, spacing_mm)
}

/// Slice of the chest phantom into which solids are painted.
struct Slice {
    hu: Vec<f32>,
    /// Signed distance of each pixel of the phantom slice to the nearest primitive of the solid that is being
    /// painted, in voxels.
    nearest: Vec<f32>,
    sides: [usize; 2],
    /// Position of the first voxel of the chest phantom, mm.
    first: Vec3,
    spacing: Vec3,
    z: f32,
}

/// Ranges of pixel columns and rows in a slice of the chest phantom.
type Rectangle = [Range<usize>; 2];

impl Slice {
    /// Returns the pixels of the phantom slice that a geometric primitive with its blurred edge may cover.
    fn covered_by(&self, part: &Part) -> Option<Rectangle> {
        let (low, high) = (part.low - self.spacing, part.high + self.spacing);
        if self.z < low.z || self.z > high.z {
            return None;
        }
        let from = ((low - self.first) / self.spacing).ceil().max(Vec3::ZERO);
        let to = ((high - self.first) / self.spacing).floor() + 1.0;
        // A float beyond the range of usize saturates, so a part outside the grid gives an empty range.
        let [nx, ny] = self.sides;
        Some([from.x as usize..(to.x as usize).min(nx), from.y as usize..(to.y as usize).min(ny)])
    }

    /// Paints a solid over the slice of the chest phantom.
    fn paint(&mut self, solid: &Solid) {
        let covered: Vec<(&Part, Rectangle)> =
            solid.parts.iter().filter_map(|part| Some((part, self.covered_by(part)?))).collect();
        let join = |a: Rectangle, (_, b): &(&Part, Rectangle)| -> Rectangle {
            std::array::from_fn(|axis| a[axis].start.min(b[axis].start)..a[axis].end.max(b[axis].end))
        };
        let Some((_, first)) = covered.first() else { return };
        let [columns, rows] = covered.iter().fold(first.clone(), join);
        let nx = self.sides[0];
        if columns.is_empty() {
            return;
        }
        for j in rows.clone() {
            self.nearest[j * nx..][columns.clone()].fill(f32::MAX);
        }
        for (part, [columns, rows]) in &covered {
            for j in rows.clone() {
                let y = self.first.y + j as f32 * self.spacing.y;
                for i in columns.clone() {
                    let p = vec3(self.first.x + i as f32 * self.spacing.x, y, self.z);
                    let nearest = &mut self.nearest[j * nx + i];
                    *nearest = nearest.min(part.distance(p, self.spacing));
                }
            }
        }
        for j in rows {
            let row = j * nx + columns.start..j * nx + columns.end;
            for (hu, nearest) in self.hu[row.clone()].iter_mut().zip(&self.nearest[row]) {
                *hu = over(*hu, solid.hu, *nearest, 1.0);
            }
        }
    }
}
