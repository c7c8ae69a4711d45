//! Every tolerance of the device's tests, with its reason.

/// Pictures with and without brick skipping: samples sit on one lattice, so only sums of zeros may differ. A published tolerance.
pub const SKIPPING: f64 = 1e-5;

/// rms over RGBA of a picture by `rays` against the exact one: eye steps of half a voxel. A published tolerance.
pub const RAYS_PICTURE_RMS: f64 = 0.005;
/// Error of `dsm:epsilon=0.005` likewise: map texels as large as voxels blur the edges of shadows. A published tolerance.
pub const DSM_PICTURE_RMS: f64 = 0.015;
/// Error of `rays` with shaded surfaces likewise: in 32 x 24 pixels the gradient at a jump is seen by few of them.
pub const SHADED_PICTURE_RMS: f64 = 0.02;

/// A map's transmittance never rises, but float32 texel coordinates of points of one ray differ by up to 1e-5 of a
/// texel and so weigh in neighbours.
pub const MAP_RISE: f64 = 1e-4;
/// Shadow rays that start at different depths sum different pieces; each may be off by what the method promises
/// (1e-3).
pub const RAYS_RISE: f64 = 2e-3;
/// Transmittance is a mean of stored values or the exponential of a sum of terms >= 0: float32 rounding of 1 alone.
pub const RANGE: f64 = 1e-6;

/// Rows of a world turned by 90 degrees are other float32 numbers: what rounding of positions (1e-5 voxels) makes
/// of a picture through a function of slope 1 per voxel.
pub const TURNED: f64 = 1e-3;
/// Tolerance where the filter keeps 8 bits of a weight: values are off by a 512th of what neighbours differ by
/// (0.02 on an NVIDIA H100).
pub const TURNED_IN_8_BITS: f64 = 0.05;

/// Layers at every sample converge to the exact curve. A published tolerance.
pub const LAYERS_EVERYWHERE: f64 = 0.01;
/// Optical depth of a point behind everything. A published tolerance.
pub const FULL_DEPTH: f64 = 1e-3;

/// Work that is forced back on changes rounding alone.
pub const FORCED: f64 = 1e-5;
