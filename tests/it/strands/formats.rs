//! Strand files of other programs: compared with what those programs read from them, and invalid files that must be
//! refused.
//!
//! `tests/data/strands.py` made the files, by nibabel and VTK.

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use umbravox::files::loading::Loading;
use umbravox::open::{VolumeSpec, is_strand_source, load};
use umbravox::strands::{STRAND_EXTENSIONS, Strands, read_strands, strands_of_bytes, tubes, write_hair};

type Points = Vec<Vec<[f64; 3]>>;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/strands")
}

fn bytes_of(name: &str) -> Vec<u8> {
    fs::read(folder().join(name)).unwrap()
}

/// Points that other programs read from every strand file.
fn expected() -> BTreeMap<String, Points> {
    serde_json::from_slice(&bytes_of("points.json")).unwrap()
}

fn points_of(strands: &Strands) -> Points {
    let mut points = strands.arrays().points.iter().map(|p| p.map(f64::from));
    let counts = strands.segment_ranges().into_iter().map(|segments| segments.len() + 1);
    counts.map(|count| points.by_ref().take(count).collect()).collect()
}

#[test]
fn every_file_of_others_has_the_points_that_they_say() {
    let mut seen = Vec::new();
    for (name, wanted) in expected() {
        let strands = read_strands(&folder().join(&name), &Loading::default()).unwrap();
        let found = points_of(&strands);
        assert_eq!(
            found.iter().map(Vec::len).collect::<Vec<_>>(),
            wanted.iter().map(Vec::len).collect::<Vec<_>>()
        );
        let pairs = found.iter().flatten().flatten().zip(wanted.iter().flatten().flatten());
        // Other programs store the transform to the world in 32 bits.
        let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 4e-5, "{name}: {off} mm");
        assert!(!strands.has_thickness(), "{name}");
        seen.extend(name.rsplit('.').next().map(str::to_owned));
    }
    let each = STRAND_EXTENSIONS.iter().filter(|e| **e != "hair");
    assert!(each.clone().count() == 5 && each.into_iter().all(|e| seen.iter().any(|s| s == e)));
}

#[test]
fn both_byte_orders_say_the_same() {
    let [little, big] = ["little.tck", "big.tck"]
        .map(|name| read_strands(&folder().join(name), &Loading::default()).unwrap());
    assert_eq!(little.arrays(), big.arrays());
    // The header is the same except for the element type.
    let text = String::from_utf8_lossy(&bytes_of("little.tck")).into_owned();
    let end = text.find("END\n").unwrap() + 4;
    for (kind, big_endian) in [("Float64LE", false), ("Float64BE", true)] {
        let mut bytes = text[..end].replace("Float32LE", kind).into_bytes();
        for p in &little.arrays().points[..3] {
            let double = p.map(f64::from).map(|x| if big_endian { x.to_be_bytes() } else { x.to_le_bytes() });
            bytes.extend(double.concat());
        }
        let end = f64::INFINITY;
        bytes.extend([if big_endian { end.to_be_bytes() } else { end.to_le_bytes() }; 3].concat());
        let read = strands_of_bytes(&bytes, "a.tck").unwrap();
        assert_eq!(read.arrays().points, little.arrays().points[..3], "{kind}");
        assert!(read.warnings()[0].contains("counts 5 tracks, but 1"), "{:?}", read.warnings());
    }
}

