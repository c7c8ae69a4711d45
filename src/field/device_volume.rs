//! Voxels of a volume on the graphics device: in one 3-D texture, or as those pages of it that have extinction.

use super::ActiveBricks;
use super::active_bricks::EmptyBricks;
use super::page_pool::{Page, PagePool};
use super::page_stream::PageStream;
use super::pages::{Content, PageGrid};
use super::texel_packing::TexelPacking;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, solid_texture, write_texels};
use crate::transfer::{TexelMapping, TransferFunction};
use crate::volume::Volume;
use crate::with_voxels;
use itertools::Itertools as _;
use serde::Serialize;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use wgpu::{ErrorFilter, TextureFormat, TextureView};

const DOWNSAMPLE_HINT: &str = "--downsample=BYTES or --downsample=2x2x1 reduces it by whole factors";
const WHAT: &str = "cannot render volume";
/// Share of slots of a pool beyond those needed, for other transfer functions.
const SPARE_SLOTS: f64 = 0.25;

/// Voxels of a volume on the device, with the linear mapping from texel values to the volume's values.
pub struct DeviceVolume {
    storage: Storage,
    packing: TexelPacking,
    /// Linear mapping from texel values of the volume texture to the volume's values.
    pub mapping: TexelMapping,
    /// Smallest and largest texel value of the volume.
    pub texel_range: [f64; 2],
    /// Number of voxels of the volume along each axis.
    pub dims: [usize; 3],
}

enum Storage {
    Whole(Box<VolumeTextures>),
    /// Pool of the pages that the last transfer function needed, and of those of earlier ones that it has room for.
    Pages(Mutex<Option<Arc<PagePool>>>),
}

/// Textures with the voxels that a transfer function needs.
#[derive(Clone)]
pub(super) struct VolumeTextures {
    pub values: TextureView,
    /// Segmentation label of each voxel, as an index into the list of labels that occur; `None` for a volume without
    /// labels.
    pub labels: Option<TextureView>,
    pub pages: Option<Pages>,
}

/// Page table of a volume for a transfer function.
#[derive(Clone)]
pub(super) struct Pages {
    pub residency: Residency,
    /// Number of pages along each axis of the volume.
    pub counts: [usize; 3],
    /// Sign and offset of the values of a texture of whole numbers; `None` for one of floats.
    pub of_words: Option<[f32; 2]>,
    pub usage: PageUsage,
}

/// Pages of a volume that are on the device.
#[derive(Clone)]
pub(super) enum Residency {
    /// All pages with extinction. The page table has the place of each page in the volume texture.
    All(TextureView),
    /// Blocks of pages, one after the other.
    Streamed(Arc<PageStream>),
}

impl Residency {
    /// Page table of the volume.
    pub fn table(&self) -> TextureView {
        match self {
            Self::All(table) => table.clone(),
            Self::Streamed(stream) => stream.table(),
        }
    }

    /// Stream of the pages, if blocks of them become resident one after the other.
    pub fn stream(&self) -> Option<&Arc<PageStream>> {
        match self {
            Self::All(_) => None,
            Self::Streamed(stream) => Some(stream),
        }
    }
}

/// Memory of a volume that is stored as pages.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PageUsage {
    /// Number of pages (cubes of 32 cells a side) of the volume.
    pub total: usize,
    /// Number of pages with extinction under the transfer function, or near it. Others are not stored.
    pub needed: usize,
    /// Memory of a page, bytes.
    pub page_bytes: u64,
    /// Memory of the pool of pages on the device, bytes.
    pub pool_bytes: u64,
    /// Host time to find the needed pages and to upload those that were missing, ms.
    pub upload_ms: f64,
    /// Number of blocks of pages that become resident one after the other; 1 if the pool holds all needed pages.
    pub blocks: usize,
}

impl DeviceVolume {
    /// Prepares a volume for the graphics device. It is uploaded as one texture if the adapter's 3-D textures and the
    /// limit on device memory allow; otherwise, transfer functions upload the pages that they need.
    ///
    /// # Errors
    /// The volume exceeds what pages can hold, or the device is lost.
    pub fn upload(gpu: &Gpu, volume: &Volume) -> Result<Self> {
        let dims = volume.dims();
        let packing = TexelPacking::of(volume);
        let whole = whole_textures(gpu, volume, &packing)?;
        let limit = gpu.device.limits().max_texture_dimension_3d as usize;
        // The distances of bricks and the page table are whole textures.
        if whole.is_none() && crate::volume::Bricks::counts_for(dims).iter().any(|n| *n > limit) {
            let [x, y, z] = dims;
            let why = format!(
                "{x} x {y} x {z} voxels, and the adapter's 3-D textures end at {limit} texels a side"
            );
            return Err(Error::input(WHAT, &volume.provenance.source, why).hint(DOWNSAMPLE_HINT));
        }
        let (storage, packing) = match whole {
            Some(textures) => (Storage::Whole(Box::new(textures)), packing),
            None => (Storage::Pages(Mutex::default()), packing.compact(volume)),
        };
        let [a, b] = volume.stored_range().map(|stored| packing.texel(stored));
        let (mapping, texel_range) = (packing.mapping(volume), [a.min(b), a.max(b)]);
        Ok(Self { storage, packing, mapping, texel_range, dims })
    }

