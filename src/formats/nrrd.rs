//! Reads NRRD volumes (Nearly Raw Raster Data, teem): `.nrrd`, or `.nhdr` with separate data files; raw, gzip or text
//! voxels.
//!
//! The affine to RAS+ mm comes from `space`, `space directions` and `space origin`, or from `spacings` alone. Source:
//! "Definition of NRRD File Format", teem.sourceforge.net/nrrd/format.html.

use super::common::{affine, mm_of, numbers};
use super::data_files::{DataFiles, Encoding, is_list, named_files};
use super::head::Head;
use super::slicer_segments::{SegmentLayers, named_segments};
use super::source::Block;
use super::text_header::{Description, Fields, Lines, TextFormat, grid, unreadable};
use crate::error::Result;
use crate::files::loading::Loading;
use crate::volume::{AffineSource, ByteOrder, Element, Scaling, Volume};
use glam::{DAffine3, DVec3};
use std::path::{Path, PathBuf};

/// File extensions of the NRRD format.
pub const EXTENSIONS: &[&str] = &["nrrd", "nhdr"];

const MAGIC: &[u8] = b"NRRD000";

/// Names of the header field in which an NRRD header lists its separate data files.
const DATA_FILE: &[&str] = &["data file", "datafile"];

/// First letters of the header fields in which 3D Slicer describes segments: `Segment0_Name:=liver`.
const SEGMENT: &str = "segment";

/// Whether a file is an NRRD volume.
pub fn is_nrrd(head: &Head) -> bool {
    head.starts_with(MAGIC)
}

const FORMAT: TextFormat = TextFormat { name: "nrrd", fields, description, data };

/// Reads one frame of an NRRD volume, selected by its index from 0.
///
/// # Errors
/// The file cannot be read, is no NRRD file, holds no scalars, or has less data than its header claims.
pub fn read_with(path: &Path, frame: usize, loading: &Loading) -> Result<Volume> {
    FORMAT.read(path, frame, loading)
}

/// Lists the header of an NRRD volume and the data files that it names.
///
/// # Errors
/// The NRRD header cannot be read.
pub fn files_of(path: &Path) -> Result<Vec<PathBuf>> {
    FORMAT.files(path)
}

fn fields(lines: &mut Lines<'_, '_>) -> Result<Fields, String> {
    let magic = lines.next()?.unwrap_or_default();
    if !magic.as_bytes().starts_with(MAGIC) {
        return Err("it is not an NRRD file".into());
    }
    let mut fields = Fields::default();
    // An empty line ends the header; a detached header ends with its file.
    while let Some(line) = lines.next()?.filter(|line| !line.is_empty()) {
        // A list of files is the last field and continues to the end of the header.
        if fields.get(DATA_FILE).is_some_and(is_list) {
            fields.list.push(line);
        } else if !line.starts_with('#') {
            match (line.split_once(": "), line.split_once(":=")) {
                (field, Some((key, value))) if field.is_none_or(|(name, _)| key.len() < name.len()) => {
                    fields.push(&format!("{key}:="), value);
                }
                (Some((name, value)), _) => fields.push(name, value),
                (None, _) => {}
            }
        }
    }
    Ok(fields)
}

fn description(fields: &Fields) -> Result<Description, String> {
    let axes = Axes::new(fields)?;
    let (mut dims, frames) = grid(&axes.sizes)?;
    let mut warnings = Vec::new();
    let affine = axes.affine(fields, &mut warnings)?;
    let name = fields.required(&["type"])?.to_lowercase();
    let element = Element::from_name(name.trim_end_matches("_t")).or_else(|| Element::from_c_name(&name));
    let element = element.ok_or_else(|| format!("its voxels are of type `{name}`; scalars are needed"))?;
    let byte_order = match fields.get(&["endian"]).map(str::to_lowercase).as_deref() {
        Some("big") => ByteOrder::Big,
        Some("little") | None => ByteOrder::Little,
        Some(other) => return Err(unreadable("endian", other)),
    };
    let layers = axes.layers(fields)?;
    let segments = match &layers {
        Some(layers) => layers.segments.clone(),
        None => named_segments(fields.with_prefix(SEGMENT)),
    };
    if let Some(SegmentLayers { count, .. }) = &layers {
        dims[0] = dims[0].checked_mul(*count).ok_or("more voxels than can be counted")?;
    }
    let block = Block { dims, element, byte_order, offset: 0, frame: 0 };
    Ok(Description { block, frames, scaling: Scaling::IDENTITY, affine, segments, layers, warnings })
}

