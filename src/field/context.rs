//! Inputs of a shadow structure's build: a volume under a light on a device.

use super::{DeviceTransfer, LightSpace, MapShape, March, PoolSizes, TilePace, View};
use crate::error::{Error, Result};
use crate::gpu::quirks::MAX_LIGHT_SAMPLES;
use crate::gpu::{Gpu, Group, Kernels, ShaderVariant, Slot, Span, uniform_buffer};
use crate::scene::Light;
use crate::strands::{Strands, VoxelisedStrands};
use crate::volume::Volume;

/// A volume under a light on a device.
#[derive(Clone, Copy)]
pub struct BuildContext<'a> {
    /// The device's pipelines.
    pub kernels: &'a Kernels,
    /// Number of tiles per submission while a shadow map is built.
    pub pace: &'a TilePace,
    /// Pool sizes that earlier builds on the volume needed.
    pub pool_sizes: &'a PoolSizes,
    /// The volume that casts shadows.
    pub volume: &'a Volume,
    /// Transfer function on the device.
    pub transfer: &'a DeviceTransfer,
    /// Strands that the volume was made from.
    pub strands: Option<&'a VoxelisedStrands>,
    /// The light.
    pub light: Light,
    /// The picture's view, where the shadows are for a picture.
    pub view: Option<&'a View>,
}

impl BuildContext<'_> {
    /// The device.
    pub fn gpu(&self) -> &Gpu {
        self.kernels.gpu()
    }

    /// Projection of a map, fitted to the active bricks or to the visible ones.
    pub fn light_space(&self, shape: MapShape) -> LightSpace {
        let active = &self.transfer.active;
        let mut space = LightSpace::fit(self.volume, active, self.light, shape, self.view);
        if let March::Samples { step } = shape.march {
            let shortest = space.depth_range_mm() / f64::from(MAX_LIGHT_SAMPLES);
            space.step_mm = (step * self.volume.min_spacing_mm()).max(shortest);
        }
        space
    }

    /// Strands that can be drawn into a map.
    ///
    /// # Errors
    /// The volume was not made from strands, a strand is wider than a voxel, or the transfer function changes their extinction.
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
        match self.transfer.function().leaves_extinction(largest) {
            true => Ok(&strands.strands),
            false => Err(refused("the transfer function does not take the strands' extinction as it is")
                .hint("the preset hair does")),
        }
    }

    /// Uniform of a light space, binding 0 of group 1.
    pub fn light_uniform(&self, light_space: &LightSpace) -> wgpu::Buffer {
        uniform_buffer(self.gpu(), "light space", &light_space.uniform())
    }

    /// Runs a pass that reads the field; `shadow` and `stage` are its groups 1 and 2.
    ///
    /// # Errors
    /// The device is out of memory or lost.
    pub fn run(
        &self,
        label: &str,
        variant: &ShaderVariant,
        [shadow, stage]: [&Group; 2],
        workgroups: [u32; 3],
    ) -> Result<Span> {
        let variant = self.transfer.prepared(self.gpu(), variant.clone())?;
        self.kernels.run(label, &variant, &[self.transfer.group(), shadow, stage], workgroups)
    }

    /// Runs a pass with one workgroup per entry of a list of words, in batches: binding 0 of group 2 is the batch's part of
    /// the list, the other bindings are `stage`.
    ///
    /// # Errors
    /// The device is out of memory or lost.
    pub fn run_over(
        &self,
        (list, count): (&wgpu::Buffer, u32),
        label: &'static str,
        variant: &ShaderVariant,
        shadow: &Group,
        stage: &[(u32, Slot<'_>)],
    ) -> Result<Span> {
        let granule = TilePace::granule(&self.gpu().device.limits());
        self.pace.run_batches(label, count, granule, |batch| {
            self.wait_until_idle();
            let list = (0, Slot::read(batch.binding(list)));
            let stage = self.kernels.group(label, &[&[list][..], stage].concat());
            self.run(label, variant, [shadow, &stage], batch.workgroups())
        })
    }

    /// Runs a pass once per step, each with its own group 2 and size, in batches: a step sees what earlier steps stored.
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
        let variant = self.transfer.prepared(self.gpu(), variant.clone())?;
        let groups = [self.transfer.group(), shadow];
        self.pace.run_batches(label, steps.len() as u32, 1, |batch| {
            self.wait_until_idle();
            self.kernels.run_steps(label, &variant, &groups, &steps[batch.range()])
        })
    }

    /// Waits for the queue where submissions are timed: the work of other threads must not count as this build's.
    fn wait_until_idle(&self) {
        if self.pace.is_limited() {
            // A lost device is reported by the pass itself.
            let _ = self.gpu().wait_for(self.gpu().submit([]));
        }
    }
}
