//! Reads the data elements of a DICOM file with the decoders of `dicom-encoding` and `dicom-parser`.
//!
//! The crate `dicom-object` is not used, because it allocates as much memory as a damaged file claims to need. It
//! also misreads sequences of unknown type (`UN` of undefined length), whose items are in the implicit syntax
//! (PS3.5, 6.2.2). Only the values of attributes that [`is_wanted`] selects are read, up to the length of the
//! longest valid value.

use super::attributes::{Attributes, is_padding};
use super::dataset::{DataSet, MAX_FRAMES, PixelData, Span, printable};
use crate::volume::read::read_full;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry as _, VirtualVr};
use dicom_core::header::DataElementHeader;
use dicom_core::{Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags, uids};
use dicom_encoding::decode::DecodeFrom as _;
use dicom_encoding::text::SpecificCharacterSet;
use dicom_encoding::{TransferSyntax, TransferSyntaxIndex};
use dicom_parser::{StatefulDecode as _, StatefulDecoder};
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;
use flate2::read::DeflateDecoder;
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Length of the DICOM preamble in bytes, and the magic word after it.
const PREAMBLE_BYTES: usize = 128;
const MAGIC: &[u8] = b"DICM";
/// Largest length of a DICOM attribute value that is read, in bytes: a lookup table of 65,536 numbers.
const MAX_VALUE_BYTES: u32 = 1 << 17;
/// Largest accepted nesting depth of DICOM sequences.
const MAX_DEPTH: usize = 64;
/// Limits for inflating a deflated DICOM data set: largest size in bytes, largest ratio to the deflated size, and a
/// size that is always allowed.
const MAX_INFLATED_BYTES: u64 = 1 << 31;
const MAX_INFLATED_RATIO: u64 = 100;
const SMALL_INFLATED_BYTES: u64 = 16 << 20;

/// Group numbers of the DICOM attributes that describe images and segmentations.
const IMAGE_GROUPS: [u16; 6] = [0x0008, 0x0018, 0x0020, 0x0028, 0x0062, 0x3004];

/// Whether the value of a DICOM attribute is read. Only numbers, codes, identifiers, the series description, the
/// rescale type and labels of segments are read; names of people and dates are never read.
fn is_wanted(tag: Tag, vr: VR) -> bool {
    use VR::{CS, DS, FD, FL, IS, OB, OW, SL, SS, UI, UL, UN, US};
    let is_number = matches!(vr, CS | DS | FD | FL | IS | OB | OW | SL | SS | UI | UL | UN | US);
    let is_text = [tags::SERIES_DESCRIPTION, tags::RESCALE_TYPE, tags::SEGMENT_LABEL].contains(&tag);
    IMAGE_GROUPS.contains(&tag.group()) && (is_number || is_text)
}

/// Tags that delimit the items of DICOM sequences.
const ITEM: Tag = Tag(0xfffe, 0xe000);
const ITEM_END: Tag = Tag(0xfffe, 0xe00d);
const SEQUENCE_END: Tag = Tag(0xfffe, 0xe0dd);

/// DICOM sequences that are read with their items if they stand at the root of a DICOM file.
const ITEM_SEQUENCES: [Tag; 4] = [
    tags::MODALITY_LUT_SEQUENCE,
    tags::SEGMENT_SEQUENCE,
    tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE,
    tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE,
];

/// DICOM sequences inside a functional group that describe an image frame. Their attributes are stored as if they
/// stood directly in the functional group.
const FRAME_SEQUENCES: [Tag; 8] = [
    tags::SEGMENT_IDENTIFICATION_SEQUENCE,
    tags::PLANE_POSITION_SEQUENCE,
    tags::PLANE_ORIENTATION_SEQUENCE,
    tags::PIXEL_MEASURES_SEQUENCE,
    tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE,
    tags::FRAME_CONTENT_SEQUENCE,
    tags::CT_IMAGE_FRAME_TYPE_SEQUENCE,
    tags::TEMPORAL_POSITION_SEQUENCE,
];

