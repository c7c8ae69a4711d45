//! Scans the tags of a VTK XML file without the contents of its data arrays, which are streamed later.

use crate::files::vtk_xml::appended_is_raw;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};

/// Largest total size of the tags of a VTK XML file and the text between them, in bytes.
const MAX_BYTES: u64 = 8 << 20;

/// Tags of a VTK XML file and the byte positions of its data arrays.
pub(super) struct Skeleton {
    /// XML text of a VTK file without appended data. Each `DataArray` element holds its index instead of its
    /// contents.
    pub(super) text: String,
    /// Byte offset and length of the contents of each `DataArray` element of a VTK file, by the index of the element.
    pub(super) arrays: Vec<[u64; 2]>,
    /// Byte offset of the appended data of a VTK file, and whether the data are raw bytes.
    pub(super) appended: Option<(u64, bool)>,
}

impl Skeleton {
    /// Scans the tags of a VTK XML file.
    ///
    /// # Errors
    /// The file cannot be read, its tags are not UTF-8 text, or they are too long.
    pub(super) fn new(file: File) -> Result<Self, String> {
        let mut tags = Tags { input: BufReader::with_capacity(1 << 16, file), at: 0, text: Vec::new() };
        let (mut arrays, mut appended) = (Vec::new(), None);
        let io_error = |e: io::Error| e.to_string();
        while let Some(tag) = tags.next().map_err(io_error)? {
            if tag.starts_with(b"<AppendedData") {
                let is_raw = appended_is_raw(&tag)?;
                tags.text.truncate(tags.text.len() - tag.len());
                tags.text.extend_from_slice(b"</VTKFile>");
                let mark = tags.skip_to(b'_').map_err(io_error)?;
                appended = Some((mark.ok_or("appended data have no mark `_`")?, is_raw));
                break;
            }
            if tag.starts_with(b"<DataArray") && !tag.ends_with(b"/>") {
                let from = tags.at;
                let to = tags.skip_to(b'<').map_err(io_error)?.ok_or("an array of it does not end")? - 1;
                tags.skip_array().map_err(io_error)?;
                tags.text.extend_from_slice(format!("{}</DataArray>", arrays.len()).as_bytes());
                arrays.push([from, to - from]);
            }
        }
        let text = String::from_utf8(tags.text).map_err(|_| "its tags are not UTF-8 text")?;
        Ok(Self { text, arrays, appended })
    }
}

/// Scanner that reads a VTK XML file tag by tag.
struct Tags {
    input: BufReader<File>,
    /// Byte offset of the scanner in the VTK file.
    at: u64,
    /// XML text of the VTK file read so far, without the contents of its data arrays.
    text: Vec<u8>,
}

impl Tags {
    /// Reads the next XML tag and returns its text; `None` at the end of the file.
    fn next(&mut self) -> io::Result<Option<Vec<u8>>> {
        let before = self.text.len();
        let mut rest = self.input.by_ref().take(MAX_BYTES.saturating_sub(before as u64));
        self.at += rest.read_until(b'<', &mut self.text)? as u64;
        if rest.limit() == 0 {
            return Err(too_long());
        }
        if self.text.last() != Some(&b'<') {
            return Ok(None);
        }
        let start = self.text.len() - 1;
        self.end_tag()?;
        Ok(Some(self.text[start..].to_vec()))
    }

    /// Reads up to the `>` that ends an XML tag, ignoring `>` in quotes.
    fn end_tag(&mut self) -> io::Result<()> {
        let mut quote = None;
        let start = self.text.len();
        let mut bytes = self.input.by_ref().take(MAX_BYTES.saturating_sub(start as u64)).bytes();
        for byte in bytes.by_ref() {
            let byte = byte?;
            self.at += 1;
            self.text.push(byte);
            // Apostrophes in a comment are no quotes.
            let in_comment = self.text[start..].starts_with(b"!");
            match (quote, byte) {
                (Some(open), byte) if byte == open => quote = None,
                (None, b'"' | b'\'') if !in_comment => quote = Some(byte),
                (None, b'>') => return Ok(()),
                _ => {}
            }
        }
        Err(if self.text.len() as u64 >= MAX_BYTES {
            too_long()
        } else {
            io::Error::other("a tag of it does not end")
        })
    }

    /// Skips bytes of the VTK file up to the next occurrence of `byte`, and returns the offset after it; `None` at
    /// the end of the file.
    fn skip_to(&mut self, byte: u8) -> io::Result<Option<u64>> {
        loop {
            let buffer = self.input.fill_buf()?;
            if buffer.is_empty() {
                return Ok(None);
            }
            let found = buffer.iter().position(|b| *b == byte);
            let count = found.map_or(buffer.len(), |place| place + 1);
            self.input.consume(count);
            self.at += count as u64;
            if found.is_some() {
                return Ok(Some(self.at));
            }
        }
    }

    /// Skips the XML tags inside a `DataArray` element, up to its end tag. The `<` of the next tag was already read.
    fn skip_array(&mut self) -> io::Result<()> {
        loop {
            let length = self.text.len();
            self.end_tag()?;
            let is_end = self.text[length..].starts_with(b"/DataArray");
            self.text.truncate(length);
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
    io::Error::other(format!("it has more than {MAX_BYTES} bytes of tags"))
}
