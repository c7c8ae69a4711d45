//! Claims, and what comes of trying them.

use super::figures::{Depth, Figures};
use super::rules::Holds;
use super::scenes::{StandIn, Variant};
use crate::error::{Error, Result};

/// A paper whose method is here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Paper {
    /// `dsm`.
    Hadwiger,
    /// `osm`.
    KimNeumann,
    /// `dom`.
    YukselKeyser,
    /// `bom`.
    Voicu,
    /// `clusters`.
    Mertens,
    /// `fourier`.
    JansenBavoil,
    /// `avsm`.
    Salvi,
    /// `moments`.
    Muenstermann,
}

impl Paper {
    /// Every paper, by year.
    pub const ALL: [Self; 8] = [
        Self::KimNeumann,
        Self::Mertens,
        Self::Hadwiger,
        Self::YukselKeyser,
        Self::JansenBavoil,
        Self::Salvi,
        Self::Voicu,
        Self::Muenstermann,
    ];

    /// As cited.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hadwiger => "Hadwiger et al. 2006",
            Self::KimNeumann => "Kim and Neumann 2001",
            Self::YukselKeyser => "Yuksel and Keyser 2008",
            Self::Voicu => "Voicu 2011",
            Self::Mertens => "Mertens et al. 2004",
            Self::JansenBavoil => "Jansen and Bavoil 2010",
            Self::Salvi => "Salvi et al. 2010",
            Self::Muenstermann => "Münstermann et al. 2018",
        }
    }

    /// By a name in its citation, letter case aside: `hadwiger`, `Neumann`, `2008`.
    ///
    /// # Errors
    /// None or several are so named.
    pub fn find(name: &str) -> Result<Self> {
        // Keyboards have no umlauts.
        let plain = |name: &str| name.to_lowercase().replace('ü', "ue");
        let wanted = plain(name.trim());
        let named = |p: &Self| {
            let cited = plain(p.name());
            cited == wanted || cited.split_whitespace().any(|word| word == wanted)
        };
        let mut found = Self::ALL.into_iter().filter(named);
        match (found.next(), found.next()) {
            (Some(paper), None) => Ok(paper),
            _ => {
                let known = Self::ALL.map(Self::name).join(", ");
                Err(Error::input("unknown paper", format!("--paper: `{name}`"), format!("there is: {known}"))
                    .hint("one author's name will do: hadwiger, kim, yuksel, voicu, mertens, jansen, salvi, muenstermann"))
            }
        }
    }
}

/// A figure of a verdict: what it is, and its value.
pub type Figure = (String, f64);

/// What came of trying a claim on a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The verdict.
    pub holds: Holds,
    /// What it follows from, the telling figure first.
    pub figures: Vec<Figure>,
    /// What else a reader should know; may be empty.
    pub note: String,
}

impl Finding {
    pub(super) fn new(holds: Holds, figures: impl IntoIterator<Item = (impl Into<String>, f64)>) -> Self {
        let figures = figures.into_iter().map(|(name, value)| (name.into(), value)).collect();
        Self { holds, figures, note: String::new() }
    }

    pub(super) fn note(self, note: impl Into<String>) -> Self {
        Self { note: note.into(), ..self }
    }
}

/// The figures of what a claim needs: a list for each of its needs, in the order in which the text of the need expands.
pub type Measured<'a> = [Vec<&'a Figures>];

/// The rule of a claim.
pub type Judge = Box<dyn Fn(&Measured) -> Result<Finding> + Send + Sync>;

/// Settings that a claim needs on a variant of its scene.
#[derive(Debug, Clone, Copy)]
pub struct Need {
    /// Of the scene.
    pub variant: Variant,
    /// As `--methods` takes them.
    pub methods: &'static str,
    /// How much is asked of them.
    pub depth: Depth,
}

/// How a claim is tried.
pub enum Trial {
    /// Not at all: why.
    Untried(&'static str),
    /// By a rule on figures.
    Judged {
        /// The rule in words.
        rule: &'static str,
        /// The rule.
        judge: Judge,
    },
}

/// Something that a paper states with a figure or a comparison.
pub struct Claim {
    /// Who states it.
    pub paper: Paper,
    /// Where: section, table or figure.
    pub place: &'static str,
    /// What.
    pub claim: String,
    /// Its figure or comparison.
    pub claimed: String,
    /// What it is tried on where nobody gives a scene.
    pub scenes: &'static [StandIn],
    /// What must be measured.
    pub needs: Vec<Need>,
    /// How it is tried.
    pub trial: Trial,
}

impl Claim {
    pub(super) fn new(
        paper: Paper,
        place: &'static str,
        claim: impl Into<String>,
        claimed: impl Into<String>,
    ) -> Self {
        let (claim, claimed) = (claim.into(), claimed.into());
        let trial = Trial::Untried("nothing judges it");
        Self { paper, place, claim, claimed, scenes: &[], needs: Vec::new(), trial }
    }

    pub(super) fn on(self, scenes: &'static [StandIn]) -> Self {
        Self { scenes, ..self }
    }

    pub(super) fn needs(mut self, variant: Variant, methods: &'static str) -> Self {
        self.needs.push(Need { variant, methods, depth: Depth::Whole });
        self
    }

    /// As [`Self::needs`], of structures alone.
    pub(super) fn needs_structure(mut self, variant: Variant, methods: &'static str) -> Self {
        self.needs.push(Need { variant, methods, depth: Depth::Structure });
        self
    }

    /// As [`Self::needs`], of times alone, which are taken in turn with those of the claim's other needs.
    pub(super) fn needs_times(mut self, variant: Variant, methods: &'static str) -> Self {
        self.needs.push(Need { variant, methods, depth: Depth::Times });
        self
    }

    pub(super) fn judged(
        self,
        rule: &'static str,
        judge: impl Fn(&Measured) -> Result<Finding> + Send + Sync + 'static,
    ) -> Self {
        Self { trial: Trial::Judged { rule, judge: Box::new(judge) }, ..self }
    }

    pub(super) fn untried(self, why: &'static str) -> Self {
        Self { trial: Trial::Untried(why), ..self }
    }
}

/// A claim as it was tried on a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Who states it.
    pub paper: &'static str,
    /// Section, table or figure.
    pub place: &'static str,
    /// What.
    pub claim: String,
    /// Its figure or comparison.
    pub claimed: String,
    /// The telling figure first.
    pub measured: Vec<Figure>,
    /// The verdict; `None` where it was not tried.
    pub holds: Option<Holds>,
    /// What it was tried on, and how that was changed; empty where it was not.
    pub scene: String,
    /// The rule, and what else a reader should know; why it was not tried, where it was not.
    pub note: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn papers_are_found_by_an_author() {
        for (name, paper) in [
            ("hadwiger", Paper::Hadwiger),
            ("Neumann", Paper::KimNeumann),
            ("kim", Paper::KimNeumann),
            ("Yuksel and Keyser 2008", Paper::YukselKeyser),
            ("2011", Paper::Voicu),
            ("Muenstermann", Paper::Muenstermann),
            ("münstermann", Paper::Muenstermann),
        ] {
            assert_eq!(Paper::find(name).unwrap(), paper);
        }
        for name in ["", "and", "lokovic"] {
            assert!(Paper::find(name).is_err_and(|e| e.exit_status() == 2), "{name}");
        }
    }
}
