//! Layered shadow maps `osm`, `dom` and `bom`: volumes with known results, and the claims of their papers.

use super::bound::along_light_rays;
use super::*;

/// Light at infinity on the z axis, for which the slab has the same result in every texel.
const ABOVE: Light = Light::Directional { toward: DVec3::Z };

fn ray_err_max(setup: &Setup, method: &str, light: Light) -> f64 {
    along_light_rays(setup, method, light).0.ray_err_max().unwrap()
}

/// Transfer function with a ramp over the values of the analytic phantoms: `per_mm` at 1000.
fn ramp(per_mm: f64) -> TransferFunction {
    extinction(&[(0.0, 0.0), (1000.0, per_mm)])
}

#[test]
fn opacity_maps_converge() {
    let thorax = opacity(&[(-200.0, 0.0), (600.0, 0.1)]);
    for (name, tf) in [("slab", ramp(0.05)), ("thorax:64", thorax)] {
        let Some(setup) = Setup::open(&phantom(name), &tf) else { return };
        let error = |layers: u32| {
            ray_err_max(
                &setup,
                &format!("osm:layers={layers},bits=32,near=0,map=64"),
                lights(setup.volume())[0].1,
            )
        };
        let errors = [8, 16, 32, 64, 128, 256].map(error);
        println!("{name}: osm layers 8 to 256: {errors:.4?}");
        assert!(errors.windows(2).all(|w| w[1] < w[0]), "{name}: {errors:?}");
        let finest = error(512);
        assert!(finest < tolerance::LAYERS_EVERYWHERE, "{name}: {finest}");
    }
}

#[test]
fn slices_lie_at_their_reported_depths() {
    let Some(setup) = Setup::open(&phantom("slab"), &ramp(0.05)) else { return };
    let error = |slicing: &str| {
        ray_err_max(&setup, &format!("osm:layers=4,slicing={slicing},bits=32,near=0,map=32"), ABOVE)
    };
    let [uniform, density, gamma] = ["uniform", "density", "gamma"].map(error);
    println!("slab, 4 layers: uniform {uniform:.4}, density {density:.4}, gamma {gamma:.4}");
    // The slab is uniform inside, so equal shares of its mass start and end with it; close planes in front catch
    // its start.
    assert!(density < gamma && gamma < uniform, "{uniform} {density} {gamma}");
}

/// With slices by density, fog thinner than a step of the coarse mass histogram still dims the light behind it.
#[test]
fn slices_by_density_begin_at_the_thinnest_matter() {
    let value = |(k, _, _)| if k < 115 { 1.0 } else { 100.0 };
    let volume = volume_of(Voxels::F32(Array3::from_shape_fn((128, 8, 8), value)), DAffine3::IDENTITY);
    let fog = extinction(&[(0.0, 0.0), (1.0, 0.0037), (100.0, 0.5)]);
    let Some(setup) = Setup::open(&Arc::new(volume), &fog) else { return };
    let below = Light::Directional { toward: DVec3::NEG_Z };
    let error = |layers: u32| {
        ray_err_max(&setup, &format!("osm:layers={layers},slicing=density,bits=32,near=0,map=32"), below)
    };
    let errors = [8, 32, 128].map(error);
    println!("fog before a wall, 8, 32, 128 layers by density: {errors:.4?}");
    assert!(errors[0] < 0.25 && errors[2] < 0.02 && errors.windows(2).all(|w| w[1] < w[0]), "{errors:?}");
}

