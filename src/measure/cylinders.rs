//! Error of the voxelised field's shadows against the strands.
//!
//! Model. A light beam is a square bundle of parallel rays, as wide as a voxel, from a place among the strands
//! towards the light. A ray crosses a segment when it passes its axis at no more than half the diameter, between the
//! segment's ends; every crossing lets through the segment's transparency, and the beam's true transmittance is the
//! mean over its rays of the products. It is compared with `exp(-optical depth)` of the volume along the beam's
//! middle, by [`crate::exact`].
//!
//! What the difference means: it is the error of the volume as a stand-in for strands, before any shadow method adds
//! its own. It holds the blur of a voxel, the overlap of strands that lie in bundles (a medium assumes that they are
//! scattered), and the foreshortening of segments that point at the light: extinction counts `d L` from whichever
//! side, a light sees `d L sin(angle)`.

use crate::exact::ExactField;
use crate::scene::Light;
use crate::strands::{Chance, Strands};
use crate::transfer::{Quantity, TransferFunction};
use crate::volume::Volume;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use rstar::primitives::GeomWithData;
use rstar::{AABB, RTree};
use std::sync::atomic::{AtomicU64, Ordering};

/// Rays along each side of a beam; one in each cell of the square, at a random place in it.
const SIDE: usize = 16;

/// Rays of a beam.
pub const RAYS_PER_BEAM: usize = SIDE * SIDE;

/// Beams at the most: 200 MiB of sums.
pub const MAX_BEAMS: usize = 100_000;

/// An opaque crossing, as optical depth: no 64-bit sum tells its transmittance from 0.
const OPAQUE: f64 = 64.0;

/// Optical depths are summed as whole multiples of this: such sums are the same in any order.
const UNIT: f64 = 1.0 / (1u64 << 32) as f64;

/// Differences of transmittance, voxelised minus true, over the beams.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct AgainstCylinders {
    /// Beams that were tested.
    pub beams: usize,
    /// Rays whose mean is the transmittance of a beam.
    pub rays_per_beam: usize,
    /// Mean true transmittance.
    pub true_mean: f64,
    /// Mean signed difference; positive where the volume transmits more light than the strands.
    pub mean: f64,
    /// Root of the mean square error in transmittance.
    pub rms: f64,
    /// Largest error in transmittance.
    pub max: f64,
    /// Part of `rms` that the finite number of rays may explain: half the rms difference of two halves of each beam.
    pub sampling_rms: f64,
}

/// Compares a volume of cubic voxels with the strands that it was made from, along `count` beams towards a directional light, the
/// same ones on every run. `None` where there is nothing to compare: no segments or no beams.
pub fn against_cylinders(
    strands: &Strands,
    volume: &Volume,
    toward: DVec3,
    count: usize,
) -> Option<AgainstCylinders> {
    let count = count.min(MAX_BEAMS);
    if strands.segment_count() == 0 || count == 0 {
        return None;
    }
    let toward = toward.normalize();
    let width_mm = volume.min_spacing_mm();
    let middles_mm: Vec<DVec3> = (0..count)
        .map(|i| {
            let mut chance = Chance::new(200, i as u64);
            let [a, b] = strands.segment(chance.below(strands.segment_count())).ends;
            // Off the strand by up to half a voxel, so that its own extinction counts as often before as behind.
            let moved = DVec3::new(chance.unit() - 0.5, chance.unit() - 0.5, chance.unit() - 0.5) * width_mm;
            a.lerp(b, chance.unit()) + moved
        })
        .collect();
    let halves = beam_halves(strands, &middles_mm, toward, width_mm);

    // Values are extinction themselves.
    let largest = volume.value_range()[1];
    let tf = TransferFunction::new(Quantity::Extinction, &[(0.0, 0.0), (largest, largest)]);
    let field = ExactField::new(volume, &tf);
    let light = Light::Directional { toward };
    let each: Vec<[f64; 3]> = middles_mm
        .par_iter()
        .zip(&halves)
        .map(|(middle_mm, [a, b])| {
            let voxelised = field.transmittance_to_light(*middle_mm, &light);
            let truth = 0.5 * (a + b);
            [truth, voxelised - truth, 0.5 * (a - b)]
        })
        .collect();
    let mean = |f: &dyn Fn(&[f64; 3]) -> f64| each.iter().map(f).sum::<f64>() / each.len() as f64;
    Some(AgainstCylinders {
        beams: each.len(),
        rays_per_beam: RAYS_PER_BEAM,
        true_mean: mean(&|e| e[0]),
        mean: mean(&|e| e[1]),
        rms: mean(&|e| e[1] * e[1]).sqrt(),
        max: each.iter().map(|e| e[1].abs()).fold(0.0, f64::max),
        sampling_rms: mean(&|e| e[2] * e[2]).sqrt(),
    })
}

