//! Comparison tables whose progress is reported, and that are cancelled.

use crate::common;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use umbravox::error::Result;
use umbravox::gpu::Gpu;
use umbravox::measure::facts::Facts;
use umbravox::measure::job::{Checked, Effort, name_of};
use umbravox::measure::journal::{JOURNAL, Journal};
use umbravox::measure::progress::{Progress, Status, StepKind, Watch};
use umbravox::measure::table::Row;
use umbravox::open::presets;
use umbravox::open::{VolumeSpec, load};
use umbravox::render::{DisabledOptimizations, Renderer};
use umbravox::report::make::{Made, Order, Subject, make};
use umbravox::report::run::{Run, SceneRecord};
use umbravox::report::tables::Layout;
use umbravox::scene::Scene;
use umbravox::shadow::parse_list;

const METHODS: &str = "none;rays;dsm:map=64,epsilon=0.06,0.02";

/// Step at which a test cancels the comparison.
enum End {
    Never,
    /// Cancels when a step of one kind starts for the n-th time.
    At(StepKind, usize),
}

/// Listener that records all progress of a comparison.
struct Listener {
    end: End,
    steps: Vec<(StepKind, String, f32)>,
    rows: Vec<(usize, Row)>,
    ended: Option<Instant>,
}

impl Listener {
    fn new(end: End) -> Self {
        Self { end, steps: Vec::new(), rows: Vec::new(), ended: None }
    }
}

impl Watch for &mut Listener {
    fn starts(&mut self, status: &Status) {
        assert!(self.ended.is_none(), "{} started after the end", status.what);
        self.steps.push((status.step.kind, status.step.method.clone(), status.share()));
        let started = |stage: StepKind| self.steps.iter().filter(|(s, ..)| *s == stage).count();
        if matches!(self.end, End::At(stage, times) if started(stage) == times) {
            self.ended = Some(Instant::now());
        }
    }

    fn row(&mut self, place: usize, row: &Row) {
        self.rows.push((place, row.clone()));
    }

    fn goes_on(&self) -> bool {
        self.ended.is_none()
    }
}

/// Measures the comparison table into `folder`, and resumes a table that is there.
fn made(folder: &Path, repeats: usize, listener: &mut Listener) -> Result<Made> {
    let volume = Arc::new(load(&VolumeSpec::new("phantom:sphere:24")).unwrap());
    let tf = presets::resolve("uniform", &volume).unwrap().tf;
    let scene = Scene { width: 32, height: 32, ..Scene::framing(&volume) };
    let methods = parse_list(METHODS).unwrap();
    let effort = Effort {
        repeats,
        short_repeats: 0,
        points: 500,
        rays: 50,
        depths: 40,
        check: Checked::Sample,
        flicker: 0,
    };
    let mut read = |_| {
        let (volume, tf, scene) = (Arc::clone(&volume), tf.clone(), scene.clone());
        Ok(Subject { volume, tf, strands: None, scene, forced: DisabledOptimizations::NONE })
    };
    let renderer = Arc::new(Renderer::new(Gpu::open(None)?));
    let mut journal = Journal::open(folder, true)?;
    let mut progress = Progress::watched(listener);
    let record = SceneRecord { name: "sphere".into(), size: [32, 32], ..SceneRecord::default() };
    let facts = Facts::of(renderer.gpu());
    let run = Run::new(&facts, effort, METHODS, &methods, vec![record], None);
    let methods = [methods];
    let order = Order { methods: &methods, budgets: &[], remark: "measured by a test" };
    make(&order, &run, &mut read, &renderer, &mut journal, &mut progress)
}

fn journal(folder: &Path) -> String {
    std::fs::read_to_string(folder.join(JOURNAL)).unwrap()
}

fn files(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap());
    names.collect()
}

/// Table row without its times.
fn figures(row: &Row) -> Row {
    Row {
        build_ms: None,
        build_ms_min: None,
        build_ms_max: None,
        frame_ms: None,
        frame_ms_min: None,
        frame_ms_max: None,
        build_host_ms: None,
        build_gpu_ms: None,
        build_wall_ms: None,
        build_first_ms: None,
        frame_host_ms: None,
        frame_gpu_ms: None,
        frame_wall_ms: None,
        bricks_ms: None,
        tables_ms: None,
        fps_static: None,
        fps_moving: None,
        frames: None,
        pareto: None,
        note: String::new(),
        ..row.clone()
    }
}

