//! Reads OME-Zarr stores: folders of array chunks (NGFF 0.4 in Zarr 2, 0.5 in Zarr 3), and single Zarr arrays.
//!
//! The reader picks the finest resolution level (0 is the finest) that the host and a device can hold. The axes x, y
//! and z place the volume by scale and translation; all other axes hold frames, the last axis fastest. NGFF defines
//! no anatomical axes, so x, y and z are taken as RAS+.

mod chunks;
mod compression;
mod metadata;
mod multiscales;
mod out_of_core;

use self::chunks::SubVolume;
use self::metadata::Array;
use self::multiscales::{Axis, Group, Image, Level};
use self::out_of_core::ZarrVoxels;
use super::common::{frame_warning, refusal, sibling, with_integer_warning};
use super::head::Head;
use crate::error::Result;
use crate::files::loading::Loading;
use crate::files::memory_budget::{host_bytes, refuse_beyond_host};
use crate::volume::{AffineSource, Provenance, Scaling, Volume, VoxelStorage};
use glam::{DAffine3, DMat3, DVec3};
use std::path::{Path, PathBuf};

/// File extensions of Zarr folders.
pub const EXTENSIONS: &[&str] = &["zarr"];

/// Names of the metadata files of a Zarr folder.
const METADATA_FILES: [&str; 4] = ["zarr.json", ".zattrs", ".zgroup", ".zarray"];
/// Largest side of a 3-D texture that every supported GPU offers, in voxels.
const MAX_SIDE: usize = 2048;
/// Inverse of the fraction of host memory that an automatically selected resolution level of a Zarr image may fill.
/// The fraction refers to total memory, not free memory, so that the choice is reproducible.
const HOST_SHARE: u64 = 4;

/// Whether a folder is a Zarr store, or a file is the metadata file of one.
pub fn is_zarr(head: &Head) -> bool {
    match head.is_folder {
        true => METADATA_FILES.iter().any(|name| head.path.join(name).is_file()),
        false => is_metadata(&head.path),
    }
}

fn is_metadata(path: &Path) -> bool {
    path.file_name().is_some_and(|name| METADATA_FILES.iter().any(|known| name == *known))
}

/// Selection of the resolution level and frame to read from an OME-Zarr store.
#[derive(Debug, Clone, Copy, Default)]
pub struct Choice {
    /// Index of the resolution level of the OME-Zarr store, 0 being the finest; `None` selects the finest that fits
    /// in host memory and a GPU texture.
    pub level: Option<usize>,
    /// Index of the frame to read, counted over all non-spatial axes of the Zarr array.
    pub frame: usize,
    /// Whether volumes may be read in parts, so that the finest level need not fit host memory.
    pub is_out_of_core: bool,
    /// Voxel size in mm that overrides the scale of the OME-Zarr metadata.
    pub spacing_mm: Option<[f64; 3]>,
}

/// Reads one frame of an OME-Zarr store as a volume, at one resolution level.
///
/// # Errors
/// The Zarr store cannot be read, is no image, or claims more than its files or the host can hold.
pub fn read_with(path: &Path, choice: Choice, loading: &Loading) -> Result<Volume> {
    let refuse = refusal(path);
    let store = Store::open(path).map_err(&refuse)?;
    let mut warnings = store.notes.clone();
    let chosen = store.choose(choice, &mut warnings)?;
    let (world_from_index, affine_source) =
        chosen.affine(choice.spacing_mm, &mut warnings).map_err(&refuse)?;
    let frames = chosen.frames().map_err(&refuse)?;
    warnings.extend(frame_warning(path, choice.frame, frames)?);
    let part = chosen.sub_volume(choice.frame);
    let storage = match loading.out_of_core_limit(part.dims(), chosen.array.element.memory_bytes()) {
        Some(host_bytes) => {
            let source = ZarrVoxels::new(path.into(), &part, host_bytes).map_err(&refuse)?;
            VoxelStorage::out_of_core(source, host_bytes)
        }
        None => {
            refuse_beyond_host(part.memory_bytes()).map_err(|why| {
                let coarser = "--level selects a coarser level";
                if store.levels.len() > 1 { refuse(why).hint(coarser) } else { refuse(why) }
            })?;
            part.read(loading).map_err(&refuse)?.into()
        }
    };
    let stored_type = chosen.array.element.describe(chosen.array.layout.byte_order);
    let provenance = Provenance {
        affine_source,
        frames,
        frame: choice.frame,
        warnings,
        ..Provenance::new(path.display().to_string(), "zarr", stored_type)
    };
    let volume = Volume::from_storage(storage, Scaling::IDENTITY, world_from_index, provenance, loading)?;
    Ok(with_integer_warning(volume, chosen.array.element))
}

