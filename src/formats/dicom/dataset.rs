//! Stores the parts of a DICOM file that the volume reader needs: image attributes, and byte positions of the pixel
//! data.

use super::attributes::Attributes;
use dicom_core::Tag;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry as _};
use dicom_dictionary_std::{StandardDataDictionary, tags};
use flate2::read::DeflateDecoder;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Largest accepted number of frames in a DICOM file.
pub(super) const MAX_FRAMES: usize = 1 << 16;
/// Byte range in a DICOM file, given by offset and length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) offset: u64,
    pub(super) bytes: u32,
}

/// Byte positions of the pixel data in a DICOM file.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) enum PixelData {
    #[default]
    None,
    /// Uncompressed pixel data of a DICOM file, in one byte range.
    Native(Span),
    /// Compressed pixel data of a DICOM file, in fragments. The first fragment is the Basic Offset Table.
    Encapsulated(Vec<Span>),
}

/// Attributes of a DICOM file and the byte positions of its pixel data.
#[derive(Debug, Clone, Default)]
pub(super) struct DataSet {
    pub(super) syntax: String,
    pub(super) root: Attributes,
    pub(super) pixels: PixelData,
    pub(super) has_floats: bool,
    /// Byte offset of the deflated data set in a DICOM file; `None` if it is not deflated. For a deflated file, byte
    /// ranges refer to the inflated data set.
    pub(super) deflated_from: Option<u64>,
    /// Inflated data set of a multi-frame DICOM file with deflated transfer syntax. It is not stored for a
    /// single-frame file, which is inflated again on each read.
    pub(super) inflated: Option<Vec<u8>>,
}

impl DataSet {
    /// Returns the group of DICOM attributes that gives the value of `tag` for an image frame. The search order is
    /// the per-frame functional group, the shared functional group, and the root of the DICOM file.
    pub(super) fn of_frame(&self, frame: usize, tag: Tag) -> Option<&Attributes> {
        let shared = self.root.items(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE).first();
        let own = self.root.items(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).get(frame);
        let levels = [own, shared, Some(&self.root)];
        levels.into_iter().flatten().find(|attributes| attributes.has(tag))
    }

    /// Whether a DICOM file is a segmentation whose pixels are masks of one bit or segment numbers (label map). In other
    /// segmentations a pixel has the fraction that a segment occupies.
    pub(super) fn is_segmentation(&self) -> bool {
        let is_binary = self.root.integer(tags::BITS_ALLOCATED) == Some(1);
        let is_seg = self.root.text(tags::MODALITY).as_deref() == Some("SEG");
        is_seg && (is_binary || self.is_label_map())
    }

    /// Whether the pixels of a DICOM segmentation are segment numbers (SegmentationType LABELMAP).
    pub(super) fn is_label_map(&self) -> bool {
        self.root.text(tags::SEGMENTATION_TYPE).as_deref() == Some("LABELMAP")
    }

    /// Reads a byte range of a DICOM file, or of its inflated data set.
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

/// Removes all characters that are unsafe on a terminal: keeps ASCII letters, digits and some punctuation.
pub(super) fn printable(text: &str) -> String {
    text.chars().filter(|c| c.is_ascii_alphanumeric() || " .,:;()+-_/%".contains(*c)).take(64).collect()
}

/// Returns the keyword of a DICOM attribute, such as `PixelSpacing`, or the tag itself if it is unknown.
pub(super) fn name_of(tag: Tag) -> String {
    StandardDataDictionary.by_tag(tag).map_or_else(|| tag.to_string(), |entry| entry.alias().to_owned())
}
