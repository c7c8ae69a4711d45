//! `compress=optimal` of `dsm`: the error bound holds, and the number of curve nodes is minimal.

use super::minimal_polyline::{Point, fewest};
use super::*;
use glam::DVec2;

fn nodes_in_all(setup: &Setup, method: &str, light: Light) -> u64 {
    setup.shadow(method, light).report.nodes_total.unwrap()
}

/// Exact curve of a texel's ray as a polyline, from the first extinction to the end; `None` for too little
/// extinction.
fn exact_polyline(field: &ExactField, map: &ShadowMap, texel: [u32; 2]) -> Option<Vec<Point>> {
    const POINTS: usize = 1500;
    let space = &map.light_space;
    let (origin, direction) = space.world_ray(DVec2::new(f64::from(texel[0]), f64::from(texel[1])));
    let start = space.ray_start();
    let curve = field.curve_along(origin + start * direction, direction, f64::INFINITY);
    if curve.total() < 1e-3 {
        return None;
    }
    let first = curve.depth_of_optical_depth(1e-9)?;
    let last = curve.depth_of_optical_depth((2048f64.ln()).min(curve.total() * (1.0 - 1e-9)))?;
    let even = (0..=POINTS).map(|i| first + (last - first) * i as f64 / POINTS as f64);
    let mut depths: Vec<f64> = even.chain(curve.jumps()).filter(|z| (first..=last).contains(z)).collect();
    depths.sort_by(f64::total_cmp);
    depths.dedup_by(|a, b| *a - *b < 1e-9);
    let mut points: Vec<Point> = depths.iter().map(|z| [*z, curve.transmittance_at(*z)]).collect();
    points[0][1] = 1.0;
    Some(points)
}

/// Number of curve nodes of some texels together: greedy, optimal, and the fewest in float64.
fn compared(setup: &Setup, epsilon: f64, map: u32, light: Light, stride: u32) -> [u64; 3] {
    let field = setup.exact();
    let [greedy, optimal] = ["greedy,segments=transmittance", "optimal"]
        .map(|compress| setup.shadow(&format!("dsm:epsilon={epsilon},compress={compress},map={map}"), light));
    let of = |map: &ShadowMap| setup.session.node_map(map).unwrap().unwrap().nodes;
    let (greedy_nodes, optimal_nodes) = (of(&greedy), of(&optimal));
    let mut sums = [0; 3];
    for row in (0..map).step_by(stride as usize) {
        for column in (0..map).step_by(stride as usize) {
            let place = [row as usize, column as usize];
            let Some(curve) = exact_polyline(&field, &optimal, [column, row]) else { continue };
            sums[0] += u64::from(greedy_nodes[place]);
            sums[1] += u64::from(optimal_nodes[place]);
            sums[2] += fewest(&curve, epsilon).len() as u64;
        }
    }
    let narrowed = optimal.report.texels_narrowed.unwrap();
    let hit = optimal.report.texels_hit.unwrap();
    println!("epsilon {epsilon}: nodes {sums:?}, narrowed {narrowed} of {hit} texels");
    sums
}

#[test]
fn fewer_nodes_than_greedy_on_every_phantom() {
    for name in ["slab:32", "sphere:32", "shell:32", "comb:32", "thorax:40"] {
        let volume = phantom(name);
        let range = if name.starts_with("thorax") { [-900.0, 1200.0] } else { [0.0, 1000.0] };
        for (n, tf) in transfer_functions(range).iter().enumerate() {
            let Some(setup) = Setup::open(&volume, tf) else { return };
            for (place, light) in lights(&volume) {
                for epsilon in ["0.005", "0.02", "0.06"] {
                    let [greedy, optimal] = ["greedy,segments=transmittance", "optimal"].map(|compress| {
                        let method = format!("dsm:epsilon={epsilon},compress={compress},map=64");
                        nodes_in_all(&setup, &method, light)
                    });
                    let what = format!("{name}, function {n}, {place}, epsilon {epsilon}");
                    assert!(optimal <= greedy, "{what}: {optimal} instead of {greedy}");
                }
            }
        }
    }
}