/// Lists the files that hold one frame of an OME-Zarr store at one resolution level: metadata and chunks.
///
/// # Errors
/// See [`read_with`].
pub fn files_of(path: &Path, choice: Choice) -> Result<Vec<PathBuf>> {
    let refuse = refusal(path);
    let store = Store::open(path).map_err(&refuse)?;
    let chosen = store.choose(choice, &mut Vec::new())?;
    let metadata = METADATA_FILES.iter().map(|name| store.folder.join(name)).filter(|file| file.is_file());
    let mut files: Vec<PathBuf> = metadata.chain(chosen.array.metadata_files()).collect();
    files.sort();
    files.dedup();
    files.extend(chosen.sub_volume(choice.frame).present().map_err(&refuse)?);
    Ok(files)
}

/// OME-Zarr image with the arrays of its resolution levels, or a single Zarr array.
struct Store {
    /// Path of the Zarr store as the user gave it.
    source: PathBuf,
    /// Folder of the OME-Zarr image in the Zarr store.
    folder: PathBuf,
    axes: Vec<Axis>,
    levels: Vec<(Level, Array)>,
    notes: Vec<String>,
}

impl Store {
    fn open(path: &Path) -> Result<Self, String> {
        let around = || path.parent().unwrap_or(Path::new("")).to_path_buf();
        let mut folder = if is_metadata(path) && !path.is_dir() { around() } else { path.to_path_buf() };
        let mut notes = Vec::new();
        if let Some(array) = Array::open(&folder)? {
            notes.push("it is a single array: its last axes are taken as z, y and x".to_string());
            let axes = default_axes(array.shape.len());
            let levels = vec![(Level::default(), array)];
            return Ok(Self { source: path.into(), folder, axes, levels, notes });
        }
        let mut group = Group::open(&folder)?;
        if matches!(group, Group::Images) {
            notes.push("it holds images in subfolders: the first one, in `0`, was read".to_string());
            folder.push("0");
            group = Group::open(&folder)?;
        }
        let image = match group {
            Group::Image(image) => image,
            Group::Plate => {
                return Err("it is a plate or a well: name the folder of one of its images, as A/1/0".into());
            }
            Group::Images | Group::Other => {
                return Err("it is no image: its metadata have no `multiscales`, and it is no array".into());
            }
        };
        let Image { mut axes, levels } = image;
        let levels: Vec<(Level, Array)> = levels
            .into_iter()
            .map(|level| {
                let place = sibling(&folder.join("zarr.json"), &level.path)?;
                let array = Array::open(&place).map_err(|why| format!("level `{}`: {why}", level.path))?;
                let array = array.ok_or_else(|| format!("level `{}`: there is no such array", level.path))?;
                Ok((level, array))
            })
            .collect::<Result<_, String>>()?;
        let count = levels.first().map_or(0, |(_, array)| array.shape.len());
        if axes.is_empty() {
            axes = default_axes(count);
        }
        for (level, array) in &levels {
            let scaled = level.scale.len();
            if array.shape.len() != axes.len() || scaled != 0 && scaled != axes.len() {
                return Err(format!(
                    "level `{}` has {} axes, its scale {scaled}, and the image {}",
                    level.path,
                    array.shape.len(),
                    axes.len()
                ));
            }
        }
        Ok(Self { source: path.into(), folder, axes, levels, notes })
    }

