//! Opaque objects in a volume: against the exact picture, closed forms, and the geometric shadow of a sphere.

use super::*;
use umbravox::mesh::{Mesh, MeshPart};
use umbravox::scene::{Camera, LightSource, Shading, Skip};

/// Triangles of a sphere: `2 n` by `n`.
fn sphere(center: DVec3, radius: f64, n: usize) -> Vec<[DVec3; 3]> {
    let at = |i: usize, j: usize| {
        let [phi, theta] = [i % (2 * n), j].map(|k| std::f64::consts::PI * k as f64 / n as f64);
        let ring = if j.is_multiple_of(n) { 0.0 } else { theta.sin() };
        center + radius * DVec3::new(ring * phi.cos(), ring * phi.sin(), theta.cos())
    };
    let quads = (0..2 * n).flat_map(|i| (0..n).map(move |j| (i, j)));
    let two = |(i, j): (usize, usize)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, d, c], [a, c, b]]
    };
    quads.flat_map(two).collect()
}

/// Square of two triangles, spanned by `x` and `y`.
fn square(center: DVec3, x: DVec3, y: DVec3) -> Vec<[DVec3; 3]> {
    let [a, b, c, d] = [center - x - y, center + x - y, center + x + y, center - x + y];
    vec![[a, b, c], [a, c, d]]
}

fn part(triangles: &[[DVec3; 3]], color: [f64; 3]) -> MeshPart {
    MeshPart { source: "test".into(), color, triangles: triangles.to_vec() }
}

fn mesh(parts: &[(&[[DVec3; 3]], [f64; 3])]) -> Option<Arc<Mesh>> {
    let parts = parts.iter().map(|(triangles, color)| part(triangles, *color));
    Some(Arc::new(Mesh::new(parts.collect()).unwrap()))
}

const GREEN: [f64; 3] = [0.2, 0.8, 0.3];
const BLUE: [f64; 3] = [0.1, 0.3, 0.9];

/// Ball within the volume, and a floor below it that is wider than the volume.
fn ball_and_floor(volume: &Volume) -> Option<Arc<Mesh>> {
    let corners = volume.corners_mm();
    let (center, radius) = volume.bounding_sphere_mm();
    let low = corners.iter().map(|c| c.z).fold(f64::INFINITY, f64::min);
    let ball = sphere(center + 0.1 * radius * DVec3::new(1.0, 0.7, 0.4), 0.22 * radius, 20);
    let at = DVec3::new(center.x, center.y, low - 0.1 * radius);
    // The floor is so wide that it reaches behind lights that are near.
    let floor = square(at, 4.0 * radius * DVec3::X, 4.0 * radius * DVec3::Y);
    mesh(&[(&ball, GREEN), (&floor, BLUE)])
}

#[test]
fn pictures_are_those_of_the_exact_reference() {
    for (name, range) in [("thorax:64", [-900.0, 1200.0]), ("sphere", [0.0, 1000.0])] {
        let volume = phantom(name);
        let [ramp, jumps, _] = transfer_functions(range);
        for (tf, shading) in [(&ramp, Shading::None), (&jumps, Shading::Lambert)] {
            let Some(setup) = Setup::open(&volume, tf) else { return };
            for (place, light) in lights(&volume) {
                let mesh = ball_and_floor(&volume);
                let scene = Scene { lights: vec![light.into()], shading, mesh, ..setup.scene(40, 30) };
                let exact = setup.exact().picture(&scene);
                // Pixels at the edge of a hard shadow differ by float32 rounding, and for a map by the size of its
                // texels.
                for (method, allowed, most_off) in [
                    ("rays", tolerance::RAYS_PICTURE_RMS, 2),
                    ("dsm:epsilon=0.005", tolerance::DSM_PICTURE_RMS, 20),
                ] {
                    let found = setup.picture(method, &scene);
                    let rms = rms_difference(&found, &exact);
                    let off = found.iter().zip(&exact).filter(|(a, b)| (*a - *b).abs() > 0.05).count();
                    println!("{name}, {place}, {shading:?}, {method}: rms {rms:.5}, {off} far off");
                    assert!(off <= most_off && rms <= allowed, "{name}, {place}, {method}: {rms}, {off}");
                }
            }
        }
    }
}

