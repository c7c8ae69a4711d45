//! Solids of one HU value, and what collects them.

use glam::{Mat3, Vec3, vec3};

/// A solid of one HU value.
pub struct Shape {
    pub hu: f32,
    /// Bounding box, mm.
    pub low: Vec3,
    pub high: Vec3,
    kind: Kind,
}

enum Kind {
    /// A round cone between two points; `flatten` above 1 makes its cross-section taller than wide.
    Tube { a: Vec3, along: Vec3, radii: [f32; 2], flatten: f32 },
    /// `local` takes positions relative to the centre to a unit ball of size `half` (its smallest half axis).
    Ellipsoid { center: Vec3, local: Mat3, half: f32 },
}

impl Shape {
    /// Signed distance, below 0 inside; to first order.
    pub fn distance(&self, p: Vec3) -> f32 {
        match &self.kind {
            Kind::Tube { a, along, radii, flatten } => {
                let mut q = p - a;
                q.z /= flatten;
                let t = (q.dot(*along) / along.length_squared().max(1e-6)).clamp(0.0, 1.0);
                (q - t * along).length() - (radii[0] + (radii[1] - radii[0]) * t)
            }
            Kind::Ellipsoid { center, local, half } => {
                let q = *local * (p - center);
                let length = q.length();
                // The gradient's length turns the ratio into a distance.
                let gradient = (local.transpose() * q).length() / length.max(1e-3);
                (length - 1.0) / gradient.max(1e-3 / half)
            }
        }
    }
}

/// Shapes in the order in which they are painted.
#[derive(Default)]
pub struct Painter {
    pub shapes: Vec<Shape>,
}

impl Painter {
    pub fn tube(&mut self, hu: f32, a: Vec3, b: Vec3, radii: [f32; 2]) {
        self.flat_tube(hu, a, b, radii, 1.0);
    }

    pub fn flat_tube(&mut self, hu: f32, a: Vec3, b: Vec3, radii: [f32; 2], flatten: f32) {
        let mut along = b - a;
        along.z /= flatten;
        let reach = vec3(1.0, 1.0, flatten) * radii[0].max(radii[1]);
        let (low, high) = (a.min(b) - reach, a.max(b) + reach);
        self.shapes.push(Shape { hu, low, high, kind: Kind::Tube { a, along, radii, flatten } });
    }

    /// Tubes through points, the radius running from the first to the second of `radii`.
    pub fn path(&mut self, hu: f32, points: &[Vec3], radii: [f32; 2]) {
        let last = (points.len() - 1).max(1) as f32;
        let radius = |i: usize| radii[0] + (radii[1] - radii[0]) * i as f32 / last;
        for (i, ends) in points.windows(2).enumerate() {
            self.tube(hu, ends[0], ends[1], [radius(i), radius(i + 1)]);
        }
    }

    /// An ellipsoid whose first half axis points along `axis`.
    pub fn ellipsoid(&mut self, hu: f32, center: Vec3, axis: Vec3, half: Vec3) {
        let x = axis.normalize();
        let y = x.any_orthonormal_vector();
        let axes = Mat3::from_cols(x, y, x.cross(y));
        let local = Mat3::from_diagonal(half.recip()) * axes.transpose();
        let reach = Vec3::splat(half.max_element());
        let kind = Kind::Ellipsoid { center, local, half: half.min_element() };
        self.shapes.push(Shape { hu, low: center - reach, high: center + reach, kind });
    }

    /// A bone: cortex outside, marrow `cortex_mm` further in.
    pub fn bone(&mut self, a: Vec3, b: Vec3, radius: f32, cortex_mm: f32, flatten: f32) {
        self.flat_tube(680.0, a, b, [radius; 2], flatten);
        self.flat_tube(260.0, a, b, [radius - cortex_mm; 2], flatten);
    }
}
