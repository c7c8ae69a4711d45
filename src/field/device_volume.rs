//! A volume's values on the device, without loss where the file has integers.

use super::fold::{Fold, Part};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, solid_texture};
use crate::transfer::TexelMapping;
use crate::volume::{Labels, Volume, Voxel, Voxels};
use crate::with_voxels;
use half::f16;

/// How texel values are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TexelFormat {
    /// 16-bit float, 2 bytes: holds every whole number from -2048 to 2048, and so exactly any integer volume whose
    /// stored values span at most 4096 (12-bit CT), kept as differences from their middle.
    Half,
    /// 32-bit float, 4 bytes: holds every whole number up to 2^24, and so any other 16-bit volume exactly, and values of
    /// 32-bit volumes, scaled by a power of 2 to `[-1, 1]`; those of 64-bit volumes are scaled to `[0, 1]` and rounded
    /// to 24 bits.
    Single,
}

impl TexelFormat {
    /// Bytes of a texel.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Half => 2,
            Self::Single => 4,
        }
    }
}

const FIT_HINT: &str = "--downsample=BYTES or --downsample=2x2x1 reduces it by whole factors";

/// The volume texture and what its texels mean.
pub struct DeviceVolume {
    pub(crate) view: wgpu::TextureView,
    /// The places of voxels' labels among all that occur, where there are labels.
    pub(crate) labels: Option<wgpu::TextureView>,
    /// How texels are kept.
    pub format: TexelFormat,
    /// What texel values mean.
    pub mapping: TexelMapping,
    /// Smallest and largest texel value.
    pub texel_range: [f64; 2],
    /// Voxels along each axis.
    pub dims: [usize; 3],
    /// Where they lie in the texture.
    pub fold: Fold,
    /// Bytes of the texture, and of that of labels.
    pub bytes: u64,
}

/// `texel = (stored - center) * per_stored`
struct Packing {
    format: TexelFormat,
    center: f64,
    per_stored: f64,
}

fn packing(volume: &Volume) -> Packing {
    let [lo, hi] = volume.stored_range();
    // Negative slopes are turned over, so that texels always rise with values.
    let sign = volume.scaling().slope.signum();
    match volume.voxels() {
        Voxels::U8(_) | Voxels::I16(_) | Voxels::U16(_) if hi - lo <= 4096.0 => {
            Packing { format: TexelFormat::Half, center: (0.5 * (lo + hi)).floor(), per_stored: sign }
        }
        Voxels::U8(_) | Voxels::I16(_) | Voxels::U16(_) => {
            Packing { format: TexelFormat::Single, center: 0.0, per_stored: sign }
        }
        // Scaled by a power of 2, float32 values stay what they are.
        Voxels::F32(_) => {
            let largest = lo.abs().max(hi.abs());
            let exponent = if largest > 0.0 { largest.log2().ceil() } else { 0.0 };
            Packing { format: TexelFormat::Single, center: 0.0, per_stored: sign * (-exponent).exp2() }
        }
        Voxels::F64(_) => {
            let span = if hi > lo { hi - lo } else { 1.0 };
            Packing { format: TexelFormat::Single, center: lo, per_stored: sign / span }
        }
    }
}

/// Writes a texture tile by tile and slice by slice: `put` appends the texels of one row, those that a part has of the
/// voxels of a grid's row, which begins at a place in memory order.
fn write_tiles(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    (fold, [nx, ny, _]): (&Fold, [usize; 3]),
    texel_bytes: u64,
    put: impl Fn(usize, &Part, &mut Vec<u8>),
) {
    let mut slice = Vec::<u8>::new();
    let mut written = 0;
    for [x, y, z] in fold.parts() {
        for (k, layer) in z.of_texels().zip(z.first_texel..) {
            slice.clear();
            y.of_texels().for_each(|j| put((k * ny + j) * nx, &x, &mut slice));
            let [width, height] = [&x, &y].map(|part| part.texels() as u32);
            gpu.queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    origin: wgpu::Origin3d {
                        x: x.first_texel as u32,
                        y: y.first_texel as u32,
                        z: layer as u32,
                    },
                    ..texture.as_image_copy()
                },
                &slice,
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(width * texel_bytes as u32),
                    rows_per_image: Some(height),
                },
                wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            );
            written += 1;
            // Bounds what the queue keeps of the copies.
            if written % 64 == 0 {
                gpu.submit([]);
            }
        }
    }
}

