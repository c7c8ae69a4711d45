//! Command line of `umbravox benchmark`, without a device.

use crate::program::{refused, umbravox};

#[test]
fn cells_are_listed_by_pattern() {
    let dir = tempfile::tempdir().unwrap();
    let list = |cells: &str| {
        let output = umbravox(dir.path(), &["benchmark", "--list", "--cells", cells]);
        String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(list("*").len(), 12 * (3 * 4 * 3 + 2));
    assert_eq!(
        list("foam-thin-lamp-*"),
        ["foam-thin-lamp-front", "foam-thin-lamp-above", "foam-thin-lamp-close"]
    );
}

#[test]
fn mistakes_are_refused_before_anything_is_made() {
    let dir = tempfile::tempdir().unwrap();
    for (arguments, words) in [
        (&["--cells", "brain-*"][..], &["--cells brain-*", "no cell"][..]),
        (&["--cells", "engine-*"], &["engine.nii.gz", "no such file"]),
        (&["--cells", "cloud-*", "--methods", "none"], &["--methods none", "dsm"]),
        (&["--cells", "cloud-*", "--budget", "bytes=none"], &["--budget", "bytes=none"]),
        (&["--cells", "cloud-*", "--external", "dsm=true"], &["dsm=true", "shadow method"]),
        (&["--cells", "cloud-*", "--shard", "3/2"], &["3/2"]),
        (&["--cells", "cloud-*", "--settings", "none"], &["--settings (none)", "no results"]),
    ] {
        let error = refused(dir.path(), &[&["benchmark", "-o", "out"], arguments].concat());
        assert!(words.iter().all(|word| error.contains(word)), "{arguments:?}: {error}");
    }
    assert!(refused(dir.path(), &["benchmark"]).contains("--output"));
    std::fs::write(dir.path().join("engine.nii.gz"), "another file").unwrap();
    let error = refused(dir.path(), &["benchmark", "-o", "out", "--cells", "engine-*"]);
    assert!(error.contains("engine.nii.gz") && error.contains("its SHA-256 is"), "{error}");
}
