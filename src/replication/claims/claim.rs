//! Claims of papers, which this program tests anew; they are read from one TOML file per paper, with a formula for
//! each claim's verdict.
//!
//! A formula refers to columns of `compare.csv` (one value per method that the claim needs) and to the quantities of
//! [`Figures::number`]. A text that starts with `$` is replaced by an entry of the file's `texts`.

use super::figures::{Depth, Figures};
use super::formula::{Formula, verdict};
use super::rules::Holds;
use super::scenes::Variant;
use crate::error::{Error, Result};
use crate::report::number::significant;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use toml::{Table, Value};

/// Built-in TOML files with claims of papers to be tested, one file per paper.
const FILES: [&str; 8] = [
    include_str!("kim_neumann.toml"),
    include_str!("hadwiger.toml"),
    include_str!("yuksel_keyser.toml"),
    include_str!("voicu.toml"),
    include_str!("mertens.toml"),
    include_str!("jansen_bavoil.toml"),
    include_str!("salvi.toml"),
    include_str!("muenstermann.toml"),
];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PaperFile {
    paper: String,
    #[serde(default)]
    texts: Table,
    claim: Value,
}

/// Measured number on which the verdict on a paper's claim rests: its name and its value.
pub type Figure = (String, f64);

/// Result of testing a paper's claim on a scene: verdict, measured numbers and remarks.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Verdict on the claim of the paper: whether it holds.
    pub holds: Holds,
    /// Measured numbers that determine the verdict on the paper's claim, the decisive one first.
    pub figures: Vec<Figure>,
    /// Further remarks on the verdict on the paper's claim, for the reader. May be empty.
    pub note: String,
}

/// Measurements for testing a paper's claim: for each [`Need`] of the claim, one entry per shadow method, in the
/// order of its method list.
pub type Measured<'a> = [Vec<&'a Figures>];

/// Shadow methods that must be measured, on a variant of the scene, to test a paper's claim.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Need {
    /// List of shadow methods with settings, in the syntax of `--methods`.
    pub methods: String,
    /// Variant of the scene on which the methods are measured to test the paper's claim.
    #[serde(default)]
    pub variant: Variant,
}

/// Remark on the verdict on a paper's claim, given always or under a condition.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Note {
    Always(String),
    When { when: Formula, text: String },
}

/// Quantitative claim of a paper, with the required measurements and the formula of the verdict.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// Citation of the paper that makes the claim.
    #[serde(skip)]
    pub paper: String,
    /// Section, table or figure of the paper in which the claim is made.
    #[serde(rename = "where")]
    pub place: String,
    /// Claim of the paper that is tested, in words.
    pub claim: String,
    /// Number or comparison that the paper gives in its claim.
    pub claimed: String,
    /// Names of the built-in scenes on which the paper's claim is tested if the user gives no scene.
    #[serde(default)]
    pub scenes: Vec<String>,
    /// Shadow methods to measure for testing the paper's claim, on variants of the scene.
    #[serde(default)]
    pub needs: Vec<Need>,
    /// Extent of the measurements for testing the paper's claim: times only, shadow maps only, or everything.
    #[serde(default)]
    pub depth: Depth,
    /// Rule, in words, that decides from the measured numbers whether the paper's claim holds.
    #[serde(default)]
    pub rule: String,
    /// Reason why the paper's claim cannot be tested; `None` if it can.
    pub untried: Option<String>,
    #[serde(default, rename = "let")]
    variables: Vec<(String, Formula)>,
    #[serde(default)]
    pub(super) figures: Vec<(String, Formula)>,
    #[serde(default)]
    verdict: Formula,
    #[serde(default)]
    notes: Vec<Note>,
}

/// Reads the claims of all papers from the built-in TOML files.
///
/// # Errors
/// A built-in claim file is malformed; a test reads them all.
pub fn all() -> Result<Vec<Claim>> {
    let bad = |why: &dyn std::fmt::Display| Error::runtime("cannot read claims", "built-in file", why);
    let mut claims = Vec::new();
    for text in FILES {
        let PaperFile { paper, texts, mut claim } = toml::from_str(text).map_err(|e| bad(&e))?;
        fill(&mut claim, &texts).map_err(|e| bad(&e))?;
        let own: Vec<Claim> = claim.try_into().map_err(|e: toml::de::Error| bad(&format!("{paper}: {e}")))?;
        claims.extend(own.into_iter().map(|claim| Claim { paper: paper.clone(), ..claim }));
    }
    Ok(claims)
}

