//! Pool of deep-shadow-map rows: if it is too small, it grows, and the tiles that ran out are built again, not all of
//! them.

use super::*;

#[test]
fn a_pool_that_runs_out_grows() {
    // Layers across the light: hundreds of nodes a texel.
    let peaks = extinction(&[(300.0, 0.0), (500.0, 0.04), (700.0, 0.0), (1000.0, 0.0)]);
    let Some(setup) = Setup::open(&phantom("comb:96"), &peaks) else { return };
    let light = Light::Directional { toward: DVec3::new(0.05, 0.02, 1.0) };
    let map = setup.shadow("dsm:epsilon=0.0005,map=64", light);
    assert!(map.report.pool_growths > 0, "{:?}", map.report);
    let again = setup.shadow("dsm:epsilon=0.0005,map=64", light);
    let (first, second) = (map.report, again.report);
    assert_eq!((second.pool_growths, second.nodes_total), (0, first.nodes_total), "{second:?}");
    assert_eq!((first.bytes, first.bytes_used), (second.bytes, second.bytes_used));
    // Tiles that stayed and tiles that were built again form the same map as a build at once.
    let across: Vec<DVec3> =
        (0..2000).map(|i| DVec3::new(f64::from(i % 50), f64::from(i / 50), 25.0) - 24.0).collect();
    assert_eq!(setup.query(&map, &across), setup.query(&again, &across));
    // A quad is four words, and at most three of the last one of a texel are empty.
    let needed = 4 * (second.nodes_total.unwrap() + 4 * second.texels_hit.unwrap());
    assert!(second.bytes_used < needed && second.bytes < second.bytes_used * 21 / 20, "{second:?}");
    // Other settings have pools of their own.
    let other = setup.shadow("dsm:epsilon=0.0005,map=65", light).report;
    assert!(other.pool_growths > 0, "{other:?}");
    assert!(map.report.nodes_max.unwrap() > 64, "{:?}", map.report);
    assert!(map.report.build_bytes > 64 * 64 * 32 * 5 / 4, "{:?}", map.report);
    let field = setup.exact();
    let points: Vec<DVec3> = (0..400)
        .map(|i| {
            let t = f64::from(i) / 400.0;
            DVec3::new(10.0 * (t * 40.0).sin(), 12.0 * (t * 23.0).cos(), 60.0 * t - 30.0)
        })
        .collect();
    // The layers do not change across the light, so texels of any size hold every point's answer.
    let bound = map.bound.unwrap();
    for (x, got) in points.iter().zip(setup.query(&map, &points)) {
        let toward = DVec3::new(0.05, 0.02, 1.0).normalize();
        let exact = |by: f64| field.transmittance_to_light(*x - toward * by, &light);
        let (low, high) =
            (exact(bound.depth_mm) - bound.transmittance, exact(-bound.depth_mm) + bound.transmittance);
        assert!((low..=high).contains(&f64::from(got)), "{x}: {got} not in {low}..{high}");
    }
}

#[test]
fn only_tiles_that_the_pool_was_too_small_for_are_built_again() {
    // On one side of x = 32 the value rises and falls along the light (hundreds of nodes), on the other it is
    // constant (two nodes).
    let value = |(k, _, i): (usize, usize, usize)| if i < 32 { 1000.0 * (k % 2) as f32 } else { 100.0 };
    let volume = volume_of(Voxels::F32(Array3::from_shape_fn((96, 64, 64), value)), DAffine3::IDENTITY);
    let haze = extinction(&[(0.0, 0.002), (1000.0, 0.03)]);
    let Some(setup) = Setup::open(&Arc::new(volume), &haze) else { return };
    let light = Light::Directional { toward: DVec3::new(0.0, 0.0, -1.0) };
    let spec = "dsm:epsilon=0.0002,map=128,fit=volume";
    let first = setup.shadow(spec, light);
    let second = setup.shadow(spec, light);
    assert_eq!((first.report.pool_growths, second.report.pool_growths), (1, 0), "{:?}", first.report);
    assert_eq!(first.report.bytes_used, second.report.bytes_used);
    // Both sides, and the edge between them, equal those of a map that had room at once.
    let points: Vec<DVec3> = (0..4000)
        .map(|i| DVec3::new(f64::from(i % 61) + 1.3, f64::from(i / 61 % 60) + 1.7, f64::from(i % 89) + 2.9))
        .collect();
    let got = setup.query(&first, &points);
    assert_eq!(got, setup.query(&second, &points));
    let dark = |side: fn(f64) -> bool| {
        points.iter().zip(&got).filter(|(p, _)| side(p.x)).map(|(_, t)| *t).fold(1.0, f32::min)
    };
    assert!(dark(|x| x < 30.0) < 0.5 && dark(|x| x > 34.0) < 0.75, "the light reaches all of it");
}

/// A window reuses the pools of maps that no longer exist, and what they held does not show.
#[test]
fn pools_of_dropped_maps_are_reused_without_traces() {
    let Some(gpu) = common::gpu() else { return };
    let live = Arc::new(Renderer::live(gpu, 1e3));
    let volume = phantom("comb:48");
    let tf = extinction(&[(300.0, 0.0), (500.0, 0.04), (700.0, 0.0), (1000.0, 0.0)]);
    let open = || Session::on(&live, Arc::clone(&volume), &tf, DisabledOptimizations::NONE).unwrap();
    let (session, fresh) = (open(), open());
    let scene = Scene { width: 60, height: 45, ..Scene::framing(&volume) };
    let method = shadow::parse("dsm:map=48,epsilon=0.005").unwrap();
    let lights = [DVec3::new(0.05, 0.02, 1.0), DVec3::new(0.8, 0.1, 0.6)];
    let [first, second] = lights.map(|toward| Light::Directional { toward });
    let unused = || session.loaded.node_pools.unused();
    assert_eq!(unused(), 0, "no map was built");
    let map = session.shadow(method.as_ref(), first).unwrap();
    let picture = session.render(&map, &scene).unwrap().pixels;
    assert_eq!(unused(), 1, "rows of the build");
    // Another map while the first exists: each has a pool of its own.
    let other = session.shadow(method.as_ref(), second).unwrap();
    assert_eq!(session.render(&map, &scene).unwrap().pixels, picture);
    assert_eq!(unused(), 1, "rows of the build");
    drop((map, other));
    assert_eq!(unused(), 3, "rows of the build, and pools without a map");
    let again = session.shadow(method.as_ref(), second).unwrap();
    assert_eq!(unused(), 2, "one of the two pools is in use again");
    let drawn_first = fresh.shadow(method.as_ref(), second).unwrap();
    assert_eq!(
        session.render(&again, &scene).unwrap().pixels,
        fresh.render(&drawn_first, &scene).unwrap().pixels
    );
}
