//! Voxelisation of strands: closed forms, brute force, conservation of area, any number of threads.

use super::strands;
use glam::DVec3;
use umbravox::files::loading::Loading;
use umbravox::strands::{Conservation, Kernel, StrandGrid, StrandSet, Strands, voxelise};

const BOTH: [Kernel; 2] = [Kernel::Box, Kernel::Tent];

fn grid(dims: [usize; 3]) -> StrandGrid {
    StrandGrid { dims, spacing_mm: 0.5, origin_mm: DVec3::new(1.0, 2.0, 3.0) }
}

/// World coordinates of index coordinates on [`grid`].
fn world(index: [f64; 3]) -> [f32; 3] {
    [1.0 + 0.5 * index[0], 2.0 + 0.5 * index[1], 3.0 + 0.5 * index[2]].map(|x| x as f32)
}

fn line(a: [f64; 3], b: [f64; 3]) -> Strands {
    strands(&[vec![world(a), world(b)]], 0.25, 0.5)
}

/// Extinction for each voxel of strand length inside: `(1 - 1/2) 1/4 mm * 0.5 mm / 0.125 mm^3`.
const PER_VOXEL: f64 = 0.5;

#[test]
fn a_segment_along_an_axis_has_known_values() {
    let shares: [(Kernel, [f64; 8]); 2] = [
        (Kernel::Box, [0.0, 0.3, 1.0, 1.0, 0.6, 0.0, 0.0, 0.0]),
        // Integrals of the tent around each centre from 1.2 to 4.1.
        (Kernel::Tent, [0.0, 0.32, 0.98, 1.0, 0.595, 0.005, 0.0, 0.0]),
    ];
    for (kernel, shares) in shares {
        for axis in 0..3 {
            let place = |x: f64| std::array::from_fn(|a| if a == axis { x } else { 3.0 });
            for [a, b] in [[1.2, 4.1], [4.1, 1.2]] {
                let values =
                    voxelise(&line(place(a), place(b)), &grid([8; 3]), kernel, &Loading::default()).unwrap();
                for (at, value) in values.iter().enumerate() {
                    let index = [at % 8, at / 8 % 8, at / 64];
                    let on_line = (0..3).all(|a| a == axis || index[a] == 3);
                    let share = if on_line { shares[index[axis]] } else { 0.0 };
                    let wanted = PER_VOXEL * share;
                    assert!(
                        (f64::from(*value) - wanted).abs() < 1e-6,
                        "{kernel:?} {index:?}: {value} {wanted}"
                    );
                }
            }
        }
    }
}

/// Share of a line that each voxel gets, computed from many points along it.
fn brute_force([a, b]: [[f64; 3]; 2], dims: [usize; 3], kernel: Kernel) -> Vec<f64> {
    const POINTS: usize = 400_000;
    let mut shares = vec![0.0; dims.iter().product()];
    for i in 0..POINTS {
        let t = (i as f64 + 0.5) / POINTS as f64;
        let p: [f64; 3] = std::array::from_fn(|x| a[x] + (b[x] - a[x]) * t);
        if (0..3).any(|x| p[x] < -0.5 || p[x] > dims[x] as f64 - 0.5) {
            continue;
        }
        let clamp = |axis: usize, c: f64| c.clamp(0.0, dims[axis] as f64 - 1.0) as usize;
        let mut add = |v: [usize; 3], share: f64| {
            shares[(v[2] * dims[1] + v[1]) * dims[0] + v[0]] += share / POINTS as f64;
        };
        match kernel {
            Kernel::Box => add(std::array::from_fn(|x| clamp(x, p[x].round())), 1.0),
            Kernel::Tent => {
                for corner in 0..8usize {
                    let side: [f64; 3] = std::array::from_fn(|x| (corner >> x & 1) as f64);
                    let weight: f64 = (0..3).map(|x| 1.0 - (p[x] - p[x].floor() - side[x]).abs()).product();
                    add(std::array::from_fn(|x| clamp(x, p[x].floor() + side[x])), weight);
                }
            }
        }
    }
    shares
}

#[test]
fn oblique_segments_agree_with_brute_force() {
    for dims in [[9, 7, 8], [1, 1, 1], [3, 1, 5]] {
        let last = dims.map(|n| n as f64 - 1.0);
        for [a, b] in [
            [[0.1, 0.2, 0.3], [0.9 * last[0], 0.7 * last[1], 0.8 * last[2]]],
            [[last[0], 0.0, last[2]], [0.0, last[1], 0.2]],
            // Segments through the faces of the grid, so that their ends are clipped.
            [[-3.0, 0.4, 0.3], [last[0] + 2.0, 0.3 * last[1], last[2] + 1.0]],
            [[0.3, -2.0, -0.5], [0.3, 4.0, 4.5]],
        ] {
            for kernel in BOTH {
                let values = voxelise(&line(a, b), &grid(dims), kernel, &Loading::default()).unwrap();
                let length: f64 = (0..3).map(|x| (b[x] - a[x]).powi(2)).sum::<f64>().sqrt();
                for (at, share) in brute_force([a, b], dims, kernel).into_iter().enumerate() {
                    let (got, wanted) = (f64::from(values[at]), PER_VOXEL * length * share);
                    assert!((got - wanted).abs() < 1e-4, "{dims:?} {kernel:?} voxel {at}: {got} {wanted}");
                }
            }
        }
    }
}

