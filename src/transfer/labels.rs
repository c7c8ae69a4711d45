//! Transfer functions for the labels of a segmentation: a label may be hidden, or have its own transfer function.

use super::{ControlPoint, LabelRule, LabelVisibility, TransferFunction};

/// Largest number of transfer functions for segmentation labels, besides the main one. All of them share the bins of
/// one set of device tables.
pub const MOST_LABEL_FUNCTIONS: usize = 15;
/// Gap between neighbouring transfer functions that are combined on one value axis, relative to the volume's value
/// range. It is wider than a bin of the device tables.
const GAP: f64 = 1.0 / 32.0;
/// Smallest width of a volume's value range, relative to its largest absolute value, for which several transfer
/// functions are combined on one value axis. A smaller range is widened.
const LEAST_WIDTH: f64 = 1.0 / 1024.0;

/// Treatment of the voxels of a segmentation label: hidden, or drawn with a transfer function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LabelClass {
    /// Hidden segmentation label: its voxels have no extinction.
    Hidden,
    /// Index of the segmentation label's transfer function in [`TransferFunction::functions`].
    Function(usize),
}

/// Several transfer functions combined on one value axis, each shifted by an offset, so that one set of device tables
/// stores all of them.
#[derive(Debug, Clone, PartialEq)]
pub struct SideBySide {
    /// Combined transfer function, with zero extinction in the gaps between the single functions and after the last.
    pub function: TransferFunction,
    /// Offset for each of [`TransferFunction::functions`], added to a voxel's value to look it up in the combined
    /// transfer function.
    pub shifts: Vec<f64>,
    /// Scalar value that hidden voxels get, above all single transfer functions, where the combined one has zero
    /// extinction.
    pub hidden: f64,
}

impl TransferFunction {
    /// Finds the transfer function for the voxels of a segmentation label. If a rule hides the label, it wins;
    /// otherwise the last rule for the label applies.
    pub fn class_of(&self, label: u32) -> LabelClass {
        let is_hidden = |rule: &LabelRule| rule.visibility == LabelVisibility::Hidden;
        let is_for = |rule: &LabelRule| rule.labels.contains(&label);
        if self.rules.iter().any(|rule| is_for(rule) && is_hidden(rule)) {
            return LabelClass::Hidden;
        }
        let end = self.rules.iter().rposition(is_for).map_or(0, |last| last + 1);
        LabelClass::Function(self.rules[..end].iter().filter(|rule| !is_hidden(rule)).count())
    }

    /// Returns this transfer function, followed by the transfer functions of its rules for segmentation labels.
    pub fn functions(&self) -> impl Iterator<Item = &Self> {
        let others = self.rules.iter().filter_map(|rule| match &rule.visibility {
            LabelVisibility::Visible(tf) => Some(&**tf),
            LabelVisibility::Hidden => None,
        });
        std::iter::once(self).chain(others)
    }

    /// Returns the transfer function at an index of the list [`Self::functions`].
    pub fn function(&self, index: usize) -> &Self {
        self.functions().nth(index).unwrap_or(self)
    }

    /// Returns the rules for segmentation labels after `change` is applied to each of their transfer functions.
    pub(super) fn with_each(&self, change: impl Fn(&Self) -> Self) -> Vec<LabelRule> {
        let mut rules = self.rules.clone();
        for rule in &mut rules {
            if let LabelVisibility::Visible(tf) = &mut rule.visibility {
                **tf = change(tf);
            }
        }
        rules
    }

