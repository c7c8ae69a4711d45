//! Data files of an NRRD or MetaImage header: one file, a list of files, or a numbered file-name pattern.

use super::common::{refusal, sibling};
use super::source::{Block, Compression, Source};
use super::text_numbers::TextNumbers;
use crate::error::Result;
use crate::files::loading::Loading;
use crate::files::memory_budget;
use crate::volume::element::grid_bytes;
use crate::volume::read::{ReadFailure, read_voxels};
use crate::volume::{ByteOrder, VoxelStorage, Voxels};
use std::io::{self, Read, Take};
use std::path::{Path, PathBuf};

/// Largest accepted number of data files of one volume.
const MAX_FILES: usize = 1 << 16;
/// Largest accepted width of the number in a file-name pattern such as `s%03d.raw`, in digits.
const MAX_DIGITS: usize = 32;

/// Encoding of the voxels in a data file: raw bytes, deflate-compressed bytes, or text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Raw,
    Deflate,
    Text,
}

/// Location and encoding of the voxels that an NRRD or MetaImage header describes.
pub(super) struct DataFiles {
    /// Paths of the files that hold the voxels of a volume: one file, or several with equal shares of the voxels.
    pub(super) paths: Vec<PathBuf>,
    pub(super) encoding: Encoding,
    /// Offset of the encoded voxels in each data file, in bytes.
    pub(super) start: u64,
    /// Number of decompressed bytes to skip before the voxels of a data file; `None` if the voxels are the last bytes
    /// of the file.
    pub(super) skip: Option<u64>,
    /// Whether the whole volume file, header included, is gzipped. The offset of the voxels then counts decompressed
    /// bytes.
    pub(super) is_gzipped: bool,
}

impl DataFiles {
    /// Opens the voxels of one frame (such as a time point) of a volume in its data files.
    ///
    /// # Errors
    /// A data file cannot be read, or holds fewer voxels than its header claims.
    pub(super) fn open(&self, block: &Block, frames: usize, loading: &Loading) -> Result<VoxelStorage> {
        let path = &self.paths[0];
        let refuse = refusal(path);
        let compression = match self.encoding {
            _ if self.is_gzipped => Compression::Detected,
            Encoding::Deflate => Compression::Deflate,
            Encoding::Raw | Encoding::Text => Compression::None,
        };
        let (start, offset) = match (self.encoding, self.skip, self.is_gzipped) {
            (Encoding::Raw, Some(skip), true) => (0, Some(self.start.saturating_add(skip))),
            (_, _, true) => {
                return Err(refuse("it is compressed twice, or as text: decompress the .gz first".into()));
            }
            (_, skip, false) => (self.start, skip),
        };
        if self.paths.len() > 1 {
            return match (self.encoding, offset) {
                (Encoding::Raw | Encoding::Deflate, Some(skip)) => self
                    .read_split(compression, skip, block, frames, loading)
                    .map(VoxelStorage::from)
                    .map_err(refuse),
                _ => Err(refuse(
                    "text, or voxels at the end of a file, in several files is not supported".into(),
                )),
            };
        }
        let mut source = Source::open_at(path, start, compression, loading)?;
        if self.encoding == Encoding::Text {
            return read_text(&mut source, block).map(VoxelStorage::from).map_err(refuse);
        }
        let from_end = || {
            let all = block.bytes()?.checked_mul(frames as u64)?;
            source.max_bytes().checked_sub(all).filter(|_| self.encoding == Encoding::Raw)
        };
        let offset = offset.or_else(from_end);
        let offset =
            offset.ok_or_else(|| refuse("it is shorter than the voxels that its header claims".into()))?;
        Block { offset, ..*block }.open(&mut source, 0).map_err(refuse)
    }

