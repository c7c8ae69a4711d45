//! Opaque objects of a scene: mesh files and strand files, each with a colour.

use super::Diagnostic;
use super::layer::layer;
use super::strands::load_strands;
use super::values;
use crate::error::{Error, Result};
use crate::files::color;
use crate::files::loading::Loading;
use crate::mesh::{self, Mesh, MeshPart, PartSource};
use crate::strands::{MOST_TRIANGLES, SIDES, Tubes, tubes};
use clap::Args;
use serde::{Serialize, Serializer};
use std::path::Path;
use std::sync::Arc;

layer! {
/// Command-line flags for opaque objects in the volume (meshes and strands); a flag that is not given is `None`.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize)]
pub struct OpaqueFlags {
    /// Opaque mesh in the volume, may be given several times: an STL, PLY or OBJ file, world mm, followed by
    /// ,color=#rrggbb (sRGB, or a name; default: #e3dac9)
    #[arg(long, value_name = "FILE", value_parser = mesh_file, help_heading = "Scene")]
    pub mesh: Option<Vec<OpaqueFile>>,
    /// Strands in the volume as opaque tubes, may be given several times: a .hair, .tck, .trk, .vtk, .vtp or .obj
    /// file or phantom:hair-NAME[:SEGMENTS], followed by ,color=#rrggbb (sRGB, or a name; default:
    /// #7fb2e5) and ,thickness=MM (needed if the file has none)
    #[arg(long, value_name = "FILE", value_parser = strand_file, help_heading = "Scene")]
    pub strands: Option<Vec<OpaqueFile>>,
}
}

/// File of an opaque object (mesh or strands) with its colour and the strands' diameter:
/// `FILE[,color=#rrggbb][,thickness=MM]`.
#[derive(Debug, Clone, PartialEq)]
pub struct OpaqueFile {
    /// Path of the opaque object's file, or `phantom:hair-NAME[:SEGMENTS]` for built-in strands.
    pub source: String,
    /// Colour of the opaque object, linear RGB.
    pub color: [f64; 3],
    /// Diameter of the opaque strands, mm; `None` for the diameters of the file.
    pub thickness_mm: Option<f64>,
}

impl Serialize for OpaqueFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let thickness = self.thickness_mm.map(|mm| format!(",thickness={mm}")).unwrap_or_default();
        let color = color::to_hex(self.color);
        serializer.collect_str(&format_args!("{},color={color}{thickness}", self.source))
    }
}

/// Parses the value of `--mesh`: a mesh file with its colour.
fn mesh_file(text: &str) -> Result<OpaqueFile, String> {
    let (source, [hex]) = values::with_keys(text, ["color"])?;
    let color = color::parse(hex.unwrap_or(Mesh::DEFAULT_COLOR))?;
    Ok(OpaqueFile { source: source.into(), color, thickness_mm: None })
}

/// Parses the value of `--strands`: a strand file with its colour and diameter.
fn strand_file(text: &str) -> Result<OpaqueFile, String> {
    let (source, [hex, mm]) = values::with_keys(text, ["color", "thickness"])?;
    let color = color::parse(hex.unwrap_or(Mesh::DEFAULT_STRAND_COLOR))?;
    let thickness_mm = mm.map(values::thickness_mm).transpose();
    let thickness_mm = thickness_mm.map_err(|why| format!("thickness: {why}"))?;
    Ok(OpaqueFile { source: source.into(), color, thickness_mm })
}

