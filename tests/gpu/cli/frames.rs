//! `render --turntable` and `--light-sweep`: each picture of the turn equals the one drawn by itself.

use crate::common;
use crate::program::{refused, succeed, umbravox};
use glam::DVec3;
use ndarray::Array3;
use ndarray_npy::ReadNpyExt;
use std::io::Cursor;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use umbravox::open::SceneRequest;
use umbravox::scene::Light;

const SCENE: [&str; 4] = ["render", "phantom:thorax:24", "--size=37x29", "--tf=ct"];

/// Runs `render`, and returns the output of `--json`.
fn render(folder: &Path, more: &[&str]) -> serde_json::Value {
    serde_json::from_str(&succeed(folder, &[&SCENE, more, &["--json"]].concat()).stdout).unwrap()
}

fn bytes(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap()
}

/// Scene file stored in a picture file.
fn scene_text(file: &[u8]) -> String {
    let reader = png::Decoder::new(Cursor::new(file)).read_info().unwrap();
    let chunk = reader.info().utf8_text.iter().find(|c| c.keyword == "umbravox:scene").unwrap();
    chunk.get_text().unwrap()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Number of shadow maps that were built and reused, for each picture.
fn built_and_kept(json: &serde_json::Value) -> Vec<[u64; 2]> {
    let frames = json["frames"].as_array().unwrap();
    frames.iter().map(|f| ["built", "kept"].map(|key| f[key].as_u64().unwrap())).collect()
}

fn flag(name: &str, v: DVec3) -> String {
    format!("--{name}={:?},{:?},{:?}", v.x, v.y, v.z)
}

#[test]
fn bad_sequences_are_refused_in_a_line() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("taken_0002.png")).unwrap();
    for (flags, output, said) in [
        (&["--turntable=0"][..], "a.png", "--turntable"),
        (&["--turntable=-3"], "a.png", "--turntable"),
        (&["--turntable=10001"], "a.png", "10000"),
        (&["--turntable=4e9"], "a.png", "--turntable"),
        (&["--light-sweep=0"], "a.png", "--light-sweep"),
        (&["--light-sweep=18446744073709551617"], "a.png", "--light-sweep"),
        (&["--turntable=3", "--light-sweep=3"], "a.png", "cannot be used with"),
        (&["--turntable=3", "--fps=5"], "a.png", "--fps"),
        (&["--fps=5"], "a.png", "--turntable, --light-sweep or --frames"),
        (&["--frames=2:1"], "a.png", "FIRST at most LAST"),
        (&["--frames=all", "--frame=1"], "a.png", "cannot be used with"),
        (&["--frames=0:1"], "a.png", "--frame"),
        (&["--annotate"], "a.exr", "--annotate"),
        (&["--annotate", "--background=none"], "a.png", "--annotate"),
        (&["--json"], "-", "--json goes to standard output"),
        (&["--turntable=3", "--fps=0"], "a.gif", "0.1 to 50"),
        (&["--turntable=3", "--fps=nan"], "a.gif", "0.1 to 50"),
        (&[], "a.gif", "must end in one of .png, .exr, .npy"),
        (&["--turntable=3"], "a.mp4", ".apng, .gif"),
        (&["--turntable=3"], "none/a.png", "there is no folder"),
        (&["--turntable=3"], "none/a.apng", "there is no folder"),
        (&["--turntable=3"], "taken.png", "taken_0002.png): it is a folder"),
        (&["--light-sweep=3", "--background=none"], "a.gif", "half-transparent"),
        (&["--turntable=3", "--certify=0.1"], "a.png", "cannot be used with"),
        (&["--turntable=3", "--error-bound"], "a.png", "cannot be used with"),
        (&["--certify=2"], "a.png", "from 0 to 1"),
        (&["--error-picture=e.exr"], "a.png", "--certify"),
        (&["--certify=0.1", "--shadow=osm"], "a.png", "only dsm with from=voxels stores bounds"),
        (&["--certify=0.1", "--shadow=dsm:from=lines"], "a.png", "only dsm with from=voxels"),
        (&["--certify=0.1", "--error-bound"], "a.png", "cannot be used with"),
        (&["--certify=0.1", "--error-picture=a.png"], "a.png", "are one file"),
        (&["--certify=0.1", "--error-picture=e.txt"], "a.png", "must end in one of"),
    ] {
        let error = refused(dir.path(), &[&SCENE, flags, &["-o", output]].concat());
        assert!(error.contains(said), "{flags:?} {output}: {error}");
    }
    // With fewer pictures no output path is a folder.
    if common::has_adapter() {
        render(dir.path(), &["--turntable=2", "-o", "taken.png"]);
    }
}

