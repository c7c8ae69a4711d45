//! Shadow method `bom`: bounding opacity maps.
//!
//! Voicu 2011, *Real-time volumetric shadows for dynamic rendering*, chapter 5, an extension of Yuksel and Keyser
//! 2008. Symbols: `z_0` and `z_1` are the depths at which matter begins and ends in a texel; `K` layers lie from `z_0
//! + d_(k-1)` to `z_0 + d_k`, with `z_0 + d_K = z_1`.
//!
//! Deviations from the thesis, and why:
//! * Two marches in one pass replace three passes. One march goes towards the light and ends at the first matter,
//!   `z_1`. The other comes from the light and passes `z_0` before the layers.
//! * A query for transmittance interpolates linearly between the two planes around the point; the thesis reads one
//!   layer.
//! * The interval `[1, N]` of the logarithm is `log_size`: the thesis states no size of the lookup texture, and the
//!   appendix's rounding of `log2` to a whole number is not followed.
//! * The lookup texture of the hybrid split (5.2.2, 5.2.3, sections 7 and 9 of its appendix) has 1024 bins of float32
//!   instead of 8 bits. A second row holds the planes that separate the layers.
//! * `split=auto` chooses among eleven ratios over whole images, as 5.2.3 does, but on the device and from a coarse
//!   map. Images are opacities `1 - T`, not rounded to 8 bits, since rounded images of few levels are less correlated
//!   (`measure=difference` rounds). Two images without contrast count as fully correlated.
//! * `split=texel` is the splitting texture of chapter 7, a ratio for every region of 4 x 4 texels. Its sum of
//!   absolute differences telescopes on a single ray, whose opacity never falls. So the ratio is chosen whose largest
//!   step between neighbouring planes is least, which bounds the error.
//! * Depths are rounded away from the light. `filter=bilinear` works as in `dom`.

use super::filter::Taps;
use super::keys::{ALIGN_KEY, Align, LOOKUP_KEY, Lookups, settings};
use super::layered::{
    AVERAGE_KEY, Average, BITS_KEY, DEPTH_BITS_KEY, LAYERS, LOG_SIZE_KEY, LayerSplit, LayeredMap, Layering,
    MEASURE_KEY, Measure, RATIO_KEY, Record, Split, split_key,
};
use super::lookup::Lookup;
use super::method::{Entry, Method, ShadowMap};
use super::published::Published;
use super::settings::{Key, Value};
use super::style::{Marker, Style};
use crate::error::Result;
use crate::field::{BuildContext, March};
use crate::gpu::ShaderVariant;

settings! {
    /// Settings of a bounding opacity map.
    pub struct BoundingOpacityMap {
        /// Number of layers of a bounding opacity map (`K` of Voicu 2011).
        layers: u32 = Key::whole(LAYERS, "15", "number of layers").in_label().search(&["1", "2", "3", "5", "7", "10", "15", "24", "32", "48", "64", "128"]),
        /// Rule that divides the depth range of each texel, from the start to the end of matter, into the layers of a
        /// bounding opacity map.
        split: LayerSplit = split_key("hybrid"),
        /// Weight of logarithmic against linear layer spacing with `split=hybrid`, from 0 (linear) to 1
        /// (logarithmic).
        ratio: f64 = RATIO_KEY,
        /// Upper end of the interval `[1, log_size]` to which depth is scaled before its logarithm spaces the layers
        /// of the shadow map.
        log_size: f64 = LOG_SIZE_KEY,
        /// Criterion by which `split=auto` chooses between linear and logarithmic layer spacing: correlation or
        /// difference of neighbouring layers.
        measure: Measure = MEASURE_KEY,
        /// Number of bits of each stored depth (start or end of matter in a texel): 8, 16 or 32.
        depth_bits: u32 = DEPTH_BITS_KEY,
        /// Number of bits of each optical depth stored in a bounding opacity map: 8, 16 or 32.
        bits: u32 = BITS_KEY,
        ..MapSettings,
        /// Whether the four texels around a point are aligned at their first depths before they are averaged.
        align: Align = ALIGN_KEY,
        /// Quantity that bilinear filtering of shadow map texels averages: optical depth or transmittance.
        average: Average = AVERAGE_KEY,
        /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each
        /// makes its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "bom",
    summary: "bounding opacity maps (2011): layers from where matter begins to where it ends",
    keys: BoundingOpacityMap::KEYS,
    make: |values| Some(Box::new(BoundingOpacityMap::from_values(values)?)),
    compared: "bom:layers=3,7,15",
    curve: "bom:layers=15",
    stability: "bom:map=64,near=0",
    published: Some(Published {
        paper: "Voicu 2011",
        settings: "bom:layers=16,split=auto,depth_bits=32,bits=32,near=0,average=depth,lookup=each",
    }),
    style: Style { color: [213, 94, 0], marker: Marker::Diamond },
};

impl BoundingOpacityMap {
    fn layering(&self) -> Layering {
        let Self { layers, split, ratio, log_size, measure, .. } = *self;
        Layering { layers, split, ratio, log_size, measure }
    }

    fn layered_map(&self, split: Split) -> LayeredMap {
        let Self { layers, bits, depth_bits, filter, average, .. } = *self;
        let record = Record { layers, bits, depths: 2, depth_bits, own_split: self.layering().by_texel() };
        let shape = self.shape();
        LayeredMap { record, split, reach: 0.0, last_takes_rest: true, filter, average, kernel: 1, shape }
    }
}

impl Method for BoundingOpacityMap {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn lookup(&self) -> Option<Lookup> {
        Some(
            self.layered_map(self.layering().any())
                .lookup(&["shadow/layered/lookup.wgsl"], self.align)
                .with_lookup_mode(self.lookup),
        )
    }

    fn taps(&self) -> Taps {
        self.filter.taps(Taps::Within(1))
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        let layering = self.layering();
        layering.passes(&self.layered_map(layering.any()))
    }

    fn builds_on_device(&self) -> bool {
        self.layering().is_fixed() && self.shape().march == March::Cells
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let built = self.layering().build(context, |split| self.layered_map(split))?;
        Ok(built.into_map(context, self))
    }
}
