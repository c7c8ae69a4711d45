//! Transfer functions as formulas (laws) that give extinction on intervals of the scalar value, and integrals of
//! extinction along a ray on which the value is a cubic.

use super::cubic::Cubic;
use crate::transfer::{ControlPoint, MAX_OPACITY, Quantity, TransferFunction};

/// Gauss-Legendre rules on `[-1, 1]`: the positive nodes and their weights.
const GAUSS_4: [(f64, f64); 2] =
    [(0.33998104358485626, 0.6521451548625461), (0.8611363115940526, 0.34785484513745385)];
pub(super) const GAUSS_6: [(f64, f64); 3] = [
    (0.2386191860831969, 0.46791393457269104),
    (0.6612093864662645, 0.3607615730481386),
    (0.932469514203152, 0.17132449237917036),
];
pub(super) const GAUSS_10: [(f64, f64); 5] = [
    (0.14887433898163122, 0.29552422471475287),
    (0.4333953941292472, 0.26926671930999635),
    (0.6794095682990244, 0.21908636251598204),
    (0.8650633666889845, 0.1494513491505806),
    (0.9739065285171717, 0.06667134430868814),
];

/// Linear segment of a transfer function: opacity or extinction is `amount + slope * (s - value)` at the scalar value
/// `s`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ramp {
    value: f64,
    amount: f64,
    slope: f64,
}

impl Ramp {
    fn between(a: &ControlPoint, b: &ControlPoint) -> Self {
        Self { value: a.value, amount: a.amount, slope: (b.amount - a.amount) / (b.value - a.value) }
    }

    #[inline]
    fn at(&self, s: f64) -> f64 {
        self.amount + self.slope * (s - self.value)
    }

    #[inline]
    fn along(&self, s: &Cubic) -> Cubic {
        let [a, b, c, d] = s.0;
        Cubic([self.at(a), self.slope * b, self.slope * c, self.slope * d])
    }
}

/// Formula of extinction as a function of the scalar value, on one interval of a transfer function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Law {
    /// Extinction is zero on the whole interval of the transfer function.
    Clear,
    /// Extinction is constant on the interval of the transfer function, 1/mm.
    Constant(f64),
    /// Extinction (1/mm) is a linear function of the scalar value, on one interval of the transfer function.
    Extinction(Ramp),
    /// Opacity per reference length is a linear function of the scalar value, on one interval of the transfer
    /// function; `per_mm` is the reciprocal of the reference length.
    Opacity { ramp: Ramp, per_mm: f64 },
}

impl Law {
    /// Returns the extinction at the scalar value `s`, 1/mm.
    #[inline]
    pub fn extinction(&self, s: f64) -> f64 {
        match self {
            Self::Clear => 0.0,
            Self::Constant(sigma) => *sigma,
            Self::Extinction(ramp) => ramp.at(s).max(0.0),
            Self::Opacity { ramp, per_mm } => absorbance(ramp.at(s)) * per_mm,
        }
    }

    /// Returns the absolute slope of the extinction at the scalar value `s`, 1/mm per value.
    #[inline]
    pub fn slope(&self, s: f64) -> f64 {
        match self {
            Self::Clear | Self::Constant(_) => 0.0,
            Self::Extinction(ramp) => ramp.slope.abs(),
            Self::Opacity { ramp, per_mm } => {
                ramp.slope.abs() * per_mm / (1.0 - ramp.at(s).clamp(0.0, MAX_OPACITY))
            }
        }
    }

    /// Returns the integral of the extinction over `x` in `[from, to]`, where the scalar value along the ray is the
    /// cubic `s(x)`.
    #[inline]
    pub fn integral(&self, s: &Cubic, from: f64, to: f64) -> f64 {
        match self {
            Self::Clear => 0.0,
            Self::Constant(sigma) => sigma * (to - from),
            // Two-point Gauss-Legendre is exact for a cubic.
            Self::Extinction(ramp) => {
                let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
                let node = half / 3f64.sqrt();
                half * (ramp.at(s.at(middle - node)) + ramp.at(s.at(middle + node))).max(0.0)
            }
            Self::Opacity { ramp, per_mm } => per_mm * absorbance_integral(&ramp.along(s), from, to),
        }
    }
}

/// Returns the optical depth `-ln(1 - opacity)` of an opacity.
#[inline]
fn absorbance(opacity: f64) -> f64 {
    -(-opacity.clamp(0.0, MAX_OPACITY)).ln_1p()
}

/// Returns the integral of `-ln(1 - opacity(x))` over `[from, to]`, to a relative error of about 1e-13.
///
/// With `z` in `[-1, 1]` over the interval, `1 - opacity = q (1 + e1 z + e2 z^2 + e3 z^3)`. Where
/// `|e1| R + |e2| R^2 + |e3| R^3 <= 0.9` the logarithm is analytic in the disc of radius `R`, which holds the
/// Bernstein ellipse of parameter `rho = R + sqrt(R^2 - 1)`, and n-point Gauss-Legendre errs by at most
/// `64/15 ln(10) rho^(-2n) / (1 - rho^-2)`. The radii below make that 1e-13 or less; no radius serves close to
/// opacity 1, where the interval is halved instead.
fn absorbance_integral(opacity: &Cubic, from: f64, to: f64) -> f64 {
    const MOST_HALVINGS: u32 = 60;
    absorbance_part(opacity, from, to, MOST_HALVINGS)
}

