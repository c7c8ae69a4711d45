//! Visits the texels of a shadow map that a line segment crosses, in order.

use super::mapping::{LightSpace, Projection};
use glam::DVec3;

/// Part of a line segment that lies within one texel of a shadow map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexelSegment {
    /// Column and row of the shadow-map texel in which this part of a line segment lies.
    pub texel: [u32; 2],
    /// Distance along the light ray at the middle of this part of a line segment (its depth in the shadow map), mm.
    pub depth_mm: f64,
    /// Difference between the depths at the ends of this part of a line segment, along the light ray, mm.
    pub extent_mm: f64,
    /// Length of this part of a line segment, projected perpendicular to the light ray, mm.
    pub across_mm: f64,
    /// Cross-section of the shadow-map texel, perpendicular to the light ray at the middle of this part of a line
    /// segment, mm^2.
    pub texel_mm2: f64,
}

/// Smallest divisor of the perspective or octahedral projection of a line segment to a shadow map, relative to the
/// lengths involved. Nearer to the light, the projection is singular.
const SINGULAR: f64 = 1e-9;

/// Part of a line segment in homogeneous texel coordinates of a shadow map, in which the projection of the segment is
/// linear. Each end is column times divisor, row times divisor, and divisor; texel `k` spans `[k, k + 1]`.
#[derive(Debug, Clone, Copy)]
struct ProjectedLine {
    t: [f64; 2],
    ends: [DVec3; 2],
}

impl ProjectedLine {
    fn at(&self, share: f64) -> DVec3 {
        self.ends[0].lerp(self.ends[1], share)
    }

    /// Clips a line segment, projected to a shadow map, to the part where a given linear function is not negative.
    /// Returns `None` if nothing is left.
    fn where_positive(self, function: impl Fn(DVec3) -> f64) -> Option<Self> {
        let [a, b] = self.ends.map(function);
        if a < 0.0 && b < 0.0 {
            return None;
        }
        let zero = a / (a - b);
        let shares = [if a < 0.0 { zero } else { 0.0 }, if b < 0.0 { zero } else { 1.0 }];
        let length = self.t[1] - self.t[0];
        let t = shares.map(|share| self.t[0] + share * length);
        Some(Self { t, ends: shares.map(|share| self.at(share)) })
    }

    /// Clips a line segment, projected to a shadow map, to the `size` texels per side of the map. The homogeneous
    /// divisor is clipped to at least `least`.
    fn on_map(self, size: f64, least: f64) -> Option<Self> {
        self.where_positive(|p| p.z - least)?
            .where_positive(|p| p.x)?
            .where_positive(|p| p.y)?
            .where_positive(|p| size * p.z - p.x)?
            .where_positive(|p| size * p.z - p.y)
    }

    /// Starts the traversal of the texel columns or rows (`axis`) of a shadow map that a projected line segment
    /// crosses.
    fn texels(&self, axis: usize, last: u32) -> AxisTraversal {
        let coordinate = |p: DVec3| (p[axis] / p.z).floor().clamp(0.0, f64::from(last));
        let [first, end] = self.ends.map(coordinate);
        AxisTraversal { line: *self, axis, texel: first, end }
    }
}

/// Traversal of the texel columns or rows of a shadow map along a projected line segment: the current index and the
/// last one.
struct AxisTraversal {
    line: ProjectedLine,
    axis: usize,
    texel: f64,
    end: f64,
}

impl AxisTraversal {
    /// Returns the parameter (0 to 1) at which a projected line segment leaves its current texel column or row of a
    /// shadow map; infinite in the last one.
    fn exit(&self) -> f64 {
        if self.texel == self.end {
            return f64::INFINITY;
        }
        let border = if self.end > self.texel { self.texel + 1.0 } else { self.texel };
        let [a, b] = self.line.ends.map(|p| p[self.axis] - border * p.z);
        if a == b { 0.0 } else { (a / (a - b)).clamp(0.0, 1.0) }
    }

    fn step(&mut self) {
        self.texel += (self.end - self.texel).signum();
    }
}

