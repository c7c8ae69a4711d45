//! Maps with a fixed number of four-vectors for each texel, which `fourier`, `moments`, `clusters` and `avsm` share. Each of them
//! is a [`VectorMap`]: its settings, and the [`VectorMapDescriptor`] that follows from them.
//!
//! They share one build (`shaders/shadow/vectors/build.wgsl`, a thread for each texel, with a sink of the method) and one atlas
//! of tiles. Every tile has a margin of one texel that repeats its neighbours (324 instead of 256 texels), so that the
//! hardware's filter, for which `fourier` and `moments` are made, never leaves a tile. Tiles without active bricks take no
//! memory, as in every map here.
//!
//! A ray ends at [`OPAQUE_DEPTH`], as in `osm`, `dom` and `bom`. Pieces of the march are whole stretches of a cell, whose
//! matter is taken to be spread evenly; `avsm` takes shorter pieces.

use super::keys::{Filter, Lookups};
use super::method::{BuildReport, Curve, Entry, Lookup, Method, ShadowMap};
use super::settings::Value;
use super::tolerances::OPAQUE_DEPTH;
use crate::error::Result;
use crate::field::{BuildContext, MapShape, TILE, TileMarch, field_shader};
use crate::gpu::{
    Constant, ShaderVariant, Slot, StorageBuffer, clamp_sampler, read_back, store_texture, uniform_buffer,
};
use bytemuck::{Pod, Zeroable};

/// Uniform of one method.
pub type MethodParams = [f32; 8];
/// Binding of [`MethodParams`] in group 1.
const PARAMS_BINDING: u32 = 5;
/// Texels a side of a tile with its margin.
const TILE_SIDE: u32 = TILE + 2;
/// Tiles across the textures of every adapter.
const TILES_ACROSS: u32 = 8192 / TILE_SIDE;

/// The lookup of methods whose vectors cannot be averaged: it averages the transmittances of `umbravox::texel_curve`.
pub(super) const TRANSMITTANCE_FILTER: &str = "shadow/vectors/filter.wgsl";

/// Storage of a vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VectorStorage {
    /// 16-bit floats.
    Half,
    /// 32-bit floats.
    Single,
    /// 32-bit words, packed and unpacked by the method.
    Words,
}

impl VectorStorage {
    /// Floats of 16 or 32 bits.
    pub fn floats(bits: u32) -> Self {
        if bits == 16 { Self::Half } else { Self::Single }
    }

    fn format(self) -> wgpu::TextureFormat {
        match self {
            Self::Half => wgpu::TextureFormat::Rgba16Float,
            Self::Single => wgpu::TextureFormat::Rgba32Float,
            Self::Words => wgpu::TextureFormat::Rgba32Uint,
        }
    }

    /// Bytes of a vector.
    fn bytes(self) -> u64 {
        if self == Self::Half { 8 } else { 16 }
    }
}

/// Description of a map of vectors.
pub struct VectorMapDescriptor {
    /// Four-vectors of a texel.
    pub vectors: u32,
    /// Storage of a vector.
    pub storage: VectorStorage,
    /// Filter among the texels around a point.
    pub filter: Filter,
    /// Vectors may be averaged, as the hardware's filter does.
    pub linear: bool,
    /// Size and fit of the map, and march of its light rays.
    pub shape: MapShape,
    /// Constants of the modules of the method.
    pub constants: Vec<Constant>,
    /// Definitions of the modules of the method.
    pub defs: Vec<&'static str>,
    /// Marches for each ray, if the sink needs more than one.
    pub marches: Option<u32>,
    /// File of the module `umbravox::sink`.
    pub sink: &'static str,
    /// File of the module `umbravox::method`, behind those that it imports.
    pub lookup: &'static [&'static str],
    /// Uniform of the method at [`PARAMS_BINDING`], and the file of the module that declares it.
    pub params: Option<(&'static str, MethodParams)>,
    /// Lookups of light by eye samples.
    pub lookup_mode: Lookups,
}

