//! Time and error of shadows on three scenes, as a table. `UMBRAVOX_BEFORE` names the binary of another build, which runs in
//! turn with this one and whose rows come first. `UMBRAVOX_PEER` is a command for VTK's ray caster: it takes VOLUME TF --eye
//! --target --fov --light --size --step and prints `MODE median min max` in ms. `UMBRAVOX_SCENES` selects scenes, and
//! `UMBRAVOX_ROUNDS` is the number of runs. Figures are medians over all runs.
//!
//! A second table has the number of busy cores during a build.

#[path = "../tests/common/mod.rs"]
mod common;

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Number of runs.
const ROUNDS: usize = 1;
/// Map sizes around errors of 0.02 and 0.04, and the ends of the range.
const MAPS: &str = "192,224,256,288,352,448,512";
const LIGHT: &str = "0.5,-0.5,0.7071";
const ERRORS: [f64; 3] = [0.02, 0.03, 0.04];

/// Build and frame times (ms) of a row in all runs, and its columns that do not change between runs.
#[derive(Default)]
struct Figures {
    build_ms: Vec<f64>,
    frame_ms: Vec<f64>,
    row: Value,
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

impl Figures {
    fn moving_ms(&self) -> f64 {
        median(&self.build_ms) + median(&self.frame_ms)
    }

    fn number(&self, column: &str) -> f64 {
        self.row[column].as_f64().unwrap_or(f64::NAN)
    }

    fn params(&self) -> &str {
        self.row["params"].as_str().unwrap_or_default()
    }

    fn print(&self, who: &str, scene: &str, none_ms: f64) {
        let work = ["work_samples", "work_lookups", "work_loads", "work_cells", "work_pieces"];
        let work = work.map(|column| format!("{:.1}", self.number(column))).join(" / ");
        println!(
            "| {scene} | {who} | {} {} | {} | {:.1} | {:.1} | {:.2} | {:.4} | {:.4} | {} | {work} |",
            self.row["method"].as_str().unwrap_or_default(),
            self.params(),
            self.row["map"],
            median(&self.build_ms),
            median(&self.frame_ms),
            median(&self.frame_ms) / none_ms,
            self.number("point_err_rms"),
            self.number("ray_err_max"),
            self.row["check_ok"],
        );
    }
}

/// Adds a run of a binary on a scene to its rows; the key of a row is its method, settings and map.
fn measure(
    binary: &Path,
    scene: &[String],
    methods: &str,
    rows: &mut BTreeMap<String, Figures>,
) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let output = Command::new(binary)
        .arg("compare")
        .args(scene)
        .args(["--methods", methods, "--light", &format!("dir:{LIGHT}"), "--size", "512x512", "--step", "1"])
        .args(["--repeats", "5", "--points", "4000", "--rays", "400", "--depths", "40", "-o"])
        .arg(folder.path())
        .output()
        .map_err(|e| e.to_string())?;
    let text = std::fs::read_to_string(folder.path().join("compare.json"))
        .map_err(|_| String::from_utf8_lossy(&output.stderr).into_owned())?;
    let table: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let table = table.as_array().or_else(|| table["rows"].as_array()).cloned().unwrap_or_default();
    for row in table {
        let key = format!("{} {} {}", row["method"], row["params"], row["map"]);
        let figures = rows.entry(key).or_default();
        figures.build_ms.push(row["build_ms"].as_f64().unwrap_or(0.0));
        figures.frame_ms.extend(row["frame_ms"].as_f64());
        figures.row = row;
    }
    Ok(())
}

/// Medians (ms) of the peer's modes on a scene with a file, a transfer function and a camera.
fn peer(command: &str, scene: &[String]) -> Result<BTreeMap<String, f64>, String> {
    let mut words = command.split_whitespace();
    let program = words.next().ok_or("UMBRAVOX_PEER is empty")?;
    let output = Command::new(program)
        .args(words)
        .args([&scene[0], &scene[2]])
        .args(&scene[3..])
        .args(["--light", LIGHT, "--size", "512", "--step", "1", "--modes", "unshaded,shadows"])
        .output()
        .map_err(|e| e.to_string())?;
    let text = String::from_utf8_lossy(&output.stdout);
    let line = |line: &str| {
        let mut words = line.split_whitespace();
        Some((words.next()?.to_owned(), words.next()?.parse().ok()?))
    };
    let modes: BTreeMap<_, _> = text.lines().filter_map(line).collect();
    match modes.contains_key("shadows") {
        true => Ok(modes),
        false => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
    }
}

/// Prints the number of busy cores during builds: processor time by wall time.
#[cfg(target_os = "linux")]
fn print_busy(scene: &[String], name: &str, march: &str) -> Result<(), String> {
    use std::sync::Arc;
    use umbravox::open::{VolumeSpec, load, presets};
    use umbravox::render::{DisabledOptimizations, Session};
    use umbravox::{scene::Light, shadow};
    let words = |e: umbravox::Error| e.to_string();
    let volume = Arc::new(load(&VolumeSpec::new(scene[0].clone())).map_err(words)?);
    let tf = presets::resolve(&scene[2], &volume).map_err(words)?.tf;
    let session =
        Session::open(None, Arc::clone(&volume), &tf, DisabledOptimizations::NONE).map_err(words)?;
    let method = shadow::parse(&format!("dsm:map=512,march={march}")).map_err(words)?;
    let light = Light::Directional { toward: glam::DVec3::new(0.5, -0.5, std::f64::consts::FRAC_1_SQRT_2) };
    // The first two builds make pipelines and pools.
    for _ in 0..2 {
        session.shadow(method.as_ref(), light).map_err(words)?;
    }
    let ticks = || -> Option<f64> {
        let text = std::fs::read_to_string("/proc/self/stat").ok()?;
        let mut fields = text.rsplit(')').next()?.split_whitespace().skip(11);
        Some(fields.next()?.parse::<f64>().ok()? + fields.next()?.parse::<f64>().ok()?)
    };
    let (start, before) = (std::time::Instant::now(), ticks());
    for _ in 0..10 {
        session.shadow(method.as_ref(), light).map_err(words)?;
    }
    let (wall, after) = (start.elapsed().as_secs_f64(), ticks());
    // A tick is a hundredth of a second.
    let busy = after.zip(before).map_or(f64::NAN, |(a, b)| (a - b) / 100.0 / wall);
    println!("| {name}, march={march} | {busy:.2} |");
    Ok(())
}

