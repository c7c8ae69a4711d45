//! Copies the contents of bound resources to the host.

use super::buffers::copied;
use super::{Gpu, Resource};
use crate::error::Result;

impl Resource {
    /// Returns the bytes of a buffer that shaders access, or the texels of a texture, x fastest and rows without padding.
    /// Samplers have none.
    ///
    /// # Errors
    /// The device is lost.
    pub fn contents(&self, gpu: &Gpu) -> Result<Vec<u8>> {
        match self {
            Self::Buffer { buffer, offset, size } => {
                let size = size.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT);
                let copy = |encoder: &mut wgpu::CommandEncoder, staging: &wgpu::Buffer| {
                    encoder.copy_buffer_to_buffer(buffer, *offset, staging, 0, size);
                };
                copied(gpu, size as usize, copy)
            }
            Self::Texture(texture) => texels(gpu, texture),
            Self::Sampler => Ok(Vec::new()),
        }
    }
}

fn texels(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Vec<u8>> {
    let size = texture.size();
    let row = size.width * texture.format().block_copy_size(None).unwrap_or(0);
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let rows = size.height * size.depth_or_array_layers;
    let copy = |encoder: &mut wgpu::CommandEncoder, staging: &wgpu::Buffer| {
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(padded),
            rows_per_image: Some(size.height),
        };
        let to = wgpu::TexelCopyBufferInfo { buffer: staging, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), to, size);
    };
    let all: Vec<u8> = copied(gpu, padded as usize * rows as usize, copy)?;
    Ok(all.chunks(padded.max(1) as usize).flat_map(|padded| &padded[..row as usize]).copied().collect())
}

#[cfg(test)]
mod tests {
    use crate::common;
    use crate::gpu::{Group, Slot, StorageBuffer, solid_texture, write_texels};

    #[test]
    fn contents_are_those_that_were_written() {
        let Some(gpu) = common::gpu() else { return };
        let words: Vec<u32> = (0..100).collect();
        let buffer = StorageBuffer::from_slice(&gpu, "words", &words).unwrap();
        let size = std::num::NonZeroU64::new(64);
        let part = wgpu::BufferBinding { buffer: &buffer, offset: 256, size };
        let texture = solid_texture(&gpu, "solid", wgpu::TextureFormat::R8Uint, [5, 3, 2]);
        let texels: Vec<u8> = (0..30).collect();
        write_texels(&gpu, &texture, [0; 3], [5, 3, 2], &texels);
        let view = texture.create_view(&Default::default());
        let (uint, solid) = (wgpu::TextureSampleType::Uint, wgpu::TextureViewDimension::D3);
        let slots = [
            (0, Slot::read(buffer.as_entire_binding())),
            (1, Slot::read(wgpu::BindingResource::Buffer(part))),
            (2, Slot::texture(&view, uint, solid)),
        ];
        let group = Group::new(&gpu, "all", &slots);
        let contents: Vec<_> =
            group.entries().map(|(_, resource)| resource.contents(&gpu).unwrap()).collect();
        let bytes: Vec<u8> = bytemuck::cast_slice(&words).to_vec();
        assert_eq!(contents, [bytes.clone(), bytes[256..320].to_vec(), texels]);
    }
}
