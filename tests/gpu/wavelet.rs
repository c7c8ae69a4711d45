//! `wavelet` on slabs, whose curves are known, and against planes with the same curves.

use super::map_methods::{ABOVE, DEEP, even, on_light_rays, slabs};
use super::*;

/// Extinction of the slabs, 1/mm.
const PER_MM: f64 = 0.03;

/// Optical depth of slabs in front of a fraction of the volume's depth.
fn depth_of(slabs: &[[f64; 2]], share: f64) -> f64 {
    slabs.iter().map(|[a, b]| PER_MM * DEEP as f64 * (share.clamp(*a, *b) - a)).sum()
}

/// Curves of slabs: exact at the multiples of `2^-rank` of the range, and optical depth is linear between them. The
/// largest error is within `sigma L / 2^(rank + 2)`, and 0 where slabs begin and end at such depths.
#[test]
fn optical_depth_is_exact_at_dyadic_depths_and_linear_between_them() {
    // One slab, two slabs at eighths of the volume and quarters of their extent, and two at other depths.
    let volumes: [&'static [[f64; 2]]; 3] =
        [&[[0.25, 0.75]], &[[0.125, 0.25], [0.5, 0.625]], &[[0.125, 0.304_687_5], [0.453_125, 0.875]]];
    for matter in volumes {
        let Some(setup) = Setup::open(&slabs(matter), &even(PER_MM)) else { return };
        let extent = [matter[0][0], matter[matter.len() - 1][1]];
        for (range, rank, bits) in [
            ("map", 1, 32),
            ("map", 4, 32),
            ("map", 6, 16),
            ("texel", 1, 32),
            ("texel", 2, 32),
            ("texel", 2, 16),
            ("texel", 6, 32),
        ] {
            let rest =
                format!("rank={rank},bits={bits},range={range},filter=nearest,near=0,map=32,fit=volume");
            let map = setup.shadow(&format!("wavelet:{rest}"), ABOVE);
            let (origin, direction) = map.light_space.world_ray(glam::DVec2::splat(15.0));
            let deep = DEEP as f64;
            // Fraction of the volume's depth at a distance along the light ray.
            let share_at = |z: f64| (deep - 0.5 - origin.z - z * direction.z) / deep;
            let [start, end] = if range == "map" { map.light_space.z_range.map(share_at) } else { extent };
            let node = |n: f64| depth_of(matter, start + (end - start) * n / f64::from(1 << rank));
            let shares: Vec<f64> = (1..256).map(|i| f64::from(i) / 256.0).collect();
            let points: Vec<_> =
                shares.iter().map(|s| DVec3::new(7.5, 7.5, (1.0 - s) * deep - 0.5)).collect();
            let (mut off, mut error) = (0.0_f64, 0.0_f64);
            for (share, got) in shares.iter().zip(setup.query(&map, &points)) {
                let at = ((share - start) / (end - start)).clamp(0.0, 1.0) * f64::from(1 << rank);
                let (below, above) = (node(at.floor()), node(at.floor() + 1.0));
                let expected = (-(below + (above - below) * at.fract())).exp();
                off = off.max((f64::from(got) - expected).abs());
                let exact = depth_of(matter, *share);
                error = error.max((-f64::from(got).ln() - exact).abs());
            }
            let bound = PER_MM * (end - start) * deep / f64::from(4 << rank);
            println!("{matter:?}, {rest}: off {off:.6}, error {error:.5} of at most {bound:.5}");
            let rounding = if bits == 32 { 1e-4 } else { 4e-3 };
            assert!(off < rounding, "{matter:?}, {rest}: {off}");
            assert!(error < bound + 20.0 * rounding, "{matter:?}, {rest}: {error} {bound}");
            if range == "texel" && extent != [0.125, 0.875] {
                let is_dyadic = matter.len() == 1 || rank >= 2;
                assert!(if is_dyadic { error < 20.0 * rounding } else { error > 0.1 }, "{rest}: {error}");
            }
        }
    }
}

/// Wavelets have the curves of as many planes, evenly spaced over the map's range, also where filters average texels.
#[test]
fn wavelets_have_the_curves_of_planes() {
    let thorax = opacity(&[(-200.0, 0.0), (600.0, 0.1)]);
    let Some(setup) = Setup::open(&phantom("thorax:64"), &thorax) else { return };
    for (place, light) in lights(setup.volume()) {
        for filter in ["nearest", "bilinear", "gauss"] {
            let rest = format!("bits=32,filter={filter},near=0,map=48,fit=volume");
            let wavelets = setup.shadow(&format!("wavelet:rank=5,{rest}"), light);
            let planes = setup.shadow(&format!("osm:layers=32,slicing=uniform,average=depth,{rest}"), light);
            let points = on_light_rays(&setup, &wavelets);
            let both = setup.query(&wavelets, &points).into_iter().zip(setup.query(&planes, &points));
            let off = both.fold(0.0_f32, |most, (a, b)| most.max((a - b).abs()));
            println!("{place}, {filter}: {off:.6}");
            assert!(off < 1e-4, "{place}, {filter}: {off}");
        }
    }
}
