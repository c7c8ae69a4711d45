//! Raw files: voxels and nothing else, gzipped or not; the layout comes from `--raw`, from a [`Sidecar`] or from the
//! file's name.

use super::sidecar::Sidecar;
use super::source::{Block, Packing, Source, Whole};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::element::{ByteOrder, Element};
use crate::volume::{AffineSource, Provenance, Scaling, Volume};
use glam::{DAffine3, DVec3};
use std::path::Path;
use std::str::FromStr;

/// Grid and element type of a raw file, `DIMXxDIMYxDIMZ:TYPE[:be]`; x runs fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawLayout {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Type of the voxels.
    pub element: Element,
    /// Order of their bytes.
    pub byte_order: ByteOrder,
}

const LAYOUT_HINT: &str =
    "DIMXxDIMYxDIMZ:u8|i8|u16|i16|u32|i32|f32|f64[:be], for instance 256x256x128:u8 or 512x512x300:i16:be";

impl FromStr for RawLayout {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refuse = |why: String| Error::input("cannot read raw layout", text, why).hint(LAYOUT_HINT);
        let mut parts = text.split(':');
        let dims = parts.next().unwrap_or_default();
        let dims = parse_dims(dims).ok_or_else(|| refuse(format!("`{dims}` is not three sizes above 0")))?;
        let element = parts.next().ok_or_else(|| refuse("the element type is missing".into()))?;
        let element = Element::from_name(element)
            .ok_or_else(|| refuse(format!("`{element}` is not an element type")))?;
        let byte_order = match (parts.next(), parts.next()) {
            (None, _) | (Some("le"), None) => ByteOrder::Little,
            (Some("be"), None) => ByteOrder::Big,
            (Some(other), _) => return Err(refuse(format!("`{other}` is not `be`"))),
        };
        Ok(Self { dims, element, byte_order })
    }
}

impl std::fmt::Display for RawLayout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y, z] = self.dims;
        let order = if self.byte_order == ByteOrder::Big { ":be" } else { "" };
        write!(f, "{x}x{y}x{z}:{}{order}", self.element.name())
    }
}

