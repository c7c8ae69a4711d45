//! Element types of voxels in files, and readers of bounded memory.

use super::downsample::BlockMeans;
use super::{Voxel, Voxels};
use ndarray::Array3;
use std::fmt;
use std::io::{self, Read};

/// Element type of the voxels in a file.
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

/// Order of the bytes of an element in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ByteOrder {
    /// Least significant byte first.
    #[default]
    Little,
    /// Most significant byte first.
    Big,
}

/// Short name, long name and size in bytes of each [`Element`].
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
    /// Element of a short (`u8`) or long name (`uint8`).
    pub fn from_name(name: &str) -> Option<Self> {
        ELEMENTS.iter().find(|(_, short, long, _)| name == *short || name == *long).map(|e| e.0)
    }

    /// Element of a type of C, such as `unsigned short` or `ushort`, with blanks or underscores; not `long`, whose size varies.
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

    /// Long name, e.g. `uint8`.
    pub fn name(self) -> &'static str {
        ELEMENTS[self as usize].2
    }

    /// Size of one element in a file.
    pub fn bytes(self) -> usize {
        ELEMENTS[self as usize].3
    }

    /// Size of one element in memory, as [`Voxels`] store it.
    pub fn memory_bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::I8 | Self::U16 | Self::I16 => 2,
            Self::F32 => 4,
            Self::U32 | Self::I32 | Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Kind and size as NumPy names them, e.g. `i2`.
    pub fn numpy_name(self) -> String {
        let (_, short, _, bytes) = ELEMENTS[self as usize];
        format!("{}{bytes}", &short[..1])
    }

    /// Element and byte order of a NumPy name such as `<i2`; the native order is taken as little-endian.
    pub fn from_numpy(name: &str) -> Option<(Self, ByteOrder)> {
        let kind = name.strip_prefix(['<', '>', '|', '=']).unwrap_or(name);
        let order = if name.starts_with('>') { ByteOrder::Big } else { ByteOrder::Little };
        let element = match kind {
            "b1" => Some(Self::U8),
            _ => ELEMENTS.iter().map(|e| e.0).find(|element| element.numpy_name() == kind),
        };
        Some((element?, order))
    }

    /// Name for people: `uint8`, `int16 big-endian`.
    pub fn describe(self, order: ByteOrder) -> String {
        let suffix = if order == ByteOrder::Big && self.bytes() > 1 { " big-endian" } else { "" };
        format!("{}{suffix}", self.name())
    }
}

/// Bytes of a grid of voxels; `None` on overflow.
pub fn grid_bytes(dims: [usize; 3], voxel_bytes: u64) -> Option<u64> {
    dims.iter().try_fold(voxel_bytes, |bytes, &n| bytes.checked_mul(n as u64))
}

/// Reason why voxels cannot be read.
#[derive(Debug)]
pub enum ReadFailure {
    /// The data end after `got` bytes.
    Short {
        got: u64,
    },
    Memory,
    Io(io::Error),
}

impl fmt::Display for ReadFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Short { got } => write!(f, "the voxels end after {got} bytes"),
            Self::Memory => write!(f, "not enough memory for the voxels"),
            Self::Io(e) => write!(f, "{e}"),
        }
    }
}

/// Runs `$body` with `$convert` bound to the conversion from stored bytes to a number in memory; the resulting array becomes
/// [`Voxels`].
macro_rules! with_element {
    ($element:expr, $order:expr, $convert:ident => $body:expr) => {{
        use $crate::volume::element::{ByteOrder, Element};
        macro_rules! of {
            ($stored:ty, $memory:ty) => {{
                let order: ByteOrder = $order;
                let $convert = move |bytes: [u8; size_of::<$stored>()]| match order {
                    ByteOrder::Little => <$stored>::from_le_bytes(bytes) as $memory,
                    ByteOrder::Big => <$stored>::from_be_bytes(bytes) as $memory,
                };
                $body.map($crate::volume::Voxels::from)
            }};
        }
        match $element {
            Element::U8 => of!(u8, u8),
            Element::I8 => of!(i8, i16),
            Element::U16 => of!(u16, u16),
            Element::I16 => of!(i16, i16),
            Element::U32 => of!(u32, f64),
            Element::I32 => of!(i32, f64),
            Element::U64 => of!(u64, f64),
            Element::I64 => of!(i64, f64),
            Element::F32 => of!(f32, f32),
            Element::F64 => of!(f64, f64),
        }
    }};
}
pub(crate) use with_element;

