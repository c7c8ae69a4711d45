//! Counts of curve nodes in each texel of a deep shadow map (Hadwiger et al. 2006, Figure 5), read back from the
//! device on request.

use super::layout::{self, DEPTH_STEPS, NAME};
use crate::error::{Error, Result};
use crate::field::{DeviceTransfer, NO_TILE, TILE, line_of_workgroups};
use crate::gpu::{DevicePass, Kernels, Read, ShaderVariant, Slot, StorageBuffer};
use crate::shadow::method::ShadowMap;
use ndarray::Array2;

/// Largest number of deep shadow map texels whose curve nodes one GPU dispatch counts; it limits the size of the
/// buffers.
const TEXELS_AT_ONCE: usize = 1 << 22;

/// Number of curve nodes in each texel of a deep shadow map, and which tiles of the map are stored.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeMap {
    /// Number of curve nodes in each texel of the deep shadow map, as rows by columns. It is 0 if the texel's light
    /// ray meets no extinction or its tile is skipped.
    pub nodes: Array2<u32>,
    /// Whether each tile of the deep shadow map is stored, as rows by columns; a tile has [`TILE`] texels per side.
    pub stored: Array2<bool>,
}

impl NodeMap {
    /// Creates the map of node counts from one count for each deep shadow map texel, row by row; [`NO_TILE`] marks
    /// texels of skipped tiles.
    fn from_counts(map_size: u32, counts: Vec<u32>) -> Result<Self> {
        let (side, across) = (map_size as usize, map_size.div_ceil(TILE) as usize);
        let broken =
            |e: ndarray::ShapeError| Error::runtime("cannot count nodes", "deep shadow map", e.to_string());
        let mut nodes = Array2::from_shape_vec((side, side), counts).map_err(broken)?;
        let tile = TILE as usize;
        let stored = Array2::from_shape_fn((across, across), |(y, x)| nodes[[y * tile, x * tile]] != NO_TILE);
        nodes.mapv_inplace(|n| if n == NO_TILE { 0 } else { n });
        Ok(Self { nodes, stored })
    }

    /// Returns, for each tile of the deep shadow map, the largest number of curve nodes in one of its texels (the
    /// layers of a block in Hadwiger et al. 2006).
    pub fn most_by_tile(&self) -> Array2<u32> {
        let tile = TILE as usize;
        let mut most = Array2::zeros(self.stored.dim());
        for ((y, x), &n) in self.nodes.indexed_iter() {
            let entry = &mut most[[y / tile, x / tile]];
            *entry = n.max(*entry);
        }
        most
    }

    /// Returns the number of deep shadow map texels that have 0, 1, 2, ... curve nodes.
    pub fn histogram(&self) -> Vec<u64> {
        let most = self.nodes.iter().copied().max().unwrap_or(0);
        let mut texels = vec![0; most as usize + 1];
        self.nodes.iter().for_each(|&n| texels[n as usize] += 1);
        texels
    }
}

pub(super) fn shader() -> ShaderVariant {
    layout::map_shader("shadow/dsm/count.wgsl")
}

/// Counts the curve nodes in each texel of a deep shadow map; returns `None` for a shadow map of another method.
///
/// # Errors
/// The GPU device is lost or out of memory.
pub fn node_map(kernels: &Kernels, transfer: &DeviceTransfer, shadow: &ShadowMap) -> Result<Option<NodeMap>> {
    if shadow.method != NAME {
        return Ok(None);
    }
    let gpu = kernels.gpu();
    let map_size = shadow.light_space.map_size;
    let texels = map_size as usize * map_size as usize;
    let mut counts = Vec::with_capacity(texels);
    for first in (0..texels).step_by(TEXELS_AT_ONCE) {
        let here = TEXELS_AT_ONCE.min(texels - first);
        let start = StorageBuffer::from_slice(gpu, "first texel", &[first as u32; 4])?;
        let node_counts = StorageBuffer::zeroed(gpu, "nodes by texel", here as u64 * 4)?;
        let stage = [
            (0, Slot::read(start.as_entire_binding())),
            (1, Slot::read_write(node_counts.as_entire_binding())),
        ];
        let groups = [transfer.group(), &shadow.group, &kernels.group("node count", &stage)];
        let (variant, workgroups) = (&shader(), line_of_workgroups(here));
        let pass = DevicePass { variant, groups: &groups, workgroups };
        let (_, words) = kernels.run("node count", &[pass], &[Read { buffer: &node_counts, words: here }])?;
        counts.extend(words.into_iter().flatten());
    }
    NodeMap::from_counts(map_size, counts).map(Some)
}