impl OpaqueFlags {
    /// Mutable paths of the mesh files and strand files of the scene's opaque objects.
    pub(super) fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        [&mut self.mesh, &mut self.strands].into_iter().flatten().flatten().map(|file| &mut file.source)
    }

    /// Reads all opaque objects of a scene into one mesh, if there are any. It appends notes and warnings to
    /// `diagnostics`.
    ///
    /// # Errors
    /// A file that cannot be read or has another format, or too many triangles.
    pub(super) fn read(
        &self,
        diagnostics: &mut Vec<Diagnostic>,
        loading: &Loading,
    ) -> Result<Option<Arc<Mesh>>> {
        let mut parts = Vec::new();
        for OpaqueFile { source, color, .. } in self.mesh.iter().flatten() {
            parts.push(mesh::read(Path::new(source), *color).map_err(|e| e.at("--mesh"))?);
        }
        let (of_meshes, mut left) = (parts.len(), MOST_TRIANGLES);
        for file in self.strands.iter().flatten() {
            loading.go_on(&file.source)?;
            let part = file.read(left, diagnostics, loading).map_err(|e| e.at("--strands"))?;
            left -= part.triangles.len();
            parts.push(part);
        }
        if parts.is_empty() {
            return Ok(None);
        }
        let flag = if of_meshes > 0 { "--mesh" } else { "--strands" };
        Ok(Some(Arc::new(Mesh::new(parts).map_err(|e| e.at(flag))?)))
    }

    /// Returns the command-line flags that describe the opaque objects of a scene, the inverse of [`Self::read`].
    pub(super) fn of(mesh: Option<&Mesh>) -> Self {
        let (mut files, mut strands) = (Vec::new(), Vec::new());
        for (source, color) in mesh.into_iter().flat_map(Mesh::parts) {
            let (list, source, thickness_mm) = match source {
                PartSource::File(path) => (&mut files, path, None),
                PartSource::Strands { source, thickness_mm } => (&mut strands, source, *thickness_mm),
            };
            list.push(OpaqueFile { source: source.clone(), color, thickness_mm });
        }
        Self {
            mesh: Some(files).filter(|files| !files.is_empty()),
            strands: Some(strands).filter(|strands| !strands.is_empty()),
        }
    }
}

