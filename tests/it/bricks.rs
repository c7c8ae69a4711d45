//! Bricks of a volume: their value ranges, classification and distances, against brute force.

use fastrand::Rng;
use glam::DAffine3;
use ndarray::Array3;
use umbravox::field::{ActiveBricks, extinction_intervals};
use umbravox::transfer::{Quantity, TransferFunction};
use umbravox::volume::{BRICK_CELLS, Bricks, Provenance, Scaling, Volume, Voxels};

fn volume(voxels: Voxels, scaling: Scaling) -> Volume {
    Volume::new(voxels, scaling, DAffine3::IDENTITY, Provenance::new("test", "test", "test")).unwrap()
}

/// Creates a random volume of any type, size and scaling.
fn random_volume(random: &mut Rng) -> Volume {
    let dims = [0; 3].map(|_| 1 + random.usize(..26));
    let shape = (dims[2], dims[1], dims[0]);
    let voxels = match random.u64(..5) {
        0 => Voxels::U8(Array3::from_shape_simple_fn(shape, || random.u8(..))),
        1 => Voxels::I16(Array3::from_shape_simple_fn(shape, || random.i16(..))),
        2 => Voxels::U16(Array3::from_shape_simple_fn(shape, || random.u16(..))),
        3 => Voxels::F32(Array3::from_shape_simple_fn(shape, || random.f64() as f32 - 0.5)),
        _ => Voxels::F64(Array3::from_shape_simple_fn(shape, || 1e6 * random.f64() - 3e5)),
    };
    let slope = [1.0, 2.2, -0.7][random.usize(..3)];
    volume(voxels, Scaling { slope, intercept: random.f64() * 100.0 })
}

#[test]
fn every_brick_holds_exactly_the_range_of_its_cells() {
    let mut random = Rng::with_seed(7);
    for _ in 0..60 {
        let volume = random_volume(&mut random);
        let n = volume.dims();
        let bricks = volume.bricks();
        assert_eq!(bricks.counts, n.map(|n| (n + 1).div_ceil(BRICK_CELLS)));
        assert_eq!(bricks.len(), bricks.counts.iter().product::<usize>());
        let mut min = vec![f64::INFINITY; bricks.len()];
        let mut max = vec![f64::NEG_INFINITY; bricks.len()];
        for cz in 0..=n[2] {
            for cy in 0..=n[1] {
                for cx in 0..=n[0] {
                    let [bx, by, bz] = [cx, cy, cz].map(|c| c / BRICK_CELLS);
                    let brick = (bz * bricks.counts[1] + by) * bricks.counts[0] + bx;
                    // Cell c interpolates voxels c - 1 and c, clamped.
                    for corner in 0..8 {
                        let at = |c: usize, axis: usize| {
                            (c + (corner >> axis & 1)).saturating_sub(1).min(n[axis] - 1)
                        };
                        let value = volume.value(at(cx, 0), at(cy, 1), at(cz, 2));
                        min[brick] = min[brick].min(value);
                        max[brick] = max[brick].max(value);
                    }
                }
            }
        }
        // No corner lies outside, and none of the ranges is wider than its cells'. (The last brick of an axis may
        // hold a clamped voxel of the brick before it, which one of its own cells interpolates too.)
        let expected: Vec<[f64; 2]> = min.into_iter().zip(max).map(|(min, max)| [min, max]).collect();
        assert_eq!(bricks.all_ranges(), expected, "{n:?}");
    }
}

fn transfer_function(points: &[(f64, f64)]) -> TransferFunction {
    TransferFunction::new(Quantity::Opacity, points)
}

fn random_transfer_function(random: &mut Rng) -> TransferFunction {
    let mut values: Vec<f64> = (0..1 + random.u64(..6)).map(|_| random.u64(..12) as f64).collect();
    values.sort_by(f64::total_cmp);
    // At most two points of one value.
    values.dedup_by_key(|v| *v as u64);
    let jump = values[random.usize(..values.len())];
    values.push(jump);
    values.sort_by(f64::total_cmp);
    let points: Vec<(f64, f64)> = values
        .into_iter()
        .map(|v| (v, if random.u64(..2) == 0 { 0.0 } else { 0.9 * random.f64() }))
        .collect();
    transfer_function(&points)
}

