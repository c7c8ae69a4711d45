//! Blosc, the packing that most writers of Zarr choose: blocks of bytes that were shuffled, each packed by itself.
//!
//! Read here and not by the C library, which the crates wrap: no foreign code sees what a stranger's file holds, and a block is
//! all that memory is taken for. Source: c-blosc 1.21, `README_CHUNK_FORMAT.rst`, `shuffle-generic.h` and `blosclz.c`.

use super::zstd::zstd;
use std::io::{self, Read, Seek, SeekFrom};

const HEADER_BYTES: u64 = 16;
/// The library's own blocks are at most 8 MiB, those that a user asks for may be larger.
const BLOCK_MOST_BYTES: usize = 64 << 20;
/// Blocks are cut into one part for each byte of an element, where those are not more and the parts not smaller than this.
const PARTS_MOST: usize = 16;
const PART_LEAST_BYTES: usize = 128;

const SHUFFLED: u8 = 1;
const PLAIN: u8 = 2;
const BITS_SHUFFLED: u8 = 4;
const WHOLE_BLOCKS: u8 = 16;

/// What packs a part of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Packer {
    BloscLz,
    Lz4,
    Zlib,
    Zstd,
}

/// A stream of blosc that is unpacked block by block, from one place of a file on.
pub(super) struct BloscReader<R> {
    input: R,
    start: u64,
    packer: Packer,
    flags: u8,
    element_bytes: usize,
    /// What all blocks unpack to, and one that is not the last.
    bytes: usize,
    block_bytes: usize,
    /// The block that is next, what the present one unpacked to, and how much of that was taken.
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
    /// From where `input` stands; `wanted` bytes are to come out.
    ///
    /// # Errors
    /// Another number of bytes would, or it is packed in a way that is not read.
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
        let packer = match flags >> 5 {
            0 => Packer::BloscLz,
            1 => Packer::Lz4,
            2 if flags & PLAIN == 0 => {
                return Err(damaged("its blocks are packed by snappy, which is not read"));
            }
            3 => Packer::Zlib,
            4 => Packer::Zstd,
            _ if flags & PLAIN != 0 => Packer::BloscLz,
            _ => return Err(damaged("its packer is not known")),
        };
        let is_plain = flags & PLAIN != 0;
        if bytes > 0 && !is_plain && !(1..=BLOCK_MOST_BYTES).contains(&block_bytes) {
            return Err(damaged(&format!("its blocks have {block_bytes} bytes")));
        }
        // Plain bytes have no blocks of their own.
        let block_bytes = if is_plain { 1 << 16 } else { block_bytes.min(bytes) };
        let element_bytes = usize::from(element_bytes).max(1);
        let (next, block, taken) = (0, Vec::new(), 0);
        Ok(Self { input, start, packer, flags, element_bytes, bytes, block_bytes, next, block, taken })
    }

    /// Unpacks the next block; whether there was one.
    fn advance(&mut self) -> io::Result<bool> {
        let from = self.next.saturating_mul(self.block_bytes);
        if from >= self.bytes {
            return Ok(false);
        }
        let length = self.block_bytes.min(self.bytes - from);
        self.taken = 0;
        if self.flags & PLAIN != 0 {
            self.block.resize(length, 0);
            self.input.read_exact(&mut self.block).map_err(|_| damaged("it ends early"))?;
        } else {
            let place = self.start + HEADER_BYTES + 4 * self.next as u64;
            self.input.seek(SeekFrom::Start(place))?;
            let mut at = [0; 4];
            self.input.read_exact(&mut at).map_err(|_| damaged("it ends early"))?;
            self.input.seek(SeekFrom::Start(self.start + u64::from(u32::from_le_bytes(at))))?;
            let packed_block = self.unpack(length)?;
            self.block = match (self.flags & SHUFFLED != 0, self.flags & BITS_SHUFFLED != 0) {
                (true, _) if self.element_bytes > 1 => unshuffled(&packed_block, self.element_bytes),
                (false, true) => bits_unshuffled(&packed_block, self.element_bytes),
                _ => packed_block,
            };
        }
        self.next += 1;
        Ok(true)
    }

    /// The block at which the input stands, as it was before it was packed.
    fn unpack(&mut self, length: usize) -> io::Result<Vec<u8>> {
        let splits = self.flags & WHOLE_BLOCKS == 0
            && self.element_bytes <= PARTS_MOST
            && length / self.element_bytes >= PART_LEAST_BYTES
            && length == self.block_bytes;
        let parts = if splits { self.element_bytes } else { 1 };
        let part_bytes = length / parts;
        if part_bytes * parts != length {
            return Err(damaged("its blocks cannot be cut into bytes of elements"));
        }
        let mut block = Vec::new();
        let mut packed = Vec::new();
        for _ in 0..parts {
            let mut count = [0; 4];
            self.input.read_exact(&mut count).map_err(|_| damaged("it ends early"))?;
            let count = u64::from(u32::from_le_bytes(count));
            if count > part_bytes as u64 {
                return Err(damaged("a block is larger packed than not"));
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
                unpack_part(self.packer, &packed, part_bytes, &mut block)?;
            }
            if block.len() - before != part_bytes {
                return Err(damaged("a block unpacks to another number of bytes"));
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

/// Appends what a part of a block unpacks to, a byte more than `wanted` at the most.
fn unpack_part(packer: Packer, packed: &[u8], wanted: usize, out: &mut Vec<u8>) -> io::Result<()> {
    let most = wanted as u64 + 1;
    match packer {
        Packer::Zlib => flate2::read::ZlibDecoder::new(packed).take(most).read_to_end(out).map(|_| ()),
        Packer::Zstd => zstd(packed)?.take(most).read_to_end(out).map(|_| ()),
        Packer::Lz4 | Packer::BloscLz => {
            let from = out.len();
            out.resize(from + wanted, 0);
            let made = match packer {
                Packer::Lz4 => lz4_flex::block::decompress_into(packed, &mut out[from..]).ok(),
                _ => blosclz(packed, &mut out[from..]),
            };
            out.truncate(from + made.ok_or_else(|| damaged("a block cannot be unpacked"))?);
            Ok(())
        }
    }
}

/// Unpacks what `blosclz` packed; how many bytes came out, or `None` where that is more than `out` holds or it goes wrong.
///
/// A control byte below 32 is followed by that many bytes and one more; others say how long a match is and how far behind.
fn blosclz(packed: &[u8], out: &mut [u8]) -> Option<usize> {
    const FAR: usize = 8191;
    let mut input = packed.iter().copied();
    let mut at = 0;
    // The first control byte has a mark in its high bits.
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
            let behind = match (high, low) {
                (31, 255) => (usize::from(input.next()?) << 8) + usize::from(input.next()?) + FAR,
                _ => (high << 8) + low,
            };
            let from = at.checked_sub(behind + 1)?;
            let end = at.checked_add(length + 3).filter(|end| *end <= out.len())?;
            // A match may run into what it makes.
            for place in 0..end - at {
                out[at + place] = out[from + place];
            }
            at = end;
        }
        match input.next() {
            Some(next) => control = next.into(),
            None => return Some(at),
        }
    }
}

/// Elements of bytes that lie apart, all first ones first.
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

/// Elements of bits that lie apart; only whole eights of elements are shuffled.
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
    fn matches_of_blosclz_may_run_into_themselves() {
        // One letter, then nine of it, then two more letters and three from six behind.
        let packed = [0, b'a', 7 << 5, 0, 0, 1, b'b', b'c', 1 << 5, 5];
        let mut out = [0; 32];
        let made = blosclz(&packed, &mut out).unwrap();
        assert_eq!(&out[..made], b"aaaaaaaaaabcaaa");
        // Too little room, a match before the beginning, a literal that ends early.
        assert_eq!(blosclz(&packed, &mut out[..8]), None);
        assert_eq!(blosclz(&[0, b'a', 1 << 5, 9], &mut out), None);
        assert_eq!(blosclz(&[5, b'a'], &mut out), None);
    }

    #[test]
    fn shuffles_come_back() {
        assert_eq!(unshuffled(&[1, 2, 3, 11, 12, 13, 99], 2), [1, 11, 2, 12, 3, 13, 99]);
        // Eight elements of one byte: bit `b` of all of them in byte `b`.
        let elements = [1u8, 2, 4, 8, 16, 32, 64, 255];
        let lanes: Vec<u8> = (0..8).map(|b| (0..8).map(|e| (elements[e] >> b & 1) << e).sum()).collect();
        assert_eq!(bits_unshuffled(&lanes, 1), elements);
        assert_eq!(bits_unshuffled(&[1, 2, 3], 1), [1, 2, 3]);
    }
}
