//! Layered shadow maps, the common part of the methods `osm`, `dom` and `bom`.
//!
//! All three store the optical depth at planes across the light ray of each texel, and interpolate linearly between
//! them. They differ in the positions of the planes. They share one build (`shaders/shadow/layered/build.wgsl`, a
//! thread for each texel, which cuts the segments of the light ray at the planes), one memory layout of texels
//! ([`record::Record`]) and the divisions of a depth range into layers ([`split::Split`]). `dom` and `bom` also share
//! the choice of a division ([`layering::Layering`]).
//!
//! The papers accumulate opacities of primitives, `Ω`, and take `exp(-κ Ω)`; here `Ω` is the optical depth along the
//! light ray. Filters average `Ω`, as theirs do. The layers of a texel lie side by side, since a query for
//! transmittance reads two neighbouring ones. Tiles of the map without extinction are not stored.
//!
//! Stored optical depth saturates at [`OPAQUE_DEPTH`], or at `κ` in 8 bits, which keeps means of `Ω` steady. If the
//! optical depths of neighbouring texels differ by `D`, rounded texel coordinates (1e-6 to 1e-5 of a texel) move the
//! mean by up to `1e-5 D`, and transmittance along a ray may rise by as much. [`Average`] selects the quantity that
//! filters average: the darkest texel dominates the mean of optical depths, which widens the shadow of an opaque
//! edge.

mod layering;
mod ratio;
mod record;
mod split;

pub use layering::LayerSplit;
pub(super) use layering::{LOG_SIZE_KEY, Layering, MEASURE_KEY, RATIO_KEY, split_key};
pub use ratio::Measure;
pub(super) use record::Record;
pub(super) use split::{SPLIT_BINS, Split, SplitTable};

use super::filter::Filter;
use super::keys::Align;
use super::lookup::Lookup;
use super::method::{BuildReport, Method, PassLeftOut, ShadowMap};
use super::settings::{Key, When, choices};
use super::tolerances::{OPAQUE_DEPTH, longest_depth};
use crate::error::Result;
use crate::field::{
    BuildContext, LightSpace, MapShape, March, Optimization, TILE_TEXELS, TileMarch, field_shader,
};
use crate::gpu::{
    Constant, Group, Read, ShaderVariant, Slot, Span, StorageBuffer, store_texture, table_texture,
    uniform_buffer,
};
use bytemuck::{Pod, Zeroable};
use record::RECORD_TEXTURE_WIDTH;

/// Depth pass of the `dom` and `bom` papers, which is skipped: the march of a light ray finds the start of matter by
/// itself.
const NO_DEPTH_PASS: PassLeftOut = PassLeftOut {
    what: "depth pass",
    why: "the march meets the start before the layers",
    optional: Some(Optimization::DepthPass),
};

/// Smallest and largest number of layers that a layered shadow map (`osm`, `dom` or `bom`) may have.
pub(super) const LAYERS: [u32; 2] = [1, 512];
pub(super) const BITS_KEY: Key = Key::choice(
    &["8", "16", "32"],
    "8",
    "bits of a stored optical depth: 8 (share of kappa), 16 or 32 (floats)",
)
.search_all();
pub(super) const DEPTH_BITS_KEY: Key = Key::choice(
    &["8", "16", "32"],
    "16",
    "bits of a texel's stored depths: 8 or 16 (steps of the map's range), 32 (float)",
)
.search_all();

choices! {
    /// Quantity that filters average among neighbouring texels of a layered shadow map.
    pub enum Average {
        /// Averages the optical depths of neighbouring shadow map texels, as the papers of the methods do.
        Depth = "depth",
        /// Averages the transmittances of neighbouring shadow map texels, as deep shadow maps do.
        Transmittance = "transmittance",
    }
}

pub(super) const AVERAGE_KEY: Key = Key::choice(
    Average::NAMES,
    "transmittance",
    "quantity that filters average: optical depth (as in the papers), or transmittance",
)
.search_all()
.when(When::Unless("filter", "pcf"));

