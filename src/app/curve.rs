//! Edits of a transfer function in the viewer, with undo. Every edited transfer function can be written to a file.

use crate::files::color;
use crate::transfer::{ControlPoint, Quantity, TransferFunction};
use eframe::egui::util::undoer::Undoer;
use std::mem::{Discriminant, discriminant};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Maximum interval between two transfer-function edits of one kind that form a single undo step.
const ONE_EDIT: Duration = Duration::from_millis(700);
/// Minimum extinction at the upper end of the vertical axis of the transfer-function editor, 1/mm.
const MIN_TOP: f64 = 1e-6;

/// Edit of a transfer function, such as moving or adding a control point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Edit {
    /// Moves a control point of the transfer function. The point stays between its neighbouring control points.
    Move {
        /// Index of the moved control point in the transfer function.
        index: usize,
        /// New scalar value of the moved control point of the transfer function.
        value: f64,
        /// New opacity of the moved control point of the transfer function, or its new extinction in 1/mm.
        amount: f64,
    },
    /// Adds a control point to the transfer function, with the colour that the function has at this scalar value.
    Add {
        /// Scalar value of the control point that is added to the transfer function.
        value: f64,
        /// Opacity of the control point that is added to the transfer function, or its extinction in 1/mm.
        amount: f64,
    },
    /// Removes a control point from the transfer function.
    Remove {
        /// Index of the control point that is removed from the transfer function.
        index: usize,
    },
    /// Sets the colour of a control point of the transfer function, rounded to the precision of a transfer-function
    /// file.
    Color {
        /// Index of the control point of the transfer function whose colour is set.
        index: usize,
        /// New colour of the control point of the transfer function, linear RGB, 0 to 1.
        color: [f64; 3],
    },
    /// Turns a control point of the transfer function into a discontinuity: adds a second control point at the same
    /// scalar value.
    Jump {
        /// Index of the control point that becomes a discontinuity of the transfer function.
        index: usize,
        /// Opacity of the transfer function just above the discontinuity, or its extinction in 1/mm.
        amount: f64,
    },
    /// Multiplies the extinction of the transfer function by one factor at every scalar value.
    Scale {
        /// Positive factor by which the extinction of the transfer function is multiplied.
        factor: f64,
    },
    /// Shifts the control points of the transfer function along the value axis, and scales their distances to the
    /// middle of their range (window and level).
    Window {
        /// Offset added to the scalar value of every control point of the transfer function.
        shift: f64,
        /// Factor on the distance of every control point of the transfer function to the middle of their range of
        /// scalar values.
        spread: f64,
    },
}

/// Applies an edit to a transfer function and returns the edited function.
///
/// # Errors
/// An edited transfer function that no file can store, e.g. with a third control point at one scalar value.
pub fn apply(tf: &TransferFunction, edit: Edit) -> Result<TransferFunction, &'static str> {
    let mut tf = tf.clone();
    let highest = match tf.quantity {
        Quantity::Opacity => 1.0,
        Quantity::Extinction => 1e6,
    };
    let amount_of = |amount: f64| if amount.is_finite() { amount.clamp(0.0, highest) } else { 0.0 };
    match edit {
        Edit::Move { index, value, amount } => {
            let [lo, hi] = range_of(&tf, index);
            let point = tf.points.get_mut(index).ok_or("there is no such point")?;
            if value.is_finite() {
                point.value = value.clamp(lo, hi);
            }
            point.amount = amount_of(amount);
        }
        Edit::Add { value, amount } => {
            if !value.is_finite() || value.abs() > 1e30 {
                return Err("the value is not a finite number");
            }
            if tf.points.iter().filter(|p| p.value == value).count() > 1 {
                return Err("there are already two points of this value");
            }
            let color = color::parse_hex(&color::to_hex(tf.color(value))).unwrap_or([1.0; 3]);
            let at = tf.points.partition_point(|p| p.value <= value);
            tf.points.insert(at, ControlPoint { value, amount: amount_of(amount), color });
        }
        Edit::Remove { index } => {
            if tf.points.len() < 2 {
                return Err("the last point cannot be removed");
            }
            if index >= tf.points.len() {
                return Err("there is no such point");
            }
            tf.points.remove(index);
        }
        Edit::Color { index, color } => {
            let point = tf.points.get_mut(index).ok_or("there is no such point")?;
            point.color = color::parse_hex(&color::to_hex(color)).unwrap_or([1.0; 3]);
        }
        Edit::Jump { index, amount } => {
            let point = *tf.points.get(index).ok_or("there is no such point")?;
            if tf.points.iter().filter(|p| p.value == point.value).count() > 1 {
                return Err("there are already two points of this value");
            }
            tf.points.insert(index + 1, ControlPoint { amount: amount_of(amount), ..point });
        }
        Edit::Scale { factor } => {
            let scaled = tf.scale_extinction(factor);
            let highest = scaled.max_extinction(f64::NEG_INFINITY, f64::INFINITY);
            let length = scaled.reference_length_mm;
            if !(highest <= 1e30 && length > 0.0 && length <= 1e30) {
                return Err("the extinction would be out of range");
            }
            return Ok(scaled);
        }
        Edit::Window { shift, spread } => {
            let (first, last) = (tf.points[0].value, tf.points[tf.points.len() - 1].value);
            let middle = 0.5 * (first + last);
            let moved = tf.scale_values(|v| middle + shift + (v - middle) * spread.max(1e-3));
            if moved.points.iter().any(|p| !p.value.is_finite() || p.value.abs() > 1e30) {
                return Err("the values would be out of range");
            }
            return Ok(moved);
        }
    }
    Ok(tf)
}

