//! Opaque objects of a scene: files of meshes and of strands, each with a colour.

use super::Diagnostic;
use super::key;
use super::layer::layer;
use super::strands::load_strands;
use super::values;
use crate::error::{Error, Result};
use crate::files::color;
use crate::files::loading::Loading;
use crate::mesh::{self, Mesh, MeshPart, PartSource};
use crate::strands::{MOST_TRIANGLES, SIDES, Tubes, tubes};
use clap::Args;
use serde::{Deserialize, Serialize, Serializer};
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

layer! {
/// Opaque objects in the volume; absent ones are `None`.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize, Deserialize)]
#[serde(default)]
pub struct OpaqueFlags {
    /// Opaque mesh in the volume, may be given several times: an STL, PLY or OBJ file, world mm, followed by
    /// ,color=#rrggbb (sRGB, bone)
    #[arg(long, value_name = "FILE", value_parser = MeshFile::from_str, help_heading = "Scene")]
    #[serde(deserialize_with = "key::texts", skip_serializing_if = "Option::is_none")]
    pub mesh: Option<Vec<MeshFile>>,
    /// Strands in the volume as opaque tubes, may be given several times: a .hair, .tck, .trk, .vtk, .vtp or .obj file or
    /// phantom:hair-NAME[:SEGMENTS], followed by ,color=#rrggbb (sRGB, blue) and ,thickness=MM (needed where the file
    /// has none)
    #[arg(long, value_name = "FILE", value_parser = StrandFile::from_str, help_heading = "Scene")]
    #[serde(deserialize_with = "key::texts", skip_serializing_if = "Option::is_none")]
    pub strands: Option<Vec<StrandFile>>,
}
}

/// A mesh file and its colour: `FILE[,color=#rrggbb]`.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// Path.
    pub source: String,
    /// Linear RGB.
    pub color: [f64; 3],
}

impl Serialize for MeshFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{},color={}", self.source, color::to_hex(self.color)))
    }
}

/// A file of strands, their colour and diameter: `FILE[,color=#rrggbb][,thickness=MM]`.
#[derive(Debug, Clone, PartialEq)]
pub struct StrandFile {
    /// A path, or `phantom:hair-NAME[:SEGMENTS]`.
    pub source: String,
    /// Linear RGB.
    pub color: [f64; 3],
    /// Diameter, mm; `None`: the file's.
    pub thickness_mm: Option<f64>,
}

impl Serialize for StrandFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let thickness = self.thickness_mm.map(|mm| format!(",thickness={mm}")).unwrap_or_default();
        serializer.collect_str(&format_args!(
            "{},color={}{thickness}",
            self.source,
            color::to_hex(self.color)
        ))
    }
}

impl FromStr for MeshFile {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (source, [hex]) = with_keys(text, ["color"])?;
        let color = color::parse_hex(hex.unwrap_or(Mesh::DEFAULT_COLOR))?;
        Ok(Self { source: source.into(), color })
    }
}

impl FromStr for StrandFile {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (source, [hex, mm]) = with_keys(text, ["color", "thickness"])?;
        let color = color::parse_hex(hex.unwrap_or(Mesh::DEFAULT_STRAND_COLOR))?;
        let thickness_mm = mm.map(values::thickness_mm).transpose();
        let thickness_mm = thickness_mm.map_err(|why| format!("thickness: {why}"))?;
        Ok(Self { source: source.into(), color, thickness_mm })
    }
}

/// Splits the name of a file from the keys behind it, each `,KEY=VALUE`.
fn with_keys<'a, const N: usize>(
    text: &'a str,
    keys: [&str; N],
) -> Result<(&'a str, [Option<&'a str>; N]), String> {
    let (mut name, mut values) = (text, [None; N]);
    // From the end, since a name may have commas.
    while let Some((before, item)) = name.rsplit_once(',') {
        let known = item.split_once('=').and_then(|(key, value)| {
            Some((keys.iter().position(|known| *known == key.trim())?, value.trim()))
        });
        let Some((place, value)) = known else { break };
        if values[place].replace(value).is_some() {
            return Err(format!("`{}` is given twice", keys[place]));
        }
        name = before;
    }
    if name.is_empty() {
        let keys: String = keys.iter().map(|key| format!("[,{key}=...]")).collect();
        return Err(format!("expected FILE{keys}"));
    }
    Ok((name, values))
}

