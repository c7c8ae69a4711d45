//! The error bound at points between the light rays of texels.

use super::*;
use umbravox::measure::errors::texels_to_test;
use umbravox::measure::point_bound::PointTest;
use umbravox::measure::point_report::PointReport;
use umbravox::shadow::{Bound, Taps};

/// Maps with a bound: every filter, with and without alignment and marches near the point.
const BOUNDED: [&str; 7] = [
    "dsm:map=24,near=0",
    "dsm:map=24,near=0,align=on",
    "dsm:map=24,near=4",
    "dsm:map=24,near=4,align=on,epsilon=0.005",
    "dsm:map=24,filter=nearest",
    "dsm:map=24,prefilter=5",
    "rays",
];

fn tested(setup: &Setup, map: &ShadowMap, light: Light, taps: Taps) -> PointReport {
    let field = setup.exact();
    let cells = texels_to_test(&field, light, &map.light_space, 60);
    let test = PointTest { cells: &cells, points_a_cell: 320, taps };
    test.run(&field, light, &setup.session, map).unwrap()
}

#[test]
fn bounds_hold_between_texels() {
    for (name, tf) in [
        ("shell:24", opacity(&[(400.0, 0.0), (600.0, 0.5)])),
        ("step:24", opacity(&[(499.0, 0.0), (500.0, 0.9)])),
    ] {
        let volume = phantom(name);
        let Some(setup) = Setup::open(&volume, &tf) else { return };
        for (light_name, light) in lights(&volume) {
            for spec in BOUNDED {
                let taps = Taps::Within(if spec.contains("prefilter") { 5 } else { 1 });
                let report = tested(&setup, &setup.shadow(spec, light), light, taps);
                assert!(report.points > 2000, "{name}, light {light_name}, {spec}: {report:?}");
                assert_eq!(report.satisfied(), Some(true), "{name}, light {light_name}, {spec}: {report:?}");
            }
        }
    }
}

/// Bounds that are smaller than the errors are found out, at points that lie where the report says.
#[test]
fn a_bound_that_is_too_small_is_found() {
    let volume = phantom("shell:24");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    let (_, light) = lights(&volume)[0];
    for spec in ["dsm:map=24,epsilon=0.1,near=0", "dsm:map=24,epsilon=0.1,near=4"] {
        let mut map = setup.shadow(spec, light);
        let bound = map.bound.unwrap();
        map.bound = Some(Bound { transmittance: 0.2 * bound.transmittance, ..bound });
        let report = tested(&setup, &map, light, Taps::Within(1));
        assert_eq!(report.satisfied(), Some(false), "{spec}: {report:?}");
        let worst = report.worst.unwrap();
        assert_eq!(setup.query(&map, &[worst.position_mm]), [worst.transmittance as f32], "{spec}");
        assert!(worst.amount < bound.transmittance, "{spec}: {worst:?}");
    }
}

/// Four texels differ from one: the bound of `filter=nearest` does not hold for a bilinear map.
#[test]
fn four_texels_are_not_within_the_bound_of_one() {
    let volume = phantom("sphere:24");
    let Some(setup) = Setup::open(&volume, &opacity(&[(499.0, 0.0), (500.0, 0.99)])) else { return };
    let (_, light) = lights(&volume)[0];
    for (texels_a_side, satisfied) in [(2, true), (1, false)] {
        let mut map = setup.shadow("dsm:map=24,near=0", light);
        map.bound = map.bound.map(|bound| Bound { texels_a_side, ..bound });
        assert_eq!(tested(&setup, &map, light, Taps::Within(1)).satisfied(), Some(satisfied));
    }
}

/// The light rays of the texels around a point lie within the stated distance of the point, also across the edges of
/// octahedral maps.
#[test]
fn texels_lie_within_the_stated_reach() {
    let volume = phantom("shell:24");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    for (name, light) in lights(&volume) {
        let map = setup.shadow("dsm:map=24", light);
        let space = &map.light_space;
        let reach_mm = map.bound.unwrap().reach_mm;
        let end = |texel: glam::DVec2| {
            let (start, ray) = space.world_ray(texel);
            start + space.z_range[1] * ray
        };
        let mut farthest = 0f64;
        for place in 0..24 * 24 {
            let base = [place % 24, place / 24];
            let at = |[c, r]: [u32; 2]| glam::DVec2::new(f64::from(c), f64::from(r));
            let ends = space.texels_around(base).map(|texel| end(at(texel)));
            for inside in [[0.02, 0.03], [0.49, 0.02], [0.4, 0.49]] {
                let point = end(at(base) + glam::DVec2::from_array(inside));
                farthest = ends.iter().map(|a| a.distance(point)).fold(farthest, f64::max);
            }
        }
        assert!(farthest <= reach_mm, "light {name}: {farthest} of {reach_mm} mm");
        assert!(farthest > 0.3 * reach_mm, "light {name}: {farthest} of {reach_mm} mm");
    }
}

/// Large maps keep their bound although texels are hardly wider than the rounding of their coordinates.
#[test]
fn large_maps_keep_their_bound() {
    let volume = phantom("shell:24");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    let (_, light) = lights(&volume)[0];
    let map = setup.shadow("dsm:map=4096", light);
    let report = tested(&setup, &map, light, Taps::Within(1));
    assert!(report.points > 2000 && report.satisfied() == Some(true), "{report:?}");
}
