//! Pictures of several lights: sums of the pictures of each light, and the exact picture of all.

use super::*;
use umbravox::render::Picture;
use umbravox::scene::{LightSource, Shading};

/// Tolerance for float32 sums in another order.
const SUMS: f64 = 2e-6;

const METHODS: [&str; 5] = ["rays", "none", "dsm:map=64", "dom:map=64", "osm:map=64"];

fn source(light: Light, color: [f64; 3], intensity: f64) -> LightSource {
    LightSource { color, intensity, ..light.into() }
}

/// Three lights of different colours: at infinity, outside, and inside the volume.
fn three(volume: &Volume) -> Vec<LightSource> {
    let [(_, far), _, (_, near), (_, inside)] = lights(volume);
    let toward = match far {
        Light::Directional { toward } => -toward,
        Light::Point { .. } => panic!("the first one is at infinity"),
    };
    let behind = Light::Directional { toward };
    vec![
        source(behind, [1.0, 0.25, 0.0], 0.75),
        source(near, [0.0, 0.5, 1.0], 1.5),
        source(inside, [0.5, 1.0, 0.5], 0.25),
    ]
}

impl Setup {
    fn lit(&self, method: &str, scene: &Scene) -> Picture {
        let method = shadow::parse(method).unwrap();
        let maps: Vec<ShadowMap> =
            scene.shining().iter().map(|l| self.session.shadow(method.as_ref(), l.light).unwrap()).collect();
        self.session.render(&maps, scene).unwrap()
    }
}

/// Sum of pictures, channel by channel, each times its factors.
fn sum(parts: &[(Array3<f32>, [f64; 3])]) -> Array3<f32> {
    Array3::from_shape_fn(parts[0].0.dim(), |(row, column, c)| match c {
        3 => parts[0].0[[row, column, 3]],
        c => parts.iter().map(|(p, f)| f64::from(p[[row, column, c]]) * f[c]).sum::<f64>() as f32,
    })
}

#[test]
fn pictures_add_up_and_scale() {
    let [ramp, jumps, _] = transfer_functions([-900.0, 1200.0]);
    let volume = phantom("thorax:48");
    let lights = three(&volume);
    for (tf, shading) in [(&ramp, Shading::None), (&jumps, Shading::BlinnPhong)] {
        let Some(setup) = Setup::open(&volume, tf) else { return };
        let base = Scene { ambient: 0.0, background: [0.0; 3], shading, ..setup.scene(40, 28) };
        for method in METHODS {
            let all = setup.lit(method, &Scene { lights: lights.clone(), ..base.clone() }).pixels;
            let white =
                |l: &LightSource| (setup.lit(method, &base.under(l.light.into())).pixels, l.radiance());
            let parts: Vec<_> = lights.iter().map(white).collect();
            let off = largest_difference(&all, &sum(&parts));
            println!("{method}, {shading:?}: {off:.1e}");
            assert!(off < SUMS, "{method}, {shading:?}: {off}");
            assert!(all.iter().any(|x| *x > 0.1), "{method}: something is seen");

            // Ambient light and the background count once, whatever the number of lights. Both are known from
            // pictures of one light with the same samples.
            let one = base.under(lights[0].light.into());
            let background = [0.3, 0.5, 0.1];
            let [dark, half, behind] =
                [one.clone(), Scene { ambient: 0.5, ..one.clone() }, Scene { background, ..one.clone() }]
                    .map(|scene| setup.lit(method, &scene).pixels);
            let ambient = sum(&[(half, [2.0; 3]), (dark.clone(), [-1.0; 3])]);
            let over = Scene { lights: lights.clone(), ambient: 0.25, background, ..base.clone() };
            let expected =
                sum(&[(all, [0.75; 3]), (ambient, [0.25; 3]), (behind, [1.0; 3]), (dark, [-1.0; 3])]);
            let off = largest_difference(&setup.lit(method, &over).pixels, &expected);
            assert!(off < SUMS, "{method}, {shading:?}, over a background: {off}");
        }
    }
}

