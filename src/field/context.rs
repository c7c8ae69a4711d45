//! What building a shadow structure needs: a volume under a light on a device.

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
    /// How much of a map is built in one submission.
    pub pace: &'a TilePace,
    /// What earlier builds on the volume have needed.
    pub pool_sizes: &'a PoolSizes,
    /// The volume that casts shadows.
    pub volume: &'a Volume,
    /// Its transfer function on the device.
    pub transfer: &'a DeviceTransfer,
    /// What the volume was made from, where that is strands.
    pub strands: Option<&'a VoxelisedStrands>,
    /// The light that it stands in.
    pub light: Light,
    /// What the picture shows, where the shadows are for a picture.
    pub view: Option<&'a View>,
}

impl BuildContext<'_> {
    /// The device.
    pub fn gpu(&self) -> &Gpu {
        self.kernels.gpu()
    }

    /// A map fitted to the active bricks, or to what of them is seen.
    pub fn light_space(&self, shape: MapShape) -> LightSpace {
        let active = &self.transfer.active;
        let mut space = LightSpace::fit(self.volume, active, self.light, shape, self.view);
        if let March::Samples { step } = shape.march {
            let shortest = space.depth_range_mm() / f64::from(MAX_LIGHT_SAMPLES);
            space.step_mm = (step * self.volume.min_spacing_mm()).max(shortest);
        }
        space
    }

    /// The strands that a map may be drawn from.
    ///
    /// # Errors
    /// The volume was not made from strands, a strand is wider than a voxel, or the transfer function shows them otherwise.
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

    /// Binding 0 of group 1.
    pub fn light_uniform(&self, light_space: &LightSpace) -> wgpu::Buffer {
        uniform_buffer(self.gpu(), "light space", &light_space.uniform())
    }

    /// Runs a pass that reads the field; `shadow` and `stage` are its groups 1 and 2.
    ///
    /// # Errors
    /// A device out of memory, or a lost one.
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

    /// Runs a pass with a workgroup an entry of a list of words, in submissions as long as the pace has it: the part of the
    /// list is binding 0 of group 2, beside the slots of `stage`.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_over(
        &self,
        (list, count): (&wgpu::Buffer, u32),
        label: &'static str,
        variant: &ShaderVariant,
        shadow: &Group,
        stage: &[(u32, Slot<'_>)],
    ) -> Result<Span> {
        let mut span: Option<Span> = None;
        let mut last = None;
        let mut parts = self.pace.parts(self.gpu(), label, count);
        while let Some(part) = parts.next(self.gpu(), last) {
            let list = (0, Slot::read(part.binding(list)));
            let stage = self.kernels.group(label, &[&[list][..], stage].concat());
            let took = self.run(label, variant, [shadow, &stage], part.workgroups())?;
            span = Some(span.map_or(took, |s| s.plus(took)));
            last = Some(took);
        }
        Ok(span.unwrap_or_default())
    }

    /// Runs a pass once a step, each with a group 2 and a size of its own, in submissions as long as the pace has it: each
    /// step sees what those before it have stored.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_steps(
        &self,
        label: &'static str,
        variant: &ShaderVariant,
        shadow: &Group,
        steps: &[(Group, [u32; 3])],
    ) -> Result<Span> {
        let variant = self.transfer.prepared(self.gpu(), variant.clone())?;
        let groups = [self.transfer.group(), shadow];
        let mut span: Option<Span> = None;
        let mut last = None;
        let mut parts = self.pace.single_parts(label, steps.len() as u32);
        while let Some(part) = parts.next(self.gpu(), last) {
            let took = self.kernels.run_steps(label, &variant, &groups, &steps[part.range()])?;
            span = Some(span.map_or(took, |s| s.plus(took)));
            last = Some(took);
        }
        Ok(span.unwrap_or_default())
    }
}
