//! The pages of TIFF files: counted first, then those of one frame are unpacked, each to where it belongs.

use super::description::{Description, Order};
use crate::files::loading::Pieces;
use crate::files::memory_budget::refuse_beyond_host;
use crate::volume::Voxels;
use ndarray::Array3;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

/// No packing of TIFF makes a byte into more.
const MOST_RATIO: u64 = 1032;

/// A file, and what is known of its pages.
struct Counted {
    path: PathBuf,
    pages: usize,
}

/// The pages of some files, one after the other.
#[derive(Default)]
pub(super) struct Pages {
    size: Option<(u32, u32)>,
    files: Vec<Counted>,
    pub(super) count: usize,
    pub(super) description: Option<Description>,
}

fn said(e: tiff::TiffError) -> String {
    e.to_string()
}

/// A decoder that takes no more memory than the bytes of its file can hold.
fn open(path: &Path) -> Result<(Decoder<BufReader<File>>, u64), String> {
    let file = File::open(path).map_err(|e| e.to_string())?;
    let file_bytes = file.metadata().map_err(|e| e.to_string())?.len();
    let mut limits = Limits::default();
    limits.decoding_buffer_size =
        usize::try_from(file_bytes.saturating_mul(MOST_RATIO)).unwrap_or(usize::MAX);
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    limits.ifd_value_size = limits.ifd_value_size.max(usize::try_from(file_bytes).unwrap_or(usize::MAX));
    Ok((Decoder::new(BufReader::new(file)).map_err(said)?.with_limits(limits), file_bytes))
}

impl Pages {
    /// Counts the pages of a file after those of the ones before it.
    ///
    /// # Errors
    /// It cannot be read, holds colours, or has pages of another size.
    pub(super) fn add(&mut self, path: &Path, pieces: &Pieces<'_>) -> Result<(), String> {
        let (mut decoder, file_bytes) = open(path)?;
        let (mut claimed, mut pages) = (0u64, 0);
        loop {
            if pieces.is_cancelled() {
                return Err("it was cancelled".into());
            }
            let size = decoder.dimensions().map_err(said)?;
            match decoder.colortype().map_err(said)? {
                ColorType::Gray(8 | 16 | 32 | 64) => {}
                ColorType::Gray(bits) => {
                    return Err(format!("its pixels have {bits} bits; 8, 16, 32 and 64 are read"));
                }
                _ => return Err("its pixels are colours; scalars are needed".into()),
            }
            if *self.size.get_or_insert(size) != size {
                let (width, height) = self.size.unwrap_or_default();
                let page = self.count + pages;
                return Err(format!("page {page} is {}x{}, and the first {width}x{height}", size.0, size.1));
            }
            if self.description.is_none() {
                self.description = Some(Description::of(&mut decoder));
            }
            // Pages may share bytes; plain ones do not, and packed ones not many times.
            let is_plain =
                decoder.find_tag_unsigned::<u16>(Tag::Compression).ok().flatten().unwrap_or(1) == 1;
            let share = if is_plain { MOST_RATIO } else { 1 };
            claimed = claimed.saturating_add(share * u64::from(size.0) * u64::from(size.1));
            if claimed > file_bytes.saturating_mul(MOST_RATIO) {
                return Err(format!("more pixels are claimed than {file_bytes} bytes can hold"));
            }
            pages += 1;
            if !decoder.more_images() {
                break;
            }
            decoder.next_image().map_err(said)?;
        }
        self.count += pages;
        self.files.push(Counted { path: path.into(), pages });
        Ok(())
    }

