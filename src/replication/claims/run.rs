//! Trying claims: what they need is measured once, then each is judged.

use super::claim::{Claim, Finding, Measured, Need, Row, Trial};
use super::figures::{Depth, Figures, Wanted, key, measure};
use super::scenes::{self, StandIn, Subject, Variant};
use super::turns::time_in_turn;
use super::{hadwiger, kim_neumann, later, voicu, yuksel_keyser};
use crate::error::{Error, Result};
use crate::measure::compare::steps;
use crate::measure::job::Effort;
use crate::measure::progress::Progress;
use crate::render::Renderer;
use crate::shadow::{Method, parse_list};
use std::collections::HashMap;
use std::sync::Arc;

/// Every claim, paper by paper.
pub fn all() -> Vec<Claim> {
    [kim_neumann::claims(), hadwiger::claims(), yuksel_keyser::claims(), voicu::claims(), later::claims()]
        .into_iter()
        .flatten()
        .collect()
}

/// The names of the scenes that claims are tried on: those given, or else the stand-ins that any of them names.
pub fn scene_names(claims: &[Claim], given: &[String]) -> Vec<String> {
    if !given.is_empty() {
        return given.to_vec();
    }
    let named = |s: &&StandIn| claims.iter().any(|c| c.scenes.contains(s));
    scenes::STAND_INS.iter().filter(named).map(|s| s.name.to_owned()).collect()
}

/// What a scene's claims need, by variant; a method that several ask for stands once, as whole as any of them asks.
fn groups<'a>(claims: impl Iterator<Item = &'a Claim>) -> Result<Vec<Wanted>> {
    let mut groups: Vec<Wanted> = Vec::new();
    let mut needs: Vec<&Need> = claims.flat_map(|c| &c.needs).filter(|n| n.depth != Depth::Times).collect();
    // Whole ones first: a structure alone is then asked for only where nobody asks for more.
    needs.sort_by_key(|n| std::cmp::Reverse(n.depth));
    for need in needs {
        let at = groups.iter().position(|g| g.variant == need.variant).unwrap_or_else(|| {
            groups.push(Wanted::nothing(need.variant));
            groups.len() - 1
        });
        let group = &mut groups[at];
        for method in parse_list(need.methods)? {
            let known =
                |list: &[Box<dyn Method>]| list.iter().any(|m| key(m.as_ref()) == key(method.as_ref()));
            match need.depth {
                _ if known(&group.whole) || known(&group.structure) => {}
                Depth::Whole => group.whole.push(method),
                Depth::Structure | Depth::Times => group.structure.push(method),
            }
        }
    }
    Ok(groups)
}

/// Tries claims, each on the scenes `given` or else on its stand-ins; `read` gives a scene by its name. A claim whose
/// figures are not to be had is a row that says why.
///
/// # Errors
/// A scene that cannot be read, one that the device cannot hold, or it was ended on request.
pub fn run(
    renderer: &Arc<Renderer>,
    claims: &[Claim],
    given: &[String],
    read: &mut dyn FnMut(&str) -> Result<Subject>,
    effort: Effort,
    progress: &mut Progress,
) -> Result<Vec<Row>> {
    let concerns = |claim: &Claim, scene: &str| match given {
        [] => claim.scenes.iter().any(|s| s.name == scene),
        given => !claim.needs.is_empty() && !compares_stand_ins(claim) && given.iter().any(|g| g == scene),
    };
    let mut planned = Vec::new();
    for scene in scene_names(claims, given) {
        let groups = groups(claims.iter().filter(|c| concerns(c, &scene)))?;
        for group in &groups {
            if !group.whole.is_empty() {
                steps(&group.whole, &effort)
                    .into_iter()
                    .for_each(|(step, times)| progress.expect(step, times));
            }
        }
        planned.push((scene, groups));
    }
    let mut rows: Vec<(usize, Row)> = Vec::new();
    for (scene, groups) in planned {
        let subject = read(&scene)?;
        let mut measured = Vec::new();
        for wanted in groups {
            let other = wanted.variant.instead.map(&mut *read).transpose()?;
            let place = (scene.as_str(), other.as_ref().unwrap_or(&subject));
            measured.push((wanted.variant, measure(renderer, place, &wanted, effort, progress)?));
        }
        for (i, claim) in claims.iter().enumerate().filter(|(_, c)| concerns(c, &scene)) {
            let row = if claim.needs.iter().any(|n| n.depth == Depth::Times) {
                let timed = time_in_turn(renderer, (&scene, &subject), &claim.needs, effort, progress)?;
                let timed: Vec<Vec<&Figures>> = timed.iter().map(|own| own.iter().collect()).collect();
                verdict(claim, &scene, &timed)
            } else {
                verdict(claim, &scene, &collect(claim, &measured)?)
            };
            rows.push((i, row));
        }
    }
    let untried = |(i, c): (usize, &Claim)| match c.trial {
        Trial::Untried(why) => Some((i, row_of(c, why))),
        Trial::Judged { .. } if !given.is_empty() && compares_stand_ins(c) => {
            Some((i, row_of(c, "Not tried: it compares built-in scenes with each other.")))
        }
        Trial::Judged { .. } => None,
    };
    rows.extend(claims.iter().enumerate().filter_map(untried));
    rows.sort_by_key(|(i, _)| *i);
    Ok(rows.into_iter().map(|(_, row)| row).collect())
}

/// Whether a claim needs built-in scenes besides its own.
fn compares_stand_ins(claim: &Claim) -> bool {
    claim.needs.iter().any(|n| n.variant.instead.is_some())
}

