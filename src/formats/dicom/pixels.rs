//! Pixels of a frame: as they stand, or unpacked by the crate of their transfer syntax.

use super::dataset::{DataSet, EXPLICIT_BIG, PixelData, Span, printable};
use crate::volume::element::Element;
use jpeg_decoder::PixelFormat;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// How the pixels of a file are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Layout {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Bits that a pixel takes: 8, 16 or 32; of floats 32 or 64.
    pub(super) allocated: u32,
    /// Bits of them that are its value, and the highest of these.
    pub(super) stored: u32,
    pub(super) high: u32,
    pub(super) is_signed: bool,
    /// Pixels are floats, and what is said of bits above is not about them.
    pub(super) is_float: bool,
}

impl Layout {
    pub(super) fn pixels(&self) -> usize {
        self.rows * self.columns
    }

    pub(super) fn frame_bytes(&self) -> usize {
        self.pixels() * (self.allocated / 8) as usize
    }

    /// Smallest and largest value that a pixel can have.
    pub(super) fn range(&self) -> [i64; 2] {
        match self.is_signed {
            true => [-(1 << (self.stored - 1)), (1 << (self.stored - 1)) - 1],
            false => [0, (1 << self.stored) - 1],
        }
    }

    /// A pixel by all its bits, those beyond the stored ones, too.
    pub(super) fn whole(&self, pixel: u32) -> i64 {
        let bits = self.allocated;
        match self.is_signed && pixel >> (bits - 1) & 1 == 1 {
            true => i64::from(pixel) - (1 << bits),
            false => pixel.into(),
        }
    }

    /// The value in the low bits of a pixel: what lies above and below it (overlays, in old files) goes.
    pub(super) fn value(&self, pixel: u32) -> i64 {
        let shifted = i64::from(pixel >> (self.high + 1 - self.stored));
        let value = shifted & ((1 << self.stored) - 1);
        match self.is_signed && value >> (self.stored - 1) == 1 {
            true => value - (1 << self.stored),
            false => value,
        }
    }
}

/// A transfer syntax with packed pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Codec {
    Rle,
    Jpeg,
    JpegLs,
    Jpeg2000,
}

/// What can be unpacked, all by code without `unsafe` foreign parts: RLE, JPEG (8 bits, and lossless up to 16), JPEG-LS and
/// JPEG 2000.
const CODECS: [(&str, Codec); 9] = [
    ("1.2.840.10008.1.2.5", Codec::Rle),
    ("1.2.840.10008.1.2.4.50", Codec::Jpeg),
    ("1.2.840.10008.1.2.4.51", Codec::Jpeg),
    ("1.2.840.10008.1.2.4.57", Codec::Jpeg),
    ("1.2.840.10008.1.2.4.70", Codec::Jpeg),
    ("1.2.840.10008.1.2.4.80", Codec::JpegLs),
    ("1.2.840.10008.1.2.4.81", Codec::JpegLs),
    ("1.2.840.10008.1.2.4.90", Codec::Jpeg2000),
    ("1.2.840.10008.1.2.4.91", Codec::Jpeg2000),
];

/// Syntaxes that lose some of the value.
const LOSSY: [&str; 4] =
    ["1.2.840.10008.1.2.4.50", "1.2.840.10008.1.2.4.51", "1.2.840.10008.1.2.4.81", "1.2.840.10008.1.2.4.91"];

/// Packed frames may hold so many times their bytes; an even picture packs far better than any other.
const MOST_RATIO: u64 = 4000;
/// ... and this much whatever they take.
const SMALL_BYTES: u64 = 2 << 20;

/// What is to be said of a transfer syntax, where values were lost.
pub(super) fn warning_of(syntax: &str) -> Option<&'static str> {
    LOSSY
        .contains(&syntax)
        .then_some("its pixels are packed with loss: values are near those of the scanner, not the same")
}

