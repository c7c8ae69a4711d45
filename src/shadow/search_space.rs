//! Search space of a shadow method: the values of each setting that a search within a budget of memory or time tries.

use super::keys::{MAP, SCALE};
use super::method::{Entry, Method, MethodSpec};
use super::settings::{Key, Kind, Value, applies};

/// Axis of the search space of a shadow method: one setting with the values that a search tries.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Index of the setting among all settings of its shadow method.
    key: usize,
    values: Vec<Value>,
    /// Index of the setting's default among the values that a search tries; the middle value if the scene chooses the
    /// default.
    default: usize,
    /// Whether the values that a search tries for the setting are numbers, in the order of non-decreasing memory.
    pub ordered: bool,
}

impl Axis {
    fn of((at, key): (usize, &Key)) -> Self {
        let values: Vec<_> = key.search_space.iter().filter_map(|text| key.parse(text)).collect();
        let default = key.parse(key.default);
        let default = values.iter().position(|value| Some(*value) == default).unwrap_or(values.len() / 2);
        let ordered = match key.kind {
            Kind::Whole { .. } | Kind::WholeOr { .. } | Kind::Number { .. } | Kind::NumberOr { .. } => true,
            Kind::Choice(names) => names.iter().all(|name| name.parse::<f64>().is_ok()),
        };
        Self { key: at, values, default, ordered }
    }

    /// Returns the number of values that a search tries for this setting of a shadow method.
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.values.len()
    }
}

/// Search space of a shadow method: all combinations of the values that a search tries for its settings. A point of
/// the space (`place`) is one index for each axis.
#[derive(Clone)]
pub struct SearchSpace {
    defaults: MethodSpec,
    axes: Vec<Axis>,
}

impl SearchSpace {
    /// Creates the search space of a shadow method; `None` if no setting of the method is searched.
    pub fn of(entry: &'static Entry) -> Option<Self> {
        let searched = entry.keys.iter().enumerate().filter(|(_, key)| !key.search_space.is_empty());
        let mut axes: Vec<_> = searched.map(Axis::of).collect();
        // The number of texels or nodes costs most: it is searched last.
        axes.sort_by_key(|axis| [MAP, SCALE].contains(&entry.keys[axis.key].name));
        (!axes.is_empty()).then(|| Self { defaults: MethodSpec::default_of(entry), axes })
    }

    /// Returns the axes of the search space: settings with the values that are tried.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Returns the point of the search space at which a search for the best settings of a shadow method starts.
    pub fn default_place(&self) -> Vec<usize> {
        self.axes.iter().map(|axis| axis.default).collect()
    }

    /// Returns the point of the search space with the settings of a specification. A setting with a value that no search
    /// tries has its default.
    pub fn place_of(&self, spec: &MethodSpec) -> Vec<usize> {
        let index =
            |axis: &Axis| axis.values.iter().position(|tried| spec.values().get(axis.key) == Some(tried));
        self.axes.iter().map(|axis| index(axis).unwrap_or(axis.default)).collect()
    }

    /// Replaces settings without effect by their defaults in a point of the search space, so that equivalent settings
    /// are the same point.
    pub fn canonical(&self, place: &[usize]) -> Vec<usize> {
        let (keys, values) = (self.defaults.entry().keys, self.values(place));
        let canonical = |(axis, index): (&Axis, &usize)| {
            if applies(keys, &values, &keys[axis.key]) { *index } else { axis.default }
        };
        self.axes.iter().zip(place).map(canonical).collect()
    }

    /// Creates the shadow method with the settings of a point of the search space; `None` if they are invalid.
    pub fn method(&self, place: &[usize]) -> Option<Box<dyn Method>> {
        (self.defaults.entry().make)(&self.values(&self.canonical(place)))
    }

    fn values(&self, place: &[usize]) -> Vec<Value> {
        let mut values = self.defaults.values().to_vec();
        for (axis, index) in self.axes.iter().zip(place) {
            values[axis.key] = axis.values[*index];
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::METHODS;

    #[test]
    fn every_searched_value_is_valid_and_every_place_reads_back() {
        let mut tunable = Vec::new();
        for entry in METHODS {
            let Some(space) = SearchSpace::of(entry) else { continue };
            tunable.push(entry.name);
            let (start, default) =
                (space.method(&space.default_place()).unwrap(), MethodSpec::default_of(entry));
            for ((key, start), default) in entry.keys.iter().zip(start.values()).zip(default.values()) {
                assert!(start == *default || matches!(key.kind, Kind::WholeOr { .. }), "{}", key.name);
            }
            for (i, axis) in space.axes().iter().enumerate() {
                let key = &entry.keys[axis.key];
                assert!(
                    axis.len() > 1 && axis.len() == key.search_space.len(),
                    "{}:{}",
                    entry.name,
                    key.name
                );
                let is_scene_choice = matches!(key.kind, Kind::WholeOr { .. });
                assert!(is_scene_choice || axis.values[axis.default] == key.parse(key.default).unwrap());
                for index in 0..axis.len() {
                    let mut place = space.default_place();
                    place[i] = index;
                    let spec = space.method(&place).unwrap().spec();
                    assert_eq!(spec.to_string().parse::<MethodSpec>().unwrap(), spec);
                }
                if axis.ordered {
                    let numbers: Vec<f64> =
                        axis.values.iter().filter_map(|v| v.to_string().parse().ok()).collect();
                    let sorted = numbers.is_sorted_by(|a, b| a < b) || numbers.is_sorted_by(|a, b| a > b);
                    assert!(sorted && numbers.len() == axis.len(), "{}:{}", entry.name, key.name);
                }
            }
        }
        assert!(
            ["dsm", "osm", "dom", "bom"].iter().all(|m| tunable.contains(m)) && !tunable.contains(&"none")
        );
    }

    #[test]
    fn settings_without_effect_are_one_place() {
        let space = SearchSpace::of(crate::shadow::entry("bom").unwrap()).unwrap();
        let axis =
            |name| space.axes().iter().position(|a| space.defaults.entry().keys[a.key].name == name).unwrap();
        let (split, ratio) = (axis("split"), axis("ratio"));
        let mut place = space.default_place();
        place[ratio] = 0;
        assert_eq!(space.canonical(&place), place);
        // `ratio` has no effect with split=linear.
        place[split] = 0;
        assert_eq!(space.canonical(&place)[ratio], space.default_place()[ratio]);
        assert_eq!(space.method(&place).unwrap().params(), "layers=15 split=linear");
    }
}