/// Whether the first bytes of a file are those of a DICOM file, with or without the preamble.
pub(super) fn is_dicom(head: &[u8]) -> bool {
    head.get(PREAMBLE_BYTES..).is_some_and(|rest| rest.starts_with(MAGIC)) || bare_syntax(head).is_some()
}

/// Recognises a DICOM file without preamble by its first bytes, and returns the transfer syntax of its first
/// elements. Scanners of the 1990s wrote such files, which start with group 2 or 8.
fn bare_syntax(head: &[u8]) -> Option<&'static str> {
    // Element 0 is the group's length; the others are those that come first without it.
    match head.get(..8)? {
        [2, 0, ..] => Some(uids::EXPLICIT_VR_LITTLE_ENDIAN),
        [8, 0, 0 | 1 | 5 | 8 | 0x16 | 0x18, 0, rest @ ..] => match rest {
            [b'A'..=b'Z', b'A'..=b'Z', ..] => [b"UL", b"CS", b"UI", b"SH", b"LO"]
                .contains(&&[rest[0], rest[1]])
                .then_some(uids::EXPLICIT_VR_LITTLE_ENDIAN),
            [low, _, 0, 0] if low % 2 == 0 => Some(uids::IMPLICIT_VR_LITTLE_ENDIAN),
            _ => None,
        },
        _ => None,
    }
}

impl DataSet {
    /// Reads the attributes of a DICOM file and the byte positions of its pixel data.
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
        let mut elements =
            Elements { input: &mut input, at: start as u64, length, is_signed: false, set: &mut set };
        let syntax = match bare.filter(|_| !has_preamble && head[0] == 8) {
            Some(bare) => bare.to_owned(),
            None => elements.meta()?,
        };
        let at = elements.at;
        set.syntax = syntax;
        if set.syntax == uids::DEFLATED_EXPLICIT_VR_LITTLE_ENDIAN {
            let limit = (MAX_INFLATED_RATIO * length.saturating_sub(at))
                .clamp(SMALL_INFLATED_BYTES, MAX_INFLATED_BYTES);
            let mut inflated = Vec::new();
            DeflateDecoder::new(input).take(limit).read_to_end(&mut inflated).map_err(io_error)?;
            set.syntax = uids::EXPLICIT_VR_LITTLE_ENDIAN.into();
            let length = inflated.len() as u64;
            Elements {
                input: &mut Cursor::new(&inflated[..]),
                at: 0,
                length,
                is_signed: false,
                set: &mut set,
            }
            .all()?;
            (set.deflated_from, set.inflated) = (Some(at), Some(inflated));
        } else {
            Elements { input: &mut input, at, length, is_signed: false, set: &mut set }.all()?;
        }
        Ok(set)
    }
}

/// Reader of the data elements of a DICOM file.
struct Elements<'a, R> {
    input: &'a mut R,
    at: u64,
    length: u64,
    /// Whether pixels are signed according to the DICOM attribute PixelRepresentation; false until this attribute is
    /// read.
    is_signed: bool,
    set: &'a mut DataSet,
}

/// Finds a DICOM transfer syntax by its UID.
fn syntax_of(uid: &str) -> Result<&'static TransferSyntax, String> {
    let found = TransferSyntaxRegistry.get(uid);
    found.ok_or_else(|| format!("its transfer syntax {} is not known", printable(uid)))
}