/// The 3x3 kernel averages optical depths of texels, as the paper's sample function does, for either filter.
#[test]
fn a_kernel_averages_nine_texels() {
    let Some(setup) = Setup::open(&phantom("shell:32"), &ramp(0.05)) else { return };
    let light = lights(setup.volume())[0].1;
    let build = |rest: &str| setup.shadow(&format!("osm:layers=16,near=0,map=48,bits=32{rest}"), light);
    let depths = |map: &ShadowMap, texels: &[glam::DVec2]| -> Vec<f64> {
        let z = map.light_space.z_range[0] + 30.0;
        let at = |t: &glam::DVec2| {
            let (origin, direction) = map.light_space.world_ray(*t);
            origin + z * direction
        };
        let points: Vec<DVec3> = texels.iter().map(at).collect();
        setup.query(map, &points).iter().map(|t| -f64::from(*t).ln()).collect()
    };
    let texel = |c: i32, r: i32| glam::DVec2::new(f64::from(c), f64::from(r));
    let plain = build(",filter=nearest");
    let mean = |c: i32, r: i32| {
        let around: Vec<_> = (0..9).map(|i| texel(c + i % 3 - 1, r + i / 3 - 1)).collect();
        depths(&plain, &around).iter().sum::<f64>() / 9.0
    };
    let (nearest, bilinear) = (build(",kernel=3,filter=nearest"), build(",kernel=3"));
    let mut largest = 0.0_f64;
    for (c, r) in [(10, 20), (24, 24), (30, 12), (17, 33), (1, 24)] {
        let expected = mean(c, r);
        for map in [&nearest, &bilinear] {
            let got = depths(map, &[texel(c, r)])[0];
            assert!((got - expected).abs() < 2e-4, "({c}, {r}): {got} {expected}");
        }
        let half_way = depths(&bilinear, &[texel(c, r) + glam::DVec2::new(0.5, 0.0)])[0];
        let both = 0.5 * (expected + mean(c + 1, r));
        assert!((half_way - both).abs() < 2e-4, "({c}.5, {r}): {half_way} {both}");
        largest = largest.max((expected - depths(&plain, &[texel(c, r)])[0]).abs());
    }
    assert!(largest > 1e-3, "the kernel changes something");
}

/// Points at the given distances (mm) behind the first surface of the sphere on light rays through its middle region,
/// with the exact transmittance there.
fn lit_side(setup: &Setup, light: Light, offsets_mm: &[f64]) -> Vec<(DVec3, f64)> {
    let field = setup.exact();
    let map = setup.shadow("none", light);
    let mut points = Vec::new();
    for (column, row) in (0..81).map(|i| (i % 9, i / 9)) {
        // Texels of a map of 512 over the middle of the volume.
        let texel = glam::DVec2::new(176.0 + 20.0 * f64::from(column), 176.0 + 20.0 * f64::from(row));
        let (origin, direction) = map.light_space.world_ray(texel);
        let start = map.light_space.ray_start();
        let curve = field.curve_along(origin + start * direction, direction, f64::INFINITY);
        if let Some(first) = curve.jumps().into_iter().next().filter(|_| curve.total() > 0.1) {
            let at = |offset: f64| origin + (start + first + offset) * direction;
            points.extend(offsets_mm.iter().map(|o| (at(*o), field.transmittance_to_light(at(*o), &light))));
        }
    }
    points
}

#[test]
fn deep_opacity_begins_where_matter_does() {
    let jump = extinction(&[(500.0, 0.0), (500.0, 0.2)]);
    let Some(setup) = Setup::open(&phantom("sphere"), &jump) else { return };
    for (place, light) in lights(setup.volume()) {
        if place == "point inside" {
            continue;
        }
        let before = lit_side(&setup, light, &[-0.05, -0.5, -3.0]);
        assert!(before.len() > 60, "{place}: {}", before.len());
        let points: Vec<DVec3> = before.iter().map(|p| p.0).collect();
        for method in [
            "dom:layers=3,near=0,align=on,map=512",
            "dom:layers=3,near=0,map=512,depth_bits=32,filter=nearest",
            "bom:layers=3,near=0,align=on,map=512",
        ] {
            let map = setup.shadow(method, light);
            let lit = setup.query(&map, &points).iter().filter(|t| **t == 1.0).count();
            // Between texels a curved surface lies a hair off the plane through its neighbours.
            let least = if method.contains("nearest") { points.len() } else { 2 * points.len() / 3 };
            assert!(lit >= least, "{place}, {method}: {lit} of {}", points.len());
        }
    }
}

