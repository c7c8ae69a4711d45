//! Picture files of `render`: with and without their background.

mod cli;

use cli::{refused, umbravox};
use ndarray::Array3;
use ndarray_npy::ReadNpyExt;
use std::path::Path;
use umbravox::files::color::{parse_hex, srgb8_from_linear};
use umbravox::files::picture::read_exr;
use umbravox::gpu::Gpu;

const BACKGROUND: &str = "#4080c0";

fn render(folder: &Path, more: &[&str], output: &str) {
    let scene = ["render", "phantom:sphere:24", "--tf=uniform", "--shadow=rays", "--size=33x27"];
    let run = umbravox(folder, &[&scene[..], more, &["-o", output]].concat());
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
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
    if Gpu::open(None).is_err() {
        println!("skipped: render --background none: there is no graphics adapter");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let color = format!("--background={BACKGROUND}");
    render(dir.path(), &[&color], "with.npy");
    render(dir.path(), &[&color], "with.png");
    // The last one as a key of a scene file.
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
    if Gpu::open(None).is_err() {
        println!("skipped: render of a picture's own scene: there is no graphics adapter");
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
    let run = umbravox(dir.path(), &["render", "--scene=scene.toml", "-o", "b.png"]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let [a, b] = ["a.png", "b.png"].map(|name| image::open(dir.path().join(name)).unwrap().to_rgb8());
    assert_eq!(a, b);
}
