//! From methods, scenes and a folder to every file of a comparison: tables, plots, pictures, the report and the journal.
//! The command line and the window both come this way.

mod files;
mod page;

use super::budgets::write_budgets;
use super::tables::write_tables;
use crate::error::Result;
use crate::measure::ablate::{self, Ablation};
use crate::measure::budget::Budget;
use crate::measure::compare::{compare_within, steps};
use crate::measure::comparison::Comparison;
use crate::measure::facts::Facts;
use crate::measure::job::{Effort, Job, file_name_part};
use crate::measure::journal::Journal;
use crate::measure::progress::Progress;
use crate::render::{Forced, Renderer, Session};
use crate::scene::Scene;
use crate::shadow::Method;
use crate::strands::Strands;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use files::{write_ablations, write_pictures, write_scene_plots};
use page::Page;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What is measured on every scene.
pub struct Order<'a> {
    /// A row each.
    pub methods: &'a [Box<dyn Method>],
    /// How much to measure.
    pub effort: Effort,
    /// Measure as well what each omission of the plan is worth.
    pub ablate: bool,
    /// What the settings of each method are searched within, for further rows.
    pub budgets: &'a [Budget],
    /// What a reader should know of how rows are timed; may be empty.
    pub remark: &'a str,
}

/// What a scene's rows are of.
pub struct Subject {
    /// The voxels.
    pub volume: Arc<Volume>,
    /// What is seen of them.
    pub tf: TransferFunction,
    /// What the volume was made from, where that is strands.
    pub strands: Option<Strands>,
    /// Camera, light, and size of the picture.
    pub scene: Scene,
    /// What is done although the scene does not need it.
    pub forced: Forced,
}

/// A comparison of which everything is measured and nothing written but the journal.
pub struct Made {
    /// Rows, pictures, notes and failures of all scenes.
    pub comparison: Comparison,
    ablations: Option<Vec<Ablation>>,
    names: Vec<String>,
    page: Page,
}

/// The files of a comparison.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Files {
    /// `compare.csv` and its like, and `columns.md`.
    pub tables: Vec<PathBuf>,
    /// Error against time and memory.
    pub plots: Vec<PathBuf>,
    /// Of each row, with where they differ, and `pictures.md`.
    pub pictures: Vec<PathBuf>,
    /// `report.html`.
    pub report: PathBuf,
    /// Empty unless they were asked for.
    pub ablations: Vec<PathBuf>,
    /// What was tried within budgets, and which method is closest within each; empty unless there are any.
    pub budgets: Vec<PathBuf>,
}

/// Measures every method on every scene, `names` being theirs, each read when its turn comes. A scene among several that
/// the device cannot hold is failed rows.
///
/// # Errors
/// A scene that cannot be read, a single one that the device cannot hold, a journal that cannot be written to, or it was
/// ended on request; what is measured is in the journal then.
pub fn make(
    order: &Order,
    names: &[String],
    read: &mut dyn FnMut(usize) -> Result<Subject>,
    renderer: &Arc<Renderer>,
    journal: &mut Journal,
    progress: &mut Progress,
) -> Result<Made> {
    let Order { methods, effort, budgets, .. } = *order;
    let several = names.len() > 1;
    for (step, times) in names.iter().flat_map(|_| steps(methods, &effort)) {
        progress.expect(step, times);
    }
    let ablated = names.iter().filter(|_| order.ablate).flat_map(|_| methods);
    ablated.for_each(|method| progress.expect(ablate::step(method.as_ref()), 1));
    let (mut all, mut ablations) = (Comparison::default(), order.ablate.then(Vec::new));
    let mut page = Page::of(names.len());
    for (i, name) in names.iter().enumerate() {
        let Subject { volume, tf, strands, scene, forced } = read(i)?;
        let mut rows = methods.len();
        match Session::on(renderer, Arc::clone(&volume), &tf, forced) {
            Ok(session) => {
                let job = Job {
                    session: &session,
                    volume: &volume,
                    tf: &tf,
                    strands: strands.as_ref(),
                    scene: &scene,
                    scene_name: name.clone(),
                    file_prefix: if several { format!("{}_", file_name_part(name)) } else { String::new() },
                    remark: order.remark.to_owned(),
                    effort,
                };
                let mut compared = compare_within(&job, methods, budgets, journal, progress)?;
                if several {
                    compared.name_scene(name);
                }
                rows = compared.compared.len();
                let measured: Vec<_> = methods.iter().chain(&compared.tuned).map(Box::as_ref).collect();
                page.add(&job, &measured, &compared.compared, progress)?;
                all.append(compared);
                if let Some(ablations) = &mut ablations {
                    ablations.append(&mut ablate::ablate(&job, methods, progress)?);
                }
            }
            Err(error) if !several => return Err(error),
            Err(error) => {
                steps(methods, &effort).iter().for_each(|(step, times)| progress.spare(step, *times));
                let facts = Facts::of(renderer.gpu());
                let failed = Comparison::failed(&facts, name, [scene.width, scene.height], methods, &error);
                page.add_rows(&failed.rows());
                all.append(failed);
            }
        }
        progress.next_scene(rows);
    }
    Ok(Made { comparison: all, ablations, names: names.to_vec(), page })
}

impl Made {
    /// Writes `compare.csv` and all the other files into a folder that exists, each whole or not at all.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(self, folder: &Path) -> Result<Files> {
        let rows = self.comparison.rows();
        Ok(Files {
            tables: write_tables(&rows, folder, "compare")?,
            plots: write_scene_plots(&rows, &self.names, folder)?,
            pictures: write_pictures(&self.comparison.compared, folder)?,
            report: self.page.write(&self.comparison, folder)?,
            budgets: write_budgets(&rows, &self.comparison.trials, folder)?,
            ablations: self
                .ablations
                .map_or_else(|| Ok(Vec::new()), |rows| write_ablations(&rows, folder))?,
        })
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
