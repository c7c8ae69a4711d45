//! NIfTI files of every kind, valid and damaged.

mod bytes;
mod damaged;
mod oracle;

use crate::common;
use bytes::{NiftiBytes, gzip};
use glam::{DVec3, dvec3};
use std::fs;
use std::path::PathBuf;
use umbravox::open::{ReadFlags, VolumeSpec, load};
use umbravox::volume::{AffineSource, ValueMeaning, Volume};
use umbravox::{Error, Result};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> Result<Volume> {
        load(&VolumeSpec::new(self.path(name).to_str().unwrap()))
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).unwrap();
    }
}

fn read(file: &NiftiBytes) -> Result<Volume> {
    let folder = Folder::new();
    folder.write("a.nii", &file.bytes());
    folder.read("a.nii")
}

/// Asserts that a file is refused in one line that contains `part`, with exit status 2.
#[track_caller]
fn refused(result: Result<Volume>, part: &str) -> Error {
    let error = result.expect_err("must be refused");
    let line = error.to_string();
    assert!(line.contains(part), "`{part}` is not in `{line}`");
    assert!(!line.contains('\n'));
    assert_eq!(error.exit_status(), 2);
    error
}

/// Voxel values of a volume, i fastest.
fn values(volume: &Volume) -> Vec<f64> {
    let [nx, ny, nz] = volume.dims();
    (0..nx * ny * nz).map(|at| volume.value(at % nx, at / nx % ny, at / (nx * ny))).collect()
}

#[track_caller]
fn assert_close(a: DVec3, b: DVec3) {
    assert!((a - b).length() < 1e-5, "{a} is not {b}");
}

#[test]
fn every_type_in_both_byte_orders_and_versions() {
    macro_rules! case {
        ($datatype:literal, $name:literal, $t:ty, $values:expr) => {
            for (big_endian, version) in [(false, 1), (true, 1), (false, 2), (true, 2)] {
                let stored: [$t; 6] = $values;
                let mut file = NiftiBytes::new([3, 2, 1]);
                if version == 2 {
                    file = file.version_2();
                }
                file.big_endian = big_endian;
                (file.datatype, file.bitpix) = ($datatype, 8 * size_of::<$t>() as i16);
                let bytes = |v: $t| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
                file.data = stored.into_iter().flat_map(bytes).collect();
                let volume = read(&file).unwrap();
                assert_eq!(volume.dims(), [3, 2, 1]);
                assert_eq!(values(&volume), stored.map(|v| v as f64), "{} {big_endian} {version}", $name);
                assert_eq!(volume.provenance.stored_type.split(' ').next(), Some($name));
                assert_eq!(
                    volume.provenance.stored_type.contains("big-endian"),
                    big_endian && size_of::<$t>() > 1
                );
                assert_eq!(volume.provenance.format, format!("nifti{version}"));
                assert!(volume.provenance.warnings.is_empty(), "{:?}", volume.provenance.warnings);
            }
        };
    }
    case!(2, "uint8", u8, [0, 1, 127, 128, 254, 255]);
    case!(256, "int8", i8, [-128, -1, 0, 1, 126, 127]);
    case!(512, "uint16", u16, [0, 1, 258, 32768, 65534, 65535]);
    case!(4, "int16", i16, [-32768, -1024, 0, 258, 3071, 32767]);
    case!(768, "uint32", u32, [0, 1, 16_909_060, 1 << 31, u32::MAX - 1, u32::MAX]);
    case!(8, "int32", i32, [i32::MIN, -1, 0, 16_909_060, 7, i32::MAX]);
    case!(1280, "uint64", u64, [0, 1, 1 << 40, (1 << 53) - 1, 72_623_859_790, 5]);
    case!(1024, "int64", i64, [-(1 << 53), -1, 0, 72_623_859_790, 7, 1 << 53]);
    case!(16, "float32", f32, [-1.5, 0.0, 1e-30, 1e30, std::f32::consts::PI, 2.0]);
    case!(64, "float64", f64, [-1.5, 0.0, 1e-200, 1e200, std::f64::consts::PI, 2.0]);
}

