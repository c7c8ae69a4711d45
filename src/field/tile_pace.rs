//! Splits the build passes of a shadow map into batches, one submission to the device each, so that a submission
//! takes about a given time.

use crate::error::Result;
use crate::gpu::Span;
use std::sync::{Mutex, PoisonError};

/// Consecutive entries of a list of shadow-map tiles or build steps, which one submission to the device processes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Batch {
    first: u32,
    count: u32,
}

/// Size of one entry in the list of shadow-map tiles on the device, bytes.
const ENTRY_BYTES: u64 = 4;

impl Batch {
    /// Returns the batch of all entries of a list.
    pub fn all(count: u32) -> Self {
        Self { first: 0, count }
    }

    /// Binds one batch's part of a list of shadow-map tiles, so that the shader sees only this part.
    pub fn binding<'a>(&self, list: &'a wgpu::Buffer) -> wgpu::BindingResource<'a> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: list,
            offset: u64::from(self.first) * ENTRY_BYTES,
            size: std::num::NonZeroU64::new(u64::from(self.count) * ENTRY_BYTES),
        })
    }

    /// Returns the range of list entries (shadow-map tiles or build steps) that this batch processes.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// Returns the number of list entries (shadow-map tiles or build steps) in this batch.
    pub fn count(&self) -> u32 {
        self.count
    }
}

/// Choice of the batch size for the build passes of a shadow map, from the intended duration of a submission and the
/// measured speed of each pass.
#[derive(Debug)]
pub struct TilePace {
    target_ms: f64,
    /// Measured speed of each build pass of a shadow map, in tiles (or steps) per millisecond.
    rates: Mutex<Vec<(&'static str, f64)>>,
}

/// Number of shadow-map tiles in the first batch, before the speed of the adapter is known.
const FIRST_TILES: u32 = 16;
/// Largest factor by which the speed assumed for a shadow-map build pass rises from one batch to the next. A batch of
/// empty tiles is fast, but the next batch may not be.
const FASTER: f64 = 1.25;

impl TilePace {
    /// Starts the choice of batch sizes for shadow-map builds, for submissions of about `target_ms`. With an infinite
    /// target, one submission processes all tiles.
    pub fn new(target_ms: f64) -> Self {
        Self { target_ms, rates: Mutex::default() }
    }

    /// Returns a choice for submissions of the same duration, without measured speeds.
    pub fn unlearned(&self) -> Self {
        Self::new(self.target_ms)
    }

    /// Whether the duration of submissions during a shadow-map build is limited. If the host's clock measures
    /// this duration, the device has to be idle before each submission.
    pub fn is_limited(&self) -> bool {
        self.target_ms.is_finite()
    }

    /// Returns the expected duration of a pass over `count` list entries, as a share of the intended duration of a
    /// submission.
    pub(super) fn share(&self, pass: &'static str, count: u32) -> f64 {
        if self.is_limited() { f64::from(count) / f64::from(self.most(pass).max(1)) } else { 0.0 }
    }

    /// Records the duration of a pass that a submission of several passes ran.
    pub fn learn_deferred(&self, pass: &'static str, count: u32, span: Span) {
        if count > 0 && span.gpu_ms.is_some() {
            self.learn(pass, count, span);
        }
    }

    /// Returns the alignment of batches in a list of shadow-map tiles: each batch starts at a multiple of this number
    /// of entries.
    pub(super) fn granule(limits: &wgpu::Limits) -> u32 {
        limits.min_storage_buffer_offset_alignment.div_ceil(ENTRY_BYTES as u32).max(1)
    }

    /// Runs a build pass of a shadow map over `count` list entries (tiles or steps) in batches, and returns the sum
    /// of the durations. An empty list is one empty batch, which runs no workgroup.
    pub(super) fn run_batches(
        &self,
        pass: &'static str,
        count: u32,
        granule: u32,
        mut submit: impl FnMut(Batch) -> Result<Span>,
    ) -> Result<Span> {
        let mut total: Option<Span> = None;
        let mut first = 0;
        loop {
            let most = self.most(pass) / granule * granule;
            let batch = Batch { first, count: most.max(granule).min(count - first) };
            let span = submit(batch)?;
            if batch.count > 0 {
                self.learn(pass, batch.count, span);
            }
            let sum = total.map_or(span, |sum| sum.plus(span));
            total = Some(sum);
            first += batch.count;
            if first >= count {
                return Ok(sum);
            }
        }
    }

    fn most(&self, pass: &'static str) -> u32 {
        if self.target_ms.is_infinite() {
            return u32::MAX;
        }
        let rates = self.rates.lock().unwrap_or_else(PoisonError::into_inner);
        let rate = rates.iter().find(|(name, _)| *name == pass).map(|(_, rate)| *rate);
        rate.map_or(FIRST_TILES, |rate| (rate * self.target_ms) as u32)
    }

    fn learn(&self, pass: &'static str, tiles: u32, span: Span) {
        let now = f64::from(tiles) / span.best().0.max(0.05);
        let mut rates = self.rates.lock().unwrap_or_else(PoisonError::into_inner);
        match rates.iter_mut().find(|(name, _)| *name == pass) {
            Some((_, rate)) => *rate = now.min(*rate * FASTER),
            None => rates.push((pass, now)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batches(pace: &TilePace, tiles: u32, ms_a_tile: impl Fn(u32) -> f64) -> Vec<Batch> {
        let mut all = Vec::new();
        let submit = |batch: Batch| {
            all.push(batch);
            let wall_ms = (batch.first..batch.first + batch.count).map(&ms_a_tile).sum();
            Ok(Span { gpu_ms: None, wall_ms })
        };
        pace.run_batches("test", tiles, 4, submit).unwrap();
        all
    }

    #[test]
    fn batches_cover_the_list_and_settle_at_the_target() {
        let pace = TilePace::new(20.0);
        for _ in 0..3 {
            let all = batches(&pace, 1003, |_| 0.5);
            let mut next = 0;
            for batch in &all {
                assert_eq!(batch.first, next);
                assert!(batch.first % 4 == 0 && batch.count > 0, "{batch:?}");
                next += batch.count;
            }
            assert_eq!(next, 1003);
            assert!(all.iter().all(|p| p.count <= 40), "20 ms at 0.5 ms a tile: {all:?}");
        }
        let settled = batches(&pace, 1003, |_| 0.5);
        assert!(settled.len() <= 1003 / 40 + 2, "{}", settled.len());
    }

    #[test]
    fn empty_tiles_do_not_make_the_next_batch_long() {
        let pace = TilePace::new(20.0);
        batches(&pace, 400, |_| 1.0);
        let all = batches(&pace, 400, |i| if i < 40 { 1e-3 } else { 1.0 });
        assert!(all.iter().all(|p| p.count <= 32), "{all:?}");
    }

    #[test]
    fn one_batch_without_a_target_and_an_empty_one_for_an_empty_list() {
        let pace = TilePace::new(f64::INFINITY);
        assert_eq!(batches(&pace, 70_000, |_| 1.0), [Batch { first: 0, count: 70_000 }]);
        assert_eq!(batches(&pace, 70_000, |_| 1.0).len(), 1);
        for pace in [pace, TilePace::new(1.0)] {
            assert_eq!(batches(&pace, 0, |_| 1.0), [Batch { first: 0, count: 0 }]);
        }
    }
}
