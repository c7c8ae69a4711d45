//! Filters of 4 x 4 texels (`filter=gauss|pcf`), and cubics between the planes of `osm` (`between=cubic`), on volumes with
//! known answers.

use super::bound::along_light_rays;
use super::*;
use glam::DVec2;
use umbravox::shadow::{Filter, LightSpace};

/// Light at infinity on the z axis.
const ABOVE: Light = Light::Directional { toward: DVec3::Z };

/// Methods whose stored curves are exact where the matter of a light ray ends. The flag says whether `filter=gauss`
/// averages optical depth there, and not transmittance.
const METHODS: [(&str, bool); 14] = [
    ("dsm:epsilon=0.001", false),
    ("osm:layers=8,bits=32", false),
    ("osm:layers=8,bits=32,average=depth", true),
    ("dom:layers=8,bits=32,depth_bits=32", false),
    ("dom:layers=8,bits=32,depth_bits=32,average=depth", true),
    ("bom:layers=8,bits=32,depth_bits=32", false),
    ("clusters:bits=32", false),
    ("avsm:bits=32", false),
    ("fourier:bits=32", true),
    ("fourier:bits=32,range=texel", false),
    ("wavelet:bits=32", true),
    ("wavelet:bits=32,range=texel", false),
    ("moments:bits=32", true),
    ("moments:bits=16", true),
];

/// Volume of 32 x 32 x 8 voxels whose values do not change along the light of [`ABOVE`].
fn columns_of(value: impl Fn(usize, usize) -> f32) -> Arc<Volume> {
    let voxels = Array3::from_shape_fn((8, 32, 32), |(_, j, i)| value(i, j));
    Arc::new(volume_of(Voxels::F32(voxels), DAffine3::IDENTITY))
}

/// Points that cover the unit square evenly.
fn spread(count: u32) -> impl Iterator<Item = DVec2> {
    (0..count).map(|k| (f64::from(k) * DVec2::new(0.754_877_666, 0.569_840_29)).fract())
}

/// Weights of the four texels on an axis at a position `w` past the centre of the second one.
fn weights(filter: &str, w: f64) -> [f64; 4] {
    let gauss = |distance: f64| (-0.5 * distance * distance).exp() - (-2.0f64).exp();
    match filter {
        "pcf" => [1.0 - w, 1.0, 1.0, w].map(|weight| weight / 3.0),
        _ => {
            let weights = [1.0 + w, w, 1.0 - w, 2.0 - w].map(gauss);
            weights.map(|weight| weight / weights.iter().sum::<f64>())
        }
    }
}

/// Position (mm) at a depth on the light ray of a texel, inside the map or beyond its edge.
fn on_ray(space: &LightSpace, texel: DVec2, z: f64) -> DVec3 {
    let (origin, direction) = space.world_ray(texel);
    origin + z * direction
}

/// Texel that continues an octahedral map: the mirrored one behind the same edge.
fn mirrored(mut texel: DVec2, side: f64) -> DVec2 {
    let inside = |t: f64| if t < 0.0 { -1.0 - t } else { 2.0 * side - 1.0 - t };
    if texel.x < 0.0 || texel.x >= side {
        texel = DVec2::new(inside(texel.x), side - 1.0 - texel.y);
    }
    if texel.y < 0.0 || texel.y >= side {
        texel = DVec2::new(side - 1.0 - texel.x, inside(texel.y));
    }
    texel
}

