//! Triangle meshes of opaque tubes around strands, added to the meshes of a scene.
//!
//! A tube is a prism of [`SIDES`] sides along the strand, with the strand's thickness at each point and a hemisphere
//! at either end. The edges of the sides lie a little outside of the strand's cylinder and their middles a little
//! inside, so that the mean width over all view directions is the strand's. With 12 sides the outline is off by at
//! most 2.3 % of the radius (5.6 % at the ends); strands that would need too many triangles have fewer sides (8, 6,
//! 4: 5.2, 9.4 and 22 %).
//!
//! Where a strand bends, both prisms end in one ring, halfway between their directions. Where it bends by more than a
//! right angle, or so near to another bend that the rings would meet, the tube ends in a hemisphere and another tube
//! begins with one. The two overlap and leave no gap. Every tube is closed.

use super::Strands;
use crate::error::{Error, Result};
use glam::DVec3;
use std::f64::consts::PI;

/// Possible numbers of sides of the prisms that approximate strand tubes. The largest one that stays within the limit
/// on triangles is used.
pub const SIDES: [usize; 4] = [12, 8, 6, 4];

/// Smallest distance between neighbouring axis points of a strand tube, relative to its radius. A strand's points at
/// smaller distances are skipped.
const LEAST_DISTANCE: f64 = 1e-2;

/// Largest number of triangles of all strand tubes of a scene.
///
/// Including its share of the bounding volume hierarchy, a triangle takes 160 bytes on the device. 96 of them are in
/// one buffer, so that 1.4 million triangles fit the 128 MiB that every adapter can bind. On the host a triangle
/// takes 0.5 KiB, and building a hierarchy of a million triangles takes 1.2 s.
pub const MOST_TRIANGLES: usize = 1_000_000;

/// Triangle mesh of tubes made from strands.
#[derive(Debug)]
pub struct Tubes {
    /// Corners of all triangles of the strand tubes, world mm, counter-clockwise when viewed from outside.
    pub triangles: Vec<[DVec3; 3]>,
    /// Number of sides of the prism that approximates each strand tube.
    pub sides: usize,
    /// Number of triangles of all strand tubes if they had the largest number of sides ([`SIDES`]).
    pub of_most_sides: usize,
}

/// Point on the axis of a strand tube, with the tube's radius there.
#[derive(Debug, Clone, Copy)]
struct TubePoint {
    at: DVec3,
    radius_mm: f64,
}

/// Tessellation of a strand tube: number of sides of its prism, and number of vertex rings in each end cap.
#[derive(Debug, Clone, Copy)]
struct Tessellation {
    sides: usize,
    /// Number of vertex rings of a hemispherical end cap of the tube, including the tube's end ring. The pole is a
    /// single vertex.
    cap_rings: usize,
}

impl Tessellation {
    fn of(sides: usize) -> Self {
        Self { sides, cap_rings: (sides + 2) / 4 }
    }

    /// Number of triangles of a strand tube with `places` points on its axis.
    fn triangles(self, places: usize) -> usize {
        2 * self.sides * (places - 1) + 2 * (2 * self.cap_rings - 1) * self.sides
    }

    /// Distance of a strand tube's vertices from its axis, in radii. It makes the mean width of the polygonal
    /// cross-section equal to the tube's diameter.
    fn corner(self) -> f64 {
        let n = self.sides as f64;
        PI / (n * (PI / n).sin())
    }
}

/// Makes a triangle mesh of tubes around all strands, with at most `most` triangles altogether.
///
/// # Errors
/// No strand has length and thickness, or even the fewest sides give too many triangles, or the host has no memory
/// for them.
pub fn tubes(strands: &Strands, most: usize) -> Result<Tubes> {
    let refused = |why: String| Error::input("cannot use strands", strands.source(), why);
    let mut counts = SIDES.map(|_| 0);
    each_tube(strands, |tube| {
        let counted = counts.iter_mut().zip(SIDES);
        counted.for_each(|(count, sides)| *count += Tessellation::of(sides).triangles(tube.len()));
    });
    if counts[0] == 0 {
        return Err(refused("no strand has length and thickness".into()));
    }
    let Some(place) = counts.iter().position(|count| *count <= most) else {
        let ([.., count], [.., sides], segments) = (counts, SIDES, strands.segment_count());
        let why = format!(
            "tubes of {segments} segments and {sides} sides have {count} triangles, and {most} are the most"
        );
        let hint = "fewer strands, or fewer points on each; as VOLUME strands may be far more";
        return Err(refused(why).hint(hint));
    };
    let (shape, mut triangles) = (Tessellation::of(SIDES[place]), Vec::new());
    if triangles.try_reserve_exact(counts[place]).is_err() {
        return Err(refused(format!("there is not enough memory for {} triangles", counts[place])));
    }
    each_tube(strands, |tube| add_tube(tube, shape, &mut triangles));
    Ok(Tubes { triangles, sides: shape.sides, of_most_sides: counts[0] })
}

