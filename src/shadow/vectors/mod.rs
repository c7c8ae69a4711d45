//! Maps that keep a fixed number of four-vectors a texel: what `fourier`, `moments`, `clusters` and `avsm` share. Each of
//! them is a [`VectorMap`]: its settings, and the [`Recipe`] that they come to.
//!
//! They share one build (`shaders/shadow/vectors/build.wgsl`, a thread a texel, whose sink is the method's own) and one
//! atlas of tiles. Every tile has a margin of one texel that repeats what its neighbours hold (324 instead of 256 texels),
//! so that the hardware's filter, which `fourier` and `moments` are made for, never leaves a tile; tiles without active
//! bricks take no memory, as in every map here.
//!
//! A ray is over at [`OPAQUE_DEPTH`], as in `osm`, `dom` and `bom`: what lies behind is not gathered. But for `avsm`, pieces
//! of the march are whole stretches of a cell, whose matter is taken to be spread evenly.

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

/// Texels a side of a tile with its margin.
const TILE_SIDE: u32 = TILE + 2;
/// Tiles across the textures of every adapter.
const TILES_ACROSS: u32 = 8192 / TILE_SIDE;

/// The module `umbravox::method` of methods whose vectors cannot be averaged: it averages the transmittances of
/// `umbravox::texel_curve`.
pub(super) const TEXELS_FILTER: &str = "shadow/vectors/filter.wgsl";

/// Of what vectors are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Numbers {
    /// 16-bit floats.
    Half,
    /// 32-bit floats.
    Single,
    /// 32-bit words that the method packs and unpacks itself.
    Words,
}

impl Numbers {
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

/// What one map of vectors is to be.
pub struct Recipe {
    /// Four-vectors a texel.
    pub vectors: u32,
    /// What a vector is of.
    pub numbers_are: Numbers,
    /// How texels around a point are used.
    pub filter: Filter,
    /// Whether a filter may take the vectors' means, as the hardware does.
    pub linear: bool,
    /// The map's, and how its light rays are marched.
    pub shape: MapShape,
    /// Constants of the method's modules.
    pub constants: Vec<Constant>,
    /// Definitions of the method's modules.
    pub defs: Vec<&'static str>,
    /// Marches a ray, where one does not do.
    pub turns: Option<u32>,
    /// The module `umbravox::sink`.
    pub sink: &'static str,
    /// The module `umbravox::method`, and those that it imports.
    pub lookup: &'static [&'static str],
    /// The method's own numbers: `own.a` and `own.b`.
    pub numbers: [[f32; 4]; 2],
    /// How eye samples ask for light.
    pub asked_by: Lookups,
}

/// What one such method has that others have not.
pub trait VectorMap: std::fmt::Debug + Send + Sync {
    /// As of [`Method::entry`].
    fn line(&self) -> &'static Entry;
    /// As of [`Method::values`].
    fn settings(&self) -> Vec<Value>;
    /// What its map is to be.
    fn recipe(&self) -> Recipe;
    /// As of [`Method::curve`].
    fn shape_of_curve(&self) -> Curve {
        Curve::Falls
    }
}

impl<M: VectorMap> Method for M {
    fn entry(&self) -> &'static Entry {
        self.line()
    }

    fn values(&self) -> Vec<Value> {
        self.settings()
    }

    fn lookup(&self) -> Option<Lookup> {
        Some(self.recipe().lookup())
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        vec![self.recipe().build_shader()]
    }

    fn curve(&self) -> Curve {
        self.shape_of_curve()
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        self.recipe().build(context, self.entry())
    }
}

/// `Own` of `shaders/shadow/vectors/layout.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Own {
    a: [f32; 4],
    b: [f32; 4],
    inv_size: [f32; 2],
    most_depth: f32,
    tiles_across: u32,
}

impl Recipe {
    fn shader(&self, entry: &'static str) -> ShaderVariant {
        let constants =
            [Constant::unsigned("VECTORS", self.vectors), Constant::unsigned("TILE_SHIFT", TILE.ilog2())];
        let shader = field_shader(entry).with_tile_table().modules(&["shadow/vectors/layout.wgsl"]);
        let words = (self.numbers_are == Numbers::Words).then_some("WORDS");
        shader.constants(&constants).constants(&self.constants).defs(self.defs.iter().copied()).defs(words)
    }

    /// The hardware filters what is linear and 16 bits wide; not every adapter filters 32.
    fn hardware_filter(&self) -> bool {
        self.linear && self.numbers_are == Numbers::Half && self.filter == Filter::Bilinear
    }

