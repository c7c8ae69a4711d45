//! Strands as opaque tubes: geometric shadows on a floor and in a homogeneous medium, and the exact picture.

use super::mesh::compare_with_geometric_shadow;
use super::*;
use umbravox::mesh::{Mesh, MeshPart};
use umbravox::scene::{Camera, LightSource};
use umbravox::strands::{Attribute, MOST_TRIANGLES, StrandArrays, Strands, tubes};

fn strand(points: &[DVec3], diameter_mm: f32) -> Strands {
    let arrays = StrandArrays {
        strands: 1,
        segments: Attribute::constant(points.len() as u32 - 1),
        points: points.iter().map(|p| p.as_vec3().to_array()).collect(),
        thickness_mm: Attribute::constant(diameter_mm),
        transparency: Attribute::constant(0.0),
        color: Attribute::constant([1.0; 3]),
        info: [0; 88],
    };
    Strands::new("test", arrays).unwrap()
}

/// Opaque tubes of strands.
fn tube(strands: &Strands) -> MeshPart {
    let made = tubes(strands, MOST_TRIANGLES).unwrap();
    assert_eq!(made.sides, 12);
    MeshPart { source: "test".into(), color: [0.1, 0.3, 0.9], triangles: made.triangles }
}

fn mesh(strands: &Strands) -> Option<Arc<Mesh>> {
    Some(Arc::new(Mesh::new(vec![tube(strands)]).unwrap()))
}

