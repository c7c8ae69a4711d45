//! Groups the DICOM files of a folder into series; each series is one volume.

use super::dataset::{DataSet, MAX_FRAMES, PixelData, printable};
use super::elements::is_dicom;
use super::pixels::{Fault, Layout};
use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage};
use crate::volume::read::read_full;
use dicom_dictionary_std::tags;
use glam::DVec3;
use rayon::prelude::*;
use std::fs::File;
use std::path::{Path, PathBuf};
use walkdir::{DirEntry, WalkDir};

pub(super) const WHAT: &str = "cannot read DICOM series";
/// Limits of the search for DICOM files in a folder: largest number of files and largest folder depth.
const MAX_FILES: usize = 200_000;
const MAX_DEPTH: usize = 8;

/// DICOM image file with one or more frames.
#[derive(Debug)]
pub(super) struct Image {
    pub(super) path: PathBuf,
    pub(super) set: DataSet,
    pub(super) layout: Layout,
    pub(super) frames: usize,
}

/// DICOM series: image files of one acquisition that have the same image size and orientation.
#[derive(Debug)]
pub(super) struct Series {
    pub(super) images: Vec<Image>,
    /// Number of damaged DICOM files in the folder of the series, and the error text of the first one.
    pub(super) damaged: usize,
    pub(super) first_fault: String,
    /// Number of the damaged files that were found only when their pixels were decoded.
    undecodable: usize,
    key: Key,
}

/// Key that identifies a DICOM series. The order of these keys is the order in which series are listed.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    number: i64,
    uid: String,
    rows: usize,
    columns: usize,
    /// Directions of image rows and columns (ImageOrientationPatient), times 100 and rounded. Images with other
    /// directions, such as localisers, form their own series.
    orientation: Option<[i64; 6]>,
}

impl Key {
    /// Whether two DICOM files belong to one series. The image directions may differ by rounding.
    fn matches(&self, other: &Self) -> bool {
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
        Self { images, key, damaged: 0, undecodable: 0, first_fault: String::new() }
    }

    /// Returns a pixel format that can hold the pixel values of all files of a DICOM series.
    pub(super) fn widest_layout(&self) -> Layout {
        let mut widest = self.images[0].layout;
        for Image { layout, .. } in &self.images {
            // Signed and unsigned values together need one bit more.
            let mixed = u32::from(layout.is_signed != widest.is_signed);
            widest.stored = (layout.stored.max(widest.stored) + mixed).min(32);
            widest.is_signed |= layout.is_signed;
            widest.is_float |= layout.is_float;
            widest.allocated = widest.allocated.max(layout.allocated);
        }
        widest
    }

    /// Removes the image file whose pixels cannot be decoded, and counts it among the damaged files.
    ///
    /// # Errors
    /// The fault belongs to no file or to the file `named` by the user, or `most` files of the folder are damaged.
    pub(super) fn skip_damaged(&mut self, fault: Fault, named: &Path, most: usize) -> Result<(), String> {
        let is_last = self.images.len() == 1 || self.undecodable == most;
        let at = fault.image.filter(|at| !is_last && self.images[*at].path != named);
        self.images.remove(at.ok_or_else(|| fault.why.clone())?);
        self.damaged += 1;
        self.undecodable += 1;
        if self.first_fault.is_empty() {
            self.first_fault = fault.why;
        }
        Ok(())
    }

