//! Edits of a gradient opacity in the viewer.

use crate::transfer::GradientOpacity;

/// Edit of a gradient opacity: of one of its points, or of all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GradientEdit {
    /// Moves a point. It stays between its neighbours.
    Move {
        /// Index of the point.
        index: usize,
        /// New gradient magnitude of the point, value units per mm.
        magnitude: f64,
        /// New factor of the point on the extinction, 0 to 1.
        factor: f64,
    },
    /// Adds a point. Without any, the factor stays 1 at gradient 0 and at `top`.
    Add {
        /// Gradient magnitude of the point, value units per mm.
        magnitude: f64,
        /// Factor of the point on the extinction, 0 to 1.
        factor: f64,
        /// Gradient magnitude at the top of the editor, value units per mm.
        top: f64,
    },
    /// Removes a point; the last one with the whole gradient opacity.
    Remove {
        /// Index of the point.
        index: usize,
    },
    /// Hides what has no gradient: the factor rises from 0 to 1 at a quarter of `top`.
    Boundaries {
        /// Gradient magnitude at the top of the editor, value units per mm.
        top: f64,
    },
    /// Removes the gradient opacity.
    Clear,
}

/// Applies an edit to a gradient opacity whose magnitudes are per mm. `None` is the factor 1 everywhere.
///
/// # Errors
/// The edited gradient opacity is not valid, e.g. with too many points.
pub fn apply(
    opacity: Option<&GradientOpacity>,
    edit: GradientEdit,
) -> Result<Option<GradientOpacity>, String> {
    let mut points: Vec<(f64, f64)> =
        opacity.map_or(Vec::new(), |o| o.points().iter().map(|p| (p.magnitude, p.factor)).collect());
    match edit {
        GradientEdit::Move { index, magnitude, factor } => {
            let magnitude_of = |i: Option<usize>| i.and_then(|i| points.get(i)).map(|p| p.0);
            let low = magnitude_of(index.checked_sub(1)).unwrap_or(0.0);
            let high = magnitude_of(Some(index + 1)).unwrap_or(f64::MAX);
            let point = points.get_mut(index).ok_or("there is no such point")?;
            *point = (rounded(magnitude).clamp(low, high), rounded(factor.clamp(0.0, 1.0)));
        }
        GradientEdit::Add { magnitude, factor, top } => {
            if points.is_empty() {
                points = vec![(0.0, 1.0), (rounded(top), 1.0)];
            }
            let at = points.partition_point(|p| p.0 <= magnitude);
            points.insert(at, (rounded(magnitude.max(0.0)), rounded(factor.clamp(0.0, 1.0))));
        }
        GradientEdit::Remove { index } => {
            if index >= points.len() {
                return Err("there is no such point".into());
            }
            points.remove(index);
        }
        GradientEdit::Boundaries { top } => points = vec![(0.0, 0.0), (rounded(0.25 * top), 1.0)],
        GradientEdit::Clear => points.clear(),
    }
    if points.is_empty() {
        return Ok(None);
    }
    GradientOpacity::new(points).map(Some)
}

/// Rounds to four significant digits, so that scene files stay short.
fn rounded(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(opacity: &Option<GradientOpacity>) -> String {
        opacity.as_ref().map_or("none".into(), ToString::to_string)
    }

    #[test]
    fn points_are_added_moved_and_removed() {
        let added = apply(None, GradientEdit::Add { magnitude: 2.0, factor: 0.25, top: 10.0 }).unwrap();
        assert_eq!(texts(&added), "0:1,2:0.25,10:1");
        let to = |index, magnitude, factor| GradientEdit::Move { index, magnitude, factor };
        let moved = apply(added.as_ref(), to(1, 99.0, -3.0)).unwrap();
        assert_eq!(texts(&moved), "0:1,10:0,10:1", "it stays between its neighbours");
        let moved = apply(added.as_ref(), to(1, 1.23456789, 0.5)).unwrap();
        assert_eq!(texts(&moved), "0:1,1.235:0.5,10:1");
        let removed = apply(moved.as_ref(), GradientEdit::Remove { index: 0 }).unwrap();
        assert_eq!(texts(&removed), "1.235:0.5,10:1");
        let one = apply(removed.as_ref(), GradientEdit::Remove { index: 1 }).unwrap();
        assert_eq!(apply(one.as_ref(), GradientEdit::Remove { index: 0 }).unwrap(), None);
        assert!(apply(one.as_ref(), GradientEdit::Remove { index: 1 }).is_err());
        assert!(apply(None, to(0, 1.0, 1.0)).is_err());
    }

    #[test]
    fn gradient_opacity_is_replaced_or_removed() {
        let boundaries = apply(None, GradientEdit::Boundaries { top: 8.0 }).unwrap();
        assert_eq!(texts(&boundaries), "0:0,2:1");
        assert_eq!(apply(boundaries.as_ref(), GradientEdit::Clear).unwrap(), None);
    }

    #[test]
    fn no_more_points_than_the_device_has() {
        let mut opacity = None;
        for i in 0..crate::transfer::MOST_GRADIENT_POINTS - 2 {
            let edit = GradientEdit::Add { magnitude: 1.0 + i as f64, factor: 0.5, top: 100.0 };
            opacity = apply(opacity.as_ref(), edit).unwrap();
        }
        let edit = GradientEdit::Add { magnitude: 50.0, factor: 0.5, top: 100.0 };
        assert!(apply(opacity.as_ref(), edit).unwrap_err().contains("at most 16"));
    }
}
