//! Compares shadow methods on scenes: measures each method, then writes tables, plots, pictures and the HTML report.
//! The command line, the window and Python call it; [`merge`](super::merge) starts from finished measurements.

mod files;
mod page;

use super::budgets::write_budgets;
pub use super::made::{Made, ReferencePicture};
use super::run::Run;
use super::tables::{Layout, write_tables};
use crate::error::Result;
use crate::files::input::source_name;
use crate::measure::ablate;
use crate::measure::budget::Budget;
use crate::measure::compare::{compare_within, steps};
use crate::measure::comparison::{Compared, Comparison, take_differences};
use crate::measure::facts::Facts;
use crate::measure::job::Job;
use crate::measure::journal::Journal;
use crate::measure::progress::Progress;
use crate::render::{DisabledOptimizations, Renderer, Session};
use crate::scene::Scene;
use crate::shadow::{Method, NodeMap, ShadowRays};
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
pub(super) use files::node_map;
use files::{write_ablations, write_pictures, write_scene_plots};
use page::{program_conditions, scene_conditions, write_page};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Shadow methods to measure on each scene of a comparison, and budgets for which their settings are tuned.
pub struct Order<'a> {
    /// Shadow methods to measure on each scene, one row of the comparison table each. A scene without methods is not
    /// read.
    pub methods: &'a [Vec<Box<dyn Method>>],
    /// Memory and time budgets within which the settings of each shadow method are tuned; each budget adds rows to
    /// the comparison table.
    pub budgets: &'a [Budget],
    /// Note for the reader on how the rows of the comparison table are timed; may be empty.
    pub remark: &'a str,
}

/// Input of one scene of a comparison: volume, transfer function, camera and lights.
#[derive(Debug, Clone)]
pub struct Subject {
    /// Voxel grid (volume) that is rendered in the scene.
    pub volume: Arc<Volume>,
    /// Transfer function that maps voxel values to colour and extinction.
    pub tf: TransferFunction,
    /// Strands (curves such as hair or fibres) that were converted to the voxels of the volume, if any.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Camera, lights, picture size and other picture settings of the scene.
    pub scene: Scene,
    /// Optimizations of the renderer to disable, so that their effect can be measured.
    pub forced: DisabledOptimizations,
}

/// Paths of the files that a comparison of shadow methods has written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Files {
    /// Paths of the comparison tables `compare.csv`, `compare.json`, `compare.md` and `compare.tex`, and of
    /// `columns.md`.
    pub tables: Vec<PathBuf>,
    /// Paths of the plots of the shadow methods' error against time and against memory.
    pub plots: Vec<PathBuf>,
    /// Paths of the shadow methods' pictures, of their difference images, and of the figures of all pictures side by
    /// side.
    pub pictures: Vec<PathBuf>,
    /// Path of the HTML report `report.html`.
    pub report: PathBuf,
    /// Paths of the ablation tables (cost of each optimization); empty unless an ablation was requested.
    pub ablations: Vec<PathBuf>,
    /// Paths of `budgets.csv` (ranking of shadow methods within each budget) and `trials.csv` (settings that the
    /// search tried); empty without budgets.
    pub budgets: Vec<PathBuf>,
    /// Remarks on result files that differ from the request, such as columns that do not fit into the LaTeX table.
    pub remarks: Vec<String>,
}

/// Measures every shadow method on every scene of a comparison; each scene is read just before its measurement. If
/// the graphics device cannot hold one of several scenes, the rows of this scene are marked as failed.
///
/// # Errors
/// A scene cannot be read, the device cannot hold the only scene, the journal cannot be written, or the user
/// cancelled the comparison. The journal then contains the rows measured so far.
pub fn make(
    order: &Order,
    run: &Run,
    read: &mut dyn FnMut(usize) -> Result<Subject>,
    renderer: &Arc<Renderer>,
    journal: &mut Journal,
    progress: &mut Progress,
) -> Result<Made> {
    let effort = run.effort;
    for methods in order.methods.iter().filter(|m| !m.is_empty()) {
        steps(methods, &effort).into_iter().for_each(|(step, times)| progress.expect(step, times));
        let ablated = methods.iter().filter(|_| run.ablate);
        ablated.for_each(|method| progress.expect(ablate::step(method.as_ref()), 1));
    }
    let mut made = Made { run: run.clone(), ablations: run.ablate.then(Vec::new), ..Made::default() };
    for (i, (name, methods)) in run.scene_names().into_iter().zip(order.methods).enumerate() {
        if methods.is_empty() {
            continue;
        }
        let Subject { volume, tf, strands, scene, forced } = read(i)?;
        let (mut rows, first) = (methods.len(), made.comparison.compared.len());
        journal.describe(run.picture_texts(i));
        match Session::on(renderer, Arc::clone(&volume), &tf, forced) {
            Ok(session) => {
                let session = session.with_strands(strands.clone());
                let job = Job {
                    strands: strands.as_deref().map(|of| &of.strands),
                    file_prefix: run.prefix(i),
                    remark: order.remark.to_owned(),
                    ..Job::new(&session, (&volume, &tf), &scene, &name, effort)
                };
                rows = made.add(&job, order.budgets, methods, journal, progress)?;
            }
            Err(error) if run.scenes.len() == 1 => return Err(error),
            Err(error) => {
                steps(methods, &effort).iter().for_each(|(step, times)| progress.spare(step, *times));
                let facts = Facts::of(renderer.gpu());
                let failed = Comparison::failed(&facts, &name, [scene.width, scene.height], methods, &error);
                made.comparison.append(failed);
            }
        }
        let lights = scene.lights_shining();
        for compared in &mut made.comparison.compared[first..] {
            (compared.row.lights, compared.row.light) = (Some(lights), run.scenes[i].light);
        }
        progress.next_scene(rows);
    }
    Ok(made)
}

