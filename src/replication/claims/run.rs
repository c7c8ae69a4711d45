//! Test of claims of papers: makes each required measurement once, then gives a verdict on each claim.

use super::claim::{Claim, Finding, Measured, Row};
use super::figures::{Depth, Figures, Wanted, key, measure};
use super::scenes::{STAND_INS, Subject, Variant};
use super::turns::time_in_turn;
use crate::error::{Error, Result};
use crate::measure::compare::steps;
use crate::measure::job::Effort;
use crate::measure::progress::Progress;
use crate::render::Renderer;
use crate::shadow::{Method, parse_list};
use std::collections::HashMap;
use std::sync::Arc;

/// Returns the names of the scenes on which claims of papers are tested: the given scenes, or else the built-in
/// scenes that the claims name.
pub fn scene_names(claims: &[Claim], given: &[String]) -> Vec<String> {
    if !given.is_empty() {
        return given.to_vec();
    }
    let names = STAND_INS.iter().map(|s| s.name.clone());
    names.filter(|name| claims.iter().any(|c| c.scenes.contains(name))).collect()
}

/// Groups the shadow methods that claims of papers need by scene variant. Each method is measured once, to the
/// greatest extent that a claim needs.
fn groups<'a>(claims: impl Iterator<Item = &'a Claim>) -> Result<Vec<Wanted>> {
    let mut groups: Vec<Wanted> = Vec::new();
    let mut claims: Vec<&Claim> = claims.filter(|c| c.depth != Depth::Times).collect();
    // Full measurements first, so that a shadow map is built alone only if no claim needs more.
    claims.sort_by_key(|c| std::cmp::Reverse(c.depth));
    for (depth, need) in claims.iter().flat_map(|c| c.needs.iter().map(|need| (c.depth, need))) {
        let at = groups.iter().position(|g| g.variant == need.variant).unwrap_or_else(|| {
            groups.push(Wanted::nothing(need.variant.clone()));
            groups.len() - 1
        });
        let group = &mut groups[at];
        for method in parse_list(&need.methods)? {
            let known =
                |list: &[Box<dyn Method>]| list.iter().any(|m| key(m.as_ref()) == key(method.as_ref()));
            match depth {
                _ if known(&group.whole) || known(&group.structure) => {}
                Depth::Whole => group.whole.push(method),
                Depth::Structure | Depth::Times => group.structure.push(method),
            }
        }
    }
    Ok(groups)
}

/// Scenes on which claims are tested: those of the command line, or else the built-in scenes that the claims name.
#[derive(Clone, Copy)]
struct Plan<'a> {
    claims: &'a [Claim],
    given: &'a [String],
}

impl<'a> Plan<'a> {
    /// Whether a claim is tested on a scene.
    fn concerns(&self, claim: &Claim, scene: &str) -> bool {
        match self.given {
            [] => claim.scenes.iter().any(|s| s == scene),
            given => {
                !claim.needs.is_empty() && !compares_stand_ins(claim) && given.iter().any(|g| g == scene)
            }
        }
    }

    /// Claims that are tested on a scene, each with its index.
    fn on(self, scene: &str) -> impl Iterator<Item = (usize, &'a Claim)> {
        self.claims.iter().enumerate().filter(move |(_, claim)| self.concerns(claim, scene))
    }

    /// Rows of an earlier run with the verdicts on all claims of a scene, each with the index of its claim; `None` if one
    /// is missing.
    fn finished(self, scene: &str, earlier: &[Row]) -> Option<Vec<(usize, Row)>> {
        let row = |(i, claim): (usize, &Claim)| {
            let same = |row: &&Row| is_row_of(row, claim) && row.scene == scene_text(claim, scene);
            Some((i, earlier.iter().find(same)?.clone()))
        };
        self.on(scene).map(row).collect()
    }
}

/// Returns a row of an earlier run whose claim, or scene, is not among the requested ones.
pub fn unrequested<'r>(claims: &[Claim], given: &[String], earlier: &'r [Row]) -> Option<&'r Row> {
    let plan = Plan { claims, given };
    let scenes = scene_names(claims, given);
    let is_requested = |row: &&Row| match row.scene.as_str() {
        "" => claims.iter().any(|claim| is_row_of(row, claim)),
        text => scenes.iter().any(|scene| {
            plan.on(scene).any(|(_, claim)| is_row_of(row, claim) && text == scene_text(claim, scene))
        }),
    };
    earlier.iter().find(|row| !is_requested(row))
}