/// Range of scalar values to which a control point of the transfer function may move. It may coincide with one
/// neighbouring control point (a discontinuity), not with two.
fn range_of(tf: &TransferFunction, index: usize) -> [f64; 2] {
    let value = |i: Option<usize>| i.and_then(|i| tf.points.get(i)).map(|p| p.value);
    let (before, before2) = (value(index.checked_sub(1)), value(index.checked_sub(2)));
    let (after, after2) = (value(Some(index + 1)), value(Some(index + 2)));
    let gap = |v: f64| (v.abs() * 1e-9).max(1e-9);
    let lo = before.map_or(-1e30, |b| if before2 == Some(b) { b + gap(b) } else { b });
    let hi = after.map_or(1e30, |a| if after2 == Some(a) { a - gap(a) } else { a });
    if lo <= hi { [lo, hi] } else { [value(Some(index)).unwrap_or(0.0); 2] }
}

/// Opacity, or extinction in 1/mm, at the upper end of the vertical axis of the transfer-function editor.
pub fn top_of(tf: &TransferFunction) -> f64 {
    match tf.quantity {
        Quantity::Opacity => 1.0,
        Quantity::Extinction => 1.25 * tf.points.iter().map(|p| p.amount).fold(MIN_TOP, f64::max),
    }
}

/// Scale of the vertical axis of the transfer-function editor: linear or logarithmic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AmountAxis {
    /// Linear scale of opacity or extinction on the vertical axis of the transfer-function editor.
    Linear,
    /// Logarithmic scale on the vertical axis of the transfer-function editor: four decades, with zero at the bottom.
    Logarithmic,
}

/// Number of decades on the logarithmic axis of the transfer-function editor.
const DECADES: f64 = 4.0;
/// Fraction of the height of the transfer-function editor's logarithmic axis below its lowest decade. There the axis
/// is linear, down to zero.
const FOOT: f64 = 0.06;

impl AmountAxis {
    /// Height in `[0, 1]` at which the transfer-function editor draws an opacity or extinction `amount`. `top` is the
    /// amount at height 1.
    pub fn height(self, amount: f64, top: f64) -> f64 {
        let share = (amount / top).clamp(0.0, 1.0);
        let lowest = 10_f64.powf(-DECADES);
        match self {
            Self::Linear => share,
            Self::Logarithmic if share < lowest => FOOT * share / lowest,
            Self::Logarithmic => FOOT + (1.0 - FOOT) * (1.0 + share.log10() / DECADES),
        }
    }

    /// Opacity or extinction at a height in `[0, 1]` of the transfer-function editor; the inverse of
    /// [`Self::height`].
    pub fn amount(self, height: f64, top: f64) -> f64 {
        let height = height.clamp(0.0, 1.0);
        let lowest = 10_f64.powf(-DECADES);
        top * match self {
            Self::Linear => height,
            Self::Logarithmic if height < FOOT => lowest * height / FOOT,
            Self::Logarithmic => 10_f64.powf(((height - FOOT) / (1.0 - FOOT) - 1.0) * DECADES),
        }
    }
}

/// Undo history of the transfer function that the user edits.
#[derive(Debug, Clone, Default)]
pub struct History {
    undoer: Undoer<Arc<TransferFunction>>,
    last: Option<(Discriminant<Edit>, Instant)>,
}