#[test]
fn integers_beyond_53_bits_are_rounded_and_say_so() {
    let file = NiftiBytes::new([2, 1, 1]).with(|f| {
        (f.datatype, f.bitpix) = (1280, 64);
        f.data = [u64::MAX, 3].into_iter().flat_map(u64::to_le_bytes).collect();
    });
    let volume = read(&file).unwrap();
    assert_eq!(values(&volume), [u64::MAX as f64, 3.0]);
    assert!(volume.provenance.warnings[0].contains("53 bits"));
}

#[test]
fn colours_and_complex_numbers_are_refused() {
    for (datatype, name) in [
        (1, "bits"),
        (32, "complex"),
        (128, "RGB"),
        (1536, "128-bit"),
        (1792, "complex"),
        (2304, "RGB"),
        (0, "unknown"),
        (-7, "unknown"),
    ] {
        refused(read(&NiftiBytes::new([2, 2, 2]).with(|f| f.datatype = datatype)), name);
    }
}

#[test]
fn scaling() {
    let scaled = |slope: f64, inter: f64| read(&NiftiBytes::new([2, 2, 1]).with(|f| f.scl = [slope, inter]));
    assert_eq!(values(&scaled(2.0, -1024.0).unwrap()), [-1024.0, -1022.0, -1020.0, -1018.0]);
    // The slope is a float32; products are formed in float64.
    let slope = f64::from(2.208_627_5_f32);
    assert_eq!(
        values(&scaled(2.208_627_5, 0.5).unwrap()),
        [0.5, slope + 0.5, 2.0 * slope + 0.5, 3.0 * slope + 0.5]
    );
    for unscaled in [0.0, f64::NAN, f64::INFINITY] {
        assert_eq!(values(&scaled(unscaled, 7.0).unwrap()), [0.0, 1.0, 2.0, 3.0], "{unscaled}");
    }
    let negative = scaled(-1.0, 10.0).unwrap();
    assert_eq!(negative.value_range(), [7.0, 10.0]);
    refused(scaled(1.0, f64::NAN), "scl_inter");
    let overflow = NiftiBytes::new([1, 1, 1]).version_2().with(|f| {
        (f.datatype, f.bitpix, f.scl) = (64, 64, [1e300, 0.0]);
        f.data = 1e300f64.to_le_bytes().to_vec();
    });
    refused(read(&overflow), "overflow");
}

#[test]
fn intents_and_echo_times_tell_what_the_values_are() {
    let folder = Folder::new();
    for (file, intent_at, descrip_at) in
        [(NiftiBytes::new([2, 2, 1]), 68, 148), (NiftiBytes::new([2, 2, 1]).version_2(), 504, 240)]
    {
        let said = |intent: u16, descrip: &str| {
            let mut bytes = file.bytes();
            bytes[intent_at..intent_at + 2].copy_from_slice(&intent.to_le_bytes());
            bytes[descrip_at..descrip_at + descrip.len()].copy_from_slice(descrip.as_bytes());
            folder.write("a.nii", &bytes);
            folder.read("a.nii").unwrap().provenance.values
        };
        assert_eq!(said(0, "Time=93808.000"), ValueMeaning::Unknown);
        assert!(matches!(said(0, "TE=3.6;Time=1.0"), ValueMeaning::Other(by) if by.contains("MR")));
        assert!(matches!(said(3, ""), ValueMeaning::Other(by) if by.contains("statistic")));
        assert!(matches!(said(1002, ""), ValueMeaning::Other(by) if by.contains("labels")));
    }
}

#[test]
fn sform_then_qform_then_voxel_sizes() {
    let both = NiftiBytes::new([4, 4, 4]).with(|f| {
        f.codes = [1, 1];
        f.qoffset = [7.0, 8.0, 9.0];
    });
    let volume = read(&both).unwrap();
    assert_eq!(volume.provenance.affine_source, AffineSource::Sform);
    assert_close(volume.world_from_index().transform_point3(dvec3(1.0, 1.0, 1.0)), dvec3(-3.0, -3.0, -3.0));

    let volume = read(&both.clone().with(|f| f.codes = [2, 0])).unwrap();
    assert_eq!(volume.provenance.affine_source, AffineSource::Qform);
    assert_close(volume.world_from_index().transform_point3(dvec3(1.0, 1.0, 1.0)), dvec3(8.0, 10.0, 12.0));

    for codes in [[0, 0], [-1, 0], [0, -3]] {
        let volume = read(&both.clone().with(|f| f.codes = codes)).unwrap();
        assert_eq!(volume.provenance.affine_source, AffineSource::Spacing);
        assert_eq!(volume.spacing_mm(), [1.0, 2.0, 3.0]);
        // The volume is centred, with x to the left.
        assert_close(volume.world_from_index().transform_point3(DVec3::splat(1.5)), DVec3::ZERO);
        assert_close(volume.world_from_index().transform_vector3(DVec3::X), -DVec3::X);
    }
}

