//! Writes the plots, difference images, figures of all pictures and ablation tables of a comparison.

use super::super::ablation;
use super::super::grid::{self, GridCell};
use super::super::heat::{heat_map_png, round_max};
use super::super::made::Made;
use super::super::names;
use super::super::plot::write_plots;
use super::super::run::Run;
use super::super::tables::Layout;
use super::super::writers;
use crate::error::{Error, Result};
use crate::files::output::write_whole;
use crate::files::picture::{Backdrop, with_texts, write_picture_with};
use crate::measure::ablate::Ablation;
use crate::measure::comparison::Compared;
use crate::measure::table::Row;
use crate::shadow::{Method, NoShadows, NodeMap, TILE};
use itertools::Itertools as _;
use ndarray::Array2;
use ndarray_npy::WriteNpyExt;
use std::path::{Path, PathBuf};

/// Title of the colour bar of difference images: absolute difference from the reference picture, which shadow rays
/// draw.
pub const DIFFERENCE: &str = "|difference| from rays, linear RGBA";

/// Writes the plots of error against time and against memory for each scene and graphics adapter; returns their
/// paths.
pub fn write_scene_plots(rows: &[Row], run: &Run, folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for wanted in rows.iter().map(Row::group).unique() {
        let own: Vec<Row> = rows.iter().filter(|r| r.group() == wanted).cloned().collect();
        let prefix = run.prefix_of(wanted.0, wanted.1);
        let stems = names::plots(prefix.trim_end_matches('_'));
        paths.extend(write_plots(&own, folder, &stems, &run.texts_of(wanted.0))?);
    }
    Ok(paths)
}

/// Returns the upper end of the colour bar that all difference images of one scene and graphics adapter share. It
/// ignores the picture without shadows, whose large differences would make all other images black.
pub(super) fn scale_of<'a>(compared: impl Iterator<Item = &'a Compared> + Clone) -> f32 {
    let end = |c: &Compared| c.difference.as_ref().and_then(round_max);
    let shadowed = compared.clone().filter(|c| c.row.method != NoShadows.name());
    let largest = shadowed.filter_map(end).reduce(f32::max);
    largest.or_else(|| compared.filter_map(end).reduce(f32::max)).unwrap_or(1.0)
}

/// Writes the difference images, the arrays of curve nodes per texel, the figure of all pictures, and `pictures.md` with links to them. Returns the paths of these files and of the shadow methods' pictures.
pub fn write_pictures(made: &Made, folder: &Path, layout: &Layout) -> Result<Vec<PathBuf>> {
    let all = &made.comparison.compared;
    let mut paths = vec![folder.join("pictures.md")];
    let mut sheet = String::new();
    for wanted in all.iter().map(|c| c.row.group()).unique() {
        let own = all.iter().filter(|c| c.row.group() == wanted && c.picture.is_some());
        if own.clone().next().is_none() {
            continue;
        }
        let (prefix, texts) = (made.run.prefix_of(wanted.0, wanted.1), made.run.texts_of(wanted.0));
        let scale = layout.difference_max.unwrap_or_else(|| scale_of(own.clone()));
        let space = if sheet.is_empty() { "" } else { "\n" };
        let several = all.iter().any(|c| c.row.scene == wanted.0 && c.row.adapter != wanted.1);
        let on = if several { format!(", {}", wanted.1) } else { String::new() };
        let grids = names::grids(&prefix);
        sheet += &format!("{space}## {}{on}\n\n![all pictures]({})\n\n", wanted.0, grids[0]);
        sheet += "| method | picture | difference from `rays` |\n| --- | --- | --- |\n";
        let reference = made.references.iter().find(|r| (r.scene.as_str(), r.adapter.as_str()) == wanted);
        if let Some(reference) = reference {
            for ending in ["png", "exr"] {
                let path = folder.join(format!("{}.{ending}", names::reference(&prefix)));
                write_picture_with(&path, &reference.pixels, Backdrop::Drawn, &texts)?;
                paths.push(path);
            }
            let name = format!("{}.png", names::reference(&prefix));
            sheet += &format!("| rays, not in the table | ![{name}]({name}) | |\n");
        }
        let mut cells: Vec<GridCell> = reference.iter().map(|r| GridCell::reference(&r.pixels)).collect();
        for c in own {
            let picture = format!("{}.png", names::picture(&c.slug));
            paths.push(folder.join(&picture));
            sheet += &format!("| {} | ![{picture}]({picture}) |", c.row.spec());
            if let Some(difference) = &c.difference {
                let name = names::difference(&c.slug);
                let png = with_texts(heat_map_png(difference, scale, DIFFERENCE)?, &texts)?;
                write_whole(&folder.join(&name), |file| file.write_all(&png))?;
                paths.push(folder.join(&name));
                sheet += &format!(" ![{name}]({name})");
            }
            sheet += " |\n";
            let picture = c.picture.as_ref();
            let difference = c.difference.as_ref();
            cells.extend(picture.map(|picture| GridCell::of(&c.row, picture, difference)));
        }
        let [png, pdf] = grid::files(&cells, layout.tex_width_pt, scale, DIFFERENCE)?;
        for (name, bytes) in grids.iter().zip([with_texts(png, &texts)?, pdf]) {
            let path = folder.join(name);
            write_whole(&path, |file| file.write_all(&bytes))?;
            paths.push(path);
        }
    }
    write_whole(&paths[0], |file| file.write_all(sheet.as_bytes()))?;
    for c in all {
        if let Some(nodes) = &c.nodes {
            let path = folder.join(names::nodes(&c.slug));
            let failed =
                |e: ndarray_npy::WriteNpyError| Error::runtime("cannot encode nodes", path.display(), e);
            let mut bytes = Vec::new();
            signed(nodes).write_npy(&mut bytes).map_err(failed)?;
            write_whole(&path, |file| file.write_all(&bytes))?;
            paths.push(path);
        }
    }
    Ok(paths)
}