impl History {
    /// Records an edit of the transfer function as an undo step, unless the edit continues the one before it, as in a
    /// drag.
    pub fn note_edit(&mut self, [before, after]: [&Arc<TransferFunction>; 2], edit: Edit) {
        let kind = discriminant(&edit);
        if self.last.is_none_or(|(last, when)| last != kind || when.elapsed() >= ONE_EDIT) {
            self.note([before, after]);
        }
        self.last = Some((kind, Instant::now()));
    }

    /// Records the replacement of the whole transfer function as an undo step.
    pub fn note(&mut self, [before, after]: [&Arc<TransferFunction>; 2]) {
        self.last = None;
        self.undoer.add_undo(before);
        // The new state removes all redo steps; the time argument has no effect.
        self.undoer.feed_state(0.0, after);
    }

    /// Undoes the last edit: restores the transfer function before it.
    pub fn undo(&mut self, now: &mut Arc<TransferFunction>) {
        self.last = None;
        self.undoer.undo(now).cloned().into_iter().for_each(|before| *now = before);
    }

    /// Redoes the edit of the transfer function that was undone last.
    pub fn redo(&mut self, now: &mut Arc<TransferFunction>) {
        self.last = None;
        self.undoer.redo(now).cloned().into_iter().for_each(|after| *now = after);
    }

    /// Returns whether an edit of the transfer function can be undone, and whether one can be redone.
    pub fn is_possible(&self, now: &Arc<TransferFunction>) -> [bool; 2] {
        [self.undoer.has_undo(now), self.undoer.has_redo(now)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::presets::PRESETS;

    /// Every edited transfer function can be written to a file and read again.
    #[test]
    fn every_edit_leaves_a_function_that_a_file_can_hold() {
        let mut seed = 7_u64;
        let mut chance = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31)
        };
        for preset in PRESETS {
            let mut tf = preset.transfer_function();
            for _ in 0..400 {
                let index = (chance() * tf.points.len() as f64) as usize;
                // Often exactly the value of another point.
                let value = if chance() < 0.5 {
                    tf.points[(chance() * tf.points.len() as f64) as usize].value
                } else {
                    (chance() - 0.5) * 4000.0
                };
                let amount = chance() * 1.4 - 0.2;
                let edit = match (chance() * 7.0) as u32 {
                    0 | 1 => Edit::Move { index, value, amount },
                    2 => Edit::Add { value, amount },
                    3 => Edit::Remove { index },
                    4 => Edit::Jump { index, amount },
                    5 => Edit::Scale { factor: 10_f64.powf(6.0 * chance() - 3.0) },
                    _ => Edit::Window { shift: chance() - 0.5, spread: 0.9 + 0.2 * chance() },
                };
                if let Ok(edited) = apply(&tf, edit) {
                    TransferFunction::from_json(&edited.to_json())
                        .unwrap_or_else(|why| panic!("{}: {edit:?} of {tf:?}: {why}", preset.name));
                    tf = edited;
                }
            }
        }
    }

    #[test]
    fn the_logarithmic_axis_is_its_own_inverse_and_never_falls() {
        for axis in [AmountAxis::Linear, AmountAxis::Logarithmic] {
            let mut before = -1.0;
            for i in 0..=1000 {
                let amount = 2.5 * (f64::from(i) / 1000.0).powi(4);
                let height = axis.height(amount, 2.5);
                assert!(height >= before && (0.0..=1.0).contains(&height));
                assert!((axis.amount(height, 2.5) - amount).abs() < 1e-9, "{axis:?} {amount}");
                before = height;
            }
        }
    }

    #[test]
    fn undo_goes_back_a_whole_drag_and_redo_forward() {
        let first = Arc::new(PRESETS[0].transfer_function());
        let mut history = History::default();
        let second = Arc::new(apply(&first, Edit::Remove { index: 0 }).unwrap());
        history.note([&first, &first]);
        history.note([&first, &second]);
        let mut now = Arc::clone(&second);
        history.undo(&mut now);
        assert_eq!(now, first);
        assert_eq!(history.is_possible(&now), [false, true]);
        history.redo(&mut now);
        assert_eq!(now, second);
        // Another edit removes the redo steps.
        history.undo(&mut now);
        let third = Arc::new(apply(&first, Edit::Scale { factor: 2.0 }).unwrap());
        history.note([&first, &third]);
        assert_eq!(history.is_possible(&third), [true, false]);
    }
}
