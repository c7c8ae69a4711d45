//! Points of `umbravox probe --points`: lines of numbers, or a point list of 3D Slicer (`.mrk.json`, `.fcsv`).
//!
//! Source: "Markups" in the developer guide of 3D Slicer 5.6, and its schema `markups-schema-v1.0.0.json`.

use super::probe_rays::{MAX_COORDINATE, parse_rows};
use crate::error::{Error, Result};
use glam::DVec3;
use serde::Deserialize;

const WHAT: &str = "cannot read points";

/// Parses the points of a `--points` file, world mm (RAS+). The beginning of the text decides its format. In a text of lines,
/// each has `x y z`, and blank lines are ignored.
///
/// # Errors
/// A line that is not three finite numbers; the error names the line number. A point list of 3D Slicer with a point that
/// has no place, or in another coordinate system than RAS and LPS.
pub fn parse_points(text: &str, place: &str) -> Result<Vec<DVec3>> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let refuse = |why| Error::input(WHAT, place, why);
    if text.trim_start().starts_with('{') {
        parse_markups(text).map_err(refuse)
    } else if text.starts_with("# Markups fiducial file") {
        parse_fcsv(text).map_err(refuse)
    } else {
        let rows = parse_rows(text, WHAT, place, "a line is `x y z`, world mm")?;
        Ok(rows.into_iter().map(DVec3::from_array).collect())
    }
}

/// Returns the factors from a coordinate system of 3D Slicer to RAS+.
fn ras_from(system: &str) -> std::result::Result<DVec3, String> {
    match system {
        "RAS" | "0" => Ok(DVec3::ONE),
        "LPS" | "1" => Ok(DVec3::new(-1.0, -1.0, 1.0)),
        other => Err(format!("its coordinate system is `{other}`; expected RAS or LPS")),
    }
}

/// Parses an `.fcsv` file: comments, of which one names the coordinate system, and rows `id,x,y,z,...`.
fn parse_fcsv(text: &str) -> std::result::Result<Vec<DVec3>, String> {
    let mut header = text.lines().take_while(|line| line.starts_with('#'));
    let system = header.find_map(|line| line.strip_prefix("# CoordinateSystem ="));
    let to_ras = ras_from(system.ok_or("its header names no coordinate system")?.trim())?;
    let mut points = Vec::new();
    let rows = (1..).zip(text.lines()).filter(|(_, row)| !row.trim().is_empty() && !row.starts_with('#'));
    for (line, row) in rows {
        // An id may be quoted.
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(row.as_bytes());
        let columns = reader.records().next().transpose().map_err(|e| e.to_string())?.unwrap_or_default();
        let coordinate = |column: usize| {
            let number = columns.get(column).and_then(|word| word.trim().parse().ok());
            number.filter(|x: &f64| x.abs() < MAX_COORDINATE).ok_or_else(|| {
                format!("line {line} has no finite numbers after its id: expected `id,x,y,z,...`")
            })
        };
        points.push(DVec3::new(coordinate(1)?, coordinate(2)?, coordinate(3)?) * to_ras);
    }
    Ok(points)
}

/// File `.mrk.json` of 3D Slicer.
#[derive(Deserialize)]
struct MarkupsFile {
    markups: Vec<Markup>,
}

/// Points of a node of 3D Slicer: a point list, line, curve, plane or others.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Markup {
    #[serde(default = "default_system")]
    coordinate_system: String,
    #[serde(default = "default_units")]
    coordinate_units: String,
    control_points: Vec<ControlPoint>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct ControlPoint {
    #[serde(default)]
    label: String,
    position: Option<[f64; 3]>,
    position_status: Option<String>,
}

fn default_system() -> String {
    "LPS".into()
}

fn default_units() -> String {
    "mm".into()
}

