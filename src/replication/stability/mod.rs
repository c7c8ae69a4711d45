//! Stiff and extreme cases, every method on each, with the exact curve beside it.
//!
//! A case (`cases`) is a small volume, a transfer function, some lights and settings that are put over those of the
//! methods. Every method is built, queried along light rays through texel centres, and drawn as a small picture.
//! `judge` finds values that are not finite or outside `[0, 1]`, transmittance that rises with depth (between depths that
//! float32 can tell apart), and violations of the error bound. The error of methods without a bound is only reported. Time and bytes are set beside those of the same method on the ordinary case.

mod cases;
mod fields;
mod judge;
pub mod table;

pub use cases::{Case, ORDINARY, all};
pub use judge::{Findings, Status};
pub use table::Row;

use crate::error::Result;
use crate::exact::ExactField;
use crate::measure::bound_check::{BoundReport, Sanity};
use crate::measure::errors::{RayTest, meets_extinction};
use crate::measure::rays::pick_texels;
use crate::render::{DisabledOptimizations, Renderer, Session};
use crate::scene::{Light, Scene};
use crate::shadow::{LightSpace, Method, MethodSpec, ShadowMap};
use glam::{DVec2, DVec3};
use std::sync::Arc;

/// Light rays of a case, light and method, and depths on each.
const RAYS: usize = 48;
const DEPTHS: usize = 96;
/// Texels a side among which rays are picked.
const CANDIDATES: u32 = 64;
/// Size of the pictures.
const PICTURE: [u32; 2] = [32, 24];
/// Depth tolerance used to place test depths around jumps, in smallest spacings, where the error bound has none.
const DEFAULT_DEPTH: f64 = 0.02;
/// Ratio to the time or bytes of the ordinary case from which a note is written.
const DEAR: f64 = 20.0;
/// Times below this are mostly the submission's, ms.
const LEAST_MS: f64 = 1.0;

/// Rises of a map: float32 texel coordinates of points of one ray differ by up to 1e-5 of a texel and so weigh in
/// neighbours.
const MAP_RISE: f64 = 1e-4;
/// Rises of shadow rays: each is a sum of other pieces, and may be off by the error bound of the method (1e-3).
const RAYS_RISE: f64 = 2e-3;
/// Transmittance is a mean of stored values or the exponential of a sum of terms >= 0: rounding of 1 alone.
const RANGE: f64 = 1e-6;

/// Share of the volume's diagonal by which depths must be apart to be distinct: float32 coordinates and their sums are
/// off by a few 1e-7 of it, and where extinction is 1e4 per mm and more, that is a rise of transmittance.
const DEPTHS_APART: f64 = 1e-6;

/// Time and memory that a method took on a case.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Cost {
    build_ms: f64,
    frame_ms: f64,
    bytes: u64,
}

impl Cost {
    fn larger(self, other: Self) -> Self {
        let [build_ms, frame_ms] =
            [(self.build_ms, other.build_ms), (self.frame_ms, other.frame_ms)].map(|(a, b)| a.max(b));
        Self { build_ms, frame_ms, bytes: self.bytes.max(other.bytes) }
    }

    fn smaller_times(self, other: Self) -> Self {
        let [build_ms, frame_ms] =
            [(self.build_ms, other.build_ms), (self.frame_ms, other.frame_ms)].map(|(a, b)| a.min(b));
        Self { build_ms, frame_ms, ..self }
    }

    /// Ratios of the costs to those of the ordinary case, with names, where they are [`DEAR`] or more.
    fn dear_beside(self, ordinary: Self) -> Vec<(f64, &'static str)> {
        let time = |here: f64, there: f64| here / there.max(LEAST_MS);
        let mut found = vec![
            (time(self.build_ms, ordinary.build_ms), "time to build"),
            (time(self.frame_ms, ordinary.frame_ms), "time to draw"),
        ];
        if ordinary.bytes > 0 {
            found.push((self.bytes as f64 / ordinary.bytes as f64, "bytes"));
        }
        found.retain(|(times, _)| *times >= DEAR);
        found
    }
}

