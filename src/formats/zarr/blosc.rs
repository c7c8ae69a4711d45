//! Decoder of Blosc, the usual compression of Zarr: blocks of shuffled bytes, each compressed separately.
//!
//! All crates for Blosc wrap the C library. This decoder is safe on malformed files and needs memory for one block only.
//! Source: c-blosc 1.21, `README_CHUNK_FORMAT.rst`, `shuffle-generic.h` and `blosclz.c`.

use super::compression::zstd;
use std::io::{self, Read, Seek, SeekFrom};

const HEADER_BYTES: u64 = 16;
/// Largest block. The library chooses at most 8 MiB, and users may choose more.
const MAX_BLOCK_BYTES: usize = 64 << 20;
/// Limits of splitting blocks into one part for each byte of an element: largest number and smallest size of parts.
const MAX_PARTS: usize = 16;
const MIN_PART_BYTES: usize = 128;

/// Flags of the header.
const SHUFFLED: u8 = 1;
const UNCOMPRESSED: u8 = 2;
const BIT_SHUFFLED: u8 = 4;
const UNSPLIT: u8 = 16;

/// Codec of the parts of blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BlockCodec {
    BloscLz,
    Lz4,
    Zlib,
    Zstd,
}

/// Reader that decompresses a Blosc buffer block by block.
pub(super) struct BloscReader<R> {
    input: R,
    start: u64,
    codec: BlockCodec,
    flags: u8,
    element_bytes: usize,
    /// Decompressed size of all blocks, and of each but the last.
    bytes: usize,
    block_bytes: usize,
    /// Index of the next block, content of the current one, and how much of it was read.
    next: usize,
    block: Vec<u8>,
    taken: usize,
}

fn damaged(why: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("its blosc stream is damaged: {why}"))
}

fn word(bytes: &[u8], at: usize) -> usize {
    bytes.get(at..at + 4).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize)
}

impl<R: Read + Seek> BloscReader<R> {
    /// Decodes the buffer at the position of `input` to `wanted` bytes.
    ///
    /// # Errors
    /// The buffer has another size, or its codec is not supported.
    pub(super) fn new(mut input: R, wanted: u64) -> io::Result<Self> {
        let start = input.stream_position()?;
        let mut header = [0; HEADER_BYTES as usize];
        input.read_exact(&mut header).map_err(|_| damaged("it ends within its header"))?;
        let [version, _, flags, element_bytes, ..] = header;
        let (bytes, block_bytes) = (word(&header, 4), word(&header, 8));
        if version > 2 {
            return Err(damaged("its version is not known"));
        }
        if bytes as u64 != wanted {
            return Err(damaged(&format!("it holds {bytes} bytes, and {wanted} are wanted")));
        }
        let codec = match flags >> 5 {
            0 => BlockCodec::BloscLz,
            1 => BlockCodec::Lz4,
            2 if flags & UNCOMPRESSED == 0 => {
                return Err(damaged("its blocks are compressed by snappy, which is not supported"));
            }
            3 => BlockCodec::Zlib,
            4 => BlockCodec::Zstd,
            _ if flags & UNCOMPRESSED != 0 => BlockCodec::BloscLz,
            _ => return Err(damaged("its codec is not known")),
        };
        let is_uncompressed = flags & UNCOMPRESSED != 0;
        if bytes > 0 && !is_uncompressed && !(1..=MAX_BLOCK_BYTES).contains(&block_bytes) {
            return Err(damaged(&format!("its blocks have {block_bytes} bytes")));
        }
        let block_bytes = if is_uncompressed { 1 << 16 } else { block_bytes.min(bytes) };
        let element_bytes = usize::from(element_bytes).max(1);
        let (next, block, taken) = (0, Vec::new(), 0);
        Ok(Self { input, start, codec, flags, element_bytes, bytes, block_bytes, next, block, taken })
    }

