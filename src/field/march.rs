//! March of light rays and the limits of its arithmetic.

/// March of light rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum March {
    /// Cell by cell, exactly.
    Cells,
    /// Regular samples with the integral of the transfer function between them.
    Samples {
        /// Distance of samples, in smallest voxel spacings.
        step: f64,
    },
    /// Segments of the strands that the volume was made from, instead of the volume.
    Lines,
}

/// Tolerance of a breakpoint's value in the light march, relative to the largest value of the piece: 2^-22, four units in
/// the last place.
pub(super) const ROOT_TOLERANCE: f32 = 1.0 / 4_194_304.0;
/// Shortest piece that the light march subdivides, in smallest voxel spacings.
pub const SHORT_PIECE: f64 = 0.01;

/// Pieces of a partial sum of optical depth.
pub(super) const PARTS_OF_SUM: u32 = 64;
/// Largest number of pieces of a light ray: with more, the rounding of their sum could exceed the error bound.
pub(super) const MOST_PIECES: u32 = PARTS_OF_SUM * (MOST_ROUNDINGS - PARTS_OF_SUM);
/// Largest number of successive roundings in the optical depth of a light ray.
pub const MOST_ROUNDINGS: u32 = 5000;

/// Abscissas and weights of 4-point Gauss-Legendre quadrature on [0, 1], the other two by symmetry; exact for polynomials of
/// degree 7.
pub const GAUSS: [[f64; 2]; 2] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_87, 0.326_072_577_431_273_07],
];
/// Optical depth of a whole ray of which a tenth may be lost each time that opacity nears 1, in three pieces a cell.
pub const UNEVEN_DEPTH: f64 = 4e-4;
