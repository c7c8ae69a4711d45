//! Mapping between world points, the light frame (coordinates along the axes of the light) and the texels of a shadow
//! map. The host composes all transforms in `f64`; `shaders/field/light.wgsl` has the same mapping in `f32`.

use super::boxes::{GridBox, Region};
use crate::field::March;
use crate::field::constants::TILE;
use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec2, DVec3};

/// Settings of a shadow map that determine its projection: its number of texels, its extent, and the way light rays
/// are marched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapShape {
    /// Number of texels per side of the shadow map. `None`: about one per voxel, or more if a voxel covers several
    /// pixels of the picture.
    pub texels: Option<u32>,
    /// Whether a shadow map covers only the active bricks (blocks of cells with extinction) that the camera may see.
    pub fits_view: bool,
    /// Number of texels on each side of a point that a query of the shadow map reads.
    pub reach: u32,
    /// Number of texels beyond that of a point which a filter reads: empty ones surround the matter of a whole scene,
    /// and tiles so far from matter are built.
    pub border: u32,
    /// Way in which the light rays of the shadow map are marched: by cells, by samples, or by strands.
    pub march: March,
    /// Length of the march from a point towards the light before a query of the shadow map, in smallest voxel
    /// spacings.
    pub near: f64,
}

impl MapShape {
    /// Smallest number of texels per side of a shadow map with a border of empty texels. A smaller map has no border
    /// and covers all bricks with extinction.
    pub const LEAST_WITH_BORDER: u32 = 8;
}

/// Kind of projection from light rays to the texels of a shadow map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Projection {
    /// Orthographic shadow map: parallel rays of a directional light.
    Orthographic = 0,
    /// Perspective shadow map of a point light from which a cone contains all bricks with extinction.
    Perspective = 1,
    /// Octahedral shadow map, with rays in all directions, of a point light inside or close to the bricks with
    /// extinction.
    Octahedral = 2,
}

/// Maps a direction to a point in the square `[-1, 1]^2` of the octahedral projection.
fn octahedral_from_direction(w: DVec3) -> DVec2 {
    let p = w.truncate() / (w.x.abs() + w.y.abs() + w.z.abs()).max(1e-300);
    if w.z >= 0.0 { p } else { fold_octahedron(p) }
}

/// Returns the unit direction of a point in the square `[-1, 1]^2` of the octahedral projection.
fn direction_from_octahedral(p: DVec2) -> DVec3 {
    let z = 1.0 - p.x.abs() - p.y.abs();
    let p = if z >= 0.0 { p } else { fold_octahedron(p) };
    p.extend(z).normalize()
}

fn fold_octahedron(p: DVec2) -> DVec2 {
    let sign = |v: f64| if v >= 0.0 { 1.0 } else { -1.0 };
    DVec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y))
}

/// Uniform of a shadow map's projection: `LightSpace` of `shaders/field/light.wgsl`.
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
    pub near_mm: f32,
    pub texel_mm: f32,
    pub padding: [f32; 3],
}

/// Projection of a shadow map: from world points to texel coordinates, and to depth along the light rays in mm.
#[derive(Debug, Clone)]
pub struct LightSpace {
    /// Kind of projection of the shadow map: orthographic, perspective or octahedral.
    pub projection: Projection,
    /// Number of texels per side of the shadow map.
    pub map_size: u32,
    /// Affine transform from the light frame (coordinates along the axes of the light, mm) to world coordinates (mm).
    pub(super) world_from_frame: DAffine3,
    pub(super) frame_from_world: DAffine3,
    pub(super) grid_from_world: DAffine3,
    /// Distance from the point light of a perspective shadow map to the origin of the light frame (coordinates along
    /// the axes of the light), mm.
    pub(super) light_distance: f64,
    /// Scale from coordinates in the projection plane to texel coordinates of the shadow map: texel = plane * scale +
    /// offset. Texel centres lie at whole numbers.
    pub(super) texel_scale: DVec2,
    pub(super) texel_offset: DVec2,
    /// Smallest and largest depth along the light rays of the shadow map, mm. All active bricks (blocks of cells with
    /// extinction) lie between them.
    pub z_range: [f64; 2],
    /// Distance between regular samples along a light ray, mm; 0 if light rays are marched in another way.
    pub step_mm: f64,
    /// Length of the march from a point towards the light before a query of the shadow map, mm.
    pub near_mm: f64,
    /// Rectangle of the projection plane that the shadow map covers, if it was fitted to a camera view. `None`: the
    /// map covers all bricks with extinction.
    pub(super) region: Option<Region>,
    pub(super) shape: MapShape,
}

impl LightSpace {
    /// Returns the texel coordinates of a world point in the shadow map (texel centres at whole numbers), and its
    /// depth along the light ray (mm).
    pub fn light_point(&self, world: DVec3) -> (DVec2, f64) {
        let p = self.frame_from_world.transform_point3(world);
        (self.plane(p) * self.texel_scale + self.texel_offset, self.depth(p))
    }

