//! Tiles of a picture in which eye rays are cast, each with a depth range, from the projection of active bricks
//! (blocks of cells with extinction).
//!
//! Hadwiger et al. (2006, section 3) rasterise the faces of bricks to find the start and end of each ray. Here the
//! host projects the outer active bricks as spheres, and all rays of a tile share their bounds. Tiles of background
//! are not cast, and rays start behind empty space. On graphics cards [`super::device_tiles`] does this.

use super::brick_projection::{BrickProjection, PIXELS_AROUND};
use super::mesh::box_corners;
use super::shader::PICTURE_SIDE;
use crate::field::{ActiveBricks, FAR};
use crate::gpu::WorkOrder;
use crate::mesh::Mesh;
use crate::scene::Scene;
use crate::volume::Volume;
use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec2, IVec3};
use rayon::prelude::*;
use std::ops::Range;

/// Tile of a picture on the device, with the depth range of its eye rays: `Tile` of `shaders/render/frame.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(super) struct TileUniform {
    pub at: [u32; 2],
    pub nearest_mm: f32,
    pub farthest_mm: f32,
}

/// Number of bricks (blocks of voxel cells) that a thread projects into the picture as one parallel task.
const LEAST_SHARE: usize = 1 << 11;

/// Tiles of a picture, row by row, each with the depth range of its active bricks (blocks of cells with extinction).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct EyeTiles {
    across: u32,
    /// Smallest and largest depth (mm) of the bricks with extinction in each tile of the picture, along the view
    /// direction. Depths count from the plane through the volume's centre; the smallest exceeds the largest in an
    /// empty tile.
    depths: Vec<[f32; 2]>,
    /// Depth range of those bricks that cover all tiles of the picture, kept apart until it is merged into the range
    /// of every tile.
    everywhere: [f32; 2],
}

/// Returns the union of the depth ranges of two picture tiles.
fn widened(own: [f32; 2], other: [f32; 2]) -> [f32; 2] {
    [own[0].min(other[0]), own[1].max(other[1])]
}

const NOTHING: [f32; 2] = [FAR, -FAR];
/// Level of a mesh's bounding volume hierarchy whose boxes are projected into the picture; it has up to 64 boxes.
const MESH_LEVELS: usize = 6;

/// Returns the columns or rows of picture tiles that a range of pixels touches, with a margin.
fn tiles_of([lo, hi]: [f64; 2], size: f64) -> Range<usize> {
    let [lo, hi] = [lo - PIXELS_AROUND, hi + PIXELS_AROUND];
    if hi < 0.0 || lo >= size {
        return 0..0;
    }
    let tile = |pixel: f64| (pixel.clamp(0.0, size - 1.0) / f64::from(PICTURE_SIDE)) as usize;
    tile(lo)..tile(hi) + 1
}

impl EyeTiles {
    /// Returns all tiles of a picture, each with an unlimited depth range of its eye rays.
    pub fn all(scene: &Scene) -> Self {
        Self::filled(scene, [-FAR, FAR])
    }

    fn filled(scene: &Scene, depths: [f32; 2]) -> Self {
        let [across, down] = [scene.width, scene.height].map(|n| n.div_ceil(PICTURE_SIDE));
        Self { across, depths: vec![depths; across as usize * down as usize], everywhere: NOTHING }
    }

    /// Finds the tiles of a picture in which active bricks (blocks of cells with extinction) may be visible, and
    /// their depth ranges. Depths count from a plane across the view at `plane_mm` from the eye.
    pub fn of(scene: &Scene, volume: &Volume, active: &ActiveBricks, plane_mm: f64) -> Self {
        let BrickProjection { brick, first_center, radius_mm: radius, inside, pixels_per_tangent, size } =
            BrickProjection::of(scene, volume, active);
        let [width, height] = size;
        let mark = |tiles: &mut Self, at: &IVec3| {
            let center = first_center + brick * at.as_dvec3();
            let [near, far] = [center.z - radius, center.z + radius];
            if far <= 0.0 {
                return;
            }
            let from_eye = inside || near <= 0.0;
            let depths = [if from_eye { -FAR } else { (near - plane_mm) as f32 }, (far - plane_mm) as f32];
            // Tangents of the sphere; one that reaches behind the eye is bounded only on its far side.
            let (per_near, per_far) = (1.0 / near.max(1e-9), 1.0 / far);
            let range = |side: f64, scale: f64, size: f64| {
                let [lo, hi] = [side - radius, side + radius];
                let least = lo * if lo > 0.0 { per_far } else { per_near };
                let most = hi * if hi < 0.0 { per_far } else { per_near };
                [least, most].map(|tangent| 0.5 * size + scale * tangent)
            };
            let columns = range(center.x, pixels_per_tangent[0], width);
            let rows = range(-center.y, pixels_per_tangent[1], height);
            tiles.mark(columns, rows, size, depths);
        };
        let none = || Self::filled(scene, NOTHING);
        let share = |bricks: &[IVec3]| {
            let mut tiles = none();
            bricks.iter().for_each(|at| mark(&mut tiles, at));
            tiles
        };
        let mut tiles = active.outer().par_chunks(LEAST_SHARE).map(share).reduce(none, Self::with);
        let everywhere = tiles.everywhere;
        tiles.depths.iter_mut().for_each(|own| *own = widened(*own, everywhere));
        tiles
    }

