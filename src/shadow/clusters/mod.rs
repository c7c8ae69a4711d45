//! Shadow method `clusters`: density clustering.
//!
//! Mertens, Kautz, Bekaert and Van Reeth 2004, *A Self-Shadow Algorithm for Dynamic Hair using Density Clustering*,
//! with which Yuksel and Keyser 2008 compare. The matter along a light ray forms `k` clusters by depth, each with its
//! optical depth, mean and standard deviation. The matter of a cluster is assumed to be uniform within `sqrt(3)`
//! standard deviations of its mean.
//!
//! The method is exact for uniform slabs, if there is one cluster for each slab and each slab is nearest to another
//! mean.
//!
//! Deviations from the paper, and why:
//! * A segment of the light ray has a length, whose standard deviation counts, and belongs to the cluster nearest to
//!   its middle; the paper's fragments are points.
//! * One pass finds the end of matter and forms the clusters. Each further iteration assigns every segment to the
//!   nearest mean of the previous march.
//! * Clusters of neighbouring texels differ, so transmittances are averaged (`filter=bilinear`).
//! * A light ray ends at a transmittance of 2^-11, as in every shadow map here; the depth range is that of all
//!   matter.

use super::keys::{ALIGN_KEY, Align, LOOKUP_KEY, Lookups, settings};
use super::method::Entry;
use super::settings::{Key, Value};
use super::style::{Marker, Style};
use super::vectors::{VectorMap, VectorMapDescriptor, VectorStorage};
use crate::gpu::Constant;

settings! {
    /// Settings of a density clustering shadow map (Mertens et al. 2004).
    pub struct DensityClusters {
        /// Number of clusters of matter along each light ray (`k` of Mertens et al. 2004).
        clusters: u32 = Key::whole([1, 16], "4", "number of clusters of matter along a light ray").in_label().search(&["1", "2", "3", "4", "6", "8", "12", "16"]),
        /// Number of marches along each light ray; each assigns the matter of the ray to the clusters with the
        /// nearest mean depths.
        iterations: u32 = Key::choice(&["1", "2", "4", "8"], "1", "k-means iterations, one march each").search(&["1", "2", "4"]),
        /// Number of bits of each stored float of a cluster (mean depth, standard deviation and optical depth): 16 or
        /// 32.
        bits: u32 = Key::choice(&["16", "32"], "16", "bits of a cluster's mean, standard deviation and optical depth (floats)").search_all(),
        ..MapSettings,
        /// Whether the four texels around a point are aligned at their first depths before they are averaged.
        align: Align = ALIGN_KEY,
        /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each
        /// makes its own.
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
    stability: "clusters:map=64,near=0",
    published: None,
    style: Style { color: [153, 153, 51], marker: Marker::Pentagon },
};

impl VectorMap for DensityClusters {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn descriptor(&self) -> VectorMapDescriptor {
        VectorMapDescriptor {
            vectors: (3 * self.clusters).div_ceil(4),
            storage: VectorStorage::floats(self.bits),
            filter: self.filter,
            align: self.align,
            linear: false,
            shape: self.shape(),
            constants: vec![Constant::unsigned("CLUSTERS", self.clusters)],
            // The first march finds the end of matter.
            defs: vec!["FROM_BEHIND"],
            marches: Some(1 + self.iterations),
            sink: &["shadow/clusters/sink.wgsl"],
            sink_words: None,
            lookup: &["shadow/clusters/lookup.wgsl"],
            lookup_mode: self.lookup,
            params: None,
        }
    }
}
