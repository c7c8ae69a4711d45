//! Conditions that make shadow methods comparable: exact planes of a split, saturation, averaging by filters,
//! reference rays of a kernel, a query for each sample.

use super::bound::along_light_rays;
use super::*;
use glam::DVec2;

/// Light at infinity on the z axis.
const ABOVE: Light = Light::Directional { toward: DVec3::Z };

/// In `dom` and `bom` optical depth is exact at the planes of the split, and nowhere else in uneven matter.
#[test]
fn planes_lie_where_the_split_says_in_dom_and_in_bom() {
    let Some(setup) = Setup::open(&phantom("comb:48"), &extinction(&[(0.0, 0.0), (1000.0, 0.06)])) else {
        return;
    };
    let light = Light::Directional { toward: DVec3::new(0.1, 0.05, 1.0) };
    let field = setup.exact();
    let layers = 5;
    let share = |split: &str, k: u32| {
        let x = f64::from(k) / f64::from(layers);
        match split {
            "linear" => x,
            "growing" => f64::from(k * (k + 1)) / f64::from(layers * (layers + 1)),
            _ => (256.0_f64.powf(x) - 1.0) / 255.0,
        }
    };
    for split in ["linear", "growing", "log"] {
        for method in ["dom", "bom"] {
            let rest = "near=0,map=64,bits=32,depth_bits=32,filter=nearest";
            let spec = format!("{method}:layers={layers},split={split},{rest}");
            let spec = if method == "dom" { format!("{spec},spread=1") } else { spec };
            let map = setup.shadow(&spec, light);
            let (at_planes, between) =
                errors_at_planes(&setup, &field, &map, method, |k| share(split, k), layers);
            println!("{method}, {split}: {at_planes:.5} at planes, {between:.5} between");
            assert!(at_planes < 0.003 && between > 4.0 * at_planes, "{spec}: {at_planes} {between}");
        }
    }
}

/// Largest errors of optical depth at the inner planes of texels near the map's middle, and half way between planes.
/// `dom` spans the map's range from the first matter on, `bom` ends where matter ends.
fn errors_at_planes(
    setup: &Setup,
    field: &ExactField<'_>,
    map: &ShadowMap,
    method: &str,
    share: impl Fn(u32) -> f64,
    layers: u32,
) -> (f64, f64) {
    let (mut at_planes, mut between) = (0.0_f64, 0.0_f64);
    for i in 0..9 {
        let texel = DVec2::new(f64::from(26 + 3 * (i % 3)), f64::from(27 + 3 * (i / 3)));
        let (origin, direction) = map.light_space.world_ray(texel);
        let start = map.light_space.ray_start();
        let curve = field.curve_along(origin + start * direction, direction, f64::INFINITY);
        let jumps = curve.jumps();
        let total = curve.total();
        assert!(total > 0.3, "{total}");
        // For a ramp, matter begins at the first depth with optical depth.
        let begins = |z: f64| -curve.transmittance_at(z).ln();
        let first = bisect([0.0, 1e6], |z| begins(z) > 1e-12).max(jumps.first().copied().unwrap_or(0.0));
        let last = bisect([0.0, 1e6], |z| begins(z) > total - 1e-12);
        let [near, far] = map.light_space.z_range;
        let extent = if method == "dom" { far - near } else { last - first };
        let plane = |k: u32| first + extent * share(k);
        let off = |z: f64| {
            let point = origin + (start + z) * direction;
            (-f64::from(setup.query(map, &[point])[0]).ln() - begins(z)).abs()
        };
        for k in 1..layers {
            at_planes = at_planes.max(off(plane(k)));
            between = between.max(off(0.5 * (plane(k) + plane(k + 1))));
        }
    }
    (at_planes, between)
}

/// Smallest depth from which on a condition holds.
fn bisect([mut low, mut high]: [f64; 2], holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if holds(middle) { high = middle } else { low = middle }
    }
    high
}

/// Stored optical depth saturates: the densest matter leaves 2^-11 of the light, or 2^-8 with 8 bits, which never rises
/// behind it.
#[test]
fn stored_optical_depth_saturates() {
    for per_mm in [1e3, 1e6] {
        let tf = extinction(&[(0.0, 0.0), (1000.0, per_mm)]);
        let Some(setup) = Setup::open(&phantom("sphere:32"), &tf) else { return };
        for (place, light) in lights(setup.volume()) {
            for method in ["osm:layers=9", "osm:layers=9,kernel=3", "dom:layers=5", "bom:layers=5"] {
                for bits in [8, 16, 32] {
                    let method = format!("{method},near=0,map=64,bits={bits}");
                    let sane = along_light_rays(&setup, &method, light).1;
                    let bad = sane.monotone_violations + sane.non_finite + sane.out_of_range;
                    assert_eq!(bad, 0, "{per_mm}, {place}, {method}: {sane:?}");
                }
            }
        }
        let behind = DVec3::new(0.2, 0.1, -15.0);
        for method in ["osm:layers=9", "dom:layers=5", "bom:layers=5"] {
            for (bits, left) in [(8, 1.0 / 250.0), (16, 1.0 / 2040.0)] {
                let map = setup.shadow(&format!("{method},near=0,map=64,bits={bits}"), ABOVE);
                let t = setup.query(&map, &[behind])[0];
                assert!(t < left, "{method}, {bits} bits: {t}");
            }
        }
    }
}

