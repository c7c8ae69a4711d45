//! Registry of all shadow methods, and the parser of lists of methods. A method is written
//! `NAME[:setting=value,...]`, and `;` separates methods. A value without `=` is one more value of the setting before
//! it.

use super::keys::MAP;
use super::method::{Entry, Method, MethodSpec};
use super::settings::{Value, When};
use super::{
    avsm, beer, bom, clusters, dom, dsm, fourier, halfangle, lightvolume, moments, none, osm, rays, sat,
    wavelet,
};
use crate::error::{Error, Result};
use std::collections::HashSet;
use std::str::FromStr;
use std::sync::LazyLock;

const WHAT: &str = "bad shadow method";

/// Largest number of combinations of settings that the text of one shadow method may stand for; more is taken as a
/// typing error.
const MAX_COMBINATIONS: usize = 10_000;

/// Registry entries of all shadow methods, in the order of tables and menus.
pub const METHODS: &[&Entry] = &[
    &none::ENTRY,
    &rays::ENTRY,
    &dsm::ENTRY,
    &osm::ENTRY,
    &dom::ENTRY,
    &bom::ENTRY,
    &clusters::ENTRY,
    &fourier::ENTRY,
    &wavelet::ENTRY,
    &avsm::ENTRY,
    &moments::ENTRY,
    &beer::ENTRY,
    &lightvolume::ENTRY,
    &sat::ENTRY,
    &halfangle::ENTRY,
    #[cfg(feature = "half")]
    &super::half::ENTRY,
];

/// Returns the registry entry of the shadow method with the given name.
pub fn entry(name: &str) -> Option<&'static Entry> {
    METHODS.iter().copied().find(|m| m.name == name)
}

/// Shadow methods that the comparison table measures by default, with their settings, in command-line syntax.
pub static COMPARED: LazyLock<String> = LazyLock::new(|| {
    let lists =
        METHODS.iter().flat_map(|m| [m.compared, m.published.map_or("", |published| published.settings)]);
    lists.filter(|list| !list.is_empty()).collect::<Vec<_>>().join(";")
});
/// Shadow methods whose transmittance `umbravox probe --curve` plots by default, in command-line syntax.
pub static CURVES: LazyLock<String> = LazyLock::new(|| joined(|m| m.curve));
/// Shadow methods that `umbravox stability` tests by default, in command-line syntax.
pub static STABILITY: LazyLock<String> = LazyLock::new(|| joined(|m| m.stability));

/// Joins one field of all registry entries of shadow methods to a list separated by `;`.
fn joined(list: impl Fn(&Entry) -> &'static str) -> String {
    METHODS.iter().map(|m| list(m)).filter(|r| !r.is_empty()).collect::<Vec<_>>().join(";")
}

/// Parses one shadow method with its settings, `METHOD[:key=value,...]`.
///
/// # Errors
/// See [`MethodSpec::parse_list`].
pub fn parse(text: &str) -> Result<Box<dyn Method>> {
    text.parse::<MethodSpec>()?.method()
}

/// Parses a list of shadow methods with their settings ([`MethodSpec::parse_list`]).
///
/// # Errors
/// See [`MethodSpec::parse_list`].
pub fn parse_list(text: &str) -> Result<Vec<Box<dyn Method>>> {
    MethodSpec::parse_list(text)?.iter().map(MethodSpec::method).collect()
}

/// Parses a list of shadow methods with their settings, and removes repetitions.
///
/// # Errors
/// See [`MethodSpec::parse_list`].
pub fn parse_distinct(text: &str) -> Result<Vec<Box<dyn Method>>> {
    let (mut specs, mut found) = (MethodSpec::parse_list(text)?, HashSet::new());
    specs.retain(|spec| found.insert(spec.clone()));
    specs.iter().map(MethodSpec::method).collect()
}