/// Bytes converted at a time; a multiple of every element size.
const CHUNK_BYTES: usize = 1 << 20;

/// Reads `dims` voxels (`i` fastest), or with `factors` the means of blocks of voxels.
///
/// Memory grows with the data that arrive, and never with the claims of a header.
///
/// # Errors
/// The data end early, cannot be read, or do not fit into memory.
pub(crate) fn read_voxels(
    input: &mut impl Read,
    dims: [usize; 3],
    element: Element,
    order: ByteOrder,
    factors: Option<[usize; 3]>,
) -> Result<Voxels, ReadFailure> {
    match factors {
        Some(factors) => with_element!(element, order, convert => read_means(input, dims, factors, convert)),
        None => with_element!(element, order, convert => read_array(input, dims, convert)),
    }
}

/// Reads voxels whose last axis runs fastest, without a second copy of them.
///
/// # Errors
/// The data end early, cannot be read, or do not fit into memory.
pub fn read_transposed(
    input: &mut impl Read,
    dims: [usize; 3],
    element: Element,
    order: ByteOrder,
) -> Result<Voxels, ReadFailure> {
    with_element!(element, order, convert => read_transposed_array(input, dims, convert))
}

fn read_transposed_array<T: Voxel, const N: usize>(
    input: &mut impl Read,
    [nx, ny, nz]: [usize; 3],
    convert: impl Fn([u8; N]) -> T,
) -> Result<Array3<T>, ReadFailure> {
    let count =
        [nx, ny, nz].iter().try_fold(1usize, |count, &n| count.checked_mul(n)).ok_or(ReadFailure::Memory)?;
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|_| ReadFailure::Memory)?;
    values.resize(count, T::from_f64(0.0));
    // The file holds columns along z, ordered by y, then x.
    let mut column = vec![0u8; nz.saturating_mul(N)];
    for at in 0..nx * ny {
        let got = read_full(input, &mut column).map_err(ReadFailure::Io)?;
        if got < column.len() {
            return Err(ReadFailure::Short { got: (at * column.len() + got) as u64 });
        }
        let first = at % ny * nx + at / ny;
        let places = values.iter_mut().skip(first).step_by(nx * ny);
        places.zip(column.as_chunks::<N>().0).for_each(|(value, &bytes)| *value = convert(bytes));
    }
    Array3::from_shape_vec((nz, ny, nx), values).map_err(|_| ReadFailure::Memory)
}

fn read_array<T, const N: usize>(
    input: &mut impl Read,
    dims: [usize; 3],
    convert: impl Fn([u8; N]) -> T,
) -> Result<Array3<T>, ReadFailure> {
    let count = dims.iter().try_fold(1usize, |count, &n| count.checked_mul(n)).ok_or(ReadFailure::Memory)?;
    let mut values = Vec::new();
    let mut chunk = vec![0u8; CHUNK_BYTES.min(count.saturating_mul(N))];
    while values.len() < count {
        let wanted = (count - values.len()).min(chunk.len() / N);
        let got = read_full(input, &mut chunk[..wanted * N]).map_err(ReadFailure::Io)?;
        if got < wanted * N {
            return Err(ReadFailure::Short { got: (values.len() * N + got) as u64 });
        }
        if values.capacity() - values.len() < wanted {
            let capacity = (2 * values.len()).max(wanted + values.len()).min(count);
            values.try_reserve_exact(capacity - values.len()).map_err(|_| ReadFailure::Memory)?;
        }
        values.extend(chunk[..wanted * N].as_chunks::<N>().0.iter().map(|&bytes| convert(bytes)));
    }
    Array3::from_shape_vec((dims[2], dims[1], dims[0]), values).map_err(|_| ReadFailure::Memory)
}

