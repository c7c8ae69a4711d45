//! Reference data that a scene's methods are measured against, and rows before timing: errors and a picture.

use super::bound_check::BoundReport;
use super::budget::Budget;
use super::check::{Check, check};
use super::errors::{RayTest, VisiblePointsByLight, texels_to_test};
use super::facts::Facts;
use super::job::{Job, SLOW_FRAME_MS, name_of};
use super::journal::Measured;
use super::progress::{Progress, Step, StepKind};
use super::similarity::{SSIM_WINDOW, ssim};
use super::stats::{Spread, image_error};
use super::strand_errors::StrandReference;
use super::table::Row;
use super::timing::Timing;
use crate::error::Result;
use crate::exact::ExactField;
use crate::render::{Omission, Session, View};
use crate::scene::{Light, Scene};
use crate::shadow::{Bound, BuildReport, LightSpace, Method, ShadowMap};
use glam::DVec2;
use ndarray::Array3;
use std::time::Instant;

/// Pixels of the exact picture that `image_*` compare with, and those of them that its own error is estimated from.
const EXACT_PIXELS: f64 = 48.0 * 32.0;
const EXACT_PIXELS_CHECKED: usize = 64;
/// Depth tolerance around which depths are crowded for methods without an error bound, in smallest spacings.
const DEFAULT_DEPTH: f64 = 0.02;
/// Timed runs of a trial, of which the slower counts: what is chosen by it should keep its budget once more.
const TRIAL_RUNS: usize = 2;
/// Times that tables and brick classes are made, to tell how long that takes.
const TRANSFER_REPEATS: usize = 3;

/// The scene at a small size and its exact picture.
struct ExactPicture {
    scene: Scene,
    pixels: Array3<f32>,
    /// Largest estimated error of the reference itself.
    error: f64,
}

/// Everything that errors are measured against, once for all methods of a scene.
pub(super) struct Reference<'a> {
    job: &'a Job<'a>,
    facts: &'a Facts,
    field: &'a ExactField<'a>,
    visible: VisiblePointsByLight,
    exact_picture: ExactPicture,
    /// Reference of the strands, if the volume was made from strands.
    strands: Option<StrandReference>,
    /// Tested texels of maps that are laid out alike.
    texels: Vec<(LightSpace, Vec<[u32; 2]>)>,
    bricks_ms: Option<f64>,
    tables_ms: Option<f64>,
    /// The pre-compressed table, which only some methods need.
    march_table_ms: Option<f64>,
    /// Notes about the scene, for each of its rows.
    notes: Vec<String>,
}

/// A reference that is made only where something needs it.
pub(super) struct Shared<'a> {
    job: &'a Job<'a>,
    facts: &'a Facts,
    field: &'a ExactField<'a>,
    made: Option<Result<Reference<'a>>>,
}

impl<'a> Shared<'a> {
    pub fn new(job: &'a Job, facts: &'a Facts, field: &'a ExactField) -> Self {
        Self { job, facts, field, made: None }
    }

    /// The reference, made at the first call.
    pub fn get(&mut self, progress: &mut Progress) -> Result<&mut Reference<'a>> {
        let (job, facts, field) = (self.job, self.facts, self.field);
        let made = self.made.get_or_insert_with(|| Reference::new(job, facts, field, progress));
        made.as_mut().map_err(|e| e.clone())
    }

    /// Whether anything has needed it.
    pub fn is_made(&self) -> bool {
        self.made.is_some()
    }
}

