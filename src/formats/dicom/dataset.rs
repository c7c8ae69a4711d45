//! One DICOM file as far as a volume needs it: the attributes that place its frames, and where its pixels lie.
//!
//! The data set is walked token by token with the crate `dicom-parser`, and no value is read that is not wanted or is
//! longer than any wanted one: the crate's own reader of whole objects takes the memory that lengths in the file claim.

use super::unknown::Unknown;
use dicom_core::dictionary::DataDictionary;
use dicom_core::{DataElementHeader, PrimitiveValue, Tag};
use dicom_dictionary_std::{StandardDataDictionary, tags};
use dicom_encoding::TransferSyntaxIndex;
use dicom_parser::StatefulDecode;
use dicom_parser::dataset::LazyDataToken;
use dicom_parser::dataset::lazy_read::LazyDataSetReader;
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;
use flate2::read::DeflateDecoder;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

pub(super) const EXPLICIT_LITTLE: &str = "1.2.840.10008.1.2.1";
pub(super) const IMPLICIT_LITTLE: &str = "1.2.840.10008.1.2";
pub(super) const EXPLICIT_BIG: &str = "1.2.840.10008.1.2.2";
const DEFLATED: &str = "1.2.840.10008.1.2.1.99";

/// Bytes before the mark of a file, and the mark.
const PREAMBLE_BYTES: usize = 128;
const MARK: &[u8] = b"DICM";
/// No wanted value is longer, but for a table of values.
const VALUE_MOST_BYTES: u32 = 1 << 14;
const TABLE_MOST_BYTES: u32 = 1 << 17;
/// A data set of more elements is refused.
const ELEMENTS_MOST: usize = 4_000_000;
/// No series has more frames in a file.
pub(super) const FRAMES_MOST: usize = 1 << 16;
/// Sequences within each other beyond which a file is refused.
const DEPTH_MOST: usize = 64;
/// What a deflated data set may become.
const INFLATED_MOST_BYTES: u64 = 1 << 31;
/// ... and, beyond a small size, how many times its bytes: pixels of scanners pack to a third.
const INFLATED_MOST_RATIO: u64 = 100;
const INFLATED_SMALL_BYTES: u64 = 16 << 20;

/// Attributes that are kept; all others are passed over. Names and dates of people are not among them.
const WANTED: [Tag; 40] = [
    tags::SOP_CLASS_UID,
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
    tags::MODALITY_LUT_SEQUENCE,
    tags::LUT_DESCRIPTOR,
    tags::LUT_DATA,
    tags::FLOAT_PIXEL_PADDING_VALUE,
    tags::GRID_FRAME_OFFSET_VECTOR,
    tags::DOSE_GRID_SCALING,
    tags::IMAGE_TYPE,
    tags::FRAME_TYPE,
    tags::DIMENSION_INDEX_VALUES,
    tags::PATIENT_POSITION,
];

/// Sequences whose items' attributes are those of frames.
const OF_FRAMES: [Tag; 7] = [
    tags::PLANE_POSITION_SEQUENCE,
    tags::PLANE_ORIENTATION_SEQUENCE,
    tags::PIXEL_MEASURES_SEQUENCE,
    tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE,
    tags::FRAME_CONTENT_SEQUENCE,
    tags::CT_IMAGE_FRAME_TYPE_SEQUENCE,
    tags::TEMPORAL_POSITION_SEQUENCE,
];

/// Attributes by tag.
#[derive(Debug, Clone, Default)]
pub(super) struct Attributes(BTreeMap<Tag, PrimitiveValue>);

impl Attributes {
    /// Text without the blanks that fill it up.
    pub(super) fn text(&self, tag: Tag) -> Option<String> {
        let text = self.0.get(&tag)?.to_str();
        let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0').to_owned();
        (!text.is_empty()).then_some(text)
    }

