//! Reads DICOM series: a folder, one file of the series, or one multi-frame file.
//!
//! Slices are ordered by their positions along the slice normal, not by number or name. Directions and positions are
//! LPS mm in the files and become RAS+. Attributes that name people are not read. Source: DICOM PS3.3, C.7.6.2 (image
//! plane), C.11.1 (modality LUT), C.7.6.16 (functional groups).

mod attributes;
mod dataset;
mod elements;
mod pixels;
mod segmentation;
mod series;
mod stack;
mod table;

use self::dataset::{DataSet, Span};
use self::elements::is_dicom as is_dicom_head;
use self::pixels::{Fault, Layout, lossy_warning, read_frame, spans};
use self::series::{Image, Series, WHAT};
use self::stack::{Layer, Stack};
use self::table::Table;
use super::head::Head;
use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage};
use crate::files::memory_budget;
use crate::volume::{Provenance, Scaling, ValueMeaning, Volume, Voxels};
use dicom_dictionary_std::tags;
use ndarray::Array3;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// File extensions of DICOM files; most files of a series have no extension.
pub const EXTENSIONS: &[&str] = &["dcm", "ima"];

/// Whether an input is a DICOM file, or a folder that holds DICOM files.
pub fn is_dicom(head: &Head) -> bool {
    match head.is_folder {
        true => series::holds_dicom(&head.path),
        false => !head.is_gzipped && is_dicom_head(&head.bytes),
    }
}

/// Largest share of the files of a DICOM series that may be skipped because their pixels cannot be decoded: one in so
/// many.
const DAMAGED_SHARE: usize = 10;

/// Describes each DICOM series of a folder in one line, in the order of `--series` from 1.
///
/// # Errors
/// The folder holds no DICOM images, or too many files.
pub fn series_of(folder: &Path) -> Result<Vec<String>> {
    Ok(series::all(folder, &Loading::default())?.0.iter().map(Series::summary).collect())
}

/// Lists the files of one DICOM series, sorted by name. In a folder with several series, `chosen` (an index from 1)
/// selects one.
///
/// # Errors
/// The path holds no DICOM series, or several series and `chosen` selects none.
pub fn files_of(path: &Path, chosen: Option<usize>) -> Result<Vec<PathBuf>> {
    if segmentation_of(path).is_some() {
        return Ok(vec![path.into()]);
    }
    let series = series::find(path, chosen, &Loading::default())?;
    let mut files: Vec<PathBuf> = series.images.iter().map(|image| image.path.clone()).collect();
    files.sort();
    Ok(files)
}

/// Reads the attributes of a DICOM file if it is a segmentation of masks or segment numbers.
fn segmentation_of(path: &Path) -> Option<DataSet> {
    if path.is_dir() {
        return None;
    }
    DataSet::read(path).ok().filter(DataSet::is_segmentation)
}

