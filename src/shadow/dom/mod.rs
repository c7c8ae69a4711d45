//! Shadow method `dom`: deep opacity maps.
//!
//! Yuksel and Keyser 2008, *Deep Opacity Maps*. Symbols: `z_0` is the depth at which matter begins in a texel, `d_k`
//! (`0 <= k <= K`) the depth from there to the far side of layer `k`, the same for every texel; `d_0 = 0`.
//!
//! Deviations from the paper, and why:
//! * One pass replaces two: the march of a light ray passes `z_0` before the layers. `z_0` is the start of the first
//!   segment with extinction, not the depth of a drawn line.
//! * "Linearly increasing layer sizes" are read as `d_k - d_(k-1)` proportional to `k`, so `d_k = d_K k (k + 1) / (K
//!   (K + 1))` (`split=growing`; the splits of `bom` exist, too). The paper sets sizes by hand for each scene, so
//!   that layers "cover the illuminated part", and states no `d_K`; `spread` is its share of the map's depth range.
//! * The paper has three treatments of matter behind the last layer (section 3): `beyond=extend` adds it to the last
//!   layer, so that it shadows itself; `ignore` skips it, so that it casts no shadow; `cover` enlarges the layers so
//!   that the last one ends behind the volume, whatever `spread`.
//! * The start depth is stored with the layers, in `depth_bits` bits, and rounded away from the light, so that points
//!   in front of matter are fully lit.
//! * `filter=bilinear` averages the optical depths of neighbouring texels, whose layers start at their own `z_0`; with
//!   `align=on`, at the mean `z_0` if the four depths are close enough to be one surface.

use super::filter::Taps;
use super::keys::{ALIGN_KEY, Align, LOOKUP_KEY, Lookups, settings};
use super::layered::{
    AVERAGE_KEY, Average, BITS_KEY, DEPTH_BITS_KEY, LAYERS, LOG_SIZE_KEY, LayerSplit, LayeredMap, Layering,
    MEASURE_KEY, Measure, RATIO_KEY, Record, Split, split_key,
};
use super::lookup::Lookup;
use super::method::{Entry, Method, ShadowMap};
use super::published::Published;
use super::settings::{Key, Value, When, choices};
use super::style::{Marker, Style};
use crate::error::Result;
use crate::field::{BuildContext, March};
use crate::gpu::ShaderVariant;

choices! {
    /// Treatment of matter behind the last layer of a deep opacity map.
    pub enum Beyond {
        /// Extends the last layer of a deep opacity map to the end of the light ray, so that it includes all matter
        /// behind it.
        Extend = "extend",
        /// Ignores matter behind the last layer of a deep opacity map, which then casts no shadow.
        Ignore = "ignore",
        /// Enlarges the layers of a deep opacity map until the last one ends behind all matter.
        Cover = "cover",
    }
}

settings! {
    /// Settings of a deep opacity map.
    pub struct DeepOpacityMap {
        /// Number of layers of a deep opacity map (`K` of Yuksel and Keyser 2008).
        layers: u32 = Key::whole(LAYERS, "15", "number of layers").in_label().search(&["1", "2", "3", "5", "7", "10", "15", "24", "32", "48", "64", "128"]),
        /// Rule that divides the depth range behind the first matter into the layers of a deep opacity map.
        split: LayerSplit = split_key("growing"),
        /// Weight of logarithmic against linear layer spacing with `split=hybrid`, from 0 (linear) to 1
        /// (logarithmic).
        ratio: f64 = RATIO_KEY,
        /// Upper end of the interval `[1, log_size]` to which depth is scaled before its logarithm spaces the layers
        /// of the shadow map.
        log_size: f64 = LOG_SIZE_KEY,
        /// Criterion by which `split=auto` chooses between linear and logarithmic layer spacing: correlation or
        /// difference of neighbouring layers.
        measure: Measure = MEASURE_KEY,
        /// Total thickness of all layers of a deep opacity map (`d_K`), as a share of the map's depth range.
        spread: f64 = Key::number(
            [0.001, 1.0],
            "0.25",
            "depth that the layers cover, as a share of the map's depth range",
        )
        .search(&["0.1", "0.25", "0.5", "1"])
        .when(When::Unless("beyond", "cover")),
        /// Treatment of matter behind the last layer of a deep opacity map.
        beyond: Beyond = Key::choice(
            Beyond::NAMES,
            "extend",
            "matter behind the last layer: added to it, ignored, or covered by larger layers",
        )
        .search(&["extend", "cover"]),
        /// Number of bits of each texel's stored start depth, at which matter begins: 8, 16 or 32.
        depth_bits: u32 = DEPTH_BITS_KEY,
        /// Number of bits of each optical depth stored in a deep opacity map: 8, 16 or 32.
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
    name: "dom",
    summary: "deep opacity maps (Yuksel and Keyser 2008): layers from where matter begins",
    keys: DeepOpacityMap::KEYS,
    make: |values| Some(Box::new(DeepOpacityMap::from_values(values)?)),
    compared: "dom:layers=3,7,15",
    curve: "dom:layers=15",
    stability: "dom:map=64,near=0",
    published: Some(Published {
        paper: "Yuksel and Keyser 2008",
        settings: "dom:layers=3,near=0,average=depth,lookup=each",
    }),
    style: Style { color: [0, 158, 115], marker: Marker::Up },
};

impl DeepOpacityMap {
    fn layering(&self) -> Layering {
        let Self { layers, split, ratio, log_size, measure, .. } = *self;
        Layering { layers, split, ratio, log_size, measure }
    }

    fn layered_map(&self, split: Split) -> LayeredMap {
        let Self { layers, bits, depth_bits, filter, average, .. } = *self;
        LayeredMap {
            record: Record { layers, bits, depths: 1, depth_bits, own_split: self.layering().by_texel() },
            split,
            reach: if self.beyond == Beyond::Cover { 1.0 } else { self.spread },
            last_takes_rest: self.beyond != Beyond::Ignore,
            filter,
            average,
            kernel: 1,
            shape: self.shape(),
        }
    }
}

impl Method for DeepOpacityMap {
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
