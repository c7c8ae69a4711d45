//! Voxels that lie in several files, one after the other, each with as many: lists of names, and patterns with numbers, as
//! NRRD and MetaImage have them.

use super::beside::beside;
use super::source::{Block, Packing, Source};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::files::memory_budget::refuse_beyond_host;
use crate::volume::Voxels;
use crate::volume::element::{ReadFailure, read_voxels};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Files of no volume are more.
const FILES_MOST: usize = 1 << 16;
/// Digits that a pattern fills a number up to.
const DIGITS_MOST: usize = 32;

/// The files that a header names in several words: `LIST`, of the names that follow, or a pattern such as `s%03d.raw 1 40 1`.
/// `None` where the name is that of one file.
///
/// # Errors
/// A pattern that is none, too many files, or one that is not beside the header.
pub(super) fn named(header: &Path, name: &str, list: &[String]) -> Result<Option<Vec<PathBuf>>, String> {
    if is_list(name) {
        if list.is_empty() || list.len() > FILES_MOST {
            return Err(format!("its list names {} files; 1 to {FILES_MOST} are read", list.len()));
        }
        return list.iter().map(|name| beside(header, name)).collect::<Result<_, _>>().map(Some);
    }
    let words: Vec<&str> = name.split_whitespace().collect();
    let Some((before, digits, after)) = words.first().and_then(|word| pattern(word)) else { return Ok(None) };
    let numbers: Option<Vec<i64>> = words[1..].iter().map(|word| word.parse().ok()).collect();
    // What may follow is of how many axes a file is, which the number of files says, too.
    let (first, last, step) = match numbers.as_deref() {
        Some([first, last, step] | [first, last, step, _]) if *step != 0 => (*first, *last, *step),
        _ => return Err(format!("`{}` is to be followed by a first and a last number and a step", words[0])),
    };
    let way = last.checked_sub(first).filter(|way| *way == 0 || way.signum() == step.signum());
    let steps = way.and_then(|way| way.checked_div(step));
    let count = steps.and_then(|n| usize::try_from(n).ok()).filter(|n| *n < FILES_MOST);
    let count = count.ok_or_else(|| format!("`{name}` names no files, or more than {FILES_MOST}"))?;
    let file = |n: usize| beside(header, &format!("{before}{:0digits$}{after}", first + n as i64 * step));
    (0..=count).map(file).collect::<Result<_, _>>().map(Some)
}

/// Whether the names of files follow.
pub(super) fn is_list(name: &str) -> bool {
    name.split_whitespace().next().is_some_and(|word| word.eq_ignore_ascii_case("list"))
}

/// What stands before and after the one number of a name, and how many digits it is filled up to.
fn pattern(name: &str) -> Option<(&str, usize, &str)> {
    let (before, rest) = name.split_once('%')?;
    let (digits, after) = rest.split_once('d')?;
    let width = if digits.is_empty() { 0 } else { digits.parse().ok()? };
    (digits.bytes().all(|b| b.is_ascii_digit()) && width <= DIGITS_MOST && !after.contains('%'))
        .then_some((before, width, after))
}

/// Reads the frame of a block of voxels whose `frames` lie in files one after the other, `skip` bytes into each.
///
/// # Errors
/// A file cannot be read or holds too little.
pub(super) fn read(
    paths: &[PathBuf],
    packing: Packing,
    start: u64,
    skip: u64,
    block: &Block,
    frames: usize,
    loading: &Loading,
) -> Result<Voxels> {
    let header = |why: String| Error::input("cannot read volume", paths[0].display(), why);
    let frame_bytes = block.bytes();
    let all = frame_bytes.and_then(|bytes| bytes.checked_mul(frames as u64));
    let (Some(frame_bytes), Some(all)) = (frame_bytes, all) else {
        return Err(header("its header claims more bytes than can be counted".into()));
    };
    let count = paths.len() as u64;
    if all % count != 0 || all / count == 0 {
        return Err(header(format!(
            "its header claims {all} bytes in {count} files, which is no whole number in each"
        )));
    }
    refuse_beyond_host(block.kept_bytes()).map_err(header)?;
    let first = frame_bytes * block.frame as u64;
    let each = all / count;
    let mut parts = Parts {
        paths,
        next: (first / each) as usize,
        packing,
        start,
        skip,
        each,
        left: 0,
        source: None,
        loading,
        trouble: None,
    };
    let passed = io::copy(&mut parts.by_ref().take(first % each), &mut io::sink());
    let voxels = match passed {
        Ok(_) => read_voxels(&mut parts, block.dims, block.element, block.byte_order),
        Err(e) => Err(ReadFailure::Io(e)),
    };
    // A file's own trouble names the file.
    match (parts.trouble, voxels) {
        (Some(trouble), _) => Err(trouble),
        (None, voxels) => voxels.map_err(|failure| header(failure.to_string())),
    }
}

/// Files that are read as if they were one.
struct Parts<'a> {
    paths: &'a [PathBuf],
    /// The file that is next.
    next: usize,
    packing: Packing,
    /// Bytes before the voxels of each file, before and after it is unpacked.
    start: u64,
    skip: u64,
    /// Bytes of voxels in each, and how many of the present one are left.
    each: u64,
    left: u64,
    source: Option<Source<'a>>,
    loading: &'a Loading,
    trouble: Option<Error>,
}

impl Parts<'_> {
    /// Opens the next file.
    fn open(&mut self) -> Result<(), Error> {
        let Some(path) = self.paths.get(self.next) else { return Ok(()) };
        let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
        let mut source = Source::open_at(path, self.start, self.packing, self.loading)?;
        let wanted = self.skip.saturating_add(self.each);
        if wanted > source.most_bytes() {
            return Err(refuse(format!("{wanted} bytes of voxels are claimed in it, and it is shorter")));
        }
        let skipped = io::copy(&mut source.by_ref().take(self.skip), &mut io::sink());
        skipped.map_err(|e| refuse(e.to_string()))?;
        (self.source, self.left, self.next) = (Some(source), self.each, self.next + 1);
        Ok(())
    }
}

impl Read for Parts<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            self.source = None;
            if let Err(e) = self.open() {
                self.trouble = Some(e);
                return Err(io::Error::other("a file of it cannot be read"));
            }
        }
        let Some(source) = &mut self.source else { return Ok(0) };
        let room = buffer.len().min(usize::try_from(self.left).unwrap_or(usize::MAX));
        let got = source.read(&mut buffer[..room]);
        if matches!(got, Ok(0)) && room > 0 || got.is_err() {
            let why = got
                .as_ref()
                .err()
                .map_or_else(|| format!("it ends {} bytes early", self.left), ToString::to_string);
            let path = &self.paths[self.next - 1];
            self.trouble = Some(Error::input("cannot read volume", path.display(), why));
        }
        let got = got?;
        self.left -= got as u64;
        Ok(got)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(name: &str, list: &[&str]) -> Result<Vec<String>, String> {
        let list: Vec<String> = list.iter().map(ToString::to_string).collect();
        let files = named(Path::new("here/a.nhdr"), name, &list)?.unwrap_or_default();
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
        assert_eq!(names("100%.raw", &[]).unwrap(), [""; 0]);
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
