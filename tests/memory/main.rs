//! Peak memory of reading volumes: at most one and a half times the bytes of the voxels, counted by an allocator.
//!
//! A program of its own, whose tests run one after the other: memory is counted for the whole process.

#[path = "../common/mod.rs"]
mod common;
mod mutants;

use ndarray::Array3;
use std::alloc::{GlobalAlloc, Layout, System};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use umbravox::formats::write_volume;
use umbravox::open::{ReadFlags, VolumeSpec, load};
use umbravox::volume::{Provenance, Scaling, Volume, Voxels};

/// System allocator that counts the present and the peak memory.
struct Counting;

static TAKEN: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

fn take(bytes: usize) {
    let taken = TAKEN.fetch_add(bytes, Ordering::Relaxed) + bytes;
    MOST.fetch_max(taken, Ordering::Relaxed);
}

// SAFETY: every call is passed on unchanged to the system allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        // SAFETY: the caller satisfies the contract of the system allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        // SAFETY: the caller satisfies the contract of the system allocator.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        TAKEN.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller satisfies the contract of the system allocator.
        unsafe { System.dealloc(at, layout) }
    }

    // The system moves large blocks by remapping pages: old and new blocks do not exist at the same time.
    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        TAKEN.fetch_sub(layout.size(), Ordering::Relaxed);
        take(size);
        // SAFETY: the caller satisfies the contract of the system allocator.
        unsafe { System.realloc(at, layout, size) }
    }
}

/// Lock that each test of this program takes, so that they run one after the other.
static ALONE: Mutex<()> = Mutex::new(());

#[global_allocator]
static COUNTING: Counting = Counting;

const DIMS: [usize; 3] = [320, 256, 128];

fn value(i: usize, j: usize, k: usize) -> i16 {
    ((i * 31 + j * 17 + k * 7) % 3001) as i16 - 1000
}

/// Writes a file: a header, then the bytes that a function writes.
fn write(path: &Path, header: &[u8], bytes: impl Fn(&mut BufWriter<File>)) {
    let mut file = BufWriter::new(File::create(path).unwrap());
    file.write_all(header).unwrap();
    bytes(&mut file);
    file.flush().unwrap();
}

fn each(mut with: impl FnMut(i16)) {
    let [nx, ny, nz] = DIMS;
    for (k, j, i) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (k, j, i)))) {
        with(value(i, j, k));
    }
}

/// Files that store the same voxels in every supported way.
fn files(home: &Path) -> Vec<(String, ReadFlags)> {
    let [nx, ny, nz] = DIMS;
    let voxels = Voxels::I16(Array3::from_shape_fn((nz, ny, nx), |(k, j, i)| value(i, j, k)));
    let affine = glam::DAffine3::IDENTITY;
    let volume = Volume::new(voxels, Scaling::IDENTITY, affine, Provenance::new("test", "test", "")).unwrap();
    let mut names = Vec::new();
    for ending in ["nii", "nii.gz", "nrrd", "npy", "raw"] {
        let name = format!("by_us.{ending}");
        write_volume(&volume, &home.join(&name)).unwrap();
        names.push((name, ReadFlags::default()));
    }
    let mut add = |name: &str, header: &str, bytes: &dyn Fn(&mut BufWriter<File>)| {
        write(&home.join(name), header.as_bytes(), bytes);
        names.push((name.to_string(), ReadFlags::default()));
    };
    let nrrd = |kind: &str, encoding: &str, endian: &str| {
        format!(
            "NRRD0005\ntype: {kind}\ndimension: 3\nsizes: {nx} {ny} {nz}\nspacings: 1 1 1\nencoding: {encoding}\n\
            endian: {endian}\n\n"
        )
    };
    add("text.nrrd", &nrrd("short", "ascii", "little"), &|f| each(|v| writeln!(f, "{v}").unwrap()));
    add("turned.nrrd", &nrrd("short", "raw", "big"), &|f| each(|v| f.write_all(&v.to_be_bytes()).unwrap()));
    add("long.nrrd", &nrrd("int64", "raw", "little"), &|f| {
        each(|v| f.write_all(&i64::from(v).to_le_bytes()).unwrap());
    });
    let meta =
        format!("NDims = 3\nDimSize = {nx} {ny} {nz}\nElementType = MET_INT\nElementDataFile = LOCAL\n");
    add("int.mha", &meta, &|f| each(|v| f.write_all(&i32::from(v).to_le_bytes()).unwrap()));
    let text = format!("{{'descr': '<i2', 'fortran_order': True, 'shape': ({nz}, {ny}, {nx}), }}\n");
    let npy = [&b"\x93NUMPY\x01\0"[..], &(text.len() as u16).to_le_bytes(), text.as_bytes()].concat();
    write(&home.join("fortran.npy"), &npy, |f| {
        for (i, j, k) in (0..nx).flat_map(|i| (0..ny).flat_map(move |j| (0..nz).map(move |k| (i, j, k)))) {
            f.write_all(&value(i, j, k).to_le_bytes()).unwrap();
        }
    });
    names.push(("fortran.npy".into(), ReadFlags::default()));
    let tag = |data: &str| {
        format!(
            "<VTKFile type=\"ImageData\" byte_order=\"LittleEndian\" header_type=\"UInt64\"><ImageData WholeExtent=\"0 {x} 0 {y} 0 {z}\">\
            <Piece Extent=\"0 {x} 0 {y} 0 {z}\"><PointData Scalars=\"a\"><DataArray type=\"Int16\" Name=\"a\" {data}",
            x = nx - 1,
            y = ny - 1,
            z = nz - 1
        )
    };
    let end = "</DataArray></PointData></Piece></ImageData></VTKFile>";
    write(&home.join("text.vti"), tag("format=\"ascii\">").as_bytes(), |f| {
        each(|v| writeln!(f, "{v}").unwrap());
        f.write_all(end.as_bytes()).unwrap();
    });
    let appended = tag("format=\"appended\" offset=\"0\">") + end.strip_suffix("</VTKFile>").unwrap_or(end);
    let appended = appended + "<AppendedData encoding=\"raw\">_";
    write(&home.join("raw.vti"), appended.as_bytes(), |f| {
        f.write_all(&(2 * nx * ny * nz).to_le_bytes()).unwrap();
        each(|v| f.write_all(&v.to_le_bytes()).unwrap());
        f.write_all(b"</AppendedData></VTKFile>").unwrap();
    });
    names.extend(["text.vti", "raw.vti"].map(|name| (name.to_string(), ReadFlags::default())));
    zarr(home);
    names.push(("one.zarr".into(), ReadFlags::default()));
    tiff(home);
    names.push(("frames.tif".into(), ReadFlags { frame: Some(1), ..ReadFlags::default() }));
    names
}