/// Smallest distance of a ray (`direction` of length 1) from a straight strand, and whether it is at an end of the
/// strand. A cylinder with a ball at either end is all points nearer than its radius.
fn distance(origin: DVec3, direction: DVec3, [a, b]: [DVec3; 2]) -> (f64, bool) {
    let along = b - a;
    // The distance to the ray of a place on the strand is convex.
    let to_ray = |t: f64| {
        let p = a + t * along - origin;
        p.distance(p.dot(direction).max(0.0) * direction)
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..80 {
        let (left, right) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if to_ray(left) < to_ray(right) { high = right } else { low = left }
    }
    let place = 0.5 * (low + high);
    (to_ray(place), !(1e-6..=1.0 - 1e-6).contains(&place))
}

/// Whether a ray misses a strand of the given radius; `None` where a tube of 12 sides may differ.
fn misses(origin: DVec3, direction: DVec3, ends: [DVec3; 2], radius: f64) -> Option<bool> {
    let (from_axis, at_end) = distance(origin, direction, ends);
    // Largest distance, in radii, of the tube's sides from the cylinder, and of its ends from the balls.
    let off = if at_end { 0.06 } else { 0.024 };
    let radii = from_axis / radius;
    ((radii - 1.0).abs() > off).then_some(radii > 1.0)
}

#[test]
fn a_straight_strand_hides_what_its_cylinder_hides() {
    let ends = [DVec3::new(-1.0, 1.0, 10.0), DVec3::new(8.0, 6.0, 13.0)];
    let radius = 2.0;
    let tube = tube(&strand(&ends, 2.0 * radius as f32));
    let is_free = |from, along| misses(from, along, ends, radius);
    compare_with_geometric_shadow(tube, &["rays", "dsm", "exact"], 96, [60, 2000], is_free);
}

/// A strand in a homogeneous medium under a light from above casts a dark shadow below it, visible from the side.
#[test]
fn a_strand_casts_its_shadow_into_the_medium() {
    let even = Array3::from_elem((40, 40, 40), 1000.0f32);
    let volume = Arc::new(volume_of(Voxels::F32(even), DAffine3::IDENTITY));
    let per_mm = 0.03;
    let tf = extinction(&[(0.0, 0.0), (1000.0, per_mm)]);
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let (medium, ambient) = (tf.color(1000.0)[0], 0.1);
    let ends = [DVec3::new(10.0, 20.0, 28.0), DVec3::new(30.0, 20.0, 28.0)];
    let radius = 3.0;
    let mesh = mesh(&strand(&ends, 2.0 * radius as f32));
    let camera = Camera {
        eye: DVec3::new(24.0, -120.0, 40.0),
        target: DVec3::new(19.5, 19.5, 19.5),
        up: DVec3::Z,
        fov_deg: 18.0,
    };
    let light = LightSource::from(Light::Directional { toward: DVec3::Z });
    let scene =
        Scene { camera, lights: vec![light], ambient, background: [0.0; 3], mesh, ..setup.scene(64, 64) };
    // Expected picture with the shadow of the cylinder, or without any.
    let wanted = |direction: DVec3, shadow: bool| {
        let inv = direction.recip();
        let [t0, t1] = [DVec3::splat(-0.5), DVec3::splat(39.5)].map(|p| (p - camera.eye) * inv);
        let (from, to) = (t0.min(t1).max_element(), t0.max(t1).min_element());
        let steps = 4000;
        let h = (to - from).max(0.0) / f64::from(steps);
        let part = |i: i32| {
            let t = from + (f64::from(i) + 0.5) * h;
            let x = camera.eye + t * direction;
            let hidden = shadow && distance(x, DVec3::Z, ends).0 < radius;
            let lit = if hidden { 0.0 } else { (-per_mm * (39.5 - x.z)).exp() };
            (-per_mm * (t - from)).exp() * per_mm * medium * (ambient + (1.0 - ambient) * lit) * h
        };
        (0..steps).map(part).sum::<f64>()
    };
    // Shadow queries are as frequent as samples, for a hard edge in the medium.
    let fine = Scene { step: 0.25, ..scene.clone() };
    let [rays, dsm] =
        ["rays:lookup=each", "dsm:epsilon=0.005,map=512,lookup=each"].map(|m| setup.picture(m, &fine));
    // Allowed difference: up to 2.4 % of the radius on either side of the shadow, and each picture's own error.
    let found = [("exact", setup.exact().picture(&scene), 0.001), ("rays", rays, 0.002), ("dsm", dsm, 0.002)];
    let mut worst = [0.0_f64; 3];
    let (mut counted, mut darkest) = (0, 0.0_f64);
    for (row, column) in (0..64).step_by(3).flat_map(|r| (0..64).step_by(3).map(move |c| (r, c))) {
        let direction = camera.ray_direction(f64::from(column), f64::from(row), 64, 64);
        if misses(camera.eye, direction, ends, radius) != Some(true) {
            continue;
        }
        let with = wanted(direction, true);
        darkest = darkest.max(wanted(direction, false) - with);
        counted += 1;
        for (place, (_, picture, _)) in found.iter().enumerate() {
            let is = f64::from(picture[[row as usize, column as usize, 0]]);
            worst[place] = worst[place].max((is - with).abs());
        }
    }
    for ((what, _, most), worst) in found.iter().zip(worst) {
        println!("{what}: off by {worst:.5} at most, where the shadow takes up to {darkest:.4}");
        assert!(worst < *most, "{what}: {worst}");
    }
    assert!(counted > 250 && darkest > 0.015, "{counted}, {darkest}");
}

#[test]
fn a_bent_strand_in_a_chest_is_drawn_as_the_exact_picture_has_it() {
    let volume = phantom("thorax:64");
    let [ramp, ..] = transfer_functions([-900.0, 1200.0]);
    let Some(setup) = Setup::open(&volume, &ramp) else { return };
    let corners = volume.corners_mm();
    let center = volume.center_mm();
    let size = corners[7] - corners[0];
    let curve = |i: i32| {
        let t = f64::from(i) / 30.0;
        center + size * DVec3::new(0.5 * (6.0 * t).cos(), 0.5 * (6.0 * t).sin(), 0.8 * t - 0.4)
    };
    let points: Vec<DVec3> = (0..=30).map(curve).collect();
    let mesh = mesh(&strand(&points, 0.06 * size.x as f32));
    for (place, light) in lights(&volume) {
        let scene = Scene { lights: vec![light.into()], mesh: mesh.clone(), ..setup.scene(40, 30) };
        let exact = setup.exact().picture(&scene);
        let found = setup.picture("rays", &scene);
        let rms = rms_difference(&found, &exact);
        let off = found.iter().zip(&exact).filter(|(a, b)| (*a - *b).abs() > 0.05).count();
        println!("{place}: rms {rms:.5}, {off} far off");
        // Pixels at the edge of a hard shadow differ by float32 rounding.
        assert!(off <= 4 && rms <= tolerance::RAYS_PICTURE_RMS, "{place}: {rms}, {off}");
        let without = setup.picture("rays", &Scene { mesh: None, ..scene });
        assert!(largest_difference(&found, &without) > 0.05, "{place}: it shows");
    }
}
