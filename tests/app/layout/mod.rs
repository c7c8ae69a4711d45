//! Layout of the window: nothing is cut, covered or unreadable from 640 x 480 points up.
//!
//! The tests examine what egui has laid out and painted: the rectangle of each widget against its panel's clip
//! rectangle, and all shapes in painting order. One window goes through all states, and each state through all sizes.

mod texts;
mod widgets;

use super::{Bench, scene_args};
use crate::common::SIZES;
use crate::comparison::little;
use eframe::egui::{self, Event, Key, Vec2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use umbravox::app::{Model, OpenMode};
use umbravox::measure::error_map::Quantity;
use umbravox::scene::Light;

/// Window sizes in points, and pixels per point. The last one is the smallest allowed window.
const WINDOWS: [(Vec2, f32); 7] = [
    (vec2(900.0, 560.0), 1.0),
    (vec2(900.0, 560.0), 2.0),
    (vec2(1280.0, 720.0), 1.0),
    (vec2(1280.0, 720.0), 2.0),
    (vec2(1920.0, 1080.0), 1.0),
    (vec2(1920.0, 1080.0), 2.0),
    (vec2(640.0, 480.0), 1.0),
];

/// Window sizes that are inspected in every state: the first ones, and always the smallest.
fn inspected_windows() -> Vec<(Vec2, f32)> {
    let (smallest, others) = WINDOWS.split_last().expect("a constant list");
    others.iter().take(SIZES.window_sizes - 1).chain([smallest]).copied().collect()
}

/// Layout faults that were found, each with its place.
#[derive(Default)]
struct Found(Vec<String>);

impl Found {
    fn at(&mut self, place: &str, faults: Vec<String>) {
        self.0.extend(faults.into_iter().map(|fault| format!("{place}: {fault}")));
    }

    fn assert_none(&self) {
        assert!(self.0.is_empty(), "{} faults:\n{}", self.0.len(), self.0.join("\n"));
    }
}

impl Bench {
    fn resize(&mut self, size: Vec2, pixels_per_point: f32) {
        let root = self.harness.input_mut().viewports.get_mut(&egui::ViewportId::ROOT).unwrap();
        root.native_pixels_per_point = Some(pixels_per_point);
        self.harness.set_size(size);
        // Panels, wrapped lines and tables settle over several frames.
        self.harness.run_steps(6);
        assert_eq!(self.harness.ctx.content_rect().size(), size);
        assert_eq!(self.harness.ctx.pixels_per_point(), pixels_per_point);
    }

    /// Scrolls a widget into view and clicks it.
    fn reach(&mut self, label: &str) {
        // Details of a final picture move the widgets below.
        self.settle();
        self.harness.get_by_label(label).scroll_to_me();
        self.harness.run_steps(3);
        self.click(label);
    }

    /// Inspects the current state of the window at every size, and its text in both themes at the first size.
    fn look(&mut self, state: &str, found: &mut Found) {
        for &(size, pixels_per_point) in &inspected_windows() {
            self.resize(size, pixels_per_point);
            let place = format!("{state}, {} x {} at {pixels_per_point}", size.x, size.y);
            assert!(widgets::count(&self.harness) > 20, "{place}: hardly anything is shown");
            found.at(&place, texts::faults(&self.harness));
            // The probe lies in the view if that is large enough.
            let Model { probe, view, .. } = &self.app().model;
            let view = view.filter(|view| probe.is_some() && view.width() > 500.0 && view.height() > 250.0);
            found.at(&place, widgets::faults(&mut self.harness, view));
        }
        self.resize(WINDOWS[0].0, WINDOWS[0].1);
        for dark in [false, true] {
            self.app().model.settings.dark = dark;
            self.harness.run_steps(3);
            let theme = if dark { "dark" } else { "light" };
            let view = self.app().model.view;
            found.at(&format!("{state}, {theme}"), texts::unreadable(&self.harness, view));
        }
    }

    /// Opens another command line with the same settings.
    fn open_line(&mut self, line: &[&str]) {
        let settings = scene_args(line).into_request().unwrap().settings;
        let source = settings.spec().source;
        self.app().model.open(settings.spec(), OpenMode::Settings(Box::new(settings)));
        self.wait_for("opened", |app| app.model.document.as_ref().is_some_and(|d| d.spec.source == source));
        self.settle();
    }

    fn choose(&mut self, main: &str, other: Option<&str>) {
        let model = &mut self.app().model;
        let document = model.document.as_mut().unwrap();
        document.method = main.parse().unwrap();
        if let Some(other) = other {
            document.other = other.parse().unwrap();
        }
        model.split.set(other.is_some());
        self.settle();
    }
}

/// Flags that make pictures cheap to draw at any size.
const CHEAP: [&str; 3] = ["--step=4", "--shading=none", "--shadow=none"];
/// Shadow methods with the longest texts.
const LONG: [&str; 2] =
    ["dsm:epsilon=0.0123,map=32,prefilter=5,precompress=off", "osm:map=32,layers=12,slicing=density"];

#[test]
fn nothing_is_cut_covered_or_unreadable_around_a_volume() {
    let Some(mut bench) = Bench::open(&[&["phantom:thorax:32"], &CHEAP[..]].concat()) else { return };
    let mut found = Found::default();
    bench.resize(WINDOWS[0].0, 1.0);
    bench.look("plain", &mut found);

    // A selected point, a point light and more lights.
    let document = bench.app().model.document.as_mut().unwrap();
    document.selected = Some(1);
    document.light_mut().light = Light::Point { position: glam::dvec3(-1234.567, 123.456, -98.765) };
    document.add_light();
    document.add_light();
    document.light_mut().intensity = 0.0;
    bench.look("a point and lights", &mut found);
    let document = bench.app().model.document.as_mut().unwrap();
    document.selected = None;
    document.remove_light();
    document.remove_light();

    bench.resize(WINDOWS[0].0, 1.0);
    bench.choose(LONG[0], None);
    bench.app().model.settings.slices = true;
    bench.look("slices", &mut found);
    bench.app().model.settings.slices = false;

    bench.choose(LONG[0], Some(LONG[1]));
    bench.look("split", &mut found);
    bench.resize(WINDOWS[0].0, 1.0);
    bench.settle();
    bench.app().difference.shows = Some(Quantity::Light);
    bench.wait_for("a heat map", |app| app.difference.found.is_some());
    bench.look("difference", &mut found);
    bench.app().difference.shows = None;
    bench.resize(WINDOWS[0].0, 1.0);
    let view = bench.app().model.view.unwrap();
    bench.settle();
    bench.click_at(view.center());
    bench.wait_for("the probe", |app| app.model.probe.is_some());
    bench.look("probe", &mut found);
    bench.app().model.probe = None;
    bench.press(Key::F);
    bench.look("flicker", &mut found);
    bench.press(Key::F);
    bench.choose("none", None);

    for text in ["saved /a/path/that/is/long/enough/to/need/more/than/one/line/scene.toml", "short"] {
        bench.app().model.note(text);
    }
    let long =
        "cannot read volume (/data/of/some/study/series-0003.nii.gz): it ends after 1234567 bytes".to_owned();
    bench.app().model.add_message(long, Some("is it still being copied?".to_owned()), true);
    bench.look("messages", &mut found);
    bench.app().model.messages.clear();
    found.assert_none();
}

#[test]
fn nothing_is_cut_covered_or_unreadable_in_windows_over_the_view() {
    let Some(mut bench) = Bench::open(&[&["phantom:thorax:32"], &CHEAP[..]].concat()) else { return };
    let mut found = Found::default();
    bench.resize(WINDOWS[0].0, 1.0);
    bench.press(Key::F1);
    bench.look("help", &mut found);
    bench.press(Key::F1);
    bench.ask_export();
    bench.look("export", &mut found);
    bench.press(Key::Escape);
    bench.app().model.settings.recent = (0..10)
        .map(|i| format!("/data/of/some/study/that/is/deep/in/folders/series-{i:04}.nii.gz"))
        .collect();
    for menu in ["File", "View"] {
        bench.click(menu);
        bench.look(menu, &mut found);
        if menu == "File" {
            for inner in ["Built-in", "Recent"] {
                bench.resize(WINDOWS[0].0, 1.0);
                bench.harness.get_by_label_contains(inner).hover();
                bench.harness.run_steps(6);
                bench.look(inner, &mut found);
            }
        }
        bench.press(Key::Escape);
        bench.press(Key::Escape);
    }
    bench.click("preset");
    bench.look("presets", &mut found);
    bench.press(Key::Escape);

    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("a folder with a long name/and one within/comparison");
    // At this size the whole form is visible and can be clicked.
    bench.resize(vec2(1920.0, 1080.0), 1.0);
    bench.ask_for_little(&folder, &little(), "1");
    bench.look("comparison", &mut found);
    bench.resize(WINDOWS[0].0, 1.0);
    bench.reach("Start");
    bench.look("comparison that runs", &mut found);
    bench.wait_for("the table", |app| app.windows.comparison.outcome().is_some());
    assert!(bench.app().windows.comparison.outcome().unwrap().is_ok());
    bench.look("rows", &mut found);
    found.assert_none();
}

#[test]
fn nothing_is_cut_covered_or_unreadable_with_labels_and_strands() {
    let dir = tempfile::tempdir().unwrap();
    let name =
        "a-scan-with-a-long-name-of-someone-who-keeps-the-date-and-the-kernel-in-it-2024-03-17-b70f.nii";
    let file = dir.path().join(name);
    super::masks::write_labels(&file);
    let labels = format!("--labels={}", file.display());
    let line = [&["phantom:thorax:32", labels.as_str(), "--label-tf=1=skin"], &CHEAP[..]].concat();
    let Some(mut bench) = Bench::open(&line) else { return };
    let mut found = Found::default();
    bench.resize(WINDOWS[0].0, 1.0);
    for side in ["Anterior", "Left", "Superior"] {
        bench.reach(&format!("clip from {side}"));
    }
    assert_eq!(bench.app().model.document.as_ref().unwrap().tf.clip.len(), 3);
    bench.look("labels and planes", &mut found);

    bench.resize(WINDOWS[0].0, 1.0);
    bench.open_line(&[&["phantom:hair-curly:300", "--resolution=16"], &CHEAP[..]].concat());
    bench.harness.get_by_label("strands resolution").scroll_to_me();
    bench.harness.run_steps(3);
    bench.type_into("strands resolution", "99999");
    bench.look("strands", &mut found);
    bench.resize(WINDOWS[0].0, 1.0);
    bench.open_line(&[&[file.to_str().unwrap()], &CHEAP[..]].concat());
    bench.look("a long name", &mut found);
    found.assert_none();
}

/// A shortened text has its whole text as a tooltip.
#[test]
fn elided_text_is_complete_in_its_tooltip() {
    let dir = tempfile::tempdir().unwrap();
    let name =
        "a-scan-with-a-long-name-of-someone-who-keeps-the-date-and-the-kernel-in-it-2024-03-17-b70f.nii";
    let file = dir.path().join(name);
    super::masks::write_labels(&file);
    let Some(mut bench) = Bench::open(&[&[file.to_str().unwrap()], &CHEAP[..]].concat()) else { return };
    bench.choose(LONG[0], Some(LONG[1]));
    bench.resize(vec2(640.0, 480.0), 1.0);
    let elided = texts::elided(&bench.harness);
    assert!(elided.len() >= 3, "{elided:?}");
    for (text, at) in elided {
        bench.harness.event(Event::PointerMoved(egui::pos2(1.0, 400.0)));
        bench.harness.run_steps(2);
        bench.harness.event(Event::PointerMoved(at));
        bench.harness.run_steps(8);
        let whole = texts::whole(&bench.harness);
        assert!(whole.iter().any(|t| t.contains(&text)), "{text} at {at}: {whole:?}");
    }
}

/// Planted layout faults are found.
#[test]
fn planted_faults_are_found() {
    let plant = |ui: &mut egui::Ui| {
        egui::Panel::left("left").resizable(false).exact_size(120.0).show(ui, |ui| {
            ui.add(egui::Label::new("too long a line for a panel of its width").extend());
            // Scrolling reaches what is out of view here.
            egui::ScrollArea::vertical().id_salt("outer").show(ui, |ui| {
                (0..40).for_each(|i| _ = ui.button(format!("button {i}")));
                egui::ScrollArea::vertical().id_salt("inner").max_height(60.0).show(ui, |ui| {
                    (0..8).for_each(|i| _ = ui.button(format!("inner {i}")));
                });
            });
        });
        let at = |x: f32, y: f32, w: f32| egui::Rect::from_min_size(egui::pos2(x, y), vec2(w, 20.0));
        ui.put(at(200.0, 20.0, 80.0), egui::Button::new("below"));
        ui.put(at(260.0, 30.0, 80.0), egui::Button::new("above"));
        ui.put(at(380.0, 390.0, 80.0), egui::Button::new("beyond the edge"));
        let color = egui::Color32::from_gray(70);
        ui.put(at(200.0, 100.0, 100.0), egui::Label::new(egui::RichText::new("dim").color(color)));
        ui.put(at(200.0, 130.0, 100.0), egui::Label::new("clear"));
        let font = egui::FontId::proportional(12.0);
        for (x, text) in [(200.0, "one text"), (220.0, "another text")] {
            let color = egui::Color32::WHITE;
            ui.painter().text(egui::pos2(x, 200.0), egui::Align2::LEFT_TOP, text, font.clone(), color);
        }
        ui.put(at(200.0, 240.0, 100.0), egui::Label::new("veiled"));
        ui.painter().rect_filled(at(200.0, 240.0, 100.0), 0.0, egui::Color32::from_black_alpha(100));
    };
    let mut harness = Harness::builder().with_size(vec2(400.0, 400.0)).build_ui(plant);
    // Scroll bars beside the content, as in the window.
    let bars = egui::style::ScrollStyle::solid();
    harness.ctx.all_styles_mut(|style| style.spacing.scroll = bars);
    harness.run_steps(3);
    let has = |faults: &[String], parts: &[&str]| {
        assert!(faults.iter().any(|f| parts.iter().all(|part| f.contains(part))), "{parts:?}: {faults:#?}");
    };
    let unreadable = texts::unreadable(&harness, None);
    has(&unreadable, &["`dim`", "contrast"]);
    assert_eq!(unreadable.len(), 1, "{unreadable:#?}");
    let texts = texts::faults(&harness);
    has(&texts, &["another text", "is painted over", "one text"]);
    has(&texts, &["a plate", "is painted over", "`veiled`"]);
    let widgets = widgets::faults(&mut harness, None);
    has(&widgets, &["cut", "too long a line"]);
    has(&widgets, &["cut", "beyond the edge"]);
    has(&widgets, &["`above`", "lies over", "`below`"]);
    assert_eq!(widgets.len(), 3, "{widgets:#?}");
}
