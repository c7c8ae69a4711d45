//! The error-against-time table: every method on the same scene, its errors first, then its times in turn.

use super::band::Band;
use super::errors::{RayTest, SeenReference, texels_to_test};
use super::stats::{image_difference, image_error};
use super::table::{Row, mark_pareto};
use super::timing::{ClockSource, StageTimes, TimedRun, Timing, interleave};
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::gpu::Clock;
use crate::render::{Omission, Session};
use crate::scene::Scene;
use crate::shadow::{Method, NoShadows, ShadowMap};
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use ndarray::{Array2, Array3, Axis};
use std::cell::Cell;
use std::collections::HashMap;

/// Frames slower than this are timed once after their warm-up, so that one method does not hold up the table.
const SLOW_FRAME_MS: f64 = 2000.0;
/// Pixels of the exact picture that `image_*` compare with.
const EXACT_PIXELS: f64 = 48.0 * 32.0;
/// Depth tolerance around which depths are crowded for methods that promise nothing, in smallest spacings.
const DEFAULT_DEPTH: f64 = 0.02;

/// Opacities of two pictures of one scene differ by no more than eye rays that end early make them.
const OPACITY_TOLERANCE: f32 = 2e-3;

/// How much to measure.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Timed runs of each method, after warm-up.
    pub repeats: usize,
    /// Points that the camera sees.
    pub points: usize,
    /// Light rays, and depths on each.
    pub rays: usize,
    pub depths: usize,
}

/// What to compare on what.
pub struct Job<'a> {
    pub session: &'a Session,
    pub volume: &'a Volume,
    pub tf: &'a TransferFunction,
    pub scene: &'a Scene,
    /// The column `scene`.
    pub scene_name: String,
    pub effort: Effort,
}

/// A row with its picture.
pub struct Compared {
    pub row: Row,
    /// A name for its files, different for every row.
    pub slug: String,
    /// `height x width x 4`, linear RGBA.
    pub picture: Array3<f32>,
    /// Largest channel difference to the picture of the `rays` row, `height x width`, where there is such a row.
    pub difference: Option<Array2<f32>>,
    pub left_out: Vec<Omission>,
}

/// Everything that came of a comparison.
pub struct Comparison {
    pub compared: Vec<Compared>,
    /// What a reader of the table should know about how it was made.
    pub notes: Vec<String>,
    /// What failed, and with what: `dsm epsilon=0.02`.
    pub failures: Vec<(String, Error)>,
}

/// Told what is done next.
pub type Progress<'a> = dyn FnMut(&str) + 'a;

/// How often [`compare`] reports progress for so many methods.
pub fn progress_steps(methods: usize) -> usize {
    2 + 3 * methods
}

/// A method made ready to be timed.
struct Prepared<'a> {
    method: &'a dyn Method,
    compared: Compared,
    frame_ms: f64,
}

