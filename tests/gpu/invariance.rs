//! Invariances of pictures: skipping, repetition, rotation of the world, sizes.

use super::*;
use umbravox::scene::{Camera, Skip};

fn without_skipping(scene: &Scene) -> Scene {
    Scene { skip: Skip::None, ..scene.clone() }
}

/// Cameras in front of, inside, and close to the surface of a volume.
pub(super) fn cameras(volume: &Volume) -> [Camera; 3] {
    let outside = Scene::framing(volume).camera;
    let center = outside.target;
    let inside = Camera { eye: center + 0.11 * (outside.eye - center), fov_deg: 70.0, ..outside };
    // A view along a grid axis: rays parallel to faces.
    let [a, b] = [volume.corners_mm()[0], volume.corners_mm()[1]];
    let axis =
        Camera { eye: center + 2.0 * (b - a), up: DVec3::new(0.3, 0.1, 1.0), fov_deg: 45.0, ..outside };
    [outside, inside, axis]
}

fn skipping_changes_nothing(volume: &Arc<Volume>, tf: &TransferFunction, methods: &[&str], what: &str) {
    let Some(setup) = Setup::open(volume, tf) else { return };
    for method in methods {
        let map = setup.shadow(method, setup.scene(1, 1).light());
        for (n, camera) in cameras(volume).into_iter().enumerate() {
            let scene = Scene { camera, ..setup.scene(45, 29) };
            let [skipping, plain] = [&scene, &without_skipping(&scene)].map(|s| setup.picture_of(&map, s));
            let off = largest_difference(&skipping, &plain);
            assert!(off <= tolerance::SKIPPING, "{what}, {method}, camera {n}: {off}");
        }
    }
}

#[test]
fn skipping_phantoms() {
    for name in ["slab:33", "shell:40", "step:31", "comb:32"] {
        for (n, tf) in transfer_functions([0.0, 1000.0]).iter().enumerate() {
            skipping_changes_nothing(
                &phantom(name),
                tf,
                &["none", "dsm:map=64", "rays:march=samples"],
                &format!("{name}, function {n}"),
            );
        }
    }
    for (n, tf) in transfer_functions([-900.0, 1200.0]).iter().enumerate() {
        skipping_changes_nothing(
            &phantom("thorax:90"),
            tf,
            &["none", "dsm:map=64"],
            &format!("thorax, function {n}"),
        );
    }
}

#[test]
fn skipping_scans() {
    for (name, range) in [("CT_AVM", [0.0, 900.0]), ("CT_pitch", [-500.0, 1100.0]), ("engine", [60.0, 250.0])]
    {
        let Some(volume) = scan(name) else { continue };
        for (n, tf) in transfer_functions(range).iter().enumerate() {
            skipping_changes_nothing(&volume, tf, &["none", "dsm:map=128"], &format!("{name}, function {n}"));
        }
    }
}

#[test]
fn rendering_is_deterministic() {
    let [_, jumps, peaks] = transfer_functions([-900.0, 1200.0]);
    for tf in [jumps, peaks] {
        let Some(setup) = Setup::open(&phantom("thorax:64"), &tf) else { return };
        let scene = setup.scene(50, 34);
        // A first build learns how large its pool has to be.
        let [_, first, second] = [(); 3].map(|()| {
            let map = setup.shadow("dsm:epsilon=0.01,map=100", scene.light());
            let report = map.report;
            (
                setup.picture_of(&map, &scene),
                report.nodes_total,
                report.nodes_max,
                report.texels_hit,
                report.bytes,
            )
        });
        assert_eq!(first.0, second.0);
        assert_eq!((first.1, first.2, first.3, first.4), (second.1, second.2, second.3, second.4));
        assert!(first.1.unwrap() > first.3.unwrap(), "{:?} nodes in {:?} texels", first.1, first.3);
    }
}

