//! Strands rasterised directly into shadow maps (`from=lines`): known results for every method with a map, and
//! invalid uses.

use super::*;
use glam::DVec2;
use umbravox::files::loading::Loading;
use umbravox::strands::{
    Attribute, Kernel, StrandArrays, StrandSet, StrandVolume, Strands, VoxelisedStrands,
};

/// Every shadow method with a map, as fine as possible, with its allowed error behind all strands.
const METHODS: [(&str, f32); 10] = [
    ("dsm:epsilon=0.001", 0.002),
    ("osm:layers=256", 1e-3),
    ("dom:bits=32", 1e-3),
    ("bom:bits=32", 1e-3),
    ("clusters", 1e-3),
    ("fourier:terms=15,range=texel,bits=32", 0.01),
    ("wavelet:rank=5,range=texel,bits=32", 1e-3),
    ("avsm:nodes=16", 2e-3),
    ("moments", 0.01),
    ("beer", 1e-3),
];

/// Straight strands between pairs of points, of one diameter (mm) and transparency.
fn straight(ends: &[[DVec3; 2]], diameter: f32, transparency: f32) -> Strands {
    let points = ends.iter().flatten().map(|p| p.to_array().map(|x| x as f32)).collect();
    let arrays = StrandArrays {
        strands: ends.len() as u32,
        segments: Attribute::constant(1),
        points,
        thickness_mm: Attribute::constant(diameter),
        transparency: Attribute::constant(transparency),
        color: Attribute::constant([1.0; 3]),
        info: [0; 88],
    };
    Strands::new("test", arrays).unwrap()
}

/// Opens strands with a volume of `resolution` voxels a side, whose values are extinction.
fn open(strands: Strands, resolution: usize) -> Option<Setup> {
    let StrandVolume { volume, grid, kernel, .. } =
        StrandVolume::of(&strands, resolution, Kernel::Box, &Loading::default()).unwrap();
    let largest = volume.value_range()[1];
    let mut setup = Setup::open(&Arc::new(volume), &extinction(&[(0.0, 0.0), (largest, largest)]))?;
    setup.session = setup.session.with_strands(Some(Arc::new(VoxelisedStrands::new(strands, grid, kernel))));
    Some(setup)
}

fn with(method: &str, more: &str) -> String {
    format!("{method}{}{more}", if method.contains(':') { ',' } else { ':' })
}

/// Points on rays through texel centres near a world point, `depth_mm` farther from the light.
fn behind(map: &ShadowMap, at: DVec3, depth_mm: f64, texels: i32) -> Vec<(DVec2, DVec3)> {
    let (texel, depth) = map.light_space.light_point(at);
    let point = |x: i32, y: i32| {
        let texel = texel.round() + DVec2::new(f64::from(x), f64::from(y));
        let (start, way) = map.light_space.world_ray(texel);
        (texel, start + (depth + depth_mm) * way)
    };
    (-texels..=texels).flat_map(|y| (-texels..=texels).map(move |x| point(x, y))).collect()
}

