//! Decodes a data array of a VTK XML file as a byte stream, with at most one compressed block in memory.
//!
//! An uncompressed array begins with its number of bytes. A compressed array consists of blocks and begins with a
//! header: the number of blocks, the uncompressed size of a full block, the size of the last block if it is not full,
//! and the compressed size of each block. In base64 files this header is encoded separately from the data.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use base64::read::DecoderReader;
use flate2::read::ZlibDecoder;
use roxmltree::Node;
use std::io::{self, Cursor, Read};

/// Largest compression ratio that zlib can reach; a VTK file that claims more is rejected.
const MOST_RATIO: u64 = 1100;

/// Encoding of the data arrays of a VTK XML file.
#[derive(Debug, Clone, Copy)]
pub struct Coding {
    /// Whether numbers of the VTK XML file are big-endian.
    pub big_endian: bool,
    /// Size in bytes of each size field before the data of a VTK array.
    header_bytes: usize,
    compressed: bool,
}

impl Coding {
    /// Reads the encoding of data arrays from the attributes of a VTK XML file's root element.
    ///
    /// # Errors
    /// The compressor or the type of the size fields is not supported.
    pub fn of(root: Node) -> Result<Self, String> {
        let compressed = match root.attribute("compressor") {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => return Err(format!("its compressor is {other}; zlib or none is read")),
        };
        let header_bytes = match root.attribute("header_type") {
            None | Some("UInt32") => 4,
            Some("UInt64") => 8,
            Some(other) => return Err(format!("its header_type is {other}, neither UInt32 nor UInt64")),
        };
        Ok(Self { big_endian: root.attribute("byte_order") == Some("BigEndian"), header_bytes, compressed })
    }

    /// Reads one of the size fields before the data of a VTK array; `place` is its index.
    fn number(&self, bytes: &[u8], place: usize) -> u64 {
        let mut word = [0; 8];
        let n = self.header_bytes;
        word[..n].copy_from_slice(&bytes[place * n..(place + 1) * n]);
        if self.big_endian {
            word[..n].reverse();
        }
        u64::from_le_bytes(word)
    }
}

/// Byte stream of one data array of a VTK XML file, decoded and decompressed.
pub struct ArrayBytes<'a> {
    /// Number of bytes of the VTK data array, as its header states.
    pub bytes: u64,
    stream: Box<dyn Read + 'a>,
}

impl Read for ArrayBytes<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.stream.read(buffer)
    }
}

/// Opens a data array of a VTK XML file at the beginning of an input. `check` may reject its number of bytes before
/// any data is read.
///
/// # Errors
/// The array's header is missing, invalid, or rejected by `check`. Later errors are reported by the stream.
pub fn array_bytes<'a>(
    input: impl Read + 'a,
    is_raw: bool,
    coding: &Coding,
    check: impl Fn(u64) -> Result<(), String>,
) -> Result<ArrayBytes<'a>, String> {
    let mut text = EncodedText { input, is_raw, decoded: Vec::new() };
    let header = coding.header_bytes;
    text.decode_to(header as u64)?;
    let first = coding.number(&text.decoded, 0);
    if coding.compressed {
        return packed(text, first, coding, check);
    }
    check(first)?;
    // The size field and the data are encoded as one base64 text.
    let begun = text.decoded.split_off(header.min(text.decoded.len()));
    let rest = first.saturating_sub(begun.len() as u64);
    let stream = Cursor::new(begun).chain(text.stream(rest)).take(first);
    Ok(ArrayBytes { bytes: first, stream: Box::new(stream) })
}

/// Encoded data array of a VTK XML file: base64 text or raw bytes.
struct EncodedText<R> {
    input: R,
    is_raw: bool,
    /// Bytes of a VTK data array that are already decoded from base64 or read.
    decoded: Vec<u8>,
}