impl<'a> Reference<'a> {
    fn new(job: &'a Job, facts: &'a Facts, field: &'a ExactField, progress: &mut Progress) -> Result<Self> {
        let mut notes = Vec::new();
        progress.begin(Step::new(StepKind::Points, ""), "exact transmittance at points")?;
        let visible = VisiblePointsByLight::new(field, job.scene, job.effort.points);
        if visible.count() < job.effort.points {
            notes.push(format!("point errors are of {} points: the camera sees little", visible.count()));
        }
        progress.begin(Step::new(StepKind::ExactPicture, ""), "exact picture")?;
        let small = small_scene(job.scene);
        let pixels = field.picture(&small);
        let error = field.picture_change(&small, &pixels, EXACT_PIXELS_CHECKED);
        notes.push(format!(
            "errors of the picture (RMSE, PSNR, SSIM) are those of {} x {} pixels, shaded as the scene is, against the \
            exact picture, which changes by at most {error:.1e} in a channel when it is integrated more finely",
            small.width, small.height
        ));
        if small.width.min(small.height) < SSIM_WINDOW as u32 {
            notes.push(format!("image_ssim is left out: its window is {SSIM_WINDOW} pixels wide"));
        }
        let exact_picture = ExactPicture { scene: small, pixels, error };
        let strands = match job.strands.map(|strands| StrandReference::new(strands, job, &visible)) {
            Some(Ok(reference)) => {
                notes.push(reference.note());
                Some(reference)
            }
            Some(Err(why)) => {
                notes.push(format!("strand_err_rms is left out: {why}"));
                None
            }
            None => None,
        };
        progress.check("tables")?;
        let [mut bricks, mut tables, mut march_tables] = [const { Vec::new() }; 3];
        for _ in 0..TRANSFER_REPEATS {
            let transfer = job.session.fresh_transfer(job.tf)?;
            bricks.push(transfer.classify_ms);
            tables.push(transfer.table_ms);
            march_tables.push(transfer.make_march_table(job.session.renderer.gpu())?.table_ms);
        }
        let median = |ms: Vec<f64>| Spread::of(&ms).map(|s| s.median);
        Ok(Self {
            job,
            facts,
            field,
            visible,
            exact_picture,
            strands,
            texels: Vec::new(),
            bricks_ms: median(bricks),
            tables_ms: median(tables),
            march_table_ms: median(march_tables),
            notes,
        })
    }