/// A thin strand across the light absorbs the fraction `opacity d / w` in the texels that it passes, `w` being their
/// width, and nothing in others. A second strand absorbs the same again.
#[test]
fn thin_strands_take_their_share_of_a_texel() {
    let (diameter, transparency) = (0.05, 0.25);
    let x = DVec3::X * 10.0;
    // Two strands above each other, and two far aside, so that texels are square.
    let at = [DVec3::new(0.0, 0.06, 0.0), DVec3::new(0.0, 0.06, 4.0), DVec3::Y * 10.0, DVec3::Y * -10.0];
    let strands = straight(&at.map(|p| [p - x, p + x]), diameter, transparency);
    let Some(setup) = open(strands, 40) else { return };
    let light = Light::Directional { toward: DVec3::NEG_Z };
    for (method, tolerance) in METHODS {
        let map = setup.shadow(&with(method, "from=lines,map=96,filter=nearest"), light);
        assert_eq!(map.bound, None, "{method}");
        let place = |world: DVec3| map.light_space.light_point(world).0;
        // Texels per mm along the strand and across it; the strand runs along one axis of the map.
        let (along, across) =
            (place(at[0] + DVec3::X) - place(at[0]), place(at[0] + DVec3::Y) - place(at[0]));
        assert!((along.length() - across.length()).abs() < 0.02 * across.length(), "{along} {across}");
        assert!(across.abs().min_element() < 1e-6, "{across}");
        let taken = f64::from(diameter) * across.length();
        assert!(taken < 0.3, "{taken}");
        let one = 1.0 - (1.0 - transparency) * taken as f32;
        // Light goes up: the second strand is behind the first.
        for (depth_mm, passed) in [(-1.0, 0), (2.0, 1), (6.0, 2)] {
            let points = behind(&map, at[0], depth_mm, 3);
            let found = setup.query(&map, &points.iter().map(|(_, p)| *p).collect::<Vec<_>>());
            for ((texel, _), found) in points.iter().zip(found) {
                let is_below = (*texel - place(at[0])).dot(across.normalize()).abs() < 0.5;
                let expected = if is_below { one.powi(passed) } else { 1.0 };
                // Layers may hold both; behind everything they do not.
                if passed == 1 && (method.starts_with("dom") || method.starts_with("bom")) {
                    continue;
                }
                let tolerance = if passed == 1 { tolerance.max(0.05) } else { tolerance };
                assert!(
                    (found - expected).abs() < tolerance,
                    "{method} behind {passed} at {texel}: {found} {expected}"
                );
            }
        }
    }
}

/// A strand wider than texels transmits its transparency, under every kind of light and at every angle.
#[test]
fn wide_strands_let_their_transparency_through() {
    for tilt in [0.0_f64, 0.8, 1.3] {
        let x = 10.0 * DVec3::new(tilt.cos(), 0.0, tilt.sin());
        let Some(setup) = open(straight(&[[-x, x]], 3.0, 0.4), 5) else { return };
        for (light, texels) in [
            (Light::Directional { toward: DVec3::new(0.0, 0.3, 1.0) }, 128),
            (Light::Point { position: DVec3::new(3.0, 2.0, 60.0) }, 128),
            (Light::Point { position: DVec3::new(0.5, 4.0, 1.0) }, 256),
        ] {
            for (method, tolerance) in METHODS {
                let map = setup.shadow(&with(method, &format!("from=lines,map={texels}")), light);
                let toward = light.from_point(DVec3::ZERO).0;
                // Far enough behind a strand that runs along with the light.
                let points = [-0.2, 0.0, 0.2].map(|s| x * s - toward * 14.0);
                for found in setup.query(&map, &points) {
                    assert!(
                        (found - 0.4).abs() < tolerance.max(0.02),
                        "{method}, {:?}, {tilt}: {found}",
                        map.light_space.projection
                    );
                }
                let before = setup.query(&map, &[toward * 3.0 + DVec3::Y * 2.0])[0];
                assert!((before - 1.0).abs() < 1e-3, "{method}: {before}");
            }
        }
    }
}

/// The number of segments does not matter: a straight strand of many segments equals one of a single segment.
#[test]
fn joints_within_a_texel_cast_no_shadow_of_their_own() {
    let x = DVec3::X * 10.0;
    let mut arrays = straight(&[[-x, x]], 0.1, 0.0).arrays().clone();
    arrays.segments = Attribute::constant(400);
    arrays.points = (0..=400).map(|i| [-10.0 + 0.05 * i as f32, 0.0, 0.0]).collect();
    for light in [
        Light::Directional { toward: DVec3::new(0.1, 0.2, 1.0) },
        Light::Directional { toward: DVec3::new(1.0, 0.0, 0.2) },
        Light::Point { position: DVec3::new(9.0, 0.3, 0.5) },
    ] {
        let mut found = Vec::new();
        for strands in [straight(&[[-x, x]], 0.1, 0.0), Strands::new("test", arrays.clone()).unwrap()] {
            let Some(setup) = open(strands, 40) else { return };
            let map = setup.shadow("dsm:epsilon=0,map=64,from=lines,filter=nearest", light);
            let points: Vec<_> = behind(&map, DVec3::ZERO, 3.0, 4).into_iter().map(|(_, p)| p).collect();
            found.push(setup.query(&map, &points));
        }
        assert!(found[0].iter().any(|t| *t < 0.95), "nothing is shaded: {:?}", found[0]);
        for (one, many) in found[0].iter().zip(&found[1]) {
            // Along a ray that all but runs with the strand, depths are known to the width of a texel.
            assert!((one - many).abs() < 0.05, "{light:?}: {one} {many}");
        }
    }
}