/// Reads one frame (time point) of a DICOM series as a volume; `frame` is its index from 0. In a folder with several
/// series, `chosen` (an index from 1) selects one.
///
/// # Errors
/// The path holds no DICOM series, or several and `chosen` selects none; files cannot be read; the slices do not form
/// a regular grid.
pub fn read_with(path: &Path, chosen: Option<usize>, frame: usize, loading: &Loading) -> Result<Volume> {
    let refuse = |why: String| Error::input(WHAT, path.display(), why);
    if let Some(set) = segmentation_of(path) {
        return segmentation::read(path, &set, frame).map_err(refuse);
    }
    let mut series = series::find(path, chosen, loading)?;
    let most_damaged = (series.images.len() / DAMAGED_SHARE).max(1);
    let mut undecodable: Option<String> = None;
    let (stack, values, (voxels, padded)) = loop {
        // If the other slices form no grid, the damaged slice is the reason.
        let refuse = |why: String| refuse(undecodable.clone().unwrap_or(why));
        let stack = stack::stack(&series, frame).map_err(refuse)?;
        let values = ValueMapping::new(&series, &stack).map_err(refuse)?;
        match voxels(&series, &stack, &values, loading) {
            Ok(read) => break (stack, values, read),
            Err(fault) => {
                let why = fault.why.clone();
                loading.go_on(&path.display().to_string())?;
                series.skip_damaged(fault, path, most_damaged).map_err(refuse)?;
                undecodable.get_or_insert(why);
            }
        }
    };
    let mut warnings = stack.warnings.clone();
    loading.go_on(&path.display().to_string())?;
    if padded > 0 {
        warnings.push(format!("{padded} voxels hold no value (padding): they became the smallest value"));
    }
    if series.damaged > 0 {
        let Series { damaged, first_fault, .. } = &series;
        warnings.push(format!("{damaged} files of the folder are damaged and were skipped ({first_fault})"));
    }
    warnings.extend(values.warnings);
    let first = &series.images[0];
    let modality = first.set.root.text(tags::MODALITY).map(|m| dataset::printable(&m)).unwrap_or_default();
    let Layout { allocated, stored, is_signed, is_float, .. } = first.layout;
    let stored_type = match (is_float, is_signed) {
        (true, _) => format!("float{allocated}, {modality}"),
        (_, true) => format!("int{allocated}, {stored} bits used, {modality}"),
        (_, false) => format!("uint{allocated}, {stored} bits used, {modality}"),
    };
    let rescale_type = first.set.of_frame(0, tags::RESCALE_TYPE).and_then(|a| a.text(tags::RESCALE_TYPE));
    let meaning = match (modality.as_str(), rescale_type.as_deref()) {
        (_, Some("HU")) => ValueMeaning::Hounsfield("DICOM rescale type HU".into()),
        ("CT", None) => ValueMeaning::Hounsfield("DICOM modality CT".into()),
        ("", _) => ValueMeaning::Unknown,
        (other, _) => ValueMeaning::Other(format!("DICOM modality {other}")),
    };
    let provenance = Provenance {
        values: meaning,
        affine_source: stack.affine_source,
        frames: stack.frames,
        frame,
        warnings,
        ..Provenance::new(path.display().to_string(), "dicom", stored_type)
    };
    Volume::new_with(voxels, values.scaling, stack.world_from_index, provenance, loading)
}

/// Mapping from the stored pixels of a DICOM series to physical values.
struct ValueMapping {
    layout: Layout,
    scaling: Scaling,
    /// Linear mapping (DICOM rescale slope and intercept) of each slice, if it differs between slices. Voxels are
    /// then stored as floats.
    each: Option<Vec<Scaling>>,
    /// DICOM modality lookup table of each image file that has one; it is applied before the rescale slope.
    tables: Vec<Option<Table>>,
    warnings: Vec<String>,
}

impl ValueMapping {
    fn new(series: &Series, stack: &Stack) -> Result<Self, String> {
        let first = &series.images[0];
        let mut warnings = Vec::new();
        warnings.extend(lossy_warning(&first.set.syntax).map(String::from));
        let of_slice = |at: usize| {
            let slice = &stack.slices[at];
            let set = &series.images[slice.image].set;
            let number = |tag| set.of_frame(slice.frame, tag).and_then(|a| a.number(tag));
            let slope = number(tags::RESCALE_SLOPE).or(number(tags::DOSE_GRID_SCALING));
            Scaling {
                slope: slope.filter(|s| *s != 0.0).unwrap_or(1.0),
                intercept: number(tags::RESCALE_INTERCEPT).unwrap_or(0.0),
            }
        };
        let all: Vec<Scaling> = (0..stack.slices.len()).map(of_slice).collect();
        let one = all.first().copied().unwrap_or(Scaling::IDENTITY);
        let same = all.iter().all(|s| *s == one);
        let mut layout = series.widest_layout();
        let table = |image: &Image| Table::new(&image.set, image.layout.is_signed);
        let tables: Vec<Option<Table>> = series.images.iter().map(table).collect::<Result<_, _>>()?;
        if let Some(bits) = tables.iter().flatten().map(|table| table.bits).max() {
            let all = tables.iter().all(Option::is_some);
            let which = if all { "its pixels" } else { "some of its slices" };
            warnings.push(format!("{which} were mapped by a lookup table (modality LUT)"));
            layout = match all {
                true => Layout { stored: bits, is_signed: false, ..layout },
                false => Layout { stored: layout.stored.max(bits) + u32::from(layout.is_signed), ..layout },
            };
        }
        let mut scaling = if same { one } else { Scaling::IDENTITY };
        let photometric = first.set.root.text(tags::PHOTOMETRIC_INTERPRETATION).unwrap_or_default();
        let modality = first.set.root.text(tags::MODALITY).unwrap_or_default();
        match photometric.as_str() {
            // CT values are HU however they are displayed; in other modalities small values are bright.
            "MONOCHROME1" if modality != "CT" && same && !layout.is_float => {
                let [lo, hi] = layout.range().map(|v| v as f64);
                scaling = Scaling { slope: -one.slope, intercept: one.slope * (lo + hi) + one.intercept };
                warnings.push("small values are bright (MONOCHROME1): inverted".into());
            }
            "MONOCHROME1" => {
                warnings.push("small values are bright (MONOCHROME1): not inverted".into());
            }
            "MONOCHROME2" | "" => {}
            other => return Err(format!("its pixels are {}; scalars are needed", dataset::printable(other))),
        }
        if !same {
            warnings.push("its slices have different scalings: stored as 32-bit floats".into());
        }
        let differs = |image: &Image| {
            image.set.root.text(tags::PHOTOMETRIC_INTERPRETATION).unwrap_or_default() != photometric
        };
        if series.images.iter().any(differs) {
            return Err("small values are bright in some of its slices and dark in others".into());
        }
        Ok(Self { layout, scaling, each: (!same).then_some(all), tables, warnings })
    }
}

