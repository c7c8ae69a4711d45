//! Pool of pages of a volume on the graphics device: a 3-D texture with a slot for each stored page, and page tables.

use super::pages::{PAGE_VOXELS, PageGrid, SlotGrid};
use super::texel_packing::TexelPacking;
use crate::error::Result;
use crate::gpu::{Gpu, solid_texture, write_texels};
use crate::volume::{Element, Labels, Volume, VoxelBlock};
use crate::with_voxels;
use itertools::Itertools as _;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use wgpu::TextureFormat;

/// Number of pages that are packed and submitted together, which limits the memory of pending copies.
const PAGES_AT_ONCE: usize = 64;

/// Sides of a page in texels, the bytes of its values, and its labels.
type PackedPage = ([u32; 3], Vec<u8>, Option<Vec<u8>>);

/// Contents of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Page {
    /// Voxels of the page with this number.
    Voxels(usize),
    /// One value everywhere, given by its bits, with the label of this index.
    Constant { value_bits: u64, rank: u8 },
}

/// Pool of pages of a volume on the device. [`Self::store`] never replaces a page, so that all page tables stay valid.
/// [`Self::replace`] serves volumes that exceed the pool.
pub(super) struct PagePool {
    grid: PageGrid,
    slots: SlotGrid,
    packing: TexelPacking,
    values: wgpu::Texture,
    labels: Option<wgpu::Texture>,
    /// Slot of each stored page.
    stored: Mutex<HashMap<Page, usize>>,
    /// Whether blocks of pages replace each other in the pool.
    is_streamed: AtomicBool,
    /// Blocks of one sweep at a time are in the pool.
    turn: Mutex<()>,
}

impl PagePool {
    /// Returns the number of bytes of a page of a volume.
    pub fn page_bytes(volume: &Volume, packing: &TexelPacking) -> u64 {
        PAGE_VOXELS.pow(3) as u64 * (packing.bytes() + u64::from(volume.labels().is_some()))
    }

    /// Creates a pool with at least `slots` slots; `None` if they exceed the adapter's 3-D textures. The caller looks for
    /// device errors.
    pub fn new(gpu: &Gpu, volume: &Volume, packing: TexelPacking, slots: usize) -> Option<Self> {
        let limit = gpu.device.limits().max_texture_dimension_3d as usize;
        let slots = SlotGrid::of(slots, limit)?;
        let texture = |label, format| solid_texture(gpu, label, format, slots.texels());
        Some(Self {
            grid: PageGrid::of(volume.dims()),
            slots,
            packing,
            values: texture("pages", packing.format),
            labels: volume.labels().map(|_| texture("pages of labels", TextureFormat::R8Uint)),
            stored: Mutex::default(),
            is_streamed: AtomicBool::new(false),
            turn: Mutex::default(),
        })
    }

    /// Creates a pool with as many slots as possible, and at most `most`; `None` if there is none.
    pub fn within(gpu: &Gpu, volume: &Volume, packing: TexelPacking, most: usize) -> Option<Self> {
        let limit = gpu.device.limits().max_texture_dimension_3d as usize;
        let most = most.min((limit / PAGE_VOXELS).pow(3));
        let fits = |slots: &usize| SlotGrid::of(*slots, limit).is_some_and(|grid| grid.len() <= most);
        Self::new(gpu, volume, packing, (1..=most).rev().find(fits)?)
    }

    /// Whether blocks of pages replace each other in the pool, so that no page stays.
    pub fn is_streamed(&self) -> bool {
        self.is_streamed.load(Ordering::Relaxed)
    }

    /// Waits until no other sweep replaces pages of the pool, and keeps others from it as long as the guard exists.
    pub fn turn(&self) -> MutexGuard<'_, ()> {
        self.turn.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets blocks of pages replace each other in the pool.
    pub fn set_streamed(&self) {
        self.is_streamed.store(true, Ordering::Relaxed);
    }

