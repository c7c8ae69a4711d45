//! Segmentation labels: hidden ones have no extinction, others have their own transfer functions, for every shadow
//! method.

use super::*;
use umbravox::scene::Skip;
use umbravox::transfer::{LabelRule, LabelVisibility};
use umbravox::volume::Labels;

/// Volume whose voxels get the labels that `label` returns.
pub(super) fn labelled(volume: &Arc<Volume>, label: impl Fn([usize; 3]) -> u16) -> Arc<Volume> {
    let [nx, ny, nz] = volume.dims();
    let labels = Array3::from_shape_fn((nz, ny, nx), |(k, j, i)| label([i, j, k]));
    let segmentation = volume_of(labels.into(), volume.world_from_index());
    let labels = Arc::new(Labels::sampled(&segmentation, volume).unwrap());
    Arc::new(Volume::clone(volume).labelled(labels).unwrap())
}

pub(super) fn through(labels: &[u32], tf: &TransferFunction) -> LabelRule {
    LabelRule { labels: labels.to_vec(), visibility: LabelVisibility::Visible(Box::new(tf.clone())) }
}

pub(super) fn hidden(labels: &[u32]) -> LabelRule {
    LabelRule { labels: labels.to_vec(), visibility: LabelVisibility::Hidden }
}

/// Label of a voxel in blocks of three voxels, in irregular order.
fn blocks([i, j, k]: [usize; 3]) -> u16 {
    [0, 7, 300, 9][((i / 3) * 5 + (j / 3) * 3 + (k / 3) * 7 + (i / 3) * (k / 3)) % 4]
}

/// Transfer functions with label rules, one label hidden: by opacity, and by extinction.
fn functions() -> [TransferFunction; 3] {
    let [ramp, jumps, peaks] = transfer_functions([-900.0, 1200.0]);
    let steps = opacity(&[(-200.0, 0.0), (-100.0, 0.04), (40.0, 0.04), (40.0, 0.2), (900.0, 0.6)]);
    let walls = extinction(&[(-300.0, 0.0), (-300.0, 0.01), (500.0, 0.2)]);
    let fog = opacity(&[(-1000.0, 0.002), (0.0, 0.01), (500.0, 0.9)]);
    [
        TransferFunction { rules: vec![through(&[7], &steps), hidden(&[300]), through(&[9], &fog)], ..ramp },
        TransferFunction { rules: vec![through(&[7, 9], &walls), hidden(&[300])], ..jumps.clone() },
        TransferFunction { rules: vec![through(&[7], &peaks), through(&[9], &walls)], ..jumps },
    ]
}

/// Labels end half-way between voxels: homogeneous slabs have known optical depths.
#[test]
fn labels_end_half_way_between_voxels() {
    let n = 24usize;
    let volume = Arc::new(volume_of(Array3::<u8>::from_elem((n, n, n), 100).into(), DAffine3::IDENTITY));
    let volume = labelled(&volume, |[_, _, k]| [1u16, 2, 3][(k / 4).min(2)]);
    let even = |sigma: f64| TransferFunction::new(Quantity::Extinction, &[(50.0, sigma), (200.0, sigma)]);
    let tf = TransferFunction { rules: vec![hidden(&[2]), through(&[3], &even(0.3))], ..even(0.05) };
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let toward = DVec3::new(0.3, 0.1, -0.95).normalize();
    let light = Light::Directional { toward };
    let points: Vec<DVec3> = (0..300)
        .map(|i| {
            DVec3::new(6.0 + f64::from(i % 5), 10.0 + f64::from(i / 5 % 6), f64::from(i / 30) * 1.8 + 0.3)
        })
        .collect();
    // Extinction 0.05 up to 3.5, 0 up to 7.5, 0.3 beyond.
    let depth = |z: f64| 0.05 * (z.min(3.5) + 0.5) + 0.3 * (z - 7.5).max(0.0);
    let wanted: Vec<f64> = points.iter().map(|p| (-depth(p.z) / -toward.z).exp()).collect();
    let methods = [
        ("rays", 2e-6),
        ("dsm:epsilon=0.002,map=256", 0.012),
        ("dsm:epsilon=0.002,map=256,march=samples", 0.02),
        ("dsm:epsilon=0.002,map=256,precompress=off,prefilter=5", 0.08),
        ("osm:layers=128,map=256", 0.05),
        ("avsm:map=256,nodes=16", 0.03),
        ("lightvolume", 0.1),
        ("lightvolume:build=sweep", 0.1),
        ("sat:scale=1,boxes=256", 0.1),
    ];
    checks::answers_are(&setup, light, &points, &wanted, &methods);
}

/// Labels without rules change nothing, bit by bit.
#[test]
fn labels_without_rules_change_nothing() {
    let volume = phantom("thorax:48");
    let [ramp, ..] = transfer_functions([-900.0, 1200.0]);
    let Some(plain) = Setup::open(&volume, &ramp) else { return };
    let other = TransferFunction { rules: vec![hidden(&[5])], ..ramp.clone() };
    let with = Setup::open(&labelled(&volume, blocks), &other).unwrap();
    let scene = plain.scene(40, 30);
    assert_eq!(plain.picture("dsm:map=64", &scene), with.picture("dsm:map=64", &scene));
    let exact =
        [&plain, &with].map(|setup| setup.exact().picture(&Scene { width: 12, height: 9, ..scene.clone() }));
    assert!(largest_difference(&exact[0], &exact[1]) < 1e-6);
}

