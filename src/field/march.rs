//! Ways to march along light rays, and the limits of the march's float32 arithmetic.

/// Way to march along the light rays of a shadow map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum March {
    /// Marches a light ray cell by cell, and integrates its extinction exactly.
    Cells,
    /// Takes regular samples along a light ray, and integrates the transfer function between them.
    Samples {
        /// Distance between samples along a light ray, in units of the smallest voxel spacing.
        step: f64,
    },
    /// Takes the strand segments that cross a light ray, instead of the voxels made from them.
    Lines,
}

/// Tolerance of the voxel value where the light march locates a breakpoint of the transfer function. It is relative
/// to the largest value on that piece of the ray: 2^-22, four units in the last place.
pub(super) const ROOT_TOLERANCE: f32 = 1.0 / 4_194_304.0;
/// Shortest piece of a light ray that the march subdivides, in units of the smallest voxel spacing.
pub const SHORT_PIECE: f64 = 0.01;

/// Number of terms in one partial sum of a light ray's optical depth.
pub(super) const PARTS_OF_SUM: u32 = 64;
/// Largest number of pieces of a light ray. With more, the rounding of the sum of their optical depths could exceed
/// the error bound.
pub(super) const MOST_PIECES: u32 = PARTS_OF_SUM * (MOST_ROUNDINGS - PARTS_OF_SUM);
/// Largest number of successive float32 roundings in the optical depth of a light ray.
pub const MOST_ROUNDINGS: u32 = 5000;

/// Abscissas and weights of 4-point Gauss-Legendre quadrature on [0, 1]; symmetry gives the other two. The rule is
/// exact for polynomials up to degree 7.
pub const GAUSS: [[f64; 2]; 2] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_87, 0.326_072_577_431_273_07],
];
/// Upper limit on the summed optical depth of those pieces of a light ray that are not subdivided although their
/// opacity nears 1. Quadrature may lose a tenth of it, in each of up to three pieces per cell.
pub const UNEVEN_DEPTH: f64 = 4e-4;
