//! Pages of a volume: cubes of cells that lie in any order in one 3-D texture. Pages without extinction are not stored.
//!
//! Neighbouring pages share the voxels at their border, so that every cell lies in one page.

use super::ActiveBricks;
use super::active_bricks::EmptyBricks;
use crate::volume::{BRICK_CELLS, Bricks, RankSet};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Number of cells along each side of a page; a power of 2.
pub(super) const PAGE_CELLS: usize = 32;
/// Number of voxels along each side of a page.
pub(super) const PAGE_VOXELS: usize = PAGE_CELLS + 1;
/// Distance from an active brick, in bricks, up to which shaders read values: the last sample before the brick, at a step of
/// up to 8 voxels, and the differences of its gradient.
const REACH_BRICKS: u8 = 3;
/// Bits of one coordinate of a page in an entry of the page table.
const SLOT_BITS: u32 = 10;

/// Whether 3-D textures of at most `side` texels a side hold a volume of `dims` voxels: in one texture, or as pages that all
/// have extinction.
pub fn holds_volume(dims: [usize; 3], side: usize) -> bool {
    let is_whole = dims.iter().all(|n| *n <= side);
    let grid = PageGrid::of(dims);
    let fits = |counts: [usize; 3]| counts.iter().all(|n| *n <= side);
    let as_pages = || grid.checked_len().is_some_and(|pages| SlotGrid::of(pages + 1, side).is_some());
    is_whole || (fits(Bricks::counts_for(dims)) && fits(grid.counts) && as_pages())
}

/// Pages of a volume, numbered with x fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PageGrid {
    /// Number of voxels of the volume along each axis.
    dims: [usize; 3],
    /// Number of pages along each axis.
    pub counts: [usize; 3],
}

impl PageGrid {
    /// Divides a volume of `dims` voxels into pages.
    pub fn of(dims: [usize; 3]) -> Self {
        Self { dims, counts: dims.map(|n| (n - 1).div_ceil(PAGE_CELLS).max(1)) }
    }

    /// Number of pages.
    pub fn len(&self) -> usize {
        self.counts.iter().product()
    }

    fn checked_len(&self) -> Option<usize> {
        self.counts.iter().try_fold(1usize, |product, n| product.checked_mul(*n))
    }

    /// Returns the voxels of a page along each axis. Pages at the upper border of the volume have fewer.
    pub fn voxels(&self, page: usize) -> [Range<usize>; 3] {
        let [nx, ny, _] = self.counts;
        let at = [page % nx, page / nx % ny, page / (nx * ny)];
        std::array::from_fn(|a| {
            let first = PAGE_CELLS * at[a];
            first..(first + PAGE_VOXELS).min(self.dims[a])
        })
    }

    /// Decides which pages of a volume are stored: those of active bricks and of bricks near them, and with segmentation
    /// labels those with several labels. Returns what stands in each other page.
    ///
    /// An empty page has values between two intervals of values with extinction. Its neighbours share voxels with it, and so
    /// have values there too, unless they have extinction. One value from there can stand for all of them: no ray finds
    /// extinction between it and the values of a neighbour.
    pub fn layout(&self, active: &ActiveBricks, empty: &EmptyBricks) -> Vec<Content> {
        let contents: Vec<Content> = (0..self.len())
            .into_par_iter()
            .map(|page| {
                let [xs, ys, zs] = self.bricks_of(page, active.counts);
                let [bx, by, _] = active.counts;
                let all = || {
                    let rows = zs.clone().flat_map(|z| ys.clone().map(move |y| (z * by + y) * bx));
                    rows.flat_map(|row| xs.clone().map(move |x| row + x))
                };
                let rank =
                    empty.labels.map_or(Some(0), |labels| RankSet::only(all().map(|b| labels.sets[b])));
                let is_near = all().any(|brick| active.distance[brick] <= REACH_BRICKS);
                let Some(rank) = rank.filter(|_| !is_near) else { return Content::Stored };
                let gaps = all().filter_map(|brick| empty.gap(brick, rank));
                let least = gaps.reduce(|a, b| if b.1 < a.1 { b } else { a });
                least.map_or(Content::Clipped, |(gap, value)| Content::Empty(Gap { rank, gap, value }))
            })
            .collect();
        let mut least = HashMap::<(usize, usize), f64>::new();
        for gap in contents.iter().filter_map(Content::gap) {
            let known = least.entry((gap.rank, gap.gap)).or_insert(gap.value);
            *known = known.min(gap.value);
        }
        let with_least = |content| match content {
            Content::Empty(gap) => Content::Empty(Gap { value: least[&(gap.rank, gap.gap)], ..gap }),
            other => other,
        };
        contents.into_iter().map(with_least).collect()
    }

