//! How much of a picture is drawn in one submission.

use crate::gpu::Span;

/// How much of a picture is drawn in one submission.
pub(crate) trait Pacing {
    /// Pixels of the next submission; `None` ends the picture.
    fn pixels_next(&mut self) -> Option<u32>;
    /// What a submission took.
    fn took(&mut self, pixels: u32, span: Span);
}

/// All in one submission, where the adapter can bind it.
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

/// How long one submission may keep the queue, and what has been learnt of how much fits into that.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// How long a submission may take, ms.
    pub target_ms: f64,
    /// Of whole pictures, empty parts included.
    pixels_per_ms: f64,
    /// Of the slowest band of the picture before, and of this one so far.
    slowest_before: f64,
    slowest_now: f64,
    pixels: f64,
    ms: f64,
}

/// By so much a part may be larger than what the slowest one before allows.
const RECOVERY: f64 = 1.25;
/// A shorter band says more of what a submission costs than of its pixels.
const TELLING_MS: f64 = 4.0;

impl Pace {
    /// Starts with small bands until it is known how fast the adapter is.
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

    /// Pixels that the last pictures have drawn in a millisecond.
    pub fn pixels_per_ms(&self) -> f64 {
        self.pixels_per_ms
    }

    /// Begins a picture with what the last one has taught.
    pub(super) fn begin(&mut self) {
        if self.ms > 0.0 {
            self.pixels_per_ms = 0.5 * (self.pixels_per_ms + self.pixels / self.ms);
            // A band that is fast since it is empty says nothing of the next: the slowest one counts.
            let faster = 2.0 * self.slowest_before;
            self.slowest_before = self.slowest_now.min(faster);
        }
        self.slowest_now = f64::INFINITY;
        (self.pixels, self.ms) = (0.0, 0.0);
    }

    pub(super) fn learn(&mut self, pixels: u32, span: Span) {
        let ms = span.wall_ms.max(0.05);
        self.pixels += f64::from(pixels);
        self.ms += ms;
        if ms >= TELLING_MS {
            // One hitch counts little by little less.
            let recovered = RECOVERY * self.slowest_now;
            self.slowest_now = recovered.min(f64::from(pixels) / ms);
        }
    }

    /// For a picture without one before: what is measured counts as soon as it is telling, and parts grow until then.
    pub(super) fn forget_before(&mut self) {
        let telling = self.slowest_now.is_finite();
        self.slowest_before = if telling { f64::INFINITY } else { 2.0 * self.slowest_before };
    }

    /// Pixels that are likely to fit into the target.
    pub(super) fn pixels(&self) -> u32 {
        let rate = self.slowest_before.min(self.slowest_now);
        (self.target_ms * rate).clamp(1.0, f64::from(u32::MAX)) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_band_makes_the_next_no_longer_than_a_full_one_may_be() {
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
