//! Comparison table of several shadow methods, measured beside the window.

use super::Bench;
use eframe::egui::{self, Modifiers};
use egui_kittest::kittest::Queryable;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};
use umbravox::measure::journal::JOURNAL;
use umbravox::measure::table::Row;
use umbravox::report::number::significant;
use umbravox::shadow::METHODS;

impl Bench {
    /// Opens the comparison window with a small task: small pictures, few points and rays, only the named method
    /// families.
    pub fn ask_for_little(&mut self, folder: &Path, families: &[(&str, &str)], repeats: &str) {
        self.harness.key_press(egui::Key::T);
        self.harness.step();
        self.harness.step();
        for entry in METHODS {
            let name = entry.name;
            match families.iter().find(|(family, _)| *family == name) {
                Some((_, spec)) => self.type_into(&format!("settings of {name}"), spec),
                // The others are chosen at first.
                None if entry.compared.is_empty() => {}
                None => self.click(&format!("compare {name}")),
            }
        }
        let figures = [("repeats", repeats), ("points", "400"), ("light rays", "40"), ("depths", "30")];
        for (name, value) in figures.into_iter().chain([("width", "24"), ("height", "20")]) {
            self.type_number(&format!("table {name}"), value);
        }
        self.type_into("table folder", folder.to_str().unwrap());
    }

    /// Types a value into a number field.
    fn type_number(&mut self, label: &str, text: &str) {
        self.click(label);
        self.harness.key_press_modifiers(Modifiers::COMMAND, egui::Key::A);
        self.harness.step();
        self.harness.event(egui::Event::Text(text.to_owned()));
        self.harness.step();
        self.harness.key_press(egui::Key::Enter);
        self.harness.step();
        self.harness.step();
    }

    fn shows(&self, label: &str) -> bool {
        self.harness.query_all_by_label_contains(label).next().is_some()
    }
}

/// Two method families with few rows.
pub fn little() -> [(&'static str, &'static str); 2] {
    [("none", "none"), ("dsm", "dsm:map=64,epsilon=0.1,0.05,prefilter=5,precompress=table")]
}

/// Reads the rows of `compare.csv`.
fn csv_rows(folder: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(folder.join("compare.csv")).unwrap();
    let rows = reader.deserialize::<BTreeMap<String, String>>();
    rows.map(|row| Row::from_texts(&row.unwrap()).unwrap()).collect()
}

