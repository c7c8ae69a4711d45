//! Damaged NIfTI files and other files: each is read as far as it is sound, or refused in one line.

use super::*;

#[test]
fn truncated_anywhere() {
    for file in [NiftiBytes::new([5, 4, 3]), NiftiBytes::new([5, 4, 3]).version_2()] {
        let bytes = file.bytes();
        let packed = gzip(&bytes);
        let folder = Folder::new();
        for cut in 0..bytes.len() {
            folder.write("a.nii", &bytes[..cut]);
            refused(folder.read("a.nii"), "cannot read volume");
        }
        for cut in 0..packed.len() {
            folder.write("a.nii.gz", &packed[..cut]);
            refused(folder.read("a.nii.gz"), "cannot read volume");
        }
        folder.write("a.nii", &[&bytes[..], b"trailing"].concat());
        assert_eq!(values(&folder.read("a.nii").unwrap())[59], 59.0);
    }
}

#[test]
fn flipped_bits_of_a_header_are_read_or_refused() {
    for file in [NiftiBytes::new([5, 4, 3]), NiftiBytes::new([5, 4, 3]).version_2()] {
        let bytes = file.bytes();
        let folder = Folder::new();
        // Every third bit is flipped, so that each byte is tested.
        for bit in (0..8 * file.header().len()).step_by(3) {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            folder.write("a.nii", &damaged);
            match folder.read("a.nii") {
                Ok(volume) => assert!(volume.world_from_index().is_finite() && volume.bytes() <= 8 * 60),
                Err(error) => assert_eq!(error.exit_status(), 2, "{error}"),
            }
        }
    }
}

#[test]
fn damaged_gzip_is_refused() {
    let folder = Folder::new();
    let packed = gzip(&NiftiBytes::new([9, 9, 9]).bytes());
    // A wrong checksum, the last field of the stream before the length.
    let mut damaged = packed.clone();
    let crc = damaged.len() - 8;
    damaged[crc] ^= 1;
    folder.write("a.nii.gz", &damaged);
    refused(folder.read("a.nii.gz"), "damaged");
    folder.write("b.nii.gz", &gzip(b"this is not a volume"));
    refused(folder.read("b.nii.gz"), "not a NIfTI file");
    folder.write("c.nii.gz", b"\x1f\x8bgarbage that is no deflate stream");
    refused(folder.read("c.nii.gz"), "cannot read volume");
    folder.write("d.nii.gz", &gzip(b""));
    refused(folder.read("d.nii.gz"), "empty");
}

#[test]
fn claims_that_the_file_cannot_hold() {
    let claim = |dim: [i64; 8]| NiftiBytes::new([4, 4, 4]).with(|f| f.dim = dim);
    let huge = [3, 32767, 32767, 32767, 1, 1, 1, 1];
    refused(read(&claim(huge)), "holds 416");
    refused(read(&claim([7, 32767, 32767, 32767, 32767, 32767, 32767, 32767])), "holds 416");
    let folder = Folder::new();
    folder.write("a.nii.gz", &gzip(&claim(huge).bytes()));
    refused(folder.read("a.nii.gz"), "compressed bytes");
    // Sizes that a deflate stream could contain are read until the stream ends.
    folder.write("b.nii.gz", &gzip(&claim([3, 90, 90, 9, 1, 1, 1, 1]).bytes()));
    refused(folder.read("b.nii.gz"), "ends after 416");
    let overflowing = NiftiBytes::new([4, 4, 4])
        .version_2()
        .with(|f| f.dim = [7, i64::MAX, i64::MAX, 2, 2, i64::MAX, 2, i64::MAX]);
    refused(read(&overflowing), "cannot be counted");
    let overflowing =
        NiftiBytes::new([4, 4, 4]).version_2().with(|f| f.dim = [3, 1 << 40, 1 << 40, 4, 1, 1, 1, 1]);
    refused(read(&overflowing), "than can be counted");
}

#[test]
fn senseless_dimensions() {
    let dims = |dim: [i64; 8]| read(&NiftiBytes::new([4, 4, 4]).with(|f| f.dim = dim));
    refused(dims([3, 4, -4, 4, 1, 1, 1, 1]), "dimension 2 is -4");
    refused(dims([3, 4, 4, 0, 1, 1, 1, 1]), "dimension 3 is 0");
    refused(dims([4, 4, 4, 4, 0, 1, 1, 1]), "dimension 4 is 0");
    refused(dims([0, 4, 4, 4, 1, 1, 1, 1]), "number of dimensions");
    refused(dims([8, 4, 4, 4, 1, 1, 1, 1]), "number of dimensions");
    refused(dims([-3, 4, 4, 4, 1, 1, 1, 1]), "number of dimensions");
    let two = NiftiBytes::new([4, 4, 4]).version_2().with(|f| f.dim[0] = 1 << 40);
    refused(read(&two), "number of dimensions");
}

#[test]
fn files_that_are_not_nifti_are_refused() {
    let folder = Folder::new();
    let mut dicom = vec![0; 128];
    dicom.extend(b"DICM and more");
    let mut analyze = NiftiBytes::new([4, 4, 4]).bytes();
    analyze[344..348].fill(0);
    let mut newlines = NiftiBytes::new([4, 4, 4]).version_2().bytes();
    newlines[8] = b'\n';
    for (name, bytes, why) in [
        ("empty.nii", vec![], "empty"),
        ("short.nii", vec![92], "not a NIfTI file"),
        ("text.nii", b"hello, world; this is a text file".to_vec(), "not a NIfTI file"),
        ("zeros.nii", vec![0; 4096], "not a NIfTI file"),
        ("newlines.nii", newlines, "magic"),
    ] {
        folder.write(name, &bytes);
        assert!(refused(folder.read(name), why).hint.is_some_and(|h| h.contains(".nii.gz")), "{name}");
    }
    folder.write("scan.dcm", &dicom);
    refused(folder.read("scan.dcm"), "transfer syntax");
    // The header of Analyze 7.5 is one of a pair.
    folder.write("analyze.nii", &analyze);
    refused(folder.read("analyze.nii"), ".img");
    refused(folder.read("absent.nii"), "no such file");
    fs::create_dir(folder.path("folder.nii")).unwrap();
    refused(folder.read("folder.nii"), "folder");
    refused(folder.read(""), "no DICOM images");
    refused(load(&VolumeSpec::new("")), "no such file");
}

#[test]
fn flags_of_raw_files_are_refused() {
    let folder = Folder::new();
    folder.write("a.nii", &NiftiBytes::new([2, 2, 2]).bytes());
    let spec = VolumeSpec::new(folder.path("a.nii").to_str().unwrap());
    refused(
        load(&VolumeSpec {
            flags: ReadFlags { spacing: Some([1.0; 3]), ..Default::default() },
            ..spec.clone()
        }),
        "--spacing",
    );
    refused(
        load(&VolumeSpec { flags: ReadFlags { offset: Some(0), ..Default::default() }, ..spec }),
        "--offset",
    );
}
