//! Output files of a comparison table.

use super::{TF, read_csv, run};
use crate::common;
use crate::program::{refused, umbravox};

const TINY: [&str; 13] = [
    "compare",
    "phantom:sphere:24",
    "--size=32x32",
    "--points=500",
    "--rays=50",
    "--depths=40",
    "--repeats=1",
    "--tf",
    "tf.json",
    "-o",
    "out",
    "--methods",
    "none;rays;dsm:map=64,epsilon=0.06,0.02;dsm:map=64,prefilter=5",
];

/// Random estimators interpolate light along eye rays in another way than `rays`, which is no error of the shadows.
#[test]
fn shadow_errors_of_random_rays_have_no_error_of_eye_rays() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let method = "rays:estimator=jackknife,samples=128";
    let scene =
        ["compare", "phantom:cloud:32", "--tf=tf.json", "--size=32x32", "--step=1", "--methods", method];
    let effort = ["--points=300", "--rays=5", "--depths=5", "--repeats=1", "-o", "out"];
    run(dir.path(), &[&scene[..], &effort].concat());
    let row = &read_csv(&dir.path().join("out/compare.csv"))[0];
    let [shadow, image, point] =
        ["shadow_rmse", "image_rmse", "point_err_rms"].map(|column| row[column].parse::<f64>().unwrap());
    assert!(point < 5e-3 && shadow < 2.0 * point && image > 5.0 * shadow, "{shadow} {image} {point}");
}

#[test]
fn the_table_has_a_row_a_setting_and_every_file_is_there() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let stdout = run(dir.path(), &TINY);
    assert_eq!(stdout.lines().filter(|l| l.starts_with('|')).count(), 2 + 5, "{stdout}");

    let out = dir.path().join("out");
    let rows = read_csv(&out.join("compare.csv"));
    let named: Vec<_> = rows.iter().map(|r| format!("{} {}", r["method"], r["params"])).collect();
    let expected = ["none ", "rays ", "dsm epsilon=0.06", "dsm epsilon=0.02", "dsm epsilon=0.02 prefilter=5"];
    assert_eq!(named, expected);
    let number = |row: usize, column: &str| rows[row][column].parse::<f64>().unwrap();
    for (i, row) in rows.iter().enumerate() {
        assert_eq!((row["scene"].as_str(), row["width"].as_str()), ("sphere:24, haze", "32"));
        assert!(number(i, "frame_ms") > 0.0 && number(i, "fps_moving") > 0.0);
        assert!(number(i, "image_rmse") < 0.2);
        assert!((0.5..=1.0).contains(&number(i, "image_ssim")));
        // Shadow rays are the reference of these, whatever the step along eye rays; their own answers are off by 1e-5.
        let is_exact = |column: &str| {
            if row["method"] == "rays" { number(i, column) == 0.0 } else { number(i, column) > 1e-5 }
        };
        assert!(is_exact("shadow_rmse") && is_exact("flip"));
        let [low, rms, high] = ["_lo", "", "_hi"].map(|end| number(i, &format!("point_err_rms{end}")));
        assert!(low <= rms && rms <= high);
        // The methods' pictures must not have a smaller error than the exact picture itself.
        assert!(number(i, "image_exact_err") < 1e-4);
        assert!(number(i, "point_err_mean_signed").abs() <= number(i, "point_err_rms"));
        assert!(number(i, "bricks_ms") > 0.0 && number(i, "tables_ms") > 0.0);
        assert!(number(i, "build_wall_ms") >= number(i, "build_ms") && number(i, "frame_wall_ms") > 0.0);
        assert!(number(i, "build_host_ms") > 0.0 && number(i, "build_host_ms") <= number(i, "build_ms"));
        assert!(number(i, "frame_host_ms") > 0.0 && number(i, "frame_host_ms") < number(i, "frame_ms"));
        assert_eq!((row["status"].as_str(), row["note"].as_str(), row["repeats"].as_str()), ("ok", "", "1"));
        for fact in ["driver", "threads", "revision"] {
            assert!(!row[fact].is_empty(), "{fact}");
        }
        assert_eq!(row["version"], env!("CARGO_PKG_VERSION"));
        assert!(number(i, "point_err_rms") <= number(i, "point_err_max"));
    }
    // Methods with an error bound satisfy it; others report none.
    let held: Vec<_> = rows.iter().map(|r| r["bound_held"].as_str()).collect();
    assert_eq!(held, ["", "true", "true", "true", "true"]);
    assert_eq!((rows[0]["bound"].as_str(), rows[0]["bytes"].as_str()), ("", "0"));
    for (row, epsilon) in [(2, 0.06), (3, 0.02)] {
        assert!((epsilon..epsilon + 0.005).contains(&number(row, "bound")));
        assert!(number(row, "build_ms") > 0.0 && number(row, "nodes_total") > 0.0);
        assert!(number(row, "point_err_rms") < 0.5 * number(0, "point_err_rms"));
    }
    assert!(number(1, "ray_err_max") < 0.01, "rays are close to exact");
    assert!(number(0, "ray_err_max") > 0.5, "no shadows are not");
    assert!(rows[0]["left_out"].contains("shadow pass"));

    let mut names: Vec<_> =
        std::fs::read_dir(&out).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let dsm = ["dsm-map-64-epsilon-0.02", "dsm-map-64-epsilon-0.02-prefilter-5", "dsm-map-64-epsilon-0.06"];
    let mut files: Vec<String> =
        ["csv", "json", "md", "png", "rows.jsonl", "svg", "tex"].map(|e| format!("compare.{e}")).into();
    files.extend(
        ["columns.md", "pictures.md", "grid.png", "grid.pdf", "report.html", "run.json"].map(String::from),
    );
    files.extend(["scene.toml", "transfer_function.json", "compare.pdf"].map(String::from));
    files.extend(["pdf", "png", "svg"].map(|e| format!("compare_bytes.{e}")));
    files.extend(dsm.iter().map(|slug| format!("nodes_{slug}.npy")));
    for ending in ["png", "exr"] {
        files.extend(["none", "rays"].iter().chain(&dsm).map(|slug| format!("picture_{slug}.{ending}")));
    }
    files.extend(["none"].iter().chain(&dsm).map(|slug| format!("difference_{slug}.png")));
    files.sort();
    assert_eq!(names, files);

    // A row of the table, two plots; a picture a row, errors of all but `rays`, and nodes of the deep shadow maps.
    let report = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(report.matches("<tr><th scope=\"row\"").count(), 5);
    assert_eq!(report.matches("<svg ").count(), 2 + 3);
    assert_eq!(report.matches("<img ").count(), 5 + 4 + 3);
    let total = format!("<figcaption>{} nodes in ", rows[3]["nodes_total"]);
    assert!(report.contains(&total), "{total}");
}

