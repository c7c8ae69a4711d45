//! Comparison of two shadow methods in one view: a movable split line, or flicker between both pictures.

use std::ops::RangeInclusive;

/// Range of the frequency at which flicker alternates between two pictures, changes per second.
pub const RATES_HZ: RangeInclusive<f64> = 0.5..=8.0;
pub const DEFAULT_RATE_HZ: f64 = 2.0;

/// Division of the view between the pictures of two shadow methods: split line or flicker.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Split {
    /// Position of the split line as a fraction of the view's width. `None` shows the picture of a single shadow
    /// method.
    pub share: Option<f32>,
    /// Start time of the flicker between two pictures, seconds of the user interface's clock; `None` if flicker is
    /// off.
    flicker_since_s: Option<f64>,
}

impl Split {
    /// Turns the split view of two shadow methods on, with the line in the centre, or off.
    pub fn set(&mut self, on: bool) {
        *self = Self { share: on.then_some(0.5), flicker_since_s: self.flicker_since_s.filter(|_| on) };
    }

    /// Turns flicker between two shadow methods on or off. Flicker also turns the split view on.
    pub fn set_flicker(&mut self, on: bool, now_s: f64) {
        self.flicker_since_s = on.then_some(now_s);
        if on {
            self.share.get_or_insert(0.5);
        }
    }

    /// Returns the split view with flicker turned off, because the flicker's start time has no meaning for the clock
    /// of another window.
    #[must_use]
    pub fn without_flicker(self) -> Self {
        Self { flicker_since_s: None, ..self }
    }

    /// Whether flicker between the pictures of two shadow methods is on.
    pub fn flickers(&self) -> bool {
        self.flicker_since_s.is_some()
    }

    /// Index of the picture that flicker shows at a given time (0 left, 1 right), and the time until the other
    /// picture is shown, s. `None` if flicker is off.
    pub fn flicker_at(&self, now_s: f64, rate_hz: f64) -> Option<(usize, f64)> {
        self.share?;
        let changes = ((now_s - self.flicker_since_s?) * rate_hz).max(0.0);
        let count = changes.floor();
        Some(((count % 2.0) as usize, (count + 1.0 - changes) / rate_hz))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_change_as_often_as_the_rate_says() {
        let mut split = Split::default();
        assert_eq!(split.flicker_at(10.0, 2.0), None);
        split.set_flicker(true, 10.0);
        let at = |now_s: f64, rate_hz: f64| split.flicker_at(now_s, rate_hz).unwrap();
        for (now_s, side, wait_s) in [(10.0, 0, 0.5), (10.25, 0, 0.25), (10.5, 1, 0.5), (11.75, 1, 0.25)] {
            assert_eq!(at(now_s, 2.0), (side, wait_s), "{now_s}");
        }
        assert_eq!(at(9.0, 2.0), (0, 0.5), "a clock that was set back");
        let mut changes = 0;
        let mut before = 0;
        for step in 0..10_000 {
            let (side, wait_s) = at(10.0 + 0.001 * f64::from(step), 8.0);
            assert!(wait_s > 0.0 && wait_s <= 0.125);
            changes += usize::from(side != before);
            before = side;
        }
        assert_eq!(changes, 79, "8 a second for 10 seconds, the first of them at the start");
    }

    #[test]
    fn flicker_needs_two_pictures_and_ends_with_the_split() {
        let mut split = Split::default();
        split.set_flicker(true, 1.0);
        assert!(split.share.is_some() && split.flickers());
        split.set_flicker(false, 2.0);
        assert!(split.share.is_some() && !split.flickers());
        split.set_flicker(true, 3.0);
        split.set(false);
        assert_eq!(split, Split::default());
    }
}