/// World, camera and light rotated together by 90 degrees about z give the same picture, by another voxel order and
/// by another affine.
#[test]
fn turned_by_a_quarter() {
    let volume = phantom("thorax:48");
    let Voxels::I16(array) = volume.resident().unwrap() else { panic!("the chest is int16") };
    let turn = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
    let other_affine =
        Arc::new(volume_of(volume.resident().unwrap().clone(), turn * volume.world_from_index()));
    // x' = -y, y' = x: index (i, j) goes to (ny - 1 - j, i).
    let (nz, ny, nx) = array.dim();
    let stored = Array3::from_shape_fn((nz, nx, ny), |(k, j, i)| array[[k, ny - 1 - i, j]]);
    let from_old = DAffine3::from_cols(-DVec3::Y, DVec3::X, DVec3::Z, DVec3::new(0.0, ny as f64 - 1.0, 0.0));
    let restored = Arc::new(volume_of(Voxels::I16(stored), turn * volume.world_from_index() * from_old));
    let [ramp, _, _] = transfer_functions([-900.0, 1200.0]);
    let Some(setup) = Setup::open(&volume, &ramp) else { return };
    let scene = setup.scene(40, 30);
    let turned = Scene {
        camera: Camera {
            eye: turn.transform_point3(scene.camera.eye),
            target: turn.transform_point3(scene.camera.target),
            ..scene.camera
        },
        ..scene.clone()
    };
    for (_, light) in lights(&volume) {
        let turned_light = match light {
            Light::Directional { toward } => Light::Directional { toward: turn.transform_vector3(toward) },
            Light::Point { position } => Light::Point { position: turn.transform_point3(position) },
        };
        let allowed = if setup.weighs_finely() { tolerance::TURNED } else { tolerance::TURNED_IN_8_BITS };
        for method in ["rays", "none"] {
            let before = setup.picture(method, &Scene { lights: vec![light.into()], ..scene.clone() });
            for volume in [&other_affine, &restored] {
                let Some(after) = Setup::open(volume, &ramp) else { return };
                let after =
                    after.picture(method, &Scene { lights: vec![turned_light.into()], ..turned.clone() });
                let off = largest_difference(&before, &after);
                assert!(off <= allowed, "{method}, {light:?}: {off}");
            }
        }
        // After the rotation the map's texels lie elsewhere: results are similar, not equal.
        let before = setup
            .picture("dsm:epsilon=0.005,map=256", &Scene { lights: vec![light.into()], ..scene.clone() });
        let Some(after) = Setup::open(&restored, &ramp) else { return };
        let after = after.picture(
            "dsm:epsilon=0.005,map=256",
            &Scene { lights: vec![turned_light.into()], ..turned.clone() },
        );
        let rms = rms_difference(&before, &after);
        assert!(rms <= tolerance::DSM_PICTURE_RMS, "dsm, {light:?}: {rms}");
    }
}

/// Pictures of odd sizes, and of a single pixel, have the same pixels as the exact picture.
#[test]
fn picture_sizes() {
    let [ramp, ..] = transfer_functions([0.0, 1000.0]);
    let Some(setup) = Setup::open(&phantom("sphere:32"), &ramp) else { return };
    let map = setup.shadow("dsm:map=64", setup.scene(1, 1).light());
    for (width, height) in [(1, 1), (1, 9), (17, 1), (7, 5), (65, 33)] {
        let scene = setup.scene(width, height);
        let picture = setup.picture_of(&map, &scene);
        assert_eq!(picture.dim(), (height as usize, width as usize, 4));
        let corner = setup.exact();
        for (row, column) in [(0, 0), (height / 2, width / 2), (height - 1, width - 1)] {
            let direction = scene.camera.ray_direction(f64::from(column), f64::from(row), width, height);
            let seen = -(-corner.curve_along(scene.camera.eye, direction, f64::INFINITY).total()).exp_m1();
            let got = f64::from(picture[[row as usize, column as usize, 3]]);
            assert!((got - seen).abs() < 0.01, "{width}x{height} at {column},{row}: {got} {seen}");
        }
    }
}

/// Shadow maps of one texel, one tile, a tile and one texel, and no multiple of a tile.
#[test]
fn map_sizes() {
    let [ramp, jumps, _] = transfer_functions([-900.0, 1200.0]);
    for tf in [ramp, jumps] {
        let Some(setup) = Setup::open(&phantom("thorax:48"), &tf) else { return };
        let mut last = f64::INFINITY;
        let yardstick = setup.picture("rays", &setup.scene(40, 30));
        for size in [1, 16, 17, 100] {
            for filter in ["nearest", "bilinear"] {
                for (place, light) in lights(setup.volume()) {
                    let method = format!("dsm:map={size},filter={filter}");
                    let picture =
                        setup.picture(&method, &Scene { lights: vec![light.into()], ..setup.scene(20, 14) });
                    let sane = picture.iter().all(|v| (0.0..=1.0 + tolerance::RANGE as f32).contains(v));
                    assert!(sane, "{method}, {place}");
                }
            }
            let rms =
                rms_difference(&yardstick, &setup.picture(&format!("dsm:map={size}"), &setup.scene(40, 30)));
            assert!(rms < last, "a finer map is closer: {rms} at {size}, {last} before");
            last = rms;
        }
        assert!(last < 2.0 * tolerance::DSM_PICTURE_RMS, "{last}");
    }
}

#[test]
fn ambient_light_alone_needs_no_shadows() {
    let [_, jumps, _] = transfer_functions([-900.0, 1200.0]);
    let Some(setup) = Setup::open(&phantom("thorax:48"), &jumps) else { return };
    let scene = Scene { ambient: 1.0, ..setup.scene(40, 30) };
    let none = setup.picture("none", &scene);
    for method in ["rays", "dsm:map=64"] {
        assert_eq!(setup.picture(method, &scene), none, "{method}");
    }
    let lit = Scene { ambient: 0.0, ..scene };
    assert!(largest_difference(&setup.picture("rays", &lit), &setup.picture("none", &lit)) > 0.1);
}