/// Copies a volume's voxels into its texture.
fn write_voxels(gpu: &Gpu, volume: &Volume, texture: &wgpu::Texture, packing: &Packing, fold: &Fold) {
    let Packing { format, center, per_stored } = *packing;
    let texel = |stored: f64| ((stored - center) * per_stored) as f32;
    let dims = volume.dims();
    with_voxels!(volume.voxels(), a => {
        let voxels = a.as_slice().unwrap_or_default();
        write_tiles(gpu, texture, (fold, dims), format.bytes(), |first, part, slice| {
            let stored = along_row(&voxels[first..][..dims[0]], part);
            match format {
                TexelFormat::Half => stored.for_each(|v| {
                    slice.extend_from_slice(&f16::from_f32(texel(v.to_f64())).to_le_bytes());
                }),
                TexelFormat::Single => stored.for_each(|v| {
                    slice.extend_from_slice(&texel(v.to_f64()).to_le_bytes());
                }),
            }
        });
    });
}

/// The places of voxels' labels, laid as the voxels are.
fn label_texture(gpu: &Gpu, labels: &Labels, fold: &Fold, dims: [usize; 3]) -> wgpu::TextureView {
    let texture = grid_texture(gpu, "labels", wgpu::TextureFormat::R8Uint, fold);
    write_tiles(gpu, &texture, (fold, dims), 1, |first, part, slice| {
        slice.extend(along_row(&labels.ranks()[first..][..dims[0]], part));
    });
    texture.create_view(&Default::default())
}

/// A 3-D texture for a grid, whose sides the adapter holds.
fn grid_texture(gpu: &Gpu, label: &str, format: wgpu::TextureFormat, fold: &Fold) -> wgpu::Texture {
    solid_texture(gpu, label, format, fold.sides().map(|side| side as u32), wgpu::TextureUsages::empty())
}

/// The values of a row that a tile's texels hold, in their order.
fn along_row<'a, T>(row: &'a [T], part: &Part) -> impl Iterator<Item = &'a T> {
    let row = &row[part.voxels.clone()];
    let margin = |edge: Option<&'a T>| edge.into_iter().cycle().take(part.margin);
    margin(row.first()).chain(row).chain(margin(row.last()))
}

impl DeviceVolume {
    /// Uploads a volume.
    ///
    /// # Errors
    /// A grid that no way of folding brings into the adapter's 3-D textures, or a device out of memory.
    pub fn upload(gpu: &Gpu, volume: &Volume) -> Result<Self> {
        let dims = volume.dims();
        let limit = gpu.device.limits().max_texture_dimension_3d as usize;
        let fold = Fold::with_bricks(dims, limit).ok_or_else(|| {
            let [x, y, z] = dims;
            let why = format!(
                "{x} x {y} x {z} voxels, the adapter's 3-D textures hold {limit} x {limit} x {limit}, and folded four times as \
                 many along an axis"
            );
            Error::input("cannot render volume", &volume.provenance.source, why).hint(FIT_HINT)
        })?;
        let Packing { format, center, per_stored } = packing(volume);
        let scaling = volume.scaling();
        let mapping = TexelMapping { scale: scaling.slope / per_stored, offset: scaling.apply(center) };
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let kept = match format {
            TexelFormat::Half => wgpu::TextureFormat::R16Float,
            TexelFormat::Single => wgpu::TextureFormat::R32Float,
        };
        let texture = grid_texture(gpu, "volume", kept, &fold);
        write_voxels(gpu, volume, &texture, &Packing { format, center, per_stored }, &fold);
        let labels = volume.labels().map(|labels| label_texture(gpu, labels, &fold, dims));
        let last = gpu.submit([]);
        gpu.wait_for(last)?;
        let texel_bytes = format.bytes() + u64::from(labels.is_some());
        let bytes = fold.sides().iter().product::<usize>() as u64 * texel_bytes;
        if pollster::block_on(scope.pop()).is_some() {
            return Err(Error::runtime(
                "cannot upload volume",
                &volume.provenance.source,
                format!("the device has no {bytes} bytes left for it"),
            )
            .hint(FIT_HINT));
        }
        let [a, b] = volume.stored_range().map(|s| (s - center) * per_stored);
        Ok(Self {
            view: texture.create_view(&Default::default()),
            labels,
            format,
            mapping,
            texel_range: [a.min(b), a.max(b)],
            dims,
            fold,
            bytes,
        })
    }

    /// Whether the hardware can filter this texture; otherwise shaders interpolate.
    pub fn filterable(&self, gpu: &Gpu) -> bool {
        self.format == TexelFormat::Half || gpu.filters_float32
    }
}