#[test]
fn notable_contents_are_reported() {
    let warnings =
        |name: &str| read_strands(&folder().join(name), &Loading::default()).unwrap().warnings().to_vec();
    assert_eq!(warnings("little.tck"), ["1 lines of fewer than two points were skipped"]);
    assert_eq!(warnings("ras.trk"), Vec::<String>::new());
    assert!(warnings("version1.trk")[0].contains("no vox_to_ras"));
    assert!(warnings("places.trk")[0].contains("another order"));
    let mut more = bytes_of("ras.trk");
    more.extend([0; 8]);
    let strands = strands_of_bytes(&more, "a.trk").unwrap();
    assert_eq!(strands.warnings(), ["8 bytes behind the 4 tracks that its header counts were not read"]);
    // Warnings of strands are passed to the volume.
    let mut spec = VolumeSpec::new(folder().join("little.tck").to_string_lossy());
    spec.flags.strands.resolution = Some(8);
    let e = load(&spec).unwrap_err();
    assert!(e.why.contains("thickness") && e.hint.unwrap().contains("--thickness MM"));
    spec.flags.strands.thickness = Some(0.5);
    let volume = load(&spec).unwrap();
    assert!(volume.provenance.warnings[0].contains("skipped"), "{:?}", volume.provenance.warnings);
}

#[test]
fn content_decides_the_format_before_the_name() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["little.tck", "big.trk", "binary4.vtk", "default.vtp"] {
        for other in ["a.hair", "a.obj", "a.dat", "a"] {
            let path = dir.path().join(other);
            fs::write(&path, bytes_of(name)).unwrap();
            assert!(is_strand_source(path.to_str().unwrap()), "{name} as {other}");
            assert_eq!(
                points_of(&read_strands(&path, &Loading::default()).unwrap()).len(),
                4,
                "{name} as {other}"
            );
        }
    }
    // The content of an OBJ file does not identify it.
    assert!(strands_of_bytes(&bytes_of("lines.obj"), "a.OBJ").is_ok());
    assert!(strands_of_bytes(&bytes_of("lines.obj"), "a.dat").unwrap_err().hint.unwrap().contains(".tck"));
    // Other VTK data are not strands, whatever their file name.
    let image = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 1 1 1\n";
    let image_xml = "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\"></VTKFile>";
    for (text, name) in [(image, "b.vtk"), (image_xml, "b.vtp")] {
        let path = dir.path().join(name);
        fs::write(&path, text).unwrap();
        assert!(!is_strand_source(path.to_str().unwrap()), "{name}");
    }
    assert!(is_strand_source("gone.trk") && !is_strand_source("gone.nii") && !is_strand_source("/"));
}

#[test]
fn headers_of_slicer_turn_two_axes_about() {
    for (text, name) in [
        (
            "# vtk DataFile Version 3.0\nSPACE=LPS\nASCII\nDATASET POLYDATA\nPOINTS 2 float\n1 2 3 4 5 6\nLINES 1 3\n2 0 1\n",
            "a.vtk",
        ),
        ("# SPACE=LPS\nv 1 2 3\nv 4 5 6\nl 1 2\n", "a.obj"),
    ] {
        let turned = points_of(&strands_of_bytes(text.as_bytes(), name).unwrap());
        assert_eq!(turned, [[[-1.0, -2.0, 3.0], [-4.0, -5.0, 6.0]]], "{name}");
        let plain = points_of(&strands_of_bytes(text.replace("LPS", "RAS").as_bytes(), name).unwrap());
        assert_eq!(plain, [[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]], "{name}");
    }
}

#[test]
fn more_segments_than_hair_files_count_are_not_written() {
    let mut text = String::new();
    (0..70_000).for_each(|i| text += &format!("v {i} 0 0\n"));
    text += "l";
    (1..=70_000).for_each(|i| text += &format!(" {i}"));
    let strands = strands_of_bytes(text.as_bytes(), "a.obj").unwrap().with_thickness(1.0).unwrap();
    assert_eq!((strands.arrays().strands, strands.segment_count()), (1, 69_999));
    let dir = tempfile::tempdir().unwrap();
    let e = write_hair(&strands, &dir.path().join("a.hair")).unwrap_err();
    assert!(e.why.contains("69999 segments") && e.why.contains("65535"), "{e}");
    // As many segments as the format can count are written and read back.
    let short = text[..text.rfind(" 65537").unwrap()].to_owned();
    let strands = strands_of_bytes(short.as_bytes(), "a.obj").unwrap();
    write_hair(&strands, &dir.path().join("a.hair")).unwrap();
    assert_eq!(
        read_strands(&dir.path().join("a.hair"), &Loading::default()).unwrap().segment_count(),
        65_535
    );
}