/// Runs the picked cases with every method: a row for each case and method that the case concerns. What fails becomes a
/// row; the others go on. `next` is called with the name of the next case.
///
/// # Errors
/// Settings that are refused.
pub fn run(
    renderer: &Arc<Renderer>,
    methods: &[MethodSpec],
    cases: &[&Case],
    next: &mut dyn FnMut(&str),
) -> Result<Vec<Row>> {
    let ordinary = &all()?[0];
    let plain = methods.iter().map(MethodSpec::method).collect::<Result<Vec<_>>>()?;
    next("what is ordinary");
    let outcomes = measure(renderer, ordinary, &plain);
    // A method that fails on the ordinary case has nothing to be compared with.
    let costs: Vec<_> = outcomes.into_iter().map(|o| o.ok().map(|(_, cost)| cost)).collect();
    let mut rows = Vec::new();
    for case in cases {
        next(&case.name);
        let mut concerned = Vec::new();
        for (method, cost) in methods.iter().zip(&costs) {
            if let Some(spec) = put_over(method, case) {
                concerned.push((spec.method()?, *cost));
            }
        }
        let (built, costs): (Vec<_>, Vec<_>) = concerned.into_iter().unzip();
        let outcomes = measure(renderer, case, &built);
        for ((outcome, method), ordinary) in outcomes.into_iter().zip(&built).zip(costs) {
            rows.push(row(case, method.as_ref(), outcome, ordinary));
        }
    }
    Ok(rows)
}

/// A method with those of a case's settings put over its own that it can have; nothing where the case does not concern it.
fn put_over(method: &MethodSpec, case: &Case) -> Option<MethodSpec> {
    let mut spec = method.clone();
    for (key, value) in &case.settings {
        match spec.clone().with(key, value) {
            Some(changed) => spec = changed,
            None if case.needs_settings => return None,
            None => {}
        }
    }
    Some(spec)
}

fn row(case: &Case, method: &dyn Method, outcome: Outcome, ordinary: Option<Cost>) -> Row {
    let map = method.map_size().map(|n| format!("map={n}"));
    let own = Some(method.params()).filter(|p| !p.is_empty());
    let params = own.into_iter().chain(map).collect::<Vec<_>>().join(" ");
    let named = |status| Row {
        case: case.name.clone(),
        method: method.name().into(),
        params,
        status,
        ..Row::default()
    };
    match outcome {
        Err(e) => Row { note: e.to_string(), ..named(Status::Failed) },
        Ok((lights, cost)) => {
            let status = lights.iter().map(|(_, f)| f.status()).max().unwrap_or(Status::Ok);
            let count = |of: fn(&Findings) -> usize| Some(lights.iter().map(|(_, f)| of(f)).sum());
            let largest = |of: &dyn Fn(&Findings) -> Option<f64>| {
                lights.iter().filter_map(|(_, f)| of(f)).max_by(f64::total_cmp)
            };
            let mut notes: Vec<_> = lights
                .iter()
                .flat_map(|(light, f)| f.complaints().into_iter().map(move |c| format!("{light}: {c}")))
                .collect();
            for (times, what) in ordinary.map_or(Vec::new(), |o| cost.dear_beside(o)) {
                notes.push(format!("{times:.0} times the ordinary {what}"));
            }
            Row {
                ray_err_max: largest(&|f| f.check.ray_err_max()),
                bound: largest(&|f| f.bound.map(|b| b.transmittance)),
                monotone_violations: count(|f| f.rays.monotone_violations),
                out_of_range: count(Findings::out_of_range),
                non_finite: count(Findings::non_finite),
                build_ms: Some(cost.build_ms),
                bytes: Some(cost.bytes),
                note: notes.join("; "),
                ..named(status)
            }
        }
    }
}