    /// The voxels of a frame, and what their type is called.
    ///
    /// # Errors
    /// A page that cannot be read or is of another type than the first; the host cannot hold them.
    pub(super) fn voxels(
        &self,
        order: &Order,
        frame: usize,
        pieces: &Pieces<'_>,
    ) -> Result<(Voxels, &'static str), String> {
        let (width, height) = self.size.ok_or("it has no pages")?;
        let (nx, ny, nz) = (width as usize, height as usize, order.slices);
        let mut stack = Stack { page: nx * ny, slices: nz, values: None };
        let mut slices: Vec<(usize, usize)> = (0..nz).map(|z| (order.page(z, frame), z)).collect();
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
                decoder.seek_to_image(page - before).map_err(said).map_err(named)?;
                let unpacked = decoder.read_image().map_err(said).map_err(named)?;
                stack.put(unpacked, z).map_err(named)?;
                pieces.done();
            }
            before += file.pages;
        }
        stack.finish([nx, ny, nz])
    }
}

enum Values {
    U8(Vec<u8>),
    I16(Vec<i16>),
    U16(Vec<u16>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Voxels that are being put together.
struct Stack {
    /// Pixels of a page.
    page: usize,
    slices: usize,
    values: Option<Values>,
}

impl Stack {
    /// Puts a page where slice `z` is.
    fn put(&mut self, page: DecodingResult, z: usize) -> Result<(), String> {
        let (from, to) = (z * self.page, (z + 1) * self.page);
        let whole =
            self.page.checked_mul(self.slices).ok_or("more voxels than can be counted are claimed")?;
        macro_rules! put {
            ($kind:ident($kept:ty), $page:expr, $convert:expr) => {{
                let page = $page;
                if page.len() != self.page {
                    return Err(format!("a page of it has {} pixels, not {}", page.len(), self.page));
                }
                if self.values.is_none() {
                    refuse_beyond_host(whole.checked_mul(size_of::<$kept>()).map(|n| n as u64))?;
                    // Zeros take no memory until they are written over.
                    self.values = Some(Values::$kind(vec![<$kept>::default(); whole]));
                }
                let Some(Values::$kind(all)) = &mut self.values else {
                    return Err("its pages are of several types".into());
                };
                all[from..to].iter_mut().zip(page).for_each(|(voxel, pixel)| *voxel = $convert(pixel));
            }};
        }
        macro_rules! keep {
            ($kind:ident($kept:ty), $page:expr) => {{
                let page = $page;
                // A page that is all of it is moved, not copied.
                if self.slices == 1 && page.len() == whole {
                    self.values = Some(Values::$kind(page));
                } else {
                    put!($kind($kept), page, |v| v);
                }
            }};
        }
        match page {
            DecodingResult::U8(page) => keep!(U8(u8), page),
            DecodingResult::U16(page) => keep!(U16(u16), page),
            DecodingResult::I8(page) => put!(I16(i16), page, i16::from),
            DecodingResult::I16(page) => keep!(I16(i16), page),
            DecodingResult::F32(page) => keep!(F32(f32), page),
            DecodingResult::F16(page) => put!(F32(f32), page, half::f16::to_f32),
            DecodingResult::F64(page) => keep!(F64(f64), page),
            DecodingResult::U32(page) => put!(F64(f64), page, f64::from),
            DecodingResult::I32(page) => put!(F64(f64), page, f64::from),
            DecodingResult::U64(_) | DecodingResult::I64(_) => {
                return Err("its pixels are 64-bit integers, which are not read".into());
            }
        }
        Ok(())
    }

    fn finish(self, [nx, ny, nz]: [usize; 3]) -> Result<(Voxels, &'static str), String> {
        macro_rules! array {
            ($values:expr, $name:expr) => {{
                let array = Array3::from_shape_vec((nz, ny, nx), $values).map_err(|e| e.to_string())?;
                Ok((Voxels::from(array), $name))
            }};
        }
        match self.values.ok_or("it has no pages")? {
            Values::U8(values) => array!(values, "uint8"),
            Values::I16(values) => array!(values, "int16"),
            Values::U16(values) => array!(values, "uint16"),
            Values::F32(values) => array!(values, "float32"),
            Values::F64(values) => array!(values, "float64"),
        }
    }
}
