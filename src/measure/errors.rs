//! Measurement of a shadow map's transmittance errors against exact float64 transmittance, at visible points and
//! along light rays through texel centres.

use super::bound_check::BoundReport;
use super::exact_rays::{ExactRay, LightRay, tap_offsets, tested_range};
use super::rays::pick_texels;
use super::rounding_envelope::{NearbyRays, RoundingEnvelope};
use super::stats::ErrorStats;
use super::test_depths::{sort_distinct, test_depths};
use crate::error::Result;
use crate::exact::{ExactField, VisiblePoint};
use crate::render::Session;
use crate::scene::{Light, LightSource, Scene};
use crate::shadow::{Enclosure, LightSpace, ShadowMap, Taps, split_samples};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::borrow::Borrow;

/// Seed for the random choice of points visible to the camera. It is fixed; every run measures errors at the same
/// points.
const SEED: u64 = 1;
/// Number of light rays whose exact transmittance curves are in memory at the same time; each takes tens of
/// kilobytes.
const RAYS_AT_ONCE: usize = 256;
/// Maximum number of texels per side that are tested for extinction on their light rays. In larger shadow maps, one
/// texel represents a block.
const MOST_TESTED_TEXELS: u32 = 512;

/// Points at which errors of shadow methods are measured: visible to the camera, each with its exact transmittance
/// from the light.
pub struct VisiblePoints {
    points_mm: Vec<DVec3>,
    weights: Vec<f64>,
    exact: Vec<f64>,
    /// Root mean square of the standard errors of the exact transmittances: 0 for a light without a size.
    exact_error: f64,
    /// Number of samples of the light, for which its shadow maps answer.
    samples: usize,
    /// Whether the light has a size.
    is_soft: bool,
}

impl VisiblePoints {
    /// Chooses about `count` points visible to the camera and computes the exact transmittance from the scene's first
    /// light to each. Fewer points, or none, are chosen where little is visible.
    pub fn new(field: &ExactField, scene: &Scene, count: usize) -> Self {
        let source = scene.lights.first().cloned().unwrap_or_default();
        Self::of(field, &field.visible_points(scene, count, SEED), &source)
    }

    fn of(field: &ExactField, points: &[VisiblePoint], source: &LightSource) -> Self {
        let points_mm: Vec<_> = points.iter().map(|p| p.position).collect();
        let (exact, exact_error) = field.transmittances_from(&points_mm, source);
        let weights = points.iter().map(|p| p.weight).collect();
        Self {
            points_mm,
            weights,
            exact,
            exact_error,
            samples: source.sample_count(),
            is_soft: source.is_soft(),
        }
    }

    /// Returns the first `count` points of a list of points visible to the camera, or all if there are fewer.
    pub fn first(&self, count: usize) -> Self {
        let n = self.len().min(count);
        let [weights, exact] = [&self.weights, &self.exact].map(|values| values[..n].to_vec());
        Self { points_mm: self.points_mm[..n].to_vec(), weights, exact, ..*self }
    }

    /// Returns a copy of the points visible to the camera with other values of exact transmittance.
    pub fn with_exact(&self, exact: Vec<f64>) -> Self {
        Self { points_mm: self.points_mm.clone(), weights: self.weights.clone(), exact, ..*self }
    }

    /// Number of points visible to the camera at which shadow errors are measured.
    pub fn len(&self) -> usize {
        self.points_mm.len()
    }

    /// Positions of the points at which shadow errors are measured, all visible to the camera, world mm.
    pub fn points_mm(&self) -> &[DVec3] {
        &self.points_mm
    }

    /// Weights, by visibility to the camera, of the points at which shadow errors are measured.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Exact transmittance from the light to each of the points visible to the camera.
    pub fn exact(&self) -> &[f64] {
        &self.exact
    }

    /// Whether the light has a size, so that exact transmittances are means over it.
    pub fn is_soft(&self) -> bool {
        self.is_soft
    }

    /// Whether there is no point visible to the camera at which shadow errors could be measured.
    pub fn is_empty(&self) -> bool {
        self.points_mm.is_empty()
    }

    /// Returns statistics of the transmittance errors `T_method - T_exact` over the points visible to the camera,
    /// weighted by visibility; `None` where no point is visible. `shadows` are the shadow maps of the light: one, or as
    /// many as it has samples.
    ///
    /// # Errors
    /// The device is lost.
    pub fn errors(&self, session: &Session, shadows: &[ShadowMap]) -> Result<Option<ErrorStats>> {
        ErrorStats::of(self.weighted(session, shadows)?)
    }

    /// Returns the widths of an enclosure at the points visible to the camera, each with the point's weight.
    fn widths(&self, session: &Session, enclosure: &Enclosure) -> Result<Vec<(f64, f64)>> {
        let found = enclosure.query(session, &self.points_mm)?;
        let widths = found.iter().map(|[lower, upper]| f64::from(upper - lower));
        Ok(widths.zip(self.weights.iter().copied()).collect())
    }

