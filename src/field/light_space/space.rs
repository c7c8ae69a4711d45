//! The space of a map's light rays: texels across, millimetres along.

use super::boxes::{GridBox, active_boxes};
use super::projection::{Projection, direction_from_octahedral, octahedral_from_direction};
use super::region::Region;
use super::shape::MapShape;
use crate::field::ActiveBricks;
use crate::field::constants::TILE;
use crate::volume::Volume;
use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec2, DVec3};

/// `LightSpace` of `shaders/field/light.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(in crate::field) struct LightUniform {
    pub frame_from_grid: [[f32; 4]; 3],
    pub grid_per_a: [f32; 3],
    pub light_distance: f32,
    pub grid_per_b: [f32; 3],
    pub projection: u32,
    pub grid_per_h: [f32; 3],
    pub map_size: u32,
    pub grid_origin: [f32; 3],
    pub tiles_across: u32,
    pub texel_scale: [f32; 2],
    pub texel_offset: [f32; 2],
    pub depth_start_mm: f32,
    pub depth_range_mm: f32,
    pub step_mm: f32,
    pub padding: f32,
}

/// A fitted projection.
#[derive(Debug, Clone)]
pub struct LightSpace {
    /// How light rays map to texels.
    pub projection: Projection,
    /// Texels a side.
    pub map_size: u32,
    /// World mm from light-frame mm.
    pub(super) world_from_frame: DAffine3,
    pub(super) frame_from_world: DAffine3,
    pub(super) grid_from_world: DAffine3,
    /// Distance from the light to the frame's origin, mm (perspective).
    pub(super) light_distance: f64,
    /// Texel coordinate (centres at whole numbers) = plane coordinate * scale + offset.
    pub(super) texel_scale: DVec2,
    pub(super) texel_offset: DVec2,
    /// Depths between which all active bricks lie, mm.
    pub z_range: [f64; 2],
    /// Distance of samples along a ray, mm, where light rays are marched by regular ones; else 0.
    pub step_mm: f64,
    /// What of the plane the map covers, where it was fitted to a view; `None`: all active bricks.
    pub(super) region: Option<Region>,
    pub(super) shape: MapShape,
}

impl LightSpace {
    /// Texel coordinates (centres at whole numbers) and depth (mm) of a world point.
    pub fn light_point(&self, world: DVec3) -> (DVec2, f64) {
        let p = self.frame_from_world.transform_point3(world);
        (self.plane(p) * self.texel_scale + self.texel_offset, self.depth(p))
    }

    /// World point of depth 0 on the ray through texel coordinates, and the ray's unit direction away from the light.
    pub fn world_ray(&self, texel: DVec2) -> (DVec3, DVec3) {
        self.ray_of_plane((texel - self.texel_offset) / self.texel_scale)
    }

    fn ray_of_plane(&self, plane: DVec2) -> (DVec3, DVec3) {
        let (start, w) = match self.projection {
            Projection::Orthographic => (plane.extend(0.0), DVec3::Z),
            Projection::Perspective => {
                let w = plane.extend(1.0).normalize();
                (self.light_distance * (w - DVec3::Z), w)
            }
            Projection::Octahedral => (DVec3::ZERO, direction_from_octahedral(plane)),
        };
        (self.world_from_frame.transform_point3(start), self.world_from_frame.transform_vector3(w))
    }

    /// The smallest depth that a ray has: where it leaves a point light, or far outside for a directional one.
    pub fn ray_start(&self) -> f64 {
        match self.projection {
            Projection::Orthographic => self.z_range[0],
            Projection::Perspective => (-self.light_distance).max(self.z_range[0]),
            Projection::Octahedral => 0.0,
        }
    }

    /// How far apart the ends of [`Self::z_range`] lie, mm; above 0.
    pub fn depth_range_mm(&self) -> f64 {
        (self.z_range[1] - self.z_range[0]).max(1e-9)
    }

    /// Width of a texel in the middle of the map, mm.
    pub fn texel_mm(&self) -> f64 {
        self.mm_per_plane() * (1.0 / self.texel_scale).max_element()
    }

    /// Millimetres across the light in the middle of what is covered, for each unit of the plane's coordinates.
    pub(super) fn mm_per_plane(&self) -> f64 {
        match self.projection {
            Projection::Orthographic => 1.0,
            Projection::Perspective => self.light_distance,
            Projection::Octahedral => self.z_range[1],
        }
    }

    /// Tiles along a side of the map.
    pub fn tiles_across(&self) -> u32 {
        self.map_size.div_ceil(TILE)
    }

    /// Whether active bricks lie under each tile: row-major, [`Self::tiles_across`] squared. Never misses one; boxes
    /// stand in for bricks.
    pub fn occupied_tiles(&self, volume: &Volume, active: &ActiveBricks) -> Vec<bool> {
        let across = self.tiles_across();
        if self.projection == Projection::Octahedral {
            return vec![active.active > 0; (across * across) as usize];
        }
        let world_from_grid = self.grid_from_world.inverse();
        let mut tiles = vec![false; (across * across) as usize];
        let [first, end] = self.texels_covered().unwrap_or([DVec2::NEG_INFINITY, DVec2::INFINITY]);
        for brick in active_boxes(active, volume.dims()) {
            let (lo, hi) = self.texels(&world_from_grid, brick);
            // Taps of the pre-filter and rounding reach a little past a brick's own texels.
            let (lo, hi) = ((lo - 1.0).max(first), (hi + 1.0).min(end));
            if lo.cmpgt(hi).any() {
                continue;
            }
            let last = i64::from(across) - 1;
            let tile = |t: f64| ((t / f64::from(TILE)).floor() as i64).clamp(0, last) as usize;
            for y in tile(lo.y)..=tile(hi.y) {
                for x in tile(lo.x)..=tile(hi.x) {
                    tiles[y * across as usize + x] = true;
                }
            }
        }
        tiles
    }

