//! Volume formats with a header of text lines, with the voxels in one file or in others: the common code of NRRD and
//! MetaImage.

use super::common::{frame_warning, numbers, refusal, with_integer_warning};
use super::data_files::DataFiles;
use super::slicer_segments::SegmentLayers;
use super::source::{Block, Source};
use crate::error::Result;
use crate::files::loading::Loading;
use crate::volume::{AffineSource, Provenance, Scaling, Segment, Volume};
use glam::DAffine3;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Largest accepted size of a text header of a volume file, in bytes.
const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Volume format with a text header (NRRD or MetaImage), defined by its parsing functions.
pub(super) struct TextFormat {
    pub(super) name: &'static str,
    /// Reads all fields of the text header of a volume file, up to the voxels.
    pub(super) fields: fn(&mut Lines<'_, '_>) -> Result<Fields, String>,
    /// Interprets the fields of the text header of a volume file. The returned voxel block describes the first frame.
    pub(super) description: fn(&Fields) -> Result<Description, String>,
    /// Locates the voxels of a volume. The arguments are the header fields, the path and size of the header, and
    /// whether the file is gzipped.
    pub(super) data: fn(&Fields, &Path, u64, bool) -> Result<DataFiles, String>,
}

/// Description of a volume by its text header (NRRD or MetaImage).
pub(super) struct Description {
    pub(super) block: Block,
    pub(super) frames: usize,
    pub(super) scaling: Scaling,
    pub(super) affine: (DAffine3, AffineSource),
    pub(super) segments: Vec<Segment>,
    /// Layers of overlapping segments. The voxel block then has one column for each voxel and layer.
    pub(super) layers: Option<SegmentLayers>,
    pub(super) warnings: Vec<String>,
}

impl TextFormat {
    /// Reads one frame of an NRRD or MetaImage volume, selected by its index from 0.
    pub(super) fn read(&self, path: &Path, frame: usize, loading: &Loading) -> Result<Volume> {
        let refuse = refusal(path);
        let mut source = Source::open(path, loading)?;
        let is_gzipped = source.is_compressed();
        let (fields, header_bytes) = self.header(&mut source).map_err(&refuse)?;
        drop(source);
        let Description { block, frames, scaling, affine, segments, layers, mut warnings } =
            (self.description)(&fields).map_err(&refuse)?;
        warnings.splice(0..0, frame_warning(path, frame, frames)?);
        let data = (self.data)(&fields, path, header_bytes, is_gzipped).map_err(&refuse)?;
        if layers.is_some() && loading.is_reducing() {
            return Err(refuse("its segments overlap (layers), so that it cannot be downsampled".into()));
        }
        let mut storage = data.open(&Block { frame, ..block }, frames, loading)?;
        if let Some(layers) = &layers {
            let [nx, ny, nz] = block.dims;
            storage = layers.merge(storage, [nx / layers.count, ny, nz], &mut warnings).map_err(&refuse)?;
        }
        let (world_from_index, affine_source) = affine;
        let provenance = Provenance {
            affine_source,
            frames,
            frame,
            segments,
            warnings,
            ..Provenance::new(path.display().to_string(), self.name, block.stored_type())
        };
        let volume = Volume::from_storage(storage, scaling, world_from_index, provenance, loading)?;
        Ok(with_integer_warning(volume, block.element))
    }

    /// Lists the header of an NRRD or MetaImage volume and the data files that it names.
    pub(super) fn files(&self, path: &Path) -> Result<Vec<PathBuf>> {
        let loading = Loading::default();
        let mut source = Source::open(path, &loading)?;
        let data =
            self.header(&mut source).and_then(|(fields, bytes)| (self.data)(&fields, path, bytes, false));
        let mut files = data.map_err(refusal(path))?.paths;
        files.retain(|file| file != path);
        files.insert(0, path.to_path_buf());
        Ok(files)
    }

    fn header(&self, source: &mut Source<'_>) -> Result<(Fields, u64), String> {
        let mut lines = Lines { source, bytes: 0 };
        Ok(((self.fields)(&mut lines)?, lines.bytes))
    }
}

/// Reader of the lines of a text header of a volume file, which counts the bytes read.
pub(super) struct Lines<'s, 'a> {
    source: &'s mut Source<'a>,
    bytes: u64,
}

