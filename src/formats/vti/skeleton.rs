//! The tags of a VTK XML file without what its arrays hold: those may be far longer than memory should be taken for, and are
//! read from where they lie.

use crate::files::vtk_xml::appended_is_raw;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};

/// Tags, and text between them, of no image are longer.
const MOST_BYTES: u64 = 8 << 20;

/// What a file says, and where its arrays lie in it.
pub(super) struct Skeleton {
    /// The file without its appended data; what is in an array is its number instead.
    pub(super) text: String,
    /// Where the text of each `DataArray` begins and how many bytes it has, by number.
    pub(super) arrays: Vec<[u64; 2]>,
    /// Where appended data begin, and whether they are raw.
    pub(super) appended: Option<(u64, bool)>,
}

impl Skeleton {
    /// Of a file, from its beginning on.
    ///
    /// # Errors
    /// It cannot be read, is no text, or has too much of it.
    pub(super) fn of(file: File) -> Result<Self, String> {
        let mut tags = Tags { input: BufReader::with_capacity(1 << 16, file), at: 0, text: Vec::new() };
        let (mut arrays, mut appended) = (Vec::new(), None);
        let said = |e: io::Error| e.to_string();
        while let Some(tag) = tags.next().map_err(said)? {
            if tag.starts_with(b"<AppendedData") {
                let is_raw = appended_is_raw(&tag)?;
                tags.text.truncate(tags.text.len() - tag.len());
                tags.text.extend_from_slice(b"</VTKFile>");
                let mark = tags.skip_to(b'_').map_err(said)?;
                appended = Some((mark.ok_or("appended data have no mark `_`")?, is_raw));
                break;
            }
            if tag.starts_with(b"<DataArray") && !tag.ends_with(b"/>") {
                let from = tags.at;
                let to = tags.skip_to(b'<').map_err(said)?.ok_or("an array of it does not end")? - 1;
                tags.skip_array().map_err(said)?;
                // The number of the array stands for what it holds.
                tags.text.extend_from_slice(format!("{}</DataArray>", arrays.len()).as_bytes());
                arrays.push([from, to - from]);
            }
        }
        let text = String::from_utf8(tags.text).map_err(|_| "its tags are not UTF-8 text")?;
        Ok(Self { text, arrays, appended })
    }
}

/// A file that is gone through tag by tag.
struct Tags {
    input: BufReader<File>,
    /// The byte of the file that is next.
    at: u64,
    /// All that has been read and not skipped.
    text: Vec<u8>,
}

impl Tags {
    /// Reads up to the end of the next tag, which is returned.
    fn next(&mut self) -> io::Result<Option<Vec<u8>>> {
        let before = self.text.len();
        let mut room = self.input.by_ref().take(MOST_BYTES.saturating_sub(before as u64));
        self.at += room.read_until(b'<', &mut self.text)? as u64;
        if room.limit() == 0 {
            return Err(too_long());
        }
        if self.text.last() != Some(&b'<') {
            return Ok(None);
        }
        let begun = self.text.len() - 1;
        self.end_tag()?;
        Ok(Some(self.text[begun..].to_vec()))
    }

    /// Reads up to the end of a tag that has begun: `>`, but for one in quotes.
    fn end_tag(&mut self) -> io::Result<()> {
        let mut quote = None;
        let begun = self.text.len();
        let mut bytes = self.input.by_ref().take(MOST_BYTES.saturating_sub(begun as u64)).bytes();
        for byte in bytes.by_ref() {
            let byte = byte?;
            self.at += 1;
            self.text.push(byte);
            // Apostrophes in a comment are no quotes.
            let in_comment = self.text[begun..].starts_with(b"!");
            match (quote, byte) {
                (Some(open), byte) if byte == open => quote = None,
                (None, b'"' | b'\'') if !in_comment => quote = Some(byte),
                (None, b'>') => return Ok(()),
                _ => {}
            }
        }
        Err(if self.text.len() as u64 >= MOST_BYTES {
            too_long()
        } else {
            io::Error::other("a tag of it does not end")
        })
    }

    /// Passes over what is before a byte, and over that one: where the file goes on, or `None` at its end.
    fn skip_to(&mut self, byte: u8) -> io::Result<Option<u64>> {
        loop {
            let held = self.input.fill_buf()?;
            if held.is_empty() {
                return Ok(None);
            }
            let found = held.iter().position(|b| *b == byte);
            let count = found.map_or(held.len(), |place| place + 1);
            self.input.consume(count);
            self.at += count as u64;
            if found.is_some() {
                return Ok(Some(self.at));
            }
        }
    }

    /// Passes over the tags in an array, of which the first has begun, up to the array's end.
    fn skip_array(&mut self) -> io::Result<()> {
        loop {
            let kept = self.text.len();
            self.end_tag()?;
            let is_end = self.text[kept..].starts_with(b"/DataArray");
            self.text.truncate(kept);
            if is_end {
                return Ok(());
            }
            if self.skip_to(b'<')?.is_none() {
                return Err(io::Error::other("an array of it does not end"));
            }
        }
    }
}

fn too_long() -> io::Error {
    io::Error::other(format!("it has more than {MOST_BYTES} bytes of tags"))
}
