//! `fourier`: Fourier opacity maps.
//!
//! Jansen and Bavoil 2010, *Fourier Opacity Mapping*. Extinction along a light ray, over the share `s` of the map's depth,
//! is kept as the first terms of its Fourier series, `a_0 / 2 + sum of a_k cos(2 pi k s) + b_k sin(2 pi k s)`; optical
//! depth is the series' integral. The coefficients are sums over what the ray meets, in any order, so that they may be
//! blended and filtered.
//!
//! It is exact for a medium of its own terms and rings around everything sharper: transmittance is not monotone, and may
//! exceed 1 where the integral dips below 0. That is part of the method, and is left as it is.
//!
//! Deviations from the paper, and why:
//! * A piece of the march is a stretch and not a point: its coefficients are the means over it, in closed form.
//! * `damping=lanczos` weighs term `k` of `n` with `sin(x) / x`, `x = pi k / (n + 1)`, which rings less and blurs more;
//!   it is ours.
//! * `range=map` counts depth over the map's range, which holds the active bricks, for all texels alike. `range=texel` counts it
//!   over each texel's own, from where its ray meets matter to where it is over, which a march of its own finds first: the terms
//!   are then spent on matter. Such series have no mean, and so transmittances are filtered, by the program.
//! * A ray is over where 2^-11 of the light is left, as in every map here: what lies behind does not ring.
//! * Texels are filtered by the hardware with `bits=16`; 32-bit floats, which not every adapter filters, by the program.

use super::keys::{LOOKUP_KEY, Lookups};
use super::method::{Curve, Entry};
use super::settings::{Key, Value, choices, settings};
use super::style::{Marker, Style};
use super::vectors::{Numbers, Recipe, TEXELS_FILTER, VectorMap};
use crate::gpu::Constant;

const MAP_LOOKUP: &[&str] = &["shadow/fourier/series.wgsl", "shadow/fourier/lookup.wgsl"];
const TEXEL_LOOKUP: &[&str] = &["shadow/fourier/series.wgsl", "shadow/fourier/texel.wgsl", TEXELS_FILTER];

choices! {
    /// How terms are weighed.
    pub enum Damping {
        /// All alike, as in the paper.
        None = "none",
        /// By Lanczos' sigma factors.
        Lanczos = "lanczos",
    }
}

choices! {
    /// Depths that the series is over.
    pub enum SeriesRange {
        /// The map's.
        Map = "map",
        /// Each texel's own.
        Texel = "texel",
    }
}

settings! {
    /// Settings of a Fourier opacity map.
    pub struct FourierOpacityMap {
        /// Terms of the series beside the constant, `n` of the paper.
        terms: u32 = Key::whole([1, 31], "7", "of the series beside the constant").in_label().search(&["1", "3", "5", "7", "11", "15", "23", "31"]),
        /// Depths that the series is over.
        range: SeriesRange = Key::choice(SeriesRange::NAMES, "map", "depths that the series is over: the map's, or each texel's own").search_all(),
        /// How they are weighed.
        damping: Damping = Key::choice(Damping::NAMES, "none", "weights of the terms: all 1, or Lanczos' factors, which ring less").search_all(),
        /// Bits of a coefficient: 16 or 32.
        bits: u32 = Key::choice(&["16", "32"], "16", "of a coefficient, a float").search_all(),
        ..MapSettings,
        /// How eye samples ask for light.
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
    stability: "fourier:map=64,range=map,texel",
    style: Style { color: [136, 34, 85], marker: Marker::Left },
};

impl VectorMap for FourierOpacityMap {
    fn line(&self) -> &'static Entry {
        &ENTRY
    }

    fn settings(&self) -> Vec<Value> {
        self.to_values()
    }

    fn recipe(&self) -> Recipe {
        let own_range = self.range == SeriesRange::Texel;
        let defs =
            [(self.damping == Damping::Lanczos).then_some("LANCZOS"), own_range.then_some("TEXEL_RANGE")];
        Recipe {
            // Two terms a vector, the constant being one of them, and a range another.
            vectors: (self.terms + u32::from(own_range)) / 2 + 1,
            numbers_are: Numbers::floats(self.bits),
            filter: self.filter,
            linear: !own_range,
            shape: self.shape(),
            constants: vec![Constant::unsigned("TERMS", self.terms)],
            defs: defs.into_iter().flatten().collect(),
            turns: own_range.then_some(2),
            sink: "shadow/fourier/sink.wgsl",
            lookup: if own_range { TEXEL_LOOKUP } else { MAP_LOOKUP },
            asked_by: self.lookup,
            numbers: [[0.0; 4]; 2],
        }
    }

    fn shape_of_curve(&self) -> Curve {
        Curve::Rings
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse_list;

    #[test]
    fn every_key_is_read_and_shown() {
        let shown = |text: &str| parse_list(text).unwrap().iter().map(|m| m.params()).collect::<Vec<_>>();
        assert_eq!(shown("fourier"), ["terms=7"]);
        assert_eq!(
            shown("fourier:terms=3,15,damping=lanczos,bits=32,map=64"),
            ["terms=3 damping=lanczos bits=32", "terms=15 damping=lanczos bits=32"]
        );
        assert_eq!(shown("fourier:range=texel"), ["terms=7 range=texel"]);
    }

    #[test]
    fn what_is_out_of_range_is_refused_by_name() {
        for (text, why) in [
            ("fourier:terms=0", "expected 1..31"),
            ("fourier:bits=8", "expected 16|32"),
            ("fourier:damping=gauss", "expected none|lanczos"),
        ] {
            let error = parse_list(text).unwrap_err();
            assert!(error.to_string().contains(why), "{error}");
            assert_eq!(error.exit_status(), 2);
        }
    }
}
