//! WGSL modules of the scalar field (volume, transfer function, light march), and the constants that they share with
//! the host.

use super::constants::{FAR, HIDDEN_SHIFT, LINE_THREADS, NO_TILE, TILE};
use super::gradient_uniform::{GRADIENT_BINDING, GRADIENT_VECTORS};
use super::light_space::Projection;
use super::march::{GAUSS, MOST_PIECES, March, PARTS_OF_SUM, ROOT_TOLERANCE, SHORT_PIECE, UNEVEN_DEPTH};
use super::page_stream::{MISSING, NEAR_MISSING, WAITING_BINDING};
use super::pages::{PAGE_CELLS, PAGE_VOXELS};
use crate::gpu::{Constant, MAX_BLOCKS, ShaderVariant, WORK_KINDS, WORK_WORDS};
use crate::transfer::{
    MAX_INTERVALS, MAX_OPACITY, MORE_NODES, MOST_CLIP_PLANES, PAIR_BINS, TABLE_BINS, VALUE_BINS,
};
use crate::volume::{BRICK_CELLS, MAX_LABELS};

/// WGSL modules for marching along light rays: cell by cell, by regular samples, and through the segments of strands.
const MARCH_CELLS: &str = "field/march.wgsl";
const MARCH_SAMPLES: &str = "field/march_samples.wgsl";
const MARCH_STRANDS: &str = "field/march_strands.wgsl";
/// Binding number, in bind group 2, of the buffer with the strand segments that the light rays of a shadow map cross.
pub(super) const LINES_BINDING: u32 = 15;
/// Binding number, in bind group 2, of the states of rays that wait for pages of the volume.
pub const RAY_STATE_BINDING: u32 = 14;
/// Shader definition (`#ifdef`) of passes whose rays wait for pages of the volume, and resume.
pub const RAY_STATES: &str = "RAY_STATES";
/// Number of words in the state of a ray that marches cell by cell, without those of its sink.
const MARCH_WORDS: u32 = 6;
/// Constant with the number of words in the state of a ray.
const RAY_STATE_WORDS: &str = "RAY_STATE_WORDS";
/// WGSL module for marching along a ray by regular samples.
const RAY_MARCH: &str = "field/ray_march.wgsl";

/// Shader definition (`#ifdef`) that lets sampled ray marching skip bricks (blocks of voxel cells) without
/// extinction.
const SKIP_BRICKS: &str = "SKIP_BRICKS";

/// WGSL module that adds up the optical depth of the intervals of a light ray, as the light march delivers them.
pub const DEPTH_SINK: &str = "field/depth_sink.wgsl";

const CONSTANTS: &[Constant] = &[
    Constant::unsigned("WORK_KINDS", WORK_KINDS),
    Constant::unsigned("WORK_WORDS", WORK_WORDS),
    Constant::unsigned("MAX_BLOCKS", MAX_BLOCKS),
    Constant::float("GAUSS_OUTER", GAUSS[0][0] as f32),
    Constant::float("GAUSS_INNER", GAUSS[1][0] as f32),
    Constant::float("OUTER_WEIGHT", GAUSS[0][1] as f32),
    Constant::float("INNER_WEIGHT", GAUSS[1][1] as f32),
    Constant::float("UNEVEN_DEPTH", UNEVEN_DEPTH as f32),
    Constant::float("ROOT_TOLERANCE", ROOT_TOLERANCE),
    Constant::float("SHORT_PIECE", SHORT_PIECE as f32),
    Constant::signed("BRICK_CELLS", BRICK_CELLS as i32),
    Constant::unsigned("BRICK_SHIFT", BRICK_CELLS.ilog2()),
    Constant::unsigned("PAGE_SHIFT", PAGE_CELLS.ilog2()),
    Constant::signed("PAGE_VOXELS", PAGE_VOXELS as i32),
    Constant::unsigned("MISSING", MISSING),
    Constant::unsigned("NEAR_MISSING", NEAR_MISSING),
    Constant::unsigned("WAITING_BINDING", WAITING_BINDING),
    Constant::unsigned("RAY_STATE_BINDING", RAY_STATE_BINDING),
    Constant::float("FAR", FAR),
    Constant::float("HIDDEN_SHIFT", HIDDEN_SHIFT),
    Constant::unsigned("LABEL_VECTORS", MAX_LABELS as u32 / 4),
    Constant::unsigned("MOST_CLIP_PLANES", MOST_CLIP_PLANES as u32),
    // Optical depth that ends a shadow ray: its transmittance is below 1e-6.
    Constant::float("ENOUGH_DEPTH", 13.8),
    Constant::unsigned("PARTS_OF_SUM", PARTS_OF_SUM),
    Constant::unsigned("MOST_PIECES", MOST_PIECES),
    Constant::float("MAX_OPACITY", MAX_OPACITY as f32),
    Constant::unsigned("VALUE_BINS", VALUE_BINS as u32),
    Constant::unsigned("VALUE_BIN_VECTORS", VALUE_BINS as u32 / 4),
    Constant::unsigned("TABLE_BINS", TABLE_BINS as u32),
    Constant::unsigned("PAIR_BINS", PAIR_BINS as u32),
    Constant::unsigned("MORE_NODES", MORE_NODES as u32),
    Constant::unsigned("MAX_INTERVALS", MAX_INTERVALS as u32),
    Constant::unsigned("PERSPECTIVE", Projection::Perspective as u32),
    Constant::unsigned("OCTAHEDRAL", Projection::Octahedral as u32),
    Constant::unsigned("TILE", TILE),
    Constant::unsigned("NO_TILE", NO_TILE),
    Constant::unsigned("LINE_THREADS", LINE_THREADS),
    Constant::signed("LINES_BINDING", LINES_BINDING as i32),
    Constant::signed("GRADIENT_BINDING", GRADIENT_BINDING as i32),
    Constant::unsigned("GRADIENT_VECTORS", GRADIENT_VECTORS as u32),
];