/// Bytes of a strand file with some of them replaced.
fn patched(name: &str, at: usize, with: &[u8]) -> Vec<u8> {
    let mut bytes = bytes_of(name);
    bytes[at..at + with.len()].copy_from_slice(with);
    bytes
}

fn replaced(name: &str, from: &str, to: &str) -> Vec<u8> {
    let bytes = bytes_of(name);
    let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).expect("it is there");
    [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
}

fn refused(name: &str, bytes: &[u8], place: &str, why: &str) {
    let e = strands_of_bytes(bytes, name).unwrap_err();
    assert_eq!(e.exit_status(), 2);
    assert!(e.place.contains(place) && e.why.contains(why), "{name}, {place}, {why}: {e}");
    assert!(!e.to_string().contains('\n'), "{e}");
}

#[test]
fn tracks_that_are_wrong_are_refused_by_the_byte() {
    let cut = |name: &str, by: usize| bytes_of(name)[..bytes_of(name).len() - by].to_vec();
    let nan = f32::NAN.to_le_bytes();
    let first = String::from_utf8_lossy(&bytes_of("little.tck")).find("END\n").unwrap() + 4;
    for (bytes, place, why) in [
        (b"mrtrix tracks\n".to_vec(), "a.tck", "END"),
        (b"mrtrix tracksuit\nEND\n".to_vec(), "byte 0", "mrtrix tracks"),
        (replaced("little.tck", "Float32LE", "Int32LE"), "line 3", "Int32LE"),
        (replaced("little.tck", "datatype", "datatyp"), "a.tck", "datatype"),
        (replaced("little.tck", "file: . ", "file: o.dat "), "line", "points are in this file"),
        (replaced("little.tck", "file", "fill"), "a.tck", "no key `file`"),
        (replaced("little.tck", "file: . ", "file: . 9"), "line", "are said to begin at byte 9"),
        (replaced("little.tck", "file: . ", "file: . 99999999999999999999"), "line", "OFFSET"),
        (patched("little.tck", first + 4, &nan), &format!("byte {first}"), "not finite"),
        (patched("little.tck", first, &2e9f32.to_le_bytes()), &format!("byte {first}"), "beyond 1e9"),
        (cut("little.tck", 12), &format!("byte {}", bytes_of("little.tck").len() - 12), "end mark"),
        (cut("big.tck", 1), "byte", "end mark"),
    ] {
        refused("a.tck", &bytes, place, why);
    }
    let most = i32::MAX.to_le_bytes();
    for (bytes, place, why) in [
        (bytes_of("ras.trk")[..999].to_vec(), "byte 999", "header"),
        (patched("ras.trk", 996, &[0; 4]), "byte 996", "0 bytes, not 1000"),
        (patched("ras.trk", 992, &[9, 0, 0, 0]), "byte 992", "version 9"),
        (patched("ras.trk", 36, &[0xff; 2]), "byte 36", "-1 scalars"),
        (patched("ras.trk", 238, &[0xff; 2]), "byte 238", "-1 properties"),
        (patched("ras.trk", 988, &[0xff; 4]), "byte 988", "-1 tracks"),
        (patched("ras.trk", 12, &[0; 4]), "byte 12", "has no size"),
        (patched("ras.trk", 16, &nan), "byte 12", "has no size"),
        (patched("ras.trk", 948, b"LPQ"), "byte 948", "`LPQ`"),
        (patched("ras.trk", 948, b"LRS"), "byte 948", "`LRS`"),
        (patched("ras.trk", 440, &[0; 4]), "byte 948", "leaves the directions"),
        (patched("ras.trk", 440, &nan), "byte 948", "leaves the directions"),
        (patched("ras.trk", 452, &nan), "byte 948", "not finite"),
        // The header claims more than the file contains.
        (patched("ras.trk", 988, &most), &format!("byte {}", bytes_of("ras.trk").len()), "4 of 2147483647"),
        (patched("ras.trk", 1000, &most), "byte 1000", "2147483647 points takes 25769803768 bytes"),
        (patched("ras.trk", 1000, &[0xff; 4]), "byte 1000", "-1 points"),
        (patched("ras.trk", 36, &i16::MAX.to_le_bytes()), "byte 1000", "are left"),
        (patched("ras.trk", 238, &i16::MAX.to_le_bytes()), "byte 1000", "are left"),
        (patched("ras.trk", 1004, &nan), "byte 1004", "not finite"),
        (cut("ras.trk", 1), "byte", "are left"),
        (cut("uncounted.trk", 1), "byte", "are left"),
    ] {
        refused("a.trk", &bytes, place, why);
    }
    // A turned axis needs its number of voxels.
    refused("a.trk", &patched("version1.trk", 6, &[0; 2]), "byte 948", "0 voxels along one");
}

