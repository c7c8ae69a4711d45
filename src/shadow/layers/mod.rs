//! Layered maps: `osm`, `dom` and `bom`.
//!
//! All three keep the optical depth at planes across each texel's light ray, and read it linearly between them;
//! they differ in where the planes lie. They share one build (`shaders/shadow/layers_build.wgsl`, a thread a texel,
//! which cuts the march's exact pieces at the planes), one packing ([`record::Record`]) and one way of splitting a
//! depth ([`split::Split`]).
//!
//! The papers accumulate opacities of primitives, `Ω`, and take `exp(-κ Ω)`; here `Ω` is the optical depth along
//! the light ray, and what filters average, as theirs do. A texel's layers lie side by side, since a lookup reads
//! two neighbouring ones; tiles without active bricks have no records.
//!
//! Averaging `Ω` is what makes `filter=bilinear` unsteady in stiff scenes: where neighbouring texels' optical depths
//! differ by `D`, the rounding of a point's texel coordinates (1e-6 to 1e-5 of a texel) moves the depth by up to
//! `1e-5 D`, and transmittance along a ray may rise by as much (`umbravox stability`: by 1e-4 at 17 to 0.1 at 1e6 per
//! mm). `filter=nearest` has none of it.

mod bounding_opacity;
mod deep_opacity;
mod keys;
mod opacity;
mod ratio;
mod record;
mod split;

pub(super) use bounding_opacity::ENTRY as BOM;
pub use bounding_opacity::{BoundingOpacityMap, BoundingSplit};
pub(super) use deep_opacity::ENTRY as DOM;
pub use deep_opacity::{Beyond, DeepOpacityMap};
pub(super) use opacity::ENTRY as OSM;
pub use opacity::{OpacityShadowMap, Slicing};
pub use ratio::{Measure, SplitChoice};

use super::deep::{CHORD_TOLERANCE, STEEPEST_SURFACE, TILE_ROWS, layout};
use super::{
    BuildContext, BuildReport, Filter, LightSpace, LightUniform, Lookup, PassLeftOut, ShadowMap, TileParts,
};
use crate::error::Result;
use crate::gpu::{
    Gpu, ShaderVariant, Span, StorageBuffer, read_back, steady_side, table_texture, uniform_buffer,
};
use crate::render::Optional;
use record::Record;
use split::{SPLIT_BINS, Split};
use std::time::Instant;

/// The pass that marches.
const BUILD: &str = "layered map build";
/// The pass of which DOM and BOM have no need here.
const NO_DEPTH_PASS: PassLeftOut = PassLeftOut {
    what: "depth pass",
    why: "the march meets the start before the layers",
    optional: Some(Optional::DepthPass),
};

/// What one layered map is to be.
struct Recipe {
    record: Record,
    split: Split,
    /// Depth that the layers span where texels store no end, mm.
    reach_mm: f64,
    /// Whether the last layer gets what lies behind it too.
    last_takes_rest: bool,
    /// The tabulated split of the whole map.
    split_choice: u32,
    filter: Filter,
    /// Texels a side that a lookup averages.
    kernel: u32,
}

/// A built map, before it is put behind a lookup.
struct Built {
    light_space: LightSpace,
    uniform: wgpu::Buffer,
    tables: wgpu::TextureView,
    records: wgpu::TextureView,
    report: BuildReport,
}