/// Returns a function that tells whether a pixel of a DICOM image is padding (PixelPaddingValue). The function
/// compares both the allocated bits and the stored bits of the pixel.
fn padding_test(image: &Image) -> impl Fn(u64) -> bool + use<> {
    let layout = image.layout;
    let range = image.set.root.integer(tags::PIXEL_PADDING_VALUE).map(|value| {
        let limit = image.set.root.integer(tags::PIXEL_PADDING_RANGE_LIMIT).unwrap_or(value);
        [value.min(limit), value.max(limit)]
    });
    move |pixel| {
        range.is_some_and(|[from, to]| {
            (from..=to).contains(&layout.allocated_value(pixel)) || (from..=to).contains(&layout.value(pixel))
        })
    }
}

/// Reads the voxels of a DICOM series, and returns them with the number of padding voxels.
fn voxels(
    series: &Series,
    stack: &Stack,
    values: &ValueMapping,
    loading: &Loading,
) -> Result<(Voxels, usize), Fault> {
    let resamples = stack.layers.iter().any(|l| matches!(l, Layer::Between(..)));
    let Layout { stored, is_signed, is_float, allocated, .. } = values.layout;
    macro_rules! gathered {
        ($type:ty) => {
            gathered(series, stack, values, loading, |v| v as $type).map(|(a, n)| (Voxels::from(a), n))
        };
    }
    match is_float {
        true if allocated > 32 => return gathered!(f64),
        true => return gathered!(f32),
        false if values.each.is_some() || resamples && stored <= 16 => return gathered!(f32),
        false => {}
    }
    match (stored, is_signed) {
        (..=8, false) => gathered!(u8),
        (..=16, false) => gathered!(u16),
        (..=16, true) => gathered!(i16),
        _ => gathered!(f64),
    }
}

/// Padding pixels of one DICOM slice, and the value range of its other pixels. Each run of padding pixels has the
/// index of its first pixel and a length.
struct Holes {
    runs: Vec<[u32; 2]>,
    range: [f64; 2],
}

/// Reader of the slices of a DICOM series.
struct SliceReader<'a> {
    series: &'a Series,
    stack: &'a Stack,
    values: &'a ValueMapping,
    /// Byte ranges of the pixel data of each frame of each DICOM file.
    spans: Vec<Vec<Vec<Span>>>,
}

