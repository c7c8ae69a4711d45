//! Gradient opacity on the device: pictures and transmittances against the exact reference.

use super::labels::{labelled, through};
use super::samples::points;
use super::*;
use umbravox::scene::{Shading, Skip};
use umbravox::transfer::GradientOpacity;

/// Affine of anisotropic, sheared voxels.
fn oblique() -> DAffine3 {
    DAffine3::from_cols(
        DVec3::new(1.4, -0.2, 0.1),
        DVec3::new(0.1, 1.0, -0.25),
        DVec3::new(-0.3, 0.4, 2.2),
        DVec3::new(-20.0, 31.0, 7.5),
    )
}

fn with(tf: &TransferFunction, opacity: &str) -> TransferFunction {
    tf.clone().with_gradient_opacity(opacity.parse().unwrap())
}

/// Volumes and transfer functions with a gradient opacity: a smooth sphere, and tissue with sharp surfaces.
fn scenes() -> Vec<(&'static str, Arc<Volume>, TransferFunction)> {
    let [ramp, ..] = transfer_functions([-900.0, 1200.0]);
    let [sphere, jumps, _] = transfer_functions([0.0, 1000.0]);
    let under_oblique = |name: &str| under(oblique(), name);
    vec![
        ("thorax", phantom("thorax:64"), with(&ramp, "20:0,120:1")),
        ("sphere", under_oblique("sphere:48"), with(&sphere, "0:0.1,30:1,120:0.2,per=voxel")),
        ("cloud", under_oblique("cloud:48"), with(&sphere, "0:1,40:0.3,40:0.8,100:0")),
        ("shell", phantom("shell:32"), with(&jumps, "0:0,200:0.5,200:1")),
    ]
}

/// Pictures by shadow rays and by maps are close to the exact picture. Where segments share shadow queries, errors are larger:
/// matter is thinner than without a gradient opacity.
#[test]
fn pictures_are_close_to_exact() {
    for (name, volume, tf) in scenes() {
        let Some(setup) = Setup::open(&volume, &tf) else { return };
        let plain = Setup::open(&volume, &TransferFunction { gradient_opacity: None, ..tf.clone() }).unwrap();
        for (light, shading) in
            [(lights(&volume)[0].1, Shading::None), (lights(&volume)[2].1, Shading::Lambert)]
        {
            let scene = Scene { lights: vec![light.into()], shading, ..setup.scene(32, 24) };
            let [exact, without] = [&setup, &plain].map(|setup| setup.exact().picture(&scene));
            let changed = rms_difference(&exact, &without);
            assert!(changed > 0.005, "{name}: the factor changes the picture by {changed}");
            for (method, allowed) in [
                ("rays:lookup=each", tolerance::GRADIENT_PICTURE_RMS),
                ("rays", 2.0 * tolerance::GRADIENT_PICTURE_RMS),
                ("rays:march=samples", 2.0 * tolerance::GRADIENT_PICTURE_RMS),
                ("dsm:epsilon=0.005", tolerance::DSM_PICTURE_RMS),
                ("dsm:epsilon=0.005,march=samples", tolerance::DSM_PICTURE_RMS),
            ] {
                let rms = rms_difference(&setup.picture(method, &scene), &exact);
                let before = rms_difference(&plain.picture(method, &scene), &without);
                println!("{name}, {shading:?}, {method}: rms {rms:.5}, {before:.5} without");
                assert!(rms <= allowed, "{name}, {shading:?}, {method}: rms {rms}");
            }
        }
    }
}

/// Transmittances at points agree with the exact ones, for every march and for methods that sample extinction.
#[test]
fn transmittances_are_close_to_exact() {
    for (name, volume, tf) in scenes() {
        let Some(setup) = Setup::open(&volume, &tf) else { return };
        let (_, light) = lights(&volume)[0];
        let points: Vec<DVec3> = points(&volume).into_iter().step_by(5).collect();
        let field = setup.exact();
        let exact: Vec<f64> = points.iter().map(|p| field.transmittance_to_light(*p, &light)).collect();
        for (method, allowed) in [
            ("rays", 0.01),
            ("rays:march=samples", 0.006),
            ("dsm:epsilon=0.005,map=192", 0.02),
            ("dsm:epsilon=0.005,map=192,march=samples", 0.02),
            ("dsm:epsilon=0.005,map=192,precompress=off", 0.03),
            ("dsm:epsilon=0.005,map=192,near=4", 0.02),
            ("osm:layers=128,map=192", 0.05),
            ("avsm:nodes=16,map=192", 0.05),
            ("lightvolume", 0.1),
            ("sat:scale=1,boxes=256", 0.1),
        ] {
            let map = setup.shadow(method, light);
            assert!(map.bound.is_none(), "{method} states a bound");
            let found = setup.query(&map, &points);
            let errors = found.iter().zip(&exact).map(|(t, exact)| f64::from(*t) - exact);
            let errors: Vec<f64> = errors.collect();
            let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
            let largest = errors.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            println!("{name}, {method}: rms {rms:.5}, largest {largest:.4}");
            assert!(rms <= allowed, "{name}, {method}: rms {rms}");
        }
    }
}

