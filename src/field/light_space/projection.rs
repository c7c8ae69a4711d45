//! Projections of light rays onto the plane of a map.

use glam::{DVec2, DVec3};

/// How light rays map to texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Projection {
    /// Light at infinity: parallel rays.
    Orthographic = 0,
    /// Point light that sees the active bricks within a cone.
    Perspective = 1,
    /// Point light inside or close to the active bricks: all directions.
    Octahedral = 2,
}

/// Where a direction lies in the square of all of them.
pub fn octahedral_from_direction(w: DVec3) -> DVec2 {
    let p = w.truncate() / (w.x.abs() + w.y.abs() + w.z.abs()).max(1e-300);
    if w.z >= 0.0 { p } else { fold(p) }
}

/// The direction of a point of that square.
pub fn direction_from_octahedral(p: DVec2) -> DVec3 {
    let z = 1.0 - p.x.abs() - p.y.abs();
    let p = if z >= 0.0 { p } else { fold(p) };
    p.extend(z).normalize()
}

fn fold(p: DVec2) -> DVec2 {
    let sign = |v: f64| if v >= 0.0 { 1.0 } else { -1.0 };
    DVec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y))
}
