//! The bytes of an array of a VTK XML file: base64 or raw, within the text or appended, plain or compressed.
//!
//! Plain ones have their number of bytes before them. Compressed ones are blocks: their number, the bytes of a whole block and
//! of the last one where that is not whole, and the compressed bytes of each. In base64 those numbers are a text of their own.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;
use roxmltree::Node;
use std::io::Read;

/// All arrays of a file together have no more numbers than this, which take 1 GiB.
pub(super) const MOST_NUMBERS: u64 = 1 << 27;

/// No compressor of zlib makes so many bytes of one.
const MOST_RATIO: u64 = 1100;

/// Data behind the mark of `AppendedData`.
#[derive(Clone, Copy)]
pub(super) struct Appended<'a> {
    /// Up to the end of the file.
    pub bytes: &'a [u8],
    /// In base64 otherwise.
    pub raw: bool,
}

/// How arrays are written.
#[derive(Clone, Copy)]
pub(super) struct Coding {
    /// The first byte of a number is its highest.
    pub big_endian: bool,
    /// Bytes of the numbers before data.
    header_bytes: usize,
    compressed: bool,
}

impl Coding {
    /// As the file's tag says it.
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
}

/// What is left of the data that an array begins.
struct Left<'a> {
    bytes: &'a [u8],
    raw: bool,
}

impl Left<'_> {
    /// So many bytes; in base64 they are a text of their own, up to its padding.
    fn take(&mut self, count: u64) -> Result<Vec<u8>, String> {
        let written = if self.raw { count } else { count.div_ceil(3).saturating_mul(4) };
        let part = usize::try_from(written).ok().and_then(|n| self.bytes.get(..n));
        let part = part.ok_or_else(|| format!("{count} bytes are said to follow, but it ends before"))?;
        self.bytes = &self.bytes[part.len()..];
        if self.raw {
            return Ok(part.to_vec());
        }
        let mut bytes = STANDARD.decode(part).map_err(|e| format!("its base64 is broken: {e}"))?;
        bytes.truncate(count as usize);
        Ok(bytes)
    }

    /// The same without going on, at the beginning.
    fn peek(&self, count: u64) -> Result<Vec<u8>, String> {
        Left { bytes: self.bytes, raw: self.raw }.take_some(count)
    }

    /// At least so many bytes of a text that goes on.
    fn take_some(&mut self, count: u64) -> Result<Vec<u8>, String> {
        // Whole groups of four letters.
        let mut bytes = self.take(if self.raw { count } else { count.div_ceil(3) * 3 })?;
        if (bytes.len() as u64) < count {
            return Err("it ends within its header".into());
        }
        bytes.truncate(count as usize);
        Ok(bytes)
    }
}

/// The bytes of an array, at most so many.
///
/// # Errors
/// They are not there, broken, or more than that.
pub(super) fn bytes_of(
    array: Node,
    coding: &Coding,
    appended: Option<Appended>,
    most: u64,
) -> Result<Vec<u8>, String> {
    let left = match array.attribute("format") {
        Some("binary") => Left { bytes: array.text().unwrap_or_default().trim().as_bytes(), raw: false },
        Some("appended") => {
            let text = array.attribute("offset").unwrap_or_default();
            let Appended { bytes, raw } = appended.ok_or("the file has no appended data")?;
            let offset = text.trim().parse::<usize>().map_err(|_| format!("its offset is `{text}`"))?;
            let bytes =
                bytes.get(offset..).ok_or_else(|| format!("its offset {offset} is beyond the file"))?;
            Left { bytes, raw }
        }
        other => return Err(format!("its format is {}", other.unwrap_or("not said"))),
    };
    if coding.compressed { unpacked(left, coding, most) } else { plain(left, coding, most) }
}

/// A number before data.
fn header_number(bytes: &[u8], place: usize, coding: &Coding) -> u64 {
    let mut word = [0; 8];
    let n = coding.header_bytes;
    word[..n].copy_from_slice(&bytes[place * n..(place + 1) * n]);
    if coding.big_endian {
        word[..n].reverse();
    }
    u64::from_le_bytes(word)
}

fn refuse_above(bytes: u64, most: u64) -> Result<(), String> {
    match bytes > most {
        true => {
            let limit = format!(
                "arrays of {MOST_NUMBERS} numbers in all are read, and {most} bytes are left of that"
            );
            Err(format!("it is of {bytes} bytes; {limit}"))
        }
        false => Ok(()),
    }
}

fn plain(mut left: Left, coding: &Coding, most: u64) -> Result<Vec<u8>, String> {
    let header = coding.header_bytes as u64;
    let bytes = header_number(&left.peek(header)?, 0, coding);
    refuse_above(bytes, most)?;
    let mut all = left.take(header + bytes)?;
    if all.len() as u64 != header + bytes {
        return Err(format!("{bytes} bytes are said to follow, but it ends before"));
    }
    all.drain(..coding.header_bytes);
    Ok(all)
}

fn unpacked(mut left: Left, coding: &Coding, most: u64) -> Result<Vec<u8>, String> {
    let header = coding.header_bytes as u64;
    if header_number(&left.peek(header)?, 0, coding) == 0 {
        return Ok(Vec::new());
    }
    let first = left.peek(3 * header)?;
    let [blocks, block_bytes, last_bytes] = [0, 1, 2].map(|place| header_number(&first, place, coding));
    // Sizes of all blocks are there before any of them is believed.
    let sizes = left.take(blocks.saturating_add(3).saturating_mul(header))?;
    if sizes.len() as u64 != (blocks + 3) * header {
        return Err("it ends within the sizes of its blocks".into());
    }
    let size = |block: u64| header_number(&sizes, 3 + block as usize, coding);
    let packed_bytes = (0..blocks).fold(0, |sum: u64, block| sum.saturating_add(size(block)));
    let last = if last_bytes == 0 { block_bytes } else { last_bytes };
    let bytes = (blocks - 1).saturating_mul(block_bytes).saturating_add(last);
    refuse_above(bytes, most)?;
    if bytes > packed_bytes.saturating_mul(MOST_RATIO) {
        return Err(format!("it says that {packed_bytes} bytes unpack to {bytes}, which they cannot"));
    }
    let packed = left.take(packed_bytes)?;
    let (mut all, mut at) = (Vec::new(), 0);
    for block in 0..blocks {
        let wanted = if block + 1 == blocks { last } else { block_bytes };
        let end = at + size(block) as usize;
        let part = packed.get(at..end).ok_or("it ends within its blocks")?;
        let before = all.len() as u64;
        let read = ZlibDecoder::new(part).take(wanted + 1).read_to_end(&mut all);
        read.map_err(|e| format!("block {block} is broken: {e}"))?;
        let found = all.len() as u64 - before;
        if found != wanted {
            return Err(format!("block {block} unpacks to {found} bytes or more, not {wanted}"));
        }
        at = end;
    }
    Ok(all)
}
