//! `umbravox probe --map-slices`: transmittance by a shadow map at even depths, as pictures seen from the light.

use super::console::{load_scene, open_session, print_json, print_message, print_result};
use super::frames::with_suffix;
use crate::error::Result;
use crate::exact::ExactField;
use crate::files::output::check_output;
use crate::files::picture::{PICTURE_EXTENSIONS, write_picture};
use crate::measure::map_slices::map_slices;
use crate::open::{Loaded, RunFlags, SceneSettings};
use ndarray::{Array2, Array3};
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;

/// Record of one slice of a shadow map: its picture, and its transmittance by the map and exact.
#[derive(Serialize)]
struct SliceRecord {
    picture: String,
    depth_mm: f64,
    mean: f64,
    exact_mean: f64,
    largest_error: f64,
}

fn grey(values: &Array2<f32>) -> Array3<f32> {
    let (height, width) = values.dim();
    Array3::from_shape_fn((height, width, 4), |(j, i, c)| if c < 3 { values[[j, i]] } else { 1.0 })
}

fn mean(values: &Array2<f32>) -> f64 {
    values.iter().map(|t| f64::from(*t)).sum::<f64>() / values.len() as f64
}

/// Writes `count` slices of the shadow map of `--shadow` and the exact ones as grey pictures, and prints a line of
/// figures for each.
///
/// # Errors
/// Bad input, or a failure of the device or disk.
pub fn run(settings: &SceneSettings, run: &RunFlags, count: u32, output: &Path) -> Result<()> {
    let method = settings.method()?;
    check_output(output, PICTURE_EXTENSIONS)?;
    let Loaded { volume, strands, tf, scene, .. } = load_scene(settings)?;
    let session = open_session(run, settings, (Arc::clone(&volume), strands), &tf)?;
    let shadow = session.shadow(method.as_ref(), scene.light())?;
    let field = ExactField::new(&volume, &tf);
    let mut records = Vec::new();
    let slices = map_slices(&session, &shadow, &field, scene.light(), count)?;
    volume.check_reads()?;
    for (number, slice) in slices.iter().enumerate() {
        let picture = with_suffix(output, &format!("_{number:04}"));
        write_picture(&picture, &grey(&slice.method))?;
        write_picture(&with_suffix(output, &format!("_{number:04}_exact")), &grey(&slice.exact))?;
        let errors = slice.method.iter().zip(&slice.exact).map(|(t, exact)| f64::from((t - exact).abs()));
        records.push(SliceRecord {
            picture: picture.display().to_string(),
            depth_mm: slice.depth_mm,
            mean: mean(&slice.method),
            exact_mean: mean(&slice.exact),
            largest_error: errors.fold(0.0, f64::max),
        });
    }
    print_message("written", &format_args!("{} pictures beside {}", 2 * records.len(), output.display()));
    if run.json {
        return print_json(&records);
    }
    let line = |r: &SliceRecord| {
        format!("{},{:.6},{:.6},{:.6},{:.6}\n", r.picture, r.depth_mm, r.mean, r.exact_mean, r.largest_error)
    };
    let lines: String = records.iter().map(line).collect();
    print_result(&format!("picture,depth_mm,mean,exact_mean,largest_error\n{lines}"))
}
