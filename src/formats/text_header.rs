//! Headers of lines, the files that they name, and voxels as text: what NRRD and MetaImage share.

use super::parts;
use super::source::{Block, Packing, Source};
use super::text_numbers::TextNumbers;
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::volume::Voxels;
use crate::volume::element::{ByteOrder, ReadFailure, read_voxels};
use glam::{DAffine3, DMat3, DVec3};
use std::io::{self, Read};
use std::path::PathBuf;

/// A header longer than this is none.
const HEADER_MOST_BYTES: u64 = 1 << 20;

/// Where lines are taken from, and how many bytes they took.
pub(super) struct Lines<'s, 'a> {
    source: &'s mut Source<'a>,
    pub(super) bytes: u64,
}

impl<'s, 'a> Lines<'s, 'a> {
    pub(super) fn new(source: &'s mut Source<'a>) -> Self {
        Self { source, bytes: 0 }
    }

    /// The next line without its end; `None` at the end of the file.
    ///
    /// # Errors
    /// The file cannot be read, or a megabyte holds no end of the header.
    pub(super) fn next(&mut self) -> Result<Option<String>, String> {
        let mut line = Vec::new();
        let mut byte = [0];
        loop {
            match self.source.read(&mut byte) {
                Ok(0) if line.is_empty() => return Ok(None),
                Ok(0) => break,
                Ok(_) => self.bytes += 1,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(e.to_string()),
            }
            if self.bytes > HEADER_MOST_BYTES {
                return Err("its header does not end within a megabyte".into());
            }
            if byte[0] == b'\n' {
                break;
            }
            line.push(byte[0]);
        }
        if line.last() == Some(&b'\r') {
            line.pop();
        }
        // A comment in another encoding is no reason to refuse a volume.
        Ok(Some(String::from_utf8_lossy(&line).into_owned()))
    }
}

/// Fields of a header, by names that are compared without letter case.
#[derive(Debug, Default)]
pub(super) struct Fields {
    all: Vec<(String, String)>,
    /// Names of files that stand in lines of their own.
    pub(super) list: Vec<String>,
}

impl Fields {
    pub(super) fn push(&mut self, name: &str, value: &str) {
        self.all.push((name.trim().to_lowercase(), value.trim().to_owned()));
    }

    /// The first field of one of these names.
    pub(super) fn get(&self, names: &[&str]) -> Option<&str> {
        self.all.iter().find(|(name, _)| names.contains(&name.as_str())).map(|(_, value)| value.as_str())
    }

    /// As [`Self::get`].
    ///
    /// # Errors
    /// There is none.
    pub(super) fn needed(&self, names: &[&str]) -> Result<&str, String> {
        self.get(names).ok_or_else(|| format!("its header has no `{}`", names[0]))
    }

    /// Numbers apart by blanks; `None` where the field is not there.
    ///
    /// # Errors
    /// One of them is none, or not finite.
    pub(super) fn numbers(&self, names: &[&str]) -> Result<Option<Vec<f64>>, String> {
        self.get(names).map(|text| numbers(text).ok_or_else(|| unreadable(names[0], text))).transpose()
    }

    /// As [`Self::numbers`], exactly `N` of them.
    ///
    /// # Errors
    /// As there, or there are fewer or more.
    pub(super) fn exactly(&self, names: &[&str], count: usize) -> Result<Option<Vec<f64>>, String> {
        match self.numbers(names)? {
            Some(all) if all.len() != count => {
                Err(format!("its `{}` has {} numbers, not {count}", names[0], all.len()))
            }
            other => Ok(other),
        }
    }

    /// Sizes above 0, apart by blanks.
    ///
    /// # Errors
    /// The field is not there, or holds something else.
    pub(super) fn sizes(&self, names: &[&str]) -> Result<Vec<usize>, String> {
        let text = self.needed(names)?;
        let sizes: Option<Vec<usize>> = text.split_whitespace().map(|n| n.parse().ok()).collect();
        sizes.filter(|s| s.iter().all(|&n| n > 0)).ok_or_else(|| unreadable(names[0], text))
    }
}

/// Why a field is refused.
pub(super) fn unreadable(name: &str, text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    format!("its `{name}` is `{short}`")
}

/// Finite numbers apart by blanks.
pub(super) fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split_whitespace().map(|n| n.parse::<f64>().ok().filter(|v| v.is_finite())).collect()
}

