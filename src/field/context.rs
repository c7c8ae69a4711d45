//! Inputs for building a shadow map: a volume, its transfer function and a light on a graphics device.

use super::shader::{RAY_STATES, shape_of};
use super::tile_pace::Batch;
use super::{
    BuildRecorder, DeferredPasses, DeviceTransfer, LightSpace, MapShape, March, NodePools, TilePace, View,
    WorkShare,
};
use crate::error::{Error, Result};
use crate::gpu::tuning::MAX_LIGHT_SAMPLES;
use crate::gpu::{DevicePass, Gpu, Group, Kernels, Read, ShaderVariant, Slot, Span, uniform_buffer};
use crate::scene::{Extent, Light};
use crate::strands::{Strands, VoxelisedStrands};
use crate::volume::Volume;

/// Inputs for building the shadow map of one light: the volume, its transfer function, and the pipelines of the
/// device.
#[derive(Clone, Copy)]
pub struct BuildContext<'a> {
    /// Compute pipelines on the graphics device, which run the build passes of the shadow map.
    pub kernels: &'a Kernels,
    /// Choice of the number of shadow-map tiles in each submission to the graphics device, which limits the duration
    /// of a submission.
    pub pace: &'a TilePace,
    /// Memory pools for curve nodes of earlier builds of deep shadow maps for this volume, and their sizes.
    pub node_pools: &'a NodePools,
    /// Volume that casts the shadows.
    pub volume: &'a Volume,
    /// Transfer function on the graphics device, with its lookup tables and the active bricks (blocks of cells with
    /// extinction).
    pub transfer: &'a DeviceTransfer,
    /// Strands (hair or fibres) from which the volume was voxelised; `None` for other volumes.
    pub strands: Option<&'a VoxelisedStrands>,
    /// Light whose shadow map is built.
    pub light: Light,
    /// Size of the light, if the map answers for a whole light with a size.
    pub extent: &'a Extent,
    /// Camera view in which the shadow map is needed; `None`: at all points.
    pub view: Option<&'a View>,
    /// Share of the map's texels that this process builds.
    pub share: WorkShare,
    /// Way in which the passes of the build run.
    pub passes: BuildPasses<'a>,
}

/// Way in which the passes of a build run. The default runs all of them at once.
#[derive(Clone, Copy, Default)]
pub struct BuildPasses<'a> {
    /// Passes that wait for the submission of the picture; `None` if passes run at once.
    pub deferred: Option<&'a DeferredPasses>,
    /// Recorder of the passes, for another program; `None` if they only run.
    pub recorder: Option<&'a BuildRecorder>,
    /// Called before each submission; `false` cancels the build.
    pub go_on: Option<&'a dyn Fn() -> bool>,
}

/// List of shadow-map tiles (or blocks of nodes) on the device, over which a compute pass runs.
#[derive(Clone, Copy)]
pub struct TileList<'a> {
    /// Entries of the list of tiles, one 32-bit word each.
    pub entries: &'a wgpu::Buffer,
    /// Number of tiles in the list.
    pub count: u32,
    /// Number of workgroups that process one tile of the list.
    pub workgroups: u32,
}

/// Largest part of a submission, by the expected duration, that deferred passes take: a part of a picture follows.
const MOST_DEFERRED: f64 = 0.5;