#[test]
fn transmittance_is_one_up_to_the_start_on_every_tested_ray() {
    let jump = extinction(&[(500.0, 0.0), (500.0, 0.2)]);
    let Some(setup) = Setup::open(&phantom("sphere"), &jump) else { return };
    let field = setup.exact();
    for (place, light) in lights(setup.volume()) {
        for method in [
            "dom:layers=3,near=0,map=64",
            "dom:layers=3,near=0,map=64,depth_bits=8",
            "bom:layers=3,near=0,map=64",
        ] {
            let map = setup.shadow(method, light);
            let mut points = Vec::new();
            for i in 0..256 {
                let texel = glam::DVec2::new(f64::from(4 * (i % 16) + 1), f64::from(4 * (i / 16) + 1));
                let (origin, direction) = map.light_space.world_ray(texel);
                let start = map.light_space.ray_start();
                let curve = field.curve_along(origin + start * direction, direction, f64::INFINITY);
                if curve.total() > 0.05
                    && let Some(first) = curve.jumps().first()
                {
                    let hair = 0.02 * setup.volume().min_spacing_mm();
                    points
                        .extend([hair, 0.3, 4.0].map(|before| origin + (start + first - before) * direction));
                }
            }
            // A light inside the ball has no empty space in front of matter.
            if place == "point inside" {
                continue;
            }
            assert!(points.len() > 100, "{place}");
            let worst = setup.query(&map, &points).into_iter().fold(1.0, f32::min);
            // Texel coordinates of points on a texel's own ray are off by float32 rounding, and neighbours weigh in
            // so much.
            assert!(worst >= 1.0 - 1e-4, "{place}, {method}: {worst}");
            let nearest = setup.shadow(&format!("{method},filter=nearest"), light);
            let all_lit = setup.query(&nearest, &points).into_iter().all(|t| t == 1.0);
            assert!(all_lit, "{place}, {method}: exactly 1 before the start");
        }
    }
}

#[test]
fn deep_opacity_has_no_bands_at_the_lit_side() {
    let jump = extinction(&[(500.0, 0.0), (500.0, 0.2)]);
    let Some(setup) = Setup::open(&phantom("sphere"), &jump) else { return };
    let light = lights(setup.volume())[0].1;
    let seen = lit_side(&setup, light, &[-1.0, -0.5, 0.0, 0.5, 1.0]);
    let points: Vec<DVec3> = seen.iter().map(|p| p.0).collect();
    let errors = |method: &str| -> Vec<f64> {
        let values = setup.query(&setup.shadow(method, light), &points);
        values.iter().zip(&seen).map(|(t, (_, exact))| f64::from(*t) - exact).collect()
    };
    let worst = |errors: &[f64]| errors.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
    let (osm, dom) = (errors("osm:layers=15,near=0"), errors("dom:layers=15,near=0,align=on"));
    println!("lit side of a ball, 15 layers: osm {:.4}, dom {:.4}", worst(&osm), worst(&dom));
    assert!(worst(&osm) > 0.1, "planes cut through the surface: bands");
    assert!(worst(&dom) < 0.25 * worst(&osm), "{} {}", worst(&dom), worst(&osm));
}

#[test]
fn lookups_behind_the_last_layer() {
    let Some(setup) = Setup::open(&phantom("slab"), &ramp(0.05)) else { return };
    let depth = |method: &str, z: f64| -> f64 {
        let map = setup.shadow(method, ABOVE);
        -f64::from(setup.query(&map, &[DVec3::new(0.5, 0.5, z)])[0]).ln()
    };
    let total = 0.05 * 32.0;
    // The slab goes down from z = 16 to -16; a quarter of the map's depth is about a quarter of that.
    let dom = |beyond: &str| format!("dom:layers=3,spread=0.25,bits=32,near=0,map=32,beyond={beyond}");
    assert!((depth(&dom("extend"), -30.0) - total).abs() < tolerance::FULL_DEPTH);
    assert!(
        (depth(&dom("extend"), 4.0) - total).abs() < tolerance::FULL_DEPTH,
        "what lies behind shadows itself"
    );
    assert!(
        (0.2..0.35).contains(&(depth(&dom("ignore"), -30.0) / total)),
        "{}",
        depth(&dom("ignore"), -30.0)
    );
    assert!((depth(&dom("cover"), -30.0) - total).abs() < tolerance::FULL_DEPTH);
    assert!((depth(&dom("cover"), 0.0) - 0.5 * total).abs() < 0.1 * total);
}

