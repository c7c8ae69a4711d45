//! Decompression of chunks as streams, so that memory is limited to the window of the compressor.

use super::blosc::BloscReader;
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use ruzstd::decoding::{FrameDecoder, StreamingDecoder};
use serde_json::Value;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};

/// Largest window of a zstd stream, that of the highest level of the command `zstd`.
const MAX_WINDOW_BYTES: u64 = 128 << 20;
/// Bytes of the checksum after a chunk.
const CHECKSUM_BYTES: u64 = 4;

/// Compression of a chunk.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Compression {
    codec: Option<Codec>,
    /// Whether a CRC-32C of the compressed bytes follows them.
    has_checksum: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Codec {
    Gzip,
    Zlib,
    Zstd,
    Blosc,
}

impl Codec {
    fn new(name: &str) -> Result<Self, String> {
        match name.strip_prefix("numcodecs.").unwrap_or(name) {
            "gzip" => Ok(Self::Gzip),
            "zlib" => Ok(Self::Zlib),
            "zstd" => Ok(Self::Zstd),
            "blosc" => Ok(Self::Blosc),
            _ => Err(format!(
                "its chunks are compressed by `{name}`; gzip, zlib, zstd and blosc are supported"
            )),
        }
    }
}

impl Compression {
    /// Reads `compressor` and `filters` of version 2.
    ///
    /// # Errors
    /// One of them is not supported.
    pub(super) fn from_v2(metadata: &Value) -> Result<Self, String> {
        if let Some(filter) = metadata.get("filters").and_then(|f| f.get(0)) {
            let name = filter.get("id").and_then(Value::as_str).unwrap_or("?");
            return Err(format!("its chunks went through the filter `{name}`, which is not supported"));
        }
        let compressor = metadata.get("compressor").filter(|c| !c.is_null());
        let name = |c: &Value| c.get("id").and_then(Value::as_str).unwrap_or("?").to_owned();
        let codec = compressor.map(|c| Codec::new(&name(c))).transpose()?;
        Ok(Self { codec, has_checksum: false })
    }

    /// Adds a bytes-to-bytes codec of version 3.
    ///
    /// # Errors
    /// The codec is not supported, or follows another one.
    pub(super) fn push(&mut self, name: &str) -> Result<(), String> {
        if self.has_checksum || self.codec.is_some() && name != "crc32c" {
            return Err(format!(
                "its chunks are compressed by `{name}` after another codec, which is not supported"
            ));
        }
        match name {
            "crc32c" => self.has_checksum = true,
            _ => self.codec = Some(Codec::new(name)?),
        }
        Ok(())
    }

    /// Size of an uncompressed chunk in its file; `None` if it is compressed.
    pub(super) fn uncompressed_bytes(&self, bytes: u64) -> Option<u64> {
        let checksum = if self.has_checksum { CHECKSUM_BYTES } else { 0 };
        if self.codec.is_none() { bytes.checked_add(checksum) } else { None }
    }

    /// Decompresses a span (offset and bytes) of a file to `wanted` bytes.
    ///
    /// # Errors
    /// The file cannot be read, or is not compressed this way.
    pub(super) fn decoder(
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
        // Block positions are checked against the end of the file only; blocks outside the span cannot do harm.
        if self.codec == Some(Codec::Blosc) {
            return Ok(Box::new(BloscReader::new(BufReader::new(file), wanted)?));
        }
        let input = BufReader::with_capacity(1 << 16, file.take(count));
        Ok(match self.codec {
            None => Box::new(input),
            Some(Codec::Gzip) => Box::new(MultiGzDecoder::new(input)),
            Some(Codec::Zlib) => Box::new(ZlibDecoder::new(input)),
            Some(Codec::Zstd | Codec::Blosc) => Box::new(zstd(input)?),
        })
    }
}

/// Decoder of a zstd stream with limited memory.
///
/// # Errors
/// The stream is none of zstd, or its window is larger than that of any writer.
pub(super) fn zstd<R: Read>(input: R) -> io::Result<StreamingDecoder<R, FrameDecoder>> {
    StreamingDecoder::new_with_max_window_size(input, MAX_WINDOW_BYTES).map_err(bad)
}

fn bad(why: impl ToString) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, why.to_string())
}

/// Compares `count` bytes with the CRC-32C after them.
fn check(file: &mut File, count: u64) -> io::Result<()> {
    let mut input = BufReader::with_capacity(1 << 16, Read::by_ref(file).take(count + CHECKSUM_BYTES));
    let (mut found, mut left) = (0, count as usize);
    while left > 0 {
        let bytes = input.fill_buf()?;
        if bytes.is_empty() {
            break;
        }
        let length = bytes.len().min(left);
        found = crc32c::crc32c_append(found, &bytes[..length]);
        input.consume(length);
        left -= length;
    }
    let mut expected = [0; CHECKSUM_BYTES as usize];
    input.read_exact(&mut expected).map_err(|_| bad("it ends within its checksum"))?;
    if found == u32::from_le_bytes(expected) {
        Ok(())
    } else {
        Err(bad("it is damaged: its checksum differs"))
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