/// Calls `take` with the axis points of every tube of the strands, at least two points each.
fn each_tube(strands: &Strands, mut take: impl FnMut(&[TubePoint])) {
    let arrays = strands.arrays();
    let radius_mm = |point: usize| {
        let each = arrays.thickness_mm.values.as_ref().map(|values| values[point]);
        0.5 * f64::from(each.unwrap_or(arrays.thickness_mm.default))
    };
    let (mut places, mut first): (Vec<TubePoint>, usize) = (Vec::new(), 0);
    for segments in strands.segment_ranges() {
        places.clear();
        for point in first..=first + segments.len() {
            let at = DVec3::from_array(arrays.points[point].map(f64::from));
            let next = TubePoint { at, radius_mm: radius_mm(point) };
            let is_near = |last: &TubePoint| {
                last.at.distance(at) <= LEAST_DISTANCE * last.radius_mm.max(next.radius_mm)
            };
            if !places.last().is_some_and(is_near) {
                places.push(next);
            }
        }
        first += segments.len() + 1;
        if places.len() > 1 && places.iter().any(|place| place.radius_mm > 0.0) {
            split(&places, &mut take);
        }
    }
}

/// Splits a strand into several tubes where the vertex rings of neighbouring bends would intersect.
fn split(places: &[TubePoint], take: &mut impl FnMut(&[TubePoint])) {
    let along = |segment: usize| places[segment + 1].at - places[segment].at;
    let (mut begun, mut taken_mm) = (0, 0.0);
    for joint in 1..places.len() - 1 {
        let (before, after) = (along(joint - 1), along(joint));
        // Extent of the ring along either segment: the radius times the tangent of half the angle between them.
        let reach_mm = places[joint].radius_mm * tangent_of_half(before.normalize(), after.normalize());
        let fits = reach_mm <= places[joint].radius_mm
            && reach_mm + taken_mm < before.length()
            && reach_mm < after.length();
        if !fits {
            take(&places[begun..=joint]);
            begun = joint;
        }
        taken_mm = if fits { reach_mm } else { 0.0 };
    }
    take(&places[begun..]);
}

/// Returns the tangent of half the angle between two unit vectors.
fn tangent_of_half(a: DVec3, b: DVec3) -> f64 {
    (a - b).length() / (a + b).length()
}

/// Ring of vertices of a strand tube around one point of its axis.
type Ring = Vec<DVec3>;

/// Adds the triangles of one strand tube to the list `triangles`.
fn add_tube(places: &[TubePoint], shape: Tessellation, triangles: &mut Vec<[DVec3; 3]>) {
    let direction = |segment: usize| (places[segment + 1].at - places[segment].at).normalize();
    let (first, last) = (direction(0), direction(places.len() - 2));
    let wider = |place: TubePoint| TubePoint { radius_mm: shape.corner() * place.radius_mm, ..place };
    // Unit vectors to the corners, perpendicular to the present segment.
    let mut across = corners(first, shape.sides);
    let mut ring = ring_at(wider(places[0]), &across);
    add_cap(wider(places[0]), -first, &across, shape, triangles);
    for joint in 1..places.len() {
        let (along, place) = (direction(joint - 1), wider(places[joint]));
        let next: Ring = if joint + 1 < places.len() {
            let after = direction(joint);
            let normal = (along + after).normalize();
            // Corners move along the segment to the plane halfway between both directions.
            let onto = |u: &DVec3| *u - along * (u.dot(normal) / along.dot(normal));
            let slanted: Ring = across.iter().map(onto).collect();
            across = slanted.iter().map(|u| (*u - after * u.dot(after)).normalize()).collect();
            slanted.iter().map(|u| place.at + place.radius_mm * *u).collect()
        } else {
            ring_at(place, &across)
        };
        add_band(&ring, &next, triangles);
        ring = next;
    }
    add_cap(wider(places[places.len() - 1]), last, &across, shape, triangles);
}

/// Unit vectors to the vertices of a regular polygon perpendicular to `along`, counter-clockwise about it.
fn corners(along: DVec3, sides: usize) -> Ring {
    let x = along.any_orthonormal_vector();
    let y = along.cross(x);
    let corner = |side: usize| {
        let (sin, cos) = (2.0 * PI * side as f64 / sides as f64).sin_cos();
        x * cos + y * sin
    };
    (0..sides).map(corner).collect()
}

