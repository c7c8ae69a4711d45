//! The files of a folder, sorted into series: what belongs into one volume.

use super::dataset::{DataSet, FRAMES_MOST, PixelData, is_dicom, printable};
use super::pixels::Layout;
use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage};
use crate::volume::element::read_full;
use dicom_dictionary_std::tags;
use glam::DVec3;
use rayon::prelude::*;
use std::fs::File;
use std::path::{Path, PathBuf};

pub(super) const WHAT: &str = "cannot read DICOM series";
/// Files and folders that are looked at.
const FILES_MOST: usize = 200_000;
const DEPTH_MOST: usize = 8;

/// A file with frames.
#[derive(Debug)]
pub(super) struct Image {
    pub(super) path: PathBuf,
    pub(super) set: DataSet,
    pub(super) layout: Layout,
    pub(super) frames: usize,
}

/// Images that were made together, with one grid across.
#[derive(Debug)]
pub(super) struct Series {
    pub(super) images: Vec<Image>,
    /// Files of the folder that may have been of it, and why the first could not be read.
    pub(super) damaged: usize,
    pub(super) first_fault: String,
    key: Key,
}

/// What all images of a series share; the order in which series are listed.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    number: i64,
    uid: String,
    rows: usize,
    columns: usize,
    /// Directions of rows and columns in hundredths: a localiser lies across the slices that it shows.
    orientation: Option<[i64; 6]>,
}

impl Key {
    /// Whether images of both belong together: directions are equal but for roundings.
    fn is_like(&self, other: &Self) -> bool {
        let near = |a: &[i64; 6], b: &[i64; 6]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1);
        let turned = match (&self.orientation, &other.orientation) {
            (Some(a), Some(b)) => !near(a, b),
            (None, None) => false,
            _ => true,
        };
        (self.number, &self.uid, self.rows, self.columns)
            == (other.number, &other.uid, other.rows, other.columns)
            && !turned
    }
}

impl Series {
    fn new(key: Key, images: Vec<Image>) -> Self {
        Self { images, key, damaged: 0, first_fault: String::new() }
    }

    /// A layout that holds the values of all images.
    pub(super) fn widest(&self) -> Layout {
        let mut widest = self.images[0].layout;
        for Image { layout, .. } in &self.images {
            // A sign takes a bit of its own beside values without one.
            let mixed = u32::from(layout.is_signed != widest.is_signed);
            widest.stored = (layout.stored.max(widest.stored) + mixed).min(32);
            widest.is_signed |= layout.is_signed;
            widest.is_float |= layout.is_float;
            widest.allocated = widest.allocated.max(layout.allocated);
        }
        widest
    }

    /// What a list says of it. Descriptions are those of protocols; nothing here names a person.
    pub(super) fn summary(&self) -> String {
        let Some(first) = self.images.first() else { return String::new() };
        let text = |tag| first.set.root.text(tag).map(|t| printable(&t));
        let slices: usize = self.images.iter().map(|i| i.frames).sum();
        let description = text(tags::SERIES_DESCRIPTION).map(|d| format!(", `{d}`")).unwrap_or_default();
        format!(
            "series {} ({}, {}x{}, {slices} slice{}{description})",
            self.key.number,
            text(tags::MODALITY).unwrap_or_else(|| "no modality".into()),
            first.layout.columns,
            first.layout.rows,
            if slices == 1 { "" } else { "s" },
        )
    }
}

/// Why a file is none of the images of a series.
#[derive(Debug)]
pub(super) enum Refused {
    /// It holds something else.
    NoScalars(String),
    /// It should, and cannot be read.
    Damaged(String),
}

impl Refused {
    fn why(self) -> String {
        match self {
            Self::NoScalars(why) | Self::Damaged(why) => why,
        }
    }
}

impl From<String> for Refused {
    fn from(why: String) -> Self {
        Self::Damaged(why)
    }
}