#[test]
fn a_white_light_is_the_picture_without_a_factor_and_dark_ones_change_nothing() {
    let [ramp, ..] = transfer_functions([0.0, 1000.0]);
    let volume = phantom("sphere");
    let Some(setup) = Setup::open(&volume, &ramp) else { return };
    let one = setup.scene(40, 28);
    let first = one.lights[0].clone();
    let dark = three(&volume).into_iter().map(|l| LightSource { intensity: 0.0, ..l });
    let black = source(first.light, [0.0; 3], 2.0);
    let many = Scene { lights: dark.chain([first.clone(), black.clone()]).collect(), ..one.clone() };
    for method in METHODS {
        let [alone, among] = [&one, &many].map(|scene| setup.lit(method, scene));
        assert_eq!(alone.pixels, among.pixels, "{method}: to the bit");
        let said = |p: &Picture, what: &str| p.plan.left_out.iter().any(|o| o.what.contains(what));
        assert!(
            said(&among, "light 1 of 5") && said(&among, "light 5 of 5") && !said(&among, "light 4 of 5")
        );
        assert!(!said(&alone, "light"));
        // A factor of a half, applied to every sample, is one of the picture.
        let half = one.under(LightSource { intensity: 0.5, ..first.clone() });
        let [lit, ambient] =
            [&half, &Scene { ambient: 1.0, ..half.clone() }].map(|s| setup.lit(method, s).pixels);
        let dim = sum(&[(alone.pixels.clone(), [0.5; 3]), (ambient, [0.5 * 0.15; 3])]);
        let seen = lit
            .iter()
            .zip(&dim)
            .enumerate()
            .filter(|(i, _)| i % 4 == 3 || lit[[i / 4 / 40, i / 4 % 40, 3]] == 1.0);
        let off = seen.map(|(_, (a, b))| f64::from((a - b).abs())).fold(0.0, f64::max);
        assert!(off < SUMS, "{method}: {off}");
    }
    // If no light has intensity, nothing is built: only ambient light is left.
    let none = Scene { lights: vec![black, LightSource { intensity: 0.0, ..first }], ..one.clone() };
    assert_eq!(setup.session.needs_shadows(&none), Err("no light shines"));
    let picture = setup.lit("none", &none).pixels;
    let ambient = setup.lit("none", &Scene { ambient: 1.0, background: [0.0; 3], ..none.clone() }).pixels;
    let background = Array3::from_shape_fn(ambient.dim(), |(r, c, k)| {
        (1.0 - ambient[[r, c, 3]]) * none.background.get(k).map_or(0.0, |b| *b as f32)
    });
    let off = largest_difference(&picture, &sum(&[(ambient, [0.15; 3]), (background, [1.0; 3])]));
    assert!(off < SUMS, "{off}");
}

#[test]
fn pictures_of_several_lights_are_near_the_exact_one() {
    for (name, range) in [("step", [0.0, 1000.0]), ("thorax:64", [-900.0, 1200.0])] {
        let volume = phantom(name);
        for tf in &transfer_functions(range)[..2] {
            let Some(setup) = Setup::open(&volume, tf) else { return };
            for shading in [Shading::None, Shading::Lambert] {
                let scene = Scene { lights: three(&volume), shading, ..setup.scene(24, 16) };
                let exact = setup.exact().picture(&scene);
                for (method, allowed) in
                    [("rays", tolerance::RAYS_PICTURE_RMS), ("dsm:epsilon=0.005", tolerance::DSM_PICTURE_RMS)]
                {
                    let rms = rms_difference(&setup.lit(method, &scene).pixels, &exact);
                    println!("{name}, {shading:?}, {method}: rms {rms:.5}");
                    assert!(rms <= allowed, "{name}, {shading:?}, {method}: rms {rms}");
                }
            }
        }
    }
}

/// Bands of a picture, parts of bands, and pictures in several dispatches add up alike: each pass continues the one
/// before.
#[test]
fn parts_of_a_picture_add_up_alike() {
    let [ramp, ..] = transfer_functions([-900.0, 1200.0]);
    let volume = phantom("thorax:48");
    let Some(setup) = Setup::open(&volume, &ramp) else { return };
    let scene = Scene { lights: three(&volume), ..setup.scene(150, 90) };
    for method in ["rays", "dsm:map=64"] {
        let whole = setup.lit(method, &scene).pixels;
        let parsed = shadow::parse(method).unwrap();
        let maps: Vec<_> =
            scene.shining().iter().map(|l| setup.session.shadow(parsed.as_ref(), l.light).unwrap()).collect();
        let Session { renderer, loaded, transfer } = &setup.session;
        let parts = renderer.render_in_bands(loaded, transfer, &maps, &scene, 0.01, |_| true).unwrap();
        assert_eq!(parts.unwrap().pixels, whole, "{method}");
    }
}

#[test]
fn one_shadow_map_per_shining_light() {
    let [ramp, ..] = transfer_functions([0.0, 1000.0]);
    let volume = phantom("sphere");
    let Some(setup) = Setup::open(&volume, &ramp) else { return };
    let scene = Scene { lights: three(&volume), ..setup.scene(8, 8) };
    let map = setup.shadow("dsm:map=64", scene.light());
    let e = setup.session.render(&map, &scene).err().expect("two are missing");
    assert!(e.why.contains("1 shadow maps for 3 lights"), "{e}");
}