impl OpaqueFlags {
    /// Names of files.
    pub(super) fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        let meshes = self.mesh.iter_mut().flatten().map(|mesh| &mut mesh.source);
        meshes.chain(self.strands.iter_mut().flatten().map(|strands| &mut strands.source))
    }

    /// Reads all opaque objects into one mesh, if there are any; notes and warnings join `diagnostics`.
    ///
    /// # Errors
    /// A file that cannot be read or has another format, or too many triangles.
    pub(super) fn read(
        &self,
        diagnostics: &mut Vec<Diagnostic>,
        loading: &Loading,
    ) -> Result<Option<Arc<Mesh>>> {
        let mut parts = Vec::new();
        for MeshFile { source, color } in self.mesh.iter().flatten() {
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

    /// Flags of a mesh: the inverse of [`Self::read`].
    pub(super) fn of(mesh: Option<&Mesh>) -> Self {
        let (mut files, mut strands) = (Vec::new(), Vec::new());
        for (source, color) in mesh.into_iter().flat_map(Mesh::parts) {
            match source {
                PartSource::File(path) => files.push(MeshFile { source: path.clone(), color }),
                PartSource::Strands { source, thickness_mm } => {
                    strands.push(StrandFile { source: source.clone(), color, thickness_mm: *thickness_mm });
                }
            }
        }
        Self {
            mesh: Some(files).filter(|files| !files.is_empty()),
            strands: Some(strands).filter(|strands| !strands.is_empty()),
        }
    }
}

impl StrandFile {
    /// Tubes of the strands, with at most `most` triangles.
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
        let files = ["a b.stl", "c,d.ply,color=#ff8000"].map(|text| text.parse::<MeshFile>().unwrap());
        assert_eq!(files[0].source, "a b.stl");
        assert_eq!((files[1].source.as_str(), files[1].color[0]), ("c,d.ply", 1.0));
        let text = serde_json::to_string(&files[1]).unwrap();
        assert_eq!(text, "\"c,d.ply,color=#ff8000\"");
        assert!("a.stl,color=red".parse::<MeshFile>().unwrap_err().contains("#rrggbb"));
        assert!(",color=#ffffff".parse::<MeshFile>().is_err());
        let flags = OpaqueFlags { mesh: Some(vec!["no such file.stl".parse().unwrap()]), strands: None };
        let error = flags.read(&mut Vec::new(), &Loading::default()).unwrap_err();
        assert!(error.exit_status() == 2 && error.place.contains("--mesh"), "{error}");
    }

    #[test]
    fn strands_are_named_with_colour_and_thickness() {
        let plain = "a,b.tck".parse::<StrandFile>().unwrap();
        assert_eq!((plain.source.as_str(), plain.thickness_mm), ("a,b.tck", None));
        for text in ["a.tck,color=#ff8000,thickness=0.25", "a.tck, thickness=0.25, color=#ff8000"] {
            let file = text.parse::<StrandFile>().unwrap();
            assert_eq!((file.source.as_str(), file.color[0], file.thickness_mm), ("a.tck", 1.0, Some(0.25)));
            assert_eq!(serde_json::to_string(&file).unwrap(), "\"a.tck,color=#ff8000,thickness=0.25\"");
        }
        for (text, why) in [
            ("a.tck,thickness=0", "above 0"),
            ("a.tck,thickness=x", "thickness"),
            ("a.tck,color=red", "#rrggbb"),
            ("a.tck,thickness=1,thickness=2", "twice"),
            (",thickness=1", "expected FILE[,color=...][,thickness=...]"),
            ("", "expected FILE"),
        ] {
            assert!(text.parse::<StrandFile>().unwrap_err().contains(why), "{text}");
        }
    }

    fn read(texts: &[&str]) -> (Result<Option<Arc<Mesh>>>, Vec<Diagnostic>) {
        let files = texts.iter().map(|text| text.parse::<StrandFile>().unwrap()).collect();
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
        assert_eq!(flags.strands.unwrap(), texts.each_ref().map(|text| text.parse::<StrandFile>().unwrap()));
        assert_eq!(OpaqueFlags::of(None), OpaqueFlags::default());
        // Two segments with caps; a tube of fur for each strand.
        assert!(mesh.triangles().len() > 2 * 24 + 120);
        let [lo, hi] = mesh.bounds_mm();
        assert!(lo.y < 0.0 && hi.y > 9.0 && hi.x > 9.0, "{lo} {hi}");
    }

    #[test]
    fn too_many_are_refused_in_numbers() {
        let (mesh, diagnostics) = read(&["phantom:hair-curly:50000", "phantom:hair-curly:6000"]);
        assert!((900_000..=MOST_TRIANGLES).contains(&mesh.unwrap().unwrap().triangles().len()));
        assert!(
            diagnostics[0] == Diagnostic::note(diagnostics[0].message.clone())
                && diagnostics[0].message.contains("8 sides, since 12 would make 1246920"),
            "{diagnostics:?}"
        );
        let e = read(&["phantom:hair-curly:200000"]).0.unwrap_err();
        assert!(
            e.why.contains("200000 segments and 4 sides") && e.why.contains("1000000 are the most"),
            "{e}"
        );
        let e = read(&["phantom:hair-curly:50000", "phantom:hair-curly:30000"]).0.unwrap_err();
        assert!(e.place.contains("phantom:hair-curly:30000"), "{e}");
        assert!(read(&["phantom:thorax"]).0.is_err() && read(&["gone.tck"]).0.is_err());
    }
}
