//! Writes output files that appear only when they are complete, and validates output paths before any work starts.

use super::input::is_standard_stream;
use crate::error::{Error, Result};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::{Builder, NamedTempFile, SpooledTempFile, TempPath};

const WHAT: &str = "cannot write file";
const WHAT_FOLDER: &str = "cannot write to folder";

/// Paths of the temporary files of all unfinished outputs.
static BEGUN: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn begun() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    BEGUN.lock().unwrap_or_else(PoisonError::into_inner)
}

fn failed(path: &Path, why: impl ToString) -> Error {
    Error::runtime(WHAT, path.display(), why)
}

/// Removes the temporary files of all unfinished outputs and ends the program with `end`. A lock prevents other
/// threads from beginning or finishing a file meanwhile.
pub fn abandon_and(end: fn() -> !) -> ! {
    let begun = begun();
    for file in begun.iter() {
        // A missing file is the desired result.
        let _ = std::fs::remove_file(file);
    }
    end()
}

/// Path of a temporary file, which is removed with it, or at the end of the program.
#[derive(Debug)]
pub struct TemporaryFile(TempPath);

impl TemporaryFile {
    /// Creates a temporary file in a folder, and opens it for writing.
    ///
    /// # Errors
    /// The folder is not writable.
    pub fn create_in(folder: &Path) -> io::Result<(File, Self)> {
        let mut begun = begun();
        let (file, path) = Builder::new().prefix("umbravox-").tempfile_in(folder)?.into_parts();
        begun.insert(path.to_path_buf());
        Ok((file, Self(path)))
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        begun().remove(self.path());
    }
}

/// Whether an output is standard output instead of a file: `-`.
pub fn is_stdout(path: &Path) -> bool {
    is_standard_stream(path)
}

/// Writes a file that appears only when it is complete: into a temporary file in the same folder, which is then
/// renamed. Output to `-` goes to standard output; a reader that has closed it is no error.
///
/// # Errors
/// `write` fails, the folder is not writable, or writing to the disk fails.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    if is_stdout(path) {
        let mut bytes = Vec::new();
        write(&mut bytes).map_err(|e| failed(path, e))?;
        let mut stdout = io::stdout().lock();
        return match stdout.write_all(&bytes).and_then(|()| stdout.flush()) {
            Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(failed(path, e)),
            _ => Ok(()),
        };
    }
    let (whole, file) = WholeFile::begin(path)?;
    let mut buffered = BufWriter::new(file);
    write(&mut buffered).map_err(|e| failed(path, e))?;
    buffered.into_inner().map_err(|e| failed(path, e.into_error()))?;
    whole.finish()
}

/// Output file that is written in steps and appears when it is finished; if it is dropped before, no file remains.
pub struct WholeFile {
    temporary: NamedTempFile,
    listed: BegunEntry,
    path: PathBuf,
}

impl WholeFile {
    /// Begins an output file. The caller writes to the returned file and must flush it before [`Self::finish`].
    ///
    /// # Errors
    /// The folder is not writable.
    pub fn begin(path: &Path) -> Result<(Self, File)> {
        let mut begun = begun();
        let temporary = temporary_in(&folder_of(path)).map_err(|e| failed(path, e))?;
        let file = temporary.as_file().try_clone().map_err(|e| failed(path, e))?;
        begun.insert(temporary.path().into());
        let listed = BegunEntry(temporary.path().into());
        Ok((Self { temporary, listed, path: path.into() }, file))
    }

    /// Completes the output file: renames the temporary file to its final name.
    ///
    /// # Errors
    /// Writing to the disk or renaming the file fails.
    pub fn finish(self) -> Result<()> {
        let Self { temporary, listed, path } = self;
        temporary.as_file().sync_all().map_err(|e| failed(&path, e))?;
        // Waits for the lock, so that no file is renamed while `abandon_and` ends the program.
        let begun = begun();
        let named = temporary.persist(&path).map_err(|e| failed(&path, e.error));
        drop(begun);
        drop(listed);
        named.map(|_| ())
    }
}

/// Entry of one temporary file in the list of unfinished outputs; dropping it removes the entry from the list.
struct BegunEntry(PathBuf);

impl Drop for BegunEntry {
    fn drop(&mut self) {
        begun().remove(&self.0);
    }
}

/// Creates a buffer in memory; beyond `memory_bytes` bytes, its contents move to a temporary file in the output's
/// folder.
pub(super) fn spool_beside(path: &Path, memory_bytes: usize) -> SpooledTempFile {
    tempfile::spooled_tempfile_in(memory_bytes, folder_of(path))
}

