//! Pool of pages of a volume on the graphics device: a 3-D texture with a slot for each stored page, and page tables.

use super::pages::{PAGE_VOXELS, PageGrid, SlotGrid};
use super::texel_packing::TexelPacking;
use crate::gpu::{Gpu, solid_texture, write_texels};
use crate::volume::Volume;
use crate::with_voxels;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use wgpu::TextureFormat;

/// Number of pages that are packed and submitted together, which limits the memory of pending copies.
const PAGES_AT_ONCE: usize = 64;

/// Contents of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Page {
    /// Voxels of the page with this number.
    Voxels(usize),
    /// One voxel everywhere, that at this memory index, in place of all pages that are not stored.
    Constant(usize),
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

    /// Number of bytes of the textures.
    pub fn bytes(&self) -> u64 {
        let texel_bytes = self.packing.bytes() + u64::from(self.labels.is_some());
        self.slots.texels().map(u64::from).iter().product::<u64>() * texel_bytes
    }

    /// Stores the pages that are missing, and returns the slots of all of them in their order; `None` if the slots that
    /// are left do not suffice.
    pub fn store(&self, gpu: &Gpu, volume: &Volume, pages: &[Page]) -> Option<Vec<usize>> {
        let mut stored = self.stored.lock().unwrap_or_else(PoisonError::into_inner);
        let missing: Vec<Page> = pages.iter().filter(|page| !stored.contains_key(page)).copied().collect();
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
        let (mut values, mut labels) = (Vec::new(), volume.labels().map(|_| Vec::new()));
        let voxels = match page {
            Page::Voxels(number) => self.grid.voxels(number),
            Page::Constant(_) => [0..PAGE_VOXELS, 0..PAGE_VOXELS, 0..PAGE_VOXELS],
        };
        let [nx, ny, _] = volume.dims();
        let [x, y, z] = voxels.clone();
        let mut append = |row: Range<usize>, count: usize| {
            let repeated = count / row.len();
            with_voxels!(volume.voxels(), a => {
                let row = &a.as_slice().unwrap_or_default()[row.clone()];
                (0..repeated).for_each(|_| self.packing.append(row.iter().copied(), &mut values));
            });
            if let Some((labels, all)) = labels.as_mut().zip(volume.labels()) {
                (0..repeated).for_each(|_| labels.extend_from_slice(&all.ranks()[row.clone()]));
            }
        };
        match page {
            Page::Constant(voxel) => append(voxel..voxel + 1, PAGE_VOXELS.pow(3)),
            Page::Voxels(_) => {
                for (k, j) in z.flat_map(|k| y.clone().map(move |j| (k, j))) {
                    let start = (k * ny + j) * nx + x.start;
                    append(start..start + x.len(), x.len());
                }
            }
        }
        (voxels.map(|range| range.len() as u32), values, labels)
    }

    /// Creates the page table: the place of the slot of every page. Pages that are not stored are in the slot `empty`.
    pub fn table(&self, gpu: &Gpu, stored: &[(usize, usize)], empty: usize) -> wgpu::TextureView {
        let mut entries = vec![self.slots.entry(empty); self.grid.len()];
        stored.iter().for_each(|(page, slot)| entries[*page] = self.slots.entry(*slot));
        let sides = self.grid.counts.map(|n| n as u32);
        let table = solid_texture(gpu, "page table", TextureFormat::R32Uint, sides);
        write_texels(gpu, &table, [0; 3], sides, &entries);
        table.create_view(&Default::default())
    }
}