/// Measures every method. One that fails is named in `failures` and the others go on; a method whose timing fails
/// keeps its errors.
///
/// # Errors
/// All methods failed (with the error of the first), or pictures that the adapter cannot hold.
pub fn compare(job: &Job, methods: &[Box<dyn Method>], progress: &mut Progress) -> Result<Comparison> {
    let mut notes = Vec::new();
    let mut failures = Vec::new();
    let field = ExactField::new(job.volume, job.tf);
    progress("exact transmittance at points");
    let mut errors = Errors::new(job, &field, &mut notes, progress)?;

    let mut prepared: Vec<Prepared> = Vec::new();
    let mut slugs = HashMap::new();
    for method in methods {
        let name = name_of(method.as_ref());
        match errors.prepare(method.as_ref(), unused_slug(method.as_ref(), &mut slugs), progress) {
            Ok(ready) => prepared.push(ready),
            Err(e) => failures.push((name, e)),
        }
    }
    if prepared.is_empty() {
        return Err(match failures.into_iter().next() {
            Some((_, first)) => first,
            None => Error::input("nothing to compare", "--methods", "no method is given"),
        });
    }
    notes.append(&mut errors.notes);
    notes.extend(unequal_opacity(&prepared));

    // Slow rows apart: they would make every round of the others as slow.
    let (slow, fast): (Vec<_>, Vec<_>) =
        (0..prepared.len()).partition(|&i| prepared[i].frame_ms > SLOW_FRAME_MS);
    for &i in &slow {
        let seconds = 1e-3 * prepared[i].frame_ms;
        let name = name_of(prepared[i].method);
        if job.effort.repeats > 1 {
            notes.push(format!("{name}: a frame takes {seconds:.1} s; timed once after one warm-up run"));
        }
    }
    for (which, warmup, repeats) in [(fast, 1, job.effort.repeats), (slow, 0, 1)] {
        let methods: Vec<_> = which.iter().map(|&i| prepared[i].method).collect();
        let timed = time(job, &methods, warmup, repeats, progress)?;
        for (i, timed) in which.into_iter().zip(timed) {
            match timed {
                Ok((timing, clock)) => prepared[i].compared.row.set_timing(&timing, clock),
                Err(e) => failures.push((name_of(prepared[i].method), e)),
            }
        }
    }

    let mut compared: Vec<_> = prepared.into_iter().map(|p| p.compared).collect();
    let mut rows: Vec<_> = compared.iter().map(|c| c.row.clone()).collect();
    mark_pareto(&mut rows);
    let reference = compared.iter().find(|c| c.row.method == "rays").map(|c| c.picture.clone());
    for (compared, row) in compared.iter_mut().zip(rows) {
        compared.row = row;
        if let Some(reference) = &reference
            && compared.row.method != "rays"
        {
            compared.difference = Some(image_difference(compared.picture.view(), reference.view())?);
        }
    }
    Ok(Comparison { compared, notes, failures })
}

/// Shadows change light, never opacity: says where a picture's opacity is not that of the first, as when a driver
/// gives up a shader's loops.
fn unequal_opacity(prepared: &[Prepared]) -> Vec<String> {
    let Some((first, others)) = prepared.split_first() else { return Vec::new() };
    let opacity = |p: &Prepared| p.compared.picture.index_axis(Axis(2), 3).to_owned();
    let expected = opacity(first);
    let note = |p: &Prepared| {
        let off =
            (opacity(p) - &expected).iter().filter(|d| d.is_nan() || d.abs() > OPACITY_TOLERANCE).count();
        let (name, first) = (name_of(p.method), name_of(first.method));
        (off > 0)
            .then(|| format!("{name}: {off} pixels of its picture differ in opacity from that of {first}"))
    };
    others.iter().filter_map(note).collect()
}

/// Method and settings as tables name them.
pub fn name_of(method: &dyn Method) -> String {
    [method.name(), &method.params()].join(" ").trim_end().to_string()
}

/// Everything that errors are measured against, once for all methods.
struct Errors<'a> {
    job: &'a Job<'a>,
    field: &'a ExactField<'a>,
    seen: SeenReference,
    /// The scene at a small size and its exact picture, where the model defines one.
    exact_picture: Option<(Scene, Array3<f32>)>,
    /// Tested texels by map size: the light space of a scene depends on nothing else.
    texels: HashMap<u32, Vec<[u32; 2]>>,
    notes: Vec<String>,
}

impl<'a> Errors<'a> {
    fn new(
        job: &'a Job,
        field: &'a ExactField,
        notes: &mut Vec<String>,
        progress: &mut Progress,
    ) -> Result<Self> {
        let seen = SeenReference::new(field, job.scene, job.effort.points);
        if seen.len() < job.effort.points {
            notes.push(format!("point errors are of {} points: the camera sees little", seen.len()));
        }
        progress("exact picture");
        let small = small_scene(job.scene);
        let exact_picture = match field.picture(&small) {
            Ok(picture) => {
                notes.push(format!(
                    "image errors are of {} x {} pixels, against the exact picture",
                    small.width, small.height
                ));
                Some((small, picture))
            }
            Err(e) => {
                notes.push(format!("image errors are left out: {}", e.why));
                None
            }
        };
        Ok(Self { job, field, seen, exact_picture, texels: HashMap::new(), notes: Vec::new() })
    }

