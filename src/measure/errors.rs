//! Transmittance errors of a built shadow structure against the exact field: at points that the camera sees, and
//! along light rays through texel centres.

use super::bound_check::BoundReport;
use super::rays::pick_texels;
use super::rounding_envelope::{NearbyRays, RoundingEnvelope};
use super::stats::ErrorStats;
use super::test_depths::{sort_distinct, test_depths};
use crate::error::Result;
use crate::exact::{ExactField, OpticalDepthCurve, VisiblePoint};
use crate::render::Session;
use crate::scene::{Light, LightSource, Scene};
use crate::shadow::{LightSpace, ShadowMap, Taps};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Every run tests the same points.
const SEED: u64 = 1;
/// Rays whose exact curves are in memory at once; each takes tens of kilobytes.
const RAYS_AT_ONCE: usize = 256;
/// Texels a side that are tested for meeting anything; on larger maps one stands for a block.
const MOST_TESTED_TEXELS: u32 = 512;
/// Share of the map's depth range by which a ray is tested before and behind what it meets.
const MARGIN: f64 = 0.02;

/// Visible points with the exact transmittance from the light to each.
pub struct VisiblePoints {
    points_mm: Vec<DVec3>,
    weights: Vec<f64>,
    exact: Vec<f64>,
}

impl VisiblePoints {
    /// About `count` points, under a scene's first light; fewer, or none, where the camera sees little.
    pub fn new(field: &ExactField, scene: &Scene, count: usize) -> Self {
        Self::of(field, &field.visible_points(scene, count, SEED), scene.light())
    }

    fn of(field: &ExactField, points: &[VisiblePoint], light: Light) -> Self {
        let to_light = |p: &DVec3| field.transmittance_to_light(*p, &light);
        let points_mm: Vec<_> = points.iter().map(|p| p.position).collect();
        let exact = points_mm.par_iter().map(to_light).collect();
        Self { points_mm, weights: points.iter().map(|p| p.weight).collect(), exact }
    }

    /// Returns the first `count` points, or all points if there are fewer.
    pub fn first(&self, count: usize) -> Self {
        let n = self.len().min(count);
        let [weights, exact] = [&self.weights, &self.exact].map(|values| values[..n].to_vec());
        Self { points_mm: self.points_mm[..n].to_vec(), weights, exact }
    }

    /// Copy of the points with another exact transmittance at each.
    pub fn with_exact(&self, exact: Vec<f64>) -> Self {
        Self { points_mm: self.points_mm.clone(), weights: self.weights.clone(), exact }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points_mm.len()
    }

    /// Positions of the points, world mm.
    pub fn points_mm(&self) -> &[DVec3] {
        &self.points_mm
    }

    /// Weights of the visible points in error statistics.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Exact transmittance from the light to each point.
    pub fn exact(&self) -> &[f64] {
        &self.exact
    }

    /// Whether the camera sees nothing.
    pub fn is_empty(&self) -> bool {
        self.points_mm.is_empty()
    }

    /// `T_method - T_exact` over the points, weighted as the camera sees them; `None` where it sees nothing.
    ///
    /// # Errors
    /// A lost device.
    pub fn errors(&self, session: &Session, shadow: &ShadowMap) -> Result<Option<ErrorStats>> {
        ErrorStats::of(self.weighted(session, shadow)?)
    }

    /// Errors at the points, with their weights.
    fn weighted(&self, session: &Session, shadow: &ShadowMap) -> Result<Vec<(f64, f64)>> {
        let values = session.query(shadow, &self.points_mm)?;
        let error = |(value, exact): (&f32, &f64)| f64::from(*value) - exact;
        Ok(values.iter().zip(&self.exact).map(error).zip(self.weights.iter().copied()).collect())
    }
}

/// Visible points, divided among the lights that shine; the points of each light are spread over the whole picture.
pub struct VisiblePointsByLight(Vec<VisiblePoints>);

impl VisiblePointsByLight {
    /// Chooses about `count` points in total, or fewer where the camera sees little.
    pub fn new(field: &ExactField, scene: &Scene, count: usize) -> Self {
        let points = field.visible_points(scene, count, SEED);
        let lights = scene.shining();
        // Any stretch of the sequence that points are from is spread evenly.
        let place = |i: usize| i * points.len() / lights.len();
        let part = |(i, source): (usize, &LightSource)| {
            VisiblePoints::of(field, &points[place(i)..place(i + 1)], source.light)
        };
        Self(lights.iter().enumerate().map(part).collect())
    }

    /// Number of points.
    pub fn count(&self) -> usize {
        self.0.iter().map(VisiblePoints::len).sum()
    }

    /// Points for each light.
    pub fn parts(&self) -> &[VisiblePoints] {
        &self.0
    }

    /// Errors like [`VisiblePoints::errors`], over all lights together, whose structures are in their order.
    ///
    /// # Errors
    /// See [`VisiblePoints::errors`].
    pub fn errors(&self, session: &Session, shadows: &[ShadowMap]) -> Result<Option<ErrorStats>> {
        let mut all = Vec::with_capacity(self.count());
        for (part, shadow) in self.0.iter().zip(shadows) {
            all.append(&mut part.weighted(session, shadow)?);
        }
        ErrorStats::of(all)
    }
}

