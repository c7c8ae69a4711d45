//! Large regions of the chest phantom as implicit functions: skin, fat, muscle, lungs, diaphragm, scanner table.

use glam::{Vec2, Vec3, vec2, vec3};

/// CT number of air, HU.
pub const AIR: f32 = -1000.0;

/// Blends two CT numbers across an edge like a CT scanner, from the signed distance to the edge (below 0 inside).
/// Detector and reconstruction each average over about one voxel, which together is a tent filter two voxels wide.
pub fn over(outside: f32, inside: f32, distance: f32, cell: f32) -> f32 {
    let t = (distance / cell).clamp(-1.0, 1.0);
    // Integral of the tent up to the edge.
    let within = 0.5 * (1.0 - t.abs()).powi(2);
    outside + (inside - outside) * if t < 0.0 { 1.0 - within } else { within }
}

/// Signed distance to a surface of the chest phantom, and the width of its blurred edge.
#[derive(Clone, Copy)]
struct Surface {
    /// Signed distance to the surface of the region in the chest phantom, mm, below 0 inside.
    mm: f32,
    /// Width of the blurred edge of the surface, mm: the extent of a voxel along the surface normal.
    edge_mm: f32,
}

impl Surface {
    /// Computes the signed distance and edge width of a surface from value and gradient of its implicit function, for
    /// voxels of size `cell` in mm.
    fn new(value: f32, gradient: Vec3, cell: Vec3) -> Self {
        let slope = gradient.length().max(1e-6);
        Self { mm: value / slope, edge_mm: (gradient * cell).length() / slope }
    }

    /// Offsets a surface of the chest phantom inwards by `mm` millimetres.
    fn inward(self, mm: f32) -> Self {
        Self { mm: self.mm + mm, ..self }
    }

    /// Returns the surface of the complement of a region of the chest phantom.
    fn outside(self) -> Self {
        Self { mm: -self.mm, ..self }
    }

    /// Returns the surface of the intersection of two regions of the chest phantom.
    fn and(self, other: Self) -> Self {
        if self.mm > other.mm { self } else { other }
    }

    fn is_far_outside(self) -> bool {
        self.mm > self.edge_mm
    }

    fn is_far_inside(self) -> bool {
        self.mm < -self.edge_mm
    }

    fn over(self, outside: f32, inside: f32) -> f32 {
        over(outside, inside, self.mm, self.edge_mm)
    }
}

/// Returns the CT number (HU) of the chest phantom at a point, without bones, vessels and other solids that are
/// painted later. `cell` is the voxel size in mm.
pub fn tissue(p: Vec3, cell: Vec3) -> f32 {
    let body = body(p, cell);
    let outside = table(p, cell);
    if body.is_far_outside() {
        return outside;
    }
    let mut hu = body.over(outside, 30.0);
    hu = body.inward(2.5).over(hu, -105.0);
    // Fat is thicker at the sides and in front than at the back.
    let fat_mm = 9.0 + 5.0 * (p.x / 160.0).powi(2) + 4.0 * (p.y / 110.0).max(0.0);
    let muscle = body.inward(fat_mm);
    if muscle.is_far_outside() {
        return hu;
    }
    hu = muscle.over(hu, 55.0);
    let cavity = cavity(p, cell);
    if cavity.is_far_outside() {
        return hu;
    }
    let below = diaphragm(p, cell);
    // Lungs sink under their own weight: denser towards the back.
    let lung_hu = -840.0 - 0.45 * (p.y - 10.0);
    let lung = lung_from(p, cavity, below);
    if lung.is_far_inside() {
        return lung_hu;
    }
    let mut inside = mediastinum_hu(p);
    if !below.is_far_inside() {
        inside = below.outside().over(inside, abdomen_hu(p, cell));
    }
    hu = cavity.over(hu, inside);
    lung.over(hu, lung_hu)
}

/// Returns the signed distance to the skin of the chest phantom, to first order.
fn body(p: Vec3, cell: Vec3) -> Surface {
    let up = (p.z / 128.0).clamp(-0.5, 1.0);
    let half = vec2(162.0 - 14.0 * up * up, 112.0 - 12.0 * up * up);
    let q = vec2(p.x, p.y - 8.0).abs() / half;
    let slope = q * vec2(q.x.sqrt(), q.y.sqrt());
    Surface::new(slope.dot(q) - 1.0, (2.5 * slope / half).extend(0.0), cell)
}

/// Rib cage of the chest phantom, mm: y coordinate of its axis, and half axes of its elliptic cross-section along x
/// and y.
pub const CAVITY_Y: f32 = 12.0;
pub const CAVITY_HALF: Vec2 = vec2(128.0, 80.0);

