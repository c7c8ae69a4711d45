//! Output files of `compare --ablate`.

use super::run;
use crate::common;
use std::collections::HashMap;

type Rows = Vec<HashMap<String, String>>;

#[test]
fn every_omission_is_forced_back_on() {
    if !common::has_adapter() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let methods = "none;dsm:map=192;dom:map=192,layers=31";
    let mut args = vec!["compare", "phantom:shell:48", "--size=48x48", "--tf", "tf.json", "-o", "out"];
    args.extend([
        "--points=200",
        "--rays=20",
        "--depths=20",
        "--repeats=2",
        "--ablate",
        // Zoomed out, so that some tiles show only background.
        "--zoom=0.6",
        "--methods",
        methods,
    ]);
    run(dir.path(), &args);
    let path = dir.path().join("out/ablation.csv");
    let rows: Rows = csv::Reader::from_path(&path).unwrap().deserialize().map(|r| r.unwrap()).collect();
    let of = |method: &str| -> Vec<&str> {
        rows.iter().filter(|r| r["method"] == method).map(|r| r["omission"].as_str()).collect()
    };
    assert_eq!(of("none"), ["colors", "march-table", "bricks", "eye-tiles", "gradients"]);
    assert_eq!(of("dsm"), ["colors", "breakpoint-search", "bricks", "eye-tiles", "tiles", "gradients"]);
    assert_eq!(
        of("dom"),
        ["colors", "breakpoint-search", "bricks", "eye-tiles", "tiles", "depth-pass", "gradients"]
    );
    for row in &rows {
        let number =
            |column: &str| row[column].parse::<f64>().unwrap_or_else(|_| panic!("{column}: {row:?}"));
        assert!(number("picture_difference") <= 1e-5, "{row:?}");
        assert!(row["note"].is_empty(), "{row:?}");
        for column in ["tables_ms", "tables_ms_forced", "frame_ms", "frame_ms_forced"] {
            assert!(number(column) > 0.0, "{column}: {row:?}");
        }
        let more = number("bytes_forced") - number("bytes");
        match row["omission"].as_str() {
            "tiles" | "march-table" | "colors" => assert!(more > 0.0, "{row:?}"),
            _ => assert_eq!(more, 0.0, "{row:?}"),
        }
    }
    let markdown = std::fs::read_to_string(dir.path().join("out/ablation.md")).unwrap();
    assert_eq!(markdown.lines().filter(|l| l.starts_with("| shell:48")).count(), rows.len());
    let json = std::fs::read_to_string(dir.path().join("out/ablation.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json.as_array().unwrap().len(), rows.len());
}
