//! Float64 reference against fields of known optical depth: trilinear interpolation is exact for `a + b i + ... + h i
//! j k`.

use super::*;
use umbravox::exact::ExactField;
use umbravox::scene::Light;
use umbravox::transfer::MAX_OPACITY;

fn along_x(field: &ExactField, y: f64, z: f64) -> f64 {
    field.optical_depth(DVec3::new(-50.0, y, z), DVec3::new(50.0, y, z))
}

#[test]
fn slab() {
    let affine = DAffine3::from_translation(DVec3::new(-3.0, 4.0, 10.0))
        * DAffine3::from_scale(DVec3::new(0.5, 2.0, 3.0));
    let volume = volume([8, 4, 5], affine, |_, _, _| 5.0);
    let tf = extinction(&[(0.0, 0.3)]);
    let field = ExactField::new(&volume, &tf);
    let at = |i: f64, j: f64, k: f64| affine.transform_point3(DVec3::new(i, j, k));
    // (from, to, length inside in mm)
    let cases = [
        (at(-9.0, 1.3, 2.2), at(20.0, 1.3, 2.2), 4.0),
        (at(2.0, -9.0, 2.0), at(2.0, 9.0, 2.0), 8.0),
        (at(2.5, 3.0, 30.0), at(2.5, 3.0, -30.0), 15.0),
        (at(1.0, 1.0, 1.0), at(4.0, 1.0, 1.0), 1.5),
        (at(-0.5, -0.5, -0.5), at(7.5, 3.5, 4.5), DVec3::new(4.0, 8.0, 15.0).length()),
        (at(-8.5, -4.5, -5.5), at(15.5, 7.5, 9.5), DVec3::new(4.0, 8.0, 15.0).length()),
        // In the domain's face and edge, which belong to it.
        (at(-9.0, -0.5, 1.0), at(9.0, -0.5, 1.0), 4.0),
        (at(-9.0, 3.5, 4.5), at(9.0, 3.5, 4.5), 4.0),
        // Segments without length, at a touched corner, beside, short of and away from the volume.
        (at(2.0, 2.0, 2.0), at(2.0, 2.0, 2.0), 0.0),
        (at(-1.5, 0.5, 0.0), at(0.5, -1.5, 0.0), 0.0),
        (at(-9.0, 3.6, 1.0), at(9.0, 3.6, 1.0), 0.0),
        (at(-9.0, 1.0, 1.0), at(-1.0, 1.0, 1.0), 0.0),
        (at(9.0, 1.0, 1.0), at(90.0, 1.0, 1.0), 0.0),
    ];
    for (a, b, length_mm) in cases {
        assert_close(field.optical_depth(a, b), 0.3 * length_mm, EXACT);
    }
    let segments: Vec<_> = cases.iter().map(|&(a, b, _)| (a, b)).collect();
    let each: Vec<_> = cases.iter().map(|&(a, b, _)| field.optical_depth(a, b)).collect();
    assert_eq!(field.optical_depths(&segments), each);
    assert!(field.optical_depth(at(0.0, 0.0, 0.0), DVec3::NAN).is_nan());
    assert!(field.optical_depth(DVec3::INFINITY, at(0.0, 0.0, 0.0)).is_nan());
    // Segments from afar, from so far that positions round away (any finite result will do), and of nearly no length.
    let across = |far: f64| field.optical_depth(DVec3::new(-far, 6.0, 16.0), DVec3::new(far, 6.0, 16.0));
    assert_close(across(1e6), 1.2, 1e-9);
    assert!(across(1e30).is_finite() && across(1e300).is_finite());
    assert_close(field.optical_depth(at(1.0, 1.0, 1.0), at(1.0, 1.0, 1.0) + DVec3::X * 1e-12), 3e-13, 1e-15);
}

#[test]
fn a_single_voxel() {
    let volume = volume([1, 1, 1], DAffine3::IDENTITY, |_, _, _| 1.0);
    let tf = extinction(&[(1.0, 0.0), (1.0, 2.0)]);
    let field = ExactField::new(&volume, &tf);
    assert_close(along_x(&field, 0.0, 0.0), 2.0, EXACT);
    let (a, b) = (DVec3::splat(-3.0), DVec3::splat(3.0));
    assert_close(field.optical_depth(a, b), 2.0 * 3f64.sqrt(), EXACT);
}

