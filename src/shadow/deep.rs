//! `dsm`: tiled deep shadow maps.
//!
//! Hadwiger, Kratz, Sigg, Bühler 2006, *GPU-Accelerated Deep Shadow Maps for Direct Volume Rendering*; compression after
//! Lokovic and Veach 2000. Symbols: `epsilon` is the paper's error bound on transmittance.
//!
//! Deviations from the paper, and why:
//! * One compute pass builds the map. The paper's passes of eight nodes each become rows of seven nodes and a link:
//!   every texel of a tile that holds active bricks has a first row, further rows come from a pool shared by all tiles
//!   (an atomic counter), so that one long texel does not lengthen its whole tile.
//! * Rays are marched cell by cell instead of at regular steps: inside a cell the field along a ray is a cubic, and the
//!   pre-compressed table tells at which values visibility bends; no peak or grazing touch is stepped over.
//! * The stored slope is clamped to be no more than zero, which never leaves the window: output is monotone.
//! * `filter=bilinear` lays the four functions over each other at the depth where each first meets extinction (where
//!   these are close enough to be one surface) before it averages them: without that, slanted lit walls shadow
//!   themselves. On rays through texel centres it changes nothing, and so neither the promise.
//! * A node is 4 bytes: 16-bit depth within the map's range and 16-bit transmittance.
//! * `precompress=off` samples at regular steps with point samples of the extinction, as the paper's Figure 3 (left).

use super::spec::Setting;
use super::{
    Bound, BuildContext, BuildReport, Entry, Key, LightSpace, LightUniform, Lookup, Method, ShadowMap, TILE,
    TileParts,
};
use crate::error::{Error, Result};
use crate::gpu::{
    Gpu, ShaderVariant, Span, StorageBuffer, read_back, steady_side, table_texture, uniform_buffer,
};
use crate::volume::Volume;
use bytemuck::{Pod, Zeroable};
use std::time::Instant;

/// What the compression's polyline may stray from the curve between its points.
pub(super) const CHORD_TOLERANCE: f64 = 0.002;
/// Transmittance at which a ray is taken to be over (2^-11, `OPAQUE_DEPTH` in the shaders).
const OVER: f64 = 1.0 / 2048.0;
/// Rounding to 16 bits, once at a line's start and once at its end.
const STORAGE: f64 = 1.0 / 65535.0;
/// What float32 positions, table selection and quadrature may add.
const ARITHMETIC: f64 = 0.001;
/// Share of a voxel by which float32 may misplace a surface along the ray.
pub(super) const POSITION_TOLERANCE: f64 = 0.02;
/// Slope against the light up to which neighbouring texels are taken to see one surface.
pub(super) const STEEPEST_SURFACE: f64 = 4.0;
/// Depth steps of the map's range.
const DEPTH_STEPS: f64 = 65534.0;
/// Words and bytes of a row: seven nodes and a link.
const ROW_BYTES: u64 = 32;
/// Texels across the texture of nodes.
const NODE_TEXTURE_WIDTH: u32 = 4096;
pub(super) const TILE_ROWS: u32 = TILE * TILE;
/// The pass that marches.
const BUILD: &str = "deep shadow map build";
/// First row of a tile that is left out.
const NO_TILE: u32 = u32::MAX;
pub(super) const MAX_MAP: u32 = 8192;
/// Modules of the lookup, by which a built structure is known to be a deep shadow map.
pub(super) const LOOKUP: &[&str] = &["shadow/deep_layout.wgsl", "shadow/deep.wgsl"];

/// How the four texels around a point are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    Nearest,
    Bilinear,
}

/// Whether the light march uses the pre-compressed table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precompress {
    Table,
    Off,
}

/// Settings of a deep shadow map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeepShadowMap {
    /// Error in transmittance that the compression may make.
    pub epsilon: f64,
    /// Sub-texel rays whose mean a texel stores: 1, 5 or 9.
    pub prefilter: u32,
    pub precompress: Precompress,
    /// Texels a side.
    pub map: u32,
    pub filter: Filter,
    /// Distance of regular samples along the light ray (`precompress=off`, and twice that of pre-filtered lattices), in
    /// units of the smallest voxel spacing.
    pub step: f64,
    /// Added to a point's depth before it is looked up, in units of the smallest voxel spacing.
    pub offset: f64,
}