impl Recipe {
    /// Definitions of the lookup.
    fn read_defs(&self) -> Vec<&'static str> {
        let mut defs = self.record.read_defs();
        defs.extend(self.split.def());
        defs.extend((self.filter == Filter::Bilinear).then_some("FILTER_BILINEAR"));
        defs
    }

    fn uniform(&self, light_space: &LightSpace) -> LightUniform {
        let [near, far] = light_space.z_range;
        let mut uniform = LightUniform {
            depth_start_mm: near as f32,
            depth_range_mm: (far - near).max(1e-9) as f32,
            reach_mm: self.reach_mm.max(1e-9) as f32,
            planes_passed: self.record.layers - u32::from(self.last_takes_rest),
            split_row: light_space.tiles_across(),
            split_choice: self.split_choice,
            split_exponent: if let Split::Power(exponent) = self.split { exponent as f32 } else { 1.0 },
            longest_depth: (8.0 * CHORD_TOLERANCE).sqrt() as f32,
            same_surface_mm: (STEEPEST_SURFACE * light_space.texel_mm()) as f32,
            kernel: self.kernel,
            filter_side: self.kernel + u32::from(self.filter == Filter::Bilinear),
            ..light_space.uniform()
        };
        self.record.describe(&mut uniform);
        uniform
    }

    /// The layout table, with the tabulated splits in rows below it: its size and texels.
    fn tables(&self, entries: &[u32], across: u32) -> ([u32; 2], Vec<u32>) {
        let Split::Tables(splits) = &self.split else { return ([across, across], entries.to_vec()) };
        let width = across.max(SPLIT_BINS as u32 + 1).max(self.record.layers + 1);
        let mut texels = Vec::new();
        let mut push = |row: &mut dyn Iterator<Item = u32>| {
            texels.extend(row);
            texels.resize(texels.len().next_multiple_of(width as usize), 0);
        };
        entries.chunks(across as usize).for_each(|row| push(&mut row.iter().copied()));
        for row in splits.iter().flat_map(|s| s.rows(self.record.layers)) {
            push(&mut row.iter().map(|v| v.to_bits()));
        }
        ([width, across + 2 * splits.len() as u32], texels)
    }

    /// Builds the map. `stage` holds what the build reads and counts: its first word is the texels hit; `None` where
    /// texels choose no split of their own.
    fn build(
        &self,
        context: &BuildContext<'_>,
        light_space: LightSpace,
        stage: Option<&wgpu::Buffer>,
    ) -> Result<Built> {
        let gpu = context.renderer.gpu();
        let start = Instant::now();
        let across = light_space.tiles_across();
        let (entries, list) = layout(&context.built_tiles(&light_space));
        let (size, texels) = self.tables(&entries, across);
        let tables = table_texture(gpu, "layered map tables", wgpu::TextureFormat::R32Uint, size, &texels)?;
        let uniform = uniform_buffer(gpu, "light space", &self.uniform(&light_space));
        let record_count = list.len() as u64 * u64::from(TILE_ROWS);
        let records = record_texture(gpu, self.record, record_count)?;
        let tile_list = StorageBuffer::from_slice(gpu, "layered map tiles", &list)?;
        let own_stage = StorageBuffer::zeroed(gpu, "layered map stage", 16)?;
        let stage = stage.unwrap_or(&own_stage);
        let host_ms = start.elapsed().as_secs_f64() * 1e3;

        let pass = Pass {
            store: Some((&records, self.record.format())),
            first: &tables,
            second: &super::plain::unused_texture(gpu)?,
            stage,
        };
        let mut defs = self.record.write_defs();
        defs.extend(self.split.def());
        let variant = march_variant(
            context,
            "shadow/layers_build.wgsl",
            &["shadow/layers_layout.wgsl", "shadow/layers_sink.wgsl"],
            defs,
        )?;
        let with_depth_pass = self.record.depths > 0 && context.transfer.forced.has(Optional::DepthPass);
        let mut device: Option<Span> = None;
        let mut depth_passes = 0;
        let mut parts = TileParts::new(context.renderer, BUILD, list.len() as u32);
        let mut last = None;
        while let Some(part) = parts.next(context.renderer, last) {
            let (groups, list) = (part.workgroups(), part.binding(&tile_list));
            let mut took = pass.run(context, BUILD, &variant, &uniform, groups, list.clone())?;
            if with_depth_pass {
                took = depth_pass(context, &pass, record_count, &uniform, groups, list)?.plus(took);
                depth_passes += 1;
            }
            device = Some(device.map_or(took, |d| d.plus(took)));
            last = Some(took);
        }
        let texels_hit = u64::from(read_back::<u32>(gpu, stage, 1)?[0]);
        let left_out = (entries.len() - list.len()) as u64;
        let tile_bytes = u64::from(TILE_ROWS) * self.record.bytes();
        let report = BuildReport {
            host_ms,
            device,
            // Whole lines of the texture, as they are allocated.
            bytes: self.record.texture_bytes(record_count) + size_of_val(&texels[..]) as u64,
            texels_hit: Some(texels_hit),
            tiles: entries.len() as u32,
            tiles_left_out: left_out as u32,
            bytes_left_out: left_out * tile_bytes,
            passes_left_out: if self.record.depths > 0 && depth_passes == 0 { &[NO_DEPTH_PASS] } else { &[] },
            ..Default::default()
        };
        Ok(Built { light_space, uniform, tables, records, report })
    }
}

impl Built {
    /// Puts the map behind the lookup that the last of the modules offers.
    fn behind(
        self,
        context: &BuildContext<'_>,
        modules: &'static [&'static str],
        defs: Vec<&'static str>,
    ) -> ShadowMap {
        ShadowMap {
            bind_group: context.renderer.shadow_bind_group(&self.uniform, &self.tables, &self.records),
            lookup: Some(Lookup { modules, defs, marches: false }),
            light_space: self.light_space,
            report: self.report,
            bound: None,
        }
    }
}

