//! Stability suite: runs every shadow method on extreme and ill-conditioned cases and compares it with the exact
//! transmittance.
//!
//! A case (`cases`) has a small volume, a transfer function, some lights, and settings that override those of the
//! methods. Every method is built, queried along light rays through texel centres, and rendered as a small picture.
//! Methods with an error bound are also queried at points between these rays.
//!
//! `judge` finds numerical faults: values that are not finite or outside `[0, 1]`, violations of the error bound, and
//! transmittance that increases with depth. Increases count only between depths that float32 can distinguish. For
//! methods without a bound, the error is only reported.
//!
//! Time and memory are compared with those of the same method on the ordinary case.

mod cases;
mod fields;
mod judge;
pub mod table;

pub use cases::{Case, ORDINARY, all};
pub use judge::{Findings, Status};
pub use table::Row;

use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::measure::bound_check::{BoundReport, Sanity};
use crate::measure::enclosure_check::EnclosureTest;
use crate::measure::errors::{RayTest, meets_extinction};
use crate::measure::point_bound::PointTest;
use crate::measure::progress::{Progress, Step, StepKind};
use crate::measure::rays::pick_texels;
use crate::render::{DisabledOptimizations, Renderer, Session};
use crate::scene::{Light, Scene};
use crate::shadow::{LightSpace, Method, MethodSpec, ShadowMap};
use glam::{DVec2, DVec3};
use std::sync::Arc;

/// Number of light rays tested for each stability case, light and shadow method. `DEPTHS` is the number of depths
/// tested on each ray.
const RAYS: usize = 48;
const DEPTHS: usize = 96;
/// Number of cells between texel centres, and of prisms of texels, in which error bounds are tested at points, and of
/// points in each.
const CELLS: usize = 24;
const POINTS_A_CELL: usize = 256;
/// Maximum number of texels per side of the regular grid on the shadow map from which tested light rays are chosen.
const CANDIDATES: u32 = 64;
/// Width and height of the pictures in stability tests, pixels.
const PICTURE: [u32; 2] = [32, 24];
/// Tolerance in depth for placing test depths around jumps of transmittance, for methods without an error bound, in
/// units of the smallest voxel spacing.
const DEFAULT_DEPTH: f64 = 0.02;
/// Ratio of a method's time or memory to that in the ordinary stability case from which the stability table notes it.
const NOTED_RATIO: f64 = 20.0;
/// Time that the device needs for a shadow map and a picture, ms, and largest ratio of host to device time, for a case
/// that is timed once. Others are timed twice, since the first time includes the compilation of shaders.
const SLOW_MS: f64 = 500.0;
const MOST_HOST: f64 = 0.1;
/// Smallest time of the ordinary stability case that serves as a baseline, ms. Shorter times consist mostly of
/// command submission.
const LEAST_MS: f64 = 1.0;

/// Tolerance for transmittance that increases with depth, for methods with a shadow map, beside the share that
/// interpolation takes from a neighbour because float32 texel coordinates vary along a ray.
const MAP_RISE: f64 = 1e-4;
/// Tolerance for transmittance that increases with depth, for methods that march shadow rays. Each query integrates
/// different segments, with an error of up to 1e-3 (the method's error bound).
const RAYS_RISE: f64 = 2e-3;
/// Tolerance for transmittance outside `[0, 1]`. It covers float32 rounding only, since methods average stored values
/// or take the exponential of a sum that is not positive.
const RANGE: f64 = 1e-6;

/// Smallest distance between two depths on a light ray that count as distinct, as a fraction of the volume's
/// diagonal. Float32 coordinates have errors of a few 1e-7 of the diagonal, which change transmittance visibly where
/// the extinction is 1e4 per mm or more.
const DEPTHS_APART: f64 = 1e-6;

