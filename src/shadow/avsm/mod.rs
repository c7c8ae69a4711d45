//! `avsm`: adaptive volumetric shadow maps.
//!
//! Salvi, Vidimče, Lauritzen and Lefohn 2010, *Adaptive Volumetric Shadow Maps*. A texel keeps `N` nodes of its ray's
//! transmittance, whatever the ray meets; where there would be more, the inner node goes whose loss changes the area under
//! the curve least, and its neighbours stay. Memory is bounded and the error is not: the counterpart of `dsm`.
//!
//! It is the march's own polyline (cell by cell within 0.0023 of the curve, with 32 bits) as long as the nodes suffice.
//!
//! Deviations from the paper, and why:
//! * Pieces arrive in the order of the march, and are appended; the paper inserts what rasterisation brings in any order.
//! * Pieces are as short as `dsm` wants them, since chords are straight; the paper's segments are as they are drawn.
//! * The transmittances of four texels are averaged (`filter=bilinear`), as in the paper; `dsm` also lays their surfaces
//!   over each other. With `filter=nearest` their difference is the compression's.
//! * A ray is over where 2^-11 of the light is left, as in every map here.

use super::keys::{LOOKUP_KEY, Lookups};
use super::method::Entry;
use super::settings::{Key, Value, settings};
use super::style::{Marker, Style};
use super::tolerances::longest_depth;
use super::vectors::{Numbers, Recipe, TEXELS_FILTER, VectorMap};
use crate::gpu::Constant;

settings! {
    /// Settings of an adaptive volumetric shadow map.
    pub struct AdaptiveShadowMap {
        /// Nodes a texel, `N` of the paper.
        nodes: u32 = Key::choice(&["4", "6", "8", "12", "16", "24", "32"], "8", "of a texel's transmittance").in_label().search_all(),
        /// Bits of a node's depth and transmittance, each: 16 or 32.
        bits: u32 = Key::choice(&["16", "32"], "32", "of a node's depth and transmittance, floats").search_all(),
        ..MapSettings,
        /// How eye samples ask for light.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "avsm",
    summary: "adaptive volumetric shadow maps (Salvi et al. 2010): a fixed number of nodes a texel",
    keys: AdaptiveShadowMap::KEYS,
    make: |values| Some(Box::new(AdaptiveShadowMap::from_values(values)?)),
    compared: "avsm:nodes=8,16",
    curve: "avsm",
    stability: "avsm:map=64",
    style: Style { color: [68, 170, 153], marker: Marker::Spark },
};

impl VectorMap for AdaptiveShadowMap {
    fn line(&self) -> &'static Entry {
        &ENTRY
    }

    fn settings(&self) -> Vec<Value> {
        self.to_values()
    }

    fn recipe(&self) -> Recipe {
        Recipe {
            vectors: self.nodes / 2,
            numbers_are: Numbers::floats(self.bits),
            filter: self.filter,
            linear: false,
            shape: self.shape(),
            constants: vec![Constant::unsigned("NODES", self.nodes)],
            defs: Vec::new(),
            turns: None,
            sink: "shadow/avsm/sink.wgsl",
            lookup: &["shadow/avsm/lookup.wgsl", TEXELS_FILTER],
            asked_by: self.lookup,
            numbers: [[longest_depth(), 0.0, 0.0, 0.0], [0.0; 4]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse_list;

    #[test]
    fn every_key_is_read_and_shown() {
        let shown = |text: &str| parse_list(text).unwrap().iter().map(|m| m.params()).collect::<Vec<_>>();
        assert_eq!(shown("avsm"), ["nodes=8"]);
        assert_eq!(shown("avsm:nodes=4,16,bits=16,map=64"), ["nodes=4 bits=16", "nodes=16 bits=16"]);
    }

    #[test]
    fn what_is_out_of_range_is_refused_by_name() {
        for (text, why) in [
            ("avsm:nodes=5", "expected 4|6|8|12|16|24|32"),
            ("avsm:epsilon=0.1", "there is: nodes, bits, from, march, step, map, fit, filter, lookup"),
        ] {
            let error = parse_list(text).unwrap_err();
            assert!(error.to_string().contains(why), "{error}");
            assert_eq!(error.exit_status(), 2);
        }
    }
}
