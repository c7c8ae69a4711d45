//! Decodes the pixels of DICOM frames: uncompressed, or compressed as RLE, JPEG, JPEG-LS or JPEG 2000.

use super::dataset::{DataSet, PixelData, Span, printable};
use dicom_dictionary_std::uids;
use dicom_encoding::TransferSyntaxIndex as _;
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;
use jpeg_decoder::{Error as JpegError, PixelFormat, UnsupportedFeature};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Pixel format of a DICOM file: image size, bit depth, sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Layout {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Bits allocated for a pixel in a DICOM file (BitsAllocated): 8, 16 or 32; 32 or 64 for floats.
    pub(super) allocated: u32,
    /// Number of bits that hold an integer pixel value of a DICOM file (BitsStored), and the index of the highest of
    /// these bits (HighBit).
    pub(super) stored: u32,
    pub(super) high: u32,
    pub(super) is_signed: bool,
    pub(super) is_float: bool,
}

impl Layout {
    pub(super) fn pixels(&self) -> usize {
        self.rows * self.columns
    }

    pub(super) fn frame_bytes(&self) -> usize {
        self.pixels() * (self.allocated / 8) as usize
    }

    /// Returns the smallest and largest possible value of an integer DICOM pixel.
    pub(super) fn range(&self) -> [i64; 2] {
        match self.is_signed {
            true => [-(1 << (self.stored - 1)), (1 << (self.stored - 1)) - 1],
            false => [0, (1 << self.stored) - 1],
        }
    }

    /// Returns the integer value of a DICOM pixel from all its allocated bits (BitsAllocated).
    pub(super) fn allocated_value(&self, pixel: u64) -> i64 {
        self.low_bits(pixel, self.allocated)
    }

    /// Returns the integer value of a DICOM pixel from its stored bits (BitsStored). Ignores overlay bits, which old
    /// files store in the unused bits.
    pub(super) fn value(&self, pixel: u64) -> i64 {
        self.low_bits(pixel >> (self.high + 1 - self.stored), self.stored)
    }

    fn low_bits(&self, word: u64, bits: u32) -> i64 {
        let value = (word & ((1 << bits) - 1)) as i64;
        if self.is_signed && value >> (bits - 1) == 1 { value - (1 << bits) } else { value }
    }

    /// Returns the value of a floating-point DICOM pixel.
    pub(super) fn float(&self, pixel: u64) -> f64 {
        if self.allocated == 64 { f64::from_bits(pixel) } else { f32::from_bits(pixel as u32).into() }
    }
}

/// Reason why the voxels of a DICOM series cannot be read, with the index of the image file to blame, if any.
pub(super) struct Fault {
    pub(super) image: Option<usize>,
    pub(super) why: String,
}

impl Fault {
    /// Blames an image file of a series.
    pub(super) fn of_image(at: usize, path: &Path, why: &str) -> Self {
        Self { image: Some(at), why: format!("{}: {why}", path.display()) }
    }
}

impl From<String> for Fault {
    fn from(why: String) -> Self {
        Self { image: None, why }
    }
}

/// Compression method of DICOM pixel data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Codec {
    Rle,
    Jpeg,
    JpegLs,
    Jpeg2000,
}

/// Supported compressed transfer syntaxes of DICOM, each with its decoder and whether it is lossy. RLE, JPEG (8 bits,
/// and lossless up to 16), JPEG-LS and JPEG 2000 have decoders in Rust.
const CODECS: [(&str, Codec, bool); 9] = [
    (uids::RLE_LOSSLESS, Codec::Rle, false),
    (uids::JPEG_BASELINE8_BIT, Codec::Jpeg, true),
    (uids::JPEG_EXTENDED12_BIT, Codec::Jpeg, true),
    (uids::JPEG_LOSSLESS, Codec::Jpeg, false),
    (uids::JPEG_LOSSLESS_SV1, Codec::Jpeg, false),
    (uids::JPEGLS_LOSSLESS, Codec::JpegLs, false),
    (uids::JPEGLS_NEAR_LOSSLESS, Codec::JpegLs, true),
    (uids::JPEG2000_LOSSLESS, Codec::Jpeg2000, false),
    (uids::JPEG2000, Codec::Jpeg2000, true),
];

