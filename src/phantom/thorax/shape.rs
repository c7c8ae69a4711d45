//! Solids of the chest phantom, each a union of geometric primitives with one CT number.

use glam::{Mat3, Vec2, Vec3, vec2, vec3};

/// Solid with one CT number (HU). It is a union of primitives without edges between them.
#[derive(Debug)]
pub struct Solid {
    pub hu: f32,
    pub parts: Vec<Part>,
}

/// Geometric primitive of a solid: tube, ellipsoid, plate or drum.
#[derive(Debug)]
pub struct Part {
    /// Corners of the bounding box of the geometric primitive, mm.
    pub low: Vec3,
    pub high: Vec3,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// Tube: a round cone between two points; `flatten` above 1 makes its cross-section taller than wide.
    Tube { a: Vec3, along: Vec3, radii: [f32; 2], flatten: f32 },
    /// Ellipsoid; `local` maps positions relative to its centre to the unit ball.
    Ellipsoid { center: Vec3, local: Mat3 },
    /// Plate: points within `radius` of a triangle with corner `a` and two edge vectors.
    Plate { a: Vec3, sides: [Vec3; 2], radius: f32 },
    /// Drum: an upright body with rounded rims and half height `half.y`, straight over a half width `half.x`. Its
    /// radius is `radius` at half height and grows by `flare` times the squared height.
    Drum { center: Vec3, half: Vec2, radius: f32, flare: f32 },
}

/// Radius of the rounded rims of a drum primitive, mm.
const RIM_MM: f32 = 2.0;

/// Returns the signed distance to an implicit surface, in voxels of size `cell`, to first order. The arguments are
/// value and gradient of the implicit function.
fn in_cells(value: f32, gradient: Vec3, cell: Vec3) -> f32 {
    value / (gradient * cell).length().max(1e-6)
}

impl Part {
    /// Returns the signed distance of point `p` from the geometric primitive, in voxels of size `cell` (mm), to first
    /// order. It is below 0 inside.
    pub fn distance(&self, p: Vec3, cell: Vec3) -> f32 {
        match &self.kind {
            Kind::Tube { a, along, radii, flatten } => {
                let stretch = vec3(1.0, 1.0, flatten.recip());
                let q = (p - a) * stretch;
                let t = (q.dot(*along) / along.length_squared().max(1e-6)).clamp(0.0, 1.0);
                let off = q - t * along;
                let length = off.length();
                let value = length - (radii[0] + (radii[1] - radii[0]) * t);
                in_cells(value, off * stretch / length.max(1e-6), cell)
            }
            Kind::Ellipsoid { center, local } => {
                let q = *local * (p - center);
                let length = q.length();
                in_cells(length - 1.0, local.transpose() * q / length.max(1e-6), cell)
            }
            Kind::Plate { a, sides, radius } => {
                let off = p - closest_on_triangle(p, *a, *sides);
                let length = off.length();
                in_cells(length - radius, off / length.max(1e-6), cell)
            }
            Kind::Drum { center, half, radius, flare } => {
                let q = p - center;
                let aside = vec2(q.x - q.x.clamp(-half.x, half.x), q.y);
                let length = aside.length();
                let from = vec2(length - radius - flare * q.z * q.z, q.z.abs() - half.y) + RIM_MM;
                let outside = from.max(Vec2::ZERO);
                let weight = match from.max_element() > 0.0 {
                    true => outside / outside.length(),
                    false if from.x > from.y => Vec2::X,
                    false => Vec2::Y,
                };
                let value = from.max_element().min(0.0) + outside.length() - RIM_MM;
                let across = weight.x * aside / length.max(1e-6);
                in_cells(value, across.extend(weight.y), cell)
            }
        }
    }
}

/// Returns the point of a triangle that is closest to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
fn closest_on_triangle(p: Vec3, a: Vec3, [ab, ac]: [Vec3; 2]) -> Vec3 {
    let ap = p - a;
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let (bp, cp) = (ap - ab, ap - ac);
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return a + ab;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + d1 / (d1 - d3) * ab;
    }
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return a + ac;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + d2 / (d2 - d6) * ac;
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return a + ab + w * (ac - ab);
    }
    let inverse = (va + vb + vc).recip();
    a + vb * inverse * ab + vc * inverse * ac
}