/// Reads a file that may be an image.
///
/// # Errors
/// It is no DICOM file, has no pixels, or its attributes contradict each other.
pub(super) fn image(path: &Path) -> Result<Image, Refused> {
    let mut set = DataSet::read(path)?;
    if set.pixels == PixelData::None {
        return Err(Refused::NoScalars("it is a DICOM file without an image".into()));
    }
    let whole = |tag| set.root.whole(tag);
    let needed = |tag| whole(tag).ok_or_else(|| format!("it has no `{}`", super::dataset::name_of(tag)));
    let size = |tag| match needed(tag)? {
        n @ 1..=65535 => Ok(n as usize),
        n => Err(format!("its `{}` is {n}", super::dataset::name_of(tag))),
    };
    if whole(tags::SAMPLES_PER_PIXEL).unwrap_or(1) != 1 {
        return Err(Refused::NoScalars("its pixels are colours; scalars are needed".into()));
    }
    let allocated = match needed(tags::BITS_ALLOCATED)? {
        n @ (32 | 64) if set.has_floats => n as u32,
        n @ (8 | 16 | 32) if !set.has_floats => n as u32,
        n => return Err(format!("its pixels have {n} bits; 8, 16 and 32 are read").into()),
    };
    let stored = whole(tags::BITS_STORED).unwrap_or(allocated.into());
    let high = whole(tags::HIGH_BIT).unwrap_or(stored - 1);
    if !(1..=i64::from(allocated)).contains(&stored) || !(stored - 1..allocated.into()).contains(&high) {
        return Err(format!("it stores {stored} bits up to bit {high} in pixels of {allocated}").into());
    }
    let layout = Layout {
        rows: size(tags::ROWS)?,
        columns: size(tags::COLUMNS)?,
        allocated,
        stored: stored as u32,
        high: high as u32,
        is_signed: whole(tags::PIXEL_REPRESENTATION) == Some(1),
        is_float: set.has_floats,
    };
    let frames = match whole(tags::NUMBER_OF_FRAMES).unwrap_or(1) {
        0 => 1,
        n if (1..=FRAMES_MOST as i64).contains(&n) => n as usize,
        n => return Err(format!("it has {n} frames").into()),
    };
    if frames == 1 {
        set.inflated = None;
    }
    Ok(Image { path: path.into(), set, layout, frames })
}

fn key(image: &Image) -> Key {
    let set = &image.set;
    let orientation = set
        .of_frame(0, tags::IMAGE_ORIENTATION_PATIENT)
        .and_then(|a| a.numbers(tags::IMAGE_ORIENTATION_PATIENT))
        .and_then(|v| <[f64; 6]>::try_from(v).ok());
    Key {
        number: set.root.whole(tags::SERIES_NUMBER).unwrap_or(0),
        uid: set.root.text(tags::SERIES_INSTANCE_UID).unwrap_or_default(),
        rows: image.layout.rows,
        columns: image.layout.columns,
        orientation: orientation.map(|v| v.map(|c| (c * 1e2).round() as i64)),
    }
}

/// Images sorted into series.
fn sorted(images: Vec<Image>) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for image in images {
        let key = key(&image);
        match all.iter_mut().find(|series| series.key.is_like(&key)) {
            Some(series) => series.images.push(image),
            None => all.push(Series::new(key, vec![image])),
        }
    }
    all.sort_by(|a, b| a.key.cmp(&b.key));
    all
}

/// The series that a path stands for: that of a file, or the one of a folder (`chosen`, from 1, where it holds several).
///
/// # Errors
/// There is none, or several and no choice.
pub(super) fn find(path: &Path, chosen: Option<usize>, loading: &Loading) -> Result<Series> {
    let refuse = |why: String| Error::input(WHAT, path.display(), why);
    if !path.is_dir() {
        if chosen.is_some() {
            let why = "it picks a series of a folder, and a file is of one";
            return Err(Error::input(WHAT, "--series", why));
        }
        let named = image(path).map_err(|e| refuse(e.why()))?;
        // An enhanced image is a series by itself.
        if named.frames > 1 {
            return Ok(Series::new(key(&named), vec![named]));
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let key = key(&named);
        let (images, faults) = images(&files_in(folder, 0), loading);
        let found = sorted(images).into_iter().find(|series| series.key.is_like(&key));
        return Ok(with_faults(found.unwrap_or_else(|| Series::new(key, vec![named])), &faults));
    }
    let files = files_in(path, DEPTH_MOST);
    if files.len() >= FILES_MOST {
        return Err(refuse(format!("it holds more than {FILES_MOST} files; name a folder within it")));
    }
    let (images, faults) = images(&files, loading);
    let mut all = sorted(images);
    loading.go_on(&path.display().to_string())?;
    let list = || {
        let lines = all.iter().take(20).enumerate().map(|(i, s)| format!("{}: {}", i + 1, s.summary()));
        lines.collect::<Vec<_>>().join("; ")
    };
    match (all.len(), chosen) {
        (0, _) => {
            let why = files.iter().filter(|f| is_dicom_file(f)).find_map(|f| image(f).err());
            let why = why.map_or_else(String::new, |why| format!(": of the first, {}", why.why()));
            Err(refuse(format!("it holds no DICOM images that can be read{why}")))
        }
        (1, None) => Ok(with_faults(all.swap_remove(0), &faults)),
        (n, Some(at)) if (1..=n).contains(&at) => Ok(with_faults(all.swap_remove(at - 1), &faults)),
        (n, Some(at)) => Err(Error::input(WHAT, "--series", format!("{at} is not in 1 to {n}")).hint(list())),
        (n, None) => Err(refuse(format!("it holds {n} series: --series N picks one")).hint(list())),
    }
}

/// A series that says which files were damaged.
fn with_faults(series: Series, faults: &[String]) -> Series {
    let first_fault = faults.first().cloned().unwrap_or_default();
    Series { damaged: faults.len(), first_fault, ..series }
}

/// Whether a file's first bytes say so.
fn is_dicom_file(path: &Path) -> bool {
    let mut head = [0; 160];
    let got = File::open(path).ok().and_then(|mut file| read_full(&mut file, &mut head).ok());
    got.is_some_and(|got| is_dicom(&head[..got]))
}

/// Whether a folder holds a DICOM file, at most a few folders down.
pub(super) fn holds_dicom(folder: &Path) -> bool {
    files_in(folder, DEPTH_MOST).par_iter().any(|file| is_dicom_file(file))
}

/// The images among some files, and what was wrong with those that should be images, or cannot be opened; whatever else lies
/// beside them is passed over.
fn images(files: &[PathBuf], loading: &Loading) -> (Vec<Image>, Vec<String>) {
    let pieces = loading.pieces(ReadingStage::Reading, 4 * files.len());
    let read: Vec<Result<Image, String>> = files
        .par_iter()
        .filter_map(|path| {
            if pieces.is_cancelled() {
                return None;
            }
            pieces.done();
            let named = |why: String| format!("{}: {why}", path.display());
            if let Err(e) = File::open(path) {
                return Some(Err(named(e.to_string())));
            }
            match is_dicom_file(path).then(|| image(path))? {
                Ok(image) => Some(Ok(image)),
                Err(Refused::NoScalars(_)) => None,
                Err(Refused::Damaged(why)) => Some(Err(named(why))),
            }
        })
        .collect();
    let (mut images, mut faults) = (Vec::new(), Vec::new());
    for one in read {
        match one {
            Ok(image) => images.push(image),
            Err(why) => faults.push(why),
        }
    }
    (images, faults)
}

/// The plain files of a folder and of those within it, by name.
fn files_in(folder: &Path, depth: usize) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![(folder.to_path_buf(), depth)];
    while let Some((folder, depth)) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let Ok(kind) = entry.metadata() else { continue };
            if kind.is_file() {
                files.push(entry.path());
            } else if kind.is_dir() && depth > 0 && !entry.file_type().is_ok_and(|t| t.is_symlink()) {
                folders.push((entry.path(), depth - 1));
            }
            if files.len() >= FILES_MOST {
                return files;
            }
        }
    }
    files.sort();
    files
}

