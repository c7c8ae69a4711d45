//! Slices of a shadow map: transmittance at its texel centres at even depths, which are pictures seen from the light.

use super::exact_rays::{ExactRay, LightRay};
use crate::error::Result;
use crate::exact::ExactField;
use crate::render::Session;
use crate::scene::Light;
use crate::shadow::ShadowMap;
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

/// Transmittance at the texel centres of a shadow map at one depth. Rows lie from top to bottom and columns from left
/// to right as seen from the light.
pub struct MapSlice {
    /// Distance of the slice from the near end of the shadow map's depth range, along the light rays, mm.
    pub depth_mm: f64,
    /// Transmittance by queries of the shadow map.
    pub method: Array2<f32>,
    /// Exact transmittance.
    pub exact: Array2<f32>,
}

/// Returns `count` slices of a shadow map, spaced evenly in depth like the planes of an opacity shadow map: the last
/// one lies at the far end of the map's depth range.
///
/// # Errors
/// The device is lost.
pub fn map_slices(
    session: &Session,
    shadow: &ShadowMap,
    field: &ExactField,
    light: Light,
    count: u32,
) -> Result<Vec<MapSlice>> {
    let space = &shadow.light_space;
    let side = space.map_size as usize;
    let range_mm = space.depth_range_mm();
    let depths: Vec<f64> = (1..=count).map(|i| range_mm * f64::from(i) / f64::from(count)).collect();
    let texel = |i: usize| DVec2::new((i % side) as f64, (i / side) as f64);
    let rays: Vec<LightRay> = (0..side * side).map(|i| LightRay::new(space, light, texel(i))).collect();
    let exact_along = |ray: &LightRay| {
        let exact = ExactRay::new(field, *ray);
        depths.iter().map(|z| exact.transmittance(space.z_range[0] + z) as f32).collect()
    };
    let exact: Vec<Vec<f32>> = rays.par_iter().map(exact_along).collect();
    let slice = |(i, depth_mm): (usize, &f64)| {
        let points: Vec<_> = rays.par_iter().map(|ray| ray.at(space.z_range[0] + depth_mm)).collect();
        let found = session.query(shadow, &points)?;
        let picture = |value: &dyn Fn(usize) -> f32| {
            Array2::from_shape_fn((side, side), |(row, column)| value(row * side + column))
        };
        Ok(MapSlice {
            depth_mm: *depth_mm,
            method: picture(&|texel| found[texel]),
            exact: picture(&|texel| exact[texel][i]),
        })
    };
    depths.iter().enumerate().map(slice).collect()
}
