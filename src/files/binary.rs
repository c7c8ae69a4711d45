//! Reads numbers at byte offsets of binary file headers.

/// Bytes of a binary file header and the byte order of its numbers.
#[derive(Debug, Clone, Copy)]
pub struct BinaryFields<'a> {
    /// Bytes of the binary file header.
    pub bytes: &'a [u8],
    /// Whether numbers of the file header are big-endian.
    pub big_endian: bool,
}

impl BinaryFields<'_> {
    /// Returns the bytes of the number at a byte offset of the file header, in little-endian order.
    ///
    /// # Panics
    /// The number extends beyond the end of the bytes.
    pub fn little_endian<const N: usize>(self, at: usize) -> [u8; N] {
        let mut word = [0; N];
        word.copy_from_slice(&self.bytes[at..at + N]);
        if self.big_endian {
            word.reverse();
        }
        word
    }

    /// Reads the signed 16-bit integer at a byte offset of the file header.
    pub fn short(self, at: usize) -> i16 {
        i16::from_le_bytes(self.little_endian(at))
    }

    /// Reads the signed 32-bit integer at a byte offset of the file header.
    pub fn integer(self, at: usize) -> i32 {
        i32::from_le_bytes(self.little_endian(at))
    }

    /// Reads the signed 64-bit integer at a byte offset of the file header.
    pub fn long(self, at: usize) -> i64 {
        i64::from_le_bytes(self.little_endian(at))
    }

    /// Reads consecutive 32-bit floats that start at a byte offset of the file header.
    pub fn floats<const N: usize>(self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| f32::from_le_bytes(self.little_endian(at + 4 * i)).into())
    }

    /// Reads consecutive 64-bit floats that start at a byte offset of the file header.
    pub fn doubles<const N: usize>(self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| f64::from_le_bytes(self.little_endian(at + 8 * i)))
    }
}
