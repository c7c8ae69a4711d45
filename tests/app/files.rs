//! Input and output files of the window: unreadable files, scenes of the command line, pictures.

use super::Bench;
use ndarray::Array3;
use ndarray_npy::ReadNpyExt;
use umbravox::app::curve::Edit;
use umbravox::files::color::srgb8_from_linear;
use umbravox::files::loading::Loading;
use umbravox::files::picture::{Backdrop, read_exr};
use umbravox::open::SceneRequest;
use umbravox::render::{DisabledOptimizations, Picture, Session};

/// Draws a scene file as `render --scene` does.
fn drawn_by_the_command_line(scene: &std::path::Path) -> Picture {
    let settings = SceneRequest::read(scene).unwrap().settings;
    let method = settings.method().unwrap();
    let loaded = settings.load(&Loading::default()).unwrap();
    let session = Session::open(None, loaded.volume, &loaded.tf, DisabledOptimizations::NONE).unwrap();
    let shadow = session.shadow(method.as_ref(), loaded.scene.light()).unwrap();
    session.render(&shadow, &loaded.scene).unwrap()
}

#[test]
fn a_scene_file_draws_the_pixels_of_the_window() {
    let line = ["phantom:thorax:32", "--shadow=dsm:map=64,epsilon=0.03", "--light=dir:0.3,-0.2,0.7"];
    let Some(mut bench) = Bench::open(&line) else { return };
    let app = bench.app();
    app.model.look_from(2);
    app.model.edit(Edit::Color { index: 1, color: [0.3, 0.62, 0.1] });
    let amount = app.model.document.as_ref().unwrap().tf.points[1].amount;
    app.model.edit(Edit::Move { index: 1, value: 11.0 / 3.0, amount: amount + 0.123 });
    bench.settle();
    let dir = tempfile::tempdir().unwrap();
    let (scene, picture) = (dir.path().join("scene.toml"), dir.path().join("picture.npy"));
    let (width, height) = {
        let scene = &bench.app().model.document.as_ref().unwrap().scene;
        (scene.width, scene.height)
    };
    bench.app().model.save_scene(&scene);
    bench.app().model.export(&picture, [width, height], Backdrop::Drawn);
    bench.settle();
    let exported = Array3::<f32>::read_npy(std::fs::File::open(&picture).unwrap()).unwrap();
    let drawn = drawn_by_the_command_line(&scene);
    assert_eq!(drawn.pixels, exported, "scene: {}", std::fs::read_to_string(&scene).unwrap());
    // The screen shows the same picture, encoded.
    let shown = bench.pixels();
    let off = shown.chunks(4).zip(exported.rows()).map(|(shown, linear)| {
        (0..3).map(|c| shown[c].abs_diff(srgb8_from_linear(f64::from(linear[c])))).max().unwrap()
    });
    let off: Vec<u8> = off.collect();
    assert_eq!(shown.len(), width as usize * height as usize * 4);
    let beyond = off.iter().filter(|o| **o > 1).count();
    assert!(
        beyond == 0,
        "{beyond} of {} pixels are off by more than rounding, at most {:?}",
        off.len(),
        off.iter().max()
    );
}

#[test]
fn a_transparent_export_over_the_background_is_the_opaque_picture() {
    let line = ["phantom:thorax:32", "--shadow=dom:map=64", "--background=#3060c0"];
    let Some(mut bench) = Bench::open(&line) else { return };
    let dir = tempfile::tempdir().unwrap();
    let size = [90, 70];
    let mut export = |name: &str, backdrop: Backdrop| {
        let path = dir.path().join(name);
        bench.app().model.export(&path, size, backdrop);
        bench.settle();
        path
    };
    let with = read_exr(&export("with.exr", Backdrop::Drawn)).unwrap();
    let without = read_exr(&export("without.exr", Backdrop::LeftOut)).unwrap();
    let png = image::open(export("without.png", Backdrop::LeftOut)).unwrap();
    assert_eq!(png.color(), image::ColorType::Rgba8);
    let background = bench.app().model.document.as_ref().unwrap().scene.background;
    let (mut clear, mut solid) = (0, 0);
    for (i, (over, bare)) in with.rows().into_iter().zip(without.rows()).enumerate() {
        let alpha = f64::from(bare[3]);
        assert_eq!(over[3], bare[3]);
        clear += usize::from(alpha == 0.0);
        solid += usize::from(alpha > 0.5);
        let code = png.as_rgba8().unwrap().get_pixel(i as u32 % size[0], i as u32 / size[0]).0;
        assert_eq!(code[3], (alpha * 255.0).round() as u8);
        for c in 0..3 {
            let composed = f64::from(bare[c]) + (1.0 - alpha) * background[c];
            assert!((composed - f64::from(over[c])).abs() < 2e-6, "pixel {i}: {composed} {}", over[c]);
            if alpha == 0.0 {
                assert_eq!((bare[c], code[c]), (0.0, 0));
            } else {
                assert_eq!(code[c], srgb8_from_linear(f64::from(bare[c]) / alpha), "pixel {i}");
            }
        }
    }
    assert!(clear > 100 && solid > 100, "{clear} {solid}");
    // The picture on screen keeps its background; the prompt offers both.
    assert_eq!(bench.app().model.document.as_ref().unwrap().scene.background, background);
    bench.ask_export();
    bench.click("Transparent");
    let path = dir.path().join("asked.png");
    bench.type_into("path", path.to_str().unwrap());
    bench.click("Export");
    bench.settle();
    assert_eq!(image::open(path).unwrap().color(), image::ColorType::Rgba8);
    // Escape closes the prompt, with or without focus in its field.
    for _ in 0..2 {
        bench.ask_export();
        bench.harness.step();
        assert!(bench.app().windows.prompt.is_open());
        bench.harness.key_press(eframe::egui::Key::Escape);
        bench.harness.run_steps(2);
        assert!(!bench.app().windows.prompt.is_open());
    }
    // Enter in the field confirms.
    bench.ask_export();
    let path = dir.path().join("entered.png");
    bench.type_into("path", path.to_str().unwrap());
    bench.harness.key_press(eframe::egui::Key::Enter);
    bench.harness.run_steps(2);
    assert!(!bench.app().windows.prompt.is_open());
    bench.settle();
    assert!(path.is_file());
}

