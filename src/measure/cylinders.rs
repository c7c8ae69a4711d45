//! Transmittance error of voxelised strands (hair or fibres): compares the voxel volume with light beams through the
//! strands as cylinders.
//!
//! Model: a light beam is a square bundle of parallel rays, as wide as a voxel, from a point among the strands
//! towards the light. A ray crosses a strand segment if it passes the segment's axis within half the diameter,
//! between the ends. Every crossing multiplies the ray's transmittance by the segment's transparency. The beam's true
//! transmittance is the mean over its rays. It is compared with `exp(-optical depth)` of the volume along the beam's
//! axis, by [`crate::exact`].
//!
//! The difference is the error of the volume as a substitute for strands, without the error of a shadow method. It
//! has three sources: the blur of a voxel; the overlap of strands in bundles, where a medium assumes scattered
//! strands; and the foreshortening of segments along the light. The volume has the extinction `d L` from every
//! direction, but the light sees `d L sin(angle)`.

use crate::exact::ExactField;
use crate::random::Chance;
use crate::scene::Light;
use crate::strands::Strands;
use crate::transfer::{Quantity, TransferFunction};
use crate::volume::Volume;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use rstar::primitives::GeomWithData;
use rstar::{AABB, RTree};
use std::sync::atomic::{AtomicU64, Ordering};

/// Number of light rays along each side of a square light beam. The square has a grid of cells, each with one ray at
/// a random position.
const SIDE: usize = 16;

/// Number of parallel rays that sample one light beam.
pub const RAYS_PER_BEAM: usize = SIDE * SIDE;

/// Maximum number of light beams through the strands. Their sums of optical depth take 200 MiB.
pub const MAX_BEAMS: usize = 100_000;

/// Optical depth assigned to an opaque strand segment: its transmittance is indistinguishable from 0 in float64.
const OPAQUE: f64 = 64.0;

/// Unit in which optical depths of strand segments are summed, as integers. Such sums do not depend on the order of
/// the segments.
const UNIT: f64 = 1.0 / (1u64 << 32) as f64;

/// Statistics of transmittance differences over light beams: through the voxel volume minus through the strands as
/// cylinders.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct AgainstCylinders {
    /// Number of light beams along which the voxel volume and its strands were compared.
    pub beams: usize,
    /// Number of rays per light beam; the transmittance of the beam is the mean over its rays.
    pub rays_per_beam: usize,
    /// Mean transmittance of light beams through the strands as cylinders.
    pub true_mean: f64,
    /// Mean signed difference in transmittance over light beams. Positive where the voxel volume transmits more light
    /// than the strands.
    pub mean: f64,
    /// Root mean square difference in transmittance between the voxel volume and the strands, over all light beams.
    pub rms: f64,
    /// Largest absolute difference in transmittance between the voxel volume and the strands, over all light beams.
    pub max: f64,
    /// Part of the difference `rms` that the finite number of rays per light beam may explain: half the rms
    /// difference between two halves of each beam's rays.
    pub sampling_rms: f64,
}

/// Compares the transmittance of a volume of cubic voxels with that of the strands it was made from, along `count`
/// light beams towards a directional light. Repeated calls use the same beams. Returns `None` without strand segments
/// or without beams.
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
            // Displaced from the strand by up to half a voxel, so that its own extinction counts as often before as
            // behind.
            let moved = DVec3::new(chance.unit() - 0.5, chance.unit() - 0.5, chance.unit() - 0.5) * width_mm;
            a.lerp(b, chance.unit()) + moved
        })
        .collect();
    let halves = beam_halves(strands, &middles_mm, toward, width_mm);

    // Voxel values are extinction.
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

/// Returns the transmittance of light beams through the strands as cylinders. Beams are `width_mm` wide and run from
/// `middles_mm` (world) towards a directional light. Each result has two means, over interleaved halves of the beam's
/// rays.
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

/// Returns the optical depth through the strands along every ray of every light beam, in multiples of [`UNIT`].
///
/// All rays are parallel, so crossings are found in the plane perpendicular to them. There, strand segments are
/// ribbons, and an R*-tree of the beams finds those that a ribbon may touch. The coordinates of `starts` are in the
/// light's frame: two across, the third towards the light; mm.
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
                // An opaque ray needs no further sum, which also prevents overflow.
                if crosses && sum.load(Ordering::Relaxed) < enough {
                    sum.fetch_add(depth, Ordering::Relaxed);
                }
            }
        }
    });
    depths
}
