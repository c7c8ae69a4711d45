//! Registry of shadow methods.

use super::method::{Entry, Method};
use super::spec::MethodSpec;
use super::{avsm, bom, clusters, dom, dsm, fourier, lightvolume, moments, none, osm, rays};
use crate::error::Result;
use std::collections::HashSet;
use std::sync::LazyLock;

/// Every method, in the order of tables and menus.
pub const METHODS: &[&Entry] = &[
    &none::ENTRY,
    &rays::ENTRY,
    &dsm::ENTRY,
    &osm::ENTRY,
    &dom::ENTRY,
    &bom::ENTRY,
    &clusters::ENTRY,
    &fourier::ENTRY,
    &avsm::ENTRY,
    &moments::ENTRY,
    &lightvolume::ENTRY,
    #[cfg(feature = "half")]
    &super::half::ENTRY,
];

/// Finds a method by its name.
pub fn entry(name: &str) -> Option<&'static Entry> {
    METHODS.iter().copied().find(|m| m.name == name)
}

/// Methods of the default comparison.
pub static COMPARED: LazyLock<String> = LazyLock::new(|| joined(|m| m.compared));
/// Methods of the default `probe --curve`.
pub static CURVES: LazyLock<String> = LazyLock::new(|| joined(|m| m.curve));
/// Methods of the stability cases.
pub static STABILITY: LazyLock<String> = LazyLock::new(|| joined(|m| m.stability));

/// Joins one list of every method with `;`.
fn joined(list: impl Fn(&Entry) -> &'static str) -> String {
    METHODS.iter().map(|m| list(m)).filter(|r| !r.is_empty()).collect::<Vec<_>>().join(";")
}

/// Parses `METHOD[:key=value,...]`.
///
/// # Errors
/// See [`MethodSpec::parse_list`].
pub fn parse(text: &str) -> Result<Box<dyn Method>> {
    text.parse::<MethodSpec>()?.method()
}

/// Parses a list of methods ([`MethodSpec::parse_list`]).
///
/// # Errors
/// See [`MethodSpec::parse_list`].
pub fn parse_list(text: &str) -> Result<Vec<Box<dyn Method>>> {
    MethodSpec::parse_list(text)?.iter().map(MethodSpec::method).collect()
}

/// Parses a list of methods without repetitions.
///
/// # Errors
/// See [`MethodSpec::parse_list`].
pub fn parse_distinct(text: &str) -> Result<Vec<Box<dyn Method>>> {
    let (mut specs, mut found) = (MethodSpec::parse_list(text)?, HashSet::new());
    specs.retain(|spec| found.insert(spec.clone()));
    specs.iter().map(MethodSpec::method).collect()
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
                assert!(other.name != entry.name && other.style != entry.style, "{}", entry.name);
            }
            for list in
                [entry.stability, entry.compared, entry.curve].into_iter().filter(|list| !list.is_empty())
            {
                let methods = parse_list(list).unwrap();
                assert!(methods.iter().all(|method| method.name() == entry.name), "{list}");
            }
            assert!(!entry.stability.is_empty(), "{}", entry.name);
        }
    }

    #[test]
    fn repeated_methods_are_dropped() {
        let count = |text: &str| parse_distinct(text).unwrap().len();
        assert_eq!(count("dsm:epsilon=0.1,0.1"), 1);
        assert_eq!(count("none;dsm:epsilon=0.1,0.10,0.02;none;dsm:epsilon=0.02"), 3);
    }
}