impl<'a, R: Read + 'a> EncodedText<R> {
    /// Decodes groups of four base64 characters until at least `count` bytes are decoded.
    fn decode_to(&mut self, count: u64) -> Result<(), String> {
        let missing = count.saturating_sub(self.decoded.len() as u64);
        let written = if self.is_raw { missing } else { missing.div_ceil(3).saturating_mul(4) };
        let mut part = Vec::new();
        let got = self.input.by_ref().take(written).read_to_end(&mut part).map_err(|e| e.to_string())?;
        if (got as u64) < written {
            return Err(cut(count));
        }
        match self.is_raw {
            true => self.decoded.append(&mut part),
            false => self.decoded.extend(STANDARD.decode(part).map_err(broken)?),
        }
        match (self.decoded.len() as u64) < count {
            true => Err("it ends within its header".into()),
            false => Ok(()),
        }
    }

    /// Returns a stream of the next `count` bytes of a VTK data array.
    fn stream(self, count: u64) -> Box<dyn Read + 'a> {
        if self.is_raw {
            return Box::new(self.input.take(count));
        }
        let letters = count.div_ceil(3).saturating_mul(4);
        Box::new(DecoderReader::new(self.input.take(letters), &STANDARD).take(count))
    }
}

fn broken(e: impl std::fmt::Display) -> String {
    format!("its base64 is broken: {e}")
}

fn cut(bytes: u64) -> String {
    format!("{bytes} bytes are said to follow, but it ends before")
}

fn packed<'a, R: Read + 'a>(
    mut text: EncodedText<R>,
    blocks: u64,
    coding: &Coding,
    check: impl Fn(u64) -> Result<(), String>,
) -> Result<ArrayBytes<'a>, String> {
    if blocks == 0 {
        return Ok(ArrayBytes { bytes: 0, stream: Box::new(io::empty()) });
    }
    let header = coding.header_bytes as u64;
    text.decode_to(3 * header)?;
    let [block_bytes, last_bytes] = [1, 2].map(|place| coding.number(&text.decoded, place));
    // All sizes must be present before memory is allocated for them.
    text.decode_to(blocks.saturating_add(3).saturating_mul(header))?;
    let size = |block: usize| (coding.number(&text.decoded, 3 + block), block_bytes);
    let mut sizes: Vec<(u64, u64)> = (0..blocks as usize).map(size).collect();
    let last = if last_bytes == 0 { block_bytes } else { last_bytes };
    sizes[blocks as usize - 1].1 = last;
    let packed_bytes = sizes.iter().fold(0, |sum: u64, (packed, _)| sum.saturating_add(*packed));
    let bytes = (blocks - 1).saturating_mul(block_bytes).saturating_add(last);
    check(bytes)?;
    if bytes > packed_bytes.saturating_mul(MOST_RATIO) {
        return Err(format!("it says that {packed_bytes} bytes unpack to {bytes}, which they cannot"));
    }
    let (input, block) = (text.stream(packed_bytes), Cursor::default());
    let stream = CompressedBlocks { input, sizes: sizes.into_iter(), block };
    Ok(ArrayBytes { bytes, stream: Box::new(stream) })
}

/// Compressed blocks of a VTK data array, which are decompressed one after another.
struct CompressedBlocks<'a> {
    input: Box<dyn Read + 'a>,
    /// Compressed and uncompressed size of each remaining block of a VTK data array, bytes.
    sizes: std::vec::IntoIter<(u64, u64)>,
    /// Decompressed bytes of the current block of a VTK data array.
    block: Cursor<Vec<u8>>,
}

impl Read for CompressedBlocks<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bad = |why: String| io::Error::new(io::ErrorKind::InvalidData, why);
        loop {
            let got = self.block.read(buffer)?;
            if got > 0 || buffer.is_empty() {
                return Ok(got);
            }
            let Some((size, expected)) = self.sizes.next() else { return Ok(0) };
            let (mut packed, mut bytes) = (Vec::new(), Vec::new());
            let got = self.input.by_ref().take(size).read_to_end(&mut packed).map_err(|e| bad(broken(e)))?;
            if (got as u64) < size {
                return Err(bad(cut(size)));
            }
            let mut decoder = ZlibDecoder::new(&packed[..]).take(expected.saturating_add(1));
            decoder.read_to_end(&mut bytes).map_err(|e| bad(format!("a block is broken: {e}")))?;
            if bytes.len() as u64 != expected {
                let why = format!("a block unpacks to {} bytes or more, not {expected}", bytes.len());
                return Err(bad(why));
            }
            self.block = Cursor::new(bytes);
        }
    }
}