/// Converts the curve-node counts of a deep shadow map to one integer array: nodes per texel, -1 in tiles that are
/// not stored.
fn signed(map: &NodeMap) -> Array2<i32> {
    let side = TILE as usize;
    Array2::from_shape_fn(map.nodes.dim(), |(row, column)| match map.stored[[row / side, column / side]] {
        true => map.nodes[[row, column]] as i32,
        false => -1,
    })
}

/// Restores the curve-node counts of a deep shadow map from one integer array: nodes per texel, -1 in tiles that are
/// not stored.
pub fn node_map(signed: &Array2<i32>) -> NodeMap {
    let (rows, columns) = signed.dim();
    let side = TILE as usize;
    let stored = Array2::from_shape_fn((rows.div_ceil(side), columns.div_ceil(side)), |(row, column)| {
        signed[[row * side, column * side]] >= 0
    });
    NodeMap { nodes: signed.mapv(|n| n.max(0) as u32), stored }
}

/// Writes the ablation tables (cost of each optimization) as CSV, JSON and Markdown; returns their paths.
pub fn write_ablations(rows: &[Ablation], folder: &Path) -> Result<Vec<PathBuf>> {
    let markdown = ablation::markdown(rows).into_bytes();
    let files = [
        ("ablation.csv", writers::csv(rows)?),
        ("ablation.json", writers::json(rows)?.into_bytes()),
        ("ablation.md", markdown),
    ];
    writers::write_files(folder, files)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::arr2;

    #[test]
    fn nodes_come_back_from_their_file() {
        let nodes =
            Array2::from_shape_fn((20, 20), |(r, c)| if r < 16 && c < 16 { (r * c) as u32 } else { 0 });
        let map = NodeMap { nodes, stored: arr2(&[[true, false], [false, true]]) };
        assert_eq!(signed(&map)[[19, 19]], 0);
        assert_eq!(signed(&map)[[0, 16]], -1);
        let back = node_map(&signed(&map));
        assert_eq!((back.nodes, back.stored), (map.nodes, map.stored));
    }

    #[test]
    fn one_scale_is_of_all_rows_but_those_without_shadows() {
        let compared = |method: &str, value: f32| Compared {
            row: Row { method: method.into(), ..Row::default() },
            method: method.into(),
            slug: String::new(),
            picture: None,
            difference: Some(arr2(&[[0.0, value]])),
            nodes: None,
            left_out: Vec::new(),
        };
        let all =
            [compared("none", 0.9), compared("dsm", 0.011), compared("osm", 0.04), compared("dom", 0.0)];
        assert!((scale_of(all.iter()) - 0.05).abs() < 1e-6);
        assert!((scale_of(all[3..].iter()) - 1.0).abs() < 1e-6);
        let low = [compared("none", 0.3)];
        assert!((scale_of(low.iter()) - 0.5).abs() < 1e-6, "alone it has its own");
        let high = [compared("dsm", 0.02), compared("osm", 0.7)];
        assert!((scale_of(high.iter()) - 1.0).abs() < 1e-6);
    }
}