impl Default for DeepShadowMap {
    fn default() -> Self {
        Self {
            epsilon: 0.02,
            prefilter: 1,
            precompress: Precompress::Table,
            map: 512,
            filter: Filter::Bilinear,
            step: 0.5,
            offset: 0.0,
        }
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "dsm",
    summary: "tiled deep shadow maps (Hadwiger et al. 2006), error-bounded",
    keys: &[
        Key {
            name: "epsilon",
            values: "0..1",
            default: "0.02",
            help: "error that compression may make in transmittance",
        },
        Key { name: "prefilter", values: "1|5|9", default: "1", help: "sub-texel rays averaged in a texel" },
        Key {
            name: "precompress",
            values: "table|off",
            default: "table",
            help: "pre-compressed transfer-function table, or regular point samples",
        },
        Key { name: "map", values: "1..8192", default: "512", help: "texels a side" },
        Key {
            name: "filter",
            values: "nearest|bilinear",
            default: "bilinear",
            help: "texels used for a point",
        },
        Key {
            name: "step",
            values: "0.01..8",
            default: "0.5",
            help: "regular light step, in smallest spacings (precompress=off, prefilter)",
        },
        Key {
            name: "offset",
            values: "-8..8",
            default: "0",
            help: "added to a point's depth, in smallest spacings",
        },
    ],
    parse: |setting| Ok(Box::new(DeepShadowMap::from_setting(setting)?)),
};

impl DeepShadowMap {
    fn from_setting(setting: &Setting) -> Result<Self> {
        let mut s = Self::default();
        for (key, value) in &setting.params {
            let refuse = |why: &str| Error::input("bad value", format!("dsm:{key}={value}"), why);
            let number = |lo: f64, hi: f64| {
                let v = value.parse::<f64>().ok().filter(|v| *v >= lo && *v <= hi);
                v.ok_or_else(|| refuse(&format!("expected a number from {lo} to {hi}")))
            };
            match (key.as_str(), value.as_str()) {
                ("epsilon", _) => s.epsilon = number(0.0, 1.0)?,
                ("prefilter", "1") => s.prefilter = 1,
                ("prefilter", "5") => s.prefilter = 5,
                ("prefilter", "9") => s.prefilter = 9,
                ("precompress", "table") => s.precompress = Precompress::Table,
                ("precompress", "off") => s.precompress = Precompress::Off,
                ("filter", "nearest") => s.filter = Filter::Nearest,
                ("filter", "bilinear") => s.filter = Filter::Bilinear,
                ("map", _) => {
                    let n = value.parse::<u32>().ok().filter(|n| (1..=MAX_MAP).contains(n));
                    s.map = n.ok_or_else(|| refuse("expected a whole number from 1 to 8192"))?;
                }
                ("step", _) => s.step = number(0.01, 8.0)?,
                ("offset", _) => s.offset = number(-8.0, 8.0)?,
                _ => {
                    let known = ENTRY.keys.iter().find(|k| k.name == key);
                    return Err(refuse(&format!("expected {}", known.map_or("no such key", |k| k.values))));
                }
            }
        }
        Ok(s)
    }

    /// Cell by cell with a single ray: the whole curve goes to the compression as it comes.
    fn whole_curve(&self) -> bool {
        self.precompress == Precompress::Table && self.prefilter == 1
    }

    /// Distance of the regular lattice, mm; half a step where means of exact curves are taken, so that the lattice
    /// itself stays within half a step of depth.
    fn lattice_mm(&self, volume: &Volume) -> f64 {
        let step = if self.precompress == Precompress::Table { 0.5 * self.step } else { self.step };
        step * volume.min_spacing_mm()
    }

    fn bound(&self, volume: &Volume, light_space: &LightSpace) -> Option<Bound> {
        if self.precompress == Precompress::Off {
            return None;
        }
        let [z_min, z_max] = light_space.z_range;
        let lattice = if self.whole_curve() { 0.0 } else { self.lattice_mm(volume) };
        let chord = if self.whole_curve() { CHORD_TOLERANCE } else { 0.0 };
        Some(Bound {
            transmittance: self.epsilon + chord + OVER + STORAGE + ARITHMETIC,
            depth_mm: POSITION_TOLERANCE * volume.min_spacing_mm()
                + 0.5 * (z_max - z_min) / DEPTH_STEPS
                + lattice
                + self.offset.abs() * volume.min_spacing_mm(),
        })
    }

