//! Renders pictures by ray casting, band of rows by band of rows, into host memory. [`super::display`] draws pictures
//! into the textures of a window.

use super::caster::Caster;
use super::eye_tiles::EyeTiles;
use super::frame_uniform::FrameUniform;
use super::lights::LightMaps;
use super::output::{Band, Output, OutputPass, ToHost};
use super::pace::{AtOnce, Pace, Pacing};
use super::pass::{Pass, each_section, section_groups, section_passes};
use super::plan::{PictureTiles, plane_distance_mm};
use super::shader::{PICTURE_SIDE, background_shader};
use super::{Plan, Renderer};
use crate::error::{Error, Result};
use crate::field::{
    DeferredPasses, DeviceTransfer, FAR, LoadedVolume, PageReach, PassRays, WorkShare, shape_of,
};
use crate::gpu::{DevicePass, Group, Read, Span, StorageBuffer, uniform_buffer};
use crate::scene::Scene;
use ndarray::Array3;
use std::ops::Range;

/// Rendered picture in host memory, with the time to draw it and the plan of needed and skipped work.
pub struct Picture {
    /// Pixels of the picture as `height x width x 4` floats: linear RGB over the background, and opacity `1 - T_eye`.
    pub pixels: Array3<f32>,
    /// Time to cast the eye rays of the picture. It includes the projection of bricks to tiles of the picture on the
    /// host.
    pub span: Span,
    /// Part of the time of the picture that the host takes to project bricks to tiles of the picture, ms.
    pub host_ms: f64,
    /// Plan of the rendered picture: the work that its scene needed, such as queries for transmittance, and the work
    /// that was skipped.
    pub plan: Plan,
}

/// Marker for a pixel whose eye ray has not started, in the buffer that holds how far each eye ray has been marched.
pub(super) const NOT_STARTED: f32 = -FAR;

/// Number of unfinished pixels and padding, before the progress of the pixels in that buffer, 32-bit words.
const PROGRESS_HEADER_WORDS: usize = 4;

/// Returns the number of picture rows of which the adapter can bind all buffers; their largest has `row_bytes` for each
/// row, and the adapter binds `most` bytes.
fn most_rows(row_bytes: u64, most: u64) -> u32 {
    let header_bytes = 4 * PROGRESS_HEADER_WORDS as u64;
    let rows = u32::try_from(most.saturating_sub(header_bytes) / row_bytes).unwrap_or(u32::MAX);
    (rows / PICTURE_SIDE).max(1) * PICTURE_SIDE
}

