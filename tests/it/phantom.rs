//! Built-in volumes (phantoms): their closed forms, files and limits.

use std::fs;
use umbravox::cli::{info::Info, phantom};
use umbravox::formats::write_nifti;
use umbravox::open::{ReadFlags, VolumeSpec, load};
use umbravox::phantom::Phantom;
use umbravox::volume::{AffineSource, Volume};

fn build(spec: &str) -> Volume {
    load(&VolumeSpec::new(spec)).unwrap()
}

/// Integral over z of the interpolated values in the voxel column (i, j), mm; every plane counts one spacing.
fn column_integral(volume: &Volume, i: usize, j: usize) -> f64 {
    (0..volume.dims()[2]).map(|k| volume.value(i, j, k)).sum::<f64>() * volume.spacing_mm()[2]
}

#[test]
fn names_and_sizes() {
    assert_eq!(load(&VolumeSpec::default()).unwrap().provenance.source, "phantom:thorax:256");
    for phantom in Phantom::ALL {
        for size in [1, 2, 3, 7, 33] {
            let volume = build(&format!("phantom:{phantom}:{size}"));
            assert_eq!(volume.dims().into_iter().max(), Some(size), "{phantom}");
            assert_eq!(volume.provenance.source, format!("phantom:{phantom}:{size}"));
            assert_eq!(volume.provenance.affine_source, AffineSource::Spacing);
            // Centred on the origin.
            let sum = volume.corners_mm().into_iter().sum::<glam::DVec3>();
            assert!(sum.length() < 1e-3, "{phantom} {sum}");
        }
    }
    for bad in [
        "phantom:",
        "phantom:brain",
        "phantom:Slab",
        "phantom:slab:",
        "phantom:slab:0",
        "phantom:slab:4097",
        "phantom:slab:-4",
        "phantom:slab:1e2",
        "phantom:slab:8:8",
    ] {
        let error = load(&VolumeSpec::new(bad)).unwrap_err();
        assert_eq!(error.exit_status(), 2, "{bad}");
        assert!(error.to_string().contains(bad), "{error}");
    }
    for size in [0, 4097, usize::MAX] {
        assert!(Phantom::Comb.build(size).is_err());
    }
    let with_flag = VolumeSpec {
        flags: ReadFlags { raw: Some("2x2x2:u8".parse().unwrap()), ..Default::default() },
        ..VolumeSpec::new("phantom:slab")
    };
    assert!(load(&with_flag).unwrap_err().to_string().contains("--raw"));
    let with_frame = VolumeSpec {
        flags: ReadFlags { frame: Some(1), ..Default::default() },
        ..VolumeSpec::new("phantom:slab")
    };
    assert!(load(&with_frame).unwrap_err().to_string().contains("--frame"));
}

#[test]
fn slab_step_and_comb_have_their_depths() {
    for n in [1usize, 2, 5, 16, 17, 63, 64] {
        let h = 64.0 / n as f64;
        let slab = build(&format!("phantom:slab:{n}"));
        let planes = (n - n / 4) - n / 4;
        assert!((column_integral(&slab, 0, n / 2) - 1000.0 * planes as f64 * h).abs() < 1e-2, "slab {n}");
        let comb = build(&format!("phantom:comb:{n}"));
        let teeth = (0..n).filter(|k| k % 4 == 2).count();
        assert!((column_integral(&comb, n / 2, 0) - 1000.0 * teeth as f64 * h).abs() < 1e-2, "comb {n}");
        let step = build(&format!("phantom:step:{n}"));
        for i in 0..n {
            assert_eq!(step.value(i, n - 1, 0), if i >= n / 2 { 1000.0 } else { 0.0 });
        }
    }
    // For even n the step's face is the plane x = 0.
    let step = build("phantom:step:64");
    let face = step.world_from_index().transform_point3(glam::dvec3(31.5, 0.0, 0.0));
    assert_eq!(face.x, 0.0);
}

