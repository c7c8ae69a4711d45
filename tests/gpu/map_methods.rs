//! `clusters`, `fourier`, `avsm`, `moments` and `beer` on media for which each is exact, and the claims of their papers.

use super::bound::along_light_rays;
use super::*;
use glam::DVec2;

/// Light at infinity on the z axis, for which all texels have the same curve.
pub(super) const ABOVE: Light = Light::Directional { toward: DVec3::Z };

/// Number of voxels of the layered volume along the light.
pub(super) const DEEP: usize = 128;
const WIDE: usize = 16;

/// Volume of layers: `value` gets the fraction of the depth from the light of [`ABOVE`] on.
fn layers_of(value: impl Fn(f64) -> f64) -> Arc<Volume> {
    let share = |k: usize| 1.0 - (k as f64 + 0.5) / DEEP as f64;
    let voxels = Array3::from_shape_fn((DEEP, WIDE, WIDE), |(k, _, _)| value(share(k)) as f32);
    Arc::new(volume_of(Voxels::F32(voxels), DAffine3::IDENTITY))
}

fn ray_err_max(setup: &Setup, method: &str) -> f64 {
    along_light_rays(setup, method, ABOVE).0.ray_err_max().unwrap()
}

/// Volume of slabs of one voxel or more: value 1000 inside the given fractions of the depth.
pub(super) fn slabs(volume_shares: &'static [[f64; 2]]) -> Arc<Volume> {
    layers_of(move |s| if volume_shares.iter().any(|[a, b]| (*a..*b).contains(&s)) { 1000.0 } else { 0.0 })
}

/// Transfer function with constant extinction, 1/mm, inside slabs and none outside.
pub(super) fn even(per_mm: f64) -> TransferFunction {
    extinction(&[(500.0, 0.0), (500.0, per_mm), (1000.0, per_mm)])
}

/// Points on light rays through the centres of texels, inside the volume.
pub(super) fn on_light_rays(setup: &Setup, map: &ShadowMap) -> Vec<DVec3> {
    let side = map.light_space.map_size;
    let [start, end] = map.light_space.z_range;
    let index_from_world = setup.volume().world_from_index().inverse();
    let dims = setup.volume().dims().map(|n| n as f64 - 1.0);
    let point = |i: u32| {
        let texel = DVec2::new(f64::from(i * 7 % side), f64::from(i * 11 % (side - 1)));
        let (origin, direction) = map.light_space.world_ray(texel);
        origin + (start + f64::from(i % 19 + 1) / 20.0 * (end - start)) * direction
    };
    let inside = |p: &DVec3| {
        let index = index_from_world.transform_point3(*p).to_array();
        index.iter().zip(dims).all(|(i, last)| (0.0..=last).contains(i))
    };
    (0..800).map(point).filter(inside).collect()
}

#[test]
fn fourier_is_exact_for_a_medium_of_its_own_terms() {
    let wave = |s: f64| {
        1.2 + 0.5 * (std::f64::consts::TAU * s).cos() - 0.6 * (2.0 * std::f64::consts::TAU * s).sin()
    };
    let Some(setup) = Setup::open(&layers_of(wave), &extinction(&[(0.0, 0.0), (3.0, 0.06)])) else { return };
    let error =
        |rest: &str| ray_err_max(&setup, &format!("fourier:{rest},filter=nearest,near=0,map=32,fit=volume"));
    let errors = [1, 2, 3, 7].map(|terms| error(&format!("terms={terms},bits=32")));
    println!("one and two waves, 1, 2, 3, 7 terms: {errors:.5?}");
    // Values are linear between voxels, and constant in the outermost halves of voxels.
    assert!(errors[0] > 0.03 && errors[1..].iter().all(|e| *e < 1e-3), "{errors:?}");
    let halves = error("terms=3,bits=16");
    assert!(halves < 4e-3, "{halves}");
    // Damping reduces the terms that the medium itself has.
    assert!(error("terms=2,bits=32,damping=lanczos") > 0.01);
}

