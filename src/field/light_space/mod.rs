//! Light space: the projection of a shadow map, fitted to the active bricks.
//!
//! The light frame is in millimetres, `(a, b, h)` with `h` away from the light; depth `z` is distance along the light
//! ray. Everything is composed here in `f64`; `shaders/field/light.wgsl` is the same mapping in `f32`.

mod boxes;
mod fit;
mod lines;
mod projection;
mod region;
mod rounding;
mod shape;
mod space;

pub use projection::Projection;
pub use rounding::Rounding;
pub use shape::MapShape;
pub use space::LightSpace;