    /// Returns the textures with all voxels that a transfer function needs. Pages that are missing are uploaded. The active
    /// bricks were found with `blur`.
    ///
    /// # Errors
    /// The pages exceed the limit on device memory, or the device is out of memory.
    pub(super) fn textures(
        &self,
        gpu: &Gpu,
        volume: &Volume,
        active: &ActiveBricks,
        (tf, blur): (&TransferFunction, f64),
    ) -> Result<VolumeTextures> {
        let pool = match &self.storage {
            Storage::Whole(textures) => return Ok(VolumeTextures::clone(textures)),
            Storage::Pages(pool) => pool,
        };
        let start = Instant::now();
        let grid = PageGrid::of(self.dims);
        let empty = EmptyBricks::of(volume.bricks(), active, tf, blur);
        let contents = grid.layout(active, &empty);
        let needed = contents.iter().filter(|content| **content == Content::Stored).count();
        let least = contents.iter().find_map(Content::gap).map_or(volume.value_range()[0], |gap| gap.value);
        let page = |(number, content): (usize, &Content)| match content {
            Content::Stored => Page::Voxels(number),
            Content::Empty(gap) => Page::Constant { value_bits: gap.value.to_bits(), rank: gap.rank as u8 },
            Content::Clipped => Page::Constant { value_bits: least.to_bits(), rank: 0 },
        };
        let pages: Vec<Page> = contents.iter().enumerate().map(page).collect();
        let mut pool = pool.lock().unwrap_or_else(PoisonError::into_inner);
        let (current, residency) = self.residency(gpu, volume, pages, pool.take())?;
        *pool = Some(Arc::clone(&current));
        let (values, labels) = current.views();
        let usage = PageUsage {
            total: grid.len(),
            needed,
            page_bytes: PagePool::page_bytes(volume, &self.packing),
            pool_bytes: current.bytes(),
            upload_ms: start.elapsed().as_secs_f64() * 1e3,
            blocks: residency.stream().map_or(1, |stream| stream.blocks()),
        };
        let of_words = (self.packing.format == TextureFormat::R16Uint).then(|| self.packing.of_words());
        let pages = Some(Pages { residency, counts: grid.counts, of_words, usage });
        Ok(VolumeTextures { values, labels, pages })
    }

    /// Stores pages in the pool of a former transfer function or in a new one: all of them if the pool holds them, and
    /// otherwise block by block.
    fn residency(
        &self,
        gpu: &Gpu,
        volume: &Volume,
        pages: Vec<Page>,
        former: Option<Arc<PagePool>>,
    ) -> Result<(Arc<PagePool>, Residency)> {
        let count = pages.iter().unique().count();
        let page_bytes = PagePool::page_bytes(volume, &self.packing);
        let slots_in = |limit: u64| (limit / page_bytes) as usize;
        let most = gpu.memory_limit.map_or(usize::MAX, slots_in);
        if let Some(pool) = former {
            if !pool.is_streamed() {
                if let Some(slots) = pool.store(gpu, volume, &pages)? {
                    let table = pool.table(gpu, &slots);
                    return Ok((pool, Residency::All(table)));
                }
            } else if count > pool.len()
                && let Some(stream) = self.stream(gpu, &pool, &pages)?
            {
                return Ok((pool, stream));
            }
        }
        let spare = (count as f64 * SPARE_SLOTS) as usize;
        let sizes = [(count + spare).min(most), count];
        for slots in sizes.into_iter().filter(|slots| (count..=most).contains(slots)) {
            let made = without_errors(gpu, || PagePool::new(gpu, volume, self.packing, slots))?;
            if let Some(pool) = made.flatten()
                && pool.len() <= most
                && let Some(slots) = pool.store(gpu, volume, &pages)?
            {
                gpu.wait_for(gpu.submit([]))?;
                let table = pool.table(gpu, &slots);
                return Ok((Arc::new(pool), Residency::All(table)));
            }
        }
        let most = gpu.memory_limit.map_or(count, |limit| slots_in(limit.saturating_sub(gpu.memory_reserve)));
        let sizes = std::iter::successors(Some(most.min(count)), |slots| Some(slots * 7 / 8));
        for most in sizes.take_while(|slots| *slots > 0) {
            let made = without_errors(gpu, || PagePool::within(gpu, volume, self.packing, most))?;
            let Some(pool) = made.flatten().map(Arc::new) else { continue };
            if let Some(stream) = self.stream(gpu, &pool, &pages)? {
                return Ok((pool, stream));
            }
            break;
        }
        Err(cannot_hold(gpu, volume, count as u64 * page_bytes))
    }