/// Texels of a map whose light rays are to be tested, spread over what they meet; see [`pick_texels`].
pub fn texels_to_test(
    field: &ExactField,
    light: Light,
    light_space: &LightSpace,
    count: usize,
) -> Vec<[u32; 2]> {
    let map = light_space.map_size;
    let block = map.div_ceil(MOST_TESTED_TEXELS).max(1);
    let blocks = map.div_ceil(block);
    let met: Vec<bool> = (0..blocks * blocks)
        .into_par_iter()
        .map(|i| {
            let texel = DVec2::new(f64::from(i % blocks), f64::from(i / blocks)) + 0.5;
            let texel = texel * f64::from(block) - 0.5;
            light_space.covers(texel) && meets_extinction(field, light, light_space, texel)
        })
        .collect();
    let picked = pick_texels(map, count, |column, row| met[(row / block * blocks + column / block) as usize]);
    let covered = |t: &[u32; 2]| light_space.covers(DVec2::new(f64::from(t[0]), f64::from(t[1])));
    picked.into_iter().filter(covered).collect()
}

/// Whether the light ray through texel coordinates meets any extinction.
pub fn meets_extinction(field: &ExactField, light: Light, light_space: &LightSpace, texel: DVec2) -> bool {
    let ray = LightRay::new(light_space, light, texel);
    field.meets_extinction(ray.at(ray.start_mm), ray.direction, f64::INFINITY)
}

/// A tested map: its texels, the rays in each, and the depths on each ray.
pub struct RayTest<'a> {
    /// Column and row of each texel.
    pub texels: &'a [[u32; 2]],
    /// Rays whose mean a texel stands for.
    pub taps: Taps,
    /// Depths a ray.
    pub depths: usize,
    /// Depth tolerance that the depths are crowded by where the method has no error bound, mm.
    pub default_depth_mm: f64,
    /// Further test depths of each texel's ray (mm), in the order of the texels; of every one or of none.
    pub nodes_mm: &'a [Vec<f64>],
}

impl RayTest<'_> {
    /// Compares the method with the exact curve of each texel; the `ray` of a deviation is an index into `texels`.
    ///
    /// # Errors
    /// A lost device.
    pub fn run(
        &self,
        field: &ExactField,
        light: Light,
        session: &Session,
        shadow: &ShadowMap,
    ) -> Result<BoundReport> {
        let mut report = BoundReport::default();
        let query = |points: &[DVec3]| session.query(shadow, points);
        self.visit(field, light, shadow, query, |own, _, _| report = report.merge(own))?;
        Ok(report)
    }

    /// Hands the report, depths (mm, ascending) and values of each ray to `visit`, for a method whose transmittance at
    /// points (world mm) is given by `query`.
    ///
    /// # Errors
    /// Those of `query`.
    pub fn visit(
        &self,
        field: &ExactField,
        light: Light,
        shadow: &ShadowMap,
        query: impl Fn(&[DVec3]) -> Result<Vec<f32>>,
        mut visit: impl FnMut(BoundReport, &[f64], &[f32]),
    ) -> Result<()> {
        let bound = shadow.bound;
        let nearby = NearbyRays::new(field, bound.unwrap_or_default());
        let from_light_mm = bound.map_or(0.0, |b| b.from_light_mm);
        let tolerance_mm = bound.map_or(self.default_depth_mm, |b| b.depth_mm);
        let space = &shadow.light_space;
        for (chunk, texels) in self.texels.chunks(RAYS_AT_ONCE).enumerate() {
            let rays: Vec<(Vec<ExactRay>, Vec<f64>)> = texels
                .par_iter()
                .enumerate()
                .map(|(i, &[column, row])| {
                    let center = DVec2::new(f64::from(column), f64::from(row));
                    let curves: Vec<_> = tap_offsets(self.taps)
                        .into_iter()
                        .map(|offset| ExactRay::new(field, LightRay::new(space, light, center + offset)))
                        .collect();
                    let [first, last] = tested_range(&curves, space.z_range, tolerance_mm);
                    let nearest = match light {
                        Light::Point { .. } => LightRay::new(space, light, center).start_mm + from_light_mm,
                        Light::Directional { .. } => first,
                    };
                    let range = [first.max(nearest), last];
                    let mut jumps: Vec<_> = curves.iter().flat_map(ExactRay::jumps).collect();
                    jumps.sort_by(f64::total_cmp);
                    let mut depths = test_depths(range, &jumps, self.depths, tolerance_mm);
                    if let Some(nodes) = self.nodes_mm.get(chunk * RAYS_AT_ONCE + i) {
                        depths.extend(nodes.iter().filter(|z| (range[0]..=range[1]).contains(*z)));
                        sort_distinct(&mut depths);
                    }
                    (curves, depths)
                })
                .collect();
            let points_mm: Vec<_> = texels
                .iter()
                .zip(&rays)
                .flat_map(|(&[column, row], (_, depths))| {
                    let center = DVec2::new(f64::from(column), f64::from(row));
                    let ray = LightRay::new(space, light, center);
                    depths.iter().map(move |&z| ray.at(z))
                })
                .collect();
            let values = query(&points_mm)?;
            let mut rest = &values[..];
            for (i, (exact, depths)) in rays.iter().enumerate() {
                let (own, others) = rest.split_at(depths.len());
                rest = others;
                let ray = chunk * RAYS_AT_ONCE + i;
                let [column, row] = texels[i].map(f64::from);
                let envelope = |known: Vec<f64>| {
                    let around = |offset| {
                        let ray = LightRay::new(space, light, DVec2::new(column, row) + offset);
                        nearby.envelope(ray.at(ray.start_mm), ray.direction, ray.start_mm, &known)
                    };
                    let all: Option<Vec<_>> = tap_offsets(self.taps).into_iter().map(around).collect();
                    all.map(RoundingEnvelope::mean)
                };
                let mean = |z| exact.iter().map(|ray| ray.transmittance(z)).sum::<f64>() / exact.len() as f64;
                let report = BoundReport::of_ray(ray, &mean, depths, own, bound, envelope);
                visit(report, depths, own);
            }
        }
        Ok(())
    }
}

