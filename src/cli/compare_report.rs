//! `report.html` of `umbravox compare`: what the report needs beyond the rows.

use super::values::light_text;
use crate::error::{Error, Result};
use crate::measure::compare::{Compared, Job};
use crate::measure::heat::{heat_map_png, round_max};
use crate::measure::html::{Conditions, Entry, write_report};
use crate::measure::stats::image_difference;
use crate::measure::table::Row;
use crate::output::picture_png;
use crate::shadow::{Method, NodeMap, ShadowRays, parse};
use ndarray::{Array2, Array3};
use std::path::{Path, PathBuf};

const ERROR_LABEL: &str = "|difference| from rays, linear RGBA";

/// A report that grows by one scene after another.
#[derive(Debug, Default)]
pub struct Report {
    scenes: Vec<String>,
    facts: Vec<(String, String)>,
    entries: Vec<Entry>,
    notes: Vec<String>,
}

impl Report {
    /// Adds the rows of one scene, while its volume is on the device.
    ///
    /// Nodes are counted on maps built once more, outside all timing. Where no row is `rays`, a picture by it is drawn
    /// to show errors against. What of this fails is a note in the report.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub fn add(
        &mut self,
        job: &Job,
        compared: &[Compared],
        notes: &[String],
        failures: &[(String, Error)],
    ) -> Result<()> {
        self.notes.extend_from_slice(notes);
        self.notes.extend(failures.iter().map(|(name, e)| format!("{name} failed: {e}")));
        self.add_facts(&job.scene_name, facts(job));
        let mut reference = None;
        if compared.iter().all(|c| c.row.method != ShadowRays.name()) {
            match reference_picture(job) {
                Ok(picture) => reference = Some(picture),
                Err(e) => self.notes.push(format!("error pictures are left out: {e}")),
            }
        }
        for c in compared {
            let difference = match (&c.difference, &reference) {
                (None, Some(reference)) => Some(image_difference(c.picture.view(), reference.view())?),
                (own, _) => own.clone(),
            };
            let nodes = nodes(job, &c.row).unwrap_or_else(|e| {
                self.notes.push(format!("{}: nodes are not shown: {e}", c.slug));
                None
            });
            self.entries.push(Entry {
                row: c.row.clone(),
                picture_png: Some(picture_png(&c.picture)?),
                error_png: difference.as_ref().map(error_png).transpose()?,
                nodes,
            });
        }
        Ok(())
    }

    /// What all scenes share is said once; what differs names its scene.
    fn add_facts(&mut self, scene: &str, facts: Vec<(&str, String)>) {
        for (name, value) in facts {
            let said = |(n, v): &(String, String)| n == name && *v == value;
            if self.facts.iter().any(said) {
                continue;
            }
            let other = self.facts.iter().any(|(n, _)| n == name);
            let name = if other { format!("{name} ({scene})") } else { name.into() };
            self.facts.push((name, value));
        }
        self.scenes.push(scene.into());
    }

    /// Writes `report.html` into a folder that exists and gives its path.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(self, folder: &Path) -> Result<PathBuf> {
        let conditions = Conditions {
            title: format!("Shadow methods: {}", self.scenes.join("; ")),
            facts: self.facts,
            error_caption: "largest difference of any channel from the picture by rays".into(),
            notes: self.notes,
        };
        let path = folder.join("report.html");
        write_report(&conditions, &self.entries, &path)?;
        Ok(path)
    }
}

fn error_png(difference: &Array2<f32>) -> Result<Vec<u8>> {
    heat_map_png(difference, round_max(difference), ERROR_LABEL)
}

/// The picture by a shadow ray per sample.
fn reference_picture(job: &Job) -> Result<Array3<f32>> {
    let shadow = job.session.shadow(&ShadowRays, job.scene.light)?;
    Ok(job.session.render(&shadow, job.scene)?.pixels)
}

/// The nodes of a row's structure, where it has any.
fn nodes(job: &Job, row: &Row) -> Result<Option<NodeMap>> {
    if row.nodes_total.is_none() {
        return Ok(None);
    }
    let shadow = job.session.shadow(method_of(row)?.as_ref(), job.scene.light)?;
    job.session.node_map(&shadow)
}

/// The method that a row is of, by its columns.
fn method_of(row: &Row) -> Result<Box<dyn Method>> {
    let map = row.map.map(|map| format!("map={map}"));
    let settings: Vec<_> = row.params.split_whitespace().map(String::from).chain(map).collect();
    let colon = if settings.is_empty() { "" } else { ":" };
    parse(&format!("{}{colon}{}", row.method, settings.join(",")))
}

/// What the table was made with.
fn facts(job: &Job) -> Vec<(&'static str, String)> {
    let (scene, effort) = (job.scene, job.effort);
    let info = &job.session.renderer.gpu().info;
    let camera = &scene.camera;
    let vector = |v: glam::DVec3| format!("{:.4}, {:.4}, {:.4}", v.x, v.y, v.z);
    let [nx, ny, nz] = job.volume.dims();
    let driver = [info.driver.as_str(), &info.driver_info].join(" ");
    vec![
        ("volume, transfer function", format!("{}; {nx} x {ny} x {nz} voxels", job.scene_name)),
        ("adapter", format!("{} ({:?}; {})", info.name, info.backend, driver.trim())),
        ("host threads", rayon::current_num_threads().to_string()),
        ("picture", format!("{} x {} pixels", scene.width, scene.height)),
        ("light", light_text(&scene.light)),
        ("eye, target", format!("{}; {} mm", vector(camera.eye), vector(camera.target))),
        ("up, field of view", format!("{}; {} degrees", vector(camera.up), camera.fov_deg)),
        ("ambient, shading", format!("{}; {:?}", scene.ambient, scene.shading).to_lowercase()),
        ("eye-ray step", format!("{} of the smallest voxel spacing", scene.step)),
        (
            "times",
            format!("medians of {} after a warm-up, methods in turn; slow frames once", effort.repeats),
        ),
        (
            "errors",
            format!("{} points; {} light rays of {} depths", effort.points, effort.rays, effort.depths),
        ),
        ("program", format!("umbravox {}", env!("CARGO_PKG_VERSION"))),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::parse_list;

    #[test]
    fn facts_that_scenes_share_are_said_once() {
        let mut report = Report::default();
        report.add_facts("a", vec![("light", "up".into()), ("picture", "2 x 2".into())]);
        report.add_facts("b", vec![("light", "down".into()), ("picture", "2 x 2".into())]);
        let facts: Vec<_> = report.facts.iter().map(|(n, v)| format!("{n}: {v}")).collect();
        assert_eq!(facts, ["light: up", "picture: 2 x 2", "light (b): down"]);
        assert_eq!(report.scenes, ["a", "b"]);
    }

    #[test]
    fn a_row_names_its_method() {
        let methods = "none;rays;dsm;dsm:epsilon=0.005,prefilter=5,precompress=off,filter=nearest,step=0.25,offset=-1,map=64;\
            osm:layers=8,slicing=gamma,bits=8,map=32;dom:layers=5,beyond=cover,filter=nearest;bom:split=log,layers=3";
        for method in parse_list(methods).unwrap() {
            let row = Row {
                method: method.name().into(),
                params: method.params(),
                map: method.map_size(),
                ..Row::default()
            };
            let again = method_of(&row).unwrap();
            assert_eq!(format!("{again:?}"), format!("{method:?}"));
        }
    }
}