fn ring_at(place: TubePoint, across: &[DVec3]) -> Ring {
    across.iter().map(|u| place.at + place.radius_mm * *u).collect()
}

/// Adds the triangles between two neighbouring vertex rings of a strand tube; the second ring is farther along the
/// tube.
fn add_band(from: &[DVec3], to: &[DVec3], triangles: &mut Vec<[DVec3; 3]>) {
    for side in 0..from.len() {
        let next = (side + 1) % from.len();
        triangles.push([from[side], from[next], to[next]]);
        triangles.push([from[side], to[next], to[side]]);
    }
}

/// Adds the triangles of the hemispherical cap at an end of a strand tube; `outward` points to the cap's pole. Its
/// vertices keep the order of the tube's end ring.
fn add_cap(
    place: TubePoint,
    outward: DVec3,
    across: &[DVec3],
    shape: Tessellation,
    triangles: &mut Vec<[DVec3; 3]>,
) {
    let is_first = (across[0].cross(across[1])).dot(outward) < 0.0;
    let mut ring = ring_at(place, across);
    for step in 1..shape.cap_rings {
        let (sin, cos) = (0.5 * PI * step as f64 / shape.cap_rings as f64).sin_cos();
        let corner = |u: &DVec3| place.at + place.radius_mm * (cos * *u + sin * outward);
        let next: Ring = across.iter().map(corner).collect();
        if is_first {
            add_band(&next, &ring, triangles)
        } else {
            add_band(&ring, &next, triangles)
        }
        ring = next;
    }
    let pole = place.at + place.radius_mm * outward;
    for side in 0..ring.len() {
        let (a, b) = (ring[side], ring[(side + 1) % ring.len()]);
        triangles.push(if is_first { [b, a, pole] } else { [a, b, pole] });
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Attribute, StrandArrays};
    use super::*;
    use crate::mesh::{Mesh, MeshPart};

    fn strand(points: Vec<[f32; 3]>, thickness_mm: Attribute<f32>) -> Strands {
        let arrays = StrandArrays {
            strands: 1,
            segments: Attribute::constant(points.len() as u32 - 1),
            points,
            thickness_mm,
            transparency: Attribute::constant(0.0),
            color: Attribute::constant([1.0; 3]),
            info: [0; 88],
        };
        Strands::new("test", arrays).unwrap()
    }

    fn made(strands: &Strands) -> Vec<[DVec3; 3]> {
        tubes(strands, MOST_TRIANGLES).unwrap().triangles
    }

    fn mesh_of(strands: &Strands) -> Mesh {
        let triangles = made(strands);
        Mesh::new(vec![MeshPart { source: "test".into(), color: [1.0; 3], triangles }]).unwrap()
    }

    /// Test strands: a gentle curve, a zigzag, a hairpin, a line with a repeated point, and a strand that tapers to
    /// zero width.
    fn some() -> Vec<Strands> {
        let curve = |i: u32| {
            let t = f64::from(i) * 0.2;
            [10.0 * t.cos(), 10.0 * t.sin(), 3.0 * t].map(|x| x as f32)
        };
        let wide = Attribute::constant(2.0);
        let taper = Attribute { default: 0.0, values: Some(vec![3.0, 2.0, 0.0]) };
        vec![
            strand((0..40).map(curve).collect(), wide.clone()),
            strand((0..20).map(|i| [i as f32, (i % 2) as f32 * 3.0, 0.0]).collect(), wide.clone()),
            strand(vec![[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 0.1, 0.0]], wide.clone()),
            strand(vec![[0.0; 3], [0.0; 3], [5.0, 1.0, 2.0], [5.0, 1.0, 2.0], [7.0, 3.0, 2.0]], wide),
            strand(vec![[0.0; 3], [5.0, 0.0, 0.0], [9.0, 0.0, 1.0]], taper),
        ]
    }

    #[test]
    fn outlines_are_off_by_the_documented_amounts() {
        for (sides, most) in SIDES.into_iter().zip([0.023, 0.052, 0.094, 0.215]) {
            let (corner, n) = (Tessellation::of(sides).corner(), sides as f64);
            assert!(corner - 1.0 < most && 1.0 - corner * (PI / n).cos() < most, "{sides}: {corner}");
            // The mean width over all directions is the diameter.
            let width = |turn: f64| {
                let at = |side: usize| corner * (2.0 * PI * side as f64 / n + turn).cos();
                (0..sides).map(at).fold(0.0, f64::max) - (0..sides).map(at).fold(0.0, f64::min)
            };
            let mean = (0..3600).map(|i| width(2.0 * PI * f64::from(i) / 3600.0)).sum::<f64>() / 3600.0;
            assert!((mean - 2.0).abs() < 1e-4, "{sides}: {mean}");
        }
    }

    #[test]
    fn every_tube_is_closed_and_has_the_counted_triangles() {
        for (strands, sides) in some().iter().flat_map(|s| SIDES.map(|sides| (s, sides))) {
            let (shape, mut count, mut triangles) = (Tessellation::of(sides), 0, Vec::new());
            each_tube(strands, |tube| count += shape.triangles(tube.len()));
            each_tube(strands, |tube| add_tube(tube, shape, &mut triangles));
            assert_eq!(triangles.len(), count);
            // A mesh is closed if every edge is used equally often in both directions.
            let mut edges = std::collections::HashMap::new();
            let key = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
            for t in &triangles {
                for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                    *edges.entry((key(a), key(b))).or_insert(0) += 1;
                    *edges.entry((key(b), key(a))).or_insert(0) -= 1;
                }
            }
            assert!(edges.values().all(|n| *n == 0));
        }
    }

    #[test]
    fn surfaces_have_the_distance_of_the_radius_from_the_strand() {
        for strands in some() {
            let distance_to = |p: DVec3| {
                let to_segment = |i: usize| {
                    let [a, b] = strands.segment(i).ends;
                    let t = if a == b { 0.0 } else { (p - a).dot(b - a) / (b - a).length_squared() };
                    p.distance(a + t.clamp(0.0, 1.0) * (b - a))
                };
                (0..strands.segment_count()).map(to_segment).fold(f64::INFINITY, f64::min)
            };
            let widest = 0.5 * strands.widest_mm();
            for t in made(&strands) {
                let farthest = t.iter().map(|p| distance_to(*p)).fold(0.0, f64::max);
                // A bend of a right angle puts its outer corner farther away, as the joint of two pipes does.
                assert!(
                    farthest <= 2.0_f64.sqrt() * Tessellation::of(12).corner() * widest + 1e-9,
                    "{farthest}"
                );
            }
        }
        // Normals look outward.
        let straight = strand(vec![[0.0; 3], [9.0, 0.0, 0.0]], Attribute::constant(2.0));
        for [a, b, c] in made(&straight) {
            let middle = (a + b + c) / 3.0;
            let axis = DVec3::new(middle.x.clamp(0.0, 9.0), 0.0, 0.0);
            assert!((b - a).cross(c - a).dot(middle - axis) > 0.0);
            assert!((middle.distance(axis) - 1.0).abs() < 0.05);
        }
    }

    /// A ray that starts on a strand's axis hits the strand's tube in every direction: the mesh has no gaps at
    /// joints.
    #[test]
    fn no_ray_leaves_a_tube() {
        for strands in some() {
            let mesh = mesh_of(&strands);
            for i in 0..strands.segment_count() {
                let [a, b] = strands.segment(i).ends;
                for (share, turn) in [(0.01, 0.3), (0.5, 1.7), (0.99, 2.9)] {
                    let radius = 0.5 * strands.segment(i).diameter_mm;
                    let from = a + share * (b - a);
                    for k in 0..200 {
                        let z = -0.995 + 0.01 * f64::from(k);
                        let phi = turn + 2.399_963 * f64::from(k);
                        let ring = (1.0 - z * z).sqrt();
                        let direction = DVec3::new(ring * phi.cos(), ring * phi.sin(), z);
                        // A strand that tapers is nearly without width at its tip.
                        let met = radius < 0.6 || mesh.first_hit(from, direction, [0.0, 1e6]).is_some();
                        assert!(met, "segment {i}, {from}, {direction}");
                    }
                }
            }
        }
    }

    #[test]
    fn strands_without_extent_or_with_too_many_triangles_are_refused() {
        let none = strand(vec![[1.0; 3]; 5], Attribute::constant(2.0));
        let thin = strand(vec![[0.0; 3], [1.0; 3]], Attribute::constant(0.0));
        for strands in [none, thin] {
            assert!(tubes(&strands, 1000).unwrap_err().why.contains("length and thickness"));
        }
        let line = strand((0..101).map(|i| [i as f32, 0.0, 0.0]).collect(), Attribute::constant(1.0));
        for (most, sides, count) in [(2520, 12, 2520), (2519, 8, 1648), (1647, 6, 1236), (1000, 4, 808)] {
            let made = tubes(&line, most).unwrap();
            assert_eq!((made.sides, made.triangles.len(), made.of_most_sides), (sides, count, 2520));
        }
        let e = tubes(&line, 807).unwrap_err();
        assert!(e.why.contains("100 segments and 4 sides have 808 triangles, and 807 are the most"), "{e}");
    }
}
