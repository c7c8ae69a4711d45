//! Enclosures of the exact transmittance (`enclose=on`): a lower and an upper bound at every point.

use super::*;
use crate::labels::{labelled, through};
use glam::Vec3Swizzles;
use umbravox::measure::enclosure_check::EnclosureTest;
use umbravox::measure::errors::{VisiblePointsByLight, texels_to_test};
use umbravox::measure::point_report::PointReport;
use umbravox::transfer::ClipPlane;

const ENCLOSED: [&str; 5] = [
    "dsm:map=24,near=0,enclose=on",
    "dsm:map=24,near=4,enclose=on",
    "dsm:map=7,near=2,enclose=on,epsilon=0.001",
    "dsm:map=64,near=4,enclose=on,segments=transmittance",
    "dsm:map=24,near=0,enclose=on,compress=optimal,epsilon=0.001",
];

fn tested(setup: &Setup, map: &ShadowMap, light: Light) -> PointReport {
    let field = setup.exact();
    let texels = texels_to_test(&field, light, &map.light_space, 24);
    let test = EnclosureTest { texels: &texels, points_a_texel: 320 };
    test.run(&field, light, &setup.session, map).unwrap()
}

/// Returns the mean width of an enclosure at the points that a camera sees.
fn width(setup: &Setup, spec: &str) -> f64 {
    let scene = Scene::framing(&setup.session.loaded.volume);
    let field = setup.exact();
    let visible = VisiblePointsByLight::new(&field, &scene, 2000);
    let map = setup.shadow(spec, scene.light());
    visible.enclosure_widths(&setup.session, &[map]).unwrap().expect("visible points").mean
}

fn assert_encloses(volume: &Arc<Volume>, tf: &TransferFunction, what: &str) {
    let Some(setup) = Setup::open(volume, tf) else { return };
    for (light_name, light) in lights(volume) {
        for spec in ENCLOSED {
            let report = tested(&setup, &setup.shadow(spec, light), light);
            assert!(report.points >= 300, "{what}, light {light_name}, {spec}: {report:?}");
            assert_eq!(report.satisfied(), Some(true), "{what}, light {light_name}, {spec}: {report:?}");
        }
    }
}

#[test]
fn enclosures_contain_the_exact_transmittance() {
    assert_encloses(&phantom("shell:24"), &opacity(&[(400.0, 0.0), (600.0, 0.5)]), "ramp");
    assert_encloses(&phantom("step:24"), &opacity(&[(499.0, 0.0), (500.0, 0.9)]), "jump");
    // A function with many intervals, whose peaks lie inside the ranges of values.
    let peaks: Vec<(f64, f64)> =
        (0..60).map(|i| (f64::from(i) * 17.0, if i % 2 == 0 { 0.0 } else { 0.3 })).collect();
    assert_encloses(&phantom("shell:24"), &opacity(&peaks), "peaks");
}

#[test]
fn enclosures_hold_behind_clip_planes_and_in_oblique_flat_voxels() {
    let tf = opacity(&[(300.0, 0.0), (600.0, 0.4)]);
    let volume = phantom("shell:24");
    let normal = DVec3::new(0.3, -0.5, 0.8).normalize();
    let middle = volume.corners_mm().iter().sum::<DVec3>() / 8.0;
    let cut = ClipPlane { normal, offset_mm: normal.dot(middle) };
    assert_encloses(&volume, &TransferFunction { clip: vec![cut], ..tf.clone() }, "clipped");
    let turned = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7)
        * DAffine3::from_scale(DVec3::new(0.7, 0.7, 5.0));
    let flat = volume_of(volume.resident().unwrap().clone(), turned);
    assert_encloses(&Arc::new(flat), &tf, "flat voxels");
}

