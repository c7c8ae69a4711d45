//! NRRD (Nearly Raw Raster Data, teem): `.nrrd`, and `.nhdr` with the voxels in a file beside it; raw, gzip and ascii.
//!
//! World is RAS+ mm by `space`, `space directions` and `space origin`; without them voxels are placed by `spacings` alone.
//! Source: "Definition of NRRD File Format", teem.sourceforge.net/nrrd/format.html.

use super::beside::beside;
use super::frames::picked;
use super::head::Head;
use super::parts;
use super::source::{Block, Source, inexact_integers};
use super::text_header::{Data, Encoding, Fields, Lines, affine, grid, numbers, unreadable};
use super::units::mm_of;
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::element::{ByteOrder, Element};
use crate::volume::{AffineSource, Provenance, Scaling, Volume};
use glam::{DAffine3, DVec3};
use std::path::{Path, PathBuf};

/// File-name endings of the format.
pub const EXTENSIONS: &[&str] = &["nrrd", "nhdr"];

const MAGIC: &[u8] = b"NRRD000";

/// The field that names the files of a detached header.
const DATA_FILE: &[&str] = &["data file", "datafile"];

/// Names of element types, as the format has them.
const TYPES: [(&[&str], Element); 10] = [
    (&["signed char", "int8", "int8_t"], Element::I8),
    (&["uchar", "unsigned char", "uint8", "uint8_t"], Element::U8),
    (&["short", "short int", "signed short", "signed short int", "int16", "int16_t"], Element::I16),
    (&["ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"], Element::U16),
    (&["int", "signed int", "int32", "int32_t"], Element::I32),
    (&["uint", "unsigned int", "uint32", "uint32_t"], Element::U32),
    (
        &[
            "longlong",
            "long long",
            "long long int",
            "signed long long",
            "signed long long int",
            "int64",
            "int64_t",
        ],
        Element::I64,
    ),
    (&["ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"], Element::U64),
    (&["float"], Element::F32),
    (&["double"], Element::F64),
];

/// Whether a file is of this format.
pub fn is_nrrd(head: &Head) -> bool {
    head.starts_with(MAGIC)
}

/// Reads one frame (0 is the first).
///
/// # Errors
/// The file cannot be read, is no NRRD file, holds no scalars, or has less data than its header claims.
pub fn read_with(path: &Path, frame: usize, loading: &Loading) -> Result<Volume> {
    let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
    let mut source = Source::open(path, loading)?;
    let (fields, header_bytes) = header(&mut source).map_err(refuse)?;
    let in_gzip = !matches!(source, Source::Plain { .. });
    drop(source);
    let axes = Axes::of(&fields).map_err(refuse)?;
    let (dims, frames) = grid(&axes.sizes).map_err(refuse)?;
    let mut warnings: Vec<String> = picked(path, frame, frames)?.into_iter().collect();
    let (world_from_index, affine_source) = axes.affine(&fields, &mut warnings).map_err(refuse)?;
    let block = block(&fields, dims, frame).map_err(refuse)?;
    let voxels = data(&fields, path, header_bytes, in_gzip).map_err(refuse)?.read(&block, frames, loading)?;
    warnings.extend(inexact_integers(&voxels, block.element));
    let provenance = Provenance {
        affine_source,
        frames,
        frame,
        warnings,
        ..Provenance::new(path.display().to_string(), "nrrd", block.stored_type())
    };
    Volume::new_with(voxels, Scaling::IDENTITY, world_from_index, provenance, loading)
}

/// The files that a header stands for: itself, and those that it names.
///
/// # Errors
/// The header cannot be read.
pub fn files_of(path: &Path) -> Result<Vec<PathBuf>> {
    let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
    let loading = Loading::default();
    let (fields, header_bytes) = header(&mut Source::open(path, &loading)?).map_err(refuse)?;
    let data = data(&fields, path, header_bytes, false).map_err(refuse)?;
    let mut files = vec![path.to_path_buf()];
    files.extend(data.paths.into_iter().filter(|file| file != path));
    Ok(files)
}

/// The fields, and the bytes up to the voxels.
fn header(source: &mut Source<'_>) -> Result<(Fields, u64), String> {
    let mut lines = Lines::new(source);
    let magic = lines.next()?.unwrap_or_default();
    if !magic.as_bytes().starts_with(MAGIC) {
        return Err("it is not an NRRD file".into());
    }
    let mut fields = Fields::default();
    // The header ends with an empty line, that of a detached one with its file.
    while let Some(line) = lines.next()?.filter(|line| !line.is_empty()) {
        // The last field of a header may be a list, a file in each line up to its end.
        if fields.get(DATA_FILE).is_some_and(parts::is_list) {
            fields.list.push(line);
            continue;
        }
        // Key and value pairs (`:=`) are what a user says of the volume, not what it is.
        if let Some((name, value)) = line.split_once(": ").filter(|_| !line.starts_with('#')) {
            fields.push(name, value);
        }
    }
    Ok((fields, lines.bytes))
}

/// The axes that place a volume: those of its grid, then the ones of frames.
struct Axes {
    sizes: Vec<usize>,
    /// Which axes of the file they are.
    kept: Vec<usize>,
}