/// Returns the relative height of a point within the tapered top of the rib cage: 0 at its lower end, 1 at the tip.
fn apex(z: f32) -> f32 {
    ((z + 20.0) / 142.0).max(0.0)
}

/// Returns the width of the rib cage of the chest phantom at height `z` in mm, relative to its largest width.
pub fn cavity_scale(z: f32) -> f32 {
    (1.0 - apex(z).min(1.0).powf(2.5)).powf(0.4)
}

/// Returns the signed distance to the inner wall of the rib cage of the chest phantom, to first order.
fn cavity(p: Vec3, cell: Vec3) -> Surface {
    let u = p.x.abs() / CAVITY_HALF.x;
    let v = (p.y - CAVITY_Y).abs() / CAVITY_HALF.y;
    let w = apex(p.z);
    let slopes = [u, v, w].map(|t| t * t.sqrt());
    let value = slopes[0] * u + slopes[1] * v + slopes[2] * w - 1.0;
    let gradient = vec3(slopes[0] / CAVITY_HALF.x, slopes[1] / CAVITY_HALF.y, slopes[2] / 142.0);
    Surface::new(value, 2.5 * gradient, cell)
}

/// Returns the signed distance to the diaphragm of the chest phantom, positive below it. The diaphragm has two domes,
/// the right one (+x) higher.
fn diaphragm(p: Vec3, cell: Vec3) -> Surface {
    let dome = |x: f32, top: f32| {
        let off = vec2(p.x - x, p.y - 8.0);
        let height = top - 40.0 * ((off.x / 78.0).powi(2) + (off.y / 92.0).powi(2));
        (height, -80.0 * vec2(off.x / (78.0 * 78.0), off.y / (92.0 * 92.0)))
    };
    let (right, left, floor) = (dome(60.0, -34.0), dome(-62.0, -44.0), (-112.0, Vec2::ZERO));
    let higher = |a: (f32, Vec2), b: (f32, Vec2)| if a.0 > b.0 { a } else { b };
    let (height, slope) = higher(higher(right, left), floor);
    let surface = Surface::new(1.0, slope.extend(-1.0), cell);
    Surface { mm: 0.8 * (height - p.z), ..surface }
}

/// Returns the signed distance to the lungs of the chest phantom, mm. The lungs lie in the rib cage, above the
/// diaphragm, beside the mediastinum.
pub fn lungs(p: Vec3) -> f32 {
    lung_from(p, cavity(p, Vec3::ONE), diaphragm(p, Vec3::ONE)).mm
}

fn lung_from(p: Vec3, cavity: Surface, below: Surface) -> Surface {
    let within = cavity.inward(3.0).and(below.inward(2.0));
    if within.mm > 30.0 {
        return within;
    }
    // The two lungs come close to each other in front of the heart and part around the spine.
    let front = ((p.y - 20.0) / 60.0).clamp(0.0, 1.0);
    let middle = p.x.abs() - (27.0 - 19.0 * front);
    let spine = vec2(p.x, p.y + 52.0).length() - 25.0;
    let heart = ((p - HEART).length() - 52.0).max(-30.0);
    // These surfaces are upright but for the heart, which its own walls cover.
    within.and(Surface { mm: -middle.min(spine).min(heart), edge_mm: cavity.edge_mm })
}

/// Centre of the heart in the chest phantom, mm.
pub const HEART: Vec3 = vec3(-18.0, 22.0, -30.0);

fn mediastinum_hu(p: Vec3) -> f32 {
    // Fat with strands of soft tissue.
    -80.0 + 25.0 * ((0.11 * p.x + 0.07 * p.z).sin() * (0.13 * p.y - 0.05 * p.z).sin())
}

/// Returns the CT number (HU) in the abdomen of the chest phantom: liver on the right, fat on the left. Stomach and
/// spleen are painted later.
fn abdomen_hu(p: Vec3, cell: Vec3) -> f32 {
    let plane = -(p.x + 30.0 + 0.35 * (p.z + 70.0));
    Surface::new(plane, vec3(-1.0, 0.0, -0.35), cell).over(-95.0, 112.0)
}

/// Returns the CT number (HU) outside of the chest phantom's body: air, or the scanner table, which is a thin shell
/// filled with foam.
fn table(p: Vec3, cell: Vec3) -> f32 {
    let top = -107.0 + p.x * p.x / 840.0;
    let depth = top - p.y;
    if depth < -cell.y || p.x.abs() > 172.0 {
        return AIR;
    }
    let slab = (depth - 9.0).abs() - 9.0;
    let side = p.x.abs() - 168.0;
    let shape = Surface { mm: slab.max(side), edge_mm: if slab > side { cell.y } else { cell.x } };
    shape.inward(2.2).over(shape.over(AIR, -180.0), -930.0)
}