#[test]
fn sphere_and_shell_have_their_isosurfaces() {
    let (sphere, shell) = (build("phantom:sphere:64"), build("phantom:shell:64"));
    assert_eq!(sphere.dims(), [64; 3]);
    for [i, j, k] in [[0, 0, 0], [31, 32, 31], [10, 40, 50], [63, 5, 20]] {
        let world = sphere.world_from_index().transform_point3(glam::dvec3(i as f64, j as f64, k as f64));
        let r = world.length();
        assert!((sphere.value(i, j, k) - 1000.0 * (1.0 - r * r / 1024.0)).abs() < 1e-3);
        assert!((shell.value(i, j, k) - 1000.0 * (1.0 - (r - 20.0).abs() / 8.0).max(0.0)).abs() < 1e-3);
    }
    // Along an axis, values pass 750 at a radius of 16 mm, but for interpolation's 3 h^2 / 4 in r^2.
    let value = |x: f64| {
        let p = sphere.index_from_world().transform_point3(glam::dvec3(x, 0.5, 0.5));
        let (i, w) = (p.x.floor(), p.x - p.x.floor());
        let at = |i: f64| sphere.value(i as usize, p.y as usize, p.z as usize);
        at(i) * (1.0 - w) + at(i + 1.0) * w
    };
    let expected = |r: f64| 1000.0 * (1.0 - r * r / 1024.0);
    for step in 0..100 {
        let x = 0.3 * f64::from(step);
        let exact = expected((x * x + 0.5).sqrt());
        let below = exact - value(x);
        assert!((-1e-3..=1000.0 * 0.75 / 1024.0 + 1e-3).contains(&below), "{x} {below}");
    }
}

#[test]
fn thorax_is_a_chest() {
    let chest = build("phantom:thorax:128");
    assert_eq!(chest.dims(), [128, 96, 64]);
    let value = |x: f64, y: f64, z: f64| {
        let p = chest.index_from_world().transform_point3(glam::dvec3(x, y, z)).round();
        // The median of the neighbourhood: thin vessels and noise aside.
        let at = |i: f64, d: usize| i as usize + d - 1;
        let mut near: Vec<f64> =
            (0..27).map(|d| chest.value(at(p.x, d % 3), at(p.y, d / 3 % 3), at(p.z, d / 9))).collect();
        near.sort_by(f64::total_cmp);
        near[13]
    };
    let cases = [
        ("air beside the body", [-176.0, 100.0, 0.0], [-1024.0, -950.0]),
        ("right lung", [90.0, 40.0, 10.0], [-950.0, -700.0]),
        ("left lung", [-95.0, -20.0, 40.0], [-950.0, -700.0]),
        ("left ventricle", [-32.0, 14.0, -34.0], [250.0, 450.0]),
        ("liver, on the right", [80.0, 10.0, -100.0], [60.0, 160.0]),
        ("muscle", [143.0, 8.0, 20.0], [0.0, 110.0]),
        ("vertebra", [0.0, -52.0, 0.0], [150.0, 320.0]),
        ("descending aorta, on the left", [-24.0, -38.0, 0.0], [280.0, 440.0]),
        ("trachea", [1.0, -9.0, 90.0], [-1024.0, -900.0]),
    ];
    for (what, [x, y, z], [low, high]) in cases {
        assert!((low..=high).contains(&value(x, y, z)), "{what}: {}", value(x, y, z));
    }
    assert_eq!(chest.spacing_mm(), [2.8125, 2.8125, 4.0]);
    let [low, high] = chest.value_range();
    assert!(low >= -1024.0 && (600.0..=3071.0).contains(&high), "{low} {high}");
    // Every build gives the same volume.
    assert_eq!(chest.resident().unwrap(), build("phantom:thorax:128").resident().unwrap());
}

#[test]
fn files_hold_phantoms_without_loss() {
    let folder = tempfile::tempdir().unwrap();
    for (name, ending) in [("sphere:23", "nii"), ("thorax:50", "nii.gz"), ("comb:7", "NII.GZ")] {
        let path = folder.path().join(format!("{}.{ending}", name.replace(':', ".")));
        phantom::run(name, &path).unwrap();
        let read = load(&VolumeSpec::new(path.to_str().unwrap())).unwrap();
        let built = build(&format!("phantom:{name}"));
        assert_eq!(read.resident().unwrap(), built.resident().unwrap(), "{name}");
        assert_eq!(read.world_from_index(), built.world_from_index(), "{name}");
        assert_eq!(read.provenance.affine_source, AffineSource::Sform);
        assert!(read.provenance.warnings.is_empty(), "{:?}", read.provenance.warnings);
    }
}

