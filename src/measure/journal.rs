//! Journal of a comparison of shadow methods (`compare.rows.jsonl`): records every measurement on disk at once; an
//! interrupted comparison can then resume.
//!
//! A line of the journal is one of three: a row with its errors (written after its picture), a timed round of a row,
//! or a trial of a search within a budget. Lines are only appended, each complete and in one write. An incomplete
//! last line, left by an interruption, is discarded.

use super::table::Row;
use super::timing::StageTimes;
use crate::error::{Error, Result};
use crate::files::picture::{Backdrop, read_exr, write_picture_with};
use crate::render::Omission;
use ndarray::Array3;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::fs::{File, OpenOptions, TryLockError};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Name of the file that records finished measurements, in the output folder of the comparison of shadow methods.
pub const JOURNAL: &str = "compare.rows.jsonl";

/// Errors and memory of one shadow method, determined before its timed rounds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Comparison table row of the shadow method, without measured times.
    #[serde(rename = "cells", with = "row_as_texts")]
    pub row: Row,
    /// Unique text in the names of this table row's files, such as its picture.
    pub slug: String,
    /// Kinds of rendering work, such as gradients, that the renderer skipped because the scene does not need them.
    pub left_out: Vec<Omission>,
    /// Notes on the measurement for the reader of the comparison table.
    pub notes: Vec<String>,
    /// Time to render the method's first picture, ms. A method with a slow first picture is timed only once.
    pub frame_ms: f64,
}

/// Serializes comparison table rows as a map from column names to CSV texts, because JSON cannot represent infinity.
mod row_as_texts {
    use super::{BTreeMap, Deserialize, Row, Serialize};
    use serde::{Deserializer, Serializer, de::Error};

    pub fn serialize<S: Serializer>(row: &Row, serializer: S) -> Result<S::Ok, S::Error> {
        row.texts().serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Row, D::Error> {
        let texts = BTreeMap::deserialize(deserializer)?;
        Row::from_texts(&texts).map_err(|column| D::Error::custom(format!("`{column}` has no such value")))
    }
}

/// Comparison table row that an earlier program run recorded in the journal file, with its picture and timed rounds.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorded {
    /// Comparison table row from the journal file, without measured times.
    pub measured: Measured,
    /// Picture of the table row's shadow method from the journal: `height x width x 4`, linear RGBA.
    pub picture: Array3<f32>,
    /// Measured times of the shadow method, one entry per timed round, each with the index of the program run that
    /// measured it.
    pub rounds: Vec<(u32, StageTimes)>,
}

#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Line {
    Row {
        key: String,
        /// Hash of the picture of this table row. It reveals whether the picture file was replaced.
        picture: String,
        #[serde(flatten)]
        measured: Measured,
    },
    Round {
        key: String,
        run: u32,
        times: StageTimes,
    },
    Trial {
        key: String,
        #[serde(with = "row_as_texts")]
        trial: Row,
    },
}

/// Journal of measurements: the table rows that earlier program runs recorded, and the file for new ones.
#[derive(Debug, Default)]
pub struct Journal {
    place: Option<(PathBuf, File)>,
    /// Metadata to write into picture files, as pairs of key and text.
    about: Vec<(String, String)>,
    /// Number of comparison table rows that this program run wrote to the journal file or reused from it.
    recorded: usize,
    /// Index of this program run among those that wrote to the journal file, from 1.
    run: u32,
    /// Comparison table rows from the journal file by key, each with the hash of its picture.
    rows: HashMap<String, (Measured, String)>,
    rounds: HashMap<String, Vec<(u32, StageTimes)>>,
    trials: HashMap<String, Row>,
}

impl Journal {
    /// Creates a journal of measurements that writes nothing to disk.
    pub fn nowhere() -> Self {
        Self::default()
    }