    /// Finite numbers.
    pub(super) fn numbers(&self, tag: Tag) -> Option<Vec<f64>> {
        let numbers = self.0.get(&tag)?.to_multi_float64().ok()?;
        (!numbers.is_empty() && numbers.iter().all(|n| n.is_finite())).then_some(numbers)
    }

    pub(super) fn number(&self, tag: Tag) -> Option<f64> {
        self.numbers(tag).map(|all| all[0])
    }

    pub(super) fn whole(&self, tag: Tag) -> Option<i64> {
        self.0.get(&tag)?.to_int().ok()
    }

    /// Numbers of 16 bits.
    pub(super) fn words(&self, tag: Tag) -> Option<Vec<u16>> {
        self.0.get(&tag)?.to_multi_int().ok()
    }

    /// Decimals of the numbers, where they are texts without an exponent: so finely they were rounded.
    pub(super) fn decimals(&self, tag: Tag) -> Option<usize> {
        let PrimitiveValue::Strs(texts) = self.0.get(&tag)? else { return None };
        let of = |text: &String| match text.contains(['e', 'E']) {
            true => None,
            false => Some(text.trim().split_once('.').map_or(0, |(_, decimals)| decimals.len())),
        };
        texts.iter().map(of).try_fold(0, |most, decimals| Some(most.max(decimals?)))
    }

    pub(super) fn has(&self, tag: Tag) -> bool {
        self.0.contains_key(&tag)
    }
}

/// Bytes in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) offset: u64,
    pub(super) bytes: u32,
}

/// Where the pixels lie.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) enum PixelData {
    #[default]
    None,
    /// As they stand.
    Native(Span),
    /// Packed, in fragments; the first is the table of offsets.
    Encapsulated(Vec<Span>),
}

/// A file.
#[derive(Debug, Clone, Default)]
pub(super) struct DataSet {
    pub(super) syntax: String,
    pub(super) root: Attributes,
    /// Those of all frames, and of each.
    pub(super) shared: Attributes,
    pub(super) frames: Vec<Attributes>,
    pub(super) pixels: PixelData,
    /// Whether they are floats.
    pub(super) has_floats: bool,
    /// What the table of values says of itself.
    pub(super) table: Attributes,
    /// Where the file holds the data set deflated: from which byte on, and the data set itself, of which spans are. That is not
    /// kept where there is one frame, which is inflated anew.
    pub(super) deflated_from: Option<u64>,
    pub(super) inflated: Option<Vec<u8>>,
}

trait ReadSeek: Read + Seek {}
impl<T: Read + Seek> ReadSeek for T {}

/// Whether the first bytes of a file are those of a DICOM file, with its preamble or without.
pub(super) fn is_dicom(head: &[u8]) -> bool {
    head.get(PREAMBLE_BYTES..).is_some_and(|rest| rest.starts_with(MARK)) || bare_syntax(head).is_some()
}

/// The syntax of a data set without preamble and meta group, as scanners of the nineties wrote it: it begins with group 8.
fn bare_syntax(head: &[u8]) -> Option<&'static str> {
    let word = |at: usize| head.get(at..at + 4);
    let group = head.get(..2)?;
    if group == [2, 0] {
        return Some(EXPLICIT_LITTLE);
    }
    // Element 0 is the group's length; 5, 8, 0x16 and 0x18 come first otherwise.
    let known = |element: &[u8]| matches!(element, [0 | 1 | 5 | 8 | 0x16 | 0x18, 0]);
    match group {
        [8, 0] if known(head.get(2..4)?) => match word(4)? {
            [a @ b'A'..=b'Z', b @ b'A'..=b'Z', ..] => {
                matches!(&[*a, *b], b"UL" | b"CS" | b"UI" | b"SH" | b"LO").then_some(EXPLICIT_LITTLE)
            }
            [low, _, 0, 0] if low % 2 == 0 => Some(IMPLICIT_LITTLE),
            _ => None,
        },
        _ => None,
    }
}

