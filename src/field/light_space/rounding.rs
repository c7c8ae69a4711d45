//! Float32 errors of positions on light rays.

use super::mapping::{LightSpace, Projection};
use crate::volume::{BRICK_CELLS, Volume};
use glam::{DMat3, DVec2, DVec3};

/// Roundings of a light ray's coordinate, each of half a unit in the last place: 3 of the plane coordinate (a division
/// counts as 5), 3 of the direction, 4 of products and sums, one of mirroring, and those of the inputs.
const ROUNDINGS: f64 = 17.0;
/// Further roundings, of a coordinate in the mirrored volume: those of the start and of a point.
const MIRRORED_ROUNDINGS: f64 = 2.0;

/// Roundings of a sum of four products with rounded factors.
const DOT_ROUNDINGS: f64 = 6.0;
/// Largest error of a texel coordinate, in texels, with an error bound near a point light.
const MOST_TEXEL_ERROR: f64 = 2.5e-4;

/// Float32 errors of positions on light rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounding {
    /// Largest error of a point, mm.
    pub position_mm: f64,
    /// Largest error of a texel coordinate, in texels, beyond `from_light_mm` from a point light.
    pub texels: f64,
    /// Distance from a point light up to which texel coordinates have no error bound, mm.
    pub from_light_mm: f64,
}

impl LightSpace {
    /// Largest float32 errors of points on a texel's ray, with or without clip planes: see `docs/bound.md`, "Positions".
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
        // Transform of a lookup's point from grid space to the light frame.
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
