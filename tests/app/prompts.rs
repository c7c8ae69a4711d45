//! Path prompts and floating windows over the view: Enter confirms, Escape closes the topmost one; the probe
//! describes error bounds.

use super::Bench;
use eframe::egui::{Key, vec2};
use egui_kittest::kittest::Queryable;
use umbravox::app::{App, Purpose};
use umbravox::formats::write_nifti;
use umbravox::open::SceneRequest;
use umbravox::phantom::Phantom;
use umbravox::scene::Shading;
use umbravox::transfer::TransferFunction;

const SMALL: &[&str] = &["phantom:sphere:24", "--tf=uniform", "--shadow=dsm:map=64"];

impl Bench {
    fn ask(&mut self, purpose: Purpose) {
        let App { model, windows, .. } = self.app();
        windows.prompt.ask(model, purpose);
        self.harness.run_steps(2);
    }

    fn errors(&mut self) -> Vec<String> {
        let messages = self.app().model.messages.iter();
        messages.filter(|m| m.is_error).map(|m| m.text.clone()).collect()
    }
}

#[test]
fn enter_confirms_every_prompt() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    for (purpose, name) in [
        (Purpose::SaveTransfer, "mine.json"),
        (Purpose::SaveScene, "mine.toml"),
        (Purpose::ExportPicture, "mine.png"),
    ] {
        bench.ask(purpose);
        // The field has the focus at the start.
        bench.harness.key_press_modifiers(eframe::egui::Modifiers::COMMAND, Key::A);
        bench.harness.step();
        bench.harness.event(eframe::egui::Event::Text(path(name).display().to_string()));
        bench.harness.step();
        bench.press(Key::Enter);
        assert!(!bench.app().windows.prompt.is_open(), "{purpose:?}");
        bench.settle();
        assert!(path(name).is_file(), "{purpose:?}: {:?}", bench.errors());
    }
    assert!(TransferFunction::read(&path("mine.json")).is_ok());
    assert!(SceneRequest::read(&path("mine.toml")).is_ok());

    let other = r#"{"name": "other", "units": "", "points": [{"value": 0, "opacity": 0}, {"value": 9, "opacity": 0.5}]}"#;
    std::fs::write(path("other.json"), other).unwrap();
    bench.ask(Purpose::LoadTransfer);
    bench.type_into("path", path("other.json").to_str().unwrap());
    bench.press(Key::Enter);
    assert_eq!(bench.app().model.document.as_ref().unwrap().tf.name, "other");

    bench.ask(Purpose::OpenVolume);
    bench.type_into("path", "phantom:step:12");
    bench.press(Key::Enter);
    assert!(!bench.app().windows.prompt.is_open());
    bench.wait_for("the volume", |app| app.model.document.as_ref().unwrap().spec.source == "phantom:step:12");

    // An empty path is not confirmed.
    bench.ask(Purpose::OpenVolume);
    bench.type_into("path", " ");
    bench.press(Key::Enter);
    assert!(bench.app().windows.prompt.is_open());
    assert_eq!(bench.errors(), Vec::<String>::new());
}

#[test]
fn tab_completes_a_path_and_its_folder_is_remembered() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("scans");
    std::fs::create_dir(&folder).unwrap();
    for (name, size) in [("first.nii.gz", 8), ("second.nii.gz", 10)] {
        write_nifti(&Phantom::Step.build(size).unwrap(), &folder.join(name)).unwrap();
    }
    std::fs::write(folder.join("notes.txt"), "not a volume").unwrap();
    let opened = |bench: &mut Bench, name: &str| {
        assert!(!bench.app().windows.prompt.is_open());
        let source = folder.join(name).display().to_string();
        bench.wait_for(name, |app| app.model.document.as_ref().unwrap().spec.source == source);
        bench.settle();
    };
    let type_text = |bench: &mut Bench, text: &str| {
        bench.harness.event(eframe::egui::Event::Text(text.to_owned()));
        bench.harness.run_steps(2);
    };
    bench.ask(Purpose::OpenVolume);
    bench.type_into("path", dir.path().join("sc").to_str().unwrap());
    bench.press(Key::Tab);
    type_text(&mut bench, "s");
    for key in [Key::Tab, Key::Enter] {
        bench.press(key);
    }
    opened(&mut bench, "second.nii.gz");
    // The next prompt starts in the same folder.
    bench.ask(Purpose::OpenVolume);
    type_text(&mut bench, "f");
    for key in [Key::Tab, Key::Enter] {
        bench.press(key);
    }
    opened(&mut bench, "first.nii.gz");
    // The suggested name is selected, so that typing replaces it.
    bench.ask(Purpose::ExportPicture);
    type_text(&mut bench, "a.png");
    bench.press(Key::Enter);
    bench.settle();
    assert!(folder.join("a.png").is_file(), "{:?}", bench.errors());
    // Where nothing can be completed Tab moves the focus.
    bench.ask(Purpose::OpenVolume);
    bench.type_into("path", "nothing like this");
    bench.press(Key::Tab);
    assert!(!bench.harness.get_by_label("path").is_focused());
    bench.press(Key::Escape);
    assert!(!bench.app().windows.prompt.is_open());
}