impl DataSet {
    /// Reads one file up to the end of what says where its pixels lie.
    ///
    /// # Errors
    /// Why it is none, in words.
    pub(super) fn read(path: &Path) -> Result<Self, String> {
        let io_error = |e: io::Error| e.to_string();
        let file = File::open(path).map_err(io_error)?;
        let length = file.metadata().map_err(io_error)?.len();
        let mut input = BufReader::with_capacity(1 << 14, file);
        let mut head = [0; PREAMBLE_BYTES + 8];
        let got = crate::volume::element::read_full(&mut input, &mut head).map_err(io_error)?;
        let head = &head[..got];
        let start = match head.get(PREAMBLE_BYTES..).is_some_and(|rest| rest.starts_with(MARK)) {
            true => (PREAMBLE_BYTES + MARK.len()) as u64,
            false => 0,
        };
        let (syntax, at) = match (start, bare_syntax(head)) {
            (0, None) => return Err("it is not a DICOM file".into()),
            (0, Some(syntax)) if head.starts_with(&[8, 0]) => (syntax.to_owned(), 0),
            _ => meta(&mut input, start, length)?,
        };
        let mut set = Self { syntax, ..Self::default() };
        if set.syntax == DEFLATED {
            input.seek(SeekFrom::Start(at)).map_err(io_error)?;
            let mut inflated = Vec::new();
            let most = (INFLATED_MOST_RATIO * length.saturating_sub(at))
                .clamp(INFLATED_SMALL_BYTES, INFLATED_MOST_BYTES);
            DeflateDecoder::new(input).take(most).read_to_end(&mut inflated).map_err(io_error)?;
            set.syntax = EXPLICIT_LITTLE.into();
            let length = inflated.len() as u64;
            set.walk(&mut Cursor::new(&inflated[..]), 0, length)?;
            (set.deflated_from, set.inflated) = (Some(at), Some(inflated));
        } else {
            set.walk(&mut input, at, length)?;
        }
        Ok(set)
    }

    fn walk(&mut self, input: &mut dyn ReadSeek, at: u64, length: u64) -> Result<(), String> {
        let Some(syntax) = TransferSyntaxRegistry.get(&self.syntax) else {
            return Err(format!("its transfer syntax {} is not known", printable(&self.syntax)));
        };
        input.seek(SeekFrom::Start(at)).map_err(|e| e.to_string())?;
        let input = Unknown::new(input, self.syntax != IMPLICIT_LITTLE).map_err(|e| e.to_string())?;
        let mut reader = LazyDataSetReader::new_with_ts(input, syntax).map_err(|e| e.to_string())?;
        // Sequences that the present element lies in, items of the outermost one, and whether pixels have begun.
        let (mut path, mut item, mut packed) = (Vec::<Tag>::new(), 0usize, None::<Vec<Span>>);
        // Whether the pixels of an icon are being passed over.
        let mut in_icon = false;
        for _ in 0..ELEMENTS_MOST {
            let Some(token) = reader.advance() else { break };
            match token {
                // What follows the pixels may be damaged or cut; what precedes them may not.
                Err(_) if packed.is_some() => break,
                Err(e) => return Err(format!("it is damaged: {e}")),
                Ok(LazyDataToken::SequenceStart { tag, .. }) => {
                    if path.is_empty() {
                        item = 0;
                        if WANTED.contains(&tag) {
                            self.root.0.insert(tag, PrimitiveValue::Empty);
                        }
                    }
                    path.push(tag);
                    if path.len() > DEPTH_MOST {
                        return Err("its sequences lie too deep within each other".into());
                    }
                }
                Ok(LazyDataToken::SequenceEnd) if packed.is_some() => break,
                Ok(LazyDataToken::SequenceEnd) if in_icon => in_icon = false,
                Ok(LazyDataToken::SequenceEnd) => {
                    path.pop();
                }
                Ok(LazyDataToken::PixelSequenceStart) if path.is_empty() => packed = Some(Vec::new()),
                Ok(LazyDataToken::PixelSequenceStart) => in_icon = true,
                Ok(LazyDataToken::ItemStart { .. }) if in_icon => {}
                Ok(LazyDataToken::ItemStart { len }) => match &mut packed {
                    Some(fragments) => fragments.push(Span { offset: 0, bytes: len.get().unwrap_or(0) }),
                    None => item += usize::from(path.len() == 1),
                },
                Ok(LazyDataToken::LazyItemValue { len, decoder }) => {
                    let span = Span { offset: decoder.position(), bytes: len };
                    if span.offset.saturating_add(len.into()) > length {
                        return Err("its pixels end early".into());
                    }
                    if let Some(last) = packed.as_mut().and_then(|p| p.last_mut()) {
                        *last = span;
                    }
                    decoder.skip_bytes(len).map_err(|e| e.to_string())?;
                }
                Ok(LazyDataToken::LazyValue { header, decoder }) => {
                    if self.take(&header, decoder, &path, item, length)? {
                        return Ok(());
                    }
                }
                Ok(LazyDataToken::ElementHeader(_) | LazyDataToken::ItemEnd) => {}
                Ok(_) => {}
            }
        }
        if let Some(fragments) = packed {
            self.pixels = PixelData::Encapsulated(fragments);
        }
        Ok(())
    }

