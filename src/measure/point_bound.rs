//! Test of a shadow method's error bound at points anywhere in the shadow map, not only on the light rays through
//! texel centres.
//!
//! A query combines the transmittance curves of the texels around a point with weights that are not negative and add
//! up to 1. Its result therefore lies between the extremes of these curves, each within the error bound `b` and the
//! tolerance in depth `d` (plus the shift of `align=on`) of its exact curve `T_i`:
//! `min T_i(z + d) - b <= T_method <= max T_i(z - d) + b`. All texels lie within [`Bound::reach_mm`] of the point.
//! `docs/bound.md` has the derivation.

use super::exact_rays::{ExactRay, LightRay, tap_offsets, tested_range};
use super::point_report::{PointReport, PointViolation, distance};
use super::rounding_envelope::{NearbyRays, RoundingEnvelope};
use super::test_depths::{sort_distinct, test_depths};
use crate::error::Result;
use crate::exact::ExactField;
use crate::random::{mix, mix_to_unit};
use crate::render::Session;
use crate::scene::Light;
use crate::shadow::{Bound, LightSpace, ShadowMap, Taps};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Number of cells between texel centres whose exact transmittance curves are in memory at the same time.
const CELLS_AT_ONCE: usize = 64;
/// Number of light rays between the texel centres of a cell on which points are tested.
const RAYS_A_CELL: usize = 8;

/// Parameters for a test of a shadow map's error bound at points between the light rays of texels.
pub struct PointTest<'a> {
    /// Column and row of the first texel of each tested cell. The other texels of a cell are the next in each
    /// direction.
    pub cells: &'a [[u32; 2]],
    /// Number of points in each cell, on light rays in positions that a hash of the cell gives.
    pub points_a_cell: usize,
    /// Number and placement of the light rays that the shadow map's pre-filter averages in each texel.
    pub taps: Taps,
}

/// Texel of a shadow map: the light rays that its pre-filter averages, with their exact curves.
type Texel<'a> = Vec<(LightRay, ExactRay<'a>)>;

/// Texels that queries in a cell combine, and the points tested there.
struct Cell<'a> {
    texels: Vec<Texel<'a>>,
    /// Depth (mm) and position (world mm) of each point.
    points: Vec<(f64, DVec3)>,
}

impl PointTest<'_> {
    /// Tests the error bound of a shadow map at points of every cell. The report is empty for shadow maps without a
    /// bound.
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
        let Some(bound) = shadow.bound else { return Ok(report) };
        let nearby = NearbyRays::new(field, bound);
        for chunk in self.cells.chunks(CELLS_AT_ONCE) {
            let of = |cell: &[u32; 2]| self.cells_of(*cell, (field, light), &shadow.light_space, bound);
            let cells: Vec<Cell<'_>> = chunk.par_iter().flat_map_iter(of).collect();
            let points: Vec<DVec3> = cells.iter().flat_map(|c| c.points.iter().map(|p| p.1)).collect();
            let values = session.query(shadow, &points)?;
            let points_of = |cell: &Cell<'_>| cell.points.len();
            let of = |cell: &Cell<'_>, values: &[f32]| cell.report(values, bound, &nearby);
            report = report.merge(PointReport::of_all(&cells, &values, points_of, of));
        }
        Ok(report)
    }

    /// Returns the tested points of a cell, with the texels that queries combine there. Shadow rays have no texels:
    /// each ray is a cell of its own.
    fn cells_of<'f>(
        &self,
        cell: [u32; 2],
        (field, light): (&'f ExactField<'f>, Light),
        space: &LightSpace,
        bound: Bound,
    ) -> Vec<Cell<'f>> {
        let texel = |at: DVec2| -> Texel<'f> {
            let rays = tap_offsets(self.taps)
                .into_iter()
                .map(|(offset, _)| LightRay::new(space, light, at + offset));
            rays.map(|ray| (ray, ExactRay::new(field, ray))).collect()
        };
        let centre = |[column, row]: [u32; 2]| DVec2::new(f64::from(column), f64::from(row));
        let seed = u64::from(cell[0]) << 32 | u64::from(cell[1]);
        let share = |k: usize| mix_to_unit(seed ^ mix(k as u64));
        let inside = (0..RAYS_A_CELL).map(|k| DVec2::new(share(2 * k), share(2 * k + 1)));
        let lines: Vec<DVec2> = match bound.texels_a_side {
            // Rounding decides between texels at the border of their squares.
            1 => inside.map(|at| centre(cell) + 0.98 * (at - 0.5)).collect(),
            _ => inside.map(|at| centre(cell) + at).collect(),
        };
        let last = DVec2::splat(f64::from(space.map_size) - 0.51);
        let lines: Vec<DVec2> =
            lines.into_iter().filter(|at| at.cmple(last).all() && space.covers(*at)).collect();
        let texels: Vec<DVec2> = match bound.texels_a_side {
            0 => {
                let alone = |at: DVec2| self.cell(vec![texel(at)], &[at], light, space, bound);
                return lines.into_iter().map(alone).collect();
            }
            1 => vec![centre(cell)],
            _ => space.texels_around(cell).map(centre).to_vec(),
        };
        if lines.is_empty() {
            return Vec::new();
        }
        vec![self.cell(texels.into_iter().map(texel).collect(), &lines, light, space, bound)]
    }

    /// Returns a cell of the given texels with points at the positions `lines` (in texels).
    fn cell<'f>(
        &self,
        texels: Vec<Texel<'f>>,
        lines: &[DVec2],
        light: Light,
        space: &LightSpace,
        bound: Bound,
    ) -> Cell<'f> {
        let tolerance_mm = bound.depth_mm + bound.align_mm;
        let curves = || texels.iter().flatten().map(|(_, curve)| curve);
        let [first, last] = tested_range(curves(), space.z_range, tolerance_mm);
        let mut jumps: Vec<f64> = curves().flat_map(ExactRay::jumps).collect();
        jumps.sort_by(f64::total_cmp);
        let mut points = Vec::new();
        for at in lines {
            let line = LightRay::new(space, light, *at);
            let nearest = match light {
                Light::Point { .. } => line.start_mm + bound.from_light_mm,
                Light::Directional { .. } => first,
            };
            let depths = test_depths(
                [first.max(nearest), last],
                &jumps,
                self.points_a_cell / RAYS_A_CELL,
                tolerance_mm,
            );
            points.extend(depths.into_iter().map(|z| (z, line.at(z))));
        }
        Cell { texels, points }
    }
}

