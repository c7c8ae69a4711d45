//! What shadows cost beside the picture without them, at what error: a table of three scenes, of this build alone or in turn
//! with another one's binary (`UMBRAVOX_BEFORE`), whose rows come first. Figures are medians over all runs.

#[path = "../tests/common/mod.rs"]
mod common;

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Runs of each binary, unless `UMBRAVOX_ROUNDS` says otherwise.
const ROUNDS: usize = 2;
/// Where errors of 0.02 and 0.04 lie, and the ends of the range.
const MAPS: &str = "160,176,192,256,288,320,384,512,576";
const ERRORS: [f64; 3] = [0.02, 0.03, 0.04];

/// Builds and frames (ms) of a row in all runs, and what does not change from run to run.
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

/// Adds a run of a binary over a scene to its rows, which are told apart by method, settings and map.
fn measure(
    binary: &Path,
    scene: &[String],
    methods: &str,
    rows: &mut BTreeMap<String, Figures>,
) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let told = Command::new(binary)
        .arg("compare")
        .args(scene)
        .args(["--methods", methods, "--light", "dir:0.5,-0.5,0.7071", "--size", "512x512", "--step", "1"])
        .args(["--repeats", "5", "--points", "4000", "--rays", "400", "--depths", "40", "-o"])
        .arg(folder.path())
        .output()
        .map_err(|e| e.to_string())?;
    let text = std::fs::read_to_string(folder.path().join("compare.json"))
        .map_err(|_| String::from_utf8_lossy(&told.stderr).into_owned())?;
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
        let volume = common::scan(name)?.display().to_string();
        Some((name.to_owned(), [vec![volume, "--tf".into(), tf], words(camera)].concat()))
    };
    let vessels = ramp("CT_AVM.json", [(190.0, 0.0), (310.0, 0.3)]);
    let metal = ramp("engine.json", [(60.0, 0.0), (120.0, 0.6)]);
    let mut scenes = vec![("thorax:128".to_owned(), words("phantom:thorax:128 --tf ct"))];
    scenes.extend(scan("CT_AVM", vessels, "--eye 150,-260,160 --target 18.4,17,12 --fov 40"));
    scenes.extend(scan("engine", metal, "--eye 300,-300,200 --target 0,0,0 --fov 40"));
    let now = PathBuf::from(env!("CARGO_BIN_EXE_umbravox"));
    let before = std::env::var_os("UMBRAVOX_BEFORE").map(PathBuf::from);
    let by_cells = format!("none;dsm:epsilon=0.02,0.06,map={MAPS}");
    let by_samples = format!("{by_cells};dsm:march=samples,step=0.5,1,epsilon=0.02,0.06,map={MAPS}");
    println!(
        "| scene | build of | method | map | build ms | frame ms | frame / none | point_err_rms | ray_err_max | check_ok | samples / lookups / loads a pixel / cells / pieces a texel |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let rounds = std::env::var("UMBRAVOX_ROUNDS").ok().and_then(|n| n.parse().ok()).unwrap_or(ROUNDS);
    for (name, scene) in &scenes {
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
    ExitCode::SUCCESS
}
