//! Volume texture on the graphics device, which stores integer voxel values without loss.

use super::fold::{Fold, FoldSpan};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, solid_texture, write_texels};
use crate::transfer::TexelMapping;
use crate::volume::{Labels, Volume, Voxel, Voxels};
use crate::with_voxels;
use half::f16;
use wgpu::TextureFormat;

const DOWNSAMPLE_HINT: &str = "--downsample=BYTES or --downsample=2x2x1 reduces it by whole factors";

/// Volume texture on the device, with the linear mapping from its texel values to the volume's values.
pub struct DeviceVolume {
    pub(crate) view: wgpu::TextureView,
    /// Texture with the segmentation label of each voxel, as an index into the list of labels that occur; `None` for
    /// a volume without labels.
    pub(crate) labels: Option<wgpu::TextureView>,
    /// Linear mapping from texel values of the volume texture to the volume's values.
    pub mapping: TexelMapping,
    /// Smallest and largest texel value in the volume texture.
    pub texel_range: [f64; 2],
    /// Number of voxels of the volume along each axis.
    pub dims: [usize; 3],
    /// Placement of the voxels in the volume texture. A volume that is longer than the texture may be is cut into
    /// tiles side by side (folded).
    pub fold: Fold,
    /// Bytes of the volume texture and the label texture.
    pub bytes: u64,
}

/// Linear conversion from stored voxel values to texel values of the volume texture: `texel = (stored - center) *
/// per_stored`.
struct Packing {
    format: TextureFormat,
    center: f64,
    per_stored: f64,
}

/// Chooses how a volume's values are stored as 16-bit or 32-bit floats.
///
/// A 16-bit float is exact for whole numbers from -2048 to 2048: integer volumes whose stored values span at most
/// 4096 (12-bit CT) are stored as differences from their middle. A 32-bit float is exact for whole numbers up to
/// 2^24, and so for other 16-bit volumes. Values of 32-bit volumes are scaled by a power of 2 to `[-1, 1]`, without
/// rounding. Values of 64-bit volumes are scaled to `[0, 1]` and rounded to 24 bits.
fn packing(volume: &Volume) -> Packing {
    let [lo, hi] = volume.stored_range();
    // A negative slope is negated, so that texels always rise with values.
    let sign = volume.scaling().slope.signum();
    let single = Packing { format: TextureFormat::R32Float, center: 0.0, per_stored: sign };
    match volume.voxels() {
        Voxels::U8(_) | Voxels::I16(_) | Voxels::U16(_) if hi - lo <= 4096.0 => {
            Packing { format: TextureFormat::R16Float, center: (0.5 * (lo + hi)).floor(), ..single }
        }
        Voxels::U8(_) | Voxels::I16(_) | Voxels::U16(_) => single,
        Voxels::F32(_) => {
            let largest = lo.abs().max(hi.abs());
            let exponent = if largest > 0.0 { largest.log2().ceil() } else { 0.0 };
            Packing { per_stored: sign * (-exponent).exp2(), ..single }
        }
        Voxels::F64(_) => {
            let span = if hi > lo { hi - lo } else { 1.0 };
            Packing { center: lo, per_stored: sign / span, ..single }
        }
    }
}

/// Writes a folded (tiled) volume texture, one slice of a volume tile at a time. `put` appends the texels of one row:
/// it takes the memory index of the row's first voxel, and the range of that row in the tile.
fn write_tiles(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    (fold, [nx, ny, _]): (&Fold, [usize; 3]),
    put: impl Fn(usize, &FoldSpan, &mut Vec<u8>),
) {
    let mut slice = Vec::<u8>::new();
    let mut written = 0;
    for [x, y, z] in fold.spans() {
        for (k, layer) in z.voxels_by_texel().zip(z.first_texel..) {
            slice.clear();
            y.voxels_by_texel().for_each(|j| put((k * ny + j) * nx, &x, &mut slice));
            let origin = [x.first_texel, y.first_texel, layer].map(|first| first as u32);
            let [width, height] = [&x, &y].map(|span| span.texels() as u32);
            write_texels(gpu, texture, origin, [width, height, 1], &slice);
            written += 1;
            // Limits the memory of pending copies.
            if written % 64 == 0 {
                gpu.submit([]);
            }
        }
    }
}

