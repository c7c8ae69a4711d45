//! Reading of files reports progress and stops when it is cancelled.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use umbravox::files::loading::{Loading, ReadingProgress, ReadingStage};
use umbravox::formats::write_nifti;
use umbravox::open::{SceneRequest, VolumeSpec, load};
use umbravox::strands::{StrandSet, write_hair};
use umbravox::volume::Histogram;

/// Random bytes, which a compressor cannot shorten much.
fn noise(bytes: usize) -> Vec<u8> {
    let mut state = 1_u64;
    let next = |_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as u8
    };
    (0..bytes).map(next).collect()
}

/// Writes one volume of `n` voxels a side in every file format.
fn files(folder: &Path, n: usize) -> Vec<PathBuf> {
    let raw = folder.join(format!("noise_{n}x{n}x{n}_uint16.raw"));
    std::fs::write(&raw, noise(2 * n * n * n)).unwrap();
    let volume = load(&VolumeSpec::new(raw.to_str().unwrap())).unwrap();
    let forms = ["plain.nii", "packed.nii.gz"].map(|name| folder.join(name));
    for path in &forms {
        write_nifti(&volume, path).unwrap();
    }
    let hair = folder.join("curls.hair");
    write_hair(&StrandSet::Curly.build(n * 500).unwrap(), &hair).unwrap();
    [vec![raw, hair], forms.to_vec()].concat()
}

fn spec(source: &str) -> VolumeSpec {
    let mut spec = VolumeSpec::new(source);
    if source.contains("hair") {
        spec.flags.strands.resolution = Some(64);
    }
    spec
}

/// Reads a volume as the window does, watched from another thread.
fn watched(
    source: &str,
    mut each: impl FnMut(&Loading, ReadingProgress),
) -> (umbravox::Result<u64>, Arc<Loading>) {
    let loading = Arc::new(Loading::default());
    let (theirs, spec) = (Arc::clone(&loading), spec(source));
    let thread = std::thread::spawn(move || {
        let volume = spec.read(&theirs)?.volume;
        Ok(Histogram::of_with(&volume, 64, &theirs)?.counts.iter().sum())
    });
    while !thread.is_finished() {
        each(&loading, loading.progress());
        std::thread::sleep(Duration::from_micros(300));
    }
    (thread.join().unwrap(), loading)
}

#[test]
fn the_share_rises_to_one_and_the_volume_is_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let mut sources: Vec<String> =
        files(dir.path(), 120).iter().map(|p| p.to_str().unwrap().to_owned()).collect();
    sources.extend(["phantom:thorax:96", "phantom:shell:96", "phantom:hair-fur:30000"].map(String::from));
    for source in sources {
        let mut seen = vec![ReadingProgress::default()];
        let (voxels, loading) = watched(&source, |_, progress| seen.push(progress));
        assert!(seen.windows(2).all(|w| w[0].share <= w[1].share), "{source}: {seen:?}");
        assert_eq!(
            loading.progress(),
            ReadingProgress { stage: ReadingStage::Counting, share: 1.0 },
            "{source}"
        );
        let plain = load(&spec(&source)).unwrap();
        assert_eq!(voxels.unwrap(), plain.dims().iter().map(|n| *n as u64).product::<u64>(), "{source}");
        let again = spec(&source).read(&Loading::default()).unwrap().volume;
        assert_eq!(again.resident().unwrap(), plain.resident().unwrap(), "{source}");
    }
}

