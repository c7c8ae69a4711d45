//! `compare.rows.jsonl`: what has been measured, a line each, on disk as soon as it is measured, so that an interrupted
//! table can be continued.
//!
//! A line is a row with its errors, written after its picture is on disk, one timed round of a row, or a trial of a
//! search within a budget. Lines are only ever added, each whole and in one write; what an interruption has left of a last line is dropped.

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

/// The file's name, in the folder of the table.
pub const JOURNAL: &str = "compare.rows.jsonl";

/// A row without its times, as it is measured first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The row, times left out.
    #[serde(rename = "cells", with = "row_as_texts")]
    pub row: Row,
    /// Part of its files' names.
    pub slug: String,
    /// Work that the plan skipped.
    pub left_out: Vec<Omission>,
    /// Notes for the reader of the table.
    pub notes: Vec<String>,
    /// Time of the first picture, ms, from which slow rows are recognised.
    pub frame_ms: f64,
}

/// Rows as their cells in CSV, by column: JSON has no infinity.
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

/// A row of an earlier run, with what it was timed so far.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorded {
    /// The row as it was measured.
    pub measured: Measured,
    /// `height x width x 4`, linear RGBA.
    pub picture: Array3<f32>,
    /// Timed rounds with the run of the program that each is from.
    pub rounds: Vec<(u32, StageTimes)>,
}

#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Line {
    Row {
        key: String,
        /// Fingerprint of the picture, to distinguish it from another one of the same name.
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

/// Recorded rows by their keys, and the file of new ones.
#[derive(Debug, Default)]
pub struct Journal {
    place: Option<(PathBuf, File)>,
    /// Metadata of the pictures, by keys.
    about: Vec<(String, String)>,
    /// Rows that are on disk and belong to this run's table.
    recorded: usize,
    /// Number of this run of the program, from 1 for the first that writes to a journal.
    run: u32,
    /// Measured rows by key, each with the fingerprint of its picture.
    rows: HashMap<String, (Measured, String)>,
    rounds: HashMap<String, Vec<(u32, StageTimes)>>,
    trials: HashMap<String, Row>,
}

impl Journal {
    /// A journal that records nothing.
    pub fn nowhere() -> Self {
        Self::default()
    }

    /// Opens the journal of a folder that exists: to go on with what is there, or to start anew, which forgets it.
    ///
    /// # Errors
    /// A file that cannot be read or written, that another run is writing to, or with a line that is none of a journal.
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
        // A file system without locks cannot say who writes.
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

    /// Number of rows of earlier runs, of all scenes and settings.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Number of rows of the table on disk, measured by this run or by earlier ones.
    pub fn recorded(&self) -> usize {
        self.recorded + self.rows.len()
    }

    /// Sets the texts, by key, of the pictures that are recorded from now on, besides their methods.
    pub fn describe(&mut self, about: Vec<(String, String)>) {
        self.about = about;
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn read(&mut self, line: &[u8]) -> Result<(), String> {
        match serde_json::from_slice(line).map_err(|e| e.to_string())? {
            Line::Row { key, picture, measured } => {
                // A row measured again, because its picture was gone, is timed again.
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

    /// Removes and returns the row of a key, if an earlier run measured it and its pictures still exist unchanged.
    pub fn take(&mut self, key: &str) -> Option<Recorded> {
        let (measured, expected) = self.rows.remove(key)?;
        let [png, exr] = self.pictures(&measured.slug)?;
        let picture = read_exr(&exr).ok()?;
        let rounds = self.rounds.remove(key).unwrap_or_default();
        let recorded = png.is_file() && fingerprint(&picture) == expected;
        self.recorded += usize::from(recorded);
        recorded.then_some(Recorded { measured, picture, rounds })
    }

    /// Puts a row's pictures on disk, and then the row.
    ///
    /// # Errors
    /// Files that cannot be written.
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

    /// Adds a timed round of some rows.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn record_round<'k>(&mut self, times: impl IntoIterator<Item = (&'k str, StageTimes)>) -> Result<()> {
        let run = self.run;
        let line = |(key, times): (&str, _)| Line::Round { key: key.into(), run, times };
        self.write(&times.into_iter().map(line).collect::<Vec<_>>())
    }

    /// Returns the trial of a key, if an earlier run made it.
    pub fn trial(&self, key: &str) -> Option<Row> {
        self.trials.get(key).cloned()
    }

    /// Adds a trial.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn record_trial(&mut self, key: &str, trial: &Row) -> Result<()> {
        self.write(&[Line::Trial { key: key.into(), trial: trial.clone() }])
    }

    /// Number of this run of the program, from 1.
    pub fn run(&self) -> u32 {
        self.run
    }

    /// A row's picture as PNG, and as EXR, which keeps every bit.
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

/// Removes the pictures of a journal that is started anew: of rows that a search chose nothing else may say so yet.
fn remove_pictures(journal: &mut File, folder: &Path) {
    let mut bytes = Vec::new();
    // What cannot be read or removed stays, and is written over where a row of that name comes again.
    let _ = journal.read_to_end(&mut bytes);
    for line in bytes.split(|b| *b == b'\n') {
        let Ok(Line::Row { measured: Measured { slug, .. }, .. }) = serde_json::from_slice(line) else {
            continue;
        };
        // Whatever the journal says, nothing outside the folder is touched.
        if !slug.contains(['/', '\\']) {
            for ending in ["png", "exr"] {
                let _ = std::fs::remove_file(folder.join(format!("picture_{slug}.{ending}")));
            }
        }
    }
}

/// A number for a picture's shape and bits.
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
        }
    }

    /// Writes a journal of two rows, one with a round.
    fn written(folder: &Path) {
        let mut journal = Journal::open(folder, false).unwrap();
        journal.record("k1", &measured(1), &picture()).unwrap();
        journal.record("k2", &measured(2), &picture()).unwrap();
        journal.record_round([("k1", times(0.7))]).unwrap();
    }

    #[test]
    fn what_was_kept_comes_back_as_it_was() {
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
        // Another row's picture of the same name is not its own.
        let mut journal = Journal::open(dir.path(), true).unwrap();
        journal.record("k1", &measured(1), &picture()).unwrap();
        journal.record("other", &measured(1), &(picture() + 1.0)).unwrap();
        drop(journal);
        let mut journal = Journal::open(dir.path(), true).unwrap();
        assert!(journal.take("k1").is_none() && journal.take("other").is_some());
        // The rounds of before are not those of the row measured again.
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
