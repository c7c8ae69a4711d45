//! Sharing of a graphics device between threads: device errors by thread, and a lock on submissions.
//!
//! A window recreates its surface when it is resized. wgpu waits until the device is idle for that, and fails if
//! another thread submits meanwhile; the window then paints in a size that its surface does not have. The window
//! therefore holds back the submissions of other threads for a moment. Errors belong to the thread whose call failed,
//! so that an error of the window does not discard a picture of another thread.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

/// Longest time for which submissions to the device are held back, even without a release.
const LONGEST_HOLD: Duration = Duration::from_secs(1);

/// State that all users of one graphics device share; clones refer to the same state.
#[derive(Debug, Clone, Default)]
pub struct Sharing(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    /// Time until which no thread submits commands to the device.
    held: Mutex<Option<Instant>>,
    released: Condvar,
    /// First uncaptured device error of each thread, as wgpu's error callback reported it.
    errors: Mutex<Vec<(ThreadId, Uncaptured)>>,
}

/// Error of the graphics device that wgpu reports by its callback for uncaptured errors, not as the result of a call.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Uncaptured {
    /// Message of an uncaptured device error, as wgpu words it.
    pub why: String,
    /// Whether the error means that the device was out of memory; a repetition would fail too.
    pub out_of_memory: bool,
}

fn lock<T>(slot: &Mutex<T>) -> MutexGuard<'_, T> {
    // The data is plain: a panic of another thread leaves it valid.
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Sharing {
    /// Holds back all submissions to the device ([`Gpu::submit`](super::Gpu::submit)) from the return of this call
    /// until [`Self::release`], for a second at most.
    pub fn hold(&self) {
        *lock(&self.0.held) = Some(Instant::now() + LONGEST_HOLD);
    }

    /// Allows submissions to the device again after [`Self::hold`].
    pub fn release(&self) {
        if lock(&self.0.held).take().is_some() {
            self.0.released.notify_all();
        }
    }

    /// Waits while submissions to the device are held back, and then runs `act`. No thread can hold them back
    /// meanwhile.
    pub(super) fn unheld<T>(&self, act: impl FnOnce() -> T) -> T {
        let mut held = lock(&self.0.held);
        while let Some(left) = held.and_then(|until| until.checked_duration_since(Instant::now())) {
            held = self.0.released.wait_timeout(held, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        *held = None;
        act()
    }

    /// Stores an uncaptured device error that a call of this thread caused, unless an earlier one is still stored.
    pub(super) fn note(&self, error: &wgpu::Error) {
        let mut errors = lock(&self.0.errors);
        let here = thread::current().id();
        if errors.iter().all(|(thread, _)| *thread != here) {
            let out_of_memory = matches!(error, wgpu::Error::OutOfMemory { .. });
            errors.push((here, Uncaptured { why: error.to_string(), out_of_memory }));
        }
    }

    /// Returns the first uncaptured device error that calls of this thread have caused since the last `take_error`.
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