impl Made {
    /// Measures the shadow methods on one scene and returns the number of new table rows, tuned settings included. It
    /// also counts the curve nodes of deep shadow maps and draws the reference picture if it is missing. If one of
    /// these two steps fails, the comparison gets a note.
    fn add(
        &mut self,
        job: &Job,
        budgets: &[Budget],
        methods: &[Box<dyn Method>],
        journal: &mut Journal,
        progress: &mut Progress,
    ) -> Result<usize> {
        let several = self.run.scenes.len() > 1;
        let prefix = if several { format!("{}: ", job.scene_name) } else { String::new() };
        if self.run.conditions.is_empty() {
            self.run.conditions = program_conditions(job);
        }
        self.run
            .conditions
            .extend(scene_conditions(job).map(|(name, value)| (format!("{prefix}{name}"), value)));
        let mut all = compare_within(job, methods, budgets, journal, progress)?;
        if several {
            all.name_scene(&job.scene_name);
        }
        if !all.compared.iter().any(|c| c.is_reference() && c.picture.is_some()) {
            progress.check("reference picture")?;
            match reference(job) {
                Ok(reference) => {
                    take_differences(&mut all.compared, &reference.pixels)?;
                    self.references.push(reference);
                }
                Err(e) => all.notes.push(format!("{prefix}differences are left out: {e}")),
            }
        }
        for (method, c) in methods.iter().chain(&all.tuned).zip(&mut all.compared) {
            progress.check("nodes")?;
            c.nodes = nodes(job, method.as_ref(), c).unwrap_or_else(|e| {
                all.notes.push(format!("{}: nodes are not shown: {e}", c.row.spec()));
                None
            });
        }
        let rows = all.compared.len();
        self.comparison.append(all);
        if let Some(ablations) = &mut self.ablations {
            ablations.append(&mut ablate::ablate(job, methods, progress)?);
        }
        Ok(rows)
    }

    /// Writes all result files of a comparison into an existing folder; each file appears only when it is complete.
    /// The run description `run.json` is written last and marks the folder as finished.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(mut self, folder: &Path, layout: &Layout) -> Result<Files> {
        self.record_rows();
        // Written before any result file, so that all files of an interrupted run can be removed.
        self.run.write(folder)?;
        let rows = self.comparison.rows();
        let (tables, remarks) = write_tables(&rows, folder, &self.run, layout)?;
        let files = Files {
            tables,
            plots: write_scene_plots(&rows, &self.run, folder)?,
            pictures: write_pictures(&self, folder, layout)?,
            report: write_page(&self, folder, layout.difference_max)?,
            budgets: write_budgets(&rows, &self.comparison.trials, folder)?,
            ablations: self
                .ablations
                .as_ref()
                .map_or_else(|| Ok(Vec::new()), |rows| write_ablations(rows, folder))?,
            remarks,
        };
        self.run.notes = self.comparison.notes;
        self.run.finished = true;
        self.run.write(folder)?;
        Ok(files)
    }
}

/// Renders the reference picture of a scene with one shadow ray per sample.
fn reference(job: &Job) -> Result<ReferencePicture> {
    let shadows = job.session.shadows_of(&ShadowRays::default(), job.scene)?;
    let pixels = job.session.render(&shadows, job.scene)?.pixels;
    let adapter = job.session.renderer.gpu().info.name.clone();
    Ok(ReferencePicture { scene: job.scene_name.clone(), adapter, pixels })
}

/// Counts the curve nodes in each texel of a deep shadow map. Returns `None` for other shadow maps and for scenes
/// with several lights.
fn nodes(job: &Job, method: &dyn Method, compared: &Compared) -> Result<Option<NodeMap>> {
    match &job.scene.shining()[..] {
        [source] if compared.row.nodes_total.is_some() => {
            let shadow = job.session.shadow_of(method, job.scene, source.light)?;
            job.session.node_map(&shadow)
        }
        _ => Ok(None),
    }
}

/// Short scene name from volume and transfer function, for example `CT_AVM, CT bone`.
pub fn scene_name(volume: &Volume, tf: &TransferFunction) -> String {
    let source = &volume.provenance.source;
    let file = source_name(source);
    let stem = file.strip_suffix(".gz").unwrap_or(file);
    let stem = [".nii", ".hdr", ".img", ".raw"].iter().find_map(|e| stem.strip_suffix(e)).unwrap_or(stem);
    let volume = stem.strip_prefix("phantom:").unwrap_or(stem);
    format!("{volume}, {}", tf.name)
}
