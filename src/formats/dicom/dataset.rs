//! The part of a DICOM file that a volume needs: the attributes that place its frames, and the position of its pixels.
//!
//! The elements are read here and not by `dicom-object`: that crate allocates the lengths that a file claims, and it
//! misreads sequences of unknown type (`UN` of undefined length), whose items are in the implicit syntax (PS3.5, 6.2.2).
//! Only the values of [`WANTED`] attributes are read, and none that is longer than any valid one.

use super::attributes::{Attributes, Value, is_padding};
use crate::volume::read::read_full;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry as _, VirtualVr};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags};
use dicom_encoding::TransferSyntaxIndex;
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;
use flate2::read::DeflateDecoder;
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

const IMPLICIT_LITTLE: &str = "1.2.840.10008.1.2";
const EXPLICIT_LITTLE: &str = "1.2.840.10008.1.2.1";
const DEFLATED: &str = "1.2.840.10008.1.2.1.99";
pub(super) const EXPLICIT_BIG: &str = "1.2.840.10008.1.2.2";

/// Bytes before the magic word of a file, and the magic word.
const PREAMBLE_BYTES: usize = 128;
const MAGIC: &[u8] = b"DICM";
/// Largest length of a value that is read: 65,536 numbers of a lookup table.
const MAX_VALUE_BYTES: u32 = 1 << 17;
/// Largest number of frames in a file.
pub(super) const MAX_FRAMES: usize = 1 << 16;
/// Largest nesting depth of sequences.
const MAX_DEPTH: usize = 64;
/// Largest size of an inflated data set, and beyond a small size the largest ratio to its deflated bytes.
const MAX_INFLATED_BYTES: u64 = 1 << 31;
const MAX_INFLATED_RATIO: u64 = 100;
const SMALL_INFLATED_BYTES: u64 = 16 << 20;

/// Attributes that are read. Names of people and dates are not among them.
const WANTED: [Tag; 34] = [
    tags::MODALITY,
    tags::SERIES_DESCRIPTION,
    tags::SERIES_INSTANCE_UID,
    tags::SERIES_NUMBER,
    tags::ACQUISITION_NUMBER,
    tags::INSTANCE_NUMBER,
    tags::TEMPORAL_POSITION_IDENTIFIER,
    tags::TEMPORAL_POSITION_INDEX,
    tags::IMAGE_POSITION_PATIENT,
    tags::IMAGE_ORIENTATION_PATIENT,
    tags::SLICE_THICKNESS,
    tags::SPACING_BETWEEN_SLICES,
    tags::SAMPLES_PER_PIXEL,
    tags::PHOTOMETRIC_INTERPRETATION,
    tags::NUMBER_OF_FRAMES,
    tags::ROWS,
    tags::COLUMNS,
    tags::PIXEL_SPACING,
    tags::IMAGER_PIXEL_SPACING,
    tags::NOMINAL_SCANNED_PIXEL_SPACING,
    tags::BITS_ALLOCATED,
    tags::BITS_STORED,
    tags::HIGH_BIT,
    tags::PIXEL_REPRESENTATION,
    tags::PIXEL_PADDING_VALUE,
    tags::PIXEL_PADDING_RANGE_LIMIT,
    tags::RESCALE_INTERCEPT,
    tags::RESCALE_SLOPE,
    tags::RESCALE_TYPE,
    tags::LUT_DESCRIPTOR,
    tags::LUT_DATA,
    tags::FLOAT_PIXEL_PADDING_VALUE,
    tags::GRID_FRAME_OFFSET_VECTOR,
    tags::DOSE_GRID_SCALING,
];

/// Tags that delimit items and sequences.
const ITEM: Tag = Tag(0xfffe, 0xe000);
const ITEM_END: Tag = Tag(0xfffe, 0xe00d);
const SEQUENCE_END: Tag = Tag(0xfffe, 0xe0dd);

