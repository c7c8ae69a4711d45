//! Comparison of the strand volume with rays through the strands' cylinders, where the result is known.

use super::strands;
use glam::DVec3;
use umbravox::files::loading::Loading;
use umbravox::measure::cylinders::{AgainstCylinders, against_cylinders};
use umbravox::strands::{DEFAULT_RESOLUTION, Kernel, StrandVolume, Strands};

fn compared(strands: &Strands, toward: DVec3, resolution: usize) -> AgainstCylinders {
    let made = StrandVolume::of(strands, resolution, Kernel::Box, &Loading::default()).unwrap();
    against_cylinders(strands, &made.volume, toward, 1500).unwrap()
}

#[test]
fn one_wide_strand_is_in_front_of_half_of_the_beams() {
    for transparency in [0.0, 0.4] {
        let one = strands(&[vec![[-10.0, 0.0, 0.0], [10.0, 0.0, 0.0]]], 4.0, transparency);
        // Voxels of 0.24 mm: beams beside the axis lie within the strand's shadow.
        let a = compared(&one, DVec3::Z, 102);
        let wanted = 0.5 * (1.0 + f64::from(transparency));
        assert!((a.true_mean - wanted).abs() < 0.03, "{a:?}");
        // Only beams at the two ends are partly in its shadow.
        assert!(a.sampling_rms < 0.01, "{a:?}");
    }
}

#[test]
fn strands_along_the_light_hide_nothing_of_it() {
    let toward = DVec3::new(1.0, 2.0, 2.0) / 3.0;
    let lines: Vec<_> = (0..50)
        .map(|i| {
            let root = DVec3::new(f64::from(i % 7), f64::from(i % 5), 0.0);
            [root, root + 9.0 * toward].map(|p| p.as_vec3().to_array()).to_vec()
        })
        .collect();
    let a = compared(&strands(&lines, 0.05, 0.0), toward, 40);
    // 32-bit ends make them lean by 1e-8.
    assert!(a.true_mean > 0.9999 && a.mean < -0.01 && (a.true_mean + a.mean) > 0.0, "{a:?}");
}

/// Thin straight strands at random places across the light behave as the medium that extinction assumes.
#[test]
fn scattered_strands_across_the_light_are_the_medium() {
    let mut random = fastrand::Rng::with_seed(7);
    let mut lines = Vec::new();
    for _ in 0..8000 {
        let center = DVec3::new(random.f64(), random.f64(), random.f64()) * 40.0;
        let angle = std::f64::consts::PI * random.f64();
        let half = 1.5 * DVec3::new(angle.cos(), angle.sin(), 0.0);
        lines.push([center - half, center + half].map(|p| p.as_vec3().to_array()).to_vec());
    }
    let scattered = strands(&lines, 0.05, 0.0);
    let across = compared(&scattered, DVec3::Z, 22);
    assert!(across.true_mean > 0.3 && across.true_mean < 0.8, "{across:?}");
    assert!(across.mean.abs() < 0.01 && across.rms < 0.08, "{across:?}");
    // Viewed obliquely they hide less than their extinction predicts, by the mean of the sine.
    let slanted = compared(&scattered, DVec3::X, 22);
    assert!(slanted.mean < -0.03, "{slanted:?}");
    assert_eq!(slanted, compared(&scattered, DVec3::X, 22), "not the same on every run");
}

#[test]
fn nothing_is_compared_where_there_is_nothing() {
    let one = strands(&[vec![[0.0; 3], [1.0; 3]]], 0.1, 0.0);
    let made = StrandVolume::of(&one, DEFAULT_RESOLUTION, Kernel::Box, &Loading::default()).unwrap();
    assert_eq!(against_cylinders(&one, &made.volume, DVec3::Z, 0), None);
    let point = strands(&[vec![[0.0; 3]]], 0.1, 0.0);
    let made = StrandVolume::of(&point, DEFAULT_RESOLUTION, Kernel::Box, &Loading::default()).unwrap();
    assert_eq!(against_cylinders(&point, &made.volume, DVec3::Z, 9), None);
}