/// A claim without verdict.
fn row_of(claim: &Claim, note: impl Into<String>) -> Row {
    Row {
        paper: claim.paper.name(),
        place: claim.place,
        claim: claim.claim.clone(),
        claimed: claim.claimed.clone(),
        measured: Vec::new(),
        holds: None,
        scene: String::new(),
        note: note.into(),
    }
}

/// What a claim needs, from all that was measured on its scene.
fn collect<'a>(
    claim: &Claim,
    known: &'a [(Variant, HashMap<String, Figures>)],
) -> Result<Vec<Vec<&'a Figures>>> {
    let mut measured = Vec::new();
    for need in &claim.needs {
        let figures = known.iter().find(|(variant, _)| *variant == need.variant).map(|(_, figures)| figures);
        let missing = || Error::runtime("cannot judge", claim.claim.as_str(), "a figure was not measured");
        let found = parse_list(need.methods)?
            .iter()
            .map(|m| figures.and_then(|f| f.get(&key(m.as_ref()))).ok_or_else(missing))
            .collect::<Result<Vec<_>>>()?;
        measured.push(found);
    }
    Ok(measured)
}

/// The row of a claim on a scene, from the figures that it needs.
fn verdict(claim: &Claim, scene: &str, measured: &Measured) -> Row {
    let Trial::Judged { rule, judge } = &claim.trial else { return row_of(claim, "") };
    let mut variants: Vec<String> = claim.needs.iter().map(|n| n.variant.text()).collect();
    variants.dedup();
    let changed = variants.iter().any(|v| !v.is_empty());
    let named = |v: &String| if v.is_empty() { "as it is".to_owned() } else { v.clone() };
    let how = variants.iter().map(named).collect::<Vec<_>>().join("; ");
    let scene = if changed { format!("{scene} ({how})") } else { scene.to_owned() };
    match judge(measured) {
        Ok(Finding { holds, figures, note }) => {
            let note = if note.is_empty() { rule.to_string() } else { format!("{rule} {note}") };
            Row { measured: figures, holds: Some(holds), scene, ..row_of(claim, note) }
        }
        Err(e) => Row { scene, ..row_of(claim, format!("Not tried: {e}.")) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::table;
    use crate::replication::claims::claim::Paper;
    use crate::replication::claims::rules::{Holds, at_least};

    #[test]
    fn every_claim_can_be_asked_for() {
        let claims = all();
        let tried: Vec<_> = claims.iter().filter(|c| matches!(c.trial, Trial::Judged { .. })).collect();
        assert!(tried.len() >= 25, "{}", tried.len());
        for paper in Paper::ALL {
            assert!(tried.iter().any(|c| c.paper == paper));
        }
        for claim in &claims {
            let timed = claim.needs.iter().filter(|n| n.depth == Depth::Times).count();
            assert!(timed == 0 || timed == claim.needs.len(), "{}", claim.claim);
            let instead = claim.needs.iter().filter_map(|n| n.variant.instead);
            assert!(instead.into_iter().all(|name| scenes::STAND_INS.iter().any(|s| s.name == name)));
            assert!(!claim.claim.is_empty() && !claim.claimed.is_empty() && !claim.place.is_empty());
            match claim.trial {
                Trial::Judged { rule, .. } => {
                    assert!(!claim.scenes.is_empty() && !claim.needs.is_empty(), "{}", claim.claim);
                    assert!(rule.ends_with('.'), "{rule}");
                }
                Trial::Untried(why) => assert!(claim.needs.is_empty() && why.ends_with('.'), "{why}"),
            }
        }
        let groups = groups(claims.iter()).unwrap();
        for group in &groups {
            let all = group.whole.iter().chain(&group.structure);
            let mut keys: Vec<_> = all.map(|m| key(m.as_ref())).collect();
            keys.sort();
            keys.dedup();
            assert_eq!(keys.len(), group.whole.len() + group.structure.len(), "a setting is measured once");
        }
    }

    /// The same verdict whatever is measured would be a constant in disguise.
    #[test]
    fn verdicts_follow_from_the_figures() {
        let claim = Claim::new(Paper::Voicu, "Table 1", "slower", "2")
            .on(&[scenes::FUR])
            .needs(scenes::AS_IS, "osm:layers=4,8")
            .judged("Yes from 2 on.", |m| {
                let ratio = m[0][1].frame_ms()? / m[0][0].frame_ms()?;
                Ok(Finding::new(at_least(ratio, 2.0), [("ratio", ratio)]).note("Planted."))
            });
        let of = |times: [Option<f64>; 2]| {
            let keyed = parse_list("osm:layers=4,8").unwrap().into_iter().zip(times).map(|(m, ms)| {
                let row = table::Row { frame_ms: ms, ..Default::default() };
                (key(m.as_ref()), Figures { name: "osm".into(), row, ..Figures::default() })
            });
            let known = [(scenes::AS_IS, keyed.collect())];
            verdict(&claim, "fur", &collect(&claim, &known).unwrap())
        };
        assert_eq!(of([Some(1.0), Some(3.0)]).holds, Some(Holds::Yes));
        assert_eq!(of([Some(1.0), Some(1.5)]).holds, Some(Holds::Partly));
        let row = of([Some(1.0), Some(1.0)]);
        assert_eq!((row.holds, row.measured[0].1, row.scene.as_str()), (Some(Holds::No), 1.0, "fur"));
        assert_eq!(row.note, "Yes from 2 on. Planted.");
        let row = of([Some(1.0), None]);
        assert!(row.holds.is_none() && row.note.contains("no frame time"), "{}", row.note);
        assert!(collect(&claim, &[]).is_err());
    }
}
