//! Float64 reference on the built-in volumes, whose optical depths are known.

use super::*;
use umbravox::exact::ExactField;
use umbravox::phantom::Phantom;

/// Offset from a voxel's centre, in voxels, so that a ray does not follow a single line of voxels.
const ASIDE: f64 = 0.5;

fn depth_along(phantom: Phantom, size: usize, tf: &TransferFunction, direction: DVec3) -> f64 {
    let volume = phantom.build(size).unwrap();
    let through = direction.any_orthonormal_vector() * ASIDE;
    ExactField::new(&volume, tf).optical_depth(through - 100.0 * direction, through + 100.0 * direction)
}

#[test]
fn slab() {
    let ramp = extinction(&[(0.0, 0.0), (2000.0, 0.4)]);
    let jump = extinction(&[(500.0, 0.0), (500.0, 0.2)]);
    for size in [16usize, 37, 64] {
        let (h, k0) = (64.0 / size as f64, size / 4);
        let thickness_mm = (size - 2 * k0) as f64 * h;
        // Affines are rounded to f32.
        assert_close(depth_along(Phantom::Slab, size, &ramp, DVec3::Z), 0.2 * thickness_mm, 1e-6);
        assert_close(depth_along(Phantom::Slab, size, &jump, DVec3::NEG_Z), 0.2 * thickness_mm, 1e-6);
    }
}

#[test]
fn step() {
    for size in [32, 64] {
        let jump = extinction(&[(500.0, 0.0), (500.0, 0.2)]);
        assert_close(depth_along(Phantom::Step, size, &jump, DVec3::X), 6.4, 1e-6);
        let oblique = DVec3::new(3.0, 0.4, -0.2);
        let stretched = 6.4 * oblique.length() / 3.0;
        let volume = Phantom::Step.build(size).unwrap();
        let got = ExactField::new(&volume, &jump).optical_depth(-20.0 * oblique, 20.0 * oblique);
        assert_close(got, stretched, 1e-6);
    }
}

#[test]
fn comb() {
    for size in [32, 64] {
        let h = 64.0 / size as f64;
        let layers = (size / 4) as f64;
        let ramp = extinction(&[(0.0, 0.0), (2000.0, 0.4)]);
        assert_close(depth_along(Phantom::Comb, size, &ramp, DVec3::Z), 0.2 * layers * h, 1e-6);
        let above = opacity(&[(500.0, 0.0), (500.0, 0.3)]);
        assert_close(depth_along(Phantom::Comb, size, &above, DVec3::Z), -(0.7f64.ln()) * layers * h, 1e-6);
    }
}

/// Optical depth of the sphere lies between those of the true surface and of the slightly smaller interpolated one.
#[test]
fn sphere_chord() {
    let size = 64;
    let volume = Phantom::Sphere.build(size).unwrap();
    let tf = extinction(&[(400.0, 0.0), (400.0, 0.1)]);
    let field = ExactField::new(&volume, &tf);
    let radius2 = 32.0 * 32.0 * 0.6;
    let mut random = Rng::with_seed(23);
    for _ in 0..100 {
        let toward = in_box(&mut random, DVec3::NEG_ONE, DVec3::ONE).normalize();
        let beside = toward.any_orthonormal_vector() * (20.0 * random.f64());
        let chord = |r2: f64| 2.0 * (r2 - beside.length_squared()).max(0.0).sqrt();
        let got = field.optical_depth(beside - toward * 60.0, beside + toward * 60.0) / 0.1;
        // Voxels are f32, which moves the surface by 1e-6 of itself.
        let rounding = 1e-4;
        assert!((chord(radius2 - 0.75) - rounding..chord(radius2) + rounding).contains(&got), "{got}");
    }
}
