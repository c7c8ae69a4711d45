//! Light space: the projection of a shadow map, fitted to the active bricks (blocks of cells with extinction).
//!
//! The light frame has the coordinates `(a, b, h)` along the axes of the light, in mm; `h` points away from the
//! light. Depth `z` is the distance along the light ray.

mod boxes;
mod fit;
mod lines;
mod mapping;
mod prism;
mod rounding;
mod tiles;

pub use mapping::{LightSpace, MapShape, Projection};
pub use prism::Prism;
pub use rounding::Rounding;
pub use tiles::TileSet;