/// Where each frame of a file lies: one span for native pixels, one or more fragments for packed ones.
///
/// # Errors
/// The pixels are not there, fewer than said, or packed in a way that cannot be read.
pub(super) fn spans(
    path: &Path,
    set: &DataSet,
    layout: &Layout,
    frames: usize,
) -> Result<Vec<Vec<Span>>, String> {
    let bytes = layout.frame_bytes();
    match &set.pixels {
        PixelData::None => Err("it has no pixels".into()),
        PixelData::Native(span) => {
            let wanted = (bytes as u64).checked_mul(frames as u64);
            if wanted.is_none_or(|wanted| wanted > span.bytes.into()) {
                let Layout { rows, columns, allocated, .. } = layout;
                return Err(format!(
                    "{frames} x {rows} x {columns} pixels of {allocated} bits are claimed, and it holds {} bytes",
                    span.bytes
                ));
            }
            let at = |frame: usize| span.offset + (frame * bytes) as u64;
            Ok((0..frames).map(|f| vec![Span { offset: at(f), bytes: bytes as u32 }]).collect())
        }
        PixelData::Encapsulated(fragments) => {
            codec(&set.syntax)?;
            let table =
                fragments.first().map(|table| set.bytes(path, *table)).transpose()?.unwrap_or_default();
            let spans = encapsulated(fragments, frames, &table)?;
            let packed: u64 = fragments.iter().map(|f| u64::from(f.bytes)).sum();
            let claimed = (bytes as u64).saturating_mul(frames as u64);
            if claimed > packed.saturating_mul(MOST_RATIO).max(SMALL_BYTES) {
                return Err(format!("{claimed} bytes of pixels are claimed to be packed in {packed}"));
            }
            Ok(spans)
        }
    }
}

/// Fragments of each frame: all of one frame, one each, or by the table of offsets, which counts from the first fragment's
/// item on.
fn encapsulated(fragments: &[Span], frames: usize, table: &[u8]) -> Result<Vec<Vec<Span>>, String> {
    let data = fragments.get(1..).unwrap_or_default();
    let Some(first) = data.first() else { return Err("it has no pixels".into()) };
    if frames == 1 {
        return Ok(vec![data.to_vec()]);
    }
    if data.len() == frames {
        return Ok(data.iter().map(|span| vec![*span]).collect());
    }
    let starts: Vec<u64> = table.as_chunks().0.iter().map(|&word| u32::from_le_bytes(word).into()).collect();
    let mut of_frames: Vec<Vec<Span>> = vec![Vec::new(); frames];
    for span in data {
        let at = span.offset - first.offset;
        // The last frame that begins no later.
        match starts.partition_point(|start| *start <= at) {
            frame if (1..=frames).contains(&frame) && starts.len() == frames => {
                of_frames[frame - 1].push(*span)
            }
            _ => {
                let n = data.len();
                return Err(format!("its {frames} frames are cut into {n} fragments, and no table says how"));
            }
        }
    }
    match of_frames.iter().any(Vec::is_empty) {
        true => Err("its table of offsets leaves frames without pixels".into()),
        false => Ok(of_frames),
    }
}

fn codec(syntax: &str) -> Result<Codec, String> {
    CODECS.iter().find(|(uid, _)| *uid == syntax).map(|(_, codec)| *codec).ok_or_else(|| {
        let name = dicom_name(syntax);
        format!("its pixels are packed as {name}; RLE, JPEG, JPEG-LS and JPEG 2000 can be read")
    })
}

fn dicom_name(syntax: &str) -> String {
    use dicom_encoding::TransferSyntaxIndex as _;
    dicom_transfer_syntax_registry::TransferSyntaxRegistry
        .get(syntax)
        .map_or_else(|| printable(syntax), |found| found.name().to_owned())
}

/// The pixels of one frame, each as `convert` makes it of all its bits, into `out` of as many.
///
/// # Errors
/// The pixels cannot be read or unpacked.
pub(super) fn read_frame<T>(
    path: &Path,
    set: &DataSet,
    layout: &Layout,
    spans: &[Span],
    out: &mut [T],
    convert: impl Fn(u32) -> T,
) -> Result<(), String> {
    let mut bytes = Vec::new();
    for span in spans {
        bytes.extend_from_slice(&set.bytes(path, *span)?);
    }
    let is_native = matches!(set.pixels, PixelData::Native(_));
    let pixels: Vec<u32> = match is_native {
        true => {
            let big = set.syntax == EXPLICIT_BIG;
            words(&bytes, layout.allocated, big)
        }
        false => unpacked(codec(&set.syntax)?, &bytes, layout)?,
    };
    if pixels.len() < out.len() {
        return Err(format!("it holds {} pixels a frame, not {}", pixels.len(), out.len()));
    }
    for (value, pixel) in out.iter_mut().zip(pixels) {
        *value = convert(pixel);
    }
    Ok(())
}

