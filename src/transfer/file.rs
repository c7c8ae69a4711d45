//! This program's transfer-function files (`transfer_functions/*.json`): name, units, `reference_length_mm`, and
//! control points by non-decreasing scalar value. Each control point has an opacity or an extinction, and a colour
//! `#rrggbb`. Optional points of `gradient_opacity` have a gradient magnitude and a factor.

use super::{ControlPoint, GradientLength, GradientOpacity, Quantity, TransferFunction};
use crate::error::{Error, Result};
use crate::files::color;
use crate::files::input::read_text;
use crate::files::output::write_whole;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Largest scalar value and largest extinction in a transfer-function file. Products of larger numbers with a length
/// overflow 32-bit floats.
const MAX_MAGNITUDE: f64 = 1e30;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    name: String,
    #[serde(default)]
    units: String,
    #[serde(default = "one_mm")]
    reference_length_mm: f64,
    points: Vec<PointEntry>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gradient_opacity: Option<Vec<GradientEntry>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gradient_per: Option<GradientLength>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GradientEntry {
    gradient: f64,
    factor: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PointEntry {
    value: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    opacity: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    extinction: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    color: Option<String>,
}

fn one_mm() -> f64 {
    1.0
}

impl TransferFunction {
    /// Reads a transfer-function file in this program's JSON format.
    ///
    /// # Errors
    /// The file cannot be read, is not JSON, has unknown keys or breaks a rule of the format.
    pub fn read(path: &Path) -> Result<Self> {
        const WHAT: &str = "cannot read transfer function";
        let mut tf = Self::from_json(&read_text(path, WHAT)?)
            .map_err(|why| Error::input(WHAT, path.display(), why))?;
        if tf.name.is_empty() {
            tf.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        }
        Ok(tf)
    }

    /// Writes a transfer-function file in this program's JSON format, completely or not at all. Colours are rounded
    /// to 8 bits per channel.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_whole(path, |file| writeln!(file, "{}", self.to_json()))
    }

    /// Returns the transfer function as the text of a transfer-function file (JSON).
    pub fn to_json(&self) -> String {
        let points = self.points.iter().map(|p| PointEntry {
            value: p.value,
            opacity: (self.quantity == Quantity::Opacity).then_some(p.amount),
            extinction: (self.quantity == Quantity::Extinction).then_some(p.amount),
            color: Some(color::to_hex(p.color)),
        });
        let gradient_opacity = self.gradient_opacity.as_ref();
        let file = File {
            name: self.name.clone(),
            units: self.units.clone(),
            reference_length_mm: self.reference_length_mm,
            points: points.collect(),
            gradient_per: gradient_opacity
                .map(GradientOpacity::length)
                .filter(|per| *per != GradientLength::Mm),
            gradient_opacity: gradient_opacity.map(|opacity| {
                let points = opacity.points().iter();
                points.map(|p| GradientEntry { gradient: p.magnitude, factor: p.factor }).collect()
            }),
        };
        serde_json::to_string_pretty(&file).expect("numbers and strings always serialise")
    }

    /// Parses the text of a transfer-function file (JSON).
    ///
    /// # Errors
    /// The text breaks the file format; the reason is one line.
    pub fn from_json(text: &str) -> Result<Self, String> {
        let file: File = serde_json::from_str(text).map_err(|e| e.to_string())?;
        let length = file.reference_length_mm;
        if !(length > 0.0 && length <= MAX_MAGNITUDE) {
            return Err(format!("`reference_length_mm` must be greater than 0, not {length}"));
        }
        let quantity = match file.points.first() {
            None => return Err("`points` is empty; at least one is needed".into()),
            Some(p) if p.extinction.is_some() => Quantity::Extinction,
            Some(_) => Quantity::Opacity,
        };
        let mut points: Vec<ControlPoint> = Vec::with_capacity(file.points.len());
        for (i, p) in file.points.iter().enumerate() {
            let point = control_point(p, quantity).map_err(|why| format!("`points[{i}]`: {why}"))?;
            let before = points.last().map(|b| b.value);
            if before.is_some_and(|b| b > point.value) {
                let rule = "is less than the one before; points go by non-decreasing value";
                return Err(format!("`points[{i}]`: value {} {rule}", point.value));
            }
            if i >= 2 && points[i - 2].value == point.value {
                let rule = "occurs more than twice; a jump is two points of one value";
                return Err(format!("`points[{i}]`: value {} {rule}", point.value));
            }
            points.push(point);
        }
        let File { name, units, gradient_opacity, gradient_per, .. } = file;
        let tf = Self { name, units, reference_length_mm: length, points, ..Self::new(quantity, &[]) };
        let tf = match gradient_opacity {
            Some(points) => tf.with_gradient_opacity(
                GradientOpacity::new(points.iter().map(|p| (p.gradient, p.factor)))
                    .map_err(|why| format!("`gradient_opacity`: {why}"))?
                    .per(gradient_per.unwrap_or_default()),
            ),
            None if gradient_per.is_some() => return Err("`gradient_per` without `gradient_opacity`".into()),
            None => tf,
        };
        let largest = tf.max_extinction(f64::NEG_INFINITY, f64::INFINITY);
        if largest > MAX_MAGNITUDE {
            return Err(format!("an extinction of {largest:.3e} per mm is too large for 32-bit arithmetic"));
        }
        Ok(tf)
    }
}

