//! The large regions of the chest as implicit functions of position: skin, fat, muscle, lungs, diaphragm, table.

use glam::{Vec2, Vec3, vec2, vec3};

/// HU of air.
pub const AIR: f32 = -1000.0;

/// `inside` where the signed distance is below 0, `outside` above, a ramp in between.
pub fn over(outside: f32, inside: f32, distance_mm: f32, edge_mm: f32) -> f32 {
    outside + (inside - outside) * (0.5 - distance_mm / edge_mm).clamp(0.0, 1.0)
}

/// HU of everything that is not a painted shape.
pub fn tissue(p: Vec3, edge_mm: f32) -> f32 {
    let body = body(p);
    let outside = table(p, edge_mm);
    if body > edge_mm {
        return outside;
    }
    let mut hu = over(outside, 30.0, body, edge_mm);
    hu = over(hu, -105.0, body + 2.5, edge_mm);
    // Fat is thicker at the sides and in front than at the back.
    let fat_mm = 9.0 + 5.0 * (p.x / 160.0).powi(2) + 4.0 * (p.y / 110.0).max(0.0);
    let muscle = body + fat_mm;
    if muscle > edge_mm {
        return hu;
    }
    hu = over(hu, 55.0, muscle, edge_mm);
    let cavity = cavity(p);
    if cavity > edge_mm {
        return hu;
    }
    let below = diaphragm(p);
    // Lungs sink under their own weight: denser towards the back.
    let lung_hu = -840.0 - 0.45 * (p.y - 10.0);
    let lung = lung_from(p, cavity, below);
    if lung < -edge_mm {
        return lung_hu;
    }
    let mut inside = mediastinum_hu(p);
    if below > -edge_mm {
        inside = over(inside, abdomen_hu(p, edge_mm), -below, edge_mm);
    }
    hu = over(hu, inside, cavity, edge_mm);
    over(hu, lung_hu, lung, edge_mm)
}

/// Signed distance to the skin, to first order.
fn body(p: Vec3) -> f32 {
    let up = (p.z / 128.0).clamp(-0.5, 1.0);
    let half = vec2(162.0 - 14.0 * up * up, 112.0 - 12.0 * up * up);
    superellipse(vec2(p.x, p.y - 8.0), half)
}

/// Centre of the rib cage in y, and its half axes.
pub const CAVITY_Y: f32 = 12.0;
pub const CAVITY_HALF: Vec2 = vec2(128.0, 80.0);

/// How far up the apex a height is: 0 where the cage is a cylinder, 1 at its tip.
fn apex(z: f32) -> f32 {
    ((z + 20.0) / 142.0).max(0.0)
}

/// Share of the cage's half axes that is left at a height.
pub fn cavity_scale(z: f32) -> f32 {
    (1.0 - apex(z).min(1.0).powf(2.5)).powf(0.4)
}

/// Signed distance to the inside of the rib cage, to first order.
fn cavity(p: Vec3) -> f32 {
    let u = p.x.abs() / CAVITY_HALF.x;
    let v = (p.y - CAVITY_Y).abs() / CAVITY_HALF.y;
    let w = apex(p.z);
    let slopes = [u, v, w].map(|t| t * t.sqrt());
    let value = slopes[0] * u + slopes[1] * v + slopes[2] * w - 1.0;
    let gradient = vec3(slopes[0] / CAVITY_HALF.x, slopes[1] / CAVITY_HALF.y, slopes[2] / 142.0);
    value / (2.5 * gradient.length()).max(1e-3)
}

/// Signed distance to `|x/a|^2.5 + |y/b|^2.5 = 1`, to first order.
fn superellipse(p: Vec2, half: Vec2) -> f32 {
    let q = p.abs() / half;
    let slope = q * vec2(q.x.sqrt(), q.y.sqrt());
    (slope.dot(q) - 1.0) / (2.5 * (slope / half).length()).max(1e-3)
}

/// Signed distance to the diaphragm, above 0 underneath: two domes, the right one (+x) higher.
fn diaphragm(p: Vec3) -> f32 {
    let dome = |x: f32, top: f32| top - 40.0 * (((p.x - x) / 78.0).powi(2) + ((p.y - 8.0) / 92.0).powi(2));
    (dome(60.0, -34.0).max(dome(-62.0, -44.0)).max(-112.0) - p.z) * 0.8
}

/// Signed distance to the lungs: in the cage, above the diaphragm, beside the mediastinum.
pub fn lungs(p: Vec3) -> f32 {
    lung_from(p, cavity(p), diaphragm(p))
}

fn lung_from(p: Vec3, cavity: f32, below: f32) -> f32 {
    let outside = (cavity + 3.0).max(below + 2.0);
    if outside > 30.0 {
        return outside;
    }
    // The two lungs come close to each other in front of the heart and part around the spine.
    let front = ((p.y - 20.0) / 60.0).clamp(0.0, 1.0);
    let middle = p.x.abs() - (27.0 - 19.0 * front);
    let spine = vec2(p.x, p.y + 52.0).length() - 25.0;
    let heart = ((p - HEART).length() - 52.0).max(-30.0);
    outside.max(-middle.min(spine).min(heart))
}

/// Centre of the heart.
pub const HEART: Vec3 = vec3(-18.0, 22.0, -30.0);

fn mediastinum_hu(p: Vec3) -> f32 {
    // Fat with strands of soft tissue.
    -80.0 + 25.0 * ((0.11 * p.x + 0.07 * p.z).sin() * (0.13 * p.y - 0.05 * p.z).sin())
}

/// Liver on the right, fat on the left (stomach and spleen are painted).
fn abdomen_hu(p: Vec3, edge_mm: f32) -> f32 {
    over(-95.0, 112.0, -(p.x + 30.0 + 0.35 * (p.z + 70.0)) * 0.9, edge_mm)
}

/// The scanner table's thin shell and foam, in air.
fn table(p: Vec3, edge_mm: f32) -> f32 {
    let top = -107.0 + p.x * p.x / 840.0;
    let depth = top - p.y;
    if depth < -edge_mm || p.x.abs() > 172.0 {
        return AIR;
    }
    let slab = (depth - 9.0).abs() - 9.0;
    let shape = slab.max(p.x.abs() - 168.0);
    over(over(AIR, -180.0, shape, edge_mm), -930.0, shape + 2.2, edge_mm)
}