/// Sequences within functional groups that describe frames.
const FRAME_SEQUENCES: [Tag; 7] = [
    tags::PLANE_POSITION_SEQUENCE,
    tags::PLANE_ORIENTATION_SEQUENCE,
    tags::PIXEL_MEASURES_SEQUENCE,
    tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE,
    tags::FRAME_CONTENT_SEQUENCE,
    tags::CT_IMAGE_FRAME_TYPE_SEQUENCE,
    tags::TEMPORAL_POSITION_SEQUENCE,
];

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
    /// Attributes that all frames share.
    pub(super) shared: Attributes,
    /// Attributes of each frame.
    pub(super) frames: Vec<Attributes>,
    pub(super) pixels: PixelData,
    pub(super) has_floats: bool,
    /// Attributes of the modality lookup table, if there is one.
    pub(super) table: Option<Attributes>,
    /// First byte of a deflated data set; spans then count inflated bytes.
    pub(super) deflated_from: Option<u64>,
    /// Inflated data set of a file with several frames; that of one frame is inflated again when it is needed.
    pub(super) inflated: Option<Vec<u8>>,
}

trait ReadSeek: Read + Seek {}
impl<T: Read + Seek> ReadSeek for T {}

/// Whether the first bytes of a file are those of a DICOM file, with its preamble or without.
pub(super) fn is_dicom(head: &[u8]) -> bool {
    head.get(PREAMBLE_BYTES..).is_some_and(|rest| rest.starts_with(MAGIC)) || bare_syntax(head).is_some()
}

/// Syntax of a data set without preamble and meta group, as scanners of the nineties wrote it: it begins with group 8.
fn bare_syntax(head: &[u8]) -> Option<&'static str> {
    // Element 0 is the group's length; the others are those that come first without it.
    match head.get(..8)? {
        [2, 0, ..] => Some(EXPLICIT_LITTLE),
        [8, 0, 0 | 1 | 5 | 8 | 0x16 | 0x18, 0, rest @ ..] => match rest {
            [b'A'..=b'Z', b'A'..=b'Z', ..] => {
                [b"UL", b"CS", b"UI", b"SH", b"LO"].contains(&&[rest[0], rest[1]]).then_some(EXPLICIT_LITTLE)
            }
            [low, _, 0, 0] if low % 2 == 0 => Some(IMPLICIT_LITTLE),
            _ => None,
        },
        _ => None,
    }
}

impl DataSet {
    /// Reads a file up to the position of its pixels.
    ///
    /// # Errors
    /// The file cannot be read or is no DICOM file.
    pub(super) fn read(path: &Path) -> Result<Self, String> {
        let io_error = |e: io::Error| e.to_string();
        let file = File::open(path).map_err(io_error)?;
        let length = file.metadata().map_err(io_error)?.len();
        let mut input = BufReader::with_capacity(1 << 14, file);
        let mut head = [0; PREAMBLE_BYTES + 8];
        let got = read_full(&mut input, &mut head).map_err(io_error)?;
        let has_preamble = head[..got].get(PREAMBLE_BYTES..).is_some_and(|rest| rest.starts_with(MAGIC));
        let start = if has_preamble { PREAMBLE_BYTES + MAGIC.len() } else { 0 };
        let bare = bare_syntax(&head[..got]);
        if !has_preamble && bare.is_none() {
            return Err("it is not a DICOM file".into());
        }
        let mut set = Self::default();
        input.seek(SeekFrom::Start(start as u64)).map_err(io_error)?;
        let mut elements = Elements { input: &mut input, at: start as u64, length, set: &mut set };
        let syntax = match bare.filter(|_| !has_preamble && head[0] == 8) {
            Some(bare) => bare.to_owned(),
            None => elements.meta()?,
        };
        let at = elements.at;
        set.syntax = syntax;
        if set.syntax == DEFLATED {
            let limit = (MAX_INFLATED_RATIO * length.saturating_sub(at))
                .clamp(SMALL_INFLATED_BYTES, MAX_INFLATED_BYTES);
            let mut inflated = Vec::new();
            DeflateDecoder::new(input).take(limit).read_to_end(&mut inflated).map_err(io_error)?;
            set.syntax = EXPLICIT_LITTLE.into();
            let length = inflated.len() as u64;
            Elements { input: &mut Cursor::new(&inflated[..]), at: 0, length, set: &mut set }.all()?;
            (set.deflated_from, set.inflated) = (Some(at), Some(inflated));
        } else {
            Elements { input: &mut input, at, length, set: &mut set }.all()?;
        }
        Ok(set)
    }