impl MethodSpec {
    /// Parses shadow methods separated by `;` (one at the end is allowed). Every combination of the given values is
    /// one method specification, and the last setting varies fastest.
    ///
    /// # Errors
    /// The text is malformed, names an unknown method or setting, has a value out of range, or expands to more than
    /// 10,000 combinations.
    pub fn parse_list(text: &str) -> Result<Vec<Self>> {
        let text = text.trim();
        let specs = text.strip_suffix(';').unwrap_or(text).split(';').map(Written::parse);
        // All methods are parsed before the first name is looked up, so that malformed text is reported first.
        let expanded =
            specs.collect::<Result<Vec<_>>>()?.iter().map(Written::expand).collect::<Result<Vec<_>>>()?;
        Ok(expanded.concat())
    }
}

impl Default for MethodSpec {
    /// Returns the default shadow method: deep shadow maps with default settings.
    fn default() -> Self {
        Self::default_of(&dsm::ENTRY)
    }
}

impl MethodSpec {
    /// Returns the paper whose settings these are, whatever the size of the map; `None` for other settings.
    pub fn paper(&self) -> Option<&'static str> {
        let published = self.entry().published?;
        let own: Self = published.settings.parse().ok()?;
        let mut pairs = self.settings().zip(own.settings());
        pairs
            .all(|((key, value), (_, of_paper))| key.name == MAP || value == of_paper)
            .then_some(published.paper)
    }
}

impl FromStr for MethodSpec {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match &mut Self::parse_list(text)?[..] {
            [only] => Ok(only.clone()),
            _ => Err(Error::input(WHAT, text, "expected one method with one value for each key")),
        }
    }
}

/// Shadow method as written on the command line, with any number of values for each setting.
struct Written<'a> {
    name: &'a str,
    /// Settings of the shadow method in the order written, each once and with at least one value.
    params: Vec<(&'a str, Vec<&'a str>)>,
}

impl<'a> Written<'a> {
    fn parse(text: &'a str) -> Result<Self> {
        let text = text.trim();
        let refuse = |why: String| Error::input(WHAT, format!("`{text}`"), why);
        let (name, rest) = match text.split_once(':') {
            Some((name, rest)) => (name.trim(), Some(rest)),
            None => (text, None),
        };
        if name.is_empty() || name.contains([',', '=']) {
            let error = refuse("expected NAME[:key=value,...]".into());
            return Err(if name.contains(',') {
                error.hint("in a list of methods, `;` separates them (in quotes)")
            } else {
                error
            });
        }
        let mut params: Vec<(&str, Vec<&str>)> = Vec::new();
        for part in rest.into_iter().flat_map(|rest| rest.split(',')) {
            let (key, value) = match part.split_once('=') {
                Some((key, value)) => (Some(key.trim()), value.trim()),
                None => (None, part.trim()),
            };
            if key == Some("") || value.is_empty() {
                return Err(refuse(format!("`{part}` is not key=value")));
            }
            match key {
                Some(key) if params.iter().any(|(k, _)| *k == key) => {
                    return Err(refuse(format!("`{key}` is given twice")));
                }
                Some(key) => params.push((key, vec![value])),
                None => match params.last_mut() {
                    Some((_, values)) => values.push(value),
                    None => return Err(refuse(format!("`{value}` has no key before it"))),
                },
            }
        }
        Ok(Self { name, params })
    }

