//! Gradient opacity of the float64 reference: closed forms, and brute-force quadrature by an independent implementation.

use super::*;
use std::sync::Arc;
use umbravox::exact::ExactField;
use umbravox::scene::{Camera, Light, Scene};
use umbravox::transfer::{GradientOpacity, LabelRule, LabelVisibility};
use umbravox::volume::Labels;

/// Stated error of the optical depth with a gradient opacity, relative, and absolute below 1.
const STATED: f64 = 1e-10;

/// Gradient opacities over the gradients of the rough volume: rising, with a jump and a falling end, and constant.
const OPACITIES: [&str; 4] = ["0:0,60:1", "10:0.1,25:0.9,25:0.3,60:1,90:0", "0:1,40:0", "30:0,30:1"];

fn with(tf: &TransferFunction, opacity: &str) -> TransferFunction {
    tf.clone().with_gradient_opacity(opacity.parse().unwrap())
}

/// Trilinear cell with its transfer function, in cell coordinates.
struct Cell<'a> {
    corner: [f64; 8],
    volume: &'a Volume,
    tf: &'a TransferFunction,
    opacity: GradientOpacity,
}

impl Cell<'_> {
    fn value(&self, p: DVec3) -> f64 {
        let weight = |c: usize, axis: usize| if c >> axis & 1 == 1 { p[axis] } else { 1.0 - p[axis] };
        (0..8).map(|c| weight(c, 0) * weight(c, 1) * weight(c, 2) * self.corner[c]).sum()
    }

    /// Magnitude of the gradient in world space. The gradient along an axis is the difference between two faces of the cell.
    fn magnitude(&self, p: DVec3) -> f64 {
        let slope = |axis: usize| {
            let face = |at: f64| {
                let mut q = p;
                q[axis] = at;
                self.value(q)
            };
            face(1.0) - face(0.0)
        };
        let gradient = DVec3::new(slope(0), slope(1), slope(2));
        (self.volume.index_from_world().matrix3.transpose() * gradient).length()
    }

    fn extinction(&self, p: DVec3) -> f64 {
        self.tf.extinction(self.value(p)) * self.opacity.factor(self.magnitude(p))
    }

    /// Integrates over the chord from `a` to `b`, between the points where value or gradient reach a breakpoint or turn.
    fn whole_integral(&self, a: DVec3, b: DVec3) -> f64 {
        let mut cuts = vec![0.0, 1.0];
        let values: Vec<f64> = self.tf.points.iter().map(|p| p.value).collect();
        let magnitudes: Vec<f64> = self.opacity.points().iter().map(|p| p.magnitude).collect();
        cuts_of(&|t| self.value(a.lerp(b, t)), &values, &mut cuts);
        cuts_of(&|t| self.magnitude(a.lerp(b, t)), &magnitudes, &mut cuts);
        cuts.sort_by(f64::total_cmp);
        let part = |w: &[f64]| {
            let [from, to] = [w[0], w[1]].map(|t| a.lerp(b, t));
            self.integral(from, to, self.five_points(from, to), 45)
        };
        cuts.windows(2).filter(|w| w[1] > w[0]).map(part).sum()
    }

    /// Integrates over the chord from `a` to `b` by bisection, with five-point Gauss quadrature.
    fn integral(&self, a: DVec3, b: DVec3, whole: f64, left: u32) -> f64 {
        let middle = 0.5 * (a + b);
        let halves = [self.five_points(a, middle), self.five_points(middle, b)];
        let sum = halves[0] + halves[1];
        // The parts of a unit chord add up to an error of about 1e-12.
        if left == 0 || (sum - whole).abs() <= 1e-13 * a.distance(b) {
            return sum;
        }
        self.integral(a, middle, halves[0], left - 1) + self.integral(middle, b, halves[1], left - 1)
    }

    fn five_points(&self, a: DVec3, b: DVec3) -> f64 {
        let nodes = [
            (0.0, 0.568_888_888_888_888_9),
            (0.538_469_310_105_683, 0.478_628_670_499_366_47),
            (0.906_179_845_938_664, 0.236_926_885_056_189_08),
        ];
        let at = |x: f64| self.extinction(0.5 * (a + b) + 0.5 * x * (b - a));
        let sum: f64 = nodes.iter().map(|(x, w)| w * if *x == 0.0 { at(0.0) } else { at(*x) + at(-x) }).sum();
        0.5 * sum * a.distance(b)
    }
}

