//! Solids of the chest phantom: heart, vessels, airways and bones as tubes, plates and ellipsoids.

use super::noise::uniform;
use super::regions::{CAVITY_HALF, CAVITY_Y, HEART, cavity_scale, lungs};
use super::shape::{Painter, Part, Solid, drum, path, plate, smooth, tube};
use glam::{Vec3, vec2, vec3};

/// Returns all solids of the chest phantom in painting order; later solids cover earlier ones.
pub fn solids() -> Vec<Solid> {
    let mut painter = Painter::default();
    abdomen(&mut painter);
    lung_vessels(&mut painter);
    heart(&mut painter);
    great_vessels(&mut painter);
    airways(&mut painter);
    spine(&mut painter);
    ribs(&mut painter);
    sternum_and_shoulders(&mut painter);
    painter.solids
}

fn abdomen(painter: &mut Painter) {
    painter.ellipsoid(118.0, vec3(-88.0, -28.0, -98.0), vec3(-0.3, 0.3, 0.9), vec3(44.0, 24.0, 30.0));
    painter.ellipsoid(45.0, vec3(-52.0, 30.0, -100.0), vec3(-0.4, 0.2, 1.0), vec3(46.0, 34.0, 34.0));
    painter.ellipsoid(-960.0, vec3(-54.0, 46.0, -88.0), vec3(-0.4, 0.1, 1.0), vec3(26.0, 17.0, 20.0));
}

fn heart(painter: &mut Painter) {
    let apex = vec3(-0.62, 0.52, -0.58).normalize();
    painter.ellipsoid(115.0, HEART, apex, vec3(58.0, 43.0, 43.0));
    // Left and right ventricle, left and right atrium.
    painter.ellipsoid(350.0, HEART + vec3(-14.0, -8.0, -4.0), apex, vec3(38.0, 19.0, 19.0));
    painter.ellipsoid(300.0, HEART + vec3(8.0, 20.0, -6.0), apex, vec3(36.0, 15.0, 18.0));
    painter.ellipsoid(360.0, HEART + vec3(14.0, -32.0, 22.0), vec3(1.0, 0.1, 0.1), vec3(26.0, 17.0, 19.0));
    painter.ellipsoid(270.0, HEART + vec3(42.0, -4.0, 6.0), vec3(0.1, 0.2, 1.0), vec3(25.0, 18.0, 18.0));
    // Coronary arteries run on the surface: points in the ellipsoid's frame, projected onto it.
    let side = apex.cross(Vec3::Z).normalize();
    let front = side.cross(apex);
    let on_surface = |along: f32, turn: f32| {
        let ring = (1.0 - along * along).max(0.0).sqrt() * 44.0;
        HEART + apex * (58.5 * along) + (front * turn.cos() + side * turn.sin()) * ring
    };
    for (turn, sweep) in [(0.35, 0.25), (-0.9, -0.8), (1.6, 1.1), (2.7, -0.5)] {
        let points: Vec<Vec3> = (0..=24)
            .map(|i| {
                let t = i as f32 / 24.0;
                on_surface(-0.55 + 1.35 * t, turn + sweep * t + 0.08 * (9.0 * t).sin())
            })
            .collect();
        painter.path(370.0, &points, [2.3, 1.1]);
    }
}

