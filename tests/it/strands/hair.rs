//! The `.hair` format of strands: every combination of arrays, and invalid files that must be refused at the right
//! byte.

use super::arrays;
use std::fs;
use std::path::PathBuf;
use umbravox::files::loading::Loading;
use umbravox::open::load_strands;
use umbravox::strands::{Attribute, Kernel, StrandVolume, Strands, read_strands, write_hair};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self) -> PathBuf {
        self.0.path().join("a.hair")
    }

    fn read(&self, bytes: &[u8]) -> umbravox::Result<Strands> {
        fs::write(self.path(), bytes).unwrap();
        read_strands(&self.path(), &Loading::default())
    }
}

/// Creates a `.hair` file by hand: two strands, of 2 and 1 segments, with the arrays of `flags`.
fn file(flags: u32) -> Vec<u8> {
    let mut bytes = b"HAIR".to_vec();
    for n in [2u32, if flags & 1 == 0 { 4 } else { 5 }, flags, 1] {
        bytes.extend(n.to_le_bytes());
    }
    for x in [0.25f32, 0.125, 0.9, 0.8, 0.7] {
        bytes.extend(x.to_le_bytes());
    }
    bytes.extend((0..88).map(|i| 255 - i as u8));
    let points = if flags & 1 == 0 { 4 } else { 5 };
    let floats = |bytes: &mut Vec<u8>, first: f32, count: usize, step: f32| {
        (0..count).for_each(|i| bytes.extend((first + i as f32 * step).to_le_bytes()));
    };
    if flags & 1 != 0 {
        bytes.extend([2, 0, 1, 0]);
    }
    if flags & 2 != 0 {
        floats(&mut bytes, -3.0, 3 * points, 0.5);
    }
    if flags & 4 != 0 {
        floats(&mut bytes, 0.0, points, 0.25);
    }
    if flags & 8 != 0 {
        floats(&mut bytes, 0.0, points, 0.2);
    }
    if flags & 16 != 0 {
        floats(&mut bytes, 0.0, 3 * points, 0.03);
    }
    bytes
}

fn patched(flags: u32, at: usize, with: &[u8]) -> Vec<u8> {
    let mut bytes = file(flags);
    bytes[at..at + with.len()].copy_from_slice(with);
    bytes
}

#[test]
fn every_combination_of_arrays_is_read_and_written_byte_by_byte() {
    let folder = Folder::new();
    for flags in (0..32).filter(|f| f & 2 != 0) {
        let bytes = file(flags);
        let strands = folder.read(&bytes).unwrap();
        let arrays = strands.arrays();
        assert_eq!((arrays.strands, arrays.segments.default), (2, 1));
        assert_eq!(arrays.segments.values, (flags & 1 != 0).then(|| vec![2, 1]));
        assert_eq!(arrays.points[0], [-3.0, -2.5, -2.0]);
        assert_eq!(arrays.points.len(), if flags & 1 == 0 { 4 } else { 5 });
        assert_eq!((arrays.thickness_mm.default, arrays.transparency.default), (0.25, 0.125));
        assert_eq!(arrays.thickness_mm.values.as_ref().map(|v| v[1]), (flags & 4 != 0).then_some(0.25));
        assert_eq!(arrays.transparency.values.as_ref().map(|v| v[1]), (flags & 8 != 0).then_some(0.2));
        assert_eq!(
            arrays.color.values.as_ref().map(|v| v[0]),
            (flags & 16 != 0).then_some([0.0, 0.03, 0.06])
        );
        assert_eq!(arrays.color.default, [0.9, 0.8, 0.7]);
        assert_eq!(arrays.info[..2], [255, 254]);
        assert_eq!(strands.segment_count(), if flags & 1 == 0 { 2 } else { 3 });
        let copy = folder.path().with_file_name("b.hair");
        write_hair(&strands, &copy).unwrap();
        assert_eq!(fs::read(&copy).unwrap(), bytes, "flags {flags}");
    }
}

