//! MetaImage (ITK, Elastix): `.mha`, and `.mhd` with the voxels in a file beside it; raw, zlib and text.
//!
//! Directions and origin are in LPS mm, as in ITK, and are turned to RAS+.
//! Source: ITK's MetaIO documentation, "MetaImage Format".

use super::beside::beside;
use super::frames::picked;
use super::head::Head;
use super::parts;
use super::source::{Block, Source, inexact_integers};
use super::text_header::{Data, Encoding, Fields, Lines, affine, grid, unreadable};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::element::{ByteOrder, Element};
use crate::volume::{AffineSource, Provenance, Scaling, Volume};
use glam::{DAffine3, DVec3};
use std::path::{Path, PathBuf};

/// File-name endings of the format.
pub const EXTENSIONS: &[&str] = &["mha", "mhd"];

/// Element types, as the format has them.
const TYPES: [(&str, Element); 12] = [
    ("MET_CHAR", Element::I8),
    ("MET_UCHAR", Element::U8),
    ("MET_SHORT", Element::I16),
    ("MET_USHORT", Element::U16),
    ("MET_INT", Element::I32),
    ("MET_UINT", Element::U32),
    ("MET_LONG", Element::I32),
    ("MET_ULONG", Element::U32),
    ("MET_LONG_LONG", Element::I64),
    ("MET_ULONG_LONG", Element::U64),
    ("MET_FLOAT", Element::F32),
    ("MET_DOUBLE", Element::F64),
];

/// Keys that such a header can begin with.
const FIRST_KEYS: [&str; 3] = ["ObjectType", "NDims", "Comment"];

/// Whether a file is of this format.
pub fn is_metaimage(head: &Head) -> bool {
    let text = String::from_utf8_lossy(head.bytes());
    let first = text.split_once('=').map_or("", |(key, _)| key.trim());
    FIRST_KEYS.contains(&first) && (text.contains("NDims") || head.is_named(EXTENSIONS))
}