    /// Describes a DICOM series in one line, without names of people.
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

/// Reason why a file cannot be used as an image of a DICOM series.
#[derive(Debug)]
pub(super) enum Refused {
    /// The DICOM file is valid but holds no scalar image.
    NoScalars(String),
    /// The DICOM file is damaged or cannot be read.
    Damaged(String),
}

impl Refused {
    pub(super) fn why(self) -> String {
        let (Self::NoScalars(why) | Self::Damaged(why)) = self;
        why
    }
}

impl From<String> for Refused {
    fn from(why: String) -> Self {
        Self::Damaged(why)
    }
}

/// Reads the attributes and the pixel format of a DICOM image file.
///
/// # Errors
/// The file is no DICOM file, has no scalar pixels, or its attributes contradict each other.
pub(super) fn image(path: &Path) -> Result<Image, Refused> {
    let mut set = DataSet::read(path)?;
    if set.pixels == PixelData::None {
        return Err(Refused::NoScalars("it is a DICOM file without an image".into()));
    }
    if set.is_segmentation() {
        return Err(Refused::NoScalars(
            "it is a segmentation (SEG), which is read as a file of its own".into(),
        ));
    }
    let layout = layout(&set)?;
    let frames = match set.root.integer(tags::NUMBER_OF_FRAMES).unwrap_or(1) {
        0 => 1,
        n if (1..=MAX_FRAMES as i64).contains(&n) => n as usize,
        n => return Err(format!("it has {n} frames").into()),
    };
    if frames == 1 {
        set.inflated = None;
    }
    Ok(Image { path: path.into(), set, layout, frames })
}

/// Reads the pixel format of a DICOM image.
///
/// # Errors
/// The pixels are no scalars, or the attributes contradict each other.
pub(super) fn layout(set: &DataSet) -> Result<Layout, Refused> {
    let integer = |tag| set.root.integer(tag);
    let needed = |tag| integer(tag).ok_or_else(|| format!("it has no `{}`", super::dataset::name_of(tag)));
    let size = |tag| match needed(tag)? {
        n @ 1..=65535 => Ok(n as usize),
        n => Err(format!("its `{}` is {n}", super::dataset::name_of(tag))),
    };
    if integer(tags::SAMPLES_PER_PIXEL).unwrap_or(1) != 1 {
        return Err(Refused::NoScalars("its pixels are colours; scalars are needed".into()));
    }
    let allocated = match needed(tags::BITS_ALLOCATED)? {
        n @ (32 | 64) if set.has_floats => n as u32,
        n @ (8 | 16 | 32) if !set.has_floats => n as u32,
        n => return Err(format!("its pixels have {n} bits; 8, 16 and 32 are read").into()),
    };
    let stored = integer(tags::BITS_STORED).unwrap_or(allocated.into());
    let high = integer(tags::HIGH_BIT).unwrap_or(stored - 1);
    if !(1..=i64::from(allocated)).contains(&stored) || !(stored - 1..allocated.into()).contains(&high) {
        return Err(format!("it stores {stored} bits up to bit {high} in pixels of {allocated}").into());
    }
    Ok(Layout {
        rows: size(tags::ROWS)?,
        columns: size(tags::COLUMNS)?,
        allocated,
        stored: stored as u32,
        high: high as u32,
        is_signed: integer(tags::PIXEL_REPRESENTATION) == Some(1),
        is_float: set.has_floats,
    })
}

fn key(image: &Image) -> Key {
    let set = &image.set;
    let orientation = set
        .of_frame(0, tags::IMAGE_ORIENTATION_PATIENT)
        .and_then(|a| a.numbers(tags::IMAGE_ORIENTATION_PATIENT))
        .and_then(|v| <[f64; 6]>::try_from(v).ok());
    Key {
        number: set.root.integer(tags::SERIES_NUMBER).unwrap_or(0),
        uid: set.root.text(tags::SERIES_INSTANCE_UID).unwrap_or_default(),
        rows: image.layout.rows,
        columns: image.layout.columns,
        orientation: orientation.map(|v| v.map(|c| (c * 1e2).round() as i64)),
    }
}

/// Groups DICOM images into series, and sorts the series.
fn grouped(images: Vec<Image>) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for image in images {
        let key = key(&image);
        match all.iter_mut().find(|series| series.key.matches(&key)) {
            Some(series) => series.images.push(image),
            None => all.push(Series::new(key, vec![image])),
        }
    }
    all.sort_by(|a, b| a.key.cmp(&b.key));
    all
}

/// Finds all DICOM series of a folder, at least one, and the error texts of damaged files.
///
/// # Errors
/// The folder holds no DICOM images that can be read, or too many files.
pub(super) fn all(folder: &Path, loading: &Loading) -> Result<(Vec<Series>, Vec<String>)> {
    let refuse = |why: String| Error::input(WHAT, folder.display(), why);
    let files = files_in(folder, MAX_DEPTH);
    if files.len() >= MAX_FILES {
        return Err(refuse(format!("it holds more than {MAX_FILES} files; name a folder within it")));
    }
    let (images, faults) = images(&files, loading);
    let all = grouped(images);
    loading.go_on(&folder.display().to_string())?;
    if all.is_empty() {
        let why = files.iter().filter(|f| is_dicom_file(f)).find_map(|f| image(f).err());
        let why = why.map_or_else(String::new, |why| format!(": of the first, {}", why.why()));
        return Err(refuse(format!("it holds no DICOM images that can be read{why}")));
    }
    Ok((all, faults))
}