impl Cell<'_> {
    /// Compares the method's transmittances at the points of the cell with its texels.
    fn report(&self, values: &[f32], bound: Bound, nearby: &NearbyRays<'_>) -> PointReport {
        let depth_mm = bound.depth_mm + bound.align_mm;
        let mean = |texel: &Texel<'_>, z: f64| {
            texel.iter().map(|(_, curve)| curve.transmittance(z)).sum::<f64>() / texel.len() as f64
        };
        let allowed = |[least, most]: [f64; 2]| [least - bound.transmittance, most + bound.transmittance];
        let interval = |z: f64| {
            let values = |z: f64| self.texels.iter().map(move |texel| mean(texel, z));
            allowed([
                values(z + depth_mm).fold(f64::INFINITY, f64::min),
                values(z - depth_mm).fold(0.0, f64::max),
            ])
        };
        let mut report = PointReport::of(values.len());
        let mut suspects = Vec::new();
        for ((z, position_mm), t) in self.points.iter().zip(values) {
            let (transmittance, interval) = (f64::from(*t), interval(*z));
            let amount = distance([transmittance; 2], interval);
            if !report.records_inside(amount) {
                suspects.push((
                    *z,
                    PointViolation { position_mm: *position_mm, transmittance, interval, amount },
                ));
            }
        }
        if suspects.is_empty() {
            return report;
        }
        let mut known: Vec<f64> = suspects.iter().flat_map(|(z, _)| [z - depth_mm, z + depth_mm]).collect();
        sort_distinct(&mut known);
        let envelope = |texel: &Texel<'_>| {
            let around = |(ray, _): &(LightRay, ExactRay<'_>)| {
                nearby.envelope(ray.at(ray.start_mm), ray.direction, ray.start_mm, &known)
            };
            texel.iter().map(around).collect::<Option<Vec<_>>>().map(RoundingEnvelope::mean)
        };
        let envelopes: Option<Vec<RoundingEnvelope>> = self.texels.iter().map(envelope).collect();
        for (z, mut point) in suspects {
            if let Some(all) = &envelopes {
                let least = all.iter().map(|e| e.least(z + depth_mm)).fold(f64::INFINITY, f64::min);
                let most = all.iter().map(|e| e.most(z - depth_mm)).fold(0.0, f64::max);
                point.amount = distance([point.transmittance; 2], allowed([least, most]));
            }
            report.count(point);
        }
        report
    }
}
