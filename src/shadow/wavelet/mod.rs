//! Shadow method `wavelet`: Haar wavelets of extinction along the light.
//!
//! After Aizenshtein, Smal and McGuire 2022, *Wavelet Transparency*, arXiv 2201.00094, of which only the abstract and
//! the first paragraphs were read. The abstract describes a wavelet representation of transmittance as a function of
//! depth. It does not say which function is projected, so this is a decision of this program.
//!
//! Here it is the extinction, a function of the depth `s`, scaled to 0 to 1 over a range. Each texel stores `2^rank`
//! coefficients: the optical depth of the ray, and for each wavelet half the difference between the optical depths of
//! the two halves of its support. They are sums over the matter along the ray, in any order, so that they can be
//! blended and filtered. Optical depth is the integral of the series, in which each wavelet becomes a triangle. A
//! query needs one wavelet of each level.
//!
//! The wavelets of all levels represent every function that is constant on `2^rank` intervals. So the optical depth is
//! exact at the ends of the intervals, and linear within them. With extinction of at most `sigma` in a range of length
//! `L`, it is off by at most `sigma L / 2^(rank + 2)`: within an interval of length `w` matter fills a share `f`, and the
//! largest distance from the chord, `sigma w f (1 - f)`, is at most `sigma w / 4`. Transmittance falls with depth, because
//! means of extinction are not negative. Rounding to 16 bits breaks this: transmittance may then rise, by less than
//! 0.01.
//!
//! In exact arithmetic, `osm:average=depth` has the same curves with as many evenly spaced planes. It stores optical
//! depths instead of coefficients, and reads two of them for a query.
//!
//! Deviations from the paper, as far as it was read, and why:
//! * A segment of the light ray has a length: its matter is spread over it. Segments that contain an end of an interval
//!   are as short as for `osm`. The paper draws transparent primitives.
//! * The march proceeds in the order of depth. So it stores the optical depth in front of the nodes that it passes, and
//!   the coefficients follow at its end: a piece costs no update of `rank + 1` coefficients at both of its ends.
//! * `range=map` and `range=texel` are those of `fourier`.
//! * A light ray ends at a transmittance of 2^-11, as in every shadow map here.

use super::fourier::SeriesRange;
use super::keys::{Align, LOOKUP_KEY, Lookups, settings};
use super::method::{Curve, Entry, MethodSpec};
use super::settings::{Key, Value};
use super::style::{Marker, Style};
use super::tolerances::longest_depth;
use super::vectors::{RANGE, VectorMap, VectorMapDescriptor, VectorStorage};
use crate::gpu::Constant;

settings! {
    /// Settings of a shadow map of Haar wavelets.
    pub struct WaveletMap {
        /// Number of levels of wavelets: a texel of the shadow map stores `2^rank` coefficients.
        rank: u32 = Key::whole([1, 6], "4", "levels of wavelets; a texel stores 2^rank coefficients").in_label().search(&["1", "2", "3", "4", "5", "6"]),
        /// Depth range over which wavelets are placed: the map's, or that of the matter in each texel.
        range: SeriesRange = Key::choice(SeriesRange::NAMES, "map", "depth range of the wavelets: that of the map, or of each texel").search_all(),
        /// Number of bits of each stored wavelet coefficient, a float: 16 or 32.
        bits: u32 = Key::choice(&["16", "32"], "16", "bits of a coefficient (float)").search_all(),
        ..MapSettings,
        /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each
        /// makes its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "wavelet",
    summary: "Haar wavelets of extinction along the light (after Aizenshtein et al. 2022)",
    keys: WaveletMap::KEYS,
    make: |values| Some(Box::new(WaveletMap::from_values(values)?)),
    compared: "wavelet:range=map,texel",
    curve: "wavelet",
    stability: "wavelet:map=64,range=map,texel,bits=16,32,near=0",
    published: None,
    style: Style { color: [170, 68, 153], marker: Marker::Hexagon },
};

impl VectorMap for WaveletMap {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn descriptor(&self) -> VectorMapDescriptor {
        let texel_range = self.range == SeriesRange::Texel;
        VectorMapDescriptor {
            // The depth range of a texel counts as two coefficients.
            vectors: ((1 << self.rank) + 2 * u32::from(texel_range)).div_ceil(4),
            storage: VectorStorage::floats(self.bits),
            filter: self.filter,
            align: Align::Off,
            linear: !texel_range,
            shape: self.shape(),
            constants: vec![
                Constant::unsigned("RANK", self.rank),
                Constant::float("LONGEST_DEPTH", longest_depth()),
            ],
            defs: texel_range.then_some("TEXEL_RANGE").into_iter().collect(),
            marches: texel_range.then_some(2),
            sink: &[RANGE, "shadow/wavelet/sink.wgsl"],
            // Optical depth, range, number of passed nodes, and all nodes.
            sink_words: Some(1 + 4 + 1 + (1 << self.rank)),
            lookup: &["shadow/wavelet/lookup.wgsl"],
            lookup_mode: self.lookup,
            params: None,
        }
    }

    fn curve(&self) -> Curve {
        // Coefficients of 16 bits are rounded one by one.
        if self.bits == 16 { Curve::Stays } else { Curve::of_map(&MethodSpec::new(&ENTRY, self.to_values())) }
    }
}