/// Spatial and frame axes of an NRRD array, without the leading axes that hold the components of a voxel.
struct Axes {
    sizes: Vec<usize>,
    /// Number of leading NRRD axes that hold the components of a voxel.
    first: usize,
    /// Number of components of a voxel: 1, or the number of layers of overlapping segments.
    components: usize,
}

impl Axes {
    /// Finds the spatial and frame axes of an NRRD header.
    ///
    /// # Errors
    /// The sizes contradict the dimension.
    fn new(fields: &Fields) -> Result<Self, String> {
        let sizes = fields.sizes(&["sizes"])?;
        let dimension = fields.sizes(&["dimension"])?;
        if dimension != [sizes.len()] || sizes.len() > 16 {
            return Err(format!("its `dimension` is {dimension:?}, and it has {} sizes", sizes.len()));
        }
        let directions = fields.get(&["space directions"]).map(vectors).transpose()?;
        let kinds: Vec<&str> = fields.get(&["kinds"]).unwrap_or_default().split_whitespace().collect();
        let is_spatial = |axis: usize| match &directions {
            Some(all) => all.get(axis).is_some_and(Option::is_some),
            // An axis is spatial unless its kind is another.
            None => !matches!(
                kinds.get(axis).copied().unwrap_or("???"),
                "time" | "list" | "vector" | "point" | "normal" | "scalar" | "complex" | "stub"
            ),
        };
        // Axes before the spatial ones hold the values of a voxel.
        let first = (0..sizes.len()).take_while(|&axis| !is_spatial(axis)).count();
        let components = sizes[..first].iter().try_fold(1usize, |all, n| all.checked_mul(*n));
        let components = components.ok_or("more numbers at each voxel than can be counted")?;
        let mut sizes = sizes[first..].to_vec();
        // The third axis of planar images holds frames.
        if sizes.len() > 2 && !is_spatial(first + 2) {
            sizes.insert(2, 1);
        }
        Ok(Self { sizes, first, components })
    }

    /// Returns the layers of overlapping segments, whose numbers are the components of a voxel; `None` for scalars.
    ///
    /// # Errors
    /// The components are colours or vectors.
    fn layers(&self, fields: &Fields) -> Result<Option<SegmentLayers>, String> {
        if self.components == 1 {
            return Ok(None);
        }
        let refusal = || format!("it has {} numbers at each voxel; scalars are needed", self.components);
        SegmentLayers::new(fields.with_prefix(SEGMENT), self.components).map(Some).ok_or_else(refusal)
    }

    fn affine(
        &self,
        fields: &Fields,
        warnings: &mut Vec<String>,
    ) -> Result<(DAffine3, AffineSource), String> {
        let origin = fields.get(&["space origin"]).map(vectors).transpose()?;
        let origin = origin.and_then(|all| all.into_iter().next().flatten()).unwrap_or(DVec3::ZERO);
        let Some(directions) = fields.get(&["space directions"]).map(vectors).transpose()? else {
            return Ok((DAffine3::from_scale(self.spacings(fields, warnings)?), AffineSource::Spacing));
        };
        let of = |axis: usize| directions.get(self.first + axis).copied().flatten();
        let [Some(x), Some(y)] = [of(0), of(1)] else {
            return Err("its `space directions` do not say where its axes go".into());
        };
        // A file of one slice need not give its thickness.
        let z = of(2).unwrap_or_else(|| x.cross(y).normalize_or_zero());
        let unit = unit_mm(fields, warnings);
        let ([x, y, z], origin) = ([x * unit, y * unit, z * unit], origin * unit);
        let space = fields.get(&["space"]).unwrap_or_default().to_lowercase();
        let lps = match space.as_str() {
            "left-posterior-superior" | "lps" | "left-posterior-superior-time" | "lpst" => true,
            "right-anterior-superior" | "ras" | "right-anterior-superior-time" | "rast" => false,
            "left-anterior-superior" | "las" => {
                let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
                return Ok((mirror * affine([x, y, z], origin, false), AffineSource::Axes));
            }
            other => {
                let name = if other.is_empty() { "none" } else { other };
                warnings.push(format!("its space is `{name}`: taken as right-anterior-superior"));
                false
            }
        };
        Ok((affine([x, y, z], origin, lps), AffineSource::Axes))
    }