fn control_point(p: &PointEntry, quantity: Quantity) -> Result<ControlPoint, String> {
    if p.value.abs() > MAX_MAGNITUDE {
        return Err(format!("`value` {:e} is too large for 32-bit arithmetic", p.value));
    }
    let (amount, given) = match (p.opacity, p.extinction) {
        (Some(opacity), None) => (opacity, Quantity::Opacity),
        (None, Some(extinction)) => (extinction, Quantity::Extinction),
        (Some(_), Some(_)) => return Err("gives both `opacity` and `extinction`; one is wanted".into()),
        (None, None) => return Err("gives neither `opacity` nor `extinction`".into()),
    };
    if given != quantity {
        let kinds = format!("gives `{given:?}` where the points before give `{quantity:?}`").to_lowercase();
        return Err(format!("{kinds}; one kind a file"));
    }
    if given == Quantity::Opacity && !(0.0..=1.0).contains(&amount) {
        return Err(format!("`opacity` must be in [0, 1], not {amount}"));
    }
    if amount < 0.0 {
        return Err(format!("`extinction` must not be negative, as {amount} is"));
    }
    let color = p.color.as_deref().map_or(Ok([1.0; 3]), color::parse_hex)?;
    Ok(ControlPoint { value: p.value, amount, color })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::MAX_OPACITY;

    fn refusal(json: &str) -> String {
        TransferFunction::from_json(json).expect_err(json)
    }

    #[test]
    fn the_documented_example_is_read() {
        let tf = TransferFunction::from_json(
            r##"{"name": "CT bone", "units": "HU", "reference_length_mm": 2.0,
                "points": [{"value": 150, "opacity": 0.0, "color": "#d0b090"},
                           {"value": 600, "opacity": 0.6}]}"##,
        )
        .unwrap();
        assert_eq!((tf.name.as_str(), tf.units.as_str(), tf.quantity), ("CT bone", "HU", Quantity::Opacity));
        assert_eq!(tf.points[1].color, [1.0; 3], "white where no colour is given");
        assert!((tf.extinction(600.0) - -(0.4_f64.ln()) / 2.0).abs() < 1e-15);
    }

    #[test]
    fn writing_and_reading_give_the_same() {
        for json in [
            r##"{"name":"a","units":"HU","reference_length_mm":0.1,"points":[
                {"value":-0.1,"opacity":0.3,"color":"#010203"},{"value":7,"opacity":1}, {"value":7,"opacity":0.25}]}"##,
            r##"{"name":"b","units":"1/mm","points":[{"value":0,"extinction":1e-7,"color":"#fedcba"}]}"##,
            r#"{"points":[{"value":0,"opacity":1}],
                "gradient_opacity":[{"gradient":0,"factor":0.1},{"gradient":12.5,"factor":1}]}"#,
            r#"{"points":[{"value":0,"opacity":1}],"gradient_per":"voxel",
                "gradient_opacity":[{"gradient":5,"factor":0.5}]}"#,
        ] {
            let tf = TransferFunction::from_json(json).unwrap();
            assert_eq!(TransferFunction::from_json(&tf.to_json()).unwrap(), tf);
        }
    }

    #[test]
    fn each_broken_rule_is_named() {
        for (json, expected) in [
            (r#"{"points": []}"#, "`points` is empty"),
            (r#"{"name": "x"}"#, "missing field `points`"),
            (r#"{"points": [{"value": 1, "opacity": 0.5, "alpha": 1}]}"#, "unknown field `alpha`"),
            (r#"{"points": [{"value": 1, "opacity": 0.5}], "colour": 1}"#, "unknown field `colour`"),
            (r#"{"points": [{"opacity": 0.5}]}"#, "missing field `value`"),
            (r#"{"points": [{"value": 1}]}"#, "`points[0]`: gives neither"),
            (r#"{"points": [{"value": 1, "opacity": 0.1, "extinction": 1}]}"#, "`points[0]`: gives both"),
            (
                r#"{"points": [{"value": 1, "opacity": 0.1}, {"value": 2, "extinction": 1}]}"#,
                "`points[1]`: gives `extinction`",
            ),
            (
                r#"{"points": [{"value": 1, "extinction": 0.1}, {"value": 2, "opacity": 1}]}"#,
                "`points[1]`: gives `opacity`",
            ),
            (r#"{"points": [{"value": 1, "opacity": 1.5}]}"#, "must be in [0, 1], not 1.5"),
            (r#"{"points": [{"value": 1, "opacity": -0.1}]}"#, "must be in [0, 1], not -0.1"),
            (r#"{"points": [{"value": 1, "extinction": -2}]}"#, "must not be negative"),
            (
                r#"{"points": [{"value": 2, "opacity": 0}, {"value": 1, "opacity": 0}]}"#,
                "`points[1]`: value 1 is less",
            ),
            (
                r#"{"points": [{"value": 1, "opacity": 0}, {"value": 1, "opacity": 1}, {"value": 1, "opacity": 0}]}"#,
                "more than twice",
            ),
            (
                r#"{"reference_length_mm": 0, "points": [{"value": 1, "opacity": 0}]}"#,
                "`reference_length_mm` must be greater",
            ),
            (
                r#"{"reference_length_mm": -1, "points": [{"value": 1, "opacity": 0}]}"#,
                "`reference_length_mm` must be greater",
            ),
            (
                r#"{"reference_length_mm": 1e-40, "points": [{"value": 1, "opacity": 1}]}"#,
                "too large for 32-bit",
            ),
            (
                r##"{"points": [{"value": 1, "opacity": 0, "color": "red"}]}"##,
                "`points[0]`: `red` is not a colour",
            ),
            (
                r#"{"points": [{"value": 1, "opacity": 0}], "gradient_opacity": []}"#,
                "`gradient_opacity`: it has no points",
            ),
            (
                r#"{"points": [{"value": 1, "opacity": 0}], "gradient_opacity": [{"gradient": 1, "factor": 2}]}"#,
                "`gradient_opacity`: a factor must be in [0, 1], not 2",
            ),
            (
                r#"{"points": [{"value": 1, "opacity": 0}], "gradient_opacity": [{"gradient": 1}]}"#,
                "missing field `factor`",
            ),
            (r#"{"points": [{"value": 1, "opacity": 0}], "gradient_per": "mm"}"#, "`gradient_per` without"),
            (r#"{"points": [{"value": 1, "opacity": 0}], "gradient_per": "inch"}"#, "unknown variant `inch`"),
            (r#"{"points": [{"value": 1e999, "opacity": 0}]}"#, "out of range"),
            (r#"{"points": [{"value": 1e200, "opacity": 0}]}"#, "too large"),
            (r#"{"points": [{"value": NaN, "opacity": 0}]}"#, "expected value"),
            (r#"{"points": [{"value": "1", "opacity": 0}]}"#, "invalid type: string"),
            (r#"{"points": [{"value": 1, "value": 2, "opacity": 0}]}"#, "duplicate field `value`"),
            (r#"{"points": [{"value": 1, "opacity": 0}]} x"#, "trailing characters"),
            ("", "EOF"),
            ("[]", "invalid"),
        ] {
            let why = refusal(json);
            assert!(why.contains(expected) && !why.contains('\n'), "{json}\n gave: {why}");
        }
    }

    #[test]
    fn full_opacity_has_the_largest_extinction() {
        let tf = TransferFunction::from_json(r#"{"points": [{"value": 0, "opacity": 1}]}"#).unwrap();
        assert_eq!(tf.extinction(5.0), -(-MAX_OPACITY).ln_1p());
        assert!((tf.extinction(5.0) - 24.0 * std::f64::consts::LN_2).abs() < 1e-12);
    }
}
