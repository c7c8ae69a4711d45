//! Opaque things in a volume: triangles that eye rays and light rays end at (Yuksel and Keyser 2008, Figure 7; Voicu 2011,
//! 5.3): an implant in a CT, a head under its hair.
//!
//! A surface is opaque and infinitely thin. It is lit by the cosine of the light's angle, on the side that the light is on,
//! with what the volume and other triangles leave of the light; what lies behind it is not seen.

mod files;
mod tree;

pub use files::{MESH_EXTENSIONS, read};
pub use tree::{FlatNode, Hit};

use crate::error::{Error, Result};
use bvh::bvh::Bvh;
use glam::DVec3;

/// A surface of triangles, world mm.
pub struct Mesh {
    /// Corners of every triangle.
    triangles: Vec<[DVec3; 3]>,
    /// Number of each part's first triangle, and the part's linear RGB.
    parts: Vec<(usize, [f64; 3])>,
    tree: Bvh<f64, 3>,
    /// Triangles without an area, which are left out.
    left_out: usize,
    /// Where it came from.
    pub source: String,
}

impl std::fmt::Debug for Mesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Mesh({} triangles of {})", self.triangles.len(), self.source)
    }
}

/// The same mesh, not one like it.
impl PartialEq for Mesh {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl Mesh {
    /// sRGB of a mesh that is given none: bone.
    pub const DEFAULT_COLOR: [u8; 3] = [227, 218, 201];

    /// Of parts, each of triangles with their corners in world mm and a linear RGB colour; triangles without an area are left
    /// out.
    ///
    /// # Errors
    /// A coordinate that is not finite, or nothing with an area.
    pub fn new(given: Vec<(Vec<[DVec3; 3]>, [f64; 3])>, source: &str) -> Result<Self> {
        let refused = |why: String| Error::input("cannot use mesh", source, why);
        let has_area = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).length_squared() > 0.0;
        let (mut triangles, mut parts, mut left_out) = (Vec::new(), Vec::new(), 0);
        for (part, color) in given {
            if let Some(place) = part.iter().position(|t| !t.iter().all(|p| p.is_finite())) {
                return Err(refused(format!("triangle {place} has a corner that is no finite number")));
            }
            let count = part.len();
            parts.push((triangles.len(), color));
            triangles.extend(part.into_iter().filter(has_area));
            left_out += parts.last().map_or(0, |(first, _)| count + first) - triangles.len();
        }
        if triangles.is_empty() {
            return Err(refused(format!("none of its {left_out} triangles has an area")));
        }
        let tree = tree::build(&triangles);
        Ok(Self { triangles, parts, tree, left_out, source: source.into() })
    }

    /// Corners of every triangle, world mm.
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// Linear RGB of a triangle.
    pub fn color(&self, triangle: usize) -> [f64; 3] {
        let part = self.parts.partition_point(|(first, _)| *first <= triangle);
        self.parts[part.max(1) - 1].1
    }

    /// Triangles of the source without an area.
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// Smallest and largest coordinates, world mm.
    pub fn bounds_mm(&self) -> [DVec3; 2] {
        let corners = self.triangles.iter().flatten();
        corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[lo, hi], p| [lo.min(*p), hi.max(*p)])
    }

    /// Unit normal of a triangle, by the order of its corners.
    pub fn normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.triangles[triangle];
        (b - a).cross(c - a).normalize()
    }

    /// The nearest triangle on `origin + z direction` with `z` strictly between two depths (mm, `direction` of length 1).
    pub fn first_hit(&self, origin: DVec3, direction: DVec3, between_mm: [f64; 2]) -> Option<Hit> {
        tree::first_hit(&self.tree, &self.triangles, origin, direction, between_mm)
    }

    /// Whether any triangle lies on such a stretch.
    pub fn is_hit(&self, origin: DVec3, direction: DVec3, between_mm: [f64; 2]) -> bool {
        tree::is_hit(&self.tree, &self.triangles, origin, direction, between_mm)
    }

    /// The tree in one list that is gone through without a stack, as shaders do: boxes in world mm.
    pub fn flat_tree(&self) -> Vec<FlatNode> {
        tree::flat(&self.tree)
    }
}