fn absorbance_part(opacity: &Cubic, from: f64, to: f64, halvings_left: u32) -> f64 {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let Cubic([m, b, c, d]) = opacity.substitute(middle, half);
    let q = 1.0 - m.clamp(0.0, MAX_OPACITY);
    let (b, c, d) = (b.abs(), c.abs(), d.abs());
    let analytic_within = |radius: f64| radius * (b + radius * (c + radius * d)) <= 0.9 * q;
    let rule = |nodes: &[(f64, f64)]| {
        let pair = |&(x, w): &(f64, f64)| {
            w * (absorbance(opacity.at(middle - half * x)) + absorbance(opacity.at(middle + half * x)))
        };
        half * nodes.iter().map(pair).sum::<f64>()
    };
    if analytic_within(45.0) {
        rule(&GAUSS_4)
    } else if analytic_within(8.7) {
        rule(&GAUSS_6)
    } else if analytic_within(2.75) || halvings_left == 0 {
        rule(&GAUSS_10)
    } else {
        absorbance_part(opacity, from, middle, halvings_left - 1)
            + absorbance_part(opacity, middle, to, halvings_left - 1)
    }
}

/// Transfer function, as one formula of extinction (law) for each interval of the scalar value. The interval of
/// `laws[i]` runs from `cuts[i - 1]` up to, but without, `cuts[i]`.
#[derive(Debug, Clone)]
pub(super) struct Laws {
    pub cuts: Vec<f64>,
    pub laws: Vec<Law>,
    /// Number of intervals of the transfer function with extinction (not [`Law::Clear`]) before each interval.
    active_before: Vec<u32>,
    /// Limits of the scalar values with extinction: the transfer function has none below `clear_below`, and none from
    /// `clear_from` on.
    clear_below: f64,
    clear_from: f64,
}

impl Laws {
    pub fn new(tf: &TransferFunction) -> Self {
        let (mut cuts, mut laws) = (Vec::new(), Vec::new());
        if let (Some(first), Some(last)) = (tf.points.first(), tf.points.last()) {
            laws.push(constant(tf, first.amount));
            let mut push = |from: f64, law: Law| {
                cuts.push(from);
                laws.push(law);
            };
            for ab in tf.points.windows(2).filter(|ab| ab[1].value > ab[0].value) {
                stretch(tf, &ab[0], &ab[1], &mut push);
            }
            push(last.value, constant(tf, last.amount));
        } else {
            laws.push(Law::Clear);
        }
        let mut active_before = vec![0];
        for law in &laws {
            active_before.push(active_before[active_before.len() - 1] + u32::from(*law != Law::Clear));
        }
        let below = |i: usize| i.checked_sub(1).map_or(f64::NEG_INFINITY, |i| cuts[i]);
        let clear_below = laws.iter().position(|l| *l != Law::Clear).map_or(f64::INFINITY, below);
        let clear_from = match laws.iter().rposition(|l| *l != Law::Clear) {
            Some(i) => cuts.get(i).copied().unwrap_or(f64::INFINITY),
            None => f64::NEG_INFINITY,
        };
        Self { cuts, laws, active_before, clear_below, clear_from }
    }

    /// Returns the index of the transfer function's interval that contains the scalar value `value`.
    #[inline]
    pub fn interval(&self, value: f64) -> usize {
        self.cuts.partition_point(|cut| *cut <= value)
    }

    /// Returns the index of the transfer function's interval just below the scalar value `value`.
    #[inline]
    pub fn interval_below(&self, value: f64) -> usize {
        self.cuts.partition_point(|cut| *cut < value)
    }

    /// Returns the indices of the transfer function's intervals that contain `min` and `max`; `None` if there is no
    /// extinction between the two.
    #[inline]
    pub fn active(&self, min: f64, max: f64) -> Option<(usize, usize)> {
        if max < self.clear_below || min >= self.clear_from {
            return None;
        }
        let (first, last) = (self.interval(min), self.interval(max));
        (self.active_before[last + 1] > self.active_before[first]).then_some((first, last))
    }
}

fn constant(tf: &TransferFunction, amount: f64) -> Law {
    if amount > 0.0 { Law::Constant(tf.extinction_of_amount(amount)) } else { Law::Clear }
}

