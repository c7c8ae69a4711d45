//! Transfer functions that differ by label: what a segmentation tells apart is hidden, or seen through another function.

use super::{ControlPoint, LabelRule, Seen, TransferFunction};

/// Functions beside the first that labels may have at the most: all of them share the bins of one set of tables.
pub const MOST_LABEL_FUNCTIONS: usize = 15;
/// Room between two functions on the axis of values that they share, as a share of the range of values: more than a bin of
/// the tables.
const ROOM: f64 = 1.0 / 32.0;
/// Width of the range of values at the least, as a share of the largest of them.
const LEAST_WIDTH: f64 = 1.0 / 1024.0;

/// What the voxels of a label are seen through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Nothing: they have no extinction.
    Hidden,
    /// An element of [`TransferFunction::functions`].
    Function(usize),
}

/// Several functions one after another on one axis of values, so that one set of tables holds all of them.
#[derive(Debug, Clone, PartialEq)]
pub struct SideBySide {
    /// All of them; without extinction between and behind them.
    pub function: TransferFunction,
    /// What is added to a value for each element of [`TransferFunction::functions`].
    pub shifts: Vec<f64>,
    /// A value behind all of them.
    pub hidden: f64,
}

impl TransferFunction {
    /// How a label's voxels are seen: hidden where any rule hides it, else by the last rule for it, else as all others.
    pub fn class_of(&self, label: u32) -> Class {
        let mut class = Class::Function(0);
        let mut function = 0;
        for rule in &self.rules {
            let is_for = rule.labels.contains(&label);
            match rule.seen {
                Seen::Hidden if is_for => return Class::Hidden,
                Seen::Hidden => {}
                Seen::Through(_) => {
                    function += 1;
                    if is_for {
                        class = Class::Function(function);
                    }
                }
            }
        }
        class
    }

    /// The function itself, and those of its rules in their order.
    pub fn functions(&self) -> Vec<&Self> {
        let others = self.rules.iter().filter_map(|rule| match &rule.seen {
            Seen::Through(tf) => Some(&**tf),
            Seen::Hidden => None,
        });
        std::iter::once(self).chain(others).collect()
    }

    /// An element of [`Self::functions`].
    pub fn function(&self, index: usize) -> &Self {
        let others = self.rules.iter().filter_map(|rule| match &rule.seen {
            Seen::Through(tf) => Some(&**tf),
            Seen::Hidden => None,
        });
        std::iter::once(self).chain(others).nth(index).unwrap_or(self)
    }

    /// The same with every function in it changed, its own rules kept.
    pub(super) fn with_each(&self, change: impl Fn(&Self) -> Self) -> Vec<LabelRule> {
        let of_rule = |rule: &LabelRule| match &rule.seen {
            Seen::Hidden => rule.clone(),
            Seen::Through(tf) => LabelRule { seen: Seen::Through(Box::new(change(tf))), ..rule.clone() },
        };
        self.rules.iter().map(of_rule).collect()
    }