    /// Builds and draws once, which warms the pipelines up, and measures errors.
    // Long: the stages of one measurement, each of which reads what the stages before measured.
    pub fn measure(
        &mut self,
        method: &dyn Method,
        slug: &str,
        progress: &mut Progress,
    ) -> Result<(Measured, Array3<f32>)> {
        let (job, name) = (self.job, name_of(method));
        progress.begin(Step::new(StepKind::Draw, &name), &format!("{name}: building and drawing"))?;
        let needed = job.session.needs_shadows(job.scene);
        // A transfer function of its own tells which tables the method needs.
        let transfer = job.session.fresh_transfer(job.tf)?;
        let Session { renderer, loaded, .. } = job.session;
        let build = || {
            // The small picture, whose sides are rounded, may be a little wider.
            let view = View::of_shadows(job.scene).map(|view| view.holding(&self.exact_picture.scene));
            renderer.shadows_in(loaded, &transfer, method, job.scene, view.as_ref())
        };
        let start = Instant::now();
        let mut shadows = build()?;
        let build_first_ms = start.elapsed().as_secs_f64() * 1e3;
        if BuildReport::of_all(&shadows).guessed {
            // The row is about what a moved light finds.
            shadows = build()?;
        }
        let marches = |map: &ShadowMap| map.lookup.as_ref().is_some_and(|l| l.marches());
        let marched = transfer.march_table().is_some() || shadows.iter().any(marches);
        if marched {
            // Timed runs use the session's own tables, which must not be made in the first of them.
            job.session.transfer.make_march_table(renderer.gpu())?;
        }
        let march_table_ms = self.march_table_ms.filter(|_| marched).unwrap_or_default();
        progress.check(&format!("{name}: drawing"))?;
        let mut picture = renderer.render(loaded, &transfer, &shadows, job.scene)?;
        if picture.span.best().0 > SLOW_FRAME_MS {
            // Drivers compile as late as the first use, and a busy machine takes seconds for it.
            picture = renderer.render(loaded, &transfer, &shadows, job.scene)?;
        }
        let report = BuildReport::of_all(&shadows);
        let mut left_out = picture.plan.left_out;
        if let (Err(why), true) = (needed, method.has_map()) {
            left_out.insert(
                0,
                Omission { what: "shadow map".into(), why: why.into(), saved: None, optional: None },
            );
        }
        let mut row = Row {
            build_first_ms: Some(build_first_ms),
            map: shadows
                .iter()
                .map(|map| map.light_space.map_size)
                .max()
                .filter(|_| needed.is_ok() && method.has_map()),
            bytes: Some(report.bytes),
            bytes_used: Some(report.bytes_used),
            nodes_total: report.nodes_total,
            nodes_max: report.nodes_max,
            lights: Some(job.scene.lights_shining()),
            bricks_ms: self.bricks_ms,
            tables_ms: self.tables_ms.map(|ms| ms + march_table_ms),
            left_out: left_out.iter().map(Omission::text).collect::<Vec<_>>().join("; "),
            ..self.row(method)
        };
        if !job.remark.is_empty() {
            row.add_note(&job.remark);
        }
        let exact = &self.exact_picture;
        let kernels = renderer.kernels();
        let (drawn, picture_work) = kernels.counting_work(|| job.session.render(&shadows, &exact.scene))?;
        let (_, build_work) = kernels.counting_work(|| job.session.shadows_of(method, job.scene))?;
        let pixels = u64::from(exact.scene.width) * u64::from(exact.scene.height);
        row.set_work((build_work, report.texels_built()), (picture_work, pixels));
        row.set_image_error(&image_error(drawn.pixels.view(), exact.pixels.view())?);
        row.image_ssim = ssim(drawn.pixels.view(), exact.pixels.view())?;
        row.image_exact_err = Some(exact.error);
        progress.begin(Step::new(StepKind::Errors, &name), &format!("{name}: errors"))?;
        let mut notes = self.notes.clone();
        // A structure that was not built has no errors of its own.
        if needed.is_ok() {
            if let Some(stats) = self.visible.errors(job.session, &shadows)? {
                row.set_point_errors(&stats);
            }
            if let (Some(strands), [shadow]) = (&self.strands, &shadows[..]) {
                row.strand_err_rms = strands.rms(job.session, shadow)?;
            }
            progress.check(&format!("{name}: errors on light rays"))?;
            notes.extend(self.measure_rays(method, &shadows, &mut row)?);
            let mut checked = None;
            for (source, shadow) in job.scene.shining().iter().zip(&shadows) {
                let own = check(job.session, method, shadow, &job.scene.under(*source))?;
                checked = checked.zip(own).map_or(checked.or(own), |(a, b): (Check, Check)| Some(a.merge(b)));
            }
            if let Some(check) = checked {
                row.set_check(&check);
            }
        }
        let measured = Measured { row, slug: slug.into(), left_out, notes, frame_ms: picture.span.best().0 };
        Ok((measured, picture.pixels))
    }

    /// Row of a method without measurements.
    pub fn row(&self, method: &dyn Method) -> Row {
        self.facts.row(&self.job.scene_name, [self.job.scene.width, self.job.scene.height], method)
    }

    /// Fills the row of a trial: what the setting needs of each kind of budget, and its errors where one may allow it.
    pub fn try_setting(&self, method: &dyn Method, budgets: &[Budget], trial: &mut Row) -> Result<()> {
        let job = self.job;
        let mut shadows = job.session.shadows_of(method, job.scene)?;
        if BuildReport::of_all(&shadows).guessed {
            shadows = job.session.shadows_of(method, job.scene)?;
        }
        trial.bytes = Some(BuildReport::of_all(&shadows).bytes);
        let drawn = job.session.render(&shadows, &self.exact_picture.scene)?;
        let largest_ms =
            budgets.iter().filter(|b| matches!(b, Budget::Ms(_))).map(Budget::amount).reduce(f64::max);
        if let Some(largest_ms) = largest_ms {
            let mut times = Vec::new();
            while times.len() < TRIAL_RUNS {
                times.push(job.timed(method)?);
                let timing = Timing::of(&times)?;
                [trial.build_ms, trial.frame_ms] = [timing.build_ms, timing.frame_ms].map(|s| Some(s.max));
                // Nothing brings it within reach.
                if timing.build_ms.min + timing.frame_ms.min > 2.0 * largest_ms {
                    break;
                }
            }
        }
        if budgets.iter().any(|b| b.holds(trial)) {
            trial.point_err_rms = self.visible.errors(job.session, &shadows)?.map(|stats| stats.rms);
            trial.image_rmse = Some(image_error(drawn.pixels.view(), self.exact_picture.pixels.view())?.rmse);
        }
        Ok(())
    }

