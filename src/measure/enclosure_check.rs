//! Test of an enclosure (`enclose=on`): whether `L <= T_exact <= U` at points anywhere in a shadow map.
//!
//! Points lie on light rays inside the prisms of texels and close to their edges, where the rays of a texel differ most,
//! and around the depths where the exact curve bends. Where a ray grazes a surface, float32 rounding decides whether it
//! meets it. Points outside are therefore compared with a rounding envelope, as in [`bound_check`](super::bound_check).

use super::bound_check::EXACT_ROUNDING;
use super::exact_rays::{ExactRay, LightRay, tested_range};
use super::rays::mix;
use super::rounding_envelope::NearbyRays;
use super::test_depths::test_depths;
use crate::error::Result;
use crate::exact::ExactField;
use crate::render::Session;
use crate::scene::Light;
use crate::shadow::{Bound, Enclosure, ShadowMap};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Number of light rays whose exact transmittance curves are in memory at the same time.
const RAYS_AT_ONCE: usize = 512;
/// Number of light rays in the prism of each tested texel: half of them anywhere, half close to its edges.
const RAYS_A_TEXEL: usize = 8;
/// Distance from the axis of a prism to the rays close to its edges, in texels.
const EDGE: f64 = 0.499;

/// Result of testing an enclosure of the exact transmittance.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EnclosureReport {
    /// Number of points at which an enclosure was tested.
    pub points: usize,
    /// Number of points at which the exact transmittance lies outside the enclosure.
    pub violations: usize,
    /// Number of points at which the exact transmittance lies outside the enclosure, but the rounding envelope of the
    /// light ray meets it.
    pub limited: usize,
    /// Point with the largest distance of the exact transmittance from the enclosure.
    pub worst: Option<EnclosureViolation>,
}

/// Point at which the exact transmittance lies outside its enclosure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnclosureViolation {
    /// Position of the point, world mm.
    pub position_mm: DVec3,
    /// Lower and upper bound on the transmittance from the light to the point.
    pub enclosure: [f64; 2],
    /// Exact transmittance from the light to the point.
    pub t_exact: f64,
    /// Distance of the exact transmittance from the enclosure; infinite for NaN.
    pub amount: f64,
}

impl EnclosureReport {
    /// Merges the reports on two sets of points. Of two equal violations, the first is kept.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        let worst = match (self.worst, other.worst) {
            (Some(a), Some(b)) if b.amount > a.amount => Some(b),
            (a, b) => a.or(b),
        };
        Self {
            points: self.points + other.points,
            violations: self.violations + other.violations,
            limited: self.limited + other.limited,
            worst,
        }
    }

    /// Returns `enclosure_held`: whether the exact transmittance lies within the enclosure at every tested point;
    /// `None` without points.
    pub fn satisfied(&self) -> Option<bool> {
        (self.points > 0).then_some(self.violations == 0)
    }
}

/// Parameters for a test of an enclosure.
pub struct EnclosureTest<'a> {
    /// Column and row of each texel in whose prism points are tested.
    pub texels: &'a [[u32; 2]],
    /// Number of points in each prism.
    pub points_a_texel: usize,
}

/// Light ray in a prism with its exact curve, and the depths (mm) of the tested points.
struct TestedRay<'a> {
    ray: LightRay,
    curve: ExactRay<'a>,
    depths_mm: Vec<f64>,
}