    /// Reads the voxels of one frame (such as a time point) of a volume, which may span several data files.
    fn read_split(
        &self,
        compression: Compression,
        skip: u64,
        block: &Block,
        frames: usize,
        loading: &Loading,
    ) -> Result<Voxels, String> {
        let all = block.bytes().and_then(|bytes| Some((bytes, bytes.checked_mul(frames as u64)?)));
        let (frame_bytes, all) = all.ok_or("its header claims more bytes than can be counted")?;
        let count = self.paths.len() as u64;
        if all % count != 0 || all / count == 0 {
            return Err(format!(
                "its header claims {all} bytes in {count} files, which is no whole number in each"
            ));
        }
        memory_budget::refuse_beyond_host(grid_bytes(block.dims, block.element.memory_bytes()))?;
        let (first, each) = (frame_bytes * block.frame as u64, all / count);
        let open = |path: &PathBuf| {
            let named = |why: String| format!("{}: {why}", path.display());
            let mut source =
                Source::open_at(path, self.start, compression, loading).map_err(|e| named(e.why))?;
            let wanted = skip.saturating_add(each);
            if wanted > source.max_bytes() {
                return Err(named(format!("{wanted} bytes of voxels are claimed in it, and it is shorter")));
            }
            let skipped = io::copy(&mut source.by_ref().take(skip), &mut io::sink());
            skipped.map_err(|e| named(e.to_string()))?;
            Ok((named("it ends early".into()), source.take(each)))
        };
        let files = self.paths[(first / each) as usize..].iter().map(open);
        let mut joined = Joined { files, current: None };
        io::copy(&mut joined.by_ref().take(first % each), &mut io::sink()).map_err(|e| e.to_string())?;
        read_voxels(&mut joined, block.dims, block.element, block.byte_order, None).map_err(|e| e.to_string())
    }
}

/// Concatenation of several data files into one stream. If a file ends too early, its stored error text is returned.
struct Joined<'a, I> {
    files: I,
    current: Option<(String, Take<Source<'a>>)>,
}

impl<'a, I: Iterator<Item = Result<(String, Take<Source<'a>>), String>>> Read for Joined<'a, I> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            if let Some((early, file)) = &mut self.current {
                let got = file.read(buffer)?;
                if got > 0 || buffer.is_empty() {
                    return Ok(got);
                }
                if file.limit() > 0 {
                    return Err(io::Error::other(early.clone()));
                }
            }
            match self.files.next() {
                Some(next) => self.current = Some(next.map_err(io::Error::other)?),
                None => return Ok(0),
            }
        }
    }
}

/// Reads voxels that are stored as text: numbers separated by white space or commas.
fn read_text(source: &mut Source<'_>, block: &Block) -> Result<Voxels, String> {
    let [nx, ny, nz] = block.dims;
    let count = grid_bytes(block.dims, 1);
    let skipped = count.and_then(|n| n.checked_mul(block.frame as u64));
    let (Some(count), Some(skipped)) = (count, skipped) else {
        return Err("its header claims more voxels than can be counted".into());
    };
    // A number and its separator take at least two bytes.
    let most = source.max_bytes() / 2 + 1;
    if count.saturating_add(skipped) > most {
        return Err(format!("its header claims {nx}x{ny}x{nz} voxels, but it holds {most} numbers at most"));
    }
    let mut numbers = TextNumbers::new(source, block.element, count);
    if !numbers.skip(skipped).map_err(|e| e.to_string())? {
        return Err(format!("its text ends before frame {}", block.frame));
    }
    let size = block.element.bytes() as u64;
    let voxels = read_voxels(&mut numbers, block.dims, block.element, ByteOrder::Little, None);
    voxels.map_err(|failure| match failure {
        ReadFailure::Short { got } => format!("its text ends after {} of {count} voxels", got / size),
        other => other.to_string(),
    })
}