/// Validates the path of an output file before any work starts. The extension must be one of `extensions`, the folder
/// must exist and be writable, and the path must not be a folder.
///
/// # Errors
/// Input error: one of these conditions is violated.
pub fn check_output(path: &Path, extensions: &[&'static str]) -> Result<()> {
    let refuse = |why: String| Error::input(WHAT, path.display(), why);
    extension(path, extensions)?;
    if path.is_dir() {
        return Err(refuse("it is a folder".into()));
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        return Err(refuse(format!("there is no folder `{}`", folder.display())));
    }
    temporary_in(&folder)
        .map_err(|e| refuse(format!("the folder `{}` cannot be written to: {e}", folder.display())))?;
    Ok(())
}

/// Validates an output as [`check_output`] does, and allows `-` for standard output in the first of the formats.
/// `prints_json`: a result in JSON goes there already.
///
/// # Errors
/// See [`check_output`]; or two results for standard output.
pub fn check_output_or_stdout(path: &Path, extensions: &[&'static str], prints_json: bool) -> Result<()> {
    match (is_stdout(path), prints_json) {
        (false, _) => check_output(path, extensions),
        (true, false) => Ok(()),
        (true, true) => Err(Error::input(WHAT, "--output -", "--json goes to standard output, too")),
    }
}

/// Returns the extension of a file name as [`extension`] does, or the first one for standard output (`-`).
///
/// # Errors
/// See [`extension`].
pub fn extension_or_first(path: &Path, extensions: &[&'static str]) -> Result<&'static str> {
    extensions.first().copied().filter(|_| is_stdout(path)).map_or_else(|| extension(path, extensions), Ok)
}

/// Validates the path of an output folder: neither it nor a folder above it may be a file. Creates nothing.
///
/// # Errors
/// Input error: the folder cannot be used.
pub fn check_output_dir(path: &Path) -> Result<()> {
    match path.ancestors().find(|p| p.exists()) {
        Some(file) if !file.is_dir() => {
            let why = format!("`{}` is not a folder", file.display());
            Err(Error::input(WHAT_FOLDER, path.display(), why))
        }
        _ => Ok(()),
    }
}

/// Returns an error if a folder already contains the result table `file`, so that no table is overwritten by
/// accident.
///
/// # Errors
/// Input error: the folder already contains this table.
pub fn check_no_table(folder: &Path, file: &str) -> Result<()> {
    if std::fs::metadata(folder.join(file)).is_ok_and(|m| m.len() > 0) {
        let why = format!("it holds {file} already");
        return Err(Error::input("cannot write table", folder.display(), why)
            .hint("--resume continues it, --overwrite writes it anew, or give another folder"));
    }
    Ok(())
}

/// Creates an output folder with its parent folders, and returns an error if it is not writable.
///
/// # Errors
/// Input error: the folder cannot be used.
pub fn prepare_output_dir(path: &Path) -> Result<()> {
    let refuse = |e: io::Error| Error::input(WHAT_FOLDER, path.display(), e);
    std::fs::create_dir_all(path).map_err(refuse)?;
    temporary_in(path).map_err(refuse)?;
    Ok(())
}

/// Returns the extension of a file name if it is one of `extensions`, ignoring case (`nii.gz` counts as one
/// extension).
///
/// # Errors
/// The file name has none of the extensions.
pub fn extension(path: &Path, extensions: &[&'static str]) -> Result<&'static str> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let ends =
        |e: &str| name.strip_suffix(e).and_then(|stem| stem.strip_suffix('.')).is_some_and(|s| !s.is_empty());
    extensions.iter().copied().find(|e| ends(e)).ok_or_else(|| {
        let known = extensions.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(", ");
        Error::input(WHAT, path.display(), format!("the name must end in one of {known}"))
    })
}

fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder.into(),
        _ => ".".into(),
    }
}

fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = Builder::new();
    builder.prefix(".umbravox-").suffix(".tmp");
    #[cfg(unix)]
    {
        // A temporary file is private by default; the finished one gets the permissions that the umask leaves.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    // The library's own message names the temporary file, which means nothing to the user.
    builder.tempfile_in(folder).map_err(|e| e.kind().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(folder: &Path) -> usize {
        std::fs::read_dir(folder).unwrap().count()
    }

    #[test]
    fn a_failed_write_leaves_nothing_and_keeps_the_old_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.csv");
        write_whole(&path, |f| f.write_all(b"old")).unwrap();
        let e = write_whole(&path, |f| {
            f.write_all(b"new")?;
            Err(io::Error::other("disk full"))
        })
        .unwrap_err();
        assert_eq!((e.exit_status(), e.why.as_str()), (1, "disk full"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(entries(dir.path()), 1);
    }

    #[test]
    fn a_file_written_over_a_while_appears_when_it_is_finished() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.gif");
        let (whole, mut file) = WholeFile::begin(&path).unwrap();
        file.write_all(b"half").unwrap();
        drop(whole);
        assert_eq!(entries(dir.path()), 0, "dropped, it leaves nothing");
        let (whole, mut file) = WholeFile::begin(&path).unwrap();
        file.write_all(b"whole").unwrap();
        assert!(!path.exists());
        whole.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        assert_eq!(WholeFile::begin(&dir.path().join("none/a.gif")).err().unwrap().exit_status(), 1);
    }

    #[test]
    fn bad_outputs_are_refused_before_the_work() {
        let dir = tempfile::tempdir().unwrap();
        let check = |name: &str| check_output(&dir.path().join(name), &["png", "exr", "npy"]);
        check("a.png").unwrap();
        check("b.NPY").unwrap();
        assert!(check("a.jpg").unwrap_err().why.contains(".png, .exr, .npy"));
        assert!(check(".png").unwrap_err().why.contains("must end in"));
        assert!(check("apng").unwrap_err().why.contains("must end in"));
        assert!(check("missing/a.png").unwrap_err().why.contains("no folder"));
        std::fs::create_dir(dir.path().join("f.png")).unwrap();
        assert!(check("f.png").unwrap_err().why.contains("is a folder"));
        assert_eq!(entries(dir.path()), 1, "checking leaves nothing behind");
        assert!(check_output(&dir.path().join("v.nii.gz"), &["nii", "nii.gz"]).is_ok());
    }

    #[test]
    fn an_output_folder_is_made_or_refused() {
        let dir = tempfile::tempdir().unwrap();
        check_output_dir(&dir.path().join("a/b")).unwrap();
        assert_eq!(entries(dir.path()), 0);
        prepare_output_dir(&dir.path().join("a/b")).unwrap();
        std::fs::write(dir.path().join("file"), "").unwrap();
        assert_eq!(check_output_dir(&dir.path().join("file/b")).unwrap_err().exit_status(), 2);
        assert_eq!(prepare_output_dir(&dir.path().join("file")).unwrap_err().exit_status(), 2);
    }
}