    /// Decompresses the next block; returns whether there was one.
    fn advance(&mut self) -> io::Result<bool> {
        let from = self.next.saturating_mul(self.block_bytes);
        if from >= self.bytes {
            return Ok(false);
        }
        let length = self.block_bytes.min(self.bytes - from);
        self.taken = 0;
        if self.flags & UNCOMPRESSED != 0 {
            self.block.resize(length, 0);
            self.input.read_exact(&mut self.block).map_err(|_| damaged("it ends early"))?;
        } else {
            let index = self.start + HEADER_BYTES + 4 * self.next as u64;
            self.input.seek(SeekFrom::Start(index))?;
            let mut at = [0; 4];
            self.input.read_exact(&mut at).map_err(|_| damaged("it ends early"))?;
            self.input.seek(SeekFrom::Start(self.start + u64::from(u32::from_le_bytes(at))))?;
            let shuffled = self.decompress(length)?;
            self.block = match (self.flags & SHUFFLED != 0, self.flags & BIT_SHUFFLED != 0) {
                (true, _) if self.element_bytes > 1 => unshuffled(&shuffled, self.element_bytes),
                (false, true) => bits_unshuffled(&shuffled, self.element_bytes),
                _ => shuffled,
            };
        }
        self.next += 1;
        Ok(true)
    }

    /// Decompresses the block at the position of the input, still shuffled.
    fn decompress(&mut self, length: usize) -> io::Result<Vec<u8>> {
        let splits = self.flags & UNSPLIT == 0
            && self.element_bytes <= MAX_PARTS
            && length / self.element_bytes >= MIN_PART_BYTES
            && length == self.block_bytes;
        let parts = if splits { self.element_bytes } else { 1 };
        let part_bytes = length / parts;
        if part_bytes * parts != length {
            return Err(damaged("its blocks cannot be split into bytes of elements"));
        }
        let mut block = Vec::new();
        let mut packed = Vec::new();
        for _ in 0..parts {
            let mut count = [0; 4];
            self.input.read_exact(&mut count).map_err(|_| damaged("it ends early"))?;
            let count = u64::from(u32::from_le_bytes(count));
            if count > part_bytes as u64 {
                return Err(damaged("a compressed block is larger than its content"));
            }
            packed.clear();
            self.input.by_ref().take(count).read_to_end(&mut packed)?;
            if packed.len() as u64 != count {
                return Err(damaged("a block ends beyond the file"));
            }
            let before = block.len();
            if packed.len() == part_bytes {
                block.extend_from_slice(&packed);
            } else {
                decompress_part(self.codec, &packed, part_bytes, &mut block)?;
            }
            if block.len() - before != part_bytes {
                return Err(damaged("a block decompresses to another number of bytes"));
            }
        }
        Ok(block)
    }
}

impl<R: Read + Seek> Read for BloscReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.block.len() && !self.advance()? {
            return Ok(0);
        }
        let rest = &self.block[self.taken..];
        let count = rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        self.taken += count;
        Ok(count)
    }
}

/// Appends the decompressed part of a block, at most one byte more than `wanted`.
fn decompress_part(codec: BlockCodec, packed: &[u8], wanted: usize, out: &mut Vec<u8>) -> io::Result<()> {
    let most = wanted as u64 + 1;
    match codec {
        BlockCodec::Zlib => flate2::read::ZlibDecoder::new(packed).take(most).read_to_end(out).map(|_| ()),
        BlockCodec::Zstd => zstd(packed)?.take(most).read_to_end(out).map(|_| ()),
        BlockCodec::Lz4 | BlockCodec::BloscLz => {
            let from = out.len();
            out.resize(from + wanted, 0);
            let made = match codec {
                BlockCodec::Lz4 => lz4_flex::block::decompress_into(packed, &mut out[from..]).ok(),
                _ => blosclz(packed, &mut out[from..]),
            };
            out.truncate(from + made.ok_or_else(|| damaged("a block cannot be decompressed"))?);
            Ok(())
        }
    }
}

