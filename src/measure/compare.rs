//! The error-against-time table of one scene: every method's errors first, then its times in turn.
//!
//! Each is kept in the [`Journal`] as soon as it is had: a row with its errors and picture, then round by round its
//! times, each round of all methods. What an earlier run has kept is not measured again: a row's errors are then
//! taken as they are, and of its timed rounds only those that are missing are run, in turn with those of the other
//! methods that miss some.

mod rounds;

use super::facts::{Facts, job_key, row_key};
use super::journal::Journal;
use super::prepare::Errors;
use super::progress::{Progress, Stage, Step};
use super::stats::image_difference;
use super::table::{Row, mark_pareto};
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::render::{Omission, Session};
use crate::scene::Scene;
use crate::shadow::Method;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use ndarray::{Array2, Array3, Axis};
use rounds::{Entry, time};
use std::collections::HashMap;
use std::ops::RangeInclusive;

/// Frames slower than this are timed once, so that one method does not hold up the table.
pub(super) const SLOW_FRAME_MS: f64 = 2000.0;

/// Opacities of two pictures of one scene differ by no more than eye rays that end early make them.
const OPACITY_TOLERANCE: f32 = 2e-3;

/// Every family, each with at least three settings.
pub const DEFAULT_METHODS: &str = "none;rays;dsm:epsilon=0.06,0.02,0.005;osm:layers=8,32,128;dom:layers=3,7,15;\
    bom:layers=3,7,15";

/// How much to measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Timed runs of each method, after warm-up.
    pub repeats: usize,
    /// Points that the camera sees.
    pub points: usize,
    /// Light rays, and depths on each.
    pub rays: usize,
    pub depths: usize,
}

impl Effort {
    /// What each figure may be.
    pub const REPEATS: RangeInclusive<i64> = 1..=1000;
    pub const POINTS: RangeInclusive<i64> = 1..=10_000_000;
    pub const RAYS: RangeInclusive<i64> = 1..=1_000_000;
    pub const DEPTHS: RangeInclusive<i64> = 2..=4000;
}

impl Default for Effort {
    fn default() -> Self {
        Self { repeats: 5, points: 20_000, rays: 2000, depths: 200 }
    }
}

/// What to compare on what.
pub struct Job<'a> {
    pub session: &'a Session,
    pub volume: &'a Volume,
    pub tf: &'a TransferFunction,
    pub scene: &'a Scene,
    /// The column `scene`.
    pub scene_name: String,
    /// What the names of the scene's files start with; empty where there is but one scene.
    pub file_prefix: String,
    /// What a reader should know of how rows are timed, for their notes and those of the table; may be empty.
    pub remark: String,
    pub effort: Effort,
}

/// A row with its picture.
pub struct Compared {
    pub row: Row,
    /// A name for its files, different for every row.
    pub slug: String,
    /// `height x width x 4`, linear RGBA; `None` where the row failed before it was drawn.
    pub picture: Option<Array3<f32>>,
    /// Largest channel difference to the picture of the scene's `rays` row, `height x width`, where there is one.
    pub difference: Option<Array2<f32>>,
    pub left_out: Vec<Omission>,
}

/// Everything that came of a comparison.
#[derive(Default)]
pub struct Comparison {
    /// Scene by scene, in the order of the methods; failed rows too.
    pub compared: Vec<Compared>,
    /// What a reader of the table should know about how it was made.
    pub notes: Vec<String>,
    /// What failed, and with what: `dsm epsilon=0.02`.
    pub failures: Vec<(String, Error)>,
}

impl Comparison {
    /// The table.
    pub fn rows(&self) -> Vec<Row> {
        self.compared.iter().map(|c| c.row.clone()).collect()
    }

    /// Says of which scene the notes and failures are.
    pub fn name_scene(&mut self, name: &str) {
        self.notes.iter_mut().for_each(|note| *note = format!("{name}: {note}"));
        self.failures.iter_mut().for_each(|(what, _)| *what = format!("{name}: {what}"));
    }

    /// Adds another scene's.
    pub fn append(&mut self, mut other: Self) {
        self.compared.append(&mut other.compared);
        self.notes.append(&mut other.notes);
        self.failures.append(&mut other.failures);
    }

