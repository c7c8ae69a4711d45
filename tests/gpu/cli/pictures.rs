//! Picture files of `render`, with and without a background.

use crate::common;
use crate::program::{refused, succeed, umbravox};
use glam::DVec3;
use ndarray::Array3;
use ndarray_npy::ReadNpyExt;
use std::path::Path;
use umbravox::files::color::{parse_hex, srgb8_from_linear};
use umbravox::files::picture::read_exr;
use umbravox::formats::write_volume;
use umbravox::open::{VolumeSpec, load};
use umbravox::volume::{Provenance, Scaling, Volume};

const BACKGROUND: &str = "#4080c0";

fn render(folder: &Path, more: &[&str], output: &str) {
    let tf = if more.iter().any(|flag| flag.starts_with("--tf=")) { "" } else { "--tf=uniform" };
    let scene = ["render", "phantom:sphere:24", "--shadow=rays", "--size=33x27", tf];
    let scene = &scene[..scene.len() - usize::from(tf.is_empty())];
    succeed(folder, &[scene, more, &["-o", output]].concat());
}

fn npy(path: &Path) -> Array3<f32> {
    Array3::read_npy(std::fs::File::open(path).unwrap()).unwrap()
}

#[test]
fn other_words_for_a_background_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    for word in ["None", "transparent", "", "#12345"] {
        let background = format!("--background={word}");
        let error = refused(dir.path(), &["render", "phantom:slab:8", &background, "-o", "a.png"]);
        assert!(error.contains("--background") && error.contains("`none`"), "{error}");
    }
}

#[test]
fn a_picture_without_its_background_goes_over_it_again() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let color = format!("--background={BACKGROUND}");
    render(dir.path(), &[&color], "with.npy");
    render(dir.path(), &[&color], "with.png");
    // The last variant is a key of a scene file.
    std::fs::write(at("bare.toml"), "background = 'none'\n").unwrap();
    for name in ["bare.png", "bare.npy"] {
        render(dir.path(), &["--background=none"], name);
    }
    render(dir.path(), &["--scene=bare.toml"], "bare.exr");
    let (with, bare) = (npy(&at("with.npy")), read_exr(&at("bare.exr")).unwrap());
    assert_eq!(npy(&at("bare.npy")), bare);
    assert_eq!(image::open(at("with.png")).unwrap().color(), image::ColorType::Rgb8);
    let png = image::open(at("bare.png")).unwrap();
    assert_eq!(png.color(), image::ColorType::Rgba8);

    let background = parse_hex(BACKGROUND).unwrap();
    let (mut clear, mut solid) = (0, 0);
    let pixels = png.as_rgba8().unwrap().pixels();
    for ((over, bare), code) in with.rows().into_iter().zip(bare.rows()).zip(pixels) {
        let alpha = f64::from(bare[3]);
        assert_eq!(over[3], bare[3], "the opacity is the volume's");
        assert_eq!(code[3], (alpha * 255.0).round() as u8);
        clear += usize::from(alpha == 0.0);
        solid += usize::from(alpha > 0.3);
        for c in 0..3 {
            let composed = f64::from(bare[c]) + (1.0 - alpha) * background[c];
            assert!((composed - f64::from(over[c])).abs() < 1e-6, "{composed} {}", over[c]);
            let straight = if alpha > 0.0 { f64::from(bare[c]) / alpha } else { 0.0 };
            assert_eq!(code[c], srgb8_from_linear(straight));
        }
    }
    assert!(clear > 50 && solid > 50, "{clear} {solid}");
}

#[test]
fn a_png_holds_the_scene_file_that_draws_it() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let scene =
        ["--light=point:30.5,-21.25,60.125", "--fov=33.3", "--ambient=0.25", "--background", BACKGROUND];
    render(dir.path(), &scene, "a.png");
    let file = std::io::BufReader::new(std::fs::File::open(dir.path().join("a.png")).unwrap());
    let reader = png::Decoder::new(file).read_info().unwrap();
    let chunk = reader.info().utf8_text.iter().find(|c| c.keyword == "umbravox:scene").unwrap();
    std::fs::write(dir.path().join("scene.toml"), chunk.get_text().unwrap()).unwrap();
    succeed(dir.path(), &["render", "--scene=scene.toml", "-o", "b.png"]);
    let [a, b] = ["a.png", "b.png"].map(|name| image::open(dir.path().join(name)).unwrap().to_rgb8());
    assert_eq!(a, b);
}

#[test]
fn an_annotated_png_has_marks_and_the_scene() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    for (flags, name) in [(&[][..], "plain.png"), (&["--annotate"], "marked.png")] {
        let scene = ["render", "phantom:sphere:24", "--tf=ct", "--size=200x160", "-o", name];
        succeed(dir.path(), &[&scene, flags].concat());
    }
    let [plain, marked] = ["plain.png", "marked.png"].map(|name| image::open(dir.path().join(name)).unwrap());
    let [plain, marked] = [plain, marked].map(|image| image.to_rgb8());
    let changed = plain.pixels().zip(marked.pixels()).filter(|(a, b)| a != b).count();
    assert!(plain.dimensions() == marked.dimensions() && (100..8000).contains(&changed), "{changed}");
    succeed(dir.path(), &["render", "--scene=marked.png", "-o", "again.png"]);
    assert_eq!(image::open(dir.path().join("again.png")).unwrap().to_rgb8(), plain);
}

