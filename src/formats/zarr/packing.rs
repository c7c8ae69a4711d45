//! The bytes of a chunk, as they were before they were packed: a stream, so that a chunk takes no more memory than the
//! window of its packer whatever it claims to hold.

use super::blosc::BloscReader;
use super::zstd::zstd;
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use serde_json::Value;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

/// Bytes behind those of a chunk that has a checksum.
const CHECKSUM_BYTES: u64 = 4;

/// How the bytes of a chunk are packed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Packing {
    packer: Option<Packer>,
    /// A CRC-32C of what is packed follows after it.
    has_checksum: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Packer {
    Gzip,
    Zlib,
    Zstd,
    Blosc,
}

impl Packer {
    fn of(name: &str) -> Result<Self, String> {
        match name.strip_prefix("numcodecs.").unwrap_or(name) {
            "gzip" => Ok(Self::Gzip),
            "zlib" => Ok(Self::Zlib),
            "zstd" => Ok(Self::Zstd),
            "blosc" => Ok(Self::Blosc),
            _ => Err(format!("its chunks are packed by `{name}`; gzip, zlib, zstd and blosc are read")),
        }
    }
}

impl Packing {
    /// Of the `compressor` and `filters` of Zarr's version 2.
    ///
    /// # Errors
    /// One that is not read.
    pub(super) fn of_v2(metadata: &Value) -> Result<Self, String> {
        if let Some(filter) = metadata.get("filters").and_then(|f| f.get(0)) {
            let name = filter.get("id").and_then(Value::as_str).unwrap_or("?");
            return Err(format!("its chunks went through the filter `{name}`, which is not read"));
        }
        let compressor = metadata.get("compressor").filter(|c| !c.is_null());
        let name = |c: &Value| c.get("id").and_then(Value::as_str).unwrap_or("?").to_owned();
        let packer = compressor.map(|c| Packer::of(&name(c))).transpose()?;
        Ok(Self { packer, has_checksum: false })
    }

    /// Adds a codec of version 3 that makes bytes of bytes.
    ///
    /// # Errors
    /// It is not read, or after another one.
    pub(super) fn push(&mut self, codec: &str) -> Result<(), String> {
        if self.has_checksum || self.packer.is_some() && codec != "crc32c" {
            return Err(format!(
                "its chunks are packed by `{codec}` after another packer, which is not read"
            ));
        }
        match codec {
            "crc32c" => self.has_checksum = true,
            _ => self.packer = Some(Packer::of(codec)?),
        }
        Ok(())
    }

    /// Bytes that `bytes` of numbers take in a file, where none are packed.
    pub(super) fn plain_bytes(&self, bytes: u64) -> Option<u64> {
        let checksum = if self.has_checksum { CHECKSUM_BYTES } else { 0 };
        if self.packer.is_none() { bytes.checked_add(checksum) } else { None }
    }

    /// What `span` of a file, offset and bytes, unpacks to; `wanted` bytes are to come out of it.
    ///
    /// # Errors
    /// The file cannot be read, or is not packed so.
    pub(super) fn unpacked(
        &self,
        mut file: File,
        [from, count]: [u64; 2],
        wanted: u64,
    ) -> io::Result<Box<dyn Read>> {
        file.seek(SeekFrom::Start(from))?;
        let mut count = count;
        if self.has_checksum {
            count = count.checked_sub(CHECKSUM_BYTES).ok_or_else(|| bad("it ends within its checksum"))?;
            check(&mut file, count)?;
            file.seek(SeekFrom::Start(from))?;
        }
        // A hostile place of a block is refused by the end of the file alone: nothing is believed of what lies there.
        if self.packer == Some(Packer::Blosc) {
            return Ok(Box::new(BloscReader::new(BufReader::new(file), wanted)?));
        }
        let input = BufReader::with_capacity(1 << 16, file.take(count));
        Ok(match self.packer {
            None => Box::new(input),
            Some(Packer::Gzip) => Box::new(MultiGzDecoder::new(input)),
            Some(Packer::Zlib) => Box::new(ZlibDecoder::new(input)),
            Some(Packer::Zstd | Packer::Blosc) => Box::new(zstd(input)?),
        })
    }
}

fn bad(why: impl ToString) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, why.to_string())
}

/// Compares `count` bytes with the CRC-32C behind them.
fn check(file: &mut File, count: u64) -> io::Result<()> {
    let mut input = BufReader::with_capacity(1 << 16, Read::by_ref(file).take(count + CHECKSUM_BYTES));
    let found = crc32c(&mut Read::by_ref(&mut input).take(count))?;
    let mut said = [0; CHECKSUM_BYTES as usize];
    input.read_exact(&mut said).map_err(|_| bad("it ends within its checksum"))?;
    if found == u32::from_le_bytes(said) {
        Ok(())
    } else {
        Err(bad("it is damaged: its checksum is another"))
    }
}

/// CRC-32C (Castagnoli), bit by bit from the lowest one.
pub(super) fn crc32c(input: &mut impl Read) -> io::Result<u32> {
    const TABLE: [u32; 256] = {
        let mut table = [0; 256];
        let mut byte = 0;
        while byte < table.len() {
            let mut rest = byte as u32;
            let mut bit = 0;
            while bit < 8 {
                rest = if rest & 1 == 1 { rest >> 1 ^ 0x82f6_3b78 } else { rest >> 1 };
                bit += 1;
            }
            table[byte] = rest;
            byte += 1;
        }
        table
    };
    let (mut crc, mut buffer) = (u32::MAX, [0; 4096]);
    loop {
        let got = input.read(&mut buffer)?;
        if got == 0 {
            return Ok(!crc);
        }
        for byte in &buffer[..got] {
            crc = crc >> 8 ^ TABLE[usize::from(crc as u8 ^ byte)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_castagnolis() {
        // The check value of the catalogue of CRCs, and that of nothing.
        assert_eq!(crc32c(&mut &b"123456789"[..]).unwrap(), 0xe306_9283);
        assert_eq!(crc32c(&mut &b""[..]).unwrap(), 0);
    }

    #[test]
    fn packers_follow_each_other_only_where_that_is_read() {
        let mut packing = Packing::default();
        packing.push("zstd").unwrap();
        assert!(packing.push("gzip").unwrap_err().contains("after another"));
        packing.push("crc32c").unwrap();
        assert!(packing.push("blosc").is_err());
        assert!(Packing::default().push("bz2").unwrap_err().contains("`bz2`"));
    }
}
