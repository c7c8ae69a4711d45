//! Every shadow method, a line each, and what all front doors ask of the list.

use super::method::{Entry, Method};
use super::spec;
use super::{avsm, bom, clusters, dom, dsm, fourier, lightvolume, moments, none, osm, rays};
use crate::error::{Error, Result};
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

/// The line of a method.
pub fn entry(name: &str) -> Option<&'static Entry> {
    METHODS.iter().copied().find(|m| m.name == name)
}

/// Rows of the default comparison, of a default `probe --curve`, and of the stability cases.
pub static COMPARED: LazyLock<String> = LazyLock::new(|| rows(|m| m.compared));
/// See [`COMPARED`].
pub static CURVES: LazyLock<String> = LazyLock::new(|| rows(|m| m.curve));
/// See [`COMPARED`].
pub static STABILITY: LazyLock<String> = LazyLock::new(|| rows(|m| m.stability));

/// What all methods have of one list, with `;` between them.
fn rows(own: impl Fn(&Entry) -> &'static str) -> String {
    METHODS.iter().map(|m| own(m)).filter(|r| !r.is_empty()).collect::<Vec<_>>().join(";")
}

/// Parses `METHOD[:key=value,...]`.
///
/// # Errors
/// An unknown method or key, or a value out of range, naming it and what there is.
pub fn parse(text: &str) -> Result<Box<dyn Method>> {
    let mut methods = parse_list(text)?;
    match (methods.pop(), methods.is_empty()) {
        (Some(only), true) => Ok(only),
        _ => Err(Error::input("bad shadow method", text, "one method with one value a key is meant here")),
    }
}

/// Parses a list of methods as [`parse_list`] does, each once: the same given twice is one row.
///
/// # Errors
/// As there.
pub fn parse_distinct(text: &str) -> Result<Vec<Box<dyn Method>>> {
    let mut seen = HashSet::new();
    let mut methods = parse_list(text)?;
    methods.retain(|method| seen.insert(format!("{method:?}")));
    Ok(methods)
}

/// Parses a list of methods, with `;` between them; every combination of values is a row.
///
/// # Errors
/// As [`parse`].
pub fn parse_list(text: &str) -> Result<Vec<Box<dyn Method>>> {
    let mut methods = Vec::new();
    for spec in spec::parse_list(text)? {
        for setting in spec.expand()? {
            let entry = entry(&setting.name).ok_or_else(|| {
                let names = METHODS.iter().map(|m| m.name).collect::<Vec<_>>().join(", ");
                let place = format!("`{}`", setting.name);
                Error::input("unknown shadow method", place, format!("there is: {names}"))
            })?;
            methods.push(entry.with(&setting)?);
        }
    }
    Ok(methods)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_has_its_defaults_and_stands_in_no_others_way() {
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
            let own = |rows: &str| {
                let names = parse_list(rows).unwrap().iter().map(|m| m.name()).collect::<Vec<_>>();
                assert!(names.iter().all(|n| *n == entry.name), "{rows}");
            };
            own(entry.stability);
            [entry.compared, entry.curve].into_iter().filter(|r| !r.is_empty()).for_each(own);
        }
    }
}
