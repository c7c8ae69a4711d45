//! Damaged volume files: a reader returns their values or a one-line error, quickly, and in little memory.
//!
//! `UMBRAVOX_MUTANTS=N` tries N of each file instead of those of `common::SIZES`, after the first
//! `UMBRAVOX_MUTANTS_AFTER`; `UMBRAVOX_MUTANTS_OF=nrrd,npy` only of these kinds. What failed is kept in a folder that
//! the message names.

use crate::common::{SIZES, copy};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use umbravox::files::loading::Loading;
use umbravox::open::{VolumeSpec, load};
use umbravox::transfer::TransferFunction;
use umbravox::{strands, transfer};

/// Kind of a damaged file, which selects its reader.
#[derive(Clone, Copy)]
enum Of {
    Volume,
    Strands,
    Transfer,
}

impl Of {
    /// Reads a damaged file, and uses its contents.
    fn read(self, path: &Path) -> umbravox::Result<()> {
        match self {
            Self::Volume => load(&VolumeSpec::new(path.to_string_lossy())).map(|_| ()),
            Self::Strands => strands::read_strands(path, &Loading::default()).map(|strands| {
                assert!(strands.arrays().points.iter().flatten().all(|x| x.is_finite()));
            }),
            Self::Transfer => transfer::formats::read(path).map(|carried| {
                let again = TransferFunction::from_json(&carried.tf.to_json());
                again.unwrap_or_else(|why| panic!("it does not obey the rules of its own file: {why}"));
            }),
        }
    }
}

/// Sample file that is damaged; files beside it stay unchanged.
struct Seed {
    of: Of,
    kind: &'static str,
    /// File that is opened, in a folder of copies.
    opened: &'static str,
    /// File that is damaged.
    damaged: &'static str,
}

const fn seed(kind: &'static str, opened: &'static str, damaged: &'static str) -> Seed {
    Seed { of: Of::Volume, kind, opened, damaged }
}

const fn strands(kind: &'static str, opened: &'static str) -> Seed {
    Seed { of: Of::Strands, kind, opened, damaged: opened }
}

const fn transfer(kind: &'static str, opened: &'static str) -> Seed {
    Seed { of: Of::Transfer, kind, opened, damaged: opened }
}

static SEEDS: &[Seed] = &[
    seed("nrrd", "raw_lps.nrrd", "raw_lps.nrrd"),
    seed("nrrd", "gzip_ras.nrrd", "gzip_ras.nrrd"),
    seed("nrrd", "text_las.nrrd", "text_las.nrrd"),
    seed("nrrd", "layers.seg.nrrd", "layers.seg.nrrd"),
    seed("nrrd", "detached.nhdr", "detached.nhdr"),
    seed("nrrd", "itk.seq.nrrd", "itk.seq.nrrd"),
    seed("metaimage", "plain.mha", "plain.mha"),
    seed("metaimage", "packed.mha", "packed.mha"),
    seed("metaimage", "packed.mhd", "packed.mhd"),
    seed("metaimage", "packed.mhd", "packed.zraw"),
    seed("metaimage", "list.mhd", "list.mhd"),
    seed("nrrd", "slabs.nhdr", "slabs.nhdr"),
    seed("nrrd", "pattern.nhdr", "pattern.nhdr"),
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
    seed("dicom", "dicom_segments.dcm", "dicom_segments.dcm"),
    seed("dicom", "dicom_labelmap.dcm", "dicom_labelmap.dcm"),
    seed("dicom", "dicom_signed_implicit/90.dcm", "dicom_signed_implicit/90.dcm"),
    seed("dicom", "dicom_big/90.dcm", "dicom_big/90.dcm"),
    seed("dicom", "dicom_deflated/90.dcm", "dicom_deflated/90.dcm"),
    seed("dicom", "dicom_rle/90.dcm", "dicom_rle/90.dcm"),
    seed("dicom", "dicom_jpegls/90.dcm", "dicom_jpegls/90.dcm"),
    seed("dicom", "dicom_j2k/90.dcm", "dicom_j2k/90.dcm"),
    seed("dicom", "dicom_jpeg_lossless/0.dcm", "dicom_jpeg_lossless/0.dcm"),
    seed("dicom", "dicom_missing", "dicom_missing/89.dcm"),
    seed("dicom", "enhanced.dcm", "enhanced.dcm"),
    seed("dicom", "dicom_unknown/0.dcm", "dicom_unknown/0.dcm"),
    seed("dicom", "dicom_table/0.dcm", "dicom_table/0.dcm"),
    seed("dicom", "dicom_float/0.dcm", "dicom_float/0.dcm"),
    seed("zarr", "two.ome.zarr", "two.ome.zarr/.zattrs"),
    seed("zarr", "two.ome.zarr", "two.ome.zarr/s0/.zarray"),
    seed("zarr", "three.ome.zarr", "three.ome.zarr/zarr.json"),
    seed("zarr", "v3_sharded.zarr", "v3_sharded.zarr/zarr.json"),
    seed("zarr", "v3_sharded.zarr", "v3_sharded.zarr/c/0/0/0"),
    seed("zarr", "v3_turned.zarr", "v3_turned.zarr/c/0/0/0"),
    seed("zarr", "v2_gzip.zarr", "v2_gzip.zarr/0.0.0"),
    seed("zarr", "v2_zstd.zarr", "v2_zstd.zarr/0.0.0"),
    seed("zarr", "v2_blosclz_1.zarr", "v2_blosclz_1.zarr/0.0.0"),
    seed("zarr", "v2_lz4_2.zarr", "v2_lz4_2.zarr/0.0.0"),
    seed("zarr", "v2_zlib_1.zarr", "v2_zlib_1.zarr/0.0.0"),
    seed("zarr", "v2_zstd_2.zarr", "v2_zstd_2.zarr/0.0.0"),
    seed("vti", "appended.vti", "appended.vti"),
    seed("vti", "raw.vti", "raw.vti"),
    seed("vti", "raw_packed.vti", "raw_packed.vti"),
    seed("vti", "inline.vti", "inline.vti"),
    seed("vti", "text.vti", "text.vti"),
    seed("vti", "cells.vti", "cells.vti"),
    seed("vti", "pieces.vti", "pieces.vti"),
    strands("hair", "own.hair"),
    strands("tck", "little.tck"),
    strands("tck", "big.tck"),
    strands("trk", "oblique.trk"),
    strands("trk", "big.trk"),
    strands("trk", "uncounted.trk"),
    strands("vtk", "text4.vtk"),
    strands("vtk", "text5.vtk"),
    strands("vtk", "binary4.vtk"),
    strands("vtk", "binary5.vtk"),
    strands("vtp", "default.vtp"),
    strands("vtp", "inline.vtp"),
    strands("vtp", "inline_plain.vtp"),
    strands("vtp", "raw.vtp"),
    strands("vtp", "raw_plain.vtp"),
    strands("vtp", "text.vtp"),
    strands("obj", "lines.obj"),
    transfer("paraview", "paraview.json"),
    transfer("paraview", "paraview_bent.json"),
    transfer("slicer", "slicer.vp"),
    transfer("slicer", "slicer.vp.json"),
    transfer("niivue", "niivue.json"),
    transfer("niivue", "niivue_range.json"),
    transfer("inviwo", "inviwo.itf"),
    transfer("inviwo", "inviwo_old.itf"),
    transfer("own-tf", "own.json"),
];

