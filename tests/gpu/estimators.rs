//! Random estimators of shadow rays: bias and range against the exact transmittance, and random numbers that depend on
//! the point and the seed alone.

use super::labels::{hidden, labelled, through};
use super::samples::points;
use super::*;

/// Runs with different seeds, and points in each.
const RUNS: usize = 48;
const POINTS: usize = 160;
/// Bias that float32 explains.
const ROUNDING: f64 = 2e-6;

/// Volumes and transfer functions under all four kinds of light.
fn scenes() -> Vec<(String, Arc<Volume>, TransferFunction, Light)> {
    let mut scenes = Vec::new();
    for (name, range) in [("thorax:32", [-900.0, 1200.0]), ("cloud:32", [0.0, 1000.0])]
        .into_iter()
        .chain([("foam:32", [0.0, 1000.0]), ("smoke:32", [0.0, 1000.0])])
    {
        let volume = phantom(name);
        for (k, tf) in transfer_functions(range).into_iter().enumerate() {
            for (light_name, light) in lights(&volume) {
                scenes.push((format!("{name}, {k}, {light_name}"), Arc::clone(&volume), tf.clone(), light));
            }
        }
    }
    let volume = labelled(&phantom("thorax:32"), |[i, j, k]| [0, 7, 9][(i / 5 + j / 7 + k / 6) % 3]);
    let [_, jumps, _] = transfer_functions([-900.0, 1200.0]);
    // The function of other labels has no extinction at most values of label 7.
    let faint = opacity(&[(800.0, 0.0), (1200.0, 0.3)]);
    let rules = vec![through(&[7], &opacity(&[(-300.0, 0.0), (600.0, 0.5)])), hidden(&[9])];
    let clip = vec!["0.3,1,0.2,-3".parse().unwrap()];
    let [_, (_, outside), .., (_, inside)] = lights(&volume);
    scenes.push(("labels".into(), Arc::clone(&volume), TransferFunction { rules, ..faint }, outside));
    scenes.push(("clipped".into(), volume, TransferFunction { clip, ..jumps }, inside));
    scenes
}

/// Mean error of a method over the points for each of several seeds.
fn mean_errors(setup: &Setup, method: &str, light: Light, points: &[DVec3], exact: &[f64]) -> Vec<f64> {
    let of_seed = |seed: usize| {
        let map = setup.shadow(&format!("{method},seed={seed}"), light);
        let values = setup.query(&map, points);
        values.iter().zip(exact).map(|(value, exact)| f64::from(*value) - exact).sum::<f64>()
            / points.len() as f64
    };
    (0..RUNS).map(of_seed).collect()
}

#[test]
fn unbiased_estimators_have_no_bias_in_fifty_scenes() {
    let all = scenes();
    assert_eq!(all.len(), 50);
    let kept = common::SIZES.estimator_scenes;
    let mut beyond = Vec::new();
    let mut tests = 0;
    // The last scenes have labels and clip planes.
    for (name, volume, tf, light) in all[..48].iter().step_by(50 / kept).chain(&all[48..]) {
        let Some(setup) = Setup::open(volume, tf) else { return };
        let points: Vec<DVec3> = points(volume).into_iter().step_by(25).take(POINTS).collect();
        let field = setup.exact();
        let exact: Vec<f64> = points.iter().map(|p| field.transmittance_to_light(*p, light)).collect();
        for method in ["ratio,samples=2", "residual,samples=2", "unbiased,samples=4"] {
            let errors = mean_errors(&setup, &format!("rays:estimator={method}"), *light, &points, &exact);
            let n = errors.len() as f64;
            let bias = errors.iter().sum::<f64>() / n;
            let variance = errors.iter().map(|e| (e - bias).powi(2)).sum::<f64>() / (n - 1.0);
            let sigmas = (bias.abs() - ROUNDING).max(0.0) / (variance / n).sqrt().max(1e-12);
            tests += 1;
            if sigmas > 3.0 {
                beyond.push(format!("{name}, {method}: {bias:.2e}, {sigmas:.1} standard errors"));
            }
            assert!(sigmas < 5.0, "{name}, {method}: bias {bias:.2e}, {sigmas:.1} standard errors");
        }
    }
    println!("{tests} tests, beyond 3 standard errors: {beyond:?}");
    // Of Student's t with 47 degrees of freedom, one in 230 lies beyond three standard errors.
    assert!(beyond.len() <= 1 + tests / 100, "{beyond:?}");
}