#[test]
fn quaternions() {
    let turned = |quatern: [f64; 3], qfac: f64| {
        read(&NiftiBytes::new([2, 2, 2]).with(|f| {
            (f.codes, f.quatern) = ([1, 0], quatern);
            f.pixdim[0] = qfac;
        }))
        .unwrap()
    };
    // A quarter turn about z: i runs along +y, j along -x.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let quarter = turned([0.0, 0.0, half], 1.0).world_from_index();
    assert_close(quarter.transform_vector3(DVec3::X), DVec3::Y);
    assert_close(quarter.transform_vector3(DVec3::Y), -2.0 * DVec3::X);
    assert_close(quarter.transform_vector3(DVec3::Z), 3.0 * DVec3::Z);
    // qfac -1 flips k, and only -1 does.
    assert_close(turned([0.0; 3], -1.0).world_from_index().transform_vector3(DVec3::Z), -3.0 * DVec3::Z);
    assert_close(turned([0.0; 3], 0.0).world_from_index().transform_vector3(DVec3::Z), 3.0 * DVec3::Z);
    // A half turn about y, whose w is 0.
    let flipped = turned([0.0, 1.0, 0.0], 1.0).world_from_index();
    assert_close(flipped.transform_vector3(DVec3::X), -DVec3::X);
    assert_close(flipped.transform_vector3(DVec3::Z), -3.0 * DVec3::Z);
    // A quaternion too long for a rotation is normalised, with a warning.
    let long = turned([3.0, 0.0, 0.0], 1.0);
    assert_close(long.world_from_index().transform_vector3(DVec3::Y), -2.0 * DVec3::Y);
    assert!(long.provenance.warnings.iter().any(|w| w.contains("quaternion")));
}

#[test]
fn oblique_sheared_and_flipped_sforms_are_preserved() {
    let rows = [[0.5, 0.25, -0.125, 10.0], [-0.75, 2.0, 0.5, -20.0], [0.125, 0.0, -3.0, 30.0]];
    let volume = read(&NiftiBytes::new([2, 2, 2]).with(|f| f.srow = rows)).unwrap();
    for (axis, row) in rows.iter().enumerate() {
        let affine = volume.world_from_index();
        assert_eq!([0, 1, 2].map(|c| affine.matrix3.col(c)[axis]), row[..3]);
        assert_eq!(affine.translation[axis], row[3]);
    }
    let p = dvec3(0.3, 1.7, -0.2);
    let back = volume.index_from_world().transform_point3(volume.world_from_index().transform_point3(p));
    assert!((back - p).length() < 1e-14);
}

#[test]
fn broken_forms_are_passed_over_with_a_warning() {
    for poison in [f64::NAN, f64::INFINITY, 0.0] {
        let file = NiftiBytes::new([2, 2, 2]).with(|f| {
            f.codes = [1, 1];
            f.srow = [[poison; 4]; 3];
        });
        let volume = read(&file).unwrap();
        assert_eq!(volume.provenance.affine_source, AffineSource::Qform);
        assert!(volume.provenance.warnings.iter().any(|w| w.contains("sform")), "{poison}");

        let volume = read(&file.with(|f| f.quatern = [f64::NAN, 0.0, 0.0])).unwrap();
        assert_eq!(volume.provenance.affine_source, AffineSource::Spacing);
        assert!(volume.provenance.warnings.iter().any(|w| w.contains("qform")), "{poison}");
    }
    for (size, becomes) in [(0.0, 1.0), (f64::NAN, 1.0), (f64::INFINITY, 1.0), (-2.5, 2.5)] {
        let file = NiftiBytes::new([2, 2, 2]).with(|f| {
            f.codes = [0, 0];
            f.pixdim[2] = size;
        });
        let volume = read(&file).unwrap();
        assert_eq!(volume.spacing_mm(), [1.0, becomes, 3.0], "{size}");
        assert!(volume.provenance.warnings.iter().any(|w| w.contains("voxel size")), "{size}");
    }
}