impl SliceReader<'_> {
    /// Returns the pixel values of one DICOM slice. Padding pixels are NaN; a later step replaces them.
    fn values(&self, at: usize) -> Result<Vec<f64>, Fault> {
        let slice = &self.stack.slices[at];
        let image = &self.series.images[slice.image];
        let scaling = self.values.each.as_ref().map_or(Scaling::IDENTITY, |each| each[at]);
        let mut out = vec![0.0; self.values.layout.pixels()];
        let spans = &self.spans[slice.image][slice.frame];
        let is_padding = padding_test(image);
        let table = self.values.tables[slice.image].as_ref();
        let float_padding = image.set.root.number(tags::FLOAT_PIXEL_PADDING_VALUE);
        let value = |pixel| {
            if image.layout.is_float {
                let value = image.layout.float(pixel);
                return if float_padding == Some(value) { f64::NAN } else { scaling.apply(value) };
            }
            let stored = image.layout.value(pixel);
            match (is_padding(pixel), table) {
                (true, _) => f64::NAN,
                (false, Some(table)) => scaling.apply(table.value(stored).into()),
                (false, None) => scaling.apply(stored as f64),
            }
        };
        read_frame(&image.path, &image.set, &image.layout, spans, &mut out, value)
            .map_err(|why| Fault::of_image(slice.image, &image.path, &why))?;
        Ok(out)
    }
}

/// Reads all z layers of a DICOM volume, converts each value by `convert`, and counts the padding voxels. Padding
/// voxels get the smallest value of the volume.
fn gathered<T: Copy + Default + Send + Sync>(
    series: &Series,
    stack: &Stack,
    values: &ValueMapping,
    loading: &Loading,
    convert: impl Fn(f64) -> T + Sync,
) -> Result<(Array3<T>, usize), Fault> {
    let Layout { rows, columns, .. } = values.layout;
    let spans = |(at, image): (usize, &Image)| {
        spans(&image.path, &image.set, &image.layout, image.frames)
            .map_err(|why| Fault::of_image(at, &image.path, &why))
    };
    let spans: Vec<_> = series.images.iter().enumerate().map(spans).collect::<Result<_, _>>()?;
    let pixels = values.layout.pixels();
    let count =
        pixels.checked_mul(stack.layers.len()).ok_or_else(|| "more voxels than can be counted".to_owned())?;
    memory_budget::check_grid([columns, rows, stack.layers.len()], size_of::<T>() as u64)?;
    let mut all: Vec<T> = Vec::new();
    all.try_reserve_exact(count).map_err(|_| "not enough memory for the voxels".to_owned())?;
    all.resize(count, T::default());
    let slices = SliceReader { series, stack, values, spans };
    let pieces = loading.pieces(ReadingStage::Unpacking, stack.layers.len());
    let fill = |out: &mut [T], layer: &Layer| -> Result<Holes, Fault> {
        if pieces.is_cancelled() {
            return Err("it was cancelled".to_owned().into());
        }
        let values = match *layer {
            Layer::Slice(at) => slices.values(at)?,
            Layer::Between(at, share) => {
                let (below, above) = (slices.values(at)?, slices.values(at + 1)?);
                below.iter().zip(above).map(|(a, b)| a + share * (b - a)).collect()
            }
        };
        let mut holes = Holes { runs: Vec::new(), range: [f64::INFINITY, f64::NEG_INFINITY] };
        for (at, (out, &v)) in out.iter_mut().zip(&values).enumerate() {
            if !v.is_nan() {
                *out = convert(v);
                holes.range = [holes.range[0].min(v), holes.range[1].max(v)];
                continue;
            }
            match holes.runs.last_mut() {
                Some([first, number]) if *first as usize + *number as usize == at => *number += 1,
                _ => holes.runs.push([at as u32, 1]),
            }
        }
        pieces.done();
        Ok(holes)
    };
    let holes: Vec<Holes> = all
        .par_chunks_mut(pixels)
        .zip(&stack.layers)
        .map(|(out, layer)| fill(out, layer))
        .collect::<Result<_, _>>()?;
    let [low, high] = holes
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], h| [a.min(h.range[0]), b.max(h.range[1])]);
    if low > high {
        return Err("all of its pixels are padding".to_owned().into());
    }
    // With a negative slope the largest stored number is the smallest value.
    let smallest = convert(if values.scaling.slope < 0.0 { high } else { low });
    let mut padded = 0;
    for (out, holes) in all.chunks_mut(pixels).zip(&holes) {
        for [first, number] in &holes.runs {
            let (first, number) = (*first as usize, *number as usize);
            out[first..first + number].fill(smallest);
            padded += number;
        }
    }
    Array3::from_shape_vec((stack.layers.len(), rows, columns), all)
        .map(|array| (array, padded))
        .map_err(|e| e.to_string().into())
}