impl EnclosureTest<'_> {
    /// Tests the enclosure of a shadow map. The report is empty for maps without one.
    ///
    /// # Errors
    /// The device is lost.
    pub fn run(
        &self,
        field: &ExactField,
        light: Light,
        session: &Session,
        shadow: &ShadowMap,
    ) -> Result<EnclosureReport> {
        let mut report = EnclosureReport::default();
        let Some(enclosure) = &shadow.enclosure else { return Ok(report) };
        let bound = enclosure.tolerances;
        let nearby = NearbyRays::new(field, bound);
        for texels in self.texels.chunks(RAYS_AT_ONCE / RAYS_A_TEXEL) {
            let rays = |texel: &[u32; 2]| self.rays_of(*texel, (field, light), shadow, bound);
            let rays: Vec<TestedRay<'_>> = texels.par_iter().flat_map_iter(rays).collect();
            let points: Vec<DVec3> =
                rays.iter().flat_map(|r| r.depths_mm.iter().map(|z| r.ray.at(*z))).collect();
            let found = enclosure.query(session, &points)?;
            let mut rest = &found[..];
            let mut own = Vec::with_capacity(rays.len());
            for ray in &rays {
                let (first, others) = rest.split_at(ray.depths_mm.len());
                own.push((ray, first));
                rest = others;
            }
            let reports: Vec<_> =
                own.into_par_iter().map(|(ray, found)| ray.report(found, &nearby)).collect();
            report = reports.into_iter().fold(report, EnclosureReport::merge);
        }
        Ok(report)
    }

    /// Returns the tested rays in the prism of a texel, in positions that a hash of the texel gives.
    fn rays_of<'f>(
        &self,
        texel: [u32; 2],
        (field, light): (&'f ExactField<'f>, Light),
        shadow: &ShadowMap,
        bound: Bound,
    ) -> Vec<TestedRay<'f>> {
        let space = &shadow.light_space;
        let seed = u64::from(texel[0]) << 32 | u64::from(texel[1]);
        let share = |k: usize| (mix(seed ^ mix(k as u64)) >> 11) as f64 / (1u64 << 53) as f64;
        let offset = |k: usize| {
            let any = 2.0 * DVec2::new(share(2 * k), share(2 * k + 1)) - 1.0;
            // One ray in four anywhere, one on an edge, and two on corners.
            EDGE * match k % 4 {
                0 => any,
                1 => any / any.abs().max_element(),
                _ => any.signum(),
            }
        };
        let centre = DVec2::new(f64::from(texel[0]), f64::from(texel[1]));
        let lines = (0..RAYS_A_TEXEL).map(|k| centre + offset(k)).filter(|at| space.covers(*at));
        let tested = |at: DVec2| {
            let ray = LightRay::new(space, light, at);
            let curve = ExactRay::new(field, ray);
            let [first, last] = tested_range([&curve].into_iter(), space.z_range, bound.depth_mm);
            let nearest = match light {
                Light::Point { .. } => ray.start_mm + bound.from_light_mm,
                Light::Directional { .. } => first,
            };
            let range = [first.max(nearest), last];
            let depths_mm =
                test_depths(range, &curve.jumps(), self.points_a_texel / RAYS_A_TEXEL, bound.depth_mm);
            TestedRay { ray, curve, depths_mm }
        };
        lines.map(tested).collect()
    }
}

impl TestedRay<'_> {
    /// Compares the enclosures of the points with their exact transmittances.
    fn report(&self, found: &[[f32; 2]], nearby: &NearbyRays<'_>) -> EnclosureReport {
        let outside = |[least, most]: [f64; 2], [low, high]: [f64; 2]| match low.is_nan() || high.is_nan() {
            true => f64::INFINITY,
            false => (low - most).max(least - high),
        };
        let mut report = EnclosureReport { points: found.len(), ..Default::default() };
        let mut envelope = None;
        for (z, found) in self.depths_mm.iter().zip(found) {
            let (enclosure, t_exact) = (found.map(f64::from), self.curve.transmittance(*z));
            let mut amount = outside([t_exact; 2], enclosure);
            if amount <= EXACT_ROUNDING {
                continue;
            }
            let around = envelope.get_or_insert_with(|| {
                let start_mm = self.ray.start_mm;
                nearby.envelope(self.ray.at(start_mm), self.ray.direction, start_mm, &self.depths_mm)
            });
            if let Some(around) = around {
                amount = outside([around.least(*z), around.most(*z)], enclosure);
            }
            let own = if amount > EXACT_ROUNDING {
                let violation =
                    EnclosureViolation { position_mm: self.ray.at(*z), enclosure, t_exact, amount };
                EnclosureReport { violations: 1, worst: Some(violation), ..Default::default() }
            } else {
                EnclosureReport { limited: 1, ..Default::default() }
            };
            report = report.merge(own);
        }
        report
    }
}

impl Enclosure {
    /// Returns the lower and the upper bound on the exact transmittance from the light to world points (mm).
    ///
    /// # Errors
    /// The device is lost.
    pub fn query(&self, session: &Session, points_mm: &[DVec3]) -> Result<Vec<[f32; 2]>> {
        let [lower, upper] = [&self.lower, &self.upper].map(|map| session.query(map, points_mm));
        Ok(lower?.into_iter().zip(upper?).map(<[f32; 2]>::from).collect())
    }
}