/// The grid of a file with `sizes` along its axes, and its frames: what follows after three axes.
///
/// # Errors
/// Fewer than two axes, or more frames than can be counted.
pub(super) fn grid(sizes: &[usize]) -> Result<([usize; 3], usize), String> {
    if sizes.len() < 2 {
        return Err(format!("it has {} axis, and a volume two or three", sizes.len()));
    }
    let at = |axis: usize| sizes.get(axis).copied().unwrap_or(1);
    let frames = sizes.iter().skip(3).try_fold(1usize, |frames, &n| frames.checked_mul(n));
    Ok(([at(0), at(1), at(2)], frames.ok_or("its number of frames cannot be counted")?))
}

/// World mm (RAS+) from index coordinates, of directions and an origin in mm; `lps` where their first two coordinates
/// go to the left and to the back, as those of DICOM and ITK do.
pub(super) fn affine(directions: [DVec3; 3], origin: DVec3, lps: bool) -> DAffine3 {
    let affine = DAffine3::from_mat3_translation(
        DMat3::from_cols(directions[0], directions[1], directions[2]),
        origin,
    );
    match lps {
        true => DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0)) * affine,
        false => affine,
    }
}

/// How the voxels are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Raw,
    Deflate,
    Text,
}

/// Where the voxels of a header lie.
pub(super) struct Data {
    /// The file, or several with as many voxels in each.
    pub(super) paths: Vec<PathBuf>,
    pub(super) encoding: Encoding,
    /// Bytes of the file before them, packed or not.
    pub(super) start: u64,
    /// Bytes before them once unpacked; `None` where they are the last of the file.
    pub(super) skip: Option<u64>,
    /// The file is gzipped as a whole, and `start` counts unpacked bytes.
    pub(super) in_gzip: bool,
}

impl Data {
    /// Reads one frame.
    ///
    /// # Errors
    /// The file cannot be read or holds fewer voxels than claimed.
    pub(super) fn read(&self, block: &Block, frames: usize, loading: &Loading) -> Result<Voxels> {
        let Some(path) = self.paths.first() else {
            return Err(Error::input("cannot read volume", "its header", "it names no file"));
        };
        let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
        if self.in_gzip {
            let (Encoding::Raw, Some(skip)) = (self.encoding, self.skip) else {
                return Err(refuse("it is packed twice, or as text: unpack the .gz first".into()));
            };
            let mut source = Source::open(path, loading)?;
            let offset = self.start.saturating_add(skip);
            return Block { offset, ..*block }.read(&mut source, 0).map_err(refuse);
        }
        let packing = match self.encoding {
            Encoding::Deflate => Packing::Deflate,
            Encoding::Raw | Encoding::Text => Packing::Plain,
        };
        if self.paths.len() > 1 {
            return match (self.encoding, self.skip) {
                (Encoding::Raw | Encoding::Deflate, Some(skip)) => {
                    parts::read(&self.paths, packing, self.start, skip, block, frames, loading)
                }
                _ => Err(refuse("its voxels are text, or last, in several files, which is not read".into())),
            };
        }
        let mut source = Source::open_at(path, self.start, packing, loading)?;
        if self.encoding == Encoding::Text {
            return read_text(&mut source, block).map_err(refuse);
        }
        let offset = match self.skip {
            Some(skip) => skip,
            None => {
                let all = block.bytes().and_then(|bytes| bytes.checked_mul(frames as u64));
                let from = all.and_then(|bytes| source.most_bytes().checked_sub(bytes));
                from.filter(|_| self.encoding == Encoding::Raw)
                    .ok_or_else(|| refuse("it is shorter than the voxels that its header claims".into()))?
            }
        };
        Block { offset, ..*block }.read(&mut source, 0).map_err(refuse)
    }
}

/// Voxels written as numbers apart by blanks or commas.
fn read_text(source: &mut Source<'_>, block: &Block) -> Result<Voxels, String> {
    let [nx, ny, nz] = block.dims;
    let count = nx.checked_mul(ny).and_then(|n| n.checked_mul(nz));
    let skipped = count.and_then(|n| n.checked_mul(block.frame));
    let (Some(count), Some(skipped)) = (count, skipped) else {
        return Err("its header claims more voxels than can be counted".into());
    };
    // A number and its blank take two bytes at the least.
    let most = source.most_bytes() / 2 + 1;
    if (count as u64).saturating_add(skipped as u64) > most {
        return Err(format!("its header claims {nx}x{ny}x{nz} voxels, but it holds {most} numbers at most"));
    }
    let mut numbers = TextNumbers::new(source, block.element, count as u64);
    if !numbers.skip(skipped as u64).map_err(|e| e.to_string())? {
        return Err(format!("its text ends before frame {}", block.frame));
    }
    let size = block.element.bytes() as u64;
    read_voxels(&mut numbers, block.dims, block.element, ByteOrder::Little).map_err(|failure| match failure {
        ReadFailure::Short { got } => format!("its text ends after {} of {count} voxels", got / size),
        other => other.to_string(),
    })
}