/// A wall at a known depth in a homogeneous medium: `C = c (1 - e^(-2 s d)) / 2 + m e^(-2 s d)` with the light on the
/// eye's side.
#[test]
fn a_wall_in_an_even_medium_is_as_computed() {
    let even = Array3::from_elem((40, 40, 40), 1000.0f32);
    let volume = Arc::new(volume_of(Voxels::F32(even), DAffine3::IDENTITY));
    let per_mm = 0.03;
    let tf = extinction(&[(0.0, 0.0), (1000.0, per_mm)]);
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let medium = tf.color(1000.0);
    let depth = 20.0;
    let wall = square(DVec3::new(19.5, 19.5, 39.5 - depth), 50.0 * DVec3::X, 50.0 * DVec3::Y);
    let eye = DVec3::new(19.5, 19.5, 20_000.0);
    let camera = Camera { eye, target: DVec3::new(19.5, 19.5, 0.0), up: DVec3::Y, fov_deg: 0.02 };
    let light = LightSource::from(Light::Directional { toward: DVec3::Z });
    let background = [1.0, 0.0, 0.0];
    let scene =
        Scene { camera, lights: vec![light], background, mesh: mesh(&[(&wall, GREEN)]), ..setup.scene(8, 8) };
    for (ambient, exponent) in [(1.0, 1.0), (0.0, 2.0)] {
        let scene = Scene { ambient, ..scene.clone() };
        let left = (-exponent * per_mm * depth).exp();
        let wanted: [f64; 3] = std::array::from_fn(|c| medium[c] * (1.0 - left) / exponent + GREEN[c] * left);
        let exact = setup.exact().picture(&scene);
        for (what, picture) in [("rays", setup.picture("rays", &scene)), ("exact", exact)] {
            for c in 0..3 {
                let found = f64::from(picture[[4, 4, c]]);
                assert!(
                    (found - wanted[c]).abs() < 1e-3,
                    "{what}, ambient {ambient}: {found} for {}",
                    wanted[c]
                );
            }
            assert_eq!(picture[[4, 4, 3]], 1.0, "a wall is opaque");
        }
    }
    // The light behind the wall lights neither the wall nor what is before it.
    let behind = Light::Directional { toward: DVec3::NEG_Z };
    let dark = setup.picture("rays", &Scene { ambient: 0.0, lights: vec![behind.into()], ..scene });
    assert!((0..3).all(|c| dark[[4, 4, c]] == 0.0), "{dark}");
}

/// Compares pictures of an opaque object above a white floor, in a volume without extinction, with its geometric shadow
/// on the floor. `misses` says whether a ray misses the object; `None` where the object's triangles may differ from it.
/// `fewest` are the least numbers of pixels in shadow and in light.
pub fn compare_with_geometric_shadow(
    object: MeshPart,
    methods: &[&str],
    side: u32,
    fewest: [usize; 2],
    misses: impl Fn(DVec3, DVec3) -> Option<bool>,
) {
    let nothing = Array3::from_elem((8, 8, 8), 0.0f32);
    let volume = Arc::new(volume_of(Voxels::F32(nothing), DAffine3::IDENTITY));
    let Some(setup) = Setup::open(&volume, &extinction(&[(500.0, 0.0), (1000.0, 1.0)])) else { return };
    let below = DVec3::new(4.0, 4.0, -2.0);
    let floor = part(&square(below, 30.0 * DVec3::X, 30.0 * DVec3::Y), [1.0; 3]);
    let mesh = Some(Arc::new(Mesh::new(vec![object, floor]).unwrap()));
    // A view from straight above, so that a pixel's place on the floor is known.
    let eye = DVec3::new(4.0, 4.0, 400.0);
    let camera = Camera { eye, target: DVec3::new(4.0, 4.0, 0.0), up: DVec3::Y, fov_deg: 7.0 };
    for light in [
        Light::Directional { toward: DVec3::new(0.6, 0.3, 1.0) },
        Light::Point { position: DVec3::new(14.0, -3.0, 30.0) },
    ] {
        let (mesh, lights) = (mesh.clone(), vec![light.into()]);
        let scene = Scene { camera, lights, ambient: 0.25, mesh, ..setup.scene(side, side) };
        for method in methods {
            let picture = match *method {
                "exact" => setup.exact().picture(&scene),
                method => setup.picture(method, &scene),
            };
            let mut counted = [0; 2];
            for (row, column) in (0..side).flat_map(|r| (0..side).map(move |c| (r, c))) {
                let direction = camera.ray_direction(f64::from(column), f64::from(row), side, side);
                let x = eye + (below.z - eye.z) / direction.z * direction;
                let (toward, _) = light.from_point(x);
                let is_floor = misses(eye, direction) == Some(true) && (x - below).abs().max_element() < 29.0;
                let (Some(is_lit), true) = (misses(x, toward), is_floor) else { continue };
                counted[usize::from(is_lit)] += 1;
                let wanted = 0.25 + if is_lit { 0.75 * toward.z } else { 0.0 };
                let found = f64::from(picture[[row as usize, column as usize, 0]]);
                assert!((found - wanted).abs() < 1e-4, "{method}, {x}: {found} for {wanted}");
            }
            assert!(counted[0] > fewest[0] && counted[1] > fewest[1], "{counted:?}");
        }
    }
}