// Long: one session in the window, each step of which needs the table of the steps before.
#[test]
fn a_comparison_fills_the_table_and_its_folder() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:24", "--shadow=dsm:map=64"]) else { return };
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("made/for it");
    // The comparison uses the scene that was shown at the start.
    let scene = bench.app().model.document.as_ref().unwrap().scene.clone();
    bench.ask_for_little(&folder, &[("none", "none"), ("dsm", "dsm:map=64,epsilon=0.1,0.05")], "2");
    assert!(bench.shows("3 rows"));
    bench.click("Start");
    assert_eq!(bench.app().windows.comparison.share(), Some(0.0));
    bench.wait_for("a step", |app| app.windows.comparison.share().is_none_or(|share| share > 0.0));
    bench.harness.get_by_label("comparison progress");
    // The window stays usable while the comparison runs.
    bench.app().model.look_from(2);
    bench.wait_for("a row", |app| !app.windows.comparison.rows().is_empty());
    bench.wait_for("the table", |app| app.windows.comparison.outcome().is_some());
    let comparison = &bench.app().windows.comparison;
    assert!(comparison.outcome().unwrap().is_ok(), "{:?}", comparison.outcome());
    assert_eq!(comparison.share(), None);

    let rows = bench.app().windows.comparison.rows();
    assert_eq!(rows, csv_rows(&folder), "what is shown is what is written");
    let named: Vec<_> = rows.iter().map(|r| format!("{} {}", r.method, r.params)).collect();
    assert_eq!(named, ["none ", "dsm epsilon=0.1", "dsm epsilon=0.05"]);
    for row in &rows {
        assert_eq!((row.width, row.height, row.repeats), (24, 20, Some(2)));
        assert!(row.point_err_rms.is_some() && row.frame_ms.is_some() && row.pareto.is_some());
        assert!(row.note.contains("the window was open"), "{}", row.note);
        assert!(row.scene.starts_with("sphere:24, "), "{}", row.scene);
    }
    for file in ["md", "json", "tex", "svg", "png"] {
        assert!(folder.join(format!("compare.{file}")).is_file(), "{file}");
    }
    let report = folder.join("report.html");
    let text = std::fs::read_to_string(&report).unwrap();
    assert!(text.contains("the window was open"));
    let eye = scene.camera.eye;
    assert!(text.contains(&format!("{:.4}, {:.4}, {:.4}", eye.x, eye.y, eye.z)), "the camera of the start");
    assert!(bench.shows(report.to_str().unwrap()));

    // Numbers are right-aligned under their headings.
    for (heading, value) in [("point_err_rms", rows[2].point_err_rms), ("frame_ms", rows[2].frame_ms)] {
        let above = bench.harness.get_by_label(&format!("sort by {heading}")).rect();
        let text = significant(value.unwrap(), 3);
        let figures = bench.harness.query_all_by_label(&text).map(|n| n.rect()).collect::<Vec<_>>();
        let under =
            |r: &egui::Rect| r.top() > above.bottom() - 1.0 && (r.right() - above.right()).abs() < 1.5;
        assert!(figures.iter().any(under), "{heading} {above}: {text} {figures:?}");
    }
    // The system opens the report; if it cannot, a message names the path.
    bench.app().windows.comparison.opener = Some(|_| Err(std::io::Error::other("no browser is here")));
    bench.click("Open report");
    let said = format!("cannot open the report ({}): no browser is here", report.display());
    let start = Instant::now();
    while !bench.shows(&said) {
        bench.harness.step();
        assert!(start.elapsed() < Duration::from_secs(20));
    }
    bench.app().windows.comparison.opener = Some(|path| match path.is_file() {
        true => std::fs::rename(path, path.with_extension("opened")),
        false => Err(std::io::Error::other("that is no file")),
    });
    bench.click("Open report");
    while !report.with_extension("opened").is_file() {
        bench.harness.step();
        assert!(start.elapsed() < Duration::from_secs(20));
    }
    bench.harness.run_steps(3);
    assert!(!bench.shows("cannot open the report"));

    // A click puts a row's method into the shadows panel; with Shift it becomes the second method.
    bench.settle();
    bench.click("epsilon=0.05");
    bench.settle();
    assert_eq!(
        format!("{:#}", bench.app().model.document.as_ref().unwrap().method),
        "dsm:epsilon=0.05,map=64"
    );
    assert_eq!(bench.app().model.frame.as_ref().unwrap().main.spec, "dsm:epsilon=0.05,map=64");
    assert!(bench.app().model.split.share.is_none());
    bench.harness.event(egui::Event::ModifiersChanged(Modifiers::SHIFT));
    let at = bench.harness.get_by_label("epsilon=0.1").rect().center();
    bench.harness.event(egui::Event::PointerMoved(at));
    bench.harness.step();
    for pressed in [true, false] {
        let (button, modifiers) = (egui::PointerButton::Primary, Modifiers::SHIFT);
        bench.harness.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers });
        bench.harness.step();
    }
    bench.harness.event(egui::Event::ModifiersChanged(Modifiers::NONE));
    bench.settle();
    let frame = bench.app().model.frame.clone().unwrap();
    let specs = (frame.main.spec.as_str(), frame.other.as_ref().unwrap().spec.as_str());
    assert_eq!(specs, ("dsm:epsilon=0.05,map=64", "dsm:epsilon=0.1,map=64"));

    // Headings sort the table: the worst row is at the top, then at the bottom.
    let worst = rows.iter().max_by(|a, b| a.point_err_rms.partial_cmp(&b.point_err_rms).unwrap()).unwrap();
    assert_eq!(worst.method, "none");
    let top = |bench: &Bench, label: &str| bench.harness.get_by_label(label).rect().top();
    for (clicks, first, second) in [(1, "epsilon=0.05", "epsilon=0.1"), (2, "epsilon=0.1", "epsilon=0.05")] {
        bench.click("sort by point_err_rms");
        assert!(top(&bench, first) < top(&bench, second), "{clicks}");
    }

    // The table is complete: resuming measures nothing and gives the same rows.
    let journal = std::fs::read(folder.join(JOURNAL)).unwrap();
    bench.app().model.document.as_mut().unwrap().scene = scene;
    bench.settle();
    bench.click("Start");
    bench.wait_for("the table again", |app| app.windows.comparison.outcome().is_some());
    assert_eq!(bench.app().windows.comparison.rows(), rows);
    assert_eq!(std::fs::read(folder.join(JOURNAL)).unwrap(), journal);
}

