//! Shadow method `lightvolume`: light volumes.
//!
//! A light volume is a coarse lattice over the volume whose nodes store the light that arrives there (Behrens and
//! Ratering 1998, *Adding Shadows to a Texture-Based Volume Renderer*). It is filtered like any other volume, and has no
//! projection of the light that could alias. Shadows are no sharper than the lattice.
//!
//! * `build=gather` marches from every node to the light, which is exact at nodes.
//! * `build=sweep` advances through slices away from the light, as the paper and half-angle slicing (Kniss et al.
//!   2003, *A Model for Volume Lighting and Modeling*) do. The light at a node is the light where its ray passes the
//!   previous slice, filtered among four nodes and attenuated between the slices. Each ray is marched once, but
//!   filtering spreads the light from slice to slice.
//!
//! Deviations from the papers, and why:
//! * Slices lie across the axis of the grid along which light mainly travels, not across the light or halfway to the
//!   eye: nodes do not move with the camera. A point light has up to six sweeps, one for each side of a cube around
//!   it.
//! * The space between two slices is marched as in every method here; the papers blend one texture slice.
//! * The lattice covers the bricks (blocks of voxels) with extinction. In empty space a query for transmittance
//!   continues to the first such brick towards the light, so that `build=gather` marches only from nodes near bricks
//!   with extinction.
//! * 8 bits are the papers'; 16-bit and 32-bit floats exist, too.

mod lattice;

use super::keys::{LOOKUP_KEY, Lookups, MARCH_KEY, MarchBy, STEP_KEY, settings};
use super::layered::Average;
use super::lookup::Lookup;
use super::method::{BuildReport, Curve, Entry, Method, ShadowMap};
use super::none::test_space;
use super::settings::{Key, Value, choices};
use super::style::{Marker, Style};
use super::tolerances::OPAQUE_DEPTH;
use crate::error::Result;
use crate::field::{BuildContext, DEPTH_SINK, March, TileList, field_shader};
use crate::gpu::{
    Constant, ShaderVariant, Slot, Span, StorageBuffer, VolumeTexture, clamp_sampler, uniform_buffer,
};
use bytemuck::{Pod, Zeroable};
use lattice::{BLOCK, Lattice};

choices! {
    /// Algorithm that builds a light volume: a march from every node, or a sweep slice by slice.
    pub enum LightBuild {
        /// Marches from every node of the light volume to the light.
        Gather = "gather",
        /// Sweeps through the light volume slice by slice, away from the light.
        Sweep = "sweep",
    }
}

settings! {
    /// Settings of a light volume.
    pub struct LightVolume {
        /// Distance between neighbouring nodes of the light volume along each axis, in voxels.
        scale: f64 = Key::number([0.5, 64.0], "2", "distance of lattice nodes, in voxels").in_label().search(&["16", "8", "6", "4", "3", "2", "1.5", "1"]),
        /// Algorithm that builds the light volume: a march from every node, or a sweep slice by slice.
        build: LightBuild = Key::choice(LightBuild::NAMES, "gather", "propagation of light: a march from every node to the light, or slice by slice").in_label().search_all(),
        /// Number of bits stored for each node of the light volume: 8, 16 or 32.
        bits: u32 = Key::choice(&["8", "16", "32"], "16", "bits of a node's value: 8 (steps), 16 or 32 (floats)").search_all(),
        /// Quantity that the light volume stores at its nodes and averages between them: optical depth or
        /// transmittance.
        average: Average = Key::choice(Average::NAMES, "transmittance", "quantity that nodes store and filters average: optical depth or transmittance").search_all(),
        /// Way in which light rays are marched: cell by cell with exact integrals, or by samples at regular
        /// distances.
        march: MarchBy = MARCH_KEY,
        /// Distance between regular samples along a light ray, in units of the smallest voxel spacing.
        step: f64 = STEP_KEY,
        /// Whether neighbouring samples of a camera ray share one transmittance query of the light volume, or each
        /// makes its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "lightvolume",
    summary: "light volume (Behrens and Ratering 1998): the light that arrives, on a lattice over the volume",
    keys: LightVolume::KEYS,
    make: |values| Some(Box::new(LightVolume::from_values(values)?)),
    compared: "lightvolume:scale=2,4,build=gather,sweep",
    curve: "lightvolume",
    stability: "lightvolume:build=gather,sweep",
    published: None,
    style: Style { color: [17, 119, 51], marker: Marker::Triad },
};

/// Size of the buffer from which packed slices of a light volume are copied into a texture, bytes; it holds at least
/// one slice.
const PACKED_BYTES: u64 = 1 << 24;
/// Alignment of rows in copies from buffers to textures, bytes.
const ROW_BYTES: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;
/// Number of threads per side of a GPU workgroup in the shaders that sweep and pack a light volume.
const SQUARE: u32 = 8;

/// Uniform buffer of a light volume's lattice; mirrors struct `Lattice` in `shaders/shadow/lightvolume/lattice.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct LatticeParams {
    first: [f32; 3],
    scale: f32,
    counts: [u32; 3],
    max_depth: f32,
}