    /// Returns one method specification for every combination of the values that the command line lists for its
    /// settings.
    fn expand(&self) -> Result<Vec<MethodSpec>> {
        let count = self.params.iter().try_fold(1_usize, |n, (_, values)| n.checked_mul(values.len()));
        if count.is_none_or(|n| n > MAX_COMBINATIONS) {
            return Err(Error::input(WHAT, self.name, "it has more than 10000 combinations"));
        }
        let entry = entry(self.name).ok_or_else(|| {
            let names = METHODS.iter().map(|m| m.name).collect::<Vec<_>>().join(", ");
            Error::input("unknown shadow method", format!("`{}`", self.name), format!("there is: {names}"))
        })?;
        let mut specs = vec![MethodSpec::default_of(entry)];
        for (name, texts) in &self.params {
            let at = entry.keys.iter().position(|key| key.name == *name);
            let at = at.ok_or_else(|| unknown_key(entry, name))?;
            let key = &entry.keys[at];
            let refused = |text: &&str| {
                let place = format!("{}:{name}={text}", entry.name);
                Error::input("bad value", place, format!("expected {}", key.values()))
            };
            let values = texts.iter().map(|text| key.parse(text).ok_or_else(|| refused(text)));
            let values = values.collect::<Result<Vec<_>>>()?;
            let with = |spec: &MethodSpec, value: &Value| {
                let mut spec = spec.clone();
                spec.values[at] = *value;
                spec
            };
            specs = specs.iter().flat_map(|spec| values.iter().map(move |value| with(spec, value))).collect();
        }
        specs.iter().try_for_each(|spec| self.check_effect(spec))?;
        Ok(specs)
    }

    /// Returns an error if the command line gives a setting that other settings of the same shadow method disable.
    fn check_effect(&self, spec: &MethodSpec) -> Result<()> {
        for key in spec.entry.keys.iter().filter(|key| self.params.iter().any(|(name, _)| *name == key.name))
        {
            if let When::Is(other, wanted) = key.when
                && !spec.applies(key)
            {
                let place = format!("{}:{}", spec.entry.name, key.name);
                return Err(Error::input(
                    "bad value",
                    place,
                    format!("it has an effect with {other}={wanted} only"),
                ));
            }
        }
        Ok(())
    }
}