/// Finds the DICOM series that a file belongs to, or the series of a folder that `chosen` (an index from 1) selects.
///
/// # Errors
/// The path holds no DICOM series, or several series and `chosen` selects none.
pub(super) fn find(path: &Path, chosen: Option<usize>, loading: &Loading) -> Result<Series> {
    let refuse = |why: String| Error::input(WHAT, path.display(), why);
    if !path.is_dir() {
        if chosen.is_some() {
            let why = "it selects a series of a folder, and a file belongs to one series";
            return Err(Error::input(WHAT, "--series", why));
        }
        let named = image(path).map_err(|e| refuse(e.why()))?;
        // A multi-frame image is a series by itself.
        if named.frames > 1 {
            return Ok(Series::new(key(&named), vec![named]));
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let key = key(&named);
        let (images, faults) = images(&files_in(folder, 0), loading);
        let found = grouped(images).into_iter().find(|series| series.key.matches(&key));
        return Ok(with_faults(found.unwrap_or_else(|| Series::new(key, vec![named])), &faults));
    }
    let (mut all, faults) = all(path, loading)?;
    let list = || {
        let lines = all.iter().take(20).enumerate().map(|(i, s)| format!("{}: {}", i + 1, s.summary()));
        lines.collect::<Vec<_>>().join("; ")
    };
    match (all.len(), chosen) {
        (1, None) => Ok(with_faults(all.swap_remove(0), &faults)),
        (n, Some(at)) if (1..=n).contains(&at) => Ok(with_faults(all.swap_remove(at - 1), &faults)),
        (n, Some(at)) => Err(Error::input(WHAT, "--series", format!("{at} is not in 1 to {n}")).hint(list())),
        (n, None) => Err(refuse(format!("it holds {n} series: --series N selects one")).hint(list())),
    }
}

/// Stores the number of damaged DICOM files in the folder, and the error text of the first one, in a DICOM series.
fn with_faults(series: Series, faults: &[String]) -> Series {
    let first_fault = faults.first().cloned().unwrap_or_default();
    Series { damaged: faults.len(), first_fault, ..series }
}

/// Whether the first bytes of a file are those of a DICOM file.
fn is_dicom_file(path: &Path) -> bool {
    let mut head = [0; 160];
    let got = File::open(path).ok().and_then(|mut file| read_full(&mut file, &mut head).ok());
    got.is_some_and(|got| is_dicom(&head[..got]))
}

/// Whether a folder or its subfolders hold a DICOM file.
pub(super) fn holds_dicom(folder: &Path) -> bool {
    files_in(folder, MAX_DEPTH).par_iter().any(|file| is_dicom_file(file))
}

/// Reads all DICOM images among `files`, and returns them with the error texts of damaged files. Files of other
/// formats are skipped.
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
    let (images, faults): (Vec<_>, Vec<_>) = read.into_iter().partition(Result::is_ok);
    (images.into_iter().flatten().collect(), faults.into_iter().filter_map(Result::err).collect())
}

/// Lists the files of a folder and its subfolders, down to `depth` levels, sorted by path.
fn files_in(folder: &Path, depth: usize) -> Vec<PathBuf> {
    let entries = WalkDir::new(folder).max_depth(1 + depth).into_iter().flatten();
    let files = entries.filter(|entry| entry.file_type().is_file()).map(DirEntry::into_path);
    let mut files: Vec<PathBuf> = files.take(MAX_FILES).collect();
    files.sort();
    files
}

/// One frame of a DICOM image file, with its position in LPS mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slice {
    pub(super) image: usize,
    pub(super) frame: usize,
    pub(super) position: Option<DVec3>,
    /// Sort key of DICOM slices at one position: temporal position, acquisition number, instance number.
    pub(super) order: [i64; 3],
}

/// Returns the offset of a DICOM frame from the first frame of its file, in LPS mm, for a frame without a position.
/// Uses the offsets of the dose grid (GridFrameOffsetVector), or equal spacing.
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
    /// Returns all slices (image frames) of a DICOM series, ordered by time, acquisition number and instance number.
    pub(super) fn slices(&self) -> Vec<Slice> {
        let mut slices = Vec::new();
        for (at, Image { set, frames, .. }) in self.images.iter().enumerate() {
            let own = set.root.items(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE);
            for frame in 0..*frames {
                let numbers = |tag| set.of_frame(frame, tag).and_then(|a| a.numbers(tag));
                let integer = |tag| set.of_frame(frame, tag).and_then(|a| a.integer(tag));
                let position = numbers(tags::IMAGE_POSITION_PATIENT).filter(|p| p.len() == 3);
                let position = position.map(|p| DVec3::new(p[0], p[1], p[2]));
                let time =
                    integer(tags::TEMPORAL_POSITION_INDEX).or(integer(tags::TEMPORAL_POSITION_IDENTIFIER));
                let order = [
                    time.unwrap_or(0),
                    integer(tags::ACQUISITION_NUMBER).unwrap_or(0),
                    integer(tags::INSTANCE_NUMBER).unwrap_or(0).saturating_mul(1 << 20) + frame as i64,
                ];
                // A single position in a multi-frame file is that of the first frame.
                let is_own =
                    *frames == 1 || own.get(frame).is_some_and(|a| a.has(tags::IMAGE_POSITION_PATIENT));
                let position = position.map(|p| if is_own { p } else { p + offset_of(set, frame) });
                slices.push(Slice { image: at, frame, position, order });
            }
        }
        slices.sort_by_key(|s| s.order);
        slices
    }
}
