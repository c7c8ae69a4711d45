//! Test of a shadow method's error bound on the light ray nearest to a probed point.

use super::cached_session::Prepared;
use super::messages::{NearestRay, ProbedBound};
use crate::error::Result;
use crate::exact::ExactField;
use crate::measure::errors::RayTest;
use crate::scene::Light;
use crate::shadow::Taps;
use glam::{DVec2, DVec3};

/// Number of depths along the light ray at which the error bound is tested, besides depths around the breakpoints of
/// the exact transmittance curve.
const DEPTHS: usize = 200;

/// Tests the error bound of a shadow method against the exact transmittance, on the light ray through the texel
/// centre nearest to a point (world mm). `taps` states which light rays the method averages per texel. Returns `None`
/// if the method has no bound.
///
/// # Errors
/// A lost device.
pub fn test_bound(
    made: &Prepared<'_>,
    taps: Taps,
    field: &ExactField,
    light: Light,
    point: DVec3,
) -> Result<Option<ProbedBound>> {
    let Some(shadow) = made.shadows.first() else { return Ok(None) };
    let Some(bound) = shadow.bound else { return Ok(None) };
    let space = &shadow.light_space;
    let (at, _) = space.light_point(point);
    let center = at.round();
    let last = DVec2::splat(f64::from(space.map_size) - 1.0);
    let is_in_map = center.cmpge(DVec2::ZERO).all() && center.cmple(last).all() && space.covers(center);
    if !is_in_map {
        return Ok(Some(ProbedBound { bound, nearest: None }));
    }
    let texels = [[center.x as u32, center.y as u32]];
    let test =
        RayTest { texels: &texels, taps, depths: DEPTHS, default_depth_mm: bound.depth_mm, nodes_mm: &[] };
    let query = |points: &[DVec3]| made.renderer.query(made.loaded, made.transfer, shadow, points);
    let mut nearest = None;
    test.visit(field, light, shadow, query, |report, _, _| {
        nearest = report.ray_err_max().zip(report.satisfied()).map(|(largest, satisfied)| NearestRay {
            texels_away: at.distance(center),
            largest,
            satisfied,
        });
    })?;
    Ok(Some(ProbedBound { bound, nearest }))
}
