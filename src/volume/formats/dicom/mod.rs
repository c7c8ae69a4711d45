//! DICOM series: a folder, or any file of it, or one enhanced multi-frame file.
//!
//! Slices are placed by position along the normal of their plane, never by number or name; directions and positions are
//! LPS mm in the files and RAS+ here. No attribute that names a person is read.
//! Source: DICOM PS3.3, C.7.6.2 (image plane), C.11.1 (modality LUT), C.7.6.16 (functional groups).

mod dataset;
mod pixels;
mod series;
mod stack;

use self::dataset::is_dicom as is_dicom_head;
use self::pixels::{Layout, read_frame, spans, warning_of};
use self::series::{Series, WHAT};
use self::stack::{Layer, Stack};
use super::head::Head;
use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage};
use crate::volume::{Provenance, Scaling, ValuesSaid, Volume, Voxels};
use crate::with_voxels;
use dicom_dictionary_std::tags;
use ndarray::Array3;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// File-name endings of the format; most files of a series have none.
pub const EXTENSIONS: &[&str] = &["dcm", "ima"];

/// Whether a file or folder is of this format.
pub fn is_dicom(head: &Head) -> bool {
    match head.is_folder() {
        true => series::holds_dicom(head.path()),
        false => is_dicom_head(head.bytes()),
    }
}

/// The files of the series that a path stands for, in the order of their slices.
///
/// # Errors
/// As [`read_with`].
pub fn files_of(path: &Path, chosen: Option<usize>) -> Result<Vec<PathBuf>> {
    let series = series::find(path, chosen, &Loading::default())?;
    let mut files: Vec<PathBuf> = series.images.iter().map(|image| image.path.clone()).collect();
    files.sort();
    Ok(files)
}

/// Reads one frame (0 is the first) of a series: the one of a file, or of a folder the one that is `chosen` (from 1).
///
/// # Errors
/// No series, or several without a choice; files that cannot be read; slices that no grid can hold.
pub fn read_with(path: &Path, chosen: Option<usize>, frame: usize, loading: &Loading) -> Result<Volume> {
    let refuse = |why: String| Error::input(WHAT, path.display(), why);
    let series = series::find(path, chosen, loading)?;
    let stack = stack::stack(&series, frame).map_err(refuse)?;
    let values = Values::of(&series, &stack).map_err(refuse)?;
    let mut warnings = stack.warnings.clone();
    let mut voxels = voxels(&series, &stack, &values, loading).map_err(refuse)?;
    loading.go_on(&path.display().to_string())?;
    if let Some(padding) = values.padding {
        warnings.extend(without_padding(&mut voxels, padding));
    }
    warnings.extend(values.warnings);
    let first = &series.images[0];
    let modality = first.set.root.text(tags::MODALITY).map(|m| dataset::printable(&m)).unwrap_or_default();
    let Layout { allocated, stored, is_signed, .. } = first.layout;
    let sign = if is_signed { "int" } else { "uint" };
    let rescale_type = first.set.of_frame(0, tags::RESCALE_TYPE).and_then(|a| a.text(tags::RESCALE_TYPE));
    let said = match (modality.as_str(), rescale_type.as_deref()) {
        (_, Some("HU")) => ValuesSaid::Hounsfield("DICOM rescale type HU".into()),
        ("CT", None) => ValuesSaid::Hounsfield("DICOM modality CT".into()),
        ("", _) => ValuesSaid::Nothing,
        (other, _) => ValuesSaid::Other(format!("DICOM modality {other}")),
    };
    let provenance = Provenance {
        values: said,
        affine_source: stack.affine_source,
        frames: stack.frames,
        frame,
        warnings,
        ..Provenance::new(
            path.display().to_string(),
            "dicom",
            format!("{sign}{allocated}, {stored} bits used, {modality}"),
        )
    };
    Volume::new_with(voxels, values.scaling, stack.world_from_index, provenance, loading)
}

/// How the pixels of a series become values.
struct Values {
    layout: Layout,
    scaling: Scaling,
    /// Slope and intercept of each slice, where they are not the same for all: values are then stored as floats.
    each: Option<Vec<Scaling>>,
    /// Stored values that mean nothing, from and to.
    padding: Option<[f64; 2]>,
    warnings: Vec<String>,
}

impl Values {
    fn of(series: &Series, stack: &Stack) -> Result<Self, String> {
        let first = &series.images[0];
        let mut warnings = Vec::new();
        warnings.extend(warning_of(&first.set.syntax).map(String::from));
        let of_slice = |at: usize| {
            let slice = &stack.slices[at];
            let set = &series.images[slice.image].set;
            let number = |tag| set.of_frame(slice.frame, tag).and_then(|a| a.number(tag));
            Scaling {
                slope: number(tags::RESCALE_SLOPE).filter(|s| *s != 0.0).unwrap_or(1.0),
                intercept: number(tags::RESCALE_INTERCEPT).unwrap_or(0.0),
            }
        };
        let all: Vec<Scaling> = (0..stack.slices.len()).map(of_slice).collect();
        let one = all.first().copied().unwrap_or(Scaling::IDENTITY);
        let same = all.iter().all(|s| *s == one);
        if first.set.root.has(tags::MODALITY_LUT_SEQUENCE) {
            warnings.push("it has a table of values (modality LUT), which is not applied".into());
        }
        let layout = first.layout;
        let padding = first.set.root.whole(tags::PIXEL_PADDING_VALUE).map(|value| {
            let limit = first.set.root.whole(tags::PIXEL_PADDING_RANGE_LIMIT).unwrap_or(value);
            let of = |v: i64| layout.value((v as u32) << (layout.high + 1 - layout.stored)) as f64;
            let (a, b) = (of(value), of(limit));
            [a.min(b), a.max(b)]
        });
        let mut scaling = if same { one } else { Scaling::IDENTITY };
        let photometric = first.set.root.text(tags::PHOTOMETRIC_INTERPRETATION).unwrap_or_default();
        let modality = first.set.root.text(tags::MODALITY).unwrap_or_default();
        match photometric.as_str() {
            // Of a CT the values are HU whichever way they are shown; of others small ones are the bright ones.
            "MONOCHROME1" if modality != "CT" && same => {
                let [lo, hi] = layout.range().map(|v| v as f64);
                scaling = Scaling { slope: -one.slope, intercept: one.slope * (lo + hi) + one.intercept };
                warnings.push("small values are the bright ones (MONOCHROME1): turned about".into());
            }
            "MONOCHROME1" => {
                warnings.push("small values are the bright ones (MONOCHROME1): kept as they are".into());
            }
            "MONOCHROME2" | "" => {}
            other => return Err(format!("its pixels are {}; scalars are needed", dataset::printable(other))),
        }
        if !same {
            warnings.push("its slices have scalings of their own: kept as 32-bit floats".into());
        }
        // What padding would be scaled to differs by slice.
        let padding = padding.filter(|_| same);
        Ok(Self { layout, scaling, each: (!same).then_some(all), padding, warnings })
    }
}