/// Words that occur in file headers, inserted at random places.
const WORDS: [&[u8]; 26] = [
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
    b"END\n",
    b"\x00\x00\xc0\x7f",
    b"LINES 99999999 99999999\n",
    b"NumberOfPoints=\"99999999999\"",
    b"offset=\"18446744073709551615\"",
    b"[[[[[[[[[[[[[[[[",
    b"<a><a><a><a><a>",
    b"null",
    b"[1000000, 1000000, 1000000]",
    b"1000000000",
];

fn mutate(random: &mut fastrand::Rng, bytes: &mut Vec<u8>) {
    for _ in 0..1 + random.usize(..4) {
        let at = random.usize(..bytes.len().max(1)).min(bytes.len().saturating_sub(1));
        // Most positions are in the header, at the beginning of the file, where damage matters most.
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

/// Creates a folder with all sample files.
fn seeds_in(home: &Path) {
    use umbravox::formats::write_volume;
    use umbravox::phantom::Phantom;
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    for folder in ["formats/files", "formats/transfer", "data/strands"] {
        copy(&tests.join(folder), home);
    }
    // Files written by this program alone.
    let volume = Phantom::Shell.build(8).unwrap();
    for name in ["one.nii", "one.nii.gz", "v.raw"] {
        write_volume(&volume, &home.join(name)).unwrap();
    }
    let curls = strands::StrandSet::Curly.build(60).unwrap();
    strands::write_hair(&curls, &home.join("own.hair")).unwrap();
}

/// Peak memory of this process, bytes; `None` if the system does not report it.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kb| kb << 10)
}

/// Counts of the damaged copies (mutants) of one sample file.
#[derive(Default)]
struct Counts {
    tried: AtomicUsize,
    read: AtomicUsize,
}

/// State that all threads of a run share.
struct Run {
    seeds: Vec<&'static Seed>,
    counts: Vec<Counts>,
    /// Number of mutants of each sample file, and of those before them that another run has tried.
    count: usize,
    after: usize,
    next: AtomicUsize,
    slowest: Mutex<(Duration, String)>,
    faults: Mutex<Vec<String>>,
    kept: PathBuf,
}

/// Number of successive mutants of one sample file, so that files are seldom restored.
const ROUND: usize = 500;

impl Run {
    fn of_environment() -> Self {
        let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<usize>().ok());
        let of = std::env::var("UMBRAVOX_MUTANTS_OF").unwrap_or_default();
        let wanted = |seed: &&Seed| of.is_empty() || of.split(',').any(|kind| kind == seed.kind);
        let seeds: Vec<&Seed> = SEEDS.iter().filter(wanted).collect();
        Self {
            counts: seeds.iter().map(|_| Counts::default()).collect(),
            seeds,
            count: number("UMBRAVOX_MUTANTS").unwrap_or(SIZES.damaged_files),
            after: number("UMBRAVOX_MUTANTS_AFTER").unwrap_or(0),
            next: AtomicUsize::new(0),
            slowest: Mutex::default(),
            faults: Mutex::default(),
            kept: std::env::temp_dir().join("umbravox-mutants"),
        }
    }

    /// Works on rounds of mutants until none are left.
    fn work(&self) {
        let home = tempfile::tempdir().unwrap();
        seeds_in(home.path());
        loop {
            let at = self.next.fetch_add(1, Ordering::Relaxed);
            let (place, round) = (at % self.seeds.len(), at / self.seeds.len());
            let of_round = self.count.saturating_sub(round * ROUND).min(ROUND);
            if of_round == 0 {
                return;
            }
            let path: PathBuf = home.path().join(self.seeds[place].damaged);
            let whole = std::fs::read(&path).unwrap();
            // A sample file has the same mutants in the same order, independent of the others.
            let seed = SEEDS.iter().position(|seed| std::ptr::eq(seed, self.seeds[place])).unwrap();
            let from = (self.after / ROUND + round) as u64;
            let mut random = fastrand::Rng::with_seed(from.wrapping_mul(1_000_003) ^ (seed as u64) << 40);
            for turn in 0..of_round {
                let mut bytes = whole.clone();
                mutate(&mut random, &mut bytes);
                std::fs::write(&path, &bytes).unwrap();
                if let Some(why) = self.attempt(place, home.path()) {
                    std::fs::create_dir_all(&self.kept).unwrap();
                    let Seed { kind, damaged, .. } = self.seeds[place];
                    let name = self.kept.join(format!("{kind}-{from}-{turn}-{}", damaged.replace('/', "_")));
                    std::fs::write(&name, &bytes).unwrap();
                    let fault = format!("{}: {why}", name.display());
                    self.faults.lock().unwrap_or_else(PoisonError::into_inner).push(fault);
                }
            }
            std::fs::write(&path, &whole).unwrap();
        }
    }

    /// Opens the mutant in `home`, and describes what is wrong with the result, if anything.
    fn attempt(&self, place: usize, home: &Path) -> Option<String> {
        let (seed, counts) = (self.seeds[place], &self.counts[place]);
        let path = home.join(seed.opened);
        let timed = || {
            let begun = Instant::now();
            let result = catch_unwind(AssertUnwindSafe(|| seed.of.read(&path)));
            (result, begun.elapsed())
        };
        let (mut result, mut took) = timed();
        if took > Duration::from_secs(1) {
            // Other programs may have slowed the machine: the second time counts.
            (result, took) = timed();
        }
        counts.tried.fetch_add(1, Ordering::Relaxed);
        let fault = match result {
            Err(_) => Some("it panics".into()),
            Ok(Ok(())) => {
                counts.read.fetch_add(1, Ordering::Relaxed);
                None
            }
            Ok(Err(e)) if e.exit_status() != 2 => Some(format!("status {}: {e}", e.exit_status())),
            Ok(Err(e)) if e.to_string().lines().count() != 1 => Some(format!("not one line: {e:?}")),
            Ok(Err(_)) => None,
        };
        let mut slowest = self.slowest.lock().unwrap_or_else(PoisonError::into_inner);
        if took > slowest.0 {
            *slowest = (took, format!("{} {}", seed.kind, seed.damaged));
        }
        fault.or_else(|| (took > Duration::from_secs(1)).then(|| format!("it takes {took:?}")))
    }

    /// Prints what was done, and fails if anything is wrong.
    fn judge(self) {
        for (Seed { kind, damaged, .. }, counts) in self.seeds.iter().zip(&self.counts) {
            let (tried, read) = (counts.tried.load(Ordering::Relaxed), counts.read.load(Ordering::Relaxed));
            println!("{kind:<10} {damaged:<30} {tried} tried, {read} of them read");
            // Few mutants of a series that tolerates damaged slices may all be readable.
            assert!(tried >= self.count && (read < tried || self.count < 1000), "{damaged}");
        }
        let (took, of) = &*self.slowest.lock().unwrap();
        println!("slowest: {took:?} ({of}); peak memory {:?} bytes", peak_bytes());
        let faults = self.faults.into_inner().unwrap();
        let first = faults[..faults.len().min(12)].join("\n");
        assert!(faults.is_empty(), "{} faults, first {first}", faults.len());
        if let Some(peak) = peak_bytes() {
            assert!(peak < 1 << 30, "{peak} bytes");
        }
    }
}

#[test]
fn damaged_files_are_read_or_refused() {
    let _alone = crate::ALONE.lock();
    let run = Run::of_environment();
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(2, usize::from) {
            scope.spawn(|| run.work());
        }
    });
    run.judge();
}
