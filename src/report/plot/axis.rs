//! Plot axes with tick marks, for linear and logarithmic scales.

use super::page::{GRID, SMALL, TEXT};
use crate::report::canvas::{Anchor, BLACK, Drawing, INK, Point, Rect, text_width};

/// Plot axis that maps values from `low` to `high` to page positions from `from` to `to`. On a logarithmic axis,
/// `low` and `high` are base-10 logarithms.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    pub low: f64,
    pub high: f64,
    from: f64,
    to: f64,
    logarithmic: bool,
    pub ticks: Vec<Tick>,
}

/// Notation of the numbers at the ticks of a logarithmic axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Notation {
    /// Decimal numbers at the ticks of a logarithmic axis, or powers of ten if a decimal number would be long.
    Plain,
    /// Powers of ten at all labelled ticks of a logarithmic axis.
    Powers,
}

/// Tick mark on a plot axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    pub value: f64,
    /// Label of a tick mark: a text and an optional exponent drawn as a superscript. `None` for a minor tick.
    pub label: Option<(String, Option<i32>)>,
}

impl Axis {
    /// Creates a logarithmic axis for positive values, with a margin at both ends; it spans at least a factor of 8.
    pub fn log(values: impl Iterator<Item = f64>, from: f64, to: f64, notation: Notation) -> Self {
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v.log10()), h.max(v.log10())));
        // Without values, the axis shows an arbitrary decade.
        let (low, high) = if low <= high { (low, high) } else { (-1.0, 0.0) };
        let air = (0.07 * (high - low)).max(0.5 * (8_f64.log10() - (high - low)));
        let (low, high) = (low - air, high + air);
        Self { low, high, from, to, logarithmic: true, ticks: log_ticks(low, high, notation) }
    }

    /// Creates a linear axis with at most `most` ticks; `low` must be less than `high`, both finite.
    pub fn linear([low, high]: [f64; 2], from: f64, to: f64, most: usize) -> Self {
        Self { low, high, from, to, logarithmic: false, ticks: linear_ticks(low, high, most) }
    }

    /// Returns the position of a value along a plot axis, in page coordinates (points).
    pub fn place(&self, value: f64) -> f64 {
        let value = if self.logarithmic { value.log10() } else { value };
        self.from + (self.to - self.from) * (value - self.low) / (self.high - self.low)
    }
}

/// Ticks of a logarithmic axis, labelled at powers of ten. Very long axes have fewer labels; short axes have more,
/// for example at 2 and 5.
fn log_ticks(low: f64, high: f64, notation: Notation) -> Vec<Tick> {
    let span = high - low;
    let labelled: &[i32] = match span {
        s if s < 1.0 => &[1, 2, 3, 5, 7],
        s if s < 2.2 => &[1, 2, 5],
        _ => &[1],
    };
    let stride = (span / 7.0).ceil().max(1.0) as i32;
    let mut ticks: Vec<(i32, i32)> = Vec::new();
    for exponent in low.floor() as i32..=high.ceil() as i32 {
        ticks.extend((1..10).map(|mantissa| (mantissa, exponent)));
    }
    ticks.retain(|&(m, e)| {
        let at = f64::from(m).log10() + f64::from(e);
        (low..=high).contains(&at)
    });
    let has_label = |m: i32, e: i32| labelled.contains(&m) && e % stride == 0;
    // All labels of one axis use one notation.
    let plain = notation == Notation::Plain
        && ticks.iter().filter(|(m, e)| has_label(*m, *e)).all(|(_, e)| (-2..=4).contains(e));
    ticks
        .into_iter()
        .map(|(m, e)| Tick {
            value: f64::from(m) * 10_f64.powi(e),
            label: has_label(m, e).then(|| match (plain, m) {
                (true, _) => (format!("{:.*}", (-e).max(0) as usize, f64::from(m) * 10_f64.powi(e)), None),
                (false, 1) => ("10".into(), Some(e)),
                (false, _) => (format!("{m} × 10"), Some(e)),
            }),
        })
        .collect()
}

/// Ticks of a linear axis at multiples of 1, 2 or 5 times a power of ten, all labelled with equally many digits.
fn linear_ticks(low: f64, high: f64, most: usize) -> Vec<Tick> {
    let span = high - low;
    let steps = (-300..=300).flat_map(|e| [1.0, 2.0, 5.0].map(|m| (m, e)));
    let step = steps.map(|(m, e)| (m * 10_f64.powi(e), e)).find(|(s, _)| span / s < most as f64);
    let Some((step, exponent)) = step else { return Vec::new() };
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    let label = |value: f64| match exponent {
        -4..=5 => format!("{value:.*}", (-exponent).max(0) as usize),
        _ => format!("{value:.0e}"),
    };
    // Integer multiples of the step, so that 0 is exact.
    let tick = |i: i64| Tick { value: i as f64 * step, label: Some((label(i as f64 * step), None)) };
    (first..=last).map(tick).collect()
}

/// Draws the frame of a plot with grid lines, ticks, tick labels and the titles of both axes. A horizontal axis
/// without a title has no tick labels.
pub fn draw_axes(drawing: &mut Drawing, frame: Rect, [x, y]: [&Axis; 2], [x_title, y_title]: [&str; 2]) {
    let Rect { left, top, right, .. } = frame;
    let length = |tick: &Tick| if tick.label.is_some() { 7.0 } else { 4.0 };
    for tick in &x.ticks {
        let at = x.place(tick.value);
        if let Some((base, power)) = &tick.label {
            drawing.line(&[Point(at, top), Point(at, frame.bottom)], 0.8, GRID);
            if !x_title.is_empty() {
                tick_label(drawing, Point(at, frame.bottom + 18.0), Anchor::Middle, base, *power);
            }
        }
        drawing.line(&[Point(at, frame.bottom), Point(at, frame.bottom - length(tick))], 1.0, INK);
    }
    for tick in &y.ticks {
        let at = y.place(tick.value);
        if let Some((base, power)) = &tick.label {
            drawing.line(&[Point(left, at), Point(right, at)], 0.8, GRID);
            tick_label(drawing, Point(left - 9.0, at), Anchor::End, base, *power);
        }
        drawing.line(&[Point(left, at), Point(left + length(tick), at)], 1.0, INK);
    }
    drawing.outline(frame, 1.2, INK);
    axis_titles(drawing, frame, [x_title, y_title]);
}

