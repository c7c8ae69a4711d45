//! Colour and marker of each shadow method, equal in all plots.

use crate::measure::defaults::style;
use crate::report::canvas::{Drawing, Point, Rgb, WHITE};
use crate::shadow::{METHODS, Marker, Style};
use itertools::Itertools as _;

/// Radius of a plot marker, points.
pub const MARKER: f64 = 5.5;

/// Plot styles for shadow methods that define no style of their own.
const OTHERS: [Style; 2] = [
    Style { color: [86, 180, 233], marker: Marker::Down },
    Style { color: [110, 110, 110], marker: Marker::Plus },
];

/// Name, plot colour and plot marker of a shadow method.
pub struct Family {
    pub name: String,
    pub color: Rgb,
    pub marker: Marker,
}

/// Returns the plot style of each distinct shadow method, in the order of the registry [`METHODS`]; unregistered
/// methods follow in order of appearance.
pub fn families<'a>(methods: impl Iterator<Item = &'a str>) -> Vec<Family> {
    let mut names: Vec<&str> = methods.unique().collect();
    names.sort_by_key(|name| METHODS.iter().position(|e| e.name == *name).unwrap_or(METHODS.len()));
    let mut others = OTHERS.into_iter().cycle();
    let family = |name: &str| {
        let Style { color, marker } = style(name).or_else(|| others.next()).unwrap_or(OTHERS[0]);
        Family { name: name.into(), color, marker }
    };
    names.into_iter().map(family).collect()
}

/// Dash patterns (dash and gap lengths, points) that distinguish the curves of one shadow method with several
/// settings. The first is a solid line.
pub const DASHES: [Option<[f64; 2]>; 4] = [None, Some([9.0, 4.0]), Some([2.0, 3.0]), Some([5.0, 2.5])];

/// Draws a plot marker: a filled shape with a white rim, or two crossed strokes over white ones.
pub fn marker(drawing: &mut Drawing, at: Point, marker: Marker, color: Rgb) {
    let r = MARKER;
    let corners = |r: f64| -> Vec<Point> {
        let around = |n: usize, turn: f64, radii: [f64; 2]| {
            (0..n)
                .map(|i| {
                    let angle = turn + std::f64::consts::TAU * i as f64 / n as f64;
                    let radius = radii[i % 2];
                    Point(at.0 + radius * angle.sin(), at.1 - radius * angle.cos())
                })
                .collect()
        };
        let (half, third) = (std::f64::consts::FRAC_PI_4, std::f64::consts::PI);
        match marker {
            Marker::Square => around(4, half, [1.25 * r; 2]),
            Marker::Diamond => around(4, 0.0, [1.35 * r; 2]),
            Marker::Up => around(3, 0.0, [1.3 * r; 2]),
            Marker::Down => around(3, third, [1.3 * r; 2]),
            Marker::Left => around(3, -2.0 * half, [1.3 * r; 2]),
            Marker::Right => around(3, 2.0 * half, [1.3 * r; 2]),
            Marker::Pentagon => around(5, 0.0, [1.2 * r; 2]),
            Marker::Hexagon => around(6, 0.0, [1.2 * r; 2]),
            Marker::Triad => around(6, 0.0, [1.6 * r, 0.45 * r]),
            Marker::Spark => around(8, 0.0, [1.6 * r, 0.6 * r]),
            Marker::Star => around(10, 0.0, [1.5 * r, 0.62 * r]),
            Marker::Circle => around(40, 0.0, [r; 2]),
            Marker::Cross | Marker::Plus => Vec::new(),
        }
    };
    let strokes: &[[f64; 2]] = match marker {
        Marker::Cross => &[[0.8, 0.8], [0.8, -0.8]],
        Marker::Plus => &[[1.1, 0.0], [0.0, 1.1]],
        _ => {
            drawing.polygon(&corners(r + 1.4), WHITE);
            drawing.polygon(&corners(r), color);
            return;
        }
    };
    for (width, color) in [(5.0, WHITE), (2.6, color)] {
        for [dx, dy] in strokes.iter().map(|s| s.map(|d| d * r)) {
            drawing.line(&[Point(at.0 - dx, at.1 - dy), Point(at.0 + dx, at.1 + dy)], width, color);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_keep_their_style_whatever_else_is_drawn() {
        let named = |names: &[&'static str]| {
            families(names.iter().copied())
                .into_iter()
                .map(|f| (f.name, f.color, f.marker))
                .collect::<Vec<_>>()
        };
        let all = named(&["bom", "mine", "dsm", "none", "dsm"]);
        assert_eq!(all.iter().map(|f| f.0.as_str()).collect::<Vec<_>>(), ["none", "dsm", "bom", "mine"]);
        assert_eq!(named(&["dsm"])[0], all[1]);
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a.1 != b.1 && a.2 != b.2), "{a:?} looks like another");
        }
    }
}
