//! Ablation study of the renderer's optimizations: times and memory with each optimization disabled, beside those
//! with it enabled.

use super::job::{Job, SLOW_FRAME_MS, name_of};
use super::progress::{Progress, Step, StepKind};
use super::stats::image_difference;
use super::timing::{StageTimes, Timing, Turns, clock_name, interleave};
use crate::error::{Error, Result};
use crate::render::{DisabledOptimizations, Omission, Optimization, Picture, View};
use crate::shadow::{BuildReport, Method};
use serde::Serialize;
use std::time::Instant;

/// Row of the ablation table: one shadow method with one renderer optimization disabled and enabled. Times are
/// medians of interleaved rounds.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Ablation {
    /// Name of the scene: volume and transfer function, or the scene file.
    pub scene: String,
    /// Name of the graphics adapter on which the times were measured.
    pub adapter: String,
    /// Clock (GPU timestamps or the host's clock) that measured the shadow map's build time and the frame time. Times
    /// of transfer function tables are always from the host's clock.
    pub clock: Option<&'static str>,
    /// Name of the shadow method.
    pub method: String,
    /// Settings of the shadow method as `key=value` texts separated by spaces.
    pub params: String,
    /// Name of the renderer optimization that was disabled, as the option `--no-skip` takes it.
    pub omission: String,
    /// Rendering work, such as computing gradients, that the renderer optimization avoids.
    pub what: String,
    /// Reason why the scene does not need the rendering work that the optimization avoids.
    pub why: String,
    /// Time to compute the transfer function's lookup tables and to classify the volume's bricks, with the tested
    /// renderer optimization enabled, ms.
    pub tables_ms: Option<f64>,
    /// Time to compute the transfer function's lookup tables and to classify the volume's bricks, with the tested
    /// renderer optimization disabled, ms.
    pub tables_ms_forced: Option<f64>,
    /// Time to build the shadow map with the tested renderer optimization enabled, ms.
    pub build_ms: Option<f64>,
    /// Time to build the shadow map with the tested renderer optimization disabled, ms.
    pub build_ms_forced: Option<f64>,
    /// Time to render one picture from a finished shadow map with the tested renderer optimization enabled, ms.
    pub frame_ms: Option<f64>,
    /// Time to render one picture from a finished shadow map with the tested renderer optimization disabled, ms.
    pub frame_ms_forced: Option<f64>,
    /// Memory of the shadow map and its build, transfer function tables and brick classes with the tested renderer
    /// optimization enabled, bytes.
    pub bytes: Option<u64>,
    /// Memory of the shadow map and its build, transfer function tables and brick classes with the tested renderer
    /// optimization disabled, bytes.
    pub bytes_forced: Option<u64>,
    /// Largest difference in any colour channel between two pictures: one with the tested renderer optimization
    /// enabled, one with it disabled.
    pub picture_difference: Option<f64>,
    /// Explanation of empty values in this row of the ablation table, such as an error message.
    pub note: String,
}

/// Times, memory and picture of one run of a shadow method with a given set of disabled optimizations.
struct Run {
    times: StageTimes,
    bytes: u64,
    picture: Picture,
}

/// Measures the effect of each renderer optimization on times, memory and picture, for every shadow method. A failure
/// becomes a row of the ablation table with the error in its `note`. A method that fails with all optimizations
/// enabled gets one such row.
///
/// # Errors
/// The user cancelled the measurement.
pub fn ablate(job: &Job, methods: &[Box<dyn Method>], progress: &mut Progress) -> Result<Vec<Ablation>> {
    let mut rows = Vec::new();
    for method in methods {
        let method = method.as_ref();
        progress.begin(step(method), &format!("{}: ablation", name_of(method)))?;
        match one_method(job, method) {
            Ok(mut more) => rows.append(&mut more),
            Err(e) => rows.push(Ablation { note: e.to_string(), ..Ablation::of(job, method) }),
        }
    }
    progress.end();
    Ok(rows)
}

/// Returns the step of the progress display for the ablation study of one shadow method.
pub fn step(method: &dyn Method) -> Step {
    Step::new(StepKind::Ablation, &name_of(method))
}

