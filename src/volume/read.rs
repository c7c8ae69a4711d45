//! Reads voxels from a stream, with memory bounded by the data that arrive.

use super::downsample::BlockMeans;
use super::element::{ByteOrder, Element};
use super::voxels::{Voxel, Voxels};
use ndarray::Array3;
use std::fmt;
use std::io::{self, Read};

/// Reason why the voxels of a volume cannot be read from a stream.
#[derive(Debug)]
pub enum ReadFailure {
    /// The voxel data end early, after `got` bytes.
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

/// Runs `$body` with `$convert` bound to a function that converts the stored bytes of a voxel to a number in memory.
/// The array that `$body` returns becomes [`Voxels`].
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

/// Number of voxel bytes that are converted at a time; a multiple of every voxel size.
const CHUNK_BYTES: usize = 1 << 20;

/// Reads a grid of `dims` voxels (`i` fastest). With `factors` it downsamples them to block means while it reads.
///
/// Memory grows with the data that arrive, not with the size that a header claims.
///
/// # Errors
/// The voxel data end early, cannot be read, or do not fit into memory.
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

/// Reads a grid of `dims` voxels that is stored with the last axis fastest, without a second copy in memory.
///
/// # Errors
/// The voxel data end early, cannot be read, or do not fit into memory.
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

/// Reads rows of voxels and downsamples them to block means.
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

/// Reads from `input` until `buffer` is full or the input ends; returns the number of bytes read.
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
    fn memory_grows_with_the_data_and_not_with_claims() {
        let mut input = io::repeat(7).take(3 * CHUNK_BYTES as u64 + 5);
        let claimed = [32767; 3];
        match read_voxels(&mut input, claimed, Element::F64, ByteOrder::Little, None) {
            Err(ReadFailure::Short { got }) => assert_eq!(got, 3 * CHUNK_BYTES as u64 + 5),
            other => panic!("{other:?}"),
        }
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
