//! Constants that this module shares with its shaders.

/// Stand-in for infinity on the device.
pub const FAR: f32 = 1e30;
/// Shift of hidden values: far beyond all values, and less than [`FAR`].
pub const HIDDEN_SHIFT: f32 = 1e29;
/// Texels per side of a tile (Hadwiger et al. 2006, 3.4).
pub const TILE: u32 = 16;
/// Texels of a tile, and so its records.
pub const TILE_TEXELS: u32 = TILE * TILE;
/// Entry of the tile table for a skipped tile.
pub const NO_TILE: u32 = u32::MAX;
/// Threads per workgroup of passes over a list.
pub const LINE_THREADS: u32 = 64;