/// Adds the formulas of extinction between two control points of the transfer function, `a` and `b`, where `b` has
/// the larger value.
fn stretch(tf: &TransferFunction, a: &ControlPoint, b: &ControlPoint, push: &mut impl FnMut(f64, Law)) {
    if a.amount == b.amount {
        return push(a.value, constant(tf, a.amount));
    }
    let ramp = Ramp::between(a, b);
    if tf.quantity == Quantity::Extinction {
        return push(a.value, Law::Extinction(ramp));
    }
    let law = Law::Opacity { ramp, per_mm: tf.reference_length_mm.recip() };
    // Opacity is clamped just below 1, which adds a kink like that of a control point.
    let clamped = [a, b].map(|p| p.amount > MAX_OPACITY);
    let kink = a.value + (MAX_OPACITY - a.amount) / ramp.slope;
    let inside = kink > a.value && kink < b.value;
    match clamped {
        [true, true] => push(a.value, constant(tf, MAX_OPACITY)),
        [false, true] if inside => {
            push(a.value, law);
            push(kink, constant(tf, MAX_OPACITY));
        }
        [true, false] if inside => {
            push(a.value, constant(tf, MAX_OPACITY));
            push(kink, law);
        }
        _ => push(a.value, law),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tf(quantity: Quantity, points: &[(f64, f64)]) -> TransferFunction {
        TransferFunction { reference_length_mm: 2.0, ..TransferFunction::new(quantity, points) }
    }

    #[test]
    fn laws_agree_with_the_transfer_function() {
        let shapes: [&[(f64, f64)]; 6] = [
            &[(3.0, 0.4)],
            &[(0.0, 0.0), (10.0, 0.0), (10.0, 0.7), (20.0, 1.0), (30.0, 0.0)],
            &[(-5.0, 1.0), (5.0, 0.25), (5.0, 0.5)],
            &[(0.0, 0.3), (0.0, 0.0), (1.0, 0.9)],
            &[(0.0, 1.0), (1.0, 1.0), (2.0, 0.999_999_99)],
            &[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)],
        ];
        for (points, quantity) in
            shapes.iter().flat_map(|s| [(*s, Quantity::Opacity), (*s, Quantity::Extinction)])
        {
            let tf = tf(quantity, points);
            let laws = Laws::new(&tf);
            assert_eq!(laws.laws.len(), laws.cuts.len() + 1);
            assert!(laws.cuts.is_sorted_by(|a, b| a < b), "{:?}", laws.cuts);
            for step in -400..=1400 {
                let v = f64::from(step) * 0.025;
                let (got, want) = (laws.laws[laws.interval(v)].extinction(v), tf.extinction(v));
                assert!((got - want).abs() <= 1e-12 * want.max(1.0), "{points:?} {v}: {got} {want}");
                assert_eq!(laws.active(v, v).is_some(), laws.laws[laws.interval(v)] != Law::Clear);
            }
            assert_eq!(laws.active(f64::MIN, f64::MAX).is_some(), points != shapes[5]);
        }
    }

    #[test]
    fn an_empty_transfer_function_is_clear() {
        let laws = Laws::new(&tf(Quantity::Opacity, &[]));
        assert_eq!(laws.active(f64::MIN, f64::MAX), None);
    }

    /// Optical depth of a linear opacity matches the closed form, from small slopes to singular ones.
    #[test]
    fn opacity_ramps_meet_the_closed_form() {
        let primitive = |q: f64| q * q.ln() - q;
        for (a, b) in [(0.0, 0.02), (0.1, 0.2), (0.0, 0.5), (0.0, 0.9), (0.3, 1.0 - 1e-5), (0.999, 0.9)] {
            let got = absorbance_integral(&Cubic([a, b - a, 0.0, 0.0]), 0.0, 1.0);
            let want = (primitive(1.0 - b) - primitive(1.0 - a)) / (b - a);
            assert!((got - want).abs() <= 1e-12 * want, "{a}..{b}: {got} {want}");
        }
        let faint = absorbance_integral(&Cubic([0.0, 1e-6, 0.0, 0.0]), 0.0, 1.0);
        assert!((faint / (5e-7 + 1e-12 / 6.0) - 1.0).abs() < 1e-12, "{faint}");
    }

    /// Optical depth of a cubic opacity with three known roots matches the closed form, a sum of linear terms.
    #[test]
    fn cubic_opacity_meets_the_closed_form() {
        // 1 - opacity = k (r0 - x)(r1 - x)(r2 + x); each factor integrates in closed form.
        let part = |u: f64, v: f64| (v * v.ln() - v) - (u * u.ln() - u);
        for (k, r0, r1, r2) in [(0.05, 2.0, 1.5, 4.0), (0.3, 1.000_01, 1.2, 1.4), (0.02, 3.0, 4.0, 3.5)] {
            let q: [f64; 4] = [r0 * r1 * r2, r0 * r1 - r2 * (r0 + r1), r2 - r0 - r1, 1.0].map(|c: f64| k * c);
            let opacity = Cubic([1.0 - q[0], -q[1], -q[2], -q[3]]);
            let want = -(f64::ln(k) + part(r0 - 1.0, r0) + part(r1 - 1.0, r1) + part(r2, r2 + 1.0));
            let got = absorbance_integral(&opacity, 0.0, 1.0);
            assert!((got - want).abs() <= 1e-12 * want.abs(), "{got} {want}");
        }
    }
}