/// Homogeneous slabs at different depths: a Fourier series over each texel's own range is exact, one over the map's
/// range rings.
#[test]
fn fourier_over_a_texels_own_range_is_exact_for_an_even_slab() {
    let voxels = Array3::from_shape_fn((DEEP, WIDE, WIDE), |(k, _, i)| {
        let slab = if i < WIDE / 2 { 10..50 } else { 70..120 };
        if slab.contains(&k) { 1000.0f32 } else { 0.0 }
    });
    let volume = Arc::new(volume_of(Voxels::F32(voxels), DAffine3::IDENTITY));
    let Some(setup) = Setup::open(&volume, &even(0.03)) else { return };
    for (terms, bits, most) in [(1, 32, 1e-3), (6, 32, 1e-3), (7, 32, 1e-3), (7, 16, 4e-3)] {
        let error = |range: &str| {
            let rest =
                format!("terms={terms},bits={bits},range={range},filter=nearest,near=0,map=32,fit=volume");
            ray_err_max(&setup, &format!("fourier:{rest}"))
        };
        let [map, texel] = ["map", "texel"].map(error);
        println!(
            "slabs, {terms} terms of {bits} bits: over the map's range {map:.4}, over texels' {texel:.4}"
        );
        assert!(texel < most && map > 0.02, "{terms} {bits}: {map} {texel}");
    }
}

/// The Fourier series rings before and behind a surface, as the paper and `stability` report.
#[test]
fn fourier_rings_around_a_surface() {
    // Faint matter at both ends, so that the map's range is the whole depth.
    let value = |s: f64| {
        if (0.45..0.55).contains(&s) {
            1000.0
        } else if (0.02..0.98).contains(&s) {
            0.0
        } else {
            100.0
        }
    };
    let wall = extinction(&[(0.0, 0.0), (100.0, 0.001), (1000.0, 0.2)]);
    let Some(setup) = Setup::open(&layers_of(value), &wall) else { return };
    let sanity = |terms: u32| {
        along_light_rays(&setup, &format!("fourier:terms={terms},bits=32,near=0,map=32,fit=volume"), ABOVE).1
    };
    let [few, many] = [3, 15].map(sanity);
    println!("a wall, 3 and 15 terms: {few:?} {many:?}");
    for found in [few, many] {
        assert!(found.out_of_range > 0 && found.monotone_violations > 0 && found.non_finite == 0);
    }
    assert!(many.largest_rise < few.largest_rise);
}

#[test]
fn clusters_are_exact_for_as_many_slabs() {
    let four: &[[f64; 2]] = &[[0.06, 0.2], [0.3, 0.44], [0.55, 0.7], [0.8, 0.95]];
    let Some(setup) = Setup::open(&slabs(four), &even(0.03)) else { return };
    let error =
        |rest: &str| ray_err_max(&setup, &format!("clusters:{rest},filter=nearest,near=0,map=32,fit=volume"));
    let errors = [1, 2, 4].map(|clusters| error(&format!("clusters={clusters},bits=32")));
    println!("four slabs, 1, 2, 4 clusters: {errors:.5?}");
    assert!(errors[2] < 1e-3 && errors[1] > 0.01 && errors[0] > 0.02, "{errors:?}");
    // Slabs that are not nearest to the initial, evenly spaced means separate after more marches.
    let two: &[[f64; 2]] = &[[0.05, 0.25], [0.45, 0.95]];
    let setup = Setup::open(&slabs(two), &even(0.03)).unwrap();
    let error = |iterations: u32| {
        let text = format!(
            "clusters:clusters=2,iterations={iterations},bits=32,filter=nearest,near=0,map=32,fit=volume"
        );
        ray_err_max(&setup, &text)
    };
    let errors = [1, 8].map(error);
    println!("two uneven slabs, 1 and 8 marches: {errors:.5?}");
    assert!(errors[0] > 0.01 && errors[1] < 1e-3, "{errors:?}");
}