/// Whether a row has the verdict on a claim.
pub(super) fn is_row_of(row: &Row, claim: &Claim) -> bool {
    (&row.paper, &row.place, &row.claim, &row.claimed)
        == (&claim.paper, &claim.place, &claim.claim, &claim.claimed)
}

/// Tests claims of papers on the scenes `given`, or else on the built-in scenes that each claim names. `read` loads a
/// scene by its name. A claim with missing measurements gets a row with the reason.
///
/// `earlier` has the rows of an earlier run. A scene whose claims all have a row there is not measured again.
///
/// Returns the rows, with the error that ended the run early, if any: a scene cannot be read, the device cannot store
/// it, or the observer of `progress` cancelled the measurement. Rows of finished scenes are returned in any case.
pub fn run(
    renderer: &Arc<Renderer>,
    claims: &[Claim],
    given: &[String],
    earlier: &[Row],
    read: &mut dyn FnMut(&str) -> Result<Subject>,
    effort: Effort,
    progress: &mut Progress,
) -> (Vec<Row>, Result<()>) {
    let plan = Plan { claims, given };
    let scenes = scene_names(claims, given);
    let mut of_scenes: Vec<Vec<(usize, Row)>> =
        scenes.iter().map(|scene| plan.finished(scene, earlier).unwrap_or_default()).collect();
    let missing = scenes.iter().zip(&mut of_scenes).filter(|(_, rows)| rows.is_empty()).collect();
    let outcome = measure_into(missing, renderer, plan, read, effort, progress);
    let mut rows = of_scenes.concat();
    let untried = |(i, c): (usize, &Claim)| {
        let compares = !given.is_empty() && compares_stand_ins(c);
        let compares = compares.then_some("Not tried: it compares built-in scenes with each other.");
        c.untried.as_deref().or(compares).map(|why| (i, row_of(c, why)))
    };
    rows.extend(claims.iter().enumerate().filter_map(untried));
    rows.sort_by_key(|(i, _)| *i);
    (rows.into_iter().map(|(_, row)| row).collect(), outcome)
}

/// Measures scenes and appends the verdicts to the rows of each scene, each with the index of its claim; see [`run`].
fn measure_into(
    scenes: Vec<(&String, &mut Vec<(usize, Row)>)>,
    renderer: &Arc<Renderer>,
    plan: Plan<'_>,
    read: &mut dyn FnMut(&str) -> Result<Subject>,
    effort: Effort,
    progress: &mut Progress,
) -> Result<()> {
    let mut planned = Vec::new();
    for (scene, rows) in scenes {
        let groups = groups(plan.on(scene).map(|(_, claim)| claim))?;
        for group in &groups {
            if !group.whole.is_empty() {
                steps(&group.whole, &effort)
                    .into_iter()
                    .for_each(|(step, times)| progress.expect(step, times));
            }
        }
        planned.push((scene, rows, groups));
    }
    for (scene, rows, groups) in planned {
        let subject = read(scene)?;
        let mut measured = Vec::new();
        for wanted in groups {
            let other = wanted.variant.scene.as_deref().map(&mut *read).transpose()?;
            let place = (scene.as_str(), other.as_ref().unwrap_or(&subject));
            let figures = measure(renderer, place, &wanted, effort, progress)?;
            measured.push((wanted.variant, figures));
        }
        for (i, claim) in plan.on(scene) {
            let row = if claim.depth == Depth::Times {
                let timed = time_in_turn(renderer, (scene, &subject), &claim.needs, effort, progress)?;
                let timed: Vec<Vec<&Figures>> = timed.iter().map(|own| own.iter().collect()).collect();
                verdict(claim, scene, &timed)
            } else {
                verdict(claim, scene, &collect(claim, &measured)?)
            };
            rows.push((i, row));
        }
    }
    Ok(())
}

/// Whether a paper's claim is tested by comparing two built-in scenes with each other.
fn compares_stand_ins(claim: &Claim) -> bool {
    claim.needs.iter().any(|n| n.variant.scene.is_some())
}

/// Creates a row of the table of tested claims (`claims.csv`), without a verdict.
fn row_of(claim: &Claim, note: impl Into<String>) -> Row {
    Row {
        paper: claim.paper.clone(),
        place: claim.place.clone(),
        claim: claim.claim.clone(),
        claimed: claim.claimed.clone(),
        note: note.into(),
        ..Row::default()
    }
}