#[test]
fn a_ball_hides_what_lies_behind_it() {
    let (center, radius) = (DVec3::new(4.0, 4.0, 12.0), 3.0);
    let ball = part(&sphere(center, radius, 64), GREEN);
    compare_with_geometric_shadow(
        ball,
        &["rays", "dsm", "lightvolume", "moments"],
        64,
        [20, 500],
        |from, along| {
            let from_surface = (center - from).cross(along).length() - radius;
            (from_surface.abs() > 0.05).then_some(from_surface > 0.0)
        },
    );
}

#[test]
fn nothing_that_is_left_out_shows() {
    let volume = phantom("thorax:48");
    let [ramp, ..] = transfer_functions([-900.0, 1200.0]);
    let Some(setup) = Setup::open(&volume, &ramp) else { return };
    let scene = Scene { mesh: ball_and_floor(&volume), ..setup.scene(70, 50) };
    for method in ["rays", "dsm:map=64", "lightvolume", "sat", "none"] {
        let bricks = setup.picture(method, &scene);
        let none = setup.picture(method, &Scene { skip: Skip::None, ..scene.clone() });
        assert!(largest_difference(&bricks, &none) < 2e-4, "{method}");
        assert_eq!(bricks, setup.picture(method, &scene), "{method}: twice the same");
    }
    // Views from within the ball, and with the floor behind the eye as well as before it.
    let corners = volume.corners_mm();
    let center = volume.center_mm();
    let low = corners.iter().map(|c| c.z).fold(f64::INFINITY, f64::min);
    for (eye, fov_deg) in
        [(center + DVec3::new(3.0, 2.0, 1.0), 120.0), (DVec3::new(center.x, center.y, low + 1.0), 140.0)]
    {
        let camera = Camera { eye, target: center + DVec3::new(50.0, 20.0, -30.0), up: DVec3::Z, fov_deg };
        let bricks = Scene { camera, ..scene.clone() };
        let none = Scene { skip: Skip::None, ..bricks.clone() };
        assert!(
            largest_difference(&setup.picture("rays", &bricks), &setup.picture("rays", &none)) < 2e-4,
            "{eye}"
        );
    }
    // Several lights add up on surfaces, too.
    let [(_, far), _, (_, near), _] = lights(&volume);
    let map = |light: Light| setup.shadow("rays", light);
    let maps = [map(far), map(near)];
    let sources = [LightSource::from(far), LightSource { color: [1.0, 0.5, 0.0], ..near.into() }];
    let base = Scene { ambient: 0.0, background: [0.0; 3], ..scene };
    let both =
        setup.session.render(&maps[..], &Scene { lights: sources.to_vec(), ..base.clone() }).unwrap().pixels;
    let each =
        [0, 1].map(|i| setup.session.render(&maps[i], &base.under(sources[i].clone())).unwrap().pixels);
    let sum = Array3::from_shape_fn(both.dim(), |(r, c, k)| match k {
        3 => each[0][[r, c, 3]],
        k => each[0][[r, c, k]] + each[1][[r, c, k]],
    });
    assert!(largest_difference(&both, &sum) < 2e-6);
}