#[test]
fn every_type_and_scaling_is_written() {
    use ndarray::Array3;
    use umbravox::volume::{Provenance, Scaling, Voxels};
    let folder = tempfile::tempdir().unwrap();
    let shape = (2, 3, 4);
    let affine =
        glam::DAffine3::from_cols_array(&[0.5, 0.25, 0.0, -1.0, 2.0, 0.0, 0.0, 0.5, 3.0, 7.0, -8.0, 9.0]);
    for voxels in [
        Voxels::U8(Array3::from_shape_fn(shape, |(k, j, i)| (100 * k + 10 * j + i) as u8)),
        Voxels::I16(Array3::from_shape_fn(shape, |(k, j, i)| (1000 * k + 10 * j + i) as i16 - 700)),
        Voxels::U16(Array3::from_shape_fn(shape, |(k, j, i)| (50_000 * k + 10 * j + i) as u16)),
        Voxels::F32(Array3::from_shape_fn(shape, |(k, j, i)| (k + j) as f32 / (i + 1) as f32)),
        Voxels::F64(Array3::from_shape_fn(shape, |(k, j, i)| (k + j) as f64 / (i + 1) as f64)),
    ] {
        let provenance = Provenance { source: "test".into(), ..build("phantom:slab:1").provenance };
        let scaling = Scaling { slope: -0.5, intercept: 3.25 };
        let volume = Volume::new(voxels, scaling, affine, provenance).unwrap();
        for name in ["a.nii", "a.nii.gz"] {
            let path = folder.path().join(name);
            write_nifti(&volume, &path).unwrap();
            let read = load(&VolumeSpec::new(path.to_str().unwrap())).unwrap();
            assert_eq!(read.resident().unwrap(), volume.resident().unwrap());
            assert_eq!(read.scaling(), volume.scaling());
            assert_eq!(read.world_from_index(), affine);
        }
    }
    // The file is overwritten, and no other file remains.
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn output_appears_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let named = |name: &str| folder.path().join(name);
    fs::create_dir(named("folder.nii")).unwrap();
    for path in [named("a.png"), named("a"), named("absent/a.nii"), named("folder.nii"), named("")] {
        let error = phantom::run("slab:4", &path).unwrap_err();
        assert_eq!(error.exit_status(), 2, "{error}");
    }
    assert!(phantom::run("heart", &named("b.nii")).is_err());
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["folder.nii"]);
}

#[cfg(unix)]
#[test]
fn files_are_readable_by_others_as_the_umask_allows() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    phantom::run("slab:4", &folder.path().join("a.nii")).unwrap();
    fs::write(folder.path().join("b"), "").unwrap();
    let mode = |name: &str| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
    assert_eq!(mode("a.nii"), mode("b"));
}

#[test]
fn info_tells_everything() {
    let info = Info::of(&build("phantom:thorax:64"), None);
    assert_eq!((info.dims, info.brick_counts, info.bricks), ([64, 48, 32], [17, 13, 9], 1989));
    assert_eq!(info.affine[3], [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(info.affine[0], [5.625, 0.0, 0.0, -177.1875]);
    assert_eq!(info.size_mm, [360.0, 270.0, 256.0]);
    assert_eq!(info.bounds_mm, [[-180.0, -135.0, -128.0], [180.0, 135.0, 128.0]]);
    assert_eq!(info.memory_bytes, 64 * 48 * 32 * 2);
    let json: serde_json::Value = serde_json::to_value(&info).unwrap();
    assert_eq!(json["affine_source"], "spacing");
    assert_eq!(json["scaling"]["slope"], 1.0);
    let text = info.to_text();
    for part in [
        "phantom:thorax:64",
        "int16",
        "64 x 48 x 32 voxels",
        "5.625 x 5.625 x 8 mm",
        "voxel sizes",
        "17 x 13 x 9 (1989)",
        "192.0 KiB",
    ] {
        assert!(text.contains(part), "`{part}` is not in\n{text}");
    }
}