#[test]
fn json_on_stdout_is_the_file() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let stdout = run(dir.path(), &[&TINY[..11], &["--methods", "none", "--json"]].concat());
    assert_eq!(stdout, std::fs::read_to_string(dir.path().join("out/compare.json")).unwrap());
    let rows: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(rows[0]["method"], "none");
}

#[test]
fn a_map_that_no_sample_needs_is_not_built() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), &[&TINY[..11], &["--methods", "dsm:map=64", "--ambient=1"]].concat());
    let rows = read_csv(&dir.path().join("out/compare.csv"));
    // Without a shadow map only the light space is built.
    assert!(rows[0]["build_ms"].parse::<f64>().unwrap() < 5.0 && rows[0]["bytes"] == "0", "{:?}", rows[0]);
    assert_eq!((rows[0]["point_err_rms"].as_str(), rows[0]["bound_held"].as_str()), ("", ""));
    assert!(rows[0]["left_out"].contains("shadow map (ambient 1)"), "{}", rows[0]["left_out"]);
}

#[test]
fn bad_methods_are_refused_before_anything_is_made() {
    let dir = tempfile::tempdir().unwrap();
    for (methods, why) in [
        ("nonsense", "nonsense"),
        ("none;dsm:epsilon=2", "epsilon"),
        ("dsm:layers=3", "layers"),
        ("rays:map=512", "there is: estimator, samples, seed, march, step, lookup"),
        ("", "NAME"),
    ] {
        let args = ["compare", "phantom:slab:8", "-o", "out", "--methods", methods];
        let error = refused(dir.path(), &args);
        assert!(error.contains("--methods") && error.contains(why), "{methods}: {error}");
    }
    for flag in ["--repeats=0", "--points=0", "--rays=0", "--depths=1"] {
        refused(dir.path(), &["compare", "phantom:slab:8", "-o", "out", flag]);
    }
}

