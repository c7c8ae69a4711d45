//! `clusters`: density clustering.
//!
//! Mertens, Kautz, Bekaert and Van Reeth 2004, *A Self-Shadow Algorithm for Dynamic Hair using Density Clustering*, with
//! which Yuksel and Keyser 2008 compare. What a light ray meets is gathered in `k` clusters by depth, each with its optical
//! depth, its mean and its spread (standard deviation); a cluster's matter is taken to lie evenly within `sqrt(3)` spreads
//! of its mean.
//!
//! It is exact for as many even slabs as there are clusters, each nearest to another mean.
//!
//! Deviations from the paper, and why:
//! * A piece of the march is a stretch, whose own spread counts, and goes to the cluster nearest to its middle; the paper's
//!   fragments are points.
//! * The marches that find where matter ends and those that gather are one pass; `iterations` beyond one give every piece
//!   to the nearest mean of the march before.
//! * Clusters of neighbouring texels are not the same matter, and so transmittances are averaged (`filter=bilinear`).
//! * A ray is over where 2^-11 of the light is left, as in every map here; the range of depths is that of all matter.

use super::keys::{LOOKUP_KEY, Lookups};
use super::method::Entry;
use super::settings::{Key, Value, settings};
use super::style::{Marker, Style};
use super::vectors::{Numbers, Recipe, TEXELS_FILTER, VectorMap};
use crate::gpu::Constant;

settings! {
    /// Settings of a map of clusters.
    pub struct DensityClusters {
        /// Clusters, `k` of the paper.
        clusters: u32 = Key::whole([1, 16], "4", "of matter along a light ray").in_label().search(&["1", "2", "3", "4", "6", "8", "12", "16"]),
        /// Times that matter is given to the nearest mean.
        iterations: u32 = Key::choice(&["1", "2", "4", "8"], "1", "marches that give matter to the nearest mean").search(&["1", "2", "4"]),
        /// Bits of a mean, a spread and an optical depth: 16 or 32.
        bits: u32 = Key::choice(&["16", "32"], "16", "of a cluster's mean, spread and optical depth, floats").search_all(),
        ..MapSettings,
        /// How eye samples ask for light.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "clusters",
    summary: "density clustering (Mertens et al. 2004): a few clusters of matter along the light",
    keys: DensityClusters::KEYS,
    make: |values| Some(Box::new(DensityClusters::from_values(values)?)),
    compared: "clusters:clusters=4,8",
    curve: "clusters",
    stability: "clusters:map=64",
    style: Style { color: [153, 153, 51], marker: Marker::Pentagon },
};

impl VectorMap for DensityClusters {
    fn line(&self) -> &'static Entry {
        &ENTRY
    }

    fn settings(&self) -> Vec<Value> {
        self.to_values()
    }

    fn recipe(&self) -> Recipe {
        Recipe {
            vectors: (3 * self.clusters).div_ceil(4),
            numbers_are: Numbers::floats(self.bits),
            filter: self.filter,
            linear: false,
            shape: self.shape(),
            constants: vec![Constant::unsigned("CLUSTERS", self.clusters)],
            // The first march looks for where matter ends.
            defs: vec!["FROM_BEHIND"],
            turns: Some(1 + self.iterations),
            sink: "shadow/clusters/sink.wgsl",
            lookup: &["shadow/clusters/lookup.wgsl", TEXELS_FILTER],
            asked_by: self.lookup,
            numbers: [[0.0; 4]; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse_list;

    #[test]
    fn every_key_is_read_and_shown() {
        let shown = |text: &str| parse_list(text).unwrap().iter().map(|m| m.params()).collect::<Vec<_>>();
        assert_eq!(shown("clusters"), ["clusters=4"]);
        assert_eq!(
            shown("clusters:clusters=2,iterations=1,4,bits=32,map=64"),
            ["clusters=2 bits=32", "clusters=2 iterations=4 bits=32"]
        );
    }

    #[test]
    fn what_is_out_of_range_is_refused_by_name() {
        for (text, why) in
            [("clusters:clusters=17", "expected 1..16"), ("clusters:iterations=3", "expected 1|2|4|8")]
        {
            let error = parse_list(text).unwrap_err();
            assert!(error.to_string().contains(why), "{error}");
            assert_eq!(error.exit_status(), 2);
        }
    }
}
