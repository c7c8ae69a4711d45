//! `--downsample`: fewer voxels at the right places, with a note in numbers. A volume too large for the machine is
//! refused before it is read.

use crate::program::{refused, succeed};
use std::fs::File;
use std::path::Path;
use umbravox::open::{VolumeSpec, load};
use umbravox::volume::Volume;

fn read(folder: &Path, name: &str) -> Volume {
    load(&VolumeSpec::new(folder.join(name).to_string_lossy())).unwrap()
}

#[test]
fn voxels_are_reduced_alike_while_they_are_read_and_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in ["whole.nii.gz", "whole.nrrd", "whole.npy", "whole.raw"] {
        succeed(at, &["convert", "phantom:thorax:50", "-o", name]);
        let said = succeed(at, &["convert", name, "--downsample=2x3x1", "-o", "streamed.nii"]).stderr;
        assert!(said.contains("reduced by 2x3x1 from 50 x 37 x 25 to 25 x 13 x 25"), "{name}: {said}");
        // A cropped part must be read before it is downsampled.
        let cropped = ["convert", name, "--crop", "0:49,,", "--downsample=2x3x1", "-o", "after.nii"];
        let said = succeed(at, &cropped).stderr;
        assert!(said.contains("reduced by 2x3x1"), "{name}: {said}");
        let [streamed, after] = ["streamed.nii", "after.nii"].map(|name| read(at, name));
        assert_eq!(streamed.resident().unwrap(), after.resident().unwrap(), "{name}");
        assert_eq!(streamed.world_from_index(), after.world_from_index(), "{name}");
        let whole = read(at, "whole.nii.gz");
        let mean = (0..6).map(|n| whole.value(10 + n % 2, 12 + n / 2, 7)).sum::<f64>() / 6.0;
        assert!((streamed.value(5, 4, 7) - mean).abs() <= 0.5, "{name}");
    }
    let said = succeed(at, &["info", "whole.nrrd", "--downsample=20kB"]).stdout;
    assert!(said.contains("reduced by 2x2x2 from 50 x 37 x 25 to 25 x 19 x 13"), "{said}");
    // A volume that fits is not changed, and there is no note.
    assert!(!succeed(at, &["info", "whole.nrrd", "--downsample"]).stdout.contains("reduced"));
    assert!(refused(at, &["info", "whole.nrrd", "--downsample=2x2"]).contains("--downsample"));
    assert!(
        refused(at, &["info", "whole.nrrd", "--downsample=1B"]).contains("cannot be reduced to fit 1 bytes")
    );
    assert!(
        refused(at, &["render", "phantom:hair-fur", "--downsample", "-o", "a.png"]).contains("--downsample")
    );
}

#[cfg(target_os = "linux")]
#[test]
fn more_than_the_machine_has_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = File::create(folder.path().join("huge.raw")).unwrap();
    // A sparse file; if the file system allows no such length, the test ends.
    if file.set_len(1 << 40).is_err() {
        return crate::common::skip("the file system has no files of a tebibyte");
    }
    let start = std::time::Instant::now();
    let error = refused(folder.path(), &["info", "huge.raw", "--raw", "8192x8192x16384:u8"]);
    assert!(error.contains("its voxels need 1024.0 GiB"), "{error}");
    assert!(error.contains("--downsample") && start.elapsed().as_secs() < 10, "{error}");
}
