//! Written volumes are read back with the same values at the same positions.

use glam::{DAffine3, DMat3, DVec3, EulerRot};
use ndarray::Array3;
use proptest::prelude::*;
use umbravox::formats::{VOLUME_EXTENSIONS, write_volume};
use umbravox::open::{VolumeSpec, load};
use umbravox::volume::{Provenance, Scaling, Volume, Voxels};

fn volumes() -> impl Strategy<Value = Volume> {
    let sizes = (1usize..6, 1usize..6, 1usize..6);
    let angles = prop::array::uniform3(-3.0..3.0);
    let spacing = prop::array::uniform3(0.01f64..20.0);
    let origin = prop::array::uniform3(-500.0..500.0);
    let scaling = prop_oneof![
        Just((1.0, 0.0)),
        Just((1.0, -1024.0)),
        Just((-3.0, 7.0)),
        (0.001f64..10.0, -100.0..100.0),
    ];
    (sizes, 0u8..5, any::<u64>(), angles, spacing, origin, scaling).prop_map(
        |((nx, ny, nz), kind, seed, [a, b, c], spacing, origin, (slope, intercept))| {
            let mut random = fastrand::Rng::with_seed(seed);
            let shape = (nz, ny, nx);
            let voxels = match kind {
                0 => Voxels::U8(Array3::from_shape_simple_fn(shape, || random.u8(..))),
                1 => Voxels::I16(Array3::from_shape_simple_fn(shape, || random.i16(..))),
                2 => Voxels::U16(Array3::from_shape_simple_fn(shape, || random.u16(..))),
                3 => Voxels::F32(Array3::from_shape_simple_fn(shape, || random.f32() * 1e4 - 5e3)),
                _ => Voxels::F64(Array3::from_shape_simple_fn(shape, || random.f64() * 1e4 - 5e3)),
            };
            let rotation = DMat3::from_euler(EulerRot::XYZ, a, b, c);
            let affine = DAffine3::from_mat3_translation(
                rotation * DMat3::from_diagonal(DVec3::from_array(spacing)),
                DVec3::from_array(origin),
            );
            Volume::new(voxels, Scaling { slope, intercept }, affine, Provenance::new("test", "test", ""))
                .unwrap()
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_writer_keeps_values_and_affine(volume in volumes()) {
        let folder = tempfile::tempdir().unwrap();
        for ending in VOLUME_EXTENSIONS {
            let path = folder.path().join(format!("v.{ending}"));
            write_volume(&volume, &path).unwrap();
            let back = load(&VolumeSpec::new(path.to_str().unwrap())).unwrap();
            prop_assert_eq!(back.dims(), volume.dims(), "{}", ending);
            let share = match *ending {
                // NIfTI holds scaling and affine in 32 bits.
                "nii" | "nii.gz" => 1e-6,
                // Directions and spacing are apart.
                "mha" | "vti" => 1e-15,
                _ => 0.0,
            };
            let (a, b) = (volume.world_from_index(), back.world_from_index());
            let pairs = a.to_cols_array().into_iter().zip(b.to_cols_array());
            for (a, b) in pairs {
                prop_assert!((a - b).abs() <= share * 1e3, "{}: {} {}", ending, a, b);
            }
            let [nx, ny, nz] = volume.dims();
            let largest = volume.value_range().map(f64::abs).into_iter().fold(0.0, f64::max);
            for (i, j, k) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (i, j, k)))) {
                let (a, b) = (volume.value(i, j, k), back.value(i, j, k));
                prop_assert!((a - b).abs() <= share * largest, "{}: {} {}", ending, a, b);
            }
        }
    }
}