    /// Opens the journal file of measurements in an existing folder, either to resume the comparison or to discard
    /// its results and start anew.
    ///
    /// # Errors
    /// The journal file cannot be read or written, another run is writing to it, or it has an invalid line.
    pub fn open(folder: &Path, resume: bool) -> Result<Self> {
        let path = folder.join(JOURNAL);
        let failed = |e: std::io::Error| Error::runtime("cannot record rows", path.display(), e);
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(failed)?;
        // On a file system without locks, another writer cannot be detected.
        if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            let why = "another `umbravox compare` is writing to the folder";
            return Err(Error::input("cannot record rows", path.display(), why));
        }
        let mut journal = Self { run: 1, ..Self::default() };
        let mut whole = 0;
        if !resume {
            remove_pictures(&mut file, folder);
        }
        if resume {
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).map_err(failed)?;
            whole = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |last| last + 1);
            for (i, line) in bytes[..whole].split_inclusive(|b| *b == b'\n').enumerate() {
                journal.read(line).map_err(|why| {
                    let place = format!("{}: line {}", path.display(), i + 1);
                    Error::input("cannot resume", place, why)
                        .hint("without --resume the table is started anew")
                })?;
            }
        }
        file.set_len(whole as u64).map_err(failed)?;
        file.seek(SeekFrom::End(0)).map_err(failed)?;
        journal.place = Some((folder.into(), file));
        Ok(journal)
    }

    /// Number of comparison table rows from earlier program runs that were not reused yet, over all scenes and
    /// settings.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Number of comparison table rows in the journal file, measured by this program run or by earlier ones.
    pub fn recorded(&self) -> usize {
        self.recorded + self.rows.len()
    }

    /// Sets the metadata, as pairs of key and text, for the picture files written from now on. Each picture also
    /// states its shadow method.
    pub fn describe(&mut self, about: Vec<(String, String)>) {
        self.about = about;
    }

    /// Whether the journal file has no comparison table rows from earlier program runs left to reuse.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn read(&mut self, line: &[u8]) -> Result<(), String> {
        match serde_json::from_slice(line).map_err(|e| e.to_string())? {
            Line::Row { key, picture, measured } => {
                // A row that was measured again, because its picture was missing, is also timed again.
                self.rounds.remove(&key);
                self.rows.insert(key, (measured, picture));
            }
            Line::Round { key, run, times } => {
                self.run = self.run.max(run + 1);
                self.rounds.entry(key).or_default().push((run, times));
            }
            Line::Trial { key, trial } => {
                self.trials.insert(key, trial);
            }
        }
        Ok(())
    }

    /// Returns the table row that an earlier program run recorded under a key, and removes it from the rows left to
    /// reuse. Returns `None` if there is none, or if its pictures are missing or changed.
    pub fn take(&mut self, key: &str) -> Option<Recorded> {
        let (measured, expected) = self.rows.remove(key)?;
        let [png, exr] = self.pictures(&measured.slug)?;
        let picture = read_exr(&exr).ok()?;
        let rounds = self.rounds.remove(key).unwrap_or_default();
        let recorded = png.is_file() && fingerprint(&picture) == expected;
        self.recorded += usize::from(recorded);
        recorded.then_some(Recorded { measured, picture, rounds })
    }

    /// Writes the pictures of a comparison table row to disk, then records the row in the journal file.
    ///
    /// # Errors
    /// A picture file or the journal file cannot be written.
    pub fn record(&mut self, key: &str, measured: &Measured, picture: &Array3<f32>) -> Result<()> {
        let Some(pictures) = self.pictures(&measured.slug) else { return Ok(()) };
        let mut about = self.about.clone();
        about.push(("Description".into(), measured.row.spec()));
        for path in &pictures {
            write_picture_with(path, picture, Backdrop::Drawn, &about)?;
        }
        let (picture, measured) = (fingerprint(picture), measured.clone());
        self.write(&[Line::Row { key: key.into(), picture, measured }])?;
        self.recorded += 1;
        Ok(())
    }

    /// Records the measured times of one round for several comparison table rows, given by key.
    ///
    /// # Errors
    /// The journal file cannot be written.
    pub fn record_round<'k>(&mut self, times: impl IntoIterator<Item = (&'k str, StageTimes)>) -> Result<()> {
        let run = self.run;
        let line = |(key, times): (&str, _)| Line::Round { key: key.into(), run, times };
        self.write(&times.into_iter().map(line).collect::<Vec<_>>())
    }

    /// Returns the trial of method settings that an earlier program run recorded under a key; `None` if there is
    /// none.
    pub fn trial(&self, key: &str) -> Option<Row> {
        self.trials.get(key).cloned()
    }

    /// Records a measured trial of method settings in the journal file.
    ///
    /// # Errors
    /// The journal file cannot be written.
    pub fn record_trial(&mut self, key: &str, trial: &Row) -> Result<()> {
        self.write(&[Line::Trial { key: key.into(), trial: trial.clone() }])
    }

    /// Index of this program run among those that wrote to the journal file, from 1.
    pub fn run(&self) -> u32 {
        self.run
    }

    /// Returns the paths of a table row's picture as a PNG file and as a lossless EXR file.
    fn pictures(&self, slug: &str) -> Option<[PathBuf; 2]> {
        let (folder, _) = self.place.as_ref()?;
        Some(["png", "exr"].map(|e| folder.join(format!("picture_{slug}.{e}"))))
    }

    fn write(&mut self, lines: &[Line]) -> Result<()> {
        let Some((folder, file)) = &mut self.place else { return Ok(()) };
        let failed = |e: &dyn std::fmt::Display| {
            Error::runtime("cannot record rows", folder.join(JOURNAL).display(), e)
        };
        let mut bytes = Vec::new();
        for line in lines {
            serde_json::to_writer(&mut bytes, line).map_err(|e| failed(&e))?;
            bytes.push(b'\n');
        }
        file.write_all(&bytes).and_then(|()| file.sync_data()).map_err(|e| failed(&e))
    }
}