/// The pixels of one frame of floats into `out` of as many.
///
/// # Errors
/// They cannot be read.
pub(super) fn read_floats(
    path: &Path,
    set: &DataSet,
    layout: &Layout,
    spans: &[Span],
    out: &mut [f64],
) -> Result<(), String> {
    let bytes = spans.iter().map(|span| set.bytes(path, *span)).collect::<Result<Vec<_>, _>>()?.concat();
    let element = if layout.allocated == 64 { Element::F64 } else { Element::F32 };
    if bytes.len() < out.len() * element.bytes() {
        return Err("its pixels end early".into());
    }
    let is_big = set.syntax == EXPLICIT_BIG;
    for (value, word) in out.iter_mut().zip(bytes.chunks_exact(element.bytes())) {
        let mut stored = [0; 8];
        stored[..word.len()].copy_from_slice(word);
        if is_big {
            stored[..word.len()].reverse();
        }
        *value = match element {
            Element::F64 => f64::from_le_bytes(stored),
            _ => f32::from_bits(u64::from_le_bytes(stored) as u32).into(),
        };
    }
    Ok(())
}

fn words(bytes: &[u8], allocated: u32, big: bool) -> Vec<u32> {
    match (allocated, big) {
        (8, _) => bytes.iter().map(|&b| b.into()).collect(),
        (16, false) => bytes.as_chunks().0.iter().map(|&b| u16::from_le_bytes(b).into()).collect(),
        (16, true) => bytes.as_chunks().0.iter().map(|&b| u16::from_be_bytes(b).into()).collect(),
        (_, false) => bytes.as_chunks().0.iter().map(|&b| u32::from_le_bytes(b)).collect(),
        (_, true) => bytes.as_chunks().0.iter().map(|&b| u32::from_be_bytes(b)).collect(),
    }
}

/// Pixels in the low bits of words, as many as a frame has.
fn unpacked(codec: Codec, bytes: &[u8], layout: &Layout) -> Result<Vec<u32>, String> {
    if codec == Codec::Rle {
        return rle(bytes, layout);
    }
    // A decoder that meets what it did not think of must not end the program.
    let decoded = catch_unwind(AssertUnwindSafe(|| match codec {
        Codec::Jpeg => jpeg(bytes, layout),
        Codec::JpegLs => jpeg_ls(bytes, layout),
        Codec::Jpeg2000 | Codec::Rle => jpeg_2000(bytes, layout),
    }));
    decoded.unwrap_or_else(|_| Err("its pixels are damaged: the decoder gave up".into()))
}

fn another_size(width: usize, height: usize, layout: &Layout) -> Result<(), String> {
    match [height, width] == [layout.rows, layout.columns] {
        true => Ok(()),
        false => {
            Err(format!("its packed pixels are {width}x{height}, not {}x{}", layout.columns, layout.rows))
        }
    }
}

fn jpeg(bytes: &[u8], layout: &Layout) -> Result<Vec<u32>, String> {
    let mut decoder = jpeg_decoder::Decoder::new(bytes);
    decoder.set_max_decoding_buffer_size(4 * layout.frame_bytes() + 4096);
    decoder.read_info().map_err(|e| e.to_string())?;
    let info = decoder.info().ok_or("its pixels have no JPEG header")?;
    another_size(info.width.into(), info.height.into(), layout)?;
    let bytes = decoder.decode().map_err(|e| e.to_string())?;
    match info.pixel_format {
        PixelFormat::L8 => Ok(words(&bytes, 8, false)),
        PixelFormat::L16 => {
            Ok(bytes.as_chunks().0.iter().map(|&b| u32::from(u16::from_ne_bytes(b))).collect())
        }
        _ => Err("its pixels are colours; scalars are needed".into()),
    }
}

fn jpeg_ls(bytes: &[u8], layout: &Layout) -> Result<Vec<u32>, String> {
    let (pixels, width, height) =
        jpegls::decode(bytes, layout.columns as u32, layout.rows as u32).map_err(|e| e.to_string())?;
    another_size(width as usize, height as usize, layout)?;
    Ok(pixels.into_iter().map(u32::from).collect())
}

fn jpeg_2000(bytes: &[u8], layout: &Layout) -> Result<Vec<u32>, String> {
    let settings = hayro_jpeg2000::DecodeSettings { strict: true, ..Default::default() };
    let image = hayro_jpeg2000::Image::new(bytes, &settings).map_err(|e| e.to_string())?;
    another_size(image.width() as usize, image.height() as usize, layout)?;
    let mut context = hayro_jpeg2000::DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(|e| e.to_string())?;
    let [component] = decoded.components() else {
        return Err("its pixels are colours; scalars are needed".into());
    };
    // The decoder makes signed samples unsigned, as it does those that were: the shift goes, and in two's complement they are
    // those of a native frame.
    let shift = if is_signed(bytes) { 1i32 << (component.bit_depth() - 1) } else { 0 };
    Ok(component.samples().iter().map(|&v| (v.round() as i32 - shift) as u32).collect())
}

