//! Reading the values of keys, each refusal naming what there is.

use super::super::deep::MAX_MAP;
use super::super::{Entry, Filter, Key};
use crate::error::{Error, Result};

pub(super) const MAP: Key = Key { name: "map", values: "1..8192", default: "512", help: "texels a side" };
pub(super) const FILTER: Key =
    Key { name: "filter", values: "nearest|bilinear", default: "bilinear", help: "texels used for a point" };
pub(super) const BITS: Key = Key {
    name: "bits",
    values: "8|16|32",
    default: "16",
    help: "of a stored optical depth: 8 is a share of kappa, 16 and 32 are floats",
};
pub(super) const DEPTH_BITS: Key = Key {
    name: "depth_bits",
    values: "8|16|32",
    default: "16",
    help: "of a texel's stored depths: 8 and 16 are steps of the map's range, 32 a float",
};
pub(super) const MOST_LAYERS: u32 = 512;

/// A key with its value, as written.
pub(super) struct Given<'a> {
    pub entry: &'static Entry,
    pub key: &'a str,
    pub value: &'a str,
}

impl Given<'_> {
    /// The value is none of those that the key has.
    pub fn refuse(&self) -> Error {
        let known = self.entry.keys.iter().find(|k| k.name == self.key);
        let values = known.map_or("no such key", |k| k.values);
        Error::input(
            "bad value",
            format!("{}:{}={}", self.entry.name, self.key, self.value),
            format!("expected {values}"),
        )
    }

    pub fn whole(&self, least: u32, most: u32) -> Result<u32> {
        self.value.parse().ok().filter(|n| (least..=most).contains(n)).ok_or_else(|| self.refuse())
    }

    pub fn number(&self, least: f64, most: f64) -> Result<f64> {
        self.value.parse().ok().filter(|n| (least..=most).contains(n)).ok_or_else(|| self.refuse())
    }

    pub fn layers(&self) -> Result<u32> {
        self.whole(1, MOST_LAYERS)
    }

    pub fn map(&self) -> Result<u32> {
        self.whole(1, MAX_MAP)
    }

    pub fn bits(&self) -> Result<u32> {
        self.one_of(&[("8", 8), ("16", 16), ("32", 32)])
    }

    pub fn filter(&self) -> Result<Filter> {
        self.one_of(&[("nearest", Filter::Nearest), ("bilinear", Filter::Bilinear)])
    }

    pub fn one_of<T: Copy>(&self, values: &[(&str, T)]) -> Result<T> {
        values.iter().find(|(name, _)| *name == self.value).map(|(_, v)| *v).ok_or_else(|| self.refuse())
    }
}

/// `key=value` texts of settings that differ from the standard.
pub(super) fn params(layers: u32, others: &[(&str, String, bool)]) -> String {
    let mut text = format!("layers={layers}");
    for (key, value, differs) in others {
        if *differs {
            text += &format!(" {key}={value}");
        }
    }
    text
}