#[test]
fn nodes_are_the_curve_while_they_suffice() {
    let three: &[[f64; 2]] = &[[0.2, 0.21], [0.5, 0.51], [0.8, 0.81]];
    let Some(setup) = Setup::open(&slabs(three), &even(0.25)) else { return };
    let error = |nodes: u32| {
        ray_err_max(&setup, &format!("avsm:nodes={nodes},bits=32,filter=nearest,near=0,map=32,fit=volume"))
    };
    let errors = [4, 6, 16, 32].map(error);
    println!("three sheets, 4, 6, 16, 32 nodes: {errors:.5?}");
    // Chords stray by 0.0023 and the compression by 0.0006 from each sheet's curve, which has no more than ten lines.
    assert!(errors[3] < 0.004 && errors[0] > 0.05 && errors[1] < errors[0], "{errors:?}");
}

#[test]
fn moments_are_exact_for_half_as_many_sheets() {
    let sheets: [&[[f64; 2]]; 3] = [
        &[[0.2, 0.208], [0.7, 0.708]],
        &[[0.2, 0.208], [0.5, 0.508], [0.8, 0.808]],
        &[[0.1, 0.108], [0.35, 0.358], [0.6, 0.608], [0.9, 0.908]],
    ];
    for (moments, shares) in [4, 6, 8].into_iter().zip(sheets) {
        let Some(setup) = Setup::open(&slabs(shares), &even(0.5)) else { return };
        let exact = setup.exact();
        for basis in ["power", "trigonometric", "power,measure=light", "trigonometric,measure=light"] {
            for (beta, bits) in [(0.0, 32), (0.25, 32), (1.0, 32), (0.0, 16), (0.25, 16), (1.0, 16)] {
                let method = format!(
                    "moments:moments={moments},basis={basis},beta={beta},bits={bits},near=0,map=32,fit=volume"
                );
                let map = setup.shadow(&method, ABOVE);
                // Half way between neighbouring sheets, before the first and behind the last.
                let mut edges = vec![[-0.1, 0.0]];
                edges.extend(shares);
                edges.push([1.0, 1.1]);
                let half_way = edges.windows(2).map(|w| 0.5 * (w[0][1] + w[1][0]));
                let points: Vec<_> =
                    half_way.map(|s| DVec3::new(7.5, 7.5, (1.0 - s) * DEEP as f64 - 0.5)).collect();
                for (point, got) in points.iter().zip(setup.query(&map, &points)) {
                    let truth = exact.transmittance_to_light(*point, &ABOVE);
                    assert!((f64::from(got) - truth).abs() < 0.02, "{method}: {got} {truth}");
                }
            }
        }
    }
}

/// Moments in 16 bits give nearly the results of floats, in half of the memory.
#[test]
fn moments_in_words_are_those_in_floats() {
    let thorax = opacity(&[(-200.0, 0.0), (600.0, 0.1)]);
    let Some(setup) = Setup::open(&phantom("thorax:64"), &thorax) else { return };
    for (place, light) in lights(setup.volume()) {
        for kind in [
            "moments=4",
            "moments=6",
            "moments=8",
            "moments=4,basis=trigonometric",
            "moments=8,basis=trigonometric",
            "moments=6,measure=light",
        ] {
            let build = |bits: u32, filter: &str| {
                setup.shadow(
                    &format!("moments:{kind},bits={bits},filter={filter},near=0,map=64,fit=volume"),
                    light,
                )
            };
            for filter in ["nearest", "bilinear"] {
                let (words, floats) = (build(16, filter), build(32, filter));
                assert!(3 * words.report.bytes < 2 * floats.report.bytes + 100_000, "{kind}");
                let points = on_light_rays(&setup, &floats);
                let pairs = setup.query(&words, &points).into_iter().zip(setup.query(&floats, &points));
                let square: f32 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
                let rms = (square / points.len() as f32).sqrt();
                println!("{place}, {kind}, {filter}: {rms:.5}");
                // On the unit circle, 8 floats are close to rounding errors: SwiftShader's sines are less exact than
                // others'.
                let most = if kind.contains("trigonometric") { 0.06 } else { 0.03 };
                assert!(rms < most, "{place}, {kind}, {filter}: {rms}");
            }
        }
    }
}