/// Parses a `.mrk.json` file.
fn parse_markups(text: &str) -> std::result::Result<Vec<DVec3>, String> {
    let file: MarkupsFile =
        serde_json::from_str(text).map_err(|e| format!("it is no point list of 3D Slicer: {e}"))?;
    let mut points = Vec::new();
    for markup in file.markups {
        let to_ras = ras_from(&markup.coordinate_system)?;
        if markup.coordinate_units != "mm" {
            return Err(format!("its unit is `{}`; expected mm", markup.coordinate_units));
        }
        for ControlPoint { label, position, position_status } in markup.control_points {
            let is_defined = position_status.is_none_or(|status| status == "defined");
            let position = position.filter(|position| {
                is_defined && position.iter().all(|coordinate| coordinate.abs() < MAX_COORDINATE)
            });
            let position = position.ok_or_else(|| format!("its point `{label}` has no defined position"))?;
            points.push(DVec3::from_array(position) * to_ras);
        }
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXPECTED: [DVec3; 2] = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-4.0, 5.0, 0.5)];

    fn refusal(text: &str) -> String {
        let error = parse_points(text, "points.txt").unwrap_err();
        assert_eq!(error.exit_status(), 2);
        error.to_string()
    }

    #[test]
    fn points_are_rows_of_three() {
        for text in [
            "\u{feff}1 2 3\n\n-4 5e0 .5\n",
            "# x y z\r\n1, 2,3\r\n-4\t5e0 .5",
            "x,y,z\n1,2,3\n# end\n-4,5,.5",
        ] {
            assert_eq!(parse_points(text, "points.txt").unwrap(), EXPECTED);
        }
        let error = refusal("1 2 3\n1 2");
        assert!(error.contains("points.txt: line 2): 2 numbers where 3"), "{error}");
    }

    #[test]
    fn points_of_fcsv_files_are_ras() {
        let columns = "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID";
        let file = |system: &str, sign: i32| {
            let system = format!("# Markups fiducial file version = 4.11\n# CoordinateSystem = {system}\n");
            format!(
                "{system}{columns}\n\"1,a\",{sign},{},3,0,0,0,1,1,1,0,F-1,,\nb,{},{},.5,0,0,0,1,1,1,0,\"a,b\",,,2,0\n",
                2 * sign,
                -4 * sign,
                5 * sign
            )
        };
        for (system, sign) in [("LPS", -1), ("1", -1), ("RAS", 1), ("0", 1)] {
            assert_eq!(parse_points(&file(system, sign), "points.fcsv").unwrap(), EXPECTED);
        }
        for (text, why) in [
            (file("2", 1), "points.txt): its coordinate system is `2`; expected RAS or LPS"),
            (file("RAS", 1).replace("# CoordinateSystem", "# Coordinates"), "names no coordinate system"),
            (file("RAS", 1).replace("a\",1,2,3", "a\",x,y,z"), "line 4 has no finite numbers after its id"),
            (file("RAS", 1) + "c,1,2\n", "line 6 has no finite numbers after its id"),
        ] {
            let error = refusal(&text);
            assert!(error.contains(why), "{error}");
        }
    }

    #[test]
    fn points_of_markups_are_ras() {
        let file = |system: &str, last: &str| {
            format!(
                r#"{{"@schema": "markups-schema-v1.0.3.json#", "markups": [
                    {{"type": "Fiducial", {system} "controlPoints": [{{"id": "1", "position": [-1, -2.0, 3]}}]}},
                    {{"type": "Line", "coordinateSystem": "RAS", "coordinateUnits": "mm", "controlPoints": [{last}]}}]}}"#
            )
        };
        let last = r#"{"label": "F-2", "position": [-4.0, 5.0, 0.5], "positionStatus": "defined"}"#;
        for system in ["", r#""coordinateSystem": "LPS", "coordinateUnits": "mm","#] {
            assert_eq!(parse_points(&file(system, last), "points.mrk.json").unwrap(), EXPECTED);
        }
        for (text, why) in [
            (file(r#""coordinateSystem": "IJK","#, last), "its coordinate system is `IJK`"),
            (file(r#""coordinateUnits": "m","#, last), "its unit is `m`; expected mm"),
            (file("", &last.replace("\"defined", "\"undefined")), "its point `F-2` has no defined position"),
            (file("", r#"{"label": "F-3"}"#), "its point `F-3` has no defined position"),
            (file("", r#"{"label": "F-4", "position": [1e301, 0, 0]}"#), "its point `F-4` has no defined"),
            (file("", r#"{"position": [1, 2]}"#), "it is no point list of 3D Slicer: invalid length 2"),
            ("{}".into(), "it is no point list of 3D Slicer: missing field `markups`"),
        ] {
            let error = refusal(&text);
            assert!(error.contains(why), "{error}");
        }
    }
}
