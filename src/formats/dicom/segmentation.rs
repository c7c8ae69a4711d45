//! Reads DICOM segmentations (SEG) of masks or segment numbers.
//!
//! Each frame of a segmentation of one bit a pixel is the mask of one segment in one slice. Each frame of a label map has
//! the segment numbers of one slice. The volume has the number of a segment in each voxel, and 0 elsewhere. Sources: DICOM
//! PS3.3, C.8.20.2 (segmentation image) and C.10.7.1.1 (encoding of CIELab values).

use super::attributes::Attributes;
use super::dataset::{DataSet, MAX_FRAMES, PixelData, printable};
use super::pixels::{read_frame, spans};
use super::series::{Refused, layout};
use super::stack::Plane;
use crate::files::memory_budget;
use crate::formats::common::affine;
use crate::volume::{AffineSource, Provenance, Scaling, Segment, ValueMeaning, Volume, Voxels};
use dicom_dictionary_std::tags;
use glam::{DAffine3, DVec3};
use ndarray::Array3;
use palette::chromatic_adaptation::AdaptFromUnclamped as _;
use palette::convert::FromColorUnclamped as _;
use palette::white_point::{D50, D65};
use palette::{Lab, Srgb, Xyz};
use std::path::Path;

/// Largest distance of a frame of a segmentation from its place in the grid, as a fraction of the slice spacing.
const OFF_GRID: f64 = 0.1;
/// Distance below which two frames of a segmentation lie in one slice, mm.
const SAME_MM: f64 = 1e-3;

/// Reads a DICOM segmentation as a volume of segment numbers. `frame` is the time frame, always 0.
///
/// # Errors
/// The frames have no positions or form no grid, the pixels are too few, or masks are compressed.
pub(super) fn read(path: &Path, set: &DataSet, frame: usize) -> Result<Volume, String> {
    if frame > 0 {
        return Err(format!("--frame {frame} is beyond its 1 frame (counted from 0): it is a segmentation"));
    }
    let mut warnings = Vec::new();
    let is_label_map = set.is_label_map();
    let masks = Masks::new(set, is_label_map, &mut warnings)?;
    let (labels, overlaps) =
        if is_label_map { (masks.numbers(path, set)?, 0) } else { masks.labels(path, set)? };
    if overlaps > 0 {
        warnings.push(format!("{overlaps} voxels belong to several segments: they have the last one"));
    }
    let [columns, rows, layers] = masks.dims;
    let shape = (layers, rows, columns);
    let voxels = if labels.iter().all(|label| *label <= u16::from(u8::MAX)) {
        Array3::from_shape_vec(shape, labels.iter().map(|label| *label as u8).collect()).map(Voxels::from)
    } else {
        Array3::from_shape_vec(shape, labels).map(Voxels::from)
    };
    let stored_type = if is_label_map { "label map, SEG" } else { "1 bit, SEG" };
    let provenance = Provenance {
        values: ValueMeaning::Other("DICOM segmentation".into()),
        affine_source: AffineSource::Axes,
        warnings,
        segments: segments(set),
        ..Provenance::new(path.display().to_string(), "dicom", stored_type)
    };
    let voxels = voxels.map_err(|e| e.to_string())?;
    Volume::new(voxels, Scaling::IDENTITY, masks.world_from_index, provenance).map_err(|e| e.why)
}

/// Returns the numbers, names and colours of the segments of a DICOM segmentation.
fn segments(set: &DataSet) -> Vec<Segment> {
    let named = set.root.items(tags::SEGMENT_SEQUENCE).iter().filter_map(|item| {
        let label = item.integer(tags::SEGMENT_NUMBER).and_then(|n| u32::try_from(n).ok())?;
        Some(Segment { label, name: printable(&item.text(tags::SEGMENT_LABEL)?), color: color(item) })
    });
    named.collect()
}

/// Returns the recommended colour of a segment, sRGB from 0 to 1. The file has it in CIE L*a*b* with the white D50.
fn color(item: &Attributes) -> Option<[f32; 3]> {
    let [l, a, b] =
        <[u16; 3]>::try_from(item.words(tags::RECOMMENDED_DISPLAY_CIE_LAB_VALUE)?).ok()?.map(f64::from);
    let full = f64::from(u16::MAX);
    // L* is 0 to 100, and a* and b* are -128 to 127, each over the whole range of 16 bits.
    let lab = Lab::<D50, f64>::new(100.0 * l / full, 255.0 * a / full - 128.0, 255.0 * b / full - 128.0);
    let xyz = Xyz::<D65, f64>::adapt_from_unclamped(Xyz::<D50, f64>::from_color_unclamped(lab));
    let rgb: [f64; 3] = Srgb::from_color_unclamped(xyz).into();
    Some(rgb.map(|c| c.clamp(0.0, 1.0) as f32))
}

/// Frames of a DICOM segmentation on the grid of their volume.
struct Masks {
    dims: [usize; 3],
    world_from_index: DAffine3,
    /// Segment number and layer (index along z) of each frame. A frame of a label map has the number 0, since it holds
    /// several segments.
    frames: Vec<(u16, usize)>,
}