/// Findings by light, and the largest cost over the lights.
type Outcome = Result<(Vec<(String, Findings)>, Cost)>;

/// Every method on a case.
fn measure(renderer: &Arc<Renderer>, case: &Case, methods: &[Box<dyn Method>]) -> Vec<Outcome> {
    let session = match Session::on(renderer, Arc::clone(&case.volume), &case.tf, DisabledOptimizations::NONE)
    {
        Ok(session) => session,
        Err(e) => return methods.iter().map(|_| Err(e.clone())).collect(),
    };
    let field = ExactField::new(&case.volume, &case.tf);
    let measured = |method: &dyn Method| {
        let (mut findings, mut cost) = (Vec::new(), Cost::default());
        for &light in &case.lights {
            let lit = Lit { case, session: &session, field: &field, light };
            let (found, took) = lit.measure(method)?;
            findings.push((light.text(), found));
            cost = cost.larger(took);
        }
        Ok((findings, cost))
    };
    methods.iter().map(|m| measured(m.as_ref())).collect()
}

/// Stability case with one of its lights.
struct Lit<'a> {
    case: &'a Case,
    session: &'a Session,
    field: &'a ExactField<'a>,
    light: Light,
}

impl Lit<'_> {
    fn measure(&self, method: &dyn Method) -> Result<(Findings, Cost)> {
        let (case, session) = (self.case, self.session);
        let [width, height] = PICTURE;
        let scene =
            Scene { step: case.step, width, height, ..Scene::framing(&case.volume).under(self.light.into()) };
        let draw = || -> Result<_> {
            let shadow = session.shadow(method, self.light)?;
            let picture = session.render(&shadow, &scene)?;
            let report = &shadow.report;
            let cost =
                Cost { build_ms: report.build_ms(), frame_ms: picture.span.best().0, bytes: report.bytes };
            Ok((shadow, picture, cost))
        };
        // What comes first pays for the driver's own preparations.
        let (_, _, first) = draw()?;
        let (shadow, picture, second) = draw()?;
        let mut found = self.query_rays(method, &shadow)?;
        found.look_at(&picture.pixels);
        Ok((found, second.smaller_times(first)))
    }

    /// Transmittance along light rays.
    fn query_rays(&self, method: &dyn Method, shadow: &ShadowMap) -> Result<Findings> {
        let test = RayTest {
            texels: &self.texels(&shadow.light_space),
            taps: method.taps(),
            depths: DEPTHS,
            default_depth_mm: DEFAULT_DEPTH * self.case.volume.min_spacing_mm(),
            nodes_mm: &[],
        };
        let rise = if shadow.lookup.as_ref().is_some_and(|l| l.marches()) { RAYS_RISE } else { MAP_RISE };
        let (mut check, mut rays) = (BoundReport::default(), Sanity::default());
        let [near, far] = [self.case.volume.corners_mm()[0], self.case.volume.corners_mm()[7]];
        let apart_mm = DEPTHS_APART * near.distance(far);
        let query = |points: &[DVec3]| self.session.query(shadow, points);
        test.visit(self.field, self.light, shadow, query, |own, depths, values| {
            check = check.merge(own);
            rays = rays.merge(Sanity::of_ray(depths, values, [RANGE, rise], apart_mm));
        })?;
        Ok(Findings { check, bound: shadow.bound, curve: method.curve(), rays, ..Findings::default() })
    }

    /// The middle of the map and texels spread over what the light meets.
    fn texels(&self, space: &LightSpace) -> Vec<[u32; 2]> {
        let candidates = space.map_size.min(CANDIDATES);
        let stride = space.map_size / candidates;
        let texel = |c: u32, r: u32| [c * stride + c % stride, r * stride + r % stride];
        let meets = |c: u32, r: u32| {
            let [column, row] = texel(c, r).map(f64::from);
            meets_extinction(self.field, self.light, space, DVec2::new(column, row))
        };
        let mut texels = vec![[space.map_size / 2; 2]];
        texels.extend(pick_texels(candidates, RAYS - 1, meets).into_iter().map(|[c, r]| texel(c, r)));
        texels
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::{self, METHODS};
    #[test]
    fn settings_are_put_over_those_of_methods_that_know_them() {
        let cases = all().unwrap();
        let over = |method: &str, name: &str| {
            let case = cases.iter().find(|c| c.name == name).unwrap();
            put_over(&method.parse().unwrap(), case).map(|s| s.to_string())
        };
        assert_eq!(over("dsm:epsilon=0.1,map=64", "epsilon-0").unwrap(), "dsm:epsilon=0,map=64");
        assert_eq!(over("osm:map=64", "epsilon-0"), None);
        assert_eq!(over("rays", "map-1"), None);
        assert_eq!(over("osm:layers=4", "bits-8").unwrap(), "osm:layers=4,bits=8");
        assert_eq!(over("rays", "step-too-long").unwrap(), "rays");
        assert_eq!(
            over("dsm", "step-too-long").unwrap(),
            "dsm:epsilon=0.02,precompress=off,march=samples,step=8"
        );
        assert_eq!(over("bom", "step-too-long").unwrap(), "bom:layers=15,ratio=0.5,march=samples,step=8");
        assert_eq!(over("none", "comb").unwrap(), "none");
        // Every setting of every case is one that the methods take.
        for case in &cases {
            for method in METHODS {
                if let Some(spec) = put_over(&MethodSpec::default_of(method), case) {
                    assert_eq!(spec.to_string().parse::<MethodSpec>().unwrap(), spec);
                }
            }
        }
    }

    #[test]
    fn planted_costs_are_remarked_on() {
        let ordinary = Cost { build_ms: 0.5, frame_ms: 10.0, bytes: 100 };
        let said = |cost: Cost| cost.dear_beside(ordinary).iter().map(|d| d.1).collect::<Vec<_>>();
        assert_eq!(said(ordinary), [""; 0]);
        // Half a millisecond counts as one.
        assert_eq!(said(Cost { build_ms: 19.0, ..ordinary }), [""; 0]);
        assert_eq!(said(Cost { build_ms: 21.0, bytes: 2000, ..ordinary }), ["time to build", "bytes"]);
        assert_eq!(Cost { frame_ms: 250.0, ..ordinary }.dear_beside(ordinary), [(25.0, "time to draw")]);
        assert_eq!(
            Cost { bytes: 5, ..ordinary }.dear_beside(Cost::default()),
            [],
            "none has bytes ordinarily"
        );
    }

    #[test]
    fn a_row_is_the_worst_of_its_lights_and_failures_are_rows() {
        let cases = all().unwrap();
        let method = shadow::parse("dsm:map=64,epsilon=0.1").unwrap();
        let bad = Findings { picture_non_finite: 3, ..Findings::default() };
        let cost = Cost { build_ms: 100.0, frame_ms: 1.0, bytes: 7 };
        let lights = vec![("sun".into(), Findings::default()), ("lamp".into(), bad)];
        let ordinary = Some(Cost { build_ms: 2.0, ..Cost::default() });
        let made = row(&cases[0], method.as_ref(), Ok((lights, cost)), ordinary);
        assert_eq!((made.status, made.non_finite, made.bytes), (Status::Nan, Some(3), Some(7)));
        assert_eq!(made.params, "epsilon=0.1 map=64");
        assert!(made.note.contains("lamp: 3 channels") && !made.note.contains("sun"), "{}", made.note);
        assert!(made.note.contains("50 times the ordinary time to build"), "{}", made.note);
        let lost = crate::error::Error::runtime("device lost", "here", "planted");
        let made = row(&cases[0], method.as_ref(), Err(lost), None);
        assert_eq!((made.status, made.note.as_str()), (Status::Failed, "device lost (here): planted"));
    }
}