/// Selects the measurements for one claim of a paper from all measurements on a scene.
fn collect<'a>(
    claim: &Claim,
    known: &'a [(Variant, HashMap<String, Figures>)],
) -> Result<Vec<Vec<&'a Figures>>> {
    let mut measured = Vec::new();
    for need in &claim.needs {
        let figures = known.iter().find(|(variant, _)| *variant == need.variant).map(|(_, figures)| figures);
        let missing = || Error::runtime("cannot judge", claim.claim.as_str(), "a figure was not measured");
        let found = parse_list(&need.methods)?
            .iter()
            .map(|m| figures.and_then(|f| f.get(&key(m.as_ref()))).ok_or_else(missing))
            .collect::<Result<Vec<_>>>()?;
        measured.push(found);
    }
    Ok(measured)
}

/// Name of a scene with the variants that a claim needs, for the column `scene`.
fn scene_text(claim: &Claim, scene: &str) -> String {
    let mut variants: Vec<String> = claim.needs.iter().map(|n| n.variant.text()).collect();
    variants.dedup();
    if variants.iter().all(String::is_empty) {
        return scene.to_owned();
    }
    let named = |v: &String| if v.is_empty() { "as it is".to_owned() } else { v.clone() };
    let how = variants.iter().map(named).collect::<Vec<_>>().join("; ");
    format!("{scene} ({how})")
}

