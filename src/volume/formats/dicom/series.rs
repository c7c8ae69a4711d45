//! The files of a folder, sorted into series: what belongs into one volume.

use super::dataset::{DataSet, PixelData, is_dicom, printable};
use super::pixels::Layout;
use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage};
use crate::volume::element::read_full;
use dicom_dictionary_std::tags;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;
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
    key: Key,
}

/// What all images of a series share; the order in which series are listed.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    number: i64,
    uid: String,
    layout: Layout,
    /// Directions of rows and columns in thousandths: a localiser lies across the slices that it shows.
    orientation: Option<[i64; 6]>,
}

impl Series {
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

/// Reads a file that may be an image.
///
/// # Errors
/// It is no DICOM file, has no pixels, or its attributes contradict each other; in words.
pub(super) fn image(path: &Path) -> Result<Image, String> {
    let set = DataSet::read(path)?;
    if set.pixels == PixelData::None {
        return Err("it is a DICOM file without an image".into());
    }
    let whole = |tag| set.root.whole(tag);
    let needed = |tag| whole(tag).ok_or_else(|| format!("it has no `{}`", super::dataset::name_of(tag)));
    let size = |tag| match needed(tag)? {
        n @ 1..=65535 => Ok(n as usize),
        n => Err(format!("its `{}` is {n}", super::dataset::name_of(tag))),
    };
    if whole(tags::SAMPLES_PER_PIXEL).unwrap_or(1) != 1 {
        return Err("its pixels are colours; scalars are needed".into());
    }
    let allocated = match needed(tags::BITS_ALLOCATED)? {
        n @ (8 | 16 | 32) => n as u32,
        n => return Err(format!("its pixels have {n} bits; 8, 16 and 32 are read")),
    };
    let stored = whole(tags::BITS_STORED).unwrap_or(allocated.into());
    let high = whole(tags::HIGH_BIT).unwrap_or(stored - 1);
    if !(1..=i64::from(allocated)).contains(&stored) || !(stored - 1..allocated.into()).contains(&high) {
        return Err(format!("it stores {stored} bits up to bit {high} in pixels of {allocated}"));
    }
    let layout = Layout {
        rows: size(tags::ROWS)?,
        columns: size(tags::COLUMNS)?,
        allocated,
        stored: stored as u32,
        high: high as u32,
        is_signed: whole(tags::PIXEL_REPRESENTATION) == Some(1),
    };
    let frames = match whole(tags::NUMBER_OF_FRAMES).unwrap_or(1) {
        0 => 1,
        n @ 1..=1_000_000 => n as usize,
        n => return Err(format!("it has {n} frames")),
    };
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
        layout: image.layout,
        orientation: orientation.map(|v| v.map(|c| (c * 1e3).round() as i64)),
    }
}

/// Images sorted into series.
fn sorted(images: Vec<Image>) -> Vec<Series> {
    let mut by_key: BTreeMap<Key, Vec<Image>> = BTreeMap::new();
    for image in images {
        by_key.entry(key(&image)).or_default().push(image);
    }
    by_key.into_iter().map(|(key, images)| Series { images, key }).collect()
}

/// The series that a path stands for: that of a file, or the one of a folder (`chosen`, from 1, where it holds several).
///
/// # Errors
/// There is none, or several and no choice.
pub(super) fn find(path: &Path, chosen: Option<usize>, loading: &Loading) -> Result<Series> {
    let refuse = |why: String| Error::input(WHAT, path.display(), why);
    if !path.is_dir() {
        let named = image(path).map_err(refuse)?;
        // An enhanced image is a series by itself.
        if named.frames > 1 {
            return Ok(Series { key: key(&named), images: vec![named] });
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let key = key(&named);
        let all = sorted(images(&files_in(folder, 0), loading));
        let found = all.into_iter().find(|series| series.key == key);
        return Ok(found.unwrap_or(Series { key, images: vec![named] }));
    }
    let files = files_in(path, DEPTH_MOST);
    if files.len() >= FILES_MOST {
        return Err(refuse(format!("it holds more than {FILES_MOST} files; name a folder within it")));
    }
    let mut all = sorted(images(&files, loading));
    loading.go_on(&path.display().to_string())?;
    let list = || {
        let lines = all.iter().take(20).enumerate().map(|(i, s)| format!("{}: {}", i + 1, s.summary()));
        lines.collect::<Vec<_>>().join("; ")
    };
    match (all.len(), chosen) {
        (0, _) => {
            let why = files.iter().find_map(|f| image(f).err().filter(|_| is_dicom_file(f)));
            let why = why.map_or_else(String::new, |why| format!(": of the first, {why}"));
            Err(refuse(format!("it holds no DICOM images that can be read{why}")))
        }
        (1, None) => Ok(all.swap_remove(0)),
        (n, Some(at)) if (1..=n).contains(&at) => Ok(all.swap_remove(at - 1)),
        (n, Some(at)) => Err(Error::input(WHAT, "--series", format!("{at} is not in 1 to {n}")).hint(list())),
        (n, None) => Err(refuse(format!("it holds {n} series: --series N picks one")).hint(list())),
    }
}

/// Whether a file's first bytes say so.
fn is_dicom_file(path: &Path) -> bool {
    let mut head = [0; 160];
    let got = File::open(path).ok().and_then(|mut file| read_full(&mut file, &mut head).ok());
    got.is_some_and(|got| is_dicom(&head[..got]))
}

/// Whether a folder holds a DICOM file, at most a few folders down.
pub(super) fn holds_dicom(folder: &Path) -> bool {
    files_in(folder, DEPTH_MOST).iter().take(1000).any(|file| is_dicom_file(file))
}

/// The images among some files; whatever else lies beside them is passed over.
fn images(files: &[PathBuf], loading: &Loading) -> Vec<Image> {
    let pieces = loading.pieces(ReadingStage::Reading, 4 * files.len());
    files
        .par_iter()
        .filter_map(|path| {
            if pieces.is_cancelled() {
                return None;
            }
            pieces.done();
            is_dicom_file(path).then(|| image(path).ok()).flatten()
        })
        .collect()
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
                let position = position.filter(|_| *frames == 1 || set.frames.len() > frame);
                slices.push(Slice { image: at, frame, position, order });
            }
        }
        slices.sort_by_key(|s| s.order);
        slices
    }
}
