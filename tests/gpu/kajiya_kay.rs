//! Strands shaded by their directions: closed forms for one direction, the exact picture for many.

use super::*;
use umbravox::files::loading::Loading;
use umbravox::open::presets;
use umbravox::scene::{LightSource, Shading, Skip};
use umbravox::strands::{
    Attribute, Kernel, StrandArrays, StrandSet, StrandVolume, Strands, VoxelisedStrands,
};

/// Opens strands on the shared device with their default transfer function.
fn open(strands: &Strands, resolution: usize, kernel: Kernel) -> Option<Setup> {
    let StrandVolume { volume, grid, .. } =
        StrandVolume::of(strands, resolution, kernel, &Loading::default()).unwrap();
    let tf = presets::resolve("hair", &volume).unwrap().tf;
    let Setup { session, tf } = Setup::open(&Arc::new(volume), &tf)?;
    let voxelised = VoxelisedStrands::new(strands.clone(), grid, kernel);
    Some(Setup { session: session.with_strands(Some(Arc::new(voxelised))), tf })
}

/// Exact field with the strand directions.
fn exact(setup: &Setup) -> ExactField<'_> {
    let strands = setup.session.loaded.strands.as_ref().unwrap();
    setup.exact().with_directions(Some(strands.directions().unwrap()))
}

/// Bundle of straight strands along the unit vector `u`, 40 mm long.
fn straight(u: DVec3) -> Strands {
    let (v, w) = u.any_orthonormal_pair();
    let places = (-9..=9).flat_map(|i| (-9..=9).map(move |j| f64::from(i) * v + f64::from(j) * w));
    let ends = |p: DVec3| [p - 20.0 * u, p + 20.0 * u].map(|p| p.as_vec3().to_array());
    let points: Vec<_> = places.flat_map(ends).collect();
    let arrays = StrandArrays {
        strands: points.len() as u32 / 2,
        segments: Attribute::constant(1),
        points,
        thickness_mm: Attribute::constant(0.3),
        transparency: Attribute::constant(0.0),
        color: Attribute::constant([1.0; 3]),
        info: [0; 88],
    };
    Strands::new("test", arrays).unwrap()
}

/// Unit vector at an angle from `u`, rotated about it by `around`.
fn at(u: DVec3, angle: f64, around: f64) -> DVec3 {
    let (v, w) = u.any_orthonormal_pair();
    angle.cos() * u + angle.sin() * (around.cos() * v + around.sin() * w)
}

/// Kajiya-Kay factor from the angles of light and eye with the strand: the highlight is where they add up to 180
/// degrees.
fn by_angles(from_light: f64, from_eye: f64) -> f64 {
    from_light.sin() + 0.3 * (from_light + from_eye - std::f64::consts::PI).cos().max(0.0).powi(32)
}

#[test]
fn straight_strands_have_the_factor_of_two_angles() {
    // Half floats of an oblique direction have errors of 2^-12 of its squares, which matter most for a sine near 0.
    for (u, allowed) in [(DVec3::X, 2e-3), (DVec3::new(0.48, -0.6, 0.64), 4e-3)] {
        let Some(setup) = open(&straight(u), 40, Kernel::Box) else { return };
        let allowed = if setup.weighs_finely() { allowed } else { 2.0 * allowed };
        for (place, from_light) in [(0.4, 0.5), (1.3, 1.1), (2.2, 1.6), (3.0, 2.1), (4.9, 2.7)] {
            // Where a ray meets the strands, the middle of a step may lie before them, where the factor is 1.
            let mut base = Scene { ambient: 0.0, background: [0.0; 3], step: 0.1, ..setup.scene(13, 9) };
            let from_eye = 0.9;
            let away = 60.0 * at(u, from_eye, 0.2);
            base.camera.eye = base.camera.target + away;
            base.lights = vec![Light::Directional { toward: at(u, from_light, place) }.into()];
            let picture = |shading| setup.picture("none", &Scene { shading, ..base.clone() });
            let [plain, shaded] = [Shading::None, Shading::KajiyaKay].map(picture);
            let (mut seen, mut worst) = (0, 0.0_f64);
            for ((row, column, channel), plain) in plain.indexed_iter().filter(|(_, plain)| **plain > 0.05) {
                let e = -base.camera.ray_direction(column as f64, row as f64, base.width, base.height);
                let wanted = if channel == 3 { 1.0 } else { by_angles(from_light, e.dot(u).acos()) };
                let got = f64::from(shaded[[row, column, channel]] / plain);
                worst = worst.max((got - wanted).abs());
                seen += usize::from(channel == 0);
            }
            println!("{u}, {from_light}: {seen} pixels, off by {worst:.1e}");
            assert!(worst < allowed && seen > 20, "{u}, {from_light}: {worst}");
        }
    }
}