/// Creates a tube primitive: a round cone between two points.
pub fn tube(a: Vec3, b: Vec3, radii: [f32; 2], flatten: f32) -> Part {
    let mut along = b - a;
    along.z /= flatten;
    let reach = vec3(1.0, 1.0, flatten) * radii[0].max(radii[1]);
    Part { low: a.min(b) - reach, high: a.max(b) + reach, kind: Kind::Tube { a, along, radii, flatten } }
}

/// Creates tube primitives along a polyline in the chest phantom. Their radius changes linearly from the first to the
/// second of `radii`.
pub fn path(points: &[Vec3], radii: [f32; 2], flatten: f32) -> Vec<Part> {
    let last = (points.len() - 1).max(1) as f32;
    let radius = |i: usize| radii[0] + (radii[1] - radii[0]) * i as f32 / last;
    let tubes = points.windows(2).enumerate();
    tubes.map(|(i, ends)| tube(ends[0], ends[1], [radius(i), radius(i + 1)], flatten)).collect()
}

/// Subdivides a polyline into points of a Catmull-Rom curve.
pub fn smooth(points: &[Vec3]) -> Vec<Vec3> {
    const STEPS: usize = 6;
    let at = |i: isize| points[i.clamp(0, points.len() as isize - 1) as usize];
    let mut curve = Vec::with_capacity(points.len() * STEPS);
    for i in 0..points.len() as isize - 1 {
        let [p, a, b, q] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
        for step in 0..STEPS {
            let t = step as f32 / STEPS as f32;
            let (m, n) = (0.5 * (b - p), 0.5 * (q - a));
            let (t2, t3) = (t * t, t * t * t);
            curve.push(
                a * (2.0 * t3 - 3.0 * t2 + 1.0)
                    + m * (t3 - 2.0 * t2 + t)
                    + b * (3.0 * t2 - 2.0 * t3)
                    + n * (t3 - t2),
            );
        }
    }
    curve.extend(points.last());
    curve
}

/// Creates a plate primitive: all points within `radius` of a triangle.
pub fn plate([a, b, c]: [Vec3; 3], radius: f32) -> Part {
    let (low, high) = (a.min(b).min(c) - radius, a.max(b).max(c) + radius);
    Part { low, high, kind: Kind::Plate { a, sides: [b - a, c - a], radius } }
}

/// Creates a drum primitive that stands along z, see [`Kind::Drum`].
pub fn drum(center: Vec3, half: Vec2, radius: f32, flare: f32) -> Part {
    let widest = radius + flare * half.y * half.y;
    let reach = vec3(half.x + widest, widest, half.y);
    Part { low: center - reach, high: center + reach, kind: Kind::Drum { center, half, radius, flare } }
}

/// List of solids in the order in which they are painted into the chest phantom.
#[derive(Default)]
pub struct Painter {
    pub solids: Vec<Solid>,
}

impl Painter {
    pub fn solid(&mut self, hu: f32, parts: Vec<Part>) {
        self.solids.push(Solid { hu, parts });
    }

    /// Adds tubes along a polyline to the solids of the chest phantom, as one solid. Their radius changes linearly
    /// from the first to the second of `radii`.
    pub fn path(&mut self, hu: f32, points: &[Vec3], radii: [f32; 2]) {
        self.solid(hu, path(points, radii, 1.0));
    }

    /// Adds tubes along a smooth curve through `points` to the solids of the chest phantom, as one solid.
    pub fn curve(&mut self, hu: f32, radii: [f32; 2], points: &[Vec3]) {
        self.path(hu, &smooth(points), radii);
    }

    /// Adds an ellipsoid to the solids of the chest phantom. Its first half axis points along `axis`.
    pub fn ellipsoid(&mut self, hu: f32, center: Vec3, axis: Vec3, half: Vec3) {
        let x = axis.normalize();
        let y = x.any_orthonormal_vector();
        let axes = Mat3::from_cols(x, y, x.cross(y));
        let local = Mat3::from_diagonal(half.recip()) * axes.transpose();
        let reach = Vec3::splat(half.max_element());
        let part =
            Part { low: center - reach, high: center + reach, kind: Kind::Ellipsoid { center, local } };
        self.solid(hu, vec![part]);
    }