/// True transmittances of the beams, `width_mm` wide, from these places (world mm) towards a directional light: of each the
/// means over two interleaved halves of its rays.
pub(super) fn beam_halves(
    strands: &Strands,
    middles_mm: &[DVec3],
    toward: DVec3,
    width_mm: f64,
) -> Vec<[f64; 2]> {
    let toward = toward.normalize();
    let (across, up) = toward.any_orthonormal_pair();
    let in_light = |p: DVec3| DVec3::new(p.dot(across), p.dot(up), p.dot(toward));
    let starts: Vec<DVec3> = middles_mm.iter().map(|p| in_light(*p)).collect();
    let offsets: Vec<DVec2> = (0..RAYS_PER_BEAM)
        .map(|ray| {
            let mut chance = Chance::new(201, ray as u64);
            let cell = DVec2::new((ray % SIDE) as f64 + chance.unit(), (ray / SIDE) as f64 + chance.unit());
            (cell / SIDE as f64 - 0.5) * width_mm
        })
        .collect();
    let depths = optical_depths(strands, &starts, &offsets, in_light, 0.5 * width_mm);
    let mean = |rays: &[AtomicU64]| {
        let mut halves = [0.0; 2];
        for (ray, depth) in rays.iter().enumerate() {
            let transmittance = (-(depth.load(Ordering::Relaxed) as f64 * UNIT).min(OPAQUE)).exp();
            halves[(ray % SIDE + ray / SIDE) % 2] += transmittance / (RAYS_PER_BEAM / 2) as f64;
        }
        halves
    };
    depths.par_chunks(RAYS_PER_BEAM).map(mean).collect()
}

/// Optical depth of every ray of every beam, in multiples of [`UNIT`].
///
/// The rays are all parallel, so that crossings are a matter of the plane across them: segments are ribbons there,
/// and an R*-tree of the beams says which ones a ribbon may touch. `starts` are in the light's frame: across, across,
/// towards the light; mm.
fn optical_depths(
    strands: &Strands,
    starts: &[DVec3],
    offsets: &[DVec2],
    in_light: impl Fn(DVec3) -> DVec3 + Sync,
    half_width_mm: f64,
) -> Vec<AtomicU64> {
    let depths: Vec<AtomicU64> = (0..starts.len() * offsets.len()).map(|_| AtomicU64::new(0)).collect();
    let places = starts.iter().enumerate().map(|(i, start)| GeomWithData::new([start.x, start.y], i));
    let tree = RTree::bulk_load(places.collect());
    let enough = (OPAQUE / UNIT) as u64;
    (0..strands.segment_count()).into_par_iter().for_each(|index| {
        let segment = strands.segment(index);
        let depth =
            if segment.transparency > 0.0 { (-segment.transparency.ln()).min(OPAQUE) } else { OPAQUE };
        let depth = (depth / UNIT) as u64;
        let radius = 0.5 * segment.diameter_mm;
        let [a, b] = segment.ends.map(&in_light);
        let along = (b - a).truncate();
        let length = along.length();
        if length == 0.0 || radius == 0.0 || depth == 0 {
            return;
        }
        let direction = along / length;
        let margin = DVec2::splat(radius + half_width_mm);
        let low = a.truncate().min(b.truncate()) - margin;
        let high = a.truncate().max(b.truncate()) + margin;
        for place in tree.locate_in_envelope(AABB::from_corners(low.to_array(), high.to_array())) {
            let start = starts[place.data];
            let from_a = start.truncate() - a.truncate();
            if direction.perp_dot(from_a).abs() > radius + half_width_mm * std::f64::consts::SQRT_2 {
                continue;
            }
            let first = place.data * offsets.len();
            for (offset, sum) in offsets.iter().zip(&depths[first..first + offsets.len()]) {
                let q = from_a + offset;
                let at = q.dot(direction) / length;
                let before_light = a.z + at * (b.z - a.z) > start.z;
                let crosses =
                    (0.0..1.0).contains(&at) && direction.perp_dot(q).abs() <= radius && before_light;
                // What is dark stays dark: without more of it the sum cannot overflow.
                if crosses && sum.load(Ordering::Relaxed) < enough {
                    sum.fetch_add(depth, Ordering::Relaxed);
                }
            }
        }
    });
    depths
}