/// Time and memory that a shadow method needs in a stability case.
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

    /// Returns the ratios of time and memory to those in the ordinary stability case that reach [`NOTED_RATIO`], each
    /// with a name.
    fn large_ratios_to(self, ordinary: Self) -> Vec<(f64, &'static str)> {
        let time = |here: f64, there: f64| here / there.max(LEAST_MS);
        let mut found = vec![
            (time(self.build_ms, ordinary.build_ms), "time to build"),
            (time(self.frame_ms, ordinary.frame_ms), "time to draw"),
        ];
        if ordinary.bytes > 0 {
            found.push((self.bytes as f64 / ordinary.bytes as f64, "bytes"));
        }
        found.retain(|(times, _)| *times >= NOTED_RATIO);
        found
    }
}

/// Returns the rows of the stability table in a case, one for each method to which the case applies, without results.
///
/// # Errors
/// A setting of the case is not allowed; a test tries them all.
pub fn planned(methods: &[MethodSpec], case: &Case) -> Result<Vec<Row>> {
    let applicable = methods.iter().filter_map(|method| with_case_settings(method, case));
    applicable.map(|spec| Ok(unmeasured(case, spec.method()?.as_ref()))).collect()
}

/// Runs the given stability cases with every given shadow method. Returns a row of the stability table for each case
/// and method to which the case applies, with the error that ended the run early, if any. A failure of a method
/// becomes a row, and the others continue. The observer of `progress` can end the run between two cases.
///
/// `finished` has the rows of each case from an earlier run ([`table::finished`]). A case with rows is not run again.
pub fn run(
    renderer: &Arc<Renderer>,
    methods: &[MethodSpec],
    cases: &[&Case],
    finished: Vec<Vec<Row>>,
    progress: &mut Progress,
) -> (Vec<Row>, Result<()>) {
    let mut rows = finished;
    rows.resize(cases.len(), Vec::new());
    let outcome = run_into(&mut rows, renderer, methods, cases, progress);
    (rows.concat(), outcome)
}

/// See [`run`]; fills the empty lists of `rows`, one for each case.
fn run_into(
    rows: &mut [Vec<Row>],
    renderer: &Arc<Renderer>,
    methods: &[MethodSpec],
    cases: &[&Case],
    progress: &mut Progress,
) -> Result<()> {
    let ordinary = &all()?[0];
    let plain = methods.iter().map(MethodSpec::method).collect::<Result<Vec<_>>>()?;
    let step = Step::new(StepKind::Case, "");
    let missing: Vec<_> = cases.iter().zip(rows).filter(|(_, rows)| rows.is_empty()).collect();
    if missing.is_empty() {
        return Ok(());
    }
    progress.expect(step.clone(), 1 + missing.len());
    progress.begin(step.clone(), "ordinary case")?;
    let outcomes = measure(renderer, ordinary, &plain);
    // A method that fails on the ordinary case has no baseline.
    let costs: Vec<_> = outcomes.into_iter().map(|o| o.ok().map(|(_, cost)| cost)).collect();
    for (case, rows) in missing {
        progress.begin(step.clone(), &case.name)?;
        let mut applicable = Vec::new();
        for (method, cost) in methods.iter().zip(&costs) {
            if let Some(spec) = with_case_settings(method, case) {
                applicable.push((spec.method()?, *cost));
            }
        }
        let (built, costs): (Vec<_>, Vec<_>) = applicable.into_iter().unzip();
        let outcomes = measure(renderer, case, &built);
        for ((outcome, method), ordinary) in outcomes.into_iter().zip(&built).zip(costs) {
            rows.push(row(case, method.as_ref(), outcome, ordinary));
        }
    }
    Ok(())
}

/// Measures the rows of an earlier table again: the same cases and settings. Costs are not noted.
///
/// # Errors
/// A case or a setting is unknown, or the observer of `progress` ended the run.
pub fn measured_again(rows: &[Row], renderer: &Arc<Renderer>, progress: &mut Progress) -> Result<Vec<Row>> {
    let (every, step) = (all()?, Step::new(StepKind::Case, ""));
    let tested = |own: &[Row]| {
        let name = &own[0].case;
        let unknown = || Error::input("cannot verify", name, "there is no such case");
        let case = every.iter().find(|case| case.name == *name).ok_or_else(unknown)?;
        let method = |row: &Row| row.spec().and_then(|spec| spec.method()).map_err(|e| e.at(name));
        Ok((case, own.iter().map(method).collect::<Result<Vec<_>>>()?))
    };
    let cases = rows.chunk_by(|a, b| a.case == b.case).map(tested).collect::<Result<Vec<_>>>()?;
    progress.expect(step.clone(), cases.len());
    let mut measured = Vec::new();
    for (case, methods) in cases {
        progress.begin(step.clone(), &case.name)?;
        let outcomes = measure(renderer, case, &methods).into_iter().zip(&methods);
        measured.extend(outcomes.map(|(outcome, method)| row(case, method.as_ref(), outcome, None)));
    }
    Ok(measured)
}

