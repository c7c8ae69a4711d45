//! Progress of commands that measure shadow methods.

use super::console::StepDisplay;
use super::interrupt::Interrupt;
use crate::measure::progress::{Status, Watch};

/// Progress display of measurements of shadow methods. After an interrupt (Ctrl-C), they end with the present one.
pub struct MeasuringBar<'a> {
    /// Bar on the terminal, or lines elsewhere.
    pub bar: &'a StepDisplay,
    /// Interrupt of the user.
    pub interrupt: &'a Interrupt,
}

impl Watch for MeasuringBar<'_> {
    fn starts(&mut self, status: &Status) {
        self.bar.show(status);
    }

    fn goes_on(&self) -> bool {
        !self.interrupt.is_requested()
    }
}