/// Half way between a lit texel and a dark one, the mean of optical depths is dark and that of transmittances half
/// lit.
#[test]
fn filters_average_transmittance_or_depth() {
    let value = |(_, _, i)| if i < 16 { 0.0 } else { 1000.0 };
    let volume = volume_of(Voxels::F32(Array3::from_shape_fn((8, 32, 32), value)), DAffine3::IDENTITY);
    let tf = extinction(&[(500.0, 0.0), (500.0, 2.0)]);
    let Some(setup) = Setup::open(&Arc::new(volume), &tf) else { return };
    for method in ["osm:layers=8", "dom:layers=8", "bom:layers=8", "osm:layers=8,kernel=3"] {
        let built = |rest: &str| setup.shadow(&format!("{method},near=0,map=48,bits=32{rest}"), ABOVE);
        // Along rows and along columns, one of which crosses the edge.
        let values = |map: &ShadowMap, at: f64| -> Vec<f64> {
            let z = map.light_space.z_range[1] - 0.5;
            let point = |i: i32| {
                let along = f64::from(i % 46) + at;
                let texel = if i < 46 { DVec2::new(along, 24.0) } else { DVec2::new(24.0, along) };
                let (origin, direction) = map.light_space.world_ray(texel);
                origin + z * direction
            };
            let points: Vec<_> = (0..92).map(point).collect();
            setup.query(map, &points).into_iter().map(f64::from).collect()
        };
        let nearest = values(&built(",filter=nearest,average=transmittance"), 0.0);
        let light = values(&built(",average=transmittance"), 0.5);
        for (pair, got) in nearest
            .chunks(46)
            .flat_map(|line| line.windows(2))
            .zip(light.chunks(46).flat_map(|line| &line[..45]))
        {
            assert!((got - 0.5 * (pair[0] + pair[1])).abs() < 1e-3, "{method}: {pair:?} {got}");
        }
        let depth = values(&built(",average=depth"), 0.5);
        let widest = light.iter().zip(&depth).map(|(l, d)| l - d).fold(0.0, f64::max);
        assert!(widest > 0.1, "{method}: means of optical depth widen an opaque edge, by {widest}");
        assert!(light.iter().zip(&depth).all(|(l, d)| l + 1e-4 > *d), "{method}: never narrower");
    }
}

/// A map with a kernel is compared with the mean of the rays that it averages, as pre-filtered maps are.
#[test]
fn a_kernel_is_judged_by_the_texels_that_it_averages() {
    let Some(setup) = Setup::open(&phantom("thorax:48"), &opacity(&[(-200.0, 0.0), (600.0, 0.1)])) else {
        return;
    };
    let light = lights(setup.volume())[0].1;
    let error = |rest: &str| {
        let method = format!("osm:layers=512,near=0,map=48,bits=32{rest}");
        along_light_rays(&setup, &method, light).0.ray_err_max().unwrap()
    };
    let (plain, kernel) = (error(""), error(",kernel=3,average=transmittance"));
    println!("512 planes: one texel {plain:.4}, a kernel of nine {kernel:.4}");
    assert!(plain < 2.0 * tolerance::LAYERS_EVERYWHERE && kernel < 2.0 * tolerance::LAYERS_EVERYWHERE);
}

/// Planes placed by lost light lie where light arrives; planes placed by mass also lie in the dark.
#[test]
fn slices_by_lost_light_leave_out_what_is_dark() {
    // A thin veil, a wall that lets nothing through, and much behind it.
    let value = |(k, _, _)| match k {
        0..=43 => 1000.0,
        44..=63 => 100.0,
        _ => 0.0,
    };
    let volume = volume_of(Voxels::F32(Array3::from_shape_fn((72, 8, 8), value)), DAffine3::IDENTITY);
    let tf = extinction(&[(0.0, 0.0), (100.0, 0.08), (1000.0, 3.0)]);
    let Some(setup) = Setup::open(&Arc::new(volume), &tf) else { return };
    let error = |slicing: &str| {
        let method = format!("osm:layers=6,slicing={slicing},bits=32,near=0,map=64");
        along_light_rays(&setup, &method, ABOVE).0.ray_err_max().unwrap()
    };
    let [density, lit] = ["density", "lit"].map(error);
    println!("a veil before a wall, 6 planes: by mass {density:.4}, by lost light {lit:.4}");
    assert!(lit < 0.5 * density, "{density} {lit}");
}

/// A shadow query for each sample makes the picture by shadow rays closer to the exact one.
#[test]
fn a_lookup_for_each_sample_is_closer() {
    let Some(setup) = Setup::open(&phantom("thorax:32"), &opacity(&[(-300.0, 0.0), (500.0, 0.3)])) else {
        return;
    };
    // At longer steps the eye ray's own error hides that of the light.
    let scene = Scene { step: 0.125, ..setup.scene(24, 20) };
    let exact = setup.exact().picture(&scene);
    let rms = |method: &str| rms_difference(&setup.picture(method, &scene), &exact);
    let (shared, each) = (rms("rays"), rms("rays:lookup=each"));
    println!("rms to the exact picture: lookups shared {shared:.6}, for each sample {each:.6}");
    assert!(each < 0.8 * shared && each < 1e-3, "{shared} {each}");
    // Every method accepts the setting, and its map gives the same results.
    for method in ["dsm:near=0,map=64", "osm:near=0,map=64", "dom:near=0,map=64", "bom:near=0,map=64"] {
        let each = format!("{method},lookup=each");
        let difference = rms_difference(&setup.picture(&each, &scene), &setup.picture(method, &scene));
        assert!(difference > 0.0 && difference < 0.02, "{method}: {difference}");
    }
}