#[test]
fn pictures_of_a_turntable_are_those_from_their_eyes() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let place = ["--eye=300,-420,160", "--target=12,-7,30", "--up=0.1,0,2"];
    for shadow in ["--shadow=dsm", "--shadow=dsm:fit=volume", "--shadow=rays", "--shadow=lightvolume"] {
        let turn = render(folder, &[&place[..], &[shadow, "--turntable=5", "-o", "turn.png"]].concat());
        render(folder, &[&place[..], &[shadow, "-o", "alone.png"]].concat());
        assert_eq!(bytes(folder, "turn_0000.png"), bytes(folder, "alone.png"), "{shadow}: the first is it");
        let [eye, target] = [DVec3::new(300.0, -420.0, 160.0), DVec3::new(12.0, -7.0, 30.0)];
        let up = DVec3::new(0.1, 0.0, 2.0).normalize();
        let mut pictures = Vec::new();
        for k in 0..5 {
            let name = format!("turn_{k:04}.png");
            let frame = &turn["frames"][k];
            assert_eq!(
                (&frame["file"], &frame["angle_deg"]),
                (&name.as_str().into(), &(72.0 * k as f64).into())
            );
            let scene = SceneRequest::from_toml(&scene_text(&bytes(folder, &name))).unwrap().settings;
            // Rodrigues' formula, counterclockwise around `up`.
            let (sin, cos) = (72.0 * k as f64).to_radians().sin_cos();
            let away = eye - target;
            let turned = away * cos + up.cross(away) * sin + up * up.dot(away) * (1.0 - cos);
            let drawn_from = scene.eye.unwrap();
            assert!((drawn_from - target - turned).length() < 1e-10, "{drawn_from}");
            let explicit = [&flag("eye", drawn_from), place[1], place[2], shadow, "-o", "alone.png"];
            render(folder, &explicit);
            assert_eq!(bytes(folder, &name), bytes(folder, "alone.png"), "{shadow}: picture {k}");
            pictures.push(bytes(folder, &name));
        }
        std::fs::write(folder.join("scene.toml"), scene_text(&pictures[3])).unwrap();
        succeed(folder, &["render", "--scene=scene.toml", "-o", "again.png"]);
        assert_eq!(pictures[3], bytes(folder, "again.png"), "{shadow}: from its own text");
        pictures.dedup();
        assert_eq!(pictures.len(), 5, "they differ");
        // One shadow map of the whole volume serves all pictures; `fit=view` may need one for each.
        let counts = built_and_kept(&turn);
        assert!(counts.iter().all(|[built, kept]| built + kept == 1) && counts[0] == [1, 0], "{counts:?}");
        if shadow != "--shadow=dsm" {
            assert!(counts[1..].iter().all(|c| *c == [0, 1]), "{shadow}: {counts:?}");
        }
    }
}