/// Writes a Zarr array in one chunk.
fn zarr(home: &Path) {
    let [nx, ny, nz] = DIMS;
    let folder = home.join("one.zarr");
    std::fs::create_dir(&folder).unwrap();
    let about = format!(
        "{{\"zarr_format\": 2, \"shape\": [{nz}, {ny}, {nx}], \"chunks\": [{nz}, {ny}, {nx}], \"dtype\": \"<i2\", \
        \"order\": \"C\", \"compressor\": null, \"fill_value\": 0, \"filters\": null}}"
    );
    std::fs::write(folder.join(".zarray"), about).unwrap();
    write(&folder.join("0.0.0"), b"", |f| each(|v| f.write_all(&v.to_le_bytes()).unwrap()));
}

/// Writes TIFF pages of two channels, one after the other, as ImageJ does.
fn tiff(home: &Path) {
    use tiff::encoder::{TiffEncoder, colortype::Gray16};
    let [nx, ny, nz] = DIMS;
    let mut file = TiffEncoder::new(File::create(home.join("frames.tif")).unwrap()).unwrap();
    let about = format!("ImageJ=1.53\nimages={}\nchannels=2\nslices={nz}\n", 2 * nz);
    for page in 0..2 * nz {
        let pixels: Vec<u16> = (0..nx * ny).map(|at| value(at % nx, at / nx, page / 2) as u16).collect();
        let mut image = file.new_image::<Gray16>(nx as u32, ny as u32).unwrap();
        image.encoder().write_tag(tiff::tags::Tag::ImageDescription, about.as_str()).unwrap();
        image.write_data(&pixels).unwrap();
    }
}

#[test]
fn readers_take_little_more_than_the_voxels() {
    let _alone = ALONE.lock();
    let home = tempfile::tempdir().unwrap();
    let mut faults = Vec::new();
    for (name, flags) in files(home.path()) {
        let spec = VolumeSpec { source: home.path().join(&name).to_string_lossy().into_owned(), flags };
        let before = TAKEN.load(Ordering::Relaxed);
        MOST.store(before, Ordering::Relaxed);
        let volume = load(&spec).unwrap();
        let ratio = (MOST.load(Ordering::Relaxed) - before) as f64 / volume.bytes() as f64;
        println!("{name:<14} {:>4} MB {ratio:.3}", volume.bytes() >> 20);
        if name != "frames.tif" {
            assert_eq!(volume.value(7, 5, 3), f64::from(value(7, 5, 3)), "{name}");
        }
        assert_eq!(volume.dims(), DIMS, "{name}");
        if ratio > 1.5 {
            faults.push(format!("{name}: {ratio:.2}"));
        }
    }
    assert!(faults.is_empty(), "{faults:?}");
    // A volume too large for any host is refused with its size before memory is taken; the file is sparse.
    let path = home.path().join("huge_60000x60000x1000_u8.raw");
    File::create(&path).unwrap().set_len(60_000 * 60_000 * 1000).unwrap();
    let before = TAKEN.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    if Path::new("/proc/meminfo").exists() {
        let error = load(&VolumeSpec::new(path.to_string_lossy())).unwrap_err();
        assert!(error.why.contains("need 3352.8 GiB") && error.why.contains("are free"), "{error}");
        assert!(MOST.load(Ordering::Relaxed) - before < 1 << 24);
    }
}