fn great_vessels(painter: &mut Painter) {
    let aorta = [
        vec3(-8.0, 14.0, -8.0),
        vec3(8.0, 24.0, 22.0),
        vec3(14.0, 20.0, 50.0),
        vec3(2.0, 2.0, 72.0),
        vec3(-16.0, -20.0, 68.0),
        vec3(-24.0, -36.0, 48.0),
        vec3(-24.0, -38.0, 0.0),
        vec3(-18.0, -34.0, -60.0),
        vec3(-8.0, -28.0, -140.0),
    ];
    painter.curve(360.0, [15.0, 10.5], &aorta);
    for (from, to, radius) in [
        (vec3(10.0, 8.0, 70.0), vec3(22.0, 4.0, 140.0), 6.0),
        (vec3(-4.0, -4.0, 74.0), vec3(-16.0, 0.0, 140.0), 4.2),
        (vec3(-13.0, -16.0, 70.0), vec3(-34.0, -8.0, 140.0), 5.0),
    ] {
        painter.curve(355.0, [radius, 0.8 * radius], &[from, 0.5 * (from + to) + vec3(0.0, 3.0, 0.0), to]);
    }
    // Superior and inferior vena cava, pulmonary trunk and its two branches.
    let superior = [vec3(30.0, 12.0, 140.0), vec3(28.0, 10.0, 60.0), vec3(24.0, 14.0, -18.0)];
    painter.curve(420.0, [9.5, 10.0], &superior);
    painter.path(170.0, &[vec3(24.0, 8.0, -40.0), vec3(20.0, -14.0, -140.0)], [11.0, 12.0]);
    let fork = vec3(-16.0, 16.0, 32.0);
    painter.curve(340.0, [13.0, 13.0], &[vec3(-14.0, 46.0, -14.0), vec3(-18.0, 38.0, 14.0), fork]);
    painter.curve(340.0, [11.0, 8.0], &[fork, vec3(-30.0, 0.0, 32.0), hilum(-1.0)]);
    painter.curve(340.0, [11.0, 8.0], &[fork, vec3(10.0, 2.0, 28.0), hilum(1.0)]);
    let oesophagus = [vec3(-4.0, -28.0, 140.0), vec3(2.0, -32.0, 30.0), vec3(-12.0, -18.0, -140.0)];
    painter.curve(35.0, [7.0, 7.0], &oesophagus);
}

/// Position of a hilum in the chest phantom, mm: the point where vessels and airways enter a lung. `side` is 1 on the
/// right (+x), -1 on the left.
fn hilum(side: f32) -> Vec3 {
    vec3(side * 40.0, -8.0, 22.0)
}

fn airways(painter: &mut Painter) {
    let carina = vec3(2.0, -14.0, 46.0);
    let trachea = [vec3(0.0, -6.0, 140.0), vec3(1.0, -10.0, 90.0), carina];
    let mut tubes = vec![(smooth(&trachea), [9.0, 8.5])];
    for side in [-1.0, 1.0] {
        let root = hilum(side) + vec3(0.0, -6.0, 2.0);
        tubes.push((vec![carina, root], [7.0, 5.5]));
        for (to, radius) in [
            (vec3(side * 62.0, 0.0, 58.0), 3.4),
            (vec3(side * 66.0, 26.0, 8.0), 3.0),
            (vec3(side * 62.0, -30.0, -10.0), 3.8),
        ] {
            tubes.push((
                smooth(&[root, 0.6 * root + 0.4 * to + vec3(0.0, 0.0, -2.0), to]),
                [radius + 1.2, radius - 0.8],
            ));
        }
    }
    // All walls before all lumens, so that branches open into each other.
    let wider = |mm: f32| {
        let tubes = tubes.iter();
        tubes.flat_map(|(points, radii)| path(points, radii.map(|r| r + mm), 1.0)).collect::<Vec<Part>>()
    };
    painter.solid(20.0, wider(1.4));
    painter.solid(-985.0, wider(0.0));
}