impl Renderer {
    /// Renders a picture of a scene; `shadows` holds the shadow maps of its lights, in the order of the lights.
    ///
    /// # Errors
    /// The adapter cannot hold the picture, the numbers of lights and shadow maps differ, or the device is lost.
    pub fn render<'a>(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadows: impl Into<LightMaps<'a>>,
        scene: &Scene,
    ) -> Result<Picture> {
        let broken = || Error::runtime("cannot render", "picture", "it was left unfinished");
        let drawn = self.render_with(
            (loaded, transfer),
            shadows.into(),
            scene,
            &mut AtOnce,
            0..scene.height,
            |_| true,
        )?;
        drawn.ok_or_else(broken)
    }

    /// Returns the rows of a picture of a scene that a process draws as its share, for [`Self::render_rows`].
    pub fn rows_of_share(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        scene: &Scene,
        share: WorkShare,
    ) -> Range<u32> {
        let plane_mm = plane_distance_mm(scene, &loaded.volume);
        let weights = EyeTiles::of(scene, &loaded.volume, &transfer.active, plane_mm).row_weights();
        let Range { start, end } = share.range(&weights);
        let row = |tile: usize| (tile as u32 * PICTURE_SIDE).min(scene.height);
        row(start)..row(end)
    }

    /// Renders some rows of a picture of a scene; the first is a multiple of 8.
    ///
    /// # Errors
    /// See [`Self::render`].
    pub fn render_rows<'a>(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadows: impl Into<LightMaps<'a>>,
        scene: &Scene,
        rows: Range<u32>,
    ) -> Result<Picture> {
        let broken = || Error::runtime("cannot render", "rows of a picture", "they were left unfinished");
        let drawn =
            self.render_with((loaded, transfer), shadows.into(), scene, &mut AtOnce, rows, |_| true)?;
        drawn.ok_or_else(broken)
    }

    /// Renders a picture of a scene in submissions of about `submission_ms` each, so that other threads can use the
    /// device in between. `go_on` receives the share of the picture that is drawn (0 to 1), after each pass over a band of
    /// rows. If it returns `false` after a band, rendering stops and returns `None`.
    ///
    /// # Errors
    /// The adapter cannot hold the picture, the numbers of lights and shadow maps differ, or the device is lost.
    pub fn render_in_bands<'a>(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadows: impl Into<LightMaps<'a>>,
        scene: &Scene,
        submission_ms: f64,
        go_on: impl FnMut(f32) -> bool,
    ) -> Result<Option<Picture>> {
        let pace = &mut Pace::new(submission_ms);
        self.render_with((loaded, transfer), shadows.into(), scene, pace, 0..scene.height, go_on)
    }

    fn render_with(
        &self,
        (loaded, transfer): (&LoadedVolume, &DeviceTransfer),
        shadows: LightMaps<'_>,
        scene: &Scene,
        pacing: &mut dyn Pacing,
        rows: Range<u32>,
        go_on: impl FnMut(f32) -> bool,
    ) -> Result<Option<Picture>> {
        let (width, height) = (scene.width as usize, rows.len());
        let pixels = Vec::with_capacity(width * height * 4);
        let mut output = ToHost { gpu: self.gpu(), pixels, width, rows, go_on };
        let drawn = self.draw(loaded, transfer, shadows, scene, pacing, &mut output)?;
        let pixels = output.pixels;
        let Some((plan, span, host_ms)) = drawn else { return Ok(None) };
        let broken = |why: String| Error::runtime("cannot render", "picture", why);
        let pixels = Array3::from_shape_vec((height, width, 4), pixels).map_err(|e| broken(e.to_string()))?;
        Ok(Some(Picture { pixels, span, host_ms, plan }))
    }

    /// Casts the eye rays of a picture in bands of rows; `pacing` chooses the number of pixels per submission.
    /// Returns the plan, the time, and the host's part of the time in ms; `None` if `pacing` or `output` stopped the
    /// drawing.
    pub(super) fn draw(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadows: LightMaps<'_>,
        scene: &Scene,
        pacing: &mut dyn Pacing,
        output: &mut dyn Output,
    ) -> Result<Option<(Plan, Span, f64)>> {
        let shadows = shadows.checked(scene)?;
        let maps = shadows.maps();
        let none = DeferredPasses::default();
        let deferred = shadows.deferred.unwrap_or(&none);
        let (mut plan, caster, host_ms) = self.caster((loaded, transfer), maps, scene, deferred)?;
        let (width, height) = (scene.width, scene.height);
        let row_bytes = u64::from(width) * 16;
        let limits = self.gpu().device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let highest = most_rows(u64::from(width) * caster.pixel_bytes(), most);
        // The time of a picture includes the search for its tiles on the host.
        let mut span = Span { gpu_ms: self.gpu().timestamp_period_ns.map(|_| host_ms), wall_ms: host_ms };
        let mut made: Option<(wgpu::Buffer, u32)> = None;
        let Range { start: begin, end } = output.rows(height);
        let mut first_row = begin;
        while first_row < end {
            let Some(pixels) = pacing.pixels_next() else { return Ok(None) };
            // Each part of a picture would need a sweep of its own.
            let pixels = if caster.needs_sweeps() { u32::MAX } else { pixels };
            let rows = pixels_to_rows(pixels, width).min(highest).min(end - first_row);
            let buffer = match &made {
                Some((buffer, rows_made)) if *rows_made >= rows => buffer.clone(),
                _ => {
                    let buffer = StorageBuffer::zeroed(self.gpu(), "picture", row_bytes * u64::from(rows))?;
                    made = Some((buffer.clone(), rows));
                    buffer
                }
            };
            let band = Band { buffer: &buffer, first_row, rows };
            let after = output.pass(&band)?;
            let mut advanced = |share: f32| {
                let done = (first_row - begin) as f32 + share * rows as f32;
                output.advanced(done / (end - begin) as f32)
            };
            let after = after.as_ref();
            let is_drawn =
                self.cast_band(&caster, &band, (pixels, pacing), after, &mut span, &mut advanced)?;
            if !is_drawn || !output.finished(&band)? {
                return Ok(None);
            }
            first_row += rows;
        }
        caster.counts.get().into_iter().for_each(|counts| plan.skip_tiles(counts));
        Ok(Some((plan, span, host_ms)))
    }

    /// Casts the eye rays of one band of picture rows, in submissions of a few columns; the first one draws about
    /// `pixels` pixels. The last one also runs `after`. `advanced` receives the share of the band that is drawn. Returns
    /// `false` if `pacing` stopped the drawing.
    fn cast_band(
        &self,
        caster: &Caster<'_>,
        &Band { buffer, first_row, rows }: &Band<'_>,
        (pixels, pacing): (u32, &mut dyn Pacing),
        after: Option<&OutputPass>,
        span: &mut Span,
        advanced: &mut dyn FnMut(f32) -> bool,
    ) -> Result<bool> {
        let width = caster.scene.width;
        // Progress of a pixel: sample, light there, last two values.
        let resumable = caster.passes.iter().any(|pass| pass.resumable || pass.sections.is_some());
        let pixels_here = if resumable { rows as usize * width as usize } else { 1 };
        let mut start = vec![f32::from_bits(0); PROGRESS_HEADER_WORDS];
        start.resize(4 * pixels_here + PROGRESS_HEADER_WORDS, NOT_STARTED);
        let progress = StorageBuffer::from_slice(self.gpu(), "progress", &start)?;
        let mut pixels = Some(pixels);
        let mut first_column = 0;
        while first_column < width {
            let Some(budget) = pixels.take().or_else(|| pacing.pixels_next()) else { return Ok(false) };
            let columns = pixels_to_columns(budget, rows).min(width - first_column);
            let tiles = caster.part(self.gpu(), [first_column, first_row], [columns, rows])?;
            let mut part: Option<Span> = None;
            for (i, pass) in caster.passes.iter().enumerate() {
                if resumable && i > 0 {
                    self.gpu().queue.write_buffer(&progress, 0, bytemuck::cast_slice(&start));
                }
                let uniform = FrameUniform {
                    first_row,
                    rows,
                    tiles_cast: tiles.cast,
                    first_tile: [first_column, first_row].map(|n| n / PICTURE_SIDE),
                    part_tiles: [columns, rows].map(|n| n.div_ceil(PICTURE_SIDE)),
                    ..caster.frame_uniform(i)
                };
                let uniform = uniform_buffer(self.gpu(), "frame", &uniform);
                let buffers = [buffer, &progress, &tiles.buffer];
                let states = caster.ray_states(self.gpu(), rows * width)?;
                let stages: Vec<_> = each_section(pass.sections)
                    .map(|section| self.stage(caster, &uniform, buffers, (section, states.as_ref())))
                    .collect();
                // The first pass draws the background.
                let left_out = if i == 0 { tiles.left_out } else { 0 };
                let is_last = i + 1 == caster.passes.len() && first_column + columns >= width;
                let after = after.filter(|_| is_last);
                let mut advanced = |unfinished: u32| {
                    let share = 1.0 - unfinished as f32 / (columns * rows) as f32;
                    let passes = (i as f32 + share) / caster.passes.len() as f32;
                    advanced((first_column as f32 + passes * columns as f32) / width as f32)
                };
                let tiles = [left_out, tiles.cast];
                // Without a share of pixels: a block of pages is finished.
                let mut go_on = |unfinished: Option<u32>| {
                    advanced(unfinished.unwrap_or(columns * rows))
                        && (unfinished.is_some() || pacing.pixels_next().is_some())
                };
                let took = self.cast_part(caster, pass, (&stages, &progress), tiles, after, &mut go_on)?;
                let Some(took) = took else { return Ok(false) };
                part = Some(part.map_or(took, |so_far| so_far.plus(took)));
            }
            if let Some(took) = part {
                pacing.took(rows * columns, took);
                *span = span.plus(took);
            }
            first_column += columns;
        }
        Ok(true)
    }

    /// Runs one rendering pass over a part of a band of picture rows, in as many dispatches as it needs. `stages` are
    /// the groups 2 of the sections of the volume, or of the whole volume. `tiles` holds the number of picture tiles
    /// without eye rays, and the number of those with eye rays. `after` runs at the end of each submission. `go_on`
    /// receives the number of unfinished pixels after each dispatch; after that of a block of the volume's pages it
    /// receives `None`, and may stop the drawing. The result is then `None`.
    fn cast_part(
        &self,
        caster: &Caster<'_>,
        pass: &Pass,
        (stages, progress): (&[Group], &wgpu::Buffer),
        tiles: [u32; 2],
        after: Option<&OutputPass>,
        go_on: &mut dyn FnMut(Option<u32>) -> bool,
    ) -> Result<Option<Span>> {
        let shared = [caster.transfer.group(), &pass.group];
        let groups = section_groups(pass.sections, shared, stages, caster.mesh.as_ref());
        let mut part: Option<Span> = None;
        let background = background_shader(matches!(caster.tiles, PictureTiles::OnDevice(_)));
        let [left_out, cast] = tiles.map(shape_of);
        let rays = section_passes(&groups, &pass.shader, cast);
        let mut fill = DevicePass { variant: &background, groups: &groups[0].groups, workgroups: left_out };
        let after_groups = after.map(|after| [caster.transfer.group(), &pass.group, &after.stage]);
        let after = after.zip(after_groups.as_ref()).map(|(after, groups)| DevicePass {
            variant: &after.shader,
            groups,
            workgroups: after.workgroups,
        });
        let cast = |first: &[DevicePass<'_>], reads: &[Read<'_>]| {
            let passes = [first, &rays, after.as_slice()].concat();
            let recorded = self.kernels.record("ray cast", &passes, reads)?;
            caster.deferred.submit_with(&self.kernels, recorded)
        };
        let mut submit = || -> Result<(Span, u32)> {
            let unfinished = pass.resumable.then_some(Read { buffer: progress, words: 1 });
            let mut reads = unfinished.as_slice().to_vec();
            let (took, words) = match &caster.tiles {
                // The first submission also finds the tiles.
                PictureTiles::OnDevice(tiles) if caster.counts.get().is_none() => {
                    reads.push(tiles.read());
                    let ran = tiles.with_pass(|project| cast(&[project, fill], &reads))?;
                    let head = ran.1.last().map_or(&[][..], |words| words);
                    caster.counts.set(Some(tiles.counts(head)));
                    ran
                }
                _ => cast(&[fill], &reads)?,
            };
            // Later dispatches only continue rays.
            fill.workgroups = [0; 3];
            let so_far = part.map_or(took, |s| s.plus(took));
            part = Some(so_far);
            let unfinished = if pass.resumable { words[0][0] } else { 0 };
            Ok((so_far, unfinished))
        };
        if let Some(stream) = caster.transfer.stream() {
            let volume = &caster.loaded.volume;
            let eye = volume.index_from_world().transform_point3(caster.scene.camera.eye);
            let rays = (PassRays::From(eye), PageReach::Neighbours);
            let mut took = Span { gpu_ms: None, wall_ms: 0.0 };
            let is_drawn = stream.sweep(self.gpu(), volume, rays, || {
                took = submit()?.0;
                Ok(go_on(None))
            })?;
            go_on(Some(0));
            return Ok(is_drawn.then_some(took));
        }
        loop {
            let (so_far, unfinished) = submit()?;
            go_on(Some(unfinished));
            if unfinished == 0 {
                return Ok(Some(so_far));
            }
            self.gpu().queue.write_buffer(progress, 0, &0u32.to_le_bytes());
        }
    }
}

