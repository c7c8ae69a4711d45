//! Shadow maps with a fixed number of four-vectors in each texel, the common part of `fourier`, `wavelet`, `moments`,
//! `clusters`, `avsm` and `beer`. Each of these methods is a [`VectorMap`]: its settings, and the
//! [`VectorMapDescriptor`] that follows from them.
//!
//! They share one build (`shaders/shadow/vectors/build.wgsl`, a thread for each texel, with a module of the method
//! that receives the matter along the light ray) and one texture atlas of shadow map tiles. Every tile has a margin
//! of one texel that repeats its neighbours (324 instead of 256 texels), or of two for filters of 4 x 4 texels. So the
//! hardware's texture filter, for which `fourier` and `moments` are made, never leaves a tile. Tiles without
//! extinction take no memory, as in every shadow map here.
//!
//! A light ray ends at [`OPAQUE_DEPTH`], as in `osm`, `dom` and `bom`. A segment of the light ray is a whole stretch
//! within one cell, whose matter is assumed to be uniform; `avsm`, `wavelet` and
//! `moments:measure=light` take shorter segments.

use super::filter::{Filter, Taps};
use super::keys::{Align, Lookups};
use super::lookup::Lookup;
use super::method::{BuildReport, Curve, Entry, Method, MethodSpec, ShadowMap};
use super::settings::Value;
use super::tolerances::OPAQUE_DEPTH;
use crate::error::Result;
use crate::field::{BuildContext, MapShape, March, TILE, TileMarch, field_shader};
use crate::gpu::{
    Constant, Read, ShaderVariant, Slot, StorageBuffer, clamp_sampler, store_texture, uniform_buffer,
};
use bytemuck::{Pod, Zeroable};

/// Contents of the uniform buffer for the settings of one shadow method: eight floats.
pub type MethodParams = [f32; 8];
/// Binding index of the uniform buffer [`MethodParams`] in shader group 1.
const PARAMS_BINDING: u32 = 5;
/// File of the shader module with the depth range of a series, which sinks import.
pub(super) const RANGE: &str = "shadow/vectors/range.wgsl";
/// Number of texels per side of a texture that every graphics adapter supports.
const WIDEST_ATLAS: u32 = 8192;

/// Storage format of the four-vectors that a shadow map stores in each texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VectorStorage {
    /// Stores the components of a shadow map's four-vectors as 16-bit floats.
    Half,
    /// Stores the components of a shadow map's four-vectors as 32-bit floats.
    Single,
    /// Stores the components of a shadow map's four-vectors as 32-bit words, which the shadow method packs and
    /// unpacks.
    Words,
}

impl VectorStorage {
    /// Returns the storage format of a shadow map's four-vectors with floats of 16 or 32 bits.
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

    /// Returns the size of one four-vector stored in a shadow map, bytes.
    fn bytes(self) -> u64 {
        if self == Self::Half { 8 } else { 16 }
    }
}

/// Description of a shadow map that stores four-vectors in its texels.
pub struct VectorMapDescriptor {
    /// Number of four-vectors in each shadow map texel.
    pub vectors: u32,
    /// Storage format of the four-vectors that a shadow map stores in each texel.
    pub storage: VectorStorage,
    /// Filter of the shadow map texels around a point.
    pub filter: Filter,
    /// Whether the four texels around a point are aligned at their first depths before they are averaged.
    pub align: Align,
    /// Whether a query may average the four-vectors of neighbouring shadow map texels, as hardware texture filtering
    /// does. Otherwise, and with percentage-closer filtering, it averages their transmittances.
    pub linear: bool,
    /// Texels per side and covered region of the shadow map, and the way in which its light rays are marched.
    pub shape: MapShape,
    /// Constants of the shadow method's shader modules.
    pub constants: Vec<Constant>,
    /// Preprocessor definitions of the shadow method's shader modules.
    pub defs: Vec<&'static str>,
    /// Number of times that the shadow map build marches each light ray; `None` for once.
    pub marches: Option<u32>,
    /// File of the shader module `umbravox::sink`, which receives the matter along a light ray, interval by interval,
    /// preceded by the modules that it imports.
    pub sink: &'static [&'static str],
    /// Number of words in the state of the sink of a ray that waits for pages of the volume; `None` if rays cannot wait.
    pub sink_words: Option<u32>,
    /// Files of the shader module `umbravox::texel_curve` with the transmittance of a texel, or of the mean of texels,
    /// preceded by the modules that it imports.
    pub lookup: &'static [&'static str],
    /// Values of the shadow method's uniform buffer at [`PARAMS_BINDING`], and the file of the shader module that
    /// declares it.
    pub params: Option<(&'static str, MethodParams)>,
    /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each makes
    /// its own.
    pub lookup_mode: Lookups,
}