/// UID of the retired DICOM transfer syntax Explicit VR Big Endian.
const EXPLICIT_BIG: &str = "1.2.840.10008.1.2.2";
/// Largest accepted ratio of decoded to compressed DICOM pixel bytes, and a decoded size that is always accepted.
/// Uniform images compress best.
const MAX_RATIO: u64 = 4000;
const SMALL_BYTES: u64 = 2 << 20;

/// Returns a warning if a DICOM transfer syntax is lossy.
pub(super) fn lossy_warning(syntax: &str) -> Option<&'static str> {
    let is_lossy = CODECS.iter().any(|(uid, _, is_lossy)| *uid == syntax && *is_lossy);
    is_lossy
        .then_some("its pixels are compressed with loss: values are near those of the scanner, not the same")
}

/// Finds the byte ranges of the pixels of each DICOM frame: one range if uncompressed, otherwise one or more
/// fragments.
///
/// # Errors
/// The file has no pixels or fewer than it claims, or an unsupported method compresses them.
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
            if claimed > packed.saturating_mul(MAX_RATIO).max(SMALL_BYTES) {
                return Err(format!("{claimed} bytes of pixels are claimed to be compressed to {packed}"));
            }
            Ok(spans)
        }
    }
}

/// Assigns the fragments of compressed DICOM pixel data to frames. A single frame takes all fragments. Otherwise each
/// frame takes one fragment, or the Basic Offset Table gives the fragments of each frame.
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
        match starts.partition_point(|start| *start <= at) {
            frame if (1..=frames).contains(&frame) && starts.len() == frames => {
                of_frames[frame - 1].push(*span)
            }
            _ => {
                let n = data.len();
                return Err(format!(
                    "its {frames} frames are cut into {n} fragments without a usable table of offsets"
                ));
            }
        }
    }
    match of_frames.iter().any(Vec::is_empty) {
        true => Err("its table of offsets leaves frames without pixels".into()),
        false => Ok(of_frames),
    }
}

fn codec(syntax: &str) -> Result<Codec, String> {
    CODECS.iter().find(|(uid, ..)| *uid == syntax).map(|(_, codec, _)| *codec).ok_or_else(|| {
        let found = TransferSyntaxRegistry.get(syntax);
        let name = found.map_or_else(|| printable(syntax), |found| found.name().to_owned());
        format!("its pixels are compressed as {name}; RLE, JPEG, JPEG-LS and JPEG 2000 can be read")
    })
}

/// Reads the pixels of a DICOM frame into `out`; `convert` maps the bits of a pixel to its value.
///
/// # Errors
/// The pixels cannot be read or decoded, or are fewer than `out` holds.
pub(super) fn read_frame(
    path: &Path,
    set: &DataSet,
    layout: &Layout,
    spans: &[Span],
    out: &mut [f64],
    convert: impl Fn(u64) -> f64,
) -> Result<(), String> {
    let bytes = spans.iter().map(|span| set.bytes(path, *span)).collect::<Result<Vec<_>, _>>()?.concat();
    let pixels: Vec<u64> = match set.pixels {
        PixelData::Native(_) => words(&bytes, layout.allocated, set.syntax == EXPLICIT_BIG),
        _ => decoded(codec(&set.syntax)?, &bytes, layout)?,
    };
    if pixels.len() < out.len() {
        return Err(format!("it holds {} pixels a frame, not {}", pixels.len(), out.len()));
    }
    out.iter_mut().zip(pixels).for_each(|(value, pixel)| *value = convert(pixel));
    Ok(())
}