    /// Attributes that hold `tag` for a frame: its own, those of all frames, or the file's.
    pub(super) fn of_frame(&self, frame: usize, tag: Tag) -> Option<&Attributes> {
        let levels = [self.frames.get(frame), Some(&self.shared), Some(&self.root)];
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

/// Encoding of elements.
#[derive(Debug, Clone, Copy)]
struct Syntax {
    is_explicit: bool,
    big_endian: bool,
}

const IMPLICIT: Syntax = Syntax { is_explicit: false, big_endian: false };
const EXPLICIT: Syntax = Syntax { is_explicit: true, big_endian: false };

/// Attributes that the elements of a sequence item belong to.
#[derive(Debug, Clone, Copy)]
enum Owner {
    Root,
    Table,
    SharedGroups,
    Shared,
    FrameGroups(usize),
    Frame(usize),
    /// Elements that no volume needs.
    Nothing,
}

/// Tag, type and length of an element; an undefined length is `None`.
struct ElementHeader {
    tag: Tag,
    vr: VR,
    bytes: Option<u32>,
}

/// Reader of the elements of a data set.
struct Elements<'a> {
    input: &'a mut dyn ReadSeek,
    at: u64,
    length: u64,
    set: &'a mut DataSet,
}

impl Elements<'_> {
    /// Reads all elements up to the pixels.
    fn all(&mut self) -> Result<(), String> {
        if TransferSyntaxRegistry.get(&self.set.syntax).is_none() {
            return Err(format!("its transfer syntax {} is not known", printable(&self.set.syntax)));
        }
        let syntax = Syntax {
            is_explicit: self.set.syntax != IMPLICIT_LITTLE,
            big_endian: self.set.syntax == EXPLICIT_BIG,
        };
        self.seek(self.at)?;
        self.elements(self.length, syntax, Owner::Root, 0)
    }

    /// Reads the meta group and returns the transfer syntax that it names.
    fn meta(&mut self) -> Result<String, String> {
        let mut syntax = None;
        loop {
            let from = self.at;
            // A header of the data set itself need not be readable in this syntax.
            let header = self.header(EXPLICIT).ok().filter(|header| header.tag.group() == 2);
            let Some(header) = header else {
                self.seek(from)?;
                return syntax.ok_or_else(|| "it does not name its transfer syntax".into());
            };
            let bytes = header.bytes.ok_or("an element of its meta group has no length")?;
            self.check(header.tag, bytes)?;
            if header.tag == tags::TRANSFER_SYNTAX_UID && bytes <= 64 {
                let text = String::from_utf8_lossy(&self.value(bytes)?).into_owned();
                syntax = Some(text.trim_matches(is_padding).to_owned());
            } else {
                self.skip(bytes)?;
            }
        }
    }

    /// Reads elements up to a byte of the file, the end of an item of undefined length, or the pixels.
    fn elements(&mut self, end: u64, syntax: Syntax, owner: Owner, depth: usize) -> Result<(), String> {
        while self.at < end && self.set.pixels == PixelData::None {
            let ElementHeader { tag, vr, bytes } = self.header(syntax)?;
            let is_root = matches!(owner, Owner::Root);
            let has_floats = [tags::FLOAT_PIXEL_DATA, tags::DOUBLE_FLOAT_PIXEL_DATA].contains(&tag);
            match bytes {
                _ if tag == ITEM_END => return Ok(()),
                None if tag == tags::PIXEL_DATA && is_root => return self.fragments(syntax),
                None if vr == VR::UN => {
                    let inner = if self.has_explicit_items()? { syntax } else { IMPLICIT };
                    self.sequence(tag, None, inner, owner, depth + 1)?;
                }
                _ if bytes.is_none() || vr == VR::SQ => {
                    self.sequence(tag, bytes, syntax, owner, depth + 1)?
                }
                Some(bytes) => {
                    self.check(tag, bytes)?;
                    if is_root && (tag == tags::PIXEL_DATA || has_floats) {
                        self.set.pixels = PixelData::Native(Span { offset: self.at, bytes });
                        self.set.has_floats = has_floats;
                    } else if bytes <= MAX_VALUE_BYTES && WANTED.contains(&tag) && self.owned(owner).is_some()
                    {
                        let value = Value::new(&self.value(bytes)?, self.signed(tag, vr), syntax.big_endian);
                        self.owned(owner).map(|attributes| attributes.0.insert(tag, value));
                    } else {
                        self.skip(bytes)?;
                    }
                }
                None => return Err("an element of it has no length".into()),
            }
        }
        Ok(())
    }

