//! Shadow maps fitted to the camera's view: correct at visible points, and finer there.

use super::*;
use umbravox::measure::errors::VisiblePoints;
use umbravox::scene::Camera;

/// Lights at infinity, and two and a half times as far away as the volume's corners.
fn lights(volume: &Volume) -> [Light; 2] {
    let toward = DVec3::new(0.4, -0.5, 0.7);
    let middle =
        volume.world_from_index().transform_point3(0.5 * DVec3::from_array(volume.dims().map(|n| n as f64)));
    let distance = 2.5 * volume.corners_mm()[0].distance(middle);
    [Light::Directional { toward }, Light::Point { position: middle + distance * toward }]
}

/// Cameras that show the whole volume, a part of it from outside, and one in the middle of it.
fn cameras(volume: &Volume) -> [Camera; 3] {
    let whole = Camera::framing(volume, DVec3::Z, 40.0);
    let aside = whole.target + DVec3::new(6.0, -4.0, 5.0);
    [
        whole,
        Camera { fov_deg: 4.0, target: aside, ..whole },
        Camera { eye: whole.target + DVec3::new(1.0, 2.0, 0.5), target: aside, fov_deg: 60.0, ..whole },
    ]
}

#[test]
fn a_map_of_the_view_is_finer_than_one_of_the_volume() {
    let volume = phantom("thorax:96");
    let tf = opacity(&[(-200.0, 0.0), (400.0, 0.4)]);
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let field = ExactField::new(&volume, &tf);
    for light in lights(&volume) {
        for (i, camera) in cameras(&volume).into_iter().enumerate() {
            let scene = Scene {
                camera,
                lights: vec![light.into()],
                width: 96,
                height: 64,
                ..Scene::framing(&volume)
            };
            let seen = VisiblePoints::new(&field, &scene, 3000);
            assert!(!seen.is_empty());
            for method in
                ["dsm:epsilon=0.01", "osm:layers=64,kernel=3", "dom:layers=31", "bom:layers=31,march=samples"]
            {
                let measure = |rest: &str| {
                    let parsed = shadow::parse(&format!("{method},map=64{rest}")).unwrap();
                    let map = setup.session.shadow_of(parsed.as_ref(), &scene, scene.light()).unwrap();
                    let rms = seen.errors(&setup.session, std::slice::from_ref(&map)).unwrap().unwrap().rms;
                    (rms, map.light_space.texel_mm(), map.report.texels_built())
                };
                let ((view, fine, few), (whole, wide, many)) = (measure(""), measure(",fit=volume"));
                let what =
                    format!("{method} {light:?} {i}: {view} {whole}, {fine} {wide} mm, {few} {many} texels");
                assert!(fine <= wide * 1.001 && few <= many, "{what}");
                assert!(view < whole + 2e-3, "{what}");
                if i == 1 {
                    assert!(fine < 0.9 * wide && few < many, "{what}");
                    // Errors of layers along the ray stay; where errors are tiny, chance decides.
                    assert!(view < 0.7 * whole || !method.starts_with("dsm") || whole < 1e-3, "{what}");
                }
            }
        }
    }
}

#[test]
fn no_edge_of_the_map_shows_in_the_picture() {
    // A haze in which every visible point is lit alike except for its depth; points outside the map are not.
    let volume = phantom("slab:32");
    let tf = opacity(&[(0.0, 0.02), (2000.0, 0.02)]);
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    for light in lights(&volume) {
        for camera in cameras(&volume) {
            let scene = Scene {
                camera,
                lights: vec![light.into()],
                width: 64,
                height: 48,
                ambient: 0.0,
                ..Scene::framing(&volume)
            };
            for method in [
                "dsm:epsilon=0.002",
                "dsm:epsilon=0.002,filter=nearest",
                "osm:kernel=3,layers=64",
                "dom:layers=63",
            ] {
                let draw = |rest: &str| {
                    let parsed = shadow::parse(&format!("{method},{rest}")).unwrap();
                    setup.picture_of(
                        &setup.session.shadow_of(parsed.as_ref(), &scene, scene.light()).unwrap(),
                        &scene,
                    )
                };
                let off = largest_difference(&draw("map=64"), &draw("map=64,fit=volume"));
                assert!(off < 0.02, "{method} {light:?} {camera:?}: {off}");
            }
        }
    }
}

#[test]
fn maps_choose_texels_as_wide_as_voxels_and_finer_where_those_are_large() {
    let volume = phantom("thorax:96");
    let Some(setup) = Setup::open(&volume, &opacity(&[(-200.0, 0.0), (400.0, 0.4)])) else { return };
    let voxel = volume.min_spacing_mm();
    let method = shadow::parse("dsm").unwrap();
    for light in lights(&volume) {
        let [whole, part, _] = cameras(&volume);
        let space = |camera, height| {
            let scene = Scene {
                camera,
                lights: vec![light.into()],
                width: height,
                height,
                ..Scene::framing(&volume)
            };
            setup.session.shadow_of(method.as_ref(), &scene, scene.light()).unwrap().light_space
        };
        let texel = space(whole, 60).texel_mm();
        assert!((0.7..=1.0).contains(&(texel / voxel)), "{light:?}: {texel} mm, voxels {voxel} mm");
        // Zoomed in, the map has two pixels per texel, and texels of at least half a voxel.
        let near = space(part, 400);
        assert!((0.48..0.6).contains(&(near.texel_mm() / voxel)), "{light:?}: {}", near.texel_mm());
        let everywhere = setup.session.shadow(method.as_ref(), light).unwrap().light_space;
        assert!((0.7..=1.0).contains(&(everywhere.texel_mm() / voxel)), "{light:?}");
    }
}