#[test]
fn beer_maps_are_exact_for_one_slab() {
    let Some(setup) = Setup::open(&slabs(&[[0.25, 0.75]]), &even(0.03)) else { return };
    for mean in ["extent", "matter"] {
        for (bits, most) in [(32, 1e-4), (16, 2e-3)] {
            let rest = format!("mean={mean},bits={bits},filter=nearest,near=0,map=32,fit=volume");
            let error = ray_err_max(&setup, &format!("beer:{rest}"));
            println!("a slab, mean={mean}, {bits} bits: {error:.6}");
            assert!(error < most, "mean={mean}, {bits} bits: {error}");
        }
    }
}

/// Two slabs with a gap, 16 and 32 mm of 96 mm: both means of extinction give the curve of their definition, and the
/// known error in front of the second slab.
#[test]
fn beer_maps_spread_two_slabs_over_the_gap() {
    let [begin, gap, second, end] = [0.125, 0.25, 0.625, 0.875];
    let Some(setup) = Setup::open(&slabs(&[[0.125, 0.25], [0.625, 0.875]]), &even(0.03)) else { return };
    let exact = setup.exact();
    let deep = DEEP as f64;
    let total = 0.03 * (gap - begin + end - second) * deep;
    for (mean, slope) in [("extent", total / (end - begin) / deep), ("matter", 0.03)] {
        let map =
            setup.shadow(&format!("beer:mean={mean},bits=32,filter=nearest,near=0,map=32,fit=volume"), ABOVE);
        let shares: Vec<f64> = (1..64).map(|i| f64::from(i) / 64.0).collect();
        let points: Vec<_> = shares.iter().map(|s| DVec3::new(7.5, 7.5, (1.0 - s) * deep - 0.5)).collect();
        let mut largest = 0.0_f64;
        for ((share, point), got) in shares.iter().zip(&points).zip(setup.query(&map, &points)) {
            let expected = (-total.min(slope * (share - begin).max(0.0) * deep)).exp();
            assert!((f64::from(got) - expected).abs() < 1e-4, "{mean}, {share}: {got} {expected}");
            largest = largest.max((f64::from(got) - exact.transmittance_to_light(*point, &ABOVE)).abs());
        }
        // The largest error is behind the first slab or in front of the second one.
        let error = |share: f64| {
            ((-total.min(slope * (share - begin) * deep)).exp() - (-0.03 * (gap - begin) * deep).exp()).abs()
        };
        let known = error(gap).max(error(second));
        println!("two slabs, mean={mean}: largest error {largest:.4}, known {known:.4}");
        assert!(known > 0.1 && (largest - known).abs() < 1e-4, "{mean}: {largest} {known}");
    }
}

/// An opaque slab in one cell: its stored part ends where the ray ends, with the right slope.
#[test]
fn opaque_slabs_keep_their_slope() {
    let Some(setup) = Setup::open(&slabs(&[[0.25, 0.75]]), &even(16.6)) else { return };
    for method in [
        "clusters:clusters=1,bits=32",
        "avsm:nodes=16,bits=32",
        "beer:bits=32",
        "wavelet:range=texel,bits=32",
    ] {
        let error = ray_err_max(&setup, &format!("{method},filter=nearest,near=0,map=32,fit=volume"));
        println!("an opaque slab, {method}: {error:.4}");
        assert!(error < 0.005, "{method}: {error}");
    }
}