/// Creates the row of the table of tested claims (`claims.csv`) with the verdict on one paper's claim, from its
/// measurements.
fn verdict(claim: &Claim, scene: &str, measured: &Measured) -> Row {
    let scene = scene_text(claim, scene);
    let rule = &claim.rule;
    match claim.judge(measured) {
        Ok(Finding { holds, figures, note }) => {
            let note = if note.is_empty() { rule.clone() } else { format!("{rule} {note}") };
            Row { measured: figures, holds, scene, ..row_of(claim, note) }
        }
        Err(e) => Row { scene, ..row_of(claim, format!("Not tried: {e}.")) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::defaults::settings;
    use crate::measure::table;
    use crate::replication::claims::all;
    use crate::replication::claims::rules::Holds;
    use crate::shadow::{NodeMap, SplitChoice};

    #[test]
    fn every_claim_can_be_asked_for() {
        let claims = all().unwrap();
        let tried = claims.iter().filter(|c| c.untried.is_none()).count();
        assert!(tried >= 115, "{tried}");
        for claim in &claims {
            assert!(!claim.claim.is_empty() && !claim.claimed.is_empty() && !claim.place.is_empty());
            match &claim.untried {
                None => {
                    assert!(!claim.scenes.is_empty() && !claim.needs.is_empty(), "{}", claim.claim);
                    assert!(claim.rule.ends_with('.'), "{}", claim.rule);
                }
                Some(why) => assert!(claim.needs.is_empty() && why.ends_with('.'), "{why}"),
            }
        }
        for group in &groups(claims.iter()).unwrap() {
            let all = group.whole.iter().chain(&group.structure);
            let mut keys: Vec<_> = all.map(|m| key(m.as_ref())).collect();
            keys.sort();
            keys.dedup();
            assert_eq!(keys.len(), group.whole.len() + group.structure.len(), "a setting is measured once");
        }
    }

    /// Returns random measurements of a shadow method for tests, with a value for every quantity.
    fn made_up(method: &dyn Method, random: &mut fastrand::Rng) -> Figures {
        let mut value = |scale: f64| Some(scale * (0.2 + random.f64()));
        let row = table::Row {
            build_ms: value(50.0),
            frame_ms: value(50.0),
            bytes: value(1e6).map(|b| b as u64),
            nodes_total: value(1e5).map(|n| n as u64),
            nodes_max: value(50.0).map(|n| n as u64),
            ray_err_max: value(0.5),
            point_err_rms: value(0.1),
            point_err_mean_signed: value(-0.1),
            shadow_rmse: value(0.1),
            bound_held: value(1.0).map(|x| x > 0.5),
            width: random.u32(32..512),
            height: 48,
            settings: settings(method),
            ..table::Row::default()
        };
        let points: Vec<_> = (0..40)
            .map(|i| super::super::figures::AtPoint {
                exact: f64::from(i) / 39.0,
                method: random.f64(),
                weight: 1.0,
            })
            .collect();
        Figures {
            name: method.name().into(),
            row,
            picture: Some(ndarray::Array3::from_shape_fn((16, 16, 4), |_| random.f32())),
            points,
            split: Some(SplitChoice { ratio: random.f64(), correlation: random.f64() }),
            nodes: Some(NodeMap {
                nodes: ndarray::Array2::from_shape_fn((64, 64), |(i, j)| {
                    let n = random.u32(0..40);
                    if (i + j) % 7 == 0 { 40 } else { n / 4 }
                }),
                stored: ndarray::Array2::from_elem((4, 4), true),
            }),
        }
    }

    /// Tests that every paper's claim has formulas that can be evaluated, and a verdict that depends on the measured
    /// numbers.
    #[test]
    fn verdicts_follow_from_the_figures() {
        let mut random = fastrand::Rng::with_seed(7);
        let mut constant = Vec::new();
        for claim in all().unwrap() {
            if claim.untried.is_some() {
                continue;
            }
            let mut verdicts = std::collections::BTreeSet::new();
            for _ in 0..200 {
                let methods: Vec<_> = claim.needs.iter().map(|n| parse_list(&n.methods).unwrap()).collect();
                let figures: Vec<Vec<Figures>> = methods
                    .iter()
                    .map(|list| list.iter().map(|m| made_up(m.as_ref(), &mut random)).collect())
                    .collect();
                let measured: Vec<Vec<&Figures>> = figures.iter().map(|l| l.iter().collect()).collect();
                verdicts.insert(
                    claim.judge(&measured).map_err(|e| format!("{}: {e}", claim.claim)).unwrap().holds,
                );
                if verdicts.len() > 1 {
                    break;
                }
            }
            if verdicts.len() == 1 {
                constant.push(claim.claim);
            }
        }
        // Random figures follow no power law, and random points have some of every transmittance.
        let unreachable = [
            "linear in the number",
            "direct mapping",
            "Far fewer layers",
            "number of nodes in the compressed",
            "kappa",
            "Many tiles",
        ];
        constant.retain(|claim| unreachable.iter().all(|text| !claim.contains(text)));
        assert_eq!(constant, Vec::<String>::new(), "the same verdict whatever is measured");
    }

    #[test]
    fn scenes_with_all_their_rows_are_finished() {
        let mut claims = all().unwrap();
        claims.retain(|claim| claim.paper == "Kim and Neumann 2001");
        let plan = Plan { claims: &claims, given: &[] };
        let scene = &scene_names(&claims, &[])[0];
        let row = |(_, claim): (usize, &Claim)| Row {
            scene: scene_text(claim, scene),
            ..row_of(claim, "Measured.")
        };
        let mut rows: Vec<Row> = plan.on(scene).map(row).collect();
        assert_eq!(plan.finished(scene, &rows).unwrap().len(), rows.len());
        assert!(unrequested(&claims, &[], &rows).is_none());
        // On a scene of the user, these rows are not requested.
        assert!(unrequested(&claims, &["mine".into()], &rows).is_some());
        rows.pop();
        assert!(plan.finished(scene, &rows).is_none());
        rows[0].claimed = "another number".into();
        assert_eq!(unrequested(&claims, &[], &rows), Some(&rows[0]), "the claim is another one");
        // Several claims are told apart by their texts.
        let is_own = |(i, claim): (usize, &Claim)| {
            claims.iter().position(|other| is_row_of(&row_of(claim, ""), other)) == Some(i)
        };
        assert!(claims.iter().enumerate().all(is_own));
    }

    #[test]
    fn a_missing_figure_is_a_row_without_verdict() {
        let claim = all().unwrap().into_iter().find(|c| c.place == "Figure 4.3").unwrap();
        let of = |errors: [Option<f64>; 2]| {
            let keyed = parse_list(&claim.needs[0].methods).unwrap().into_iter().zip(errors).map(|(m, e)| {
                let row = table::Row { shadow_rmse: e, ..Default::default() };
                (key(m.as_ref()), Figures { name: "osm".into(), row, ..Figures::default() })
            });
            let known = [(Variant::default(), keyed.collect())];
            verdict(&claim, "fur", &collect(&claim, &known).unwrap())
        };
        assert_eq!(of([Some(1.0), Some(3.0)]).holds, Holds::Yes);
        assert_eq!(of([Some(1.5), Some(1.0)]).holds, Holds::Partly);
        let row = of([Some(3.0), Some(1.0)]);
        assert_eq!((row.holds, row.measured[0].1, row.scene.as_str()), (Holds::No, 3.0, "fur"));
        let row = of([Some(1.0), None]);
        assert!(row.holds == Holds::Untried && row.note.contains("no shadow_rmse"), "{}", row.note);
        assert!(collect(&claim, &[]).is_err());
    }
}
