//! Takes the tiles of a map apart into submissions, each about as long as the renderer wants it.

use super::shader::shape_of;
use crate::gpu::{Gpu, Span};
use std::sync::{Mutex, PoisonError};

/// Some neighbours in a list of tiles, built by one submission.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TilePart {
    first: u32,
    count: u32,
}

/// Bytes of an entry in a list of tiles.
const ENTRY_BYTES: u64 = 4;

impl TilePart {
    /// These tiles of the list: shaders see them as the whole of it.
    pub fn binding<'a>(&self, list: &'a wgpu::Buffer) -> wgpu::BindingResource<'a> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: list,
            offset: u64::from(self.first) * ENTRY_BYTES,
            size: std::num::NonZeroU64::new(u64::from(self.count) * ENTRY_BYTES),
        })
    }

    /// Numbers of the things in it.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// A workgroup a tile.
    pub fn workgroups(&self) -> [u32; 3] {
        shape_of(self.count)
    }
}

/// How long one submission of a map's build may keep the queue, and how many tiles have fitted into that.
#[derive(Debug)]
pub struct TilePace {
    target_ms: f64,
    /// By the build pass.
    tiles_per_ms: Mutex<Vec<(&'static str, f64)>>,
}

/// Until it is known how fast the adapter is.
const FIRST_TILES: u32 = 16;
/// A slow part counts at once, a fast one little by little: empty tiles say nothing of the next.
const FASTER: f64 = 1.25;

impl TilePace {
    /// Without end (`f64::INFINITY`) all tiles are built at once.
    pub fn new(target_ms: f64) -> Self {
        Self { target_ms, tiles_per_ms: Mutex::default() }
    }

    /// Takes a list of `tiles` tiles apart for a pass.
    pub(super) fn parts(&self, gpu: &Gpu, pass: &'static str, tiles: u32) -> TileParts<'_> {
        let offset_bytes = gpu.device.limits().min_storage_buffer_offset_alignment;
        self.in_granules(pass, tiles, offset_bytes.div_ceil(ENTRY_BYTES as u32).max(1))
    }

    /// Takes so many things apart, of which any may begin a part.
    pub(super) fn single_parts(&self, pass: &'static str, things: u32) -> TileParts<'_> {
        self.in_granules(pass, things, 1)
    }

    fn in_granules(&self, pass: &'static str, tiles: u32, granule: u32) -> TileParts<'_> {
        TileParts { pace: self, pass, tiles, next: 0, granule, building: 0 }
    }

    fn most(&self, pass: &'static str) -> u32 {
        if self.target_ms.is_infinite() {
            return u32::MAX;
        }
        let rates = self.tiles_per_ms.lock().unwrap_or_else(PoisonError::into_inner);
        let rate = rates.iter().find(|(name, _)| *name == pass).map(|(_, rate)| *rate);
        rate.map_or(FIRST_TILES, |rate| (rate * self.target_ms) as u32)
    }

    fn learn(&self, pass: &'static str, tiles: u32, span: Span) {
        let now = f64::from(tiles) / span.wall_ms.max(0.05);
        let mut rates = self.tiles_per_ms.lock().unwrap_or_else(PoisonError::into_inner);
        match rates.iter_mut().find(|(name, _)| *name == pass) {
            Some((_, rate)) => *rate = now.min(*rate * FASTER),
            None => rates.push((pass, now)),
        }
    }
}

/// A list of tiles taken apart: at least one part, which is empty where there are no tiles.
pub(super) struct TileParts<'a> {
    pace: &'a TilePace,
    pass: &'static str,
    tiles: u32,
    next: u32,
    /// Offsets into the list are multiples of so many tiles.
    granule: u32,
    /// Tiles of the part that is being built.
    building: u32,
}

impl TileParts<'_> {
    /// The next part, once the queue is free; `last` is what the one before took.
    pub fn next(&mut self, gpu: &Gpu, last: Option<Span>) -> Option<TilePart> {
        let part = self.advance(last)?;
        if self.pace.target_ms.is_finite() {
            // What others have submitted meanwhile is no part of its time; a lost device shows in the part itself.
            let _ = gpu.wait_for(gpu.submit([]));
        }
        Some(part)
    }

    fn advance(&mut self, last: Option<Span>) -> Option<TilePart> {
        if let Some(span) = last.filter(|_| self.building > 0) {
            self.pace.learn(self.pass, self.building, span);
        }
        if self.next > 0 && self.next >= self.tiles {
            return None;
        }
        let most = self.pace.most(self.pass) / self.granule * self.granule;
        self.building = most.max(self.granule).min(self.tiles - self.next);
        let part = TilePart { first: self.next, count: self.building };
        // An empty list is one part, too.
        self.next += self.building.max(1);
        Some(part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(pace: &TilePace, tiles: u32, ms_a_tile: impl Fn(u32) -> f64) -> Vec<TilePart> {
        let mut parts = TileParts { pace, pass: "test", tiles, next: 0, granule: 4, building: 0 };
        let mut last = None;
        let mut all = Vec::new();
        while let Some(part) = parts.advance(last) {
            let wall_ms = (part.first..part.first + part.count).map(&ms_a_tile).sum();
            last = Some(Span { gpu_ms: None, wall_ms });
            all.push(part);
        }
        all
    }

    #[test]
    fn parts_cover_the_list_and_settle_at_the_target() {
        let pace = TilePace::new(20.0);
        for _ in 0..3 {
            let all = parts(&pace, 1003, |_| 0.5);
            let mut next = 0;
            for part in &all {
                assert_eq!(part.first, next);
                assert!(part.first % 4 == 0 && part.count > 0, "{part:?}");
                next += part.count;
            }
            assert_eq!(next, 1003);
            assert!(all.iter().all(|p| p.count <= 40), "20 ms at 0.5 ms a tile: {all:?}");
        }
        let settled = parts(&pace, 1003, |_| 0.5);
        assert!(settled.len() <= 1003 / 40 + 2, "{}", settled.len());
    }

    #[test]
    fn empty_tiles_do_not_make_the_next_part_long() {
        let pace = TilePace::new(20.0);
        parts(&pace, 400, |_| 1.0);
        let all = parts(&pace, 400, |i| if i < 40 { 1e-3 } else { 1.0 });
        assert!(all.iter().all(|p| p.count <= 32), "{all:?}");
    }

    #[test]
    fn without_a_target_there_is_one_part_and_of_nothing_an_empty_one() {
        let pace = TilePace::new(f64::INFINITY);
        assert_eq!(parts(&pace, 70_000, |_| 1.0), [TilePart { first: 0, count: 70_000 }]);
        assert_eq!(parts(&pace, 70_000, |_| 1.0).len(), 1);
        for pace in [pace, TilePace::new(1.0)] {
            assert_eq!(parts(&pace, 0, |_| 1.0), [TilePart { first: 0, count: 0 }]);
        }
    }
}
