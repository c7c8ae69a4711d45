//! Camera framing: computes the bounds of all that is visible of a volume, and a camera whose picture they fill.

use crate::field::{ActiveBricks, extinction_intervals};
use crate::mesh::Mesh;
use crate::scene::Camera;
use crate::transfer::{LabelClass, TransferFunction};
use crate::volume::{BRICK_CELLS, Volume, VoxelBlock};
use glam::{DVec3, IVec3};
use std::sync::Arc;

/// Margin between the projected visible bounds of a volume and the edge of the picture, as a share of half the
/// picture's size.
const MARGIN: f64 = 0.05;
/// Smallest distance of the eye from the nearest visible point of a volume, relative to the extent of the visible
/// bounds along the view direction.
const BEFORE: f64 = 0.1;

/// Visible bounds of a volume: the cells with extinction and the opaque mesh, or the whole domain if there is
/// neither. They do not depend on the camera or the shading.
#[derive(Debug)]
pub struct VisibleBounds {
    volume: Arc<Volume>,
    /// Bricks (blocks of voxel cells) with extinction next to a brick without, or at the border of the volume. They
    /// enclose all other bricks with extinction.
    outer: Vec<IVec3>,
    /// Intervals of voxel values with extinction, for each transfer function that segmentation labels use.
    intervals: Vec<Vec<[f64; 2]>>,
    /// Index of the transfer function for each segmentation label, in the order of the volume's labels; `None`: the
    /// label is hidden.
    functions: Vec<Option<usize>>,
    /// Clip planes in voxel index coordinates; the side with `normal · p >= offset` remains visible.
    planes: Vec<(DVec3, f64)>,
    mesh: Option<Arc<Mesh>>,
    center_mm: DVec3,
}

impl VisibleBounds {
    /// Computes the visible bounds of a volume under a transfer function, together with an optional opaque mesh.
    pub fn of(volume: &Arc<Volume>, tf: &TransferFunction, mesh: Option<&Arc<Mesh>>) -> Self {
        let active = ActiveBricks::of(volume.bricks(), tf);
        let to_world = |index: DVec3| volume.world_from_index().transform_point3(index);
        let of_field = active.index_box(volume.dims()).map(|[lo, hi]| {
            let corner = |c: usize| {
                DVec3::from_array(std::array::from_fn(|a| if c >> a & 1 == 0 { lo[a] } else { hi[a] }))
            };
            (0..8).map(|c| to_world(corner(c))).collect::<Vec<_>>()
        });
        let corners =
            of_field.into_iter().flatten().chain(mesh.into_iter().flat_map(|mesh| mesh.bounds_mm()));
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [lo, hi] = corners.fold(none, |[lo, hi], p| [lo.min(p), hi.max(p)]);
        if lo.cmpgt(hi).any() {
            return Self::whole(volume);
        }
        let ids = volume.labels().map_or(&[][..], |labels| labels.ids());
        let function = |id: &u32| match tf.class_of(*id) {
            LabelClass::Hidden => None,
            LabelClass::Function(function) => Some(function),
        };
        Self {
            volume: Arc::clone(volume),
            outer: active.outer().to_vec(),
            intervals: tf.functions().map(extinction_intervals).collect(),
            functions: ids.iter().map(function).collect(),
            planes: tf.clip.iter().map(|plane| plane.in_coordinates(volume.world_from_index())).collect(),
            mesh: mesh.map(Arc::clone),
            center_mm: 0.5 * (lo + hi),
        }
    }

    /// Returns bounds that contain the whole domain of a volume, whether it is visible or not.
    pub fn whole(volume: &Arc<Volume>) -> Self {
        let center_mm = volume.center_mm();
        let (intervals, functions, planes) = (Vec::new(), Vec::new(), Vec::new());
        let volume = Arc::clone(volume);
        Self { volume, outer: Vec::new(), intervals, functions, planes, mesh: None, center_mm }
    }

