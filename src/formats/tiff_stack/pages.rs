//! Reads the pages of TIFF files: first counts all pages, then decodes the pages of one frame of the volume.

use super::description::{Description, Order};
use crate::files::loading::Pieces;
use crate::formats::assembly::Assembly;
use crate::volume::Voxels;
use ndarray::Array3;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

/// Largest accepted ratio of decoded to compressed TIFF bytes.
const MAX_RATIO: u64 = 1032;

/// TIFF file and its number of pages.
struct CountedFile {
    path: PathBuf,
    pages: usize,
}

/// Pages of the TIFF files of a stack, numbered through all files.
#[derive(Default)]
pub(super) struct Pages {
    size: Option<(u32, u32)>,
    files: Vec<CountedFile>,
    pub(super) count: usize,
    pub(super) description: Option<Description>,
}

fn text(e: tiff::TiffError) -> String {
    e.to_string()
}

/// Opens a TIFF decoder with a memory limit in proportion to the file size.
fn open(path: &Path) -> Result<(Decoder<BufReader<File>>, u64), String> {
    let file = File::open(path).map_err(|e| e.to_string())?;
    let file_bytes = file.metadata().map_err(|e| e.to_string())?.len();
    let mut limits = Limits::default();
    limits.decoding_buffer_size = usize::try_from(file_bytes.saturating_mul(MAX_RATIO)).unwrap_or(usize::MAX);
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    limits.ifd_value_size = limits.ifd_value_size.max(usize::try_from(file_bytes).unwrap_or(usize::MAX));
    Ok((Decoder::new(BufReader::new(file)).map_err(text)?.with_limits(limits), file_bytes))
}

impl Pages {
    /// Counts the pages of a TIFF file and adds the file to the TIFF stack.
    ///
    /// # Errors
    /// The TIFF file cannot be read, holds colours, or has a page whose size differs from the first page.
    pub(super) fn add(&mut self, path: &Path, pieces: &Pieces<'_>) -> Result<(), String> {
        let (mut decoder, file_bytes) = open(path)?;
        let (mut claimed, mut pages) = (0u64, 0);
        loop {
            if pieces.is_cancelled() {
                return Err("it was cancelled".into());
            }
            let size = decoder.dimensions().map_err(text)?;
            match decoder.colortype().map_err(text)? {
                ColorType::Gray(8 | 16 | 32 | 64) => {}
                ColorType::Gray(bits) => {
                    return Err(format!("its pixels have {bits} bits; 8, 16, 32 and 64 are supported"));
                }
                _ => return Err("its pixels are colours; scalars are needed".into()),
            }
            if *self.size.get_or_insert(size) != size {
                let (width, height) = self.size.unwrap_or_default();
                let page = self.count + pages;
                return Err(format!("page {page} is {}x{}, and the first {width}x{height}", size.0, size.1));
            }
            if self.description.is_none() {
                self.description = Some(Description::new(&mut decoder));
            }
            // Uncompressed pages do not share bytes, and compressed ones rarely do.
            let is_plain =
                decoder.find_tag_unsigned::<u16>(Tag::Compression).ok().flatten().unwrap_or(1) == 1;
            let share = if is_plain { MAX_RATIO } else { 1 };
            claimed = claimed.saturating_add(share * u64::from(size.0) * u64::from(size.1));
            if claimed > file_bytes.saturating_mul(MAX_RATIO) {
                return Err(format!("more pixels are claimed than {file_bytes} bytes can hold"));
            }
            pages += 1;
            if !decoder.more_images() {
                break;
            }
            decoder.next_image().map_err(text)?;
        }
        self.count += pages;
        self.files.push(CountedFile { path: path.into(), pages });
        Ok(())
    }

    /// Decodes the voxels of one frame of a TIFF stack.
    ///
    /// # Errors
    /// A page cannot be read, its pixel type differs from the first page, or the host has too little memory.
    pub(super) fn voxels(&self, order: &Order, frame: usize, pieces: &Pieces<'_>) -> Result<Voxels, String> {
        let (width, height) = self.size.ok_or("it has no pages")?;
        let mut stack = Assembly::new([width as usize, height as usize, order.slices]);
        let mut slices: Vec<(usize, usize)> = (0..order.slices).map(|z| (order.page(z, frame), z)).collect();
        slices.sort_unstable();
        let mut slices = slices.into_iter().peekable();
        let mut before = 0;
        for file in &self.files {
            let named = |why: String| {
                format!("{}: {why}", file.path.file_name().unwrap_or_default().to_string_lossy())
            };
            let mut decoder = None;
            while let Some((page, z)) = slices.next_if(|(page, _)| *page < before + file.pages) {
                if pieces.is_cancelled() {
                    return Err("it was cancelled".into());
                }
                let decoder = match &mut decoder {
                    Some(decoder) => decoder,
                    none => none.insert(open(&file.path)?.0),
                };
                decoder.seek_to_image(page - before).map_err(text).map_err(named)?;
                let page = decoder.read_image().map_err(text).map_err(named)?;
                let page = page_voxels(page, width as usize, height as usize).map_err(named)?;
                stack.put(page, [0, 0, z]).map_err(named)?;
                pieces.done();
            }
            before += file.pages;
        }
        stack.finish().ok_or_else(|| "it has no pages".into())
    }
}

/// Converts the pixels of one TIFF page to voxels.
fn page_voxels(page: DecodingResult, width: usize, height: usize) -> Result<Voxels, String> {
    macro_rules! voxels {
        ($pixels:expr, $stored:ty) => {{
            let (count, pixels) = ($pixels.len(), $pixels.into_iter().map(<$stored>::from).collect());
            let array = Array3::from_shape_vec((1, height, width), pixels);
            let mismatch = |_| format!("a page of it has {count} pixels, not {}", width * height);
            array.map(Voxels::from).map_err(mismatch)
        }};
    }
    match page {
        DecodingResult::U8(pixels) => voxels!(pixels, u8),
        DecodingResult::U16(pixels) => voxels!(pixels, u16),
        DecodingResult::I8(pixels) => voxels!(pixels, i16),
        DecodingResult::I16(pixels) => voxels!(pixels, i16),
        DecodingResult::F16(pixels) => voxels!(pixels, f32),
        DecodingResult::F32(pixels) => voxels!(pixels, f32),
        DecodingResult::F64(pixels) => voxels!(pixels, f64),
        DecodingResult::U32(pixels) => voxels!(pixels, f64),
        DecodingResult::I32(pixels) => voxels!(pixels, f64),
        DecodingResult::U64(_) | DecodingResult::I64(_) => {
            Err("its pixels are 64-bit integers, which are not supported".into())
        }
    }
}