/// Replaces every text of a paper's claim file that starts with `$` by the entry of that name in the table `texts` of
/// the same file.
fn fill(value: &mut Value, texts: &Table) -> Result<(), String> {
    match value {
        Value::String(text) => {
            if let Some(name) = text.strip_prefix('$') {
                *value = texts.get(name).ok_or_else(|| format!("no text `{name}`"))?.clone();
            }
            Ok(())
        }
        Value::Array(list) => list.iter_mut().try_for_each(|v| fill(v, texts)),
        Value::Table(table) => table.iter_mut().try_for_each(|(_, v)| fill(v, texts)),
        _ => Ok(()),
    }
}

impl Claim {
    /// Evaluates the formulas of a paper's claim on the measurements. Returns the verdict with the measured numbers
    /// behind it.
    ///
    /// # Errors
    /// A value that a formula needs was not measured.
    pub fn judge(&self, measured: &Measured) -> Result<Finding, String> {
        let mut values: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        let lookup =
            |values: &BTreeMap<&str, Vec<f64>>, name: &str, need: usize, entries: Option<(usize, usize)>| {
                let none = || format!("{name}@{need} has no such entry");
                if let Some(list) = values.get(name) {
                    return list
                        .get(entries.map_or(0..list.len(), |(i, j)| i..j))
                        .map(<[f64]>::to_vec)
                        .ok_or_else(none);
                }
                let methods = measured.get(need).ok_or_else(none)?;
                let range = entries.map_or(0..methods.len(), |(i, j)| i..j);
                methods
                    .get(range.clone())
                    .ok_or_else(none)?
                    .iter()
                    .zip(range)
                    .map(|(f, i)| f.number(name, methods.get(i + 1).copied()))
                    .collect()
            };
        for (name, formula) in &self.variables {
            let list = formula.list(&|n, need, entries| lookup(&values, n, need, entries))?;
            values.insert(name, list);
        }
        let lookup =
            |name: &str, need: usize, entries: Option<(usize, usize)>| lookup(&values, name, need, entries);
        let figures = self.figures.iter().map(|(name, f)| Ok((name.clone(), f.number(&lookup)?)));
        let figures = figures.collect::<Result<Vec<_>, String>>()?;
        let mut notes = Vec::new();
        for note in &self.notes {
            let (applies, text) = match note {
                Note::Always(text) => (true, text),
                Note::When { when, text } => (when.number(&lookup)? != 0.0, text),
            };
            if applies {
                let filled = values.iter().filter(|(_, list)| list.len() == 1);
                notes.push(filled.fold(text.clone(), |text, (name, list)| {
                    text.replace(&format!("{{{name}}}"), &list[0].to_string())
                }));
            }
        }
        Ok(Finding { holds: verdict(self.verdict.number(&lookup)?)?, figures, note: notes.join(" ") })
    }

    /// Whether the verdict depends on measured times.
    pub fn has_timed_verdict(&self) -> bool {
        is_timed(&self.verdict, &self.variables)
    }

    /// Returns whether each of the measured numbers, in order, depends on times.
    pub fn timed_figures(&self) -> impl Iterator<Item = bool> {
        self.figures.iter().map(|(_, formula)| is_timed(formula, &self.variables))
    }

    /// Whether all that is measured depends on times.
    pub fn depends_on_times_only(&self) -> bool {
        self.depth == Depth::Times || self.has_timed_verdict() && self.timed_figures().all(|timed| timed)
    }
}

/// Whether a formula of a paper's claim depends on measured times, itself or by one of the variables before it.
fn is_timed(formula: &Formula, variables: &[(String, Formula)]) -> bool {
    let mut timed = false;
    formula.names(&mut |name, _| {
        let own = variables.iter().rposition(|(variable, _)| variable == name);
        timed |= own.map_or(name.contains("_ms") || name.starts_with("fps"), |i| {
            is_timed(&variables[i].1, &variables[..i])
        });
    });
    timed
}

/// Returns the citation of the paper that contains a given word, ignoring case: `hadwiger`, `Neumann`, `2008`.
///
/// # Errors
/// No citation contains the word, or several do.
pub fn find_paper(name: &str, claims: &[Claim]) -> Result<String> {
    // Keyboards have no umlauts.
    let plain = |name: &str| name.to_lowercase().replace('ü', "ue");
    let wanted = plain(name.trim());
    let mut papers: Vec<&str> = claims.iter().map(|c| c.paper.as_str()).collect();
    papers.dedup();
    let named = |paper: &&&str| {
        let cited = plain(paper);
        cited == wanted || cited.split_whitespace().any(|word| word == wanted)
    };
    let mut found = papers.iter().filter(named);
    match (found.next(), found.next()) {
        (Some(paper), None) => Ok((*paper).to_owned()),
        _ => Err(Error::input(
            "unknown paper",
            format!("--paper: `{name}`"),
            format!("known papers: {}", papers.join(", ")),
        )
        .hint(
            "one author's name is enough: hadwiger, kim, yuksel, voicu, mertens, jansen, salvi, muenstermann",
        )),
    }
}