#[test]
fn scenes_share_a_table_and_flags_win_over_each() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let scene = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    scene("ball.toml", "volume = 'phantom:sphere:24'\ntf = 'tf.json'\nsize = '16x16'\nlight = 'dir:0,0,1'\n");
    scene("wall.toml", "volume = 'phantom:slab:12'\ntf = 'uniform'\nsize = '24x20'\nambient = 1\n");
    let args = ["compare", "--scene=ball.toml", "--scene=wall.toml", "--size=32x24", "-o", "out"];
    let effort =
        ["--points=200", "--rays=20", "--depths=20", "--repeats=1", "--methods=none;rays;dsm:map=32"];
    let stdout = run(dir.path(), &[&args[..], &effort].concat());
    assert!(stdout.contains("| ball ") && stdout.contains("| wall "), "{stdout}");

    let out = dir.path().join("out");
    let rows = read_csv(&out.join("compare.csv"));
    let named: Vec<_> = rows.iter().map(|r| (r["scene"].as_str(), r["method"].as_str())).collect();
    let expected = ["ball", "wall"].map(|s| ["none", "rays", "dsm"].map(|m| (s, m))).concat();
    assert_eq!(named, expected);
    for row in &rows {
        assert_eq!((row["width"].as_str(), row["height"].as_str()), ("32", "24"), "--size wins over both");
        // A setting of one scene file applies to its scene alone.
        assert_eq!(row["left_out"].contains("ambient 1"), row["scene"] == "wall", "{}", row["left_out"]);
    }
    // Each scene has its own Pareto front: without errors the wall has none.
    let on_front = |scene: &str| rows.iter().filter(|r| r["scene"] == scene && r["pareto"] == "true").count();
    assert!(on_front("ball") > 0 && on_front("wall") == 0);
    for scene in ["ball", "wall"] {
        for file in [format!("compare_{scene}.svg"), format!("picture_{scene}_dsm-map-32-epsilon-0.02.png")] {
            assert!(out.join(&file).is_file(), "{file}");
        }
        // Three pictures, and the two that differ from that by `rays`, with every pixel.
        let pdf = std::fs::read(out.join(format!("{scene}_grid.pdf"))).unwrap();
        let pdf = String::from_utf8_lossy(&pdf);
        let count = |part: &str| pdf.matches(part).count();
        assert_eq!([count("/Subtype /Image"), count("/Width 32"), count("/Height 24")], [5; 3], "{scene}");
        let png = image::open(out.join(format!("{scene}_grid.png"))).unwrap();
        assert!(png.width() >= 2 * 455 && png.to_rgb8().pixels().any(|p| p.0 == [255; 3]), "{scene}");
    }
    let sheet = std::fs::read_to_string(out.join("pictures.md")).unwrap();
    assert!(
        sheet.contains("## ball")
            && sheet.contains("![all pictures](ball_grid.png)")
            && sheet.contains("(difference_wall_none.png)"),
        "{sheet}"
    );
}

#[test]
fn scenes_that_do_not_go_together_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let scene = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    scene("a.toml", "volume = 'phantom:slab:8'\nadapter = 'one'");
    scene("b.toml", "volume = 'phantom:slab:8'\nadapter = 'two'");
    scene("c.toml", "volume = 'no-such.nii'");
    let error = refused(dir.path(), &["compare", "--scene=a.toml", "--scene=b.toml", "-o", "out"]);
    assert!(error.contains("different"), "{error}");
    // The last scene's mistake is found before the first one is drawn.
    let error =
        refused(dir.path(), &["compare", "phantom:slab:8", "--scene=a.toml", "--scene=d.toml", "-o", "out"]);
    assert!(error.contains("d.toml"), "{error}");
    let scenes = ["compare", "--adapter=any", "--scene=a.toml", "--scene=c.toml", "-o", "out"];
    assert!(refused(dir.path(), &scenes).contains("no-such.nii"));
    let error = refused(dir.path(), &["render", "--scene=a.toml", "--scene=b.toml", "-o", "a.png"]);
    assert!(error.contains("(--scene)"), "{error}");
}

#[test]
fn a_row_that_fails_says_why_and_the_others_go_on() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("tf.json"), TF).unwrap();
    // 512 layers of 8192 x 8192 texels are more than any texture holds.
    let methods = ["--methods", "none;osm:map=8192,layers=512;dsm:map=64"];
    let output = umbravox(dir.path(), &[&TINY[..11], &methods].concat());
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("error: 1 of 3 rows failed"), "{stderr}");
    let rows = read_csv(&dir.path().join("out/compare.csv"));
    let status: Vec<_> = rows.iter().map(|r| r["status"].as_str()).collect();
    assert_eq!(status, ["ok", "failed", "ok"]);
    assert!(rows[1]["note"].contains("cannot allocate"), "{}", rows[1]["note"]);
    assert!(rows[1]["frame_ms"].is_empty() && !rows[2]["frame_ms"].is_empty());
    assert!(
        std::fs::read_to_string(dir.path().join("out/compare.md"))
            .unwrap()
            .contains("failed: cannot allocate")
    );
}

#[test]
fn a_row_with_an_enclosure_has_a_certified_picture() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let mut args = TINY;
    args[12] = "dsm:map=32,enclose=on;dsm:map=32";
    run(dir.path(), &args);
    let rows = read_csv(&dir.path().join("out/compare.csv"));
    let number = |column: &str| rows[0][column].parse::<f64>().unwrap();
    assert_eq!((rows[0]["certified_held"].as_str(), rows[0]["enclosure_held"].as_str()), ("true", "true"));
    assert!(number("certified_err_mean") > 5e-4 && number("certified_err_mean") < number("certified_err"));
    assert!(number("certified_rays") > 0.0 && number("certified_rays") < 1.0);
    for column in ["certified_held", "certified_err", "certified_err_mean", "certified_rays"] {
        assert_eq!(rows[1][column], "", "{column}");
    }
}
