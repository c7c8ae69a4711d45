//! The page of `umbravox export` in a browser: its pictures are those of `umbravox render` on the same adapter.

use crate::browser::answers;
use crate::common::{Requirement, scan};
use crate::program::refused;
use std::collections::HashMap;
use std::path::Path;
use std::process::Command;
use umbravox::shadow::METHODS;

/// SwiftShader as a Vulkan driver, as Debian's chromium has it. The browser draws with it too.
const SWIFTSHADER: &str = "/usr/lib/chromium/vk_swiftshader_icd.json";

/// Script that draws the picture of every method, from the first view, then with a light that was moved twice, and with twice the
/// extinction where the page can, again with the initial light, and from inside the volume. It posts the pixels.
const SCRIPT: &str = r#"
(async () => {
  const post = (path, body) => fetch(path, { method: "POST", body });
  try {
    const page = await umbravox;
    await page.drawing;
    const { renderer, record } = page;
    for (let i = 0; i < record.methods.length; i++) await post(`/${i}`, await renderer.pixels(i));
    const draw = async (name, toward, extinction) => {
      renderer.setScene(page.light, toward, extinction);
      for (const [i, { follows_light }] of record.methods.entries()) {
        if (follows_light) await post(`/${name}-${i}`, await renderer.pixels(i));
      }
    };
    if (page.light >= 0) {
      // Maps of another light leave nothing in those of the next.
      renderer.setScene(page.light, [-0.7, 0.2, 0.4], 1);
      for (let i = 0; i < record.methods.length; i++) await renderer.pixels(i, record.camera, [8, 8]);
      await draw("light", [0.3, 0.8, 0.5], 1);
    }
    await draw("denser", page.toward, 2);
    renderer.setScene(page.light, page.toward, 1);
    await post("/again", await renderer.pixels(1));
    const { eye, target } = record.camera;
    await post("/inside", await renderer.pixels(0, { ...record.camera, eye: target, target: eye }));
    await post("/camera", JSON.stringify({ eye: eye.join(), target: target.join() }));
    page.choose(1);
    page.toggleDifference();
    while (page.drawing) await page.drawing;
    await post("/status", document.getElementById("status").textContent);
    await post("/end", "");
  } catch (error) {
    await post("/error", error.stack);
  }
})();"#;

