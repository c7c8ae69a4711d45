//! OME-Zarr: a folder of chunks, NGFF 0.4 beside Zarr 2 and 0.5 within Zarr 3; and plain arrays of Zarr.
//!
//! Of the sizes in which an image is there (levels, 0 the finest) the finest is read that the host and a device can hold.
//! Axes called x, y and z place the volume, by scale and translation; along all others lie frames, the last axis fastest: a
//! file of times and channels has the channels of the first time first. NGFF knows no patient: x, y and z are taken as they
//! stand, RAS+.

mod blosc;
mod chunks;
mod metadata;
mod multiscales;
mod packing;
mod zstd;

use self::chunks::Part;
use self::metadata::Array;
use self::multiscales::{Axis, Group, Image, Level};
use super::beside::beside;
use super::frames::picked;
use super::head::Head;
use super::source::inexact_integers;
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::files::memory_budget::{host_bytes, refuse_beyond_host};
use crate::volume::{AffineSource, Provenance, Scaling, Volume};
use glam::{DAffine3, DMat3, DVec3};
use std::path::{Path, PathBuf};

/// Ending of such folders.
pub const EXTENSIONS: &[&str] = &["zarr"];

/// Files that say what a folder holds.
const MARKS: [&str; 4] = ["zarr.json", ".zattrs", ".zgroup", ".zarray"];
/// The longest side of a 3-D texture that every device holds.
const SIDE_MOST: usize = 2048;
/// Of the host's memory, a level that is chosen for a user takes at most one part in so many: of all of it and not of what is
/// free, so that the same level is chosen again.
const OF_HOST: u64 = 4;

/// Whether a folder holds Zarr, or a file says what the folder around it holds.
pub fn is_zarr(head: &Head) -> bool {
    match head.is_folder() {
        true => MARKS.iter().any(|mark| head.path().join(mark).is_file()),
        false => is_mark(head.path()),
    }
}

fn is_mark(path: &Path) -> bool {
    path.file_name().is_some_and(|name| MARKS.iter().any(|mark| name == *mark))
}

/// What of a store is to be read.
#[derive(Debug, Clone, Copy, Default)]
pub struct Choice {
    /// 0 is the finest; the finest that fits where it is `None`.
    pub level: Option<usize>,
    /// Which of the volumes along axes that are none of space.
    pub frame: usize,
    /// To win over what the file says, mm.
    pub spacing_mm: Option<[f64; 3]>,
}

/// Reads one frame of one level.
///
/// # Errors
/// It cannot be read, is no image, or claims more than its files or the host can hold.
pub fn read_with(path: &Path, choice: Choice, loading: &Loading) -> Result<Volume> {
    let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
    let store = Store::of(path).map_err(refuse)?;
    let mut warnings = store.notes.clone();
    let chosen = store.choose(choice, &mut warnings)?;
    let (world_from_index, affine_source) =
        chosen.placed(choice.spacing_mm, &mut warnings).map_err(refuse)?;
    let frames = chosen.frames().map_err(refuse)?;
    warnings.extend(picked(path, choice.frame, frames)?);
    let part = chosen.part(choice.frame);
    refuse_beyond_host(part.kept_bytes()).map_err(|why| {
        let coarser = "--level picks a coarser one";
        if store.levels.len() > 1 { refuse(why).hint(coarser) } else { refuse(why) }
    })?;
    let voxels = part.read(loading).map_err(refuse)?;
    warnings.extend(inexact_integers(&voxels, chosen.array.element));
    let stored_type = chosen.array.element.describe(chosen.array.layout.byte_order);
    let provenance = Provenance {
        affine_source,
        frames,
        frame: choice.frame,
        warnings,
        ..Provenance::new(path.display().to_string(), "zarr", stored_type)
    };
    Volume::new_with(voxels, Scaling::IDENTITY, world_from_index, provenance, loading)
}

/// The files of one frame of one level: what says how to read it, and the chunks.
///
/// # Errors
/// As [`read_with`].
pub fn files_of(path: &Path, choice: Choice) -> Result<Vec<PathBuf>> {
    let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
    let store = Store::of(path).map_err(refuse)?;
    let chosen = store.choose(choice, &mut Vec::new())?;
    let marks = MARKS.iter().map(|mark| store.folder.join(mark)).filter(|mark| mark.is_file());
    let mut files: Vec<PathBuf> = marks.chain(chosen.array.metadata_files()).collect();
    files.sort();
    files.dedup();
    files.extend(chosen.part(choice.frame).present().map_err(refuse)?);
    Ok(files)
}