/// Shadow method whose map has a fixed number of four-vectors in each texel.
pub trait VectorMap: std::fmt::Debug + Send + Sync {
    /// Returns the registry entry of the shadow method.
    fn entry(&self) -> &'static Entry;
    /// Returns the values of the shadow method's settings, in the order of the entry's keys.
    fn values(&self) -> Vec<Value>;
    /// Returns the description of the shadow map that follows from the method's settings.
    fn descriptor(&self) -> VectorMapDescriptor;
    /// Returns the guarantee on the method's transmittance along a light ray: falling, within 0 and 1, or neither.
    fn curve(&self) -> Curve {
        Curve::of_map(&MethodSpec::new(VectorMap::entry(self), VectorMap::values(self)))
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

    fn taps(&self) -> Taps {
        self.descriptor().filter.taps(Taps::Within(1))
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        vec![self.descriptor().build_shader()]
    }

    fn curve(&self) -> Curve {
        VectorMap::curve(self)
    }

    fn builds_on_device(&self) -> bool {
        self.descriptor().shape.march == March::Cells
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        self.descriptor().build(context, VectorMap::entry(self))
    }
}

/// Uniform buffer of shadow maps of four-vectors; mirrors struct `VectorMap` in `shaders/shadow/vectors/layout.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct VectorParams {
    inv_size: [f32; 2],
    max_depth: f32,
    tiles_across: u32,
}

impl VectorMapDescriptor {
    fn shader(&self, entry: &'static str) -> ShaderVariant {
        let constants = [
            Constant::unsigned("VECTORS", self.vectors),
            Constant::unsigned("TILE_SHIFT", TILE.ilog2()),
            Constant::unsigned("TILE_MARGIN", self.shape.border),
        ];
        let shader = field_shader(entry).with_tile_table().modules(&["shadow/vectors/layout.wgsl"]);
        let shader = match self.params {
            Some((module, _)) => shader.modules(&[module]),
            None => shader,
        };
        let words = (self.storage == VectorStorage::Words).then_some("WORDS");
        shader.constants(&constants).constants(&self.constants).defs(self.defs.iter().copied()).defs(words)
    }

    /// Whether the hardware filters the shadow map's texture; not every adapter filters 32-bit floats.
    fn hardware_filter(&self) -> bool {
        self.linear && self.storage == VectorStorage::Half && self.filter == Filter::Bilinear
    }

    /// Whether a query averages the four-vectors of neighbouring texels.
    fn averages_vectors(&self) -> bool {
        self.linear && matches!(self.filter, Filter::Bilinear | Filter::Gauss)
    }

    /// Returns the number of texels per side of a shadow map tile with its margin.
    fn tile_side(&self) -> u32 {
        TILE + 2 * self.shape.border
    }

    /// Returns the shader of the pass that marches light rays and builds the shadow map.
    fn build_shader(&self) -> ShaderVariant {
        let shader = self.shader("shadow/vectors/build.wgsl").modules(&["field/tiles.wgsl"]);
        let shader = shader
            .defs((self.storage == VectorStorage::Half).then_some("BITS_16"))
            .defs(self.marches.map(|_| "MARCHES"));
        let marches = Constant::unsigned("MARCHES", self.marches.unwrap_or(1));
        let [modules @ .., sink] = self.sink else { return shader };
        let shader = shader.constants(&[marches]).modules(modules).with_march(self.shape.march, sink);
        match self.sink_words.filter(|_| self.shape.march == March::Cells) {
            // The number of the march comes first.
            Some(words) => shader.with_ray_states(1 + words),
            None => shader,
        }
    }