/// Draws the titles of both axes, below and to the left of a plot frame.
pub fn axis_titles(drawing: &mut Drawing, frame: Rect, [x_title, y_title]: [&str; 2]) {
    let Point(x, y) = frame.middle();
    drawing.text(Point(x, frame.bottom + 44.0), Anchor::Middle, TEXT, BLACK, x_title);
    drawing.rotated_text(Point(frame.left - 77.0, y), TEXT, BLACK, y_title);
}

/// Draws the label of a tick mark: `base` with an optional exponent as a superscript. The exponent is a separate
/// text, since SVG has no portable superscript.
pub fn tick_label(drawing: &mut Drawing, at: Point, anchor: Anchor, base: &str, power: Option<i32>) {
    let [base, raised] =
        [base.to_owned(), power.map_or(String::new(), |p| p.to_string())].map(|t| t.replace('-', "−"));
    let raised_size = 0.75 * SMALL;
    let (width, raised_width) = (text_width(&base, SMALL), text_width(&raised, raised_size));
    let left = match anchor {
        Anchor::Start => at.0,
        Anchor::Middle => at.0 - 0.5 * (width + raised_width),
        Anchor::End => at.0 - width - raised_width,
    };
    drawing.text(Point(left, at.1), Anchor::Start, SMALL, INK, &base);
    if !raised.is_empty() {
        drawing.text(Point(left + width + 0.5, at.1 - 5.5), Anchor::Start, raised_size, INK, &raised);
    }
}

#[cfg(test)]
mod tests {
    use super::Notation::{Plain, Powers};
    use super::*;

    fn labels(values: &[f64], notation: Notation) -> Vec<String> {
        let axis = Axis::log(values.iter().copied(), 0.0, 1.0, notation);
        axis.ticks
            .into_iter()
            .filter_map(|t| t.label)
            .map(|(base, power)| power.map_or(base.clone(), |p| format!("{base}^{p}")))
            .collect()
    }

    #[test]
    fn values_lie_inside_in_order_and_decades_are_even() {
        let axis = Axis::log([1e-4, 3.0, 0.02].into_iter(), 100.0, 500.0, Plain);
        let places = [1e-4, 0.02, 3.0].map(|v| axis.place(v));
        assert!(places.is_sorted() && places[0] > 110.0 && places[2] < 490.0, "{places:?}");
        let decade = axis.place(10.0) - axis.place(1.0);
        assert!((axis.place(0.01) - axis.place(0.001) - decade).abs() < 1e-9);
        // Upwards on a page is towards smaller numbers.
        let up = Axis::log([1.0, 10.0].into_iter(), 500.0, 100.0, Plain);
        assert!(up.place(10.0) < up.place(1.0));
    }

    #[test]
    fn ticks_suit_the_span() {
        assert_eq!(labels(&[80.0, 1500.0], Plain), ["100", "200", "500", "1000"]);
        assert_eq!(labels(&[0.3, 20_000.0], Plain), ["1", "10", "100", "1000", "10000"]);
        assert_eq!(labels(&[1e-5, 0.5], Plain), ["10^-5", "10^-4", "10^-3", "10^-2", "10^-1", "10^0"]);
        assert_eq!(
            labels(&[0.0012, 0.0012], Plain),
            ["5 × 10^-4", "7 × 10^-4", "10^-3", "2 × 10^-3", "3 × 10^-3"]
        );
        assert_eq!(labels(&[0.03, 0.8], Powers), ["5 × 10^-2", "10^-1", "2 × 10^-1", "5 × 10^-1", "10^0"]);
        assert_eq!(
            labels(&[1e-12, 1.0], Plain),
            ["10^-12", "10^-10", "10^-8", "10^-6", "10^-4", "10^-2", "10^0"]
        );
    }

    #[test]
    fn linear_ticks_are_round_and_inside() {
        let labels = |low, high| -> Vec<String> {
            let ticks = Axis::linear([low, high], 0.0, 1.0, 6).ticks;
            ticks.into_iter().filter_map(|t| Some(t.label?.0)).collect()
        };
        assert_eq!(labels(0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(-0.03, 0.03), ["-0.02", "0.00", "0.02"]);
        assert_eq!(labels(0.0, 234.5), ["0", "50", "100", "150", "200"]);
        assert_eq!(labels(0.0, 3e-7), ["0e0", "1e-7", "2e-7", "3e-7"]);
        let axis = Axis::linear([2.0, 4.0], 100.0, 50.0, 6);
        assert_eq!((axis.place(2.0), axis.place(3.0), axis.place(4.0)), (100.0, 75.0, 50.0));
    }

    #[test]
    fn any_values_give_a_usable_axis() {
        for values in [&[][..], &[5.0], &[1e-300, 1e300], &[4.0, 4.000_000_1]] {
            let axis = Axis::log(values.iter().copied(), 0.0, 1.0, Plain);
            let named = axis.ticks.iter().filter(|t| t.label.is_some()).count();
            assert!((1..=9).contains(&named), "{values:?}: {named}");
            assert!(values.iter().all(|v| (0.0..=1.0).contains(&axis.place(*v))), "{values:?}");
        }
    }
}