    /// Views of the textures of values and labels.
    pub fn views(&self) -> (wgpu::TextureView, Option<wgpu::TextureView>) {
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        (view(&self.values), self.labels.as_ref().map(view))
    }

    /// Number of slots.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Returns the number of pages that it holds now.
    pub fn stored_len(&self) -> usize {
        self.stored.lock().unwrap_or_else(PoisonError::into_inner).len()
    }

    /// Number of bytes of the textures.
    pub fn bytes(&self) -> u64 {
        let texel_bytes = self.packing.bytes() + u64::from(self.labels.is_some());
        self.slots.texels().map(u64::from).iter().product::<u64>() * texel_bytes
    }

    /// Stores the pages that are missing, and returns the slots of all of them in their order; `None` if the slots that
    /// are left do not suffice.
    ///
    /// # Errors
    /// Voxels that are read in parts cannot be read.
    pub fn store(&self, gpu: &Gpu, volume: &Volume, pages: &[Page]) -> Result<Option<Vec<usize>>> {
        let mut stored = self.stored.lock().unwrap_or_else(PoisonError::into_inner);
        let missing = missing_of(&stored, pages);
        if stored.len() + missing.len() > self.slots.len() {
            return Ok(None);
        }
        let new: Vec<(Page, usize)> = missing.into_iter().zip(stored.len()..).collect();
        self.upload(gpu, volume, &new)?;
        stored.extend(new);
        Ok(Some(pages.iter().filter_map(|page| stored.get(page).copied()).collect()))
    }

    /// Stores the pages that are missing in place of others, and returns the number of pages that were uploaded. The pool
    /// must have a slot for each page.
    ///
    /// # Errors
    /// Voxels that are read in parts cannot be read.
    pub fn replace(&self, gpu: &Gpu, volume: &Volume, pages: &[Page]) -> Result<usize> {
        let mut stored = self.stored.lock().unwrap_or_else(PoisonError::into_inner);
        let missing = missing_of(&stored, pages);
        let wanted: HashSet<Page> = pages.iter().copied().collect();
        let in_use: HashSet<usize> = stored.values().copied().collect();
        let unused = (0..self.slots.len()).filter(|slot| !in_use.contains(slot));
        let replaced = stored.iter().filter(|(page, _)| !wanted.contains(page)).map(|(_, slot)| *slot);
        // Unused slots first: pages that stay may serve another block.
        let slots: Vec<usize> = unused.chain(replaced.sorted_unstable()).take(missing.len()).collect();
        let freed: HashSet<usize> = slots.iter().copied().collect();
        stored.retain(|_, slot| !freed.contains(slot));
        let new: Vec<(Page, usize)> = missing.into_iter().zip(slots).collect();
        self.upload(gpu, volume, &new)?;
        let count = new.len();
        stored.extend(new);
        Ok(count)
    }

    /// Uploads pages to their slots.
    fn upload(&self, gpu: &Gpu, volume: &Volume, new: &[(Page, usize)]) -> Result<()> {
        for some in new.chunks(PAGES_AT_ONCE) {
            let rows = some.par_chunk_by(|(a, _), (b, _)| self.row_of(*a) == self.row_of(*b));
            let packed: Vec<_> = rows.map(|row| self.packed_row(volume, row)).collect::<Result<_>>()?;
            for ((_, slot), (sides, values, labels)) in some.iter().zip(packed.into_iter().flatten()) {
                let origin = self.slots.first_texel(*slot);
                write_texels(gpu, &self.values, origin, sides, &values);
                let labels = self.labels.as_ref().zip(labels);
                labels.iter().for_each(|(texture, ranks)| write_texels(gpu, texture, origin, sides, ranks));
            }
            gpu.submit([]);
        }
        Ok(())
    }