#[test]
fn units_other_than_mm_give_a_warning() {
    for (units, said) in [(0, false), (2, false), (1, true), (3, true), (3 | 8, true)] {
        let volume = read(&NiftiBytes::new([2, 2, 2]).with(|f| f.xyzt_units = units)).unwrap();
        assert_eq!(volume.spacing_mm(), [1.0, 2.0, 3.0]);
        assert_eq!(volume.provenance.warnings.iter().any(|w| w.contains("lengths")), said, "{units}");
    }
}

#[test]
fn fewer_and_more_dimensions() {
    for (dim, dims, frames) in [
        ([1, 24, -5, 0, 9, 9, 9, 9], [24, 1, 1], 1),
        ([2, 4, 6, 0, 9, 9, 9, 9], [4, 6, 1], 1),
        ([3, 4, 3, 2, 9, 9, 9, 9], [4, 3, 2], 1),
        ([4, 2, 3, 2, 2, 9, 9, 9], [2, 3, 2], 2),
        ([5, 2, 3, 2, 1, 2, 9, 9], [2, 3, 2], 2),
        ([7, 2, 1, 1, 3, 2, 2, 1], [2, 1, 1], 12),
    ] {
        let mut file = NiftiBytes::new([4, 3, 2]);
        file.dim = dim;
        let volume = read(&file).unwrap();
        assert_eq!((volume.dims(), volume.provenance.frames), (dims, frames), "{dim:?}");
    }
}

#[test]
fn frames() {
    for zipped in [false, true] {
        let folder = Folder::new();
        let file = NiftiBytes::new([2, 3, 4]).with(|f| f.dim = [4, 2, 3, 2, 2, 1, 1, 1]);
        folder.write("a.nii", &if zipped { gzip(&file.bytes()) } else { file.bytes() });
        let frame = |n| {
            load(&VolumeSpec {
                flags: ReadFlags { frame: n, ..Default::default() },
                ..VolumeSpec::new(folder.path("a.nii").to_str().unwrap())
            })
        };
        assert_eq!(values(&frame(None).unwrap())[0], 0.0);
        let second = frame(Some(1)).unwrap();
        assert_eq!(values(&second), (12..24).map(f64::from).collect::<Vec<_>>());
        assert_eq!((second.provenance.frames, second.provenance.frame), (2, 1));
        assert!(second.provenance.warnings[0].contains("frame 1"));
        refused(frame(Some(2)), "--frame 2");
        refused(frame(Some(usize::MAX)), "beyond its 2 frames");
    }
}

#[test]
fn content_decides_about_gzip() {
    let folder = Folder::new();
    let bytes = NiftiBytes::new([3, 3, 3]).bytes();
    for (name, content) in [("a.nii", gzip(&bytes)), ("b.nii.gz", bytes.clone()), ("c.nii.gz", gzip(&bytes))]
    {
        folder.write(name, &content);
        assert_eq!(values(&folder.read(name).unwrap())[26], 26.0, "{name}");
    }
    // Several members, as parallel compressors write them.
    folder.write("d.nii.gz", &[gzip(&bytes[..360]), gzip(&bytes[360..])].concat());
    assert_eq!(values(&folder.read("d.nii.gz").unwrap())[26], 26.0);
}

#[test]
fn pairs_by_either_name() {
    let file = NiftiBytes::new([3, 2, 2]).with(|f| {
        f.magic = b"ni1\0".to_vec();
        f.vox_offset = 0.0;
    });
    let two = file.clone().version_2().with(|f| {
        f.magic = b"ni2\0\r\n\x1a\n".to_vec();
        f.vox_offset = 5.0;
        f.data.splice(0..0, [99; 5]);
    });
    for file in [file, two] {
        for (header_gz, image_gz) in [(false, false), (true, true), (false, true), (true, false)] {
            let folder = Folder::new();
            let name = |ending: &str, gz: bool| format!("scan.v2.{ending}{}", if gz { ".gz" } else { "" });
            let content = |bytes: Vec<u8>, gz: bool| if gz { gzip(&bytes) } else { bytes };
            folder.write(&name("hdr", header_gz), &content(file.header(), header_gz));
            refused(folder.read(&name("hdr", header_gz)), "no such file");
            folder.write(&name("img", image_gz), &content(file.data.clone(), image_gz));
            for named in [name("hdr", header_gz), name("img", image_gz)] {
                let volume = folder.read(&named).unwrap();
                assert_eq!(values(&volume), (0..12).map(f64::from).collect::<Vec<_>>(), "{named}");
            }
        }
    }
    let folder = Folder::new();
    folder.write("lonely.img", &[0; 12]);
    refused(folder.read("lonely.img"), "no such file");
    let misnamed = NiftiBytes::new([3, 2, 2]).with(|f| f.magic = b"ni1\0".to_vec());
    refused(read(&misnamed), ".img");
}

