//! Reader of the polylines of Wavefront OBJ files (their `l` elements).
//!
//! `v x y z` is a point. `l a b c ...` is a polyline through the points with these indices. Positive indices count
//! from 1; negative ones count backwards from the last point. In `a/t` the texture coordinate is ignored, and so are
//! all other elements. Coordinates are world mm, RAS+.
//!
//! The `tobj` crate is not used: it rounds coordinates with its own parser of floats, and splits polylines into pairs
//! of points.

use super::input::{in_file, in_line};
use super::lines::Polylines;
use crate::error::Result;
use glam::DVec3;

/// Parses the polylines (`l` elements) of a Wavefront OBJ file.
///
/// # Errors
/// A line is malformed, a polyline names a missing point, or there are no polylines.
pub(super) fn parse(bytes: &[u8]) -> Result<Polylines> {
    let mut lines = Polylines::in_space_of(bytes);
    let mut points: Vec<DVec3> = Vec::new();
    let (mut joined, mut begun) = (String::new(), 1);
    for (place, line) in bytes.split(|b| *b == b'\n').enumerate() {
        let text = String::from_utf8_lossy(line);
        let text = text.trim();
        // A line continues after a backslash.
        if let Some(part) = text.strip_suffix('\\') {
            joined += part;
            joined.push(' ');
            continue;
        }
        joined += text;
        element(&joined, &mut points, &mut lines).map_err(|why| in_line(begun, why))?;
        joined.clear();
        begun = place + 2;
    }
    element(&joined, &mut points, &mut lines).map_err(|why| in_line(begun, why))?;
    match lines.count() {
        0 => Err(in_file("it has no polylines (elements `l`)")
            .hint("faces are an opaque thing in a volume: --mesh FILE.obj")),
        _ => Ok(lines),
    }
}

fn element(text: &str, points: &mut Vec<DVec3>, lines: &mut Polylines) -> Result<(), String> {
    let mut words = text.split_ascii_whitespace();
    match words.next() {
        Some("v") => {
            let mut number = || {
                let word = words.next().ok_or("a point has three coordinates")?;
                word.parse().map_err(|_| format!("`{word}` is not a number"))
            };
            points.push(DVec3::new(number()?, number()?, number()?));
        }
        Some("l") => {
            for word in words {
                let number = word.split('/').next().unwrap_or(word);
                let place = match number.parse::<isize>() {
                    Ok(n) if n > 0 => Some(n as usize - 1),
                    Ok(n) if n < 0 => points.len().checked_sub(n.unsigned_abs()),
                    _ => return Err(format!("`{word}` is no number of a point")),
                };
                let point = place.and_then(|p| points.get(p));
                lines.point(*point.ok_or_else(|| {
                    format!("a polyline goes through point {number} of {}", points.len())
                })?)?;
            }
            lines.end();
        }
        _ => {}
    }
    Ok(())
}