    /// All functions on one axis, for a volume whose values lie in `[low, high]`.
    ///
    /// # Errors
    /// Functions of different quantities or reference lengths, or too many.
    pub fn side_by_side(&self, [low, high]: [f64; 2]) -> Result<SideBySide, String> {
        let functions = self.functions();
        let others = functions.len() - 1;
        if others > MOST_LABEL_FUNCTIONS {
            return Err(format!(
                "{others} functions of labels, at most {MOST_LABEL_FUNCTIONS} fit beside each other"
            ));
        }
        let alike =
            |tf: &&Self| tf.quantity == self.quantity && tf.reference_length_mm == self.reference_length_mm;
        if let Some(other) = functions.iter().find(|tf| !alike(tf)) {
            let of =
                |tf: &Self| format!("{:?} over {} mm", tf.quantity, tf.reference_length_mm).to_lowercase();
            return Err(format!("one gives {} and the others {}", of(other), of(self)));
        }
        // No narrower than what float32 tells apart beside the values themselves.
        let least = low.abs().max(high.abs()) * LEAST_WIDTH;
        let width = if high - low > least { high - low } else { least };
        let width = if width > 0.0 { width } else { 1.0 };
        let room = ROOM * width;
        let [low, high] = [low - 0.25 * room, high + 0.25 * room];
        let pitch = high - low + room;
        let shifts: Vec<f64> = (0..functions.len()).map(|i| i as f64 * pitch).collect();
        let mut points = Vec::new();
        for (tf, shift) in functions.iter().zip(&shifts) {
            let at = |value: f64| ControlPoint { value, amount: tf.amount(value), color: tf.color(value) };
            let none = |at: ControlPoint| ControlPoint { amount: 0.0, ..at };
            let ends = [at(low), at(high)];
            let inside = tf.points.iter().filter(|p| p.value > low && p.value < high).copied();
            let all = [none(ends[0]), ends[0]].into_iter().chain(inside).chain([ends[1], none(ends[1])]);
            points.extend(all.map(|p| ControlPoint { value: p.value + shift, ..p }));
        }
        let function = Self { points, rules: Vec::new(), ..self.clone() };
        Ok(SideBySide { function, shifts, hidden: high + pitch * others as f64 + 0.5 * room })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Quantity;
    use super::*;

    fn tf(points: &[(f64, f64)]) -> TransferFunction {
        TransferFunction::new(Quantity::Opacity, points)
    }

    fn labelled() -> TransferFunction {
        let through = |points: &[(f64, f64)]| Seen::Through(Box::new(tf(points)));
        TransferFunction {
            rules: vec![
                LabelRule { labels: vec![1, 2], seen: through(&[(0.0, 0.5)]) },
                LabelRule { labels: vec![7], seen: Seen::Hidden },
                LabelRule { labels: vec![2, 7, 9], seen: through(&[(-5.0, 0.0), (3.0, 0.2), (3.0, 0.9)]) },
            ],
            ..tf(&[(-10.0, 0.1), (40.0, 0.6)])
        }
    }

    #[test]
    fn hidden_wins_and_then_the_last_rule() {
        let tf = labelled();
        let classes = [0, 1, 2, 7, 9, 500].map(|label| tf.class_of(label));
        let [f, h] = [Class::Function, |_| Class::Hidden];
        assert_eq!(classes, [f(0), f(1), f(2), h(0), f(2), f(0)]);
    }

    #[test]
    fn side_by_side_every_function_is_what_it_was() {
        let tf = labelled();
        for range in [[-20.0, 50.0], [0.0, 10.0], [4.0, 4.0]] {
            let SideBySide { function, shifts, hidden } = tf.side_by_side(range).unwrap();
            for (one, shift) in tf.functions().into_iter().zip(&shifts) {
                for i in 0..=100 {
                    let value = range[0] + (range[1] - range[0]) * f64::from(i) / 100.0;
                    let (want, got) = (one.amount(value), function.amount(value + shift));
                    assert!(
                        (want - got).abs() < 1e-12
                            || one.points.iter().any(|p| (p.value - value).abs() < 1e-9)
                    );
                }
                let width = if range[1] > range[0] { range[1] - range[0] } else { LEAST_WIDTH * range[0] };
                assert_eq!(function.amount(range[1] + 0.75 * ROOM * width + shift), 0.0);
            }
            assert_eq!(function.amount(hidden), 0.0);
            assert!(function.points.windows(2).all(|w| w[0].value <= w[1].value));
        }
    }

    #[test]
    fn functions_that_do_not_go_together_are_refused() {
        let mut tf = labelled();
        let other = TransferFunction { reference_length_mm: 2.0, ..tf.clone() };
        tf.rules.push(LabelRule { labels: vec![3], seen: Seen::Through(Box::new(other)) });
        assert!(tf.side_by_side([0.0, 1.0]).unwrap_err().contains("over 2 mm"));
        let rule = labelled().rules[0].clone();
        tf.rules = vec![rule; MOST_LABEL_FUNCTIONS + 1];
        assert!(tf.side_by_side([0.0, 1.0]).unwrap_err().contains("at most"));
    }
}