#[test]
fn ramps_over_a_linear_field() {
    let volume = volume([10, 3, 3], DAffine3::IDENTITY, |i, _, _| i);
    // Half a voxel at 0, the ramp from 0 to 9, half a voxel at 9.
    let linear = extinction(&[(0.0, 0.0), (20.0, 2.0)]);
    assert_close(along_x(&ExactField::new(&volume, &linear), 0.3, 0.7), 4.05 + 0.45, EXACT);
    let tf = opacity(&[(0.0, 0.0), (10.0, 1.0)]);
    let primitive = |q: f64| q * q.ln() - q;
    let want = 10.0 * (primitive(0.1) - primitive(1.0)) - 0.5 * 0.1f64.ln();
    assert_close(along_x(&ExactField::new(&volume, &tf), 0.3, 0.7), want, EXACT);
}

#[test]
fn opacity_one_is_clamped() {
    let volume = volume([5, 3, 3], DAffine3::IDENTITY, |i, _, _| i);
    let most = 24.0 * std::f64::consts::LN_2;
    let uniform = opacity(&[(0.0, 1.0)]);
    assert_close(along_x(&ExactField::new(&volume, &uniform), 1.0, 1.0), 5.0 * most, EXACT);
    // Up to the opacity limit just below value 2; at the limit 2^-24 from there; up again, down from 3.
    let peak = transfer(Quantity::Opacity, 2.0, &[(1.0, 0.0), (2.0, 1.0), (3.0, 1.0), (4.0, 0.0)]);
    let primitive = |q: f64| q * q.ln() - q;
    let flank = primitive(1.0 - MAX_OPACITY) - primitive(1.0) + (1.0 - MAX_OPACITY) * most;
    assert_close(along_x(&ExactField::new(&volume, &peak), 1.0, 1.0), (2.0 * flank + most) / 2.0, EXACT);
}

#[test]
fn jump_in_linear_and_cubic_fields() {
    let tf = extinction(&[(4.3, 0.0), (4.3, 0.7)]);
    let linear = volume([10, 3, 3], DAffine3::IDENTITY, |i, _, _| i);
    assert_close(along_x(&ExactField::new(&linear, &tf), 1.0, 1.0), 0.7 * 5.2, EXACT);
    let cubic = volume([7, 7, 7], DAffine3::IDENTITY, |i, j, k| i * j * k);
    let field = ExactField::new(&cubic, &tf);
    for v in [0.02f64, 0.999, 1.0, 4.3, 27.0, 100.5] {
        let tf = extinction(&[(v, 0.0), (v, 0.7)]);
        let field = ExactField::new(&cubic, &tf);
        let got = field.optical_depth(DVec3::splat(-0.25), DVec3::splat(6.25));
        assert_close(got, 0.7 * 3f64.sqrt() * (6.25 - v.cbrt()), EXACT);
    }
    // Up and down again within cells: i * j along i + j = 6 has its peak between voxels.
    let got = field.optical_depth(DVec3::new(0.0, 6.0, 1.0), DVec3::new(6.0, 0.0, 1.0));
    assert_close(got, 0.7 * 2f64.sqrt() * 2.0 * (9f64 - 4.3).sqrt(), EXACT);
}

#[test]
fn comb_of_thin_peaks() {
    let volume = volume([12, 4, 4], DAffine3::IDENTITY, |i, j, _| 2.0 * i + j);
    for half_width in [0.1, 1e-3, 1e-6] {
        let peaks: Vec<_> = (1..=20)
            .map(f64::from)
            .flat_map(|c| [(c - half_width, 0.0), (c + 0.05 * half_width, 3.0), (c + half_width, 0.0)])
            .collect();
        let (a, b) = (DVec3::new(0.0, 0.5, 0.3), DVec3::new(11.0, 2.0, 2.9));
        // Value rises evenly from 0.5 to 24: every peak is crossed once.
        let mm_per_value = a.distance(b) / 23.5;
        let wide = ExactField::new(&volume, &extinction(&peaks)).optical_depth(a, b);
        // The width of a peak is what is left of its edges after rounding to f64.
        let rounding = 1e-14 / half_width;
        assert_close(wide / (20.0 * 3.0 * half_width * mm_per_value), 1.0, EXACT + rounding);
    }
}

