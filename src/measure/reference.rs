//! Reference data of one scene (exact picture and exact transmittance), and the measurement of each shadow method's
//! errors against them.

use super::bound_check::BoundReport;
use super::budget::Budget;
use super::certified::{self, CertifiedScene, DEFAULT_ETA};
use super::check::{Check, check};
use super::errors::{RayTest, VisiblePointsByLight, texels_to_test};
use super::facts::Facts;
use super::flicker::{FLICKER_POINTS, Flicker, FlickerReference};
use super::job::{Checked, Job, SLOW_FRAME_MS, name_of};
use super::journal::Measured;
use super::mean_error::{MEAN_ERROR_POINTS, MeanErrorSample};
use super::point_checks::PointChecks;
use super::point_report::PointReport;
use super::progress::{Progress, Step, StepKind};
use super::random_error::RandomError;
use super::shadow_error::ShadowReferences;
use super::similarity::{SSIM_WINDOW, ssim};
use super::small_scene::small_scene;
use super::stats::{Spread, image_error};
use super::strand_errors::StrandReference;
use super::table::Row;
use super::trial_times::set_trial_times;
use crate::error::Result;
use crate::exact::ExactField;
use crate::field::DeviceTransfer;
use crate::render::{Omission, Session, View};
use crate::scene::{Light, LightSource, Scene};
use crate::shadow::{Bound, BuildReport, LightSpace, Lookup, Method, ShadowMap, mapped_lights};
use glam::DVec2;
use ndarray::Array3;
use std::time::Instant;

/// Number of pixels of the exact reference picture at which its own error is estimated.
const EXACT_PIXELS_CHECKED: usize = 64;
/// Tolerance in depth for placing test depths around jumps of transmittance, for methods without an error bound, in
/// units of the smallest voxel spacing.
const DEFAULT_DEPTH: f64 = 0.02;
/// Number of timed repetitions of two tasks: classifying the volume's bricks and computing the transfer function's
/// tables.
const TRANSFER_REPEATS: usize = 3;

/// Exact reference picture of a scene at a reduced size, with an estimate of its own error.
struct ExactPicture {
    scene: Scene,
    pixels: Array3<f32>,
    /// Largest estimated error of the exact reference picture itself, in any colour channel.
    error: f64,
}

/// Reference data of one scene (exact picture and exact transmittance), computed once, against which the errors of
/// all shadow methods are measured.
pub(super) struct Reference<'a> {
    job: &'a Job<'a>,
    facts: &'a Facts,
    field: &'a ExactField<'a>,
    visible: VisiblePointsByLight,
    random: MeanErrorSample,
    exact_picture: ExactPicture,
    /// Transmittance from the light through the strands as cylinders, if the volume was voxelised from strands.
    strands: Option<StrandReference>,
    /// Shadow map texels chosen for tests of their light rays, kept for all shadow maps with the same size and
    /// projection of the light.
    texels: Vec<(LightSpace, Vec<[u32; 2]>)>,
    shadow_references: ShadowReferences,
    /// Points and exact transmittances for the measurement of flicker, if that was asked for.
    flicker: Option<(VisiblePointsByLight, FlickerReference)>,
    bricks_ms: Option<f64>,
    tables_ms: Option<f64>,
    /// Time to compute the table of transfer function breakpoints for marching light rays (Hadwiger et al. 2006,
    /// 3.2), ms. Only some shadow methods need this table.
    march_table_ms: Option<f64>,
    /// Notes about the scene, to be added to the measurement of every shadow method.
    notes: Vec<String>,
}

