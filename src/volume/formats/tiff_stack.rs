//! TIFF: a multi-page file, or a folder of files of one page each; grey values of 8, 16 and 32 bits.
//!
//! Pages are slices, the first one at index 0, files in the order of the numbers in their names. Voxel sizes are those that
//! ImageJ writes or an OME header has; a resolution alone is what a printer would take, and is not used.

use super::frames::picked;
use super::head::Head;
use crate::error::{Error, Result};
use crate::files::loading::{Loading, Pieces, ReadingStage};
use crate::volume::{Provenance, Scaling, Volume, Voxels};
use glam::{DAffine3, DVec3};
use ndarray::Array3;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use tiff::ColorType;
use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

/// File-name endings of the format.
pub const EXTENSIONS: &[&str] = &["tif", "tiff"];

const MAGICS: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];

/// No packing of TIFF makes a byte into more.
const MOST_RATIO: u64 = 1032;

/// Whether a file is of this format, or a folder holds files that are named so.
pub fn is_tiff(head: &Head) -> bool {
    match head.is_folder() {
        true => !files_in(head.path()).is_empty(),
        false => !head.is_packed() && MAGICS.iter().any(|magic| head.starts_with(magic)),
    }
}

/// The files that a path stands for, in the order of their slices.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    if path.is_dir() { files_in(path) } else { vec![path.into()] }
}

/// Reads one frame (0 is the first); `spacing_mm` wins over what the file says.
///
/// # Errors
/// A file that cannot be read, holds colours, or has pages of several sizes.
pub fn read_with(
    path: &Path,
    frame: usize,
    spacing_mm: Option<[f64; 3]>,
    loading: &Loading,
) -> Result<Volume> {
    let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
    let files = files_of(path);
    let mut pages = Pages::default();
    let pieces = loading.pieces(ReadingStage::Reading, files.len());
    for file in &files {
        pages.add(file, &pieces).map_err(|why| Error::input("cannot read volume", file.display(), why))?;
        pieces.done();
        loading.go_on(&path.display().to_string())?;
    }
    let mut warnings = Vec::new();
    let description = pages.description.take().unwrap_or_default();
    let order = Order::of(&description.text, pages.count).map_err(refuse)?;
    warnings.extend(picked(path, frame, order.frames())?);
    let spacing = spacing_mm.or_else(|| description.spacing_mm()).unwrap_or_else(|| {
        warnings.push("no --spacing given: voxels taken as 1 mm".into());
        [1.0; 3]
    });
    let stored_type = pages.stored_type();
    let voxels = pages.into_voxels(&order, frame).map_err(refuse)?;
    let provenance = Provenance {
        frames: order.frames(),
        frame,
        warnings,
        ..Provenance::new(path.display().to_string(), "tiff", stored_type)
    };
    let world_from_index = DAffine3::from_scale(DVec3::from_array(spacing));
    Volume::new_with(voxels, description.scaling(), world_from_index, provenance, loading)
}

/// Files of a folder that are named as this format, by the numbers in their names.
fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let named =
        |p: &PathBuf| p.extension().is_some_and(|e| EXTENSIONS.iter().any(|x| e.eq_ignore_ascii_case(x)));
    let mut files: Vec<PathBuf> = entries.filter(|p| named(p) && p.is_file()).collect();
    files.sort_by_cached_key(|p| natural(&p.file_name().unwrap_or_default().to_string_lossy()));
    files
}

/// A name cut into words and numbers, so that `slice10` follows after `slice9`.
fn natural(name: &str) -> Vec<(u128, String)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let word = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let (text, after) = rest.split_at(word);
        let digits = after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len());
        let (number, after) = after.split_at(digits);
        parts.push((0, text.to_lowercase()));
        parts.push((number.parse().unwrap_or(u128::MAX), String::new()));
        rest = after;
    }
    parts
}

/// Pages read so far, one after the other.
#[derive(Default)]
struct Pages {
    size: Option<(u32, u32)>,
    values: Option<Values>,
    count: usize,
    description: Option<Description>,
}

