//! Texts of the labels beside plot points, and their placement without overlaps.

use crate::measure::table::{Cell, Row};
use crate::report::canvas::{Point, Rect};

/// Returns a short plot label for each comparison-table row: the settings that differ from other rows of its shadow
/// method (numbers as `key=value`, words without key). If none differs, the label is the method's name.
pub fn of_rows(rows: &[Row]) -> Vec<String> {
    let settings = |row: &Row| {
        let map = row.map.map(|map| ("map", map.into()));
        row.settings.iter().cloned().chain(map).collect::<Vec<_>>()
    };
    let settings: Vec<Vec<(&str, Cell)>> = rows.iter().map(settings).collect();
    let differs = |method: &str, pair: &(&str, Cell)| {
        rows.iter().zip(&settings).any(|(r, s)| r.method == method && !s.contains(pair))
    };
    let word = |(key, value): &(&str, Cell)| match value {
        Cell::Text(word) => word.clone(),
        number => format!("{key}={number}"),
    };
    let label = |(row, own): (&Row, &Vec<(&str, Cell)>)| {
        let words: Vec<_> = own.iter().filter(|pair| differs(&row.method, pair)).map(word).collect();
        if words.is_empty() { row.method.clone() } else { words.join(" ") }
    };
    rows.iter().zip(&settings).map(label).collect()
}

/// Label of a plot point before its placement: size of the label and position of the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    pub point: Point,
    pub width: f64,
    pub height: f64,
    /// Whether the label may be so far from its plot point that a leader line must connect them.
    pub far: bool,
}

/// Position of a placed label in a plot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    pub rect: Rect,
    /// Leader line from the plot point to its label; `None` if the label is close to the point.
    pub leader: Option<[Point; 2]>,
}

/// Candidate distances from the rim of a plot marker to its label, points.
const DISTANCES: [f64; 6] = [2.0, 5.0, 10.0, 18.0, 30.0, 45.0];
/// Number of candidate directions from a plot marker to its label, anticlockwise from the right.
const DIRECTIONS: usize = 16;
/// Distance from which a leader line connects a label with its plot point, points.
const LEADER_FROM: f64 = 10.0;
/// Number of passes of the label placement; in each pass every label may move to a better place.
const SWEEPS: usize = 4;
/// Largest fraction of a label's area that other labels or markers may cover; a label covered more is not drawn.
const MOST_COVERED: f64 = 0.08;

/// Places the labels of plot points inside the rectangle `bounds`, with little overlap with each other, with plot
/// markers and with the rectangles `obstacles`. Earlier labels have priority; a label without a free place is `None`.
pub fn place(labels: &[Wanted], radius: f64, obstacles: &[Rect], bounds: Rect) -> Vec<Option<Placed>> {
    let markers: Vec<Rect> = labels.iter().map(|l| Rect::around(l.point, radius, radius)).collect();
    let mut placed: Vec<Option<Placed>> = vec![None; labels.len()];
    let covered = |rect: &Rect, placed: &[Option<Placed>], own: usize| -> f64 {
        let others = placed.iter().enumerate().filter(|(j, _)| *j != own).filter_map(|(_, p)| *p);
        let labels = others.map(|p| p.rect.overlap(rect));
        labels.chain(markers.iter().map(|m| m.overlap(rect))).sum()
    };
    let crossed = |rect: &Rect| obstacles.iter().map(|o| o.overlap(rect)).sum::<f64>();
    let settle = |placed: &mut Vec<Option<Placed>>, dropped: &[bool]| {
        for _ in 0..SWEEPS {
            for (i, &label) in labels.iter().enumerate().filter(|(i, _)| !dropped[*i]) {
                placed[i] = candidates(label, radius)
                    .filter(|(_, c)| bounds.holds(&c.rect) && (label.far || c.leader.is_none()))
                    .map(|(cost, c)| {
                        let over = covered(&c.rect, placed, i) + crossed(&c.rect);
                        (cost + 3.0 * over + crossings(&c, i, &markers, placed), c)
                    })
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .map(|(_, c)| c);
            }
        }
    };
    let mut dropped = vec![false; labels.len()];
    // Drops labels that cover something, the last first; the others then have more space.
    loop {
        settle(&mut placed, &dropped);
        let covers = |i: usize| {
            placed[i].is_some_and(|p: Placed| covered(&p.rect, &placed, i) > MOST_COVERED * p.rect.area())
        };
        let Some(last) = (0..labels.len()).rev().find(|&i| covers(i)) else { return placed };
        dropped[last] = true;
        placed[last] = None;
    }
}