    /// Returns the volume whose visible bounds these are.
    pub fn volume(&self) -> &Volume {
        &self.volume
    }

    /// Returns the centre of the bounding box of all that is visible of the volume and the mesh, world mm. Its error
    /// is at most the size of a brick (block of voxel cells).
    pub fn center_mm(&self) -> DVec3 {
        self.center_mm
    }

    /// Returns a camera that looks from the side `away` and shows all of the visible bounds, from as close as
    /// possible. The picture is `aspect` times as wide as high; a small margin remains at the edges that the bounds
    /// reach.
    pub fn framed(&self, away: DVec3, up: DVec3, fov_deg: f64, aspect: f64) -> Camera {
        let forward = -away.normalize();
        let right = forward.cross(up).normalize_or(forward.any_orthonormal_vector());
        let frame_up = right.cross(forward);
        let half_y = (0.5 * fov_deg.to_radians()).tan() * (1.0 - MARGIN);
        let half_x = half_y * aspect;
        // A point p is left of the picture's right edge where (p - eye) (right - half_x forward) <= 0, and so on:
        // each side gives one bound on the eye, two opposite ones the depth at which both just hold.
        let side = |across: DVec3, half: f64| {
            let ends = [1.0, -1.0].map(|sign| self.furthest(sign * across - half * forward));
            (-(ends[0] + ends[1]) / (2.0 * half), 0.5 * (ends[0] - ends[1]))
        };
        let ((depth_x, x), (depth_y, y)) = (side(right, half_x), side(frame_up, half_y));
        // The eye stays in front of the nearest visible point, however wide the view is.
        let [far, near] = [self.furthest(forward), -self.furthest(-forward)];
        let depth = depth_x.min(depth_y).min(near - BEFORE * (far - near));
        let eye = depth * forward + x * right + y * frame_up;
        let target = eye + (self.center_mm.dot(forward) - depth) * forward;
        Camera { eye, target, up, fov_deg }
    }

    /// Returns the largest dot product of a visible world point with `direction`, with an error of at most one voxel
    /// cell.
    fn furthest(&self, direction: DVec3) -> f64 {
        let of_mesh = self.mesh.as_ref().map_or(f64::NEG_INFINITY, |mesh| {
            mesh.triangles().iter().flatten().map(|p| p.dot(direction)).fold(f64::NEG_INFINITY, f64::max)
        });
        if self.outer.is_empty() && self.mesh.is_none() {
            return self
                .volume
                .corners_mm()
                .iter()
                .map(|c| c.dot(direction))
                .fold(f64::NEG_INFINITY, f64::max);
        }
        // Uses the axes of the grid, along which boxes of cells are aligned.
        let world = self.volume.world_from_index();
        let (along, origin) = (world.matrix3.transpose() * direction, world.translation.dot(direction));
        let reach = |[lo, hi]: [DVec3; 2]| origin + (along * lo).max(along * hi).element_sum();
        let dims = self.volume.dims().map(|n| n as i32);
        let mut bounds: Vec<(f64, IVec3)> = self
            .outer
            .iter()
            .map(|brick| (reach(cells_box(*brick * BRICK_CELLS as i32, BRICK_CELLS as i32, dims)), *brick))
            .collect();
        // Visits first the bricks that may reach furthest, until no other brick can. Neighbouring cells share voxels,
        // and so a brick with extinction has a cell with extinction.
        bounds.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        let mut furthest = of_mesh;
        for (bound, brick) in &bounds {
            if *bound <= furthest {
                break;
            }
            let voxels = self.voxels_of(*brick);
            let cells = cells_of(*brick).filter(|cell| self.has_extinction(*cell, &voxels));
            furthest = cells.map(|cell| reach(cells_box(cell, 1, dims))).fold(furthest, f64::max);
        }
        // A clip plane may remove every cell of a brick that still counts as active, within the margin of that test.
        let of_bricks = bounds.first().map_or(furthest, |(bound, _)| *bound);
        if furthest.is_finite() { furthest } else { of_bricks }
    }