pub(super) fn steps_shader() -> ShaderVariant {
    layout::map_shader("shadow/dsm/steps.wgsl")
}

/// Returns the depths (mm, increasing away from the light) of all curve nodes of the given deep shadow map texels
/// `[column, row]`. Returns `None` for a shadow map of another method.
///
/// # Errors
/// The GPU device is lost or out of memory.
pub fn node_depths(
    kernels: &Kernels,
    transfer: &DeviceTransfer,
    shadow: &ShadowMap,
    texels: &[[u32; 2]],
) -> Result<Option<Vec<Vec<f64>>>> {
    let Some(map) = node_map(kernels, transfer, shadow)? else { return Ok(None) };
    let gpu = kernels.gpu();
    let space = &shadow.light_space;
    let mm_a_step = space.depth_range_mm() / f64::from(DEPTH_STEPS);
    let mut depths = Vec::with_capacity(texels.len());
    for texels in texels.chunks(TEXELS_AT_ONCE / 16) {
        let counts: Vec<u32> = texels.iter().map(|[c, r]| map.nodes[[*r as usize, *c as usize]]).collect();
        let mut total = 0;
        let mut places = Vec::with_capacity(texels.len());
        for ([column, row], count) in texels.iter().zip(&counts) {
            places.push([row * space.map_size + column, total]);
            total += count;
        }
        let requests = StorageBuffer::from_slice(gpu, "texels", &places)?;
        let node_steps = StorageBuffer::zeroed(gpu, "steps of nodes", u64::from(total) * 4)?;
        let stage = [
            (0, Slot::read(requests.as_entire_binding())),
            (1, Slot::read_write(node_steps.as_entire_binding())),
        ];
        let groups = [transfer.group(), &shadow.group, &kernels.group("steps of nodes", &stage)];
        let (variant, workgroups) = (&steps_shader(), line_of_workgroups(places.len()));
        let pass = DevicePass { variant, groups: &groups, workgroups };
        let read = Read { buffer: &node_steps, words: total as usize };
        let (_, words) = kernels.run("steps of nodes", &[pass], &[read])?;
        let mut rest = words.first().map_or(&[][..], |steps| steps);
        for count in counts {
            let (texel_steps, others) = rest.split_at(count as usize);
            rest = others;
            depths.push(texel_steps.iter().map(|s| space.z_range[0] + f64::from(*s) * mm_a_step).collect());
        }
    }
    Ok(Some(depths))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_take_their_fullest_texel_and_the_histogram_counts_every_texel() {
        // 20 x 20 texels: four tiles, three of them cut by the border, one of them skipped.
        let mut counts = vec![0; 400];
        counts[3 * 20 + 5] = 7;
        counts[15 * 20 + 15] = 9;
        counts[16 * 20 + 19] = 4;
        (0..16).for_each(|y| (16..20).for_each(|x| counts[y * 20 + x] = NO_TILE));
        let map = NodeMap::from_counts(20, counts).unwrap();
        assert_eq!(map.most_by_tile(), ndarray::arr2(&[[9, 0], [0, 4]]));
        assert_eq!(map.stored, ndarray::arr2(&[[true, false], [true, true]]));
        let histogram = map.histogram();
        assert_eq!(histogram.len(), 10);
        assert_eq!((histogram[0], histogram[4], histogram[7], histogram[9]), (397, 1, 1, 1));
        assert!(NodeMap::from_counts(20, vec![0; 399]).is_err());
    }
}
