//! Voxel layout of raw volume files, from the text of `--raw`, the file name, or the sidecar file that `convert`
//! writes.

use crate::error::{Error, Result};
use crate::files::input::read_text;
use crate::volume::{ByteOrder, Element, Scaling, Volume};
use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Grid size, voxel type and byte order of a raw volume, written as `DIMXxDIMYxDIMZ:TYPE[:be]`; x runs fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawLayout {
    /// Number of voxels of the raw volume along x, y and z.
    pub dims: [usize; 3],
    /// Type of the stored voxels of a raw volume.
    pub element: Element,
    /// Byte order of the stored voxels of a raw volume.
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
    /// Parses the voxel layout from a file name such as `foot_256x256x256_uint8.raw` (also `_be`, and short type
    /// names).
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

/// JSON sidecar file of a `.raw` or `.npy` volume, with voxel layout, value mapping and affine; e.g. `foot.raw.json`
/// for `foot.raw`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sidecar {
    /// Voxel layout of the volume, in the syntax of the option `--raw`.
    pub layout: String,
    /// Slope of the linear mapping from stored voxel values to physical values.
    pub slope: f64,
    /// Intercept of the linear mapping from stored voxel values to physical values.
    pub intercept: f64,
    /// Affine from voxel indices to world coordinates (RAS+, mm): three rows of four numbers.
    pub world_from_index: [[f64; 4]; 3],
}

impl Sidecar {
    /// Creates the contents of the JSON sidecar file for a volume that is written with this voxel layout.
    pub fn new(volume: &Volume, layout: &RawLayout) -> Self {
        let affine = volume.world_from_index();
        let Scaling { slope, intercept } = volume.scaling();
        let world_from_index = std::array::from_fn(|row| {
            let m = affine.matrix3;
            [m.x_axis[row], m.y_axis[row], m.z_axis[row], affine.translation[row]]
        });
        Self { layout: layout.to_string(), slope, intercept, world_from_index }
    }

    /// Returns the path of the JSON sidecar file of a volume file: its path with `.json` appended.
    pub fn path_of(path: &Path) -> PathBuf {
        let mut name = path.as_os_str().to_owned();
        name.push(".json");
        name.into()
    }

    /// Reads the JSON sidecar file of a volume file; `None` if there is none.
    ///
    /// # Errors
    /// The sidecar file cannot be read or parsed.
    pub fn beside(path: &Path) -> Result<Option<Self>> {
        const WHAT: &str = "cannot read the sidecar of a volume";
        let path = Self::path_of(path);
        if !path.is_file() {
            return Ok(None);
        }
        let text = read_text(&path, WHAT)?;
        serde_json::from_str(&text).map(Some).map_err(|e| Error::input(WHAT, path.display(), e))
    }

    /// Parses the voxel layout text of the sidecar file.
    ///
    /// # Errors
    /// The text is no valid layout; see [`RawLayout::from_str`](std::str::FromStr).
    pub fn raw_layout(&self) -> Result<RawLayout> {
        self.layout.parse()
    }

    /// Returns the linear mapping from stored voxel values to physical values.
    pub fn scaling(&self) -> Scaling {
        Scaling { slope: self.slope, intercept: self.intercept }
    }

    /// Returns the affine from voxel indices to world coordinates (RAS+, mm).
    pub fn affine(&self) -> DAffine3 {
        let column = |c: usize| DVec3::from_array(self.world_from_index.map(|row| row[c]));
        DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3))
    }
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
    fn layouts_in_file_names() {
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