    /// Returns the light ray through texel coordinates of the shadow map: its world point at depth 0, and its unit
    /// direction away from the light.
    pub fn world_ray(&self, texel: DVec2) -> (DVec3, DVec3) {
        let plane = (texel - self.texel_offset) / self.texel_scale;
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

    /// Returns the depth at which light rays start, mm: at a point light, or before all bricks with extinction for a
    /// directional light.
    pub fn ray_start(&self) -> f64 {
        match self.projection {
            Projection::Orthographic => self.z_range[0],
            Projection::Perspective => (-self.light_distance).max(self.z_range[0]),
            Projection::Octahedral => 0.0,
        }
    }

    /// Returns the length of the shadow map's depth range along the light rays, mm; always above 0.
    pub fn depth_range_mm(&self) -> f64 {
        (self.z_range[1] - self.z_range[0]).max(1e-9)
    }

    /// Returns the width of a texel in the middle of the shadow map, mm.
    pub fn texel_mm(&self) -> f64 {
        self.mm_per_plane() * (1.0 / self.texel_scale).max_element()
    }

    /// Returns a bound on the distance (mm) from a point of the volume to the light rays, at equal depth, through the
    /// texel centres around it.
    pub fn texel_reach_mm(&self) -> f64 {
        // Length of the diagonal of a texel where texels are largest. A unit of coordinates in an octahedron's plane
        // turns the direction by at most 3: sqrt(3) for the slope of its faces, sqrt(3) for the distance to them.
        let mm_per_plane = match self.projection {
            Projection::Orthographic => 1.0,
            Projection::Perspective => self.z_range[1] + self.light_distance,
            Projection::Octahedral => 3.0 * self.z_range[1],
        };
        mm_per_plane * (1.0 / self.texel_scale).length()
    }

    /// Returns the texel `[column, row]` and the texels at (1, 0), (0, 1) and (1, 1) from it: those that a query
    /// between their centres reads. Beyond its edges a map repeats its last texels; an octahedral map continues at
    /// the mirrored position of the same edge.
    pub fn texels_around(&self, [column, row]: [u32; 2]) -> [[u32; 2]; 4] {
        let last = i64::from(self.map_size) - 1;
        [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[right, down]| {
            let (mut c, mut r) = (i64::from(column) + right, i64::from(row) + down);
            if self.projection == Projection::Octahedral {
                if c > last {
                    (c, r) = (last, last - r);
                }
                if !(0..=last).contains(&r) {
                    (c, r) = (last - c, r.clamp(0, last));
                }
            }
            [c, r].map(|at| at.clamp(0, last) as u32)
        })
    }

    /// Returns the length in mm of one unit of coordinates in the projection plane, at the middle of the shadow map.
    pub(super) fn mm_per_plane(&self) -> f64 {
        match self.projection {
            Projection::Orthographic => 1.0,
            Projection::Perspective => self.light_distance,
            Projection::Octahedral => self.z_range[1],
        }
    }

    /// Returns the number of tiles (squares of texels) along a side of the shadow map.
    pub fn tiles_across(&self) -> u32 {
        self.map_size.div_ceil(TILE)
    }

    /// Returns the device uniform of the shadow map's projection, for binding 0 of bind group 1.
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
            near_mm: self.near_mm as f32,
            texel_mm: self.texel_mm() as f32,
            padding: [0.0; 3],
        }
    }

    /// Returns the coordinates of a point in the projection plane of the shadow map. The point is given along the
    /// axes of the light.
    pub(super) fn plane(&self, p: DVec3) -> DVec2 {
        match self.projection {
            Projection::Orthographic => p.truncate(),
            Projection::Perspective => p.truncate() / (p.z + self.light_distance),
            Projection::Octahedral => octahedral_from_direction(p),
        }
    }

    /// Returns the depth of a point along the light ray, mm. The point is given along the axes of the light.
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

    /// Returns a range of depths along the light rays that contains a box of volume cells, mm. The range may be
    /// larger than necessary.
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
        // The distance to the light changes by at most the distance to the centre.
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
    use crate::gpu::{StructLayout, wgsl_layout};
    use std::mem::offset_of;

    #[test]
    fn the_uniform_has_one_layout() {
        let shader = field_shader("render/query.wgsl")
            .with_depth_march()
            .modules(&["shadow/rays/lookup.wgsl", "shadow/direct.wgsl"]);
        // The rows of the affine are an array in Rust and three vectors in WGSL.
        let StructLayout { size, mut members } = wgsl_layout(&shader, "LightSpace");
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
            ("near_mm", offset_of!(LightUniform, near_mm)),
            ("texel_mm", offset_of!(LightUniform, texel_mm)),
        ];
        let expected = offsets.map(|(name, at)| (name.to_string(), at)).to_vec();
        assert_eq!((size, members), (size_of::<LightUniform>(), expected));
    }
}