    /// Builds and draws once, which warms the pipelines up, and measures errors.
    fn prepare<'m>(
        &mut self,
        method: &'m dyn Method,
        slug: String,
        progress: &mut Progress,
    ) -> Result<Prepared<'m>> {
        let (job, name) = (self.job, name_of(method));
        progress(&format!("{name}: building and drawing"));
        let needed = job.session.needs_shadows(job.scene);
        let shadow = build(job, method)?;
        let picture = job.session.render(&shadow, job.scene)?;
        let report = &shadow.report;
        let mut left_out = picture.plan.left_out;
        if let (Err(why), Some(_)) = (needed, method.map_size()) {
            left_out.insert(
                0,
                Omission { what: "shadow map".into(), why: why.into(), saved: None, optional: None },
            );
        }
        let mut row = Row {
            scene: job.scene_name.clone(),
            adapter: job.session.renderer.gpu().info.name.clone(),
            method: method.name().into(),
            params: method.params(),
            map: method.map_size(),
            width: job.scene.width,
            height: job.scene.height,
            bytes: Some(report.bytes),
            nodes_total: report.nodes_total,
            nodes_max: report.nodes_max,
            left_out: left_out.iter().map(omission_text).collect::<Vec<_>>().join("; "),
            ..Row::default()
        };
        if let Some((small, exact)) = &self.exact_picture {
            let drawn = job.session.render(&shadow, small)?;
            row.set_image_error(&image_error(drawn.pixels.view(), exact.view())?);
        }
        progress(&format!("{name}: errors"));
        // A structure that was not built has no errors of its own.
        if needed.is_ok() {
            if let Some(stats) = self.seen.errors(job.session, &shadow)? {
                row.set_point_errors(&stats);
            }
            self.measure_rays(method, &shadow, &mut row)?;
        }
        let compared = Compared { row, slug, picture: picture.pixels, difference: None, left_out };
        Ok(Prepared { method, compared, frame_ms: picture.span.best().0 })
    }

    fn measure_rays(&mut self, method: &dyn Method, shadow: &ShadowMap, row: &mut Row) -> Result<()> {
        let job = self.job;
        let space = &shadow.light_space;
        let (field, light, count) = (self.field, job.scene.light, job.effort.rays);
        let texels =
            self.texels.entry(space.map_size).or_insert_with(|| texels_to_test(field, light, space, count));
        let test = RayTest {
            texels,
            taps: method.taps(),
            depths: job.effort.depths,
            default_depth_mm: DEFAULT_DEPTH * job.volume.min_spacing_mm(),
        };
        let report = test.run(field, light, job.session, shadow)?;
        let promise = shadow.bound.map(|b| Band { bound: b.transmittance, depth_mm: b.depth_mm });
        row.set_ray_errors(&report, promise);
        if let Some(worst) = report.worst {
            let [column, texel_row] = texels[worst.ray];
            self.notes.push(format!(
                "{}: the bound does not hold at {} of {} depths; worst by {:.6} in texel ({column}, {texel_row}) \
                at depth {:.6} mm: {:.6}, exact {:.6}",
                name_of(method),
                report.violations,
                report.depths,
                worst.amount,
                worst.depth_mm,
                worst.t_method,
                worst.t_exact
            ));
        }
        Ok(())
    }
}

/// Builds a method's structure, or that of `none` where no light can be kept from a sample.
fn build(job: &Job, method: &dyn Method) -> Result<ShadowMap> {
    let needed = job.session.needs_shadows(job.scene).is_ok();
    job.session.shadow(if needed { method } else { &NoShadows }, job.scene.light)
}