/// The voxels, slice by slice, several at a time.
fn voxels(series: &Series, stack: &Stack, values: &Values, loading: &Loading) -> Result<Voxels, String> {
    let resamples = stack.layers.iter().any(|l| matches!(l, Layer::Between(..)));
    let Layout { stored, is_signed, .. } = values.layout;
    if values.each.is_some() || resamples && stored <= 16 {
        return gathered(series, stack, values, loading, |v| v as f32).map(Voxels::F32);
    }
    match (stored, is_signed) {
        (..=8, false) => gathered(series, stack, values, loading, |v| v as u8).map(Voxels::U8),
        (..=16, false) => gathered(series, stack, values, loading, |v| v as u16).map(Voxels::U16),
        (..=16, true) => gathered(series, stack, values, loading, |v| v as i16).map(Voxels::I16),
        _ => gathered(series, stack, values, loading, |v| v).map(Voxels::F64),
    }
}

/// Layers of numbers as `keep` stores them.
fn gathered<T: Copy + Default + Send + Sync>(
    series: &Series,
    stack: &Stack,
    values: &Values,
    loading: &Loading,
    keep: impl Fn(f64) -> T + Sync,
) -> Result<Array3<T>, String> {
    let Layout { rows, columns, .. } = values.layout;
    let spans: Vec<_> = series
        .images
        .iter()
        .map(|image| {
            spans(&image.set, &image.layout, image.frames)
                .map_err(|e| format!("{}: {e}", image.path.display()))
        })
        .collect::<Result<_, _>>()?;
    let pixels = values.layout.pixels();
    let count = pixels.checked_mul(stack.layers.len()).ok_or("more voxels than can be counted")?;
    let mut all: Vec<T> = Vec::new();
    all.try_reserve_exact(count).map_err(|_| "not enough memory for the voxels")?;
    all.resize(count, T::default());
    let frame = |at: usize| -> Result<Vec<f64>, String> {
        let slice = &stack.slices[at];
        let image = &series.images[slice.image];
        let scaling = values.each.as_ref().map_or(Scaling::IDENTITY, |each| each[at]);
        let mut out = vec![0.0; pixels];
        let spans = &spans[slice.image][slice.frame];
        read_frame(&image.path, &image.set, &image.layout, spans, &mut out, |v| scaling.apply(v as f64))
            .map_err(|e| format!("{}: {e}", image.path.display()))?;
        Ok(out)
    };
    let pieces = loading.pieces(ReadingStage::Unpacking, stack.layers.len());
    all.par_chunks_mut(pixels).zip(&stack.layers).try_for_each(|(out, layer)| {
        if pieces.is_cancelled() {
            return Err("it was cancelled".to_string());
        }
        match *layer {
            Layer::Slice(at) => {
                out.iter_mut().zip(frame(at)?).for_each(|(out, v)| *out = keep(v));
            }
            Layer::Between(at, share) => {
                let (below, above) = (frame(at)?, frame(at + 1)?);
                for ((out, a), b) in out.iter_mut().zip(below).zip(above) {
                    *out = keep(a + share * (b - a));
                }
            }
        }
        pieces.done();
        Ok(())
    })?;
    Array3::from_shape_vec((stack.layers.len(), rows, columns), all).map_err(|e| e.to_string())
}

/// Makes voxels that mean nothing the smallest of the others, and says how many.
fn without_padding(voxels: &mut Voxels, [from, to]: [f64; 2]) -> Option<String> {
    use crate::volume::Voxel;
    fn replace<T: Voxel>(array: &mut Array3<T>, from: f64, to: f64) -> (usize, f64) {
        let is_padding = |v: &T| (from..=to).contains(&v.to_f64());
        let smallest =
            array.iter().filter(|v| !is_padding(v)).copied().reduce(|a, b| if b < a { b } else { a });
        let Some(smallest) = smallest else { return (0, 0.0) };
        let mut replaced = 0;
        array.iter_mut().filter(|v| is_padding(v)).for_each(|v| {
            *v = smallest;
            replaced += 1;
        });
        (replaced, smallest.to_f64())
    }
    let (replaced, smallest) = with_voxels!(voxels, a => replace(a, from, to));
    (replaced > 0).then(|| {
        format!("{replaced} voxels hold no value (padding, stored as {from}): they became the smallest, {smallest}")
    })
}
