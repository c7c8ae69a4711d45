//! Segments of a segmentation by 3D Slicer (`.seg.nrrd`): names, colours, and layers of overlapping segments.
//!
//! Segments that overlap are stored in several layers: each voxel has one number for each layer (axis of kind `list`). The
//! reader merges the layers into one label a voxel. Source: "Segmentation NRRD file format (.seg.nrrd)", developer guide
//! of 3D Slicer, slicer.readthedocs.io.

use super::common::numbers;
use crate::files::memory_budget;
use crate::volume::{Segment, Voxel as _, VoxelStorage, Voxels};
use crate::with_voxels;
use ndarray::Array3;
use std::collections::BTreeMap;

/// Segment as the header of a `.seg.nrrd` file describes it.
#[derive(Debug, Default)]
struct Entry {
    value: Option<u32>,
    layer: Option<usize>,
    name: Option<String>,
    color: Option<[f32; 3]>,
}

impl Entry {
    /// Returns the named segment that has this label in the volume. A segment without a name has no entry in lists.
    fn segment(&self, label: u32) -> Option<Segment> {
        Some(Segment { label, name: self.name.clone()?, color: self.color })
    }
}

/// Reads the segments of a header, each with its number in the header. `fields` has the names of the fields behind
/// `segment`, and their values: `0_name:=` and `liver` for `Segment0_Name:=liver`.
fn entries<'a>(fields: impl Iterator<Item = (&'a str, &'a str)>) -> BTreeMap<u32, Entry> {
    let mut numbered: BTreeMap<u32, Entry> = BTreeMap::new();
    for (key, value) in fields {
        let Some((number, key)) = key.split_once('_') else { continue };
        let Ok(number) = number.parse() else { continue };
        let entry = numbered.entry(number).or_default();
        match key {
            "labelvalue:=" => entry.value = value.parse().ok(),
            "layer:=" => entry.layer = value.parse().ok(),
            "name:=" => entry.name = Some(value.to_owned()),
            "color:=" => {
                let color = numbers(value).and_then(|all| <[f64; 3]>::try_from(all).ok());
                entry.color = color.map(|color| color.map(|c| c.clamp(0.0, 1.0) as f32));
            }
            _ => {}
        }
    }
    numbered
}

/// Returns the named segments of a segmentation of one layer, in the order of their numbers. Segments without name or label
/// value are skipped. `fields` are the names of the fields behind `segment`, and their values.
pub(super) fn named_segments<'a>(fields: impl Iterator<Item = (&'a str, &'a str)>) -> Vec<Segment> {
    entries(fields).into_values().filter_map(|entry| entry.segment(entry.value?)).collect()
}

/// Layers of a segmentation with overlapping segments, and the label that each segment gets in the volume.
#[derive(Debug)]
pub(super) struct SegmentLayers {
    /// Number of layers.
    pub(super) count: usize,
    /// Label in the volume of each segment, by its layer and its value in that layer.
    labels: BTreeMap<(usize, u32), u32>,
    pub(super) segments: Vec<Segment>,
}

impl SegmentLayers {
    /// Gives each segment of a header a label of its own: its value, or the next unused number if a segment of another
    /// layer has this value. `None` if the header describes no segments. `fields` are as in [`named_segments`].
    pub(super) fn new<'a>(fields: impl Iterator<Item = (&'a str, &'a str)>, count: usize) -> Option<Self> {
        let entries = entries(fields);
        // Slicer 4 stores one segment a layer, in order, and all of them with the value 1.
        let placed = entries.iter().map(|(number, entry)| {
            let layer = entry.layer.unwrap_or(if entry.value.is_none() { *number as usize } else { 0 });
            ((layer, entry.value.unwrap_or(1)), entry)
        });
        let placed: Vec<_> = placed.filter(|((layer, value), _)| *layer < count && *value > 0).collect();
        let mut unused = placed.iter().map(|((_, value), _)| *value).max()?.checked_add(1);
        let mut this = Self { count, labels: BTreeMap::new(), segments: Vec::new() };
        for (place, entry) in placed {
            if this.labels.contains_key(&place) {
                continue;
            }
            let is_taken = this.labels.values().any(|label| *label == place.1);
            let label = if is_taken { unused? } else { place.1 };
            if is_taken {
                unused = label.checked_add(1);
            }
            this.labels.insert(place, label);
            this.segments.extend(entry.segment(label));
        }
        Some(this)
    }

    /// Merges the layers into one label a voxel: the last layer with a segment counts. `dims` has the number of voxels along
    /// x, y and z. Adds warnings about voxels in several segments, and about numbers that belong to no segment.
    ///
    /// # Errors
    /// The voxels are not in memory, or there is too little memory for the labels.
    pub(super) fn merge(
        &self,
        storage: VoxelStorage,
        [nx, ny, nz]: [usize; 3],
        warnings: &mut Vec<String>,
    ) -> Result<VoxelStorage, String> {
        let VoxelStorage::Resident(voxels) = storage else {
            return Err("its segments overlap (layers), so that it cannot be read in parts".into());
        };
        memory_budget::check_grid([nx, ny, nz], size_of::<u32>() as u64)?;
        let (mut labels, mut overlaps, mut unknown) = (Vec::with_capacity(nx * ny * nz), 0, 0);
        with_voxels!(&voxels, a => {
            for values in a.as_slice().unwrap_or_default().chunks_exact(self.count) {
                let (mut merged, mut found) = (0, 0);
                for (layer, value) in values.iter().enumerate() {
                    let value = value.to_f64();
                    if value == 0.0 {
                        continue;
                    }
                    match self.labels.get(&(layer, value as u32)).filter(|_| value.fract() == 0.0) {
                        Some(label) => {
                            found += 1;
                            merged = *label;
                        }
                        None => unknown += 1,
                    }
                }
                overlaps += usize::from(found > 1);
                labels.push(merged);
            }
        });
        if overlaps > 0 {
            warnings.push(format!(
                "{overlaps} voxels belong to several segments: they have that of the last layer"
            ));
        }
        if unknown > 0 {
            warnings.push(format!("{unknown} numbers of voxels belong to no segment: they were ignored"));
        }
        let most = labels.iter().copied().max().unwrap_or(0);
        let shape = (nz, ny, nx);
        macro_rules! stored_as {
            ($type:ty) => {
                Array3::from_shape_vec(shape, labels.into_iter().map(|label| label as $type).collect())
                    .map(Voxels::from)
            };
        }
        let merged = match most {
            0..=0xff => stored_as!(u8),
            0x100..=0xffff => stored_as!(u16),
            _ => stored_as!(f64),
        };
        merged.map(VoxelStorage::from).map_err(|e| e.to_string())
    }
}
