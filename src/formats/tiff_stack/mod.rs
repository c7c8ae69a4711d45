//! Reads TIFF stacks: a multi-page file, or a folder of TIFF files; grey values of 8 to 64 bits.
//!
//! Pages are slices from index 0 on; files are ordered by the numbers in their names. Voxel sizes come from an ImageJ
//! or OME description. A TIFF resolution alone is not used, since it is meant for printing.

mod description;
mod pages;

use self::description::Order;
use self::pages::Pages;
use super::common::{frame_warning, refusal};
use super::head::Head;
use crate::error::Result;
use crate::files::loading::{Loading, ReadingStage};
use crate::volume::{Provenance, Volume};
use glam::{DAffine3, DVec3};
use std::path::{Path, PathBuf};

/// File extensions of the TIFF format.
pub const EXTENSIONS: &[&str] = &["tif", "tiff"];

const MAGICS: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];

/// Whether a file is TIFF, or a folder holds files with a TIFF extension.
pub fn is_tiff(head: &Head) -> bool {
    match head.is_folder {
        true => !files_in(&head.path).is_empty(),
        false => !head.is_gzipped && MAGICS.iter().any(|magic| head.starts_with(magic)),
    }
}

/// Lists the files of a TIFF stack in the order of their slices.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    if path.is_dir() { files_in(path) } else { vec![path.into()] }
}

/// Reads one frame of a TIFF stack as a volume, selected by its index from 0; `spacing_mm` overrides the voxel sizes
/// of the file.
///
/// # Errors
/// A TIFF file cannot be read, holds colours, or has pages of several sizes.
pub fn read_with(
    path: &Path,
    frame: usize,
    spacing_mm: Option<[f64; 3]>,
    loading: &Loading,
) -> Result<Volume> {
    let refuse = refusal(path);
    let files = files_of(path);
    let mut pages = Pages::default();
    let counting = loading.pieces(ReadingStage::Reading, usize::MAX);
    for file in &files {
        pages.add(file, &counting).map_err(refusal(file))?;
        loading.go_on(&path.display().to_string())?;
    }
    let mut warnings = Vec::new();
    let description = pages.description.take().unwrap_or_default();
    let order = Order::new(&description.text, pages.count).map_err(&refuse)?;
    warnings.extend(frame_warning(path, frame, order.frames())?);
    let spacing = spacing_mm.or_else(|| description.spacing_mm()).unwrap_or_else(|| {
        warnings.push("no --spacing given: voxels taken as 1 mm".into());
        [1.0; 3]
    });
    let pieces = loading.pieces(ReadingStage::Reading, order.slices);
    let voxels = pages.voxels(&order, frame, &pieces).map_err(refuse)?;
    let provenance = Provenance {
        frames: order.frames(),
        frame,
        warnings,
        ..Provenance::new(path.display().to_string(), "tiff", voxels.element().name())
    };
    let world_from_index = DAffine3::from_scale(DVec3::from_array(spacing));
    Volume::new_with(voxels, description.scaling(), world_from_index, provenance, loading)
}

/// Lists the TIFF files of a folder, ordered by the numbers in their names.
fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let named =
        |p: &PathBuf| p.extension().is_some_and(|e| EXTENSIONS.iter().any(|x| e.eq_ignore_ascii_case(x)));
    let mut files: Vec<PathBuf> = entries.filter(|p| named(p) && p.is_file()).collect();
    files.sort_by_cached_key(|p| natural(&p.file_name().unwrap_or_default().to_string_lossy()));
    files
}

/// Splits a file name into words and numbers as a sort key: `slice10` sorts after `slice9`.
fn natural(name: &str) -> Vec<(u128, String)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let word = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let (text, after) = rest.split_at(word);
        let digits = after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len());
        let (number, after) = after.split_at(digits);
        parts.push((0, text.to_lowercase()));
        parts.push((number.parse().unwrap_or(u128::MAX), String::new()));
        rest = after;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_sorted_by_number() {
        let mut names = ["s10.tif", "s015.tif", "s9.tif", "S1.tif", "s9b2.tif", "s9b10.tif"];
        names.sort_by_cached_key(|n| natural(n));
        assert_eq!(names, ["S1.tif", "s9.tif", "s9b2.tif", "s9b10.tif", "s10.tif", "s015.tif"]);
    }
}