/// Runs a command on SwiftShader with the shaders of a page.
fn on_swiftshader(folder: &Path, args: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_umbravox"))
        .args(args)
        .current_dir(folder)
        .env("VK_DRIVER_FILES", SWIFTSHADER)
        .env("UMBRAVOX_TUNING", "card")
        .output()
        .unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn rms(page: &[u8], file: &Path) -> f64 {
    let picture: ndarray::Array3<f32> = ndarray_npy::read_npy(file).unwrap();
    let page: Vec<f32> = page.chunks(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect();
    assert_eq!(page.len(), picture.len());
    let squares = page.iter().zip(&picture).map(|(a, b)| f64::from(a - b).powi(2));
    (squares.sum::<f64>() / page.len() as f64).sqrt()
}

/// Compares the pictures of the page of a scene with those of the program. The first method has no map. Returns the number of
/// methods whose light the page moved.
fn check(scene: &[&str], methods: &str) -> Option<usize> {
    if !Path::new(SWIFTSHADER).exists() {
        Requirement::Browser.missing(&format!("there is no {SWIFTSHADER}"));
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = |command: &str, scale: &str, more: &[&str]| {
        on_swiftshader(folder, &[&[command, "--opacity-scale", scale], scene, more].concat());
    };
    run("export", "1", &["--embed-volume", "--methods", methods, "-o", "page.html"]);
    let page = std::fs::read_to_string(folder.join("page.html")).unwrap();
    println!("{scene:?}: {:.1} MB", page.len() as f64 * 1e-6);
    let page = page
        .replace("default-src 'none'", "default-src 'none'; connect-src 'self'")
        .replace("</body>", &format!("<script>{SCRIPT}</script></body>"));
    let answers = answers(page, &HashMap::new())?;
    let compare = |answer: &str, arguments: &[&str]| {
        let scale = if answer.starts_with("denser") { "2" } else { "1" };
        run("render", scale, &[arguments, &["-o", "picture.npy"]].concat());
        let off = rms(&answers[answer], &folder.join("picture.npy"));
        println!("{scene:?} {answer} {arguments:?}: rms {off:.1e}");
        assert!(off < 1e-5, "{scene:?} {answer} {arguments:?}: rms {off:e}");
    };
    let mut moved = 0;
    for (i, method) in methods.split(';').enumerate() {
        // Maps of a page are valid in all views.
        let has_map = METHODS.iter().any(|entry| {
            method.split(':').next() == Some(entry.name) && entry.keys.iter().any(|key| key.name == "fit")
        });
        let whole = if method.contains(':') { ",fit=volume" } else { ":fit=volume" };
        let method = format!("{method}{}", if has_map { whole } else { "" });
        compare(&i.to_string(), &["--shadow", &method]);
        if i == 1 {
            compare("again", &["--shadow", &method]);
        }
        let [light, denser] = ["light", "denser"].map(|name| format!("{name}-{i}"));
        if answers.contains_key(&light) && !scene.contains(&"--light") {
            compare(&light, &["--shadow", &method, "--light", "dir:0.3,0.8,0.5"]);
            moved += 1;
        }
        if answers.contains_key(&denser) {
            compare(&denser, &["--shadow", &method]);
        }
    }
    let first = methods.split(';').next().unwrap();
    let camera: HashMap<String, String> = serde_json::from_slice(&answers["camera"]).unwrap();
    let [eye, target] = ["eye", "target"].map(|end| camera[end].as_str());
    compare("inside", &["--shadow", first, "--eye", target, "--target", eye]);
    let status = String::from_utf8_lossy(&answers["status"]).into_owned();
    // Without shadows there is no reference.
    assert!(status.contains("difference from rays") || scene.contains(&"--ambient"), "{status}");
    Some(moved)
}

#[test]
fn pages_of_a_phantom_draw_the_pictures_of_the_program() {
    let scene = ["phantom:thorax:48", "--tf", "ct", "--size", "96x80", "--shading", "lambert"];
    let methods = "rays;dsm:map=96;avsm:map=96;osm:map=96;fourier:map=96;wavelet:map=96;moments:map=96;bom:map=96;beer:map=96;lightvolume;none";
    if let Some(moved) = check(&scene, methods) {
        assert_eq!(moved, 10, "all but lightvolume");
    }
}

#[test]
fn pages_of_a_scan_draw_the_pictures_of_the_program() {
    let Some(engine) = scan("engine") else { return };
    let engine = engine.to_str().unwrap();
    let lights = ["--light", "dir:0.5,-0.5,0.7,color=#ff8040", "--light", "point:-40,300,300"];
    let scene = [&[engine, "--downsample=2x2x2", "--tf", "engine", "--size", "90x64"][..], &lights].concat();
    check(&scene, "rays;dsm:map=128,epsilon=0.02;clusters:map=64;bom:map=64");
}

#[test]
fn pages_of_hair_draw_the_pictures_of_the_program() {
    let scene = ["phantom:hair-curly:2000", "--tf", "hair", "--resolution", "48", "--shading", "kajiya-kay"];
    check(&[&scene[..], &["--size", "72x72"]].concat(), "rays;dom:map=64;dsm:map=64,from=lines");
}

#[test]
fn pages_without_shadows_draw() {
    check(&["phantom:thorax:24", "--tf", "bone", "--size", "40x40"], "none;rays");
    check(&["phantom:thorax:24", "--tf", "bone", "--size", "40x40", "--ambient", "1"], "rays;none");
}

#[test]
fn a_scan_is_embedded_on_request_alone() {
    let Some(engine) = scan("engine") else { return };
    let folder = tempfile::tempdir().unwrap();
    let error = refused(folder.path(), &["export", engine.to_str().unwrap(), "-o", "page.html"]);
    assert!(error.contains("data of this file"), "{error}");
    let labels = ["export", "phantom:thorax:24", "--labels", "parts.nii", "-o", "page.html"];
    assert!(refused(folder.path(), &labels).contains("parts.nii"));
    let png = ["export", "phantom:thorax:24", "-o", "page.png"];
    assert!(refused(folder.path(), &png).contains("page.png"));
}