impl serde::Serialize for RawLayout {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl RawLayout {
    /// From a file name such as `foot_256x256x256_uint8.raw` (also `_be`, and the short type names); `None` where the
    /// name does not say it.
    pub fn from_file_name(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?.to_ascii_lowercase();
        let stem = name.strip_suffix(".gz").unwrap_or(&name).strip_suffix(".raw")?;
        let parts: Vec<&str> = stem.split(['_', '-', '.']).collect();
        parts.windows(2).enumerate().find_map(|(at, pair)| {
            let dims = parse_dims(pair[0])?;
            let element = Element::from_name(pair[1])?;
            let big = parts.get(at + 2) == Some(&"be");
            Some(Self { dims, element, byte_order: if big { ByteOrder::Big } else { ByteOrder::Little } })
        })
    }
}

fn parse_dims(text: &str) -> Option<[usize; 3]> {
    let sizes: Vec<usize> = text.split('x').map(|n| n.parse().ok()).collect::<Option<_>>()?;
    <[usize; 3]>::try_from(sizes).ok().filter(|dims| dims.iter().all(|&n| n > 0))
}

/// What is read, and where the file does not say it, how it is placed.
#[derive(Debug, Clone, PartialEq)]
pub struct RawFile {
    /// Grid and element type.
    pub layout: RawLayout,
    /// Voxel size, mm; voxel (0, 0, 0) then sits at the world's origin and the axes are the world's.
    pub spacing_mm: Option<[f64; 3]>,
    /// Bytes before the voxels, unpacked.
    pub offset_bytes: u64,
    /// What stands beside the file, where anything does.
    pub sidecar: Option<Sidecar>,
}

impl From<RawLayout> for RawFile {
    /// Voxels from the first byte on, and nothing known of where they are.
    fn from(layout: RawLayout) -> Self {
        Self { layout, spacing_mm: None, offset_bytes: 0, sidecar: None }
    }
}

/// Reads a raw file, gzipped or not. Without a spacing and without a sidecar voxels count 1 mm.
///
/// # Errors
/// The file cannot be read, its size is not exactly the offset and the voxels, or a spacing is not above 0.
pub fn read(path: &Path, file: &RawFile) -> Result<Volume> {
    read_with(path, file, &Loading::default())
}

/// As [`read`], watched and ended early through `loading`.
///
/// # Errors
/// As there, or it was cancelled.
pub fn read_with(path: &Path, file: &RawFile, loading: &Loading) -> Result<Volume> {
    let RawFile { layout, spacing_mm, offset_bytes, sidecar } = file;
    let source = path.display().to_string();
    let refuse = |why: String| Error::input("cannot read raw volume", &source, why);
    let mut warnings = Vec::new();
    if sidecar.is_none() && spacing_mm.is_none() {
        warnings.push("no --spacing given: voxels taken as 1 mm".to_string());
    }
    let spacing_mm = spacing_mm.unwrap_or([1.0; 3]);
    if !spacing_mm.iter().all(|s| s.is_finite() && *s > 0.0) {
        return Err(Error::input(
            "cannot use spacing",
            "--spacing",
            format!("{spacing_mm:?} mm is not three lengths above 0"),
        ));
    }
    let RawLayout { dims, element, byte_order } = *layout;
    let block = Block { dims, element, byte_order, offset: *offset_bytes, frame: 0 };
    let wanted = block.bytes().and_then(|bytes| bytes.checked_add(*offset_bytes));
    // Voxels may begin as a gzip stream does: a file of just their size is none.
    let is_exact = std::fs::metadata(path).is_ok_and(|m| Some(m.len()) == wanted);
    let packing = if is_exact { Packing::Plain } else { Packing::Sniffed };
    let mut data = Source::open_at(path, 0, packing, loading)?;
    let another_size = |held: String| {
        let [nx, ny, nz] = dims;
        let wanted = wanted.map_or("more bytes than can be counted".into(), |n| format!("{n} bytes"));
        let claim = format!("{nx}x{ny}x{nz} {} after {offset_bytes} bytes is {wanted}", block.stored_type());
        refuse(format!("{claim}, the file has {held}"))
            .hint("--raw DIMXxDIMYxDIMZ:TYPE and --offset BYTES must account for the whole file")
    };
    let is_plain = matches!(data, Source::Plain { .. });
    if is_plain && wanted != Some(data.most_bytes()) {
        return Err(another_size(format!("{} bytes", data.most_bytes())));
    }
    let voxels = block.read_all(&mut data).map_err(|e| match e {
        // What a packed file holds is known once it was unpacked.
        Whole::Another(held) => another_size(held),
        Whole::Unreadable(why) => refuse(why),
    })?;
    let world_from_index = match sidecar {
        Some(said) if file.spacing_mm.is_none() => said.affine(),
        _ => DAffine3::from_scale(DVec3::from_array(spacing_mm)),
    };
    let scaling = sidecar.as_ref().map_or(Scaling::IDENTITY, Sidecar::scaling);
    let affine_source = match sidecar {
        Some(_) if file.spacing_mm.is_none() => AffineSource::Axes,
        _ => AffineSource::Spacing,
    };
    let stored_type = block.stored_type();
    let provenance = Provenance { affine_source, warnings, ..Provenance::new(&source, "raw", stored_type) };
    Volume::new_with(voxels, scaling, world_from_index, provenance, loading)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(dims: [usize; 3], element: Element, byte_order: ByteOrder) -> RawLayout {
        RawLayout { dims, element, byte_order }
    }

    #[test]
    fn layouts() {
        let parse = |s: &str| s.parse::<RawLayout>();
        assert_eq!(parse("3x4x5:u8").unwrap(), layout([3, 4, 5], Element::U8, ByteOrder::Little));
        assert_eq!(parse("3x4x5:i16:be").unwrap(), layout([3, 4, 5], Element::I16, ByteOrder::Big));
        for bad in [
            "",
            "3x4:u8",
            "3x4x5",
            "3x4x5:",
            "3x4x5:rgb",
            "0x4x5:u8",
            "-3x4x5:u8",
            "3x4x5x6:u8",
            "3x4x5:u8:pdp",
            "3x4x5:u8:be:x",
            "99999999999999999999x1x1:u8",
        ] {
            let error = parse(bad).unwrap_err();
            assert_eq!(error.exit_status(), 2, "{bad}");
            assert!(error.hint.is_some());
        }
    }

    #[test]
    fn names_that_say_it() {
        let named = |s: &str| RawLayout::from_file_name(Path::new(s));
        let foot = layout([256, 256, 256], Element::U8, ByteOrder::Little);
        assert_eq!(named("a/foot_256x256x256_uint8.raw"), Some(foot));
        assert_eq!(named("foot_256x256x256_u8.RAW"), Some(foot));
        assert_eq!(named("foot_256x256x256_u8.raw.gz"), Some(foot));
        assert_eq!(
            named("csafe_heptane_302x302x302_int16_be.raw"),
            Some(layout([302, 302, 302], Element::I16, ByteOrder::Big))
        );
        for bad in
            ["foot.raw", "foot_256x256_uint8.raw", "foot_256x256x256.raw", "foot_256x256x256_uint8.nii"]
        {
            assert_eq!(named(bad), None, "{bad}");
        }
    }
}
