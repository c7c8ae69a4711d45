//! The page of `umbravox export` in a browser: its pictures are those of `umbravox render` on the same adapter.

use crate::browser::{WebGpu, answers};
use crate::common::{Requirement, SIZES, scan};
use crate::program::refused;
use std::collections::HashMap;
use std::path::Path;
use std::process::Command;
use umbravox::shadow::METHODS;

/// SwiftShader as a Vulkan driver, as Debian's chromium has it. The browser draws with it too.
const SWIFTSHADER: &str = "/usr/lib/chromium/vk_swiftshader_icd.json";

/// Script that draws the picture of every method, from the first view, then with a light that was moved twice, and with twice the
/// extinction where the page can, again with the initial light, and from inside the volume. Where the page can, it edits the
/// points of the transfer function with the pointer, and draws under a moved light. It posts the pixels.
const SCRIPT: &str = r#"
(async () => {
  const post = (path, body) => fetch(path, { method: "POST", body });
  try {
    const page = await umbravox;
    await page.drawing;
    const { renderer, record } = page;
    for (let i = 0; i < record.methods.length; i++) await post(`/${i}`, await renderer.pixels(i));
    const draw = async (name, toward, extinction, points) => {
      renderer.setScene(page.light, toward, extinction, points);
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
    if (page.editor) {
      const { editor } = page;
      const box = editor.svg.getBoundingClientRect();
      const send = (type, target, [x, y], button = 0) => target.dispatchEvent(new PointerEvent(type, { bubbles: true,
        button, clientX: box.left + x * box.width, clientY: box.top + y * box.height }));
      const counts = [page.points.length];
      // A faint point at low values, where bricks were empty; a point that moves up; one that is removed.
      send("dblclick", editor.svg, [0.12, 0.88]);
      counts.push(page.points.length);
      const last = editor.svg.querySelectorAll("circle")[page.points.length - 2];
      send("pointerdown", last, [0, 0]);
      send("pointermove", window, [0.6, 0.5]);
      send("pointerup", window, [0.6, 0.5]);
      send("pointermove", window, [0.1, 0.1]);
      if (page.points.length > 3) send("contextmenu", editor.svg.querySelectorAll("circle")[2], [0, 0], 2);
      counts.push(page.points.length);
      while (page.drawing) await page.drawing;
      const active = (distances) => distances.filter((distance) => distance === 0).length;
      await post("/counts", counts.join());
      await post("/active", [active(renderer.bound(record.methods[0].field, 3).bytes), active(renderer.active.distance)].join());
      await post("/function", editor.text());
      await draw("edited", page.light < 0 ? undefined : [0.3, 0.8, 0.5], 1, page.points);
      const { points } = page;
      page.reset();
      // Without extinction, the background remains.
      renderer.setScene(page.light, page.toward, 1, points.map((point) => ({ ...point, amount: 0 })));
      await post("/empty", await renderer.pixels(0));
      renderer.setScene(page.light, page.toward, 1);
      await post("/undone", await renderer.pixels(1));
    }
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

/// Script before those of the page: collects their errors.
const ERRORS: &str = r#"<script>
const scriptErrors = [];
addEventListener("error", ({ message }) => scriptErrors.push(message));
addEventListener("unhandledrejection", ({ reason }) => scriptErrors.push(String(reason)));
</script>"#;

/// Script that posts what a page without WebGPU shows.
const STILLS_SCRIPT: &str = r#"<script>
(async () => {
  const post = (path, body) => fetch(path, { method: "POST", body });
  try {
    const stops = await umbravox.then(() => "", ({ message }) => message);
    await new Promise((resolve) => setTimeout(resolve, 0));
    const status = document.getElementById("status");
    const pictures = [...document.getElementById("stills").querySelectorAll("img")];
    await Promise.all(pictures.map((picture) => picture.decode()));
    const isShown = (element) => element.getClientRects().length > 0;
    const sizes = pictures.filter(isShown).map(({ alt, naturalWidth, naturalHeight }) => [alt, naturalWidth, naturalHeight]);
    await post("/shown", sizes.join(";"));
    await post("/status", status.getBoundingClientRect().bottom < innerHeight ? status.textContent : "");
    await post("/canvas", String(isShown(document.getElementById("canvas"))));
    await post("/stops", stops);
    await post("/errors", scriptErrors.join("; "));
    await post("/end", "");
  } catch (error) {
    await post("/error", `${error.stack}; ${scriptErrors.join("; ")}`);
  }
})();
</script>"#;

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

fn pixels(answer: &[u8]) -> Vec<f32> {
    answer.chunks(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect()
}

fn numbers(answer: &[u8]) -> Vec<usize> {
    String::from_utf8_lossy(answer).split(',').map(|number| number.parse().unwrap()).collect()
}

fn rms(page: &[u8], file: &Path) -> f64 {
    let picture: ndarray::Array3<f32> = ndarray_npy::read_npy(file).unwrap();
    let page = pixels(page);
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
    let answers = answers(page, &HashMap::new(), WebGpu::SwiftShader)?;
    // Scene with the function that the page edited.
    let mut edited_scene = scene.to_vec();
    if let (Some(function), Some(tf)) =
        (answers.get("function"), scene.iter().position(|flag| *flag == "--tf"))
    {
        std::fs::write(folder.join("function.json"), function).unwrap();
        edited_scene[tf + 1] = "function.json";
        let counts: Vec<usize> = numbers(&answers["counts"]);
        assert!(counts[1] == counts[0] + 1 && counts[2] <= counts[1], "{counts:?}");
        let active: Vec<usize> = numbers(&answers["active"]);
        println!("{scene:?}: {active:?} active bricks before and after the edit");
        assert!(active[1] > active[0] || !scene[0].starts_with("phantom:thorax"), "{active:?}");
        assert!(pixels(&answers["empty"]).chunks(4).all(|pixel| pixel[3] == 0.0), "nothing is left");
    }
    let compare = |answer: &str, arguments: &[&str]| {
        let scale = if answer.starts_with("denser") { "2" } else { "1" };
        let scene = if answer.starts_with("edited") { &edited_scene[..] } else { scene };
        let arguments =
            [&["render", "--opacity-scale", scale], scene, arguments, &["-o", "picture.npy"]].concat();
        on_swiftshader(folder, &arguments);
        let off = rms(&answers[answer], &folder.join("picture.npy"));
        println!("{scene:?} {answer} {arguments:?}: rms {off:.1e}");
        assert!(off < 1e-5, "{scene:?} {answer} {arguments:?}: rms {off:e}");
    };
    let camera: HashMap<String, String> = serde_json::from_slice(&answers["camera"]).unwrap();
    let [eye, target] = ["eye", "target"].map(|end| camera[end].as_str());
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
            if answers.contains_key("undone") {
                compare("undone", &["--shadow", &method]);
            }
        }
        let [light, denser, edited] = ["light", "denser", "edited"].map(|name| format!("{name}-{i}"));
        if answers.contains_key(&edited) {
            // The camera of the page stays, and that of the program would frame what has become visible.
            let camera = ["--eye", eye, "--target", target];
            compare(&edited, &[&["--shadow", &method, "--light", "dir:0.3,0.8,0.5"][..], &camera].concat());
        }
        if answers.contains_key(&light) && !scene.contains(&"--light") {
            compare(&light, &["--shadow", &method, "--light", "dir:0.3,0.8,0.5"]);
            moved += 1;
        }
        if answers.contains_key(&denser) {
            compare(&denser, &["--shadow", &method]);
        }
    }
    let first = methods.split(';').next().unwrap();
    compare("inside", &["--shadow", first, "--eye", target, "--target", eye]);
    let status = String::from_utf8_lossy(&answers["status"]).into_owned();
    // Without shadows there is no reference.
    assert!(status.contains("difference from rays") || scene.contains(&"--ambient"), "{status}");
    Some(moved)
}

/// First `count` of a list of methods.
fn first(methods: &str, count: usize) -> String {
    methods.split(';').take(count).collect::<Vec<_>>().join(";")
}

#[test]
fn pages_of_a_phantom_draw_the_pictures_of_the_program() {
    let scene = ["phantom:thorax:48", "--tf", "ct", "--size", "96x80", "--shading", "lambert"];
    let methods = "rays;dsm:map=96;lightvolume;moments:map=96;avsm:map=96;osm:map=96;fourier:map=96;wavelet:map=96;bom:map=96;\
        beer:map=96;none";
    let methods = first(methods, SIZES.page_methods[0]);
    if let Some(moved) = check(&scene, &methods) {
        assert_eq!(moved, SIZES.page_methods[0] - 1, "all but lightvolume");
    }
}

#[test]
fn pages_of_a_scan_draw_the_pictures_of_the_program() {
    let Some(engine) = scan("engine") else { return };
    let engine = engine.to_str().unwrap();
    let lights = ["--light", "dir:0.5,-0.5,0.7,color=#ff8040", "--light", "point:-40,300,300"];
    let scene = [&[engine, "--downsample=2x2x2", "--tf", "engine", "--size", "90x64"][..], &lights].concat();
    check(&scene, &first("rays;dsm:map=128,epsilon=0.02;clusters:map=64;bom:map=64", SIZES.page_methods[1]));
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
fn pages_without_webgpu_show_stored_pictures_and_the_reason() {
    if !Path::new(SWIFTSHADER).exists() {
        return Requirement::Browser.missing(&format!("there is no {SWIFTSHADER}"));
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = ["export", "phantom:thorax:24", "--tf", "bone", "--size", "40x32", "--methods", "rays;none"];
    on_swiftshader(folder.path(), &[&scene[..], &["-o", "page.html"]].concat());
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    let page = page
        .replace("default-src 'none'", "default-src 'none'; connect-src 'self'")
        .replace("</body>", &format!("{STILLS_SCRIPT}</body>"));
    // Such a browser has neither WebGPU nor the decompression of the data.
    let old = "<script>delete Navigator.prototype.gpu; delete window.DecompressionStream;</script>";
    let cases = [
        (WebGpu::NoAdapter, "", "This page needs WebGPU"),
        (WebGpu::NoAdapter, old, "This browser has none."),
        (WebGpu::Insecure, "", "Save this page as a file"),
    ];
    for (webgpu, before, reason) in cases {
        let page = page.replace("<head>", &format!("<head>{ERRORS}{before}"));
        let Some(answers) = answers(page, &HashMap::new(), webgpu) else { return };
        let text = |name: &str| String::from_utf8_lossy(&answers[name]).into_owned();
        let status = text("status");
        assert!(
            status.contains(reason) && status.contains("stored pictures"),
            "{webgpu:?} {before}: {status}"
        );
        assert!(!text("stops").is_empty(), "{webgpu:?} {before}");
        assert_eq!(text("shown"), "rays,40,32;none,40,32", "{webgpu:?} {before}");
        assert_eq!(text("canvas"), "false", "{webgpu:?} {before}");
        assert_eq!(text("errors"), "", "{webgpu:?} {before}");
    }
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
