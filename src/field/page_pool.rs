//! Pool of pages of a volume on the graphics device: a 3-D texture with a slot for each stored page, and page tables.

use super::pages::{PAGE_VOXELS, PageGrid, SlotGrid};
use super::texel_packing::TexelPacking;
use crate::gpu::{Gpu, solid_texture, write_texels};
use crate::volume::{Volume, Voxels};
use crate::with_voxels;
use itertools::Itertools as _;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use wgpu::TextureFormat;

/// Number of pages that are packed and submitted together, which limits the memory of pending copies.
const PAGES_AT_ONCE: usize = 64;

/// Contents of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Page {
    /// Voxels of the page with this number.
    Voxels(usize),
    /// One value everywhere, given by its bits, with the label of this index.
    Constant { value_bits: u64, rank: u8 },
}

/// Pool of pages of a volume on the device. Pages are added and never replaced, so that all page tables stay valid.
pub(super) struct PagePool {
    grid: PageGrid,
    slots: SlotGrid,
    packing: TexelPacking,
    values: wgpu::Texture,
    labels: Option<wgpu::Texture>,
    /// Slot of each stored page.
    stored: Mutex<HashMap<Page, usize>>,
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
        })
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

    /// Number of bytes of the textures.
    pub fn bytes(&self) -> u64 {
        let texel_bytes = self.packing.bytes() + u64::from(self.labels.is_some());
        self.slots.texels().map(u64::from).iter().product::<u64>() * texel_bytes
    }

    /// Stores the pages that are missing, and returns the slots of all of them in their order; `None` if the slots that
    /// are left do not suffice.
    pub fn store(&self, gpu: &Gpu, volume: &Volume, pages: &[Page]) -> Option<Vec<usize>> {
        let mut stored = self.stored.lock().unwrap_or_else(PoisonError::into_inner);
        let missing = pages.iter().filter(|page| !stored.contains_key(page));
        let missing: Vec<Page> = missing.copied().unique().collect();
        if stored.len() + missing.len() > self.slots.len() {
            return None;
        }
        let first = stored.len();
        let new: Vec<(Page, usize)> = missing.into_iter().zip(first..).collect();
        for some in new.chunks(PAGES_AT_ONCE) {
            let packed: Vec<_> = some.par_iter().map(|(page, _)| self.packed(volume, *page)).collect();
            for ((_, slot), (sides, values, labels)) in some.iter().zip(packed) {
                let origin = self.slots.first_texel(*slot);
                write_texels(gpu, &self.values, origin, sides, &values);
                let labels = self.labels.as_ref().zip(labels);
                labels.iter().for_each(|(texture, ranks)| write_texels(gpu, texture, origin, sides, ranks));
            }
            gpu.submit([]);
        }
        stored.extend(new);
        Some(pages.iter().filter_map(|page| stored.get(page).copied()).collect())
    }

    /// Returns the sides of a page in texels, the bytes of its values, and its labels.
    fn packed(&self, volume: &Volume, page: Page) -> ([u32; 3], Vec<u8>, Option<Vec<u8>>) {
        let (mut values, labels) = (Vec::new(), volume.labels());
        let number = match page {
            Page::Voxels(number) => number,
            Page::Constant { value_bits, rank } => {
                let texels = PAGE_VOXELS.pow(3);
                let stored = volume.scaling().invert(f64::from_bits(value_bits));
                // Integers have been scaled and back.
                let is_whole = matches!(volume.voxels(), Voxels::U8(_) | Voxels::I16(_) | Voxels::U16(_));
                let stored = if is_whole { stored.round() } else { stored };
                self.packing.append(std::iter::repeat_n(stored, texels), &mut values);
                return ([PAGE_VOXELS as u32; 3], values, labels.map(|_| vec![rank; texels]));
            }
        };
        let voxels = self.grid.voxels(number);
        let [nx, ny, _] = volume.dims();
        let [x, y, z] = voxels.clone();
        let starts = z.flat_map(|k| y.clone().map(move |j| (k * ny + j) * nx + x.start));
        let rows = starts.map(|start| start..start + x.len());
        with_voxels!(volume.voxels(), a => {
            let all = a.as_slice().unwrap_or_default();
            rows.clone().for_each(|row| self.packing.append(all[row].iter().copied(), &mut values));
        });
        let labels = labels.map(|labels| rows.flat_map(|row| &labels.ranks()[row]).copied().collect());
        (voxels.map(|range| range.len() as u32), values, labels)
    }

    /// Creates the page table from the slot of every page.
    pub fn table(&self, gpu: &Gpu, slots: &[usize]) -> wgpu::TextureView {
        let entries: Vec<u32> = slots.iter().map(|slot| self.slots.entry(*slot)).collect();
        let sides = self.grid.counts.map(|n| n as u32);
        let table = solid_texture(gpu, "page table", TextureFormat::R32Uint, sides);
        write_texels(gpu, &table, [0; 3], sides, &entries);
        table.create_view(&Default::default())
    }
}
