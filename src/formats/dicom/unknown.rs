//! Sequences whose type a writer did not know: `UN` of undefined length in an explicit syntax, whose items are in the implicit
//! one (PS3.5, 6.2.2, once CP-246). The crate's reader takes their items for explicit ones.
//!
//! What such a sequence holds is nothing that a volume needs. A reader that goes through [`Unknown`] sees in its place a
//! sequence of one item with one element, of as many bytes: all places in the file stay what they are.

use std::io::{self, BufReader, Read, Seek, SeekFrom};

/// The end of an element's tag on, up to the value: `UN`, two bytes that are 0, the length that says none.
const UNKNOWN: [u8; 8] = [b'U', b'N', 0, 0, 0xff, 0xff, 0xff, 0xff];
/// Tags of an item, of the end of one, and of the end of a sequence.
const ITEM: [u8; 4] = [0xfe, 0xff, 0x00, 0xe0];
const ITEM_END: [u8; 4] = [0xfe, 0xff, 0x0d, 0xe0];
const SEQUENCE_END: [u8; 4] = [0xfe, 0xff, 0xdd, 0xe0];
const UNDEFINED: u32 = u32::MAX;
/// Bytes of a tag and a length, of an element's whole header, and of both.
const SHORT_BYTES: usize = 8;
const LONG_BYTES: usize = 12;
const INSTEAD_BYTES: usize = SHORT_BYTES + LONG_BYTES;
/// Sequences within each other.
const DEPTH_MOST: usize = 64;
/// Elements that are gone through in all: a hostile file must not have its end looked for again and again.
const ELEMENTS_MOST: usize = 1_000_000;

/// A file in which such sequences are covered.
pub(super) struct Unknown<R> {
    input: R,
    at: u64,
    /// The bytes that were read last.
    last: [u8; UNKNOWN.len()],
    /// What stands from a place on instead of what does.
    cover: Option<(u64, [u8; INSTEAD_BYTES])>,
    /// Elements that may still be gone through; none where the syntax has no such sequences.
    left: usize,
}

impl<R: Read + Seek> Unknown<R> {
    /// From where an input stands; `is_explicit` says whether types stand in it at all.
    pub(super) fn new(mut input: R, is_explicit: bool) -> io::Result<Self> {
        let at = input.stream_position()?;
        let left = if is_explicit { ELEMENTS_MOST } else { 0 };
        Ok(Self { input, at, last: [0; UNKNOWN.len()], cover: None, left })
    }

    /// Covers the sequence that begins here, where its items are as they should be.
    fn cover(&mut self) -> io::Result<()> {
        let from = self.at;
        let input = BufReader::with_capacity(1 << 12, &mut self.input);
        let end = Implicit { input, at: from, left: &mut self.left }.sequence();
        self.input.seek(SeekFrom::Start(from))?;
        // The end of the sequence stays; without room for an element there is none to be misread.
        let held = end?.map_or(0, |end| end - from - SHORT_BYTES as u64);
        let Some(value) = held.checked_sub(INSTEAD_BYTES as u64).and_then(|n| u32::try_from(n).ok()) else {
            return Ok(());
        };
        let mut instead = [0; INSTEAD_BYTES];
        instead[..4].copy_from_slice(&ITEM);
        instead[4..8].copy_from_slice(&(value + LONG_BYTES as u32).to_le_bytes());
        // A private element, which nobody wants.
        instead[8..16].copy_from_slice(&[0x09, 0, 0x01, 0x10, b'O', b'B', 0, 0]);
        instead[16..].copy_from_slice(&value.to_le_bytes());
        self.cover = Some((from, instead));
        Ok(())
    }
}

impl<R: Read + Seek> Read for Unknown<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let got = self.input.read(buffer)?;
        if let Some((from, instead)) = self.cover {
            for (byte, place) in buffer[..got].iter_mut().zip(self.at..) {
                let covered = place.checked_sub(from).and_then(|n| instead.get(n as usize));
                *byte = covered.copied().unwrap_or(*byte);
            }
        }
        self.at += got as u64;
        for byte in &buffer[got.saturating_sub(UNKNOWN.len())..got] {
            self.last.rotate_left(1);
            self.last[UNKNOWN.len() - 1] = *byte;
        }
        // Headers are read field by field: their end is the end of a reading.
        if self.last == UNKNOWN && self.left > 0 {
            self.cover()?;
        }
        Ok(got)
    }
}

