//! Gradient opacity along a ray: the factor on the extinction by the gradient magnitude of the value.
//!
//! Within a cell the components of the gradient of the trilinear value are quadratics of the distance along a ray, and its
//! squared magnitude is a polynomial of degree 4. A cell is cut where the magnitude passes a point of the gradient
//! opacity, and where it is close to zero, since the magnitude bends there. Between cuts extinction times factor is
//! smooth, and is integrated by adaptive quadrature.

use super::cell::CellChord;
use super::cubic::Cubic;
use super::law::{GAUSS_6, GAUSS_10, Law};
use crate::transfer::{GradientOpacity, GradientPoint};
use glam::{DMat3, DVec3};

/// Relative difference of Gauss rules with 6 and 10 points up to which the latter is taken. Its error is smaller by far.
const TOLERANCE: f64 = 1e-11;
/// Rounding error of the scalar value and of the gradient magnitude, in units of their largest terms.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Largest number of halvings of an interval, and of intervals into which it is divided.
const MOST_HALVINGS: u32 = 50;
const MOST_PANELS: u32 = 4000;
/// Smallest gradient magnitude along a chord, relative to the largest, below which the chord is cut there.
const SMALL: f64 = 0.1;

/// Linear segment of a gradient opacity: the factor is `factor + slope * (g - magnitude)` at the gradient magnitude `g`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FactorRamp {
    magnitude: f64,
    factor: f64,
    slope: f64,
}

impl FactorRamp {
    fn constant(factor: f64) -> Self {
        Self { magnitude: 0.0, factor, slope: 0.0 }
    }

    #[inline]
    fn at(&self, magnitude: f64) -> f64 {
        (self.factor + self.slope * (magnitude - self.magnitude)).clamp(0.0, 1.0)
    }
}

/// Gradient opacity of a volume, as one formula for each interval of the gradient magnitude.
#[derive(Debug, Clone)]
pub(super) struct GradientLaws {
    /// Gradient magnitudes between the intervals, ascending.
    cuts: Vec<f64>,
    ramps: Vec<FactorRamp>,
    /// Gradient in world space, per mm, of a gradient in index space.
    world_from_index: DMat3,
}

impl GradientLaws {
    /// Creates the formulas of a gradient opacity for a volume with the given linear map from world to index space.
    pub fn new(opacity: &GradientOpacity, index_from_world: DMat3) -> Self {
        let points = opacity.points();
        let (mut cuts, mut ramps) = (Vec::new(), Vec::new());
        ramps.extend(points.first().map(|p| FactorRamp::constant(p.factor)));
        for ab in points.windows(2) {
            let [GradientPoint { magnitude, factor }, b] = [ab[0], ab[1]];
            if b.magnitude > magnitude {
                cuts.push(magnitude);
                let slope = (b.factor - factor) / (b.magnitude - magnitude);
                ramps.push(match slope == 0.0 {
                    true => FactorRamp::constant(factor),
                    false => FactorRamp { magnitude, factor, slope },
                });
            }
        }
        if let Some(last) = points.last() {
            cuts.push(last.magnitude);
            ramps.push(FactorRamp::constant(last.factor));
        }
        // With index = M world, the gradient in world is the transpose of M times that in index space.
        Self { cuts, ramps, world_from_index: index_from_world.transpose() }
    }