/// Row of `claims.csv`: a claim of a paper with the result of its test on one scene. The fields are the columns.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Citation of the paper that makes the claim.
    pub paper: String,
    /// Section, table or figure of the paper in which the claim is made.
    #[serde(rename = "where")]
    pub place: String,
    /// Claim of the paper that was tested, in words.
    pub claim: String,
    /// Number or comparison that the paper gives in its claim.
    pub claimed: String,
    /// Measured numbers that determine the verdict on the paper's claim, the decisive one first.
    #[serde(serialize_with = "serialize_figures", deserialize_with = "deserialize_figures")]
    pub measured: Vec<Figure>,
    /// Verdict on the claim of the paper: whether it holds.
    pub holds: Holds,
    /// Scene, with its variants, on which the paper's claim was tested. Empty for a claim that was not tested.
    pub scene: String,
    /// Rule for the verdict on the paper's claim, with remarks, or the reason why the claim was not tested.
    pub note: String,
}

/// Formats the measured numbers behind the verdict on a paper's claim in one line, with three significant digits.
pub(super) fn figures_text(figures: &[Figure]) -> String {
    let text = |(name, value): &Figure| format!("{name}: {}", figure_text(*value));
    figures.iter().map(text).collect::<Vec<_>>().join("; ")
}

/// Formats a measured number behind the verdict on a paper's claim, with three significant digits.
pub(super) fn figure_text(value: f64) -> String {
    significant(value, 3)
}

fn serialize_figures<S: Serializer>(figures: &[Figure], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&figures_text(figures))
}

/// Reads the text of [`figures_text`]; the numbers have its three significant digits.
fn deserialize_figures<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Figure>, D::Error> {
    let text = String::deserialize(deserializer)?;
    let figure = |part: &str| {
        let (name, value) = part.rsplit_once(": ")?;
        Some((name.to_owned(), value.parse().ok()?))
    };
    let parts = text.split("; ").filter(|part| !part.is_empty());
    parts
        .map(figure)
        .collect::<Option<_>>()
        .ok_or_else(|| D::Error::custom(format!("`{text}` is no list of figures")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::replication::claims::scenes::STAND_INS;

    #[test]
    fn papers_are_found_by_an_author() {
        let claims = all().unwrap();
        for (name, paper) in [
            ("hadwiger", "Hadwiger et al. 2006"),
            ("Neumann", "Kim and Neumann 2001"),
            ("kim", "Kim and Neumann 2001"),
            ("Yuksel and Keyser 2008", "Yuksel and Keyser 2008"),
            ("2011", "Voicu 2011"),
            ("Muenstermann", "Münstermann et al. 2018"),
            ("münstermann", "Münstermann et al. 2018"),
        ] {
            assert_eq!(find_paper(name, &claims).unwrap(), paper);
        }
        for name in ["", "and", "lokovic"] {
            assert!(find_paper(name, &claims).is_err_and(|e| e.exit_status() == 2), "{name}");
        }
    }

    /// The table is read again by splitting these texts.
    #[test]
    fn names_of_figures_have_no_separator() {
        for claim in all().unwrap() {
            assert!(claim.figures.iter().all(|(name, _)| !name.contains("; ")), "{}", claim.claim);
        }
    }

    /// Tests that every name in the formula of a paper's claim is a variable or a measured quantity.
    #[test]
    fn formula_names_are_known() {
        for claim in all().unwrap() {
            let variables: Vec<&str> = claim.variables.iter().map(|(name, _)| name.as_str()).collect();
            let notes = claim.notes.iter().filter_map(|note| match note {
                Note::When { when, .. } => Some(when),
                Note::Always(_) => None,
            });
            let formulas = claim.variables.iter().chain(&claim.figures).map(|(_, f)| f);
            let scenes = claim.needs.iter().filter_map(|n| n.variant.scene.as_ref()).chain(&claim.scenes);
            for scene in scenes {
                assert!(STAND_INS.iter().any(|s| s.name == *scene), "{}: {scene}", claim.claim);
            }
            for formula in formulas.chain(notes).chain([&claim.verdict]) {
                formula.names(&mut |name, need| {
                    let known = variables.contains(&name) || need < claim.needs.len() && Figures::has(name);
                    assert!(known, "{}: {name}@{need}", claim.claim);
                });
            }
        }
    }
}
