//! Claims as files: one TOML file a paper, with a formula for each verdict.
//!
//! A formula speaks of the columns of `compare.csv` (a value for each method that the claim needs) and of the
//! quantities of [`Figures::number`]. Texts that start with `$` stand for an entry of the file's `texts`.

use super::figures::{Depth, Figures};
use super::formula::{Formula, verdict};
use super::rules::Holds;
use super::scenes::{STAND_INS, StandIn, Variant};
use crate::error::{Error, Result};
use crate::scene::Skip;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Files of all papers: the citation stands in each.
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
    texts: BTreeMap<String, String>,
    claim: Vec<ClaimEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClaimEntry {
    #[serde(rename = "where")]
    place: String,
    claim: String,
    claimed: String,
    #[serde(default)]
    scenes: Vec<String>,
    #[serde(default)]
    needs: Vec<NeedEntry>,
    #[serde(default)]
    depth: Depth,
    #[serde(default, rename = "let")]
    variables: Vec<(String, String)>,
    #[serde(default)]
    figures: Vec<(String, String)>,
    #[serde(default)]
    verdict: String,
    #[serde(default)]
    rule: String,
    #[serde(default)]
    notes: Vec<NoteEntry>,
    untried: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NeedEntry {
    methods: String,
    #[serde(default = "one")]
    extinction: f64,
    light: Option<[f64; 3]>,
    #[serde(default)]
    skip_none: bool,
    pixels: Option<u32>,
    scene: Option<String>,
}

fn one() -> f64 {
    1.0
}

#[derive(Deserialize)]
#[serde(untagged)]
enum NoteEntry {
    Always(String),
    When { when: String, text: String },
}

/// A figure of a verdict: its name and its value.
pub type Figure = (String, f64);

/// Result of trying a claim on a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The verdict.
    pub holds: Holds,
    /// The figures it follows from, the decisive one first.
    pub figures: Vec<Figure>,
    /// Further remarks for the reader; may be empty.
    pub note: String,
}

/// Figures of the methods of each need, in the order in which the text of the need expands.
pub type Measured<'a> = [Vec<&'a Figures>];

/// Methods that a claim needs on a variant of its scene.
#[derive(Debug, Clone)]
pub struct Need {
    /// Variant of the scene.
    pub variant: Variant,
    /// Method list, in the syntax of `--methods`.
    pub methods: String,
    /// How much is measured.
    pub depth: Depth,
}

/// How a claim is tried.
#[derive(Debug)]
pub enum Trial {
    /// Not at all, and why.
    Untried(String),
    /// By a rule on figures.
    Judged(Judge),
}

/// Rule of a claim.
#[derive(Debug)]
pub struct Judge {
    /// The rule in words.
    pub rule: String,
    variables: Vec<(String, Formula)>,
    figures: Vec<(String, Formula)>,
    verdict: Formula,
    notes: Vec<(Formula, String)>,
}

/// Statement of a paper with a figure or a comparison in it.
#[derive(Debug)]
pub struct Claim {
    /// Citation.
    pub paper: String,
    /// Section, table or figure.
    pub place: String,
    /// The statement.
    pub claim: String,
    /// Its figure or comparison.
    pub claimed: String,
    /// Stand-ins that it is tried on where no scene is given.
    pub scenes: Vec<StandIn>,
    /// Methods to measure.
    pub needs: Vec<Need>,
    /// How it is tried.
    pub trial: Trial,
}

/// Reads every claim, paper by paper.
///
/// # Errors
/// A file of this program that is malformed; a test reads them all.
pub fn all() -> Result<Vec<Claim>> {
    let mut claims = Vec::new();
    for text in FILES {
        let bad = |why: &dyn std::fmt::Display| Error::runtime("cannot read claims", "built-in file", why);
        let PaperFile { paper, texts, claim } = toml::from_str(text).map_err(|e| bad(&e))?;
        for entry in claim {
            let what = entry.claim.clone();
            let read = entry.read(&paper, &texts);
            claims.push(read.map_err(|why| bad(&format!("{paper}, `{what}`: {why}")))?);
        }
    }
    Ok(claims)
}