/// Returns a shader variant that can read the volume, the transfer function and the projection of a shadow map.
pub fn field_shader(entry: &'static str) -> ShaderVariant {
    let modules = [
        "field/watch.wgsl",
        "field/work.wgsl",
        "field/tuning.wgsl",
        "field/field.wgsl",
        "field/ray_state.wgsl",
        "field/cubic.wgsl",
        "field/labels.wgsl",
        "field/transfer.wgsl",
        "field/gradient_opacity.wgsl",
        "field/gradient_depth.wgsl",
        "field/light.wgsl",
    ];
    ShaderVariant::of(entry).modules(&modules).constants(CONSTANTS)
}

impl ShaderVariant {
    /// Adds the WGSL module of a shadow map's tile table, which gives the index of the data record of each texel.
    #[must_use]
    pub fn with_tile_table(self) -> Self {
        self.modules(&["field/tile_table.wgsl"])
    }

    /// Adds the WGSL modules for marching along light rays. The march hands each interval of a ray to the WGSL module
    /// `sink`.
    #[must_use]
    pub fn with_march(self, march: March, sink: &'static str) -> Self {
        let shader = self.modules(&["field/sums.wgsl", sink]);
        match march {
            March::Cells => shader.modules(&[MARCH_CELLS]),
            March::Samples { .. } => shader.modules(&[RAY_MARCH, MARCH_SAMPLES]).defs([SKIP_BRICKS]),
            March::Lines => shader.modules(&[MARCH_STRANDS]),
        }
    }

    /// Adds the WGSL modules that march a light ray within a shader that casts eye rays or queries points, and add up its
    /// optical depth. A march by samples shares its module, and whether it skips bricks, with the eye rays.
    #[must_use]
    pub fn with_shadow_rays(self, march: March) -> Self {
        match march {
            March::Samples { .. } => self.modules(&["field/sums.wgsl", DEPTH_SINK, RAY_MARCH, MARCH_SAMPLES]),
            _ => self.with_march(march, DEPTH_SINK),
        }
    }

    /// Adds the WGSL module for marching along rays by regular samples. With `skip_bricks`, it skips bricks (blocks
    /// of voxel cells) without extinction.
    #[must_use]
    pub fn with_ray_march(self, skip_bricks: bool) -> Self {
        let known = self.modules.contains(&RAY_MARCH);
        self.modules(if known { &[] } else { &[RAY_MARCH] }).defs(skip_bricks.then_some(SKIP_BRICKS))
    }

    /// Lets the light rays of a march by cells wait for pages of the volume. The state of the sink has `sink_words`
    /// words, which its functions `save_sink` and `load_sink` write and read.
    #[must_use]
    pub fn with_ray_states(self, sink_words: u32) -> Self {
        self.constants(&[Constant::unsigned(RAY_STATE_WORDS, MARCH_WORDS + sink_words)])
    }

    /// Returns the number of words in the state of a ray that waits for pages; `None` if rays of this shader cannot wait.
    pub fn ray_state_words(&self) -> Option<u32> {
        self.constants.iter().find_map(|constant| constant.unsigned_value(RAY_STATE_WORDS))
    }

    /// Adds the WGSL modules that march light rays cell by cell and add up their optical depth.
    #[must_use]
    pub fn with_depth_march(self) -> Self {
        self.with_march(March::Cells, DEPTH_SINK)
    }
}

/// Whether a shader marches light rays cell by cell, and so needs the lookup table of transfer-function breakpoints.
pub fn marches_cells(variant: &ShaderVariant) -> bool {
    variant.modules.contains(&MARCH_CELLS)
}

/// Whether a shader marches light rays by samples.
pub fn marches_samples(variant: &ShaderVariant) -> bool {
    variant.modules.contains(&MARCH_SAMPLES)
}

/// Returns the dispatch size of a compute pass with one thread per item, in workgroups of [`LINE_THREADS`] threads.
pub fn line_of_workgroups(items: usize) -> [u32; 3] {
    shape_of((items as u32).div_ceil(LINE_THREADS))
}

/// Returns a two-dimensional dispatch size for the given number of workgroups, since one dimension holds at most
/// 65,535. It has as few rows as possible, and fewer idle workgroups than rows. No workgroups run for 0.
pub fn shape_of(workgroups: u32) -> [u32; 3] {
    let rows = workgroups.div_ceil(65_535).max(1);
    [workgroups.div_ceil(rows), rows, 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_workgroup_has_work_but_for_the_last_of_rows() {
        for workgroups in [1, 2, 255, 256, 257, 262, 1025, 65_535] {
            assert_eq!(shape_of(workgroups), [workgroups, 1, 1]);
        }
        for workgroups in [65_536, 70_001, 131_071, 1_000_003] {
            let [across, rows, _] = shape_of(workgroups);
            assert!(across <= 65_535 && rows == workgroups.div_ceil(65_535));
            assert!(
                (workgroups..workgroups + rows).contains(&(across * rows)),
                "{workgroups}: {across} x {rows}"
            );
        }
        assert_eq!((shape_of(0), line_of_workgroups(20_000)), ([0, 1, 1], [313, 1, 1]));
    }
}
