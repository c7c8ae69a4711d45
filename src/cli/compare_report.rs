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

/// Writes the report of a comparison into its folder and gives its path.
///
/// Nodes are counted on maps built once more, outside all timing. Where no row is `rays`, a picture by it is drawn to
/// show errors against. What of this fails is a note in the report.
///
/// # Errors
/// A file that cannot be written.
pub fn write(
    job: &Job,
    compared: &[Compared],
    notes: &[String],
    failures: &[(String, Error)],
    folder: &Path,
) -> Result<PathBuf> {
    let mut notes = notes.to_vec();
    notes.extend(failures.iter().map(|(name, e)| format!("{name} failed: {e}")));
    let reference = match compared.iter().any(|c| c.row.method == ShadowRays.name()) {
        true => None,
        false => reference(job).inspect_err(|e| notes.push(format!("error pictures are left out: {e}"))).ok(),
    };
    let mut entries = Vec::with_capacity(compared.len());
    for c in compared {
        let difference = match (&c.difference, &reference) {
            (None, Some(reference)) => Some(image_difference(c.picture.view(), reference.view())?),
            (own, _) => own.clone(),
        };
        let nodes = nodes(job, &c.row).unwrap_or_else(|e| {
            notes.push(format!("{}: nodes are not shown: {e}", c.slug));
            None
        });
        entries.push(Entry {
            row: c.row.clone(),
            picture_png: Some(picture_png(&c.picture)?),
            error_png: difference.as_ref().map(error_png).transpose()?,
            nodes,
        });
    }
    let conditions = Conditions {
        title: format!("Shadow methods: {}", job.scene_name),
        facts: facts(job),
        error_caption: "largest difference of any channel from the picture by rays".into(),
        notes,
    };
    let path = folder.join("report.html");
    write_report(&conditions, &entries, &path)?;
    Ok(path)
}

fn error_png(difference: &Array2<f32>) -> Result<Vec<u8>> {
    heat_map_png(difference, round_max(difference), ERROR_LABEL)
}

/// The picture by a shadow ray per sample.
fn reference(job: &Job) -> Result<Array3<f32>> {
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
fn facts(job: &Job) -> Vec<(String, String)> {
    let (scene, effort) = (job.scene, job.effort);
    let info = &job.session.renderer.gpu().info;
    let camera = &scene.camera;
    let vector = |v: glam::DVec3| format!("{:.4}, {:.4}, {:.4}", v.x, v.y, v.z);
    let [nx, ny, nz] = job.volume.dims();
    let driver = [info.driver.as_str(), &info.driver_info].join(" ");
    let facts = [
        ("volume, transfer function", format!("{}; {nx} x {ny} x {nz} voxels", job.scene_name)),
        ("adapter", format!("{} ({:?}; {})", info.name, info.backend, driver.trim())),
        ("host threads", rayon::current_num_threads().to_string()),
        ("picture", format!("{} x {} pixels", scene.width, scene.height)),
        ("light", light_text(&scene.light)),
        ("eye, target", format!("{}; {} mm", vector(camera.eye), vector(camera.target))),
        ("up, field of view", format!("{}; {} degrees", vector(camera.up), camera.fov_deg)),
        ("ambient, shading", format!("{}; {:?}", scene.ambient, scene.shading).to_lowercase()),
        ("eye-ray step", format!("{} of the smallest voxel spacing", scene.step)),
        ("times", format!("median of {} after a warm-up, methods in turn", effort.repeats)),
        (
            "errors",
            format!("{} points; {} light rays of {} depths", effort.points, effort.rays, effort.depths),
        ),
        ("program", format!("umbravox {}", env!("CARGO_PKG_VERSION"))),
    ];
    facts.map(|(name, value)| (name.to_string(), value)).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::parse_list;

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