/// The bindings of one compute pass over a layered map.
struct Pass<'a> {
    /// Group 2, binding 0, where the pass writes records.
    store: Option<(&'a wgpu::TextureView, wgpu::TextureFormat)>,
    /// Group 1: tables and records.
    first: &'a wgpu::TextureView,
    second: &'a wgpu::TextureView,
    /// Group 2: what it counts and reads.
    stage: &'a wgpu::Buffer,
}

impl Pass<'_> {
    fn run(
        &self,
        context: &BuildContext<'_>,
        label: &str,
        variant: &ShaderVariant,
        uniform: &wgpu::Buffer,
        [across, down]: [u32; 2],
        list: wgpu::BindingResource<'_>,
    ) -> Result<Span> {
        let renderer = context.renderer;
        let gpu = renderer.gpu();
        let stage_layout = stage_layout(gpu, self.store.map(|(_, format)| format));
        let pipeline = renderer.pipeline(variant, &stage_layout)?;
        let shadow = renderer.shadow_bind_group(uniform, self.first, self.second);
        let mut entries = vec![
            wgpu::BindGroupEntry { binding: 1, resource: self.stage.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 2, resource: list },
        ];
        entries.extend(self.store.map(|(view, _)| wgpu::BindGroupEntry {
            binding: 0,
            resource: wgpu::BindingResource::TextureView(view),
        }));
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(label),
            layout: &stage_layout,
            entries: &entries,
        });
        renderer.timer().compute(gpu, label, |pass| {
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, context.transfer.bind_group(), &[]);
            pass.set_bind_group(1, &shadow, &[]);
            pass.set_bind_group(2, &group, &[]);
            if down > 0 {
                pass.dispatch_workgroups(across, down, 1);
            }
        })
    }
}

/// The papers' depth pass, which nothing here reads, in the bindings of the build that follows.
fn depth_pass(
    context: &BuildContext<'_>,
    build: &Pass<'_>,
    texels: u64,
    uniform: &wgpu::Buffer,
    groups: [u32; 2],
    list: wgpu::BindingResource<'_>,
) -> Result<Span> {
    let starts = StorageBuffer::zeroed(context.renderer.gpu(), "starts", 4 * texels)?;
    let sink = &["shadow/start_sink.wgsl"];
    let variant = march_variant(context, "shadow/layers_start.wgsl", sink, Vec::new())?;
    let second = &super::plain::unused_texture(context.renderer.gpu())?;
    Pass { store: None, stage: &starts, second, ..*build }.run(
        context,
        "depth pass",
        &variant,
        uniform,
        groups,
        list,
    )
}

/// Group 2 of a pass over a layered map; wgpu keeps equal layouts once.
fn stage_layout(gpu: &Gpu, store: Option<wgpu::TextureFormat>) -> wgpu::BindGroupLayout {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty,
        count: None,
    };
    let buffer = |binding, read_only| {
        let ty = wgpu::BufferBindingType::Storage { read_only };
        entry(binding, wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None })
    };
    let mut entries = vec![buffer(1, false), buffer(2, true)];
    entries.extend(store.map(|format| {
        let access = wgpu::StorageTextureAccess::WriteOnly;
        let view_dimension = wgpu::TextureViewDimension::D2;
        entry(0, wgpu::BindingType::StorageTexture { access, format, view_dimension })
    }));
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("layered map stage"),
        entries: &entries,
    })
}

/// A pass that marches light rays into a sink, which is the last of `modules`.
fn march_variant(
    context: &BuildContext<'_>,
    entry: &'static str,
    modules: &[&'static str],
    mut defs: Vec<&'static str>,
) -> Result<ShaderVariant> {
    defs.extend(context.march_defs()?);
    let common = ["common/field.wgsl", "common/transfer.wgsl", "common/light.wgsl"];
    Ok(ShaderVariant { entry, modules: [&common, modules, &["common/march.wgsl"]].concat(), defs })
}

/// The texture of so many records. wgpu clears what is never written, and cleared records let all light through.
fn record_texture(gpu: &Gpu, record: Record, records: u64) -> Result<wgpu::TextureView> {
    let size = record.texture_size(records);
    gpu.check_texture("layered shadow map", size)?;
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("layered map records"),
        size: wgpu::Extent3d { width: size[0], height: steady_side(gpu, size[1]), depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: record.format(),
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::STORAGE_BINDING,
        view_formats: &[],
    });
    gpu.take_error()?;
    Ok(texture.create_view(&Default::default()))
}