    /// What comes of a scene that cannot be drawn at all: a failed row a method.
    pub fn failed(
        facts: &Facts,
        scene_name: &str,
        size: [u32; 2],
        methods: &[Box<dyn Method>],
        error: &Error,
    ) -> Self {
        let mut comparison = Self::default();
        for method in methods {
            let method = method.as_ref();
            comparison.compared.push(Compared::failed(
                facts.row(scene_name, size, method),
                String::new(),
                error,
            ));
            comparison.failures.push((format!("{scene_name}: {}", name_of(method)), error.clone()));
        }
        comparison
    }
}

impl Compared {
    fn failed(mut row: Row, slug: String, error: &Error) -> Self {
        row.set_failed(error);
        Self { row, slug, picture: None, difference: None, left_out: Vec::new() }
    }
}

/// What there is to do for a scene, and how often.
pub fn steps(methods: &[Box<dyn Method>], effort: &Effort) -> Vec<(Step, usize)> {
    let mut steps = vec![(Step::new(Stage::Points, ""), 1), (Step::new(Stage::ExactPicture, ""), 1)];
    for method in methods {
        let name = name_of(method.as_ref());
        let times = [(Stage::Draw, 1), (Stage::Errors, 1), (Stage::Run, 1 + effort.repeats)];
        steps.extend(times.map(|(stage, times)| (Step::new(stage, &name), times)));
    }
    steps
}

/// Measures every method. One that fails is a row that says why, and the others go on; a method whose timing fails
/// keeps its errors. Ended between two steps, it leaves what is measured in the journal.
///
/// # Errors
/// No method is given, a journal that cannot be written to, or it was ended on request.
pub fn compare(
    job: &Job,
    methods: &[Box<dyn Method>],
    journal: &mut Journal,
    progress: &mut Progress,
) -> Result<Comparison> {
    if methods.is_empty() {
        return Err(Error::input("nothing to compare", "--methods", "no method is given"));
    }
    let facts = Facts::of(job.session.renderer.gpu());
    let job_key = job_key(job, &facts);
    let field = ExactField::new(job.volume, job.tf);
    let mut errors: Option<Result<Errors>> = None;

    let mut result = Comparison::default();
    let mut entries: Vec<Result<Entry, Compared>> = Vec::new();
    let mut slugs = HashMap::new();
    for (place, method) in methods.iter().enumerate() {
        let (method, name) = (method.as_ref(), name_of(method.as_ref()));
        let slug = unused_slug(&job.file_prefix, method, &mut slugs);
        let key = row_key(job_key, method, &slug);
        let (entry, notes) = match journal.take(&key) {
            Some(kept) => {
                progress.spare(&Step::new(Stage::Draw, &name), 1);
                progress.spare(&Step::new(Stage::Errors, &name), 1);
                Entry::kept(method, place, key, kept)
            }
            None => {
                // Made only where a row needs it.
                let errors = errors.get_or_insert_with(|| Errors::new(job, &facts, &field, progress));
                let measured = match errors {
                    Ok(errors) => errors.measure(method, &slug, progress),
                    Err(e) => Err(e.clone()),
                };
                match measured {
                    Ok((measured, picture)) => {
                        journal.keep(&key, &measured, &picture)?;
                        Entry::new(method, place, key, measured, picture)
                    }
                    Err(e) if e.is_cancelled() => return Err(e),
                    Err(e) => {
                        let size = [job.scene.width, job.scene.height];
                        let failed = Compared::failed(facts.row(&job.scene_name, size, method), slug, &e);
                        progress.row(place, &failed.row);
                        entries.push(Err(failed));
                        progress.spare(&Step::new(Stage::Run, &name), 1 + job.effort.repeats);
                        result.failures.push((name, e));
                        continue;
                    }
                }
            }
        };
        for note in notes {
            if !result.notes.contains(&note) {
                result.notes.push(note);
            }
        }
        progress.row(place, &entry.compared.row);
        entries.push(Ok(entry));
    }
    if errors.is_none() {
        progress.spare(&Step::new(Stage::Points, ""), 1);
        progress.spare(&Step::new(Stage::ExactPicture, ""), 1);
    }

    let mut ready: Vec<&mut Entry> = entries.iter_mut().filter_map(|e| e.as_mut().ok()).collect();
    result.notes.extend(unequal_opacity(&ready));
    // Slow rows apart: they would make every round of the others as slow.
    let (mut slow, mut fast): (Vec<_>, Vec<_>) = ready.drain(..).partition(|e| e.frame_ms > SLOW_FRAME_MS);
    if job.effort.repeats > 1 {
        for entry in &mut slow {
            let seconds = 1e-3 * entry.frame_ms;
            entry.compared.row.add_note(&format_args!("a frame takes {seconds:.1} s: timed once"));
        }
    }
    for (group, repeats) in [(&mut fast, job.effort.repeats), (&mut slow, 1)] {
        result.failures.extend(time(job, group, repeats, journal, progress)?);
    }
    progress.end();

    result.compared = entries.into_iter().map(|e| e.map_or_else(|failed| failed, |e| e.compared)).collect();
    let mut rows = result.rows();
    if !job.remark.is_empty() && rows.iter().any(|r| r.note.contains(&job.remark)) {
        result.notes.insert(0, job.remark.clone());
    }
    mark_pareto(&mut rows);
    let compared = &mut result.compared;
    let reference = compared.iter().find(|c| c.row.method == "rays").and_then(|c| c.picture.clone());
    for (compared, row) in compared.iter_mut().zip(rows) {
        compared.row = row;
        if let (Some(picture), Some(reference)) = (&compared.picture, &reference)
            && compared.row.method != "rays"
        {
            compared.difference = Some(image_difference(picture.view(), reference.view())?);
        }
    }
    Ok(result)
}