/// Columns of matter, whose edges cross tiles and reach the edges of the map: a query is the weighted mean of the exact
/// transmittances (or optical depths) of 16 texels.
#[test]
fn a_query_is_the_weighted_mean_of_its_texels() {
    let volume = columns_of(|i, j| if (i / 5 + j / 3) % 2 == 1 { 1000.0 } else { 0.0 });
    let Some(setup) = Setup::open(&volume, &extinction(&[(500.0, 0.0), (500.0, 0.1)])) else { return };
    let field = setup.exact();
    let inside = Light::Point { position: DVec3::new(15.2, 14.7, 3.6) };
    for (light, side) in [(ABOVE, 48), (inside, 40)] {
        for ((method, averages_depth), filter) in
            METHODS.into_iter().flat_map(|method| [(method, "gauss"), (method, "pcf")])
        {
            let map = setup.shadow(&format!("{method},filter={filter},near=0,map={side},fit=volume"), light);
            let space = &map.light_space;
            let z = space.z_range[1] + 0.25;
            let exact = |texel: DVec2| {
                let texel = if light == ABOVE { texel } else { mirrored(texel, f64::from(side)) };
                field.transmittance_to_light(on_ray(space, texel, z), &light)
            };
            let places: Vec<DVec2> = spread(250).map(|share| f64::from(side) * share - 0.5).collect();
            let points: Vec<DVec3> = places.iter().map(|place| on_ray(space, *place, z)).collect();
            let values = setup.query(&map, &points);
            let (mut errors, mut blurred) = (Vec::new(), 0.0_f64);
            for (place, got) in places.iter().zip(values) {
                let base = place.floor();
                let [columns, rows] = (*place - base).to_array().map(|w| weights(filter, w));
                let of_depth = averages_depth && filter == "gauss";
                let mean: f64 = (0..16)
                    .map(|n| {
                        let t = exact(base + DVec2::new(f64::from(n % 4) - 1.0, f64::from(n / 4) - 1.0));
                        columns[n as usize % 4] * rows[n as usize / 4] * if of_depth { -t.ln() } else { t }
                    })
                    .sum();
                let mean = if of_depth { (-mean).exp() } else { mean };
                errors.push((f64::from(got) - mean).abs());
                blurred = blurred.max((exact(place.round()) - mean).abs());
            }
            errors.sort_by(f64::total_cmp);
            // Rays that graze the edge of a column differ by float32.
            let worst = errors[errors.len() - 1 - errors.len() / 50];
            println!("{method}, {filter}, {side} texels: {worst:.5}, beside {blurred:.2}");
            assert!(worst < 0.004 && blurred > 0.1, "{method}, {filter}, {side}: {worst} {blurred}");
        }
    }
}

/// Optical depth that is linear across the light stays so: the filters have no bias. Even matter is unchanged.
#[test]
fn linear_and_even_matter_is_unchanged() {
    let tf = extinction(&[(0.0, 0.0), (31.0, 0.12)]);
    for (even, most) in [(false, 1.5e-3), (true, 1e-3)] {
        let Some(setup) = Setup::open(&columns_of(|i, _| if even { 20.0 } else { i as f32 }), &tf) else {
            return;
        };
        let field = setup.exact();
        for (method, filter) in METHODS.iter().flat_map(|method| [(method.0, "gauss"), (method.0, "pcf")]) {
            let map = setup.shadow(&format!("{method},filter={filter},near=0,map=48,fit=volume"), ABOVE);
            let space = &map.light_space;
            let z = space.z_range[1] + 0.25;
            let points: Vec<DVec3> = spread(200).map(|share| on_ray(space, 6.0 + 35.0 * share, z)).collect();
            let values = setup.query(&map, &points);
            let error = |(point, t): (&DVec3, f32)| {
                (f64::from(t) - field.transmittance_to_light(*point, &ABOVE)).abs()
            };
            let worst = points.iter().zip(values).map(error).fold(0.0, f64::max);
            println!("{method}, {filter}, even {even}: {worst:.6}");
            assert!(worst < most, "{method}, {filter}, even {even}: {worst}");
        }
    }
}

/// On the light ray of a texel the result is compared with the same mean of exact curves. There is no error bound.
#[test]
fn wide_filters_are_judged_by_the_texels_that_they_average() {
    let Some(setup) = Setup::open(&phantom("thorax:48"), &opacity(&[(-200.0, 0.0), (600.0, 0.1)])) else {
        return;
    };
    let light = lights(setup.volume())[0].1;
    for filter in ["gauss", "pcf"] {
        let method = format!("dsm:epsilon=0.001,near=0,map=48,filter={filter}");
        let (report, sanity) = along_light_rays(&setup, &method, light);
        let error = report.ray_err_max().unwrap();
        println!("dsm, {filter}: {error:.5}");
        assert!(error < 0.005 && sanity.monotone_violations == 0, "{filter}: {error}");
        assert!(setup.shadow(&method, light).bound.is_none() && report.satisfied().is_none());
        // The march of `near` is not clamped to a range of texels.
        let near = setup.shadow(&format!("dsm:map=48,filter={filter}"), light);
        assert!(near.bound.is_none());
    }
    assert!(setup.shadow("dsm:map=48", light).bound.is_some());
    assert!(Filter::Gauss.is_wide() && Filter::Pcf.is_wide() && !Filter::Bilinear.is_wide());
}