    /// Takes an element where it is wanted; whether the pixels begin with it.
    fn take<D: StatefulDecode>(
        &mut self,
        header: &DataElementHeader,
        decoder: &mut D,
        path: &[Tag],
        item: usize,
        length: u64,
    ) -> Result<bool, String> {
        let bytes = header.len.get().ok_or("an element of it has no length")?;
        let span = Span { offset: decoder.position(), bytes };
        if span.offset.saturating_add(bytes.into()) > length {
            return Err(format!("its element {} ends beyond the file", header.tag));
        }
        let floats = [tags::FLOAT_PIXEL_DATA, tags::DOUBLE_FLOAT_PIXEL_DATA];
        let has_floats = floats.contains(&header.tag);
        if (header.tag == tags::PIXEL_DATA || has_floats) && path.is_empty() {
            (self.pixels, self.has_floats) = (PixelData::Native(span), has_floats);
            return Ok(true);
        }
        if item > FRAMES_MOST {
            return Err(format!("it describes more than {FRAMES_MOST} frames"));
        }
        let is_table = header.tag == tags::LUT_DATA;
        let most = if is_table { TABLE_MOST_BYTES } else { VALUE_MOST_BYTES };
        match self.home(path, item).filter(|_| WANTED.contains(&header.tag)) {
            Some(home) if bytes <= most => {
                let value = decoder.read_value_preserved(header).map_err(|e| e.to_string())?;
                home.0.insert(header.tag, value);
            }
            _ => decoder.skip_bytes(bytes).map_err(|e| e.to_string())?,
        }
        Ok(false)
    }

    /// Where an attribute within these sequences belongs; `item` counts those of the outermost from 1.
    fn home(&mut self, path: &[Tag], item: usize) -> Option<&mut Attributes> {
        match path {
            [] => Some(&mut self.root),
            [tags::MODALITY_LUT_SEQUENCE] => Some(&mut self.table),
            [tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, inner] if OF_FRAMES.contains(inner) => {
                Some(&mut self.shared)
            }
            [tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, inner] if OF_FRAMES.contains(inner) => {
                let at = item.checked_sub(1)?;
                if self.frames.len() <= at {
                    self.frames.resize_with(at + 1, Attributes::default);
                }
                self.frames.get_mut(at)
            }
            _ => None,
        }
    }