/// Whether the first component of a JPEG 2000 codestream is signed: the high bit of its depth in the SIZ marker.
fn is_signed(bytes: &[u8]) -> bool {
    const SIZ: [u8; 4] = [0xff, 0x4f, 0xff, 0x51];
    // Behind the markers: two words of 16 bits, eight of 32, one of 16.
    const DEPTH: usize = SIZ.len() + 2 * 2 + 8 * 4 + 2;
    let start = bytes.windows(SIZ.len()).take(4096).position(|w| w == SIZ);
    start.and_then(|at| bytes.get(at + DEPTH)).is_some_and(|depth| depth & 0x80 != 0)
}

/// PackBits by planes of bytes, the most significant one first (PS3.5, annex G). Written here, since the crates' own decoders
/// believe the offsets of the segments.
fn rle(bytes: &[u8], layout: &Layout) -> Result<Vec<u32>, String> {
    let damaged = || String::from("its RLE segments are damaged");
    let long = |at: usize| -> Option<usize> {
        let word = bytes.get(4 * at..4 * at + 4)?;
        Some(u32::from_le_bytes([word[0], word[1], word[2], word[3]]) as usize)
    };
    let planes = (layout.allocated / 8) as usize;
    if long(0) != Some(planes) {
        return Err(format!("it has {} RLE segments, not {planes}", long(0).unwrap_or(0)));
    }
    let mut pixels = vec![0u32; layout.pixels()];
    for plane in 0..planes {
        let from = long(1 + plane).ok_or_else(damaged)?;
        let to = if plane + 1 < planes { long(2 + plane).ok_or_else(damaged)? } else { bytes.len() };
        let mut segment = bytes.get(from..to).ok_or_else(damaged)?;
        let shift = 8 * (planes - 1 - plane);
        let mut at = 0;
        let put = |pixels: &mut [u32], at: &mut usize, byte: u8, times: usize| {
            for pixel in pixels.iter_mut().skip(*at).take(times) {
                *pixel |= u32::from(byte) << shift;
            }
            *at += times;
        };
        while let [code, rest @ ..] = segment
            && at < layout.pixels()
        {
            let count = usize::from(*code) + 1;
            segment = match code {
                0..=127 => {
                    let (run, rest) = rest.split_at_checked(count).ok_or_else(damaged)?;
                    run.iter().for_each(|&byte| put(&mut pixels, &mut at, byte, 1));
                    rest
                }
                128 => rest,
                129..=255 => {
                    let (byte, rest) = rest.split_first().ok_or_else(damaged)?;
                    put(&mut pixels, &mut at, *byte, 257 - usize::from(*code));
                    rest
                }
            };
        }
        if at < layout.pixels() {
            return Err(damaged());
        }
    }
    Ok(pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fragments_belong_to_frames_by_the_table() {
        let span = |offset| Span { offset, bytes: 10 };
        // Items have eight bytes in front of ten.
        let fragments = [span(0), span(100), span(118), span(136)];
        let table: Vec<u8> = [0u32, 36].into_iter().flat_map(u32::to_le_bytes).collect();
        let frames = encapsulated(&fragments, 2, &table).unwrap();
        assert_eq!(frames, [vec![span(100), span(118)], vec![span(136)]]);
        assert!(
            encapsulated(&fragments, 2, &[]).is_err() && encapsulated(&fragments, 2, &table[..4]).is_err()
        );
        assert_eq!(encapsulated(&fragments, 3, &[]).unwrap().len(), 3);
        assert!(encapsulated(&fragments[..1], 1, &[]).is_err());
    }

    #[test]
    fn overlays_and_signs_are_told_from_values() {
        let layout = |stored, high, is_signed| Layout {
            rows: 1,
            columns: 1,
            allocated: 16,
            stored,
            high,
            is_signed,
            is_float: false,
        };
        assert_eq!(layout(12, 11, false).value(0xf123), 0x123);
        assert_eq!(layout(12, 11, true).value(0x0fff), -1);
        assert_eq!(layout(12, 15, false).value(0x1230), 0x123);
        assert_eq!(layout(16, 15, true).value(0x8000), -32768);
        assert_eq!(layout(12, 11, true).range(), [-2048, 2047]);
    }
}
