//! Reads mesh files: STL (binary and text), PLY and OBJ, recognised by content first and by name second.
//!
//! Coordinates are world mm, RAS+. If a header contains `SPACE=LPS`, as 3D Slicer writes it, x and y are negated.

use super::MeshPart;
use crate::error::{Error, Result};
use crate::files::input::says_lps;
use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};
use std::io::{BufRead, Cursor};
use std::path::Path;

/// File extensions of the supported mesh formats.
pub const MESH_EXTENSIONS: &[&str] = &["stl", "ply", "obj"];

const WHAT: &str = "cannot read mesh";
/// Size of the header of a binary STL file, bytes.
const STL_HEADER_BYTES: usize = 84;
/// Size of the record of one triangle in a binary STL file, bytes.
const STL_TRIANGLE_BYTES: usize = 50;

/// Function that parses the bytes of a mesh file to triangles.
type Parse = fn(&[u8]) -> TriangleResult;

/// Selects the parser for the format of a mesh file; `None` if the format is unknown.
fn parser_of(bytes: &[u8], path: &Path) -> Option<Parse> {
    let count_fits = bytes.get(80..).and_then(|rest| rest.first_chunk()).is_some_and(|count| {
        let triangles = u32::from_le_bytes(*count) as usize;
        triangles.checked_mul(STL_TRIANGLE_BYTES).is_some_and(|b| b + STL_HEADER_BYTES == bytes.len())
    });
    let named = |ending: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    let text = bytes.trim_ascii_start();
    if text.starts_with(b"ply\n") || text.starts_with(b"ply\r") {
        Some(ply)
    } else if count_fits || text.starts_with(b"solid") || named("stl") {
        Some(stl)
    } else if named("obj") || bytes.lines().map_while(|l| l.ok()).take(200).any(|l| l.starts_with("v ")) {
        Some(obj)
    } else {
        None
    }
}

/// Reads a mesh file as one part of a mesh, with `color` in linear RGB.
///
/// # Errors
/// The mesh file cannot be read, is no STL, PLY or OBJ file, or is damaged.
pub fn read(path: &Path, color: [f64; 3]) -> Result<MeshPart> {
    let refused = |why: String| Error::input(WHAT, path.display(), why);
    let bytes = std::fs::read(path).map_err(|e| refused(e.to_string()))?;
    let parse = parser_of(&bytes, path).ok_or_else(|| {
        refused("it is no STL, PLY or OBJ file".into()).hint("other meshes can be exported as one of these")
    })?;
    let mut triangles = parse(&bytes).map_err(refused)?;
    if says_lps(&bytes) {
        triangles.iter_mut().flatten().for_each(|p| *p *= DVec3::new(-1.0, -1.0, 1.0));
    }
    Ok(MeshPart { source: path.display().to_string().into(), color, triangles })
}

type TriangleResult = std::result::Result<Vec<[DVec3; 3]>, String>;

fn stl(bytes: &[u8]) -> TriangleResult {
    let words = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::UnexpectedEof => "it ends before its triangles do".into(),
        _ => e.to_string(),
    };
    let mut cursor = Cursor::new(bytes);
    let reader = stl_io::create_stl_reader(&mut cursor).map_err(words)?;
    let corners = |t: stl_io::Triangle| t.vertices.map(|v| DVec3::from(v.0.map(f64::from)));
    reader.map(|t| t.map(corners).map_err(words)).collect()
}

fn obj(bytes: &[u8]) -> TriangleResult {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_lines: true,
        ignore_points: true,
        ..Default::default()
    };
    let mut text = bytes;
    // Materials are not read: a mesh has one colour.
    let (models, _) =
        tobj::load_obj_buf(&mut text, &options, |_| Ok(Default::default())).map_err(|e| e.to_string())?;
    let mut triangles = Vec::new();
    for model in &models {
        let points = model.mesh.positions.as_chunks::<3>().0.iter();
        let points: Vec<DVec3> = points.map(|p| DVec3::from(p.map(f64::from))).collect();
        for face in model.mesh.indices.as_chunks::<3>().0 {
            triangles.push(corners_of(&points, face.map(i64::from))?);
        }
    }
    Ok(triangles)
}

