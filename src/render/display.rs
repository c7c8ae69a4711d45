//! Pictures on the screen: encoded to sRGB into a texture of the same device, band by band, with no copy to the host.

use super::{DeviceTransfer, LoadedVolume, Plan, Renderer};
use crate::error::Result;
use crate::gpu::{Gpu, ShaderVariant, Span, uniform_buffer};
use crate::scene::Scene;
use crate::shadow::ShadowMap;
use bytemuck::{Pod, Zeroable};

/// `Band` of `shaders/display.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct BandUniform {
    pub size: [u32; 2],
    pub first_row: u32,
    pub padding: u32,
}

/// A texture that a window shows: sRGB-encoded, 8 bits a channel.
#[derive(Debug)]
pub struct DisplayTexture {
    pub texture: wgpu::Texture,
    pub view: wgpu::TextureView,
    pub width: u32,
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
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        gpu.take_error()?;
        let view = texture.create_view(&Default::default());
        Ok(Self { texture, view, width, height })
    }
}

/// How long one submission may keep the queue, and what has been learnt of how much fits into that.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    pub target_ms: f64,
    pixels_per_ms: f64,
}

impl Pace {
    /// Starts with small bands until it is known how fast the adapter is.
    pub fn new(target_ms: f64) -> Self {
        Self { target_ms, pixels_per_ms: 500.0 }
    }

    /// Pixels that have lately been drawn in a millisecond.
    pub fn pixels_per_ms(&self) -> f64 {
        self.pixels_per_ms
    }

    pub(super) fn learn(&mut self, pixels: u32, span: Span) {
        let now = f64::from(pixels) / span.wall_ms.max(0.05);
        // Bands differ in what they hold; half the new and half the old follows a scene within a few of them.
        self.pixels_per_ms = 0.5 * (self.pixels_per_ms + now);
    }

    pub(super) fn rows(&self, width: u32) -> u32 {
        // Workgroups are eight rows high.
        let rows = (self.target_ms * self.pixels_per_ms / f64::from(width.max(1)) / 8.0).floor().max(1.0);
        (rows * 8.0).min(f64::from(u32::MAX)) as u32
    }
}

/// What drawing to the screen took.
#[derive(Debug, Clone)]
pub struct Drawn {
    pub plan: Plan,
    pub span: Span,
    /// The longest that a single band kept the queue, ms.
    pub longest_band_ms: f64,
}

impl Renderer {
    /// Draws a picture of the texture's size into it, in bands of about `pace.target_ms`; `None` where `go_on` said no
    /// after a band (the texture is then part old, part new).
    ///
    /// # Errors
    /// A picture that the adapter cannot hold, or a lost device.
    #[expect(clippy::too_many_arguments, reason = "what is drawn, where to, and how fast")]
    pub fn draw_to(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadow: &ShadowMap,
        scene: &Scene,
        target: &DisplayTexture,
        pace: &mut Pace,
        mut go_on: impl FnMut() -> bool,
    ) -> Result<Option<Drawn>> {
        let scene = Scene { width: target.width, height: target.height, ..scene.clone() };
        let variant = ShaderVariant { entry: "display.wgsl", modules: Vec::new(), defs: Vec::new() };
        let pipeline = self.pipeline(&variant, &self.layouts.display)?;
        let pace = std::cell::RefCell::new(pace);
        let mut longest_band_ms = 0.0_f64;
        let mut complete = true;
        let (plan, span) = self.draw(
            loaded,
            transfer,
            shadow,
            &scene,
            |_| pace.borrow().rows(scene.width),
            |band| {
                pace.borrow_mut().learn(band.rows * scene.width, band.span);
                longest_band_ms = longest_band_ms.max(band.span.wall_ms);
                let size = [scene.width, band.rows];
                let uniform = BandUniform { size, first_row: band.first_row, padding: 0 };
                let uniform = uniform_buffer(&self.gpu, "band", &uniform);
                let group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("display"),
                    layout: &self.layouts.display,
                    entries: &[
                        wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() },
                        wgpu::BindGroupEntry { binding: 1, resource: band.buffer.as_entire_binding() },
                        wgpu::BindGroupEntry {
                            binding: 2,
                            resource: wgpu::BindingResource::TextureView(&target.view),
                        },
                    ],
                });
                let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
                {
                    let mut pass = encoder.begin_compute_pass(&Default::default());
                    pass.set_pipeline(&pipeline);
                    pass.set_bind_group(0, transfer.bind_group(), &[]);
                    pass.set_bind_group(1, &shadow.bind_group, &[]);
                    pass.set_bind_group(2, &group, &[]);
                    pass.dispatch_workgroups(scene.width.div_ceil(8), band.rows.div_ceil(8), 1);
                }
                self.gpu.submit_and_wait(encoder)?;
                let last = band.first_row + band.rows >= scene.height;
                complete = last || go_on();
                Ok(complete)
            },
        )?;
        Ok(span.filter(|_| complete).map(|span| Drawn { plan, span, longest_band_ms }))
    }
}
