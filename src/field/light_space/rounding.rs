//! Bounds on the float32 errors of positions on light rays.

use super::mapping::{LightSpace, Projection};
use crate::volume::{BRICK_CELLS, Volume};
use glam::{DMat3, DVec2, DVec3};

/// Number of float32 roundings in a coordinate of a point on a light ray, each of half a unit in the last place. They
/// are 3 for the coordinates in the projection plane (a division counts as 5), 3 for the direction, 4 for products
/// and sums, and 1 for mirroring; the rest is from the inputs.
const ROUNDINGS: f64 = 17.0;
/// Number of further float32 roundings, for the start of a light ray and a point on it, where the volume is mirrored
/// so that the ray runs along rising coordinates.
const MIRRORED_ROUNDINGS: f64 = 2.0;

/// Number of float32 roundings in a sum of four products, such as one row of an affine transform, whose factors are
/// rounded too.
const DOT_ROUNDINGS: f64 = 6.0;
/// Largest float32 error of a texel coordinate in a shadow map for which an error bound is given, in texels. The
/// error is larger near a point light.
const MOST_TEXEL_ERROR: f64 = 2.5e-4;

/// Bounds on the float32 errors of positions on the light rays of a shadow map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounding {
    /// Largest float32 error of a point's position on a light ray, mm.
    pub position_mm: f64,
    /// Largest float32 error of a point's texel coordinate in the shadow map, in texels. It does not hold within
    /// `from_light_mm` of a point light.
    pub texels: f64,
    /// Distance from a point light within which texel coordinates of the shadow map have no error bound, mm.
    pub from_light_mm: f64,
}

impl LightSpace {
    /// Returns bounds on the float32 errors of points on the light rays of a shadow map. `clips` says whether there
    /// are clip planes; see `docs/bound.md`, "Positions".
    pub fn rounding(&self, volume: &Volume, clips: bool) -> Rounding {
        // The distance of a clip plane is a sum of four products, too.
        let roundings = ROUNDINGS + if clips { DOT_ROUNDINGS } else { 0.0 };
        let unit = roundings * f64::from(f32::EPSILON) / 2.0;
        let world_from_grid = self.grid_from_world.inverse();
        let grid_from_frame = self.grid_from_world * self.world_from_frame;
        let frame_from_grid = self.frame_from_world * world_from_grid;
        // The largest plane coordinates of texels, and depths.
        let last = f64::from(self.map_size) - 0.5;
        let ends = [-0.5, last].map(|t| ((DVec2::splat(t) - self.texel_offset) / self.texel_scale).abs());
        let plane = ends[0].max(ends[1]);
        let deepest = self.z_range[0].abs().max(self.z_range[1].abs());
        let reach = match self.projection {
            Projection::Orthographic => DVec3::new(plane.x, plane.y, deepest),
            // Start and direction of the ray, each with its own roundings.
            Projection::Perspective => self.light_distance * plane.extend(plane.length_squared()) + deepest,
            Projection::Octahedral => DVec3::splat(deepest),
        };
        let m = grid_from_frame.matrix3;
        let grid = grid_from_frame.translation.abs()
            + m.x_axis.abs() * reach.x
            + m.y_axis.abs() * reach.y
            + m.z_axis.abs() * reach.z;
        let length =
            |m: DMat3, v: DVec3| m.x_axis.length() * v.x + m.y_axis.length() * v.y + m.z_axis.length() * v.z;
        let whole = DVec3::from_array(volume.dims().map(|n| (n + BRICK_CELLS) as f64));
        let mirrored = MIRRORED_ROUNDINGS * f64::from(f32::EPSILON) / 2.0;
        let built = length(world_from_grid.matrix3, unit * grid + mirrored * whole);
        // Transform of a queried point from grid space to the light frame.
        let far = DVec3::from_array(volume.dims().map(|n| n as f64 + 0.5));
        let m = frame_from_grid.matrix3;
        let frame = m.x_axis.abs() * far.x
            + m.y_axis.abs() * far.y
            + m.z_axis.abs() * far.z
            + frame_from_grid.translation.abs();
        let lookup = DOT_ROUNDINGS * f64::from(f32::EPSILON) / 2.0 * frame;
        // The error in texels rises towards a point light.
        let (texels, from_light_mm) = match self.projection {
            Projection::Orthographic => ((lookup.truncate() * self.texel_scale).max_element(), 0.0),
            Projection::Perspective | Projection::Octahedral => {
                let texels_mm =
                    (lookup.length() * self.texel_scale).max_element() * (1.0 + plane.max_element());
                let nearest = self.z_range[0] + self.light_distance;
                let texels = (texels_mm / nearest.max(f64::MIN_POSITIVE)).min(MOST_TEXEL_ERROR);
                let from_light_mm = texels_mm / MOST_TEXEL_ERROR;
                (texels, if from_light_mm > nearest { from_light_mm } else { 0.0 })
            }
        };
        let mapped = DOT_ROUNDINGS * f64::from(f32::EPSILON) / 2.0 * f64::from(self.map_size);
        Rounding { position_mm: built + lookup.length(), texels: texels + mapped, from_light_mm }
    }
}
