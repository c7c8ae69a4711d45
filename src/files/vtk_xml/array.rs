//! The bytes of an array of a VTK XML file, as a stream: no more memory is taken than one packed block has bytes.
//!
//! Plain ones have their number of bytes before them. Compressed ones are blocks: their number, the bytes of a whole block and
//! of the last one where that is not whole, and the compressed bytes of each. In base64 those numbers are a text of their own.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use base64::read::DecoderReader;
use flate2::read::ZlibDecoder;
use roxmltree::Node;
use std::io::{self, Cursor, Read};

/// No compressor of zlib makes so many bytes of one.
const MOST_RATIO: u64 = 1100;

/// How arrays are written.
#[derive(Debug, Clone, Copy)]
pub struct Coding {
    /// The first byte of a number is its highest.
    pub big_endian: bool,
    /// Bytes of the numbers before data.
    header_bytes: usize,
    compressed: bool,
}

impl Coding {
    /// As the file's tag says it.
    ///
    /// # Errors
    /// A compressor, or numbers before data, that are not read.
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

    /// A number before data.
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

/// The bytes of an array.
pub struct ArrayBytes<'a> {
    /// How many it claims.
    pub bytes: u64,
    stream: Box<dyn Read + 'a>,
}

impl Read for ArrayBytes<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.stream.read(buffer)
    }
}

/// The bytes of the array that an input begins with; `check` is asked about their number before any of them is taken.
///
/// # Errors
/// They are not there, broken, or refused by `check`; what is wrong with those that follow the stream says.
pub fn array_bytes<'a>(
    input: impl Read + 'a,
    is_raw: bool,
    coding: &Coding,
    check: impl Fn(u64) -> Result<(), String>,
) -> Result<ArrayBytes<'a>, String> {
    let mut text = Text { input, is_raw, decoded: Vec::new() };
    if coding.compressed {
        packed(text, coding, check)
    } else {
        let header = coding.header_bytes;
        text.decode_to(header as u64)?;
        let bytes = coding.number(&text.decoded, 0);
        check(bytes)?;
        let all = (header as u64).saturating_add(bytes);
        // They are of one text with the number before them.
        let begun = text.decoded.split_off(header.min(text.decoded.len()));
        let rest = all.saturating_sub((header + begun.len()) as u64);
        let stream = Cursor::new(begun).chain(text.stream(rest)).take(bytes);
        Ok(ArrayBytes { bytes, stream: Box::new(stream) })
    }
}

/// A text in base64, or bytes as they are.
struct Text<R> {
    input: R,
    is_raw: bool,
    /// What has been decoded of it.
    decoded: Vec<u8>,
}

impl<'a, R: Read + 'a> Text<R> {
    /// Decodes on until there are so many bytes of it, or somewhat more: whole groups of four letters, up to its padding.
    fn decode_to(&mut self, count: u64) -> Result<(), String> {
        let missing = count.saturating_sub(self.decoded.len() as u64);
        let written = if self.is_raw { missing } else { missing.div_ceil(3).saturating_mul(4) };
        let mut part = Vec::new();
        let got = self.input.by_ref().take(written).read_to_end(&mut part).map_err(|e| e.to_string())?;
        if (got as u64) < written {
            return Err(format!("{count} bytes are said to follow, but it ends before"));
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

    /// The next so many bytes of it.
    fn stream(self, count: u64) -> Box<dyn Read + 'a> {
        match self.is_raw {
            true => Box::new(self.input.take(count)),
            false => {
                let letters = count.div_ceil(3).saturating_mul(4);
                Box::new(DecoderReader::new(self.input.take(letters), &STANDARD).take(count))
            }
        }
    }
}

fn broken(e: impl std::fmt::Display) -> String {
    format!("its base64 is broken: {e}")
}

fn packed<'a, R: Read + 'a>(
    mut text: Text<R>,
    coding: &Coding,
    check: impl Fn(u64) -> Result<(), String>,
) -> Result<ArrayBytes<'a>, String> {
    let header = coding.header_bytes as u64;
    text.decode_to(header)?;
    let blocks = coding.number(&text.decoded, 0);
    if blocks == 0 {
        return Ok(ArrayBytes { bytes: 0, stream: Box::new(io::empty()) });
    }
    text.decode_to(3 * header)?;
    let [block_bytes, last_bytes] = [1, 2].map(|place| coding.number(&text.decoded, place));
    // Sizes of all blocks are there before any of them is believed.
    text.decode_to(blocks.saturating_add(3).saturating_mul(header))?;
    let sizes: Vec<u64> = (0..blocks as usize).map(|block| coding.number(&text.decoded, 3 + block)).collect();
    let packed_bytes = sizes.iter().fold(0, |sum: u64, size| sum.saturating_add(*size));
    let last = if last_bytes == 0 { block_bytes } else { last_bytes };
    let bytes = (blocks - 1).saturating_mul(block_bytes).saturating_add(last);
    check(bytes)?;
    if bytes > packed_bytes.saturating_mul(MOST_RATIO) {
        return Err(format!("it says that {packed_bytes} bytes unpack to {bytes}, which they cannot"));
    }
    let stream =
        Blocks { input: text.stream(packed_bytes), sizes, next: 0, block_bytes, last, block: None, found: 0 };
    Ok(ArrayBytes { bytes, stream: Box::new(stream) })
}

/// Blocks that are unpacked one after the other.
struct Blocks<'a> {
    input: Box<dyn Read + 'a>,
    /// Packed bytes of each.
    sizes: Vec<u64>,
    next: usize,
    /// What each unpacks to, and the last one.
    block_bytes: u64,
    last: u64,
    /// The present one, and how much has come out of it.
    block: Option<ZlibDecoder<Cursor<Vec<u8>>>>,
    found: u64,
}

impl Blocks<'_> {
    /// What the block before `next` unpacks to.
    fn wanted(&self) -> u64 {
        if self.next == self.sizes.len() { self.last } else { self.block_bytes }
    }
}

impl Read for Blocks<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bad = |why: String| io::Error::new(io::ErrorKind::InvalidData, why);
        loop {
            if let Some(block) = &mut self.block {
                let number = self.next - 1;
                let got = block.read(buffer).map_err(|e| bad(format!("block {number} is broken: {e}")))?;
                self.found += got as u64;
                let wanted = self.wanted();
                if self.found > wanted || got == 0 && !buffer.is_empty() && self.found < wanted {
                    let found = self.found.min(wanted.saturating_add(1));
                    return Err(bad(format!(
                        "block {number} unpacks to {found} bytes or more, not {wanted}"
                    )));
                }
                if got > 0 || buffer.is_empty() {
                    return Ok(got);
                }
                self.block = None;
            }
            let Some(&size) = self.sizes.get(self.next) else { return Ok(0) };
            let mut packed = Vec::new();
            let got = self.input.by_ref().take(size).read_to_end(&mut packed).map_err(|e| bad(broken(e)))?;
            if (got as u64) < size {
                return Err(bad(format!("{size} bytes are said to follow, but it ends before")));
            }
            self.next += 1;
            self.found = 0;
            self.block = Some(ZlibDecoder::new(Cursor::new(packed)));
        }
    }
}