#[test]
fn pictures_of_a_time_series_are_those_of_its_frames() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/formats/files/frames.npy");
    let series = ["render", file.to_str().unwrap(), "--tf=uniform", "--size=31x23"];
    let run = |more: &[&str]| {
        // Standard output may be a picture.
        let output = umbravox(folder, &[&series, more].concat());
        assert!(output.status.success(), "{more:?}: {}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    let json: serde_json::Value =
        serde_json::from_slice(&run(&["--frames=all", "-o", "t.png", "--json"])).unwrap();
    let frames = json["frames"].as_array().unwrap();
    assert!(frames.len() > 1 && frames[1]["frame"] == 1, "{json}");
    for number in 0..frames.len() {
        let numbered = bytes(folder, &format!("t_{number:04}.png"));
        std::fs::write(folder.join("scene.toml"), scene_text(&numbered)).unwrap();
        succeed(folder, &["render", "--scene=scene.toml", "-o", "again.png"]);
        assert_eq!(numbered, bytes(folder, "again.png"), "frame {number}");
        let scene = SceneRequest::from_toml(&scene_text(&numbered)).unwrap().settings;
        assert_eq!(scene.read_flags.frame, Some(number));
    }
    let streamed = run(&["--frames=all", "-o", "-"]);
    let numbered: Vec<u8> = (0..frames.len()).flat_map(|n| bytes(folder, &format!("t_{n:04}.png"))).collect();
    assert_eq!(streamed, numbered);
}

#[test]
fn warnings_about_later_frames_are_printed_once() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    // Frames of 4 x 4 x 4 voxels: the first is whole, the others have 1, 2 and 2 voxels without a value.
    let mut voxels = ndarray::Array4::from_shape_fn((4, 4, 4, 4), |(_, z, y, x)| (x + y + z) as f32);
    for (frame, count) in [(1, 1), (2, 2), (3, 2)] {
        (0..count).for_each(|x| voxels[[frame, 0, 0, x]] = f32::NAN);
    }
    ndarray_npy::write_npy(dir.path().join("series.npy"), &voxels).unwrap();
    let line = ["render", "series.npy", "--tf=uniform", "--size=8x8", "--frames=all", "-o", "t.png"];
    let stderr = succeed(dir.path(), &line).stderr;
    let warnings: Vec<_> = stderr.lines().filter(|line| line.starts_with("warning: ")).collect();
    let beginnings = ["warning: no --spacing", "warning: frame 1: 1 voxels", "warning: frame 2: 2 voxels"];
    assert_eq!(warnings.len(), beginnings.len(), "{stderr}");
    assert!(warnings.iter().zip(beginnings).all(|(line, begin)| line.starts_with(begin)), "{stderr}");
    assert!(!stderr.contains("progress:"), "a quick command writes no lines: {stderr}");
}

#[test]
fn a_map_that_follows_the_view_is_built_for_each() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let near = ["--zoom=6", "--shadow=dsm", "--turntable=4", "-o", "near.npy"];
    let counts = built_and_kept(&render(dir.path(), &near));
    assert_eq!(counts, [[1, 0]; 4], "what is seen of the volume differs");
    let said =
        succeed(dir.path(), &[&SCENE[..], &["--turntable=3", "--explain", "-o", "a.npy"]].concat()).stderr;
    assert!(said.contains("plan: 3 pictures: ") && !said.contains("on the axis"), "{said}");
    let above = ["--light=dir:0,0,1", "--light-sweep=2", "-o", "a.npy"];
    let said = succeed(dir.path(), &[&SCENE[..], &above].concat()).stderr;
    assert!(said.contains("note: every light lies on the rotation axis"), "{said}");
    // If no light lights the scene, no shadow map is built.
    let lit = ["--ambient=1", "--turntable=3", "-o", "lit.npy"];
    let json = render(dir.path(), &lit);
    assert_eq!(json["method"], "none");
    let alone = render(dir.path(), &["--ambient=1", "-o", "alone.npy"]);
    assert_eq!(json["left_out"], alone["left_out"]);
    assert_eq!(bytes(dir.path(), "lit_0000.npy"), bytes(dir.path(), "alone.npy"));
}