    /// Reads a sequence of known or undefined length.
    fn sequence(
        &mut self,
        tag: Tag,
        bytes: Option<u32>,
        syntax: Syntax,
        owner: Owner,
        depth: usize,
    ) -> Result<(), String> {
        if depth > MAX_DEPTH {
            return Err("its sequences are nested too deeply".into());
        }
        let end = match bytes {
            Some(bytes) => self.check(tag, bytes)?,
            None => self.length,
        };
        if matches!((owner, tag), (Owner::Root, tags::MODALITY_LUT_SEQUENCE)) {
            self.set.table = Some(Attributes::default());
        }
        let mut number = 0;
        while self.at < end {
            let header = self.header(syntax)?;
            match header.tag {
                SEQUENCE_END => break,
                ITEM => {}
                _ => return Err("it is damaged: a sequence holds something else than items".into()),
            }
            let inner = match (owner, tag) {
                (Owner::Root, tags::MODALITY_LUT_SEQUENCE) => Owner::Table,
                (Owner::Root, tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE) => Owner::SharedGroups,
                (Owner::Root, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE) => Owner::FrameGroups(number),
                (Owner::SharedGroups, tag) if FRAME_SEQUENCES.contains(&tag) => Owner::Shared,
                (Owner::FrameGroups(frame), tag) if FRAME_SEQUENCES.contains(&tag) => Owner::Frame(frame),
                _ => Owner::Nothing,
            };
            number += 1;
            if number > MAX_FRAMES && matches!(inner, Owner::FrameGroups(_)) {
                return Err(format!("it describes more than {MAX_FRAMES} frames"));
            }
            match (header.bytes, inner) {
                // Fragments of an icon's pixels are items without elements.
                (Some(bytes), Owner::Nothing) => {
                    self.check(header.tag, bytes)?;
                    self.skip(bytes)?;
                }
                (Some(bytes), _) => {
                    let end = self.check(header.tag, bytes)?;
                    self.elements(end, syntax, inner, depth)?;
                }
                (None, _) => self.elements(end, syntax, inner, depth)?,
            }
        }
        Ok(())
    }

    /// Reads the positions of compressed pixels. Damage after the first fragment ends the list.
    fn fragments(&mut self, syntax: Syntax) -> Result<(), String> {
        let mut fragments = Vec::new();
        while let Ok(ElementHeader { tag: ITEM, bytes: Some(bytes), .. }) = self.header(syntax) {
            if self.at + u64::from(bytes) > self.length {
                return Err("its pixels end early".into());
            }
            fragments.push(Span { offset: self.at, bytes });
            self.skip(bytes)?;
        }
        self.set.pixels = PixelData::Encapsulated(fragments);
        Ok(())
    }

    /// Attributes of an owner; `None` if its elements are not stored.
    fn owned(&mut self, owner: Owner) -> Option<&mut Attributes> {
        match owner {
            Owner::Root => Some(&mut self.set.root),
            Owner::Table => self.set.table.as_mut(),
            Owner::Shared => Some(&mut self.set.shared),
            Owner::Frame(at) => {
                let missing = (at + 1).max(self.set.frames.len());
                self.set.frames.resize_with(missing, Attributes::default);
                self.set.frames.get_mut(at)
            }
            Owner::SharedGroups | Owner::FrameGroups(_) | Owner::Nothing => None,
        }
    }

