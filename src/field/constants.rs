//! Numeric constants that the host shares with WGSL shaders: the size of shadow-map tiles, workgroup sizes, and
//! markers for hidden voxels and skipped tiles.

/// Large finite number that shaders use in place of infinity.
pub const FAR: f32 = 1e30;
/// Number that shaders add to the values of voxels whose segmentation label is hidden. It lies far beyond all voxel
/// values.
pub const HIDDEN_SHIFT: f32 = 1e29;
/// Number of texels per side of a shadow-map tile (Hadwiger et al. 2006, 3.4).
pub const TILE: u32 = 16;
/// Number of texels in a shadow-map tile. The shadow map stores one data record for each texel.
pub const TILE_TEXELS: u32 = TILE * TILE;
/// Marker in the tile table of a shadow map for a tile whose texels are not stored.
pub const NO_TILE: u32 = u32::MAX;
/// Number of threads per workgroup in one-dimensional compute passes, with one thread per list item.
pub const LINE_THREADS: u32 = 64;
