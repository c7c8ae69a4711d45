//! `dom`: deep opacity maps.
//!
//! Yuksel and Keyser 2008, *Deep Opacity Maps*. Symbols: `z_0` the depth at which matter begins in a texel, `d_k`
//! (`0 <= k <= K`) the depth from there to the far side of layer `k`, the same for every texel; `d_0 = 0`.
//!
//! Deviations from the paper, and why:
//! * One pass instead of two: the march meets `z_0` before anything that lies behind it. It is the start of the first
//!   exact piece with extinction, not the depth of a drawn line.
//! * "Linearly increasing layer sizes" are read as `d_k - d_(k-1)` proportional to `k`, so `d_k = d_K k (k + 1) /
//!   (K (K + 1))` (`split=growing`; the splits of `bom` can be had as well). The paper sets sizes by hand, a scene at a
//!   time, so that layers "cover the illuminated part", and states no `d_K`; `spread` is its share of the map's depth
//!   range, a quarter by default.
//! * Behind the last layer, the paper's three ways (section 3): `beyond=extend` counts what lies there in the last
//!   layer, so that it shadows itself; `ignore` leaves it out, so that it casts no shadow; `cover` makes the layers
//!   so large that the last one ends behind the volume, whatever `spread` says.
//! * The start is stored in a channel with the layers, in as many bits as asked for (`depth_bits`), and rounded away
//!   from the light, so that whatever lies in front of matter is fully lit.
//! * `filter=bilinear` averages `z_0` and the layers of neighbouring texels, as texture hardware does, where the four
//!   depths are close enough to be one surface; elsewhere each texel's layers start at its own `z_0`.

use super::keys::{LOOKUP_KEY, Lookups};
use super::layered::{
    AVERAGE_KEY, Average, BITS_KEY, DEPTH_BITS_KEY, LAYERS, LOG_SIZE_KEY, LayerSplit, Layering, MEASURE_KEY,
    Measure, RATIO_KEY, Recipe, Record, Split, split_key,
};
use super::method::{Entry, Lookup, Method, ShadowMap};
use super::settings::{Key, Value, When, choices, settings};
use super::style::{Marker, Style};
use crate::error::Result;
use crate::field::BuildContext;
use crate::gpu::ShaderVariant;

choices! {
    /// What becomes of matter behind the last layer.
    pub enum Beyond {
        /// It counts in the last layer.
        Extend = "extend",
        /// It casts no shadow.
        Ignore = "ignore",
        /// There is none: the layers reach behind everything.
        Cover = "cover",
    }
}

settings! {
    /// Settings of a deep opacity map.
    pub struct DeepOpacityMap {
        /// Layers, `K` of the paper.
        layers: u32 = Key::whole(LAYERS, "15", "layers").in_label().search(&["1", "2", "3", "5", "7", "10", "15", "24", "32"]),
        /// How layers share their depth.
        split: LayerSplit = split_key("growing"),
        /// From linear (0) to logarithmic (1).
        ratio: f64 = RATIO_KEY,
        /// Logarithms go over the interval from 1 to this.
        log_size: f64 = LOG_SIZE_KEY,
        /// By what a ratio is chosen.
        measure: Measure = MEASURE_KEY,
        /// `d_K` as a share of the map's depth range.
        spread: f64 = Key::number(
            [0.001, 1.0],
            "0.25",
            "how deep the layers reach, as a share of the map's depth range",
        )
        .search(&["0.1", "0.25", "0.5", "1"])
        .when(When::Unless("beyond", "cover")),
        /// What becomes of matter behind the last layer.
        beyond: Beyond = Key::choice(
            Beyond::NAMES,
            "extend",
            "what lies behind the last layer: it is in that, nowhere, or there is none since the layers grow",
        )
        .search(&["extend", "cover"]),
        /// Bits of a stored start depth: 8, 16 or 32.
        depth_bits: u32 = DEPTH_BITS_KEY,
        /// Bits of a stored optical depth: 8, 16 or 32.
        bits: u32 = BITS_KEY,
        ..MapSettings,
        /// What the filter averages.
        average: Average = AVERAGE_KEY,
        /// How eye samples ask for light.
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
    stability: "dom:map=64",
    style: Style { color: [0, 158, 115], marker: Marker::Up },
};

impl DeepOpacityMap {
    fn layering(&self) -> Layering {
        let Self { layers, split, ratio, log_size, measure, .. } = *self;
        Layering { layers, split, ratio, log_size, measure }
    }

    fn recipe(&self, split: Split) -> Recipe {
        let Self { layers, bits, depth_bits, filter, average, .. } = *self;
        Recipe {
            record: Record { layers, bits, depths: 1, depth_bits, own_split: self.layering().by_texel() },
            split,
            // The layers of `cover` reach behind everything, whatever `spread` says.
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
            self.recipe(self.layering().any())
                .lookup("shadow/layered/lookup.wgsl")
                .with_lookup_mode(self.lookup),
        )
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        let layering = self.layering();
        layering.passes(&self.recipe(layering.any()))
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let built = self.layering().build(context, |split| self.recipe(split))?;
        Ok(built.into_map(context, self))
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse_list;

    #[test]
    fn every_key_is_read_and_shown() {
        let shown = |text: &str| parse_list(text).unwrap().iter().map(|m| m.params()).collect::<Vec<_>>();
        assert_eq!(shown("dom"), ["layers=15"]);
        assert_eq!(
            shown("dom:layers=3,7,beyond=extend,ignore,cover"),
            [
                "layers=3",
                "layers=3 beyond=ignore",
                "layers=3 beyond=cover",
                "layers=7",
                "layers=7 beyond=ignore",
                "layers=7 beyond=cover"
            ]
        );
        assert_eq!(
            shown("dom:spread=0.5,depth_bits=8,bits=32,filter=nearest,map=64"),
            ["layers=15 spread=0.5 depth_bits=8 bits=32 filter=nearest"]
        );
        assert_eq!(
            shown("dom:layers=7,split=linear,growing,hybrid,auto"),
            ["layers=7 split=linear", "layers=7", "layers=7 split=hybrid ratio=0.5", "layers=7 split=auto"]
        );
        assert_eq!(shown("dom:spread=0.25,beyond=cover"), ["layers=15 beyond=cover"]);
        assert_eq!(parse_list("dom:map=64").unwrap()[0].map_size(), Some(64));
    }

    #[test]
    fn what_is_out_of_range_is_refused_by_name() {
        for (text, why) in [
            ("dom:layers=0", "dom:layers=0): expected 1..512"),
            ("dom:spread=0", "expected 0.001..1"),
            ("dom:spread=nan", "expected 0.001..1"),
            ("dom:beyond=clamp", "expected extend|ignore|cover"),
            ("dom:depth_bits=12", "expected 8|16|32"),
            (
                "dom:slicing=uniform",
                "there is: layers, split, ratio, log_size, measure, spread, beyond, depth_bits, bits, from, march, step, map, fit, filter, average, lookup",
            ),
        ] {
            let error = parse_list(text).unwrap_err();
            assert!(error.to_string().contains(why), "{error}");
            assert_eq!(error.exit_status(), 2);
        }
    }
}