/// Adds the arteries and veins of both lungs to the chest phantom. Each vessel forks into two thinner ones by
/// Murray's law (2^(-1/3)).
fn lung_vessels(painter: &mut Painter) {
    struct Branch {
        from: Vec3,
        direction: Vec3,
        radius: f32,
        length: f32,
        seed: u64,
    }
    for (tree, start) in [Vec3::ZERO, vec3(0.0, 8.0, -22.0)].into_iter().enumerate() {
        for side in [-1.0f32, 1.0] {
            let root = hilum(side) + start;
            let mut open: Vec<Branch> = (0..7)
                .map(|i| {
                    let seed = (tree as u64) << 60 | u64::from(side > 0.0) << 59 | (i + 1) << 50;
                    let turn = std::f32::consts::TAU * (i as f32 + 0.5 * uniform(seed)) / 7.0;
                    let direction = vec3(side * 0.75, turn.cos(), 1.15 * turn.sin()).normalize();
                    Branch { from: root, direction, radius: 4.4, length: 27.0, seed }
                })
                .collect();
            while let Some(branch) = open.pop() {
                let Some(end) = reach(branch.from, branch.direction, branch.length) else { continue };
                let thinner = branch.radius * 0.5f32.powf(1.0 / 3.0);
                // Contrast fades to tissue in the smallest ones.
                let hu = 60.0 + 60.0 * branch.radius.min(4.0);
                let radii = [branch.radius, 0.5 * (branch.radius + thinner)];
                painter.solid(hu, vec![tube(branch.from, end, radii, 1.0)]);
                if thinner < 0.55 {
                    continue;
                }
                let plane = branch.direction.any_orthonormal_vector();
                let spin = std::f32::consts::TAU * uniform(branch.seed ^ 0x51);
                let across = plane * spin.cos() + branch.direction.cross(plane) * spin.sin();
                for (child, sign) in [1.0f32, -1.0].into_iter().enumerate() {
                    let seed =
                        branch.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1 + child as u64);
                    let spread = sign * (0.45 + 0.35 * uniform(seed ^ 0xa7));
                    open.push(Branch {
                        from: end,
                        direction: (branch.direction + across * spread).normalize(),
                        radius: thinner * (0.92 + 0.12 * uniform(seed ^ 0x3c)),
                        length: branch.length * (0.72 + 0.25 * uniform(seed ^ 0x99)),
                        seed,
                    });
                }
            }
        }
    }
}

/// Returns the end point of a vessel branch in the chest phantom, shortened to lie in the lung; `None` if too little
/// remains.
fn reach(from: Vec3, direction: Vec3, length: f32) -> Option<Vec3> {
    [1.0, 0.7, 0.45]
        .into_iter()
        .map(|share| from + direction * (share * length))
        .find(|&end| lungs(end) < -3.0)
}

/// Returns the y coordinate of the spine of the chest phantom at height `z`, mm. It follows the thoracic kyphosis.
fn spine_y(z: f32) -> f32 {
    -46.0 - 6.0 * (1.0 - (z / 128.0).powi(2))
}

fn spine(painter: &mut Painter) {
    const PITCH_MM: f32 = 24.0;
    // Discs first, then the vertebrae over their rims, then the canal.
    for half in -13..=13 {
        let z = 0.5 * half as f32 * PITCH_MM;
        let center = vec3(0.0, spine_y(z), z);
        let (x, y) = (vec3(5.5, 0.0, 0.0), vec3(0.0, 12.0, 0.0));
        if half % 2 != 0 {
            painter.solid(85.0, vec![tube(center - x, center + x, [11.5; 2], 0.62)]);
            continue;
        }
        // A drum, a little wider at the end plates.
        for (hu, inset) in [(620.0, 0.0), (230.0, 1.9)] {
            painter.solid(hu, vec![drum(center, vec2(5.5, 9.8 - inset), 11.0 - inset, 0.018)]);
        }
        let arch = center - 2.1 * y;
        for side in [-1.0, 1.0] {
            let pedicle = center + vec3(side * 11.0, -9.0, 3.0);
            let joint = arch + vec3(side * 12.5, 0.0, 1.0);
            painter.bone(&[pedicle, joint], 4.2, 1.6, 1.3);
            painter.bone(&[joint, arch + vec3(0.0, -9.0, -2.0)], 4.0, 1.6, 1.6);
            painter.bone(&[joint, joint + vec3(side * 22.0, -7.0, 3.0)], 4.0, 1.5, 1.0);
        }
        painter.bone(&[arch + vec3(0.0, -9.0, -2.0), arch + vec3(0.0, -22.0, -16.0)], 3.4, 1.5, 1.5);
    }
    let canal: Vec<Vec3> =
        (-15..=15).map(|i| vec3(0.0, spine_y(9.0 * i as f32) - 20.5, 9.0 * i as f32)).collect();
    painter.path(15.0, &canal, [7.5; 2]);
    painter.path(45.0, &canal, [4.6; 2]);
}