/// Splits the bytes of DICOM pixel data into unsigned integers of `bits` bits each.
fn words(bytes: &[u8], bits: u32, big_endian: bool) -> Vec<u64> {
    let word = |bytes: &[u8]| {
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        if big_endian {
            word[..bytes.len()].reverse();
        }
        u64::from_le_bytes(word)
    };
    bytes.chunks_exact((bits / 8) as usize).map(word).collect()
}

/// Decodes a compressed DICOM frame. Each pixel is in the low bits of a 64-bit word.
fn decoded(codec: Codec, bytes: &[u8], layout: &Layout) -> Result<Vec<u64>, String> {
    if codec == Codec::Rle {
        return rle(bytes, layout);
    }
    // A panic of a decoder must not end the program.
    let decoded = catch_unwind(AssertUnwindSafe(|| match codec {
        Codec::Jpeg => jpeg(bytes, layout),
        Codec::JpegLs => jpeg_ls(bytes, layout),
        Codec::Jpeg2000 | Codec::Rle => jpeg_2000(bytes, layout),
    }));
    decoded.unwrap_or_else(|_| Err("its pixels are damaged: the decoder gave up".into()))
}

fn check_size(width: usize, height: usize, layout: &Layout) -> Result<(), String> {
    match [height, width] == [layout.rows, layout.columns] {
        true => Ok(()),
        false => {
            Err(format!("its compressed pixels are {width}x{height}, not {}x{}", layout.columns, layout.rows))
        }
    }
}

fn jpeg(bytes: &[u8], layout: &Layout) -> Result<Vec<u64>, String> {
    let mut decoder = jpeg_decoder::Decoder::new(bytes);
    decoder.set_max_decoding_buffer_size(4 * layout.frame_bytes() + 4096);
    decoder.read_info().map_err(|e| match e {
        JpegError::Unsupported(UnsupportedFeature::SamplePrecision(bits)) => format!(
            "its pixels are lossy JPEG of {bits} bits, and only 8 are read; `gdcmconv --raw` or `dcmdjpeg` \
             writes them without compression"
        ),
        e => e.to_string(),
    })?;
    let info = decoder.info().ok_or("its pixels have no JPEG header")?;
    check_size(info.width.into(), info.height.into(), layout)?;
    let bytes = decoder.decode().map_err(|e| e.to_string())?;
    match info.pixel_format {
        PixelFormat::L8 => Ok(words(&bytes, 8, false)),
        PixelFormat::L16 => Ok(words(&bytes, 16, cfg!(target_endian = "big"))),
        _ => Err("its pixels are colours; scalars are needed".into()),
    }
}

fn jpeg_ls(bytes: &[u8], layout: &Layout) -> Result<Vec<u64>, String> {
    let (pixels, width, height) =
        jpegls::decode(bytes, layout.columns as u32, layout.rows as u32).map_err(|e| e.to_string())?;
    check_size(width as usize, height as usize, layout)?;
    Ok(pixels.into_iter().map(u64::from).collect())
}

fn jpeg_2000(bytes: &[u8], layout: &Layout) -> Result<Vec<u64>, String> {
    let settings = hayro_jpeg2000::DecodeSettings { strict: true, ..Default::default() };
    let image = hayro_jpeg2000::Image::new(bytes, &settings).map_err(|e| e.to_string())?;
    check_size(image.width() as usize, image.height() as usize, layout)?;
    let mut context = hayro_jpeg2000::DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(|e| e.to_string())?;
    let [component] = decoded.components() else {
        return Err("its pixels are colours; scalars are needed".into());
    };
    // The decoder adds half the range to signed samples. Without that offset they are in two's complement,
    // like native pixels.
    let shift = if is_signed(bytes) { 1i32 << (component.bit_depth() - 1) } else { 0 };
    Ok(component.samples().iter().map(|&v| u64::from((v.round() as i32 - shift) as u32)).collect())
}

