//! Damaged files: whatever they hold, a reader answers with a volume or with one line, soon, and in little memory.
//!
//! `UMBRAVOX_MUTANTS=N` tries N of each kind of file instead of a few hundred. What failed is kept in a folder that the
//! message names.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use umbravox::open::{VolumeSpec, load};

/// One file is damaged; those beside it are there as they were.
struct Seed {
    kind: &'static str,
    /// What is opened, in a folder of copies.
    opened: &'static str,
    /// What is damaged of it.
    damaged: &'static str,
}

const fn seed(kind: &'static str, opened: &'static str, damaged: &'static str) -> Seed {
    Seed { kind, opened, damaged }
}

const SEEDS: [Seed; 30] = [
    seed("nrrd", "raw_lps.nrrd", "raw_lps.nrrd"),
    seed("nrrd", "gzip_ras.nrrd", "gzip_ras.nrrd"),
    seed("nrrd", "text_las.nrrd", "text_las.nrrd"),
    seed("nrrd", "detached.nhdr", "detached.nhdr"),
    seed("nrrd", "itk.seq.nrrd", "itk.seq.nrrd"),
    seed("metaimage", "plain.mha", "plain.mha"),
    seed("metaimage", "packed.mha", "packed.mha"),
    seed("metaimage", "packed.mhd", "packed.mhd"),
    seed("metaimage", "packed.mhd", "packed.zraw"),
    seed("npy", "c.npy", "c.npy"),
    seed("npy", "fortran.npy", "fortran.npy"),
    seed("tiff", "pages.tif", "pages.tif"),
    seed("tiff", "deflate.tif", "deflate.tif"),
    seed("tiff", "big.tif", "big.tif"),
    seed("tiff", "tiled.tif", "tiled.tif"),
    seed("tiff", "imagej.tif", "imagej.tif"),
    seed("nifti", "plain.hdr", "plain.hdr"),
    seed("nifti", "one.nii", "one.nii"),
    seed("nifti", "one.nii.gz", "one.nii.gz"),
    seed("raw", "v.raw", "v.raw.json"),
    seed("dicom", "dicom_oblique/90.dcm", "dicom_oblique/90.dcm"),
    seed("dicom", "dicom_signed_implicit/90.dcm", "dicom_signed_implicit/90.dcm"),
    seed("dicom", "dicom_big/90.dcm", "dicom_big/90.dcm"),
    seed("dicom", "dicom_deflated/90.dcm", "dicom_deflated/90.dcm"),
    seed("dicom", "dicom_rle/90.dcm", "dicom_rle/90.dcm"),
    seed("dicom", "dicom_jpegls/90.dcm", "dicom_jpegls/90.dcm"),
    seed("dicom", "dicom_j2k/90.dcm", "dicom_j2k/90.dcm"),
    seed("dicom", "dicom_jpeg_lossless/0.dcm", "dicom_jpeg_lossless/0.dcm"),
    seed("dicom", "dicom_missing", "dicom_missing/89.dcm"),
    seed("dicom", "enhanced.dcm", "enhanced.dcm"),
];

/// Words that headers are made of, put where they do not belong.
const WORDS: [&[u8]; 16] = [
    b"4294967295",
    b"-1",
    b"99999999999999999999",
    b"nan",
    b"1e308",
    b"0",
    b"\n",
    b"../../../etc/passwd",
    b"NRRD0005\n",
    b"sizes: 65535 65535 65535\n",
    b"DimSize = 65535 65535 65535\n",
    b"(65535, 65535, 65535)",
    b"\xff\xff\xff\xff",
    b"\x00\x00\x00\x80",
    b"\xfe\xff\xdd\xe0",
    b"encoding: gzip\n",
];

fn mutate(random: &mut fastrand::Rng, bytes: &mut Vec<u8>) {
    for _ in 0..1 + random.usize(..4) {
        let at = random.usize(..bytes.len().max(1)).min(bytes.len().saturating_sub(1));
        // Headers come first, and are where the harm is.
        let at = if random.bool() { at.min(random.usize(..700)) } else { at };
        if bytes.is_empty() {
            return;
        }
        match random.u8(..9) {
            0 => bytes[at] ^= 1 << random.u8(..8),
            1 => bytes[at] = random.u8(..),
            2 => bytes[at] = *random.choice(&[0, 1, 0x7f, 0x80, 0xff, b'0', b'9', b' ', b'\n']).unwrap(),
            3 => bytes.truncate(at),
            4 => {
                let to = (at + random.usize(1..64)).min(bytes.len());
                bytes.drain(at..to);
            }
            5 => {
                let to = (at + random.usize(1..64)).min(bytes.len());
                let piece = bytes[at..to].to_vec();
                let into = random.usize(..=bytes.len());
                bytes.splice(into..into, piece);
            }
            6 => {
                let word = *random.choice(&WORDS).unwrap();
                let to = if random.bool() { at } else { (at + word.len()).min(bytes.len()) };
                bytes.splice(at..to, word.iter().copied());
            }
            7 => {
                let value = random.u64(..).to_le_bytes();
                for (byte, new) in bytes[at..].iter_mut().zip(&value[..1 << random.u8(..4)]) {
                    *byte = *new;
                }
            }
            _ => {
                // A digit more or less in a number of text.
                if bytes[at].is_ascii_digit() {
                    bytes.insert(at, b'0' + random.u8(..10));
                }
            }
        }
    }
}