    /// Combines this transfer function and those of its segmentation labels on one value axis, for a volume with
    /// values in `[low, high]`.
    ///
    /// # Errors
    /// The transfer functions store different quantities, or opacities for different lengths, or there are too many.
    pub fn side_by_side(&self, [low, high]: [f64; 2]) -> Result<SideBySide, String> {
        let functions: Vec<&Self> = self.functions().collect();
        let others = functions.len() - 1;
        if others > MOST_LABEL_FUNCTIONS {
            return Err(format!(
                "{others} functions of labels, at most {MOST_LABEL_FUNCTIONS} fit beside each other"
            ));
        }
        if let Some(other) = functions.iter().find(|tf| !tf.has_quantity_of(self)) {
            let [one, others] = [*other, self]
                .map(|tf| format!("{:?} over {} mm", tf.quantity, tf.reference_length_mm).to_lowercase());
            return Err(format!("one gives {one} and the others {others}"));
        }
        // At least the resolution of float32 at these values.
        let least = low.abs().max(high.abs()) * LEAST_WIDTH;
        let width = if high - low > least { high - low } else { least };
        let width = if width > 0.0 { width } else { 1.0 };
        let gap = GAP * width;
        let [low, high] = [low - 0.25 * gap, high + 0.25 * gap];
        let pitch = high - low + gap;
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
        Ok(SideBySide { function, shifts, hidden: high + pitch * others as f64 + 0.5 * gap })
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
        let through = |points: &[(f64, f64)]| LabelVisibility::Visible(Box::new(tf(points)));
        TransferFunction {
            rules: vec![
                LabelRule { labels: vec![1, 2], visibility: through(&[(0.0, 0.5)]) },
                LabelRule { labels: vec![7], visibility: LabelVisibility::Hidden },
                LabelRule {
                    labels: vec![2, 7, 9],
                    visibility: through(&[(-5.0, 0.0), (3.0, 0.2), (3.0, 0.9)]),
                },
            ],
            ..tf(&[(-10.0, 0.1), (40.0, 0.6)])
        }
    }

    #[test]
    fn hidden_wins_and_then_the_last_rule() {
        let tf = labelled();
        let classes = [0, 1, 2, 7, 9, 500].map(|label| tf.class_of(label));
        let [f, h] = [LabelClass::Function, |_| LabelClass::Hidden];
        assert_eq!(classes, [f(0), f(1), f(2), h(0), f(2), f(0)]);
    }

    #[test]
    fn combined_functions_keep_their_amounts() {
        let tf = labelled();
        for range in [[-20.0, 50.0], [0.0, 10.0], [4.0, 4.0]] {
            let SideBySide { function, shifts, hidden } = tf.side_by_side(range).unwrap();
            for (one, shift) in tf.functions().zip(&shifts) {
                for i in 0..=100 {
                    let value = range[0] + (range[1] - range[0]) * f64::from(i) / 100.0;
                    let (want, got) = (one.amount(value), function.amount(value + shift));
                    assert!(
                        (want - got).abs() < 1e-12
                            || one.points.iter().any(|p| (p.value - value).abs() < 1e-9)
                    );
                }
                let width = if range[1] > range[0] { range[1] - range[0] } else { LEAST_WIDTH * range[0] };
                assert_eq!(function.amount(range[1] + 0.75 * GAP * width + shift), 0.0);
            }
            assert_eq!(function.amount(hidden), 0.0);
            assert!(function.points.windows(2).all(|w| w[0].value <= w[1].value));
        }
    }

    #[test]
    fn incompatible_functions_are_refused() {
        let mut tf = labelled();
        let other = TransferFunction { reference_length_mm: 2.0, ..tf.clone() };
        tf.rules.push(LabelRule { labels: vec![3], visibility: LabelVisibility::Visible(Box::new(other)) });
        assert!(tf.side_by_side([0.0, 1.0]).unwrap_err().contains("over 2 mm"));
        // Extinction does not depend on the reference length.
        let mut extinction = tf.clone();
        extinction.quantity = Quantity::Extinction;
        for rule in &mut extinction.rules {
            if let LabelVisibility::Visible(own) = &mut rule.visibility {
                own.quantity = Quantity::Extinction;
            }
        }
        assert!(extinction.side_by_side([0.0, 1.0]).is_ok());
        let rule = labelled().rules[0].clone();
        tf.rules = vec![rule; MOST_LABEL_FUNCTIONS + 1];
        assert!(tf.side_by_side([0.0, 1.0]).unwrap_err().contains("at most"));
    }
}