/// Resolves the data files that a header names: a single name, `LIST` with the names that follow, or a pattern such
/// as `s%03d.raw 1 40 1` (first number, last number, step).
///
/// # Errors
/// The pattern is invalid, there are too many data files, or a file is not in the folder of the header.
pub(super) fn named_files(header: &Path, name: &str, list: &[String]) -> Result<Vec<PathBuf>, String> {
    if is_list(name) {
        if list.is_empty() || list.len() > MAX_FILES {
            return Err(format!("its list names {} files; 1 to {MAX_FILES} are supported", list.len()));
        }
        return list.iter().map(|name| sibling(header, name)).collect();
    }
    let words: Vec<&str> = name.split_whitespace().collect();
    let Some((before, digits, after)) = words.first().and_then(|word| pattern(word)) else {
        return Ok(vec![sibling(header, name)?]);
    };
    let numbers: Option<Vec<i64>> = words[1..].iter().map(|word| word.parse().ok()).collect();
    // A fourth number is the number of axes of a file, which the number of files implies.
    let (first, last, step) = match numbers.as_deref() {
        Some([first, last, step] | [first, last, step, _]) if *step != 0 => (*first, *last, *step),
        _ => return Err(format!("`{}` needs a first and a last number and a step", words[0])),
    };
    let distance = last.checked_sub(first).filter(|n| *n == 0 || n.signum() == step.signum());
    let steps = distance.and_then(|n| n.checked_div(step));
    let count = steps.and_then(|n| usize::try_from(n).ok()).filter(|n| *n < MAX_FILES);
    let count = count.ok_or_else(|| format!("`{name}` names no files, or more than {MAX_FILES}"))?;
    let file = |n: usize| sibling(header, &format!("{before}{:0digits$}{after}", first + n as i64 * step));
    (0..=count).map(file).collect()
}

/// Whether the data-file field of an NRRD or MetaImage header is `LIST`. The names of the data files then follow on
/// separate lines.
pub(super) fn is_list(name: &str) -> bool {
    name.split_whitespace().next().is_some_and(|word| word.eq_ignore_ascii_case("list"))
}

/// Splits a file-name pattern such as `s%03d.raw` into the prefix, the width of the number, and the suffix.
fn pattern(name: &str) -> Option<(&str, usize, &str)> {
    let (before, rest) = name.split_once('%')?;
    let (digits, after) = rest.split_once('d')?;
    let width = if digits.is_empty() { 0 } else { digits.parse().ok()? };
    (digits.bytes().all(|b| b.is_ascii_digit()) && width <= MAX_DIGITS && !after.contains('%'))
        .then_some((before, width, after))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(name: &str, list: &[&str]) -> Result<Vec<String>, String> {
        let list: Vec<String> = list.iter().map(ToString::to_string).collect();
        let files = named_files(Path::new("here/a.nhdr"), name, &list)?;
        Ok(files.iter().map(|file| file.to_string_lossy().replace('\\', "/")).collect())
    }

    #[test]
    fn lists_and_patterns_name_files_beside_the_header() {
        assert_eq!(names("LIST 2", &["b.raw", "c d.raw"]).unwrap(), ["here/b.raw", "here/c d.raw"]);
        assert_eq!(
            names("s%03d.raw 8 12 2", &[]).unwrap(),
            ["here/s008.raw", "here/s010.raw", "here/s012.raw"]
        );
        assert_eq!(names("s%d 2 1 -1 2", &[]).unwrap(), ["here/s2", "here/s1"]);
        assert_eq!(names("100%.raw", &[]).unwrap(), ["here/100%.raw"]);
        for (name, list) in [
            ("LIST", &[][..]),
            ("LIST", &["../b.raw"]),
            ("LIST", &["/etc/passwd"]),
            ("../s%d.raw 1 2 1", &[]),
            ("s%d.raw", &[]),
            ("s%d.raw 1 2", &[]),
            ("s%d.raw 1 2 0", &[]),
            ("s%d.raw 2 1 1", &[]),
            ("s%d.raw 0 9999999999 1", &[]),
            ("s%d.raw -9223372036854775808 9223372036854775807 1", &[]),
            ("s%d.raw -9223372036854775808 -9223372036854775807 -9223372036854775808", &[]),
        ] {
            assert!(names(name, list).is_err(), "{name}");
        }
    }
}