#[test]
fn lights_of_a_sweep_are_those_given_explicitly() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let place = ["--eye=300,-420,160", "--target=12,-7,30", "--shadow=dsm:map=64"];
    let [toward, at] = [DVec3::new(0.48, 0.64, 0.6), DVec3::new(80.0, 10.0, 200.0)];
    let lights = [flag("light", toward).replace('=', "=dir:"), flag("light", at).replace('=', "=point:")];
    let colored = format!("{},color=#ff8040,intensity=0.5", lights[1]);
    let all = [&place[..], &[&lights[0], &colored, "--light-sweep=4", "-o", "sweep.npy"]].concat();
    let counts = built_and_kept(&render(folder, &all));
    assert_eq!(counts, [[2, 0]; 4], "each light has a map of its own in each picture");
    render(folder, &[&place[..], &[&lights[0], &colored, "-o", "alone.npy"]].concat());
    assert_eq!(bytes(folder, "sweep_0000.npy"), bytes(folder, "alone.npy"));
    let read = |name: &str| Array3::<f32>::read_npy(std::fs::File::open(folder.join(name)).unwrap()).unwrap();
    let target = DVec3::new(12.0, -7.0, 30.0);
    let quarters = |v: DVec3, k: usize| (0..k).fold(v, |v, _| DVec3::new(-v.y, v.x, v.z));
    let mut turned_off = 0.0_f32;
    for k in 1..4 {
        let toward = flag("light", quarters(toward, k)).replace('=', "=dir:");
        let at = flag("light", target + quarters(at - target, k)).replace('=', "=point:");
        let at = format!("{at},color=#ff8040,intensity=0.5");
        render(folder, &[&place[..], &[&toward, &at, "-o", "alone.npy"]].concat());
        let (sweep, alone) = (read(&format!("sweep_{k:04}.npy")), read("alone.npy"));
        let off = |a: &Array3<f32>| a.iter().zip(&alone).map(|(a, b)| (a - b).abs()).fold(0.0_f32, f32::max);
        // A rotation by sines and cosines differs by 1e-16 from one that swaps coordinates, which can move a node,
        // within epsilon.
        assert!(off(&sweep) < 0.02, "picture {k}: {}", off(&sweep));
        turned_off = turned_off.max(off(&read("sweep_0000.npy")));
    }
    assert!(turned_off > 0.05, "{turned_off}: the light matters");
    // Pictures of the turning camera record the turned lights, and reproduce the picture.
    render(folder, &[&place[..], &[&lights[0], &lights[1], "--light-sweep=3", "-o", "sweep.png"]].concat());
    let text = scene_text(&bytes(folder, "sweep_0001.png"));
    let scene = SceneRequest::from_toml(&text).unwrap().settings;
    let Light::Point { position } = scene.light.unwrap()[1].light else { panic!("{text}") };
    assert!(((position - target).length() - (at - target).length()).abs() < 1e-10);
    std::fs::write(folder.join("scene.toml"), text).unwrap();
    succeed(folder, &["render", "--scene=scene.toml", "-o", "again.png"]);
    assert_eq!(bytes(folder, "sweep_0001.png"), bytes(folder, "again.png"));
}

#[test]
fn one_animated_file_holds_the_numbered_pictures() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    std::fs::write(folder.join("f_0006.png"), "of a longer turn").unwrap();
    let run = umbravox(folder, &[&SCENE[..], &["--turntable=6", "-o", "f.png"]].concat());
    let said = String::from_utf8(run.stderr).unwrap();
    assert!(said.contains("warning: f_0006.png is from an earlier run"), "{said}");
    std::fs::remove_file(folder.join("f_0006.png")).unwrap();
    let numbered: Vec<Vec<u8>> = (0..6)
        .map(|k| image::open(folder.join(format!("f_{k:04}.png"))).unwrap().to_rgb8().into_raw())
        .collect();

    let json = render(folder, &["--turntable=6", "--fps=4", "-o", "turn.apng"]);
    assert!(json["frames"][3].get("file").is_none() && json["frames"].as_array().unwrap().len() == 6);
    let file = bytes(folder, "turn.apng");
    assert_eq!(scene_text(&file), scene_text(&bytes(folder, "f_0000.png")));
    let mut reader = png::Decoder::new(Cursor::new(file)).read_info().unwrap();
    assert_eq!(reader.info().animation_control().unwrap().num_frames, 6);
    let mut pixels = vec![0; 37 * 29 * 3];
    for (k, numbered) in numbered.iter().enumerate() {
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, *numbered, "picture {k}");
        let control = reader.info().frame_control().unwrap();
        assert_eq!(f64::from(control.delay_num) / f64::from(control.delay_den), 0.25);
    }

    render(folder, &["--turntable=6", "--fps=4", "-o", "turn.gif"]);
    let file = bytes(folder, "turn.gif");
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(&file[..]).unwrap();
    let mut count = 0;
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        assert_eq!((frame.width, frame.height, frame.delay), (37, 29, 25));
        let rgb = frame.buffer.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]);
        let off: f64 = rgb.zip(&numbered[count]).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
        // An animation has 256 colours for all pictures.
        assert!((off / numbered[count].len() as f64).sqrt() < 6.0, "picture {count}: {off}");
        count += 1;
    }
    assert_eq!(count, 6);
    assert!(names(folder).iter().all(|name| !name.ends_with(".tmp")), "{:?}", names(folder));
}

