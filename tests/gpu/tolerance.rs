//! Tolerances of the tests on a device, with their reasons.

/// Allowed difference between pictures with and without brick skipping: samples lie on one lattice, so only sums of
/// zeros may differ. A published tolerance.
pub const SKIPPING: f64 = 1e-5;

/// Allowed rms over RGBA of a picture by `rays` against the exact one, for eye steps of half a voxel. A published
/// tolerance.
pub const RAYS_PICTURE_RMS: f64 = 0.005;
/// Allowed rms over RGBA of a picture by `dsm:epsilon=0.005` against the exact one: map texels as large as voxels
/// blur the edges of shadows. A published tolerance.
pub const DSM_PICTURE_RMS: f64 = 0.015;
/// Rms of a picture with a gradient opacity and a shadow ray for each segment: factors that jump within a cell.
pub const GRADIENT_PICTURE_RMS: f64 = 0.006;
/// Allowed rms over RGBA of a picture of shaded surfaces by `rays` against the exact one: few of its 32 x 24 pixels
/// show the gradient at a jump.
pub const SHADED_PICTURE_RMS: f64 = 0.02;

/// Allowed rise of a shadow map's transmittance along a ray. It never rises within a texel, but float32 texel
/// coordinates differ by up to 1e-5 of a texel and mix in neighbours.
pub const MAP_RISE: f64 = 1e-4;
/// Allowed rise of transmittance by shadow rays: rays that start at different depths sum different pieces, each
/// within the error bound of 1e-3.
pub const RAYS_RISE: f64 = 2e-3;
/// Allowed deviation of transmittance from [0, 1]: float32 rounding of 1.
pub const RANGE: f64 = 1e-6;

/// Allowed difference of pictures of a world rotated by 90 degrees: positions round differently (1e-5 voxels), with a
/// transfer function of slope 1 per voxel.
pub const TURNED: f64 = 1e-3;
/// Allowed difference of rotated pictures if the filter has 8-bit weights: values differ by a 512th of the difference
/// of neighbours (0.02 on an NVIDIA H100).
pub const TURNED_IN_8_BITS: f64 = 0.05;

/// Allowed error of layered maps with a layer at every sample, which converge to the exact curve. A published
/// tolerance.
pub const LAYERS_EVERYWHERE: f64 = 0.01;
/// Allowed error of the optical depth at a point behind all matter. A published tolerance.
pub const FULL_DEPTH: f64 = 1e-3;

/// Allowed change of a picture by work that is forced on: only rounding.
pub const FORCED: f64 = 1e-5;