const CONSTANTS: &[Constant] = &[
    Constant::unsigned("RECORD_TEXTURE_WIDTH", RECORD_TEXTURE_WIDTH),
    Constant::unsigned("MOST_LAYERS", LAYERS[1]),
    Constant::unsigned("SPLIT_BINS", SPLIT_BINS as u32),
];
const READ: &str = "shadow/layered/read.wgsl";

/// Description of a layered shadow map (`osm`, `dom` or `bom`): texel layout, planes, filter and size.
pub(super) struct LayeredMap {
    pub record: Record,
    pub split: Split,
    /// Total thickness of a texel's layers, as a share of the shadow map's depth range, unless the texel stores the
    /// depth at which its matter ends.
    pub reach: f64,
    /// Whether the last layer of the shadow map also contains all matter behind it.
    pub last_takes_rest: bool,
    pub filter: Filter,
    /// Quantity that a transmittance query averages among shadow map texels: optical depth or transmittance.
    pub average: Average,
    /// Width, in texels, of the square of shadow map texels over which a transmittance query averages.
    pub kernel: u32,
    /// Texels per side and covered region of the shadow map, and the way in which its light rays are marched.
    pub shape: MapShape,
}

/// Costs of the search for a division of depth into layers, which precedes the build.
#[derive(Debug, Clone, Copy)]
pub(super) struct SplitSearch {
    /// GPU time of its passes.
    pub device: Span,
    /// Memory of its buffers and textures, bytes.
    pub bytes: u64,
}

/// Uniform buffer of the layered shadow map shaders; mirrors struct `Params` in `shaders/shadow/layered/layout.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct LayeredParams {
    layers: u32,
    first_slot: u32,
    record_blocks: u32,
    block_mask: u32,
    block_slot_shift: u32,
    header_bits: u32,
    planes_passed: u32,
    split_exponent: f32,
    reach_mm: f32,
    depth_steps_per_mm: f32,
    kappa: f32,
    longest_depth: f32,
    max_depth: f32,
}

/// Number of words in the state of a ray that waits for pages of the volume: number of the march, and sink.
const STATE_WORDS: u32 = 1 + 13;

/// Layered shadow map after its build, without the shader code that queries it.
pub(super) struct Built<'a> {
    pub tiles: TileMarch<'a>,
    pub report: BuildReport,
    params: wgpu::Buffer,
    splits: Option<wgpu::TextureView>,
    records: wgpu::TextureView,
}

/// Returns the shader with the given entry file, together with the code for the memory layout of layered shadow maps.
pub(super) fn shader(entry: &'static str) -> ShaderVariant {
    field_shader(entry).with_tile_table().modules(&["shadow/layered/layout.wgsl"]).constants(CONSTANTS)
}

/// Returns the shader of the depth pass in the papers of `dom` and `bom`. It runs only on request, since nothing
/// reads its result.
fn depth_pass_shader(march: March) -> ShaderVariant {
    let start = shader("shadow/layered/start.wgsl").modules(&["field/tiles.wgsl"]);
    start.with_march(march, "shadow/layered/start_sink.wgsl")
}

impl LayeredMap {
    /// Returns the shader with the given entry file, together with the code that reads the texels of a layered shadow
    /// map.
    pub fn read_shader(&self, entry: &'static str) -> ShaderVariant {
        shader(entry).modules(&[READ]).defs(self.record.read_defs()).defs(self.split.def())
    }