/// Constant extinction takes the minimal number of lines: each touches the ceiling once, and goes from floor to
/// floor.
#[test]
fn an_exponential_takes_the_lines_that_it_must() {
    const DEPTH: f64 = 4.0;
    // Where e^-v (1 + v) = 1 - gap, and where e^-u - 1 + u = gap.
    let root = |f: &dyn Fn(f64) -> f64| {
        let (mut low, mut high) = (0.0, 1e3);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if f(middle) < 0.0 { low = middle } else { high = middle }
        }
        low
    };
    let expected = |epsilon: f64| {
        let (mut x, mut nodes) = (0.0f64, 1);
        loop {
            let gap = 2.0 * epsilon * x.exp();
            if (-x).exp() <= (-DEPTH).exp() + 2.0 * epsilon {
                return nodes;
            }
            nodes += 1;
            if gap < 1.0 {
                x += root(&|v| 1.0 - gap - (-v).exp() * (1.0 + v));
            }
            let gap = 2.0 * epsilon * x.exp();
            x += root(&|u| (-u).exp() - 1.0 + u - gap);
            if x >= DEPTH {
                return nodes;
            }
        }
    };
    let volume = phantom("slab:32");
    let length = {
        let corners = volume.corners_mm();
        corners.iter().map(|c| c.z).fold(f64::MIN, f64::max)
            - corners.iter().map(|c| c.z).fold(f64::MAX, f64::min)
    };
    let Some(setup) = Setup::open(&volume, &extinction(&[(0.0, DEPTH / length)])) else { return };
    let light = Light::Directional { toward: DVec3::Z };
    let mut checked = 0;
    for epsilon in [0.003, 0.006, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06] {
        // The chords of the march have errors up to 0.0023: closer cases are not decided.
        let (most, least) = (expected((epsilon - 0.0024f64).max(1e-4)), expected(epsilon + 0.0024));
        if most != least {
            continue;
        }
        checked += 1;
        let map = setup.shadow(&format!("dsm:epsilon={epsilon},compress=optimal,map=32"), light);
        let greedy = setup.shadow(&format!("dsm:epsilon={epsilon},segments=transmittance,map=32"), light);
        let found = map.report.nodes_total.unwrap() as f64 / map.report.texels_hit.unwrap() as f64;
        assert_eq!(found, f64::from(most), "epsilon {epsilon}");
        assert!(map.report.nodes_total < greedy.report.nodes_total, "epsilon {epsilon}");
    }
    assert!(checked >= 3, "{checked}");
}

/// Four sheets, each of which halves the light within a 50th of a voxel, take a line each and one between two.
#[test]
fn sheets_take_two_nodes_each() {
    let volume = phantom("comb:16");
    let sheet_mm = 0.02 * volume.min_spacing_mm();
    let sheets = extinction(&[(990.0, 0.0), (990.0, 2f64.ln() / sheet_mm)]);
    let Some(setup) = Setup::open(&volume, &sheets) else { return };
    let light = Light::Directional { toward: DVec3::Z };
    for epsilon in [0.025, 0.03] {
        let map = setup.shadow(&format!("dsm:epsilon={epsilon},compress=optimal,map=32"), light);
        assert_eq!(map.report.nodes_total.unwrap(), 8 * map.report.texels_hit.unwrap(), "{epsilon}");
        assert_eq!(map.report.nodes_max, Some(8));
    }
}

/// Matter so thin that the whole curve stays within twice epsilon takes one node; a ray that meets nothing takes
/// none.
#[test]
fn thin_matter_takes_one_node() {
    let volume = phantom("slab:16");
    let Some(setup) = Setup::open(&volume, &extinction(&[(0.0, 1e-4)])) else { return };
    let map = setup.shadow("dsm:compress=optimal,map=32", Light::Directional { toward: DVec3::Z });
    assert_eq!(map.report.nodes_total, map.report.texels_hit);
    assert!(map.report.nodes_total > Some(0));
}

#[test]
fn near_the_fewest_of_all_on_real_rays() {
    for (name, points) in [
        ("CT_AVM", [(190.0, 0.0), (310.0, 0.3)]),
        ("engine", [(60.0, 0.0), (120.0, 0.6)]),
        ("CT_pitch", [(190.0, 0.0), (310.0, 0.3)]),
    ] {
        let Some(volume) = scan(name) else { return };
        let Some(setup) = Setup::open(&volume, &opacity(&points)) else { return };
        let light = Light::Directional { toward: DVec3::new(0.5, -0.5, std::f64::consts::FRAC_1_SQRT_2) };
        for epsilon in [0.005, 0.02, 0.06] {
            println!("{name}");
            let [greedy, optimal, fewest] = compared(&setup, epsilon, 256, light, 9);
            assert!(optimal < greedy && fewest > 400, "{name}, epsilon {epsilon}");
            let over = optimal as f64 / fewest as f64;
            assert!((0.97..1.04).contains(&over), "{name}, epsilon {epsilon}: {over} of the fewest");
        }
    }
}