    /// Returns the transmittance error `T_method - T_exact` at each point visible to the camera, with the point's
    /// weight.
    ///
    /// # Errors
    /// The device is lost.
    pub fn weighted(&self, session: &Session, shadows: &[ShadowMap]) -> Result<Vec<(f64, f64)>> {
        let values = self.transmittances(session, shadows)?;
        let errors = values.iter().zip(&self.exact).map(|(value, exact)| value - exact);
        Ok(errors.zip(self.weights.iter().copied()).collect())
    }

    fn transmittances(&self, session: &Session, shadows: &[ShadowMap]) -> Result<Vec<f64>> {
        mean_of_maps(shadows, &self.points_mm, |map, points| session.query(map, points))
    }
}

/// Points visible to the camera at which shadow errors are measured, divided among the lights with nonzero intensity.
/// The points of each light are spread over the whole picture.
pub struct VisiblePointsByLight(Vec<VisiblePoints>);

impl VisiblePointsByLight {
    /// Chooses about `count` points visible to the camera, as the total over all lights. Fewer points are chosen
    /// where the camera sees little.
    pub fn new(field: &ExactField, scene: &Scene, count: usize) -> Self {
        let points = field.visible_points(scene, count, SEED);
        let lights = scene.sources_shining();
        // The points come from a low-discrepancy sequence, any section of which is evenly distributed.
        let place = |i: usize| i * points.len() / lights.len();
        let part = |(i, source): (usize, &LightSource)| {
            VisiblePoints::of(field, &points[place(i)..place(i + 1)], source)
        };
        Self(lights.iter().enumerate().map(part).collect())
    }

    /// Number of points visible to the camera at which shadow errors are measured, over all lights.
    pub fn count(&self) -> usize {
        self.0.iter().map(VisiblePoints::len).sum()
    }

    /// Points visible to the camera at which shadow errors are measured, for each light.
    pub fn parts(&self) -> &[VisiblePoints] {
        &self.0
    }

    /// Returns statistics of the transmittance errors `T_method - T_exact` at the visible points of all lights
    /// together. `shadows` are the shadow maps of the lights, in order.
    ///
    /// # Errors
    /// See [`VisiblePoints::errors`].
    pub fn errors(&self, session: &Session, shadows: &[ShadowMap]) -> Result<Option<ErrorStats>> {
        ErrorStats::of(self.weighted(session, shadows)?)
    }

    /// Returns the transmittance error `T_method - T_exact` at the visible points of all lights, with their weights.
    /// `shadows` are the shadow maps of the lights, in order.
    ///
    /// # Errors
    /// See [`VisiblePoints::weighted`].
    pub fn weighted(&self, session: &Session, shadows: &[ShadowMap]) -> Result<Vec<(f64, f64)>> {
        let mut all = Vec::with_capacity(self.count());
        for (part, shadows) in self.with_maps(shadows) {
            all.append(&mut part.weighted(session, shadows)?);
        }
        Ok(all)
    }

    /// Returns the transmittances by shadow maps at the visible points of all lights. `shadows` are the maps of the lights,
    /// in order.
    ///
    /// # Errors
    /// The device is lost.
    pub fn transmittances(&self, session: &Session, shadows: &[ShadowMap]) -> Result<Vec<f64>> {
        let mut all = Vec::with_capacity(self.count());
        for (part, shadows) in self.with_maps(shadows) {
            all.extend(part.transmittances(session, shadows)?);
        }
        Ok(all)
    }

    /// Returns the first points of each light, about `count` over all lights.
    pub fn first(&self, count: usize) -> Self {
        let each = count.div_ceil(self.0.len().max(1));
        Self(self.0.iter().map(|part| part.first(each)).collect())
    }

    /// Returns the points of each light with the shadow maps of its samples.
    fn with_maps<'s>(
        &'s self,
        shadows: &'s [ShadowMap],
    ) -> impl Iterator<Item = (&'s VisiblePoints, &'s [ShadowMap])> {
        let mut rest = shadows;
        self.0.iter().map(move |part| {
            let (maps, others) = split_samples(rest, part.samples);
            rest = others;
            (part, maps)
        })
    }

    /// Returns the root mean square of the standard errors of the exact transmittances, the largest of all lights: 0
    /// without a light that has a size.
    pub fn exact_error(&self) -> f64 {
        self.0.iter().map(|part| part.exact_error).fold(0.0, f64::max)
    }

    /// Returns statistics of the widths of the enclosures at the visible points of all lights together; `None` unless
    /// all of their shadow maps have one and no light has a size.
    ///
    /// # Errors
    /// See [`VisiblePoints::errors`].
    pub fn enclosure_widths(&self, session: &Session, shadows: &[ShadowMap]) -> Result<Option<ErrorStats>> {
        let mut all = Vec::with_capacity(self.count());
        for (part, maps) in self.with_maps(shadows) {
            let [ShadowMap { enclosure: Some(enclosure), .. }] = maps else { return Ok(None) };
            if part.is_soft {
                return Ok(None);
            }
            all.append(&mut part.widths(session, enclosure)?);
        }
        ErrorStats::of(all)
    }
}