    /// Fills the light-ray errors of a row from the shadow maps, one per light in order; adds a note where an error bound
    /// is violated.
    fn measure_rays(
        &mut self,
        method: &dyn Method,
        shadows: &[ShadowMap],
        row: &mut Row,
    ) -> Result<Vec<String>> {
        let (mut all, mut notes) = (BoundReport::default(), Vec::new());
        for (source, shadow) in self.job.scene.shining().iter().zip(shadows) {
            // Together they are as many rays as one light's.
            let count = self.job.effort.rays.div_ceil(shadows.len());
            let (report, note) = self.measure_rays_of(method, (source.light, shadow), count)?;
            all = all.merge(report);
            notes.extend(note);
        }
        row.set_ray_errors(&all, Bound::of_all(shadows));
        Ok(notes)
    }

    /// Measures one light with a given number of rays.
    fn measure_rays_of(
        &mut self,
        method: &dyn Method,
        (light, shadow): (Light, &ShadowMap),
        count: usize,
    ) -> Result<(BoundReport, Option<String>)> {
        let job = self.job;
        let space = &shadow.light_space;
        let field = self.field;
        let known = self.texels.iter().position(|(known, _)| known.is_laid_out_as(space));
        let known = known.unwrap_or_else(|| {
            let side = space.map_size;
            let all = (0..side).flat_map(|r| (0..side).map(move |c| [c, r]));
            let covered = |t: &[u32; 2]| space.covers(DVec2::new(f64::from(t[0]), f64::from(t[1])));
            let texels = match job.effort.check_all {
                true => all.filter(covered).collect(),
                false => texels_to_test(field, light, space, count),
            };
            self.texels.push((space.clone(), texels));
            self.texels.len() - 1
        });
        let texels = &self.texels[known].1;
        let nodes = match job.effort.check_all {
            true => job.session.node_depths(shadow, texels)?.unwrap_or_default(),
            false => Vec::new(),
        };
        let test = RayTest {
            texels,
            taps: method.taps(),
            depths: job.effort.depths,
            default_depth_mm: DEFAULT_DEPTH * job.volume.min_spacing_mm(),
            nodes_mm: &nodes,
        };
        let report = test.run(field, light, job.session, shadow)?;
        let note = report.worst.map(|worst| {
            let [column, texel_row] = texels[worst.ray];
            format!(
                "{}: the bound does not hold at {} of {} depths; worst by {:.6} in texel ({column}, {texel_row}) \
                at depth {:.6} mm: {:.6}, exact {:.6}",
                name_of(method),
                report.violations,
                report.depths,
                worst.amount,
                worst.depth_mm,
                worst.t_method,
                worst.t_exact
            )
        });
        Ok((report, note))
    }
}

/// The scene at about [`EXACT_PIXELS`] pixels and the same shape, or as it is where it is smaller.
fn small_scene(scene: &Scene) -> Scene {
    let (width, height) = (f64::from(scene.width), f64::from(scene.height));
    let scale = (EXACT_PIXELS / (width * height)).sqrt().min(1.0);
    let scaled = |n: f64| (n * scale).round().max(1.0) as u32;
    Scene { width: scaled(width), height: scaled(height), ..scene.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;

    #[test]
    fn the_exact_picture_has_the_shape_of_the_picture() {
        let scene = Scene::framing(&Phantom::Slab.build(8).unwrap());
        for (size, small) in
            [((512, 512), (39, 39)), ((1920, 1280), (48, 32)), ((20, 30), (20, 30)), ((9000, 1), (3718, 1))]
        {
            let scene = small_scene(&Scene { width: size.0, height: size.1, ..scene.clone() });
            assert_eq!((scene.width, scene.height), small);
        }
    }
}
