//! Opaque triangle meshes inside a volume, such as an implant in a CT or a head under its hair. View rays and shadow
//! rays end at them (Yuksel and Keyser 2008, Figure 7; Voicu 2011, 5.3).
//!
//! A mesh surface is opaque and infinitely thin. Lambert's law shades the side that faces the light; the volume and
//! other triangles attenuate the light. Everything behind a surface is hidden.

mod files;
mod tree;

pub use files::{MESH_EXTENSIONS, read};
pub use tree::{FlatNode, Hit};

use crate::error::{Error, Result};
use glam::DVec3;
use sha2::{Digest, Sha256};
use tree::Tree;

/// Offset of a shadow ray's origin from a mesh surface towards the light, which avoids self-shadowing. The unit is
/// the smallest voxel spacing.
pub const SURFACE_GAP: f64 = 1e-3;

/// Largest coordinate of a mesh, mm. Beyond it float32 is too imprecise.
const MAX_MM: f64 = 1e9;

/// Opaque triangle mesh in world mm, with a bounding volume hierarchy for ray queries.
pub struct Mesh {
    /// Corners of every triangle of the mesh, world mm.
    triangles: Vec<[DVec3; 3]>,
    /// Index of the first triangle, the source, and the linear RGB colour of each part of the mesh.
    parts: Vec<(usize, PartSource, [f64; 3])>,
    tree: Tree,
    /// Number of triangles that were skipped because their area is zero.
    left_out: usize,
    /// SHA-256 digest of the corners and colours of the mesh. A comparison of shadow methods that is resumed uses it
    /// to detect a changed mesh.
    sha256: String,
}

/// Part of a triangle mesh, with one source and one colour.
#[derive(Debug, Clone)]
pub struct MeshPart {
    /// Source of the triangles of the mesh part: a mesh file or strands.
    pub source: PartSource,
    /// Colour of the mesh part, linear RGB.
    pub color: [f64; 3],
    /// Corners of every triangle of the mesh part, world mm.
    pub triangles: Vec<[DVec3; 3]>,
}

/// Source of the triangles of a mesh part.
#[derive(Debug, Clone, PartialEq)]
pub enum PartSource {
    /// Path of a mesh file.
    File(String),
    /// Strands that were converted to tubes of triangles.
    Strands {
        /// Path of the strand file, or `phantom:hair-NAME[:SEGMENTS]` for built-in strands.
        source: String,
        /// Strand diameter set by the user, mm; `None` if not set.
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

/// Computes the SHA-256 digest of a mesh: all corners, and the first triangle and colour of each part.
fn digest(triangles: &[[DVec3; 3]], parts: &[(usize, PartSource, [f64; 3])]) -> String {
    let mut hasher = Sha256::new();
    triangles.iter().flatten().for_each(|p| hasher.update(bytemuck::bytes_of(&p.to_array())));
    for (first, _, color) in parts {
        hasher.update((*first as u64).to_le_bytes());
        hasher.update(bytemuck::bytes_of(color));
    }
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Compares two meshes as objects in memory: a mesh equals only itself, whatever its triangles are.
impl PartialEq for Mesh {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl Mesh {
    /// Default colour of a mesh, sRGB: bone white.
    pub const DEFAULT_COLOR: &str = "#e3dac9";
    /// Default colour of strands, sRGB: a blue that differs from bone and vessels.
    pub const DEFAULT_STRAND_COLOR: &str = "#7fb2e5";

    /// Builds a mesh from several parts; triangles with zero area are skipped.
    ///
    /// # Errors
    /// A coordinate is not finite or too large, or no triangle of a part has an area.
    pub fn new(sources: Vec<MeshPart>) -> Result<Self> {
        let has_area = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).length_squared() > 0.0;
        let (mut triangles, mut parts, mut left_out) = (Vec::new(), Vec::new(), 0);
        for part in sources {
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
        let tree = Tree::new(&triangles);
        let sha256 = digest(&triangles, &parts);
        Ok(Self { triangles, parts, tree, left_out, sha256 })
    }

    /// Returns the source and linear RGB colour of each part of the mesh.
    pub fn parts(&self) -> impl Iterator<Item = (&PartSource, [f64; 3])> {
        self.parts.iter().map(|(_, source, color)| (source, *color))
    }

    /// Returns the corners of every triangle of the mesh, world mm.
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// Returns the linear RGB colour of a triangle of the mesh, by its index.
    pub fn color(&self, triangle: usize) -> [f64; 3] {
        let part = self.parts.partition_point(|(first, ..)| *first <= triangle);
        self.parts[part.max(1) - 1].2
    }

    /// Returns the number of triangles that were skipped because their area is zero.
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// Returns the bounding box of the mesh, world mm.
    pub fn bounds_mm(&self) -> [DVec3; 2] {
        let corners = self.triangles.iter().flatten();
        corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[lo, hi], p| [lo.min(*p), hi.max(*p)])
    }

    /// Returns the unit normal of a triangle of the mesh, oriented by the order of its corners (right-hand rule).
    pub fn normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.triangles[triangle];
        (b - a).cross(c - a).normalize()
    }

    /// Finds the nearest triangle of the mesh on the ray `origin + z direction`, with `z` strictly between two depths
    /// in mm. `direction` has length 1.
    pub fn first_hit(&self, origin: DVec3, direction: DVec3, between_mm: [f64; 2]) -> Option<Hit> {
        let mut first = None;
        self.tree.visit(&self.triangles, [origin, direction], between_mm, |hit| {
            first = Some(hit);
            Some(hit.depth_mm)
        });
        first
    }

    /// Whether any triangle of the mesh lies on the ray `origin + z direction`, with `z` strictly between two depths
    /// in mm.
    pub fn is_hit(&self, origin: DVec3, direction: DVec3, between_mm: [f64; 2]) -> bool {
        let mut is_hit = false;
        self.tree.visit(&self.triangles, [origin, direction], between_mm, |_| {
            is_hit = true;
            None
        });
        is_hit
    }

    /// Returns the bounding volume hierarchy of the mesh as a list for stackless traversal in shaders.
    pub fn flat_tree(&self) -> Vec<FlatNode> {
        self.tree.flat(&self.triangles)
    }

    /// Returns bounding boxes (world mm) that together contain all triangles: the nodes of the bounding volume
    /// hierarchy at depth `levels`.
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