impl BuildContext<'_> {
    /// Returns the graphics device on which the shadow map is built.
    pub fn gpu(&self) -> &Gpu {
        self.kernels.gpu()
    }

    /// Returns the projection of a shadow map. It is fitted to all active bricks (blocks of cells with extinction),
    /// or to those in the camera's view.
    pub fn light_space(&self, shape: MapShape) -> LightSpace {
        let active = &self.transfer.active;
        let mut space = LightSpace::fit(self.volume, active, self.light, shape, self.view);
        if let March::Samples { step } = shape.march {
            let shortest = space.depth_range_mm() / f64::from(MAX_LIGHT_SAMPLES);
            space.step_mm = (step * self.volume.min_spacing_mm()).max(shortest);
        }
        space
    }

    /// Returns the strands that can be drawn directly into a shadow map, without voxels.
    ///
    /// # Errors
    /// The volume was not made from strands, a strand is wider than a voxel, or the transfer function changes their
    /// extinction.
    pub fn drawn_strands(&self) -> Result<&Strands> {
        let refused = |why: &str| Error::input("cannot draw strands into the map", "from=lines", why);
        let source = &self.volume.provenance.source;
        let strands = self.strands.ok_or_else(|| {
            refused(&format!("{source} was not made from strands"))
                .hint("from=voxels marches through any volume")
        })?;
        let (widest, voxel) = (strands.strands.widest_mm(), self.volume.min_spacing_mm());
        if widest > voxel {
            let why = format!(
                "a strand is {widest} mm wide, and a voxel {voxel:.3}: bricks hold middles of strands"
            );
            return Err(refused(&why).hint("a smaller --resolution has wider voxels"));
        }
        let [_, largest] = self.volume.value_range();
        let as_it_is = self.transfer.function().leaves_extinction(largest);
        match as_it_is && !self.transfer.has_gradient_opacity {
            true => Ok(&strands.strands),
            false => Err(refused("the transfer function does not take the strands' extinction as it is")
                .hint("the preset hair does")),
        }
    }

    /// Creates the uniform buffer of a shadow map's projection, for binding 0 of bind group 1.
    pub fn light_uniform(&self, light_space: &LightSpace) -> wgpu::Buffer {
        uniform_buffer(self.gpu(), "light space", &light_space.uniform())
    }

    /// Returns a context whose passes are not deferred, for builds whose passes depend on each other.
    #[must_use]
    pub fn at_once(&self) -> Self {
        Self { passes: BuildPasses { deferred: None, ..self.passes }, ..*self }
    }

    /// Runs one compute pass of a shadow-map build. Its shader reads the volume and the transfer function; `shadow`
    /// and `stage` are bind groups 1 and 2 of the shader.
    ///
    /// # Errors
    /// The device is out of memory or lost.
    pub fn run(
        &self,
        label: &'static str,
        variant: &ShaderVariant,
        [shadow, stage]: [&Group; 2],
        workgroups: [u32; 3],
    ) -> Result<Span> {
        let variant = &self.prepared(variant)?;
        self.record(variant, [shadow, stage], workgroups);
        let groups = &[self.transfer.group(), shadow, stage];
        let pass = DevicePass { variant, groups, workgroups };
        Ok(self.kernels.run(label, &[pass], &[])?.0)
    }

    /// Runs a compute pass of a shadow-map build over a list, such as a list of tiles. The list is split into batches,
    /// one submission each. Binding 0 of bind group 2 is the batch's part of the list; `stage` holds the other
    /// bindings of that group. Returns the duration, and the words of `read` after the last batch. If the pass is
    /// deferred, the duration is zero and there are no words.
    ///
    /// # Errors
    /// The device is out of memory or lost.
    pub fn run_over(
        &self,
        list: TileList<'_>,
        label: &'static str,
        variant: &ShaderVariant,
        shadow: &Group,
        stage: &[(u32, Slot<'_>)],
        read: Option<Read<'_>>,
    ) -> Result<(Span, Option<Vec<u32>>)> {
        let granule = TilePace::granule(&self.gpu().device.limits());
        let variant = &self.prepared(variant)?;
        let over = |batch: Batch| {
            let entries = (0, Slot::read(batch.binding(list.entries)));
            let stage = self.kernels.group(label, &[&[entries][..], stage].concat());
            (stage, shape_of(batch.count() * list.workgroups))
        };
        if self.passes.recorder.is_some() {
            let (stage, workgroups) = over(Batch::all(list.count));
            self.record(variant, [shadow, &stage], workgroups);
        }
        let share = self.pace.share(label, list.count);
        let fits = |deferred: &&DeferredPasses| deferred.share() + share <= MOST_DEFERRED;
        if let Some(deferred) = self.passes.deferred.filter(fits) {
            let (stage, workgroups) = over(Batch::all(list.count));
            let groups = &[self.transfer.group(), shadow, &stage];
            let pass = DevicePass { variant, groups, workgroups };
            deferred.push(label, list.count, share, self.kernels.record(label, &[pass], read.as_slice())?);
            return Ok((self.no_time(), None));
        }
        let mut words = Vec::new();
        let span = self.pace.run_batches(label, list.count, granule, |batch| {
            self.check(label)?;
            self.wait_until_idle();
            let (stage, workgroups) = over(batch);
            let groups = &[self.transfer.group(), shadow, &stage];
            let pass = DevicePass { variant, groups, workgroups };
            let (span, reads) = self.kernels.run(label, &[pass], read.as_slice())?;
            words = reads.into_iter().next().unwrap_or_default();
            Ok(span)
        })?;
        Ok((span, Some(words)))
    }

    /// Runs passes that follow a pass over a list of tiles ([`Self::run_over`]), in one submission. `shadow` and
    /// `stage` are bind groups 1 and 2 of all of them. With `is_deferred`, that pass was deferred, and these are
    /// deferred, too. Returns the duration, and the words of `read` unless the passes are deferred.
    ///
    /// # Errors
    /// The device is out of memory or lost.
    pub fn run_behind(
        &self,
        label: &'static str,
        passes: &[(&ShaderVariant, [u32; 3])],
        [shadow, stage]: [&Group; 2],
        read: Read<'_>,
        is_deferred: bool,
    ) -> Result<(Span, Option<Vec<u32>>)> {
        passes.iter().for_each(|(variant, workgroups)| self.record(variant, [shadow, stage], *workgroups));
        let groups = &[self.transfer.group(), shadow, stage];
        let pass = |&(variant, workgroups)| DevicePass { variant, groups, workgroups };
        let passes: Vec<_> = passes.iter().map(pass).collect();
        let recorded = self.kernels.record(label, &passes, &[read])?;
        if let Some(deferred) = self.passes.deferred.filter(|_| is_deferred) {
            deferred.push(label, 0, 0.0, recorded);
            return Ok((self.no_time(), None));
        }
        self.wait_until_idle();
        let (span, reads) = self.kernels.submit(vec![recorded])?.into_iter().next().unwrap_or_default();
        Ok((span, reads.into_iter().next()))
    }

    /// Prepares the shader of a pass over the volume.
    ///
    /// # Errors
    /// The device is out of memory, or the volume is resident block by block and the pass reads it as a whole.
    fn prepared(&self, variant: &ShaderVariant) -> Result<ShaderVariant> {
        if self.transfer.stream().is_some() && !variant.defs.contains(&RAY_STATES) {
            return Err(self.not_by_blocks());
        }
        self.transfer.prepared(self.gpu(), variant.clone())
    }

    /// Returns the error of a build that needs the whole volume on the device.
    pub fn not_by_blocks(&self) -> Error {
        let source = &self.volume.provenance.source;
        let why = "its pages with extinction exceed the device memory, and this method or setting needs all at once";
        Error::input("cannot build a shadow map", source, why)
            .hint("dsm, osm, dom, bom, fourier, moments, wavelet and beer march block by block; --device-memory sets the limit")
    }

    /// Records a pass for another program, if the build is recorded. `shadow` and `stage` are bind groups 1 and 2.
    fn record(&self, variant: &ShaderVariant, [shadow, stage]: [&Group; 2], workgroups: [u32; 3]) {
        if let Some(recorder) = self.passes.recorder {
            recorder.push(variant, [self.transfer.group(), shadow, stage], workgroups);
        }
    }

    /// Returns the duration of a deferred pass before it has run.
    fn no_time(&self) -> Span {
        Span { gpu_ms: self.gpu().timestamp_period_ns.map(|_| 0.0), wall_ms: 0.0 }
    }

    /// Runs a compute pass of a shadow-map build once per step, where each step reads what earlier steps stored.
    /// Steps differ in bind group 2 and dispatch size; a batch of several steps is one submission.
    ///
    /// # Errors
    /// The device is out of memory or lost.
    pub fn run_steps(
        &self,
        label: &'static str,
        variant: &ShaderVariant,
        shadow: &Group,
        steps: &[(Group, [u32; 3])],
    ) -> Result<Span> {
        let variant = &self.prepared(variant)?;
        let groups: Vec<_> = steps.iter().map(|(step, _)| [self.transfer.group(), shadow, step]).collect();
        let passes = groups.iter().zip(steps);
        let passes: Vec<_> =
            passes.map(|(groups, (_, size))| DevicePass { variant, groups, workgroups: *size }).collect();
        self.pace.run_batches(label, steps.len() as u32, 1, |batch| {
            self.check(label)?;
            self.wait_until_idle();
            Ok(self.kernels.run(label, &passes[batch.range()], &[])?.0)
        })
    }

    /// Checks that the build goes on.
    ///
    /// # Errors
    /// The user cancelled it.
    fn check(&self, label: &str) -> Result<()> {
        if self.passes.go_on.is_none_or(|go_on| go_on()) { Ok(()) } else { Err(Error::cancelled(label)) }
    }

    /// Waits until the device is idle, if the duration of submissions is limited and measured by the host's clock. The
    /// work of other threads then does not count as build time.
    fn wait_until_idle(&self) {
        if self.pace.is_limited() && self.gpu().timestamp_period_ns.is_none() {
            // A lost device is reported by the pass itself.
            let _ = self.gpu().wait_for(self.gpu().submit([]));
        }
    }
}