enum Values {
    U8(Vec<u8>),
    I16(Vec<i16>),
    U16(Vec<u16>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Pages {
    fn add(&mut self, path: &Path, pieces: &Pieces<'_>) -> Result<(), String> {
        let file = File::open(path).map_err(|e| e.to_string())?;
        let file_bytes = file.metadata().map_err(|e| e.to_string())?.len();
        let most = file_bytes.saturating_mul(MOST_RATIO);
        let mut limits = Limits::default();
        limits.decoding_buffer_size = usize::try_from(most).unwrap_or(usize::MAX);
        limits.intermediate_buffer_size = limits.decoding_buffer_size;
        limits.ifd_value_size = limits.ifd_value_size.max(usize::try_from(file_bytes).unwrap_or(usize::MAX));
        let said = |e: tiff::TiffError| e.to_string();
        let mut decoder = Decoder::new(BufReader::new(file)).map_err(said)?.with_limits(limits);
        let mut read_bytes = 0u64;
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
                return Err(format!(
                    "page {} is {}x{}, and the first {width}x{height}",
                    self.count, size.0, size.1
                ));
            }
            if self.description.is_none() {
                self.description = Some(Description::of(&mut decoder));
            }
            // Pages may share bytes; plain ones do not, and packed ones not many times.
            let is_plain =
                decoder.find_tag_unsigned::<u16>(Tag::Compression).ok().flatten().unwrap_or(1) == 1;
            let share = if is_plain { MOST_RATIO } else { 1 };
            read_bytes = read_bytes.saturating_add(share * u64::from(size.0) * u64::from(size.1));
            if read_bytes > most {
                return Err(format!("more pixels are claimed than {file_bytes} bytes can hold"));
            }
            self.append(decoder.read_image().map_err(said)?)?;
            self.count += 1;
            if !decoder.more_images() {
                return Ok(());
            }
            decoder.next_image().map_err(said)?;
        }
    }

    fn append(&mut self, page: DecodingResult) -> Result<(), String> {
        macro_rules! append {
            ($kind:ident, $page:expr) => {
                match self.values.get_or_insert_with(|| Values::$kind(Vec::new())) {
                    Values::$kind(all) => {
                        let page = $page;
                        all.try_reserve(page.len()).map_err(|_| "not enough memory for the voxels")?;
                        all.extend(page);
                    }
                    _ => return Err("its pages are of several types".into()),
                }
            };
        }
        match page {
            DecodingResult::U8(v) => append!(U8, v),
            DecodingResult::U16(v) => append!(U16, v),
            DecodingResult::I8(v) => append!(I16, v.into_iter().map(i16::from)),
            DecodingResult::I16(v) => append!(I16, v),
            DecodingResult::F32(v) => append!(F32, v),
            DecodingResult::F16(v) => append!(F32, v.into_iter().map(|v| v.to_f32())),
            DecodingResult::F64(v) => append!(F64, v),
            DecodingResult::U32(v) => append!(F64, v.into_iter().map(f64::from)),
            DecodingResult::I32(v) => append!(F64, v.into_iter().map(f64::from)),
            DecodingResult::U64(_) | DecodingResult::I64(_) => {
                return Err("its pixels are 64-bit integers, which are not read".into());
            }
        }
        Ok(())
    }

    fn stored_type(&self) -> &'static str {
        match &self.values {
            Some(Values::U8(_)) | None => "uint8",
            Some(Values::I16(_)) => "int16",
            Some(Values::U16(_)) => "uint16",
            Some(Values::F32(_)) => "float32",
            Some(Values::F64(_)) => "float64",
        }
    }

    fn into_voxels(self, order: &Order, frame: usize) -> Result<Voxels, String> {
        let (width, height) = self.size.ok_or("it has no pages")?;
        let (nx, ny) = (width as usize, height as usize);
        fn picked<T: Copy>(all: Vec<T>, page: usize, order: &Order, frame: usize) -> Vec<T> {
            if order.frames() == 1 {
                return all;
            }
            let pages = (0..order.slices).map(|z| order.page(z, frame) * page);
            pages.flat_map(|at| all[at..at + page].iter().copied()).collect()
        }
        macro_rules! array {
            ($values:expr) => {
                Array3::from_shape_vec((order.slices, ny, nx), picked($values, nx * ny, order, frame))
                    .map(Voxels::from)
                    .map_err(|e| e.to_string())
            };
        }
        match self.values.ok_or("it has no pages")? {
            Values::U8(v) => array!(v),
            Values::I16(v) => array!(v),
            Values::U16(v) => array!(v),
            Values::F32(v) => array!(v),
            Values::F64(v) => array!(v),
        }
    }
}