impl<R: Read + Seek> Elements<'_, R> {
    /// Reads all elements of a DICOM data set up to the pixel data.
    fn all(&mut self) -> Result<(), String> {
        let syntax = syntax_of(&self.set.syntax)?;
        self.seek(self.at)?;
        let mut root = Attributes::default();
        self.elements(self.length, syntax, 0, Some(&mut root))?;
        self.set.root = root;
        Ok(())
    }

    /// Reads the DICOM file meta group and returns the UID of the transfer syntax.
    fn meta(&mut self) -> Result<String, String> {
        let (mut syntax, explicit) = (None, syntax_of(uids::EXPLICIT_VR_LITTLE_ENDIAN)?);
        loop {
            let from = self.at;
            // A header of the data set itself need not be readable in this syntax.
            let header = self.header(explicit).ok().filter(|header| header.tag.group() == 2);
            let Some(header) = header else {
                self.seek(from)?;
                return syntax.ok_or_else(|| "it does not name its transfer syntax".into());
            };
            let bytes = header.len.get().ok_or("an element of its meta group has no length")?;
            self.check(header.tag, bytes)?;
            if header.tag == tags::TRANSFER_SYNTAX_UID && bytes <= 64 {
                let text = String::from_utf8_lossy(&self.value(bytes)?).into_owned();
                syntax = Some(text.trim_matches(is_padding).to_owned());
            } else {
                self.skip(bytes)?;
            }
        }
    }

    /// Reads DICOM elements until one of three ends: byte `end`, the end of an item of undefined length, or the pixel
    /// data.
    fn elements(
        &mut self,
        end: u64,
        syntax: &TransferSyntax,
        depth: usize,
        mut into: Option<&mut Attributes>,
    ) -> Result<(), String> {
        while self.at < end && self.set.pixels == PixelData::None {
            let header = self.header(syntax)?;
            let (tag, vr, bytes, is_root) = (header.tag, header.vr, header.len.get(), depth == 0);
            let has_floats = [tags::FLOAT_PIXEL_DATA, tags::DOUBLE_FLOAT_PIXEL_DATA].contains(&tag);
            match bytes {
                _ if tag == ITEM_END => return Ok(()),
                None if tag == tags::PIXEL_DATA && is_root => return self.fragments(syntax),
                None if vr == VR::UN && !self.has_explicit_items()? => {
                    let implicit = syntax_of(uids::IMPLICIT_VR_LITTLE_ENDIAN)?;
                    self.sequence(&header, implicit, depth + 1, into.as_deref_mut())?;
                }
                None => self.sequence(&header, syntax, depth + 1, into.as_deref_mut())?,
                Some(_) if vr == VR::SQ => self.sequence(&header, syntax, depth + 1, into.as_deref_mut())?,
                Some(bytes) => {
                    self.check(tag, bytes)?;
                    if is_root && (tag == tags::PIXEL_DATA || has_floats) {
                        self.set.pixels = PixelData::Native(Span { offset: self.at, bytes });
                        self.set.has_floats = has_floats;
                    } else if let Some(into) = &mut into
                        && bytes <= MAX_VALUE_BYTES
                        && is_wanted(tag, vr)
                    {
                        let header = DataElementHeader { vr: self.signed(tag, vr), ..header };
                        let value = self.value(bytes)?;
                        let text = SpecificCharacterSet::default();
                        let value = StatefulDecoder::new_with(&value[..], syntax, text, 0)
                            .and_then(|mut decoder| decoder.read_value_preserved(&header));
                        // An attribute with an invalid value counts as missing.
                        value.ok().map(|value| into.values.insert(tag, value));
                        if is_root && tag == tags::PIXEL_REPRESENTATION {
                            self.is_signed = into.integer(tag).is_some_and(|sign| sign != 0);
                        }
                    } else {
                        self.skip(bytes)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Reads the items of a DICOM sequence, or skips the sequence if the volume reader does not need it.
    fn sequence(
        &mut self,
        header: &DataElementHeader,
        syntax: &TransferSyntax,
        depth: usize,
        mut into: Option<&mut Attributes>,
    ) -> Result<(), String> {
        if depth > MAX_DEPTH {
            return Err("its sequences are nested too deeply".into());
        }
        let end = header.len.get().map_or(Ok(self.length), |bytes| self.check(header.tag, bytes))?;
        let has_items = depth == 1 && ITEM_SEQUENCES.contains(&header.tag);
        let is_of_frame = depth == 2 && FRAME_SEQUENCES.contains(&header.tag);
        for number in 0.. {
            if self.at >= end {
                break;
            }
            let item = self.header(syntax)?;
            match item.tag {
                SEQUENCE_END => break,
                ITEM => {}
                _ => return Err("it is damaged: a sequence holds something else than items".into()),
            }
            let inner = match &mut into {
                Some(_) if has_items && number >= MAX_FRAMES => {
                    return Err(format!("it describes more than {MAX_FRAMES} frames"));
                }
                Some(all) if has_items => {
                    let items = all.items.entry(header.tag).or_default();
                    items.push(Attributes::default());
                    items.last_mut()
                }
                Some(all) if is_of_frame => Some(&mut **all),
                _ => None,
            };
            match item.len.get() {
                Some(bytes) => {
                    let end = self.check(item.tag, bytes)?;
                    match inner {
                        Some(_) => self.elements(end, syntax, depth, inner)?,
                        // Fragments of an icon's pixels are items without elements.
                        None => self.skip(bytes)?,
                    }
                }
                None => self.elements(end, syntax, depth, inner)?,
            }
        }
        Ok(())
    }

    /// Reads the byte positions of the fragments of compressed DICOM pixel data. Stops at the first damaged item
    /// header.
    fn fragments(&mut self, syntax: &TransferSyntax) -> Result<(), String> {
        let mut fragments = Vec::new();
        while let Ok(DataElementHeader { tag: ITEM, len, .. }) = self.header(syntax)
            && let Some(bytes) = len.get()
        {
            if self.at + u64::from(bytes) > self.length {
                return Err("its pixels end early".into());
            }
            fragments.push(Span { offset: self.at, bytes });
            self.skip(bytes)?;
        }
        self.set.pixels = PixelData::Encapsulated(fragments);
        Ok(())
    }

    fn header(&mut self, syntax: &TransferSyntax) -> Result<DataElementHeader, String> {
        let decoder = syntax.decoder_for::<R>().ok_or("its transfer syntax cannot be decoded")?;
        let (header, bytes) = decoder.decode_header(self.input).map_err(|e| format!("it is damaged: {e}"))?;
        self.at += bytes as u64;
        Ok(header)
    }

    /// Returns the value representation (VR) of a DICOM attribute. If the attribute is signed exactly when the pixels
    /// are, unsigned `US` becomes signed `SS` for signed pixels.
    fn signed(&self, tag: Tag, vr: VR) -> VR {
        let follows_pixels =
            StandardDataDictionary.by_tag(tag).is_some_and(|entry| entry.vr() == VirtualVr::Xs);
        if vr == VR::US && follows_pixels && self.is_signed { VR::SS } else { vr }
    }

    /// Whether the items of a DICOM sequence of type `UN` have explicit VRs, which violates the standard.
    fn has_explicit_items(&mut self) -> Result<bool, String> {
        let mut start = [0; 14];
        let got = read_full(&mut self.input, &mut start).map_err(|e| e.to_string())?;
        self.seek(self.at)?;
        Ok(got == start.len() && VR::from_binary([start[12], start[13]]).is_some())
    }

    fn value(&mut self, bytes: u32) -> Result<Vec<u8>, String> {
        let mut value = vec![0; bytes as usize];
        self.input.read_exact(&mut value).map_err(|e| format!("it is damaged: {e}"))?;
        self.at += u64::from(bytes);
        Ok(value)
    }

    /// Returns the byte offset of the end of a DICOM element whose value has `bytes` bytes; an error if it is beyond
    /// the file.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<DataSet, String> {
        let mut set = DataSet { syntax: uids::EXPLICIT_VR_LITTLE_ENDIAN.into(), ..DataSet::default() };
        let length = bytes.len() as u64;
        Elements { input: &mut Cursor::new(bytes), at: 0, length, is_signed: false, set: &mut set }.all()?;
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