/// Looks up the corners of a triangle by the indices of its points in a mesh file.
fn corners_of(points: &[DVec3], numbers: [i64; 3]) -> std::result::Result<[DVec3; 3], String> {
    let mut corners = [DVec3::ZERO; 3];
    for (corner, number) in corners.iter_mut().zip(numbers) {
        let found = usize::try_from(number).ok().and_then(|n| points.get(n));
        *corner = *found.ok_or_else(|| format!("a face names point {number} of {}", points.len()))?;
    }
    Ok(corners)
}

/// Vertex or face of a PLY mesh file.
#[derive(Default)]
struct PlyElement {
    at: [Option<f64>; 3],
    points: Vec<i64>,
}

impl PlyElement {
    fn set_points(&mut self, property: Property) -> PropertyAccessResult {
        self.points = match property {
            Property::ListInt(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUInt(v) => v.into_iter().map(i64::from).collect(),
            Property::ListShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUChar(v) => v.into_iter().map(i64::from).collect(),
            _ => return PropertyAccessResult::Ignored,
        };
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for PlyElement {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            "vertex_indices" | "vertex_index" => return self.set_points(property),
            _ => return PropertyAccessResult::Ignored,
        };
        self.at[axis] = match property {
            Property::Float(v) => Some(f64::from(v)),
            Property::Double(v) => Some(v),
            Property::Int(v) => Some(f64::from(v)),
            Property::UInt(v) => Some(f64::from(v)),
            Property::Short(v) => Some(f64::from(v)),
            Property::UShort(v) => Some(f64::from(v)),
            Property::Char(v) => Some(f64::from(v)),
            Property::UChar(v) => Some(f64::from(v)),
            _ => None,
        };
        PropertyAccessResult::Set
    }
}

fn ply(bytes: &[u8]) -> TriangleResult {
    let mut reader = Reader::new(bytes);
    let parser = Parser::<PlyElement>::new();
    let header = parser.read_header(&mut reader).map_err(|e| e.to_string())?;
    let (mut corners, mut polygons) = (Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        let read = parser.read_payload_for_element(&mut reader, element, &header);
        let read = read.map_err(|e| e.to_string())?;
        match name.as_str() {
            "face" => polygons = read,
            "vertex" => {
                let place = |p: &PlyElement| match p.at {
                    [Some(x), Some(y), Some(z)] => Ok(DVec3::new(x, y, z)),
                    _ => Err("its points have no x, y and z".to_string()),
                };
                corners = read.iter().map(place).collect::<std::result::Result<Vec<_>, _>>()?;
            }
            // Other elements are skipped.
            _ => {}
        }
    }
    if polygons.is_empty() {
        return Err("it has no faces".into());
    }
    let mut triangles = Vec::new();
    for polygon in &polygons {
        let [first, rest @ ..] = &polygon.points[..] else { continue };
        for pair in rest.windows(2) {
            triangles.push(corners_of(&corners, [*first, pair[0], pair[1]])?);
        }
    }
    Ok(triangles)
}

#[cfg(test)]
mod tests {
    use super::super::Mesh;
    use super::*;

    fn from(name: &str, bytes: &[u8]) -> Result<Mesh> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        Mesh::new(vec![read(&path, [1.0; 3])?])
    }

    const TEXT_STL: &str = "solid one\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\nvertex 2 2 3\nvertex 1 4 3\n\
        endloop\nendfacet\nendsolid one\n";
    const SQUARE_PLY: &str = "ply\nformat ascii 1.0\ncomment SPACE=LPS\nelement vertex 4\nproperty float x\n\
        property double y\nproperty float z\nproperty uchar red\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n0 0 1 9\n2 0 1 9\n2 2 1 9\n0 2 1 9\n4 0 1 2 3\n";