impl Ablation {
    /// Creates a row of the ablation table without measured values.
    fn of(job: &Job, method: &dyn Method) -> Self {
        Self {
            scene: job.scene_name.clone(),
            adapter: job.session.renderer.gpu().info.name.clone(),
            method: method.name().into(),
            params: method.params(),
            ..Self::default()
        }
    }
}

fn one_method(job: &Job, method: &dyn Method) -> Result<Vec<Ablation>> {
    let base = job.session.transfer.disabled;
    let lean = run(job, method, base)?;
    let omissions: Vec<(Optimization, Omission)> =
        lean.picture.plan.left_out.iter().filter_map(|o| Some((o.optional?, o.clone()))).collect();
    let variants: Vec<DisabledOptimizations> = [base]
        .into_iter()
        .chain(omissions.iter().map(|(optional, _)| base.and(DisabledOptimizations::only(*optional))))
        .collect();
    // The first run of each variant warms up its pipelines; it also supplies the picture and the memory.
    let rounds = if lean.times.frame.best().0 > SLOW_FRAME_MS { 1 } else { job.effort.repeats };
    let first: Vec<Result<Run>> = variants[1..].iter().map(|v| run(job, method, *v)).collect();
    let mut turns: Vec<Turns> = variants
        .iter()
        .map(|variant| Turns { run: Box::new(|| Ok(run(job, method, *variant)?.times)), warmup: 0, rounds })
        .collect();
    let timings = interleave(&mut turns, &|| job.keep_busy(), &mut |_| Ok(()))?;
    let mut timings = timings.into_iter().map(|t| Timing::of(&t?));
    let none = || Err(Error::runtime("cannot time", name_of(method), "no run was counted"));
    let own = timings.next().unwrap_or_else(none)?;
    let rows = omissions.iter().zip(first).zip(timings).map(|(((optional, omission), first), forced)| {
        let mut row = Ablation {
            clock: Some(clock_name(own.clock)),
            omission: optional.to_string(),
            what: omission.what.clone(),
            why: omission.why.clone(),
            tables_ms: own.tables_ms,
            build_ms: Some(own.build_ms.median),
            frame_ms: Some(own.frame_ms.median),
            bytes: Some(lean.bytes),
            ..Ablation::of(job, method)
        };
        let measured = first.and_then(|run| {
            let off = image_difference(run.picture.pixels.view(), lean.picture.pixels.view())?;
            row.picture_difference = Some(off.iter().fold(0.0, |most, d| f64::from(*d).max(most)));
            row.bytes_forced = Some(run.bytes);
            forced
        });
        match measured {
            Ok(timing) => {
                row.tables_ms_forced = timing.tables_ms;
                row.build_ms_forced = Some(timing.build_ms.median);
                row.frame_ms_forced = Some(timing.frame_ms.median);
            }
            Err(e) => row.note = e.to_string(),
        }
        row
    });
    Ok(rows.collect())
}

/// Computes the transfer function's tables and brick classes, the shadow maps and one picture from a volume that is
/// already on the graphics device, and measures all of these.
fn run(job: &Job, method: &dyn Method, forced: DisabledOptimizations) -> Result<Run> {
    let (renderer, loaded) = (&job.session.renderer, &job.session.loaded);
    let transfer = renderer.transfer(loaded, job.tf, forced)?;
    let start = Instant::now();
    let view = View::of_shadows(job.scene);
    let shadows = renderer.shadows_in(loaded, &transfer, method, job.scene, view.as_ref())?;
    let build_wall_ms = start.elapsed().as_secs_f64() * 1e3;
    let picture = renderer.render(loaded, &transfer, &shadows, job.scene)?;
    let march = transfer.march_table();
    let report = BuildReport::of_all(&shadows);
    Ok(Run {
        times: StageTimes {
            tables_ms: Some(transfer.table_ms + transfer.classify_ms + march.map_or(0.0, |t| t.table_ms)),
            build_host_ms: report.host_ms,
            build_device: report.device,
            build_wall_ms,
            frame: picture.span,
            frame_host_ms: picture.host_ms,
            gpu_mhz: None,
            unsteady: false,
        },
        bytes: report.bytes + report.build_bytes + transfer.bytes + march.map_or(0, |t| t.bytes),
        picture,
    })
}
