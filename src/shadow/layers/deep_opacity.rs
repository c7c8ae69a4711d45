//! `dom`: deep opacity maps.
//!
//! Yuksel and Keyser 2008, *Deep Opacity Maps*. Symbols: `z_0` the depth at which matter begins in a texel, `d_k`
//! (`0 <= k <= K`) the depth from there to the far side of layer `k`, the same for every texel; `d_0 = 0`.
//!
//! Deviations from the paper, and why:
//! * One pass instead of two: the march meets `z_0` before anything that lies behind it. It is the start of the first
//!   exact piece with extinction, not the depth of a drawn line.
//! * "Linearly increasing layer sizes" are read as `d_k - d_(k-1)` proportional to `k`, so `d_k = d_K k (k + 1) /
//!   (K (K + 1))`. The paper states no `d_K`; `spread` is its share of the map's depth range, all of it by default.
//! * Behind the last layer, the paper's three ways (section 3): `beyond=extend` counts what lies there in the last
//!   layer, so that it shadows itself; `ignore` leaves it out, so that it casts no shadow; `cover` makes the layers
//!   so large that the last one ends behind the volume, whatever `spread` says.
//! * The start is stored in a channel with the layers, in as many bits as asked for (`depth_bits`), and rounded away
//!   from the light, so that whatever lies in front of matter is fully lit.
//! * `filter=bilinear` averages `z_0` and the layers of neighbouring texels, as texture hardware does, where the four
//!   depths are close enough to be one surface; elsewhere each texel's layers start at its own `z_0`.

use super::super::spec::Setting;
use super::super::{BuildContext, Entry, Filter, Key, LightSpace, Method, ShadowMap};
use super::Recipe;
use super::keys::{self, Given};
use super::record::Record;
use super::split::Split;
use crate::error::Result;
use std::time::Instant;

pub(super) const LOOKUP: &[&str] =
    &["shadow/layers_layout.wgsl", "shadow/layers_read.wgsl", "shadow/deep_opacity.wgsl"];

/// What becomes of matter behind the last layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beyond {
    Extend,
    Ignore,
    Cover,
}

/// Settings of a deep opacity map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeepOpacityMap {
    /// Layers, `K` of the paper: 1 to 512.
    pub layers: u32,
    /// `d_K` as a share of the map's depth range.
    pub spread: f64,
    pub beyond: Beyond,
    /// Bits of a stored start depth: 8, 16 or 32.
    pub depth_bits: u32,
    /// Bits of a stored optical depth: 8, 16 or 32.
    pub bits: u32,
    /// Texels a side.
    pub map: u32,
    pub filter: Filter,
}

impl Default for DeepOpacityMap {
    fn default() -> Self {
        Self {
            layers: 15,
            spread: 1.0,
            beyond: Beyond::Extend,
            depth_bits: 16,
            bits: 16,
            map: 512,
            filter: Filter::Bilinear,
        }
    }
}

pub(in super::super) static ENTRY: Entry = Entry {
    name: "dom",
    summary: "deep opacity maps (Yuksel and Keyser 2008): layers from where matter begins",
    keys: &[
        Key { name: "layers", values: "1..512", default: "15", help: "layers, each larger than the last" },
        Key {
            name: "spread",
            values: "0.001..1",
            default: "1",
            help: "how deep the layers reach, as a share of the map's depth range",
        },
        Key {
            name: "beyond",
            values: "extend|ignore|cover",
            default: "extend",
            help: "what lies behind the last layer where spread < 1: in it, nowhere, or nothing since the layers grow",
        },
        keys::DEPTH_BITS,
        keys::BITS,
        keys::MAP,
        keys::FILTER,
    ],
    parse: |setting| Ok(Box::new(DeepOpacityMap::from_setting(setting)?)),
};

const BEYONDS: [(&str, Beyond); 3] =
    [("extend", Beyond::Extend), ("ignore", Beyond::Ignore), ("cover", Beyond::Cover)];

impl DeepOpacityMap {
    fn from_setting(setting: &Setting) -> Result<Self> {
        let mut s = Self::default();
        for (key, value) in &setting.params {
            let given = Given { entry: &ENTRY, key, value };
            match key.as_str() {
                "layers" => s.layers = given.layers()?,
                "spread" => s.spread = given.number(0.001, 1.0)?,
                "beyond" => s.beyond = given.one_of(&BEYONDS)?,
                "depth_bits" => s.depth_bits = given.bits()?,
                "bits" => s.bits = given.bits()?,
                "map" => s.map = given.map()?,
                "filter" => s.filter = given.filter()?,
                _ => return Err(given.refuse()),
            }
        }
        Ok(s)
    }
}

impl Method for DeepOpacityMap {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn params(&self) -> String {
        let standard = Self::default();
        let beyond = BEYONDS.iter().find(|(_, b)| *b == self.beyond).map_or("", |(name, _)| name);
        // The layers of `cover` reach behind everything, whatever `spread` says.
        let spread_matters = self.beyond != Beyond::Cover;
        keys::params(
            self.layers,
            &[
                ("spread", self.spread.to_string(), spread_matters && self.spread != standard.spread),
                ("beyond", beyond.into(), self.beyond != standard.beyond),
                ("depth_bits", self.depth_bits.to_string(), self.depth_bits != standard.depth_bits),
                ("bits", self.bits.to_string(), self.bits != standard.bits),
                ("filter", "nearest".into(), self.filter != standard.filter),
            ],
        )
    }

    fn map_size(&self) -> Option<u32> {
        Some(self.map)
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let start = Instant::now();
        let light_space = LightSpace::fit(context.volume, &context.transfer.active, context.light, self.map);
        let [near, far] = light_space.z_range;
        let spread = if self.beyond == Beyond::Cover { 1.0 } else { self.spread };
        let recipe = Recipe {
            record: Record {
                layers: self.layers,
                bits: self.bits,
                depths: 1,
                depth_bits: self.depth_bits,
                own_split: false,
            },
            split: Split::Growing,
            reach_mm: spread * (far - near),
            last_takes_rest: self.beyond != Beyond::Ignore,
            split_choice: 0,
            filter: self.filter,
            kernel: 1,
        };
        let host_ms = start.elapsed().as_secs_f64() * 1e3;
        let mut built = recipe.build(context, light_space, None)?;
        built.report.host_ms += host_ms;
        Ok(built.behind(context, LOOKUP, recipe.read_defs()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::parse_list;

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
            shown("dom:spread=0.25,depth_bits=8,bits=32,filter=nearest,map=64"),
            ["layers=15 spread=0.25 depth_bits=8 bits=32 filter=nearest"]
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
            ("dom:slicing=uniform", "there is: layers, spread, beyond, depth_bits, bits, map, filter"),
        ] {
            let error = parse_list(text).unwrap_err();
            assert!(error.to_string().contains(why), "{error}");
            assert_eq!(error.exit_status(), 2);
        }
    }
}
