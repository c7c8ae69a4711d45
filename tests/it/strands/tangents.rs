//! Strand directions on the grid: closed forms, the extinction as their trace, any number of threads.

use super::strands;
use glam::DVec3;
use std::sync::Arc;
use umbravox::files::loading::Loading;
use umbravox::strands::{Kernel, StrandGrid, StrandSet, Strands, VoxelisedStrands, tangents, voxelise};

const BOTH: [Kernel; 2] = [Kernel::Box, Kernel::Tent];

/// Elements `xx, yy, zz, xy, xz, yz` of `u u^T`.
fn product(u: DVec3) -> [f64; 6] {
    [u.x * u.x, u.y * u.y, u.z * u.z, u.x * u.y, u.x * u.z, u.y * u.z]
}

fn extinction_of(moments: &[f32; 6]) -> f64 {
    moments[..3].iter().map(|m| f64::from(*m)).sum()
}

#[test]
fn one_straight_strand_has_one_direction() {
    let grid = StrandGrid { dims: [12, 11, 10], spacing_mm: 0.5, origin_mm: DVec3::new(1.0, 2.0, 3.0) };
    // Segments that are exact in 32-bit floats, and whose parts have the same direction.
    for (from, along) in [
        (DVec3::new(1.5, 2.25, 3.5), DVec3::new(4.0, 3.0, 2.0)),
        (DVec3::new(6.0, 6.5, 3.25), DVec3::new(-4.0, -3.5, 4.0)),
        (DVec3::new(3.0, 4.0, 3.5), DVec3::new(0.0, 0.0, 4.0)),
    ] {
        let point = |t: f64| (from + t * along).to_array().map(|x| x as f32);
        let line = strands(&[vec![point(0.0), point(0.25), point(1.0)]], 0.125, 0.25);
        let wanted = product(along.normalize());
        for kernel in BOTH {
            let (moments, values) = (
                tangents(&line, &grid, kernel).unwrap(),
                voxelise(&line, &grid, kernel, &Loading::default()).unwrap(),
            );
            assert!(values.iter().filter(|v| **v > 0.01).count() > 5);
            for (at, (moments, value)) in moments.values().iter().zip(&values).enumerate() {
                for (got, share) in moments.iter().zip(wanted) {
                    let wanted = share * f64::from(*value);
                    let off = (f64::from(*got) - wanted).abs();
                    assert!(off <= 1.5e-7 * wanted.abs(), "{kernel:?}, voxel {at}: {got}, not {wanted}");
                }
            }
        }
    }
}

#[test]
fn the_trace_is_the_extinction() {
    let curly = StrandSet::Curly.build(30_000).unwrap();
    let grid = StrandGrid::around(curly.bounds_mm().unwrap(), 48).unwrap();
    for kernel in BOTH {
        let (moments, values) = (
            tangents(&curly, &grid, kernel).unwrap(),
            voxelise(&curly, &grid, kernel, &Loading::default()).unwrap(),
        );
        assert_eq!(moments.dims(), grid.dims);
        let mut mixed = 0;
        for (moments, value) in moments.values().iter().zip(&values) {
            let value = f64::from(*value);
            assert!(
                (extinction_of(moments) - value).abs() <= 1e-6 * value,
                "{kernel:?}: {moments:?}, {value}"
            );
            mixed += usize::from(value > 0.0 && moments[..3].iter().all(|m| f64::from(*m) < 0.6 * value));
        }
        assert!(mixed > 1000, "curls run every way: {mixed}");
    }
}

/// A reversed strand has the same direction moments, and does not cancel the other.
#[test]
fn strands_have_no_sign() {
    let grid = StrandGrid { dims: [8; 3], spacing_mm: 1.0, origin_mm: DVec3::ZERO };
    let [a, b] = [[1.25, 2.0, 3.5], [6.0, 4.5, 3.0]];
    let [there, back]: [Strands; 2] = [[a, b], [b, a]].map(|line| strands(&[line.to_vec()], 0.5, 0.0));
    let both = strands(&[vec![a, b], vec![b, a]], 0.5, 0.0);
    for kernel in BOTH {
        let [there, back, both] = [&there, &back, &both].map(|s| tangents(s, &grid, kernel).unwrap());
        for ((a, b), sum) in there.values().iter().zip(back.values()).zip(both.values()) {
            for ((a, b), sum) in a.iter().zip(b).zip(sum) {
                assert!((a - b).abs() < 1e-6 && (a + b - sum).abs() < 1e-6, "{a}, {b}, {sum}");
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let strands = StrandSet::Clustered.build(20_000).unwrap();
    // The grid is larger than one slab of voxels.
    let grid = StrandGrid::around(strands.bounds_mm().unwrap(), 160).unwrap();
    for kernel in BOTH {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let moments = pool.install(|| tangents(&strands, &grid, kernel).unwrap());
            moments.values().iter().map(|m| m.map(f32::to_bits)).collect::<Vec<_>>()
        };
        let one = with(1);
        assert!(with(2) == one && with(5) == one, "{kernel:?}");
    }
}

#[test]
fn directions_are_made_once_for_all_who_hold_them() {
    let strands = StrandSet::Fur.build(500).unwrap();
    let grid = StrandGrid::around(strands.bounds_mm().unwrap(), 16).unwrap();
    let expected = tangents(&strands, &grid, Kernel::Tent).unwrap();
    let of = VoxelisedStrands::new(strands, grid, Kernel::Tent);
    let [first, second] = [of.directions().unwrap(), of.directions().unwrap()];
    assert!(Arc::ptr_eq(&first, &second) && *first == expected);
    let held = Arc::downgrade(&first);
    drop((first, second));
    assert!(held.upgrade().is_none(), "nobody holds them any more");
    assert_eq!(*of.directions().unwrap(), expected);
}