    /// Returns the bricks with cells in a page, along each axis.
    fn bricks_of(&self, page: usize, counts: [usize; 3]) -> [Range<usize>; 3] {
        let voxels = self.voxels(page);
        // Cell c interpolates the voxels c - 1 and c.
        std::array::from_fn(|a| {
            let Range { start, end } = voxels[a];
            start / BRICK_CELLS..(end / BRICK_CELLS + 1).min(counts[a])
        })
    }
}

/// Value that stands for those of an empty page.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gap {
    /// Index of the label of all voxels of the page; 0 without labels.
    pub rank: usize,
    /// Number of intervals with extinction below the value.
    gap: usize,
    /// Least value of all empty pages of the same label in the same gap.
    pub value: f64,
}

/// Contents of a page on the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Content {
    /// Its voxels.
    Stored,
    /// One value without extinction.
    Empty(Gap),
    /// Anything: clip planes remove the whole page.
    Clipped,
}

impl Content {
    /// Value that stands for those of the page.
    pub fn gap(&self) -> Option<&Gap> {
        match self {
            Self::Empty(gap) => Some(gap),
            _ => None,
        }
    }
}

/// Places of pages in a 3-D texture: a grid of slots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SlotGrid {
    /// Number of slots along each axis of the texture.
    counts: [usize; 3],
}

impl SlotGrid {
    /// Returns a grid of at least `slots` slots in a texture of at most `limit` texels a side; `None` if it holds fewer.
    pub fn of(slots: usize, limit: usize) -> Option<Self> {
        let most = (limit / PAGE_VOXELS).min(1 << SLOT_BITS);
        let with_rows = |x: usize| (1..=x).map(move |y| [x, y, slots.div_ceil(x * y).max(1)]);
        let all = (1..=most).flat_map(with_rows).filter(|counts| counts[2] <= most);
        // Of those with equally many slots, the one with the most equal sides.
        let counts = all.min_by_key(|[x, y, z]| (x * y * z, x + y + z))?;
        Some(Self { counts })
    }

    /// Number of slots.
    pub fn len(&self) -> usize {
        self.counts.iter().product()
    }

    /// Number of texels of the texture along each axis.
    pub fn texels(&self) -> [u32; 3] {
        self.counts.map(|n| (n * PAGE_VOXELS) as u32)
    }

    fn place(&self, slot: usize) -> [usize; 3] {
        let [x, y, _] = self.counts;
        [slot % x, slot / x % y, slot / (x * y)]
    }

    /// Returns the first texel of a slot.
    pub fn first_texel(&self, slot: usize) -> [u32; 3] {
        self.place(slot).map(|at| (at * PAGE_VOXELS) as u32)
    }