impl ClaimEntry {
    fn read(self, paper: &str, texts: &BTreeMap<String, String>) -> Result<Claim, String> {
        let text = |text: String| match text.strip_prefix('$') {
            Some(name) => texts.get(name).cloned().ok_or_else(|| format!("no text `{name}`")),
            None => Ok(text),
        };
        let named = |(name, formula): (String, String)| Ok((name, Formula::parse(&formula)?));
        let stand_in = |name: String| {
            STAND_INS.iter().find(|s| s.name == name).copied().ok_or_else(|| format!("no stand-in `{name}`"))
        };
        let need = |need: NeedEntry| {
            let variant = Variant {
                extinction: need.extinction,
                toward: need.light,
                skip: need.skip_none.then_some(Skip::None),
                side_px: need.pixels,
                instead: need.scene.map(stand_in).transpose()?.map(|s| s.name),
            };
            Ok::<_, String>(Need { variant, methods: text(need.methods)?, depth: self.depth })
        };
        let note = |note: NoteEntry| match note {
            NoteEntry::Always(note) => Ok((Formula::Number(1.0), text(note)?)),
            NoteEntry::When { when, text: note } => Ok::<_, String>((Formula::parse(&when)?, text(note)?)),
        };
        let trial = match self.untried {
            Some(why) => Trial::Untried(why),
            None => Trial::Judged(Judge {
                rule: text(self.rule)?,
                variables: self.variables.into_iter().map(named).collect::<Result<_, String>>()?,
                figures: self.figures.into_iter().map(named).collect::<Result<_, String>>()?,
                verdict: Formula::parse(&self.verdict)?,
                notes: self.notes.into_iter().map(note).collect::<Result<_, _>>()?,
            }),
        };
        Ok(Claim {
            paper: paper.to_owned(),
            place: self.place,
            claim: self.claim,
            claimed: self.claimed,
            scenes: self.scenes.into_iter().map(stand_in).collect::<Result<_, _>>()?,
            needs: self.needs.into_iter().map(need).collect::<Result<_, _>>()?,
            trial,
        })
    }
}

impl Judge {
    /// Evaluates the rule on what was measured.
    ///
    /// # Errors
    /// A figure that was not measured.
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
        for (when, text) in &self.notes {
            if when.number(&lookup)? != 0.0 {
                let filled = values.iter().filter(|(_, list)| list.len() == 1);
                notes.push(filled.fold(text.clone(), |text, (name, list)| {
                    text.replace(&format!("{{{name}}}"), &list[0].to_string())
                }));
            }
        }
        Ok(Finding { holds: verdict(self.verdict.number(&lookup)?)?, figures, note: notes.join(" ") })
    }
}

/// Finds the citation of a paper by a word of it, letter case aside: `hadwiger`, `Neumann`, `2008`.
///
/// # Errors
/// No paper, or several, have that word.
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

/// A claim as it was tried on a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Citation.
    pub paper: String,
    /// Section, table or figure.
    pub place: String,
    /// The statement.
    pub claim: String,
    /// Its figure or comparison.
    pub claimed: String,
    /// Figures of the verdict, the decisive one first.
    pub measured: Vec<Figure>,
    /// The verdict; `None` where the claim was not tried.
    pub holds: Option<Holds>,
    /// Scene and its variants; empty where the claim was not tried.
    pub scene: String,
    /// The rule and remarks, or why the claim was not tried.
    pub note: String,
}

#[cfg(test)]
mod tests {
    use super::*;

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

    /// Every name of a formula is a variable or a quantity of the methods of an existing need.
    #[test]
    fn formulas_speak_of_what_there_is() {
        for claim in all().unwrap() {
            let Trial::Judged(judge) = &claim.trial else { continue };
            let variables: Vec<&str> = judge.variables.iter().map(|(name, _)| name.as_str()).collect();
            let notes = judge.notes.iter().map(|(when, _)| when);
            let formulas = judge.variables.iter().chain(&judge.figures).map(|(_, f)| f);
            for formula in formulas.chain(notes).chain([&judge.verdict]) {
                formula.names(&mut |name, need| {
                    let known = variables.contains(&name) || need < claim.needs.len() && Figures::has(name);
                    assert!(known, "{}: {name}@{need}", claim.claim);
                });
            }
        }
    }
}