impl LightSpace {
    /// Visits in order the parts of a line segment that lie in single texels of the shadow map. The ends of the
    /// segment are in world mm; no part spans more than `most_extent_mm` in depth.
    pub fn texels_along(&self, ends: [DVec3; 2], most_extent_mm: f64, mut visit: impl FnMut(TexelSegment)) {
        let [a, b] = ends.map(|p| self.frame_from_world.transform_point3(p));
        let size = f64::from(self.map_size);
        let least = SINGULAR * (a.length() + b.length() + self.light_distance);
        // A segment of length 0 is skipped; at the light it would have no texel.
        if a == b {
            return;
        }
        for part in self.linear_parts(a, b) {
            let least = if self.projection == Projection::Orthographic { 0.0 } else { least };
            let Some(line) = part.on_map(size, least) else { continue };
            let mut axes = [0, 1].map(|axis| line.texels(axis, self.map_size - 1));
            let mut from = 0.0;
            loop {
                let exits = [axes[0].exit(), axes[1].exit()];
                let axis = usize::from(exits[1] < exits[0]);
                let to = exits[axis].clamp(from, 1.0);
                if to > from {
                    let texel = [axes[0].texel as u32, axes[1].texel as u32];
                    let t = [from, to].map(|share| line.t[0] + share * (line.t[1] - line.t[0]));
                    self.visit_parts(texel, t.map(|t| a.lerp(b, t)), most_extent_mm, &mut visit);
                }
                if exits[axis].is_infinite() {
                    break;
                }
                axes[axis].step();
                from = to;
            }
        }
    }

    /// Returns the unit direction of the light ray through a world point, and the smaller width of a shadow-map texel
    /// there, mm.
    pub fn ray_and_texel_mm(&self, world: DVec3) -> (DVec3, f64) {
        let (direction, texel_mm2) = self.ray_and_area(self.frame_from_world.transform_point3(world));
        let scale = self.texel_scale.abs();
        let narrowness = (scale.min_element() / scale.max_element()).sqrt();
        (self.world_from_frame.transform_vector3(direction), narrowness * texel_mm2.sqrt())
    }

    /// Splits the line segment from `a` to `b` (coordinates along the axes of the light) where the projection to the
    /// shadow map changes its formula. Homogeneous texel coordinates are linear in each part.
    fn linear_parts(&self, a: DVec3, b: DVec3) -> impl Iterator<Item = ProjectedLine> {
        let mut cuts = [0.0, 1.0, 1.0, 1.0, 1.0];
        if self.projection == Projection::Octahedral {
            // An octant of directions is a triangle of the square.
            let crossings = [0, 1, 2].map(|axis| a[axis] / (a[axis] - b[axis]));
            for (cut, t) in cuts[1..4].iter_mut().zip(crossings) {
                *cut = if t > 0.0 && t < 1.0 { t } else { 1.0 };
            }
            cuts.sort_unstable_by(f64::total_cmp);
        }
        let part = move |t: [f64; 2]| {
            let octant = a.lerp(b, 0.5 * (t[0] + t[1])).map(|x| if x < 0.0 { -1.0 } else { 1.0 });
            ProjectedLine { t, ends: t.map(|t| self.homogeneous(a.lerp(b, t), octant)) }
        };
        let parts = (0..4).map(move |i| [cuts[i], cuts[i + 1]]);
        parts.filter(|[from, to]| from < to).map(part)
    }

    /// Returns the homogeneous texel coordinates of a point: column times divisor, row times divisor, and divisor.
    /// The point is given along the axes of the light; `octant` holds the signs of its direction from the light.
    fn homogeneous(&self, p: DVec3, octant: DVec3) -> DVec3 {
        let (x, y, divisor) = match self.projection {
            Projection::Orthographic => (p.x, p.y, 1.0),
            Projection::Perspective => (p.x, p.y, p.z + self.light_distance),
            Projection::Octahedral => {
                let sum = p.dot(octant);
                match octant.z > 0.0 {
                    true => (p.x, p.y, sum),
                    false => ((sum - p.y * octant.y) * octant.x, (sum - p.x * octant.x) * octant.y, sum),
                }
            }
        };
        let offset = self.texel_offset + 0.5;
        DVec3::new(
            x * self.texel_scale.x + offset.x * divisor,
            y * self.texel_scale.y + offset.y * divisor,
            divisor,
        )
    }