    fn binary_stl(header: &[u8], triangles: &[[f32; 9]]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, b' ');
        bytes.extend((triangles.len() as u32).to_le_bytes());
        for t in triangles {
            bytes.extend([0.0f32, 0.0, 1.0].iter().chain(t).flat_map(|c| c.to_le_bytes()));
            bytes.extend([0, 0]);
        }
        bytes
    }

    #[test]
    fn every_format_gives_its_triangles() {
        let corner = |mesh: &Mesh, t: usize, c: usize| mesh.triangles()[t][c];
        let text = from("a.stl", TEXT_STL.as_bytes()).unwrap();
        assert_eq!((text.triangles().len(), corner(&text, 0, 2)), (1, DVec3::new(1.0, 4.0, 3.0)));
        // By content, whatever the name.
        let t = [1.0, 2.0, 3.0, 2.0, 2.0, 3.0, 1.0, 4.0, 3.0];
        for header in [&b"made by hand"[..], b"solid, although binary"] {
            let binary = from("a.bin", &binary_stl(header, &[t, t.map(|c| c + 1.0)])).unwrap();
            assert_eq!((binary.triangles().len(), corner(&binary, 1, 0)), (2, DVec3::new(2.0, 3.0, 4.0)));
        }
        // Meshes with other corners have another digest.
        let moved = from("a.stl", TEXT_STL.replace("1 4 3", "1 5 3").as_bytes()).unwrap();
        assert_ne!(format!("{text:?}"), format!("{moved:?}"));
        assert_eq!(format!("{text:?}"), format!("{:?}", from("b.stl", TEXT_STL.as_bytes()).unwrap()));
        let slicer = from("s.stl", &binary_stl(b"3D Slicer output. SPACE=LPS", &[t])).unwrap();
        assert_eq!(corner(&slicer, 0, 0), DVec3::new(-1.0, -2.0, 3.0));
        let ply = from("a.ply", SQUARE_PLY.as_bytes()).unwrap();
        assert_eq!((ply.triangles().len(), corner(&ply, 1, 1)), (2, DVec3::new(-2.0, -2.0, 1.0)));
        let obj = "o thing\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\nf -4 -3 -2\nl 1 2\n";
        let obj = from("a.obj", obj.as_bytes()).unwrap();
        assert_eq!((obj.triangles().len(), corner(&obj, 0, 2)), (3, DVec3::new(1.0, 1.0, 0.0)));
    }

    #[test]
    fn damaged_files_are_refused_in_one_line() {
        let mut cut = binary_stl(b"cut", &[[1.0; 9]]);
        cut.truncate(100);
        let many = SQUARE_PLY.replace("4 0 1 2 3", "4 0 1 2 7");
        let negative = SQUARE_PLY.replace("4 0 1 2 3", "4 0 1 2 -1");
        let huge = SQUARE_PLY.replace("element vertex 4", "element vertex 4000000000");
        for (name, bytes) in [
            ("a.stl", &cut[..]),
            ("a.stl", b""),
            ("a.stl", b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 1 2\n"),
            ("a.stl", &binary_stl(b"no triangles", &[])),
            ("a.stl", &binary_stl(b"no area", &[[1.0; 9]])),
            ("a.stl", &binary_stl(b"nan", &[[f32::NAN; 9]])),
            ("a.stl", &binary_stl(b"far", &[[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2e9, 0.0]])),
            ("a.ply", many.as_bytes()),
            ("a.ply", negative.as_bytes()),
            ("a.ply", huge.as_bytes()),
            ("a.ply", b"ply\nformat ascii 1.0\nend_header\n"),
            ("a.obj", b"v 0 0 0\nf 1 2 3\n"),
            ("a.obj", b"nothing\n"),
            ("a.txt", b"nothing of the kind\n"),
        ] {
            let error = from(name, bytes).unwrap_err();
            assert_eq!(error.exit_status(), 2, "{error}");
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
}