    /// The uniform for the device, binding 0 of group 1.
    pub(in crate::field) fn uniform(&self) -> LightUniform {
        let frame_from_grid = self.frame_from_world * self.grid_from_world.inverse();
        let grid_from_frame = self.grid_from_world * self.world_from_frame;
        let m = frame_from_grid.matrix3.transpose();
        let row = |r: DVec3, t: f64| [r.x as f32, r.y as f32, r.z as f32, t as f32];
        let t = frame_from_grid.translation;
        let g = grid_from_frame.matrix3;
        LightUniform {
            frame_from_grid: [row(m.x_axis, t.x), row(m.y_axis, t.y), row(m.z_axis, t.z)],
            grid_per_a: g.x_axis.as_vec3().to_array(),
            light_distance: self.light_distance as f32,
            grid_per_b: g.y_axis.as_vec3().to_array(),
            projection: self.projection as u32,
            grid_per_h: g.z_axis.as_vec3().to_array(),
            map_size: self.map_size,
            grid_origin: grid_from_frame.translation.as_vec3().to_array(),
            tiles_across: self.tiles_across(),
            texel_scale: self.texel_scale.as_vec2().to_array(),
            texel_offset: self.texel_offset.as_vec2().to_array(),
            depth_start_mm: self.z_range[0] as f32,
            depth_range_mm: self.depth_range_mm() as f32,
            step_mm: self.step_mm as f32,
            padding: 0.0,
        }
    }

    pub(super) fn plane(&self, p: DVec3) -> DVec2 {
        match self.projection {
            Projection::Orthographic => p.truncate(),
            Projection::Perspective => p.truncate() / (p.z + self.light_distance),
            Projection::Octahedral => octahedral_from_direction(p),
        }
    }

    pub(super) fn depth(&self, p: DVec3) -> f64 {
        match self.projection {
            Projection::Orthographic => p.z,
            Projection::Perspective => {
                let d = self.light_distance;
                // |x - light| - d without cancellation.
                (p.length_squared() + 2.0 * d * p.z) / ((p + DVec3::Z * d).length() + d)
            }
            Projection::Octahedral => p.length(),
        }
    }

    /// Texel rectangle that a box covers.
    fn texels(&self, world_from_grid: &DAffine3, bounds: GridBox) -> (DVec2, DVec2) {
        let frame_from_grid = self.frame_from_world * *world_from_grid;
        let mut lo = DVec2::INFINITY;
        let mut hi = DVec2::NEG_INFINITY;
        for g in bounds.corners() {
            let t = self.plane(frame_from_grid.transform_point3(g)) * self.texel_scale + self.texel_offset;
            lo = lo.min(t);
            hi = hi.max(t);
        }
        (lo, hi)
    }

    /// Depth range of a box, never too small.
    pub(super) fn depths(&self, world_from_grid: &DAffine3, bounds: GridBox) -> [f64; 2] {
        let frame_from_grid = self.frame_from_world * *world_from_grid;
        let center = frame_from_grid.transform_point3(bounds.center);
        let m = frame_from_grid.matrix3;
        if self.projection == Projection::Orthographic {
            let reach = (m.x_axis.z * bounds.half.x).abs()
                + (m.y_axis.z * bounds.half.y).abs()
                + (m.z_axis.z * bounds.half.z).abs();
            return [center.z - reach, center.z + reach];
        }
        // Distance to the light changes by no more than the way to the centre.
        let radius = bounds
            .corners()
            .iter()
            .map(|g| frame_from_grid.transform_point3(*g).distance(center))
            .fold(0.0, f64::max);
        let z = self.depth(center);
        [(z - radius).max(-self.light_distance), z + radius]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::field_shader;
    use crate::gpu::wgsl_layout;
    use std::mem::offset_of;

    #[test]
    fn the_uniform_has_one_layout() {
        let shader =
            field_shader("render/query.wgsl").with_depth_march().modules(&["shadow/rays/lookup.wgsl"]);
        // The rows of the affine are an array in Rust and three vectors in WGSL.
        let (size, mut members) = wgsl_layout(&shader, "LightSpace");
        let rows: Vec<_> = members.drain(..3).collect();
        for (row, axis) in ["a", "b", "h"].iter().enumerate() {
            let at = offset_of!(LightUniform, frame_from_grid) + row * size_of::<[f32; 4]>();
            assert_eq!(rows[row], (format!("frame_from_grid_{axis}"), at));
        }
        let offsets = [
            ("grid_per_a", offset_of!(LightUniform, grid_per_a)),
            ("light_distance", offset_of!(LightUniform, light_distance)),
            ("grid_per_b", offset_of!(LightUniform, grid_per_b)),
            ("projection", offset_of!(LightUniform, projection)),
            ("grid_per_h", offset_of!(LightUniform, grid_per_h)),
            ("map_size", offset_of!(LightUniform, map_size)),
            ("grid_origin", offset_of!(LightUniform, grid_origin)),
            ("tiles_across", offset_of!(LightUniform, tiles_across)),
            ("texel_scale", offset_of!(LightUniform, texel_scale)),
            ("texel_offset", offset_of!(LightUniform, texel_offset)),
            ("depth_start_mm", offset_of!(LightUniform, depth_start_mm)),
            ("depth_range_mm", offset_of!(LightUniform, depth_range_mm)),
            ("step_mm", offset_of!(LightUniform, step_mm)),
        ];
        let expected = offsets.map(|(name, at)| (name.to_string(), at)).to_vec();
        assert_eq!((size, members), (size_of::<LightUniform>(), expected));
    }
}