    fn visit_parts(
        &self,
        texel: [u32; 2],
        [from, to]: [DVec3; 2],
        most_extent_mm: f64,
        visit: &mut impl FnMut(TexelSegment),
    ) {
        let depths = [from, to].map(|p| self.depth(p));
        // Near a point light, the area of a texel changes along a part.
        let nearest = [from, to].map(|p| self.distance(p)).into_iter().fold(f64::INFINITY, f64::min);
        let extent_mm = most_extent_mm.min(MOST_SHARE * nearest);
        let parts = ((depths[1] - depths[0]).abs() / extent_mm).ceil().clamp(1.0, MOST_PARTS);
        for part in 0..parts as u32 {
            let [a, b] = [part, part + 1].map(|i| from.lerp(to, f64::from(i) / parts));
            let middle = 0.5 * (a + b);
            let (ray, texel_mm2) = self.ray_and_area(middle);
            visit(TexelSegment {
                texel,
                depth_mm: self.depth(middle),
                extent_mm: (self.depth(b) - self.depth(a)).abs(),
                across_mm: (b - a).cross(ray).length(),
                texel_mm2,
            });
        }
    }

    /// Returns the distance from the light to a point, which is given along the axes of the light, mm; infinite for a
    /// directional light.
    fn distance(&self, p: DVec3) -> f64 {
        match self.projection {
            Projection::Orthographic => f64::INFINITY,
            Projection::Perspective => (p + DVec3::Z * self.light_distance).length(),
            Projection::Octahedral => p.length(),
        }
    }

    /// Returns the direction of the light ray through a point, and the cross-section (mm^2) of a shadow-map texel
    /// perpendicular to the ray there. Point and direction are given along the axes of the light.
    fn ray_and_area(&self, p: DVec3) -> (DVec3, f64) {
        let plane_mm2 = 1.0 / (self.texel_scale.x * self.texel_scale.y).abs();
        let (direction, on_plane) = match self.projection {
            Projection::Orthographic => return (DVec3::Z, plane_mm2),
            Projection::Perspective => {
                let direction = p + DVec3::Z * self.light_distance;
                (direction, direction.z)
            }
            Projection::Octahedral => (p, p.abs().element_sum()),
        };
        // An area of the plane at distance l from the light, at an angle with cosine 1 / l, covers the solid angle
        // area / l^3; here both are scaled to the point.
        let distance = direction.length().max(f64::MIN_POSITIVE);
        (direction / distance, plane_mm2 * on_plane.powi(3) / distance)
    }
}