/// One slice: a frame of an image, and where it lies in LPS mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slice {
    pub(super) image: usize,
    pub(super) frame: usize,
    pub(super) position: Option<DVec3>,
    /// What tells slices of one place apart: time, acquisition, number.
    pub(super) order: [i64; 3],
}

/// How far a frame without a position of its own lies from the first: by the offsets of a dose grid, or evenly.
fn offset_of(set: &DataSet, frame: usize) -> DVec3 {
    let numbers = |tag| set.of_frame(frame, tag).and_then(|a| a.numbers(tag));
    let normal = numbers(tags::IMAGE_ORIENTATION_PATIENT)
        .filter(|v| v.len() == 6)
        .map_or(DVec3::Z, |v| DVec3::new(v[0], v[1], v[2]).cross(DVec3::new(v[3], v[4], v[5])));
    let offsets = numbers(tags::GRID_FRAME_OFFSET_VECTOR).filter(|all| all.len() > frame);
    let spacing = numbers(tags::SPACING_BETWEEN_SLICES).or(numbers(tags::SLICE_THICKNESS));
    let spacing = spacing.map_or(1.0, |v| v[0].abs()).max(1e-6);
    normal * offsets.map_or(spacing * frame as f64, |all| all[frame] - all[0])
}

impl Series {
    /// Every frame of every image.
    pub(super) fn slices(&self) -> Vec<Slice> {
        let mut slices = Vec::new();
        for (at, Image { set, frames, .. }) in self.images.iter().enumerate() {
            for frame in 0..*frames {
                let numbers = |tag| set.of_frame(frame, tag).and_then(|a| a.numbers(tag));
                let whole = |tag| set.of_frame(frame, tag).and_then(|a| a.whole(tag));
                let position = numbers(tags::IMAGE_POSITION_PATIENT).filter(|p| p.len() == 3);
                let position = position.map(|p| DVec3::new(p[0], p[1], p[2]));
                let time = whole(tags::TEMPORAL_POSITION_INDEX).or(whole(tags::TEMPORAL_POSITION_IDENTIFIER));
                let order = [
                    time.unwrap_or(0),
                    whole(tags::ACQUISITION_NUMBER).unwrap_or(0),
                    whole(tags::INSTANCE_NUMBER).unwrap_or(0).saturating_mul(1 << 20) + frame as i64,
                ];
                // A file of several frames with one position says that of the first alone.
                let is_own = *frames == 1
                    || set.frames.get(frame).is_some_and(|a| a.has(tags::IMAGE_POSITION_PATIENT));
                let position = position.map(|p| if is_own { p } else { p + offset_of(set, frame) });
                slices.push(Slice { image: at, frame, position, order });
            }
        }
        slices.sort_by_key(|s| s.order);
        slices
    }
}