    /// Returns the entry of the page table for the slot of each page; `None` for pages that are not stored.
    pub fn entries<'a>(&self, pages: impl Iterator<Item = &'a Page>) -> Vec<Option<u32>> {
        let stored = self.stored.lock().unwrap_or_else(PoisonError::into_inner);
        pages.map(|page| stored.get(page).map(|slot| self.slots.entry(*slot))).collect()
    }

    /// Returns the row along x that a page lies in; `None` for one of a constant value.
    fn row_of(&self, page: Page) -> Option<usize> {
        match page {
            Page::Voxels(number) => Some(number / self.grid.counts[0]),
            Page::Constant { .. } => None,
        }
    }

    /// Packs pages that lie in one row along x, which are read together.
    fn packed_row(&self, volume: &Volume, row: &[(Page, usize)]) -> Result<Vec<PackedPage>> {
        let ranges = row.iter().filter_map(|(page, _)| match page {
            Page::Voxels(number) => Some(self.grid.voxels(*number)),
            Page::Constant { .. } => None,
        });
        let together = ranges
            .reduce(|a, b| [a[0].start.min(b[0].start)..a[0].end.max(b[0].end), b[1].clone(), b[2].clone()]);
        let block = together.map(|range| volume.block(&range)).transpose()?;
        Ok(row.par_iter().map(|(page, _)| self.packed(volume, block.as_ref(), *page)).collect())
    }

    /// Packs a page, from a block with its voxels.
    fn packed(&self, volume: &Volume, block: Option<&VoxelBlock<'_>>, page: Page) -> PackedPage {
        let (mut values, labels) = (Vec::new(), volume.labels());
        let number = match page {
            Page::Voxels(number) => number,
            Page::Constant { value_bits, rank } => {
                let texels = PAGE_VOXELS.pow(3);
                let stored = volume.scaling().invert(f64::from_bits(value_bits));
                // Integers have been scaled and back.
                let is_whole = !matches!(volume.element(), Element::F32 | Element::F64);
                let stored = if is_whole { stored.round() } else { stored };
                self.packing.append(std::iter::repeat_n(stored, texels), &mut values);
                return ([PAGE_VOXELS as u32; 3], values, labels.map(|_| vec![rank; texels]));
            }
        };
        let voxels = self.grid.voxels(number);
        let [nx, ny, _] = volume.dims();
        let [x, y, z] = voxels.clone();
        let rows = z.flat_map(|k| y.clone().map(move |j| [x.start, j, k]));
        if let Some(block) = block {
            with_voxels!(block.voxels(), a => {
                let all = a.as_slice().unwrap_or_default();
                let row_of = |first| all[block.place(first)..][..x.len()].iter().copied();
                rows.clone().for_each(|first| self.packing.append(row_of(first), &mut values));
            });
        }
        let ranks_of = |labels: &Labels, [i, j, k]: [usize; 3]| {
            labels.ranks()[(k * ny + j) * nx + i..][..x.len()].to_vec()
        };
        let labels = labels.map(|labels| rows.flat_map(|first| ranks_of(labels, first)).collect());
        (voxels.map(|range| range.len() as u32), values, labels)
    }

    /// Creates the page table from the slot of every page.
    pub fn table(&self, gpu: &Gpu, slots: &[usize]) -> wgpu::TextureView {
        let entries: Vec<u32> = slots.iter().map(|slot| self.slots.entry(*slot)).collect();
        let table = self.empty_table(gpu);
        self.write_table(gpu, &table, &entries);
        table.create_view(&Default::default())
    }

    /// Creates a page table without entries.
    pub fn empty_table(&self, gpu: &Gpu) -> wgpu::Texture {
        solid_texture(gpu, "page table", TextureFormat::R32Uint, self.grid.counts.map(|n| n as u32))
    }

    /// Writes the entries of all pages to a page table.
    pub fn write_table(&self, gpu: &Gpu, table: &wgpu::Texture, entries: &[u32]) {
        write_texels(gpu, table, [0; 3], self.grid.counts.map(|n| n as u32), entries);
    }
}

/// Returns the pages that are not stored, each once.
fn missing_of(stored: &HashMap<Page, usize>, pages: &[Page]) -> Vec<Page> {
    pages.iter().filter(|page| !stored.contains_key(page)).copied().unique().collect()
}
