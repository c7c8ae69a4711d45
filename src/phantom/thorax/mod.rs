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

use super::grid::by_slices;
use crate::files::loading::Loading;
use crate::volume::IndexBox;
pub use anatomy::solids;
use glam::{Vec3, vec3};
use ndarray::Array3;
use noise::triangular;
use regions::{AIR, over, tissue};
use shape::Part;
pub use shape::Solid;
use std::ops::Range;

/// Default number of voxels of the chest phantom along x. Voxels are then 1.41 mm in plane, and slices 2 mm.
pub const DEFAULT_SIZE: usize = 256;
/// Extent of the chest phantom along x, y and z, mm.
const EXTENT_MM: Vec3 = vec3(360.0, 270.0, 256.0);
/// Amplitude of the noise of the chest phantom, HU. The distribution is triangular, with a standard deviation of
/// about 10.
const NOISE_HU: f32 = 24.0;

/// Returns the number of voxels of the chest phantom along x, y and z for `size` voxels along x.
pub fn dims(size: usize) -> [usize; 3] {
    [size, (3 * size / 4).max(1), (size / 2).max(1)]
}

/// Returns the distance between voxels of the chest phantom, mm.
pub fn spacing_mm(size: usize) -> [f64; 3] {
    let dims = dims(size);
    std::array::from_fn(|axis| f64::from(EXTENT_MM[axis]) / dims[axis] as f64)
}

/// Computes a box of voxels of the chest phantom with `size` voxels along x, in HU. They are incomplete if `loading` was
/// cancelled.
pub fn build(size: usize, solids: &[Solid], part: &IndexBox, loading: &Loading) -> Array3<i16> {
    let [nx, ny, nz] = dims(size);
    let spacing = Vec3::from_array(spacing_mm(size).map(|s| s as f32));
    let first = -0.5 * spacing * vec3(nx as f32 - 1.0, ny as f32 - 1.0, nz as f32 - 1.0);
    let [xs, ys, _] = part;
    by_slices(part, loading, |k, plane: &mut [i16]| {
        let z = first.z + k as f32 * spacing.z;
        let pixels = plane.len();
        let sides = [xs.clone(), ys.clone()];
        let mut slice = Slice { hu: vec![AIR; pixels], nearest: vec![0.0; pixels], sides, first, spacing, z };
        for (j, row) in ys.clone().zip(slice.hu.chunks_exact_mut(xs.len())) {
            // The largest slices take a tenth of a second.
            if loading.is_cancelled() {
                return;
            }
            let y = first.y + j as f32 * spacing.y;
            for (i, hu) in xs.clone().zip(row) {
                *hu = tissue(vec3(first.x + i as f32 * spacing.x, y, z), spacing);
            }
        }
        for solid in solids {
            slice.paint(solid);
        }
        let places = ys.clone().flat_map(|j| xs.clone().map(move |i| (k * ny + j) * nx + i));
        for (at, (voxel, hu)) in places.zip(plane.iter_mut().zip(&slice.hu)) {
            let noise = NOISE_HU * triangular(at as u64);
            // Rounds to nearest: the sum is within +-4096, where a truncating cast is quicker than `round`.
            *voxel = ((hu + noise + 4096.5) as i32 - 4096).max(-1024) as i16;
        }
    })
}

/// Slice of the chest phantom into which solids are painted.
struct Slice {
    hu: Vec<f32>,
    /// Signed distance of each pixel of the phantom slice to the nearest primitive of the solid that is being
    /// painted, in voxels.
    nearest: Vec<f32>,
    /// Columns and rows of the slice.
    sides: Rectangle,
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
        let [xs, ys] = &self.sides;
        let within = |from: f32, to: f32, side: &Range<usize>| {
            (from as usize).max(side.start)..(to as usize).min(side.end)
        };
        Some([within(from.x, to.x, xs), within(from.y, to.y, ys)])
    }

    /// Returns the places in memory of some columns of a row.
    fn row(&self, j: usize, columns: &Range<usize>) -> Range<usize> {
        let [xs, ys] = &self.sides;
        let start = (j - ys.start) * xs.len();
        start + columns.start - xs.start..start + columns.end - xs.start
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
        if columns.is_empty() {
            return;
        }
        for j in rows.clone() {
            let row = self.row(j, &columns);
            self.nearest[row].fill(f32::MAX);
        }
        for (part, [columns, rows]) in &covered {
            for j in rows.clone() {
                let y = self.first.y + j as f32 * self.spacing.y;
                for i in columns.clone() {
                    let p = vec3(self.first.x + i as f32 * self.spacing.x, y, self.z);
                    let at = self.row(j, &(i..i)).start;
                    let nearest = &mut self.nearest[at];
                    *nearest = nearest.min(part.distance(p, self.spacing));
                }
            }
        }
        for j in rows {
            let row = self.row(j, &columns);
            for (hu, nearest) in self.hu[row.clone()].iter_mut().zip(&self.nearest[row]) {
                *hu = over(*hu, solid.hu, *nearest, 1.0);
            }
        }
    }
}
