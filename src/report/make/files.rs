//! What a table is written with besides itself and the report: plots, pictures and what omissions are worth.

use super::super::ablation;
use super::super::heat::{round_max, write_heat_map};
use super::super::plot::write_plots;
use super::super::writers;
use crate::error::Result;
use crate::files::output::write_whole;
use crate::measure::ablate::Ablation;
use crate::measure::comparison::Compared;
use crate::measure::job::file_name_part;
use crate::measure::table::Row;
use std::path::{Path, PathBuf};

/// Error against time and against bytes, a drawing of each a scene; returns the paths.
pub fn write_scene_plots(rows: &[Row], scenes: &[String], folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for scene in scenes {
        let of_scene: Vec<Row> = rows.iter().filter(|r| r.scene == *scene).cloned().collect();
        let stem = match scenes.len() {
            1 => "compare".into(),
            _ => format!("compare_{}", file_name_part(scene)),
        };
        paths.extend(write_plots(&of_scene, folder, &stem)?);
    }
    Ok(paths)
}

/// Writes where each row's picture differs from that of `rays`, and `pictures.md`, which shows the two side by side;
/// returns the paths, with those of the pictures, which the journal has written.
pub fn write_pictures(compared: &[Compared], folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = vec![folder.join("pictures.md")];
    let mut sheet = String::new();
    let mut scene = None;
    for c in compared.iter().filter(|c| c.picture.is_some()) {
        if scene != Some(&c.row.scene) {
            let space = if scene.is_some() { "\n" } else { "" };
            scene = Some(&c.row.scene);
            sheet += &format!(
                "{space}## {}\n\n| method | picture | difference from `rays` |\n| --- | --- | --- |\n",
                c.row.scene
            );
        }
        let name = format!("picture_{}.png", c.slug);
        sheet += &format!("| {} {} | ![{name}]({name}) |", c.row.method, c.row.params);
        paths.push(folder.join(name));
        sheet += &match &c.difference {
            Some(_) => format!(" ![difference](difference_{}.png) |\n", c.slug),
            None => " |\n".into(),
        };
        if let Some(difference) = &c.difference {
            let path = folder.join(format!("difference_{}.png", c.slug));
            let label = "|difference| from rays, linear RGBA";
            write_heat_map(&path, difference, round_max(difference), label)?;
            paths.push(path);
        }
    }
    write_whole(&paths[0], |file| file.write_all(sheet.as_bytes()))?;
    Ok(paths)
}

/// Writes what omissions are worth: every column as CSV and JSON, and a table for reading; returns the paths.
pub fn write_ablations(rows: &[Ablation], folder: &Path) -> Result<Vec<PathBuf>> {
    let markdown = ablation::markdown(rows).into_bytes();
    let files = [("csv", writers::csv(rows)?), ("json", writers::json(rows)?.into_bytes()), ("md", markdown)];
    let write = |(extension, bytes): (&str, Vec<u8>)| {
        let path = folder.join(format!("ablation.{extension}"));
        write_whole(&path, |file| file.write_all(&bytes)).map(|()| path)
    };
    files.into_iter().map(write).collect()
}
