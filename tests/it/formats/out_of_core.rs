//! Volumes that are read in parts are those that are read whole, to the last bit.

use super::{Expected, folder, read};
use crate::program::{succeed, umbravox};
use glam::DVec3;
use std::path::Path;
use umbravox::exact::ExactField;
use umbravox::open::{ReadFlags, VolumeSpec, load};
use umbravox::scene::Scene;
use umbravox::transfer::{Quantity, TransferFunction};
use umbravox::volume::{ByteCount, Histogram, Volume, Voxels};

/// Flags that read any volume in parts, with a scratch folder for compressed files.
fn in_parts(flags: &ReadFlags, scratch: &Path) -> ReadFlags {
    let scratch = Some(scratch.to_string_lossy().into_owned());
    ReadFlags { host_memory: Some(ByteCount(1)), scratch, ..flags.clone() }
}

/// Returns all voxels of a volume that is read in parts, from slabs of single slices.
fn joined(volume: &Volume) -> Voxels {
    let parts = volume.out_of_core().expect("the volume is read in parts");
    parts.read(&volume.dims().map(|n| 0..n)).unwrap()
}

/// Formats that read all of their voxels do not take `--host-memory`.
#[test]
fn files_of_other_writers_are_the_same_in_parts() {
    let text = std::fs::read_to_string(folder().join("expected.json")).unwrap();
    let all: Vec<Expected> = serde_json::from_str(&text).unwrap();
    let scratch = tempfile::tempdir().unwrap();
    let mut compared = 0;
    for e in &all {
        let level = e.level.or(e.name.contains(".zarr").then_some(0));
        let flags = ReadFlags { frame: e.frame, series: e.series, level, ..ReadFlags::default() };
        let both = [flags.clone(), in_parts(&flags, scratch.path())].map(|flags| read(&e.name, flags));
        let [Ok(whole), Ok(parts)] = &both else { continue };
        // Text, lists of files and Fortran order are read whole.
        if parts.out_of_core().is_none() {
            continue;
        }
        assert_eq!(joined(parts), *whole.resident().unwrap(), "{}", e.name);
        assert_eq!(parts.stored_range(), whole.stored_range(), "{}", e.name);
        assert_eq!(parts.bricks(), whole.bricks(), "{}", e.name);
        assert_eq!(parts.provenance, whole.provenance, "{}", e.name);
        compared += 1;
    }
    assert!(compared > 15, "{compared}");
    assert_eq!(std::fs::read_dir(scratch.path()).unwrap().count(), 0, "decompressed copies remain");
}

fn converted(folder: &Path, name: &str) -> [Volume; 2] {
    succeed(folder, &["convert", "phantom:thorax:150", "-o", name]);
    let source = folder.join(name).to_string_lossy().into_owned();
    let flags = ReadFlags::default();
    [flags.clone(), in_parts(&flags, folder)]
        .map(|flags| load(&VolumeSpec { source: source.clone(), flags }).unwrap())
}

#[test]
fn all_that_is_computed_from_voxels_is_the_same_in_parts() {
    let home = tempfile::tempdir().unwrap();
    let tf = TransferFunction::new(Quantity::Extinction, &[(-200.0, 0.0), (300.0, 0.05), (900.0, 0.2)]);
    for name in ["a.raw", "a.nii.gz"] {
        let [whole, parts] = converted(home.path(), name);
        assert_eq!(parts.bricks(), whole.bricks());
        let [a, b] = [&whole, &parts].map(|volume| Histogram::of(volume, 64).unwrap());
        assert_eq!((a.range, &a.counts), (b.range, &b.counts));
        assert!(a.gradients.iter().zip(&b.gradients).all(|(a, b)| (a - b).abs() <= 1e-9 * a.abs()));
        let crop = |volume: &Volume| {
            volume.clone().cropped("5:100,,70:".parse().unwrap(), &Default::default()).unwrap()
        };
        assert_eq!(joined(&crop(&parts)), *crop(&whole).resident().unwrap());
        let reduced = |volume: &Volume| volume.downsampled([2, 3, 1], &Default::default()).unwrap();
        assert_eq!(reduced(&parts).resident(), reduced(&whole).resident());
        let fields = [&whole, &parts].map(|volume| ExactField::new(volume, &tf));
        let corners = whole.corners_mm();
        let between = |a: usize, share: f64| corners[a].lerp(corners[7 - a], share) + DVec3::splat(0.3);
        for i in 0..200 {
            let segment = (between(i % 8, 0.01), between((i + 3) % 8, 0.3 + 0.003 * i as f64));
            let [x, y] = fields.each_ref().map(|field| field.optical_depth(segment.0, segment.1));
            assert_eq!(x.to_bits(), y.to_bits(), "{segment:?}");
            let [x, y] = fields.each_ref().map(|field| field.gradient(segment.1));
            assert_eq!(x, y);
        }
        // Rays are computed in another order.
        let scene = Scene::framing(&whole);
        let [a, b] = fields.each_ref().map(|field| {
            let points = field.visible_points(&scene, 60, 3);
            let places: Vec<DVec3> = points.iter().map(|point| point.position).collect();
            let segments: Vec<_> = places.iter().map(|place| (*place, corners[5])).collect();
            (field.transmittances_from(&places, &scene.lights[0]), field.optical_depths(&segments), points)
        });
        assert!(a == b && a.2.len() > 10, "{a:?} {b:?}");
        parts.check_reads().unwrap();
    }
}

#[test]
fn what_cannot_be_read_later_is_an_error_and_no_zeros() {
    let home = tempfile::tempdir().unwrap();
    let [_, parts] = converted(home.path(), "a.raw");
    std::fs::File::options().write(true).open(home.path().join("a.raw")).unwrap().set_len(1000).unwrap();
    assert!(Histogram::of(&parts, 8).is_err());
    let tf = TransferFunction::new(Quantity::Extinction, &[(0.0, 0.1)]);
    ExactField::new(&parts, &tf);
    assert!(parts.check_reads().unwrap_err().why.contains("shorter"));
    // A compressed file needs a place for its voxels.
    umbravox(home.path(), &["convert", "phantom:slab:20", "-o", "b.nii.gz"]);
    let source = home.path().join("b.nii.gz").to_string_lossy().into_owned();
    let flags = ReadFlags { host_memory: Some(ByteCount(1)), ..ReadFlags::default() };
    let said = load(&VolumeSpec { source, flags }).unwrap_err();
    assert!(said.why.contains("--scratch"), "{said}");
}