    fn lookup(&self) -> Lookup {
        let shader = self.shader("").with_filter(self.filter, 1, self.align);
        let shader = shader.modules(&["shadow/vectors/read.wgsl"]).modules(self.lookup);
        let shader = shader.modules(&["shadow/vectors/filter.wgsl"]);
        let shader = shader.defs(self.averages_vectors().then_some("AVERAGE_VECTORS"));
        let shader = shader.defs(self.hardware_filter().then_some("HARDWARE_FILTER"));
        Lookup::new(shader).with_near(self.shape.near).with_lookup_mode(self.lookup_mode)
    }

    /// Returns the size of the four-vectors of one shadow map texel, bytes.
    fn texel_bytes(&self) -> u64 {
        u64::from(self.vectors) * self.storage.bytes()
    }

    /// Returns the number of shadow map tiles side by side in the texture atlas, and the width and height of the
    /// atlas in texels. The atlas has as few rows as every adapter's textures allow, so that little of the last row
    /// stays empty. It is nearly square if textures are not high enough.
    fn atlas(&self, tiles: u32) -> (u32, [u32; 2]) {
        let tiles = tiles.max(1);
        let side = self.tile_side();
        let most = WIDEST_ATLAS / side;
        let wide = tiles.div_ceil(most);
        let square = (f64::from(tiles) / f64::from(self.vectors)).sqrt().ceil() as u32;
        let rows = if wide * self.vectors <= most { wide } else { square };
        let across = tiles.div_ceil(rows);
        (across, [across * side, rows * self.vectors * side])
    }

    /// Builds a shadow map of four-vectors.
    ///
    /// # Errors
    /// A shadow map that is too large for the graphics adapter.
    fn build(&self, context: &BuildContext<'_>, entry: &Entry) -> Result<ShadowMap> {
        let gpu = context.gpu();
        let tiles = TileMarch::fit(context, self.shape)?;
        let (tiles_across, size) = self.atlas(tiles.built);
        let atlas = store_texture(gpu, "shadow map of vectors", self.storage.format(), size)?;
        // The texture may be larger than requested: its sides are rounded up.
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
        let read = Read { buffer: &hit, words: 1 };
        let (span, words) =
            tiles.run("map of vectors build", &self.build_shader(), &slots, &stage, Some(read))?;

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
        let tile_bytes = u64::from(self.tile_side().pow(2)) * self.texel_bytes();
        let texels_stored = u64::from(size[0] * size[1] / self.vectors);
        let report = BuildReport {
            device: Some(span),
            bytes: texels_stored * self.texel_bytes() + tiles.table_bytes(),
            bytes_used: u64::from(tiles.built) * tile_bytes + tiles.table_bytes(),
            texels_hit: Some(words.and_then(|words| words.first().copied()).unwrap_or(0).into()),
            tiles: tiles.tiles,
            tiles_left_out: left_out,
            bytes_left_out: u64::from(left_out) * tile_bytes,
            ..Default::default()
        };
        Ok(ShadowMap {
            method: entry.name,
            group: tiles.group("map of vectors", &slots),
            lookup: Some(self.lookup()),
            light_space: tiles.light_space,
            report,
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
    use crate::shadow::keys::Fit;

    #[test]
    fn uniforms_match_their_shaders() {
        let map = VectorMapDescriptor {
            vectors: 2,
            storage: VectorStorage::Half,
            filter: Filter::Bilinear,
            align: Align::Off,
            linear: true,
            shape: Fit::Volume.shape(Some(64), Filter::Bilinear, March::Cells, 0.0),
            constants: vec![Constant::unsigned("TERMS", 3)],
            defs: Vec::new(),
            marches: None,
            sink: &[RANGE, "shadow/fourier/sink.wgsl"],
            sink_words: None,
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
