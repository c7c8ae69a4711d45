//! Numbers of binary headers.

/// Bytes of a file whose numbers have one byte order.
#[derive(Debug, Clone, Copy)]
pub struct BinaryFields<'a> {
    /// Bytes of the file.
    pub bytes: &'a [u8],
    /// Whether the most significant byte of a number comes first.
    pub big_endian: bool,
}

impl BinaryFields<'_> {
    /// Bytes of the number at a position, in little-endian order.
    ///
    /// # Panics
    /// There are fewer bytes.
    pub fn little_endian<const N: usize>(self, at: usize) -> [u8; N] {
        let mut word = [0; N];
        word.copy_from_slice(&self.bytes[at..at + N]);
        if self.big_endian {
            word.reverse();
        }
        word
    }

    /// 16-bit integer at a position.
    pub fn short(self, at: usize) -> i16 {
        i16::from_le_bytes(self.little_endian(at))
    }

    /// 32-bit integer at a position.
    pub fn integer(self, at: usize) -> i32 {
        i32::from_le_bytes(self.little_endian(at))
    }

    /// 64-bit integer at a position.
    pub fn long(self, at: usize) -> i64 {
        i64::from_le_bytes(self.little_endian(at))
    }

    /// Successive 32-bit floats.
    pub fn floats<const N: usize>(self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| f32::from_le_bytes(self.little_endian(at + 4 * i)).into())
    }

    /// Successive 64-bit floats.
    pub fn doubles<const N: usize>(self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| f64::from_le_bytes(self.little_endian(at + 8 * i)))
    }
}