#[test]
fn polylines_that_are_wrong_are_refused() {
    for (from, to, place, why) in [
        ("# vtk", "# VTK", "byte 0", "does not begin"),
        ("ASCII", "ASKEW", "byte 38", "neither ASCII nor BINARY"),
        ("POINTS 26", "POINTS 27", "byte", "was expected"),
        ("POINTS 26", "POINTS 25", "byte", "is no part of polygonal data"),
        ("POINTS 26", "POINTS 99999999999999", "byte", "numbers take 599999999999993 bytes"),
        ("POINTS 26", "POINTS 18446744073709551615", "byte", "at the least"),
        ("POINTS 26", "POINTS many", "byte", "`many`"),
        ("float", "bit", "byte", "`bit`"),
        ("LINES 4 30", "LINES 5 30", "byte", "do not make 5 cells"),
        ("LINES 4 30", "LINES 4 29", "byte", "do not make 4 cells"),
        ("LINES 4 30", "LINES 4 4000000000", "byte", "are left"),
        ("LINES 4 30\n7", "LINES 4 30\n-7", "byte", "a cell of -7"),
        ("LINES 4 30\n7 0", "LINES 4 30\n7 -1", "byte", "point -1"),
        ("LINES 4 30\n7 0", "LINES 4 30\n7 26", "byte", "point 26, and there are 26"),
        ("LINES 4 30", "RINGS 4 30", "byte", "`RINGS`"),
        ("LINES 4 30", "POLYGONS 4 30", "a.vtk", "no polylines"),
    ] {
        refused("a.vtk", &replaced("text4.vtk", from, to), place, why);
    }
    for (name, from, to, why) in [
        ("text5.vtk", "OFFSETS", "OFFSET", "OFFSETS was expected"),
        ("binary5.vtk", "LINES 5 26", "LINES 5 2147483647", "are left"),
        ("binary5.vtk", "vtktypeint64", "vtktypeint63", "`vtktypeint63`"),
        ("binary4.vtk", "POINTS 26", "POINTS 4611686018427387904", "at the least"),
        ("binary4.vtk", "LINES 4 30", "LINES 4 1073741824", "are left"),
    ] {
        refused("a.vtk", &replaced(name, from, to), "byte", why);
    }
    for (text, place, why) in [
        ("v 1 2\n", "line 1", "three coordinates"),
        ("v 1 2 x\n", "line 1", "`x`"),
        ("v 1 2 nan\nv 1 2 3\nl 1 2\n", "line 3", "not finite"),
        ("v 0 0 0\nv 1 0 0\n\nl 1 \\\n 3\n", "line 4", "point 3 of 2"),
        ("v 0 0 0\nl -2 1\n", "line 2", "point -2 of 1"),
        ("v 0 0 0\nl 0 1\n", "line 2", "`0`"),
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", "a.obj", "no polylines"),
        ("", "a.obj", "no polylines"),
    ] {
        refused("a.obj", text.as_bytes(), place, why);
    }
    let mut wide =
        strands_of_bytes(b"v 0 0 0\nv 1 0 0 0.5 0.5 0.5\nl 1/1 2/2\nl 1\nl -1 -2", "a.obj").unwrap();
    wide = wide.with_thickness(1.0).unwrap();
    assert_eq!((wide.segment_count(), wide.warnings().len()), (2, 1));
}

