//! What a method promises, tried on the one light ray that it speaks of close to a point.

use super::device::Prepared;
use super::messages::{NearestRay, ProbedPromise};
use crate::error::Result;
use crate::exact::ExactField;
use crate::measure::errors::RayTest;
use crate::scene::Light;
use crate::shadow::Taps;
use glam::{DVec2, DVec3};

/// Depths of the ray that are tested, besides those around what it meets.
const DEPTHS: usize = 200;

/// Tries the promise of what was prepared for one light, whose texels stand for `taps`, close to a point (world mm); `None`
/// where nothing is promised.
///
/// # Errors
/// A lost device.
pub fn tried(
    made: &Prepared<'_>,
    taps: Taps,
    field: &ExactField,
    light: Light,
    point: DVec3,
) -> Result<Option<ProbedPromise>> {
    let Some(shadow) = made.shadows.first() else { return Ok(None) };
    let Some(bound) = shadow.bound else { return Ok(None) };
    let space = &shadow.light_space;
    let (at, _) = space.light_point(point);
    let center = at.round();
    let last = DVec2::splat(f64::from(space.map_size) - 1.0);
    let is_there = center.cmpge(DVec2::ZERO).all() && center.cmple(last).all() && space.covers(center);
    if !is_there {
        return Ok(Some(ProbedPromise { bound, nearest: None }));
    }
    let texels = [[center.x as u32, center.y as u32]];
    let test =
        RayTest { texels: &texels, taps, depths: DEPTHS, default_depth_mm: bound.depth_mm, nodes_mm: &[] };
    let query = |points: &[DVec3]| made.renderer.query(made.loaded, made.transfer, shadow, points);
    let mut nearest = None;
    test.visit_asking(field, light, shadow, query, |report, _, _| {
        nearest = report.ray_err_max().zip(report.held()).map(|(largest, kept)| NearestRay {
            texels_away: at.distance(center),
            largest,
            kept,
        });
    })?;
    Ok(Some(ProbedPromise { bound, nearest }))
}