/// Adds the positions in `[0, 1]` at which a function turns or reaches one of the breakpoints, found by sampling, ternary
/// search and bisection.
fn cuts_of(f: &impl Fn(f64) -> f64, breakpoints: &[f64], cuts: &mut Vec<f64>) {
    const SAMPLES: u32 = 200;
    let at = |i: u32| f64::from(i) / f64::from(SAMPLES);
    let mut turns = vec![0.0];
    for i in 1..SAMPLES {
        let [a, b, c] = [at(i - 1), at(i), at(i + 1)].map(f);
        if (b - a) * (c - b) <= 0.0 && a != c {
            let sign = if b >= a { 1.0 } else { -1.0 };
            let (mut low, mut high) = (at(i - 1), at(i + 1));
            for _ in 0..120 {
                let [x, y] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
                if sign * f(x) < sign * f(y) { low = x } else { high = y }
            }
            turns.push(0.5 * (low + high));
        }
    }
    turns.push(1.0);
    for w in turns.windows(2) {
        for breakpoint in breakpoints {
            let (mut low, mut high) = (w[0], w[1]);
            let is_above = f(low) > *breakpoint;
            if is_above == (f(high) > *breakpoint) {
                continue;
            }
            for _ in 0..80 {
                let middle = 0.5 * (low + high);
                if (f(middle) > *breakpoint) == is_above { low = middle } else { high = middle }
            }
            cuts.push(low);
        }
    }
    cuts.extend(turns);
}

/// Optical depth between two points in index coordinates by brute force, cell by cell.
fn brute_force(volume: &Volume, tf: &TransferFunction, a: DVec3, b: DVec3) -> f64 {
    let n = volume.dims();
    let mut cuts = vec![0.0, 1.0];
    for axis in 0..3 {
        let faces = (0..n[axis]).map(|i| i as f64).chain([-0.5, n[axis] as f64 - 0.5]);
        cuts.extend(
            faces.map(|face| (face - a[axis]) / (b[axis] - a[axis])).filter(|t| (0.0..1.0).contains(t)),
        );
    }
    cuts.sort_by(f64::total_cmp);
    let length_mm = volume.world_from_index().transform_vector3(b - a).length();
    let of_part = |from: f64, to: f64| {
        let middle = a.lerp(b, 0.5 * (from + to));
        let corner = middle.floor();
        let inside = (0..3).all(|axis| (-0.5..=n[axis] as f64 - 0.5).contains(&middle[axis]));
        if !inside || to - from < 1e-14 {
            return 0.0;
        }
        let corners: [f64; 8] = std::array::from_fn(|c| {
            let at: [usize; 3] = std::array::from_fn(|axis| {
                let i = corner[axis] + f64::from((c >> axis & 1) as u8);
                i.clamp(0.0, n[axis] as f64 - 1.0) as usize
            });
            volume.value(at[0], at[1], at[2])
        });
        let opacity = tf.gradient_opacity.clone().unwrap().per_mm(volume.spacing_mm());
        let cell = Cell { corner: corners, volume, tf, opacity };
        let ends = [from, to].map(|t| a.lerp(b, t) - corner);
        // Lengths of chords are those in index space.
        let mm = length_mm / a.distance(b);
        mm * cell.whole_integral(ends[0], ends[1])
    };
    cuts.windows(2).map(|w| of_part(w[0], w[1])).sum()
}

#[test]
fn brute_force_agrees_to_the_stated_error() {
    let volume = rough_volume(oblique());
    let mut random = Rng::with_seed(3);
    let mut worst = 0.0f64;
    for _ in 0..12 {
        let [a, b] =
            std::array::from_fn(|_| in_box(&mut random, DVec3::splat(-2.0), DVec3::new(10.0, 8.0, 7.0)));
        let ends = [a, b].map(|p| oblique().transform_point3(p));
        for tf in transfer_functions() {
            for opacity in OPACITIES {
                let tf = with(&tf, opacity);
                let want = brute_force(&volume, &tf, a, b);
                let got = ExactField::new(&volume, &tf).optical_depth(ends[0], ends[1]);
                worst = worst.max((got - want).abs() / want.max(1.0));
                assert!((got - want).abs() <= STATED * want.max(1.0), "{opacity}: {got} {want}");
            }
        }
    }
    println!("largest error {worst:e}");
}

