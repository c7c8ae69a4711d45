//! Masking of a volume in the window: clip planes with handles, and labels of a segmentation.

use super::Bench;
use eframe::egui::epaint::Shape;
use eframe::egui::{Modifiers, vec2};
use egui_kittest::kittest::Queryable;
use ndarray::Array3;
use std::path::Path;
use umbravox::files::loading::Loading;
use umbravox::formats::write_volume;
use umbravox::open::{SceneRequest, VolumeSpec, load};
use umbravox::transfer::LabelClass;
use umbravox::volume::{Provenance, Scaling, Volume};

const SMALL: &[&str] = &["phantom:thorax:32", "--shadow=dsm:map=64"];

#[test]
fn a_clip_plane_is_added_dragged_and_undone() {
    let Some(mut bench) = Bench::open(SMALL) else { return };
    // The controls are below this position in the side panel.
    bench.click("Shadows");
    let whole = bench.pixels();
    bench.click("clip from Anterior");
    bench.settle();
    let document = bench.app().model.document.clone().unwrap();
    let [plane] = document.tf.clip[..] else { panic!("{:?}", document.tf.clip) };
    assert!(plane.normal.y < -0.99, "{plane}");
    let cut = bench.pixels();
    assert_ne!(cut, whole);
    assert!(!document.tf_edited(), "the function is what it was");

    // The plane goes through the centre of the volume.
    let (view, camera) = (bench.app().model.view.unwrap(), document.scene.camera);
    let frame = camera.frame();
    let d = document.volume.center_mm() - camera.eye;
    let half =
        0.5 * f64::from(view.height()) / (0.5 * camera.fov_deg.to_radians()).tan() / d.dot(frame.forward);
    let handle = view.center() + vec2((d.dot(frame.right) * half) as f32, (-d.dot(frame.up) * half) as f32);
    bench.drag(handle, handle + vec2(-40.0, 30.0), Modifiers::NONE);
    bench.settle();
    let moved = bench.app().model.document.clone().unwrap();
    assert_eq!(moved.scene.camera, camera, "the handle was dragged, not the view");
    assert_eq!(moved.tf.clip[0].normal, plane.normal);
    assert!((moved.tf.clip[0].offset_mm - plane.offset_mm).abs() > 5.0, "{} {plane}", moved.tf.clip[0]);
    assert_ne!(bench.pixels(), cut);

    // The written scene draws the same picture.
    let text = moved.scene_text("bone").unwrap();
    let settings = SceneRequest::from_toml(&text).unwrap().settings;
    let loaded = settings.load(&Loading::default()).unwrap();
    assert_eq!(loaded.tf.clip, moved.tf.clip, "{text}");

    for expected in [vec![plane], Vec::new()] {
        bench.click("Undo");
        bench.settle();
        assert_eq!(bench.app().model.document.as_ref().unwrap().tf.clip, expected, "a drag is one step");
    }
    assert_eq!(bench.pixels(), whole);
    // Another function keeps the clip plane.
    bench.click("clip from Left");
    bench.app().model.load_tf("skin");
    bench.settle();
    let document = bench.app().model.document.clone().unwrap();
    assert_eq!((document.tf.clip.len(), document.tf_edited()), (1, false));
    bench.click("clip 1 remove");
    assert!(bench.app().model.document.as_ref().unwrap().tf.clip.is_empty());
}

/// Writes a segmentation with labels 0, 1 and 3 on the grid of the thorax phantom of 32 voxels.
pub fn write_labels(file: &Path) {
    let scan = load(&VolumeSpec::new("phantom:thorax:32")).unwrap();
    let [nx, ny, nz] = scan.dims();
    let labels =
        Array3::from_shape_fn((nz, ny, nx), |(k, _, i)| if k < nz / 2 { 3u8 } else { u8::from(i > nx / 2) });
    let provenance = Provenance::new("parts", "phantom", "uint8");
    let labels = Volume::new(labels.into(), Scaling::IDENTITY, scan.world_from_index(), provenance).unwrap();
    write_volume(&labels, file).unwrap();
}

