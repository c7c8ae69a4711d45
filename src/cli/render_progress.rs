//! Progress of `render`: shadow maps, eye rays, and pictures of a rotation or a time series.

use super::console::StepDisplay;
use crate::error::Result;
use crate::measure::progress::{Status, Step, StepKind};
use std::cell::{Cell, RefCell};
use std::time::Instant;

/// Progress of one picture or of several, on stderr. Lines without a terminal begin after some seconds.
pub struct RenderProgress {
    display: StepDisplay,
    pictures: usize,
    began: Instant,
    /// Name of the present picture among several.
    name: RefCell<String>,
    /// Number of finished pictures, and the time that they took, s.
    finished: Cell<(usize, f64)>,
    /// Step of the present picture whose share is shown, and its begin.
    step: Cell<Option<(&'static str, Instant)>>,
}

impl RenderProgress {
    /// Creates the display for a number of pictures.
    ///
    /// # Errors
    /// See [`StepDisplay::new`].
    pub fn new(pictures: usize) -> Result<Self> {
        Ok(Self {
            display: StepDisplay::new()?,
            pictures,
            began: Instant::now(),
            name: RefCell::default(),
            finished: Cell::default(),
            step: Cell::default(),
        })
    }

    /// Shows that one of several pictures begins.
    pub fn begin_picture(&self, name: &impl ToString) {
        self.name.replace(name.to_string());
        self.show("", 0.0);
    }

    /// Shows that the shadow map `number` of `count` is built, counted from 0.
    pub fn show_map(&self, number: usize, count: usize) {
        self.show(&format!("shadow map {} of {count}", number + 1), 0.0);
    }

    /// Shows the share of the present picture that is drawn, 0 to 1.
    pub fn show_rays(&self, share: f32) {
        self.show_share("eye rays", share);
    }

    /// Shows the share of a step of the present picture that is done, 0 to 1.
    pub fn show_share(&self, what: &'static str, share: f32) {
        if self.step.get().is_none_or(|(known, _)| known != what) {
            self.step.set(Some((what, Instant::now())));
        }
        self.show(what, share);
    }

    /// Counts a finished picture.
    pub fn end_picture(&self) {
        let (done, _) = self.finished.get();
        self.finished.set((done + 1, self.began.elapsed().as_secs_f64()));
        self.step.set(None);
    }

    /// Prints a message for the user above the progress.
    pub fn print_message(&self, kind: &str, text: &impl std::fmt::Display) {
        self.display.print_message(kind, text);
    }

    /// Removes the progress bar from the terminal.
    pub fn finish_and_clear(&self) {
        self.display.finish_and_clear();
    }

    /// Shows a step. `share` is the share of it that is done. A single picture counts in percent.
    fn show(&self, what: &str, share: f32) {
        let (finished, _) = self.finished.get();
        let (done, total) = match self.pictures {
            1 => ((100.0 * share) as usize, 100),
            several => (finished, several),
        };
        let name = self.name.borrow();
        let parts: Vec<&str> = [name.as_str(), what].into_iter().filter(|part| !part.is_empty()).collect();
        let step = Step::new(StepKind::Render, "");
        let left_s = self.left_s(share);
        self.display.show(&Status { step: &step, what: &parts.join(", "), done, total, left_s });
    }

    /// Estimates the remaining time, s: from finished pictures, or from the present step of a single picture.
    fn left_s(&self, share: f32) -> Option<f64> {
        let (finished, took_s) = self.finished.get();
        let step_s = self.step.get().map(|(_, began)| began.elapsed().as_secs_f64());
        match finished {
            0 if self.pictures == 1 => step_s.and_then(|step_s| left_of_share(step_s, share)),
            0 => None,
            _ => Some(took_s / finished as f64 * (self.pictures - finished.min(self.pictures)) as f64),
        }
    }
}

/// Estimates the remaining time of work of which a share is done; `None` before there is any.
fn left_of_share(took_s: f64, share: f32) -> Option<f64> {
    (share > 0.0).then(|| took_s * f64::from(1.0 - share) / f64::from(share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remaining_time_follows_from_what_is_done() {
        assert_eq!(left_of_share(3.0, 0.0), None);
        assert_eq!(left_of_share(3.0, 0.75), Some(1.0));
        let progress = RenderProgress::new(4).unwrap();
        progress.show_rays(0.5);
        assert_eq!(progress.left_s(0.5), None, "the maps of other pictures take time too");
        progress.finished.set((1, 2.0));
        assert_eq!(progress.left_s(0.5), Some(6.0));
        progress.finished.set((4, 8.0));
        assert_eq!(progress.left_s(0.0), Some(0.0));
        let single = RenderProgress::new(1).unwrap();
        single.show_map(0, 2);
        assert_eq!(single.left_s(0.0), None);
        single.show_rays(0.5);
        assert!(single.left_s(0.5).is_some());
        single.show_share("certified eye rays", 0.0);
        assert_eq!(single.left_s(0.0), None, "another step has its own time");
    }
}
