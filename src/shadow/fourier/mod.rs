//! Shadow method `fourier`: Fourier opacity maps.
//!
//! Jansen and Bavoil 2010, *Fourier Opacity Mapping*. The extinction along a light ray is a function of the depth
//! `s`, scaled to 0 to 1 over the map's range. Each texel stores the first terms of its Fourier series, `a_0 / 2 +
//! sum of a_k cos(2 pi k s) + b_k sin(2 pi k s)`. Optical depth is the integral of the series. The coefficients are
//! sums over the matter along the ray, in any order, so that they can be blended and filtered.
//!
//! The method is exact for extinction that is such a series, and rings around everything sharper: transmittance is
//! not monotone, and exceeds 1 where the integral is negative. This is part of the method.
//!
//! Deviations from the paper, and why:
//! * A segment of the light ray has a length: its coefficients are the means over it, in closed form. The paper uses
//!   points.
//! * `damping=lanczos`, which the paper does not have, weighs term `k` of `n` with `sin(x) / x`, `x = pi k / (n +
//!   1)`: it rings less and blurs more.
//! * `range=map` expands the series over the map's depth range, for all texels. `range=texel` expands it over the
//!   extent of the matter of each texel, which a first march finds, so that all terms describe matter. Such series
//!   cannot be averaged, so the shader filters transmittances.
//! * A light ray ends at a transmittance of 2^-11, as in every shadow map here: matter behind does not ring.
//! * The hardware filters texels of `bits=16`; the shader filters 32-bit floats, which not every adapter filters.

use super::keys::{Align, LOOKUP_KEY, Lookups, settings};
use super::method::{Curve, Entry};
use super::settings::{Key, Value, choices};
use super::style::{Marker, Style};
use super::vectors::{RANGE, VectorMap, VectorMapDescriptor, VectorStorage};
use crate::gpu::Constant;

choices! {
    /// Weights of the terms of the Fourier series in a Fourier opacity map.
    pub enum Damping {
        /// Weight 1 for every term of the Fourier series, as in Jansen and Bavoil 2010.
        None = "none",
        /// Lanczos sigma factors as weights of the Fourier terms, which reduce ringing.
        Lanczos = "lanczos",
    }
}

choices! {
    /// Depth range over which a Fourier opacity map or a wavelet map expands its series.
    pub enum SeriesRange {
        /// Expands the series over the depth range of the whole shadow map.
        Map = "map",
        /// Expands the series over the depth range of the matter in each texel.
        Texel = "texel",
    }
}

settings! {
    /// Settings of a Fourier opacity map.
    pub struct FourierOpacityMap {
        /// Number of terms of the Fourier series beside the constant term (`n` of Jansen and Bavoil 2010).
        terms: u32 = Key::whole([1, 31], "7", "number of terms of the Fourier series beside the constant").in_label().search(&["1", "3", "5", "7", "11", "15", "23", "31"]),
        /// Depth range over which the Fourier series is expanded: the map's, or that of the matter in each texel.
        range: SeriesRange = Key::choice(SeriesRange::NAMES, "map", "depth range of the series: that of the map, or of each texel").search_all(),
        /// Weights of the Fourier terms: all 1, or Lanczos sigma factors, which reduce ringing.
        damping: Damping = Key::choice(Damping::NAMES, "none", "weights of the terms: all 1, or Lanczos factors against ringing").search_all(),
        /// Number of bits of each stored Fourier coefficient, a float: 16 or 32.
        bits: u32 = Key::choice(&["16", "32"], "16", "bits of a coefficient (float)").search_all(),
        ..MapSettings,
        /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each
        /// makes its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "fourier",
    summary: "Fourier opacity maps (Jansen and Bavoil 2010): extinction along the light as a series",
    keys: FourierOpacityMap::KEYS,
    make: |values| Some(Box::new(FourierOpacityMap::from_values(values)?)),
    compared: "fourier:terms=7,15",
    curve: "fourier:terms=7",
    stability: "fourier:map=64,range=map,texel,near=0",
    published: None,
    style: Style { color: [136, 34, 85], marker: Marker::Left },
};

impl VectorMap for FourierOpacityMap {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn descriptor(&self) -> VectorMapDescriptor {
        let texel_range = self.range == SeriesRange::Texel;
        let defs =
            [(self.damping == Damping::Lanczos).then_some("LANCZOS"), texel_range.then_some("TEXEL_RANGE")];
        VectorMapDescriptor {
            // A vector holds two terms; the constant term and the depth range of a texel count as one term each.
            vectors: (self.terms + u32::from(texel_range)) / 2 + 1,
            storage: VectorStorage::floats(self.bits),
            filter: self.filter,
            align: Align::Off,
            linear: !texel_range,
            shape: self.shape(),
            constants: vec![Constant::unsigned("TERMS", self.terms)],
            defs: defs.into_iter().flatten().collect(),
            marches: texel_range.then_some(2),
            sink: &[RANGE, "shadow/fourier/sink.wgsl"],
            // Optical depth, range, and all terms.
            sink_words: Some(1 + 4 + 4 * ((self.terms + u32::from(texel_range)) / 2 + 1)),
            lookup: &["shadow/fourier/series.wgsl", "shadow/fourier/lookup.wgsl"],
            lookup_mode: self.lookup,
            params: None,
        }
    }

    fn curve(&self) -> Curve {
        Curve::Rings
    }
}
