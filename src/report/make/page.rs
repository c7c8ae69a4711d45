//! `report.html`: what the report needs beyond the rows.

use super::super::heat::{heat_map_png, round_max};
use super::super::html::{Conditions, Pictured, write_report};
use crate::error::Result;
use crate::files::picture::picture_png;
use crate::measure::comparison::{Compared, Comparison};
use crate::measure::facts::REVISION;
use crate::measure::job::Job;
use crate::measure::progress::Progress;
use crate::measure::stats::image_difference;
use crate::measure::table::Row;
use crate::shadow::{Method, NodeMap, ShadowRays};
use ndarray::{Array2, Array3};
use std::path::{Path, PathBuf};

const ERROR_LABEL: &str = "|difference| from rays, linear RGBA";

/// The report, gathered scene by scene while each is on the device.
pub struct Page {
    /// Facts are said of each scene by name where there are several.
    several: bool,
    facts: Vec<(String, String)>,
    pictured: Vec<Pictured>,
    notes: Vec<String>,
    scenes: Vec<String>,
}

impl Page {
    /// A report of so many scenes.
    pub fn of(scenes: usize) -> Self {
        let (facts, pictured, notes) = Default::default();
        Self { several: scenes > 1, facts, pictured, notes, scenes: Vec::new() }
    }

    /// Adds a scene.
    ///
    /// Nodes are counted on maps built once more, outside all timing. Where no row is `rays`, a picture by it is drawn to
    /// show errors against. What of this fails is a note in the report.
    ///
    /// # Errors
    /// A picture that cannot be encoded, or it was ended on request.
    pub fn add(
        &mut self,
        job: &Job,
        methods: &[&dyn Method],
        compared: &[Compared],
        progress: &Progress,
    ) -> Result<()> {
        if self.facts.is_empty() {
            self.facts = program_facts(job);
        }
        let prefix = if self.several { format!("{}: ", job.scene_name) } else { String::new() };
        self.facts.extend(scene_facts(job).into_iter().map(|(name, value)| (prefix.clone() + name, value)));
        self.scenes.push(job.scene_name.clone());
        let has_rays =
            compared.iter().any(|c| c.row.method == ShadowRays::default().name() && c.picture.is_some());
        let reference = match has_rays {
            true => None,
            false => reference(job)
                .inspect_err(|e| self.notes.push(format!("{prefix}error pictures are left out: {e}")))
                .ok(),
        };
        for (method, c) in methods.iter().zip(compared) {
            progress.check("report")?;
            let difference = match (&c.difference, &reference, &c.picture) {
                (None, Some(reference), Some(picture)) => {
                    Some(image_difference(picture.view(), reference.view())?)
                }
                (own, ..) => own.clone(),
            };
            let nodes = nodes(job, *method, &c.row).unwrap_or_else(|e| {
                self.notes.push(format!("{}: nodes are not shown: {e}", c.slug));
                None
            });
            self.pictured.push(Pictured {
                row: c.row.clone(),
                picture_png: c.picture.as_ref().map(picture_png).transpose()?,
                error_png: difference.as_ref().map(error_png).transpose()?,
                nodes,
            });
        }
        Ok(())
    }

    /// Adds rows of which there is nothing to show.
    pub fn add_rows(&mut self, rows: &[Row]) {
        self.pictured.extend(rows.iter().map(|row| Pictured { row: row.clone(), ..Pictured::default() }));
    }

    /// Writes the report into a folder and gives its path.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(mut self, comparison: &Comparison, folder: &Path) -> Result<PathBuf> {
        let mut notes = comparison.notes.clone();
        notes.extend(comparison.failures.iter().map(|(name, e)| format!("{name} failed: {e}")));
        notes.append(&mut self.notes);
        let conditions = Conditions {
            title: format!("Shadow methods: {}", self.scenes.join("; ")),
            facts: self.facts,
            error_caption: "largest difference of any channel from the picture by rays".into(),
            notes,
        };
        let path = folder.join("report.html");
        write_report(&conditions, &self.pictured, &path)?;
        Ok(path)
    }
}

fn error_png(difference: &Array2<f32>) -> Result<Vec<u8>> {
    heat_map_png(difference, round_max(difference), ERROR_LABEL)
}

/// The picture by a shadow ray per sample.
fn reference(job: &Job) -> Result<Array3<f32>> {
    let shadow = job.session.shadow(&ShadowRays::default(), job.scene.light)?;
    Ok(job.session.render(&shadow, job.scene)?.pixels)
}

/// The nodes of a row's structure, where it has any.
fn nodes(job: &Job, method: &dyn Method, row: &Row) -> Result<Option<NodeMap>> {
    if row.nodes_total.is_none() {
        return Ok(None);
    }
    let shadow = job.session.shadow(method, job.scene.light)?;
    job.session.node_map(&shadow)
}

/// What the table was made with.
fn program_facts(job: &Job) -> Vec<(String, String)> {
    let effort = job.effort;
    let info = &job.session.renderer.gpu().info;
    let driver = [info.driver.as_str(), &info.driver_info].join(" ");
    let facts = [
        ("adapter", format!("{} ({:?}; {})", info.name, info.backend, driver.trim())),
        ("host threads", rayon::current_num_threads().to_string()),
        ("times", format!("median of {} after a warm-up, methods in turn; slow ones once", effort.repeats)),
        (
            "errors",
            format!("{} points; {} light rays of {} depths", effort.points, effort.rays, effort.depths),
        ),
        ("program", format!("umbravox {}, revision {REVISION}", env!("CARGO_PKG_VERSION"))),
    ];
    facts.map(|(name, value)| (name.to_string(), value)).into()
}

/// What one scene is.
fn scene_facts(job: &Job) -> [(&'static str, String); 7] {
    let scene = job.scene;
    let camera = &scene.camera;
    let vector = |v: glam::DVec3| format!("{:.4}, {:.4}, {:.4}", v.x, v.y, v.z);
    let [nx, ny, nz] = job.volume.dims();
    [
        ("volume", format!("{}; {nx} x {ny} x {nz} voxels", job.volume.provenance.source)),
        ("transfer function", job.tf.name.clone()),
        ("picture", format!("{} x {} pixels", scene.width, scene.height)),
        ("light", scene.light.text()),
        ("eye, target", format!("{}; {} mm", vector(camera.eye), vector(camera.target))),
        ("up, field of view", format!("{}; {} degrees", vector(camera.up), camera.fov_deg)),
        (
            "ambient, shading, step",
            format!("{}; {:?}; {} of the smallest voxel spacing", scene.ambient, scene.shading, scene.step)
                .to_lowercase(),
        ),
    ]
}
