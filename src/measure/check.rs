//! Sampling error of a shadow map whose light rays were marched by regular samples: compares random texels with the
//! same map marched cell by cell.
//!
//! Marching by samples has no error bound, because samples can miss details between them. Marching cell by cell has
//! no such error, so the difference is the error due to sampling.
//!
//! A texel is within tolerance if `T_cells(z + d) - t <= T_samples(z) <= T_cells(z - d) + t` at each of 24 depths
//! `z`. Here `d` is one step and `t` a tolerance in transmittance. Texels are drawn at random among those whose light
//! rays meet extinction. Depths are drawn at random, one in each of equal intervals of the map's depth range.
//!
//! If none of `n` texels exceeds the tolerance, then with 99 % confidence fewer than `4.6 / n` of such texels do. The
//! chance that `n` draws all miss a fraction `p` is `(1 - p)^n < exp(-p n)`. A deviation over a small part of the
//! depth range is found only if a depth falls there.

use crate::error::Result;
use crate::random::{mix, mix_to_unit};
use crate::render::Session;
use crate::scene::Scene;
use crate::shadow::{Method, ShadowMap};
use glam::{DVec2, DVec3};
use std::collections::HashSet;

/// Maximum number of shadow map texels at which marching light rays by regular samples is compared with marching cell
/// by cell.
const TEXELS: usize = 1024;
/// Number of shadow map texels drawn at random for the comparison of marching by samples and by cells. Texels without
/// extinction on the light ray are then discarded.
const DRAWN: usize = 8 * TEXELS;
/// Number of depths on each light ray at which the transmittances of marching by samples and by cells are compared.
const DEPTHS: usize = 24;
/// Allowed difference in transmittance between marching light rays by samples and by cells. If twice the method's
/// error bound is larger, that is allowed.
const TOLERANCE: f64 = 0.1;

/// Differences in transmittance between a shadow map marched by regular samples and the same map marched cell by
/// cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// Number of shadow map texels whose light rays were marched both by regular samples and cell by cell, to compare.
    pub texels: u64,
    /// Smallest tolerance in transmittance within which marching by samples agrees with marching by cells at all
    /// compared shadow map texels.
    pub max: f64,
    /// Largest difference in transmittance that is allowed between marching light rays by samples and by cells.
    pub tolerance: f64,
    /// Allowed displacement in depth between the transmittance curves of marching by samples and by cells, mm.
    pub depth_mm: f64,
}

impl Check {
    /// Whether the shadow map marched by samples agrees with the map marched by cells within the allowed difference
    /// in transmittance.
    pub fn ok(&self) -> bool {
        self.max <= self.tolerance
    }

    /// Merges the comparisons of marching by samples and by cells for two shadow maps. Texel counts add up; the other
    /// values come from the map with the larger difference relative to its tolerance.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        let share = |c: &Self| c.max / c.tolerance;
        let worse = if share(&other) > share(&self) { other } else { self };
        Self { texels: self.texels + other.texels, ..worse }
    }
}

/// Compares the shadow map of the scene's first light, marched by regular samples, with the same map marched cell by
/// cell. Returns `None` where the method does not march by samples, no drawn texel meets extinction, or the tolerance
/// in transmittance reaches 1.
///
/// # Errors
/// The adapter cannot store the shadow map, or the device is lost.
pub fn check(
    session: &Session,
    method: &dyn Method,
    shadow: &ShadowMap,
    scene: &Scene,
) -> Result<Option<Check>> {
    // Neither march follows the jumps of a gradient opacity exactly.
    let Some(cells) = method.by_cells().filter(|_| !session.transfer.has_gradient_opacity) else {
        return Ok(None);
    };
    let by_cells = session.shadow_of(cells.as_ref(), scene, scene.light())?;
    let space = &shadow.light_space;
    let depth_mm = space.step_mm;
    let [near, far] = space.z_range;
    let near = near.max(space.ray_start());
    let side = u64::from(space.map_size);
    let mut known = HashSet::new();
    let centre = |place: u64| DVec2::new((place % side) as f64, (place / side) as f64);
    let drawn = (0..DRAWN as u64)
        .map(|i| mix(i) % (side * side))
        .filter(|place| known.insert(*place) && space.covers(centre(*place)));
    let rays: Vec<_> = drawn.map(|place| space.world_ray(centre(place))).collect();
    // At the far end of a ray, transmittance is below 1 if the ray has met extinction.
    let ends: Vec<_> = rays.iter().map(|(start, along)| *start + *along * far).collect();
    let left = [session.query(shadow, &ends)?, session.query(&by_cells, &ends)?];
    let met = rays.iter().zip(left[0].iter().zip(&left[1])).filter(|(_, (a, b))| **a < 1.0 || **b < 1.0);
    let met: Vec<_> = met.map(|(ray, _)| *ray).take(TEXELS).collect();
    // Stratified depths: one at random in each of equal intervals.
    let depth = |ray: usize, k: usize| {
        let share = mix_to_unit((ray * DEPTHS + k) as u64);
        near + (far - near) * (k as f64 + share) / DEPTHS as f64
    };
    let points = |offset_mm: f64| -> Vec<_> {
        let on = |(i, (start, along)): (usize, &(DVec3, DVec3))| {
            let (start, along) = (*start, *along);
            (0..DEPTHS).map(move |k| start + along * (depth(i, k) + offset_mm).clamp(near, far))
        };
        met.iter().enumerate().flat_map(on).collect()
    };
    let sampled = session.query(shadow, &points(0.0))?;
    let before = session.query(&by_cells, &points(-depth_mm))?;
    let behind = session.query(&by_cells, &points(depth_mm))?;
    let outside =
        sampled.iter().zip(before.iter().zip(&behind)).map(|(t, (most, least))| (t - most).max(least - t));
    let own = by_cells.bound.map_or(0.0, |bound| bound.transmittance);
    let tolerance = TOLERANCE.max(2.0 * own);
    // A tolerance of 1 is always satisfied.
    Ok((!met.is_empty() && tolerance < 1.0).then(|| Check {
        texels: met.len() as u64,
        // NaN satisfies no tolerance.
        max: outside.map(|t| if t.is_nan() { f32::INFINITY } else { t }).fold(0.0, f32::max).into(),
        tolerance,
        depth_mm,
    }))
}
