//! The `nifti` crate as an independent reader: equal voxels where it reads a file, and valid files that version 0.18
//! reads differently or not at all. A test that fails after an update of the crate shows that a reason not to use it
//! is gone.

use super::*;
use nifti::{InMemNiftiVolume, NiftiHeader, NiftiObject, ReaderOptions};
use std::panic::catch_unwind;

/// Reads the stored voxels of a single file slice by slice with the `nifti` crate.
fn voxels_by_crate<T: nifti::DataElement>(path: &std::path::Path) -> nifti::Result<Vec<T>> {
    use nifti::{NiftiObject, ReaderStreamedOptions};
    let volume = ReaderStreamedOptions::new().read_file(path)?.into_volume();
    let slices = volume.map(|slice| slice?.into_nifti_typed_data::<T>());
    Ok(slices.collect::<nifti::Result<Vec<_>>>()?.concat())
}

/// Creates a NIfTI file of `int16` voxels in either byte order.
fn shorts(big_endian: bool) -> NiftiBytes {
    NiftiBytes::new([5, 4, 3]).with(|f| {
        (f.big_endian, f.datatype, f.bitpix) = (big_endian, 4, 16);
        let values = (0..60i16).map(|i| i.wrapping_mul(1097).wrapping_sub(20_000));
        f.data = values.flat_map(|v| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() }).collect();
    })
}

#[test]
fn voxels_are_those_of_the_nifti_crate() {
    let folder = Folder::new();
    for big_endian in [false, true] {
        let bytes = shorts(big_endian).bytes();
        folder.write("a.nii", &bytes);
        folder.write("a.nii.gz", &gzip(&bytes));
        for name in ["a.nii", "a.nii.gz"] {
            let theirs = voxels_by_crate::<i16>(&folder.path(name)).unwrap();
            let ours = folder.read(name).unwrap();
            assert_eq!(ours.element(), umbravox::volume::Element::I16);
            assert_eq!(values(&ours), theirs.iter().map(|v| f64::from(*v)).collect::<Vec<_>>(), "{name}");
        }
    }
    let floats: Vec<f32> = (0..60).map(|i| (i as f32 - 30.0) * 1.1e-3).collect();
    let file = NiftiBytes::new([5, 4, 3]).with(|f| {
        (f.datatype, f.bitpix) = (16, 32);
        f.data = floats.iter().flat_map(|v| v.to_le_bytes()).collect();
    });
    folder.write("f.nii", &file.bytes());
    assert_eq!(voxels_by_crate::<f32>(&folder.path("f.nii")).unwrap(), floats);
    let ours = values(&folder.read("f.nii").unwrap());
    assert_eq!(ours, floats.iter().map(|v| f64::from(*v)).collect::<Vec<_>>());
}

/// Writes a valid file and asserts that this program reads the voxels of [`shorts`] from it, and the crate does not.
#[track_caller]
fn only_we_read(name: &str, bytes: &[u8]) {
    let folder = Folder::new();
    folder.write(name, bytes);
    let expected = values(&read(&shorts(false)).unwrap());
    assert_eq!(values(&folder.read(name).unwrap()), expected);
    let path = folder.path(name);
    let theirs = catch_unwind(|| voxels_by_crate::<i16>(&path)).ok().and_then(std::result::Result::ok);
    let theirs = theirs.map(|voxels| voxels.into_iter().map(f64::from).collect::<Vec<_>>());
    assert_ne!(theirs, Some(expected), "{name} is read by the crate: update the docs");
}

#[test]
fn the_crate_ignores_vox_offset() {
    only_we_read("a.nii", &shorts(false).with(|f| f.vox_offset = 400.0).bytes());
}

#[test]
fn the_crate_reads_the_first_member_of_a_gzip_file_only() {
    let bytes = shorts(false).bytes();
    only_we_read("a.nii.gz", &[gzip(&bytes[..400]), gzip(&bytes[400..])].concat());
}

#[test]
fn the_crate_does_not_know_nifti_2() {
    only_we_read("a.nii", &shorts(false).version_2().bytes());
}

#[test]
fn the_crate_takes_the_size_of_voxels_from_bitpix() {
    let folder = Folder::new();
    let file = shorts(false).with(|f| f.bitpix = 64);
    folder.write("a.nii", &file.bytes());
    assert_eq!(values(&folder.read("a.nii").unwrap()), values(&read(&shorts(false)).unwrap()));
    let path = folder.path("a.nii");
    let theirs = catch_unwind(|| {
        let volume: InMemNiftiVolume = ReaderOptions::new().read_file(&path)?.into_volume();
        Ok::<_, nifti::NiftiError>(volume.into_nifti_typed_data::<i16>()?.len())
    });
    assert!(!matches!(theirs, Ok(Ok(60))));
}

/// Affine of a file with a qform as this program reads it, and as the crate does unless it panics.
fn qforms(change: impl FnOnce(&mut NiftiBytes)) -> (Volume, Option<[f64; 16]>) {
    let file = NiftiBytes::new([4, 3, 2]).with(|f| f.codes = [1, 0]).with(change);
    let ours = read(&file).unwrap();
    assert_eq!(ours.provenance.affine_source, AffineSource::Qform);
    let header = NiftiHeader::from_reader(&file.header()[..]).unwrap();
    let theirs = catch_unwind(|| header.affine::<f64>().as_slice().try_into().unwrap());
    (ours, theirs.ok())
}

#[test]
fn qforms_are_those_of_the_crate() {
    let (ours, theirs) = qforms(|f| f.quatern = [0.5, -0.5, 0.1]);
    let theirs = glam::DMat4::from_cols_array(&theirs.unwrap());
    assert!(glam::DMat4::from(ours.world_from_index()).abs_diff_eq(theirs, 1e-5), "{theirs}");
}

#[test]
fn the_crate_panics_on_long_quaternions() {
    let (ours, theirs) = qforms(|f| f.quatern = [3.0, 0.0, 0.0]);
    assert_close(ours.world_from_index().transform_vector3(DVec3::Y), -2.0 * DVec3::Y);
    assert_eq!(theirs, None);
}

#[test]
fn the_crate_panics_on_a_qfac_of_0() {
    let (ours, theirs) = qforms(|f| f.pixdim[0] = 0.0);
    assert_close(ours.world_from_index().transform_vector3(DVec3::Z), 3.0 * DVec3::Z);
    assert_eq!(theirs, None);
}

#[test]
fn the_crate_gives_planar_files_a_singular_affine() {
    let (ours, theirs) = qforms(|f| {
        f.dim = [2, 4, 3, 1, 1, 1, 1, 1];
        f.pixdim[3] = 0.0;
    });
    assert_eq!(ours.spacing_mm(), [1.0, 2.0, 1.0]);
    assert_eq!(glam::DMat4::from_cols_array(&theirs.unwrap()).determinant(), 0.0);
}