#[test]
fn voxel_offsets() {
    let at = |offset: f64| read(&NiftiBytes::new([3, 3, 3]).with(|f| f.vox_offset = offset));
    // Extensions lie between header and voxels.
    assert_eq!(values(&at(1024.0).unwrap())[26], 26.0);
    let zero = at(0.0).unwrap();
    assert_eq!(values(&zero)[26], 26.0);
    assert!(zero.provenance.warnings[0].contains("vox_offset"));
    refused(at(100.0), "inside the header");
    refused(at(349.0), "inside the header");
    for beyond in [-1.0, f64::NAN, f64::INFINITY, -1e30, 1e30] {
        refused(at(beyond), "vox_offset");
    }
    refused(at(1e15), "holds");
}

#[test]
fn non_finite_voxels_become_the_smallest_finite_value() {
    let floats = |values: &[f64], bits: i16, slope: f64| {
        read(&NiftiBytes::new([values.len(), 1, 1]).with(|f| {
            (f.datatype, f.bitpix) = (if bits == 32 { 16 } else { 64 }, bits);
            f.scl = [slope, 0.0];
            f.data = values
                .iter()
                .flat_map(|&v| {
                    if bits == 32 { (v as f32).to_le_bytes().to_vec() } else { v.to_le_bytes().to_vec() }
                })
                .collect();
        }))
    };
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    for bits in [32, 64] {
        let volume = floats(&[nan, 3.0, inf, -2.0, -inf, 1.0], bits, 1.0).unwrap();
        assert_eq!(values(&volume), [-2.0, 3.0, -2.0, -2.0, -2.0, 1.0]);
        assert_eq!(volume.provenance.non_finite, 3);
        assert!(volume.provenance.warnings.iter().any(|w| w.contains("3 voxels")));
        // The smallest value counts after scaling.
        let flipped = floats(&[nan, 3.0, -2.0], bits, -1.0).unwrap();
        assert_eq!(values(&flipped), [-3.0, -3.0, 2.0]);
        refused(floats(&[nan, inf, -inf], bits, 1.0), "no voxel has a finite value");
        // Denormal numbers are valid.
        assert_eq!(floats(&[1e-40, -1e-40], bits, 1.0).unwrap().provenance.non_finite, 0);
    }
}

#[test]
fn bitpix_does_not_decide() {
    let volume = read(&NiftiBytes::new([2, 2, 2]).with(|f| f.bitpix = 64)).unwrap();
    assert_eq!(values(&volume)[7], 7.0);
    assert!(volume.provenance.warnings[0].contains("bitpix"));
}

#[test]
fn real_scans() {
    // Values of an independent reader.
    for (name, dims, range, spacing) in [
        ("CT_AVM", [256, 242, 154], [0.0, 563.200_002_908_706_7], [0.719_942_57, 0.720_913_59, 1.0]),
        ("CT_pitch", [175, 248, 58], [0.0, 255.0], [0.8125, 0.8125, 2.397_047]),
        ("engine", [256, 256, 128], [0.0, 255.0], [1.0; 3]),
        ("fuel", [64, 33, 32], [0.0, 255.0], [1.0; 3]),
    ] {
        let Some(path) = common::scan(name) else { continue };
        let volume = load(&VolumeSpec::new(path.to_str().unwrap())).unwrap();
        assert_eq!((volume.dims(), volume.value_range()), (dims, range), "{name}");
        for (ours, theirs) in volume.spacing_mm().into_iter().zip(spacing) {
            assert!((ours - theirs).abs() < 1e-5, "{name} {ours} {theirs}");
        }
    }
}
