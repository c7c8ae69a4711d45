//! Ambient occlusion: mean transmittance of rays around a point, as long as a radius (Hernell, Ljung and Ynnerman 2010,
//! *Local Ambient Occlusion in Direct Volume Rendering*, known here by its abstract).
//!
//! Each query casts its rays, in directions of a Fibonacci lattice that are the same at all points, and marches them
//! cell by cell. A lattice of stored values would be faster where much is translucent, but its nodes inside and outside
//! of an opaque surface differ by half of the range, so that surfaces show the lattice.

use super::lookup::Lookup;
use super::method::{BuildReport, ShadowMap};
use super::none::test_space;
use crate::error::Result;
use crate::field::{BuildContext, March, field_shader, grid_from_world};
use crate::gpu::{Slot, StorageBuffer};
use crate::scene::AmbientOcclusion;
use glam::DVec3;

/// Returns the shader code of a query for ambient occlusion.
pub fn occlusion_lookup() -> Lookup {
    Lookup::new(field_shader("").with_shadow_rays(March::Cells).modules(&["shadow/occlusion.wgsl"]))
}

/// Returns maps without texels, each with its share of the rays around a point: its query is the mean transmittance of
/// these rays. The rays of a query are together about as long as the diagonal of the volume, as with one shadow ray.
///
/// # Errors
/// The device is out of memory.
pub fn ambient_occlusion(
    context: &BuildContext<'_>,
    occlusion: AmbientOcclusion,
) -> Result<Vec<(ShadowMap, f64)>> {
    let AmbientOcclusion { radius_mm, samples } = occlusion;
    let corners = context.volume.corners_mm();
    let diagonal_mm = corners[7].distance(corners[0]);
    let at_once = (diagonal_mm / radius_mm).clamp(1.0, f64::from(samples)) as u32;
    let passes = samples.div_ceil(at_once) as usize;
    let to_grid = grid_from_world(context.volume);
    let per_mm = |toward: DVec3| to_grid.transform_vector3(toward).extend(radius_mm).as_vec4().to_array();
    let rays: Vec<[f32; 4]> = occlusion.directions().into_iter().map(per_mm).collect();
    let light_space = test_space(context, March::Cells);
    let light = context.light_uniform(&light_space);
    let map_of = |pass: usize| {
        // Neighbouring directions are in different passes.
        let rays: Vec<[f32; 4]> = rays.iter().skip(pass).step_by(passes).copied().collect();
        let share = rays.len() as f64 / f64::from(samples);
        let rays = StorageBuffer::from_slice(context.gpu(), "ambient occlusion", rays.as_flattened())?;
        let slots = [(0, context.kernels.uniform(&light)), (1, Slot::read(rays.as_entire_binding()))];
        let group = context.kernels.group("ambient occlusion", &slots);
        let map = ShadowMap {
            method: "ambient occlusion",
            group,
            lookup: Some(occlusion_lookup()),
            light_space: light_space.clone(),
            report: BuildReport::default(),
            bound: None,
            enclosure: None,
            sections: None,
            _pool: None,
        };
        Ok((map, share))
    };
    (0..passes).map(map_of).collect()
}
