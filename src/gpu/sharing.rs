//! Sharing of a graphics device between threads: device errors by thread, and a lock on submissions.
//!
//! A window recreates its surface when it is resized. wgpu waits until the device is idle for that, and fails if
//! another thread submits meanwhile; the window then paints in a size that its surface does not have. The window
//! therefore holds back the submissions of other threads for a moment. Errors belong to the thread whose call failed,
//! so that an error of the window does not discard a picture of another thread.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

/// Longest time for which submissions to the device are held back, even if the thread that holds them never releases
/// them.
const LONGEST_HOLD: Duration = Duration::from_secs(1);

/// State that all users of one graphics device share (device errors, and the hold on submissions); clones refer to
/// the same state.
#[derive(Debug, Clone, Default)]
pub struct Sharing(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    /// Time until which submissions to the device are held back; `None` if they are not.
    held: Mutex<Option<Instant>>,
    released: Condvar,
    /// First device error of each thread, as reported by wgpu's callback for uncaptured errors.
    errors: Mutex<Vec<(ThreadId, Uncaptured)>>,
}

/// Error of the graphics device that wgpu reports by its callback for uncaptured errors, not as the result of a call.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Uncaptured {
    /// Message of an uncaptured device error, as wgpu words it.
    pub why: String,
    /// Whether the graphics device was out of memory. Repeating the call would then fail too.
    pub out_of_memory: bool,
}

fn lock<T>(slot: &Mutex<T>) -> MutexGuard<'_, T> {
    // The data is plain: a panic of another thread leaves it valid.
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Sharing {
    /// Holds back the submissions of all threads to the device ([`Gpu::submit`](super::Gpu::submit)), until
    /// [`Self::release`] or for a second at most.
    pub fn hold(&self) {
        *lock(&self.0.held) = Some(Instant::now() + LONGEST_HOLD);
    }

    /// Ends the hold on submissions to the device that [`Self::hold`] began.
    pub fn release(&self) {
        if lock(&self.0.held).take().is_some() {
            self.0.released.notify_all();
        }
    }

    /// Waits while submissions to the device are held back, and then calls `act`. No thread can hold them back during
    /// this call.
    pub(super) fn unheld<T>(&self, act: impl FnOnce() -> T) -> T {
        let mut held = lock(&self.0.held);
        while let Some(left) = held.and_then(|until| until.checked_duration_since(Instant::now())) {
            held = self.0.released.wait_timeout(held, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        *held = None;
        act()
    }

    /// Stores a device error that a call of this thread caused and wgpu reported by its callback, unless an earlier
    /// one is still stored.
    pub(super) fn note(&self, error: &wgpu::Error) {
        let mut errors = lock(&self.0.errors);
        let here = thread::current().id();
        if errors.iter().all(|(thread, _)| *thread != here) {
            let out_of_memory = matches!(error, wgpu::Error::OutOfMemory { .. });
            errors.push((here, Uncaptured { why: error.to_string(), out_of_memory }));
        }
    }

    /// Returns and clears the first device error that calls of this thread have caused and wgpu reported by its
    /// callback.
    pub fn take_error(&self) -> Option<Uncaptured> {
        let mut errors = lock(&self.0.errors);
        let here = thread::current().id();
        let place = errors.iter().position(|(thread, _)| *thread == here)?;
        Some(errors.swap_remove(place).1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common;
    use crate::gpu::Gpu;

    #[test]
    fn submissions_wait_for_the_release_for_a_second_at_most() {
        let sharing = Sharing::default();
        let theirs = sharing.clone();
        assert_eq!(sharing.unheld(|| 1), 1);
        sharing.hold();
        let start = Instant::now();
        let waits = thread::spawn(move || theirs.unheld(Instant::now));
        thread::sleep(Duration::from_millis(60));
        assert!(!waits.is_finished());
        let released = Instant::now();
        sharing.release();
        assert!(waits.join().unwrap() >= released);
        // Without a release.
        sharing.hold();
        sharing.unheld(|| ());
        assert!(start.elapsed() >= LONGEST_HOLD);
        assert_eq!(sharing.unheld(|| 2), 2, "the hold has ended");
    }

    #[test]
    fn an_error_is_of_the_thread_whose_call_failed() {
        let Some(gpu) = common::gpu() else { return };
        let fail = |gpu: &Gpu| {
            let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::STORAGE;
            let size = 16;
            let bad = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
            let _ = gpu.device.create_buffer(&bad);
        };
        thread::scope(|scope| {
            let theirs = scope.spawn(|| {
                fail(&gpu);
                gpu.sharing.take_error()
            });
            let theirs = theirs.join().unwrap().expect("their own");
            assert!(!theirs.out_of_memory && theirs.why.contains("Device::create_buffer"), "{theirs:?}");
        });
        thread::scope(|scope| scope.spawn(|| fail(&gpu)).join().unwrap());
        gpu.take_error().expect("nothing of this thread failed");
        fail(&gpu);
        assert!(gpu.take_error().is_err());
        gpu.take_error().expect("it has been taken");
    }
}
