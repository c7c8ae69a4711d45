//! Decompresses Zarr chunks. All codecs except Blosc decompress a stream, which limits memory to the window of the
//! compressor.

use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use ruzstd::decoding::StreamingDecoder;
use serde_json::Value;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek, SeekFrom};

/// Largest accepted window of a zstd stream in bytes, as the highest level of the `zstd` command uses.
const MAX_WINDOW_BYTES: u64 = 128 << 20;
/// Size of the CRC-32C checksum after a Zarr chunk, in bytes.
pub(super) const CHECKSUM_BYTES: u64 = 4;

/// Compression of a Zarr chunk.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Compression {
    codec: Option<Codec>,
    /// Whether a CRC-32C checksum follows the compressed bytes of a Zarr chunk.
    has_checksum: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Codec {
    Gzip,
    Zlib,
    Zstd,
    Blosc,
}

impl Compression {
    /// Parses the entries `compressor` and `filters` of Zarr 2 metadata.
    ///
    /// # Errors
    /// The compressor or a filter is not supported.
    pub(super) fn from_v2(metadata: &Value) -> Result<Self, String> {
        let name = |codec: &Value| codec.get("id").and_then(Value::as_str).unwrap_or("?").to_owned();
        if let Some(filter) = metadata.get("filters").and_then(|f| f.get(0)) {
            let name = name(filter);
            return Err(format!("its chunks went through the filter `{name}`, which is not supported"));
        }
        let mut compression = Self::default();
        let compressor = metadata.get("compressor").filter(|c| !c.is_null());
        compressor.map_or(Ok(()), |codec| compression.push(&name(codec)))?;
        Ok(compression)
    }

    /// Adds a bytes-to-bytes codec of Zarr 3 to the compression of a chunk.
    ///
    /// # Errors
    /// The codec is not supported, or follows another one.
    pub(super) fn push(&mut self, name: &str) -> Result<(), String> {
        if self.has_checksum || self.codec.is_some() && name != "crc32c" {
            return Err(format!(
                "its chunks are compressed by `{name}` after another codec, which is not supported"
            ));
        }
        self.codec = match name.strip_prefix("numcodecs.").unwrap_or(name) {
            "crc32c" => {
                self.has_checksum = true;
                self.codec
            }
            "gzip" => Some(Codec::Gzip),
            "zlib" => Some(Codec::Zlib),
            "zstd" => Some(Codec::Zstd),
            "blosc" => Some(Codec::Blosc),
            _ => {
                return Err(format!(
                    "its chunks are compressed by `{name}`; gzip, zlib, zstd and blosc are supported"
                ));
            }
        };
        Ok(())
    }

    /// Returns the stored size of an uncompressed Zarr chunk in bytes; `None` if the chunk is compressed.
    pub(super) fn uncompressed_bytes(&self, bytes: u64) -> Option<u64> {
        let checksum = if self.has_checksum { CHECKSUM_BYTES } else { 0 };
        if self.codec.is_none() { bytes.checked_add(checksum) } else { None }
    }

    /// Decompresses a Zarr chunk of `wanted` bytes from a byte range (offset and length) of a file.
    ///
    /// # Errors
    /// The file cannot be read, or its bytes do not match the codec.
    pub(super) fn decoder(
        &self,
        mut file: File,
        [from, count]: [u64; 2],
        wanted: u64,
    ) -> io::Result<Box<dyn Read>> {
        file.seek(SeekFrom::Start(from))?;
        let mut input: Box<dyn BufRead> = Box::new(BufReader::with_capacity(1 << 16, file.take(count)));
        if self.has_checksum {
            input = Box::new(Cursor::new(verified(input)?));
        }
        Ok(match self.codec {
            None => Box::new(input),
            Some(Codec::Gzip) => Box::new(MultiGzDecoder::new(input)),
            Some(Codec::Zlib) => Box::new(ZlibDecoder::new(input)),
            Some(Codec::Zstd) => {
                let stream = StreamingDecoder::new_with_max_window_size(input, MAX_WINDOW_BYTES);
                Box::new(stream.map_err(bad)?)
            }
            Some(Codec::Blosc) => Box::new(Cursor::new(blosc(input, wanted)?)),
        })
    }
}

/// Creates an I/O error for invalid Zarr data.
pub(super) fn bad(why: impl ToString) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, why.to_string())
}

/// Decompresses a complete Blosc buffer to `wanted` bytes.
fn blosc(mut input: impl Read, wanted: u64) -> io::Result<Vec<u8>> {
    let mut packed = Vec::new();
    input.read_to_end(&mut packed)?;
    match blusc::blosc1_cbuffer_validate(&packed, packed.len()) {
        Ok(bytes) if bytes as u64 == wanted => blusc::convenience::blosc1_decompress(&packed).map_err(bad),
        Ok(bytes) => Err(bad(format!("its blosc buffer holds {bytes} bytes, and {wanted} are wanted"))),
        Err(()) => Err(bad("its blosc buffer is damaged")),
    }
}

/// Reads all bytes of a Zarr chunk and verifies the CRC-32C checksum at its end.
///
/// # Errors
/// The input cannot be read, or the checksum differs.
pub(super) fn verified(mut input: impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes)?;
    let end = bytes.len().checked_sub(CHECKSUM_BYTES as usize);
    let checksum = bytes.split_off(end.ok_or_else(|| bad("it ends within its checksum"))?);
    match crc32c::crc32c(&bytes).to_le_bytes()[..] == checksum {
        true => Ok(bytes),
        false => Err(bad("it is damaged: its checksum differs")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_checksum_may_follow_a_codec() {
        let mut compression = Compression::default();
        compression.push("zstd").unwrap();
        assert!(compression.push("gzip").unwrap_err().contains("after another"));
        compression.push("crc32c").unwrap();
        assert!(compression.push("blosc").is_err());
        assert!(Compression::default().push("bz2").unwrap_err().contains("`bz2`"));
    }
}
