//! Progress bar of commands that measure shadow methods.

use super::console::show_step;
use super::interrupt::Interrupt;
use crate::measure::progress::{Status, Watch};
use indicatif::ProgressBar;

/// Progress bar of measurements of shadow methods. After an interrupt (Ctrl-C), they end with the present one.
pub struct MeasuringBar<'a> {
    /// Bar on the terminal.
    pub bar: &'a ProgressBar,
    /// Interrupt of the user.
    pub interrupt: &'a Interrupt,
}

impl Watch for MeasuringBar<'_> {
    fn starts(&mut self, status: &Status) {
        show_step(self.bar, status);
    }

    fn goes_on(&self) -> bool {
        !self.interrupt.is_requested()
    }
}
