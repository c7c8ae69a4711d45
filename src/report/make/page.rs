//! Collects pictures and measurement conditions of a comparison and writes its HTML report `report.html`.

use super::super::heat::heat_map_png;
use super::super::html::{Conditions, Pictured, write_report};
use super::super::made::Made;
use super::files::{DIFFERENCE, scale_of};
use crate::error::Result;
use crate::files::picture::picture_png;
use crate::measure::facts::REVISION;
use crate::measure::job::Job;
use crate::scene::LightSource;
use itertools::Itertools as _;
use std::path::{Path, PathBuf};

/// Writes the HTML report `report.html` of a comparison into a folder and returns its path.
///
/// # Errors
/// A picture cannot be encoded, or a file cannot be written.
pub fn write_page(made: &Made, folder: &Path, difference_max: Option<f32>) -> Result<PathBuf> {
    let all = &made.comparison.compared;
    let scale =
        |wanted| difference_max.unwrap_or_else(|| scale_of(all.iter().filter(|c| c.row.group() == wanted)));
    let scales: Vec<_> = all.iter().map(|c| c.row.group()).unique().map(|g| (g, scale(g))).collect();
    let mut pictured = Vec::new();
    for c in all {
        let max = scales.iter().find(|(g, _)| *g == c.row.group()).map_or(1.0, |(_, max)| *max);
        let error_png = |difference| heat_map_png(difference, max, DIFFERENCE);
        pictured.push(Pictured {
            row: c.row.clone(),
            picture_png: c.picture.as_ref().map(picture_png).transpose()?,
            error_png: c.difference.as_ref().map(error_png).transpose()?,
            nodes: c.nodes.clone(),
        });
    }
    let mut notes = made.comparison.notes.clone();
    notes.extend(made.comparison.failures.iter().map(|(name, e)| format!("{name} failed: {e}")));
    let mut facts = made.run.conditions.clone();
    if !made.run.again.is_empty() {
        facts.push(("made again by".into(), made.run.again.clone()));
    }
    let conditions = Conditions {
        title: format!("Shadow methods: {}", made.run.scene_names().join("; ")),
        facts,
        error_caption: "largest difference of any channel from the picture by rays, all rows on one scale"
            .into(),
        notes,
    };
    let path = folder.join("report.html");
    write_report(&conditions, &pictured, &path)?;
    Ok(path)
}

/// Measurement conditions of the whole comparison for the HTML report, as names and values: adapter, threads, numbers
/// of repeats and samples, and program revision.
pub fn program_conditions(job: &Job) -> Vec<(String, String)> {
    let effort = job.effort;
    let info = &job.session.renderer.gpu().info;
    let driver = [info.driver.as_str(), &info.driver_info].join(" ");
    let facts = [
        ("adapter", format!("{} ({:?}; {})", info.name, info.backend, driver.trim())),
        ("host threads", rayon::current_num_threads().to_string()),
        (
            "times",
            format!(
                "median of {}{} after a warm-up, methods in turn; slow ones once",
                effort.repeats,
                if effort.short_repeats > effort.repeats {
                    format!(" ({} where short)", effort.short_repeats)
                } else {
                    String::new()
                }
            ),
        ),
        (
            "errors",
            format!(
                "{} points; {} light rays of {} depths{}",
                effort.points,
                effort.rays,
                effort.depths,
                if effort.flicker > 0 {
                    format!("; flicker over {} steps", effort.flicker)
                } else {
                    String::new()
                }
            ),
        ),
        ("program", format!("umbravox {}, revision {REVISION}", env!("CARGO_PKG_VERSION"))),
    ];
    facts.map(|(name, value)| (name.to_string(), value)).into()
}

/// Measurement conditions of one scene for the HTML report, as names and values: volume, transfer function, picture
/// size, lights, camera, shading and step length.
pub fn scene_conditions(job: &Job) -> [(&'static str, String); 7] {
    let scene = job.scene;
    let camera = &scene.camera;
    let vector = |v: glam::DVec3| format!("{:.4}, {:.4}, {:.4}", v.x, v.y, v.z);
    let [nx, ny, nz] = job.volume.dims();
    [
        ("volume", format!("{}; {nx} x {ny} x {nz} voxels", job.volume.provenance.source)),
        ("transfer function", job.tf.name.clone()),
        ("picture", format!("{} x {} pixels", scene.width, scene.height)),
        ("light", scene.lights.iter().map(LightSource::text).collect::<Vec<_>>().join("; ")),
        ("eye, target", format!("{}; {} mm", vector(camera.eye), vector(camera.target))),
        ("up, field of view", format!("{}; {} degrees", vector(camera.up), camera.fov_deg)),
        (
            "ambient, shading, step",
            format!("{}; {:?}; {} of the smallest voxel spacing", scene.ambient, scene.shading, scene.step)
                .to_lowercase(),
        ),
    ]
}
