//! The part of a DICOM file that a volume needs: the attributes that place its frames, and the position of its pixels.

use super::attributes::Attributes;
use dicom_core::Tag;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry as _};
use dicom_dictionary_std::{StandardDataDictionary, tags};
use flate2::read::DeflateDecoder;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Largest number of frames in a file.
pub(super) const MAX_FRAMES: usize = 1 << 16;
/// Byte range of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) offset: u64,
    pub(super) bytes: u32,
}

/// Position of the pixels.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) enum PixelData {
    #[default]
    None,
    /// Uncompressed.
    Native(Span),
    /// Compressed in fragments; the first one is the table of offsets.
    Encapsulated(Vec<Span>),
}

/// Attributes and pixel positions of a file.
#[derive(Debug, Clone, Default)]
pub(super) struct DataSet {
    pub(super) syntax: String,
    pub(super) root: Attributes,
    pub(super) pixels: PixelData,
    pub(super) has_floats: bool,
    /// First byte of a deflated data set; spans then count inflated bytes.
    pub(super) deflated_from: Option<u64>,
    /// Inflated data set of a file with several frames; that of one frame is inflated again when it is needed.
    pub(super) inflated: Option<Vec<u8>>,
}

impl DataSet {
    /// Attributes that hold `tag` for a frame: its own, those of all frames, or the file's.
    pub(super) fn of_frame(&self, frame: usize, tag: Tag) -> Option<&Attributes> {
        let shared = self.root.items(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE).first();
        let own = self.root.items(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).get(frame);
        let levels = [own, shared, Some(&self.root)];
        levels.into_iter().flatten().find(|attributes| attributes.has(tag))
    }

    /// Reads bytes of the file, or of the inflated data set.
    pub(super) fn bytes(&self, path: &Path, span: Span) -> Result<Vec<u8>, String> {
        let early = || String::from("its pixels end early");
        if let Some(inflated) = &self.inflated {
            let from = span.offset as usize;
            let bytes = inflated.get(from..from.saturating_add(span.bytes as usize));
            return bytes.map(<[u8]>::to_vec).ok_or_else(early);
        }
        let io_error = |e: io::Error| e.to_string();
        let mut file = File::open(path).map_err(io_error)?;
        file.seek(SeekFrom::Start(self.deflated_from.unwrap_or(span.offset))).map_err(io_error)?;
        let mut bytes = Vec::new();
        if self.deflated_from.is_some() {
            let mut inflating = DeflateDecoder::new(BufReader::new(file));
            io::copy(&mut inflating.by_ref().take(span.offset), &mut io::sink()).map_err(io_error)?;
            inflating.take(span.bytes.into()).read_to_end(&mut bytes).map_err(io_error)?;
        } else {
            file.take(span.bytes.into()).read_to_end(&mut bytes).map_err(io_error)?;
        }
        if bytes.len() == span.bytes as usize { Ok(bytes) } else { Err(early()) }
    }
}

/// Characters that are safe on a terminal: letters, digits and points.
pub(super) fn printable(text: &str) -> String {
    text.chars().filter(|c| c.is_ascii_alphanumeric() || " .,:;()+-_/%".contains(*c)).take(64).collect()
}

/// Name of an attribute.
pub(super) fn name_of(tag: Tag) -> String {
    StandardDataDictionary.by_tag(tag).map_or_else(|| tag.to_string(), |entry| entry.alias().to_owned())
}
