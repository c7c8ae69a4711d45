//! Reads DICOM segmentations (SEG) of one bit a pixel.
//!
//! Each frame is the mask of one segment in one slice. The volume has the number of a segment in each voxel, and 0
//! elsewhere.

use super::dataset::{DataSet, MAX_FRAMES, PixelData, printable};
use super::stack::Plane;
use crate::files::memory_budget;
use crate::formats::common::affine;
use crate::volume::{AffineSource, Provenance, Scaling, Segment, ValueMeaning, Volume, Voxels};
use dicom_dictionary_std::tags;
use glam::{DAffine3, DVec3};
use ndarray::Array3;
use std::path::Path;

/// Largest distance of a frame of a segmentation from its place in the grid, as a fraction of the slice spacing.
const OFF_GRID: f64 = 0.1;
/// Distance below which two frames of a segmentation lie in one slice, mm.
const SAME_MM: f64 = 1e-3;

/// Reads a DICOM segmentation of one bit a pixel as a volume of segment numbers. `frame` is the time frame, always 0.
///
/// # Errors
/// The frames have no positions or form no grid, or the pixels are compressed or too few.
pub(super) fn read(path: &Path, set: &DataSet, frame: usize) -> Result<Volume, String> {
    if frame > 0 {
        return Err(format!("--frame {frame} is beyond its 1 frame (counted from 0): it is a segmentation"));
    }
    let mut warnings = Vec::new();
    let masks = Masks::new(set, &mut warnings)?;
    let (labels, overlaps) = masks.labels(path, set)?;
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
    let provenance = Provenance {
        values: ValueMeaning::Other("DICOM segmentation".into()),
        affine_source: AffineSource::Axes,
        warnings,
        segments: segments(set),
        ..Provenance::new(path.display().to_string(), "dicom", "1 bit, SEG")
    };
    let voxels = voxels.map_err(|e| e.to_string())?;
    Volume::new(voxels, Scaling::IDENTITY, masks.world_from_index, provenance).map_err(|e| e.why)
}

/// Returns the numbers and names of the segments of a DICOM segmentation.
fn segments(set: &DataSet) -> Vec<Segment> {
    let named = set.root.items(tags::SEGMENT_SEQUENCE).iter().filter_map(|item| {
        let label = item.integer(tags::SEGMENT_NUMBER).and_then(|n| u32::try_from(n).ok())?;
        Some(Segment { label, name: printable(&item.text(tags::SEGMENT_LABEL)?), color: None })
    });
    named.collect()
}

/// Frames of a DICOM segmentation on the grid of their volume.
struct Masks {
    dims: [usize; 3],
    world_from_index: DAffine3,
    /// Segment number and layer (index along z) of each frame.
    frames: Vec<(u16, usize)>,
}

impl Masks {
    /// Places the frames on a grid: the smallest one with even spacing that contains all of them.
    fn new(set: &DataSet, warnings: &mut Vec<String>) -> Result<Self, String> {
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
            numbered.push(number.filter(|n| *n > 0).ok_or("a frame of it belongs to no segment")?);
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
        let [columns, rows, layers] = self.dims;
        let pixels = rows * columns;
        let bits = set.bytes(path, span)?;
        if pixels.checked_mul(self.frames.len()).is_none_or(|all| all.div_ceil(8) > bits.len()) {
            return Err(format!("it holds {} bytes, too few for {} frames", bits.len(), self.frames.len()));
        }
        let mut labels = Vec::new();
        let count = pixels.checked_mul(layers).ok_or("more voxels than can be counted")?;
        labels.try_reserve_exact(count).map_err(|_| "not enough memory for the voxels")?;
        labels.resize(count, 0u16);
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
}

/// Returns the smallest distance of two frames that lie in different slices; `None` if all lie in one slice.
fn spacing(depths: &[f64]) -> Option<f64> {
    let mut sorted = depths.to_vec();
    sorted.sort_by(f64::total_cmp);
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
    gaps.filter(|gap| *gap > SAME_MM).min_by(f64::total_cmp)
}