#[test]
fn a_cancelled_comparison_resumes_from_its_journal() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:24", "--shadow=none"]) else { return };
    let dir = tempfile::tempdir().unwrap();
    // More rounds than the test waits for.
    bench.ask_for_little(dir.path(), &[("none", "none"), ("dsm", "dsm:map=64")], "1000");
    bench.click("Start");
    let lines = || std::fs::read_to_string(dir.path().join(JOURNAL)).unwrap_or_default().lines().count();
    bench.wait_for("a round", |_| lines() > 2);
    bench.click("Cancel comparison");
    let asked = Instant::now();
    bench.wait_for("the end", |app| app.windows.comparison.outcome().is_some());
    assert!(asked.elapsed() < Duration::from_secs(20), "{:?}", asked.elapsed());
    let outcome = bench.app().windows.comparison.outcome().unwrap();
    assert!(outcome.as_ref().is_err_and(|e| e.is_cancelled()), "{outcome:?}");
    assert!(bench.shows("Cancelled at") && bench.shows("2 rows are in"));
    assert_eq!(bench.app().windows.comparison.rows().len(), 2, "what was measured is still shown");
    assert!(!dir.path().join("compare.csv").exists());
    let names = std::fs::read_dir(dir.path()).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap());
    let begun = [JOURNAL, "run.json", "scene.toml", "transfer_function.json"];
    let known = |n: String| begun.contains(&n.as_str()) || n.starts_with("picture_");
    assert!(names.into_iter().all(known), "no half-written file");

    // With as many rounds as are recorded, the recorded rows are used.
    let kept = lines();
    bench.click("What to compare");
    while bench.harness.query_by_label("table repeats").is_none() {
        bench.harness.step();
    }
    bench.type_number("table repeats", "1");
    bench.click("Start");
    bench.wait_for("the table", |app| app.windows.comparison.outcome().is_some());
    assert!(bench.app().windows.comparison.outcome().unwrap().is_ok());
    assert_eq!(lines(), kept, "nothing is measured again");
    assert_eq!(csv_rows(dir.path()), bench.app().windows.comparison.rows());
}

#[test]
fn bad_settings_and_folders_show_errors_beside_their_fields() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:24", "--shadow=none"]) else { return };
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, "").unwrap();
    bench.ask_for_little(&file, &[("none", "none"), ("dsm", "dsm:epsilon=2")], "1");
    assert!(bench.harness.query_all_by_label_contains("epsilon").any(|n| {
        let field = bench.harness.get_by_label("settings of dsm").rect();
        n.rect().top() >= field.bottom() - 1.0 && n.rect().top() < field.bottom() + 30.0
    }));
    bench.click("Start");
    let comparison = &bench.app().windows.comparison;
    assert!(comparison.share().is_none() && comparison.outcome().is_none(), "it does not start");
    bench.type_into("settings of dsm", "osm");
    assert!(bench.shows("the settings of `dsm` belong here"));
    bench.type_into("settings of dsm", "dsm:map=32");
    assert!(bench.shows("2 rows"));
    // An output folder that is a file is refused.
    bench.click("Start");
    assert!(bench.app().windows.comparison.share().is_none());
    assert!(bench.shows("is not a folder"));
    assert_eq!(std::fs::read(&file).unwrap(), b"");
}
