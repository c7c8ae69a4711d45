//! Ways to march along the light rays of a shadow map, and constants of the march's float32 arithmetic.

/// Way to march along the light rays of a shadow map: by cells, by samples, or by strands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum March {
    /// Marches a light ray cell by cell, and integrates its extinction exactly.
    Cells,
    /// Takes regular samples along a light ray, and integrates the transfer function between them.
    Samples {
        /// Distance between samples along a light ray, in units of the smallest voxel spacing.
        step: f64,
    },
    /// Uses the strand segments (hair or fibres) that a light ray crosses, instead of the volume into which they were
    /// voxelised.
    Lines,
}

/// Tolerance of the voxel value where the light march finds a breakpoint of the transfer function by root search. It
/// is relative to the largest voxel value on that interval of the ray: 2^-22, four units in the last place.
pub(super) const ROOT_TOLERANCE: f32 = 1.0 / 4_194_304.0;
/// Length below which the march does not subdivide an interval of a light ray any further, in units of the smallest
/// voxel spacing.
pub const SHORT_PIECE: f64 = 0.01;

/// Number of terms in each partial sum of a light ray's optical depth.
pub(super) const PARTS_OF_SUM: u32 = 64;
/// Largest number of intervals into which the march divides a light ray. With more, the rounding of their summed
/// optical depth could exceed the error bound.
pub(super) const MOST_PIECES: u32 = PARTS_OF_SUM * (MOST_ROUNDINGS - PARTS_OF_SUM);
/// Largest number of successive float32 roundings in the optical depth of a light ray.
pub const MOST_ROUNDINGS: u32 = 5000;

/// Abscissas and weights of 4-point Gauss-Legendre quadrature on [0, 1]; symmetry gives the other two of each. The
/// rule is exact for polynomials up to degree 7.
pub const GAUSS: [[f64; 2]; 2] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_87, 0.326_072_577_431_273_07],
];
/// Largest total optical depth of those intervals of a light ray that are not subdivided although their opacity is
/// close to 1. Quadrature loses at most a tenth of this optical depth, in each of up to three intervals per cell.
pub const UNEVEN_DEPTH: f64 = 4e-4;