impl OpaqueFile {
    /// Reads a strand file of the scene and makes opaque tubes of its strands, with at most `most` triangles.
    fn read(&self, most: usize, diagnostics: &mut Vec<Diagnostic>, loading: &Loading) -> Result<MeshPart> {
        let Self { source, color, thickness_mm } = self;
        let strands = load_strands(source, *thickness_mm, loading).map_err(|e| match e.hint {
            Some(hint) => {
                Error { hint: Some(hint.replace("--thickness MM", ",thickness=MM behind the file")), ..e }
            }
            None => e,
        })?;
        diagnostics.extend(strands.warnings().iter().map(|w| Diagnostic::warning(format!("{source}: {w}"))));
        let Tubes { triangles, sides, of_most_sides } = tubes(&strands, most)?;
        if triangles.len() < of_most_sides {
            let why = format!("{} would make {of_most_sides} triangles, and {most} are the most", SIDES[0]);
            diagnostics
                .push(Diagnostic::note(format!("{source}: its tubes have {sides} sides, since {why}")));
        }
        let source = PartSource::Strands { source: source.clone(), thickness_mm: *thickness_mm };
        Ok(MeshPart { source, color: *color, triangles })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_with_their_colours() {
        let files = ["a b.stl", "c,d.ply,color=#ff8000"].map(|text| mesh_file(text).unwrap());
        assert_eq!(files[0].source, "a b.stl");
        assert_eq!((files[1].source.as_str(), files[1].color[0]), ("c,d.ply", 1.0));
        let text = serde_json::to_string(&files[1]).unwrap();
        assert_eq!(text, "\"c,d.ply,color=#ff8000\"");
        assert!(mesh_file("a.stl,color=reddish").unwrap_err().contains("#rrggbb"));
        assert!(mesh_file(",color=#ffffff").is_err());
        let flags = OpaqueFlags { mesh: Some(vec![mesh_file("no such file.stl").unwrap()]), strands: None };
        let error = flags.read(&mut Vec::new(), &Loading::default()).unwrap_err();
        assert!(error.exit_status() == 2 && error.place.contains("--mesh"), "{error}");
    }

    #[test]
    fn strands_are_named_with_colour_and_thickness() {
        let plain = strand_file("a,b.tck").unwrap();
        assert_eq!((plain.source.as_str(), plain.thickness_mm), ("a,b.tck", None));
        for text in ["a.tck,color=#ff8000,thickness=0.25", "a.tck, thickness=0.25, color=#ff8000"] {
            let file = strand_file(text).unwrap();
            assert_eq!((file.source.as_str(), file.color[0], file.thickness_mm), ("a.tck", 1.0, Some(0.25)));
            assert_eq!(serde_json::to_string(&file).unwrap(), "\"a.tck,color=#ff8000,thickness=0.25\"");
        }
        for (text, why) in [
            ("a.tck,thickness=0", "above 0"),
            ("a.tck,thickness=x", "thickness"),
            ("a.tck,color=reddish", "#rrggbb"),
            ("a.tck,thickness=1,thickness=2", "twice"),
            (",thickness=1", "expected FILE[,color=...][,thickness=...]"),
            ("", "expected FILE"),
        ] {
            assert!(strand_file(text).unwrap_err().contains(why), "{text}");
        }
    }

    fn read(texts: &[&str]) -> (Result<Option<Arc<Mesh>>>, Vec<Diagnostic>) {
        let files = texts.iter().map(|text| strand_file(text).unwrap()).collect();
        let mut diagnostics = Vec::new();
        let flags = OpaqueFlags { mesh: None, strands: Some(files) };
        (flags.read(&mut diagnostics, &Loading::default()), diagnostics)
    }

    #[test]
    fn strands_become_parts_of_a_mesh_and_are_named_by_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, "v 0 0 0\nv 9 0 0\nv 9 9 0\nl 1 2 3\nl 2\n").unwrap();
        let path = path.to_str().unwrap();
        let (without, _) = read(&[path]);
        let e = without.unwrap_err();
        assert!(e.place.contains("--strands") && e.why.contains("thickness"), "{e}");
        assert_eq!(e.hint.unwrap(), "give a diameter with ,thickness=MM behind the file");
        let texts = [format!("{path},thickness=2"), "phantom:hair-fur:24,color=#ff0000".into()];
        let (mesh, diagnostics) = read(&texts.each_ref().map(String::as_str));
        let mesh = mesh.unwrap().unwrap();
        assert_eq!(diagnostics.len(), 1);
        assert!(diagnostics[0].message.contains("a.obj: 1 lines of fewer"), "{diagnostics:?}");
        let flags = OpaqueFlags::of(Some(&mesh));
        assert_eq!(flags.mesh, None);
        assert_eq!(flags.strands.unwrap(), texts.each_ref().map(|text| strand_file(text).unwrap()));
        assert_eq!(OpaqueFlags::of(None), OpaqueFlags::default());
        // Two segments with caps; a tube of fur for each strand.
        assert!(mesh.triangles().len() > 2 * 24 + 120);
        let [lo, hi] = mesh.bounds_mm();
        assert!(lo.y < 0.0 && hi.y > 9.0 && hi.x > 9.0, "{lo} {hi}");
    }

    #[test]
    fn too_many_are_refused_in_numbers() {
        let file = |text: &str, most: usize| {
            let mut diagnostics = Vec::new();
            let part = strand_file(text).unwrap().read(most, &mut diagnostics, &Loading::default());
            (part, diagnostics)
        };
        let (round, none) = file("phantom:hair-curly:500", MOST_TRIANGLES);
        let most = round.unwrap().triangles.len();
        assert_eq!(none, []);
        let (part, diagnostics) = file("phantom:hair-curly:500", most - 1);
        assert!((most / 2..most).contains(&part.unwrap().triangles.len()));
        assert!(
            diagnostics[0] == Diagnostic::note(diagnostics[0].message.clone())
                && diagnostics[0].message.contains(&format!("8 sides, since 12 would make {most}")),
            "{diagnostics:?}"
        );
        let e = file("phantom:hair-curly:2000", 10_000).0.unwrap_err();
        assert!(e.why.contains("2000 segments and 4 sides") && e.why.contains("10000 are the most"), "{e}");
        // Files share the limit.
        let e = read(&["phantom:hair-curly:50000", "phantom:hair-curly:30000"]).0.unwrap_err();
        assert!(e.place.contains("phantom:hair-curly:30000"), "{e}");
        assert!(read(&["phantom:thorax"]).0.is_err() && read(&["gone.tck"]).0.is_err());
    }
}
