//! Comparison of methods on scenes: measurement, then tables, plots, pictures and the report in a folder. The command line,
//! the window and Python use it; [`merge`](super::merge) starts from measured rows.

mod files;
mod page;

use super::budgets::write_budgets;
pub use super::made::{Made, ReferencePicture};
use super::run::Run;
use super::tables::{Layout, write_tables};
use crate::error::Result;
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

/// Methods and budgets to measure on every scene.
pub struct Order<'a> {
    /// A row each, scene by scene. A scene that has none is not even read.
    pub methods: &'a [Vec<Box<dyn Method>>],
    /// Budgets within which each method's settings are tuned, for further rows.
    pub budgets: &'a [Budget],
    /// Remark on how rows are timed; may be empty.
    pub remark: &'a str,
}

/// Volume, transfer function and scene that a scene's rows are measured on.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The voxels.
    pub volume: Arc<Volume>,
    /// Transfer function applied to the voxels.
    pub tf: TransferFunction,
    /// Strands that the volume was voxelised from, if any.
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Camera, lights, and size of the picture.
    pub scene: Scene,
    /// Disabled optimizations: work done although the scene does not need it.
    pub forced: DisabledOptimizations,
}

/// The files of a comparison.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Files {
    /// `compare.csv` and its like, and `columns.md`.
    pub tables: Vec<PathBuf>,
    /// Error against time and memory.
    pub plots: Vec<PathBuf>,
    /// Pictures and difference images of each row, and grids of all pictures side by side.
    pub pictures: Vec<PathBuf>,
    /// `report.html`.
    pub report: PathBuf,
    /// Tables of the ablation; empty unless it was requested.
    pub ablations: Vec<PathBuf>,
    /// Tables of the trials within budgets and of the most accurate method in each; empty without budgets.
    pub budgets: Vec<PathBuf>,
    /// Remarks on output that could not be written as requested.
    pub remarks: Vec<String>,
}

/// Measures every method on every scene of `run`, each read when its turn comes. A scene among several that the device
/// cannot hold is failed rows.
///
/// # Errors
/// A scene that cannot be read, a single one that the device cannot hold, a journal that cannot be written to, or it was
/// ended on request; what is measured is in the journal then.
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
    /// Measures a scene, and what is shown of it beyond its rows: nodes, counted on maps built once more outside all
    /// timing, and where no row is `rays` a picture by it to show differences from. What fails of these is a note. Gives
    /// how many rows there are: those of `methods`, and what searches within budgets chose besides.
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

    /// Writes `compare.csv` and all the other files into a folder that exists, each whole or not at all, and last the
    /// record that says so.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(mut self, folder: &Path, layout: &Layout) -> Result<Files> {
        self.record_rows();
        // Before any of them is there: a run that is ended here can be removed whole.
        self.run.write(folder)?;
        let rows = self.comparison.rows();
        let (tables, remarks) = write_tables(&rows, folder, &self.run, layout)?;
        let files = Files {
            tables,
            plots: write_scene_plots(&rows, &self.run, folder)?,
            pictures: write_pictures(&self, folder, layout.tex_width_pt)?,
            report: write_page(&self, folder)?,
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

/// The picture by a shadow ray per sample.
fn reference(job: &Job) -> Result<ReferencePicture> {
    let shadows = job.session.shadows_of(&ShadowRays::default(), job.scene)?;
    let pixels = job.session.render(&shadows, job.scene)?.pixels;
    let adapter = job.session.renderer.gpu().info.name.clone();
    Ok(ReferencePicture { scene: job.scene_name.clone(), adapter, pixels })
}

/// Node map of a row's structure; `None` without nodes or with several lights.
fn nodes(job: &Job, method: &dyn Method, compared: &Compared) -> Result<Option<NodeMap>> {
    match job.scene.shining()[..] {
        [source] if compared.row.nodes_total.is_some() => {
            let shadow = job.session.shadow_of(method, job.scene, source.light)?;
            job.session.node_map(&shadow)
        }
        _ => Ok(None),
    }
}

/// Volume and transfer function in a few words: `CT_AVM, CT bone`.
pub fn scene_name(volume: &Volume, tf: &TransferFunction) -> String {
    let source = &volume.provenance.source;
    let file = source.rsplit(['/', '\\']).next().unwrap_or(source);
    let stem = file.strip_suffix(".gz").unwrap_or(file);
    let stem = [".nii", ".hdr", ".img", ".raw"].iter().find_map(|e| stem.strip_suffix(e)).unwrap_or(stem);
    let volume = stem.strip_prefix("phantom:").unwrap_or(stem);
    format!("{volume}, {}", tf.name)
}