/// Largest number of parts into which a line segment is cut in one texel of a shadow map, to limit the depth of each
/// part. A longer segment has deeper parts.
const MOST_PARTS: f64 = 4096.0;
/// Largest depth that a part of a line segment spans in a shadow-map texel, as a share of its distance from the
/// light.
const MOST_SHARE: f64 = 0.1;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::light_space::MapShape;
    use crate::field::{ActiveBricks, March};
    use crate::phantom::Phantom;
    use crate::scene::Light;
    use crate::transfer::{Quantity, TransferFunction};

    fn spaces() -> Vec<LightSpace> {
        let volume = Phantom::Slab.build(24).unwrap();
        let tf = TransferFunction::new(Quantity::Extinction, &[(-1e9, 0.1), (1e9, 0.1)]);
        let active = ActiveBricks::of(volume.bricks(), &tf);
        let shape = MapShape {
            texels: Some(37),
            fits_view: false,
            reach: 1,
            border: 1,
            march: March::Cells,
            near: 0.0,
        };
        let lights = [
            Light::Directional { toward: DVec3::new(0.3, -0.5, 0.8) },
            Light::Point { position: DVec3::new(90.0, 20.0, 40.0) },
            Light::Point { position: DVec3::new(1.0, 2.0, -0.5) },
        ];
        let spaces: Vec<_> =
            lights.iter().map(|light| LightSpace::fit(&volume, &active, *light, shape, None)).collect();
        let kinds: Vec<_> = spaces.iter().map(|space| space.projection).collect();
        assert_eq!(kinds, [Projection::Orthographic, Projection::Perspective, Projection::Octahedral]);
        spaces
    }

    /// Finds the shadow-map texels that a line crosses, by projecting many of its points.
    fn texels_of_points(space: &LightSpace, ends: [DVec3; 2], points: u32) -> Vec<[u32; 2]> {
        let mut found = Vec::new();
        for i in 0..points {
            let (at, _) = space.light_point(ends[0].lerp(ends[1], (f64::from(i) + 0.5) / f64::from(points)));
            let last = f64::from(space.map_size) - 1.0;
            let texel = (at + 0.5).floor();
            if texel.min_element() >= 0.0 && texel.max_element() <= last {
                let texel = [texel.x as u32, texel.y as u32];
                if found.last() != Some(&texel) {
                    found.push(texel);
                }
            }
        }
        found
    }

    #[test]
    fn a_line_is_cut_where_its_points_change_texels() {
        let ends = [
            [DVec3::new(-9.0, 4.0, 3.0), DVec3::new(8.0, -7.0, 9.0)],
            [DVec3::new(2.0, -9.0, -8.0), DVec3::new(-3.0, 9.0, 5.0)],
            [DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.4, 0.1, 0.35)],
        ];
        for space in spaces() {
            for ends in ends {
                let (mut texels, mut across) = (Vec::new(), 0.0);
                space.texels_along(ends, f64::INFINITY, |part| {
                    if texels.last() != Some(&part.texel) {
                        texels.push(part.texel);
                    }
                    across += part.across_mm;
                });
                let of_points = texels_of_points(&space, ends, 200_000);
                let rare = texels.iter().filter(|t| !of_points.contains(t)).count();
                assert!(
                    of_points.iter().all(|t| texels.contains(t)) && rare <= 1,
                    "{:?}: {texels:?} {of_points:?}",
                    space.projection
                );
                if space.projection == Projection::Orthographic {
                    let toward = DVec3::new(0.3, -0.5, 0.8).normalize();
                    let seen = (ends[1] - ends[0]).cross(toward).length();
                    assert!((across - seen).abs() < 1e-9 * seen, "{across} {seen}");
                }
            }
        }
    }

    #[test]
    fn parts_are_within_the_limit_and_cover_the_depths_of_the_line() {
        let ends = [DVec3::new(-9.0, 4.0, 3.0), DVec3::new(8.0, -7.0, 9.0)];
        for space in spaces() {
            let (mut deepest, mut sum) = (0.0_f64, 0.0);
            let [first, last] = ends.map(|p| space.light_point(p).1);
            space.texels_along(ends, 0.05, |part| {
                deepest = deepest.max(part.extent_mm);
                sum += part.extent_mm;
                // A point light is nearer to the middle of a line than to its ends.
                let reach = ends[0].distance(ends[1]);
                assert!(part.depth_mm > first.min(last) - reach && part.depth_mm < first.max(last) + 1e-9);
            });
            // Depth does not go evenly along a line, seen from a point.
            assert!(deepest <= 0.055, "{deepest}");
            assert!(sum >= (last - first).abs() - 1e-9, "{sum} {first} {last}");
        }
    }

    #[test]
    fn texel_areas_agree_with_their_rays() {
        for space in spaces() {
            let world = DVec3::new(3.0, -4.0, 5.0);
            let (at, depth) = space.light_point(world);
            let texel = (at + 0.5).floor();
            // Corners of a small part of the texel, at the point's depth.
            let h = 1e-4;
            let corner = |x: f64, y: f64| {
                let (start, way) = space.world_ray(at + h * glam::DVec2::new(x, y));
                start + depth * way
            };
            let (right, up) = (corner(1.0, 0.0) - corner(0.0, 0.0), corner(0.0, 1.0) - corner(0.0, 0.0));
            let truth = right.cross(up).length() / (h * h);
            let mut found = Vec::new();
            let shift = DVec3::new(1e-3, 1e-3, 0.0);
            space.texels_along([world - shift, world + shift], f64::INFINITY, |part| {
                found.push((part.texel, part.texel_mm2));
            });
            assert!(found.iter().any(|(t, _)| *t == [texel.x as u32, texel.y as u32]), "{found:?}");
            for (_, area) in found {
                assert!((area - truth).abs() < 2e-3 * truth, "{:?}: {area} {truth}", space.projection);
            }
        }
    }
}