#[test]
fn arrays_of_xml_that_are_wrong_are_refused() {
    for (name, from, to, why) in [
        ("text.vtp", "NumberOfPoints=\"26\"", "NumberOfPoints=\"27\"", "78 numbers, not 81"),
        ("text.vtp", "NumberOfLines=\"4\"", "NumberOfLines=\"99999999999\"", "4 numbers, not 99999999999"),
        ("text.vtp", "NumberOfLines=\"4\"", "NumberOfLines=\"-1\"", "`-1`"),
        ("text.vtp", "type=\"PolyData\"", "type=\"PolyDat\"", "no format"),
        ("text.vtp", "</Points>", "</Pints>", "XML"),
        ("text.vtp", "type=\"Float32\" Name=\"Points\"", "type=\"String\" Name=\"Points\"", "`String`"),
        ("inline_plain.vtp", "BigEndian", "LittleEndian", "array"),
        ("inline.vtp", "vtkZLibDataCompressor", "vtkLZ4DataCompressor", "zlib or none"),
        ("inline.vtp", "UInt64", "UInt32", "array"),
        ("raw.vtp", "UInt64", "UInt128", "UInt128"),
        ("default.vtp", "encoding=\"base64\"", "encoding=\"hex\"   ", "neither raw nor in base64"),
        ("raw_plain.vtp", "encoding=\"raw\"", "encoding=\"base64\"", "base64 is broken"),
    ] {
        refused("a.vtp", &replaced(name, from, to), "a.vtp", why);
    }
    let offset = |to: &str| {
        let text = String::from_utf8_lossy(&bytes_of("default.vtp")).into_owned();
        let at = text.find("Name=\"Points\"").unwrap();
        let from = at + text[at..].find("offset=\"").unwrap() + 8;
        let end = from + text[from..].find('"').unwrap();
        [&text[..from], to, &text[end..]].concat()
    };
    refused("a.vtp", offset("99999999").as_bytes(), "line", "beyond the file");
    refused("a.vtp", offset("-1").as_bytes(), "line", "`-1`");
    // Nested tags do not use more of the stack.
    let deep = format!("<VTKFile type=\"PolyData\">{}", "<a>".repeat(900_000));
    refused("a.vtp", deep.as_bytes(), "line 1", "XML");
    let deep = format!("{deep}{}</VTKFile>", "</a>".repeat(900_000));
    refused("a.vtp", deep.as_bytes(), "a.vtp", "no polylines");
    // A DTD could name entities that grow without end.
    let dtd = "<?xml version=\"1.0\"?><!DOCTYPE a [<!ENTITY b \"c\">]><VTKFile type=\"PolyData\"></VTKFile>";
    refused("a.vtp", dtd.as_bytes(), "line 1", "XML");
}

/// Creates a `.vtp` file of one compressed array that claims `blocks` blocks of `block` bytes.
fn compressed(blocks: u64, block: u64, packed: &[u8]) -> Vec<u8> {
    let mut data = Vec::new();
    let sizes = (0..blocks.min(1 << 16)).map(|i| if i == 0 { packed.len() as u64 } else { 0 });
    [blocks, block, 0].into_iter().chain(sizes).for_each(|n| data.extend(n.to_le_bytes()));
    data.extend(packed);
    let head = "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\" header_type=\"UInt64\" \
        compressor=\"vtkZLibDataCompressor\"><PolyData><Piece NumberOfPoints=\"2\" NumberOfLines=\"1\"><Points>\
        <DataArray type=\"UInt8\" format=\"appended\" offset=\"0\"/></Points></Piece></PolyData>\
        <AppendedData encoding=\"raw\">_";
    [head.as_bytes(), &data, b"</AppendedData></VTKFile>"].concat()
}