/// A method whose map has a fixed number of vectors for each texel.
pub trait VectorMap: std::fmt::Debug + Send + Sync {
    /// Entry of the registry.
    fn entry(&self) -> &'static Entry;
    /// Values of the keys.
    fn values(&self) -> Vec<Value>;
    /// Map that follows from the settings.
    fn descriptor(&self) -> VectorMapDescriptor;
    /// Course of the transmittance along a light ray.
    fn curve(&self) -> Curve {
        Curve::Falls
    }
}

impl<M: VectorMap> Method for M {
    fn entry(&self) -> &'static Entry {
        VectorMap::entry(self)
    }

    fn values(&self) -> Vec<Value> {
        VectorMap::values(self)
    }

    fn lookup(&self) -> Option<Lookup> {
        Some(self.descriptor().lookup())
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        vec![self.descriptor().build_shader()]
    }

    fn curve(&self) -> Curve {
        VectorMap::curve(self)
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        self.descriptor().build(context, VectorMap::entry(self))
    }
}

/// `VectorMap` of `shaders/shadow/vectors/layout.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct VectorParams {
    inv_size: [f32; 2],
    max_depth: f32,
    tiles_across: u32,
}

impl VectorMapDescriptor {
    fn shader(&self, entry: &'static str) -> ShaderVariant {
        let constants =
            [Constant::unsigned("VECTORS", self.vectors), Constant::unsigned("TILE_SHIFT", TILE.ilog2())];
        let shader = field_shader(entry).with_tile_table().modules(&["shadow/vectors/layout.wgsl"]);
        let shader = match self.params {
            Some((module, _)) => shader.modules(&[module]),
            None => shader,
        };
        let words = (self.storage == VectorStorage::Words).then_some("WORDS");
        shader.constants(&constants).constants(&self.constants).defs(self.defs.iter().copied()).defs(words)
    }

    /// Whether the hardware filters: not every adapter filters 32-bit floats.
    fn hardware_filter(&self) -> bool {
        self.linear && self.storage == VectorStorage::Half && self.filter == Filter::Bilinear
    }

    /// Shader of the pass that marches.
    fn build_shader(&self) -> ShaderVariant {
        let shader = self.shader("shadow/vectors/build.wgsl").modules(&["field/tiles.wgsl"]);
        let shader = shader
            .defs((self.storage == VectorStorage::Half).then_some("BITS_16"))
            .defs(self.marches.map(|_| "MARCHES"));
        let marches = Constant::unsigned("MARCHES", self.marches.unwrap_or(1));
        shader.constants(&[marches]).with_march(self.shape.march, self.sink)
    }

    fn lookup(&self) -> Lookup {
        let shader = self.shader("").modules(&["shadow/vectors/read.wgsl"]).modules(self.lookup);
        let bilinear = (self.filter == Filter::Bilinear).then_some("FILTER_BILINEAR");
        let shader = shader.defs(bilinear).defs(self.hardware_filter().then_some("HARDWARE_FILTER"));
        Lookup::new(shader).with_lookup_mode(self.lookup_mode)
    }

    /// Bytes of the vectors of a texel.
    fn texel_bytes(&self) -> u64 {
        u64::from(self.vectors) * self.storage.bytes()
    }

    /// Returns the tiles across the atlas, and its sides in texels: as few rows as textures of every adapter allow, so that little
    /// of the last row stays empty; nearly square if textures are not high enough.
    fn atlas(&self, tiles: u32) -> (u32, [u32; 2]) {
        let tiles = tiles.max(1);
        let wide = tiles.div_ceil(TILES_ACROSS);
        let square = (f64::from(tiles) / f64::from(self.vectors)).sqrt().ceil() as u32;
        let rows = if wide * self.vectors <= TILES_ACROSS { wide } else { square };
        let across = tiles.div_ceil(rows);
        (across, [across * TILE_SIDE, rows * self.vectors * TILE_SIDE])
    }

