//! Shadow method `moments`: moment-based transmittance.
//!
//! Münstermann, Krumpen, Klein and Peters 2018, *Moment-Based Order-Independent Transparency*, and Peters,
//! Münstermann, Wetzstein and Klein 2016, *Beyond Hard Shadows: Moment Shadow Maps for Single Scattering, Soft
//! Shadows and Translucent Occluders*. A texel stores the optical depth `b_0` of its light ray and the first moments
//! `b_1 ... b_n` of its distribution over depth. With `basis=power` the moments are means of powers of the depth,
//! scaled to -1 to 1 over the map's range. With `basis=trigonometric` they are means of points on the unit circle: 2,
//! 3 or 4 complex numbers, i.e. 4, 6 or 8 real ones. Moments are sums, and so can be blended and filtered.
//!
//! Moments bound the share of `b_0` in front of any depth from below and above. The optical depth used lies between
//! these bounds, at the fraction `beta` (the paper's overestimation). With `basis=power`, `beta=0` is never darker
//! than the exact transmittance and `beta=1` never lighter, except for rounding and bias. On the circle these are no
//! bounds, since points in the wrapping zone, in which the circle closes, count only partly. The result is exact for
//! up to `n / 2` thin sheets.
//!
//! Deviations from the papers, and why:
//! * A segment of the light ray has a length: its moments are the means over it, in closed form. The papers use
//!   points.
//! * The bounds follow from the weights of the canonical distribution (Tari et al. 2005), which come from its kernel
//!   polynomial, not from an interpolating polynomial. They are positive and normalised to a sum of one, so that
//!   transmittance stays between `exp(-b_0)` and 1. Roots are relative to the depth of the query, where they are
//!   finite, also on the circle.
//! * `measure=light` stores the moments of absorbed light, `-dT`, instead of optical depth, and the total absorbed light
//!   instead of `b_0`. Averages of neighbouring texels are then averages of transmittance.
//! * A point in the wrapping zone (a tenth of pi) counts by its angle.
//! * In exact arithmetic transmittance falls with depth for powers, and may rise on the circle if matter lies close
//!   to an end of the range. In float32 it also rises for powers in thin matter, whose moments are nearly those of
//!   fewer sheets: by up to 0.04 in the worst `stability` case.
//! * Depth is linear over the map's range, as in the shadow maps of 2016; for transparency the paper warps it by a
//!   logarithm.
//! * With `bits=16` a moment is stored in even steps from -1 to 1. The papers store powers after a matrix that was
//!   optimised for rounding; here the means of Chebyshev polynomials are stored, from which powers follow with
//!   positive weights. The optical depth is a 32-bit float, as in the papers. The shader filters texels, since core
//!   WebGPU stores no 16-bit steps and not every adapter filters 32-bit floats.
//! * `bias` is a factor on the paper's bias. With 32-bit floats the paper's bias is 5e-7, 5e-6 and 5e-5 for 4, 6 and
//!   8 power moments, and 4e-7, 8e-7 and 1.5e-6 for 2, 3 and 4 complex ones. With 16 bits it is 4e-4, 6.5e-4 and
//!   8.5e-4 for complex ones. For power moments a tenth of the papers' 6e-5, 6e-4 and 2.5e-3 is taken, since steps of
//!   Chebyshev means are finer.
//! * A light ray ends at a transmittance of 2^-11, as in every shadow map here.

use super::keys::{Align, LOOKUP_KEY, Lookups, settings};
use super::method::{Curve, Entry};
use super::settings::{Key, Value, choices};
use super::style::{Marker, Style};
use super::tolerances::longest_depth;
use super::vectors::{VectorMap, VectorMapDescriptor, VectorStorage};
use crate::gpu::Constant;
use bytemuck::{Pod, Zeroable};

/// Norm of an orthogonal polynomial below which it counts as a rounding error, when moments are evaluated.
const LEAST_NORM: f32 = 1e-11;
/// Angle on the unit circle to which no depth is mapped: the circle closes there (wrapping zone of Münstermann et al.
/// 2018).
const CLOSING_ANGLE: f32 = 0.1 * std::f32::consts::PI;

const ROOTS: &str = "shadow/moments/roots.wgsl";
const POWER: &str = "shadow/moments/power.wgsl";
const TRIGONOMETRIC: &str = "shadow/moments/trigonometric.wgsl";
const FLOATS: &str = "shadow/moments/floats.wgsl";
const WORDS: &str = "shadow/moments/words.wgsl";
const LOOKUP: &str = "shadow/moments/lookup.wgsl";

choices! {
    /// Basis functions of depth whose means are the moments of a moment shadow map.
    pub enum Basis {
        /// Uses powers of the depth as basis functions of the moments.
        Power = "power",
        /// Maps depth to points on the unit circle and uses their complex powers as basis functions of the moments.
        Trigonometric = "trigonometric",
    }
}

choices! {
    /// Distribution along the light whose moments a moment shadow map stores.
    pub enum MomentMeasure {
        /// Stores the moments of optical depth, as the papers do.
        OpticalDepth = "depth",
        /// Stores the moments of absorbed light, which is the fall of transmittance along the light.
        Light = "light",
    }
}

