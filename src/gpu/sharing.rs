//! A device that several threads use: whose errors are whose, and who submits when.
//!
//! A window on the device makes its surface anew when it is resized. wgpu waits for the device to be idle for that, and
//! gives up where another thread submits meanwhile; what the window then paints has a size that its surface has not. So
//! whoever shows a window can hold the others' submissions back for a moment, and errors belong to the thread whose call
//! failed, so that a picture is not given up for what the window did.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

/// Submissions are held back no longer than this, whatever became of the one who holds them.
const LONGEST_HOLD: Duration = Duration::from_secs(1);

/// What the users of one device share; clones know what the first one knows.
#[derive(Debug, Clone, Default)]
pub struct Sharing(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    /// Until when nobody submits.
    held: Mutex<Option<Instant>>,
    released: Condvar,
    /// The first error that no call returned, of each thread.
    errors: Mutex<Vec<(ThreadId, Uncaptured)>>,
}

/// An error that no call returned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Uncaptured {
    /// What wgpu says of it.
    pub why: String,
    /// The device has no memory left: trying again mends nothing.
    pub out_of_memory: bool,
}

fn lock<T>(slot: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic elsewhere leaves plain data that is as good as before.
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Sharing {
    /// Holds back what goes through [`Gpu::submit`](super::Gpu::submit), from when this returns until [`Self::release`], or
    /// for a second.
    pub fn hold(&self) {
        *lock(&self.0.held) = Some(Instant::now() + LONGEST_HOLD);
    }

    /// Lets submissions go on.
    pub fn release(&self) {
        if lock(&self.0.held).take().is_some() {
            self.0.released.notify_all();
        }
    }

    /// Does what nobody may do while submissions are held, and during which nobody can hold them.
    pub(super) fn unheld<T>(&self, act: impl FnOnce() -> T) -> T {
        let mut held = lock(&self.0.held);
        while let Some(left) = held.and_then(|until| until.checked_duration_since(Instant::now())) {
            held = self.0.released.wait_timeout(held, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        *held = None;
        act()
    }

    /// Notes an error of a call of this thread, unless there is one that nobody has taken.
    pub(super) fn note(&self, error: &wgpu::Error) {
        let mut errors = lock(&self.0.errors);
        let here = thread::current().id();
        if errors.iter().all(|(thread, _)| *thread != here) {
            let out_of_memory = matches!(error, wgpu::Error::OutOfMemory { .. });
            errors.push((here, Uncaptured { why: error.to_string(), out_of_memory }));
        }
    }

    /// The first error of this thread's calls since the last time.
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
    fn what_is_held_waits_for_its_release_and_no_longer_than_a_second() {
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
        // Forgotten by whoever held it.
        sharing.hold();
        sharing.unheld(|| ());
        assert!(start.elapsed() >= LONGEST_HOLD);
        assert_eq!(sharing.unheld(|| 2), 2, "and it is not held any more");
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
