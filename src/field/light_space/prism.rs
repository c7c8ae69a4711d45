//! Prisms of shadow map texels: all light rays whose nearest texel is the same.

use super::mapping::{LightSpace, Projection};
use crate::volume::Volume;
use glam::DVec3;

/// Length of a slab of a prism, as a fraction of a texel's width. Shorter slabs have narrower ranges of extinction.
const SLAB_TEXELS: f64 = 0.5;
/// Smallest length of a slab, in smallest voxel spacings: the field is smooth within a voxel.
const LEAST_SLAB: f64 = 0.25;
/// Largest number of slabs of a prism: software adapters limit the iterations of all loops together.
const MOST_SLABS: f64 = 1024.0;
/// Factor that covers roundings and terms of higher order in the small angle between light rays of a texel.
const RESERVE: f64 = 1.1;

/// Bounds on the light rays whose nearest texel of a shadow map is the same.
///
/// At equal depth, these rays pass the box around the rays through the corners of a square around the texel's centre,
/// `half_texels` to each side, if the box is `margins_mm` larger on all sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prism {
    /// Half the side of the square around a texel's centre, in texels; 0 where the margins alone contain the rays.
    pub half_texels: f64,
    /// Margin around the rays through the square's corners at both ends of the map's depth range, mm. It changes
    /// linearly between them.
    pub margins_mm: [f64; 2],
    /// Largest distance of a ray from the axis of its prism, mm, with the margin.
    pub reach_mm: f64,
    /// Length of the slabs into which a prism is cut for ranges of extinction, mm.
    pub slab_mm: f64,
    /// Grid units per mm along each axis of the volume.
    pub grid_per_mm: DVec3,
}

impl LightSpace {
    /// Returns bounds on the rays of a texel. `clips` says whether there are clip planes, whose rounding counts too.
    pub fn prism(&self, volume: &Volume, clips: bool) -> Prism {
        let rounding = self.rounding(volume, clips);
        let rounded_mm = 2.0 * rounding.position_mm;
        let half_texels = 0.5 + 2.0 * rounding.texels;
        let half_diagonal = half_texels * (1.0 / self.texel_scale).length();
        let from_light_mm = self.z_range.map(|z| (z + self.light_distance).max(0.0));
        let (half_texels, margins_mm, width_mm) = match self.projection {
            Projection::Orthographic => (half_texels, [rounded_mm; 2], half_diagonal),
            // Rays of equal length end on a sphere, which bulges beyond the plane through those of the corners by less
            // than the square of their angle to the axis.
            Projection::Perspective => {
                let bulge = |mm: f64| RESERVE * half_diagonal * half_diagonal * mm + rounded_mm;
                (half_texels, from_light_mm.map(bulge), half_diagonal * from_light_mm[1])
            }
            // A unit in the octahedron's plane turns a ray by at most 3.
            Projection::Octahedral => {
                (0.0, from_light_mm.map(|mm| RESERVE * 3.0 * half_diagonal * mm + rounded_mm), 0.0)
            }
        };
        let m = self.grid_from_world.matrix3.transpose();
        Prism {
            half_texels,
            margins_mm,
            reach_mm: width_mm + margins_mm[0].max(margins_mm[1]),
            slab_mm: (SLAB_TEXELS * self.texel_mm())
                .max(LEAST_SLAB * volume.min_spacing_mm())
                .max(self.depth_range_mm() / MOST_SLABS),
            grid_per_mm: DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length()),
        }
    }
}