/// Monotone cubic of Fritsch and Butland (1984) through `(x, y)`.
fn cubic(x: &[f64], y: &[f64], at: f64) -> f64 {
    let last = x.len() - 1;
    let secant = |k: usize| (y[k + 1] - y[k]) / (x[k + 1] - x[k]);
    let slope = |k: usize| {
        if k == 0 || k == last {
            return secant(if k == 0 { 0 } else { last - 1 });
        }
        let (h, next, a, b) = (x[k] - x[k - 1], x[k + 1] - x[k], secant(k - 1), secant(k));
        let share = (h + 2.0 * next) / (3.0 * (h + next));
        if a * b > 0.0 { a * b / (share * b + (1.0 - share) * a) } else { 0.0 }
    };
    let k = (0..last - 1).rfind(|k| x[k + 1] <= at).map_or(0, |k| k + 1);
    let h = x[k + 1] - x[k];
    let t = ((at - x[k]) / h).clamp(0.0, 1.0);
    let (start, end) = (slope(k) * h, slope(k + 1) * h);
    let curvature =
        [y[k], start, 3.0 * (y[k + 1] - y[k]) - 2.0 * start - end, 2.0 * (y[k] - y[k + 1]) + start + end];
    curvature.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

#[test]
fn cubics_between_planes_are_monotone_and_known() {
    let wave = |s: f64| 1.0 + 0.5 * (std::f64::consts::TAU * s).sin();
    let layers = |value: &dyn Fn(f64) -> f64| {
        let share = |k: usize| 1.0 - (k as f64 + 0.5) / 128.0;
        let voxels = Array3::from_shape_fn((128, 16, 16), |(k, _, _)| value(share(k)) as f32);
        Arc::new(volume_of(Voxels::F32(voxels), DAffine3::IDENTITY))
    };
    let slab = |s: f64| if (0.3..0.6).contains(&s) { 1.0 } else { 0.0 };
    for (name, volume) in [("wave", layers(&wave)), ("slab", layers(&slab))] {
        let Some(setup) = Setup::open(&volume, &extinction(&[(0.0, 0.0), (2.0, 0.05)])) else { return };
        let field = setup.exact();
        for (slicing, exponent) in [("uniform", 1.0), ("gamma", 2.2)] {
            let build = |between: &str| {
                let rest = "filter=nearest,bits=32,near=0,map=32,fit=volume";
                setup.shadow(&format!("osm:layers=12,slicing={slicing},between={between},{rest}"), ABOVE)
            };
            let (straight, map) = (build("linear"), build("cubic"));
            let [start, end] = map.light_space.z_range;
            let at = |z: f64| on_ray(&map.light_space, DVec2::splat(16.0), z);
            let exact = |z: f64| field.transmittance_to_light(at(z), &ABOVE);
            let planes: Vec<f64> =
                (0..=12).map(|k| start + (f64::from(k) / 12.0).powf(exponent) * (end - start)).collect();
            // Linear interpolation returns the stored optical depths at the planes.
            let on_planes: Vec<DVec3> = planes.iter().map(|z| at(*z)).collect();
            let stored = setup.query(&straight, &on_planes);
            let depths: Vec<f64> = stored.into_iter().map(|t| -f64::from(t).ln()).collect();
            let zs: Vec<f64> = (0..=600).map(|k| start + f64::from(k) / 600.0 * (end - start)).collect();
            let points: Vec<DVec3> = zs.iter().map(|z| at(*z)).collect();
            let [linear, values] = [&straight, &map]
                .map(|map| setup.query(map, &points).into_iter().map(f64::from).collect::<Vec<f64>>());
            for (z, t) in zs.iter().zip(&values) {
                let expected = (-cubic(&planes, &depths, *z)).exp();
                assert!((t - expected).abs() < 1e-4, "{name}, {slicing}, depth {z}: {t} {expected}");
                let k = planes[1..12].partition_point(|plane| plane <= z);
                let [most, least] = [depths[k], depths[k + 1]].map(|depth| (-depth).exp());
                assert!(*t < most + 1e-4 && *t > least - 1e-4, "{name}, {slicing}, depth {z}: {t}");
            }
            assert!(values.windows(2).all(|pair| pair[1] <= pair[0] + 1e-6), "{name}, {slicing}: falls");
            let error = |values: &[f64]| {
                let square = |(z, t): (&f64, &f64)| (exact(*z) - t).powi(2);
                (zs.iter().zip(values).map(square).sum::<f64>() / zs.len() as f64).sqrt()
            };
            let (linear, cubic) = (error(&linear), error(&values));
            println!("{name}, {slicing}: linear {linear:.5}, cubic {cubic:.5}");
            assert!(name == "slab" || cubic < 0.6 * linear, "{slicing}: {linear} {cubic}");
        }
    }
}
