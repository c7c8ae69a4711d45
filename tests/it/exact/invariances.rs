//! Invariances of the float64 reference, and changes with a known result.

use super::*;
use umbravox::exact::ExactField;

fn random_segments(n: usize) -> Vec<(DVec3, DVec3)> {
    let mut random = Rng::with_seed(11);
    let (low, high) = (DVec3::splat(-3.0), DVec3::new(11.0, 9.0, 8.0));
    (0..n).map(|_| (in_box(&mut random, low, high), in_box(&mut random, low, high))).collect()
}

/// Tolerance for results that differ only by the rounding of positions.
const ROUNDED: f64 = 1e-10;

#[test]
fn reversed_and_split() {
    let volume = rough_volume(DAffine3::IDENTITY);
    for tf in transfer_functions() {
        let field = ExactField::new(&volume, &tf);
        for (n, (a, b)) in random_segments(300).into_iter().enumerate() {
            let whole = field.optical_depth(a, b);
            assert_close(field.optical_depth(b, a), whole, ROUNDED);
            let middle = a.lerp(b, n as f64 / 300.0);
            assert_close(field.optical_depth(a, middle) + field.optical_depth(middle, b), whole, ROUNDED);
        }
    }
}

/// A field stored along other axes and rotated in the world has the same optical depths.
#[test]
fn rotated_by_90_degrees() {
    let turn = DAffine3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z, DVec3::new(4.0, -2.0, 1.0));
    let volume = rough_volume(DAffine3::IDENTITY);
    let [nx, ny, nz] = volume.dims();
    // Stored at (j, nx - 1 - i, k).
    let index_from_stored =
        DAffine3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z, DVec3::X * (nx as f64 - 1.0));
    let stored = super::volume([ny, nx, nz], turn * index_from_stored, |p, q, r| {
        volume.value(nx - 1 - q as usize, p as usize, r as usize)
    });
    for tf in transfer_functions() {
        let (straight, turned) = (ExactField::new(&volume, &tf), ExactField::new(&stored, &tf));
        for (a, b) in random_segments(200) {
            let got = turned.optical_depth(turn.transform_point3(a), turn.transform_point3(b));
            assert_close(got, straight.optical_depth(a, b), ROUNDED);
        }
    }
}

/// An affine changes the optical depth of a segment by the factor of its length.
#[test]
fn affines() {
    let shear = DAffine3::from_cols(
        DVec3::new(0.7, 0.0, 0.0),
        DVec3::new(0.4, 1.3, 0.0),
        DVec3::new(-0.2, 0.5, 2.0),
        DVec3::new(-11.0, 3.0, 7.0),
    );
    let flip = DAffine3::from_scale(DVec3::new(-1.0, 1.0, -2.5));
    let far = DAffine3::from_translation(DVec3::new(1e6, -1e6, 1e6));
    let tiny = DAffine3::from_scale(DVec3::splat(1e-6));
    let in_index = rough_volume(DAffine3::IDENTITY);
    // A position 1e6 mm away is known to 1e-10 mm only.
    for (affine, tolerance) in [
        (shear, ROUNDED),
        (flip, ROUNDED),
        (oblique(), ROUNDED),
        (tiny, ROUNDED),
        (far, 1e-7),
        (far * shear, 1e-7),
    ] {
        let in_world = rough_volume(affine);
        for tf in transfer_functions() {
            let (index, world) = (ExactField::new(&in_index, &tf), ExactField::new(&in_world, &tf));
            for (a, b) in random_segments(100) {
                let (c, d) = (affine.transform_point3(a), affine.transform_point3(b));
                let stretch = a.distance(b) / c.distance(d);
                assert_close(world.optical_depth(c, d) * stretch, index.optical_depth(a, b), tolerance);
            }
        }
    }
}

