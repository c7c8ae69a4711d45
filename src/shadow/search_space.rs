//! What a search within a budget may set of a method: the values that its line of the registry lists for each key.

use super::method::{Entry, Method};
use super::settings::{Kind, Value, applies};
use super::spec::parse_spec;
use crate::error::{Error, Result};

/// A key with the values that are tried of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Place among the entry's keys.
    key: usize,
    values: Vec<Value>,
    /// Where a search starts: place of the key's default among the values, or the middle where that is a word for a number.
    default: usize,
    /// Values are numbers, and each costs no less memory than the one before.
    pub ordered: bool,
}

impl Axis {
    /// How many values there are.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are none, which no registry has.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }
}

/// The settings among which a search looks: a place is an index into the values of each axis.
#[derive(Clone)]
pub struct SearchSpace {
    entry: &'static Entry,
    axes: Vec<Axis>,
    defaults: Vec<Value>,
}

impl SearchSpace {
    /// Of a method; `None` where there is nothing to tune.
    ///
    /// # Errors
    /// A line of the registry whose list is not of its own keys and values, or lacks a default.
    pub fn of(entry: &'static Entry) -> Result<Option<Self>> {
        if entry.tuned.is_empty() {
            return Ok(None);
        }
        let spec = parse_spec(entry.tuned)?;
        let wrong =
            |key: &str, why: &str| Error::runtime("cannot tune", format!("{}:{key}", entry.name), why);
        let mut axes = Vec::new();
        for (name, texts) in &spec.params {
            let found = entry.keys.iter().enumerate().find(|(_, k)| k.name == name);
            let (place, key) = found.ok_or_else(|| wrong(name, "the method has no such key"))?;
            let values = texts.iter().map(|text| key.parse(text)).collect::<Option<Vec<_>>>();
            let values = values.ok_or_else(|| wrong(name, "a value is none of the key's"))?;
            let default = match key.parse(key.default) {
                // What a scene makes of a word is not known here: the middle is as good as any other place.
                Some(Value::Choice(_)) if matches!(key.kind, Kind::WholeOr { .. }) => Some(values.len() / 2),
                default => values.iter().position(|v| Some(*v) == default),
            };
            let default = default.ok_or_else(|| wrong(name, "the default is not among the values"))?;
            let ordered = match key.kind {
                Kind::Whole { .. } | Kind::WholeOr { .. } | Kind::Number { .. } => true,
                Kind::Choice(names) => names.iter().all(|name| name.parse::<f64>().is_ok()),
            };
            axes.push(Axis { key: place, values, default, ordered });
        }
        let defaults = entry.keys.iter().filter_map(|k| k.parse(k.default)).collect();
        Ok(Some(Self { entry, axes, defaults }))
    }

    /// The keys that are searched.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Where every key has its default, or the middle of its values.
    pub fn default_place(&self) -> Vec<usize> {
        self.axes.iter().map(|axis| axis.default).collect()
    }

    /// The same settings, keys without effect there at their defaults, so that what is the same is one place.
    pub fn canonical(&self, place: &[usize]) -> Vec<usize> {
        let values = self.values(place);
        let settle = |(axis, index): (&Axis, &usize)| {
            let key = &self.entry.keys[axis.key];
            if applies(self.entry.keys, &values, key) { *index } else { axis.default }
        };
        self.axes.iter().zip(place).map(settle).collect()
    }

    /// The method with the settings of a place; `None` where the entry makes none of them.
    pub fn method(&self, place: &[usize]) -> Option<Box<dyn Method>> {
        (self.entry.make)(&self.values(&self.canonical(place)))
    }

    fn values(&self, place: &[usize]) -> Vec<Value> {
        let mut values = self.defaults.clone();
        for (axis, index) in self.axes.iter().zip(place) {
            values[axis.key] = axis.values[*index];
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::{METHODS, parse};

    /// Every list of the registry: readable, with the defaults, and every place is a method that reads back.
    #[test]
    fn every_search_space_is_of_its_method() {
        let mut tunable = Vec::new();
        for entry in METHODS {
            let Some(space) = SearchSpace::of(entry).unwrap() else { continue };
            tunable.push(entry.name);
            // What a scene would choose is searched among numbers.
            let start = space.method(&space.default_place()).unwrap();
            let default = parse(entry.name).unwrap();
            for ((key, start), default) in entry.keys.iter().zip(start.values()).zip(default.values()) {
                assert!(start == default || matches!(key.kind, Kind::WholeOr { .. }), "{}", key.name);
            }
            for (i, axis) in space.axes().iter().enumerate() {
                assert!(axis.len() > 1, "{}", entry.name);
                for index in 0..axis.len() {
                    let mut place = space.default_place();
                    place[i] = index;
                    let method = space.method(&place).unwrap();
                    let map = method.map_size().map_or(String::new(), |n| format!("map={n}"));
                    let given: Vec<_> = [method.params().replace(' ', ","), map]
                        .into_iter()
                        .filter(|s| !s.is_empty())
                        .collect();
                    let again = parse(&format!("{}:{}", entry.name, given.join(","))).unwrap();
                    assert_eq!(again.values(), method.values(), "{}", entry.name);
                }
                let numbers: Vec<f64> =
                    axis.values.iter().filter_map(|v| v.to_string().parse().ok()).collect();
                if axis.ordered {
                    let rising = numbers.is_sorted_by(|a, b| a < b) || numbers.is_sorted_by(|a, b| a > b);
                    assert!(rising && numbers.len() == axis.len(), "{}: in order", entry.name);
                }
            }
        }
        assert!(
            ["dsm", "osm", "dom", "bom"].iter().all(|m| tunable.contains(m)) && !tunable.contains(&"none")
        );
    }

    #[test]
    fn settings_without_effect_are_one_place() {
        let space = SearchSpace::of(crate::shadow::entry("bom").unwrap()).unwrap().unwrap();
        let axis = |name| space.axes().iter().position(|a| space.entry.keys[a.key].name == name).unwrap();
        let (split, ratio) = (axis("split"), axis("ratio"));
        let mut place = space.default_place();
        place[ratio] = 0;
        assert_eq!(space.canonical(&place), place);
        // `ratio` is of split=hybrid only.
        place[split] = 0;
        assert_eq!(space.canonical(&place)[ratio], space.default_place()[ratio]);
        assert_eq!(space.method(&place).unwrap().params(), "layers=15 split=linear");
    }
}