#[test]
fn segments_do_not_join_strands() {
    let strands = Folder::new().read(&file(31)).unwrap();
    let ends = |i: usize| strands.segment(i).ends.map(|p| p.x);
    assert_eq!([ends(0), ends(1), ends(2)], [[-3.0, -1.5], [-1.5, 0.0], [1.5, 3.0]]);
    // Diameter and transparency are the means of the two ends.
    assert_eq!(strands.segment(2).diameter_mm, 0.5 * (0.75 + 1.0));
    assert!((strands.segment(2).transparency - 0.5 * (0.6 + 0.8)).abs() < 1e-7);
}

#[test]
fn wrong_files_are_refused_by_the_byte() {
    let folder = Folder::new();
    let nan = f32::NAN.to_le_bytes();
    let all = file(31);
    let mut longer = all.clone();
    longer.push(0);
    let tail = |flags: u32, drop: usize| file(flags)[..file(flags).len() - drop].to_vec();
    for (bytes, byte, why) in [
        (vec![], 0, "header"),
        (all[..127].to_vec(), 127, "header"),
        (patched(31, 0, b"hair"), 0, "HAIR"),
        (patched(31, 12, &63u32.to_le_bytes()), 12, "flags"),
        (patched(31, 15, &[0x80]), 12, "flags"),
        (file(29), 12, "no array of points"),
        // The counts disagree.
        (patched(2, 8, &5u32.to_le_bytes()), 8, "4 points, not 5"),
        (patched(2, 16, &2u32.to_le_bytes()), 8, "6 points, not 4"),
        (patched(2, 16, &u32::MAX.to_le_bytes()), 8, "points, not 4"),
        (patched(31, 128, &3u16.to_le_bytes()), 8, "6 points, not 5"),
        (patched(31, 128, &[0xff; 4]), 8, "131072 points, not 5"),
        // A header that claims more than there is must not be believed.
        (patched(31, 8, &u32::MAX.to_le_bytes()), all.len() as u64, "point array"),
        (patched(31, 4, &u32::MAX.to_le_bytes()), all.len() as u64, "segment array"),
        (all[..130].to_vec(), 130, "segment array is bytes 128 to 132"),
        (tail(2, 1), 175, "point array is bytes 128 to 176"),
        (tail(7, 4), 208, "thickness array is bytes 192 to 212"),
        (tail(31, 60), 232, "colour array is bytes 232 to 292"),
        (longer, 292, "1 bytes follow"),
        // Invalid numbers.
        (patched(31, 132 + 12 * 3 + 4, &nan), 132 + 36, "not finite"),
        (patched(31, 132, &f32::INFINITY.to_le_bytes()), 132, "not finite"),
        (patched(2, 128 + 24, &(-2e9f32).to_le_bytes()), 152, "beyond 1e9"),
        (patched(31, 192 + 8, &nan), 200, "NaN is not a thickness"),
        (patched(31, 192 + 16, &(-0.5f32).to_le_bytes()), 208, "-0.5 is not a thickness"),
        (patched(31, 212 + 4, &1.5f32.to_le_bytes()), 216, "1.5 is not a transparency"),
        (patched(31, 212, &nan), 212, "NaN is not a transparency"),
        (patched(31, 232 + 12, &nan), 244, "colour"),
        (patched(3, 20, &nan), 20, "NaN is not a thickness"),
        (patched(3, 20, &(-1f32).to_le_bytes()), 20, "-1.0 is not a thickness"),
        (patched(3, 24, &1.01f32.to_le_bytes()), 24, "1.01 is not a transparency"),
        (patched(3, 28, &nan), 28, "colour"),
    ] {
        let e = folder.read(&bytes).unwrap_err();
        assert_eq!(e.exit_status(), 2);
        assert!(e.place.ends_with(&format!("a.hair: byte {byte}")), "byte {byte}: {e}");
        assert!(e.why.contains(why), "{why}: {e}");
    }
    let unread =
        |name: &str| read_strands(&folder.path().with_file_name(name), &Loading::default()).unwrap_err().why;
    fs::create_dir(folder.path().with_file_name("folder.hair")).unwrap();
    assert!(unread("folder.hair").contains("not a regular file"));
    assert!(unread("gone.hair").contains("No such file"));
}