fn copy(from: &Path, to: &Path) {
    if from.is_dir() {
        std::fs::create_dir_all(to).unwrap();
        for entry in std::fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            copy(&entry.path(), &to.join(entry.file_name()));
        }
    } else {
        std::fs::copy(from, to).unwrap();
    }
}

/// Files that no other library made.
fn own_seeds(folder: &Path) {
    use umbravox::volume::{Phantom, write_volume};
    let volume = Phantom::Shell.build(8).unwrap();
    for name in ["one.nii", "one.nii.gz", "v.raw"] {
        write_volume(&volume, &folder.join(name)).unwrap();
    }
}

/// The most memory that this process has had, in bytes; `None` where the system does not say.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kb| kb << 10)
}

#[test]
fn damaged_files_are_read_or_refused() {
    let count: usize = std::env::var("UMBRAVOX_MUTANTS").ok().and_then(|n| n.parse().ok()).unwrap_or(300);
    let kept = std::env::temp_dir().join("umbravox-mutants");
    let (slowest, next) = (Mutex::new((Duration::ZERO, String::new())), AtomicUsize::new(0));
    let faults = Mutex::new(Vec::<String>::new());
    let tried: [(AtomicUsize, AtomicUsize); SEEDS.len()] = Default::default();
    let fault = |what: String| faults.lock().unwrap_or_else(PoisonError::into_inner).push(what);
    let work = || {
        let home = tempfile::tempdir().unwrap();
        copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/formats/files"), home.path());
        own_seeds(home.path());
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(Seed { kind, opened, damaged }) = SEEDS.get(at % SEEDS.len()) else { return };
            // Rounds of a few hundred of one seed, so that files are put back seldom.
            let round = at / SEEDS.len();
            let of_round = count.saturating_sub(round * 500).min(500);
            if of_round == 0 {
                return;
            }
            let path: PathBuf = home.path().join(damaged);
            let whole = std::fs::read(&path).unwrap();
            let spec = VolumeSpec::new(home.path().join(opened).to_str().unwrap());
            let mut random = fastrand::Rng::with_seed((at * 1_000_003) as u64);
            for turn in 0..of_round {
                let mut bytes = whole.clone();
                mutate(&mut random, &mut bytes);
                std::fs::write(&path, &bytes).unwrap();
                let keep = |why: &str| {
                    std::fs::create_dir_all(&kept).unwrap();
                    let name = kept.join(format!("{kind}-{round}-{turn}-{}", opened.replace('/', "_")));
                    std::fs::write(&name, &bytes).unwrap();
                    fault(format!("{}: {why}", name.display()));
                };
                let begun = Instant::now();
                let result = catch_unwind(AssertUnwindSafe(|| load(&spec)));
                let took = begun.elapsed();
                tried[at % SEEDS.len()].0.fetch_add(1, Ordering::Relaxed);
                match result {
                    Err(_) => keep("it panics"),
                    Ok(Ok(_)) => {
                        tried[at % SEEDS.len()].1.fetch_add(1, Ordering::Relaxed);
                    }
                    Ok(Err(e)) if e.exit_status() != 2 => keep(&format!("status {}: {e}", e.exit_status())),
                    Ok(Err(e)) if e.to_string().lines().count() != 1 => keep(&format!("not one line: {e:?}")),
                    Ok(Err(_)) => {}
                }
                let mut slowest = slowest.lock().unwrap_or_else(PoisonError::into_inner);
                if took > slowest.0 {
                    *slowest = (took, format!("{kind} {opened}"));
                    if took > Duration::from_secs(1) {
                        keep(&format!("it takes {took:?}"));
                    }
                }
            }
            std::fs::write(&path, &whole).unwrap();
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(2, usize::from) {
            scope.spawn(work);
        }
    });
    for (Seed { kind, damaged, .. }, (tried, read)) in SEEDS.iter().zip(&tried) {
        let (tried, read) = (tried.load(Ordering::Relaxed), read.load(Ordering::Relaxed));
        println!("{kind:<10} {damaged:<30} {tried} tried, {read} of them read");
        assert!(tried >= count && read < tried, "{damaged}");
    }
    let (took, of) = &*slowest.lock().unwrap();
    println!("slowest: {took:?} ({of}); peak memory {:?} bytes", peak_bytes());
    let faults = faults.into_inner().unwrap();
    assert!(
        faults.is_empty(),
        "{} faults, first {}",
        faults.len(),
        faults[..faults.len().min(12)].join("\n")
    );
    if let Some(peak) = peak_bytes() {
        assert!(peak < 1 << 30, "{peak} bytes");
    }
}