fn unknown_key(entry: &Entry, key: &str) -> Error {
    let names = entry.keys.iter().map(|k| k.name).collect::<Vec<_>>().join(", ");
    let why = if names.is_empty() { "the method has no keys".into() } else { format!("there is: {names}") };
    Error::input("unknown key", format!("{}:{key}", entry.name), why)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_is_complete_and_distinct() {
        for (i, entry) in METHODS.iter().enumerate() {
            let method = parse(entry.name).unwrap();
            assert_eq!((method.name(), method.values().len()), (entry.name, entry.keys.len()));
            for (key, value) in entry.keys.iter().zip(method.values()) {
                assert_eq!(Some(value), key.parse(key.default), "{}:{}", entry.name, key.name);
                let coarse = key.coarser(value).to_string();
                assert!(key.parse(&coarse).is_some(), "{}:{}={coarse}", entry.name, key.name);
            }
            for other in &METHODS[..i] {
                assert!(other.name != entry.name && other.style.color != entry.style.color, "{}", entry.name);
            }
            for list in
                [entry.stability, entry.compared, entry.curve].into_iter().filter(|list| !list.is_empty())
            {
                let methods = parse_list(list).unwrap();
                assert!(methods.iter().all(|method| method.name() == entry.name), "{list}");
            }
            // A method that refuses some scenes is in no default list.
            assert_eq!(entry.stability.is_empty(), entry.name == "halfangle", "{}", entry.name);
        }
    }

    #[test]
    fn settings_of_papers_are_rows_that_name_them() {
        let papers: Vec<_> = METHODS.iter().filter_map(|entry| Some((*entry, entry.published?))).collect();
        assert_eq!(papers.len(), 4, "papers that were read in full");
        for (entry, published) in papers {
            let paper = |text: &str| text.parse::<MethodSpec>().unwrap().paper();
            assert_eq!(paper(published.settings), Some(published.paper));
            assert_eq!(paper(&format!("{},map=64", published.settings)), Some(published.paper));
            assert_eq!(paper(entry.name), None);
            let compared = MethodSpec::parse_list(&COMPARED).unwrap();
            let of_paper = |spec: &&MethodSpec| spec.paper() == Some(published.paper);
            assert_eq!(compared.iter().filter(of_paper).count(), 1);
        }
    }

    #[test]
    fn repeated_methods_are_dropped() {
        let count = |text: &str| parse_distinct(text).unwrap().len();
        assert_eq!(count("dsm:epsilon=0.1,0.1"), 1);
        assert_eq!(count("none;dsm:epsilon=0.1,0.10,0.02;none;dsm:epsilon=0.02"), 3);
    }

    fn labels(text: &str) -> Vec<String> {
        MethodSpec::parse_list(text).unwrap().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn every_combination_appears_once_in_a_stable_order() {
        assert_eq!(labels("none"), ["none"]);
        assert_eq!(
            labels("dsm:epsilon=0.06,0.02,map=256"),
            ["dsm:epsilon=0.06,map=256", "dsm:epsilon=0.02,map=256"]
        );
        assert_eq!(
            labels("osm:layers=8,32, slicing=uniform,density"),
            [
                "osm:layers=8",
                "osm:layers=8,slicing=density",
                "osm:layers=32",
                "osm:layers=32,slicing=density"
            ]
        );
        assert_eq!(labels("none; rays ;dsm:epsilon=0.1;"), ["none", "rays", "dsm:epsilon=0.1"]);
    }

    #[test]
    fn equal_settings_are_equal_whatever_their_text() {
        let specs =
            MethodSpec::parse_list("dsm;dsm:epsilon=0.020;dsm:offset=0;dsm:offset=-0,epsilon=2e-2").unwrap();
        assert!(specs.iter().all(|spec| *spec == specs[0]));
        assert_eq!(specs.iter().collect::<HashSet<_>>().len(), 1);
        assert_ne!(specs[0], specs[0].clone().with("map", "64").unwrap());
        assert_eq!(specs[0].clone().with("map", "0"), None);
        assert_eq!(specs[0].clone().with("maps", "64"), None);
        let params = |text: &str| text.parse::<MethodSpec>().unwrap().method().unwrap().params();
        assert_eq!(params("bom:split=growing,log_size=2"), params("bom:split=growing"), "no effect");
    }

    #[test]
    fn texts_read_back_as_the_same_settings() {
        for text in [
            "rays",
            "dsm:precompress=off,march=samples,step=0.25,map=64",
            "osm:from=lines,filter=nearest",
            "osm:march=samples,step=1",
            "bom:split=hybrid,ratio=0.75",
        ] {
            let spec: MethodSpec = text.parse().unwrap();
            assert_eq!(spec.to_string().parse::<MethodSpec>().unwrap(), spec, "{text}: {spec}");
            assert_eq!(spec.method().unwrap().spec(), spec, "{text}");
        }
    }

    #[test]
    fn slips_are_refused_with_their_reason() {
        for (text, why) in [
            ("", "NAME"),
            (";", "NAME"),
            ("none;;rays", "NAME"),
            (":epsilon=1", "NAME"),
            ("epsilon=1", "NAME"),
            ("dsm,epsilon=1", "NAME"),
            ("dsm:", "not key=value"),
            ("dsm:epsilon=", "not key=value"),
            ("dsm:=1", "not key=value"),
            ("dsm:epsilon=1,,map=2", "not key=value"),
            ("dsm:0.1", "no key before it"),
            ("dsm:map=1,map=2", "`map` is given twice"),
            ("dsn", "there is: none, rays"),
            ("dsm:maps=1", "there is: epsilon"),
            ("rays:map=1", "there is: estimator, samples, seed, march, step, lookup"),
            ("none:map=1", "no keys"),
            ("dsm:epsilon=2", "expected 0..1"),
            ("dsm:epsilon=nan", "expected 0..1"),
            ("osm:step=1", "march=samples only"),
        ] {
            let e = MethodSpec::parse_list(text).expect_err(text);
            assert!(e.why.contains(why), "{text}: {e}");
            assert_eq!(e.exit_status(), 2);
        }
        assert!("dsm:epsilon=0.1,0.2".parse::<MethodSpec>().unwrap_err().why.contains("one value"));
        let values = (0..200).map(|v| v.to_string()).collect::<Vec<_>>().join(",");
        let runaway = format!("dsm:map={values},step={values}");
        assert!(MethodSpec::parse_list(&runaway).unwrap_err().why.contains("more than 10000"));
    }
}
