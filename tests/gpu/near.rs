//! Marches towards the light before a query of the shadow map (`near`).

use super::*;
use glam::DVec2;
use umbravox::shadow::Curve;
use umbravox::transfer::ClipPlane;

/// Map methods with coarse maps.
const METHODS: [&str; 10] = [
    "dsm:map=24",
    "dsm:map=24,march=samples,align=on",
    "osm:map=24,layers=32",
    "dom:map=24,layers=15",
    "bom:map=24,layers=15",
    "clusters:map=24,clusters=4",
    "avsm:map=24,nodes=16",
    "moments:map=24,moments=8",
    "wavelet:map=24",
    "beer:map=24",
];

/// Root mean square error of transmittance at points, against the exact reference.
fn error_rms(setup: &Setup, map: &ShadowMap, light: &Light, points: &[DVec3]) -> f64 {
    let field = setup.exact();
    let exact = points.iter().map(|x| field.transmittance_to_light(*x, light));
    let squares = exact.zip(setup.query(map, points)).map(|(exact, got)| (exact - f64::from(got)).powi(2));
    (squares.sum::<f64>() / points.len() as f64).sqrt()
}

/// Points on a lattice over the whole domain.
fn lattice(volume: &Volume) -> Vec<DVec3> {
    let dims = DVec3::from_array(volume.dims().map(|n| n as f64));
    let at = |n: usize| (n as f64 + 0.4) / 12.0;
    let index = |i: usize| DVec3::new(at(i % 12), at(i / 12 % 12), at(i / 144)) * dims - 0.5;
    (0..1728).map(|i| volume.world_from_index().transform_point3(index(i))).collect()
}

/// The whole way to the light is shorter than the march, so that the coarse map does not matter.
#[test]
fn a_march_to_the_light_needs_no_map() {
    let volume = phantom("sphere:16");
    let Some(setup) = Setup::open(&volume, &extinction(&[(0.0, 0.0), (1000.0, 0.2)])) else { return };
    let points = lattice(&volume);
    for (name, light) in lights(&volume) {
        // `dsm` keeps to the range of its texels.
        for method in &METHODS[2..] {
            let rms = error_rms(&setup, &setup.shadow(&format!("{method},near=32"), light), &light, &points);
            assert!(rms < 2e-3, "{method}, light {name}: {rms:e}");
        }
    }
}

#[test]
fn a_short_march_halves_the_error_of_a_coarse_map() {
    let volume = phantom("shell:40");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    let (_, light) = lights(&volume)[0];
    let has_extinction = |x: &DVec3| volume.value_at(volume.index_from_world().transform_point3(*x)) > 450.0;
    let points: Vec<DVec3> = lattice(&volume).into_iter().filter(has_extinction).collect();
    assert!(points.len() > 100, "{}", points.len());
    for method in METHODS {
        let [without, with] = [0, 4].map(|near| {
            error_rms(&setup, &setup.shadow(&format!("{method},near={near}"), light), &light, &points)
        });
        assert!(with < 0.5 * without, "{method}: {without} without the march, {with} with it");
    }
}

/// Extinction reaches the border of the domain, and a clip plane cuts it: nothing beyond them casts a shadow.
#[test]
fn a_march_ends_at_the_domain_and_at_clip_planes() {
    let volume = volume_of(Voxels::F32(Array3::from_elem((12, 12, 12), 500.0)), DAffine3::IDENTITY);
    let fog = extinction(&[(0.0, 0.1), (1000.0, 0.1)]);
    let cut = ClipPlane { normal: DVec3::X, offset_mm: 3.0 };
    let clipped = TransferFunction { clip: vec![cut], ..fog.clone() };
    for tf in [fog, clipped] {
        let Some(setup) = Setup::open(&Arc::new(volume.clone()), &tf) else { return };
        let light = Light::Directional { toward: DVec3::new(-1.0, 0.2, 0.1).normalize() };
        let points: Vec<DVec3> = (0..100).map(|i| DVec3::new(3.2 + 0.08 * f64::from(i), 5.0, 6.0)).collect();
        for method in ["dsm:map=16,near=8", "fourier:map=16,near=8"] {
            let rms = error_rms(&setup, &setup.shadow(method, light), &light, &points);
            assert!(rms < if method.starts_with("dsm") { 0.01 } else { 0.05 }, "{method}: {rms}");
        }
    }
}