    /// Returns the shader code of a layered shadow map's transmittance query, which the last of the given shader
    /// modules implements.
    pub fn lookup(&self, modules: &[&'static str], align: Align) -> Lookup {
        let averages_transmittance = self.average == Average::Transmittance || self.filter == Filter::Pcf;
        let shader = self
            .read_shader("")
            .with_filter(self.filter, self.kernel, align)
            .modules(modules)
            .defs(averages_transmittance.then_some("AVERAGE_TRANSMITTANCE"));
        Lookup::new(shader).with_near(self.shape.near)
    }

    /// Returns the shader of the pass that marches light rays and builds a layered shadow map.
    pub fn build_shader(&self) -> ShaderVariant {
        let shader = shader("shadow/layered/build.wgsl").modules(&["field/tiles.wgsl"]);
        let shader = shader.defs(self.record.write_defs()).defs(self.split.def());
        let shader = shader.with_march(self.shape.march, "shadow/layered/sink.wgsl");
        if self.shape.march == March::Cells { shader.with_ray_states(STATE_WORDS) } else { shader }
    }

    /// Returns the contents of the uniform buffer of a layered shadow map.
    pub fn params(&self, light_space: &LightSpace) -> LayeredParams {
        let record = self.record;
        let range_mm = light_space.depth_range_mm();
        // The largest optical depth in d bits: exp(-kappa) = 2^-d.
        let kappa = record.bits as f32 * std::f32::consts::LN_2;
        LayeredParams {
            layers: record.layers,
            first_slot: record.first_slot(),
            record_blocks: record.blocks(),
            block_mask: record.block_words() - 1,
            block_slot_shift: (32 / record.bits * record.block_words()).ilog2(),
            header_bits: record.depth_bits,
            planes_passed: record.layers - u32::from(self.last_takes_rest),
            split_exponent: if let Split::Power(exponent) = self.split { exponent as f32 } else { 1.0 },
            reach_mm: (self.reach * range_mm).max(1e-9) as f32,
            depth_steps_per_mm: (record.depth_steps() / f64::from(range_mm as f32)) as f32,
            kappa,
            longest_depth: longest_depth(),
            max_depth: if record.bits == 8 { kappa } else { OPAQUE_DEPTH },
        }
    }

    /// Returns the size and contents of the texture that holds tabulated divisions of depth into layers, two rows
    /// each; `None` if a formula gives the division.
    fn split_rows(&self) -> Option<([u32; 2], Vec<f32>)> {
        let Split::Tables(splits) = &self.split else { return None };
        let width = (SPLIT_BINS + 1).max(self.record.layers as usize + 1);
        let mut values = Vec::new();
        for row in splits.iter().flat_map(|s| s.rows(self.record.layers)) {
            values.extend(row);
            values.resize(values.len().next_multiple_of(width), 0.0);
        }
        Some(([width as u32, 2 * splits.len() as u32], values))
    }

    /// Builds a layered shadow map. The buffer `stage` receives the number of texels whose light ray meets matter,
    /// and holds the layer divisions of regions of the map. `stage` is `None` if all texels share one division.
    ///
    /// # Errors
    /// A shadow map that is too large for the graphics adapter.
    pub fn build<'a>(
        &self,
        context: &BuildContext<'a>,
        tiles: TileMarch<'a>,
        stage: Option<&wgpu::Buffer>,
    ) -> Result<Built<'a>> {
        let gpu = context.gpu();
        let rows = self.split_rows();
        let format = wgpu::TextureFormat::R32Float;
        let splits =
            rows.as_ref().map(|(size, rows)| table_texture(gpu, "splits of layers", format, *size, rows));
        let splits = splits.transpose()?;
        let params = uniform_buffer(gpu, "layered map", &self.params(&tiles.light_space));
        let count = u64::from(tiles.records());
        let size = self.record.texture_size(count);
        let records = store_texture(gpu, "layered shadow map", self.record.format(), size)?;
        let no_stage = StorageBuffer::zeroed(gpu, "layered map stage", 16)?;
        let stage = stage.unwrap_or(&no_stage);

