//! The two methods without a map: `none` and `rays`.

use super::spec::Setting;
use super::{Bound, BuildContext, BuildReport, Entry, LightSpace, Lookup, Method, ShadowMap};
use crate::error::Result;
use crate::gpu::{Gpu, table_texture, uniform_buffer};
use std::time::Instant;

/// `none`: every point sees the light.
#[derive(Debug, Clone, Copy)]
pub struct NoShadows;

/// `rays`: a shadow ray per sample, through the same cell-by-cell march that builds the maps; the yardstick of pictures.
#[derive(Debug, Clone, Copy)]
pub struct ShadowRays;

pub(super) static NONE: Entry = Entry {
    name: "none",
    summary: "no shadows: every point sees the light",
    keys: &[],
    parse: |_: &Setting| Ok(Box::new(NoShadows)),
};

pub(super) static RAYS: Entry = Entry {
    name: "rays",
    summary: "a shadow ray per sample, marched cell by cell: slow and close to exact",
    keys: &[],
    parse: |_: &Setting| Ok(Box::new(ShadowRays)),
};

/// Optical depth that float32 positions, two-point Gauss quadrature and sums of hundreds of pieces may be off by.
const MARCH_TOLERANCE: f64 = 1e-3;

impl Method for NoShadows {
    fn name(&self) -> &'static str {
        NONE.name
    }

    fn params(&self) -> String {
        String::new()
    }

    fn map_size(&self) -> Option<u32> {
        None
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        without_map(context, None, None)
    }
}

impl Method for ShadowRays {
    fn name(&self) -> &'static str {
        RAYS.name
    }

    fn params(&self) -> String {
        String::new()
    }

    fn map_size(&self) -> Option<u32> {
        None
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let lookup = Lookup {
            modules: &["shadow/total.wgsl", "common/march.wgsl", "shadow/rays.wgsl"],
            defs: Vec::new(),
            marches: true,
        };
        let bound = Bound {
            transmittance: MARCH_TOLERANCE,
            depth_mm: super::deep::POSITION_TOLERANCE * context.volume.min_spacing_mm(),
        };
        without_map(context, Some(lookup), Some(bound))
    }
}

/// Texels of the light space that methods without a map are tested on.
const TEST_MAP: u32 = 512;

fn without_map(
    context: &BuildContext<'_>,
    lookup: Option<Lookup>,
    bound: Option<Bound>,
) -> Result<ShadowMap> {
    let start = Instant::now();
    let light_space = LightSpace::fit(context.volume, &context.transfer.active, context.light, TEST_MAP);
    let gpu = context.renderer.gpu();
    let uniform = uniform_buffer(gpu, "light space", &light_space.uniform());
    let unused = unused_texture(gpu)?;
    Ok(ShadowMap {
        bind_group: context.renderer.shadow_bind_group(&uniform, &unused, &unused),
        lookup,
        light_space,
        report: BuildReport { host_ms: start.elapsed().as_secs_f64() * 1e3, ..Default::default() },
        bound,
    })
}

/// Stands where a pipeline's layout wants a texture that its shader does not read.
pub(super) fn unused_texture(gpu: &Gpu) -> Result<wgpu::TextureView> {
    table_texture(gpu, "unused", wgpu::TextureFormat::Rgba32Uint, [1, 1], &[[0u32; 4]])
}
