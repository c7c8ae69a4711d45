//! Raw volume files: layouts, sizes that must match, flags.

use std::fs;
use std::path::Path;
use umbravox::Result;
use umbravox::open::{ReadFlags, VolumeSpec, load};
use umbravox::volume::{AffineSource, Volume};

fn spec(folder: &Path, name: &str, bytes: &[u8]) -> VolumeSpec {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    VolumeSpec::new(path.to_str().unwrap())
}

#[track_caller]
fn refused(result: Result<Volume>, part: &str) {
    let error = result.expect_err("must be refused");
    assert!(error.to_string().contains(part), "`{part}` is not in `{error}`");
    assert_eq!(error.exit_status(), 2);
}

#[test]
fn layout_from_the_flag_or_the_name() {
    let folder = tempfile::tempdir().unwrap();
    let bytes: Vec<u8> = (0..24).collect();
    let named = spec(folder.path(), "tooth_4x3x2_uint8.raw", &bytes);
    let volume = load(&VolumeSpec {
        flags: ReadFlags { spacing: Some([0.5, 1.0, 2.0]), ..Default::default() },
        ..named.clone()
    })
    .unwrap();
    assert_eq!(volume.dims(), [4, 3, 2]);
    assert_eq!(volume.value(3, 2, 1), 23.0);
    assert_eq!(volume.value(1, 0, 0), 1.0);
    assert_eq!(volume.spacing_mm(), [0.5, 1.0, 2.0]);
    assert_eq!(volume.provenance.affine_source, AffineSource::Spacing);
    assert!(volume.provenance.warnings.is_empty());
    // The flag wins over the file name; missing spacing gives a note.
    let volume = load(&VolumeSpec {
        flags: ReadFlags { raw: Some("2x2x3:u16:be".parse().unwrap()), ..Default::default() },
        ..named
    })
    .unwrap();
    assert_eq!(volume.dims(), [2, 2, 3]);
    assert_eq!(volume.value(1, 1, 2), f64::from(22 * 256 + 23));
    assert_eq!(volume.provenance.stored_type, "uint16 big-endian");
    assert!(volume.provenance.warnings[0].contains("--spacing"));
    // The flag works for files of any name.
    let other = spec(folder.path(), "scan.dat", &bytes[..8]);
    let volume = load(&VolumeSpec {
        flags: ReadFlags { raw: Some("1x1x1:f64".parse().unwrap()), ..Default::default() },
        ..other
    })
    .unwrap();
    assert_eq!(volume.value(0, 0, 0), f64::from_le_bytes([0, 1, 2, 3, 4, 5, 6, 7]));
}

#[test]
fn the_size_must_match() {
    let folder = tempfile::tempdir().unwrap();
    let file = spec(folder.path(), "a_4x3x2_u8.raw", &[0; 30]);
    refused(load(&file), "is 24 bytes, the file has 30 bytes");
    assert_eq!(
        load(&VolumeSpec { flags: ReadFlags { offset: Some(6), ..Default::default() }, ..file.clone() })
            .unwrap()
            .dims(),
        [4, 3, 2]
    );
    refused(
        load(&VolumeSpec { flags: ReadFlags { offset: Some(7), ..Default::default() }, ..file.clone() }),
        "is 31 bytes, the file has 30 bytes",
    );
    refused(
        load(&VolumeSpec {
            flags: ReadFlags { offset: Some(u64::MAX), ..Default::default() },
            ..file.clone()
        }),
        "than can be counted",
    );
    let huge = format!("{0}x{0}x{0}:f64", 3_000_000_000u64);
    refused(
        load(&VolumeSpec {
            flags: ReadFlags { raw: Some(huge.parse().unwrap()), ..Default::default() },
            ..file
        }),
        "than can be counted",
    );
    refused(load(&spec(folder.path(), "b_4x3x2_u8.raw", &[])), "has 0 bytes");
}

#[test]
fn flags_and_places() {
    let folder = tempfile::tempdir().unwrap();
    let file = spec(folder.path(), "a_2x1x1_u8.raw", &[0, 1]);
    for spacing in [[0.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, f64::NAN], [f64::INFINITY, 1.0, 1.0]] {
        refused(
            load(&VolumeSpec {
                flags: ReadFlags { spacing: Some(spacing), ..Default::default() },
                ..file.clone()
            }),
            "--spacing",
        );
    }
    refused(
        load(&VolumeSpec { flags: ReadFlags { frame: Some(1), ..Default::default() }, ..file.clone() }),
        "--frame",
    );
    assert!(load(&VolumeSpec { flags: ReadFlags { frame: Some(0), ..Default::default() }, ..file }).is_ok());
    refused(
        load(&VolumeSpec::new(folder.path().join("absent_2x1x1_u8.raw").to_str().unwrap())),
        "no such file",
    );
    fs::create_dir(folder.path().join("b_2x1x1_u8.raw")).unwrap();
    refused(load(&VolumeSpec::new(folder.path().join("b_2x1x1_u8.raw").to_str().unwrap())), "folder");
    let nan = spec(folder.path(), "c_1x1x1_f32.raw", &f32::NAN.to_le_bytes());
    refused(load(&nan), "no voxel has a finite value");
}