#[test]
fn escape_closes_only_the_topmost() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    bench.harness.set_size(vec2(2000.0, 1000.0));
    bench.settle();
    let center = bench.app().model.view.unwrap().center();
    bench.click_at(center);
    bench.wait_for("an answer", |app| app.model.probe.is_some());
    bench.press(Key::T);
    bench.press(Key::F1);
    bench.ask(Purpose::ExportPicture);
    let open = |bench: &mut Bench| {
        let app = bench.app();
        let windows = &app.windows;
        [windows.prompt.is_open(), windows.help, windows.comparison.open, app.model.probe.is_some()]
    };
    for left in 0..4 {
        let expected: [bool; 4] = std::array::from_fn(|i| i >= left);
        assert_eq!(open(&mut bench), expected);
        bench.press(Key::Escape);
    }
    assert_eq!(open(&mut bench), [false; 4]);

    // The window touched last is on top.
    bench.click_at(center);
    bench.wait_for("an answer", |app| app.model.probe.is_some());
    bench.press(Key::F1);
    // Drag to a corner that the list of keys does not cover.
    let probe = bench.harness.get_by_label("Probe").rect().left_top() + vec2(60.0, 12.0);
    bench.click_at(probe);
    bench.harness.run_steps(2);
    bench.press(Key::Escape);
    assert_eq!(open(&mut bench), [false, true, false, false]);
    // A text field, or an open list, takes Escape first.
    bench.harness.get_by_label("method epsilon").focus();
    bench.harness.run_steps(2);
    bench.press(Key::Escape);
    assert_eq!(open(&mut bench), [false, true, false, false]);
    bench.click("method");
    bench.press(Key::Escape);
    assert_eq!(open(&mut bench), [false, true, false, false]);
    bench.press(Key::Escape);
    assert_eq!(open(&mut bench), [false; 4]);
}

#[test]
fn the_probe_names_the_terms_of_the_error_bound() {
    for (spec, has_bound) in [("dsm:map=64", true), ("rays", true), ("bom:map=64", false), ("none", false)] {
        let shadow = format!("--shadow={spec}");
        let Some(mut bench) = Bench::open(&["phantom:thorax:32", &shadow]) else { return };
        let center = bench.app().model.view.unwrap().center();
        bench.click_at(center);
        bench.wait_for("an answer", |app| app.model.probe.is_some());
        bench.settle();
        let method = bench.app().model.probe.clone().unwrap().methods.remove(0);
        let name = spec.split(':').next().unwrap();
        let said = |bench: &Bench, text: &str| bench.harness.query_by_label_contains(text).is_some();
        let Some(bound) = method.bound else {
            assert!(!has_bound && said(&bench, &format!("{name} has no error bound")), "{spec}");
            continue;
        };
        assert!(has_bound, "{spec}: {bound:?}");
        let frame = bench.app().model.frame.clone().unwrap();
        assert!(bound.bound.transmittance > 0.0 && frame.main.bound.is_some());
        let nearest = bound.nearest.expect("a texel lies there");
        assert!(nearest.satisfied && nearest.texels_away <= 0.5_f64.sqrt() + 1e-9, "{spec}: {nearest:?}");
        assert!(
            said(&bench, &format!("Error bound of {name}: ±")) && said(&bench, "it is satisfied"),
            "{spec}"
        );
    }
}

#[test]
fn shading_is_off_by_default() {
    let Some(mut bench) = Bench::empty() else { return };
    bench.app().model.open_source("phantom:sphere:16");
    bench.settle();
    let document = bench.app().model.document.clone().unwrap();
    assert_eq!(document.scene.shading, Shading::None);
    // The window gives the same scene as the command line, which reads the same file.
    let read = SceneRequest::from_toml(&document.scene_text("ct").unwrap()).unwrap().settings;
    assert!(matches!(read.shading, None | Some(Shading::None)));
}