#[test]
fn a_packed_file_is_as_far_as_its_packed_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let path = files(dir.path(), 40).pop().unwrap();
    // Half of the file is missing: reading ends there, with the progress so far.
    let bytes = std::fs::read(&path).unwrap();
    let half = dir.path().join("half.nii.gz");
    std::fs::write(&half, &bytes[..bytes.len() / 2]).unwrap();
    let loading = Loading::default();
    assert!(spec(half.to_str().unwrap()).read(&loading).is_err());
    assert_eq!(
        loading.progress(),
        ReadingProgress { stage: ReadingStage::Unpacking, share: 0.85 },
        "all of it was read"
    );
    // If as many bytes follow that are never read, the voxels are the first half.
    let mut more = std::fs::File::options().append(true).open(&path).unwrap();
    more.write_all(&noise(bytes.len())).unwrap();
    let loading = Loading::default();
    let outcome = spec(path.to_str().unwrap()).read(&loading);
    // The bytes behind the stream are no gzip: they are refused, but only after the voxels.
    assert!(outcome.unwrap_err().to_string().contains("damaged after the voxels"));
    let share = loading.progress().share / 0.85;
    // Read-ahead is 64 KiB.
    let ahead = 65_536.0 / (2 * bytes.len()) as f64;
    assert!((0.5 - 1e-9..=0.5 + ahead).contains(&share), "{share} {ahead}");
}

#[test]
fn a_cancel_ends_the_reading_and_keeps_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let mut sources: Vec<String> =
        files(dir.path(), 280).iter().map(|p| p.to_str().unwrap().to_owned()).collect();
    sources.extend(["phantom:thorax:400", "phantom:hair-curly:3000000"].map(String::from));
    let mut ended_early = 0;
    for source in &sources {
        let mut cancelled = None;
        let (outcome, loading) = watched(source, |loading, progress| {
            if progress.share > 0.02 && cancelled.is_none() {
                loading.cancel();
                cancelled = Some((progress, Instant::now()));
            }
        });
        // A busy machine may be done before anyone has looked.
        let Some((progress, since)) = cancelled else { continue };
        let end = loading.progress();
        println!("{source}: cancelled at {progress:?}, at an end {:?} later at {end:?}", since.elapsed());
        if progress.share < 0.5 {
            ended_early += 1;
            let why = outcome.unwrap_err().to_string();
            assert!(why.contains("cancelled"), "{source}: {why}");
            assert!(end.share < 0.9, "{source}: it went on to {end:?}");
        }
    }
    assert!(ended_early >= 2, "only {ended_early} of {} were caught in time", sources.len());
}

#[test]
fn a_cancelled_reading_does_not_begin() {
    let dir = tempfile::tempdir().unwrap();
    let mut sources: Vec<String> =
        files(dir.path(), 24).iter().map(|p| p.to_str().unwrap().to_owned()).collect();
    sources.extend(["phantom:thorax:1024", "phantom:hair-fur:30000000"].map(String::from));
    for source in sources {
        let loading = Loading::default();
        loading.cancel();
        let error = spec(&source).read(&loading).unwrap_err();
        assert!(error.to_string().contains("cancelled") && error.exit_status() == 1, "{source}: {error}");
        assert_eq!(loading.progress().share, 0.0, "{source}");
    }
}

#[test]
fn notes_on_functions_of_labels_give_the_true_reason_for_the_units() {
    let dir = tempfile::tempdir().unwrap();
    let raw = dir.path().join("small_4x4x4_uint8.raw");
    std::fs::write(&raw, (0..64).map(|i| 3 * i + i % 2).collect::<Vec<u8>>()).unwrap();
    let labels = dir.path().join("labels_4x4x4_uint8.raw");
    std::fs::write(&labels, (0..64).map(|i| i % 5).collect::<Vec<u8>>()).unwrap();
    let scene = format!("volume = '{}'\nlabels = '{}'\nlabel-tf = '4=skin'", raw.display(), labels.display());
    let loaded = SceneRequest::from_toml(&scene).unwrap().settings.load(&Loading::default()).unwrap();
    let notes: Vec<_> = loaded.diagnostics.iter().map(|d| d.message.as_str()).collect();
    assert!(
        notes.iter().any(|note| note.contains("`skin`") && note.contains("span too little")),
        "{notes:?}"
    );
    assert!(!notes.iter().any(|note| note.contains("(--units fraction)")), "{notes:?}");
}