#[test]
fn defaults_that_nothing_uses_may_be_anything() {
    let folder = Folder::new();
    for (at, with) in
        [(16, [0xff; 4]), (20, f32::NAN.to_le_bytes()), (24, 7f32.to_le_bytes()), (28, [0xff; 4])]
    {
        let bytes = patched(31, at, &with);
        let strands = folder.read(&bytes).unwrap();
        let copy = folder.path().with_file_name("b.hair");
        write_hair(&strands, &copy).unwrap();
        assert_eq!(fs::read(&copy).unwrap(), bytes);
    }
}

#[test]
fn any_cut_and_any_changed_byte_is_an_answer_and_no_panic() {
    let folder = Folder::new();
    let mut random = fastrand::Rng::with_seed(7);
    let all = file(31);
    for length in 0..all.len() {
        assert!(folder.read(&all[..length]).is_err(), "{length} bytes");
    }
    for _ in 0..400 {
        let mut bytes = all.clone();
        for _ in 0..1 + (3.0 * random.f64()) as usize {
            let at = (random.f64() * bytes.len() as f64) as usize;
            bytes[at] = (256.0 * random.f64()) as u8;
        }
        if let Ok(strands) = folder.read(&bytes) {
            let StrandVolume { volume, .. } =
                StrandVolume::of(&strands, 16, Kernel::Box, &Loading::default()).unwrap();
            assert!(volume.value_range().iter().all(|v| v.is_finite() && *v >= 0.0));
        }
    }
}

#[test]
fn degenerate_strands_have_grids_too() {
    let volume = |arrays| {
        StrandVolume::of(&Strands::new("test", arrays).unwrap(), 20, Kernel::Box, &Loading::default())
    };
    let one_point = vec![vec![[5.0f32, 6.0, 7.0]]];
    let same_place = vec![vec![[5.0f32, 6.0, 7.0]; 4]];
    let in_a_plane = vec![vec![[0.0f32, 0.0, 3.0], [10.0, 0.0, 3.0], [10.0, 4.0, 3.0]]];
    for (lines, empty) in [(one_point, true), (same_place, true), (in_a_plane.clone(), false)] {
        for thickness in [0.0f32, 1e-3, 5.0, 1e6] {
            let made = volume(arrays(&lines, thickness, 0.0)).unwrap();
            let v = &made.volume;
            assert!(v.spacing_mm().iter().all(|s| s.is_finite() && *s > 0.0));
            assert!(v.corners_mm()[7].cmpgt(v.corners_mm()[0]).all(), "{thickness}");
            assert_eq!(v.value_range()[1] == 0.0, empty || thickness == 0.0);
            assert_eq!(v.provenance.warnings.len(), usize::from(empty || thickness == 0.0));
            assert!(made.conservation.relative_error <= 1e-6, "{:?}", made.conservation);
        }
    }
    let clear = volume(arrays(&in_a_plane, 1.0, 1.0)).unwrap();
    assert_eq!(clear.volume.value_range(), [0.0; 2]);
    let none = volume(arrays(&[], 1.0, 0.0)).unwrap_err();
    assert!(none.why.contains("no points") && none.exit_status() == 2);
    // A world at the edge of what is legal: 32-bit floats are 64 mm apart there.
    let far = vec![vec![[1e9f32, -1e9, 0.0], [1e9, -1e9, 64.0], [1e9, -1e9, 1000.0]]];
    assert!(volume(arrays(&far, 1.0, 0.0)).unwrap().conservation.relative_error <= 1e-6);
}

#[test]
fn a_file_without_thickness_needs_one() {
    let folder = Folder::new();
    fs::write(folder.path(), patched(3, 20, &[0; 4])).unwrap();
    let path = folder.path().display().to_string();
    let load = |thickness_mm| load_strands(&path, thickness_mm, &Loading::default());
    let e = load(None).unwrap_err();
    assert!(e.hint.unwrap().contains("--thickness"));
    assert_eq!(load(Some(0.5)).unwrap().segment(0).diameter_mm, 0.5);
    fs::write(folder.path(), file(7)).unwrap();
    assert_eq!(load(Some(0.5)).unwrap().arrays().thickness_mm, Attribute::constant(0.5));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 2e9] {
        assert!(load(Some(bad)).is_err());
    }
}