/// Smallest width of the part of a picture that one submission draws, in pixels. Narrower parts would spend too much
/// time on the submission.
const LEAST_COLUMNS: u32 = 64;

/// Converts a number of pixels to a number of picture rows: whole workgroups, and at least one.
fn pixels_to_rows(pixels: u32, width: u32) -> u32 {
    (pixels / width.max(1) / PICTURE_SIDE).max(1) * PICTURE_SIDE
}

/// Converts a number of pixels to a number of picture columns: whole workgroups, and at least the smallest width.
fn pixels_to_columns(pixels: u32, rows: u32) -> u32 {
    (pixels / rows.max(1) / PICTURE_SIDE * PICTURE_SIDE).max(LEAST_COLUMNS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_whole_workgroups_of_a_minimum_width() {
        assert_eq!(pixels_to_rows(u32::MAX, 512) % PICTURE_SIDE, 0);
        assert_eq!((pixels_to_rows(20_000, 1000), pixels_to_columns(20_000, 16)), (16, 1248));
        // Eight rows already have more pixels than that, and so a part of their columns is drawn.
        assert_eq!((pixels_to_rows(1000, 1000), pixels_to_columns(1000, 8)), (8, 120));
        assert_eq!((pixels_to_rows(1, 1000), pixels_to_columns(1, 8)), (8, LEAST_COLUMNS));
    }

    #[test]
    fn progress_and_its_header_fit_into_a_buffer() {
        assert_eq!(most_rows(4096 * 16, 1 << 27), 2040);
        assert_eq!(most_rows(4096 * 16, (1 << 27) + 16), 2048);
        assert_eq!(most_rows(4096 * 16, 1), PICTURE_SIDE, "the least, which is refused later");
    }
}