    /// Prepares the streaming of pages through a pool; `None` if it is too small for the smallest block.
    fn stream(&self, gpu: &Gpu, pool: &Arc<PagePool>, pages: &[Page]) -> Result<Option<Residency>> {
        let counts = PageGrid::of(self.dims).counts;
        let stream = PageStream::new(gpu, Arc::clone(pool), pages.to_vec(), counts)?;
        Ok(stream.map(|stream| Residency::Streamed(Arc::new(stream))))
    }
}

/// Returns the error of a volume whose pages with extinction need `needed_bytes`.
fn cannot_hold(gpu: &Gpu, volume: &Volume, needed_bytes: u64) -> Error {
    let source = &volume.provenance.source;
    match gpu.memory_limit {
        Some(limit) => {
            let why = format!(
                "{limit} bytes are allowed, which hold no block of pages ({needed_bytes} bytes hold all with extinction)"
            );
            let hint = "--device-memory sets the limit; --downsample and --crop reduce the volume";
            Error::input(WHAT, source, why).hint(hint)
        }
        None => {
            let why =
                format!("the device has no room for {needed_bytes} bytes of it, nor for blocks of them");
            Error::runtime(WHAT, source, why).hint(DOWNSAMPLE_HINT)
        }
    }
}

/// Uploads a volume as one texture; `None` if it exceeds the adapter's textures, its memory, or the limit on it.
///
/// # Errors
/// The device is lost.
fn whole_textures(gpu: &Gpu, volume: &Volume, packing: &TexelPacking) -> Result<Option<VolumeTextures>> {
    let dims = volume.dims();
    let limit = gpu.device.limits().max_texture_dimension_3d as usize;
    let bytes =
        dims.iter().product::<usize>() as u64 * (packing.bytes() + u64::from(volume.labels().is_some()));
    if dims.iter().any(|n| *n > limit) || gpu.memory_limit.is_some_and(|most| bytes > most) {
        return Ok(None);
    }
    let sides = dims.map(|n| n as u32);
    let made = without_errors(gpu, || {
        let values = solid_texture(gpu, "volume", packing.format, sides);
        let labels = volume.labels().map(|_| solid_texture(gpu, "labels", TextureFormat::R8Uint, sides));
        (values, labels)
    })?;
    let Some((values, labels)) = made else { return Ok(None) };
    for slab in volume.slabs(0, 1) {
        let (range, block) = slab?;
        with_voxels!(block.voxels(), a => {
            let slices = range.zip(a.as_slice().unwrap_or_default().chunks(dims[0] * dims[1]));
            write_slices(gpu, &values, slices, |slice, bytes| packing.append(slice.iter().copied(), bytes));
        });
    }
    if let (Some(texture), Some(labels)) = (&labels, volume.labels()) {
        let slices = (0..dims[2]).zip(labels.ranks().chunks(dims[0] * dims[1]));
        write_slices(gpu, texture, slices, |slice, bytes| bytes.extend_from_slice(slice));
    }
    gpu.wait_for(gpu.submit([]))?;
    let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
    Ok(Some(VolumeTextures { values: view(&values), labels: labels.as_ref().map(view), pages: None }))
}

/// Writes slices of a 3-D texture, each at its index. `append` appends the texels of a slice.
fn write_slices<'a, T: 'a>(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    slices: impl Iterator<Item = (usize, &'a [T])>,
    append: impl Fn(&'a [T], &mut Vec<u8>),
) {
    let mut texels = Vec::<u8>::new();
    for (k, slice) in slices {
        texels.clear();
        append(slice, &mut texels);
        write_texels(gpu, texture, [0, 0, k as u32], [texture.width(), texture.height(), 1], &texels);
        // Limits the memory of pending copies.
        if k % 64 == 63 {
            gpu.submit([]);
        }
    }
}

/// Returns what `create` creates on the device; `None` if the device reports that it cannot.
///
/// # Errors
/// The device is lost.
fn without_errors<T>(gpu: &Gpu, create: impl FnOnce() -> T) -> Result<Option<T>> {
    let filters = [ErrorFilter::OutOfMemory, ErrorFilter::Validation, ErrorFilter::Internal];
    let scopes = filters.map(|filter| gpu.device.push_error_scope(filter));
    let made = create();
    let errors = scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop())).count();
    gpu.take_error()?;
    Ok((errors == 0).then_some(made))
}