    /// Divides the chord of a volume cell into the intervals on which the factor has one formula. Calls `visit` with the
    /// ends of each interval, as fractions of the chord, and with the factor over the whole chord. Intervals with factor
    /// 0 are skipped.
    pub fn intervals(&self, chord: &CellChord<'_>, mut visit: impl FnMut([f64; 2], Factor)) {
        let gradient = GradientAlong::of(chord, &self.world_from_index);
        let ends = self.cuts_along(&gradient);
        let mut pending: Option<([f64; 2], FactorRamp)> = None;
        let mut emit = |[from, to]: [f64; 2], ramp: FactorRamp| {
            if (ramp.factor, ramp.slope) != (0.0, 0.0) {
                visit([from, to], Factor { ramp, gradient });
            }
        };
        for (from, to) in ends.iter().zip(&ends[1..]).filter(|(from, to)| to > from) {
            let middle = gradient.magnitude(0.5 * (from + to));
            let ramp = self.ramps[self.cuts.partition_point(|cut| *cut <= middle)];
            pending = match pending {
                // A constant factor has no bend where the gradient vanishes.
                Some((whole, before)) if before == ramp && ramp.slope == 0.0 => Some(([whole[0], *to], ramp)),
                Some((whole, before)) => {
                    emit(whole, before);
                    Some(([*from, *to], ramp))
                }
                None => Some(([*from, *to], ramp)),
            };
        }
        if let Some((whole, ramp)) = pending {
            emit(whole, ramp);
        }
    }

    /// Returns the fractions of a chord, ascending from 0 to 1, at which the magnitude passes a cut or is a small
    /// extremum.
    fn cuts_along(&self, gradient: &GradientAlong) -> Vec<f64> {
        let mut bends = vec![0.0];
        bends.extend(gradient.extrema());
        bends.push(1.0);
        let at_bends: Vec<f64> = bends.iter().map(|x| gradient.magnitude(*x)).collect();
        let largest = at_bends.iter().fold(0.0, |a: f64, b| a.max(*b));
        let mut ends = vec![0.0];
        for i in 1..bends.len() {
            let ([a, b], [low, high]) = ([at_bends[i - 1], at_bends[i]], [bends[i - 1], bends[i]]);
            let (least, most) = (a.min(b), a.max(b));
            let first = self.cuts.partition_point(|cut| *cut <= least);
            let passed = self.cuts[first..].iter().take_while(|cut| **cut < most);
            let mut roots: Vec<f64> = passed.map(|cut| gradient.solve(*cut, [low, high], b > a)).collect();
            if b < a {
                roots.reverse();
            }
            ends.extend(roots);
            if i + 1 < bends.len() && b < SMALL * largest {
                ends.push(high);
            }
        }
        ends.push(1.0);
        ends
    }
}

/// Gradient of the value along a chord, value units per mm: each component is a quadratic `c[0] + c[1] x + c[2] x^2`.
#[derive(Debug, Clone, Copy)]
struct GradientAlong([[f64; 3]; 3]);

impl GradientAlong {
    fn of(chord: &CellChord<'_>, world_from_index: &DMat3) -> Self {
        let ([x, y, z], [p, q, r]) = (chord.start, chord.displacement);
        let [v000, v100, v010, v110, v001, v101, v011, v111] = *chord.corner;
        let (a, b, c) = (v100 - v000, v010 - v000, v001 - v000);
        let (ab, ac, bc) = ((v110 - v010) - a, (v101 - v001) - a, (v011 - v001) - b);
        let abc = ((v111 - v011) - (v101 - v001)) - ab;
        // The derivative along one axis is bilinear in the other two.
        let bilinear = |constant: f64, [first, second]: [f64; 2], [u, v]: [f64; 2], [du, dv]: [f64; 2]| {
            [
                constant + first * u + (second + abc * u) * v,
                first * du + second * dv + abc * (u * dv + v * du),
                abc * du * dv,
            ]
        };
        let in_index = [
            bilinear(a, [ab, ac], [y, z], [q, r]),
            bilinear(b, [ab, bc], [x, z], [p, r]),
            bilinear(c, [ac, bc], [x, y], [p, q]),
        ];
        let power = |i: usize| *world_from_index * DVec3::from_array(in_index.map(|component| component[i]));
        let [constant, linear, quadratic] = [power(0), power(1), power(2)];
        Self(std::array::from_fn(|axis| [constant[axis], linear[axis], quadratic[axis]]))
    }

    #[inline]
    fn magnitude(&self, x: f64) -> f64 {
        self.0.iter().map(|[a, b, c]| (a + x * (b + x * c)).powi(2)).sum::<f64>().sqrt()
    }