#[test]
fn the_highlight_is_on_the_cone_of_mirror_directions() {
    let u = DVec3::new(0.48, -0.6, 0.64);
    let Some(setup) = open(&straight(u), 40, Kernel::Tent) else { return };
    let mut base = Scene { ambient: 0.0, background: [0.0; 3], ..setup.scene(15, 15) };
    let from_eye = 0.8;
    base.camera.eye = base.camera.target + 150.0 * at(u, from_eye, 0.2);
    let middle = |from_light: f64, around: f64, shading| {
        let light = Light::Directional { toward: at(u, from_light, around) };
        setup.picture("none", &Scene { lights: vec![light.into()], shading, ..base.clone() })[[7, 7, 0]]
    };
    let factor = |from_light: f64, around: f64| {
        f64::from(middle(from_light, around, Shading::KajiyaKay) / middle(from_light, around, Shading::None))
    };
    // The same sine of the light on both sides.
    let mirror = std::f64::consts::PI - from_eye;
    for around in [0.2, 1.9, 4.0] {
        let (there, here) = (factor(mirror, around), factor(from_eye, around));
        assert!((there - here - 0.3).abs() < 5e-3, "{around}: {there}, {here}");
    }
}

#[test]
fn curls_are_shaded_as_exactly_as_without_shading() {
    for kernel in [Kernel::Box, Kernel::Tent] {
        let Some(setup) = open(&StrandSet::Curly.build(20_000).unwrap(), 48, kernel) else { return };
        let field = exact(&setup);
        for (place, light) in [lights(setup.volume())[0], lights(setup.volume())[2]] {
            let scene = Scene { lights: vec![light.into()], ..setup.scene(36, 28) };
            let plain = field.picture(&scene);
            let scene = Scene { shading: Shading::KajiyaKay, ..scene };
            let picture = field.picture(&scene);
            assert!(largest_difference(&plain, &picture) > 0.02, "{place}: the shading shows");
            for (method, most) in [
                ("rays", tolerance::RAYS_PICTURE_RMS),
                ("dsm:epsilon=0.005,map=256", tolerance::DSM_PICTURE_RMS),
            ] {
                let rms = rms_difference(&setup.picture(method, &scene), &picture);
                println!("{kernel:?}, {place}, {method}: rms {rms:.5}");
                assert!(rms < most, "{kernel:?}, {place}, {method}: {rms}");
            }
        }
    }
}

#[test]
fn lights_add_up_and_skipping_changes_nothing() {
    let Some(setup) = open(&StrandSet::Clustered.build(5000).unwrap(), 40, Kernel::Box) else { return };
    let source = |light, intensity| LightSource { intensity, ..LightSource::from(light) };
    let lights = lights(setup.volume()).map(|(_, light)| light);
    let two = vec![source(lights[0], 0.7), source(lights[1], 0.4)];
    let scene = Scene { lights: two.clone(), shading: Shading::KajiyaKay, ..setup.scene(36, 28) };
    let draw = |scene: &Scene| {
        let maps: Vec<_> = scene.lights.iter().map(|s| setup.shadow("dsm:map=64", s.light)).collect();
        setup.session.render(&maps, scene).unwrap()
    };
    let both = draw(&scene);
    let dark = Scene { ambient: 0.0, background: [0.0; 3], ..scene.clone() };
    let sum = &draw(&dark.under(two[0].clone())).pixels + &draw(&dark.under(two[1].clone())).pixels;
    let rgb = |picture: &Array3<f32>| picture.slice(ndarray::s![.., .., ..3]).to_owned();
    assert!(largest_difference(&rgb(&draw(&dark).pixels), &rgb(&sum)) < 1e-5);
    let everywhere = draw(&Scene { skip: Skip::None, ..scene.clone() });
    assert!(largest_difference(&both.pixels, &everywhere.pixels) < tolerance::SKIPPING);
    // The plan names skipped work, and a picture without this shading computes no directions.
    let said = |picture: &umbravox::render::Picture, what: &str| {
        picture.plan.left_out.iter().any(|omission| omission.what == what)
    };
    assert!(said(&both, "gradients") && !said(&both, "directions of strands"));
    let plain = draw(&Scene { shading: Shading::None, ..scene });
    assert!(said(&plain, "directions of strands"));
}

#[test]
fn other_volumes_than_strands_are_refused() {
    let volume = phantom("sphere:16");
    let Some(setup) = Setup::open(&volume, &extinction(&[(0.0, 0.1)])) else { return };
    let scene = Scene { shading: Shading::KajiyaKay, ..setup.scene(8, 8) };
    let map = setup.shadow("none", scene.light());
    let Err(error) = setup.session.render(&map, &scene) else { panic!("drawn") };
    assert!(error.why.contains("not of strands"), "{error}");
}
