//! Voxels written as numbers apart by blanks or commas, as the bytes that they would be stored as: nothing of the text is kept.

use crate::volume::element::Element;
use std::io::{self, BufRead, BufReader, Read};

/// No number is written in more letters.
const WORD_MOST_BYTES: usize = 400;

/// A text that is read as the bytes of its numbers, the least one first.
pub(super) struct TextNumbers<R> {
    input: BufReader<R>,
    element: Element,
    /// Numbers that are still to come.
    left: u64,
    /// The bytes of the present one, and how many were taken.
    bytes: [u8; 8],
    taken: usize,
}

impl<R: Read> TextNumbers<R> {
    /// Of `count` numbers of this type.
    pub(super) fn new(input: R, element: Element, count: u64) -> Self {
        let taken = element.bytes();
        Self { input: BufReader::with_capacity(1 << 16, input), element, left: count, bytes: [0; 8], taken }
    }

    /// Passes over as many numbers; whether there were so many.
    ///
    /// # Errors
    /// The text cannot be read, or holds a word that no number can be.
    pub(super) fn skip(&mut self, count: u64) -> io::Result<bool> {
        for _ in 0..count {
            if self.word()?.is_none() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The next word.
    fn word(&mut self) -> io::Result<Option<String>> {
        let is_blank = |b: &u8| b.is_ascii_whitespace() || *b == b',';
        let mut word = Vec::new();
        loop {
            let held = self.input.fill_buf()?;
            if held.is_empty() {
                break;
            }
            // Blanks before a word, then the word up to the blank after it.
            let blanks = if word.is_empty() { held.iter().take_while(|b| is_blank(b)).count() } else { 0 };
            let letters = held[blanks..].iter().take_while(|b| !is_blank(b)).count();
            let ends = blanks + letters < held.len();
            word.extend_from_slice(&held[blanks..blanks + letters]);
            self.input.consume(blanks + letters);
            if word.len() > WORD_MOST_BYTES {
                return Err(bad(&String::from_utf8_lossy(&word)));
            }
            if ends && !word.is_empty() {
                break;
            }
        }
        Ok((!word.is_empty()).then(|| String::from_utf8_lossy(&word).into_owned()))
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

/// A number as a type stores it; beyond its ends the last one there is.
fn stored(value: f64, element: Element) -> [u8; 8] {
    let mut bytes = [0; 8];
    let mut put = |of: &[u8]| bytes[..of.len()].copy_from_slice(of);
    match element {
        Element::U8 => put(&(value as u8).to_le_bytes()),
        Element::I8 => put(&(value as i8).to_le_bytes()),
        Element::U16 => put(&(value as u16).to_le_bytes()),
        Element::I16 => put(&(value as i16).to_le_bytes()),
        Element::U32 => put(&(value as u32).to_le_bytes()),
        Element::I32 => put(&(value as i32).to_le_bytes()),
        Element::U64 => put(&(value as u64).to_le_bytes()),
        Element::I64 => put(&(value as i64).to_le_bytes()),
        Element::F32 => put(&(value as f32).to_le_bytes()),
        Element::F64 => put(&value.to_le_bytes()),
    }
    bytes
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
