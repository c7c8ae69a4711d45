//! What a method asks of its map.

use crate::field::March;

/// How a map is laid out over what it is to cover, and how its rays are marched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapShape {
    /// Texels a side; `None`: about one for each voxel, and finer where the picture shows voxels larger than that.
    pub texels: Option<u32>,
    /// Across what the camera sees of the active bricks, and not across all of them.
    pub fits_view: bool,
    /// Texels around a point that a lookup reads, on each side.
    pub reach: u32,
    /// How its light rays are marched.
    pub march: March,
}

impl MapShape {
    /// A map of fewer texels a side has no border, and covers everything.
    pub const LEAST_WITH_BORDER: u32 = 8;
}
