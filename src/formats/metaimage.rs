//! Reads MetaImage volumes (ITK, Elastix): `.mha`, or `.mhd` with separate data files; raw, zlib or text voxels.
//!
//! Directions and origin are in LPS mm, as in ITK, and are converted to RAS+. Source: ITK's MetaIO documentation,
//! "MetaImage Format".

use super::common::affine;
use super::data_files::{DataFiles, Encoding, is_list, named_files};
use super::head::Head;
use super::source::Block;
use super::text_header::{Description, Fields, Lines, TextFormat, grid, unreadable};
use crate::error::Result;
use crate::files::loading::Loading;
use crate::volume::{AffineSource, ByteOrder, Element, Scaling, Volume};
use glam::{DAffine3, DVec3};
use std::path::{Path, PathBuf};

/// File extensions of the MetaImage format.
pub const EXTENSIONS: &[&str] = &["mha", "mhd"];

/// Field names with which a MetaImage header can begin.
const FIRST_KEYS: [&str; 3] = ["ObjectType", "NDims", "Comment"];

/// Whether a file is a MetaImage volume.
pub fn is_metaimage(head: &Head) -> bool {
    let text = String::from_utf8_lossy(&head.bytes);
    let first = text.split_once('=').map_or("", |(key, _)| key.trim());
    FIRST_KEYS.contains(&first) && (text.contains("NDims") || head.is_named(EXTENSIONS))
}

const FORMAT: TextFormat = TextFormat { name: "metaimage", fields, description, data };

/// Reads one frame of a MetaImage volume, selected by its index from 0.
///
/// # Errors
/// The file cannot be read, is no MetaImage, holds no scalars, or has less data than its header claims.
pub fn read_with(path: &Path, frame: usize, loading: &Loading) -> Result<Volume> {
    FORMAT.read(path, frame, loading)
}

/// Lists the header of a MetaImage volume and the data files that it names.
///
/// # Errors
/// The MetaImage header cannot be read.
pub fn files_of(path: &Path) -> Result<Vec<PathBuf>> {
    FORMAT.files(path)
}

/// Reads the fields of a MetaImage header, up to the last one, `ElementDataFile`.
fn fields(lines: &mut Lines<'_, '_>) -> Result<Fields, String> {
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
            // Names of files follow `LIST`, one a line.
            while is_list(value)
                && let Some(line) = lines.next()?
            {
                fields.list.extend(Some(line.trim().to_owned()).filter(|line| !line.is_empty()));
            }
            return Ok(fields);
        }
    }
    Err("its header does not name the file of its voxels (`ElementDataFile`)".into())
}

fn description(fields: &Fields) -> Result<Description, String> {
    let sizes = fields.sizes(&["dimsize"])?;
    let axes = fields.sizes(&["ndims"])?;
    if axes != [sizes.len()] {
        return Err(format!("its `NDims` is {axes:?}, and its `DimSize` has {}", sizes.len()));
    }
    let (dims, frames) = grid(&sizes)?;
    let mut warnings = Vec::new();
    let affine = placement(fields, sizes.len(), &mut warnings)?;
    let name = fields.required(&["elementtype"])?.to_uppercase();
    let channels = fields.get(&["elementnumberofchannels"]).unwrap_or("1");
    if channels != "1" {
        return Err(format!("it has {channels} numbers at each voxel; scalars are needed"));
    }
    let element = match name.as_str() {
        "MET_LONG" => Some(Element::I32),
        "MET_ULONG" => Some(Element::U32),
        other => other.strip_prefix("MET_").and_then(Element::from_c_name),
    };
    let element = element.ok_or_else(|| format!("its voxels are of type `{name}`; scalars are needed"))?;
    let is_big = ["binarydatabyteordermsb", "elementbyteordermsb"];
    let is_big = fields.get(&is_big).is_some_and(|v| v.eq_ignore_ascii_case("true"));
    let byte_order = if is_big { ByteOrder::Big } else { ByteOrder::Little };
    let number = |name, default| Ok::<f64, String>(fields.numbers(&[name], 1)?.map_or(default, |v| v[0]));
    let scaling = Scaling {
        slope: number("elementtointensityfunctionslope", 1.0)?,
        intercept: number("elementtointensityfunctionoffset", 0.0)?,
    };
    Ok(Description {
        block: Block { dims, element, byte_order, offset: 0, frame: 0 },
        frames,
        scaling,
        affine,
        segments: Vec::new(),
        layers: None,
        warnings,
    })
}

fn placement(
    fields: &Fields,
    axes: usize,
    warnings: &mut Vec<String>,
) -> Result<(DAffine3, AffineSource), String> {
    let spacing = match fields.numbers(&["elementspacing"], axes)? {
        Some(all) => Some(all),
        None => fields.numbers(&["elementsize"], axes)?,
    };
    if spacing.is_none() {
        warnings.push("no spacing is given: voxels taken as 1 mm".into());
    }
    let mm = |axis: usize| {
        spacing.as_ref().and_then(|s| s.get(axis)).copied().filter(|s| *s != 0.0).unwrap_or(1.0)
    };
    let origin = fields.numbers(&["offset", "position", "origin"], axes)?;
    let origin_mm = |axis: usize| origin.as_ref().and_then(|o| o.get(axis)).copied().unwrap_or(0.0);
    let matrix = fields.numbers(&["transformmatrix", "rotation", "orientation"], axes * axes)?;
    let is_placed = origin.is_some() || matrix.is_some();
    // Row `axis` of the matrix is the direction of that axis of the grid.
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

fn data(fields: &Fields, path: &Path, header_bytes: u64, is_gzipped: bool) -> Result<DataFiles, String> {
    let has = |name: &str, value: &str| fields.get(&[name]).is_some_and(|v| v.eq_ignore_ascii_case(value));
    let encoding = match (has("compresseddata", "true"), has("binarydata", "false")) {
        (true, _) => Encoding::Deflate,
        (_, true) => Encoding::Text,
        _ => Encoding::Raw,
    };
    let name = fields.required(&["elementdatafile"])?;
    let header_size = fields.get(&["headersize"]).unwrap_or("0");
    let skipped: i64 = header_size.parse().map_err(|_| unreadable("HeaderSize", header_size))?;
    if name.eq_ignore_ascii_case("local") {
        let paths = vec![path.to_path_buf()];
        return Ok(DataFiles { paths, encoding, start: header_bytes, skip: Some(0), is_gzipped });
    }
    let paths = named_files(path, name, &fields.list)?;
    // -1: the voxels end the file.
    let (start, skip) = u64::try_from(skipped).map_or((0, None), |start| (start, Some(0)));
    Ok(DataFiles { paths, encoding, start, skip, is_gzipped: false })
}