    /// The pass that marches.
    fn build_shader(&self) -> ShaderVariant {
        let shader = self.shader("shadow/vectors/build.wgsl").modules(&["field/tiles.wgsl"]);
        let shader = shader
            .defs((self.numbers_are == Numbers::Half).then_some("BITS_16"))
            .defs(self.turns.map(|_| "TURNS"));
        let turns = Constant::unsigned("TURNS", self.turns.unwrap_or(1));
        shader.constants(&[turns]).with_march(self.shape.march, self.sink)
    }

    /// How the map is looked up.
    fn lookup(&self) -> Lookup {
        let shader = self.shader("").modules(&["shadow/vectors/read.wgsl"]).modules(self.lookup);
        let bilinear = (self.filter == Filter::Bilinear).then_some("FILTER_BILINEAR");
        let shader = shader.defs(bilinear).defs(self.hardware_filter().then_some("HARDWARE_FILTER"));
        Lookup::new(shader).with_lookup_mode(self.asked_by)
    }

    /// Bytes of a texel's vectors.
    fn texel_bytes(&self) -> u64 {
        u64::from(self.vectors) * self.numbers_are.bytes()
    }

    /// Tiles across the atlas, and its sides in texels: as few rows as every adapter's textures are wide for, so that little
    /// of the last stays empty, and nearly square where those are not high enough.
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
        let atlas = store_texture(gpu, "shadow map of vectors", self.numbers_are.format(), size)?;
        // Its sides are rounded up.
        let held = atlas.texture().size();
        let own = Own {
            a: self.numbers[0],
            b: self.numbers[1],
            inv_size: [1.0 / held.width as f32, 1.0 / held.height as f32],
            most_depth: OPAQUE_DEPTH,
            tiles_across,
        };
        let own = uniform_buffer(gpu, "map of vectors", &own);
        let hit = StorageBuffer::zeroed(gpu, "texels hit", 4)?;
        let numbers = (1, context.kernels.uniform(&own));
        let stage = [
            (1, Slot::store(&atlas, self.numbers_are.format())),
            (2, Slot::read_write(hit.as_entire_binding())),
        ];
        let span = tiles.run(
            "map of vectors build",
            &self.build_shader(),
            std::slice::from_ref(&numbers),
            &stage,
        )?;

        let sampler = clamp_sampler(gpu, wgpu::FilterMode::Linear);
        let filtered = self.hardware_filter();
        let sample_type = match self.numbers_are {
            Numbers::Words => wgpu::TextureSampleType::Uint,
            Numbers::Half | Numbers::Single => wgpu::TextureSampleType::Float { filterable: filtered },
        };
        let mut slots =
            vec![numbers, (3, Slot::texture(&atlas, sample_type, wgpu::TextureViewDimension::D2))];
        if filtered {
            slots.push((4, Slot::sampler(&sampler, true)));
        }
        let left_out = tiles.tiles - tiles.built;
        let texels = u64::from(size[0] * size[1] / self.vectors);
        let report = BuildReport {
            device: Some(span),
            bytes: texels * self.texel_bytes() + tiles.table_bytes(),
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
    fn numbers_of_a_map_have_one_layout() {
        let recipe = Recipe {
            vectors: 2,
            numbers_are: Numbers::Half,
            filter: Filter::Bilinear,
            linear: true,
            shape: Fit::Volume.shape(Some(64), March::Cells),
            constants: vec![Constant::unsigned("TERMS", 3)],
            defs: Vec::new(),
            turns: None,
            sink: "shadow/fourier/sink.wgsl",
            lookup: &["shadow/fourier/series.wgsl", "shadow/fourier/lookup.wgsl"],
            numbers: [[0.0; 4]; 2],
            asked_by: Lookups::Shared,
        };
        assert_layout!(&recipe.build_shader(), "Own", Own: a, b, inv_size, most_depth, tiles_across);
        assert_eq!(recipe.atlas(0), (1, [18, 36]));
        assert_eq!(recipe.atlas(200), (200, [200 * 18, 2 * 18]));
        assert_eq!(recipe.atlas(456), (228, [228 * 18, 2 * 2 * 18]));
        let (across, sides) = recipe.atlas(300_000);
        assert!(sides.iter().all(|side| *side < 16_384) && across * (sides[1] / 36) >= 300_000);
        assert_eq!(recipe.texel_bytes(), 16);
        assert!(
            recipe.hardware_filter() && !Recipe { numbers_are: Numbers::Single, ..recipe }.hardware_filter()
        );
    }
}
