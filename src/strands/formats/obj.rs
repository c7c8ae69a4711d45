//! Wavefront OBJ: the polylines of its `l` elements.
//!
//! `v x y z` is a point, `l a b c ...` a polyline through points by their numbers, from 1 or, below 0, from the last one
//! backwards; `a/t` names a texture coordinate too, which is passed over, as is everything else. Coordinates are world mm, RAS+.
//!
//! Read here and not by the `tobj` crate, which reads meshes: it keeps coordinates as they come out of its own parser of
//! floats, and turns lines into pairs.

use super::input::Trouble;
use super::lines::Lines;
use glam::DVec3;

/// The polylines of a file.
///
/// # Errors
/// A line that cannot be read, or a polyline through a point that there is not; or there are no polylines.
pub(super) fn parse(bytes: &[u8]) -> Result<Lines, Trouble> {
    let mut lines = Lines::of_space(bytes);
    let mut points: Vec<DVec3> = Vec::new();
    let (mut joined, mut begun) = (String::new(), 0);
    for (place, line) in bytes.split(|b| *b == b'\n').enumerate() {
        let text = String::from_utf8_lossy(line);
        let text = text.trim();
        if joined.is_empty() {
            begun = place + 1;
        }
        // A line goes on behind a backslash.
        if let Some(part) = text.strip_suffix('\\') {
            joined += part;
            joined.push(' ');
            continue;
        }
        joined += text;
        element(&joined, &mut points, &mut lines).map_err(|why| Trouble::in_line(begun, why))?;
        joined.clear();
    }
    element(&joined, &mut points, &mut lines).map_err(|why| Trouble::in_line(begun, why))?;
    match lines.count() {
        0 => Err(Trouble::of_file("it has no polylines (elements `l`)")
            .hint("faces are an opaque thing in a volume: --mesh FILE.obj")),
        _ => Ok(lines),
    }
}

fn element(text: &str, points: &mut Vec<DVec3>, lines: &mut Lines) -> Result<(), String> {
    let mut words = text.split_ascii_whitespace();
    match words.next() {
        Some("v") => {
            let mut number = || {
                let word = words.next().ok_or("a point has three coordinates")?;
                word.parse().map_err(|_| format!("`{word}` is not a number"))
            };
            let [x, y, z] = [number()?, number()?, number()?];
            points.try_reserve(1).map_err(|_| "there is not enough memory for its points")?;
            points.push(DVec3::new(x, y, z));
            Ok(())
        }
        Some("l") => {
            for word in words {
                let number = word.split('/').next().unwrap_or(word);
                let place = match number.parse::<i64>() {
                    Ok(n) if n > 0 => usize::try_from(n - 1).ok(),
                    Ok(n) if n < 0 => {
                        usize::try_from(n.unsigned_abs()).ok().and_then(|n| points.len().checked_sub(n))
                    }
                    _ => return Err(format!("`{word}` is no number of a point")),
                };
                let found = place.and_then(|p| points.get(p));
                let point = *found
                    .ok_or_else(|| format!("a polyline goes through point {number} of {}", points.len()))?;
                lines.point(point)?;
            }
            lines.end()
        }
        _ => Ok(()),
    }
}