/// Shadows change light, never opacity: says where a picture's opacity is not that of the first, as when a driver
/// gives up a shader's loops.
fn unequal_opacity(entries: &[&mut Entry]) -> Vec<String> {
    let opacity = |e: &Entry| e.compared.picture.as_ref().map(|p| p.index_axis(Axis(2), 3).to_owned());
    let Some((first, others)) = entries.split_first() else { return Vec::new() };
    let note = |e: &&mut Entry| {
        let (opacity, expected) = (opacity(e)?, opacity(first)?);
        let off = (opacity - &expected).iter().filter(|d| d.is_nan() || d.abs() > OPACITY_TOLERANCE).count();
        let (name, first) = (name_of(e.method), name_of(first.method));
        (off > 0)
            .then(|| format!("{name}: {off} pixels of its picture differ in opacity from that of {first}"))
    };
    others.iter().filter_map(note).collect()
}

/// Method and settings as tables name them.
pub fn name_of(method: &dyn Method) -> String {
    [method.name(), &method.params()].join(" ").trim_end().to_string()
}

/// Text as part of a file name.
pub fn file_name_part(text: &str) -> String {
    let keep = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
    text.trim_end().chars().map(keep).collect()
}

/// Scene, method and settings as part of a file name; a number is added where a row has been named so before.
fn unused_slug(prefix: &str, method: &dyn Method, used: &mut HashMap<String, u32>) -> String {
    let map = method.map_size().map_or(String::new(), |n| format!(" map={n}"));
    let slug = prefix.to_owned() + &file_name_part(&format!("{}{map} {}", method.name(), method.params()));
    let times = used.entry(slug.clone()).and_modify(|n| *n += 1).or_insert(1);
    if *times == 1 { slug } else { format!("{slug}-{times}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::parse_list;

    #[test]
    fn file_names_tell_rows_apart() {
        let methods = parse_list("none;dsm:epsilon=0.02,0.005,map=64,128;none").unwrap();
        let mut used = HashMap::new();
        let slugs: Vec<_> = methods.iter().map(|m| unused_slug("", m.as_ref(), &mut used)).collect();
        let expected = [
            "none",
            "dsm-map-64-epsilon-0.02",
            "dsm-map-128-epsilon-0.02",
            "dsm-map-64-epsilon-0.005",
            "dsm-map-128-epsilon-0.005",
            "none-2",
        ];
        assert_eq!(slugs, expected);
        assert_eq!(unused_slug("lungs_", methods[0].as_ref(), &mut used), "lungs_none");
    }
}