/// Writes the voxels of a volume into its device texture.
fn write_voxels(gpu: &Gpu, volume: &Volume, texture: &wgpu::Texture, packing: &Packing, fold: &Fold) {
    let Packing { format, center, per_stored } = *packing;
    let texel = |stored: f64| ((stored - center) * per_stored) as f32;
    let dims = volume.dims();
    with_voxels!(volume.voxels(), a => {
        let voxels = a.as_slice().unwrap_or_default();
        write_tiles(gpu, texture, (fold, dims), |first, span, slice| {
            let stored = along_row(&voxels[first..][..dims[0]], span);
            let texels = stored.map(|v| texel(v.to_f64()));
            match format {
                TextureFormat::R16Float => {
                    texels.for_each(|t| slice.extend_from_slice(&f16::from_f32(t).to_le_bytes()));
                }
                _ => texels.for_each(|t| slice.extend_from_slice(&t.to_le_bytes())),
            }
        });
    });
}

/// Creates the texture with the segmentation label of each voxel, cut into tiles (folded) like the volume texture. A
/// label is stored as its index in the list of labels that occur.
fn label_texture(gpu: &Gpu, labels: &Labels, fold: &Fold, dims: [usize; 3]) -> wgpu::TextureView {
    let texture = grid_texture(gpu, "labels", TextureFormat::R8Uint, fold);
    write_tiles(gpu, &texture, (fold, dims), |first, span, slice| {
        slice.extend(along_row(&labels.ranks()[first..][..dims[0]], span));
    });
    texture.create_view(&Default::default())
}

/// Creates a 3-D texture for the voxels of a volume, which may be cut into tiles side by side (folded).
fn grid_texture(gpu: &Gpu, label: &str, format: TextureFormat, fold: &Fold) -> wgpu::Texture {
    solid_texture(gpu, label, format, fold.sides().map(|side| side as u32))
}

/// Returns the part of a voxel row that lies in a volume tile, in the order of the tile's texels. The border voxels
/// of the tile are repeated.
fn along_row<'a, T>(row: &'a [T], span: &FoldSpan) -> impl Iterator<Item = &'a T> {
    let row = &row[span.voxels.clone()];
    let margin = |edge: Option<&'a T>| edge.into_iter().cycle().take(span.margin);
    margin(row.first()).chain(row).chain(margin(row.last()))
}

impl DeviceVolume {
    /// Uploads a volume as a texture to the graphics device.
    ///
    /// # Errors
    /// The volume exceeds the adapter's 3-D textures even when folded, or the device is out of memory.
    pub fn upload(gpu: &Gpu, volume: &Volume) -> Result<Self> {
        let dims = volume.dims();
        let limit = gpu.device.limits().max_texture_dimension_3d as usize;
        let fold = Fold::with_bricks(dims, limit).ok_or_else(|| {
            let [x, y, z] = dims;
            let why = format!(
                "{x} x {y} x {z} voxels, the adapter's 3-D textures hold {limit} x {limit} x {limit}, and folded four times as \
                 many along an axis"
            );
            Error::input("cannot render volume", &volume.provenance.source, why).hint(DOWNSAMPLE_HINT)
        })?;
        let packing = packing(volume);
        let Packing { format, center, per_stored } = packing;
        let scaling = volume.scaling();
        let mapping = TexelMapping { scale: scaling.slope / per_stored, offset: scaling.apply(center) };
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let texture = grid_texture(gpu, "volume", format, &fold);
        write_voxels(gpu, volume, &texture, &packing, &fold);
        let labels = volume.labels().map(|labels| label_texture(gpu, labels, &fold, dims));
        gpu.wait_for(gpu.submit([]))?;
        let value_bytes = if format == TextureFormat::R16Float { 2 } else { 4 };
        let texel_bytes = value_bytes + u64::from(labels.is_some());
        let bytes = fold.sides().iter().product::<usize>() as u64 * texel_bytes;
        if pollster::block_on(scope.pop()).is_some() {
            let why = format!("the device has no {bytes} bytes left for it");
            let source = &volume.provenance.source;
            return Err(Error::runtime("cannot upload volume", source, why).hint(DOWNSAMPLE_HINT));
        }
        let [a, b] = volume.stored_range().map(|s| (s - center) * per_stored);
        Ok(Self {
            view: texture.create_view(&Default::default()),
            labels,
            mapping,
            texel_range: [a.min(b), a.max(b)],
            dims,
            fold,
            bytes,
        })
    }
}
