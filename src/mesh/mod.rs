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
use sha2::{Digest, Sha256};

/// Light is asked for on a surface so far from it (towards the light, in smallest voxel spacings) that it is not hidden by
/// itself.
pub const SURFACE_GAP: f64 = 1e-3;

/// The farthest coordinate, mm: beyond, float32 knows no surface.
const MAX_MM: f64 = 1e9;

/// A surface of triangles, world mm.
pub struct Mesh {
    /// Corners of every triangle.
    triangles: Vec<[DVec3; 3]>,
    /// Number of each part's first triangle, where the part came from, and its linear RGB.
    parts: Vec<(usize, PartSource, [f64; 3])>,
    tree: Bvh<f64, 3>,
    /// Triangles without an area, which are left out.
    left_out: usize,
    /// Of corners and colours: a table that is resumed tells another mesh by it.
    sha256: String,
}

/// What a mesh is made of.
#[derive(Debug, Clone)]
pub struct MeshPart {
    /// Where it came from.
    pub source: PartSource,
    /// Linear RGB.
    pub color: [f64; 3],
    /// Corners of every triangle, world mm.
    pub triangles: Vec<[DVec3; 3]>,
}

/// Where triangles came from.
#[derive(Debug, Clone, PartialEq)]
pub enum PartSource {
    /// A file of a mesh, by its path.
    File(String),
    /// Strands, which have become tubes.
    Strands {
        /// Path of a file, or `phantom:hair-NAME[:SEGMENTS]`.
        source: String,
        /// Diameter that was asked for, mm.
        thickness_mm: Option<f64>,
    },
}

impl From<String> for PartSource {
    fn from(path: String) -> Self {
        Self::File(path)
    }
}

impl From<&str> for PartSource {
    fn from(path: &str) -> Self {
        Self::File(path.to_owned())
    }
}

impl std::fmt::Display for PartSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(source) | Self::Strands { source, .. } => f.write_str(source),
        }
    }
}

impl std::fmt::Debug for Mesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Mesh({} triangles, SHA-256 {})", self.triangles.len(), self.sha256)
    }
}

/// SHA-256 of all corners, and of where parts begin and their colours.
fn digest(triangles: &[[DVec3; 3]], parts: &[(usize, PartSource, [f64; 3])]) -> String {
    let mut hasher = Sha256::new();
    triangles.iter().flatten().for_each(|p| hasher.update(bytemuck::bytes_of(&p.to_array())));
    for (first, _, color) in parts {
        hasher.update((*first as u64).to_le_bytes());
        hasher.update(bytemuck::bytes_of(color));
    }
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The same mesh, not one like it.
impl PartialEq for Mesh {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl Mesh {
    /// sRGB of a mesh that is given none: bone.
    pub const DEFAULT_COLOR: &str = "#e3dac9";
    /// sRGB of strands that are given none: a blue that stands out from bone and vessels.
    pub const DEFAULT_STRAND_COLOR: &str = "#7fb2e5";

    /// Of parts; triangles without an area are left out.
    ///
    /// # Errors
    /// A coordinate that is not finite, or a part where nothing has an area.
    pub fn new(given: Vec<MeshPart>) -> Result<Self> {
        let has_area = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).length_squared() > 0.0;
        let (mut triangles, mut parts, mut left_out) = (Vec::new(), Vec::new(), 0);
        for part in given {
            let refused = |why: String| Error::input("cannot use mesh", &part.source, why);
            let far = |t: &[DVec3; 3]| !t.iter().all(|p| p.abs().max_element() <= MAX_MM);
            if let Some(place) = part.triangles.iter().position(far) {
                let why = "has a corner that is no number, or farther than 1e9 mm from the origin";
                return Err(refused(format!("triangle {place} {why}")));
            }
            let (count, first) = (part.triangles.len(), triangles.len());
            triangles.extend(part.triangles.iter().filter(|t| has_area(t)));
            if triangles.len() == first {
                return Err(refused(format!("none of its {count} triangles has an area")));
            }
            left_out += first + count - triangles.len();
            parts.push((first, part.source, part.color));
        }
        let tree = tree::build(&triangles);
        let sha256 = digest(&triangles, &parts);
        Ok(Self { triangles, parts, tree, left_out, sha256 })
    }

    /// Where each part came from, and its linear RGB.
    pub fn parts(&self) -> impl Iterator<Item = (&PartSource, [f64; 3])> {
        self.parts.iter().map(|(_, source, color)| (source, *color))
    }

    /// Corners of every triangle, world mm.
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// Linear RGB of a triangle.
    pub fn color(&self, triangle: usize) -> [f64; 3] {
        let part = self.parts.partition_point(|(first, ..)| *first <= triangle);
        self.parts[part.max(1) - 1].2
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
        tree::flat(&self.tree, &self.triangles)
    }

    /// Some boxes that hold all triangles, as few as so many levels of the tree have: smallest and largest coordinates, world
    /// mm.
    pub fn boxes(&self, levels: usize) -> Vec<[DVec3; 2]> {
        let nodes = self.flat_tree();
        let (mut boxes, mut ends, mut at) = (Vec::new(), Vec::new(), 0);
        while let Some(node) = nodes.get(at) {
            ends.retain(|end| *end > at);
            if node.triangle.is_some() || ends.len() >= levels {
                boxes.push(node.bounds);
                at = node.next as usize;
            } else {
                ends.push(node.next as usize);
                at += 1;
            }
        }
        boxes
    }
}
