//! The check of a map whose light rays were marched by regular samples: a random share of its texels compared with the same
//! map marched cell by cell.
//!
//! Samples have no error bound: what lies between two of them may be missed. But a method that is marched cell by cell is as
//! good as it can be, and so the difference is what the samples have cost. A texel is within tolerance where at each of 24
//! depths `T_cells(z + d) - t <= T_samples(z) <= T_cells(z - d) + t`, with `d` a step and `t` a tolerance in transmittance.
//! Texels are drawn by chance among those that meet extinction, and depths by chance in even stretches of the map's range.
//! Where none of `n` texels strays further, with 99 % confidence fewer than `4.6 / n` of such draws do: the chance of `n`
//! misses of a share `p` is `(1 - p)^n < exp(-p n)`. What strays over a small part of the range alone is found as often as a
//! depth falls there.

use super::rays::mix;
use crate::error::Result;
use crate::render::Session;
use crate::scene::Scene;
use crate::shadow::{Method, ShadowMap};
use glam::{DVec2, DVec3};
use std::collections::HashSet;

/// Texels that are compared with cells.
const TEXELS: usize = 1024;
/// Number of texels drawn, more than needed because rays without extinction are no test.
const DRAWN: usize = 8 * TEXELS;
/// Number of depths on each checked ray.
const DEPTHS: usize = 24;
/// Tolerance in transmittance, unless two maps of the method may be further apart whatever marches.
const TOLERANCE: f64 = 0.1;

/// Result of a check of a built shadow map against one marched by cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// Texels that meet extinction and were compared with cells.
    pub texels: u64,
    /// Smallest tolerance in transmittance that all tested texels satisfy.
    pub max: f64,
    /// The tolerance that is stated.
    pub tolerance: f64,
    /// Distance along the ray by which curves may be apart, mm.
    pub depth_mm: f64,
}

impl Check {
    /// Whether the stated tolerance is satisfied.
    pub fn ok(&self) -> bool {
        self.max <= self.tolerance
    }

    /// Merges two reports: counts add up, and the figures are those of the texel with the largest deviation relative
    /// to its tolerance.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        let share = |c: &Self| c.max / c.tolerance;
        let worse = if share(&other) > share(&self) { other } else { self };
        Self { texels: self.texels + other.texels, ..worse }
    }
}

/// Holds a built map of a scene's first light against its own by cells; `None` where its rays were marched by cells, or not at
/// all, or where none
/// of the texels drawn meets any extinction, or two maps of the method may be apart by any amount.
///
/// # Errors
/// A map that the adapter cannot hold, or a lost device.
pub fn check(
    session: &Session,
    method: &dyn Method,
    shadow: &ShadowMap,
    scene: &Scene,
) -> Result<Option<Check>> {
    let Some(cells) = method.by_cells() else { return Ok(None) };
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
    // Behind everything, light is missing where a ray has met something.
    let ends: Vec<_> = rays.iter().map(|(start, along)| *start + *along * far).collect();
    let left = [session.query(shadow, &ends)?, session.query(&by_cells, &ends)?];
    let met = rays.iter().zip(left[0].iter().zip(&left[1])).filter(|(_, (a, b))| **a < 1.0 || **b < 1.0);
    let met: Vec<_> = met.map(|(ray, _)| *ray).take(TEXELS).collect();
    // Depths are spread evenly, and chance has its place between two of them.
    let depth = |ray: usize, k: usize| {
        let share = (mix((ray * DEPTHS + k) as u64) >> 11) as f64 / (1u64 << 53) as f64;
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
    // A tolerance of 1 holds whatever the map says.
    Ok((!met.is_empty() && tolerance < 1.0).then(|| Check {
        texels: met.len() as u64,
        // What is no number is within no tolerance.
        max: outside.map(|t| if t.is_nan() { f32::INFINITY } else { t }).fold(0.0, f32::max).into(),
        tolerance,
        depth_mm,
    }))
}
