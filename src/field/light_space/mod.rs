//! Light space: the projection of a shadow map, fitted to the active bricks (those with extinction).
//!
//! The light frame is in millimetres, `(a, b, h)` with `h` away from the light; depth `z` is distance along the light
//! ray.

mod boxes;
mod fit;
mod lines;
mod mapping;
mod rounding;

pub use mapping::{LightSpace, MapShape, Projection};
pub use rounding::Rounding;