#[test]
fn the_last_layer_holds_the_full_depth() {
    let tf = extinction(&[(200.0, 0.0), (1000.0, 0.08)]);
    for name in ["sphere", "shell", "slab"] {
        let Some(setup) = Setup::open(&phantom(name), &tf) else { return };
        let field = setup.exact();
        for (place, light) in lights(setup.volume()) {
            for method in [
                "bom:layers=3,split=linear",
                "bom:layers=7,split=log",
                "bom:layers=15,depth_bits=8",
                "bom:layers=1,split=auto",
                "bom:layers=7,split=auto",
                "bom:layers=7,split=texel",
                "osm:layers=1,slicing=density",
            ] {
                let map = setup.shadow(&format!("{method},near=0,map=64,bits=32"), light);
                let space = &map.light_space;
                let rays = (0..256).map(|i| {
                    let texel = glam::DVec2::new(f64::from(4 * (i % 16) + 1), f64::from(4 * (i / 16) + 2));
                    let (origin, direction) = space.world_ray(texel);
                    origin + (space.z_range[1] + 1.0) * direction
                });
                let points: Vec<DVec3> = rays.collect();
                for (point, t) in points.iter().zip(setup.query(&map, &points)) {
                    let exact = -field.transmittance_to_light(*point, &light).ln();
                    let off = (-f64::from(t).ln() - exact).abs();
                    assert!(off < tolerance::FULL_DEPTH, "{name}, {place}, {method}: {exact} off by {off}");
                }
            }
        }
    }
}

#[test]
fn opaque_matter_fills_the_layers_behind_it() {
    let Some(setup) = Setup::open(&phantom("slab:32"), &opacity(&[(400.0, 0.0), (400.0, 1.0)])) else {
        return;
    };
    let points: Vec<DVec3> = (0..9).map(|i| DVec3::new(1.0, 2.0, 10.0 - 5.0 * f64::from(i))).collect();
    for method in ["osm:layers=64", "dom:layers=31", "dom:layers=3,spread=0.1,beyond=ignore", "bom:layers=31"]
    {
        let values = setup.query(&setup.shadow(&format!("{method},near=0,map=64"), ABOVE), &points);
        assert!(values.iter().all(|t| *t < 0.02), "{method}: {values:?}");
    }
}

/// Transmittance along light rays never rises and stays in range for any number of stored bits. Fewer bits take fewer
/// bytes, with a small error.
#[test]
fn stored_bits() {
    let [tf, ..] = transfer_functions([-900.0, 1200.0]);
    let Some(setup) = Setup::open(&phantom("thorax:48"), &tf) else { return };
    for (place, light) in lights(setup.volume()) {
        for method in [
            "osm:layers=15,near=0,map=48",
            "dom:layers=15,spread=1,near=0,map=48",
            "bom:layers=15,near=0,map=48",
        ] {
            let of = |bits: u32| {
                let method = format!("{method},bits={bits}");
                let (report, sanity) = along_light_rays(&setup, &method, light);
                let bad = sanity.monotone_violations + sanity.non_finite + sanity.out_of_range;
                assert_eq!(bad, 0, "{place}, {method}: {sanity:?}");
                // A larger map, since textures have whole lines.
                let bytes = setup.shadow(&method.replace("map=48", "map=256"), light).report.bytes;
                (report.ray_err_max().unwrap(), bytes)
            };
            let [(coarse, bytes_8), (half, bytes_16), (single, bytes_32)] = [8, 16, 32].map(of);
            assert!(bytes_8 < bytes_16 && bytes_16 < bytes_32, "{bytes_8} {bytes_16} {bytes_32}");
            // Half a step of kappa / 255, and 2^-8 where kappa ends; half floats have 11 bits.
            assert!(
                (coarse - single).abs() < 0.5 * 5.56 / 255.0 + 1.0 / 256.0,
                "{method}: {coarse} {single}"
            );
            assert!((half - single).abs() < 1e-3, "{method}: {half} {single}");
        }
    }
}