    fn spacings(&self, fields: &Fields, warnings: &mut Vec<String>) -> Result<DVec3, String> {
        let text = fields.get(&["spacings"]);
        let all: Vec<f64> = text
            .unwrap_or_default()
            .split_whitespace()
            .map(|n| n.parse::<f64>().map_err(|_| unreadable("spacings", n)))
            .collect::<Result<_, _>>()?;
        let mut missing = text.is_none();
        let spacing = DVec3::from_array(std::array::from_fn(|axis| {
            match all.get(self.first + axis).copied().filter(|s| s.is_finite() && *s != 0.0) {
                Some(mm) => mm.abs(),
                None => {
                    missing |= axis < self.sizes.len();
                    1.0
                }
            }
        }));
        if missing {
            warnings.push("no spacing is given: voxels taken as 1 mm".into());
        }
        warnings.push("no directions are given: placed by voxel sizes alone".into());
        Ok(spacing)
    }
}

/// Returns the length unit of an NRRD header in mm; 1 with a warning if the unit is unknown.
fn unit_mm(fields: &Fields, warnings: &mut Vec<String>) -> f64 {
    let text = fields.get(&["space units"]).unwrap_or_default();
    let units: Vec<&str> = text.split('"').map(str::trim).filter(|u| !u.is_empty()).collect();
    let Some(first) = units.first() else { return 1.0 };
    match mm_of(first).filter(|_| units.iter().all(|u| u == first)) {
        Some(mm) => mm,
        None => {
            warnings.push("its units of length are unknown or differ: taken as mm".into());
            1.0
        }
    }
}

/// Parses the vectors of an NRRD field: `(a,b,c)`, planar `(a,b)`, or `none`.
fn vectors(text: &str) -> Result<Vec<Option<DVec3>>, String> {
    let vector = |part: &str| {
        let parts = numbers(&part.trim_start().strip_prefix('(')?.replace(',', " "))?;
        match parts[..] {
            [] => Some(None),
            [x, y] => Some(Some(DVec3::new(x, y, 0.0))),
            [x, y, z] => Some(Some(DVec3::new(x, y, z))),
            _ => None,
        }
    };
    let vectors = text.replace("none", "()");
    let all: Option<Vec<_>> = vectors.trim_end().split_terminator(')').map(vector).collect();
    all.ok_or_else(|| unreadable("space directions or origin", text))
}

fn data(fields: &Fields, path: &Path, header_bytes: u64, is_gzipped: bool) -> Result<DataFiles, String> {
    let encoding = match fields.required(&["encoding"])?.to_lowercase().as_str() {
        "raw" => Encoding::Raw,
        "gzip" | "gz" => Encoding::Deflate,
        "ascii" | "text" | "txt" => Encoding::Text,
        other => return Err(format!("its voxels are encoded as `{other}`; raw, gzip and ascii can be read")),
    };
    if fields.get(&["line skip", "lineskip"]).is_some_and(|n| n != "0") {
        return Err("its `line skip` is not 0: lines before the voxels cannot be skipped".into());
    }
    let skip = match fields.get(&["byte skip", "byteskip"]) {
        None => Some(0),
        Some("-1") => None,
        Some(text) => Some(text.parse().map_err(|_| unreadable("byte skip", text))?),
    };
    let (paths, start, is_gzipped) = match fields.get(DATA_FILE) {
        Some(name) => (named_files(path, name, &fields.list)?, 0, false),
        None => (vec![path.to_path_buf()], header_bytes, is_gzipped),
    };
    Ok(DataFiles { paths, encoding, start, skip, is_gzipped })
}