impl Masks {
    /// Places the frames on a grid: the smallest one with even spacing that contains all of them.
    fn new(set: &DataSet, is_label_map: bool, warnings: &mut Vec<String>) -> Result<Self, String> {
        let size = |tag| {
            set.root.integer(tag).and_then(|n| usize::try_from(n).ok()).filter(|n| (1..=65535).contains(n))
        };
        let (rows, columns) = size(tags::ROWS).zip(size(tags::COLUMNS)).ok_or("it has no image size")?;
        let count = set.root.integer(tags::NUMBER_OF_FRAMES).unwrap_or(1);
        let count = usize::try_from(count).ok().filter(|n| (1..=MAX_FRAMES).contains(n));
        let count = count.ok_or("its number of frames is out of range")?;
        let numbers = |frame: usize, tag| set.of_frame(frame, tag).and_then(|a| a.numbers(tag));
        let plane = Plane::new(|tag| numbers(0, tag), warnings)?;
        let (mut numbered, mut positions) = (Vec::new(), Vec::new());
        for frame in 0..count {
            let tag = tags::REFERENCED_SEGMENT_NUMBER;
            let number =
                set.of_frame(frame, tag).and_then(|a| a.integer(tag)).and_then(|n| u16::try_from(n).ok());
            let number = if is_label_map { Some(0) } else { number.filter(|n| *n > 0) };
            numbered.push(number.ok_or("a frame of it belongs to no segment")?);
            let position = numbers(frame, tags::IMAGE_POSITION_PATIENT).filter(|p| p.len() == 3);
            let position = position.ok_or("a frame of it has no position")?;
            positions.push(DVec3::new(position[0], position[1], position[2]));
        }
        let depths: Vec<f64> = positions.iter().map(|p| (p - positions[0]).dot(plane.normal)).collect();
        let first = (0..count).min_by(|a, b| depths[*a].total_cmp(&depths[*b])).unwrap_or(0);
        let spacing = spacing(&depths).or(plane.thickness).unwrap_or(1.0);
        let mut layers = Vec::new();
        for (position, depth) in positions.iter().zip(&depths) {
            let layer = (depth - depths[first]) / spacing;
            let place = positions[first] + plane.normal * spacing * layer.round();
            if position.distance(place) > OFF_GRID * spacing {
                return Err("its frames are not evenly spaced above each other".into());
            }
            layers.push(layer.round() as usize);
        }
        let dims = [columns, rows, 1 + layers.iter().copied().max().unwrap_or(0)];
        memory_budget::check_grid(dims, size_of::<u16>() as u64)?;
        let axes = [plane.across[0], plane.across[1], plane.normal * spacing];
        let world_from_index = affine(axes, positions[first], true);
        Ok(Self { dims, world_from_index, frames: numbered.into_iter().zip(layers).collect() })
    }

    /// Returns the segment number of each voxel, x fastest, and the number of voxels that belong to several segments.
    fn labels(&self, path: &Path, set: &DataSet) -> Result<(Vec<u16>, usize), String> {
        let PixelData::Native(span) = set.pixels else {
            return Err("it has no pixels, or compressed ones, which are not read in segmentations".into());
        };
        let [columns, rows, _] = self.dims;
        let pixels = rows * columns;
        let bits = set.bytes(path, span)?;
        if pixels.checked_mul(self.frames.len()).is_none_or(|all| all.div_ceil(8) > bits.len()) {
            return Err(format!("it holds {} bytes, too few for {} frames", bits.len(), self.frames.len()));
        }
        let mut labels = self.unlabelled()?;
        let mut overlaps = 0;
        for (frame, (segment, layer)) in self.frames.iter().enumerate() {
            let of_layer = &mut labels[layer * pixels..(layer + 1) * pixels];
            for (pixel, label) in of_layer.iter_mut().enumerate() {
                // The bits of a frame begin right after those of the one before, lowest bit first.
                let bit = frame * pixels + pixel;
                if bits[bit / 8] >> (bit % 8) & 1 == 1 {
                    overlaps += usize::from(*label != 0 && label != segment);
                    *label = *segment;
                }
            }
        }
        Ok((labels, overlaps))
    }

    /// Returns the segment number of each voxel of a label map, x fastest.
    fn numbers(&self, path: &Path, set: &DataSet) -> Result<Vec<u16>, String> {
        let layout = layout(set).map_err(Refused::why)?;
        if layout.stored > u16::BITS || layout.is_signed || layout.is_float {
            return Err("its segment numbers are no whole numbers of at most 16 bits".into());
        }
        let spans = spans(path, set, &layout, self.frames.len())?;
        let mut labels = self.unlabelled()?;
        let pixels = layout.pixels();
        let mut values = vec![0.0; pixels];
        for ((_, layer), spans) in self.frames.iter().zip(&spans) {
            read_frame(path, set, &layout, spans, &mut values, |pixel| layout.value(pixel) as f64)?;
            let of_layer = &mut labels[layer * pixels..(layer + 1) * pixels];
            for (label, value) in of_layer.iter_mut().zip(&values) {
                *label = *value as u16;
            }
        }
        Ok(labels)
    }

    /// Returns a label of 0 for each voxel.
    fn unlabelled(&self) -> Result<Vec<u16>, String> {
        let count = self.dims.iter().try_fold(1usize, |all, n| all.checked_mul(*n));
        let count = count.ok_or("more voxels than can be counted")?;
        let mut labels = Vec::new();
        labels.try_reserve_exact(count).map_err(|_| "not enough memory for the voxels")?;
        labels.resize(count, 0);
        Ok(labels)
    }
}

/// Returns the smallest distance of two frames that lie in different slices; `None` if all lie in one slice.
fn spacing(depths: &[f64]) -> Option<f64> {
    let mut sorted = depths.to_vec();
    sorted.sort_by(f64::total_cmp);
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
    gaps.filter(|gap| *gap > SAME_MM).min_by(f64::total_cmp)
}
