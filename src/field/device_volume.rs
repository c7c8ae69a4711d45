//! A volume's values on the device, without loss where the file has integers.

use crate::error::{Error, Result};
use crate::gpu::Gpu;
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

/// Copies a volume's voxels into its texture, slice by slice.
fn write_slices(gpu: &Gpu, volume: &Volume, texture: &wgpu::Texture, packing: &Packing) {
    let Packing { format, center, per_stored } = *packing;
    let dims = volume.dims();
    let slice_voxels = dims[0] * dims[1];
    let mut slice = Vec::<u8>::with_capacity(slice_voxels * format.bytes() as usize);
    for k in 0..dims[2] {
        slice.clear();
        let texel = |stored: f64| ((stored - center) * per_stored) as f32;
        with_voxels!(volume.voxels(), a => {
            let stored = a.as_slice().unwrap_or_default()[k * slice_voxels..][..slice_voxels].iter();
            match format {
                TexelFormat::Half => stored.for_each(|v| {
                    slice.extend_from_slice(&f16::from_f32(texel(v.to_f64())).to_le_bytes());
                }),
                TexelFormat::Single => stored.for_each(|v| {
                    slice.extend_from_slice(&texel(v.to_f64()).to_le_bytes());
                }),
            }
        });
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: 0, z: k as u32 },
                aspect: wgpu::TextureAspect::All,
            },
            &slice,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some((dims[0] as u64 * format.bytes()) as u32),
                rows_per_image: Some(dims[1] as u32),
            },
            wgpu::Extent3d { depth_or_array_layers: 1, ..texture.size() },
        );
        // Bounds what the queue keeps of the copies.
        if k % 64 == 63 {
            gpu.queue.submit([]);
        }
    }
}

fn label_texture(gpu: &Gpu, labels: &Labels, size: wgpu::Extent3d) -> wgpu::TextureView {
    use wgpu::util::{DeviceExt, TextureDataOrder};
    let descriptor = wgpu::TextureDescriptor {
        label: Some("labels"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format: wgpu::TextureFormat::R8Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    };
    let order = TextureDataOrder::LayerMajor;
    let texture = gpu.device.create_texture_with_data(&gpu.queue, &descriptor, order, labels.ranks());
    texture.create_view(&Default::default())
}

impl DeviceVolume {
    /// Uploads a volume.
    ///
    /// # Errors
    /// A grid larger than the adapter's 3-D textures, or a device out of memory.
    pub fn upload(gpu: &Gpu, volume: &Volume) -> Result<Self> {
        let dims = volume.dims();
        let limit = gpu.device.limits().max_texture_dimension_3d as usize;
        if let Some(n) = dims.iter().find(|n| **n > limit) {
            return Err(Error::input(
                "cannot render volume",
                &volume.provenance.source,
                format!("{n} voxels along an axis, the adapter's 3-D textures end at {limit}"),
            ));
        }
        let Packing { format, center, per_stored } = packing(volume);
        let scaling = volume.scaling();
        let mapping = TexelMapping { scale: scaling.slope / per_stored, offset: scaling.apply(center) };
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let size = wgpu::Extent3d {
            width: dims[0] as u32,
            height: dims[1] as u32,
            depth_or_array_layers: dims[2] as u32,
        };
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("volume"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format: match format {
                TexelFormat::Half => wgpu::TextureFormat::R16Float,
                TexelFormat::Single => wgpu::TextureFormat::R32Float,
            },
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        write_slices(gpu, volume, &texture, &Packing { format, center, per_stored });
        let labels = volume.labels().map(|labels| label_texture(gpu, labels, size));
        let last = gpu.queue.submit([]);
        gpu.wait_for(last)?;
        let label_bytes = u64::from(labels.is_some());
        let bytes = (dims[0] * dims[1] * dims[2]) as u64 * (format.bytes() + label_bytes);
        if pollster::block_on(scope.pop()).is_some() {
            return Err(Error::runtime(
                "cannot upload volume",
                &volume.provenance.source,
                format!("the device has no {bytes} bytes left for it"),
            ));
        }
        let [a, b] = volume.stored_range().map(|s| (s - center) * per_stored);
        Ok(Self {
            view: texture.create_view(&Default::default()),
            labels,
            format,
            mapping,
            texel_range: [a.min(b), a.max(b)],
            dims,
            bytes,
        })
    }

    /// Whether the hardware can filter this texture; otherwise shaders interpolate.
    pub fn filterable(&self, gpu: &Gpu) -> bool {
        self.format == TexelFormat::Half || gpu.filters_float32
    }
}