settings! {
    /// Settings of a moment shadow map.
    pub struct MomentMap {
        /// Number of moments stored in each texel of a moment shadow map beside the optical depth: 4, 6 or 8.
        moments: u32 = Key::choice(&["4", "6", "8"], "6", "number of moments beside the optical depth (trigonometric: 2, 3 or 4 complex ones)").in_label().search_all(),
        /// Basis functions of the moments: powers of the depth, or of points on the unit circle.
        basis: Basis = Key::choice(Basis::NAMES, "power", "moments of powers of the depth, or of points on a circle").search_all(),
        /// Distribution along the light whose moments are stored: optical depth or absorbed light.
        measure: MomentMeasure = Key::choice(MomentMeasure::NAMES, "depth", "distribution whose moments are stored: optical depth, or absorbed light (-dT)").search_all(),
        /// Position of the optical depth that a query returns between the smallest (0) and the largest (1) that the
        /// stored moments allow.
        beta: f64 = Key::number([0.0, 1.0], "0.25", "estimate between the smallest (0) and the largest (1) optical depth that the moments allow").search(&["0", "0.25", "0.5", "0.75", "1"]),
        /// Number of bits of each stored moment: 16 or 32.
        bits: u32 = Key::choice(&["16", "32"], "32", "bits of a moment: 16 (even steps from -1 to 1) or 32 (float)").search_all(),
        /// Factor that multiplies the bias of Münstermann et al. 2018, which protects the stored moments against
        /// rounding errors.
        bias: f64 = Key::number([0.0, 1e4], "1", "bias of the moments towards those of a wide distribution, as a factor of the paper's value"),
        ..MapSettings,
        /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each
        /// makes its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "moments",
    summary: "moments of the matter along the light (Muenstermann et al. 2018), and bounds from them",
    keys: MomentMap::KEYS,
    make: |values| Some(Box::new(MomentMap::from_values(values)?)),
    compared: "moments:moments=6,8",
    curve: "moments",
    stability: "moments:moments=4,8,map=64,near=0;moments:measure=light,map=64,near=0;moments:basis=trigonometric,map=64,near=0",
    published: None,
    style: Style { color: [51, 34, 136], marker: Marker::Right },
};

/// Uniform buffer of moment shadow maps; mirrors struct `MomentParams` in `shaders/shadow/moments/params.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct MomentParams {
    biased_moments: [f32; 4],
    beta: f32,
    bias: f32,
    largest_angle: f32,
    longest_depth: f32,
}

impl MomentMap {
    /// Returns the bias of moments from Münstermann et al. 2018, and the even moments of the distribution towards
    /// which power moments are biased.
    fn unit_bias(&self) -> (f64, [f32; 4]) {
        let (float_bias, word_bias, biased_moments) = match (self.basis, self.moments) {
            (Basis::Power, 4) => (5e-7, 6e-6, [0.375, 0.375, 0.0, 0.0]),
            (Basis::Power, 6) => (5e-6, 6e-5, [0.48, 0.451, 0.45, 0.0]),
            (Basis::Power, _) => (5e-5, 2.5e-4, [0.75, 0.676_666_7, 0.63, 0.600_303]),
            (Basis::Trigonometric, 4) => (4e-7, 4e-4, [0.0; 4]),
            (Basis::Trigonometric, 6) => (8e-7, 6.5e-4, [0.0; 4]),
            (Basis::Trigonometric, _) => (1.5e-6, 8.5e-4, [0.0; 4]),
        };
        (if self.in_words() { word_bias } else { float_bias }, biased_moments)
    }

    /// Whether the shadow map stores moments in 16 bits.
    fn in_words(&self) -> bool {
        self.bits == 16
    }
}

impl VectorMap for MomentMap {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn descriptor(&self) -> VectorMapDescriptor {
        let (bias, biased_moments) = self.unit_bias();
        let params = MomentParams {
            biased_moments,
            beta: self.beta as f32,
            bias: (self.bias * bias).min(1.0) as f32,
            largest_angle: std::f32::consts::TAU - CLOSING_ANGLE,
            longest_depth: longest_depth(),
        };
        let light = (self.measure == MomentMeasure::Light).then_some("LIGHT");
        let circle = self.basis == Basis::Trigonometric;
        let degree = match self.moments {
            4 => "DEGREE_2",
            6 => "DEGREE_3",
            _ => "DEGREE_4",
        };
        VectorMapDescriptor {
            // 16 bits: one word for the optical depth and one for every two moments. 32 bits: one float for each.
            vectors: if self.in_words() { self.moments / 2 + 1 } else { self.moments + 1 }.div_ceil(4),
            storage: if self.in_words() { VectorStorage::Words } else { VectorStorage::Single },
            filter: self.filter,
            align: Align::Off,
            linear: true,
            shape: self.shape(),
            constants: vec![
                Constant::unsigned("MOMENTS", self.moments),
                Constant::float("LEAST_NORM", LEAST_NORM),
            ],
            defs: [Some(degree), circle.then_some("TRIGONOMETRIC"), light].into_iter().flatten().collect(),
            marches: None,
            sink: &["shadow/moments/sink.wgsl"],
            // Optical depth, transmittance, and all moments.
            sink_words: Some(3 + self.moments),
            lookup: match (circle, self.in_words()) {
                (true, false) => &[ROOTS, TRIGONOMETRIC, FLOATS, LOOKUP],
                (false, false) => &[ROOTS, POWER, FLOATS, LOOKUP],
                (true, true) => &[ROOTS, TRIGONOMETRIC, WORDS, LOOKUP],
                (false, true) => &[ROOTS, POWER, WORDS, LOOKUP],
            },
            lookup_mode: self.lookup,
            params: Some(("shadow/moments/params.wgsl", bytemuck::cast(params))),
        }
    }

    fn curve(&self) -> Curve {
        Curve::Stays
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse_list;
    use super::MomentParams;
    use crate::gpu::assert_layout;

    #[test]
    fn uniforms_match_their_shaders() {
        let passes = parse_list("moments:basis=trigonometric").unwrap()[0].passes();
        assert_layout!(&passes[0], "MomentParams", MomentParams: biased_moments, beta, bias, largest_angle,
            longest_depth);
    }
}
