//! Test of an enclosure (`enclose=on`): whether `L <= T_exact <= U` at points anywhere in a shadow map.
//!
//! Points lie on light rays inside the prisms of texels and close to their edges, where the rays of a texel differ most,
//! and around the depths where the exact curve bends. Where a ray grazes a surface, float32 rounding decides whether it
//! meets it. Points outside are therefore compared with a rounding envelope, as in [`bound_check`](super::bound_check).

use super::exact_rays::{ExactRay, LightRay, tested_range};
use super::point_report::{PointReport, PointViolation, distance};
use super::rounding_envelope::NearbyRays;
use super::test_depths::test_depths;
use crate::error::Result;
use crate::exact::ExactField;
use crate::random::{mix, mix_to_unit};
use crate::render::Session;
use crate::scene::Light;
use crate::shadow::{Bound, Enclosure, ShadowMap};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Number of light rays whose exact transmittance curves are in memory at the same time.
const RAYS_AT_ONCE: usize = 512;
/// Number of light rays in the prism of each tested texel: a quarter of them anywhere, a quarter close to its sides, half
/// close to its edges.
const RAYS_A_TEXEL: usize = 8;
/// Distance from the axis of a prism to the rays close to its sides and edges, along columns or rows, in texels.
const EDGE: f64 = 0.499;

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
    ) -> Result<PointReport> {
        let mut report = PointReport::default();
        let Some(enclosure) = &shadow.enclosure else { return Ok(report) };
        let bound = enclosure.tolerances;
        let nearby = NearbyRays::new(field, bound);
        for texels in self.texels.chunks(RAYS_AT_ONCE / RAYS_A_TEXEL) {
            let rays = |texel: &[u32; 2]| self.rays_of(*texel, (field, light), shadow, bound);
            let rays: Vec<TestedRay<'_>> = texels.par_iter().flat_map_iter(rays).collect();
            let points: Vec<DVec3> =
                rays.iter().flat_map(|r| r.depths_mm.iter().map(|z| r.ray.at(*z))).collect();
            let found = enclosure.query(session, &points)?;
            let points_of = |ray: &TestedRay<'_>| ray.depths_mm.len();
            let of = |ray: &TestedRay<'_>, found: &[[f32; 2]]| ray.report(found, &nearby);
            report = report.merge(PointReport::of_all(&rays, &found, points_of, of));
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
        let share = |k: usize| mix_to_unit(seed ^ mix(k as u64));
        let offset = |k: usize| {
            let any = 2.0 * DVec2::new(share(2 * k), share(2 * k + 1)) - 1.0;
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
    fn report(&self, found: &[[f32; 2]], nearby: &NearbyRays<'_>) -> PointReport {
        let mut report = PointReport::of(found.len());
        let mut envelope = None;
        for (z, found) in self.depths_mm.iter().zip(found) {
            let (interval, t_exact) = (found.map(f64::from), self.curve.transmittance(*z));
            let mut amount = distance([t_exact; 2], interval);
            if report.records_inside(amount) {
                continue;
            }
            let around = envelope.get_or_insert_with(|| {
                let start_mm = self.ray.start_mm;
                nearby.envelope(self.ray.at(start_mm), self.ray.direction, start_mm, &self.depths_mm)
            });
            if let Some(around) = around {
                amount = distance([around.least(*z), around.most(*z)], interval);
            }
            let position_mm = self.ray.at(*z);
            report.count(PointViolation { position_mm, transmittance: t_exact, interval, amount });
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
