//! Curve nodes counted texel by texel equal those that the build counted.

use super::*;
use umbravox::shadow::{NodeMap, TILE};

fn nodes_of(setup: &Setup, map: &ShadowMap) -> Option<NodeMap> {
    setup.session.node_map(map).unwrap()
}

#[test]
fn counts_add_up_to_the_builds_own() {
    let tf = extinction(&[(300.0, 0.0), (500.0, 0.04), (700.0, 0.0), (1000.0, 0.0)]);
    let Some(setup) = Setup::open(&phantom("comb:48"), &tf) else { return };
    // Many curve nodes need chains of rows. Workgroups are whole tiles, also where the map ends within one.
    for method in [
        "dsm:map=64",
        "dsm:epsilon=0.0005,map=64",
        "dsm:map=48,prefilter=5",
        "dsm:map=16",
        "dsm:map=70",
        "dsm:map=17",
        "dsm:map=1",
    ] {
        for (name, light) in lights(setup.volume()) {
            let map = setup.shadow(method, light);
            let found = nodes_of(&setup, &map).unwrap();
            let (report, side) = (&map.report, map.light_space.map_size as usize);
            assert_eq!(found.nodes.dim(), (side, side));
            let total: u64 = found.nodes.iter().map(|&n| u64::from(n)).sum();
            assert_eq!(Some(total), report.nodes_total, "{method}, {name}");
            assert!(side < 16 || total > 0, "{method}, {name}");
            let histogram = found.histogram();
            assert_eq!(Some(histogram.len() as u64 - 1), report.nodes_max, "{method}, {name}");
            assert_eq!(Some((side * side) as u64 - histogram[0]), report.texels_hit, "{method}, {name}");
            let left_out = found.stored.iter().filter(|s| !**s).count();
            assert_eq!(left_out as u32, report.tiles_left_out, "{method}, {name}");
        }
    }
}

#[test]
fn nodes_lie_where_the_matter_is() {
    let Some(setup) = Setup::open(&phantom("sphere:48"), &extinction(&[(300.0, 0.0), (900.0, 0.3)])) else {
        return;
    };
    let map = setup.shadow("dsm:map=64", lights(setup.volume())[0].1);
    let found = nodes_of(&setup, &map).unwrap();
    let center = setup.volume().center_mm();
    let (texel, _) = map.light_space.light_point(center);
    let at = |x: f64, y: f64| found.nodes[[y.round() as usize, x.round() as usize]];
    assert!(at(texel.x, texel.y) >= 2, "the sphere's middle");
    assert_eq!(at(0.0, 0.0), 0, "the map's corner");
    assert_eq!(found.stored.dim(), ((64 / TILE) as usize, (64 / TILE) as usize));
}

#[test]
fn methods_without_nodes_report_none() {
    let Some(setup) = Setup::open(&phantom("slab:16"), &extinction(&[(0.0, 0.1)])) else { return };
    let light = lights(setup.volume())[0].1;
    for method in ["none", "rays", "osm:map=32,layers=4", "dom:map=32"] {
        assert_eq!(nodes_of(&setup, &setup.shadow(method, light)), None, "{method}");
    }
}

/// In an even medium, optical depth is a line and transmittance is not.
#[test]
fn even_media_need_fewer_nodes_of_optical_depth() {
    let Some(setup) = Setup::open(&phantom("slab:24"), &extinction(&[(0.0, 0.0), (500.0, 0.05)])) else {
        return;
    };
    for (name, light) in lights(setup.volume()) {
        let count = |segments: &str| {
            let map = setup.shadow(&format!("dsm:epsilon=0.005,map=32,segments={segments}"), light);
            map.report.nodes_total.unwrap()
        };
        let (depth, transmittance) = (count("optical_depth"), count("transmittance"));
        assert!(depth > 0 && 2 * depth < transmittance, "{name}: {depth} of {transmittance}");
    }
}