#[test]
fn slabs_join_without_a_seam() {
    // Wide planes, so that every slab is one plane.
    let dims = [700, 760, 9];
    let (a, b) = ([699.0, 3.0, -0.4], [650.0, 11.0, 8.3]);
    for kernel in BOTH {
        let values = voxelise(&line(a, b), &grid(dims), kernel, &Loading::default()).unwrap();
        let window = |k: usize| (640..700).flat_map(move |i| (0..14).map(move |j| (k * 760 + j) * 700 + i));
        let length: f64 = (0..3).map(|x| (b[x] - a[x]).powi(2)).sum::<f64>().sqrt();
        let shares = brute_force([a, b], dims, kernel);
        for k in 0..9 {
            let got: f64 = window(k).map(|at| f64::from(values[at])).sum();
            let wanted: f64 = window(k).map(|at| PER_VOXEL * length * shares[at]).sum();
            assert!((got - wanted).abs() < 2e-4 && wanted > 0.5, "{kernel:?} plane {k}: {got} {wanted}");
        }
    }
}

#[test]
fn every_area_is_conserved_also_along_faces_edges_and_corners() {
    let mut random = fastrand::Rng::with_seed(7);
    let grid = grid([12, 10, 14]);
    let mut lines = Vec::new();
    for _ in 0..3000 {
        // Halves and whole numbers are faces and centres; some lie outside.
        let mut place = |fine: bool| -> [f64; 3] {
            std::array::from_fn(|_| {
                let x = -3.0 + 20.0 * random.f64();
                if fine { x } else { (2.0 * x).round() / 2.0 }
            })
        };
        let (fine_a, fine_b) = (lines.len() % 3 == 0, lines.len() % 5 == 0);
        let a = place(fine_a);
        let mut b = place(fine_b);
        if lines.len() % 4 == 0 {
            b[lines.len() % 3] = a[lines.len() % 3];
        }
        if lines.len() % 7 == 0 {
            b = a;
        }
        lines.push(vec![world(a), world(b)]);
    }
    let some = strands(&lines, 0.01, 0.25);
    for kernel in BOTH {
        let values = voxelise(&some, &grid, kernel, &Loading::default()).unwrap();
        let c = Conservation::of(&some, &grid, &values, &Loading::default()).unwrap();
        assert!(c.relative_error < 1e-7, "{kernel:?}: {c:?}");
        assert!(c.area_inside_mm2 < 0.9 * c.area_mm2 && c.area_inside_mm2 > 0.1 * c.area_mm2);
    }
    // Each segment is compared with its length clipped by hand.
    for line in lines.iter().take(600) {
        let one = strands(std::slice::from_ref(line), 0.01, 0.25);
        let [a, b] = [0, 1].map(|i| DVec3::from_array(line[i].map(f64::from)));
        let (mut enter, mut exit) = (0.0f64, 1.0f64);
        let [low, high] = [-0.5, 0.0].map(|x| {
            let n = DVec3::new(12.0, 10.0, 14.0);
            grid.origin_mm + 0.5 * if x < 0.0 { DVec3::splat(-0.5) } else { n - 0.5 }
        });
        for axis in 0..3 {
            let d = b[axis] - a[axis];
            if d != 0.0 {
                let (s, t) = ((low[axis] - a[axis]) / d, (high[axis] - a[axis]) / d);
                enter = enter.max(s.min(t));
                exit = exit.min(s.max(t));
            } else if a[axis] < low[axis] || a[axis] > high[axis] {
                exit = -1.0;
            }
        }
        let wanted = 0.75 * 0.01 * a.distance(b) * (exit - enter).max(0.0);
        for kernel in BOTH {
            let sum: f64 = voxelise(&one, &grid, kernel, &Loading::default())
                .unwrap()
                .iter()
                .map(|&v| f64::from(v))
                .sum();
            let got = sum * grid.voxel_mm3();
            assert!((got - wanted).abs() < 1e-6 * wanted + 1e-12, "{kernel:?} {line:?}: {got} {wanted}");
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let strands = StrandSet::Clustered.build(20_000).unwrap();
    let grid = StrandGrid::around(strands.bounds_mm().unwrap(), 160).unwrap();
    for kernel in BOTH {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let values = voxelise(&strands, &grid, kernel, &Loading::default()).unwrap();
                let sums = Conservation::of(&strands, &grid, &values, &Loading::default()).unwrap();
                (values.into_iter().map(f32::to_bits).collect::<Vec<_>>(), sums)
            })
        };
        let one = with(1);
        assert!(with(2) == one && with(5) == one, "{kernel:?}");
    }
}

#[test]
fn thickness_and_transparency_scale_the_values() {
    let values = |thickness: f32, transparency: f32| {
        let one = strands(&[vec![world([1.0; 3]), world([4.0, 5.0, 3.0])]], thickness, transparency);
        voxelise(&one, &grid([8; 3]), Kernel::Tent, &Loading::default()).unwrap()
    };
    let (thin, thick, clear) = (values(0.5, 0.0), values(1.0, 0.0), values(1.0, 0.75));
    assert!(thin.iter().any(|v| *v > 0.1));
    for ((a, b), c) in thin.iter().zip(&thick).zip(&clear) {
        assert_eq!((2.0 * a, b), (*b, &(4.0 * c)));
    }
    assert!(values(1.0, 1.0).iter().all(|v| *v == 0.0));
}