/// A light ray: world points by the map's depth.
#[derive(Clone, Copy)]
struct LightRay {
    /// World point of depth 0, mm.
    origin: DVec3,
    /// Away from the light.
    direction: DVec3,
    /// Depth of the light, or one before anything a light at infinity can meet.
    start_mm: f64,
}

impl LightRay {
    fn new(space: &LightSpace, light: Light, texel: DVec2) -> Self {
        let (origin, direction) = space.world_ray(texel);
        let start_mm = match light {
            Light::Point { position } => (position - origin).dot(direction),
            // The map's range may be that of active bricks only; the exact ray takes nobody's word for it.
            Light::Directional { .. } => space.z_range[0] - BEFORE_ANYTHING_MM,
        };
        Self { origin, direction, start_mm }
    }

    fn at(&self, depth_mm: f64) -> DVec3 {
        self.origin + depth_mm * self.direction
    }
}

/// Farther than any volume reaches before the first active brick; f64 has digits to spare for it.
const BEFORE_ANYTHING_MM: f64 = 1e5;

/// The exact curve of a light ray, by the map's depth.
struct ExactRay<'a> {
    curve: OpticalDepthCurve<'a>,
    start_mm: f64,
}

impl<'a> ExactRay<'a> {
    fn new(field: &'a ExactField, ray: LightRay) -> Self {
        let curve = field.curve_along(ray.at(ray.start_mm), ray.direction, f64::INFINITY);
        Self { curve, start_mm: ray.start_mm }
    }

    fn jumps(&self) -> Vec<f64> {
        self.curve.jumps().into_iter().map(|z| z + self.start_mm).collect()
    }

    fn transmittance(&self, z: f64) -> f64 {
        self.curve.transmittance_at(z - self.start_mm)
    }
}

/// Depths from a little before the first thing met to a little behind the last, within the map's range; the whole
/// range where nothing is met.
fn tested_range(curves: &[ExactRay], [z_min, z_max]: [f64; 2], tolerance_mm: f64) -> [f64; 2] {
    let start = curves.iter().map(|c| c.start_mm).fold(z_min, f64::max);
    let margin = MARGIN * (z_max - z_min) + 2.0 * tolerance_mm;
    let jumps = curves.iter().map(ExactRay::jumps).filter(|j| !j.is_empty());
    let met = jumps.map(|j| [j[0], j[j.len() - 1]]).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    match met {
        Some([first, last]) => [(first - margin).max(start), (last + margin).min(z_max)],
        None => [start, z_max],
    }
}

/// Offsets of the rays of a texel from its centre, in texels.
fn tap_offsets(taps: Taps) -> Vec<DVec2> {
    let grid = |n: u32, spacing: f64| {
        let half = 0.5 * f64::from(n - 1);
        let at = move |i: u32| DVec2::new(f64::from(i % n) - half, f64::from(i / n) - half) * spacing;
        (0..n * n).map(at).collect::<Vec<_>>()
    };
    match taps {
        Taps::Within(9) => grid(3, 1.0 / 3.0),
        Taps::Within(5) => [vec![DVec2::ZERO], grid(2, 0.5)].concat(),
        Taps::Within(_) => vec![DVec2::ZERO],
        Taps::Texels(side) => grid(side, 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_are_spread_evenly_around_the_centre() {
        for (taps, count, reach) in [
            (Taps::Within(1), 1, 0.0),
            (Taps::Within(5), 5, 0.25),
            (Taps::Within(9), 9, 1.0 / 3.0),
            (Taps::Texels(1), 1, 0.0),
            (Taps::Texels(3), 9, 1.0),
        ] {
            let offsets = tap_offsets(taps);
            assert_eq!(offsets.len(), count);
            assert!(offsets.iter().sum::<DVec2>().length() < 1e-12);
            let farthest = offsets.iter().map(|o| o.abs().max_element()).fold(0.0, f64::max);
            assert!((farthest - reach).abs() < 1e-12, "{taps:?}");
        }
    }
}
