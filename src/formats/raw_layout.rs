//! How the voxels of a raw file lie.

use crate::error::{Error, Result};
use crate::volume::element::{ByteOrder, Element};
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
