//! Converts numbers in text, separated by white space or commas, to bytes of binary voxels while they are read.

use crate::volume::element::Element;
use std::io::{self, BufReader, Read};

/// Largest accepted number of characters of a number in text voxel data.
const MAX_WORD_BYTES: usize = 400;

/// Adapter that reads text numbers and returns them as little-endian bytes of binary voxels.
pub(super) struct TextNumbers<R> {
    input: BufReader<R>,
    element: Element,
    /// Number of voxels that remain to be read from the text.
    left: u64,
    /// Binary bytes of the current voxel, and the number of these bytes that were already returned.
    bytes: [u8; 8],
    taken: usize,
}

impl<R: Read> TextNumbers<R> {
    /// Creates a reader of `count` text numbers that returns them as voxels of type `element`.
    pub(super) fn new(input: R, element: Element, count: u64) -> Self {
        let taken = element.bytes();
        Self { input: BufReader::with_capacity(1 << 16, input), element, left: count, bytes: [0; 8], taken }
    }

    /// Skips `count` text numbers; returns false if the text ends before.
    ///
    /// # Errors
    /// The text cannot be read, or holds a word that is too long for a number.
    pub(super) fn skip(&mut self, count: u64) -> io::Result<bool> {
        for _ in 0..count {
            if self.word()?.is_none() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Returns the next word of the text, without separators; `None` at the end of the text.
    fn word(&mut self) -> io::Result<Option<String>> {
        let mut word = String::new();
        for byte in self.input.by_ref().bytes() {
            match byte? {
                byte if !byte.is_ascii_whitespace() && byte != b',' => word.push(byte.into()),
                _ if word.is_empty() => {}
                _ => break,
            }
            if word.len() > MAX_WORD_BYTES {
                return Err(bad(&word));
            }
        }
        Ok(Some(word).filter(|word| !word.is_empty()))
    }
}

fn bad(word: &str) -> io::Error {
    let short: String = word.chars().take(40).collect();
    io::Error::new(io::ErrorKind::InvalidData, format!("a voxel of it is `{short}`"))
}

impl<R: Read> Read for TextNumbers<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let size = self.element.bytes();
        let mut done = 0;
        while done < buffer.len() {
            if self.taken == size {
                if self.left == 0 {
                    break;
                }
                let Some(word) = self.word()? else { break };
                let value = word.parse::<f64>().map_err(|_| bad(&word))?;
                self.bytes = stored(value, self.element);
                (self.left, self.taken) = (self.left - 1, 0);
            }
            let count = (size - self.taken).min(buffer.len() - done);
            buffer[done..done + count].copy_from_slice(&self.bytes[self.taken..self.taken + count]);
            self.taken += count;
            done += count;
        }
        Ok(done)
    }
}

/// Converts a number to the little-endian bytes of a voxel type, clamped to the range of the type.
fn stored(value: f64, element: Element) -> [u8; 8] {
    let bits = match element {
        Element::U8 => (value as u8).into(),
        Element::I8 => value as i8 as u64,
        Element::U16 => (value as u16).into(),
        Element::I16 => value as i16 as u64,
        Element::U32 => (value as u32).into(),
        Element::I32 => value as i32 as u64,
        Element::U64 => value as u64,
        Element::I64 => value as i64 as u64,
        Element::F32 => (value as f32).to_bits().into(),
        Element::F64 => value.to_bits(),
    };
    bits.to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_become_bytes_wherever_the_text_is_cut() {
        let text = "  1,-2 3.9\n300\t4";
        for capacity in 1..text.len() {
            let mut numbers = TextNumbers::new(text.as_bytes(), Element::I16, 9);
            numbers.input = BufReader::with_capacity(capacity, text.as_bytes());
            assert!(numbers.skip(1).unwrap());
            let mut bytes = Vec::new();
            numbers.read_to_end(&mut bytes).unwrap();
            let values: Vec<i16> = bytes.as_chunks().0.iter().map(|b| i16::from_le_bytes(*b)).collect();
            assert_eq!(values, [-2, 3, 300, 4], "{capacity}");
            assert!(!numbers.skip(1).unwrap());
        }
        let mut bad = TextNumbers::new(&b"1 x"[..], Element::F64, 2);
        assert!(bad.read_to_end(&mut Vec::new()).unwrap_err().to_string().contains("`x`"));
        let long = vec![b'1'; 1 << 20];
        assert!(TextNumbers::new(&long[..], Element::U8, 1).read(&mut [0]).is_err());
    }
}