/// Known bounds for uniformly spread matter: the weight of its middle is at most `1 / sum of (2 k + 1) P_k(0)^2`.
#[test]
fn moments_of_an_even_slab_are_those_of_the_paper() {
    let Some(setup) = Setup::open(&slabs(&[[0.0, 1.0]]), &even(0.01)) else { return };
    for (moments, most) in [(4, 1.0 / 2.25), (6, 1.0 / 2.25), (8, 1.0 / 3.515_625)] {
        for (beta, bits) in [(0.0, 32), (0.5, 32), (1.0, 32), (0.0, 16), (1.0, 16)] {
            let method =
                format!("moments:moments={moments},beta={beta},bits={bits},near=0,map=32,fit=volume");
            let map = setup.shadow(&method, ABOVE);
            let (origin, direction) = map.light_space.world_ray(DVec2::splat(16.0));
            let [start, end] = map.light_space.z_range;
            let got = setup.query(&map, &[origin + 0.5 * (start + end) * direction])[0];
            let share = 0.5 * (1.0 - most) + beta * most;
            let truth = (-0.01 * (end - start) * share).exp();
            assert!((f64::from(got) - truth).abs() < 2e-3, "{method}: {got} {truth}");
        }
    }
}

/// With `beta` at its two ends the moments bracket the exact transmittance at every depth.
#[test]
fn moments_bracket_the_truth() {
    for name in ["slab:32", "sphere:32", "comb:32", "thorax:64"] {
        let volume = phantom(name);
        let range = if name.starts_with("thorax") { [-900.0, 1200.0] } else { [0.0, 1000.0] };
        for (n, tf) in transfer_functions(range).iter().enumerate() {
            let Some(setup) = Setup::open(&volume, tf) else { return };
            let exact = setup.exact();
            for (place, light) in lights(&volume) {
                for kind in ["moments=4", "moments=6", "moments=8", "moments=6,measure=light"] {
                    let at = |beta: u32| {
                        let method =
                            format!("moments:{kind},beta={beta},filter=nearest,near=0,map=32,fit=volume");
                        setup.shadow(&method, light)
                    };
                    let (least, most) = (at(0), at(1));
                    let points = on_light_rays(&setup, &least);
                    let (light_most, light_least) =
                        (setup.query(&least, &points), setup.query(&most, &points));
                    for (point, (high, low)) in points.iter().zip(light_most.iter().zip(&light_least)) {
                        let truth = exact.transmittance_to_light(*point, &light);
                        let within = f64::from(*low) - 0.01 <= truth && truth <= f64::from(*high) + 0.01;
                        assert!(within, "{name}, function {n}, {place}, {kind}: {low} {truth} {high}");
                    }
                }
            }
        }
    }
}