/// Flat regions, straight ramps and surfaces of a phantom, where gradients vanish or are equal in many cells.
#[test]
fn brute_force_agrees_on_a_phantom() {
    let volume = umbravox::phantom::Phantom::Shell.build(12).unwrap();
    let mut random = Rng::with_seed(8);
    let mut worst = 0.0f64;
    for _ in 0..20 {
        let [a, b] = std::array::from_fn(|_| in_box(&mut random, DVec3::splat(-1.0), DVec3::splat(12.0)));
        let ends = [a, b].map(|p| volume.world_from_index().transform_point3(p));
        for opacity in ["0:0,100:1", "0:1,20:0.5,200:0,per=voxel"] {
            let tf = with(&opacity_ramp(), opacity);
            let want = brute_force(&volume, &tf, a, b);
            let got = ExactField::new(&volume, &tf).optical_depth(ends[0], ends[1]);
            worst = worst.max((got - want).abs() / want.max(1.0));
            assert!((got - want).abs() <= STATED * want.max(1.0), "{opacity}: {got} {want}");
        }
    }
    println!("largest error {worst:e}");
}

fn opacity_ramp() -> TransferFunction {
    opacity(&[(50.0, 0.0), (900.0, 0.8)])
}

/// A linear field has one gradient in world space, for any affine: the factor is constant.
#[test]
fn a_linear_field_has_one_factor() {
    let slope = DVec3::new(3.0, -2.0, 1.0);
    let volume = volume([12, 12, 12], oblique(), |i, j, k| slope.dot(DVec3::new(i, j, k)));
    let gradient = (volume.index_from_world().matrix3.transpose() * slope).length();
    let tf = opacity(&[(-20.0, 0.05), (40.0, 0.3)]);
    let [a, b] =
        [DVec3::new(1.3, 2.1, 10.4), DVec3::new(9.9, 8.2, 0.7)].map(|p| oblique().transform_point3(p));
    let plain = ExactField::new(&volume, &tf).optical_depth(a, b);
    for (opacity, factor) in [
        (format!("0:0,{}:1", 2.0 * gradient), 0.5),
        (format!("{}:0.25", 0.5 * gradient), 0.25),
        (format!("{}:1,{}:0.25", 0.5 * gradient, 0.9 * gradient), 0.25),
        (format!("{}:1,{}:0", 0.5 * gradient, 0.9 * gradient), 0.0),
    ] {
        let with_factor = ExactField::new(&volume, &with(&tf, &opacity)).optical_depth(a, b);
        assert_close(with_factor, factor * plain, EXACT);
    }
    // Gradients over a mean voxel spacing.
    let mean_mm = volume.spacing_mm().iter().sum::<f64>() / 3.0;
    let per_voxel = with(&tf, &format!("0:0,{}:1,per=voxel", 2.0 * gradient * mean_mm));
    assert_close(ExactField::new(&volume, &per_voxel).optical_depth(a, b), 0.5 * plain, EXACT);
}

/// The distance from a point has gradient 1; that of its samples approaches it as voxels shrink.
#[test]
fn samples_of_a_distance_approach_its_gradient() {
    let error = |n: usize| {
        let spacing = 12.0 / n as f64;
        let affine = DAffine3::from_scale(DVec3::splat(spacing));
        let volume = volume([n + 1; 3], affine, |i, j, k| {
            (DVec3::new(i, j, k) * spacing - DVec3::new(6.1, 5.7, 6.3)).length()
        });
        let tf = extinction(&[(2.0, 0.1), (6.0, 0.4)]);
        let ends = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(9.0, 4.0, 10.0)];
        let plain = ExactField::new(&volume, &tf).optical_depth(ends[0], ends[1]);
        let with_factor = ExactField::new(&volume, &with(&tf, "0:0,2:1")).optical_depth(ends[0], ends[1]);
        (with_factor / plain - 0.5).abs()
    };
    let errors = [12, 24, 48].map(error);
    assert!(errors[2] < 1e-3 && errors[2] < 0.5 * errors[1] && errors[1] < 0.5 * errors[0], "{errors:?}");
}