/// Reads rows and reduces them to block means.
fn read_means<T: Voxel, const N: usize>(
    input: &mut impl Read,
    dims: [usize; 3],
    factors: [usize; 3],
    convert: impl Fn([u8; N]) -> T,
) -> Result<Array3<T>, ReadFailure> {
    let [nx, ny, nz] = dims;
    let row_bytes = nx.checked_mul(N).ok_or(ReadFailure::Memory)?;
    let rows = ny.checked_mul(nz).ok_or(ReadFailure::Memory)?;
    let mut means = BlockMeans::new(dims, factors).ok_or(ReadFailure::Memory)?;
    let (mut bytes, mut row) = (Vec::new(), Vec::new());
    bytes.try_reserve_exact(row_bytes).map_err(|_| ReadFailure::Memory)?;
    row.try_reserve_exact(nx).map_err(|_| ReadFailure::Memory)?;
    bytes.resize(row_bytes, 0u8);
    for before in 0..rows {
        let got = read_full(input, &mut bytes).map_err(ReadFailure::Io)?;
        if got < row_bytes {
            return Err(ReadFailure::Short { got: (before * row_bytes + got) as u64 });
        }
        row.clear();
        row.extend(bytes.as_chunks::<N>().0.iter().map(|&bytes| convert(bytes)));
        means.push_row(&row).ok_or(ReadFailure::Memory)?;
    }
    means.finish().ok_or(ReadFailure::Memory)
}

/// Fills `buffer` up to the end of the input; returns the number of bytes read.
pub(crate) fn read_full(input: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match input.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(n) => filled += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            // A truncated compressed stream counts as a short file.
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => break,
            Err(e) => return Err(e),
        }
    }
    Ok(filled)
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
    fn memory_grows_with_the_data_and_not_with_claims() {
        let mut input = io::repeat(7).take(3 * CHUNK_BYTES as u64 + 5);
        let claimed = [32767; 3];
        match read_voxels(&mut input, claimed, Element::F64, ByteOrder::Little, None) {
            Err(ReadFailure::Short { got }) => assert_eq!(got, 3 * CHUNK_BYTES as u64 + 5),
            other => panic!("{other:?}"),
        }
        assert_eq!(grid_bytes([usize::MAX, 2, 1], 1), None);
    }

    #[test]
    fn transposed_data_are_the_same_voxels() {
        let [nx, ny, nz] = [5, 4, 3];
        let array = Array3::from_shape_fn((nz, ny, nx), |(k, j, i)| (100 * k + 10 * j + i) as i16);
        let transposed: Vec<u8> = array.t().iter().flat_map(|v| v.to_be_bytes()).collect();
        let read =
            |bytes: &[u8]| read_transposed(&mut &bytes[..], [nx, ny, nz], Element::I16, ByteOrder::Big);
        assert_eq!(read(&transposed).unwrap(), Voxels::I16(array));
        let short = transposed.len() - 3;
        assert!(matches!(read(&transposed[..short]), Err(ReadFailure::Short { got }) if got == short as u64));
    }

    #[test]
    fn chunks_join_without_gaps() {
        let dims = [1023, 513, 3];
        let values: Vec<u16> = (0..1023 * 513 * 3u32).map(|i| (i % 65521) as u16).collect();
        for order in [ByteOrder::Little, ByteOrder::Big] {
            let bytes: Vec<u8> = values
                .iter()
                .flat_map(|v| if order == ByteOrder::Big { v.to_be_bytes() } else { v.to_le_bytes() })
                .collect();
            let voxels = read_voxels(&mut &bytes[..], dims, Element::U16, order, None).unwrap();
            assert_eq!(voxels, Voxels::U16(Array3::from_shape_vec((3, 513, 1023), values.clone()).unwrap()));
        }
    }
}