    fn header(&mut self, syntax: Syntax) -> Result<ElementHeader, String> {
        let short =
            |b: [u8; 2]| if syntax.big_endian { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) };
        let long = |b: [u8; 4]| if syntax.big_endian { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) };
        let tag = Tag(short(self.array()?), short(self.array()?));
        let (vr, bytes) = if tag.group() == 0xfffe || !syntax.is_explicit {
            let vr = StandardDataDictionary.by_tag(tag).map_or(VR::UN, |entry| entry.vr().relaxed());
            (vr, long(self.array()?))
        } else {
            let vr = VR::from_binary(self.array()?).unwrap_or(VR::UN);
            let length: [u8; 2] = self.array()?;
            match vr {
                VR::OB
                | VR::OD
                | VR::OF
                | VR::OL
                | VR::OV
                | VR::OW
                | VR::SQ
                | VR::SV
                | VR::UC
                | VR::UN
                | VR::UR
                | VR::UT
                | VR::UV => (vr, long(self.array()?)),
                _ => (vr, short(length).into()),
            }
        };
        Ok(ElementHeader { tag, vr, bytes: Some(bytes).filter(|bytes| *bytes != u32::MAX) })
    }

    /// Type of a value whose sign is that of the pixels.
    fn signed(&self, tag: Tag, vr: VR) -> VR {
        let follows_pixels =
            StandardDataDictionary.by_tag(tag).is_some_and(|entry| entry.vr() == VirtualVr::Xs);
        let is_signed = self.set.root.integer(tags::PIXEL_REPRESENTATION).is_some_and(|sign| sign != 0);
        if vr == VR::US && follows_pixels && is_signed { VR::SS } else { vr }
    }

    /// Whether the elements of the first item have types, against the standard.
    fn has_explicit_items(&mut self) -> Result<bool, String> {
        let mut start = [0; 14];
        let got = read_full(&mut self.input, &mut start).map_err(|e| e.to_string())?;
        self.seek(self.at)?;
        Ok(got == start.len() && VR::from_binary([start[12], start[13]]).is_some())
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut bytes = [0; N];
        self.input.read_exact(&mut bytes).map_err(|e| format!("it is damaged: {e}"))?;
        self.at += N as u64;
        Ok(bytes)
    }

    fn value(&mut self, bytes: u32) -> Result<Vec<u8>, String> {
        let mut value = vec![0; bytes as usize];
        self.input.read_exact(&mut value).map_err(|e| format!("it is damaged: {e}"))?;
        self.at += u64::from(bytes);
        Ok(value)
    }

    /// Byte at which an element of this length ends.
    fn check(&self, tag: Tag, bytes: u32) -> Result<u64, String> {
        let end = self.at + u64::from(bytes);
        if end > self.length {
            return Err(format!("its element {tag} ends beyond the file"));
        }
        Ok(end)
    }

    fn skip(&mut self, bytes: u32) -> Result<(), String> {
        self.input.seek_relative(bytes.into()).map_err(|e| e.to_string())?;
        self.at += u64::from(bytes);
        Ok(())
    }

    fn seek(&mut self, at: u64) -> Result<(), String> {
        self.at = self.input.seek(SeekFrom::Start(at)).map_err(|e| e.to_string())?;
        Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<DataSet, String> {
        let mut set = DataSet { syntax: EXPLICIT_LITTLE.into(), ..DataSet::default() };
        let length = bytes.len() as u64;
        Elements { input: &mut Cursor::new(bytes), at: 0, length, set: &mut set }.all()?;
        Ok(set)
    }

    const UNKNOWN: [u8; 12] = [9, 0, 1, 0x10, b'U', b'N', 0, 0, 0xff, 0xff, 0xff, 0xff];
    const START: [u8; 8] = [0xfe, 0xff, 0, 0xe0, 0xff, 0xff, 0xff, 0xff];
    const END: [u8; 8] = [0xfe, 0xff, 0x0d, 0xe0, 0, 0, 0, 0];
    const LAST: [u8; 8] = [0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0];
    const ROWS: [u8; 10] = [0x28, 0, 0x10, 0, b'U', b'S', 2, 0, 7, 0];

    #[test]
    fn sequences_of_unknown_type_are_skipped() {
        let implicit = [&[8, 0, 0x50, 0x11, 4, 0, 0, 0][..], b"1.2."].concat();
        let explicit = [&[8, 0, 0x50, 0x11, b'U', b'I', 4, 0][..], b"1.2."].concat();
        for element in [implicit, explicit] {
            let bytes = [&UNKNOWN[..], &START, &element, &END, &LAST, &ROWS].concat();
            assert_eq!(read(&bytes).unwrap().root.integer(tags::ROWS), Some(7));
        }
    }

    #[test]
    fn deep_nesting_is_refused() {
        let inner = [&START[..], &[9, 0, 1, 0x10, 0xff, 0xff, 0xff, 0xff]].concat();
        let bytes = [&UNKNOWN[..], &inner.repeat(10_000)].concat();
        assert!(read(&bytes).unwrap_err().contains("too deep"));
    }
}
