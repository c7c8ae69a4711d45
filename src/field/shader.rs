//! The shader modules of this room, the constants that they share with the host, and how a variant takes them in.

use super::constants::{FAR, HIDDEN_SHIFT, LINE_THREADS, NO_TILE, TILE};
use super::light_space::Projection;
use crate::gpu::{Constant, ShaderVariant, WORK_KINDS, WORK_WORDS};
use crate::transfer::{
    MAX_INTERVALS, MAX_OPACITY, MORE_NODES, MOST_CLIP_PLANES, PAIR_BINS, TABLE_BINS, VALUE_BINS,
};
use crate::volume::{BRICK_CELLS, MAX_LABELS};

/// The modules that march light rays: cell by cell, by regular samples, and from segment to segment of strands.
const MARCH_CELLS: &str = "field/march.wgsl";
const MARCH_SAMPLES: &str = "field/march_samples.wgsl";
const MARCH_STRANDS: &str = "field/march_strands.wgsl";
/// Where what strands do to the rays of texels is bound in group 2.
pub(super) const LINES_BINDING: u32 = 15;
/// The module that marches along rays by regular samples.
const RAY_MARCH: &str = "field/ray_march.wgsl";

/// Defined if marches by regular samples skip bricks without extinction.
const SKIP_BRICKS: &str = "SKIP_BRICKS";

/// The sink that only adds up optical depth.
pub const DEPTH_SINK: &str = "field/depth_sink.wgsl";

/// How light rays are marched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum March {
    /// Cell by cell: every one exactly.
    Cells,
    /// By regular samples with the transfer function's integrals between them.
    Samples {
        /// Their distance, in smallest voxel spacings.
        step: f64,
    },
    /// Not through the field: through the strands that it was made from, each segment as a piece of the rays that it crosses.
    Lines,
}

/// Value to which the light march finds a breakpoint, as a share of the largest of the stretch: 2^-22, four units in the
/// last place.
pub(super) const ROOT_TOLERANCE: f32 = 1.0 / 4_194_304.0;
/// Length below which the light march cuts no piece further, in smallest voxel spacings.
pub const SHORT_PIECE: f64 = 0.01;

/// Pieces that a sink adds up by themselves before they join the others.
const PARTS_OF_SUM: u32 = 64;
/// Pieces of a light ray beyond which it is refused: their sums might be off by more than is promised.
const MOST_PIECES: u32 = PARTS_OF_SUM * (MOST_ROUNDINGS - PARTS_OF_SUM);
/// Roundings, one after another, of the optical depth of a light ray whose pieces were added up.
pub const MOST_ROUNDINGS: u32 = 5000;

/// Points and weights of Gauss and Legendre's four on [0, 1], the other two by symmetry: exact to the seventh degree.
pub const GAUSS: [[f64; 2]; 2] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_87, 0.326_072_577_431_273_07],
];
/// Optical depth of a whole ray of which a tenth may be lost each time that opacity nears 1, in three stretches a cell.
pub const UNEVEN_DEPTH: f64 = 4e-4;

const CONSTANTS: &[Constant] = &[
    Constant::unsigned("WORK_KINDS", WORK_KINDS),
    Constant::unsigned("WORK_WORDS", WORK_WORDS),
    Constant::float("GAUSS_OUTER", GAUSS[0][0] as f32),
    Constant::float("GAUSS_INNER", GAUSS[1][0] as f32),
    Constant::float("OUTER_WEIGHT", GAUSS[0][1] as f32),
    Constant::float("INNER_WEIGHT", GAUSS[1][1] as f32),
    Constant::float("UNEVEN_DEPTH", UNEVEN_DEPTH as f32),
    Constant::float("ROOT_TOLERANCE", ROOT_TOLERANCE),
    Constant::float("SHORT_PIECE", SHORT_PIECE as f32),
    Constant::signed("BRICK_CELLS", BRICK_CELLS as i32),
    Constant::unsigned("BRICK_SHIFT", BRICK_CELLS.ilog2()),
    Constant::float("FAR", FAR),
    Constant::float("HIDDEN_SHIFT", HIDDEN_SHIFT),
    Constant::unsigned("LABEL_VECTORS", MAX_LABELS as u32 / 4),
    Constant::unsigned("MOST_CLIP_PLANES", MOST_CLIP_PLANES as u32),
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
];

/// A variant that reads the field and the light space; methods with tiles have the tile table too.
pub fn field_shader(entry: &'static str) -> ShaderVariant {
    let modules = [
        "field/watch.wgsl",
        "field/work.wgsl",
        "field/quirks.wgsl",
        "field/field.wgsl",
        "field/labels.wgsl",
        "field/transfer.wgsl",
        "field/light.wgsl",
    ];
    ShaderVariant::of(entry).modules(&modules).constants(CONSTANTS)
}

impl ShaderVariant {
    /// With the tile table, which lookups and passes over tiles find their records by.
    #[must_use]
    pub fn with_tile_table(self) -> Self {
        self.modules(&["field/tile_table.wgsl"])
    }

    /// With a march, which hands its pieces to a sink.
    #[must_use]
    pub fn with_march(self, march: March, sink: &'static str) -> Self {
        let shader = self.modules(&["field/sums.wgsl", sink]);
        match march {
            March::Cells => shader.modules(&[MARCH_CELLS]),
            March::Samples { .. } => shader.modules(&[RAY_MARCH, MARCH_SAMPLES]).defs([SKIP_BRICKS]),
            March::Lines => shader.modules(&[MARCH_STRANDS]),
        }
    }

    /// Adds marches along rays by regular samples, which may skip bricks without extinction.
    #[must_use]
    pub fn with_ray_march(self, skip_bricks: bool) -> Self {
        self.modules(&[RAY_MARCH]).defs(skip_bricks.then_some(SKIP_BRICKS))
    }

    /// With the march cell by cell and the sink that only adds up optical depth.
    #[must_use]
    pub fn with_depth_march(self) -> Self {
        self.with_march(March::Cells, DEPTH_SINK)
    }
}

/// Whether a variant marches light rays cell by cell, and so needs the pre-compressed table.
pub fn marches_cells(variant: &ShaderVariant) -> bool {
    variant.modules.contains(&MARCH_CELLS)
}

/// Workgroups of [`LINE_THREADS`] for so many things.
pub fn line_of_workgroups(things: usize) -> [u32; 3] {
    shape_of((things as u32).div_ceil(LINE_THREADS))
}

/// So many workgroups in two dimensions, since one holds no more than 65,535: no more rows than that takes, and less than a
/// workgroup a row that has nothing to do.
pub fn shape_of(workgroups: u32) -> [u32; 3] {
    let rows = workgroups.div_ceil(65_535).max(1);
    [workgroups.div_ceil(rows).max(1), rows, 1]
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
        assert_eq!((shape_of(0), line_of_workgroups(20_000)), ([1, 1, 1], [313, 1, 1]));
    }
}
