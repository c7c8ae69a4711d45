//! What float32 makes of light space.

use super::projection::Projection;
use super::space::LightSpace;
use crate::volume::{BRICK_CELLS, Volume};
use glam::{DMat3, DVec2, DVec3};

/// Roundings of half a unit in the last place, at most, that a coordinate of a light ray goes through: 3 of the plane
/// coordinate (a division counts as 5), 3 of the way, 4 of products and sums, one of mirroring, and those of the inputs.
const ROUNDINGS: f64 = 17.0;
/// Roundings beside those, as large as a coordinate in the mirrored volume: of the start and of a point.
const MIRRORED_ROUNDINGS: f64 = 2.0;

/// The same of a sum of four products with rounded factors.
const DOT_ROUNDINGS: f64 = 6.0;
/// Texels by which a texel coordinate may be astray where a promise is made near a point light.
const MOST_ASTRAY: f64 = 2.5e-4;

/// What float32 makes of positions on light rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounding {
    /// How far a point may lie from its place, mm.
    pub position_mm: f64,
    /// How far a texel coordinate may lie from its place, texels; no farther from a point light than
    /// `from_light_mm` it may lie anywhere.
    pub texels: f64,
    /// See `texels`, mm.
    pub from_light_mm: f64,
}

impl LightSpace {
    /// How far float32 may put a point of a texel's ray, which ends at clip planes where there are some, from where it is:
    /// see `docs/bound.md`, "Positions".
    pub fn rounding(&self, volume: &Volume, clips: bool) -> Rounding {
        // A clip plane's distance from a point is such a sum, too.
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
            // Start and way of the ray, each with its own roundings.
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
        // A point that is looked up, from grid space to the light's.
        let far = DVec3::from_array(volume.dims().map(|n| n as f64 + 0.5));
        let m = frame_from_grid.matrix3;
        let frame = m.x_axis.abs() * far.x
            + m.y_axis.abs() * far.y
            + m.z_axis.abs() * far.z
            + frame_from_grid.translation.abs();
        let asked = DOT_ROUNDINGS * f64::from(f32::EPSILON) / 2.0 * frame;
        // The nearer to a point light, the more texels a point is astray by.
        let (texels, from_light_mm) = match self.projection {
            Projection::Orthographic => ((asked.truncate() * self.texel_scale).max_element(), 0.0),
            Projection::Perspective | Projection::Octahedral => {
                let texels_mm =
                    (asked.length() * self.texel_scale).max_element() * (1.0 + plane.max_element());
                let nearest = self.z_range[0] + self.light_distance;
                let texels = (texels_mm / nearest.max(f64::MIN_POSITIVE)).min(MOST_ASTRAY);
                let from_light_mm = texels_mm / MOST_ASTRAY;
                (texels, if from_light_mm > nearest { from_light_mm } else { 0.0 })
            }
        };
        let mapped = DOT_ROUNDINGS * f64::from(f32::EPSILON) / 2.0 * f64::from(self.map_size);
        Rounding { position_mm: built + asked.length(), texels: texels + mapped, from_light_mm }
    }
}
