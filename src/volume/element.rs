//! Number types of the voxels in volume files.

/// Number type of the voxels in a volume file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "names of standard types")]
pub enum Element {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

/// Byte order of the numbers in a volume file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ByteOrder {
    /// Little-endian byte order: least significant byte first.
    #[default]
    Little,
    /// Big-endian byte order: most significant byte first.
    Big,
}

/// Short name, long name and size in bytes of each voxel type ([`Element`]).
const ELEMENTS: [(Element, &str, &str, usize); 10] = [
    (Element::U8, "u8", "uint8", 1),
    (Element::I8, "i8", "int8", 1),
    (Element::U16, "u16", "uint16", 2),
    (Element::I16, "i16", "int16", 2),
    (Element::U32, "u32", "uint32", 4),
    (Element::I32, "i32", "int32", 4),
    (Element::U64, "u64", "uint64", 8),
    (Element::I64, "i64", "int64", 8),
    (Element::F32, "f32", "float32", 4),
    (Element::F64, "f64", "float64", 8),
];

impl Element {
    /// Finds a voxel type by its short name (`u8`) or long name (`uint8`).
    pub fn from_name(name: &str) -> Option<Self> {
        ELEMENTS.iter().find(|(_, short, long, _)| name == *short || name == *long).map(|e| e.0)
    }

    /// Finds a voxel type by a type name of C, such as `unsigned short` or `ushort`, with blanks or underscores.
    /// `long` is not accepted, since its size varies.
    pub fn from_c_name(name: &str) -> Option<Self> {
        let name = name.to_ascii_lowercase().replace('_', " ");
        let unsigned = name.strip_prefix("unsigned ").or_else(|| name.strip_prefix('u'));
        let kind = unsigned.unwrap_or_else(|| name.strip_prefix("signed ").unwrap_or(&name));
        Some(match (kind.strip_suffix(" int").unwrap_or(kind), unsigned.is_some()) {
            ("char", true) => Self::U8,
            ("char", false) => Self::I8,
            ("short", true) => Self::U16,
            ("short", false) => Self::I16,
            ("int", true) => Self::U32,
            ("int", false) => Self::I32,
            ("long long" | "longlong", true) => Self::U64,
            ("long long" | "longlong", false) => Self::I64,
            ("float", false) => Self::F32,
            ("double", false) => Self::F64,
            _ => return None,
        })
    }

    /// Long name of the voxel type, e.g. `uint8`.
    pub fn name(self) -> &'static str {
        ELEMENTS[self as usize].2
    }

    /// Size of one voxel of this type in a file, bytes.
    pub fn bytes(self) -> usize {
        ELEMENTS[self as usize].3
    }

    /// Number type in memory, one of those of [`super::Voxels`].
    pub fn in_memory(self) -> Self {
        match self {
            Self::U8 | Self::U16 | Self::I16 | Self::F32 | Self::F64 => self,
            Self::I8 => Self::I16,
            Self::U32 | Self::I32 | Self::U64 | Self::I64 => Self::F64,
        }
    }

    /// Size of one voxel in memory, bytes, after the conversion to a type of [`super::Voxels`].
    pub fn memory_bytes(self) -> u64 {
        self.in_memory().bytes() as u64
    }

    /// Type name of NumPy for the voxel type, without byte order, e.g. `i2`.
    pub fn numpy_name(self) -> String {
        let (_, short, _, bytes) = ELEMENTS[self as usize];
        format!("{}{bytes}", &short[..1])
    }

    /// Parses voxel type and byte order from a type name of NumPy such as `<i2`. Native order is taken as
    /// little-endian.
    pub fn from_numpy(name: &str) -> Option<(Self, ByteOrder)> {
        let kind = name.strip_prefix(['<', '>', '|', '=']).unwrap_or(name);
        let order = if name.starts_with('>') { ByteOrder::Big } else { ByteOrder::Little };
        let element = match kind {
            "b1" => Some(Self::U8),
            _ => ELEMENTS.iter().map(|e| e.0).find(|element| element.numpy_name() == kind),
        };
        Some((element?, order))
    }

    /// Describes voxel type and byte order for the user, e.g. `uint8`, `int16 big-endian`.
    pub fn describe(self, order: ByteOrder) -> String {
        let suffix = if order == ByteOrder::Big && self.bytes() > 1 { " big-endian" } else { "" };
        format!("{}{suffix}", self.name())
    }
}

/// Returns the size of a grid of voxels in bytes; `None` on overflow.
pub fn grid_bytes(dims: [usize; 3], voxel_bytes: u64) -> Option<u64> {
    dims.iter().try_fold(voxel_bytes, |bytes, &n| bytes.checked_mul(n as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_the_order_of_the_enum() {
        for (i, (element, short, long, bytes)) in ELEMENTS.into_iter().enumerate() {
            assert_eq!(element as usize, i);
            assert_eq!(Element::from_name(short), Some(element));
            assert_eq!(Element::from_name(long), Some(element));
            assert_eq!(8 * bytes, short[1..].parse::<usize>().unwrap());
        }
        assert_eq!(Element::from_name("rgb24"), None);
        assert_eq!(Element::from_numpy(">f8"), Some((Element::F64, ByteOrder::Big)));
        assert_eq!(Element::from_numpy("|b1"), Some((Element::U8, ByteOrder::Little)));
        assert_eq!(Element::from_numpy("<c8"), None);
        for (name, element) in [
            ("signed char", Some(Element::I8)),
            ("UCHAR", Some(Element::U8)),
            ("unsigned_short", Some(Element::U16)),
            ("signed short int", Some(Element::I16)),
            ("uint", Some(Element::U32)),
            ("ulonglong", Some(Element::U64)),
            ("LONG_LONG", Some(Element::I64)),
            ("float", Some(Element::F32)),
            ("long", None),
            ("unsigned float", None),
        ] {
            assert_eq!(Element::from_c_name(name), element, "{name}");
        }
    }

    #[test]
    fn sizes_beyond_64_bits_are_none() {
        assert_eq!(grid_bytes([usize::MAX, 2, 1], 1), None);
    }
}