/// What the first page says of the whole.
#[derive(Debug, Default)]
struct Description {
    text: String,
    /// Pixels a unit along x and y.
    resolution: [Option<f64>; 2],
}

impl Description {
    fn of(decoder: &mut Decoder<BufReader<File>>) -> Self {
        let text = decoder.get_tag_ascii_string(Tag::ImageDescription).unwrap_or_default();
        let mut resolution = |tag| {
            let ratio = match decoder.get_tag(tag).ok()? {
                Value::Rational(a, b) => f64::from(a) / f64::from(b),
                Value::Double(value) => value,
                Value::Float(value) => value.into(),
                _ => return None,
            };
            Some(ratio).filter(|r| r.is_finite() && *r > 0.0)
        };
        Self { resolution: [resolution(Tag::XResolution), resolution(Tag::YResolution)], text }
    }

    /// A line `name=value`, as ImageJ writes them.
    fn field(&self, name: &str) -> Option<&str> {
        field(&self.text, name)
    }

    /// The straight line by which ImageJ calibrates values, as it does for those of a CT.
    fn scaling(&self) -> Scaling {
        let number = |name: &str| self.field(name).and_then(|v| v.parse::<f64>().ok());
        match (self.text.starts_with("ImageJ="), self.field("cf"), number("c0"), number("c1")) {
            (true, None | Some("0"), Some(intercept), Some(slope)) if slope != 0.0 => {
                Scaling { slope, intercept }
            }
            _ => Scaling::IDENTITY,
        }
    }

    /// Voxel sizes, where ImageJ or OME says them with a unit of length.
    fn spacing_mm(&self) -> Option<[f64; 3]> {
        if self.text.starts_with("ImageJ=") {
            let unit = mm_of(self.field("unit")?)?;
            let [x, y] = self.resolution;
            let slices = self.field("spacing").and_then(|s| s.parse().ok()).unwrap_or(1.0);
            return sound([unit / x?, unit / y.or(x)?, unit * slices]);
        }
        let attribute = |name: &str| {
            let (_, after) = self.text.split_once(&format!(" {name}=\""))?;
            after.split_once('"').map(|(value, _)| value)
        };
        let size = |axis: &str| {
            let number: f64 = attribute(&format!("PhysicalSize{axis}"))?.parse().ok()?;
            let unit = attribute(&format!("PhysicalSize{axis}Unit")).unwrap_or("µm");
            Some(number * mm_of(unit)?)
        };
        sound([size("X")?, size("Y")?, size("Z").or_else(|| size("X"))?])
    }
}

fn field<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix('=')).map(str::trim)
}

fn sound(spacing: [f64; 3]) -> Option<[f64; 3]> {
    spacing.iter().all(|s| s.is_finite() && *s > 0.0).then_some(spacing)
}

/// A unit of length in mm.
pub(super) fn mm_of(unit: &str) -> Option<f64> {
    Some(match unit {
        "mm" | "millimeter" | "millimeters" => 1.0,
        "cm" | "centimeter" => 10.0,
        "m" | "meter" => 1000.0,
        "micron" | "microns" | "um" | "µm" | "μm" | "\\u00B5m" | "micrometer" => 1e-3,
        "nm" | "nanometer" => 1e-6,
        "inch" | "in" => 25.4,
        _ => return None,
    })
}

/// How pages follow each other: of ImageJ channels fastest, then slices, then times; of OME as it says.
#[derive(Debug, PartialEq)]
struct Order {
    channels: usize,
    slices: usize,
    times: usize,
    /// Pages from one channel, slice and time to the next.
    strides: [usize; 3],
}