impl Axes {
    /// # Errors
    /// Colours or vectors at each voxel, or no axes at all.
    fn of(fields: &Fields) -> Result<Self, String> {
        let sizes = fields.sizes(&["sizes"])?;
        let dimension = fields.sizes(&["dimension"])?;
        if dimension != [sizes.len()] || sizes.len() > 16 {
            return Err(format!("its `dimension` is {dimension:?}, and it has {} sizes", sizes.len()));
        }
        let directions = fields.get(&["space directions"]).map(vectors).transpose()?;
        let kinds: Vec<&str> = fields.get(&["kinds"]).unwrap_or_default().split_whitespace().collect();
        let is_spatial = |axis: usize| match &directions {
            Some(all) => all.get(axis).is_some_and(Option::is_some),
            // Only a kind that says otherwise makes an axis none of space.
            None => !matches!(
                kinds.get(axis).copied().unwrap_or("???"),
                "time" | "list" | "vector" | "point" | "normal" | "scalar" | "complex" | "stub"
            ),
        };
        // What is in front of the grid is at each voxel; one value there is a scalar.
        let inner = (0..sizes.len()).take_while(|&axis| !is_spatial(axis)).count();
        if let Some(&several) = sizes[..inner].iter().find(|&&n| n > 1) {
            return Err(format!("it has {several} numbers at each voxel; scalars are needed"));
        }
        let kept: Vec<usize> = (inner..sizes.len()).collect();
        let mut kept_sizes: Vec<usize> = kept.iter().map(|&axis| sizes[axis]).collect();
        // A picture in a plane has frames behind it, not slices.
        if kept.len() > 2 && !is_spatial(kept[2]) {
            kept_sizes.insert(2, 1);
        }
        Ok(Self { sizes: kept_sizes, kept })
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
        let of = |at: usize| self.kept.get(at).and_then(|&axis| directions.get(axis).copied().flatten());
        let [Some(x), Some(y)] = [of(0), of(1)] else {
            return Err("its `space directions` do not say where its axes go".into());
        };
        // A file of one slice need not say how thick it is.
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
        let spacing = DVec3::from_array(std::array::from_fn(|at| {
            let said = self.kept.get(at).and_then(|&axis| all.get(axis)).copied();
            match said.filter(|s| s.is_finite() && *s != 0.0) {
                Some(mm) => mm.abs(),
                None => {
                    missing |= at < self.kept.len();
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

/// The unit of length that the header gives for space, in mm; mm where it gives none that is known.
fn unit_mm(fields: &Fields, warnings: &mut Vec<String>) -> f64 {
    let text = fields.get(&["space units"]).unwrap_or_default();
    let units: Vec<&str> = text.split('"').map(str::trim).filter(|u| !u.is_empty()).collect();
    let Some(first) = units.first() else { return 1.0 };
    match mm_of(first).filter(|_| units.iter().all(|u| u == first)) {
        Some(mm) => mm,
        None => {
            warnings.push("its units of length are not known, or differ: taken as mm".into());
            1.0
        }
    }
}

/// Vectors `(a,b,c)`, or `none` for an axis without; two numbers lie in a plane.
fn vectors(text: &str) -> Result<Vec<Option<DVec3>>, String> {
    let refuse = || unreadable("space directions or origin", text);
    let mut all = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            all.push(None);
            rest = after.trim_start();
            continue;
        }
        let (inside, after) = rest.strip_prefix('(').and_then(|r| r.split_once(')')).ok_or_else(refuse)?;
        let parts = numbers(&inside.replace(',', " ")).ok_or_else(refuse)?;
        all.push(Some(match parts[..] {
            [x, y] => DVec3::new(x, y, 0.0),
            [x, y, z] => DVec3::new(x, y, z),
            _ => return Err(refuse()),
        }));
        rest = after.trim_start();
    }
    Ok(all)
}

fn block(fields: &Fields, dims: [usize; 3], frame: usize) -> Result<Block, String> {
    let name = fields.needed(&["type"])?.to_lowercase();
    let found = TYPES.iter().find(|(names, _)| names.contains(&name.as_str()));
    let element = found.ok_or_else(|| format!("its voxels are of type `{name}`; scalars are needed"))?.1;
    let byte_order = match fields.get(&["endian"]).map(str::to_lowercase).as_deref() {
        Some("big") => ByteOrder::Big,
        Some("little") | None => ByteOrder::Little,
        Some(other) => return Err(unreadable("endian", other)),
    };
    Ok(Block { dims, element, byte_order, offset: 0, frame })
}

fn data(fields: &Fields, path: &Path, header_bytes: u64, in_gzip: bool) -> Result<Data, String> {
    let encoding = match fields.needed(&["encoding"])?.to_lowercase().as_str() {
        "raw" => Encoding::Raw,
        "gzip" | "gz" => Encoding::Deflate,
        "ascii" | "text" | "txt" => Encoding::Text,
        other => return Err(format!("its voxels are packed as `{other}`; raw, gzip and ascii can be read")),
    };
    if fields.get(&["line skip", "lineskip"]).is_some_and(|n| n != "0") {
        return Err("its `line skip` is not 0: lines before the voxels cannot be passed over".into());
    }
    let skip = match fields.get(&["byte skip", "byteskip"]) {
        None => Some(0),
        Some("-1") => None,
        Some(text) => Some(text.parse().map_err(|_| unreadable("byte skip", text))?),
    };
    let (paths, start, in_gzip) = match fields.get(DATA_FILE) {
        Some(name) => match parts::named(path, name, &fields.list)? {
            Some(several) => (several, 0, false),
            None => (vec![beside(path, name)?], 0, false),
        },
        None => (vec![path.to_path_buf()], header_bytes, in_gzip),
    };
    Ok(Data { paths, encoding, start, skip, in_gzip })
}
