//! `bom`: bounding opacity maps.
//!
//! The thesis *Bounding Opacity Maps* (2011), chapter 5, an extension of Yuksel and Keyser 2008. Symbols: `z_0` and
//! `z_1` the depths at which matter begins and ends in a texel, `K` layers from `z_0 + d_(k-1)` to `z_0 + d_k`,
//! `z_0 + d_K = z_1`.
//!
//! Deviations from the thesis, and why:
//! * Two marches in one pass instead of three passes: one from behind that stops at the first matter, which is
//!   `z_1`, and one from the light, which meets `z_0` before the layers.
//! * A lookup is linear between the two planes around it; the thesis reads one layer.
//! * The lookup texture of the hybrid split (5.2.2, 5.2.3, sections 7 and 9 of its appendix) has 1024 bins of float32
//!   instead of 256 of 8 bits, and a second row with the planes themselves, which the build cuts at.
//! * `split=auto` chooses as 5.2.3 does, from eleven ratios over whole images, but on the device and from a coarse
//!   map. Images are opacities `1 - T`, not rounded to 8 bits: rounded images of few levels look unlike each other
//!   (`measure=difference` does round). Two images without contrast count as fully correlated.
//! * `split=texel` is chapter 7's splitting texture, a ratio for every region of 4 x 4 texels. The sum of absolute
//!   differences that it proposes telescopes on a single ray, whose opacity never falls; what is chosen is the
//!   ratio whose greatest step between neighbouring planes is least, which bounds the error.
//! * Depths are rounded away from the light; `filter=bilinear` as in `dom`, ends like starts.

use super::super::spec::Setting;
use super::super::{BuildContext, Entry, Filter, Key, LightSpace, Method, ShadowMap};
use super::keys::{self, Given};
use super::ratio::{Measure, SplitChoice, all_splits, choose, choose_by_region, hybrid};
use super::record::Record;
use super::split::Split;
use super::{NO_DEPTH_PASS, PassLeftOut, Recipe, deep_opacity};
use crate::error::{Error, Result};
use std::time::Instant;

/// How layers share a texel's extent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BoundingSplit {
    Linear,
    Log,
    /// From linear (0) to logarithmic (1).
    Hybrid(f64),
    /// The hybrid ratio that suits the whole map.
    Auto(Measure),
    /// The hybrid ratio that suits each region.
    Texel,
}

/// Settings of a bounding opacity map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundingOpacityMap {
    /// Layers, `K` of the thesis: 1 to 512.
    pub layers: u32,
    pub split: BoundingSplit,
    /// Bits of the stored depths: 8, 16 or 32.
    pub depth_bits: u32,
    /// Bits of a stored optical depth: 8, 16 or 32.
    pub bits: u32,
    /// Texels a side.
    pub map: u32,
    pub filter: Filter,
}

impl Default for BoundingOpacityMap {
    fn default() -> Self {
        Self {
            layers: 15,
            split: BoundingSplit::Hybrid(0.5),
            depth_bits: 16,
            bits: 16,
            map: 512,
            filter: Filter::Bilinear,
        }
    }
}

pub(in super::super) static ENTRY: Entry = Entry {
    name: "bom",
    summary: "bounding opacity maps (2011): layers from where matter begins to where it ends",
    keys: &[
        Key { name: "layers", values: "1..512", default: "15", help: "layers" },
        Key {
            name: "split",
            values: "linear|log|hybrid|auto|texel",
            default: "hybrid",
            help: "how layers share the extent; auto and texel choose the ratio, for all or by region",
        },
        Key { name: "ratio", values: "0..1", default: "0.5", help: "from linear to log (split=hybrid)" },
        Key {
            name: "measure",
            values: "correlation|difference",
            default: "correlation",
            help: "least correlation or greatest difference between neighbouring layers (split=auto)",
        },
        keys::DEPTH_BITS,
        keys::BITS,
        keys::MAP,
        keys::FILTER,
    ],
    parse: |setting| Ok(Box::new(BoundingOpacityMap::from_setting(setting)?)),
};

const SPLITS: [(&str, BoundingSplit); 5] = [
    ("linear", BoundingSplit::Linear),
    ("log", BoundingSplit::Log),
    ("hybrid", BoundingSplit::Hybrid(0.5)),
    ("auto", BoundingSplit::Auto(Measure::Correlation)),
    ("texel", BoundingSplit::Texel),
];
const MEASURES: [(&str, Measure); 2] =
    [("correlation", Measure::Correlation), ("difference", Measure::Difference)];

impl BoundingOpacityMap {
    fn from_setting(setting: &Setting) -> Result<Self> {
        let mut s = Self::default();
        let (mut ratio, mut measure) = (None, None);
        for (key, value) in &setting.params {
            let given = Given { entry: &ENTRY, key, value };
            match key.as_str() {
                "layers" => s.layers = given.layers()?,
                "split" => s.split = given.one_of(&SPLITS)?,
                "ratio" => ratio = Some(given.number(0.0, 1.0)?),
                "measure" => measure = Some(given.one_of(&MEASURES)?),
                "depth_bits" => s.depth_bits = given.bits()?,
                "bits" => s.bits = given.bits()?,
                "map" => s.map = given.map()?,
                "filter" => s.filter = given.filter()?,
                _ => return Err(given.refuse()),
            }
        }
        // A key that does nothing is a slip.
        let idle = |key: &str, split: &str| {
            Error::input("bad value", format!("bom:{key}"), format!("it is of split={split} only"))
        };
        match (&mut s.split, ratio, measure) {
            (_, None, None) => {}
            (BoundingSplit::Hybrid(own), Some(ratio), None) => *own = ratio,
            (BoundingSplit::Auto(own), None, Some(measure)) => *own = measure,
            (BoundingSplit::Hybrid(_), _, Some(_)) => return Err(idle("measure", "auto")),
            (_, Some(_), _) => return Err(idle("ratio", "hybrid")),
            (_, None, Some(_)) => return Err(idle("measure", "auto")),
        }
        Ok(s)
    }