/// Curls have the same mass in a map as in voxels; `tests/gpu/compare/strands.rs` compares them with cylinders.
#[test]
fn curls_hold_the_same_matter_drawn_into_a_map() {
    let strands = StrandSet::Curly.build(20_000).unwrap();
    let Some(setup) = open(strands, 48) else { return };
    let light = Light::Directional { toward: DVec3::new(0.5, 0.6, 0.6) };
    let exact = setup.exact();
    let mut points = Vec::new();
    let all = &setup.session.loaded.strands.as_ref().unwrap().strands;
    for i in (0..all.segment_count()).step_by(101) {
        points.push(all.segment(i).ends[0]);
    }
    let field: Vec<f64> = points.iter().map(|p| exact.transmittance_to_light(*p, &light)).collect();
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / points.len() as f64;
    let of_field = mean(&mut field.iter().copied());
    for method in ["dsm:epsilon=0.005", "avsm:nodes=16", "bom"] {
        let map = setup.shadow(&with(method, "from=lines"), light);
        let drawn = setup.query(&map, &points);
        let of_lines = mean(&mut drawn.iter().map(|t| f64::from(*t)));
        // The same matter: means differ by what foreshortening and overlap do.
        assert!((of_lines - of_field).abs() < 0.15, "{method}: {of_lines} {of_field}");
        let apart = mean(&mut drawn.iter().zip(&field).map(|(a, b)| (f64::from(*a) - b).abs()));
        assert!(apart > 1e-3 && apart < 0.25, "{method}: {apart}");
    }
}

#[test]
fn volumes_without_strands_are_refused() {
    let Some(setup) = Setup::open(&phantom("slab:16"), &extinction(&[(0.0, 0.0), (1000.0, 0.1)])) else {
        return;
    };
    let refused = |setup: &Setup, method: &str| {
        let method = shadow::parse(method).unwrap();
        setup.session.shadow(method.as_ref(), Light::default()).err().expect("it is refused")
    };
    for (method, _) in METHODS {
        let error = refused(&setup, &with(method, "from=lines"));
        assert!(error.to_string().contains("was not made from strands"), "{error}");
        assert_eq!(error.exit_status(), 2);
    }
    let strands = straight(&[[-DVec3::X, DVec3::X]], 0.1, 0.0);
    let Some(mut edited) = open(strands, 16) else { return };
    edited.session.transfer = edited.session.fresh_transfer(&extinction(&[(0.0, 0.0), (1.0, 7.0)])).unwrap();
    let error = refused(&edited, "dsm:from=lines");
    assert!(error.to_string().contains("as it is") && error.exit_status() == 2, "{error}");
    let Some(wide) = open(straight(&[[-DVec3::X, DVec3::X]], 0.5, 0.0), 16) else { return };
    let error = refused(&wide, "dsm:from=lines");
    assert!(error.to_string().contains("wide") && error.exit_status() == 2, "{error}");
}

/// A strand point at the position of the light, and a repeated point, are skipped.
#[test]
fn points_at_the_light_are_passed_over() {
    let ends = [[DVec3::ZERO, DVec3::ZERO], [DVec3::ZERO, DVec3::X], [-DVec3::X, DVec3::X]];
    let Some(setup) = open(straight(&ends, 0.1, 0.0), 16) else { return };
    for (method, _) in METHODS {
        let map = setup.shadow(&with(method, "from=lines,map=64"), Light::Point { position: DVec3::ZERO });
        let found = setup.query(&map, &[DVec3::new(0.1, 0.3, 0.2)])[0];
        assert!((0.0..=1.001).contains(&found), "{method}: {found}");
    }
}