/// Tile margins equal the neighbouring texels, inside the map and beyond the edge of an octahedral map.
#[test]
fn filters_cross_the_edges_of_tiles() {
    let Some(setup) = Setup::open(&phantom("thorax:64"), &opacity(&[(-200.0, 0.0), (600.0, 0.1)])) else {
        return;
    };
    for (place, light) in lights(setup.volume()) {
        let build =
            |rest: &str| setup.shadow(&format!("fourier:terms=3{rest},near=0,map=48,fit=volume"), light);
        let nearest = build(",bits=32,filter=nearest");
        let (program, hardware) = (build(",bits=32"), build(",bits=16"));
        let space = &nearest.light_space;
        let z = space.z_range[0] + 0.6 * (space.z_range[1] - space.z_range[0]);
        let depth = |map: &ShadowMap, texel: DVec2| {
            let (origin, direction) = space.world_ray(texel);
            -f64::from(setup.query(map, &[origin + z * direction])[0]).ln()
        };
        let mut pairs: Vec<_> =
            (0..48).map(|i| (DVec2::new(15.0, f64::from(i)), DVec2::new(16.0, f64::from(i)))).collect();
        pairs.extend((0..48).map(|i| (DVec2::new(f64::from(i), 31.0), DVec2::new(f64::from(i), 32.0))));
        let mut largest = 0.0_f64;
        let mut check = |half_way: DVec2, [a, b]: [DVec2; 2]| {
            let expected = 0.5 * (depth(&nearest, a) + depth(&nearest, b));
            largest = largest.max((depth(&nearest, a) - depth(&nearest, b)).abs());
            for (map, tolerance) in [(&program, 2e-4), (&hardware, 0.02)] {
                let got = depth(map, half_way);
                assert!((got - expected).abs() < tolerance, "{place}, {half_way}: {got} {expected}");
            }
        };
        for (a, b) in pairs {
            check(0.5 * (a + b), [a, b]);
        }
        let corner = |map: &ShadowMap| {
            let around =
                [[15.0, 15.0], [16.0, 15.0], [15.0, 16.0], [16.0, 16.0]].map(|c| depth(map, c.into()));
            0.25 * around.iter().sum::<f64>()
        };
        let got = depth(&program, DVec2::splat(15.5));
        assert!((got - corner(&nearest)).abs() < 2e-4, "{place}, where four tiles meet: {got}");
        for method in [
            "clusters:clusters=4,bits=32",
            "avsm:nodes=8,bits=32",
            "beer:bits=32",
            "wavelet:range=texel,bits=32",
        ] {
            let build = |filter: &str| {
                setup.shadow(&format!("{method},near=0,map=41,fit=volume,filter={filter}"), light)
            };
            let (nearest, bilinear) = (build("nearest"), build("bilinear"));
            for row in 0..41 {
                let visible = |map: &ShadowMap, column: f64| {
                    let (origin, direction) =
                        nearest.light_space.world_ray(DVec2::new(column, f64::from(row)));
                    f64::from(setup.query(map, &[origin + z * direction])[0])
                };
                let expected = 0.5 * (visible(&nearest, 31.0) + visible(&nearest, 32.0));
                let got = visible(&bilinear, 31.5);
                assert!((got - expected).abs() < 2e-4, "{place}, {method}, row {row}: {got} {expected}");
            }
        }
        if place == "point inside" {
            for i in 1..47 {
                let along = f64::from(i);
                check(DVec2::new(-0.5, along), [DVec2::new(0.0, along), DVec2::new(0.0, 47.0 - along)]);
                check(DVec2::new(along, 47.5), [DVec2::new(along, 47.0), DVec2::new(47.0 - along, 47.0)]);
            }
        }
        assert!(largest > 0.1, "{place}: {largest}");
    }
}

/// Properties of all these maps: transmittance 1 in front of matter, the full depth behind it, and smaller errors
/// with more numbers.
#[test]
fn error_falls_with_stored_numbers() {
    let thorax = opacity(&[(-200.0, 0.0), (600.0, 0.1)]);
    let Some(setup) = Setup::open(&phantom("thorax:64"), &thorax) else { return };
    let exact = setup.exact();
    let steps: [(&str, [u32; 3]); 5] = [
        ("clusters:clusters=", [1, 4, 16]),
        ("fourier:terms=", [3, 11, 31]),
        ("wavelet:rank=", [1, 3, 6]),
        ("avsm:nodes=", [4, 8, 24]),
        ("moments:moments=", [4, 6, 8]),
    ];
    for (method, numbers) in steps {
        for (place, light) in lights(setup.volume()) {
            for march in ["cells", "samples"] {
                let error = |n: u32| {
                    let text = format!("{method}{n},march={march},near=0,map=64,fit=volume");
                    let map = setup.shadow(&text, light);
                    let points = on_light_rays(&setup, &map);
                    let squares = points.iter().zip(setup.query(&map, &points)).map(|(point, got)| {
                        (f64::from(got) - exact.transmittance_to_light(*point, &light)).powi(2)
                    });
                    (squares.sum::<f64>() / points.len() as f64).sqrt()
                };
                let errors = numbers.map(error);
                println!("{method}{numbers:?}, {place}, {march}: {errors:.4?}");
                assert!(
                    errors.windows(2).all(|w| w[1] < 1.02 * w[0]),
                    "{method} {place} {march}: {errors:?}"
                );
            }
        }
    }
}