/// A linear field has one gradient for any affine: the factor scales the extinction.
#[test]
fn a_linear_field_has_one_factor() {
    let slope = DVec3::new(3.0, -2.0, 1.5);
    let value = |(k, j, i): (usize, usize, usize)| slope.dot(DVec3::new(i as f64, j as f64, k as f64)) as f32;
    let voxels = Voxels::F32(Array3::from_shape_fn((20, 22, 24), value));
    let volume = Arc::new(volume_of(voxels, oblique()));
    let gradient = (volume.index_from_world().matrix3.transpose() * slope).length();
    let tf = extinction(&[(-50.0, 0.05), (120.0, 0.2)]);
    // The gradient is less in the half voxels at the edge, where the value is clamped.
    let toward = DVec3::new(0.2, 0.1, 1.0);
    let light = Light::Directional { toward };
    for text in [format!("0:0,{}:1", 2.0 * gradient), format!("{0}:1,{0}:0.25", 0.9 * gradient)] {
        let Some(setup) = Setup::open(&volume, &with(&tf, &text)) else { return };
        let points = points(&volume);
        let field = setup.exact();
        for (method, allowed) in [("rays", 2e-5), ("rays:march=samples", 2e-3)] {
            let found = setup.query(&setup.shadow(method, light), &points);
            let off = points.iter().zip(&found);
            let off = off.map(|(p, t)| (f64::from(*t) - field.transmittance_to_light(*p, &light)).abs());
            let largest = off.fold(0.0, f64::max);
            println!("{text}, {method}: {largest:e}");
            assert!(largest < allowed, "{text}, {method}: {largest:e}");
        }
        // Eye rays alone: opacity.
        let scene = setup.scene(24, 16);
        let [picture, exact] = [setup.picture("none", &scene), field.picture(&scene)];
        let opacity = |picture: &Array3<f32>| picture.iter().skip(3).step_by(4).copied().collect::<Vec<_>>();
        let off =
            opacity(&picture).iter().zip(opacity(&exact)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 2e-3, "{text}: opacities differ by {off}");
    }
}

/// Estimators without bias stay without bias.
#[test]
fn random_estimators_have_no_bias() {
    let (_, volume, tf) = scenes().swap_remove(2);
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let (_, light) = lights(&volume)[0];
    let points: Vec<DVec3> = points(&volume).into_iter().step_by(25).collect();
    let field = setup.exact();
    let exact: f64 = points.iter().map(|p| field.transmittance_to_light(*p, &light)).sum();
    for method in ["ratio,samples=2", "residual,samples=2", "unbiased,samples=4"] {
        let runs = (0..32).map(|seed| {
            let map = setup.shadow(&format!("rays:estimator={method},seed={seed}"), light);
            let sum: f64 = setup.query(&map, &points).iter().map(|t| f64::from(*t)).sum();
            (sum - exact) / points.len() as f64
        });
        let errors: Vec<f64> = runs.collect();
        let n = errors.len() as f64;
        let bias = errors.iter().sum::<f64>() / n;
        let deviation = (errors.iter().map(|e| (e - bias).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
        println!("{method}: bias {bias:.2e}, standard error {deviation:.2e}");
        assert!(
            bias.abs() < 4.0 * deviation + 2e-6,
            "{method}: bias {bias:.2e}, standard error {deviation:.2e}"
        );
    }
}

/// Skipping bricks and labels work with a gradient opacity; enclosing curves are refused.
#[test]
fn other_features_work_or_are_refused() {
    let (_, volume, tf) = scenes().swap_remove(1);
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let scene = Scene { lights: vec![lights(&volume)[0].1.into()], ..setup.scene(24, 16) };
    let all = setup.picture("rays", &Scene { skip: Skip::None, ..scene.clone() });
    assert!(largest_difference(&setup.picture("rays", &scene), &all) <= tolerance::SKIPPING);

    // Labels with one function give the picture of a volume without labels.
    let two = labelled(&volume, |[i, j, k]| [0, 7][(i / 5 + j / 7 + k / 6) % 2]);
    let plain = TransferFunction { gradient_opacity: None, ..tf.clone() };
    let rules = vec![through(&[7], &plain)];
    let of_labels = Setup::open(&two, &TransferFunction { rules, ..tf.clone() }).unwrap();
    let off = rms_difference(&of_labels.picture("rays", &scene), &setup.picture("rays", &scene));
    assert!(off < 0.002, "labels change the picture by {off}");

    let enclosing = shadow::parse("dsm:enclose=on").unwrap();
    let refused = setup.session.shadow(enclosing.as_ref(), lights(&volume)[0].1).err().unwrap();
    assert!(refused.exit_status() == 2 && refused.why.contains("gradient"), "{refused}");
    let no_factor: GradientOpacity = "0:1".parse().unwrap();
    assert_eq!(plain.clone().with_gradient_opacity(no_factor), plain);
}