/// Stored type and scaling of a volume do not matter, only the scaled values.
#[test]
fn stored_types() {
    let values = rough_volume(DAffine3::IDENTITY);
    let Voxels::F64(array) = values.resident().unwrap() else { unreachable!("rough_volume stores f64") };
    let stored = [
        (Voxels::U8(array.mapv(|v| v as u8)), Scaling::IDENTITY),
        (Voxels::U16(array.mapv(|v| v as u16 + 1000)), Scaling { slope: 1.0, intercept: -1000.0 }),
        (Voxels::I16(array.mapv(|v| -4 * v as i16)), Scaling { slope: -0.25, intercept: 0.0 }),
        (Voxels::F32(array.mapv(|v| v as f32 * 0.5)), Scaling { slope: 2.0, intercept: 0.0 }),
    ];
    for (voxels, scaling) in stored {
        let other = volume_of(voxels, scaling, DAffine3::IDENTITY);
        for tf in transfer_functions() {
            for (a, b) in random_segments(50) {
                let want = ExactField::new(&values, &tf).optical_depth(a, b);
                assert_eq!(ExactField::new(&other, &tf).optical_depth(a, b), want);
            }
        }
    }
}

/// Rays through corners and along faces and edges of cells agree with rays slightly beside them, and with reversed
/// rays.
#[test]
fn faces_edges_and_corners() {
    let volume = rough_volume(DAffine3::IDENTITY);
    let tf = &transfer_functions()[1];
    let field = ExactField::new(&volume, tf);
    let hair = DVec3::new(1.1e-9, 0.7e-9, -0.9e-9);
    for direction in
        [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE, DVec3::new(1.0, -1.0, 0.0), DVec3::new(-2.0, 1.0, 1.0)]
    {
        for through in [DVec3::new(4.0, 3.0, 2.0), DVec3::new(4.0, 3.5, 2.0), DVec3::new(0.0, 6.0, 5.0)] {
            let (a, b) = (through - 20.0 * direction, through + 20.0 * direction);
            let got = field.optical_depth(a, b);
            assert!(got > 0.0);
            assert_close(field.optical_depth(b, a), got, ROUNDED);
            assert_close(field.optical_depth(a + hair, b + hair), got, 1e-7);
            assert_close(field.optical_depth(through, b) + field.optical_depth(through, a), got, ROUNDED);
        }
    }
}

/// One bright voxel in empty space has the same optical depth wherever it lies among the skipped blocks.
#[test]
fn a_voxel_in_empty_space() {
    let tf = &transfer_functions()[1];
    let alone = |at: DVec3| {
        let affine = DAffine3::from_translation(at - 1.0);
        volume([3, 3, 3], affine, |i, j, k| if [i, j, k] == [1.0; 3] { 60.0 } else { 0.0 })
    };
    let mut random = Rng::with_seed(29);
    for [i, j, k] in
        [[7, 7, 7], [8, 7, 6], [6, 15, 8], [16, 8, 7], [1, 23, 14], [22, 22, 22], [15, 16, 17], [23, 1, 24]]
    {
        let at = DVec3::new(f64::from(i), f64::from(j), f64::from(k));
        let sparse =
            volume(
                [26, 25, 27],
                DAffine3::IDENTITY,
                |i, j, k| if DVec3::new(i, j, k) == at { 60.0 } else { 0.0 },
            );
        let alone = alone(at);
        let (in_sparse, by_itself) = (ExactField::new(&sparse, tf), ExactField::new(&alone, tf));
        for n in 0..200 {
            let middle = at + in_box(&mut random, DVec3::splat(-0.9), DVec3::splat(0.9));
            let half = match n % 8 {
                0 => DVec3::X,
                1 => DVec3::Y,
                2 => DVec3::NEG_Z,
                3 => DVec3::new(1.0, -1.0, 0.0),
                _ => in_box(&mut random, DVec3::NEG_ONE, DVec3::ONE),
            } * 40.0;
            // Every other ray along cell faces.
            let middle = if n % 16 < 8 { at + (middle - at).round() * 0.5 } else { middle };
            let got = in_sparse.optical_depth(middle - half, middle + half);
            assert_close(got, by_itself.optical_depth(middle - half, middle + half), ROUNDED);
        }
        let through = in_sparse.optical_depth(at - DVec3::X * 40.0, at + DVec3::X * 40.0);
        // Value 60 falls to 20 within 2/3 voxel on either side, extinction from 0.4 to 0.
        assert_close(through, 0.4 * 2.0 / 3.0, ROUNDED);
    }
}