    /// Returns a block with the voxels that the cells of a brick interpolate.
    fn voxels_of(&self, brick: IVec3) -> VoxelBlock<'_> {
        let (first, dims) = (brick * BRICK_CELLS as i32, self.volume.dims());
        self.volume.block_or_zeros(&std::array::from_fn(|axis| {
            let last = dims[axis] - 1;
            let [low, high] = [first[axis] - 1, first[axis] - 1 + BRICK_CELLS as i32];
            (low.max(0) as usize).min(last)..(high as usize).min(last) + 1
        }))
    }

    /// Whether a cell of the volume may be visible: it has a value with extinction, its segmentation label is shown,
    /// and no clip plane removes the whole cell. The block has the cell's voxels.
    fn has_extinction(&self, cell: IVec3, block: &VoxelBlock<'_>) -> bool {
        let last = IVec3::from_array(self.volume.dims().map(|n| n as i32 - 1));
        if cell.cmpgt(last + 1).any() {
            return false;
        }
        let ends = [cell - 1, cell].map(|voxel| voxel.clamp(IVec3::ZERO, last).as_usizevec3());
        let value = |c: usize| {
            let pick = |axis: usize| ends[c >> axis & 1][axis];
            self.volume.scaling().apply(block.stored([pick(0), pick(1), pick(2)]))
        };
        let (low, high) =
            (0..8).map(value).fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        let has_some = |function: usize| {
            let intervals = &self.intervals[function];
            let next = intervals.partition_point(|[_, hi]| *hi < low);
            intervals.get(next).is_some_and(|[lo, _]| *lo <= high)
        };
        let dims = self.volume.dims();
        let shown = match self.volume.labels() {
            None => has_some(0),
            Some(labels) => (0..8).any(|c| {
                let pick = |axis: usize| ends[c >> axis & 1][axis];
                let place = pick(0) + dims[0] * (pick(1) + dims[1] * pick(2));
                self.functions[usize::from(labels.ranks()[place])].is_some_and(has_some)
            }),
        };
        let [lo, hi] = cells_box(cell, 1, dims.map(|n| n as i32));
        let kept =
            |(normal, offset): &(DVec3, f64)| (*normal * lo).max(*normal * hi).element_sum() >= *offset;
        shown && self.planes.iter().all(kept)
    }
}

fn cells_of(brick: IVec3) -> impl Iterator<Item = IVec3> {
    let side = BRICK_CELLS as i32;
    (0..side * side * side)
        .map(move |i| side * brick + IVec3::new(i % side, i / side % side, i / (side * side)))
}