/// Returns the transmittance from a light at points (world mm): the mean of the answers of its shadow maps, one for each
/// sample of a light with a size or one for all. Without maps it is 1.
///
/// # Errors
/// A query fails.
pub fn mean_of_maps<Map: Borrow<ShadowMap>>(
    maps: &[Map],
    points_mm: &[DVec3],
    query: impl Fn(&ShadowMap, &[DVec3]) -> Result<Vec<f32>>,
) -> Result<Vec<f64>> {
    if maps.is_empty() {
        return Ok(vec![1.0; points_mm.len()]);
    }
    let mut sums = vec![0.0; points_mm.len()];
    for map in maps {
        let found = query(map.borrow(), points_mm)?;
        sums.iter_mut().zip(found).for_each(|(sum, t)| *sum += f64::from(t));
    }
    Ok(sums.into_iter().map(|sum| sum / maps.len() as f64).collect())
}

/// Chooses the shadow map texels on whose light rays transmittance is tested, spread over the rays that meet
/// extinction; see [`pick_texels`].
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

/// Whether the light ray through a position on the shadow map (in texels) meets any extinction in the volume.
pub fn meets_extinction(field: &ExactField, light: Light, light_space: &LightSpace, texel: DVec2) -> bool {
    let ray = LightRay::new(light_space, light, texel);
    field.meets_extinction(ray.at(ray.start_mm), ray.direction, f64::INFINITY)
}

/// Parameters for a test of a shadow map against exact transmittance along light rays: texels, and depths on each
/// ray.
pub struct RayTest<'a> {
    /// Column and row of each shadow map texel whose light ray is tested.
    pub texels: &'a [[u32; 2]],
    /// Number and placement of the light rays that the shadow map's pre-filter averages in each texel.
    pub taps: Taps,
    /// Number of depths at which transmittance is tested on each light ray, apart from `nodes_mm`.
    pub depths: usize,
    /// Tolerance in depth for placing test depths around jumps of transmittance, for shadow methods without an error
    /// bound, mm.
    pub default_depth_mm: f64,
    /// Additional depths at which transmittance is tested on each texel's light ray, mm, in the order of `texels`.
    /// Empty if there are none.
    pub nodes_mm: &'a [Vec<f64>],
}

impl RayTest<'_> {
    /// Compares the transmittance of a shadow map with the exact transmittance along the light ray of each tested
    /// texel. The `ray` of a reported deviation is an index into `texels`.
    ///
    /// # Errors
    /// The device is lost.
    pub fn run(
        &self,
        field: &ExactField,
        light: Light,
        session: &Session,
        shadow: &ShadowMap,
    ) -> Result<BoundReport> {
        let mut report = BoundReport::default();
        let query = |points: &[DVec3]| session.query(shadow, points);
        self.visit(field, light, shadow, query, |own, _, _| report.add(own))?;
        Ok(report)
    }

    /// Tests a shadow method's transmittance along each light ray, and calls `visit` with the ray's report, depths
    /// (mm, ascending) and transmittance values. `query` returns the method's transmittance at points (world mm).
    ///
    /// # Errors
    /// Any error that `query` returns.
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
        let taps = tap_offsets(self.taps);
        let all_weights: f64 = taps.iter().map(|(_, weight)| weight).sum();
        for (chunk, texels) in self.texels.chunks(RAYS_AT_ONCE).enumerate() {
            let rays: Vec<(Vec<ExactRay>, Vec<f64>)> = texels
                .par_iter()
                .enumerate()
                .map(|(i, &[column, row])| {
                    let center = DVec2::new(f64::from(column), f64::from(row));
                    let curve = |offset| ExactRay::new(field, LightRay::new(space, light, center + offset));
                    let curves: Vec<_> = taps.iter().map(|(offset, _)| curve(*offset)).collect();
                    let [first, last] = tested_range(curves.iter(), space.z_range, tolerance_mm);
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
                    let around = |(offset, _): &(DVec2, f64)| {
                        let ray = LightRay::new(space, light, DVec2::new(column, row) + *offset);
                        nearby.envelope(ray.at(ray.start_mm), ray.direction, ray.start_mm, &known)
                    };
                    let all: Option<Vec<_>> = taps.iter().map(around).collect();
                    all.map(RoundingEnvelope::mean)
                };
                let weighed = |(ray, tap): (&ExactRay<'_>, &(DVec2, f64)), z| tap.1 * ray.transmittance(z);
                let mean = |z| exact.iter().zip(&taps).map(|tap| weighed(tap, z)).sum::<f64>() / all_weights;
                let report = BoundReport::of_ray(ray, &mean, depths, own, bound, envelope);
                visit(report, depths, own);
            }
        }
        Ok(())
    }
}