/// Reference data of one scene (exact picture and exact transmittance), computed only when first needed.
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

    /// Returns the reference data of the scene (exact picture and exact transmittance), which the first call
    /// computes.
    pub fn get(&mut self, progress: &mut Progress) -> Result<&mut Reference<'a>> {
        let (job, facts, field) = (self.job, self.facts, self.field);
        let made = self.made.get_or_insert_with(|| Reference::new(job, facts, field, progress));
        made.as_mut().map_err(|e| e.clone())
    }

    /// Whether the reference data of the scene (exact picture and exact transmittance) have been computed.
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
        if visible.exact_error() > 0.0 {
            notes.push(format!(
                "the exact transmittance from lights with a size is a mean over up to 16,384 rays, with a standard error of \
                {:.1e} (root mean square over the points)",
                visible.exact_error()
            ));
        }
        let random = MeanErrorSample::new(field, job.scene, job.effort.points.min(MEAN_ERROR_POINTS));
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
            notes.push(format!(
                "image_ssim is left out: its window of {SSIM_WINDOW} pixels is larger than the exact picture"
            ));
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
        let flicker = match job.effort.flicker {
            0 => None,
            _ => {
                let points = visible.first(FLICKER_POINTS);
                let step = &mut || progress.check("exact transmittance while the light moves");
                let reference = FlickerReference::new(field, job, &points, step)?;
                Some((points, reference))
            }
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
            random,
            exact_picture,
            strands,
            texels: Vec::new(),
            shadow_references: ShadowReferences::default(),
            flicker,
            bricks_ms: median(bricks),
            tables_ms: median(tables),
            march_table_ms: median(march_tables),
            notes,
        })
    }

    /// Builds a method's shadow maps and renders a picture, which also warms up the graphics pipelines. Then measures
    /// the method's errors.
    // Long: each stage of the measurement reads the results of the stages before.
    pub fn measure(
        &mut self,
        method: &dyn Method,
        slug: &str,
        progress: &mut Progress,
    ) -> Result<(Measured, Array3<f32>)> {
        let (job, name) = (self.job, name_of(method));
        progress.begin(Step::new(StepKind::Draw, &name), &format!("{name}: building and drawing"))?;
        let needed = job.session.needs_shadows(job.scene);
        // A separate transfer function shows which tables the method needs.
        let transfer = job.session.fresh_transfer(job.tf)?;
        let Session { renderer, loaded, .. } = job.session;
        let build = || {
            // The exact picture is small and its sides are rounded, so that it may be slightly wider.
            let view = View::of_shadows(job.scene).map(|view| view.holding(&self.exact_picture.scene));
            renderer.shadows_in(loaded, &transfer, method, job.scene, view.as_ref())
        };
        let start = Instant::now();
        let shadows = build()?;
        let build_first_ms = start.elapsed().as_secs_f64() * 1e3;
        let marches = |map: &ShadowMap| map.lookup.as_ref().is_some_and(Lookup::marches_cells);
        let marched = transfer.march_table().is_some() || shadows.iter().any(marches);
        if marched {
            // Timed runs use the session's own tables, whose computation must not fall into the first run.
            job.session.transfer.make_march_table(renderer.gpu())?;
        }
        let march_table_ms = self.march_table_ms.filter(|_| marched).unwrap_or_default();
        progress.check(&format!("{name}: drawing"))?;
        let mut picture = renderer.render(loaded, &transfer, &shadows, job.scene)?;
        if picture.span.best().0 > SLOW_FRAME_MS {
            // Drivers may compile at the first use, which takes seconds on a busy machine.
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
            build_bytes: Some(report.build_bytes).filter(|bytes| *bytes > 0),
            enclosure_bytes: Some(report.enclosure_bytes).filter(|bytes| *bytes > 0),
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
        progress.check(&format!("{name}: counted work"))?;
        let (_, full_work) = kernels.counting_work(|| job.session.render(&shadows, job.scene))?;
        row.set_frame_divergence(full_work);
        let (_, build_work) = kernels.counting_work(|| job.session.shadows_of(method, job.scene))?;
        let pixels = u64::from(exact.scene.width) * u64::from(exact.scene.height);
        row.set_work((build_work, report.texels_built()), (picture_work, pixels));
        row.set_image_error(&image_error(drawn.pixels.view(), exact.pixels.view())?);
        row.image_ssim = ssim(drawn.pixels.view(), exact.pixels.view())?;
        row.image_exact_err = Some(exact.error);
        progress.begin(Step::new(StepKind::Errors, &name), &format!("{name}: errors"))?;
        let mut notes = self.notes.clone();
        // A shadow map that was not built has no errors of its own.
        if needed.is_ok() {
            if let Some(stats) = self.visible.errors(job.session, &shadows)? {
                row.set_point_errors(&stats);
            }
            let step = &mut || progress.check(&format!("{name}: bias and variance"));
            if let Some(error) = RandomError::of(method, job.session, job.scene, &self.visible, step)? {
                row.set_random_error(&error);
            }
            let drawn = (&shadows[..], picture.pixels.view());
            if let Some(error) = self.shadow_references.measure(job, &self.visible, drawn, progress)? {
                row.set_shadow_error(&error);
            }
            notes.extend(self.shadow_references.note());
            if let Some((points, reference)) = &self.flicker {
                let step = &mut || progress.check(&format!("{name}: flicker"));
                let Flicker { light_rms, camera_rms } =
                    reference.measure(method, job.session, points, step)?;
                [row.flicker_rms, row.flicker_camera_rms] = [light_rms, camera_rms];
            }
            let maps: Vec<&ShadowMap> = shadows.iter().collect();
            if job.scene.bounds_mean_error().is_ok() {
                let random = self.random.of(&maps, |map, points| job.session.query(map, points))?;
                row.image_mean_err_bound = Some(random.bound);
            }
            if let (Some(strands), [shadow]) = (&self.strands, &shadows[..]) {
                row.strand_err_rms = strands.rms(job.session, shadow)?;
            }
            progress.check(&format!("{name}: errors on light rays"))?;
            notes.extend(self.measure_rays(method, &shadows, &mut row)?);
            notes.extend(self.point_checks().enclosures(method, &self.visible, &shadows, &mut row)?);
            progress.check(&format!("{name}: certified picture"))?;
            self.measure_certified(&maps, &transfer, &mut row)?;
            let mut checked = None;
            for (source, shadow) in job.scene.shining().iter().zip(&shadows) {
                let own = check(job.session, method, shadow, &job.scene.under(source.clone()))?;
                checked = checked.zip(own).map_or(checked.or(own), |(a, b): (Check, Check)| Some(a.merge(b)));
            }
            if let Some(check) = checked {
                row.set_check(&check);
            }
        }
        let measured = Measured { row, slug: slug.into(), left_out, notes, frame_ms: picture.span.best().0 };
        Ok((measured, picture.pixels))
    }

    /// Creates a comparison table row for a shadow method, without measured values.
    pub fn row(&self, method: &dyn Method) -> Row {
        self.facts.row(&self.job.scene_name, [self.job.scene.width, self.job.scene.height], method)
    }

    /// Measures a shadow method with tried settings: memory, times where a time budget is given, and errors where
    /// some budget is satisfied.
    pub fn try_setting(&self, method: &dyn Method, budgets: &[Budget], trial: &mut Row) -> Result<()> {
        let job = self.job;
        let shadows = job.session.shadows_of(method, job.scene)?;
        trial.bytes = Some(BuildReport::of_all(&shadows).bytes);
        let drawn = job.session.render(&shadows, &self.exact_picture.scene)?;
        set_trial_times(job, (method, job.scene), budgets, trial)?;
        if budgets.iter().any(|b| b.holds(trial)) {
            trial.point_err_rms = self.visible.errors(job.session, &shadows)?.map(|stats| stats.rms);
            trial.image_rmse = Some(image_error(drawn.pixels.view(), self.exact_picture.pixels.view())?.rmse);
        }
        Ok(())
    }

    /// Measures the transmittance errors along light rays in the shadow maps (one per light, in order), and writes
    /// them to the comparison table row. Returns a note for each violated error bound.
    fn measure_rays(
        &mut self,
        method: &dyn Method,
        shadows: &[ShadowMap],
        row: &mut Row,
    ) -> Result<Vec<String>> {
        // Curves along light rays are those of lights without a size.
        if mapped_lights(method, self.job.scene).iter().any(LightSource::is_soft) {
            return Ok(Vec::new());
        }
        let (mut all, mut points, mut notes) = (BoundReport::default(), PointReport::default(), Vec::new());
        for (source, shadow) in self.job.scene.shining().iter().zip(shadows) {
            // All lights together get as many rays as a single light would.
            let count = self.job.effort.rays.div_ceil(shadows.len());
            let (report, note) = self.measure_rays_of(method, (source.light, shadow), count)?;
            all = all.merge(report);
            notes.extend(note);
            points = points.merge(self.point_checks().of(method, (source.light, shadow), shadows.len())?);
        }
        let bound = Bound::of_all(shadows.iter().map(|map| map.bound));
        row.set_ray_errors(&all, bound);
        row.set_point_bound(&points, bound);
        notes.extend(points.note(&format!("{}: the bound", name_of(method))));
        Ok(notes)
    }

    /// Draws the certified picture of shadow maps with enclosures, and writes the bounds on its errors to the comparison
    /// table row.
    fn measure_certified(
        &self,
        shadows: &[&ShadowMap],
        transfer: &DeviceTransfer,
        row: &mut Row,
    ) -> Result<()> {
        let ExactPicture { scene, pixels, .. } = &self.exact_picture;
        let enclosed = !shadows.is_empty() && shadows.iter().all(|map| map.enclosure.is_some());
        if certified::check(scene).is_err() || !enclosed {
            return Ok(());
        }
        let Session { renderer, loaded, .. } = self.job.session;
        let certified = CertifiedScene { renderer, loaded, transfer, shadows, field: self.field };
        row.set_certified(&certified.render(scene, DEFAULT_ETA, &|_| Ok(()))?, pixels);
        Ok(())
    }

    fn point_checks(&self) -> PointChecks<'_> {
        PointChecks { job: self.job, field: self.field }
    }

    /// Measures the transmittance errors along `count` light rays in the shadow map of one light.
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
            let texels = match job.effort.check == Checked::All {
                true => all.filter(covered).collect(),
                false => texels_to_test(field, light, space, count),
            };
            self.texels.push((space.clone(), texels));
            self.texels.len() - 1
        });
        let texels = &self.texels[known].1;
        let nodes = match job.effort.check == Checked::All {
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