        let mut built = Built { tiles, report: BuildReport::default(), params, splits, records };
        let store = (1, Slot::store(&built.records, self.record.format()));
        let counted = (2, Slot::read_write(stage.as_entire_binding()));
        let slots = built.slots(context);
        let map_slots = &slots[1..];
        let (label, shader) = ("layered map build", self.build_shader());
        let read = Read { buffer: stage, words: 1 };
        let (mut device, words) =
            built.tiles.run(label, &shader, map_slots, &[store, counted], Some(read))?;
        let with_depth_pass =
            self.record.depths > 0 && context.transfer.disabled.has(Optimization::DepthPass);
        if with_depth_pass {
            let starts = StorageBuffer::zeroed(gpu, "starts", 4 * count)?;
            let stage = [(1, Slot::read_write(starts.as_entire_binding()))];
            let shader = depth_pass_shader(self.shape.march);
            device = device.plus(built.tiles.run("depth pass", &shader, map_slots, &stage, None)?.0);
        }
        let left_out = built.tiles.tiles - built.tiles.built;
        let split_bytes = rows.map_or(0, |(_, values)| size_of_val(&values[..]) as u64);
        let other_bytes = built.tiles.table_bytes() + split_bytes;
        let left_out_passes: &[_] =
            if self.record.depths > 0 && !with_depth_pass { &[NO_DEPTH_PASS] } else { &[] };
        built.report = BuildReport {
            device: Some(device),
            // The storage texture is allocated in whole lines.
            bytes: self.record.texture_bytes(count) + other_bytes,
            bytes_used: count * self.record.bytes() + other_bytes,
            texels_hit: Some(words.and_then(|words| words.first().copied()).unwrap_or(0).into()),
            tiles: built.tiles.tiles,
            tiles_left_out: left_out,
            bytes_left_out: u64::from(left_out * TILE_TEXELS) * self.record.bytes(),
            passes_left_out: left_out_passes,
            ..Default::default()
        };
        Ok(built)
    }
}

impl Built<'_> {
    /// Returns the resources that shaders bind in group 1. The first is the texture of stored shadow map texels,
    /// which a build does not read.
    fn slots(&self, context: &BuildContext<'_>) -> Vec<(u32, Slot<'_>)> {
        let mut slots = vec![(3, Slot::words(&self.records)), (1, context.kernels.uniform(&self.params))];
        slots.extend(self.splits.as_ref().map(|splits| (4, Slot::floats(splits))));
        slots
    }

    /// Returns bind group 1 of passes and transmittance queries that read the layered shadow map.
    pub fn group(&self, context: &BuildContext<'_>) -> Group {
        self.tiles.group("layered map", &self.slots(context))
    }

    /// Adds what the search for a division of depth took to the report on the build of the layered shadow map.
    pub fn after(&mut self, search: Option<SplitSearch>) {
        let Some(search) = search else { return };
        self.report.device = self.report.device.map(|build| search.device.plus(build));
        self.report.build_bytes = search.bytes;
    }

    /// Turns the built layered shadow map into the finished shadow map of a method, with the method's name and
    /// transmittance query.
    pub fn into_map(self, context: &BuildContext<'_>, method: &dyn Method) -> ShadowMap {
        ShadowMap {
            method: method.name(),
            group: self.group(context),
            lookup: method.lookup(),
            light_space: self.tiles.light_space,
            report: self.report,
            bound: None,
            enclosure: None,
            sections: None,
            _pool: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::assert_layout;
    use crate::shadow::keys::Fit;

    #[test]
    fn uniforms_match_their_shaders() {
        let layered_map = LayeredMap {
            record: Record { layers: 3, bits: 16, depths: 1, depth_bits: 16, own_split: false },
            split: Split::Growing,
            reach: 1.0,
            last_takes_rest: true,
            filter: Filter::Nearest,
            average: Average::Depth,
            kernel: 1,
            shape: Fit::Volume.shape(Some(64), Filter::Nearest, March::Cells, 0.0),
        };
        assert_layout!(&layered_map.build_shader(), "Params", LayeredParams: layers, first_slot, record_blocks, block_mask,
            block_slot_shift, header_bits, planes_passed, split_exponent, reach_mm, depth_steps_per_mm, kappa,
            longest_depth, max_depth);
    }
}