    /// Returns the entry of the page table for a page in a slot: the place of the slot, 10 bits an axis.
    pub fn entry(&self, slot: usize) -> u32 {
        let [x, y, z] = self.place(slot).map(|at| at as u32);
        x | y << SLOT_BITS | z << (2 * SLOT_BITS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::{Quantity, TransferFunction};
    use crate::volume::{Provenance, Scaling, Volume};
    use glam::DAffine3;
    use ndarray::Array3;

    #[test]
    fn every_cell_lies_in_one_page() {
        for dims in [[1, 33, 34], [32, 65, 100], [2, 2, 2]] {
            let grid = PageGrid::of(dims);
            let pages: Vec<_> = (0..grid.len()).map(|page| grid.voxels(page)).collect();
            for axis in 0..3 {
                for low in 0..dims[axis].saturating_sub(1).max(1) {
                    let high = (low + 1).min(dims[axis] - 1);
                    let number = (low / PAGE_CELLS).min(grid.counts[axis] - 1);
                    let found = pages.iter().map(|page| &page[axis]);
                    let own = found.filter(|range| range.start == number * PAGE_CELLS);
                    let holds = own.map(|range| range.contains(&low) && range.contains(&high));
                    assert_eq!(holds.reduce(|a, b| a && b), Some(true), "{dims:?} {low}");
                }
            }
            assert!(pages.iter().flatten().all(|range| (1..=PAGE_VOXELS).contains(&range.len())));
        }
    }

    #[test]
    fn pages_near_extinction_are_needed_and_no_others() {
        let dims = [130, 70, 40];
        let grid = PageGrid::of(dims);
        assert_eq!(grid.counts, [5, 3, 2]);
        for spot in [[64, 35, 20], [62, 35, 20], [32, 32, 32], [129, 69, 39], [0, 0, 0], [41, 20, 10]] {
            let at = |(k, j, i): (usize, usize, usize)| if [i, j, k] == spot { 9.0_f32 } else { 0.0 };
            let voxels = Array3::from_shape_fn((40, 70, 130), at);
            let volume = Volume::new(
                voxels.into(),
                Scaling::IDENTITY,
                DAffine3::IDENTITY,
                Provenance::new("", "", ""),
            )
            .unwrap();
            let tf = TransferFunction::new(Quantity::Extinction, &[(1.0, 0.0), (9.0, 1.0)]);
            let active = ActiveBricks::of(volume.bricks(), &tf);
            let empty = EmptyBricks::of(volume.bricks(), &active, &tf, 0.0);
            let contents = grid.layout(&active, &empty);
            for (page, content) in contents.iter().enumerate() {
                let gap = |a: usize| {
                    let Range { start, end } = grid.voxels(page)[a];
                    start.saturating_sub(spot[a]).max((spot[a] + 1).saturating_sub(end))
                };
                let distance = (0..3).map(gap).max().unwrap();
                let is_needed = *content == Content::Stored;
                assert!(is_needed || content.gap().is_some_and(|gap| gap.value == 0.0));
                // Active bricks end within a brick of the voxel.
                assert!(is_needed || distance > 9, "{spot:?}: page {page}, {distance} voxels away");
                assert!(!is_needed || distance <= 5 * BRICK_CELLS, "{spot:?}: page {page}");
            }
        }
    }

    #[test]
    fn slots_are_disjoint_and_have_entries() {
        let slots = SlotGrid::of(30, 200).unwrap();
        assert_eq!((slots.len(), slots.texels()), (30, [99, 66, 165]));
        let mut firsts: Vec<_> = (0..slots.len()).map(|slot| slots.first_texel(slot)).collect();
        for (slot, first) in firsts.iter().enumerate() {
            let entry = slots.entry(slot);
            let place = [entry & 1023, entry >> 10 & 1023, entry >> 20];
            assert_eq!(place.map(|at| 33 * at), *first);
        }
        firsts.sort_unstable();
        firsts.dedup();
        assert_eq!(firsts.len(), slots.len());
        assert!(SlotGrid::of(216, 200).is_some() && SlotGrid::of(217, 200).is_none());
    }

    #[test]
    fn long_volumes_fit_as_pages() {
        assert!(holds_volume([512, 512, 2380], 2048) && holds_volume([16, 16, 16], 16));
        for dims in [[1024, 1024, 2500], [usize::MAX - 4, 1, 1], [usize::MAX / 8; 3]] {
            assert!(!holds_volume(dims, 1024), "{dims:?}");
        }
    }
}