    /// Returns the sum of the absolute terms of all components, to which rounding errors are proportional.
    fn size(&self) -> f64 {
        self.0.iter().flatten().map(|c| c.abs()).sum()
    }

    /// Returns the extrema of the magnitude strictly inside `(0, 1)`, ascending.
    fn extrema(&self) -> Vec<f64> {
        // Coefficients of half the derivative of the squared magnitude, a cubic.
        let mut slope = [0.0; 4];
        for [a, b, c] in self.0 {
            slope[0] += a * b;
            slope[1] += b * b + 2.0 * a * c;
            slope[2] += 3.0 * b * c;
            slope[3] += 2.0 * c * c;
        }
        let slope = Cubic(slope);
        let [first, second] = slope.turning_points();
        let mut roots = Vec::new();
        let mut low = 0.0;
        for high in [first, second, 1.0] {
            let (a, b) = (slope.at(low), slope.at(high));
            if high > low && (a < 0.0) != (b < 0.0) {
                roots.push(slope.solve(0.0, low, high, b > a));
            }
            low = high;
        }
        roots.retain(|x| *x > 0.0 && *x < 1.0);
        roots
    }

    /// Returns the position between `low` and `high` at which the magnitude is `magnitude`; it must be monotone there.
    fn solve(&self, magnitude: f64, [mut low, mut high]: [f64; 2], rising: bool) -> f64 {
        const MOST_STEPS: usize = 200;
        let sign = if rising { 1.0 } else { -1.0 };
        let excess = |x: f64| sign * (self.magnitude(x) - magnitude);
        let (mut at_low, mut at_high) = (excess(low), excess(high));
        for step in 0..MOST_STEPS {
            if high - low <= f64::EPSILON * high {
                break;
            }
            // The secant, and bisection at each third step.
            let secant = low + (high - low) * (at_low / (at_low - at_high));
            let inside = secant > low && secant < high && step % 3 != 2;
            let x = if inside { secant } else { 0.5 * (low + high) };
            let at_x = excess(x);
            if at_x == 0.0 {
                return x;
            }
            if at_x < 0.0 { (low, at_low) = (x, at_x) } else { (high, at_high) = (x, at_x) }
        }
        0.5 * (low + high)
    }

    fn restrict(&self, from: f64, scale: f64) -> Self {
        Self(
            self.0.map(|[a, b, c]| {
                [a + from * (b + from * c), (b + 2.0 * c * from) * scale, c * scale * scale]
            }),
        )
    }
}

/// Factor on the extinction along an interval of a ray, at positions from 0 at its start to 1 at its end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Factor {
    ramp: FactorRamp,
    gradient: GradientAlong,
}

impl Factor {
    /// Returns the factor at a position of the interval.
    #[inline]
    pub fn at(&self, x: f64) -> f64 {
        self.ramp.at(self.gradient.magnitude(x))
    }

    /// Returns the factor if it is the same on the whole interval.
    pub fn constant(&self) -> Option<f64> {
        (self.ramp.slope == 0.0).then_some(self.ramp.factor)
    }

    /// Returns the factor along the part of the interval from `from` to `to`.
    pub fn restrict(&self, from: f64, to: f64) -> Self {
        Self { ramp: self.ramp, gradient: self.gradient.restrict(from, to - from) }
    }

    /// Returns the integral of extinction times this factor over positions in `[from, to]`, where the scalar value is the
    /// cubic `value`.
    pub fn integral(&self, law: &Law, value: &Cubic, from: f64, to: f64) -> f64 {
        match self.constant() {
            Some(factor) => factor * law.integral(value, from, to),
            None => {
                let integrand = Integrand {
                    law,
                    value,
                    factor: self,
                    value_rounding: ROUNDING * value.0.iter().map(|c| c.abs()).sum::<f64>(),
                    magnitude_rounding: ROUNDING * (self.gradient.size() + self.ramp.magnitude),
                };
                integrand.integral(from, to, MOST_HALVINGS, &mut { MOST_PANELS })
            }
        }
    }
}

