//! Pages of a volume that exceed the pool on the device. Rays stop where a page is missing; blocks of pages become
//! resident one after the other, in the order of the rays, until no ray waits.

use super::blocks::{BlockTree, PageBox, Rays, StoredCounts};
use super::page_pool::{Page, PagePool};
use super::pages::PAGE_CELLS;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, StorageBuffer, read_back};
use crate::volume::Volume;
use glam::{DAffine3, DVec3};
use itertools::Itertools as _;
use serde::Serialize;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Flag in an entry of the page table: the page is not resident.
pub(super) const MISSING: u32 = 1 << 31;
/// Flag in an entry of the page table: the page or one of its neighbours is not resident.
pub(super) const NEAR_MISSING: u32 = 1 << 30;
/// Binding of the pages for which rays wait, in bind group 0.
pub(super) const WAITING_BINDING: u32 = 13;

/// Distance from a point, in voxels along each axis, up to which all pages are resident with [`PageReach::Neighbours`].
pub const RESIDENT_VOXELS: f64 = PAGE_CELLS as f64;

/// Pages that shaders read at a point of the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PageReach {
    /// Page of the point's cell alone: light rays that march cell by cell.
    Own,
    /// Page of the point's cell and all neighbours: eye rays and queries, with gradients and short shadow rays.
    Neighbours,
}

/// Rays of a pass over a volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PassRays {
    /// Rays of one direction, in voxel index coordinates.
    Along(DVec3),
    /// Rays from a point, in voxel index coordinates.
    From(DVec3),
}

/// Blocks of pages that became resident one after the other, and the cost of that.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct StreamUsage {
    /// Number of blocks of pages that became resident.
    pub blocks: u64,
    /// Number of pages that were read and uploaded.
    pub pages: u64,
    /// Host time to read and to upload them, ms.
    pub ms: f64,
}

/// Pages of a volume, of which a pool holds some at a time.
pub struct PageStream {
    pool: Arc<PagePool>,
    /// Contents of each page of the volume, x fastest.
    pages: Vec<Page>,
    /// Number of pages along each axis.
    counts: [usize; 3],
    /// Pages of a constant value, which stay resident.
    constants: Vec<Page>,
    stored: StoredCounts,
    /// Blocks of pages for rays that read their own page, and for those that read its neighbours, too.
    own: BlockTree,
    with_neighbours: BlockTree,
    table: wgpu::Texture,
    /// One bit for each page: whether a ray waits for it.
    waiting: wgpu::Buffer,
    uploaded: [AtomicU64; 3],
}

impl PageStream {
    /// Prepares the streaming of pages through a pool. Returns `None` if the pool is too small for a page and its
    /// neighbours.
    ///
    /// # Errors
    /// The device is out of memory.
    pub(super) fn new(
        gpu: &Gpu,
        pool: Arc<PagePool>,
        pages: Vec<Page>,
        counts: [usize; 3],
    ) -> Result<Option<Self>> {
        let is_stored = |page: usize| matches!(pages[page], Page::Voxels(_));
        let stored = StoredCounts::of(counts, is_stored);
        let constants: Vec<Page> =
            pages.iter().filter(|page| matches!(page, Page::Constant { .. })).copied().unique().collect();
        let Some(most) = pool.len().checked_sub(constants.len()) else { return Ok(None) };
        let [own, with_neighbours] = [0, 1].map(|reach| BlockTree::of(&stored, reach, most));
        let (Some(own), Some(with_neighbours)) = (own, with_neighbours) else { return Ok(None) };
        pool.set_streamed();
        let table = pool.empty_table(gpu);
        let words = pages.len().div_ceil(32) as u64;
        let waiting = StorageBuffer::zeroed(gpu, "pages for which rays wait", 4 * words)?;
        Ok(Some(Self {
            pool,
            pages,
            counts,
            constants,
            stored,
            own,
            with_neighbours,
            table,
            waiting,
            uploaded: Default::default(),
        }))
    }

    /// View of the page table.
    pub(super) fn table(&self) -> wgpu::TextureView {
        self.table.create_view(&Default::default())
    }

    /// Buffer with one bit for each page, which shaders set where rays wait.
    pub(super) fn waiting(&self) -> &wgpu::Buffer {
        &self.waiting
    }

    /// Returns the number of blocks for rays that read the neighbours of their page, too.
    pub fn blocks(&self) -> usize {
        self.with_neighbours.len()
    }

