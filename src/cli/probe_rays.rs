//! `umbravox probe --rays`: exact optical depth and transmittance of line segments.

use crate::error::{Error, Result};
use crate::exact::ExactField;
use glam::DVec3;
use std::fmt::Write;

const WHAT: &str = "cannot read rays";

/// Computes the exact optical depth of the segments in `text`, one `x0 y0 z0 x1 y1 z1` (world mm) per line. Returns
/// one line `optical_depth transmittance` per segment, with 17 significant digits. Blank lines are ignored.
///
/// `place` names the file in errors.
///
/// # Errors
/// A line that is not six finite numbers; the error names the line number.
pub fn probe_rays(field: &ExactField, text: &str, place: &str) -> Result<String> {
    let segments = parse_segments(text, place)?;
    let mut answers = String::new();
    for optical_depth in field.optical_depths(&segments) {
        // Writing to a string cannot fail.
        let _ = writeln!(answers, "{optical_depth:.16e} {:.16e}", (-optical_depth).exp());
    }
    Ok(answers)
}

/// Parses the segments of a `--rays` file, world mm.
///
/// # Errors
/// See [`probe_rays`].
pub fn parse_segments(text: &str, place: &str) -> Result<Vec<(DVec3, DVec3)>> {
    let rows = parse_rows(text, WHAT, place, "a line is `x0 y0 z0 x1 y1 z1`, world mm")?;
    Ok(rows.into_iter().map(|[a, b, c, d, e, f]| (DVec3::new(a, b, c), DVec3::new(d, e, f))).collect())
}

/// Limit on the magnitude of input coordinates. Beyond it, the length of a segment could overflow.
pub(super) const MAX_COORDINATE: f64 = 1e300;

/// Words of a line of an input file, separated by commas if there are any, otherwise by white space.
fn words(line: &str) -> Vec<&str> {
    match line.contains(',') {
        true => line.split(',').map(str::trim).collect(),
        false => line.split_whitespace().collect(),
    }
}

/// Parses lines of `N` numbers separated by white space or commas, from an input file of `probe`. Blank lines, lines that
/// begin with `#`, and a first line of `N` names are ignored.
pub(super) fn parse_rows<const N: usize>(
    text: &str,
    what: &str,
    place: &str,
    hint: &str,
) -> Result<Vec<[f64; N]>> {
    let is_name = |word: &&str| {
        word.parse::<f64>().is_err() && word.starts_with(|c: char| c.is_alphabetic() || c == '"')
    };
    let is_header = |content: &str| words(content).iter().filter(|word| is_name(word)).count() == N;
    let lines = (1..).zip(text.lines().map(str::trim));
    let lines = lines.filter(|(_, content)| !content.is_empty() && !content.starts_with('#'));
    let lines =
        lines.enumerate().filter(|(n, (_, content))| *n > 0 || !is_header(content)).map(|(_, line)| line);
    let row = |(line, content): (usize, &str)| {
        let refuse = |why: String| Error::input(what, format!("{place}: line {line}"), why).hint(hint);
        let number = |word: &str| {
            let known = word.parse().ok().filter(|x: &f64| x.abs() < MAX_COORDINATE);
            known.ok_or_else(|| refuse(format!("`{word}` is not a finite number below 1e300")))
        };
        let numbers = words(content).into_iter().map(number).collect::<Result<Vec<_>>>()?;
        let wrong = |numbers: Vec<f64>| refuse(format!("{} numbers where {N} are expected", numbers.len()));
        <[f64; N]>::try_from(numbers).map_err(wrong)
    };
    lines.map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::{Quantity, TransferFunction};
    use crate::volume::{Provenance, Scaling, Volume, Voxels};
    use glam::DAffine3;
    use ndarray::Array3;

    #[test]
    fn answers_line_by_line() {
        let provenance = Provenance::new("test", "phantom", "uint8");
        let voxels = Voxels::U8(Array3::from_elem((4, 4, 4), 7));
        let volume = Volume::new(voxels, Scaling::IDENTITY, DAffine3::IDENTITY, provenance).unwrap();
        let tf = TransferFunction::new(Quantity::Extinction, &[(0.0, 0.25)]);
        let field = ExactField::new(&volume, &tf);
        let answers =
            probe_rays(&field, "-9 1 1 9 1 1\n\n 1 1 1\t1 1 1 \r\n9 9 9 10 10 10", "rays.txt").unwrap();
        let numbers: Vec<Vec<f64>> =
            answers.lines().map(|l| l.split(' ').map(|w| w.parse().unwrap()).collect()).collect();
        assert_eq!(numbers, [[1.0, (-1f64).exp()], [0.0, 1.0], [0.0, 1.0]]);
        assert!(answers.starts_with("1.0000000000000000e0 3.67879441171442"), "{answers}");
    }

    #[test]
    fn refuses_by_line_number() {
        for (text, why) in [
            ("0 0 0 1 1 1\n0 0 NaN 1 1 1", "rays.txt: line 2): `NaN` is not a finite number"),
            ("\n0 0 -inf 1 1 1", "rays.txt: line 2): `-inf` is not a finite number"),
            ("0 0 1e999 1 1 1", "rays.txt: line 1): `1e999` is not a finite number"),
            ("0 0 1 1 1", "rays.txt: line 1): 5 numbers"),
            ("0 0 1 1 1 2 3", "rays.txt: line 1): 7 numbers"),
            ("0;0;1;1;1;2", "rays.txt: line 1): `0;0;1;1;1;2` is not a finite number"),
            ("0,,1,1,1,2", "rays.txt: line 1): `` is not a finite number"),
            ("a b c d e\n0 0 1 1 1 1", "rays.txt: line 1): `a` is not a finite number"),
            ("a b c d e f\n0 0 x 1 1 1", "rays.txt: line 2): `x` is not a finite number"),
            ("0 0 1 1 1 1\na b c d e f", "rays.txt: line 2): `a` is not a finite number"),
            ("-1e308 0 0 1e308 0 0", "rays.txt: line 1): `-1e308` is not a finite number"),
        ] {
            let error = parse_segments(text, "rays.txt").unwrap_err();
            assert_eq!(error.exit_status(), 2);
            assert!(error.to_string().contains(why), "{error}");
        }
    }
}