#[test]
fn a_file_that_does_not_open_leaves_the_old_volume_and_a_message() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:24", "--shadow=none"]) else { return };
    let picture = bench.pixels();
    let dir = tempfile::tempdir().unwrap();
    let broken = dir.path().join("broken.nii");
    std::fs::write(&broken, b"this is no volume").unwrap();
    for source in [broken.to_str().unwrap(), "/nowhere/at/all.nii.gz", "phantom:nothing", "missing.toml"] {
        bench.app().model.messages.clear();
        bench.app().model.open_source(source);
        bench.wait_for(source, |app| !app.model.messages.is_empty());
        assert!(bench.app().model.messages[0].is_error, "{source}: {:?}", bench.app().model.messages);
        let document = bench.app().model.document.as_ref().unwrap();
        assert!(document.spec.source.starts_with("phantom:sphere"));
    }
    assert_eq!(bench.pixels(), picture);
    // An invalid transfer function.
    let tf = dir.path().join("broken.json");
    std::fs::write(&tf, "{\"points\": []}").unwrap();
    let before = bench.app().model.document.as_ref().unwrap().tf.clone();
    bench.app().model.messages.clear();
    bench.app().model.load_tf(tf.to_str().unwrap());
    assert!(bench.app().model.messages[0].text.contains("`points` is empty"));
    assert_eq!(bench.app().model.document.as_ref().unwrap().tf, before);
    // A picture in a folder that cannot be written.
    bench.app().model.messages.clear();
    bench.app().model.export(&dir.path().join("no/such/folder.png"), [8, 8], Backdrop::Drawn);
    assert!(bench.app().model.messages[0].is_error);
    // Errors end with the next volume.
    bench.app().model.open_source("phantom:slab:8");
    bench
        .wait_for("slab", |app| app.model.document.as_ref().unwrap().spec.source.starts_with("phantom:slab"));
    bench.settle();
    assert!(!bench.app().model.messages.iter().any(|m| m.is_error), "{:?}", bench.app().model.messages);
    assert!(!bench.app().model.uploading);
}

#[test]
fn degenerate_volumes_open_and_can_be_edited() {
    let dir = tempfile::tempdir().unwrap();
    // Volumes of one voxel, of one value, and with non-finite values.
    let one = dir.path().join("one.raw");
    std::fs::write(&one, [7_u8]).unwrap();
    let Some(mut bench) = Bench::open(&[one.to_str().unwrap(), "--raw=1x1x1:u8"]) else { return };
    bench.app().model.settings.slices = true;
    bench.app().model.edit(Edit::Add { value: 7.0, amount: 0.5 });
    bench.app().model.edit(Edit::Window { shift: 1e9, spread: 0.0 });
    bench.settle();
    let bytes: Vec<u8> = [f32::NAN, f32::INFINITY, 1e30, -1e30, 0.0, 1.0, 2.0, 3.0]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let odd = dir.path().join("odd_2x2x2_float32.raw");
    std::fs::write(&odd, bytes).unwrap();
    bench.app().model.open_source(odd.to_str().unwrap());
    bench.wait_for("odd values", |app| app.model.document.as_ref().unwrap().spec.source.contains("odd"));
    bench.settle();
    let center = bench.app().model.view.unwrap().center();
    bench.click_at(center);
    bench.settle();
}
