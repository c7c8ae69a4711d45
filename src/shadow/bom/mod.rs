//! `bom`: bounding opacity maps.
//!
//! Voicu 2011, *Real-time volumetric shadows for dynamic rendering* (the thesis on bounding opacity maps), chapter
//! 5, an extension of Yuksel and Keyser 2008. Symbols: `z_0` and `z_1` the depths at which matter begins and ends
//! in a texel, `K` layers from `z_0 + d_(k-1)` to `z_0 + d_k`, `z_0 + d_K = z_1`.
//!
//! Deviations from the thesis, and why:
//! * Two marches in one pass instead of three passes: one from behind that stops at the first matter, which is
//!   `z_1`, and one from the light, which meets `z_0` before the layers.
//! * A lookup is linear between the two planes around it; the thesis reads one layer.
//! * The interval `[1, N]` of the logarithm is `log_size`, 256 by default: no size of the lookup texture is stated, and the
//!   appendix's own rounding of `log2` to a whole number is not followed.
//! * The lookup texture of the hybrid split (5.2.2, 5.2.3, sections 7 and 9 of its appendix) has 1024 bins of float32
//!   instead of 8 bits, and a second row with the planes themselves, which the build cuts at.
//! * `split=auto` chooses as 5.2.3 does, from eleven ratios over whole images, but on the device and from a coarse
//!   map. Images are opacities `1 - T`, not rounded to 8 bits: rounded images of few levels look unlike each other
//!   (`measure=difference` does round). Two images without contrast count as fully correlated.
//! * `split=texel` is chapter 7's splitting texture, a ratio for every region of 4 x 4 texels. The sum of absolute
//!   differences that it proposes telescopes on a single ray, whose opacity never falls; what is chosen is the
//!   ratio whose greatest step between neighbouring planes is least, which bounds the error.
//! * Depths are rounded away from the light; `filter=bilinear` as in `dom`, ends like starts.

use super::keys::{LOOKUP_KEY, Lookups};
use super::layered::{
    AVERAGE_KEY, Average, BITS_KEY, DEPTH_BITS_KEY, LAYERS, LOG_SIZE_KEY, LayerSplit, Layering, MEASURE_KEY,
    Measure, RATIO_KEY, Recipe, Record, Split, split_key,
};
use super::method::{Entry, Lookup, Method, ShadowMap};
use super::settings::{Key, Value, settings};
use super::style::{Marker, Style};
use crate::error::Result;
use crate::field::BuildContext;
use crate::gpu::ShaderVariant;

settings! {
    /// Settings of a bounding opacity map.
    pub struct BoundingOpacityMap {
        /// Layers, `K` of the thesis.
        layers: u32 = Key::whole(LAYERS, "15", "layers").in_label().search(&["1", "2", "3", "5", "7", "10", "15", "24", "32"]),
        /// How layers share a texel's extent.
        split: LayerSplit = split_key("hybrid"),
        /// From linear (0) to logarithmic (1).
        ratio: f64 = RATIO_KEY,
        /// Logarithms go over the interval from 1 to this.
        log_size: f64 = LOG_SIZE_KEY,
        /// By what a ratio is chosen.
        measure: Measure = MEASURE_KEY,
        /// Bits of the stored depths: 8, 16 or 32.
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
    name: "bom",
    summary: "bounding opacity maps (2011): layers from where matter begins to where it ends",
    keys: BoundingOpacityMap::KEYS,
    make: |values| Some(Box::new(BoundingOpacityMap::from_values(values)?)),
    compared: "bom:layers=3,7,15",
    curve: "bom:layers=15",
    stability: "bom:map=64",
    style: Style { color: [213, 94, 0], marker: Marker::Diamond },
};

impl BoundingOpacityMap {
    fn layering(&self) -> Layering {
        let Self { layers, split, ratio, log_size, measure, .. } = *self;
        Layering { layers, split, ratio, log_size, measure }
    }

    fn recipe(&self, split: Split) -> Recipe {
        let Self { layers, bits, depth_bits, filter, average, .. } = *self;
        let record = Record { layers, bits, depths: 2, depth_bits, own_split: self.layering().by_texel() };
        let shape = self.shape();
        Recipe { record, split, reach: 0.0, last_takes_rest: true, filter, average, kernel: 1, shape }
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
        assert_eq!(shown("bom"), ["layers=15 ratio=0.5"]);
        assert_eq!(
            shown("bom:layers=7,split=linear,growing,log,hybrid,auto,texel"),
            [
                "layers=7 split=linear",
                "layers=7 split=growing",
                "layers=7 split=log",
                "layers=7 ratio=0.5",
                "layers=7 split=auto",
                "layers=7 split=texel"
            ]
        );
        assert_eq!(shown("bom:ratio=0,0.25"), ["layers=15 ratio=0", "layers=15 ratio=0.25"]);
        assert_eq!(
            shown("bom:split=auto,measure=difference,depth_bits=32,bits=8,filter=nearest"),
            ["layers=15 split=auto measure=difference depth_bits=32 bits=8 filter=nearest"]
        );
    }

    #[test]
    fn what_is_out_of_range_or_idle_is_refused_by_name() {
        for (text, why) in [
            ("bom:layers=600", "bom:layers=600): expected 1..512"),
            ("bom:ratio=1.1", "expected 0..1"),
            ("bom:split=quadratic", "expected linear|growing|log|hybrid|auto|texel"),
            ("bom:split=auto,measure=entropy", "expected correlation|difference"),
            ("bom:split=log,ratio=0.5", "bom:ratio): it has an effect with split=hybrid only"),
            ("bom:split=auto,ratio=0.5", "bom:ratio): it has an effect with split=hybrid only"),
            ("bom:measure=correlation", "bom:measure): it has an effect with split=auto only"),
            ("bom:split=texel,measure=difference", "bom:measure): it has an effect with split=auto only"),
            ("bom:beyond=extend", "there is: layers, split, ratio"),
        ] {
            let error = parse_list(text).unwrap_err();
            assert!(error.to_string().contains(why), "{error}");
            assert_eq!(error.exit_status(), 2);
        }
    }
}