#[test]
fn a_march_within_the_range_of_texels_keeps_the_error_bound() {
    let volume = phantom("shell:24");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    for (name, light) in lights(&volume) {
        let of = |spec: &str| setup.shadow(&format!("dsm:map=24,{spec}"), light);
        let (without, with) = (of("near=0"), of("near=4"));
        assert!(without.bound.is_some() && without.bound == with.bound, "light {name}");
        assert!(of("near=4,filter=nearest").bound.is_some(), "light {name}");
        // On the rays of texels both are the same map.
        let rays =
            (0..24 * 24).map(|i| with.light_space.world_ray(DVec2::new((i % 24).into(), (i / 24).into())));
        let [first, last] = with.light_space.z_range;
        let on_rays: Vec<DVec3> = rays
            .flat_map(|(start, ray)| {
                (0..8).map(move |k| start + (first + (last - first) * f64::from(k) / 7.0) * ray)
            })
            .collect();
        let [a, b] = [&without, &with].map(|map| setup.query(map, &on_rays));
        let difference = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(difference < 1e-3, "light {name}: {difference}");
    }
}

/// A point between texels gets a value that one of its texels has, or one between them.
#[test]
fn a_march_stays_within_the_range_of_the_texels() {
    let volume = phantom("shell:24");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    let (_, light) = lights(&volume)[0];
    let [map, texels] =
        ["near=4", "near=0,filter=nearest"].map(|spec| setup.shadow(&format!("dsm:map=24,{spec}"), light));
    let space = &map.light_space;
    let mut inside = 0;
    for point in lattice(&volume) {
        let (texel, depth) = space.light_point(point);
        let corners = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE].map(|corner| {
            let (start, ray) = space.world_ray(texel.floor() + corner);
            start + depth * ray
        });
        let around = setup.query(&texels, &corners);
        let [least, most] = [f32::min, f32::max].map(|pick| around.iter().copied().reduce(pick).unwrap());
        let got = setup.query(&map, &[point])[0];
        assert!(got >= least - 1e-4 && got <= most + 1e-4, "{point}: {got} beside {around:?}");
        inside += usize::from(most - least > 0.1 && got > least + 0.01 && got < most - 0.01);
    }
    assert!(inside > 20, "{inside} points between their texels");
}

/// Bins of the transfer function's table are wider than its ramp: values without extinction share a bin with it.
#[test]
fn values_without_extinction_stay_clear_in_wide_ranges() {
    let value = |(k, _, _): (usize, usize, usize)| if k == 15 { 1e6 } else { 0.0 };
    let volume = volume_of(Voxels::F32(Array3::from_shape_fn((16, 8, 8), value)), DAffine3::IDENTITY);
    let ramp = extinction(&[(0.0, 0.0), (100.0, 1.0)]);
    let Some(setup) = Setup::open(&Arc::new(volume), &ramp) else { return };
    let map = setup.shadow("dsm:map=8,near=4", Light::Directional { toward: DVec3::new(0.1, 0.0, -1.0) });
    let points = [DVec3::new(3.0, 4.0, 6.0), DVec3::new(4.5, 2.5, 12.0)];
    for t in setup.query(&map, &points) {
        assert!(t > 0.999, "{t}");
    }
}

/// Labels with functions of their own, one of them hidden.
#[test]
fn labels_have_their_own_extinction() {
    let cube = volume_of(Array3::<u8>::from_elem((24, 24, 24), 100).into(), DAffine3::IDENTITY);
    let volume = labels::labelled(&Arc::new(cube), |[_, _, k]| [1, 2, 3][(k / 4).min(2)]);
    let even = |sigma: f64| extinction(&[(50.0, sigma), (200.0, sigma)]);
    let rules = vec![labels::hidden(&[2]), labels::through(&[3], &even(0.3))];
    let tf = TransferFunction { rules, ..even(0.05) };
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let points = lattice(&volume);
    for (name, light) in lights(&volume).into_iter().take(2) {
        let rms = error_rms(&setup, &setup.shadow("dsm:map=24,near=32", light), &light, &points);
        assert!(rms < 0.03, "light {name}: {rms:e}");
    }
}

#[test]
fn every_method_with_the_setting_uses_it() {
    for entry in shadow::METHODS.iter().filter(|entry| entry.keys.iter().any(|key| key.name == "near")) {
        let of = |near: &str| shadow::parse(&format!("{}:near={near}", entry.name)).unwrap();
        let [without, with] = ["0", "4"].map(|near| of(near).lookup().unwrap().within("render/query.wgsl"));
        assert!(!without.modules.contains(&"shadow/near.wgsl") && with.modules.contains(&"shadow/near.wgsl"));
        // Only `dsm` keeps its map's answer on the light rays of texels.
        assert_eq!(of("4").curve() == Curve::Falls, entry.name == "dsm", "{}", entry.name);
    }
}