    /// Selects the requested resolution level of the OME-Zarr image, or the finest level that fits in host memory and
    /// a GPU texture.
    fn choose(&self, choice: Choice, notes: &mut Vec<String>) -> Result<ChosenLevel<'_>> {
        let refuse = refusal(&self.source);
        let count = self.levels.len();
        let all: Vec<ChosenLevel<'_>> =
            (0..count).map(|at| self.level(at)).collect::<Result<_, _>>().map_err(&refuse)?;
        let max_bytes = host_bytes().unwrap_or(u64::MAX) / HOST_SHARE;
        let fits = |chosen: &ChosenLevel<'_>| {
            let bytes = chosen.sub_volume(0).memory_bytes();
            chosen.dims().iter().all(|n| *n <= MAX_SIDE) && bytes.is_some_and(|bytes| bytes <= max_bytes)
        };
        let fitting = all.iter().position(fits).unwrap_or(count - 1);
        let finest = if choice.is_out_of_core { 0 } else { fitting };
        let at = choice.level.unwrap_or(finest);
        let [nx, ny, nz] = all.get(at).map_or([0; 3], ChosenLevel::dims);
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
                "{count} levels: level {at} (0 is the finest), {nx}x{ny}x{nz} voxels{why}, was read, --level selects another"
            ));
        }
        Ok(chosen)
    }

    fn level(&self, at: usize) -> Result<ChosenLevel<'_>, String> {
        let (level, array) = &self.levels[at];
        let of = |name: &str| self.axes.iter().position(|axis| axis.name == name);
        let space = ["x", "y", "z"].map(of);
        match space {
            [Some(_), Some(_), _] => Ok(ChosenLevel { axes: &self.axes, level, array, space }),
            _ => {
                let names: Vec<&str> = self.axes.iter().map(|axis| axis.name.as_str()).collect();
                Err(format!("its axes are {}; x and y are needed", names.join(", ")))
            }
        }
    }
}

/// Returns default names for the axes of a Zarr array: the last axis is x, and the axes before it are y, z, c and t.
fn default_axes(count: usize) -> Vec<Axis> {
    const USUAL: [&str; 5] = ["t", "c", "z", "y", "x"];
    let unnamed = (USUAL.len()..count).map(|at| format!("axis {at}"));
    let named = USUAL.iter().skip(USUAL.len().saturating_sub(count)).map(|name| (*name).to_string());
    unnamed.chain(named).map(|name| Axis { name, unit: None }).collect()
}

/// Resolution level of an OME-Zarr image with its spatial axes.
struct ChosenLevel<'a> {
    axes: &'a [Axis],
    level: &'a Level,
    array: &'a Array,
    /// Indices of the axes x, y and z in the shape of the Zarr array.
    space: [Option<usize>; 3],
}

impl<'a> ChosenLevel<'a> {
    fn dims(&self) -> [usize; 3] {
        self.sub_volume(0).dims()
    }

    /// Lists the non-spatial axes of the Zarr array with their sizes.
    fn others(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let sizes = self.array.shape.iter().copied().enumerate();
        sizes.filter(|(axis, _)| !self.space.contains(&Some(*axis)))
    }

    fn frames(&self) -> Result<usize, String> {
        let count = self.others().try_fold(1usize, |frames, (_, n)| frames.checked_mul(n));
        count.ok_or_else(|| "its number of frames cannot be counted".into())
    }

    /// Returns the 3-D volume of one frame of the Zarr array. The frame index counts over the non-spatial axes, the
    /// last one fastest.
    fn sub_volume(&self, frame: usize) -> SubVolume<'a> {
        let mut fixed = vec![0; self.array.shape.len()];
        let mut rest = frame;
        let others: Vec<(usize, usize)> = self.others().collect();
        for (axis, count) in others.into_iter().rev() {
            fixed[axis] = rest % count;
            rest /= count;
        }
        SubVolume { array: self.array, space: self.space, fixed }
    }

    /// Returns the affine from voxel indices to world coordinates (RAS+, mm).
    fn affine(
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
                .push("its axes have no known unit of length: taken as mm, --spacing overrides it".into());
        }
        let mut size = DVec3::from_array(along.map(|(scale, mm)| scale * mm));
        if self.space[2].is_none() {
            // A planar image is as thick as its pixels are wide.
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
    fn axes_without_names_have_default_names() {
        let names = |count| default_axes(count).into_iter().map(|axis| axis.name).collect::<Vec<_>>();
        assert_eq!(names(2), ["y", "x"]);
        assert_eq!(names(4), ["c", "z", "y", "x"]);
        assert_eq!(names(6), ["axis 5", "t", "c", "z", "y", "x"]);
    }
}