/// The interpolated squared radius of a sphere is at most 3/4 (voxel squared) above the true one.
#[test]
fn sphere_chord() {
    let center = DVec3::new(20.2, 19.7, 20.4);
    let field =
        volume([41, 41, 41], DAffine3::IDENTITY, |i, j, k| (DVec3::new(i, j, k) - center).length_squared());
    let tf = extinction(&[(225.0, 0.5), (225.0, 0.0)]);
    let field = ExactField::new(&field, &tf);
    let mut random = Rng::with_seed(3);
    for _ in 0..200 {
        let toward = in_box(&mut random, DVec3::NEG_ONE, DVec3::ONE).normalize();
        let beside = toward.any_orthonormal_vector() * (14.0 * random.f64());
        let (a, b) = (center + beside - toward * 30.0, center + beside + toward * 30.0);
        let chord = |radius2: f64| 2.0 * (radius2 - beside.length_squared()).max(0.0).sqrt();
        let got = field.optical_depth(a, b) / 0.5;
        assert!((chord(224.25)..=chord(225.0)).contains(&got), "{got}");
    }
}

/// A plateau of values exactly at a jump of the transfer function: the later point holds from the value on.
#[test]
fn plateau_at_a_jump() {
    let tf = extinction(&[(0.0, 0.0), (0.0, 0.2)]);
    let air = volume([6, 5, 4], DAffine3::IDENTITY, |_, _, _| 0.0);
    let field = ExactField::new(&air, &tf);
    assert_close(along_x(&field, 1.3, 2.1), 1.2, EXACT);
    assert_close(
        field.optical_depth(DVec3::new(0.1, 0.2, 0.3), DVec3::new(4.7, 3.1, 2.9)) / 0.2,
        DVec3::new(4.6, 2.9, 2.6).length(),
        EXACT,
    );
    // Air, then a hollow: the value is below only where it is interpolated.
    let hollow = volume([9, 5, 4], DAffine3::IDENTITY, |i, _, _| if i == 4.0 { -1.0 } else { 0.0 });
    assert_close(along_x(&ExactField::new(&hollow, &tf), 1.3, 2.1), 0.2 * 7.0, EXACT);
    // Rounding beside a plateau, where the value leaves it with the third power of the distance.
    let spots =
        volume([7, 7, 7], DAffine3::IDENTITY, |i, j, k| if (i + j + k) % 4.0 == 0.0 { 97.3 } else { 0.0 });
    let tf_cut_above = extinction(&[(0.0, 0.0), (0.0, 0.2), (50.0, 0.2), (60.0, 0.2)]);
    let field_of_spots = ExactField::new(&spots, &tf_cut_above);
    let mut random = Rng::with_seed(31);
    for _ in 0..300 {
        let corner = in_box(&mut random, DVec3::ZERO, DVec3::splat(6.0)).round();
        let other = in_box(&mut random, DVec3::ZERO, DVec3::splat(6.0)).round();
        assert_close(field_of_spots.optical_depth(corner, other), 0.2 * corner.distance(other), EXACT);
    }
    // A value that scaling rounds.
    let scaling = Scaling { slope: 2.208_627_462_387_085, intercept: -1024.3 };
    let value = scaling.apply(117.0);
    let tf = extinction(&[(value, 0.0), (value, 0.2)]);
    let stored = volume_of(Voxels::U8(Array3::from_elem((4, 5, 6), 117)), scaling, DAffine3::IDENTITY);
    assert_close(along_x(&ExactField::new(&stored, &tf), 1.3, 2.1), 1.2, EXACT);
}

#[test]
fn transmittance_to_lights() {
    let volume = volume([10, 10, 10], DAffine3::IDENTITY, |_, _, _| 1.0);
    let tf = extinction(&[(0.0, 0.1)]);
    let field = ExactField::new(&volume, &tf);
    let x = DVec3::new(2.5, 5.0, 5.0);
    let directional = Light::Directional { toward: DVec3::new(3.0, 0.0, 0.0) };
    assert_close(field.transmittance_to_light(x, &directional), (-0.7f64).exp(), EXACT);
    for (position, length_mm) in [
        (DVec3::new(4.5, 5.0, 5.0), 2.0),
        (DVec3::new(100.0, 5.0, 5.0), 7.0),
        (x, 0.0),
        (DVec3::new(2.5, 5.0, -100.0), 5.5),
    ] {
        let got = field.transmittance_to_light(x, &Light::Point { position });
        assert_close(got, f64::exp(-0.1 * length_mm), EXACT);
    }
    assert!(field.transmittance_to_light(DVec3::NAN, &directional).is_nan());
    assert!(field.transmittance_to_light(x, &Light::Directional { toward: DVec3::ZERO }).is_nan());
    let dark = extinction(&[(0.0, 20.0)]);
    let got = ExactField::new(&volume, &dark).transmittance_to_light(x, &directional);
    assert!((0.0..1e-17).contains(&got), "{got}");
}
