//! Constants of the scalar field (volume and shadow-map tiles) that the host shares with WGSL shaders.

/// Finite stand-in for infinity in shaders.
pub const FAR: f32 = 1e30;
/// Offset that shaders add to the values of hidden voxels: far beyond all real values, and less than [`FAR`].
pub const HIDDEN_SHIFT: f32 = 1e29;
/// Number of texels per side of a shadow-map tile (Hadwiger et al. 2006, 3.4).
pub const TILE: u32 = 16;
/// Number of texels in a shadow-map tile. Each texel has one record (its stored data).
pub const TILE_TEXELS: u32 = TILE * TILE;
/// Entry of a shadow map's tile table for a tile that is skipped.
pub const NO_TILE: u32 = u32::MAX;
/// Number of threads per workgroup in compute passes over a list of items.
pub const LINE_THREADS: u32 = 64;
