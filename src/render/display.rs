//! Pictures on the screen: encoded to sRGB into a texture of the same device, band by band, with no copy to the host.

use super::lights::LightMaps;
use super::pace::{Pace, Pacing};
use super::shader::{CONSTANTS, picture_workgroups};
use super::{Plan, Renderer};
use crate::error::{Error, Result};
use crate::field::{DeviceTransfer, LoadedVolume};
use crate::gpu::{Gpu, ShaderVariant, Slot, Span, uniform_buffer};
use crate::scene::Scene;
use bytemuck::{Pod, Zeroable};

/// `Band` of `shaders/render/display.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct BandUniform {
    pub size: [u32; 2],
    pub first_row: u32,
    pub padding: u32,
}

/// A texture that a window shows: sRGB-encoded, 8 bits a channel.
#[derive(Debug)]
pub struct DisplayTexture {
    /// The texture.
    pub texture: wgpu::Texture,
    /// All of it.
    pub view: wgpu::TextureView,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl DisplayTexture {
    /// # Errors
    /// A side that the adapter cannot hold.
    pub fn new(gpu: &Gpu, width: u32, height: u32) -> Result<Self> {
        gpu.check_texture("the picture on screen", [width, height])?;
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture on screen"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::STORAGE_BINDING
                | wgpu::TextureUsages::COPY_SRC
                | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        gpu.take_error()?;
        let view = texture.create_view(&Default::default());
        Ok(Self { texture, view, width, height })
    }

    /// With these pixels: four bytes each, row by row.
    ///
    /// # Errors
    /// A side that the adapter cannot hold, or bytes that are too few or too many.
    pub fn from_srgb8(gpu: &Gpu, width: u32, height: u32, pixels: &[u8]) -> Result<Self> {
        if pixels.len() as u64 != u64::from(width) * u64::from(height) * 4 {
            let why = format!("{} bytes for {width} x {height} pixels", pixels.len());
            return Err(Error::runtime("cannot show a picture", "window", why));
        }
        let made = Self::new(gpu, width, height)?;
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * 4), rows_per_image: None };
        gpu.queue.write_texture(made.texture.as_image_copy(), pixels, layout, made.texture.size());
        Ok(made)
    }
}

/// Paces a picture on the screen, whose queue others draw through, too.
struct OnScreen<'a, G: FnMut() -> bool> {
    gpu: &'a Gpu,
    pace: &'a mut Pace,
    go_on: G,
    begun: bool,
    longest_ms: f64,
}

impl<G: FnMut() -> bool> Pacing for OnScreen<'_, G> {
    fn pixels_next(&mut self) -> Option<u32> {
        if std::mem::replace(&mut self.begun, true) && !(self.go_on)() {
            return None;
        }
        // What others have submitted meanwhile is no part of a band's time; a lost device shows in the band itself.
        let _ = self.gpu.wait_for(self.gpu.submit([]));
        Some(self.pace.pixels())
    }

    fn took(&mut self, pixels: u32, span: Span) {
        self.longest_ms = self.longest_ms.max(span.wall_ms);
        self.pace.learn(pixels, span);
    }
}

/// What drawing to the screen took.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// What was left out.
    pub plan: Plan,
    /// Time of the ray casting, and of finding on the host where rays are to be cast.
    pub span: Span,
    /// The longest that a single band kept the queue, ms.
    pub longest_band_ms: f64,
}

pub(super) fn shader() -> ShaderVariant {
    ShaderVariant::of("render/display.wgsl").constants(CONSTANTS)
}

/// A texture to draw into, and how fast.
pub struct Screen<'a> {
    /// What is drawn into.
    pub target: &'a DisplayTexture,
    /// How long a band may keep the queue.
    pub pace: &'a mut Pace,
}

impl Renderer {
    /// Draws a picture of the texture's size into it, `shadows` being of its lights, in bands of about `pace.target_ms`; `None`
    /// where `go_on` said no
    /// after a band (the texture is then part old, part new).
    ///
    /// # Errors
    /// A picture that the adapter cannot hold, or a lost device.
    pub fn draw_to<'a>(
        &self,
        Screen { target, pace }: Screen<'_>,
        (loaded, transfer): (&LoadedVolume, &DeviceTransfer),
        shadows: impl Into<LightMaps<'a>>,
        scene: &Scene,
        go_on: impl FnMut() -> bool,
    ) -> Result<Option<Drawn>> {
        let scene = Scene { width: target.width, height: target.height, ..scene.clone() };
        let shader = shader();
        pace.begin();
        let mut pacing = OnScreen { gpu: self.gpu(), pace, go_on, begun: false, longest_ms: 0.0 };
        let mut encoded = None;
        let shadows = shadows.into();
        let maps = shadows.clone();
        let drawn = self.draw(loaded, transfer, shadows, &scene, &mut pacing, |band| {
            let Some(map) = maps.maps().first() else { return Ok(false) };
            let size = [scene.width, band.rows];
            let uniform = BandUniform { size, first_row: band.first_row, padding: 0 };
            let uniform = uniform_buffer(self.gpu(), "band", &uniform);
            let stage = [
                (0, self.kernels.uniform(&uniform)),
                (1, Slot::read(band.buffer.as_entire_binding())),
                (2, Slot::store(&target.view, wgpu::TextureFormat::Rgba8Unorm)),
            ];
            let groups = [transfer.group(), &map.group, &self.kernels.group("display", &stage)];
            // The next band need not wait for this one to be encoded.
            encoded = Some(self.kernels.submit(&shader, &groups, picture_workgroups(size[0], size[1]))?);
            Ok(true)
        })?;
        if let Some(submission) = encoded {
            self.gpu().wait_for(submission)?;
        }
        let longest_band_ms = pacing.longest_ms;
        Ok(drawn.map(|(plan, span)| Drawn { plan, span, longest_band_ms }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::assert_layout;

    #[test]
    fn bands_have_one_layout() {
        assert_layout!(&shader(), "Band", BandUniform: size, first_row);
    }
}