    /// Adds a bone along a polyline to the solids of the chest phantom: a cortex of thickness `cortex_mm`, with
    /// marrow inside.
    pub fn bone(&mut self, points: &[Vec3], radius: f32, cortex_mm: f32, flatten: f32) {
        self.solid(680.0, path(points, [radius; 2], flatten));
        self.solid(260.0, path(points, [radius - cortex_mm; 2], flatten));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::thorax::regions::over;

    /// Returns the exact value of a voxel at the edge of a geometric primitive of value 1 in surroundings of 0: the
    /// tent-weighted mean, by supersampling.
    fn scanned(part: &Part, at: Vec3, cell: Vec3) -> f32 {
        const SIDE: i32 = 14;
        let offset = |i: i32| 2.0 * (i as f32 + 0.5) / SIDE as f32 - 1.0;
        let (mut sum, mut all) = (0.0, 0.0);
        for i in 0..SIDE * SIDE * SIDE {
            let share = vec3(offset(i % SIDE), offset(i / SIDE % SIDE), offset(i / (SIDE * SIDE)));
            let weight = (1.0 - share.abs()).element_product();
            all += weight;
            sum += if part.distance(at + share * cell, Vec3::ONE) < 0.0 { weight } else { 0.0 };
        }
        sum / all
    }

    /// Blurred edges of solids match supersampled ones to a few hundredths, for curved and slanted surfaces and any
    /// voxel size.
    #[test]
    fn edges_are_partial_volumes() {
        let mut painter = Painter::default();
        painter.ellipsoid(0.0, Vec3::ZERO, vec3(0.3, 0.5, 0.8), vec3(17.0, 13.0, 11.0));
        let mut parts = painter.solids.remove(0).parts;
        parts.push(tube(vec3(-6.0, 2.0, -5.0), vec3(7.0, -3.0, 6.0), [9.0, 8.0], 1.3));
        parts.push(plate([vec3(-9.0, 0.0, -8.0), vec3(8.0, 3.0, -5.0), vec3(0.0, -4.0, 9.0)], 5.0));
        parts.push(drum(Vec3::ZERO, vec2(5.5, 9.0), 11.0, 0.02));
        for cell in [vec3(1.4, 1.4, 2.0), vec3(0.8, 0.8, 1.6), vec3(1.0, 1.0, 1.0)] {
            for (number, part) in parts.iter().enumerate() {
                let (mut edges, mut worst, mut sum) = (0, 0.0f32, 0.0);
                for i in 0..4000 {
                    // Low-discrepancy points over the whole box.
                    let share = vec3(0.618_034, 0.754_877_7, 0.569_840_3) * i as f32;
                    let at = part.low + (share - share.floor()) * (part.high - part.low);
                    let painted = over(0.0, 1.0, part.distance(at, cell), 1.0);
                    if painted > 0.0 && painted < 1.0 {
                        let off = painted - scanned(part, at, cell);
                        (edges, worst, sum) = (edges + 1, worst.max(off.abs()), sum + off * off);
                    }
                }
                let rms = (sum / edges as f32).sqrt();
                println!("{cell} {number}: {edges} edges, off by {rms} (rms), {worst} (most)");
                assert!(edges > 100 && rms < 0.04 && worst < 0.16, "{cell} {number}: {rms} {worst}");
            }
        }
    }

    #[test]
    fn parts_lie_within_their_boxes() {
        let parts = [
            tube(Vec3::ZERO, vec3(4.0, 5.0, 6.0), [2.0, 3.0], 0.6),
            plate([Vec3::ZERO, Vec3::X * 5.0, Vec3::Y * 7.0], 2.0),
            drum(Vec3::ONE, vec2(3.0, 4.0), 5.0, 0.05),
        ];
        for part in &parts {
            let middle = 0.5 * (part.low + part.high);
            for i in 0..4000 {
                let share = vec3(0.618_034, 0.754_877_7, 0.569_840_3) * i as f32;
                let p = middle + (share - share.floor() - 0.5) * 2.0 * (part.high - part.low);
                let within = p.cmpge(part.low).all() && p.cmple(part.high).all();
                assert!(within || part.distance(p, Vec3::ONE) > -1e-4, "{p}");
            }
        }
    }
}