impl<R: Seek> Seek for Unknown<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.input.seek(to)?;
        self.last = [0; UNKNOWN.len()];
        Ok(self.at)
    }
}

/// Elements in the implicit syntax, gone through without a look at what they hold.
struct Implicit<'a, R> {
    input: R,
    at: u64,
    left: &'a mut usize,
}

impl<R: Read + Seek> Implicit<'_, R> {
    /// The next tag and length.
    fn header(&mut self) -> io::Result<([u8; 4], u32)> {
        *self.left = self.left.checked_sub(1).ok_or(io::ErrorKind::UnexpectedEof)?;
        let mut header = [0; SHORT_BYTES];
        self.input.read_exact(&mut header)?;
        self.at += SHORT_BYTES as u64;
        let [a, b, c, d, e, f, g, h] = header;
        Ok(([a, b, c, d], u32::from_le_bytes([e, f, g, h])))
    }

    fn skip(&mut self, bytes: u32) -> io::Result<()> {
        self.input.seek(SeekFrom::Current(bytes.into()))?;
        self.at += u64::from(bytes);
        Ok(())
    }

    /// Goes to the end of a sequence that ends by its mark; `None` where it is none.
    fn sequence(&mut self) -> io::Result<Option<u64>> {
        match self.items(0) {
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(None),
            other => other,
        }
    }

    fn items(&mut self, depth: usize) -> io::Result<Option<u64>> {
        if depth > DEPTH_MOST {
            return Ok(None);
        }
        loop {
            match self.header()? {
                (SEQUENCE_END, 0) => return Ok(Some(self.at)),
                (ITEM, UNDEFINED) => loop {
                    match self.header()? {
                        (ITEM_END, 0) => break,
                        (_, UNDEFINED) => {
                            if self.items(depth + 1)?.is_none() {
                                return Ok(None);
                            }
                        }
                        (_, bytes) => self.skip(bytes)?,
                    }
                },
                (ITEM, bytes) => self.skip(bytes)?,
                _ => return Ok(None),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// A sequence of one item of undefined length with one element of `value`.
    fn sequence(value: &[u8]) -> Vec<u8> {
        let mut bytes = UNKNOWN.to_vec();
        bytes.extend(
            [&ITEM[..], &UNDEFINED.to_le_bytes(), &[8, 0, 0x50, 0x11], &(value.len() as u32).to_le_bytes()]
                .concat(),
        );
        bytes.extend([value, &ITEM_END, &[0; 4], &SEQUENCE_END, &[0; 4]].concat());
        bytes
    }

    fn through(bytes: &[u8], step: usize) -> Vec<u8> {
        let mut input = Unknown::new(Cursor::new(bytes), true).unwrap();
        let mut all = Vec::new();
        loop {
            let mut piece = vec![0; step];
            let got = input.read(&mut piece).unwrap();
            if got == 0 {
                return all;
            }
            all.extend_from_slice(&piece[..got]);
        }
    }

    #[test]
    fn an_item_of_one_element_stands_for_what_is_there() {
        let bytes = sequence(b"1.2.840.1234");
        let seen = through(&bytes, 4);
        assert_eq!(seen.len(), bytes.len());
        let inside = bytes.len() - 8 - 8;
        assert_eq!(seen[8..12], ITEM);
        assert_eq!(seen[12..16], (inside as u32 - 8).to_le_bytes());
        assert_eq!((&seen[20..22], &seen[24..28]), (&b"OB"[..], &(inside as u32 - 20).to_le_bytes()[..]));
        assert_eq!(seen[28..], bytes[28..]);
    }

    #[test]
    fn what_is_no_such_sequence_stays_as_it_is() {
        let mut cut = sequence(b"1.2.840.1234");
        cut.truncate(30);
        let mut text = UNKNOWN.to_vec();
        text.extend(b"these are the bytes of something else, and no items at all");
        for bytes in [cut, text, UNKNOWN.to_vec(), b"UN".to_vec()] {
            assert_eq!(through(&bytes, 4), bytes);
        }
        // As deep as memory would go, and no further.
        let deep: Vec<u8> = [&UNKNOWN[..]]
            .into_iter()
            .chain(std::iter::repeat_n(&[ITEM, [0xff; 4], [9, 0, 1, 16], [0xff; 4]].concat()[..], 10_000))
            .flatten()
            .copied()
            .collect();
        assert_eq!(through(&deep, 4), deep);
    }
}