impl Order {
    fn of(text: &str, pages: usize) -> Result<Self, String> {
        let count = |name: &str| field(text, name).and_then(|n| n.parse::<usize>().ok()).filter(|&n| n > 0);
        let plain = Self { channels: 1, slices: pages, times: 1, strides: [1, 1, pages] };
        if let Some(ome) = Self::of_ome(text).filter(|o| o.channels * o.slices * o.times == pages) {
            return Ok(ome);
        }
        if !text.starts_with("ImageJ=") {
            return Ok(plain);
        }
        if let Some(images) = count("images").filter(|&n| n > pages) {
            return Err(format!(
                "ImageJ put {images} slices into {pages} pages (a file beyond 4 GB), which is not read"
            ));
        }
        let (channels, times) = (count("channels").unwrap_or(1), count("frames").unwrap_or(1));
        let slices = pages / channels.saturating_mul(times).max(1);
        let fits = channels.checked_mul(times).and_then(|n| n.checked_mul(slices)) == Some(pages);
        let strides = [1, channels, channels * slices];
        Ok(if fits && slices > 0 { Self { channels, slices, times, strides } } else { plain })
    }

    /// By the first `Pixels` of an OME header.
    fn of_ome(text: &str) -> Option<Self> {
        let (_, pixels) = text.split_once("<Pixels ")?;
        let pixels = pixels.split('>').next()?;
        let attribute = |name: &str| {
            let (_, after) = pixels.split_once(&format!("{name}=\""))?;
            after.split_once('"').map(|(value, _)| value)
        };
        let size = |axis: &str| {
            attribute(&format!("Size{axis}"))?.parse::<usize>().ok().filter(|n| (1..=1 << 20).contains(n))
        };
        let sizes = [size("C")?, size("Z")?, size("T")?];
        let order = attribute("DimensionOrder")?.strip_prefix("XY")?;
        let mut strides = [1; 3];
        let mut stride = 1;
        for axis in order.chars() {
            let at = "CZT".find(axis)?;
            strides[at] = stride;
            stride *= sizes[at];
        }
        let [channels, slices, times] = sizes;
        Some(Self { channels, slices, times, strides })
    }

    fn frames(&self) -> usize {
        self.channels * self.times
    }

    fn page(&self, slice: usize, frame: usize) -> usize {
        let [channel, depth, time] = self.strides;
        frame % self.channels * channel + slice * depth + frame / self.channels * time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_sorted_by_their_numbers() {
        let mut names = ["s10.tif", "s9.tif", "S1.tif", "s9b2.tif", "s9b10.tif"];
        names.sort_by_cached_key(|n| natural(n));
        assert_eq!(names, ["S1.tif", "s9.tif", "s9b2.tif", "s9b10.tif", "s10.tif"]);
    }

    #[test]
    fn sizes_of_imagej_and_ome() {
        let image_j = Description {
            text: "ImageJ=1.53t\nimages=4\nslices=4\nunit=micron\nspacing=2.5\n".into(),
            resolution: [Some(4.0), Some(2.0)],
        };
        let mm = image_j.spacing_mm().unwrap();
        assert!(mm.iter().zip([0.25e-3, 0.5e-3, 2.5e-3]).all(|(a, b)| (a - b).abs() < 1e-12), "{mm:?}");
        let ome = Description {
            text: r#"<OME><Image><Pixels SizeX="4" PhysicalSizeX="0.5" PhysicalSizeY="0.25" PhysicalSizeZ="1" PhysicalSizeZUnit="mm"/></Image></OME>"#.into(),
            resolution: [None; 2],
        };
        assert_eq!(ome.spacing_mm(), Some([0.5e-3, 0.25e-3, 1.0]));
        let photo = Description { text: "made by a camera".into(), resolution: [Some(72.0); 2] };
        assert_eq!(photo.spacing_mm(), None);
    }

    #[test]
    fn pages_of_channels_and_times() {
        let order = Order::of("ImageJ=1\nchannels=2\nslices=3\nframes=2\n", 12).unwrap();
        assert_eq!(order, Order { channels: 2, slices: 3, times: 2, strides: [1, 2, 6] });
        let ome = r#"<OME><Pixels SizeX="4" DimensionOrder="XYZCT" SizeC="2" SizeT="2" SizeZ="3">"#;
        let by_ome = Order::of(ome, 12).unwrap();
        assert_eq!((by_ome.page(2, 0), by_ome.page(0, 1), by_ome.page(1, 2)), (2, 3, 7));
        let pages: Vec<usize> = (0..3).map(|z| order.page(z, 3)).collect();
        assert_eq!(pages, [7, 9, 11]);
        assert!(Order::of("ImageJ=1\nimages=900\n", 1).is_err());
    }
}