fn main() -> ExitCode {
    let functions = tempfile::tempdir().expect("a folder for transfer functions");
    let ramp = |name: &str, points: [(f64, f64); 2]| {
        let points = points.map(|(value, opacity)| json!({ "value": value, "opacity": opacity }));
        let path = functions.path().join(name);
        std::fs::write(&path, json!({ "name": name, "points": points }).to_string())
            .expect("a file is written");
        path.display().to_string()
    };
    let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let scan = |name: &str, tf: String, camera: &str| {
        let volume = common::scan_if_present(name)?.display().to_string();
        Some((name.to_owned(), [vec![volume, "--tf".into(), tf], words(camera)].concat()))
    };
    let vessels = ramp("CT_AVM.json", [(190.0, 0.0), (310.0, 0.3)]);
    let metal = ramp("engine.json", [(60.0, 0.0), (120.0, 0.6)]);
    let mut scenes = vec![("thorax:128".to_owned(), words("phantom:thorax:128 --tf ct"))];
    scenes.extend(scan("CT_AVM", vessels, "--eye 150,-260,160 --target 18.4,17,12 --fov 40"));
    scenes.extend(scan("engine", metal, "--eye 300,-300,200 --target 0,0,0 --fov 40"));
    let now = PathBuf::from(env!("CARGO_BIN_EXE_umbravox"));
    let before = std::env::var_os("UMBRAVOX_BEFORE").map(PathBuf::from);
    let by_cells = format!("none;dsm:epsilon=0.02,map={MAPS}");
    let by_samples = format!(
        "{by_cells};dsm:march=samples,step=0.5,0.75,1,epsilon=0.02,map={MAPS};dsm:map=512,fit=volume,march=cells,samples"
    );
    println!(
        "| scene | build of | method | map | build ms | frame ms | frame / none | point_err_rms | ray_err_max | check_ok | samples / lookups / loads a pixel / cells / pieces a texel |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let chosen = std::env::var("UMBRAVOX_SCENES").ok();
    scenes.retain(|(name, _)| chosen.as_ref().is_none_or(|list| list.split(',').any(|one| one == name)));
    let peer_command = std::env::var("UMBRAVOX_PEER").ok();
    let rounds = std::env::var("UMBRAVOX_ROUNDS").ok().and_then(|n| n.parse().ok()).unwrap_or(ROUNDS);
    for (name, scene) in &scenes {
        let mut peer_ms: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        let mut builds: Vec<_> =
            before.iter().map(|path| ("before", path, &by_cells, BTreeMap::new())).collect();
        builds.push(("now", &now, &by_samples, BTreeMap::new()));
        for _ in 0..rounds {
            for (_, binary, methods, rows) in &mut builds {
                if let Err(why) = measure(binary, scene, methods, rows) {
                    println!("{name}: {why}");
                    return ExitCode::FAILURE;
                }
            }
            // The peer cannot read the phantom.
            if let Some(command) = peer_command.as_ref().filter(|_| !scene[0].starts_with("phantom")) {
                match peer(command, scene) {
                    Ok(modes) => modes.into_iter().for_each(|(m, ms)| peer_ms.entry(m).or_default().push(ms)),
                    Err(why) => println!("{name}: no peer: {why}"),
                }
            }
        }
        for (mode, ms) in &peer_ms {
            println!("| {name} | peer | {mode} | | | {:.1} | | | | | |", median(ms));
        }
        for (who, _, _, rows) in &builds {
            let is_none = |f: &&Figures| f.row["method"] == "none";
            let none_ms = rows.values().find(is_none).map_or(f64::NAN, |f| median(&f.frame_ms));
            let fixed =
                |f: &&Figures| is_none(f) || (f.row["map"] == 512 && f.params().contains("epsilon=0.02"));
            rows.values().filter(fixed).for_each(|f| f.print(who, name, none_ms));
            for error in ERRORS {
                let close = rows.values().filter(|f| f.number("point_err_rms") <= error);
                if let Some(best) = close.min_by(|a, b| a.moving_ms().total_cmp(&b.moving_ms())) {
                    best.print(
                        &format!("{who}, fastest within {error}: {:.0} ms", best.moving_ms()),
                        name,
                        none_ms,
                    );
                }
            }
        }
    }
    #[cfg(target_os = "linux")]
    {
        println!("\n| cores busy during builds of map 512 | processor time / wall time |\n|---|---|");
        for (name, scene) in &scenes {
            for march in ["cells", "samples"] {
                if let Err(why) = print_busy(scene, name, march) {
                    println!("{why}");
                    return ExitCode::FAILURE;
                }
            }
        }
    }
    ExitCode::SUCCESS
}
