//! Numbers of this room that its shaders know too.

/// Stands for infinity on the device.
pub const FAR: f32 = 1e30;
/// Added to a value, hides it: far beyond all values, and less than [`FAR`].
pub const HIDDEN_SHIFT: f32 = 1e29;
/// Texels a side of a tile (Hadwiger et al. 2006, 3.4).
pub const TILE: u32 = 16;
/// Texels, and so records, of a tile.
pub const TILE_TEXELS: u32 = TILE * TILE;
/// Stands in the tile table for a tile that is left out.
pub const NO_TILE: u32 = u32::MAX;
/// Threads a workgroup of passes over a line of things.
pub const LINE_THREADS: u32 = 64;