    /// An attribute of a frame: its own, that of all frames, or the file's.
    pub(super) fn of_frame(&self, frame: usize, tag: Tag) -> Option<&Attributes> {
        let own = self.frames.get(frame).filter(|a| a.has(tag));
        own.or_else(|| Some(&self.shared).filter(|a| a.has(tag)))
            .or_else(|| Some(&self.root).filter(|a| a.has(tag)))
    }

    /// Reads bytes of the file, or of what it holds deflated.
    pub(super) fn bytes(&self, path: &Path, span: Span) -> Result<Vec<u8>, String> {
        if let Some(inflated) = &self.inflated {
            let from = span.offset as usize;
            let bytes = inflated.get(from..from.saturating_add(span.bytes as usize));
            return bytes.map(<[u8]>::to_vec).ok_or_else(|| "its pixels end early".into());
        }
        let io_error = |e: io::Error| e.to_string();
        let mut file = File::open(path).map_err(io_error)?;
        let mut bytes = Vec::new();
        let from = self.deflated_from.unwrap_or(span.offset);
        file.seek(SeekFrom::Start(from)).map_err(io_error)?;
        if self.deflated_from.is_some() {
            let mut inflating = DeflateDecoder::new(BufReader::new(file));
            io::copy(&mut inflating.by_ref().take(span.offset), &mut io::sink()).map_err(io_error)?;
            inflating.take(span.bytes.into()).read_to_end(&mut bytes).map_err(io_error)?;
        } else {
            file.take(span.bytes.into()).read_to_end(&mut bytes).map_err(io_error)?;
        }
        match bytes.len() == span.bytes as usize {
            true => Ok(bytes),
            false => Err("its pixels end early".into()),
        }
    }
}

/// The transfer syntax that the meta group names, and the byte at which the data set begins.
fn meta(input: &mut dyn ReadSeek, start: u64, length: u64) -> Result<(String, u64), String> {
    let explicit = TransferSyntaxRegistry.get(EXPLICIT_LITTLE).ok_or("no transfer syntaxes")?;
    input.seek(SeekFrom::Start(start)).map_err(|e| e.to_string())?;
    let mut reader = LazyDataSetReader::new_with_ts(input, explicit).map_err(|e| e.to_string())?;
    let (mut syntax, mut end) = (None, start);
    for _ in 0..1000 {
        // A header of the data set proper need not be readable in this syntax.
        let Some(Ok(token)) = reader.advance() else { break };
        match token {
            LazyDataToken::ElementHeader(header) if header.tag.group() != 2 => break,
            LazyDataToken::LazyValue { header, decoder } => {
                let bytes = header.len.get().ok_or("an element of its meta group has no length")?;
                if decoder.position().saturating_add(bytes.into()) > length {
                    return Err(format!("its element {} ends beyond the file", header.tag));
                }
                if header.tag == tags::TRANSFER_SYNTAX_UID && bytes <= 64 {
                    let value = decoder.read_value_preserved(&header).map_err(|e| e.to_string())?;
                    let text = value.to_str();
                    syntax = Some(text.trim_matches(|c: char| c.is_whitespace() || c == '\0').to_owned());
                } else {
                    decoder.skip_bytes(bytes).map_err(|e| e.to_string())?;
                }
                end = decoder.position();
            }
            _ => {}
        }
    }
    syntax.map(|s| (s, end)).ok_or_else(|| "it does not name its transfer syntax".into())
}

/// Letters, digits and points alone, so that nothing else of a file reaches a terminal.
pub(super) fn printable(text: &str) -> String {
    text.chars().filter(|c| c.is_ascii_alphanumeric() || " .,:;()+-_/%".contains(*c)).take(64).collect()
}

/// The name of an attribute, for people.
pub(super) fn name_of(tag: Tag) -> String {
    use dicom_core::dictionary::DataDictionaryEntry as _;
    StandardDataDictionary.by_tag(tag).map_or_else(|| tag.to_string(), |entry| entry.alias().to_owned())
}