#[test]
fn labels_are_hidden_and_shown() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("parts.nii");
    write_labels(&file);
    let named = format!("--labels={}", file.display());
    let Some(mut bench) = Bench::open(&[SMALL, &[&named, "--hide=3", "--label-tf=1=skin"]].concat()) else {
        return;
    };
    let document = bench.app().model.document.clone().unwrap();
    let classes = [0, 1, 3].map(|label| document.tf.class_of(label));
    assert_eq!(classes, [LabelClass::Function(0), LabelClass::Function(1), LabelClass::Hidden]);
    bench.click("Shadows");
    let half = bench.pixels();
    bench.click("label 3");
    bench.settle();
    let document = bench.app().model.document.clone().unwrap();
    assert_eq!(document.tf.class_of(3), LabelClass::Function(0));
    assert_ne!(bench.pixels(), half);
    bench.click("hide all labels");
    bench.click("label 1");
    bench.settle();
    let document = bench.app().model.document.clone().unwrap();
    let classes = [0, 1, 3].map(|label| document.tf.class_of(label));
    assert_eq!(classes, [LabelClass::Hidden, LabelClass::Function(1), LabelClass::Hidden]);
    let text = document.scene_text("ct").unwrap();
    assert!(text.contains("hide = \"0,3\"") && text.contains("1=skin"), "{text}");
    let loaded = SceneRequest::from_toml(&text).unwrap().settings.load(&Loading::default()).unwrap();
    assert_eq!(loaded.tf.rules, document.tf.rules);
}

/// Colours of the squares before the names of segments, from top to bottom.
fn squares(bench: &Bench) -> Vec<[u8; 3]> {
    let shapes = bench.harness.output().shapes.iter();
    let mut squares: Vec<_> = shapes
        .filter_map(|clipped| match &clipped.shape {
            Shape::Rect(shape) if shape.rect.size() == vec2(10.0, 10.0) => {
                let [red, green, blue, opacity] = shape.fill.to_array();
                (opacity == 255).then_some((shape.rect.top(), [red, green, blue]))
            }
            _ => None,
        })
        .collect();
    squares.sort_by(|a, b| a.0.total_cmp(&b.0));
    squares.into_iter().map(|(_, color)| color).collect()
}

#[test]
fn segments_have_their_names_and_colours() {
    let dir = tempfile::tempdir().unwrap();
    write_labels(&dir.path().join("parts.nrrd"));
    let file = std::fs::read(dir.path().join("parts.nrrd")).unwrap();
    let end = file.windows(2).position(|two| two == b"\n\n").unwrap();
    let segments = "\nSegment0_Color:=1 0.501961 0\nSegment0_LabelValue:=3\nSegment0_Layer:=0\nSegment0_Name:=liver\n\
        Segment1_Color:=0 0 1\nSegment1_LabelValue:=1\nSegment1_Layer:=0\nSegment1_Name:=Left lung";
    let slicer = dir.path().join("parts.seg.nrrd");
    std::fs::write(&slicer, [&file[..end], segments.as_bytes(), &file[end..]].concat()).unwrap();
    let dicom = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/formats/files/dicom_segments.dcm");
    let cases = [
        ("phantom:thorax:32", &slicer, ["1, Left lung", "3, liver"], [[0, 0, 255], [255, 128, 0]]),
        // The segmentation is its own image: the grids agree.
        (dicom.to_str().unwrap(), &dicom, ["1, Left lung", "2, Rib"], [[255, 0, 0], [0, 0, 255]]),
    ];
    for (volume, labels, names, colors) in cases {
        let labels = format!("--labels={}", labels.display());
        let Some(mut bench) = Bench::open(&[volume, "--shadow=none", &labels]) else { return };
        bench.click("Shadows");
        bench.harness.run_steps(2);
        for name in names {
            assert!(bench.harness.query_by_label(&format!("label {name}")).is_some(), "{volume}: {name}");
        }
        assert_eq!(squares(&bench), colors, "{volume}");
    }
}
