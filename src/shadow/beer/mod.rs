//! Shadow method `beer`: Beer shadow maps.
//!
//! The method of Unreal Engine for its volumetric clouds and, beside adaptive volumetric shadow maps, for its
//! heterogeneous volumes (`EShadowType::BeerShadowMap`). A texel stores the depth where the matter of its light ray
//! begins, a mean extinction `m`, and the optical depth of the whole ray. Behind `front`, optical depth rises with
//! the slope `m` until it is that of the whole ray:
//! `T(z) = exp(-min(optical_depth, m * max(0, z - front)))`.
//!
//! The method is exact for a ray through one uniform slab, and in front of and behind all matter.
//!
//! There is no paper, and Unreal's licence does not allow a copy of its code, so no source was read in full. The
//! format and the lookup follow descriptions and excerpts of `VolumetricCloud.usf` and `VolumetricCloudCommon.ush`,
//! and the shaders of the open library three-geospatial (`packages/clouds/src/shaders/shadow.frag`).
//!
//! Deviations, and why:
//! * `mean=extent`, the default, divides the optical depth by the length from the first to the last matter, so that
//!   the curve ends where the matter ends. Unreal divides the sum of its samples by the number of samples with
//!   extinction: gaps do not count (`mean=matter`).
//! * The march is exact; both sources take samples at regular distances.
//! * The transmittances of four texels are averaged (`filter=bilinear`). In Unreal the hardware averages the three
//!   numbers, which bends the curve where a texel without matter is near.
//! * A light ray ends at a transmittance of 2^-11, as in every shadow map here.
//! * The front and the slope are stored relative to the depth range of the map; Unreal stores kilometres. A fourth
//!   number of the texel is unused.

use super::keys::{ALIGN_KEY, Align, LOOKUP_KEY, Lookups, settings};
use super::method::Entry;
use super::settings::{Key, Value, choices};
use super::style::{Marker, Style};
use super::vectors::{VectorMap, VectorMapDescriptor, VectorStorage};

choices! {
    /// Length by which the optical depth of a light ray is divided to give its mean extinction.
    pub enum BeerMean {
        /// Divides by the length from the first to the last matter on the light ray, gaps included.
        Extent = "extent",
        /// Divides by the length of the light ray inside matter, without gaps, as Unreal Engine does.
        Matter = "matter",
    }
}

settings! {
    /// Settings of a Beer shadow map.
    pub struct BeerShadowMap {
        /// Length by which optical depth is divided to give the mean extinction of a light ray.
        mean: BeerMean = Key::choice(
            BeerMean::NAMES,
            "extent",
            "length that the mean extinction refers to: from first to last matter, or inside matter only",
        )
        .search_all(),
        /// Number of bits of each stored float of a texel (front depth, mean extinction and optical depth): 16 or 32.
        bits: u32 = Key::choice(&["16", "32"], "16", "bits of a texel's front depth, mean extinction and optical depth (floats)").search_all(),
        ..MapSettings,
        /// Whether the four texels around a point are aligned at their first depths before they are averaged.
        align: Align = ALIGN_KEY,
        /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each
        /// makes its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "beer",
    summary: "Beer shadow maps (Unreal Engine): front depth, mean extinction and optical depth a texel",
    keys: BeerShadowMap::KEYS,
    make: |values| Some(Box::new(BeerShadowMap::from_values(values)?)),
    compared: "beer",
    curve: "beer",
    stability: "beer:map=64,mean=extent,matter,near=0",
    published: None,
    style: Style { color: [136, 204, 238], marker: Marker::Plus },
};

impl VectorMap for BeerShadowMap {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn descriptor(&self) -> VectorMapDescriptor {
        VectorMapDescriptor {
            vectors: 1,
            storage: VectorStorage::floats(self.bits),
            filter: self.filter,
            align: self.align,
            linear: false,
            shape: self.shape(),
            constants: Vec::new(),
            defs: (self.mean == BeerMean::Matter).then_some("MEAN_OF_MATTER").into_iter().collect(),
            marches: None,
            sink: &["shadow/beer/sink.wgsl"],
            sink_words: Some(3),
            lookup: &["shadow/beer/lookup.wgsl"],
            lookup_mode: self.lookup,
            params: None,
        }
    }
}