/// Whether a transfer function has extinction at a value, found by comparisons alone.
fn has_extinction(tf: &TransferFunction, value: f64) -> bool {
    let before = tf.points.iter().rev().find(|p| p.value <= value);
    let after = tf.points.iter().find(|p| p.value > value);
    match (before, after) {
        (Some(p), _) if p.value == value => p.amount > 0.0,
        (before, after) => before.into_iter().chain(after).any(|p| p.amount > 0.0),
    }
}

#[test]
fn classification_is_that_of_the_transfer_function() {
    let mut random = Rng::with_seed(11);
    let (mut seen_active, mut seen_empty) = (0, 0);
    for _ in 0..2000 {
        let tf = random_transfer_function(&mut random);
        let intervals = extinction_intervals(&tf);
        assert!(intervals.iter().all(|[lo, hi]| lo <= hi));
        assert!(intervals.windows(2).all(|w| w[0][1] < w[1][0]));
        // Ranges end on, just beside, and between the points.
        let end = |random: &mut Rng| {
            let v = random.u64(..14) as f64 - 1.0;
            match random.u64(..4) {
                0 => v.next_up(),
                1 => v.next_down(),
                2 => v + 0.5,
                _ => v,
            }
        };
        let ranges: Vec<[f64; 2]> = (0..64)
            .map(|_| [end(&mut random), end(&mut random)])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        let bricks = Bricks::from_ranges([4; 3], &ranges, DAffine3::IDENTITY).unwrap();
        let active = ActiveBricks::of(&bricks, &tf);
        for ([min, max], distance) in ranges.into_iter().zip(&active.distance) {
            let expected = tf.points.iter().any(|p| p.value >= min && p.value <= max && p.amount > 0.0)
                || has_extinction(&tf, min)
                || has_extinction(&tf, max);
            // Beside a point the function itself rounds, and may so round to 0 but never away from it.
            assert!(expected || tf.max_extinction(min, max) == 0.0);
            assert_eq!(*distance == 0, expected, "[{min}, {max}] of {:?}", tf.points);
            if expected { seen_active += 1 } else { seen_empty += 1 }
        }
        assert_eq!(active.active, active.distance.iter().filter(|d| **d == 0).count());
    }
    assert!(seen_active > 1000 && seen_empty > 1000, "{seen_active} {seen_empty}");
}

#[test]
fn intervals_of_ordinary_functions() {
    let inf = f64::INFINITY;
    let up = |v: f64| v.next_up();
    type Case<'a> = (&'a [(f64, f64)], &'a [[f64; 2]]);
    let cases: [Case; 6] = [
        (&[(5.0, 0.0)], &[]),
        (&[(5.0, 0.3)], &[[-inf, inf]]),
        (&[(100.0, 0.0), (200.0, 0.5)], &[[up(100.0), inf]]),
        (&[(5.0, 0.0), (5.0, 1.0)], &[[5.0, inf]]),
        (&[(5.0, 1.0), (5.0, 0.0)], &[[-inf, 5.0]]),
        (
            &[(1.0, 0.0), (2.0, 0.4), (3.0, 0.0), (4.0, 0.0), (5.0, 0.2), (6.0, 0.0)],
            &[[up(1.0), 3.0f64.next_down()], [up(4.0), 6.0f64.next_down()]],
        ),
    ];
    for (points, expected) in cases {
        assert_eq!(extinction_intervals(&transfer_function(points)), expected, "{points:?}");
    }
}