    fn variant(&self, context: &BuildContext<'_>) -> Result<ShaderVariant> {
        let mut modules = vec!["common/field.wgsl", "common/transfer.wgsl", "common/light.wgsl"];
        let mut defs = Vec::new();
        modules.extend(["shadow/deep_layout.wgsl", "shadow/deep_nodes.wgsl"]);
        if self.whole_curve() {
            defs.push("WHOLE_CURVE");
            modules.push("shadow/deep_sink.wgsl");
        } else {
            modules.push("shadow/total.wgsl");
        }
        if self.precompress == Precompress::Table {
            defs.push("MARCH_CELLS");
            defs.extend(context.march_defs()?);
            modules.push("common/march.wgsl");
        }
        if self.prefilter > 1 {
            defs.push("PREFILTER");
        }
        Ok(ShaderVariant { entry: "shadow/deep_build.wgsl", modules, defs })
    }
}

/// `Counters` of `shaders/shadow/deep_nodes.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Counters {
    pub overflow_rows: u32,
    pub nodes_total: u32,
    pub nodes_max: u32,
    pub texels_hit: u32,
    pub texels_cut: u32,
}

/// The texture that holds rows of nodes: two texels a row.
fn node_texture(gpu: &Gpu, rows: u32) -> Result<wgpu::TextureView> {
    let size = [NODE_TEXTURE_WIDTH, rows / (NODE_TEXTURE_WIDTH / 2)];
    gpu.check_texture("deep shadow map nodes", size)?;
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("deep shadow map nodes"),
        size: wgpu::Extent3d { width: size[0], height: steady_side(gpu, size[1]), depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::STORAGE_BINDING,
        view_formats: &[],
    });
    Ok(texture.create_view(&Default::default()))
}

/// The layout table (first row of each tile, or none), and the tiles that have rows.
pub(super) fn layout(occupied: &[bool]) -> (Vec<u32>, Vec<u32>) {
    let mut list = Vec::new();
    let entry = |(tile, occupied): (usize, &bool)| {
        if !occupied {
            return NO_TILE;
        }
        list.push(tile as u32);
        (list.len() as u32 - 1) * TILE_ROWS
    };
    let entries = occupied.iter().enumerate().map(entry).collect();
    (entries, list)
}

impl Method for DeepShadowMap {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn params(&self) -> String {
        let mut text = format!("epsilon={}", self.epsilon);
        let standard = Self::default();
        let mut more = |differs: bool, key: &str, value: String| {
            if differs {
                text += &format!(" {key}={value}");
            }
        };
        more(self.prefilter != standard.prefilter, "prefilter", self.prefilter.to_string());
        more(self.precompress == Precompress::Off, "precompress", "off".into());
        more(self.filter == Filter::Nearest, "filter", "nearest".into());
        more(self.step != standard.step, "step", self.step.to_string());
        more(self.offset != standard.offset, "offset", self.offset.to_string());
        text
    }

    fn map_size(&self) -> Option<u32> {
        Some(self.map)
    }

