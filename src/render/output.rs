//! Output of a picture, band of rows by band of rows.

use crate::error::Result;
use crate::gpu::{Gpu, Group, ShaderVariant, read_back};
use std::ops::Range;

/// Band of picture rows that is finished, in a device buffer.
pub(super) struct Band<'a> {
    /// Pixels of the band of picture rows as `rows x width x 4` floats: linear RGB and opacity.
    pub buffer: &'a wgpu::Buffer,
    pub first_row: u32,
    pub rows: u32,
}

/// Destination of a picture's bands of rows.
pub(super) trait Output {
    /// Returns the rows of a picture of a height that are drawn. The first is a multiple of the side of a tile.
    fn rows(&self, height: u32) -> Range<u32> {
        0..height
    }

    /// Returns the pass that processes a band on the device, in the submission that finishes the band.
    fn pass(&mut self, _band: &Band<'_>) -> Result<Option<OutputPass>> {
        Ok(None)
    }

    /// Receives the share of the picture that is drawn (0 to 1), between the passes of a band. `false` stops the drawing
    /// between blocks of a volume's pages; otherwise it stops between bands only.
    fn advanced(&mut self, _share: f32) -> bool {
        true
    }

    /// Processes a band that is finished on the device. If it returns `false`, the drawing stops.
    fn finished(&mut self, band: &Band<'_>) -> Result<bool>;
}

/// Pass that processes a finished band on the device.
pub(super) struct OutputPass {
    pub shader: ShaderVariant,
    /// Bind group 2 of the pass; groups 0 and 1 are those of the pass that casts rays.
    pub stage: Group,
    pub workgroups: [u32; 3],
}

/// Output of a picture to host memory. `go_on` receives the share of the picture that is drawn, and may stop
/// the drawing after a band.
pub(super) struct ToHost<'a, G: FnMut(f32) -> bool> {
    pub gpu: &'a Gpu,
    pub pixels: Vec<f32>,
    pub width: usize,
    pub rows: Range<u32>,
    pub go_on: G,
}

impl<G: FnMut(f32) -> bool> Output for ToHost<'_, G> {
    fn rows(&self, _height: u32) -> Range<u32> {
        self.rows.clone()
    }

    fn advanced(&mut self, share: f32) -> bool {
        (self.go_on)(share)
    }

    fn finished(&mut self, band: &Band<'_>) -> Result<bool> {
        self.pixels.extend(read_back::<f32>(self.gpu, band.buffer, band.rows as usize * self.width * 4)?);
        let done = band.first_row + band.rows - self.rows.start;
        Ok((self.go_on)(done as f32 / self.rows.len() as f32))
    }
}
