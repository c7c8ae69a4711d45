//! Pacing of a picture: chooses the number of pixels per submission to the device, so that one submission takes about
//! the intended time.

use crate::gpu::Span;

/// Pacing of a picture: the choice of the number of pixels in each submission to the device.
pub(crate) trait Pacing {
    /// Returns the number of pixels for the next submission of a picture; `None` ends the drawing of the picture.
    fn pixels_next(&mut self) -> Option<u32>;
    /// Records the duration of a submission that drew `pixels` pixels of a picture.
    fn took(&mut self, pixels: u32, span: Span);
}

/// Pacing that draws a whole picture in one submission to the device, if the adapter can bind a picture of this size.
pub(crate) struct AtOnce;

impl Pacing for AtOnce {
    fn pixels_next(&mut self) -> Option<u32> {
        Some(u32::MAX)
    }

    fn took(&mut self, _pixels: u32, _span: Span) {}
}

impl Pacing for Pace {
    fn pixels_next(&mut self) -> Option<u32> {
        Some(self.pixels())
    }

    fn took(&mut self, pixels: u32, span: Span) {
        self.learn(pixels, span);
        self.forget_before();
    }
}

/// Pacing of a picture from the measured speed of earlier submissions, so that one submission takes about the
/// intended time.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// Intended duration of one submission of a picture, ms.
    pub target_ms: f64,
    /// Speed of drawing pictures in pixels per millisecond, averaged over whole pictures with their empty regions.
    pixels_per_ms: f64,
    /// Speed of drawing the slowest band of picture rows, in pixels per millisecond: in the previous picture and in
    /// this one.
    slowest_before: f64,
    slowest_now: f64,
    pixels: f64,
    ms: f64,
}

/// Largest factor by which the speed assumed for the slowest band of picture rows rises from one band to the next.
const RECOVERY: f64 = 1.25;
/// Shortest duration of a band of picture rows whose drawing speed is measured, ms. A shorter band spends most of its
/// time on the submission.
const SHORTEST_BAND_MS: f64 = 4.0;

impl Pace {
    /// Starts pacing for submissions of about `target_ms`. The first bands of picture rows are small, until the
    /// drawing speed of the adapter is measured.
    pub fn new(target_ms: f64) -> Self {
        let rate = 500.0;
        Self {
            target_ms,
            pixels_per_ms: rate,
            slowest_before: rate,
            slowest_now: f64::INFINITY,
            pixels: 0.0,
            ms: 0.0,
        }
    }

    /// Returns the average speed of drawing in the last pictures, in pixels per millisecond.
    pub fn pixels_per_ms(&self) -> f64 {
        self.pixels_per_ms
    }

    /// Begins a picture, and takes over the drawing speeds that were measured in the last picture.
    pub(super) fn begin(&mut self) {
        if self.ms > 0.0 {
            self.pixels_per_ms = 0.5 * (self.pixels_per_ms + self.pixels / self.ms);
            // A fast empty band says nothing about the next band: the slowest one counts.
            let faster = 2.0 * self.slowest_before;
            self.slowest_before = self.slowest_now.min(faster);
        }
        self.slowest_now = f64::INFINITY;
        (self.pixels, self.ms) = (0.0, 0.0);
    }

    pub(super) fn learn(&mut self, pixels: u32, span: Span) {
        let ms = span.best().0.max(0.05);
        self.pixels += f64::from(pixels);
        self.ms += ms;
        if ms >= SHORTEST_BAND_MS {
            // The effect of a single slow band fades.
            let recovered = RECOVERY * self.slowest_now;
            self.slowest_now = recovered.min(f64::from(pixels) / ms);
        }
    }

    /// Drops the drawing speed of the previous picture, for a single picture that has no predecessor. Bands of
    /// picture rows then grow until one is long enough to be measured.
    pub(super) fn forget_before(&mut self) {
        let measured = self.slowest_now.is_finite();
        self.slowest_before = if measured { f64::INFINITY } else { 2.0 * self.slowest_before };
    }

    /// Returns the number of pixels that can probably be drawn within the intended duration of a submission.
    pub(super) fn pixels(&self) -> u32 {
        let rate = self.slowest_before.min(self.slowest_now);
        (self.target_ms * rate).clamp(1.0, f64::from(u32::MAX)) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_band_does_not_make_the_next_too_long() {
        let ms = |wall_ms| Span { gpu_ms: None, wall_ms };
        let mut pace = Pace::new(20.0);
        for _ in 0..20 {
            pace.begin();
            // Nothing at the top, something in the middle.
            pace.learn(100_000, ms(5.0));
            pace.learn(2_000, ms(20.0));
        }
        pace.begin();
        assert!(pace.pixels() <= 2_000, "{}", pace.pixels());
        pace.learn(100_000, ms(5.0));
        assert!(pace.pixels() <= 2_000, "an empty band in between changes nothing");
        assert!((pace.pixels_per_ms() - 102_000.0 / 25.0).abs() < 1.0);
    }
}