/// Whether the first component of a JPEG 2000 codestream is signed (high bit of its depth in the SIZ marker).
fn is_signed(bytes: &[u8]) -> bool {
    const SIZ: [u8; 4] = [0xff, 0x4f, 0xff, 0x51];
    // Behind the markers: two words of 16 bits, eight of 32, one of 16.
    const DEPTH: usize = SIZ.len() + 2 * 2 + 8 * 4 + 2;
    let start = bytes.windows(SIZ.len()).take(4096).position(|w| w == SIZ);
    start.and_then(|at| bytes.get(at + DEPTH)).is_some_and(|depth| depth & 0x80 != 0)
}

/// Decodes DICOM RLE: byte planes, the most significant one first (PS3.5, annex G).
///
/// The decoder of `dicom-transfer-syntax-registry` panics on wrong segment offsets.
fn rle(bytes: &[u8], layout: &Layout) -> Result<Vec<u64>, String> {
    let damaged = || String::from("its RLE segments are damaged");
    let planes = (layout.allocated / 8) as usize;
    let header = bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word) as usize);
    let header: Vec<usize> = header.take(1 + planes).collect();
    let count = header.first().copied().unwrap_or(0);
    if count != planes || header.len() <= planes {
        return Err(format!("it has {count} RLE segments, not {planes}"));
    }
    let mut pixels = vec![0u64; layout.pixels()];
    for (plane, from) in header.iter().enumerate().skip(1) {
        let to = header.get(plane + 1).copied().unwrap_or(bytes.len());
        let plane = bytes.get(*from..to).and_then(|packed| unpacked(packed, pixels.len()));
        let plane = plane.ok_or_else(damaged)?;
        pixels.iter_mut().zip(plane).for_each(|(pixel, byte)| *pixel = *pixel << 8 | u64::from(byte));
    }
    Ok(pixels)
}

/// Decodes PackBits run-length data to `count` bytes; `None` if the data end early.
fn unpacked(mut packed: &[u8], count: usize) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    while out.len() < count {
        let (code, rest) = packed.split_first()?;
        let code = usize::from(*code);
        packed = match code {
            0..128 => {
                let (run, rest) = rest.split_at_checked(code + 1)?;
                out.extend_from_slice(run);
                rest
            }
            128 => rest,
            _ => {
                let (byte, rest) = rest.split_first()?;
                out.resize(out.len() + 257 - code, *byte);
                rest
            }
        };
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_table_assigns_fragments_to_frames() {
        let span = |offset| Span { offset, bytes: 10 };
        // Each fragment follows an item header of eight bytes.
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

    fn layout(stored: u32, high: u32, is_signed: bool) -> Layout {
        Layout { rows: 1, columns: 1, allocated: 16, stored, high, is_signed, is_float: false }
    }

    #[test]
    fn lossy_jpeg_of_12_bits_is_refused_with_a_remedy() {
        // Start of image, and a frame header (SOF1, extended sequential) of one component with 1 x 1 pixels of 12 bits.
        let frame = [0xff, 0xc1, 0, 11, 12, 0, 1, 0, 1, 1, 1, 0x11, 0];
        let image = [&[0xff, 0xd8][..], &frame, &[0xff, 0xd9]].concat();
        let why = decoded(Codec::Jpeg, &image, &layout(12, 11, false)).unwrap_err();
        assert!(why.contains("lossy JPEG of 12 bits, and only 8 are read"), "{why}");
        assert!(why.contains("`gdcmconv --raw`") && why.contains("`dcmdjpeg`"), "{why}");
    }

    #[test]
    fn overlays_are_removed_and_signs_extended() {
        assert_eq!(layout(12, 11, false).value(0xf123), 0x123);
        assert_eq!(layout(12, 11, true).value(0x0fff), -1);
        assert_eq!(layout(12, 15, false).value(0x1230), 0x123);
        assert_eq!(layout(16, 15, true).value(0x8000), -32768);
        assert_eq!(layout(12, 11, true).range(), [-2048, 2047]);
    }
}
