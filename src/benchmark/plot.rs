//! Critical-difference diagram: mean ranks of methods on a line, with bars over methods that do not differ (Demšar 2006).

use super::ranking::{Rank, Ranking};
use crate::report::canvas::{Anchor, Drawing, Point};
use crate::report::number::significant;

const WIDTH: f64 = 455.0;
/// Ends of the axis, points; names of methods stand beside it.
const AXIS: [f64; 2] = [110.0, 345.0];
const AXIS_Y: f64 = 50.0;
const LINE_HEIGHT: f64 = 15.0;
const BAR_GAP: f64 = 6.0;
const FONT_SIZE: f64 = 9.0;
const BLACK: [u8; 3] = [0; 3];
const GREY: [u8; 3] = [110; 3];

/// Draws the mean ranks of the methods within one budget. A bar connects methods whose ranks differ by less than the
/// critical difference.
pub fn critical_difference(ranking: &Ranking) -> Drawing {
    let ranks = &ranking.ranks;
    let bars = bars(ranking);
    let below = AXIS_Y + BAR_GAP * (bars.len() as f64 + 1.0);
    let rows = ranks.len().div_ceil(2);
    let mut drawing = Drawing::new(WIDTH, below + LINE_HEIGHT * (rows as f64 + 0.5));
    let most = ranks.len().max(2) as f64;
    let x = |rank: f64| AXIS[0] + (AXIS[1] - AXIS[0]) * (rank - 1.0) / (most - 1.0);
    draw_axis(&mut drawing, ranking, &x);
    for (i, rank) in ranks.iter().enumerate() {
        // The better half is labelled on the left, from the top; the other half on the right, from the bottom.
        let is_left = i < rows;
        let row = if is_left { i } else { ranks.len() - 1 - i };
        let y = below + LINE_HEIGHT * (row as f64 + 0.5);
        let (end, anchor) =
            if is_left { (AXIS[0] - 8.0, Anchor::End) } else { (AXIS[1] + 8.0, Anchor::Start) };
        let place = x(rank.mean_rank);
        drawing.line(&[Point(place, AXIS_Y), Point(place, y), Point(end, y)], 0.7, BLACK);
        let aside = if is_left { -3.0 } else { 3.0 };
        drawing.text(Point(end + aside, y), anchor, FONT_SIZE, BLACK, &label(rank));
    }
    for (i, [from, to]) in bars.into_iter().enumerate() {
        let y = AXIS_Y + BAR_GAP * (i as f64 + 1.0);
        drawing.line(&[Point(x(from) - 2.0, y), Point(x(to) + 2.0, y)], 2.5, GREY);
    }
    drawing
}

fn label(rank: &Rank) -> String {
    format!("{} {}", rank.method, significant(rank.mean_rank, 3))
}

fn draw_axis(drawing: &mut Drawing, ranking: &Ranking, x: &dyn Fn(f64) -> f64) {
    let most = ranking.ranks.len().max(2);
    drawing.line(&[Point(AXIS[0], AXIS_Y), Point(AXIS[1], AXIS_Y)], 1.0, BLACK);
    for rank in 1..=most {
        let at = x(rank as f64);
        drawing.line(&[Point(at, AXIS_Y - 4.0), Point(at, AXIS_Y)], 1.0, BLACK);
        drawing.text(Point(at, AXIS_Y - 10.0), Anchor::Middle, FONT_SIZE, BLACK, &rank.to_string());
    }
    let title = format!("mean rank by error within {}, {} volumes", ranking.budget, ranking.volumes);
    drawing.text(Point(WIDTH / 2.0, 8.0), Anchor::Middle, FONT_SIZE, BLACK, &title);
    if let Some(difference) = ranking.critical_difference {
        let [from, to] = [1.0, 1.0 + difference].map(x);
        drawing.line(&[Point(from, 24.0), Point(to.min(WIDTH), 24.0)], 1.5, BLACK);
        let text = format!("critical difference {}", significant(difference, 3));
        drawing.text(Point(from - 8.0, 24.0), Anchor::End, FONT_SIZE, BLACK, &text);
    }
}

/// Returns the ranges of mean ranks that bars connect: methods that differ by less than the critical difference. A range
/// within another is left out.
fn bars(ranking: &Ranking) -> Vec<[f64; 2]> {
    let Some(difference) = ranking.critical_difference else { return Vec::new() };
    let ranks: Vec<f64> = ranking.ranks.iter().map(|rank| rank.mean_rank).collect();
    let mut bars: Vec<[f64; 2]> = Vec::new();
    for (i, from) in ranks.iter().enumerate() {
        let last = ranks.iter().rposition(|rank| rank - from < difference).unwrap_or(i);
        if last > i && bars.last().is_none_or(|[_, to]| ranks[last] > *to) {
            bars.push([*from, ranks[last]]);
        }
    }
    bars
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_connect_methods_that_do_not_differ() {
        let rank = |mean_rank: f64| Rank {
            budget: String::new(),
            method: "m".into(),
            cells: 1,
            answered: 1,
            won: 0,
            share: 0.0,
            share_lo: 0.0,
            share_hi: 0.0,
            share_volumes_lo: None,
            share_volumes_hi: None,
            not_separated: 0,
            mean_rank,
            critical_difference: None,
            ratio: None,
        };
        let ranking = |difference| Ranking {
            budget: "bytes=1MiB".into(),
            ranks: [1.2, 2.0, 2.9, 5.0].map(rank).into(),
            critical_difference: difference,
            volumes: 12,
        };
        assert_eq!(bars(&ranking(Some(1.0))), [[1.2, 2.0], [2.0, 2.9]]);
        assert_eq!(bars(&ranking(Some(2.0))), [[1.2, 2.9]]);
        assert!(bars(&ranking(Some(0.5))).is_empty() && bars(&ranking(None)).is_empty());
        assert!(critical_difference(&ranking(Some(1.0))).png().is_ok());
    }
}