    /// Builds the map.
    ///
    /// # Errors
    /// A map that the adapter cannot hold.
    fn build(&self, context: &BuildContext<'_>, entry: &Entry) -> Result<ShadowMap> {
        let gpu = context.gpu();
        let tiles = TileMarch::fit(context, self.shape)?;
        let (tiles_across, size) = self.atlas(tiles.built);
        let atlas = store_texture(gpu, "shadow map of vectors", self.storage.format(), size)?;
        // The sides of the texture are rounded up.
        let texels = atlas.texture().size();
        let map_params = VectorParams {
            inv_size: [1.0 / texels.width as f32, 1.0 / texels.height as f32],
            max_depth: OPAQUE_DEPTH,
            tiles_across,
        };
        let map_params = uniform_buffer(gpu, "map of vectors", &map_params);
        let params = self.params.map(|(_, params)| uniform_buffer(gpu, "parameters of the method", &params));
        let hit = StorageBuffer::zeroed(gpu, "texels hit", 4)?;
        let mut slots = vec![(1, context.kernels.uniform(&map_params))];
        slots.extend(params.as_ref().map(|params| (PARAMS_BINDING, context.kernels.uniform(params))));
        let stage =
            [(1, Slot::store(&atlas, self.storage.format())), (2, Slot::read_write(hit.as_entire_binding()))];
        let span = tiles.run("map of vectors build", &self.build_shader(), &slots, &stage)?;

        let sampler = clamp_sampler(gpu, wgpu::FilterMode::Linear);
        let filtered = self.hardware_filter();
        let sample_type = match self.storage {
            VectorStorage::Words => wgpu::TextureSampleType::Uint,
            VectorStorage::Half | VectorStorage::Single => {
                wgpu::TextureSampleType::Float { filterable: filtered }
            }
        };
        slots.push((3, Slot::texture(&atlas, sample_type, wgpu::TextureViewDimension::D2)));
        if filtered {
            slots.push((4, Slot::sampler(&sampler, true)));
        }
        let left_out = tiles.tiles - tiles.built;
        let texels_stored = u64::from(size[0] * size[1] / self.vectors);
        let report = BuildReport {
            device: Some(span),
            bytes: texels_stored * self.texel_bytes() + tiles.table_bytes(),
            bytes_used: u64::from(tiles.built * TILE_SIDE * TILE_SIDE) * self.texel_bytes()
                + tiles.table_bytes(),
            texels_hit: Some(u64::from(read_back::<u32>(gpu, &hit, 1)?[0])),
            tiles: tiles.tiles,
            tiles_left_out: left_out,
            bytes_left_out: u64::from(left_out * TILE_SIDE * TILE_SIDE) * self.texel_bytes(),
            ..Default::default()
        };
        Ok(ShadowMap {
            method: entry.name,
            group: tiles.group("map of vectors", &slots),
            lookup: Some(self.lookup()),
            light_space: tiles.light_space,
            report,
            bound: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::March;
    use crate::gpu::assert_layout;
    use crate::shadow::keys::Fit;

    #[test]
    fn uniforms_match_their_shaders() {
        let map = VectorMapDescriptor {
            vectors: 2,
            storage: VectorStorage::Half,
            filter: Filter::Bilinear,
            linear: true,
            shape: Fit::Volume.shape(Some(64), March::Cells),
            constants: vec![Constant::unsigned("TERMS", 3)],
            defs: Vec::new(),
            marches: None,
            sink: "shadow/fourier/sink.wgsl",
            lookup: &["shadow/fourier/series.wgsl", "shadow/fourier/lookup.wgsl"],
            params: None,
            lookup_mode: Lookups::Shared,
        };
        assert_layout!(&map.build_shader(), "VectorMap", VectorParams: inv_size, max_depth, tiles_across);
        assert_eq!(map.atlas(0), (1, [18, 36]));
        assert_eq!(map.atlas(200), (200, [200 * 18, 2 * 18]));
        assert_eq!(map.atlas(456), (228, [228 * 18, 2 * 2 * 18]));
        let (across, sides) = map.atlas(300_000);
        assert!(sides.iter().all(|side| *side < 16_384) && across * (sides[1] / 36) >= 300_000);
        assert_eq!(map.texel_bytes(), 16);
        assert!(
            map.hardware_filter()
                && !VectorMapDescriptor { storage: VectorStorage::Single, ..map }.hardware_filter()
        );
    }
}
