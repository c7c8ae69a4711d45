//! Shadow method `avsm`: adaptive volumetric shadow maps.
//!
//! Salvi, Vidimče, Lauritzen and Lefohn 2010, *Adaptive Volumetric Shadow Maps*. Each texel stores up to `N` nodes of
//! the transmittance curve of its light ray. If there are more, the inner node is removed that changes the area under
//! the curve least; its neighbours stay. Memory is bounded and the error is not, in contrast to `dsm`.
//!
//! With enough nodes of 32 bits (`bits=32`), the stored curve is within 0.0029 of the exact transmittance.
//!
//! Deviations from the paper, and why:
//! * Segments of the light ray arrive in the order of the march, and are appended; the paper inserts rasterised
//!   segments in any order.
//! * The segments are those of a greedy compression (Lokovic and Veach 2000) of the curve with an error of 0.0006, so
//!   that few nodes have to be removed; the paper's segments are as long as drawn.
//! * The transmittances of four texels are averaged (`filter=bilinear`), as in the paper. This method and
//!   `dsm:segments=transmittance` therefore differ by the compression only.
//! * A light ray ends at a transmittance of 2^-11, as in every shadow map here.

use super::keys::{ALIGN_KEY, Align, LOOKUP_KEY, Lookups, settings};
use super::method::Entry;
use super::settings::{Key, Value};
use super::style::{Marker, Style};
use super::tolerances::{CHORD_TOLERANCE, GREEDY, longest_depth};
use super::vectors::{VectorMap, VectorMapDescriptor, VectorStorage};
use crate::gpu::Constant;
use bytemuck::{Pod, Zeroable};

settings! {
    /// Settings of an adaptive volumetric shadow map.
    pub struct AdaptiveShadowMap {
        /// Number of nodes of the transmittance curve stored in each texel of an adaptive volumetric shadow map (`N`
        /// of Salvi et al. 2010).
        nodes: u32 = Key::choice(&["4", "6", "8", "12", "16", "24", "32"], "8", "number of nodes of a texel's transmittance curve").in_label().search_all(),
        /// Number of bits of each stored depth and transmittance in an adaptive volumetric shadow map: 16 or 32.
        bits: u32 = Key::choice(&["16", "32"], "16", "bits of a node's depth and transmittance (floats)").search_all(),
        ..MapSettings,
        /// Whether the four texels around a point are aligned at their first depths before they are averaged.
        align: Align = ALIGN_KEY,
        /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each
        /// makes its own.
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
    stability: "avsm:map=64,near=0",
    published: None,
    style: Style { color: [68, 170, 153], marker: Marker::Spark },
};

/// Uniform buffer of adaptive volumetric shadow maps; mirrors struct `AvsmParams` in
/// `shaders/shadow/avsm/params.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct AvsmParams {
    longest_depth: f32,
    epsilon: f32,
    padding: [f32; 6],
}

/// Largest error in transmittance of the compression whose nodes an adaptive volumetric shadow map receives.
const NODE_TOLERANCE: f64 = 0.25 * CHORD_TOLERANCE;

impl VectorMap for AdaptiveShadowMap {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn descriptor(&self) -> VectorMapDescriptor {
        let params =
            AvsmParams { longest_depth: longest_depth(), epsilon: NODE_TOLERANCE as f32, padding: [0.0; 6] };
        VectorMapDescriptor {
            vectors: self.nodes / 2,
            storage: VectorStorage::floats(self.bits),
            filter: self.filter,
            align: self.align,
            linear: false,
            shape: self.shape(),
            constants: vec![Constant::unsigned("NODES", self.nodes)],
            defs: Vec::new(),
            marches: None,
            sink: &["shadow/segments.wgsl", "shadow/avsm/nodes.wgsl", GREEDY, "shadow/avsm/sink.wgsl"],
            sink_words: None,
            lookup: &["shadow/avsm/lookup.wgsl"],
            lookup_mode: self.lookup,
            params: Some(("shadow/avsm/params.wgsl", bytemuck::cast(params))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse_list;
    use super::AvsmParams;
    use crate::gpu::wgsl_layout;

    #[test]
    fn uniforms_match_their_shaders() {
        let members = wgsl_layout(&parse_list("avsm").unwrap()[0].passes()[0], "AvsmParams").members;
        let offset = |name: &str, offset: usize| (name.to_string(), offset);
        let longest_depth = offset("longest_depth", std::mem::offset_of!(AvsmParams, longest_depth));
        let epsilon = offset("epsilon", std::mem::offset_of!(AvsmParams, epsilon));
        assert_eq!(members, [longest_depth, epsilon]);
    }
}
