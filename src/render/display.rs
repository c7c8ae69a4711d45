//! Displays pictures on the screen: encodes them to sRGB in a device texture, band by band, without a copy to the
//! host.

use super::lights::LightMaps;
use super::output::{Band, Output, OutputPass};
use super::pace::{Pace, Pacing};
use super::shader::{CONSTANTS, picture_workgroups};
use super::{Plan, Renderer};
use crate::error::{Error, Result};
use crate::field::{DeviceTransfer, LoadedVolume};
use crate::gpu::{Gpu, Kernels, ShaderVariant, Slot, Span, texture, uniform_buffer, write_texels};
use crate::scene::Scene;
use bytemuck::{Pod, Zeroable};

/// Uniform of a band of picture rows that is encoded to sRGB: `Band` of `shaders/render/display.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct BandUniform {
    pub size: [u32; 2],
    pub first_row: u32,
    pub padding: u32,
}

/// Texture for the picture that the window shows: sRGB-encoded, 8 bits per channel.
#[derive(Debug)]
pub struct DisplayTexture {
    /// Device texture with the picture of a window.
    pub texture: wgpu::Texture,
    /// View of the whole picture texture, for shaders.
    pub view: wgpu::TextureView,
    /// Width of the window's picture in pixels.
    pub width: u32,
    /// Height of the window's picture in pixels.
    pub height: u32,
}

impl DisplayTexture {
    /// Creates a black texture for the picture of a window.
    ///
    /// # Errors
    /// A side exceeds the adapter's limit on textures.
    pub fn new(gpu: &Gpu, width: u32, height: u32) -> Result<Self> {
        gpu.check_texture("the picture on screen", [width, height])?;
        let (format, dimension) = (wgpu::TextureFormat::Rgba8Unorm, wgpu::TextureDimension::D2);
        let usage = wgpu::TextureUsages::STORAGE_BINDING;
        let texture = texture(gpu, "picture on screen", format, dimension, [width, height, 1], usage);
        gpu.take_error()?;
        let view = texture.create_view(&Default::default());
        Ok(Self { texture, view, width, height })
    }

    /// Creates the texture of a window's picture from sRGB pixels, four bytes each, row by row.
    ///
    /// # Errors
    /// A side exceeds the adapter's limit on textures, or the number of bytes is wrong.
    pub fn from_srgb8(gpu: &Gpu, width: u32, height: u32, pixels: &[u8]) -> Result<Self> {
        if pixels.len() as u64 != u64::from(width) * u64::from(height) * 4 {
            let why = format!("{} bytes for {width} x {height} pixels", pixels.len());
            return Err(Error::runtime("cannot show a picture", "window", why));
        }
        let made = Self::new(gpu, width, height)?;
        write_texels(gpu, &made.texture, [0; 3], [width, height, 1], pixels);
        Ok(made)
    }
}

/// Pacing for a picture in the window: it chooses the size of each submission, so that other threads can use the
/// device in between.
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
        if self.gpu.timestamp_period_ns.is_none() {
            // The work of other threads must not count as a band's time by the host's clock. A lost device is reported
            // by the band itself.
            let _ = self.gpu.wait_for(self.gpu.submit([]));
        }
        Some(self.pace.pixels())
    }

    fn took(&mut self, pixels: u32, span: Span) {
        self.longest_ms = self.longest_ms.max(span.best().0);
        self.pace.learn(pixels, span);
    }
}

/// Output of a picture to a texture of the window.
struct ToScreen<'a> {
    kernels: &'a Kernels,
    target: &'a DisplayTexture,
    shader: ShaderVariant,
}

impl Output for ToScreen<'_> {
    fn pass(&mut self, band: &Band<'_>) -> Result<Option<OutputPass>> {
        let size = [self.target.width, band.rows];
        let uniform = BandUniform { size, first_row: band.first_row, padding: 0 };
        let uniform = uniform_buffer(self.kernels.gpu(), "band", &uniform);
        let stage = [
            (0, self.kernels.uniform(&uniform)),
            (1, Slot::read(band.buffer.as_entire_binding())),
            (2, Slot::store(&self.target.view, wgpu::TextureFormat::Rgba8Unorm)),
        ];
        let stage = self.kernels.group("display", &stage);
        let workgroups = picture_workgroups(size[0], size[1]);
        Ok(Some(OutputPass { shader: self.shader.clone(), stage, workgroups }))
    }

    fn finished(&mut self, _band: &Band<'_>) -> Result<bool> {
        Ok(true)
    }
}

/// Plan and times of a picture that was drawn to the screen.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// Plan of the drawn picture: the work that its scene needed, such as queries for transmittance, and the work
    /// that was skipped.
    pub plan: Plan,
    /// Time to cast the eye rays of the picture. It includes the projection of bricks to tiles of the picture on the
    /// host.
    pub span: Span,
    /// Longest time that the device needed for one submission of the picture, ms.
    pub longest_band_ms: f64,
}

pub(super) fn shader() -> ShaderVariant {
    ShaderVariant::of("render/display.wgsl").constants(CONSTANTS)
}

/// Texture to which a picture for the screen is drawn, and the choice of the number of pixels per submission.
pub struct Screen<'a> {
    /// Texture to which the picture is drawn.
    pub target: &'a DisplayTexture,
    /// Choice of the number of pixels in each submission of the picture, from the measured speed of drawing.
    pub pace: &'a mut Pace,
}

impl Renderer {
    /// Draws a picture to the texture of a window, in bands of rows that take about `pace.target_ms` each; `shadows`
    /// holds the shadow maps of its lights. Returns `None` if `go_on` returned `false` between two bands: the texture
    /// then is partly drawn.
    ///
    /// # Errors
    /// The adapter cannot hold the picture, or the device is lost.
    pub fn draw_to<'a>(
        &self,
        Screen { target, pace }: Screen<'_>,
        (loaded, transfer): (&LoadedVolume, &DeviceTransfer),
        shadows: impl Into<LightMaps<'a>>,
        scene: &Scene,
        go_on: impl FnMut() -> bool,
    ) -> Result<Option<Drawn>> {
        let scene = Scene { width: target.width, height: target.height, ..scene.clone() };
        pace.begin();
        let mut pacing = OnScreen { gpu: self.gpu(), pace, go_on, begun: false, longest_ms: 0.0 };
        let shadows = shadows.into();
        let mut output = ToScreen { kernels: &self.kernels, target, shader: shader() };
        let drawn = self.draw(loaded, transfer, shadows, &scene, &mut pacing, &mut output)?;
        let longest_band_ms = pacing.longest_ms;
        Ok(drawn.map(|(plan, span, _)| Drawn { plan, span, longest_band_ms }))
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
