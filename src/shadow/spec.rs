//! The syntax of `--shadow` and `--methods`, whatever the methods are: `NAME[:key=value,...]`, methods separated by
//! `;`, and a value without `=` is one more for the key before it.

use crate::error::{Error, Result};

const WHAT: &str = "bad shadow method";

/// More rows than any table is made of; a longer expansion is a slip.
const MAX_COMBINATIONS: usize = 10_000;

/// One method with any number of values a key, as written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Spec {
    /// Name of the method.
    pub name: String,
    /// Keys in the order written, each once and with at least one value.
    pub params: Vec<(String, Vec<String>)>,
}

/// One method with one value a key: a row of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Setting {
    /// Name of the method.
    pub name: String,
    /// Keys and values, in the order written.
    pub params: Vec<(String, String)>,
}

impl Spec {
    /// Every combination of the values; the last key varies fastest.
    ///
    /// # Errors
    /// More than 10,000 of them.
    pub fn expand(&self) -> Result<Vec<Setting>> {
        let count = self.params.iter().try_fold(1_usize, |n, (_, values)| n.checked_mul(values.len()));
        if count.is_none_or(|n| n > MAX_COMBINATIONS) {
            return Err(Error::input(WHAT, &self.name, "it has more than 10000 combinations"));
        }
        let mut rows = vec![Vec::new()];
        for (key, values) in &self.params {
            let with =
                |row: &Vec<_>, value: &String| [row.as_slice(), &[(key.clone(), value.clone())]].concat();
            rows = rows.iter().flat_map(|row| values.iter().map(move |v| with(row, v))).collect();
        }
        Ok(rows.into_iter().map(|params| Setting { name: self.name.clone(), params }).collect())
    }
}

/// Parses `NAME[:key=value,...]`.
///
/// # Errors
/// An empty name, key or value, a value before any key, or a key given twice.
pub fn parse_spec(text: &str) -> Result<Spec> {
    let text = text.trim();
    let refuse = |why: String| Error::input(WHAT, format!("`{text}`"), why);
    let (name, rest) = match text.split_once(':') {
        Some((name, rest)) => (name.trim(), Some(rest)),
        None => (text, None),
    };
    if name.is_empty() || name.contains([',', '=']) {
        return Err(refuse("expected NAME[:key=value,...]".into()));
    }
    let mut params: Vec<(String, Vec<String>)> = Vec::new();
    for part in rest.into_iter().flat_map(|rest| rest.split(',')) {
        let (key, value) = match part.split_once('=') {
            Some((key, value)) => (Some(key.trim()), value.trim()),
            None => (None, part.trim()),
        };
        if key == Some("") || value.is_empty() {
            return Err(refuse(format!("`{part}` is not key=value")));
        }
        match key {
            Some(key) if params.iter().any(|(k, _)| k == key) => {
                return Err(refuse(format!("`{key}` is given twice")));
            }
            Some(key) => params.push((key.into(), vec![value.into()])),
            None => match params.last_mut() {
                Some((_, values)) => values.push(value.into()),
                None => return Err(refuse(format!("`{value}` has no key before it"))),
            },
        }
    }
    Ok(Spec { name: name.into(), params })
}

/// Parses methods separated by `;`; a `;` at the end is allowed.
///
/// # Errors
/// As [`parse_spec`], or no method at all.
pub fn parse_list(text: &str) -> Result<Vec<Spec>> {
    let text = text.trim();
    text.strip_suffix(';').unwrap_or(text).split(';').map(parse_spec).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(spec: &str) -> Vec<String> {
        let settings = parse_spec(spec).unwrap().expand().unwrap();
        let join =
            |s: &Setting| s.params.iter().map(|(k, v)| format!("{k}={v}")).collect::<Vec<_>>().join(" ");
        settings.iter().map(join).collect()
    }

    #[test]
    fn a_value_without_key_is_one_more_for_the_key_before() {
        let spec = parse_spec("dsm:epsilon=0.06,0.02,map=256").unwrap();
        assert_eq!(spec.name, "dsm");
        assert_eq!(
            spec.params,
            [("epsilon".into(), vec!["0.06".into(), "0.02".into()]), ("map".into(), vec!["256".into()])]
        );
    }

    #[test]
    fn every_combination_once_in_a_stable_order() {
        assert_eq!(labels("none"), [""]);
        assert_eq!(
            labels("osm:layers=8,32, slicing=uniform,density"),
            [
                "layers=8 slicing=uniform",
                "layers=8 slicing=density",
                "layers=32 slicing=uniform",
                "layers=32 slicing=density"
            ]
        );
    }

    #[test]
    fn lists_are_apart_by_semicolons() {
        let names = |text| parse_list(text).map(|l| l.into_iter().map(|s| s.name).collect::<Vec<_>>());
        assert_eq!(names("none; rays ;dsm:epsilon=0.1;").unwrap(), ["none", "rays", "dsm"]);
        assert!(names("none;;rays").is_err());
        assert!(names("").is_err());
        assert!(names(";").is_err());
    }

    #[test]
    fn slips_are_refused_with_their_reason() {
        for (text, why) in [
            ("", "NAME"),
            (":epsilon=1", "NAME"),
            ("epsilon=1", "NAME"),
            ("dsm,epsilon=1", "NAME"),
            ("dsm:", "not key=value"),
            ("dsm:epsilon=", "not key=value"),
            ("dsm:=1", "not key=value"),
            ("dsm:epsilon=1,,map=2", "not key=value"),
            ("dsm:0.1", "no key before it"),
            ("dsm:map=1,map=2", "`map` is given twice"),
        ] {
            let e = parse_spec(text).expect_err(text);
            assert!(e.why.contains(why), "{text}: {e}");
            assert_eq!(e.exit_status(), 2);
        }
    }

    #[test]
    fn a_runaway_expansion_is_refused() {
        let values = (0..200).map(|v| v.to_string()).collect::<Vec<_>>().join(",");
        let spec = parse_spec(&format!("dsm:a={values},b={values}")).unwrap();
        assert!(spec.expand().unwrap_err().why.contains("more than 10000"));
    }
}