#[test]
fn residual_walks_and_ray_marching_have_no_variance_in_a_homogeneous_medium() {
    let volume = Arc::new(volume_of(Array3::<u8>::from_elem((20, 20, 20), 100).into(), DAffine3::IDENTITY));
    let even = TransferFunction::new(Quantity::Extinction, &[(50.0, 0.07), (200.0, 0.07)]);
    let Some(setup) = Setup::open(&volume, &even) else { return };
    let (_, light) = lights(&volume)[0];
    let points: Vec<DVec3> = points(&volume).into_iter().take(200).collect();
    let field = setup.exact();
    for (method, least, most) in [
        ("residual,samples=1", 0.0, 1e-5),
        ("jackknife,samples=1", 0.0, 1e-5),
        ("unbiased,samples=1", 0.0, 1e-5),
        ("ratio,samples=1", 0.1, 1.0),
    ] {
        let map = setup.shadow(&format!("rays:estimator={method}"), light);
        let values = setup.query(&map, &points);
        let error = |(value, point): (&f32, &DVec3)| {
            (f64::from(*value) - field.transmittance_to_light(*point, &light)).abs()
        };
        let largest = values.iter().zip(&points).map(error).fold(0.0, f64::max);
        assert!((least..=most).contains(&largest), "{method}: {largest}");
    }
}

/// With many samples every estimate approaches the exact one; estimates of random walks stay in [0, 1].
#[test]
fn more_samples_have_less_error() {
    let [ramp, ..] = transfer_functions([0.0, 1000.0]);
    let volume = phantom("cloud:32");
    let Some(setup) = Setup::open(&volume, &ramp) else { return };
    let (_, light) = lights(&volume)[0];
    let points: Vec<DVec3> = points(&volume).into_iter().take(1000).collect();
    let field = setup.exact();
    let exact: Vec<f64> = points.iter().map(|p| field.transmittance_to_light(*p, &light)).collect();
    for method in ["ratio", "residual", "jackknife", "unbiased"] {
        let rms = |samples: usize| {
            let values = setup
                .query(&setup.shadow(&format!("rays:estimator={method},samples={samples}"), light), &points);
            if method == "ratio" || method == "residual" {
                assert!(values.iter().all(|t| (0.0..=1.0).contains(t)), "{method}");
            }
            let squares = values.iter().zip(&exact).map(|(value, exact)| (f64::from(*value) - exact).powi(2));
            (squares.sum::<f64>() / exact.len() as f64).sqrt()
        };
        let [few, many] = [2, 128].map(rms);
        println!("{method}: {few:.4} {many:.4}");
        assert!(many < 0.25 * few && many < 0.02, "{method}: {few} {many}");
    }
}

#[test]
fn random_numbers_depend_on_the_point_and_the_seed_alone() {
    let [ramp, ..] = transfer_functions([-900.0, 1200.0]);
    let Some(setup) = Setup::open(&phantom("thorax:32"), &ramp) else { return };
    let scene = setup.scene(40, 30);
    for estimator in ["ratio", "residual", "jackknife", "unbiased"] {
        let method = format!("rays:estimator={estimator},samples=2");
        let picture = setup.picture(&method, &scene);
        assert_eq!(picture, setup.picture(&method, &scene), "{estimator}: the same seed");
        assert_ne!(picture, setup.picture(&format!("{method},seed=2"), &scene), "{estimator}: another seed");
        let exact = setup.picture("rays", &scene);
        let difference = rms_difference(&picture, &exact);
        assert!((1e-4..0.2).contains(&difference), "{estimator}: {difference}");
    }
}