/// Deletes the pictures that the journal file names, because the comparison starts anew. Pictures of settings chosen
/// by a search may be named nowhere else.
fn remove_pictures(journal: &mut File, folder: &Path) {
    let mut bytes = Vec::new();
    // Files that cannot be read or removed stay. A row with the same name overwrites them later.
    let _ = journal.read_to_end(&mut bytes);
    for line in bytes.split(|b| *b == b'\n') {
        let Ok(Line::Row { measured: Measured { slug, .. }, .. }) = serde_json::from_slice(line) else {
            continue;
        };
        // Nothing outside the folder is deleted, whatever the journal contains.
        if !slug.contains(['/', '\\']) {
            for ending in ["png", "exr"] {
                let _ = std::fs::remove_file(folder.join(format!("picture_{slug}.{ending}")));
            }
        }
    }
}

/// Returns a hash of a picture's size and pixel values.
fn fingerprint(picture: &Array3<f32>) -> String {
    let mut hasher = DefaultHasher::new();
    picture.dim().hash(&mut hasher);
    picture.iter().for_each(|v| v.to_bits().hash(&mut hasher));
    format!("{:016x}", hasher.finish())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::Span;
    use crate::measure::table::tests::sample_rows;

    fn measured(i: usize) -> Measured {
        let row = Row { width: 3, height: 2, ..sample_rows()[i].clone() };
        let left_out = vec![Omission { what: "a".into(), why: "b".into(), saved: None, optional: None }];
        Measured { row, slug: format!("m{i}"), left_out, notes: vec!["n".into()], frame_ms: 0.1 + 0.2 }
    }

    fn picture() -> Array3<f32> {
        Array3::from_shape_fn((2, 3, 4), |(j, i, c)| (j + 10 * i + 100 * c) as f32 / 3.0)
    }

    fn times(ms: f64) -> StageTimes {
        let span = Span { gpu_ms: None, wall_ms: ms };
        StageTimes {
            tables_ms: None,
            build_host_ms: 1.0 / 3.0,
            build_device: Some(span),
            build_wall_ms: 0.1 + ms,
            frame: span,
            frame_host_ms: 0.1 * ms,
            gpu_mhz: Some(1000.0 * ms),
            unsteady: false,
        }
    }

    /// Writes a test journal with two comparison table rows, one of them with a timed round.
    fn written(folder: &Path) {
        let mut journal = Journal::open(folder, false).unwrap();
        journal.record("k1", &measured(1), &picture()).unwrap();
        journal.record("k2", &measured(2), &picture()).unwrap();
        journal.record_round([("k1", times(0.7))]).unwrap();
    }

    #[test]
    fn journal_round_trip() {
        let dir = tempfile::tempdir().unwrap();
        written(dir.path());
        let mut journal = Journal::open(dir.path(), true).unwrap();
        assert_eq!((journal.len(), journal.run()), (2, 2));
        let recorded = Recorded { measured: measured(1), picture: picture(), rounds: vec![(1, times(0.7))] };
        assert_eq!(journal.take("k1"), Some(recorded));
        assert_eq!(journal.take("k2").unwrap().rounds, []);
        assert_eq!(journal.take("k3"), None);
        // Rounds of the second run are added to those of the first.
        journal.record_round([("k1", times(0.9)), ("k2", times(0.3))]).unwrap();
        drop(journal);
        let rounds = Journal::open(dir.path(), true).unwrap().take("k1").unwrap().rounds;
        assert_eq!(rounds, [(1, times(0.7)), (2, times(0.9))]);
    }

    #[test]
    fn trials_come_back_as_they_were() {
        let dir = tempfile::tempdir().unwrap();
        let trial = Row { method: "dsm".into(), bytes: Some(7), frame_ms: Some(0.1 + 0.2), ..Row::default() };
        Journal::open(dir.path(), false).unwrap().record_trial("t1", &trial).unwrap();
        let journal = Journal::open(dir.path(), true).unwrap();
        assert_eq!((journal.trial("t1"), journal.trial("t2"), journal.len()), (Some(trial), None, 0));
    }

    #[test]
    fn a_last_line_that_is_not_whole_is_dropped_at_any_length() {
        let dir = tempfile::tempdir().unwrap();
        written(dir.path());
        let path = dir.path().join(JOURNAL);
        let bytes = std::fs::read(&path).unwrap();
        let second = 1 + bytes.iter().position(|b| *b == b'\n').unwrap();
        for length in [second, second + 1, second + 40, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let mut journal = Journal::open(dir.path(), true).unwrap();
            assert!(journal.take("k1").is_some_and(|k| k.rounds.is_empty()), "{length}");
            journal.record("k4", &measured(4), &picture()).unwrap();
            drop(journal);
            let mut journal = Journal::open(dir.path(), true).unwrap();
            assert!(journal.take("k4").is_some(), "{length}: what follows is whole");
        }
    }

    #[test]
    fn without_resuming_nothing_is_left() {
        let dir = tempfile::tempdir().unwrap();
        written(dir.path());
        assert!(Journal::open(dir.path(), false).unwrap().is_empty());
        assert!(!dir.path().join("picture_m1.exr").exists() && !dir.path().join("picture_m2.png").exists());
        assert!(Journal::open(dir.path(), true).unwrap().is_empty());
    }

    #[test]
    fn rows_without_their_pictures_are_measured_again() {
        let dir = tempfile::tempdir().unwrap();
        written(dir.path());
        std::fs::remove_file(dir.path().join("picture_m1.exr")).unwrap();
        std::fs::write(dir.path().join("picture_m2.exr"), "no picture").unwrap();
        let mut journal = Journal::open(dir.path(), true).unwrap();
        assert_eq!((journal.take("k1"), journal.take("k2")), (None, None));
        drop(journal);
        // A picture of another row with the same file name is rejected.
        let mut journal = Journal::open(dir.path(), true).unwrap();
        journal.record("k1", &measured(1), &picture()).unwrap();
        journal.record("other", &measured(1), &(picture() + 1.0)).unwrap();
        drop(journal);
        let mut journal = Journal::open(dir.path(), true).unwrap();
        assert!(journal.take("k1").is_none() && journal.take("other").is_some());
        // Rounds timed before do not apply to the row measured again.
        journal.record("k1", &measured(1), &picture()).unwrap();
        drop(journal);
        assert_eq!(Journal::open(dir.path(), true).unwrap().take("k1").unwrap().rounds, []);
    }

    #[test]
    fn broken_lines_and_two_at_once_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        written(dir.path());
        let open = Journal::open(dir.path(), true).unwrap();
        assert!(Journal::open(dir.path(), true).unwrap_err().why.contains("another"));
        drop(open);
        let path = dir.path().join(JOURNAL);
        let mut bytes = std::fs::read(&path).unwrap();
        bytes.extend(b"{\"kind\": \"row\"}\n");
        std::fs::write(&path, bytes).unwrap();
        let e = Journal::open(dir.path(), true).unwrap_err();
        assert!(e.exit_status() == 2 && e.place.ends_with("line 4") && e.hint.is_some(), "{e}");
    }
}