/// Volume of leaves in a box: a fraction `share` of the voxels, chosen by a hash, is matter.
fn leaves(share: f64) -> Arc<Volume> {
    let hash = |i: usize, j: usize, k: usize| {
        let mut h = ((i * 73_856_093) ^ (j * 19_349_663) ^ (k * 83_492_791)) as u32;
        for _ in 0..3 {
            h = (h ^ h >> 15).wrapping_mul(0x2c1b_3c6d);
        }
        f64::from(h ^ h >> 16) / f64::from(u32::MAX)
    };
    let value = |(k, j, i)| if hash(i, j, k) < share { 1000 } else { 0 };
    Arc::new(volume_of(Voxels::I16(Array3::from_shape_fn((48, 48, 48), value)), DAffine3::IDENTITY))
}

/// Trend of appendix 11 of the thesis: more layers give a more linear split, denser leaves a more logarithmic one.
/// More layers make neighbouring layers more alike (table 5.2.3.1).
#[test]
fn the_chosen_ratio_follows_layers_and_density() {
    let choices = |volume: &Arc<Volume>, tf: &TransferFunction, what: &str, light: Light| {
        let setup = Setup::open(volume, tf)?;
        let row = [4, 8, 16, 32].map(|layers| {
            let map = setup.shadow(&format!("bom:layers={layers},split=auto,near=0,map=64"), light);
            map.report.split_choice.unwrap()
        });
        let (ratios, correlations) = (row.map(|c| c.ratio), row.map(|c| c.correlation));
        println!("{what}: layers 4, 8, 16, 32: ratio {ratios:.1?}, correlation {correlations:.3?}");
        assert!(ratios.windows(2).all(|w| w[1] <= w[0]) && ratios[3] < ratios[0], "{what}: {ratios:?}");
        assert!(correlations.windows(2).all(|w| w[1] > w[0]), "{what}: {correlations:?}");
        Some(ratios)
    };
    let tf = extinction(&[(-300.0, 0.0), (700.0, 0.1)]);
    let thorax = phantom("thorax:64");
    if choices(&thorax, &tf, "thorax", lights(&thorax)[0].1).is_none() {
        return;
    }
    for share in [0.02, 0.1] {
        let mean = |per_mm: f64| {
            let tf = extinction(&[(300.0, 0.0), (700.0, per_mm)]);
            let what = format!("leaves in {share} of the voxels, {per_mm} /mm");
            choices(&leaves(share), &tf, &what, ABOVE).unwrap().iter().sum::<f64>() / 4.0
        };
        let [thin, dense] = [0.1, 0.5].map(mean);
        assert!(dense > thin + 0.04, "{share}: {thin} {dense}");
    }
}

#[test]
fn a_ratio_for_every_region_suits_mixed_scenes() {
    // Bone is dense and its surroundings are thin: no single ratio is right for both.
    let tf = extinction(&[(-300.0, 0.0), (100.0, 0.01), (250.0, 0.02), (400.0, 0.8)]);
    let Some(setup) = Setup::open(&phantom("thorax:96"), &tf) else { return };
    let light = lights(setup.volume())[0].1;
    let field = setup.exact();
    let seen = field.visible_points(&setup.scene(64, 64), 4000, 3);
    let points: Vec<DVec3> = seen.iter().map(|p| p.position).collect();
    let exact: Vec<f64> = points.iter().map(|p| field.transmittance_to_light(*p, &light)).collect();
    let rms = |method: &str| {
        let values = setup.query(&setup.shadow(method, light), &points);
        let sum: f64 = values.iter().zip(&exact).map(|(t, e)| (f64::from(*t) - e).powi(2)).sum();
        (sum / exact.len() as f64).sqrt()
    };
    let texel = rms("bom:layers=7,split=texel,near=0,map=256");
    let others = ["linear", "log", "hybrid"].map(|s| rms(&format!("bom:layers=7,split={s},near=0,map=256")));
    println!("rms by region {texel:.4}; linear, log, hybrid {others:.4?}");
    assert!(others.iter().all(|o| texel < *o), "{texel} {others:?}");
}
