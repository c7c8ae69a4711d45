//! Shadow method `none`: no shadows.

use super::lookup::Lookup;
use super::method::{BuildReport, Entry, Method, ShadowMap};
use super::settings::Value;
use super::style::{Marker, Style};
use crate::error::Result;
use crate::field::{BuildContext, LightSpace, MapShape, March};
use crate::gpu::tuning::MAX_RAY_SAMPLES;

/// Shadow method without shadows: the full light reaches every point.
#[derive(Debug, Clone, Copy)]
pub struct NoShadows;

pub(super) static ENTRY: Entry = Entry {
    name: "none",
    summary: "no shadows: every point sees the light",
    keys: &[],
    make: |_| Some(Box::new(NoShadows)),
    compared: "none",
    curve: "",
    stability: "none",
    published: None,
    style: Style { color: [0, 0, 0], marker: Marker::Cross },
};

impl Method for NoShadows {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        Vec::new()
    }

    fn lookup(&self) -> Option<Lookup> {
        None
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        Ok(without_map(self, context, March::Cells))
    }
}

/// Number of shadow map texels per side that tests assume for shadow methods without a shadow map.
const TEST_MAP: u32 = 512;

/// Returns the projection of the light for shadow methods without a shadow map, with an assumed number of texels.
pub(super) fn test_space(context: &BuildContext<'_>, march: March) -> LightSpace {
    context.light_space(MapShape {
        texels: Some(TEST_MAP),
        fits_view: false,
        reach: 1,
        border: 1,
        march,
        near: 0.0,
    })
}

/// Returns the shadow data of a method without a map: the light space and the transmittance query only.
pub(super) fn without_map(method: &dyn Method, context: &BuildContext<'_>, march: March) -> ShadowMap {
    let mut light_space = test_space(context, march);
    if light_space.step_mm > 0.0 {
        light_space.step_mm =
            light_space.step_mm.max(light_space.depth_range_mm() / f64::from(MAX_RAY_SAMPLES));
    }
    let light = context.light_uniform(&light_space);
    ShadowMap {
        method: method.name(),
        group: context.kernels.group("light space", &[(0, context.kernels.uniform(&light))]),
        lookup: method.lookup(),
        light_space,
        report: BuildReport::default(),
        bound: None,
        enclosure: None,
        sections: None,
        _pool: None,
    }
}
