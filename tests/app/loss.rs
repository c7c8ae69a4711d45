//! Loss of the graphics device while the window is open.

use super::Bench;
use std::time::{Duration, Instant};
use umbravox::app::curve::Edit;

#[test]
fn a_lost_device_is_replaced_and_the_scene_continues() {
    let Some(mut bench) = Bench::open(&["phantom:thorax:32", "--shadow=dsm:map=64"]) else { return };
    bench.app().model.edit(Edit::Color { index: 1, color: [0.0, 1.0, 0.0] });
    bench.app().model.look_from(2);
    bench.settle();
    let (before, picture) = (bench.app().model.document.clone().unwrap(), bench.pixels());
    assert!(bench.app().model.lost().is_none());
    bench.device.destroy();
    let start = Instant::now();
    while bench.app().model.lost().is_none() {
        let _ = bench.device.poll(eframe::wgpu::PollType::Poll);
        // Input while the device is lost is ignored.
        bench.app().model.look_from(1);
        bench.harness.step();
        assert!(start.elapsed() < super::PATIENCE);
        std::thread::sleep(Duration::from_millis(5));
    }
    bench.app().model.document.as_mut().unwrap().scene = before.scene.clone();
    let why = bench.app().model.lost().unwrap();
    let resume = bench.app().into_resume(why.clone());
    drop(bench);

    let Some(mut bench) = Bench::empty() else { return };
    bench.app().resume(resume);
    bench.settle();
    let after = bench.app().model.document.clone().unwrap();
    assert!(std::sync::Arc::ptr_eq(&before.volume, &after.volume), "it is not read again");
    assert_eq!((&before.tf, &before.scene, &before.method), (&after.tf, &after.scene, &after.method));
    assert_eq!(bench.pixels(), picture);
    assert!(bench.app().model.messages.iter().any(|m| m.text.contains("lost") && m.text.contains(&why)));
    bench.app().model.undo();
    assert_ne!(bench.app().model.document.as_ref().unwrap().tf, before.tf, "edits can still be taken back");
}

#[test]
fn the_scene_survives_without_a_device() {
    let Some(mut bench) = Bench::open(&["phantom:sphere:16", "--tf=uniform", "--shadow=none"]) else {
        return;
    };
    let resume = bench.app().into_resume("it was taken away".into());
    let dir = tempfile::tempdir().unwrap();
    let error = resume.give_up(Some(dir.path().join("new/lost.toml")));
    assert_eq!(error.exit_status(), 1);
    assert!(error.to_string().contains("it was taken away"), "{error}");
    let hint = error.hint.unwrap();
    let path = hint.split("--scene ").nth(1).expect("says where it is");
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains("phantom:sphere:16"), "{text}");
}