/// Starts a long turn, waits until `begun`, interrupts it `times` times, and returns its exit status as shells do and
/// its output.
#[cfg(unix)]
fn interrupted(
    folder: &Path,
    [size, output]: [&str; 2],
    times: usize,
    begun: impl Fn() -> bool,
) -> (i32, String) {
    use std::os::unix::process::ExitStatusExt;
    let args = ["render", "phantom:thorax:24", size, "--shadow=rays", "--turntable=5000", "-o", output];
    let mut child = Command::new(env!("CARGO_BIN_EXE_umbravox"))
        .args(args)
        .current_dir(folder)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while !begun() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be interrupted");
        assert!(start.elapsed() < Duration::from_secs(120), "it does not begin");
        std::thread::sleep(Duration::from_millis(20));
    }
    for _ in 0..times {
        crate::program::signal(&child, "TERM");
        // Two signals at the same time count as one.
        std::thread::sleep(Duration::from_millis(50));
    }
    let ended = child.wait_with_output().unwrap();
    (
        ended.status.code().unwrap_or_else(|| 128 + ended.status.signal().unwrap()),
        String::from_utf8(ended.stderr).unwrap(),
    )
}

#[cfg(unix)]
#[test]
fn an_interruption_leaves_whole_files_alone() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let small = "--size=400x400";
    let (status, said) = interrupted(folder, [small, "f.png"], 1, || folder.join("f_0001.png").exists());
    assert!(status == 1 && said.contains("error: interrupted"), "{said}");
    let left = names(folder);
    assert!(said.contains(&format!("{} of 5000 pictures are drawn", left.len())), "{said}\n{left:?}");
    for (k, name) in left.iter().enumerate() {
        assert_eq!(*name, format!("f_{k:04}.png"));
        assert_eq!(image::open(folder.join(name)).unwrap().width(), 400);
    }
    // A second interrupt ends the program at once; if the picture is done soon, after it.
    for (size, times, ends) in [(small, 1, vec![1]), ("--size=3000x3000", 2, vec![130, 1])] {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path();
        // Waits for the final file, not the one that only tests whether the folder can be written.
        let before = std::cell::RefCell::new(Vec::new());
        let (status, said) = interrupted(folder, [size, "f.gif"], times, || {
            let now = names(folder);
            !now.is_empty() && before.replace(now.clone()) == now
        });
        assert!(ends.contains(&status) && said.contains("nothing is written"), "{status}: {said}");
        assert_eq!(names(folder), [""; 0]);
    }
}

#[cfg(unix)]
#[test]
fn signals_ignored_by_nohup_stay_ignored() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let turn =
        ["render", "phantom:thorax:24", "--size=400x400", "--shadow=rays", "--turntable=4", "-o", "f.png"];
    let mut child = Command::new("nohup")
        .arg(env!("CARGO_BIN_EXE_umbravox"))
        .args(turn)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while !folder.join("f_0000.png").exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before its first picture");
        std::thread::sleep(Duration::from_millis(5));
    }
    for _ in 0..2 {
        crate::program::signal(&child, "HUP");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(names(folder).len(), 4);
}