/// Returns a shadow method with the settings that a stability case imposes, as far as the method has them. Returns
/// `None` where the case does not apply to the method.
fn with_case_settings(method: &MethodSpec, case: &Case) -> Option<MethodSpec> {
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

/// Returns the row of a shadow method in a stability case, without results.
fn unmeasured(case: &Case, method: &dyn Method) -> Row {
    let map = method.map_size().map(|n| format!("map={n}"));
    let own = Some(method.params()).filter(|p| !p.is_empty());
    let params = own.into_iter().chain(map).collect::<Vec<_>>().join(" ");
    Row { case: case.name.clone(), method: method.name().into(), params, ..Row::default() }
}

fn row(case: &Case, method: &dyn Method, outcome: Outcome, ordinary: Option<Cost>) -> Row {
    let named = |status| Row { status, ..unmeasured(case, method) };
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
                .flat_map(|(light, f)| f.faults().into_iter().map(move |c| format!("{light}: {c}")))
                .collect();
            for (times, what) in ordinary.map_or(Vec::new(), |o| cost.large_ratios_to(o)) {
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

/// Test results of a shadow method for each light of a stability case, and its largest time and memory over the
/// lights.
type Outcome = Result<(Vec<(String, Findings)>, Cost)>;

/// Tests every shadow method in a stability case and measures its time and memory.
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

/// Stability case with one of its lights, in which shadow methods are tested.
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
            let in_sections = method.lookup().is_some_and(|lookup| lookup.has_sections());
            let shadow = match in_sections {
                true => session.shadow_of(method, &scene, self.light)?,
                false => session.shadow(method, self.light)?,
            };
            let picture = session.render(&shadow, &scene)?;
            let report = &shadow.report;
            let frame_ms = picture.span.best().0;
            let cost = Cost { build_ms: report.build_ms(), frame_ms, bytes: report.bytes };
            let device_ms = frame_ms + report.device.map_or(0.0, |span| span.best().0);
            let is_settled = device_ms > SLOW_MS && report.host_ms < MOST_HOST * device_ms;
            Ok((shadow, picture, cost, is_settled))
        };
        let (mut shadow, mut picture, mut cost, is_settled) = draw()?;
        // The host's part of the first run includes the compilation of shaders.
        if !is_settled {
            let first = cost;
            (shadow, picture, cost, _) = draw()?;
            cost = cost.smaller_times(first);
        }
        let texels = self.texels(&shadow.light_space);
        let mut found = self.query_rays(method, &shadow, &texels)?;
        self.query_points(method, &shadow, &texels, &mut found)?;
        found.check_picture(&picture.pixels);
        Ok((found, cost))
    }

    /// Tests the transmittance of a shadow method along light rays in a stability case.
    fn query_rays(&self, method: &dyn Method, shadow: &ShadowMap, texels: &[[u32; 2]]) -> Result<Findings> {
        let test = RayTest {
            texels,
            taps: method.taps(),
            depths: DEPTHS,
            default_depth_mm: DEFAULT_DEPTH * self.case.volume.min_spacing_mm(),
            nodes_mm: &[],
        };
        let rise = match &shadow.lookup {
            Some(lookup) if lookup.marches_cells() => RAYS_RISE,
            // The samples of each shadow ray begin at its own point, so that transmittance is not monotone.
            Some(lookup) if lookup.marches() => f64::INFINITY,
            _ => MAP_RISE + shadow.light_space.rounding(&self.case.volume, false).texels,
        };
        let (mut check, mut rays) = (BoundReport::default(), Sanity::default());
        let [near, far] = [self.case.volume.corners_mm()[0], self.case.volume.corners_mm()[7]];
        let apart_mm = DEPTHS_APART * near.distance(far);
        let query = |points: &[DVec3]| self.session.query(shadow, points);
        test.visit(self.field, self.light, shadow, query, |own, depths, values| {
            check.add(own);
            rays = rays.merge(Sanity::of_ray(depths, values, [RANGE, rise], apart_mm));
        })?;
        Ok(Findings { check, bound: shadow.bound, curve: method.curve(), rays, ..Findings::default() })
    }

    /// Tests the error bound and the enclosure of a shadow method, if it has them, at points between light rays.
    fn query_points(
        &self,
        method: &dyn Method,
        shadow: &ShadowMap,
        texels: &[[u32; 2]],
        found: &mut Findings,
    ) -> Result<()> {
        if shadow.bound.is_some() {
            let texels: Vec<[u32; 2]> = texels.iter().copied().step_by(RAYS / CELLS).collect();
            let cells = PointTest { cells: &texels, points_a_cell: POINTS_A_CELL, taps: method.taps() };
            found.points = cells.run(self.field, self.light, self.session, shadow)?;
            let prisms = EnclosureTest { texels: &texels, points_a_texel: POINTS_A_CELL };
            found.enclosure = prisms.run(self.field, self.light, self.session, shadow)?;
        }
        Ok(())
    }

    /// Chooses the shadow map texels on whose light rays transmittance is tested: the middle of the map, and texels
    /// spread over the rays that meet extinction.
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
    fn settings_are_with_case_settings_those_of_methods_that_know_them() {
        let cases = all().unwrap();
        let over = |method: &str, name: &str| {
            let case = cases.iter().find(|c| c.name == name).unwrap();
            with_case_settings(&method.parse().unwrap(), case).map(|s| s.to_string())
        };
        assert_eq!(over("dsm:epsilon=0.1,map=64", "epsilon-0").unwrap(), "dsm:epsilon=0,map=64");
        assert_eq!(over("osm:map=64", "epsilon-0"), None);
        assert_eq!(over("rays", "map-1"), None);
        assert_eq!(over("osm:layers=4", "bits-16").unwrap(), "osm:layers=4,bits=16");
        assert_eq!(over("rays", "step-too-long").unwrap(), "rays:march=samples,step=8");
        assert_eq!(
            over("dsm", "step-too-long").unwrap(),
            "dsm:epsilon=0.02,precompress=off,march=samples,step=8"
        );
        assert_eq!(over("bom", "step-too-long").unwrap(), "bom:layers=15,ratio=0.5,march=samples,step=8");
        assert_eq!(over("none", "comb").unwrap(), "none");
        // Methods accept every setting of every case.
        for case in &cases {
            for method in METHODS {
                if let Some(spec) = with_case_settings(&MethodSpec::default_of(method), case) {
                    assert_eq!(spec.to_string().parse::<MethodSpec>().unwrap(), spec);
                }
            }
        }
    }

    #[test]
    fn planted_costs_are_remarked_on() {
        let ordinary = Cost { build_ms: 0.5, frame_ms: 10.0, bytes: 100 };
        let said = |cost: Cost| cost.large_ratios_to(ordinary).iter().map(|d| d.1).collect::<Vec<_>>();
        assert_eq!(said(ordinary), [""; 0]);
        // A baseline of half a millisecond counts as one millisecond.
        assert_eq!(said(Cost { build_ms: 19.0, ..ordinary }), [""; 0]);
        assert_eq!(said(Cost { build_ms: 21.0, bytes: 2000, ..ordinary }), ["time to build", "bytes"]);
        assert_eq!(Cost { frame_ms: 250.0, ..ordinary }.large_ratios_to(ordinary), [(25.0, "time to draw")]);
        assert_eq!(
            Cost { bytes: 5, ..ordinary }.large_ratios_to(Cost::default()),
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
