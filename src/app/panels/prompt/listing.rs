//! The files and folders that a path which is being typed may go on to.

use std::path::{MAIN_SEPARATOR_STR, Path, PathBuf, is_separator};

/// Of a folder no more are listed.
const MOST_ENTRIES: usize = 4000;

/// A file or a folder of the list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    pub name: String,
    pub is_folder: bool,
}

/// The entries of the folder that a typed path lies in.
#[derive(Debug, Default)]
pub struct Listing {
    folder: PathBuf,
    entries: Vec<Entry>,
    /// Why there is nothing to list.
    pub trouble: Option<String>,
}

/// Splits a typed path behind its last separator: the folder as it was typed, and the beginning of a name.
pub fn split(typed: &str) -> (&str, &str) {
    typed.split_at(typed.rfind(is_separator).map_or(0, |at| at + 1))
}

/// A typed path with the home folder in place of `~`.
pub fn expanded(typed: &str) -> String {
    let rest = typed.strip_prefix('~').filter(|rest| rest.is_empty() || rest.starts_with(is_separator));
    match rest.zip(dirs::home_dir()) {
        Some((rest, home)) => format!("{}{rest}", home.display()),
        None => typed.to_owned(),
    }
}

impl Listing {
    /// Lists the folder of a typed path: folders, and files with one of the endings (all where there are none), unless
    /// that folder is listed already.
    pub fn follow(&mut self, typed: &str, endings: &[&str]) {
        let folder = expanded(split(typed).0);
        let folder = if folder.is_empty() { PathBuf::from(".") } else { PathBuf::from(folder) };
        if folder != self.folder {
            let (entries, trouble) = match read(&folder, endings) {
                Ok(entries) => (entries, None),
                Err(e) => (Vec::new(), Some(e.to_string())),
            };
            *self = Self { folder, entries, trouble };
        }
    }

    /// The entries that a typed path may go on to: those whose names begin as the typed one does, in any case; hidden ones
    /// only where a dot is typed.
    pub fn matching(&self, typed: &str) -> Vec<&Entry> {
        let begun = split(typed).1.to_lowercase();
        let hidden = begun.starts_with('.');
        let matches =
            |e: &&Entry| e.name.to_lowercase().starts_with(&begun) && (hidden || !e.name.starts_with('.'));
        self.entries.iter().filter(matches).collect()
    }

    /// The typed path as far as all that it may go on to agrees; the only one whole, a folder with its separator.
    pub fn completed(&self, typed: &str) -> Option<String> {
        let found = self.matching(typed);
        let (folder, begun) = split(typed);
        if let [only] = found[..] {
            return Some(path_of(folder, only));
        }
        let mut common: Vec<char> = found.first()?.name.chars().collect();
        for entry in &found[1..] {
            let same = |(a, b): &(&char, char)| a.to_lowercase().eq(b.to_lowercase());
            let agree = common.iter().zip(entry.name.chars()).take_while(same).count();
            common.truncate(agree);
        }
        let longer = common.len() > begun.chars().count();
        longer.then(|| format!("{folder}{}", common.into_iter().collect::<String>()))
    }
}

/// The path of an entry, in a folder as it was typed.
pub fn path_of(folder: &str, entry: &Entry) -> String {
    let end = if entry.is_folder { MAIN_SEPARATOR_STR } else { "" };
    format!("{folder}{}{end}", entry.name)
}

fn read(folder: &Path, endings: &[&str]) -> std::io::Result<Vec<Entry>> {
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(folder)?.flatten() {
        if entries.len() == MOST_ENTRIES {
            break;
        }
        // What a link leads to has to be asked of the disk.
        let is_folder = match entry.file_type() {
            Ok(kind) if !kind.is_symlink() => kind.is_dir(),
            _ => entry.path().is_dir(),
        };
        let Ok(name) = entry.file_name().into_string() else { continue };
        let lower = name.to_lowercase();
        let ends = |ending: &&str| lower.strip_suffix(*ending).is_some_and(|stem| stem.ends_with('.'));
        if is_folder || endings.is_empty() || endings.iter().any(ends) {
            entries.push(Entry { name, is_folder });
        }
    }
    entries.sort_by_key(|e| (!e.is_folder, e.name.to_lowercase()));
    Ok(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_and_files_that_can_be_opened_are_listed_and_completed() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["scan_a.nii.gz", "Scan_b.NII", "notes.txt", ".hidden.nii", "other.nii"] {
            std::fs::write(dir.path().join(name), b"").unwrap();
        }
        for name in ["scans", "zarr"] {
            std::fs::create_dir(dir.path().join(name)).unwrap();
        }
        let typed = |name: &str| dir.path().join(name).display().to_string();
        let folder = typed("");
        let mut listing = Listing::default();
        let endings = ["nii", "gz"];
        listing.follow(&folder, &endings);
        let names = |listing: &Listing, text: &str| -> Vec<String> {
            listing.matching(text).iter().map(|e| e.name.clone()).collect()
        };
        assert_eq!(names(&listing, &folder), ["scans", "zarr", "other.nii", "scan_a.nii.gz", "Scan_b.NII"]);
        assert_eq!(names(&listing, &typed("sc")), ["scans", "scan_a.nii.gz", "Scan_b.NII"]);
        assert_eq!(names(&listing, &typed(".")), [".hidden.nii"]);
        assert_eq!(listing.completed(&typed("s")), Some(typed("scan")), "as far as they agree");
        assert_eq!(listing.completed(&typed("scan")), None, "no farther");
        assert_eq!(listing.completed(&typed("SCAN_A")), Some(typed("scan_a.nii.gz")));
        assert_eq!(listing.completed(&typed("z")), Some(typed("zarr") + MAIN_SEPARATOR_STR));
        assert_eq!(listing.completed(&typed("nothing")), None);
        // Another folder is listed anew, and one that is not there says why.
        listing.follow(&(typed("scans") + MAIN_SEPARATOR_STR), &endings);
        assert!(listing.matching("").is_empty() && listing.trouble.is_none());
        listing.follow(&typed("nowhere/at all"), &endings);
        assert!(listing.trouble.is_some());
        listing.follow(&folder, &[]);
        assert!(names(&listing, &folder).contains(&"notes.txt".to_owned()));
    }

    #[test]
    fn the_home_folder_has_a_short_name() {
        let Some(home) = dirs::home_dir() else { return };
        assert_eq!(expanded("~/a b"), format!("{}/a b", home.display()));
        for same in ["~a/b", "a/~", "phantom:thorax", ""] {
            assert_eq!(expanded(same), same);
        }
    }
}