#[test]
fn a_certified_png_says_what_it_is() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let args = [
        "render",
        "phantom:sphere:24",
        "--size=33x27",
        "--certify=0.05",
        "--shadow=dsm:map=32",
        "-o",
        "a.png",
    ];
    succeed(dir.path(), &args);
    let file = std::io::BufReader::new(std::fs::File::open(dir.path().join("a.png")).unwrap());
    let texts = png::Decoder::new(file).read_info().unwrap().info().utf8_text.clone();
    let text = |key: &str| texts.iter().find(|c| c.keyword == key).unwrap().get_text().unwrap();
    assert_eq!(text("umbravox:certify"), "0.05");
    assert!(text("umbravox:scene").contains("map=32,enclose=on"), "{}", text("umbravox:scene"));
}

/// Writes a segmentation of a phantom of 24 voxels a side: label 1 for its lower half, 5 for the upper one.
fn write_halves(path: &Path) {
    let scan = load(&VolumeSpec::new("phantom:sphere:24")).unwrap();
    let labels = Array3::from_shape_fn((24, 24, 24), |(k, _, _)| if k < 12 { 1u8 } else { 5 });
    let provenance = Provenance::new("halves", "phantom", "uint8");
    let labels = Volume::new(labels.into(), Scaling::IDENTITY, scan.world_from_index(), provenance).unwrap();
    write_volume(&labels, path).unwrap();
}

#[test]
fn bad_clip_planes_and_labels_are_refused_in_a_line() {
    let dir = tempfile::tempdir().unwrap();
    write_halves(&dir.path().join("halves.nii.gz"));
    let planes: Vec<String> = (0..9).map(|i| format!("--clip=1,0,0,{i}")).collect();
    let planes: Vec<&str> = planes.iter().map(String::as_str).collect();
    for (flags, said) in [
        (&["--hide=1"][..], "--hide needs --labels FILE"),
        (&["--label-tf=1=bone"], "--label-tf needs --labels FILE"),
        (&["--labels=none.nii"], "none.nii"),
        (&["--labels=halves.nii.gz", "--label-tf=1=bonny"], "neither a preset nor a file"),
        (&["--labels=halves.nii.gz", "--hide=4-"], "not a list of labels"),
        (&["--labels=halves.nii.gz", "--hide=one"], "no segment has this name"),
        (&["--labels=phantom:thorax:24"], "is no label"),
        (&["--clip=0,0,0,1"], "normal of length 0"),
        (&["--clip=1,2,3"], "four numbers"),
        (&planes, "at most 8"),
    ] {
        let error = refused(dir.path(), &[&["render", "phantom:sphere:24", "-o", "a.png"], flags].concat());
        assert!(error.contains(said), "{flags:?}: {error}");
    }
    let error = refused(dir.path(), &["render", "phantom:hair-fur:100", "--clip=0,0,1,0", "-o", "a.png"]);
    assert!(error.contains("strands cannot be clipped"), "{error}");
}

#[test]
fn parts_are_hidden_by_planes_and_labels_alike() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    write_halves(&dir.path().join("halves.nii.gz"));
    // Half-way between the voxels 11 and 12 in world mm.
    let scan = load(&VolumeSpec::new("phantom:sphere:24")).unwrap();
    let z = scan.world_from_index().transform_point3(DVec3::new(0.0, 0.0, 11.5)).z;
    let camera = ["--eye=300,200,100", "--target=0,0,0", "--fov=30"];
    let picture = |more: &[&str], name: &str| {
        render(dir.path(), &[&camera[..], more].concat(), name);
        npy(&dir.path().join(name))
    };
    let whole = picture(&[], "whole.npy");
    let clipped = picture(&[&format!("--clip=0,0,1,{z}")], "clipped.npy");
    let hidden = picture(&["--labels=halves.nii.gz", "--hide=1"], "hidden.npy");
    let off =
        |a: &Array3<f32>, b: &Array3<f32>| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0f32, f32::max);
    assert!(off(&whole, &clipped) > 0.1);
    assert!(off(&clipped, &hidden) < 5e-3, "{}", off(&clipped, &hidden));
    // Names of segments, as 3D Slicer writes them.
    write_halves(&dir.path().join("halves.nrrd"));
    let file = std::fs::read(dir.path().join("halves.nrrd")).unwrap();
    let end = file.windows(2).position(|two| two == b"\n\n").unwrap();
    let names = "\nSegment0_Color:=0.8 0.68 0.57\nSegment0_ID:=Segment_1\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n\
                 Segment0_Name:=Lower half\nSegment1_LabelValue:=5\nSegment1_Name:=upper";
    let named = [&file[..end], names.as_bytes(), &file[end..]].concat();
    std::fs::write(dir.path().join("halves.seg.nrrd"), named).unwrap();
    let by_name = picture(&["--labels=halves.seg.nrrd", "--hide=lower HALF"], "by_name.npy");
    assert_eq!(by_name, hidden);
    let info = umbravox(dir.path(), &["info", "halves.seg.nrrd"]).stdout;
    assert!(String::from_utf8(info).unwrap().contains("segments     1 Lower half\n             5 upper\n"));
    let flags = ["render", "phantom:sphere:24", "--labels=halves.seg.nrrd", "--hide=liver", "-o", "a.png"];
    assert!(refused(dir.path(), &flags).contains("(liver): no segment has this name"));
    // If all labels have another function, the picture is that function's; a scene file gives the same.
    std::fs::write(
        dir.path().join("parts.toml"),
        "labels = 'halves.nii.gz'\nlabel-tf = ['1,5=engine']\nclip = ['0,0,1,-1000']\n",
    )
    .unwrap();
    let other = picture(&["--scene=parts.toml"], "other.npy");
    render(dir.path(), &[&camera[..], &["--tf=engine"]].concat(), "engine.npy");
    let engine = npy(&dir.path().join("engine.npy"));
    assert!(off(&other, &engine) < 5e-3 && off(&other, &whole) > 0.01, "{}", off(&other, &engine));
}