    fn split_params(&self) -> Vec<(&'static str, String, bool)> {
        let text = |name: &str| ("split", name.to_owned(), true);
        match self.split {
            BoundingSplit::Linear => vec![text("linear")],
            BoundingSplit::Log => vec![text("log")],
            BoundingSplit::Hybrid(ratio) => vec![("ratio", ratio.to_string(), true)],
            BoundingSplit::Auto(Measure::Correlation) => vec![text("auto")],
            BoundingSplit::Auto(Measure::Difference) => {
                vec![text("auto"), ("measure", "difference".into(), true)]
            }
            BoundingSplit::Texel => vec![text("texel")],
        }
    }
}

const NO_SEARCH: PassLeftOut =
    PassLeftOut { what: "search for the ratio", why: "a single layer is not split", optional: None };

impl Method for BoundingOpacityMap {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn params(&self) -> String {
        let standard = Self::default();
        let mut others = self.split_params();
        others.extend([
            ("depth_bits", self.depth_bits.to_string(), self.depth_bits != standard.depth_bits),
            ("bits", self.bits.to_string(), self.bits != standard.bits),
            ("filter", "nearest".into(), self.filter != standard.filter),
        ]);
        keys::params(self.layers, &others)
    }

    fn map_size(&self) -> Option<u32> {
        Some(self.map)
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let start = Instant::now();
        let light_space = LightSpace::fit(context.volume, &context.transfer.active, context.light, self.map);
        let mut host_ms = start.elapsed().as_secs_f64() * 1e3;
        let (mut split_choice, mut regions, mut search) = (None, None, None);
        let mut searched = true;
        let split = match self.split {
            BoundingSplit::Linear => Split::Power(1.0),
            BoundingSplit::Log => Split::Tables(vec![hybrid(1.0)]),
            BoundingSplit::Hybrid(ratio) => Split::Tables(vec![hybrid(ratio)]),
            BoundingSplit::Auto(_) | BoundingSplit::Texel if self.layers == 1 => {
                searched = false;
                Split::Power(1.0)
            }
            BoundingSplit::Auto(measure) => {
                let (row, choice, took): (u32, SplitChoice, _) = choose(context, self.layers, measure)?;
                tracing::info!(
                    "bom: ratio {:.1}, correlation {:.4} over {} layers",
                    choice.ratio,
                    choice.correlation,
                    self.layers
                );
                (split_choice, search) = (Some(choice), Some(took));
                Split::Tables(vec![all_splits().swap_remove(row as usize)])
            }
            BoundingSplit::Texel => {
                let (rows, took) = choose_by_region(context, self.layers, self.map)?;
                (regions, search) = (Some(rows), Some(took));
                Split::Tables(all_splits())
            }
        };
        let recipe = Recipe {
            record: Record {
                layers: self.layers,
                bits: self.bits,
                depths: 2,
                depth_bits: self.depth_bits,
                own_split: regions.is_some(),
            },
            split,
            reach_mm: 0.0,
            last_takes_rest: true,
            split_choice: 0,
            filter: self.filter,
            kernel: 1,
        };
        let mut built = recipe.build(context, light_space, regions.as_ref())?;
        if let Some((search_host_ms, span)) = search {
            host_ms += search_host_ms;
            built.report.device = built.report.device.map(|device| span.plus(device));
        }
        built.report.host_ms += host_ms;
        built.report.split_choice = split_choice;
        if !searched {
            built.report.passes_left_out = match built.report.passes_left_out {
                [] => &[NO_SEARCH],
                _ => &[NO_DEPTH_PASS, NO_SEARCH],
            };
        }
        Ok(built.behind(context, deep_opacity::LOOKUP, recipe.read_defs()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::parse_list;

    #[test]
    fn every_key_is_read_and_shown() {
        let shown = |text: &str| parse_list(text).unwrap().iter().map(|m| m.params()).collect::<Vec<_>>();
        assert_eq!(shown("bom"), ["layers=15 ratio=0.5"]);
        assert_eq!(
            shown("bom:layers=7,split=linear,log,hybrid,auto,texel"),
            [
                "layers=7 split=linear",
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
            ("bom:split=quadratic", "expected linear|log|hybrid|auto|texel"),
            ("bom:split=auto,measure=entropy", "expected correlation|difference"),
            ("bom:split=log,ratio=0.5", "bom:ratio): it is of split=hybrid only"),
            ("bom:split=auto,ratio=0.5", "bom:ratio): it is of split=hybrid only"),
            ("bom:measure=correlation", "bom:measure): it is of split=auto only"),
            ("bom:split=texel,measure=difference", "bom:measure): it is of split=auto only"),
            ("bom:beyond=extend", "there is: layers, split, ratio"),
        ] {
            let error = parse_list(text).unwrap_err();
            assert!(error.to_string().contains(why), "{error}");
            assert_eq!(error.exit_status(), 2);
        }
    }
}