/// Candidate places of a label around its plot point, each with a penalty. Places near the point, and those to the
/// right or above, have smaller penalties.
fn candidates(label: Wanted, radius: f64) -> impl Iterator<Item = (f64, Placed)> {
    let Wanted { point, width, height, .. } = label;
    (0..DISTANCES.len() * DIRECTIONS).map(move |c| {
        let (distance, direction) = (DISTANCES[c / DIRECTIONS], c % DIRECTIONS);
        let angle = std::f64::consts::TAU * direction as f64 / DIRECTIONS as f64;
        let (dx, dy) = (angle.cos(), -angle.sin());
        let reach = radius + distance;
        let rim = Point(point.0 + reach * dx, point.1 + reach * dy);
        // The side or corner of the label that faces the point lies at `rim`.
        let center = Point(rim.0 + 0.5 * width * (2.0 * dx).clamp(-1.0, 1.0), rim.1 + 0.5 * height * dy);
        let rect = Rect::around(center, 0.5 * width, 0.5 * height);
        let leader =
            (distance >= LEADER_FROM).then_some([Point(point.0 + radius * dx, point.1 + radius * dy), rim]);
        let cost = 4.0 * distance + 6.0 * (1.0 - dx) + 2.0 * (1.0 + dy);
        (cost, Placed { rect, leader })
    })
}

/// Penalty for a leader line that crosses markers or other labels of the plot.
fn crossings(candidate: &Placed, own: usize, markers: &[Rect], placed: &[Option<Placed>]) -> f64 {
    let Some([from, to]) = candidate.leader else { return 0.0 };
    let labels = placed.iter().map(|p| p.map(|p| p.rect));
    let all = markers.iter().copied().map(Some).enumerate().chain(labels.enumerate());
    let hits = all.filter(|(j, r)| {
        *j != own
            && r.is_some_and(|r| {
                (0..=8).any(|i| {
                    let t = f64::from(i) / 8.0;
                    r.contains(Point(from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1)))
                })
            })
    });
    60.0 * hits.count() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::defaults::settings_of;

    fn row(method: &str, params: &str, map: u32) -> Row {
        Row { method: method.into(), settings: settings_of(method, params), map: Some(map), ..Row::default() }
    }

    #[test]
    fn labels_say_only_what_differs_within_a_method() {
        let rows = [
            row("rays", "", 512),
            row("dsm", "epsilon=0.06 prefilter=1", 512),
            row("dsm", "epsilon=0.02 prefilter=1", 512),
            row("osm", "layers=8 slicing=uniform", 256),
            row("osm", "layers=8 slicing=density", 512),
        ];
        let expected = ["rays", "epsilon=0.06", "epsilon=0.02", "uniform map=256", "density map=512"];
        assert_eq!(of_rows(&rows), expected);
    }

    const BOUNDS: Rect = Rect { left: 0.0, top: 0.0, right: 500.0, bottom: 400.0 };

    fn wanted(x: f64, y: f64, width: f64) -> Wanted {
        Wanted { point: Point(x, y), width, height: 12.0, far: true }
    }

    fn overlaps(placed: &[Option<Placed>]) -> f64 {
        let rects: Vec<Rect> = placed.iter().flatten().map(|p| p.rect).collect();
        let pairs = rects.iter().enumerate().flat_map(|(i, a)| rects[..i].iter().map(move |b| a.overlap(b)));
        pairs.sum()
    }

    #[test]
    fn labels_keep_clear_of_each_other_and_of_markers() {
        // A crowd in a corner, near two borders.
        let labels: Vec<_> = (0..12)
            .map(|i| (470.0 - 9.0 * f64::from(i % 4), 380.0 - 16.0 * f64::from(i / 4)))
            .map(|(x, y)| wanted(x, y, 70.0))
            .collect();
        let placed = place(&labels, 7.0, &[], BOUNDS);
        assert!(placed.iter().flatten().count() >= 6, "most find a place");
        assert!(placed.iter().flatten().all(|p| BOUNDS.holds(&p.rect)));
        assert!(overlaps(&placed) < 12.0 * MOST_COVERED * 70.0 * 12.0);
        let markers = labels.iter().map(|l| Rect::around(l.point, 7.0, 7.0));
        let covered: f64 =
            markers.flat_map(|m| placed.iter().flatten().map(move |p| p.rect.overlap(&m))).sum();
        assert!(covered < 12.0 * MOST_COVERED * 70.0 * 12.0);
    }

    #[test]
    fn a_lone_label_sits_right_beside_its_point() {
        let placed = place(&[wanted(100.0, 100.0, 60.0)], 7.0, &[], BOUNDS)[0].unwrap();
        assert_eq!(placed.leader, None);
        assert!(placed.rect.left >= 107.0 && placed.rect.left < 112.0, "{placed:?}");
        // An obstacle there, and it goes elsewhere.
        let wall = Rect { left: 108.0, top: 80.0, right: 300.0, bottom: 120.0 };
        let placed = place(&[wanted(100.0, 100.0, 60.0)], 7.0, &[wall], BOUNDS)[0].unwrap();
        assert_eq!(placed.rect.overlap(&wall), 0.0);
        // Where the border is in the way it goes to the other side.
        let placed = place(&[wanted(480.0, 100.0, 60.0)], 7.0, &[], BOUNDS)[0].unwrap();
        assert!(placed.rect.right <= 480.0 + 40.0 && BOUNDS.holds(&placed.rect));
    }

    #[test]
    fn what_cannot_be_placed_is_left_out_and_the_first_stays() {
        let same = wanted(50.0, 10.0, 90.0);
        let tiny = Rect { left: 0.0, top: 0.0, right: 160.0, bottom: 20.0 };
        let placed = place(&[same; 5], 2.0, &[], tiny);
        assert!(placed[0].is_some() && placed.iter().flatten().count() < 5);
    }
}