/// One transfer function for every label gives the picture without labels.
#[test]
fn one_function_under_many_names_is_itself() {
    let volume = phantom("thorax:48");
    let [ramp, jumps, _] = transfer_functions([-900.0, 1200.0]);
    for tf in [ramp, jumps] {
        let Some(plain) = Setup::open(&volume, &tf) else { return };
        let rules = vec![through(&[7, 300], &tf), through(&[9], &tf)];
        let many = TransferFunction { rules, ..tf.clone() };
        let with = Setup::open(&labelled(&volume, blocks), &many).unwrap();
        let (_, light) = lights(&volume)[1];
        let points: Vec<DVec3> = (0..500)
            .map(|i| {
                let f = |n: usize| (i * n % 97) as f64 / 97.0;
                let [a, b] = [volume.corners_mm()[0], volume.corners_mm()[7]];
                a + (b - a) * DVec3::new(f(13), f(29), f(57))
            })
            .collect();
        let [a, b] = [&plain, &with].map(|setup| setup.query(&setup.shadow("rays", light), &points));
        let off = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 2e-4, "{off}");
        for p in &points {
            let [a, b] = [&plain, &with].map(|setup| setup.exact().transmittance_to_light(*p, &light));
            assert!((a - b).abs() < 1e-11, "{a} {b}");
        }
    }
}

/// Error bounds of light rays hold through many labels.
#[test]
fn error_bounds_are_satisfied() {
    let volume = labelled(&phantom("thorax:48"), blocks);
    for tf in functions() {
        let Some(setup) = Setup::open(&volume, &tf) else { return };
        checks::promises_hold(&setup, "labels");
    }
}

/// Pictures with labels agree with the exact picture, and do not change without skipping.
#[test]
fn pictures_are_exact_and_skipping_changes_nothing() {
    // Labels as segmentations have them: large parts with smooth borders.
    let organs = |[i, j, k]: [usize; 3]| {
        let from = |x: usize, c: f64| (x as f64 - c).powi(2);
        if from(i, 20.0) + from(j, 30.0) + from(k, 36.0) < 300.0 {
            7
        } else if i > 40 {
            300
        } else if k < 20 {
            9
        } else {
            0
        }
    };
    let volume = labelled(&phantom("thorax:64"), organs);
    // Eye rays by samples of half a voxel see narrow peaks roughly, with labels or without.
    for tf in &functions()[..2] {
        let Some(setup) = Setup::open(&volume, tf) else { return };
        checks::pictures_are_exact_and_skipping_changes_nothing(&setup, "labels");
    }
}

/// Eye rays miss no corner of single opaque voxels in nearly clear matter by more than the accuracy of a step.
#[test]
fn eye_rays_see_thin_corners() {
    let n = 24usize;
    let volume = Arc::new(volume_of(Array3::<u8>::from_elem((n, n, n), 100).into(), DAffine3::IDENTITY));
    let volume = labelled(&volume, |[i, j, k]| u16::from((i * 7 + j * 13 + k * 29 + i * j * k) % 61 == 0));
    let even = |sigma: f64| TransferFunction::new(Quantity::Extinction, &[(50.0, sigma), (200.0, sigma)]);
    let tf = TransferFunction { rules: vec![through(&[1], &even(4.0))], ..even(0.001) };
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    // Ambient light only, so that the picture depends on eye rays alone.
    let scene = Scene { ambient: 1.0, ..setup.scene(40, 30) };
    let exact = setup.exact().picture(&scene);
    let map = setup.shadow("none", scene.light());
    for step in [0.5, 2.0] {
        let picture = setup.picture_of(&map, &Scene { step, ..scene.clone() });
        let rms = rms_difference(&picture, &exact);
        println!("step {step}: rms {rms:.5}");
        assert!(rms <= 0.002, "step {step}: {rms}");
    }
}

/// Skipped bricks have no extinction in device tables of several functions, either.
#[test]
fn functions_side_by_side_are_skipped_without_loss() {
    let ramp = Array3::from_shape_fn((20, 20, 40), |(k, j, i)| (i * 6 + (j * k) % 5) as u8);
    let volume = Arc::new(volume_of(ramp.into(), DAffine3::IDENTITY));
    let volume = labelled(&volume, |[i, ..]| (i / 4 % 3) as u16);
    let peak = |at: f64| opacity(&[(at, 0.0), (at + 3.0, 0.5), (at + 6.0, 0.0)]);
    let tf = TransferFunction {
        rules: vec![through(&[1], &peak(120.0)), through(&[2], &peak(200.0))],
        ..peak(30.0)
    };
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let scene = setup.scene(64, 48);
    for method in ["none", "dsm:march=samples,map=64"] {
        let map = setup.shadow(method, scene.light());
        let [a, b] =
            [Skip::Bricks, Skip::None].map(|skip| setup.picture_of(&map, &Scene { skip, ..scene.clone() }));
        let off = largest_difference(&a, &b);
        assert!(off <= tolerance::SKIPPING, "{method}: {off}");
    }
}

/// Bricks with hidden labels are not marched.
#[test]
fn hidden_labels_cost_nothing() {
    let volume = labelled(&phantom("thorax:64"), |[i, ..]| u16::from(i < 32));
    let [ramp, ..] = transfer_functions([-900.0, 1200.0]);
    let Some(all) = Setup::open(&volume, &ramp) else { return };
    let half = Setup::open(&volume, &TransferFunction { rules: vec![hidden(&[1])], ..ramp.clone() }).unwrap();
    let [all_active, half_active] = [&all, &half].map(|s| s.session.transfer.active.active as f64);
    assert!((0.4..0.65).contains(&(half_active / all_active)), "{half_active} of {all_active}");
    let none = Setup::open(&volume, &TransferFunction { rules: vec![hidden(&[0, 1])], ..ramp }).unwrap();
    assert!(none.session.transfer.empty);
    assert!(none.picture("dsm", &none.scene(8, 8)).iter().all(|c| c.is_finite()));
}