/// Reads one frame (0 is the first).
///
/// # Errors
/// The file cannot be read, is no MetaImage, holds no scalars, or has less data than its header claims.
pub fn read_with(path: &Path, frame: usize, loading: &Loading) -> Result<Volume> {
    let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
    let mut source = Source::open(path, loading)?;
    let (fields, header_bytes) = header(&mut source).map_err(refuse)?;
    let in_gzip = !matches!(source, Source::Plain { .. });
    drop(source);
    let sizes = fields.sizes(&["dimsize"]).map_err(refuse)?;
    let axes = fields.sizes(&["ndims"]).map_err(refuse)?;
    if axes != [sizes.len()] {
        return Err(refuse(format!("its `NDims` is {axes:?}, and its `DimSize` has {}", sizes.len())));
    }
    let (dims, frames) = grid(&sizes).map_err(refuse)?;
    let mut warnings: Vec<String> = picked(path, frame, frames)?.into_iter().collect();
    let (world_from_index, affine_source) = placed(&fields, sizes.len(), &mut warnings).map_err(refuse)?;
    let block = block(&fields, dims, frame).map_err(refuse)?;
    let scaling = scaling(&fields).map_err(refuse)?;
    let voxels = data(&fields, path, header_bytes, in_gzip).map_err(refuse)?.read(&block, frames, loading)?;
    warnings.extend(inexact_integers(&voxels, block.element));
    let provenance = Provenance {
        affine_source,
        frames,
        frame,
        warnings,
        ..Provenance::new(path.display().to_string(), "metaimage", block.stored_type())
    };
    Volume::new_with(voxels, scaling, world_from_index, provenance, loading)
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

/// The fields, and the bytes up to the voxels: `ElementDataFile` is the last line.
fn header(source: &mut Source<'_>) -> Result<(Fields, u64), String> {
    let mut lines = Lines::new(source);
    let mut fields = Fields::default();
    while let Some(line) = lines.next()? {
        let Some((name, value)) = line.split_once('=') else {
            if line.trim().is_empty() {
                continue;
            }
            return Err("it is not a MetaImage: a line of its header has no `=`".into());
        };
        fields.push(name, value);
        if name.trim().eq_ignore_ascii_case("ElementDataFile") {
            // What follows a list is names, a file in each line.
            while parts::is_list(value)
                && let Some(line) = lines.next()?
            {
                fields.list.extend(Some(line.trim().to_owned()).filter(|line| !line.is_empty()));
            }
            return Ok((fields, lines.bytes));
        }
    }
    Err("its header does not say where its voxels are (`ElementDataFile`)".into())
}

fn placed(
    fields: &Fields,
    axes: usize,
    warnings: &mut Vec<String>,
) -> Result<(DAffine3, AffineSource), String> {
    let spacing = match fields.exactly(&["elementspacing"], axes)? {
        Some(all) => Some(all),
        None => fields.exactly(&["elementsize"], axes)?,
    };
    if spacing.is_none() {
        warnings.push("no spacing is given: voxels taken as 1 mm".into());
    }
    let mm = |axis: usize| {
        spacing.as_ref().and_then(|s| s.get(axis)).copied().filter(|s| *s != 0.0).unwrap_or(1.0)
    };
    let origin = fields.exactly(&["offset", "position", "origin"], axes)?;
    let origin_mm = |axis: usize| origin.as_ref().and_then(|o| o.get(axis)).copied().unwrap_or(0.0);
    let matrix = fields.exactly(&["transformmatrix", "rotation", "orientation"], axes * axes)?;
    let is_placed = origin.is_some() || matrix.is_some();
    // Row `axis` of the matrix says where that axis of the grid goes.
    let direction = |axis: usize| {
        let along = |c: usize| match &matrix {
            Some(m) if axis < axes && c < axes => m[axis * axes + c],
            _ => f64::from(u8::from(axis == c)),
        };
        DVec3::new(along(0), along(1), along(2)) * mm(axis)
    };
    let directions = [direction(0), direction(1), direction(2)];
    let origin = DVec3::new(origin_mm(0), origin_mm(1), origin_mm(2));
    let source = if is_placed { AffineSource::Axes } else { AffineSource::Spacing };
    Ok((affine(directions, origin, true), source))
}

fn block(fields: &Fields, dims: [usize; 3], frame: usize) -> Result<Block, String> {
    let name = fields.needed(&["elementtype"])?.to_uppercase();
    let channels = fields.get(&["elementnumberofchannels"]).unwrap_or("1");
    if channels != "1" {
        return Err(format!("it has {channels} numbers at each voxel; scalars are needed"));
    }
    let found = TYPES.iter().find(|(known, _)| *known == name);
    let element = found.ok_or_else(|| format!("its voxels are of type `{name}`; scalars are needed"))?.1;
    let is_true = |names: &[&str]| fields.get(names).is_some_and(|v| v.eq_ignore_ascii_case("true"));
    let big = is_true(&["binarydatabyteordermsb", "elementbyteordermsb"]);
    let byte_order = if big { ByteOrder::Big } else { ByteOrder::Little };
    Ok(Block { dims, element, byte_order, offset: 0, frame })
}

fn scaling(fields: &Fields) -> Result<Scaling, String> {
    let number =
        |name: &str, absent: f64| Ok::<f64, String>(fields.exactly(&[name], 1)?.map_or(absent, |v| v[0]));
    Ok(Scaling {
        slope: number("elementtointensityfunctionslope", 1.0)?,
        intercept: number("elementtointensityfunctionoffset", 0.0)?,
    })
}

fn data(fields: &Fields, path: &Path, header_bytes: u64, in_gzip: bool) -> Result<Data, String> {
    let says = |name: &str, value: &str| fields.get(&[name]).is_some_and(|v| v.eq_ignore_ascii_case(value));
    let encoding = match (says("compresseddata", "true"), says("binarydata", "false")) {
        (true, _) => Encoding::Deflate,
        (_, true) => Encoding::Text,
        _ => Encoding::Raw,
    };
    let name = fields.needed(&["elementdatafile"])?;
    let header_size = fields.get(&["headersize"]).unwrap_or("0");
    let skipped: i64 = header_size.parse().map_err(|_| unreadable("HeaderSize", header_size))?;
    if name.eq_ignore_ascii_case("local") {
        let paths = vec![path.to_path_buf()];
        return Ok(Data { paths, encoding, start: header_bytes, skip: Some(0), in_gzip });
    }
    let paths = match parts::named(path, name, &fields.list)? {
        Some(several) => several,
        None => vec![beside(path, name)?],
    };
    Ok(match u64::try_from(skipped) {
        Ok(start) => Data { paths, encoding, start, skip: Some(0), in_gzip: false },
        // -1: the voxels are the last of the file.
        Err(_) => Data { paths, encoding, start: 0, skip: None, in_gzip: false },
    })
}