/// Returns the box of `side` voxel cells along each axis, starting at `cell`, in voxel index coordinates and clipped
/// to the volume.
fn cells_box(cell: IVec3, side: i32, dims: [i32; 3]) -> [DVec3; 2] {
    // Cell c spans [c - 1, c].
    let end = DVec3::from_array(dims.map(|n| f64::from(n) - 0.5));
    [cell - 1, cell - 1 + side].map(|at| at.as_dvec3().clamp(DVec3::splat(-0.5), end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::Quantity;
    use crate::volume::{Provenance, Scaling, Voxels};
    use glam::{DAffine3, DMat3};
    use ndarray::Array3;

    /// Returns a test volume on an oblique grid, with value 1 inside a box of voxels and 0 around it.
    fn boxed(lo: [usize; 3], hi: [usize; 3]) -> Arc<Volume> {
        let inside =
            |(k, j, i): (usize, usize, usize)| (0..3).all(|a| (lo[a]..=hi[a]).contains(&[i, j, k][a]));
        let values = Array3::from_shape_fn((41, 33, 50), |at| u8::from(inside(at)));
        let axes = DMat3::from_rotation_y(0.3) * DMat3::from_diagonal(DVec3::new(1.5, 1.0, -0.7));
        let affine = DAffine3::from_mat3_translation(axes, DVec3::new(-40.0, 7.0, 300.0));
        let provenance = Provenance::new("box", "test", "u8");
        Arc::new(Volume::new(Voxels::U8(values), Scaling::IDENTITY, affine, provenance).unwrap())
    }

    /// Returns the range of picture coordinates (-1 to 1 along both axes) that the box of cells with extinction
    /// covers.
    fn reaches(
        volume: &Volume,
        lo: [usize; 3],
        hi: [usize; 3],
        camera: &Camera,
        aspect: f64,
    ) -> [[f64; 2]; 2] {
        let frame = camera.frame();
        let tan = (0.5 * camera.fov_deg.to_radians()).tan();
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for c in 0..8 {
            // A value above 0 is interpolated as far as the next voxel.
            let pick = |a: usize| if c >> a & 1 == 0 { lo[a] as f64 - 1.0 } else { hi[a] as f64 + 1.0 };
            let at = volume.world_from_index().transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
            let d = at - camera.eye;
            let z = d.dot(frame.forward) * tan;
            assert!(z > 0.0);
            for (ends, at) in ends.iter_mut().zip([d.dot(frame.right) / z / aspect, d.dot(frame.up) / z]) {
                *ends = [ends[0].min(at), ends[1].max(at)];
            }
        }
        ends
    }

    #[test]
    fn what_has_extinction_fills_the_picture_to_a_cell() {
        let tf = TransferFunction::new(Quantity::Extinction, &[(0.0, 0.0), (1.0, 0.1)]);
        for (lo, hi) in [([9, 7, 10], [22, 20, 25]), ([30, 1, 3], [30, 2, 3]), ([14, 14, 14], [16, 15, 17])] {
            let volume = boxed(lo, hi);
            let seen = VisibleBounds::of(&volume, &tf, None);
            for away in [DVec3::new(0.5, 0.8, 0.35), DVec3::X, DVec3::new(-0.2, -0.9, 0.7)] {
                for aspect in [0.3, 1.0, 2.5] {
                    let camera = seen.framed(away, DVec3::Z, 35.0, aspect);
                    let [x, y] = reaches(&volume, lo, hi, &camera, aspect);
                    // Both ends of one side are at the margin, and the other side's lie within, in the middle.
                    let edge = 1.0 - MARGIN;
                    let at_edge =
                        |ends: [f64; 2]| (ends[0] + edge).abs() < 1e-9 && (ends[1] - edge).abs() < 1e-9;
                    assert!(at_edge(x) || at_edge(y), "{away} {aspect}: {x:?} {y:?}");
                    for ends in [x, y] {
                        assert!(ends[0] >= -edge - 1e-9 && ends[1] <= edge + 1e-9, "{x:?} {y:?}");
                    }
                    let view = (camera.target - camera.eye).normalize();
                    assert!((view + away.normalize()).length() < 1e-9, "{view}");
                }
            }
        }
    }

    #[test]
    fn nothing_to_see_is_framed_by_the_domain() {
        let volume = boxed([9, 7, 10], [22, 20, 25]);
        let clear = TransferFunction::new(Quantity::Extinction, &[(0.0, 0.0), (1.0, 0.0)]);
        let (none, whole) = (VisibleBounds::of(&volume, &clear, None), VisibleBounds::whole(&volume));
        let camera = |seen: &VisibleBounds| seen.framed(DVec3::Y, DVec3::Z, 40.0, 1.0);
        assert_eq!(camera(&none), camera(&whole));
        // Extinction everywhere is the same, to the last cell.
        let full = TransferFunction::new(Quantity::Extinction, &[(0.0, 0.1), (1.0, 0.1)]);
        let [a, b] = [camera(&VisibleBounds::of(&volume, &full, None)), camera(&whole)];
        assert!((a.eye - b.eye).length() < 1e-9 && (a.target - b.target).length() < 1e-9);
    }
}
