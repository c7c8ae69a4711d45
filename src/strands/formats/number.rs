//! Numbers in binary files, by their kinds and names.

/// A kind of number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Number {
    /// Bytes of one.
    pub bytes: usize,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Signed,
    Unsigned,
    Float,
}

impl Number {
    /// What cells of legacy VTK files are written with.
    pub const INT: Self = Self { bytes: 4, kind: Kind::Signed };

    /// Floats, as tracks are.
    pub const FLOAT32: Self = Self { bytes: 4, kind: Kind::Float };
    /// The same, of twice as many bytes.
    pub const FLOAT64: Self = Self { bytes: 8, kind: Kind::Float };

    /// By a name of a legacy VTK file.
    pub fn of_legacy(name: &str) -> Option<Self> {
        let (bytes, kind) = match name.to_ascii_lowercase().as_str() {
            "unsigned_char" | "vtktypeuint8" => (1, Kind::Unsigned),
            "char" | "signed_char" | "vtktypeint8" => (1, Kind::Signed),
            "unsigned_short" | "vtktypeuint16" => (2, Kind::Unsigned),
            "short" | "vtktypeint16" => (2, Kind::Signed),
            "unsigned_int" | "vtktypeuint32" => (4, Kind::Unsigned),
            "int" | "vtkidtype" | "vtktypeint32" => (4, Kind::Signed),
            "unsigned_long" | "vtktypeuint64" => (8, Kind::Unsigned),
            "long" | "vtktypeint64" => (8, Kind::Signed),
            "float" => (4, Kind::Float),
            "double" => (8, Kind::Float),
            _ => return None,
        };
        Some(Self { bytes, kind })
    }

    /// By the `type` of an array of an XML VTK file.
    pub fn of_xml(name: &str) -> Option<Self> {
        let split = name.find(|c: char| c.is_ascii_digit())?;
        let (kind, bits) = name.split_at(split);
        let kind = match kind {
            "Int" => Kind::Signed,
            "UInt" => Kind::Unsigned,
            "Float" => Kind::Float,
            _ => return None,
        };
        let bytes = bits.parse::<usize>().ok()? / 8;
        let known = if kind == Kind::Float { [4, 8].contains(&bytes) } else { [1, 2, 4, 8].contains(&bytes) };
        known.then_some(Self { bytes, kind })
    }

    /// A number of as many bytes as it has.
    ///
    /// # Panics
    /// `bytes` are fewer.
    pub fn read(self, bytes: &[u8], big_endian: bool) -> f64 {
        let mut word = [0; 8];
        word[..self.bytes].copy_from_slice(&bytes[..self.bytes]);
        if big_endian {
            word[..self.bytes].reverse();
        }
        let bits = u64::from_le_bytes(word);
        // Whole numbers to 2^53, more than any file has points, come whole.
        match (self.kind, self.bytes) {
            (Kind::Float, 4) => f64::from(f32::from_bits(bits as u32)),
            (Kind::Float, _) => f64::from_bits(bits),
            (Kind::Unsigned, _) => bits as f64,
            (Kind::Signed, n) => {
                let unused = 64 - 8 * n as u32;
                ((bits << unused) as i64 >> unused) as f64
            }
        }
    }
}