impl Lines<'_, '_> {
    /// Returns the next line of the text header without its line end; `None` at the end of the file.
    ///
    /// # Errors
    /// The file cannot be read, or the header is longer than a megabyte.
    #[expect(clippy::unbuffered_bytes, reason = "the source has a buffer")]
    pub(super) fn next(&mut self) -> Result<Option<String>, String> {
        let mut line = Vec::new();
        for byte in self.source.by_ref().take(MAX_HEADER_BYTES + 1 - self.bytes).bytes() {
            line.push(byte.map_err(|e| e.to_string())?);
            if line.ends_with(b"\n") {
                break;
            }
        }
        self.bytes += line.len() as u64;
        if self.bytes > MAX_HEADER_BYTES {
            return Err("its header does not end within a megabyte".into());
        }
        // A comment in another encoding is no reason to refuse a volume.
        let text = String::from_utf8_lossy(&line);
        Ok((!line.is_empty()).then(|| text.trim_end_matches(['\r', '\n']).to_owned()))
    }
}

/// Fields of a text header (NRRD or MetaImage). Field names are compared without letter case.
#[derive(Debug, Default)]
pub(super) struct Fields {
    all: Vec<(String, String)>,
    /// Names of data files that follow the field `LIST`, one per line of the header.
    pub(super) list: Vec<String>,
}

impl Fields {
    pub(super) fn push(&mut self, name: &str, value: &str) {
        self.all.push((name.trim().to_lowercase(), value.trim().to_owned()));
    }

    /// Returns the value of the first field of a text header whose name is among `names`.
    pub(super) fn get(&self, names: &[&str]) -> Option<&str> {
        self.all.iter().find(|(name, _)| names.contains(&name.as_str())).map(|(_, value)| value.as_str())
    }

    /// Returns the fields of a text header whose lower-case names begin with `prefix`: the rest of each name, and the
    /// value.
    pub(super) fn with_prefix(&self, prefix: &str) -> impl Iterator<Item = (&str, &str)> {
        self.all.iter().filter_map(move |(name, value)| Some((name.strip_prefix(prefix)?, value.as_str())))
    }

    /// Returns the value of a required header field.
    ///
    /// # Errors
    /// The header field is missing.
    pub(super) fn required(&self, names: &[&str]) -> Result<&str, String> {
        self.get(names).ok_or_else(|| format!("its header has no `{}`", names[0]))
    }

    /// Parses exactly `count` finite numbers from a header field; `None` if the field is missing.
    ///
    /// # Errors
    /// The header field does not hold `count` finite numbers.
    pub(super) fn numbers(&self, names: &[&str], count: usize) -> Result<Option<Vec<f64>>, String> {
        let Some(text) = self.get(names) else { return Ok(None) };
        let all = numbers(text).ok_or_else(|| unreadable(names[0], text))?;
        if all.len() != count {
            return Err(format!("its `{}` has {} numbers, not {count}", names[0], all.len()));
        }
        Ok(Some(all))
    }

    /// Parses the positive integer sizes of a header field.
    ///
    /// # Errors
    /// The header field is missing or holds something else.
    pub(super) fn sizes(&self, names: &[&str]) -> Result<Vec<usize>, String> {
        let text = self.required(names)?;
        let sizes: Option<Vec<usize>> = text.split_whitespace().map(|n| n.parse().ok()).collect();
        sizes.filter(|s| s.iter().all(|&n| n > 0)).ok_or_else(|| unreadable(names[0], text))
    }
}

/// Returns the error text for a header field that cannot be interpreted.
pub(super) fn unreadable(name: &str, text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    format!("its `{name}` is `{short}`")
}

/// Returns grid size and number of frames from the sizes of all axes of an array. Axes after the third count frames.
///
/// # Errors
/// There are fewer than two axes, or the number of frames overflows.
pub(super) fn grid(sizes: &[usize]) -> Result<([usize; 3], usize), String> {
    if sizes.len() < 2 {
        return Err(format!("it has {} axis, and a volume two or three", sizes.len()));
    }
    let at = |axis: usize| sizes.get(axis).copied().unwrap_or(1);
    let frames = sizes.iter().skip(3).try_fold(1usize, |frames, &n| frames.checked_mul(n));
    Ok(([at(0), at(1), at(2)], frames.ok_or("its number of frames cannot be counted")?))
}