/// Uniform buffer of the pass that packs light volume slices; mirrors struct `Layers` in
/// `shaders/shadow/lightvolume/pack.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Layers {
    first: u32,
    count: u32,
    row_words: u32,
}

/// Lattice and uniform buffers that all passes of a light volume build share.
struct LatticePasses<'a> {
    context: &'a BuildContext<'a>,
    lattice: Lattice,
    light: wgpu::Buffer,
    params: wgpu::Buffer,
}

impl LatticePasses<'_> {
    fn group(&self, slots: &[(u32, Slot<'_>)]) -> crate::gpu::Group {
        let kernels = self.context.kernels;
        let shared = [(0, kernels.uniform(&self.light)), (1, kernels.uniform(&self.params))];
        kernels.group("light volume", &[&shared, slots].concat())
    }
}

impl LightVolume {
    fn shader(&self, entry: &'static str) -> ShaderVariant {
        let shader = field_shader(entry).modules(&["shadow/lightvolume/lattice.wgsl"]);
        let shader = shader.constants(&[Constant::unsigned("BLOCK", BLOCK)]);
        let shader = shader.defs((self.average == Average::Depth).then_some("STORES_DEPTH"));
        shader.defs((self.bits == 8).then_some("BITS_8"))
    }

    fn march(&self) -> March {
        self.march.with_step(self.step)
    }

    fn gather_shader(&self) -> ShaderVariant {
        self.shader("shadow/lightvolume/gather.wgsl").with_march(self.march(), DEPTH_SINK)
    }

    fn sweep_shader(&self) -> ShaderVariant {
        self.shader("shadow/lightvolume/sweep.wgsl").with_march(self.march(), DEPTH_SINK)
    }

    fn pack_shader(&self) -> ShaderVariant {
        self.shader("shadow/lightvolume/pack.wgsl")
    }

    /// Returns the largest optical depth that the light volume stores. With 8 bits it is `8 ln 2`, which is a
    /// transmittance of 1/256.
    fn max_depth(&self) -> f32 {
        if self.bits == 8 { 8.0 * std::f32::consts::LN_2 } else { OPAQUE_DEPTH }
    }

    fn format(&self) -> wgpu::TextureFormat {
        match self.bits {
            8 => wgpu::TextureFormat::R8Unorm,
            16 => wgpu::TextureFormat::R16Float,
            _ => wgpu::TextureFormat::R32Float,
        }
    }

    /// Builds the light volume by a march to the light from every node at or next to a brick (block of voxels) with
    /// extinction. Returns its time, and the memory that it frees.
    fn gather(&self, passes: &LatticePasses<'_>, nodes: &VolumeTexture) -> Result<(Span, u64)> {
        let LatticePasses { context, lattice, .. } = passes;
        let blocks = lattice.blocks(&context.transfer.active);
        let list = StorageBuffer::from_slice(context.gpu(), "blocks of a light volume", &blocks)?;
        let group = passes.group(&[]);
        let stage = [(1, nodes.store_slot())];
        let list = TileList { entries: &list, count: blocks.len() as u32, workgroups: 1 };
        context
            .run_over(list, "light volume gather", &self.gather_shader(), &group, &stage, None)
            .map(|(span, _)| (span, size_of_val(&blocks[..]) as u64))
    }

    /// Builds the light volume by a sweep through its slices, away from the light. Returns its time, and the memory
    /// that it frees.
    fn sweep(&self, passes: &LatticePasses<'_>, nodes: &VolumeTexture) -> Result<(Span, u64)> {
        let LatticePasses { context, lattice, .. } = passes;
        let gpu = context.gpu();
        let [x, y, z] = lattice.counts.to_array();
        let sides = [[y, z], [z, x], [x, y]];
        let most = sides.iter().map(|[a, b]| u64::from(*a) * u64::from(*b)).max().unwrap_or(0);
        let slices = StorageBuffer::zeroed(gpu, "slices of a light volume", 8 * most)?;
        let steps = lattice.steps(context).into_iter().map(|step| {
            let buffer = uniform_buffer(gpu, "step of a sweep", &step);
            let stage = [
                (0, Slot::read(buffer.as_entire_binding())),
                (1, nodes.store_slot()),
                (2, Slot::read_write(slices.as_entire_binding())),
            ];
            let [a, b] = sides[step.axis as usize].map(|n| n.div_ceil(SQUARE));
            (context.kernels.group("step of a sweep", &stage), [a, b, 1])
        });
        let steps: Vec<_> = steps.collect();
        let span =
            context.run_steps("light volume sweep", &self.sweep_shader(), &passes.group(&[]), &steps)?;
        Ok((span, slices.size()))
    }

    /// Converts the light volume from 32 bits for each node to the 8 or 16 bits that transmittance queries read.
    /// Returns the time of that, and the memory that it frees.
    fn packed(
        &self,
        passes: &LatticePasses<'_>,
        nodes: VolumeTexture,
    ) -> Result<(VolumeTexture, (Span, u64))> {
        let LatticePasses { context, lattice, .. } = passes;
        if self.bits == 32 {
            return Ok((nodes, (Span::default(), 0)));
        }
        let gpu = context.gpu();
        let [width, height, depth] = lattice.counts.to_array();
        let row_bytes = (width * self.bits / 8).next_multiple_of(ROW_BYTES);
        let layer_bytes = u64::from(row_bytes) * u64::from(height);
        let at_once = (PACKED_BYTES / layer_bytes).clamp(1, u64::from(depth)) as u32;
        let words = StorageBuffer::zeroed(gpu, "packed light volume", layer_bytes * u64::from(at_once))?;
        let packed = VolumeTexture::new(gpu, "light volume", self.format(), lattice.counts.to_array())?;
        let mut total = Span { gpu_ms: Some(0.0), wall_ms: 0.0 };
        for first in (0..depth).step_by(at_once as usize) {
            let layers = Layers { first, count: at_once.min(depth - first), row_words: row_bytes / 4 };
            let buffer = uniform_buffer(gpu, "layers of a light volume", &layers);
            let stage = [
                (0, Slot::read(buffer.as_entire_binding())),
                (1, Slot::read_write(words.as_entire_binding())),
                (2, nodes.slot(false)),
            ];
            let stage = context.kernels.group("layers of a light volume", &stage);
            let groups = [layers.row_words.div_ceil(SQUARE), height.div_ceil(SQUARE), layers.count];
            let span = context.run(
                "light volume pack",
                &self.pack_shader(),
                [&passes.group(&[]), &stage],
                groups,
            )?;
            packed.copy_layers(gpu, &words, row_bytes, first..first + layers.count);
            total = total.plus(span);
        }
        let node_bytes = 4 * u64::from(width) * u64::from(height) * u64::from(depth);
        Ok((packed, (total, node_bytes + words.size())))
    }
}

impl Method for LightVolume {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn lookup(&self) -> Option<Lookup> {
        let shader = self.shader("").modules(&["shadow/lightvolume/lookup.wgsl"]);
        Some(Lookup::new(shader.defs((self.bits == 32).then_some("BITS_32"))).with_lookup_mode(self.lookup))
    }

    fn curve(&self) -> Curve {
        Curve::Stays
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        let build = match self.build {
            LightBuild::Gather => self.gather_shader(),
            LightBuild::Sweep => self.sweep_shader(),
        };
        let pack = (self.bits != 32).then(|| self.pack_shader());
        std::iter::once(build).chain(pack).collect()
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        // The pass that packs the nodes reads those of the first pass.
        let context = &context.at_once();
        let gpu = context.gpu();
        let lattice = Lattice::around(&context.transfer.active, context.volume.dims(), self.scale);
        let light_space = test_space(context, self.march());
        let params = LatticeParams {
            first: lattice.first.as_vec3().to_array(),
            scale: lattice.scale as f32,
            counts: lattice.counts.to_array(),
            max_depth: self.max_depth(),
        };
        let params = uniform_buffer(gpu, "light volume", &params);
        let passes = LatticePasses { context, lattice, light: context.light_uniform(&light_space), params };
        let format = wgpu::TextureFormat::R32Float;
        let nodes = VolumeTexture::new(gpu, "light volume", format, lattice.counts.to_array())
            .map_err(|e| e.hint("a larger scale has fewer nodes"))?;
        let (built, freed) = match self.build {
            LightBuild::Gather => self.gather(&passes, &nodes)?,
            LightBuild::Sweep => self.sweep(&passes, &nodes)?,
        };
        let (volume, (packing, freed_by_packing)) = self.packed(&passes, nodes)?;
        // Not every adapter filters 32-bit floats, and the hardware's weights have fewer bits.
        let filtered = self.bits != 32;
        let sampler = clamp_sampler(gpu, wgpu::FilterMode::Linear);
        let mut slots = vec![(3, volume.slot(filtered))];
        if filtered {
            slots.push((4, Slot::sampler(&sampler, true)));
        }
        let bytes = lattice.nodes() * u64::from(self.bits / 8);
        Ok(ShadowMap {
            method: ENTRY.name,
            group: passes.group(&slots),
            lookup: self.lookup(),
            light_space,
            report: BuildReport {
                device: Some(if self.bits == 32 { built } else { built.plus(packing) }),
                bytes,
                bytes_used: bytes,
                build_bytes: freed + freed_by_packing,
                ..Default::default()
            },
            bound: None,
            enclosure: None,
            sections: None,
            _pool: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::assert_layout;

    #[test]
    fn uniforms_have_one_layout() {
        let volume = LightVolume::default();
        assert_layout!(&volume.gather_shader(), "Lattice", LatticeParams: first, scale, counts, max_depth);
        assert_layout!(&volume.pack_shader(), "Layers", Layers: first, count, row_words);
        assert_layout!(&volume.sweep_shader(), "SweepStep", lattice::SweepStep: axis, slice, down, opening, whole);
    }
}