fn ribs(painter: &mut Painter) {
    for number in 1..=11u16 {
        let n = f32::from(number);
        let head_z = 112.0 - 21.0 * (n - 1.0);
        let drop_mm = 26.0 + 5.0 * n.min(6.0);
        // Angle from straight back to where the bone ends; the lower ribs are shorter.
        let end = (152.0 - 9.0 * (n - 6.0).max(0.0)).to_radians();
        for side in [-1.0, 1.0] {
            let point = |t: f32| {
                let angle = 0.2 + (end - 0.2) * t;
                let z = head_z + 4.0 - drop_mm * t.powf(1.15);
                let half = (CAVITY_HALF + 5.0) * cavity_scale(z).max(0.36);
                let bend = |v: f32| v.abs().powf(0.8) * v.signum();
                vec3(side * half.x * bend(angle.sin()), CAVITY_Y - half.y * bend(angle.cos()), z)
            };
            let mut points: Vec<Vec3> = (0..=28).map(|i| point(i as f32 / 28.0)).collect();
            points.insert(0, vec3(side * 15.0, spine_y(head_z) - 6.0, head_z + 2.0));
            painter.solid(700.0, path(&points, [3.7; 2], 1.7));
            painter.solid(280.0, path(&points, [2.1; 2], 1.7));
            if number <= 8 {
                let from = point(1.0);
                let z = (from.z + 9.0 + 4.0 * (n - 4.0).max(0.0)).max(-40.0);
                let to = vec3(side * 14.0, sternum_y(z), z);
                let middle = 0.5 * (from + to) + vec3(0.0, 4.0, -6.0);
                painter.curve(190.0, [5.2, 5.0], &[from, middle, to]);
            }
        }
    }
}

/// Returns the y coordinate of the front of the rib cage of the chest phantom at height `z`, mm, where the sternum
/// lies.
fn sternum_y(z: f32) -> f32 {
    CAVITY_Y + (CAVITY_HALF.y + 5.0) * cavity_scale(z)
}

fn sternum_and_shoulders(painter: &mut Painter) {
    // Both edges of a plate that is narrow below and broad above, where it is the manubrium.
    let edges: Vec<[Vec3; 2]> = (0..=26)
        .map(|layer| {
            let z = -46.0 + 5.0 * layer as f32;
            let half_width = if z > 50.0 { 12.0 + 0.35 * (z - 50.0) } else { 11.0 + 2.0 * (0.12 * z).sin() };
            [-1.0, 1.0].map(|side| vec3(side * half_width, sternum_y(z), z))
        })
        .collect();
    for (hu, radius) in [(620.0, 5.2), (240.0, 3.6)] {
        let triangles = edges.windows(2).flat_map(|layers| {
            let [[a, b], [c, d]] = [layers[0], layers[1]];
            [plate([a, b, c], radius), plate([b, c, d], radius)]
        });
        painter.solid(hu, triangles.collect());
    }
    for side in [-1.0, 1.0] {
        let clavicle = smooth(&[
            vec3(side * 20.0, sternum_y(84.0) + 2.0, 92.0),
            vec3(side * 55.0, sternum_y(84.0) + 8.0, 100.0),
            vec3(side * 88.0, 40.0, 108.0),
            vec3(side * 118.0, 12.0, 116.0),
        ]);
        painter.bone(&clavicle, 5.8, 2.0, 1.0);
        // Scapula: a thin blade along the back of the cage with thicker borders, and its spine.
        let mirror = vec3(side, 1.0, 1.0);
        let blade = [vec3(72.0, -84.0, 92.0), vec3(120.0, -62.0, 96.0), vec3(86.0, -88.0, 4.0)];
        let blade = blade.map(|p| p * mirror);
        let [inner, outer, tip] = blade;
        let mut bone = vec![plate(blade, 1.8)];
        bone.extend(path(&[inner, tip], [2.8; 2], 1.0));
        bone.extend(path(&[outer, tip], [4.2, 3.2], 1.0));
        painter.solid(640.0, bone);
        painter.solid(280.0, path(&[outer, tip], [2.4, 1.4], 1.0));
        let spine = [vec3(74.0, -88.0, 78.0), vec3(104.0, -84.0, 92.0), vec3(132.0, -58.0, 106.0)];
        painter.bone(&smooth(&spine.map(|p| p * mirror)), 4.6, 1.7, 1.0);
    }
}