/// Extinction times factor along an interval of a ray, with the rounding errors of scalar value and gradient magnitude.
struct Integrand<'a> {
    law: &'a Law,
    value: &'a Cubic,
    factor: &'a Factor,
    value_rounding: f64,
    magnitude_rounding: f64,
}

impl Integrand<'_> {
    /// Returns the integrand at a position, and a bound on its rounding error.
    fn at(&self, x: f64) -> (f64, f64) {
        let (value, factor) = (self.value.at(x), self.factor.at(x));
        let sigma = self.law.extinction(value);
        let rounding = factor * self.law.slope(value) * self.value_rounding
            + sigma * self.factor.ramp.slope.abs() * self.magnitude_rounding;
        (sigma * factor, rounding)
    }

    /// Integrates by adaptive bisection: Gauss rules with 6 and 10 points are compared.
    fn integral(&self, from: f64, to: f64, halvings_left: u32, panels_left: &mut u32) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let mut noise = 0.0f64;
        let mut rule = |nodes: &[(f64, f64)]| {
            let mut sum = 0.0;
            for &(x, weight) in nodes {
                for at in [middle - half * x, middle + half * x] {
                    let (integrand, rounding) = self.at(at);
                    sum += weight * integrand;
                    noise = noise.max(rounding);
                }
            }
            half * sum
        };
        let (coarse, fine) = (rule(&GAUSS_6), rule(&GAUSS_10));
        let enough = TOLERANCE * fine + noise * 2.0 * half;
        if (fine - coarse).abs() <= enough || halvings_left == 0 || *panels_left == 0 {
            return fine;
        }
        *panels_left -= 1;
        self.integral(from, middle, halvings_left - 1, panels_left)
            + self.integral(middle, to, halvings_left - 1, panels_left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opacity(text: &str) -> GradientOpacity {
        text.parse().unwrap()
    }

    fn chord(corner: &[f64; 8]) -> CellChord<'_> {
        CellChord { corner, start: [0.1, 0.7, 0.2], displacement: [0.6, -0.5, 0.8] }
    }

    const CORNER: [f64; 8] = [3.0, -2.0, 7.0, 1.0, 0.5, 4.0, -6.0, 2.5];

    #[test]
    fn the_gradient_is_the_slope_of_the_value() {
        let scale = DMat3::from_diagonal(DVec3::new(2.0, 0.5, 4.0));
        let along = GradientAlong::of(&chord(&CORNER), &scale);
        let value = |[x, y, z]: [f64; 3]| {
            let mix = |a: f64, b: f64, w: f64| a + (b - a) * w;
            let row = |i: usize| mix(CORNER[i], CORNER[i + 1], x);
            mix(mix(row(0), row(2), y), mix(row(4), row(6), y), z)
        };
        for t in [0.0, 0.3, 1.0] {
            let at = |axis: usize, h: f64| {
                let chord = chord(&CORNER);
                let mut p: [f64; 3] = std::array::from_fn(|i| chord.start[i] + t * chord.displacement[i]);
                p[axis] += h;
                value(p)
            };
            let slopes: [f64; 3] = std::array::from_fn(|axis| at(axis, 0.5) - at(axis, -0.5));
            let want = (scale * DVec3::from_array(slopes)).length();
            assert!((along.magnitude(t) - want).abs() < 1e-12, "{t}");
            assert!((along.restrict(0.2, 0.5).magnitude((t - 0.2) / 0.5) - want).abs() < 1e-12);
        }
    }

    /// Each interval has one formula, and together they have the factor of the transfer function.
    #[test]
    fn intervals_have_the_factor_of_the_function() {
        let opacity = opacity("2:0.1,6:0.9,6:0.3,9:1,12:0");
        let laws = GradientLaws::new(&opacity, DMat3::IDENTITY);
        let along = GradientAlong::of(&chord(&CORNER), &DMat3::IDENTITY);
        let mut covered = Vec::new();
        laws.intervals(&chord(&CORNER), |[from, to], factor| {
            covered.push([from, to]);
            for i in 1..20 {
                let x = from + (to - from) * f64::from(i) / 20.0;
                let want = opacity.factor(along.magnitude(x));
                assert!((factor.at(x) - want).abs() < 1e-12, "{x}");
                let part = factor.restrict(from, to);
                assert!((part.at(f64::from(i) / 20.0) - want).abs() < 1e-12);
            }
        });
        assert!(covered.len() > 2 && covered[0][0] == 0.0, "{covered:?}");
        let visible = (0..1000).map(|i| f64::from(i) / 1000.0).filter(|x| along.magnitude(*x) < 12.0);
        assert!(visible.into_iter().all(|x| covered.iter().any(|[a, b]| *a <= x && x <= *b)), "{covered:?}");
    }

    #[test]
    fn extrema_are_where_the_magnitude_turns() {
        // (x - 0.3, 0, 0) and (0, 1 - x, 2 x): minima at 0.3 and at 0.2.
        let one = GradientAlong([[-0.3, 1.0, 0.0], [0.0; 3], [0.0; 3]]);
        assert!(one.extrema().len() == 1 && (one.extrema()[0] - 0.3).abs() < 1e-15, "{:?}", one.extrema());
        assert_eq!(one.magnitude(0.3), 0.0);
        let two = GradientAlong([[0.0; 3], [1.0, -1.0, 0.0], [0.0, 2.0, 0.0]]);
        assert!((two.extrema()[0] - 0.2).abs() < 1e-15);
        assert_eq!(GradientAlong([[5.0, 0.0, 0.0]; 3]).extrema(), [0.0; 0]);
    }

    /// The magnitude |x - 0.3| times a linear extinction has a closed form on both sides of the bend.
    #[test]
    fn a_vanishing_gradient_is_integrated_exactly() {
        let gradient = GradientAlong([[-0.3, 1.0, 0.0], [0.0; 3], [0.0; 3]]);
        let laws = GradientLaws::new(&opacity("0:0,1:1"), DMat3::IDENTITY);
        assert_eq!(laws.cuts_along(&gradient).len(), 3, "cut where it vanishes");
        let factor = Factor { ramp: FactorRamp { magnitude: 0.0, factor: 0.0, slope: 1.0 }, gradient };
        let value = Cubic([0.0, 1.0, 0.0, 0.0]);
        let law = Law::Constant(2.0);
        let want = 0.3f64.powi(2) + 0.7f64.powi(2);
        let got = factor.integral(&law, &value, 0.0, 0.3) + factor.integral(&law, &value, 0.3, 1.0);
        assert!((got - want).abs() < 1e-15, "{got} {want}");
        // Bisection alone resolves the bend, too.
        let uncut = factor.integral(&law, &value, 0.0, 1.0);
        assert!((uncut - want).abs() < 1e-12, "{uncut} {want}");
    }

    /// For the magnitude sqrt(x^2 + d^2), the integral has a closed form, however close to zero the magnitude is.
    #[test]
    fn a_nearly_vanishing_gradient_is_integrated_exactly() {
        for d in [1e-9f64, 1e-5, 1e-2, 0.3, 2.0] {
            let gradient = GradientAlong([[-0.5, 1.0, 0.0], [d, 0.0, 0.0], [0.0; 3]]);
            let factor = Factor { ramp: FactorRamp { magnitude: 0.0, factor: 0.0, slope: 0.25 }, gradient };
            let root = (0.25 + d * d).sqrt();
            let want = 0.25 * 3.0 * (0.5 * root + d * d * (0.5 / d).asinh());
            let got = factor.integral(&Law::Constant(3.0), &Cubic([0.0; 4]), 0.0, 1.0);
            assert!((got / want - 1.0).abs() < 1e-12, "{d}: {got} {want}");
        }
    }
}