/// An image with its arrays, or an array alone.
struct Store {
    /// What a user named.
    source: PathBuf,
    /// Where the image itself is.
    folder: PathBuf,
    axes: Vec<Axis>,
    levels: Vec<(Level, Array)>,
    notes: Vec<String>,
}

impl Store {
    fn of(path: &Path) -> Result<Self, String> {
        let around = || path.parent().unwrap_or(Path::new("")).to_path_buf();
        let mut folder = if is_mark(path) && !path.is_dir() { around() } else { path.to_path_buf() };
        let mut notes = Vec::new();
        if let Some(array) = Array::of(&folder)? {
            notes.push("it is an array alone: its last axes are taken as z, y and x".to_string());
            let level =
                Level { path: String::new(), scale: Vec::new(), translation: Vec::new(), is_scaled: false };
            let axes = usual_axes(array.shape.len());
            return Ok(Self { source: path.into(), folder, axes, levels: vec![(level, array)], notes });
        }
        let mut group = Group::of(&folder)?;
        if matches!(group, Group::Images) {
            notes.push("it holds images in folders of it: the first one, in `0`, was read".to_string());
            folder.push("0");
            group = Group::of(&folder)?;
        }
        let image = match group {
            Group::Image(image) => image,
            Group::Plate => {
                return Err("it is a plate or a well: name the folder of one of its images, as A/1/0".into());
            }
            Group::Images | Group::Another => {
                return Err("it is no image: its metadata have no `multiscales`, and it is no array".into());
            }
        };
        let Image { mut axes, levels } = image;
        let levels: Vec<(Level, Array)> = levels
            .into_iter()
            .map(|level| {
                let place = beside(&folder.join("zarr.json"), &level.path)?;
                let array = Array::of(&place).map_err(|why| format!("level `{}`: {why}", level.path))?;
                let array = array.ok_or_else(|| format!("level `{}`: there is no such array", level.path))?;
                Ok((level, array))
            })
            .collect::<Result<_, String>>()?;
        let count = levels.first().map_or(0, |(_, array)| array.shape.len());
        if axes.is_empty() {
            axes = usual_axes(count);
        }
        for (level, array) in &levels {
            let said = level.scale.len();
            if array.shape.len() != axes.len() || said != 0 && said != axes.len() {
                return Err(format!(
                    "level `{}` has {} axes, its scale {said}, and the image {}",
                    level.path,
                    array.shape.len(),
                    axes.len()
                ));
            }
        }
        Ok(Self { source: path.into(), folder, axes, levels, notes })
    }

    /// The level that is asked for, or the finest that fits.
    fn choose(&self, choice: Choice, notes: &mut Vec<String>) -> Result<Chosen<'_>> {
        let refuse = |why: String| Error::input("cannot read volume", self.source.display(), why);
        let count = self.levels.len();
        let all: Vec<Chosen<'_>> =
            (0..count).map(|at| self.level(at)).collect::<Result<_, _>>().map_err(refuse)?;
        let most = host_bytes().unwrap_or(u64::MAX) / OF_HOST;
        let fits = |chosen: &Chosen<'_>| {
            let bytes = chosen.part(0).kept_bytes();
            chosen.dims().iter().all(|n| *n <= SIDE_MOST) && bytes.is_some_and(|bytes| bytes <= most)
        };
        let finest = all.iter().position(fits).unwrap_or(count - 1);
        let at = choice.level.unwrap_or(finest);
        let [nx, ny, nz] = all.get(at).map_or([0; 3], Chosen::dims);
        let Some(chosen) = all.into_iter().nth(at) else {
            let why = format!("--level {at} is beyond its {count} levels (counted from 0, the finest)");
            return Err(refuse(why));
        };
        if count > 1 {
            let why = match choice.level {
                None if at > 0 => ", the finest that fits memory and a texture",
                _ => "",
            };
            notes.push(format!(
                "{count} levels: level {at} (0 is the finest), {nx}x{ny}x{nz} voxels{why}, was read, --level picks another"
            ));
        }
        Ok(chosen)
    }

    fn level(&self, at: usize) -> Result<Chosen<'_>, String> {
        let (level, array) = &self.levels[at];
        let of = |name: &str| self.axes.iter().position(|axis| axis.name == name);
        let space = ["x", "y", "z"].map(of);
        match space {
            [Some(_), Some(_), _] => Ok(Chosen { axes: &self.axes, level, array, space }),
            _ => {
                let names: Vec<&str> = self.axes.iter().map(|axis| axis.name.as_str()).collect();
                Err(format!("its axes are {}; x and y are needed", names.join(", ")))
            }
        }
    }
}