/// Decompresses BloscLZ; returns the number of bytes, or `None` if the data are damaged or more than `out` holds.
///
/// A control byte `c` below 32 precedes `c + 1` literal bytes; others encode the length and distance of a match.
fn blosclz(packed: &[u8], out: &mut [u8]) -> Option<usize> {
    const FAR: usize = 8191;
    let mut input = packed.iter().copied();
    let mut at = 0;
    // The high bits of the first control byte are a marker.
    let mut control = usize::from(input.next()? & 31);
    loop {
        if control < 32 {
            let (from, count) = (packed.len() - input.len(), control + 1);
            out.get_mut(at..at + count)?.copy_from_slice(packed.get(from..from + count)?);
            input = packed[from + count..].iter().copied();
            at += count;
        } else {
            let mut length = (control >> 5) - 1;
            let high = control & 31;
            if length == 6 {
                loop {
                    let more = usize::from(input.next()?);
                    length += more;
                    if more != 255 {
                        break;
                    }
                }
            }
            let low = usize::from(input.next()?);
            let distance = match (high, low) {
                (31, 255) => (usize::from(input.next()?) << 8) + usize::from(input.next()?) + FAR,
                _ => (high << 8) + low,
            };
            let from = at.checked_sub(distance + 1)?;
            let end = at.checked_add(length + 3).filter(|end| *end <= out.len())?;
            // A match may overlap its output.
            for offset in 0..end - at {
                out[at + offset] = out[from + offset];
            }
            at = end;
        }
        match input.next() {
            Some(next) => control = next.into(),
            None => return Some(at),
        }
    }
}

/// Reverses the byte shuffle, which stores the first bytes of all elements, then the second ones, and so on.
fn unshuffled(bytes: &[u8], element_bytes: usize) -> Vec<u8> {
    let count = bytes.len() / element_bytes;
    let mut out = bytes.to_vec();
    for (place, lane) in bytes.chunks_exact(count.max(1)).take(element_bytes).enumerate() {
        for (to, byte) in out[..count * element_bytes].iter_mut().skip(place).step_by(element_bytes).zip(lane)
        {
            *to = *byte;
        }
    }
    out
}

/// Reverses the bit shuffle, which applies to multiples of eight elements.
fn bits_unshuffled(bytes: &[u8], element_bytes: usize) -> Vec<u8> {
    let count = bytes.len() / element_bytes;
    if count == 0 || !count.is_multiple_of(8) {
        return bytes.to_vec();
    }
    let mut out = bytes.to_vec();
    out[..count * element_bytes].fill(0);
    for (lane, bits) in bytes.chunks_exact(count / 8).take(8 * element_bytes).enumerate() {
        let (byte, bit) = (lane / 8, lane % 8);
        for element in 0..count {
            out[element * element_bytes + byte] |= (bits[element / 8] >> (element % 8) & 1) << bit;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blosclz_matches_may_overlap_their_output() {
        // One letter, nine copies of it, two more letters, and three from distance six.
        let packed = [0, b'a', 7 << 5, 0, 0, 1, b'b', b'c', 1 << 5, 5];
        let mut out = [0; 32];
        let made = blosclz(&packed, &mut out).unwrap();
        assert_eq!(&out[..made], b"aaaaaaaaaabcaaa");
        // Output too small, match before the start, truncated literal.
        assert_eq!(blosclz(&packed, &mut out[..8]), None);
        assert_eq!(blosclz(&[0, b'a', 1 << 5, 9], &mut out), None);
        assert_eq!(blosclz(&[5, b'a'], &mut out), None);
    }

    #[test]
    fn shuffles_are_reversed() {
        assert_eq!(unshuffled(&[1, 2, 3, 11, 12, 13, 99], 2), [1, 11, 2, 12, 3, 13, 99]);
        // Eight elements of one byte: byte `b` holds bit `b` of all of them.
        let elements = [1u8, 2, 4, 8, 16, 32, 64, 255];
        let lanes: Vec<u8> = (0..8).map(|b| (0..8).map(|e| (elements[e] >> b & 1) << e).sum()).collect();
        assert_eq!(bits_unshuffled(&lanes, 1), elements);
        assert_eq!(bits_unshuffled(&[1, 2, 3], 1), [1, 2, 3]);
    }
}