    /// Returns the union of two sets of picture tiles, with the union of the depth ranges in each tile.
    fn with(mut self, other: Self) -> Self {
        for (own, other) in self.depths.iter_mut().zip(other.depths) {
            *own = widened(*own, other);
        }
        self.everywhere = widened(self.everywhere, other.everywhere);
        self
    }

    /// Extends the depth ranges of all picture tiles that a rectangle of pixels touches, by the depth range of a
    /// brick.
    fn mark(&mut self, columns: [f64; 2], rows: [f64; 2], size: [f64; 2], depths: [f32; 2]) {
        let (columns, rows) = (tiles_of(columns, size[0]), tiles_of(rows, size[1]));
        if columns.len() * rows.len() == self.depths.len() {
            // Thousands of bricks around the eye may cover all tiles.
            self.everywhere = widened(self.everywhere, depths);
            return;
        }
        for row in rows {
            let row = &mut self.depths[row * self.across as usize..][..self.across as usize];
            for own in &mut row[columns.clone()] {
                *own = widened(*own, depths);
            }
        }
    }

    /// Adds the tiles of the picture in which a mesh may be visible.
    #[must_use]
    pub fn with_mesh(mut self, scene: &Scene, mesh: &Mesh) -> Self {
        let frame = scene.camera.frame();
        let axes = DMat3::from_cols(frame.right, frame.up, frame.forward).transpose();
        let up = (0.5 * scene.camera.fov_deg.to_radians()).tan();
        let [width, height] = [scene.width, scene.height].map(f64::from);
        let scale = 0.5 * height / up;
        for bounds in mesh.boxes(MESH_LEVELS) {
            let corners = box_corners(bounds).map(|p| axes * (p - scene.camera.eye));
            if corners.iter().all(|p| p.z <= 0.0) {
                continue;
            }
            // A box that reaches behind the eye may be anywhere in the picture.
            let behind = corners.iter().any(|p| p.z <= 1e-6 * p.abs().max_element());
            let pixels = corners
                .map(|p| DVec2::new(0.5 * width + scale * p.x / p.z, 0.5 * height - scale * p.y / p.z));
            let ends = pixels
                .iter()
                .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[lo, hi], p| [lo.min(*p), hi.max(*p)]);
            let [lo, hi] = if behind { [DVec2::ZERO, DVec2::new(width, height)] } else { ends };
            let (columns, rows) = (tiles_of([lo.x, hi.x], width), tiles_of([lo.y, hi.y], height));
            for row in rows {
                let row = &mut self.depths[row * self.across as usize..][..self.across as usize];
                // Tiles with active bricks retain their depth range.
                row[columns.clone()]
                    .iter_mut()
                    .filter(|[near, far]| near > far)
                    .for_each(|own| *own = [0.0; 2]);
            }
        }
        self
    }

    /// Returns the depth range of each tile, row by row; the smallest exceeds the largest in an empty tile.
    #[cfg(test)]
    pub fn depths(&self) -> &[[f32; 2]] {
        &self.depths
    }

    /// Returns for each row of tiles the sum of their depth ranges, in hundredths of the largest, as a measure of the work
    /// of their eye rays.
    pub fn row_weights(&self) -> Vec<u64> {
        let depth = |[near, far]: &[f32; 2]| if near > far { 0.0 } else { (far - near).min(FAR) };
        let largest = self.depths.iter().map(depth).fold(1e-6, f32::max);
        let weight = |depths: &[f32; 2]| (100.0 * depth(depths) / largest).ceil() as u64;
        self.depths.chunks(self.across as usize).map(|row| row.iter().map(weight).sum()).collect()
    }

    /// Returns the number of all tiles of the picture, and the number of tiles in which nothing is visible.
    pub fn counts(&self) -> [usize; 2] {
        [self.depths.len(), self.depths.iter().filter(|[near, far]| near > far).count()]
    }

    /// Returns the tiles in a rectangle of the picture (in pixels), and the number of tiles in which eye rays are
    /// cast. These tiles come first; the rectangle starts at the corner of a tile.
    pub fn part(
        &self,
        [column, row]: [u32; 2],
        [columns, rows]: [u32; 2],
        order: WorkOrder,
    ) -> (Vec<TileUniform>, u32) {
        let place = |(x, y): (u32, u32)| {
            let [nearest_mm, farthest_mm] = self.depths[(y * self.across + x) as usize];
            TileUniform { at: [x * PICTURE_SIDE, y * PICTURE_SIDE], nearest_mm, farthest_mm }
        };
        let range = |first: u32, count: u32| first / PICTURE_SIDE..(first + count).div_ceil(PICTURE_SIDE);
        let columns = range(column, columns);
        let mut lines: Vec<u32> = range(row, rows).collect();
        order.spread_rows(&mut lines);
        let positions = order.positions([columns.len() as u32, lines.len() as u32]);
        let all = positions.map(|[x, y]| place((columns.start + x, lines[y as usize])));
        let (mut cast, rest): (Vec<_>, Vec<_>) = all.partition(|tile| tile.nearest_mm <= tile.farthest_mm);
        let count = cast.len() as u32;
        cast.extend(rest);
        (cast, count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::grid_from_world;
    use crate::phantom::Phantom;
    use crate::scene::Camera;
    use crate::transfer::{Quantity, TransferFunction};
    use crate::volume::BRICK_CELLS;
    use glam::DVec3;

    /// Asserts that each eye ray meets bricks with extinction only within the depth range of its picture tile.
    fn nothing_is_missed(volume: &Volume, active: &ActiveBricks, scene: &Scene) -> EyeTiles {
        let plane = 50.0;
        let tiles = EyeTiles::of(scene, volume, active, plane);
        let frame = scene.camera.frame();
        let grid_from_world = grid_from_world(volume);
        let up = (0.5 * scene.camera.fov_deg.to_radians()).tan();
        let right = up * f64::from(scene.width) / f64::from(scene.height);
        for (y, x) in (0..scene.height).flat_map(|y| (0..scene.width).map(move |x| (y, x))) {
            let ndc = |i: u32, n: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
            let along = frame.forward + right * ndc(x, scene.width) * frame.right
                - up * ndc(y, scene.height) * frame.up;
            let [near, far] = tiles.depths[((y / PICTURE_SIDE) * tiles.across + x / PICTURE_SIDE) as usize];
            for k in 0..1500 {
                let z = 0.2 * f64::from(k);
                let g = grid_from_world.transform_point3(scene.camera.eye + z * along);
                let brick = (g / BRICK_CELLS as f64).floor().as_ivec3();
                if active.distance_at(brick) == Some(0) {
                    let depth = (z - plane) as f32;
                    assert!(
                        near <= depth && depth <= far,
                        "{x}, {y}: {depth} not in {near}..{far}, {scene:?}"
                    );
                }
            }
        }
        tiles
    }

    #[test]
    fn no_active_brick_is_missed_from_anywhere() {
        let volume = Phantom::Shell.build(48).unwrap();
        let tf = TransferFunction::new(Quantity::Opacity, &[(400.0, 0.0), (600.0, 0.5)]);
        let active = ActiveBricks::of(volume.bricks(), &tf);
        let framing = Scene::framing(&volume);
        let away = framing.camera.eye - framing.camera.target;
        let at = |eye: DVec3, target: DVec3, fov_deg: f64| Camera { eye, target, fov_deg, ..framing.camera };
        let center = framing.camera.target;
        let cameras = [
            framing.camera,
            at(center + 0.6 * away, center + DVec3::new(9.0, -4.0, 14.0), 20.0),
            at(center, center + DVec3::new(1.0, 0.4, -0.3), 100.0),
            at(center + 0.2 * away, center, 130.0),
            at(center + DVec3::new(14.0, 2.0, 1.0), center - away, 75.0),
            at(center + 4.0 * away, center, 50.0),
            // Bricks on both sides of the plane through the eye, across the view.
            at(center + DVec3::new(27.0, 0.0, 3.0), center + DVec3::new(27.0, 100.0, 0.0), 60.0),
            at(center + DVec3::new(0.0, 0.0, 33.0), center + DVec3::new(100.0, 0.0, 30.0), 140.0),
        ];
        let mut left_out = 0;
        for (camera, [width, height]) in
            cameras.into_iter().zip([[40, 40], [61, 23], [17, 50]].into_iter().cycle())
        {
            let scene = Scene { camera, width, height, ..framing.clone() };
            left_out += nothing_is_missed(&volume, &active, &scene).counts()[1];
        }
        assert!(left_out > 20, "{left_out}");
    }

    #[test]
    fn a_part_has_each_of_its_tiles_once() {
        let volume = Phantom::Slab.build(8).unwrap();
        let scene = Scene { width: 100, height: 50, ..Scene::framing(&volume) };
        let mut tiles = EyeTiles::filled(&scene, NOTHING);
        tiles.mark([30.0, 40.0], [10.0, 12.0], [100.0, 50.0], [1.0, 2.0]);
        let (list, cast) = tiles.part([16, 8], [84, 20], WorkOrder::Spread);
        assert_eq!((list.len(), cast), (11 * 3, 3));
        assert!(
            list[..3].iter().all(|t| t.at[1] == 8 && (24..=40).contains(&t.at[0]) && t.farthest_mm == 2.0)
        );
        assert_eq!(tiles.counts(), [13 * 7, 13 * 7 - 3]);
        tiles.mark([f64::NEG_INFINITY, -5.0], [0.0, 9.0], [100.0, 50.0], [0.0, 9.0]);
        assert_eq!(tiles.counts()[1], 13 * 7 - 3, "beside the picture");
        assert_eq!(EyeTiles::all(&scene).part([0, 0], [100, 50], WorkOrder::Blocks).1, 13 * 7);
    }
}