#[test]
fn a_table_that_is_ended_stops_at_once_and_is_resumed_to_the_same_rows() {
    if !common::has_adapter() {
        return;
    }
    let whole = tempfile::tempdir().unwrap();
    let mut listener = Listener::new(End::Never);
    let expected = made(whole.path(), 2, &mut listener).unwrap().comparison.rows();
    assert_eq!(expected.len(), 4);
    // Progress reports name each stage and method, and the share that is done.
    let methods: Vec<_> = parse_list(METHODS).unwrap().iter().map(|m| name_of(m.as_ref())).collect();
    for method in &methods {
        for (stage, times) in [(StepKind::Draw, 1), (StepKind::Errors, 1), (StepKind::Run, 3)] {
            let heard = listener.steps.iter().filter(|(s, m, _)| (s, m) == (&stage, method)).count();
            assert_eq!(heard, times, "{stage:?} {method}");
        }
    }
    let shares: Vec<f32> = listener.steps.iter().map(|(.., share)| *share).collect();
    assert!(shares[0] == 0.0 && shares.windows(2).all(|w| w[0] < w[1]) && shares[shares.len() - 1] < 1.0);
    // Rows are reported with their errors, and again with the times of every round.
    for (place, row) in expected.iter().enumerate() {
        let told: Vec<&Row> = listener.rows.iter().filter(|(p, _)| *p == place).map(|(_, r)| r).collect();
        assert_eq!(told.iter().map(|r| r.repeats).collect::<Vec<_>>(), [None, Some(1), Some(2)]);
        // These columns compare with other rows.
        assert_eq!(Row { pareto: row.pareto, frames: row.frames, ..told[2].clone() }, *row);
        assert_eq!((row.note.as_str(), row.has_failed()), ("measured by a test", false));
    }

    // Cancelled while the third method is drawn: two rows are recorded, and nothing else is written.
    let dir = tempfile::tempdir().unwrap();
    let mut listener = Listener::new(End::At(StepKind::Draw, 3));
    let e = made(dir.path(), 2, &mut listener).err().unwrap();
    let waited = listener.ended.unwrap().elapsed();
    assert!(e.is_cancelled() && e.place.starts_with("dsm epsilon=0.06"), "{e}");
    assert!(waited < Duration::from_secs(20), "{waited:?}");
    let kept = journal(dir.path());
    assert_eq!(kept.lines().count(), 2);
    let mut left = files(dir.path());
    left.sort();
    let pictures = ["picture_none.exr", "picture_none.png", "picture_rays.exr", "picture_rays.png"];
    assert_eq!(left, [&[JOURNAL][..], &pictures[..]].concat());

    // Cancelled again in the timed rounds: complete rounds are recorded.
    let mut listener = Listener::new(End::At(StepKind::Run, 4 + 4 + 2));
    let e = made(dir.path(), 2, &mut listener).err().unwrap();
    assert!(e.is_cancelled() && e.place.contains("timing"), "{e}");
    let drawn = listener.steps.iter().filter(|(s, ..)| *s == StepKind::Draw).count();
    assert_eq!(drawn, 2, "what was measured is not measured again");
    assert!(journal(dir.path()).starts_with(&kept) && journal(dir.path()).lines().count() == 4 + 4);
    assert!(!dir.path().join("compare.csv").exists());

    // Resumed to the end.
    let mut listener = Listener::new(End::Never);
    let resumed = made(dir.path(), 2, &mut listener).unwrap();
    let rows = resumed.comparison.rows();
    assert!(rows.iter().all(|r| r.note.contains("measured by a test; its 2 timed rounds are from 2 runs")));
    let errors = |rows: &[Row]| rows.iter().map(figures).collect::<Vec<_>>();
    assert_eq!(errors(&rows), errors(&expected));
    let written = resumed.write(dir.path(), &Layout::default()).unwrap();
    let all = written.tables.iter().chain(&written.plots).chain(&written.pictures).chain([&written.report]);
    all.for_each(|path| assert!(path.is_file(), "{}", path.display()));
    let csv = String::from_utf8(std::fs::read(dir.path().join("compare.csv")).unwrap()).unwrap();
    assert_eq!(csv.lines().count(), 5);
    assert!(std::fs::read_to_string(written.report).unwrap().contains("<li>measured by a test</li>"));
}

#[test]
fn cancelled_before_start_measures_nothing() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let mut listener = Listener::new(End::Never);
    listener.ended = Some(Instant::now());
    assert!(made(dir.path(), 1, &mut listener).err().unwrap().is_cancelled());
    assert!(listener.steps.is_empty() && listener.rows.is_empty());
    assert_eq!((files(dir.path()), journal(dir.path())), (vec![JOURNAL.to_owned()], String::new()));
}