/// Optical depths along a ray, and the depths that have them, agree with those of shorter segments.
#[test]
fn curves_and_their_inverses_agree() {
    let volume = rough_volume(oblique());
    let [a, b] =
        [DVec3::new(-1.0, 0.3, 0.2), DVec3::new(9.0, 7.0, 5.5)].map(|p| oblique().transform_point3(p));
    for tf in transfer_functions() {
        for opacity in OPACITIES {
            let tf = with(&tf, opacity);
            let field = ExactField::new(&volume, &tf);
            let curve = field.curve(a, b);
            assert_close(curve.total(), field.optical_depth(a, b), EXACT);
            for k in 1..=20 {
                let depth_mm = a.distance(b) * f64::from(k) / 20.0;
                let end = a + (b - a).normalize() * depth_mm;
                assert_close(curve.optical_depth_at(depth_mm), field.optical_depth(a, end), STATED);
                let tau = curve.total() * f64::from(k) / 20.0;
                if let Some(depth_mm) = curve.depth_of_optical_depth(tau) {
                    assert_close(curve.optical_depth_at(depth_mm), tau, STATED);
                }
            }
        }
    }
}

/// With the light at the eye, the picture has a closed form of the optical depth of its rays.
#[test]
fn picture_lit_from_the_eye() {
    let volume = rough_volume(oblique());
    let mut tf = with(&extinction(&[(20.0, 0.0), (60.0, 0.4), (90.0, 0.1)]), OPACITIES[1]);
    let color = [0.9, 0.5, 0.25];
    tf.points.iter_mut().for_each(|p| p.color = color);
    let field = ExactField::new(&volume, &tf);
    let camera = Camera { up: DVec3::Z, ..Camera::framing(&volume, DVec3::Z, 35.0) };
    let lights = vec![Light::Point { position: camera.eye }.into()];
    let base = Scene::framing(&volume);
    let scene = Scene { camera, lights, width: 12, height: 8, ambient: 0.2, background: [0.0; 3], ..base };
    let mut seen = 0;
    for ((row, column, channel), got) in field.picture(&scene).indexed_iter() {
        let direction = scene.camera.ray_direction(column as f64, row as f64, 12, 8);
        let t = (-field.curve_along(scene.camera.eye, direction, f64::INFINITY).total()).exp();
        let want = match channel {
            3 => 1.0 - t,
            c => color[c] * (0.2 * (1.0 - t) + 0.8 * 0.5 * (1.0 - t * t)),
        };
        assert!((f64::from(*got) - want).abs() < 1e-4, "{row} {column} {channel}: {got} {want}");
        seen += usize::from(t < 0.9);
    }
    assert!(seen > 40, "{seen}");
}

/// The factor 1 everywhere is no gradient opacity, and all labels share one.
#[test]
fn labels_share_the_factor_and_one_changes_nothing() {
    let volume = rough_volume(oblique());
    let [tf, other, ..] = &transfer_functions()[..] else { unreachable!() };
    assert_eq!(with(tf, "none"), *tf);
    let labels = Array3::from_shape_fn((6, 7, 9), |(k, j, i)| (i / 3 + j / 2 + k / 2) as u8 % 2);
    let labels = volume_of(Voxels::U8(labels), Scaling::IDENTITY, oblique());
    let labels = Arc::new(Labels::sampled(&labels, &volume).unwrap());
    let labelled = rough_volume(oblique()).labelled(labels).unwrap();
    let [a, b] =
        [DVec3::new(-1.0, 0.3, 0.2), DVec3::new(9.0, 7.0, 5.5)].map(|p| oblique().transform_point3(p));
    // Both labels have the function of one volume without labels.
    let rule = |tf: &TransferFunction| LabelRule {
        labels: vec![1],
        visibility: LabelVisibility::Visible(Box::new(tf.clone())),
    };
    for opacity in OPACITIES {
        let whole = with(tf, opacity);
        let of_labels = TransferFunction { rules: vec![rule(tf)], ..whole.clone() };
        let depth = |volume: &Volume, tf: &TransferFunction| ExactField::new(volume, tf).optical_depth(a, b);
        let want = depth(&volume, &whole);
        assert_close(depth(&labelled, &of_labels), want, STATED);
        let differing = TransferFunction { rules: vec![rule(other)], ..whole.clone() };
        let off = depth(&labelled, &differing) - want;
        assert!(off.abs() > 1e-3, "{opacity}: {off}");
    }
}