/// The axes of an array that has no names for them.
fn usual_axes(count: usize) -> Vec<Axis> {
    const USUAL: [&str; 5] = ["t", "c", "z", "y", "x"];
    let unnamed = (USUAL.len()..count).map(|at| format!("axis {at}"));
    let named = USUAL.iter().skip(USUAL.len().saturating_sub(count)).map(|name| (*name).to_string());
    unnamed.chain(named).map(|name| Axis { name, unit: None }).collect()
}

/// A level, and its axes of space.
struct Chosen<'a> {
    axes: &'a [Axis],
    level: &'a Level,
    array: &'a Array,
    /// Which axis is x, y and z.
    space: [Option<usize>; 3],
}

impl<'a> Chosen<'a> {
    fn dims(&self) -> [usize; 3] {
        self.part(0).dims()
    }

    /// Axes along which frames lie, and how many there are.
    fn others(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let sizes = self.array.shape.iter().copied().enumerate();
        sizes.filter(|(axis, _)| !self.space.contains(&Some(*axis)))
    }

    fn frames(&self) -> Result<usize, String> {
        let count = self.others().try_fold(1usize, |frames, (_, n)| frames.checked_mul(n));
        count.ok_or_else(|| "its number of frames cannot be counted".into())
    }

    /// The volume at a frame, the last axis fastest.
    fn part(&self, frame: usize) -> Part<'a> {
        let mut fixed = vec![0; self.array.shape.len()];
        let mut rest = frame;
        let others: Vec<(usize, usize)> = self.others().collect();
        for (axis, count) in others.into_iter().rev() {
            fixed[axis] = rest % count;
            rest /= count;
        }
        Part { array: self.array, space: self.space, fixed }
    }

    /// World mm from index coordinates.
    fn placed(
        &self,
        spacing_mm: Option<[f64; 3]>,
        warnings: &mut Vec<String>,
    ) -> Result<(DAffine3, AffineSource), String> {
        if let Some(mm) = spacing_mm {
            return Ok((DAffine3::from_scale(DVec3::from_array(mm)), AffineSource::Spacing));
        }
        if !self.level.is_scaled {
            warnings.push("no voxel sizes and no --spacing are given: voxels taken as 1 mm".into());
            return Ok((DAffine3::IDENTITY, AffineSource::Spacing));
        }
        let mut without_unit = false;
        let [along, origin] = [&self.level.scale, &self.level.translation].map(|numbers| {
            self.space.map(|axis| {
                axis.map_or((0.0, 1.0), |axis| {
                    let mm = self.axes[axis].mm();
                    without_unit |= mm.is_none();
                    (numbers[axis], mm.unwrap_or(1.0))
                })
            })
        });
        if without_unit {
            warnings
                .push("its axes have no unit of length that is known: taken as mm, --spacing decides".into());
        }
        let mut size = DVec3::from_array(along.map(|(scale, mm)| scale * mm));
        if self.space[2].is_none() {
            // A picture is as thick as its pixels are wide.
            size.z = size.x.abs();
        }
        if !size.is_finite() || size.to_array().contains(&0.0) {
            return Err(format!("its voxel sizes are {}, {} and {} mm", size.x, size.y, size.z));
        }
        let origin = DVec3::from_array(origin.map(|(offset, mm)| offset * mm));
        Ok((DAffine3::from_mat3_translation(DMat3::from_diagonal(size), origin), AffineSource::Axes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_without_names_are_the_usual_ones() {
        let names = |count| usual_axes(count).into_iter().map(|axis| axis.name).collect::<Vec<_>>();
        assert_eq!(names(2), ["y", "x"]);
        assert_eq!(names(4), ["c", "z", "y", "x"]);
        assert_eq!(names(6), ["axis 5", "t", "c", "z", "y", "x"]);
    }
}