    fn taps(&self) -> u32 {
        self.prefilter
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let (renderer, volume) = (context.renderer, context.volume);
        let gpu = renderer.gpu();
        let start = Instant::now();
        let active = &context.transfer.active;
        let light_space = LightSpace::fit(volume, active, context.light, self.map);
        let (entries, list) = layout(&context.built_tiles(&light_space));
        let [z_min, z_max] = light_space.z_range;
        let spacing = volume.min_spacing_mm();
        let mut uniform = LightUniform {
            epsilon: self.epsilon as f32,
            chord_tolerance: CHORD_TOLERANCE as f32,
            step_mm: self.lattice_mm(volume) as f32,
            tile_rows: list.len() as u32 * TILE_ROWS,
            taps: self.prefilter,
            depth_offset_mm: (self.offset * spacing) as f32,
            depth_start_mm: z_min as f32,
            same_surface_steps: (STEEPEST_SURFACE * light_space.texel_mm() * DEPTH_STEPS
                / (z_max - z_min).max(1e-9)) as f32,
            depth_steps_per_mm: (DEPTH_STEPS / (z_max - z_min).max(1e-9)) as f32,
            ..light_space.uniform()
        };
        let across = light_space.tiles_across();
        let word = wgpu::TextureFormat::R32Uint;
        let tiles = table_texture(gpu, "deep shadow map layout", word, [across, across], &entries)?;
        let tile_list = StorageBuffer::from_slice(gpu, "deep shadow map tiles", &list)?;
        let host_ms = start.elapsed().as_secs_f64() * 1e3;

        // A quarter more rows than texels does for most scenes; the counter says what this one needs.
        let mut pool_rows = uniform.tile_rows + uniform.tile_rows / 4;
        let mut pool_growths = 0;
        let pipeline = renderer.pipeline(&self.variant(context)?, &renderer.layouts().build)?;
        let (nodes, device, counters) = loop {
            // Whole lines of the texture; a map without tiles keeps one.
            pool_rows = pool_rows.max(1).next_multiple_of(NODE_TEXTURE_WIDTH / 2);
            uniform.pool_rows = pool_rows;
            let nodes = node_texture(gpu, pool_rows)?;
            let (device, counters) =
                run_build(context, &pipeline, &uniform, [&nodes, &tiles], &tile_list, list.len() as u32)?;
            if counters.texels_cut > 0 {
                let why =
                    format!("the adapter ended {} light rays before they were done", counters.texels_cut);
                return Err(Error::runtime("cannot build the deep shadow map", self.params(), why)
                    .hint("software adapters limit loops: fewer pre-filter taps or a longer step will do"));
            }
            let needed = uniform.tile_rows + counters.overflow_rows;
            if needed <= pool_rows {
                break (nodes, device, counters);
            }
            pool_rows = needed + needed / 16;
            pool_growths += 1;
        };
        let bytes = u64::from(pool_rows) * ROW_BYTES + size_of_val(&entries[..]) as u64;
        let light = uniform_buffer(gpu, "light space", &uniform);
        Ok(ShadowMap {
            bind_group: renderer.shadow_bind_group(&light, &tiles, &nodes),
            lookup: Some(Lookup {
                modules: LOOKUP,
                defs: if self.filter == Filter::Bilinear { vec!["FILTER_BILINEAR"] } else { Vec::new() },
                marches: false,
            }),
            report: BuildReport {
                host_ms,
                device: Some(device),
                bytes,
                nodes_total: Some(u64::from(counters.nodes_total)),
                nodes_max: Some(u64::from(counters.nodes_max)),
                texels_hit: Some(u64::from(counters.texels_hit)),
                tiles: entries.len() as u32,
                tiles_left_out: (entries.len() - list.len()) as u32,
                bytes_left_out: (entries.len() - list.len()) as u64 * u64::from(TILE_ROWS) * ROW_BYTES,
                pool_growths,
                passes_left_out: &[],
                split_choice: None,
            },
            bound: self.bound(volume, &light_space),
            light_space,
        })
    }
}

fn run_build(
    context: &BuildContext<'_>,
    pipeline: &wgpu::ComputePipeline,
    uniform: &LightUniform,
    [nodes, tiles]: [&wgpu::TextureView; 2],
    tile_list: &wgpu::Buffer,
    tile_count: u32,
) -> Result<(Span, Counters)> {
    let renderer = context.renderer;
    let gpu: &Gpu = renderer.gpu();
    let light = uniform_buffer(gpu, "light space", uniform);
    let unused = super::plain::unused_texture(gpu)?;
    let counters = StorageBuffer::zeroed(gpu, "deep shadow map counters", size_of::<Counters>() as u64)?;
    let shadow = renderer.shadow_bind_group(&light, tiles, &unused);
    let mut span: Option<Span> = None;
    let mut parts = TileParts::new(renderer, BUILD, tile_count);
    let mut last = None;
    while let Some(part) = parts.next(renderer, last) {
        let build = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(BUILD),
            layout: &renderer.layouts().build,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(nodes) },
                wgpu::BindGroupEntry { binding: 1, resource: counters.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 2, resource: part.binding(tile_list) },
            ],
        });
        let took = renderer.timer().compute(gpu, BUILD, |pass| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, context.transfer.bind_group(), &[]);
            pass.set_bind_group(1, &shadow, &[]);
            pass.set_bind_group(2, &build, &[]);
            let [across, down] = part.workgroups();
            if down > 0 {
                pass.dispatch_workgroups(across, down, 1);
            }
        })?;
        span = Some(span.map_or(took, |s| s.plus(took)));
        last = Some(took);
    }
    let span = span.unwrap_or(Span { gpu_ms: None, wall_ms: 0.0 });
    Ok((span, read_back::<Counters>(gpu, &counters, 1)?[0]))
}