#[test]
fn impossible_unpacked_sizes_are_refused() {
    // A MiB of zeros, packed.
    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(&mut packer, &vec![0; 1 << 20]).unwrap();
    let packed = packer.finish().unwrap();
    for (blocks, block, why) in [
        (1, 1 << 20, "1048576 numbers, not 6"),
        (1, 1000, "unpacks to 1001 bytes or more"),
        (1, 1 << 21, "unpack to 2097152, which they cannot"),
        (1, 1 << 40, "134217728 numbers in all"),
        (u64::MAX, u64::MAX, "ends before"),
        (u64::MAX / 8, 1, "ends before"),
        (1 << 40, 1, "ends before"),
        (3, u64::MAX / 2, "134217728 numbers in all"),
    ] {
        refused("a.vtp", &compressed(blocks, block, &packed), "line", why);
    }
}

/// Damages a strand file by flips, cuts, doublings and huge counts: the reader returns a result and never panics.
fn attack(name: &str, seed: u64, rounds: usize) {
    let all = bytes_of(name);
    let mut random = fastrand::Rng::with_seed(seed);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..rounds {
        let mut bytes = all.clone();
        for _ in 0..random.usize(1..4) {
            let at = random.usize(..bytes.len());
            match random.u8(..6) {
                0 => bytes[at] ^= 1 << random.u8(..8),
                1 => bytes[at] = random.u8(..),
                2 => bytes.truncate(at.max(1)),
                3 => {
                    let end = random.usize(at..bytes.len());
                    let part = bytes[at..end].to_vec();
                    bytes.splice(at..at, part);
                }
                4 => {
                    let end = (at + 4).min(bytes.len());
                    let count = [i32::MAX, -1, 0, 1 << 24, i32::MIN][random.usize(..5)];
                    bytes.splice(
                        at..end,
                        if random.bool() { count.to_le_bytes() } else { count.to_be_bytes() },
                    );
                }
                // A digit of a text becomes many.
                _ => {
                    if let Some(digit) = bytes.iter().skip(at).position(u8::is_ascii_digit) {
                        bytes.splice(at + digit..at + digit, *b"99999999");
                    }
                }
            }
        }
        match strands_of_bytes(&bytes, name) {
            Ok(strands) => {
                read += 1;
                assert!(strands.arrays().points.iter().flatten().all(|x| x.is_finite()));
                // Strands that were read can be voxelised, or are refused.
                if read % 16 == 0 {
                    let _ = tubes(&strands.with_thickness(random.f64() * 10.0 + 1e-3).unwrap(), 20_000)
                        .map(|made| assert!(made.triangles.iter().flatten().all(|p| p.is_finite())));
                }
            }
            Err(e) => {
                refused += 1;
                assert!(e.exit_status() == 2 && !e.to_string().contains('\n'), "{name}: {e}");
            }
        }
    }
    println!("{name}: {read} read, {refused} refused");
    assert!(read > 0 && refused > rounds / 20, "{name}: {read} read, {refused} refused");
}

#[test]
fn any_damage_is_an_answer_and_no_panic() {
    for (seed, name) in expected().keys().enumerate() {
        attack(name, seed as u64, 2500);
    }
}

#[test]
fn every_cut_is_an_answer_and_no_panic() {
    for name in expected().keys() {
        let all = bytes_of(name);
        for length in 0..all.len() {
            let _ = strands_of_bytes(&all[..length], name);
        }
        // Every cut of a track file is detected, except where the header gives no count.
        if name.ends_with("ck") || (name.ends_with("trk") && name != "uncounted.trk") {
            assert!((0..all.len()).all(|n| strands_of_bytes(&all[..n], name).is_err()), "{name}");
        }
    }
}

#[test]
fn the_fixtures_are_all_there() {
    let names: Vec<String> =
        fs::read_dir(folder()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    let said: Value = serde_json::from_slice(&bytes_of("points.json")).unwrap();
    assert_eq!(names.len(), said.as_object().unwrap().len() + 1);
}