/// Times methods in turn; one answer each, in their order.
fn time(
    job: &Job,
    methods: &[&dyn Method],
    warmup: usize,
    repeats: usize,
    progress: &mut Progress,
) -> Result<Vec<Result<(Timing, ClockSource)>>> {
    // The GPU's clock only where every frame was read from it.
    let clocks: Vec<_> = methods.iter().map(|_| Cell::new(ClockSource::Gpu)).collect();
    let mut runs: Vec<TimedRun> = Vec::with_capacity(methods.len());
    for (method, clock) in methods.iter().zip(&clocks) {
        progress(&format!("{}: timing", name_of(*method)));
        runs.push(Box::new(move || {
            let shadow = build(job, *method)?;
            // Without a structure there is nothing to build; what little the host does is part of every frame.
            let build_ms = shadow.report.device.map_or(0.0, |_| shadow.report.build_ms());
            let (frame_ms, source) = job.session.render(&shadow, job.scene)?.span.best();
            if source == Clock::Wall {
                clock.set(ClockSource::Wall);
            }
            Ok(StageTimes { build_ms, frame_ms })
        }));
    }
    let timings = interleave(&mut runs, warmup, repeats)?;
    drop(runs);
    Ok(timings.into_iter().zip(clocks).map(|(t, clock)| t.map(|t| (t, clock.get()))).collect())
}

/// The scene at about [`EXACT_PIXELS`] pixels and the same shape, or as it is where it is smaller.
fn small_scene(scene: &Scene) -> Scene {
    let (width, height) = (f64::from(scene.width), f64::from(scene.height));
    let scale = (EXACT_PIXELS / (width * height)).sqrt().min(1.0);
    let scaled = |n: f64| (n * scale).round().max(1.0) as u32;
    Scene { width: scaled(width), height: scaled(height), ..scene.clone() }
}

fn omission_text(omission: &Omission) -> String {
    let saved = omission.saved.as_ref().map_or(String::new(), |s| format!(", {s}"));
    format!("{} ({}){saved}", omission.what, omission.why)
}

/// Method and settings as part of a file name; a number is added where a row has been named so before.
fn unused_slug(method: &dyn Method, used: &mut HashMap<String, u32>) -> String {
    let map = method.map_size().map_or(String::new(), |n| format!(" map={n}"));
    let text = format!("{}{map} {}", method.name(), method.params());
    let keep = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    let slug: String = text.trim_end().chars().map(keep).collect();
    let times = used.entry(slug.clone()).and_modify(|n| *n += 1).or_insert(1);
    if *times == 1 { slug } else { format!("{slug}-{times}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::parse_list;
    use crate::volume::{VolumeSpec, load};

    #[test]
    fn file_names_tell_rows_apart() {
        let methods = parse_list("none;dsm:epsilon=0.02,0.005,map=64,128;none").unwrap();
        let mut used = HashMap::new();
        let slugs: Vec<_> = methods.iter().map(|m| unused_slug(m.as_ref(), &mut used)).collect();
        let expected = [
            "none",
            "dsm-map-64-epsilon-0.02",
            "dsm-map-128-epsilon-0.02",
            "dsm-map-64-epsilon-0.005",
            "dsm-map-128-epsilon-0.005",
            "none-2",
        ];
        assert_eq!(slugs, expected);
    }

    #[test]
    fn the_exact_picture_has_the_shape_of_the_picture() {
        let scene = Scene::framing(&load(&VolumeSpec::new("phantom:slab:8")).unwrap());
        for (size, small) in
            [((512, 512), (39, 39)), ((1920, 1280), (48, 32)), ((20, 30), (20, 30)), ((9000, 1), (3718, 1))]
        {
            let scene = small_scene(&Scene { width: size.0, height: size.1, ..scene.clone() });
            assert_eq!((scene.width, scene.height), small);
        }
    }
}