/// Creates bricks of which some are active: those get value 1.
fn seeded(counts: [usize; 3], is_active: impl FnMut(usize) -> bool) -> Bricks {
    let total = counts.iter().product();
    let ranges: Vec<_> = (0..total).map(is_active).map(|active| [f64::from(u8::from(active)); 2]).collect();
    Bricks::from_ranges(counts, &ranges, DAffine3::IDENTITY).unwrap()
}

#[test]
fn distances_are_chebyshev() {
    let mut random = Rng::with_seed(23);
    let tf = transfer_function(&[(0.5, 0.0), (0.5, 1.0)]);
    for density in [1, 3, 30, 300] {
        for _ in 0..25 {
            let counts = [0; 3].map(|_| 1 + random.usize(..17));
            let bricks = seeded(counts, |_| random.u64(..300) < density);
            let place =
                |at: usize| [at % counts[0], at / counts[0] % counts[1], at / (counts[0] * counts[1])];
            let seeds: Vec<[usize; 3]> =
                (0..bricks.len()).filter(|&at| bricks.range(at)[0] > 0.0).map(place).collect();
            let active = ActiveBricks::of(&bricks, &tf);
            for at in 0..bricks.len() {
                let here = place(at);
                let nearest = seeds
                    .iter()
                    .map(|seed| (0..3).map(|axis| here[axis].abs_diff(seed[axis])).max().unwrap())
                    .min()
                    .unwrap_or(255);
                assert_eq!(usize::from(active.distance[at]), nearest, "{counts:?} {here:?}");
            }
            assert_eq!(active.active, seeds.len());
            let bounds = (!seeds.is_empty()).then(|| {
                let fold = |f: fn(usize, usize) -> usize| {
                    [0, 1, 2].map(|axis| seeds.iter().map(|s| s[axis]).reduce(f).unwrap())
                };
                [fold(usize::min), fold(usize::max)]
            });
            assert_eq!(active.bounds, bounds);
        }
    }
}

#[test]
fn distances_stop_at_255() {
    let tf = transfer_function(&[(0.5, 0.0), (0.5, 1.0)]);
    for axis in 0..3 {
        let mut counts = [1; 3];
        counts[axis] = 400;
        let active = ActiveBricks::of(&seeded(counts, |at| at == 3), &tf);
        let expected: Vec<u8> = (0..400usize).map(|i| i.abs_diff(3).min(255) as u8).collect();
        assert_eq!(active.distance, expected, "axis {axis}");
    }
}

/// Camera framing and the device share the bricks of a volume: they are computed once, at the first use.
#[test]
fn bricks_are_computed_once_per_volume() {
    let volume = random_volume(&mut Rng::with_seed(3));
    assert!(std::ptr::eq(volume.bricks(), volume.bricks()));
}

#[test]
fn the_index_box_holds_everything_with_extinction() {
    let mut voxels = Array3::<u8>::zeros((40, 40, 40));
    voxels[[20, 8, 39]] = 9;
    let volume = volume(Voxels::U8(voxels), Scaling::IDENTITY);
    let bricks = volume.bricks();
    let active = ActiveBricks::of(bricks, &transfer_function(&[(0.0, 0.0), (9.0, 0.5)]));
    // The voxel's support is x [38, 39.5], y [7, 9], z [19, 21].
    let [low, high] = active.index_box(volume.dims()).unwrap();
    assert_eq!(low.to_array(), [35.0, 7.0, 19.0]);
    assert_eq!(high.to_array(), [39.5, 11.0, 23.0]);
    let empty = ActiveBricks::of(bricks, &transfer_function(&[(100.0, 0.0), (200.0, 1.0)]));
    assert_eq!((empty.active, empty.bounds, empty.index_box(volume.dims())), (0, None, None));
    assert!(empty.distance.iter().all(|&d| d == 255));
    let all = ActiveBricks::of(bricks, &transfer_function(&[(0.0, 0.5)]));
    assert_eq!(all.active, bricks.len());
    let [low, high] = all.index_box(volume.dims()).unwrap();
    assert_eq!((low.to_array(), high.to_array()), ([-0.5; 3], [39.5; 3]));
}