    /// Returns the number of pages that are resident now.
    pub fn resident_pages(&self) -> usize {
        self.pool.stored_len()
    }

    /// Returns what has become resident since the stream was made.
    pub fn usage(&self) -> StreamUsage {
        let [blocks, pages, micros] = self.uploaded.each_ref().map(|n| n.load(Ordering::Relaxed));
        StreamUsage { blocks, pages, ms: micros as f64 / 1e3 }
    }

    /// Runs a pass again and again, until none of its rays waits for a page. Before each repetition, the first block with
    /// a page that a ray waits for becomes resident. Returns `false` as soon as `pass` does.
    ///
    /// # Errors
    /// The pass fails, voxels cannot be read, or the device is lost.
    pub fn sweep(
        &self,
        gpu: &Gpu,
        volume: &Volume,
        (rays, reach): (PassRays, PageReach),
        mut pass: impl FnMut() -> Result<bool>,
    ) -> Result<bool> {
        let _one_at_a_time = self.pool.turn();
        let page_from_index = DAffine3::from_scale(DVec3::splat(1.0 / PAGE_CELLS as f64));
        let rays = match rays {
            PassRays::Along(direction) => Rays::Along(direction),
            PassRays::From(point) => Rays::From(page_from_index.transform_point3(point)),
        };
        let tree = match reach {
            PageReach::Own => &self.own,
            PageReach::Neighbours => &self.with_neighbours,
        };
        self.make_resident(gpu, volume, &[])?;
        let none = vec![0; 4 * self.pages.len().div_ceil(32)];
        gpu.queue.write_buffer(&self.waiting, 0, &none);
        let mut before = None;
        loop {
            if !pass()? {
                return Ok(false);
            }
            let words = read_back::<u32>(gpu, &self.waiting, self.pages.len().div_ceil(32))?;
            let waits = |page: usize| words[page / 32] >> (page % 32) & 1 == 1;
            let Some(block) = tree.first(rays, &mut |block| self.numbers(block).any(waits)) else {
                return Ok(true);
            };
            if before.as_ref() == Some(&block) {
                let why = format!("rays wait for pages {block:?}, which are resident");
                return Err(Error::runtime("cannot march through", &volume.provenance.source, why));
            }
            before = Some(block.clone());
            gpu.queue.write_buffer(&self.waiting, 0, &none);
            let around = match reach {
                PageReach::Own => block,
                PageReach::Neighbours => self.stored.grown(&block, 1),
            };
            let stored = self.numbers(&around).map(|page| self.pages[page]);
            let wanted: Vec<Page> = stored.filter(|page| matches!(page, Page::Voxels(_))).collect();
            self.make_resident(gpu, volume, &wanted)?;
        }
    }

    /// Makes some pages resident, and all of a constant value. Then writes the page table.
    fn make_resident(&self, gpu: &Gpu, volume: &Volume, wanted: &[Page]) -> Result<()> {
        let start = Instant::now();
        let uploaded = self.pool.replace(gpu, volume, &[&self.constants, wanted].concat())?;
        let entries = self.pool.entries(self.pages.iter());
        let mut flagged: Vec<u32> = entries.iter().map(|entry| entry.unwrap_or(MISSING)).collect();
        for page in (0..entries.len()).filter(|page| entries[*page].is_none()) {
            let around = self.stored.grown(&self.box_of(page), 1);
            self.numbers(&around).for_each(|near| flagged[near] |= NEAR_MISSING);
        }
        self.pool.write_table(gpu, &self.table, &flagged);
        let micros = start.elapsed().as_micros() as u64;
        let counts = [u64::from(!wanted.is_empty()), uploaded as u64, micros];
        self.uploaded.iter().zip(counts).for_each(|(sum, more)| {
            sum.fetch_add(more, Ordering::Relaxed);
        });
        Ok(())
    }

    fn box_of(&self, page: usize) -> PageBox {
        let [nx, ny, _] = self.counts;
        [page % nx, page / nx % ny, page / (nx * ny)].map(|at| at..at + 1)
    }

    /// Returns the numbers of the pages in a box.
    fn numbers(&self, [x, y, z]: &PageBox) -> impl Iterator<Item = usize> + use<> {
        let [nx, ny, _] = self.counts;
        let (x, y) = (x.clone(), y.clone());
        z.clone().flat_map(move |z| {
            let x = x.clone();
            y.clone().flat_map(move |y| x.clone().map(move |x| (z * ny + y) * nx + x))
        })
    }
}