/// An enclosure from 0 to 1 would always hold: widths fall with finer maps, and where a march precedes the map.
#[test]
fn enclosures_narrow_with_finer_maps_and_longer_marches() {
    let Some(setup) = Setup::open(&phantom("shell:48"), &opacity(&[(400.0, 0.0), (600.0, 0.1)])) else {
        return;
    };
    let of = |settings: &str| width(&setup, &format!("dsm:enclose=on,epsilon=0.002,{settings}"));
    let [coarse, fine, finer] = ["map=32,near=0", "map=64,near=0", "map=256,near=0"].map(of);
    assert!(fine < 0.75 * coarse && finer < 0.45 * fine && finer < 0.1, "{coarse}, {fine}, {finer}");
    let near = of("map=64,near=8");
    assert!(near < 0.6 * fine, "{near} of {fine}");
    // The compression widens each bound by less than epsilon and its fixed terms.
    let loose = width(&setup, "dsm:enclose=on,epsilon=0.1,map=256,near=0");
    assert!(loose > finer && loose < finer + 0.11, "{loose}, {finer}");
}

/// Curves of another light, or of the wrong side, are found out, at points that lie where the report says.
#[test]
fn a_wrong_enclosure_is_found() {
    let volume = phantom("shell:24");
    let Some(setup) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.5)])) else { return };
    let (_, light) = lights(&volume)[0];
    let spec = "dsm:map=24,near=0,enclose=on";
    let mut map = setup.shadow(spec, light);
    let mut enclosure = map.enclosure.take().expect("an enclosure");
    std::mem::swap(&mut enclosure.lower, &mut enclosure.upper);
    map.enclosure = Some(enclosure);
    let report = tested(&setup, &map, light);
    assert_eq!(report.satisfied(), Some(false), "{report:?}");
    let worst = report.worst.unwrap();
    let found = map.enclosure.as_ref().unwrap().query(&setup.session, &[worst.position_mm]).unwrap();
    assert_eq!(found[0].map(f64::from), worst.interval);
    // Thinner matter: its curves do not bound those of the tested one.
    let Some(thin) = Setup::open(&volume, &opacity(&[(400.0, 0.0), (600.0, 0.05)])) else { return };
    map.enclosure = thin.shadow(spec, light).enclosure;
    assert_eq!(tested(&setup, &map, light).satisfied(), Some(false));
}

#[test]
fn labels_and_methods_without_an_enclosure() {
    let volume = phantom("shell:24");
    let tf = opacity(&[(400.0, 0.0), (600.0, 0.5)]);
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let (_, light) = lights(&volume)[0];
    assert!(setup.shadow("dsm:map=24", light).enclosure.is_none());
    let rules = vec![through(&[7], &opacity(&[(0.0, 0.1)]))];
    let volume = labelled(&volume, |[i, ..]| if i < 9 { 7 } else { 0 });
    let Some(setup) = Setup::open(&volume, &TransferFunction { rules, ..tf }) else { return };
    let method = shadow::parse("dsm:map=24,enclose=on").unwrap();
    let refused = setup.session.shadow(method.as_ref(), light).err().expect("a refusal").to_string();
    assert!(refused.contains("enclose=on") && refused.contains("labels"), "{refused}");
}

/// Rounding moves points on the border of a small map, which has no empty texels around, to the outside: the lower bound
/// must not be that of an unlit border. Extinction reaches the border of the volume.
#[test]
fn lower_bounds_hold_on_the_border_of_small_maps() {
    for spacing in [1.3, 0.7, 0.37, 2.9] {
        let scaled = DAffine3::from_scale(DVec3::splat(spacing));
        let volume = Arc::new(volume_of(Array3::<u8>::from_elem((24, 24, 24), 100).into(), scaled));
        let Some(setup) = Setup::open(&volume, &extinction(&[(50.0, 0.5), (200.0, 0.5)])) else { return };
        let field = setup.exact();
        let [low, high] = [-0.5 * spacing, 23.5 * spacing];
        for toward in [DVec3::X, DVec3::Y, DVec3::Z] {
            let light = Light::Directional { toward };
            let map = setup.shadow("dsm:map=7,near=0,enclose=on", light);
            let across = toward.zxy();
            let points = (0..300).flat_map(|i| {
                let along = low + (high - low) * f64::from(i) / 299.0;
                [low, high].map(|side| toward.yzx() * side + across * along)
            });
            let points: Vec<DVec3> = points.collect();
            let found = map.enclosure.as_ref().unwrap().query(&setup.session, &points).unwrap();
            for (point, [lower, _]) in points.iter().zip(found) {
                let exact = field.transmittance_to_light(*point, &light);
                assert!(f64::from(lower) <= exact, "{spacing} mm, {toward}, {point}: {lower} above {exact}");
            }
        }
    }
}
