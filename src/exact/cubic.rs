//! Cubic polynomials on the unit interval. The value of a trilinear field along a ray within one cell is such a
//! cubic.

/// Cubic polynomial `c[0] + c[1] x + c[2] x^2 + c[3] x^3` for `x` in `[0, 1]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cubic(pub [f64; 4]);

impl Cubic {
    #[inline]
    pub fn at(&self, x: f64) -> f64 {
        let [a, b, c, d] = self.0;
        a + x * (b + x * (c + x * d))
    }

    #[inline]
    pub fn slope_at(&self, x: f64) -> f64 {
        let [_, b, c, d] = self.0;
        b + x * (2.0 * c + x * (3.0 * d))
    }

    /// Returns the cubic polynomial in `y` after the substitution `x = from + scale * y`.
    pub fn substitute(&self, from: f64, scale: f64) -> Self {
        let [_, _, c, d] = self.0;
        Self([
            self.at(from),
            self.slope_at(from) * scale,
            (c + 3.0 * d * from) * scale * scale,
            d * scale * scale * scale,
        ])
    }

    /// Returns the part of the cubic polynomial on the interval `[from, to]`, as a cubic over `[0, 1]`.
    pub fn restrict(&self, from: f64, to: f64) -> Self {
        self.substitute(from, to - from)
    }

    /// Returns the turning points (local extrema) of the cubic polynomial strictly inside `(0, 1)`, ascending;
    /// missing ones are 1.
    pub fn turning_points(&self) -> [f64; 2] {
        let [_, c, b, a] = [self.0[0], self.0[1], self.0[2], 3.0 * self.0[3]];
        let discriminant = b * b - a * c;
        if discriminant.is_nan() || discriminant <= 0.0 {
            return [1.0; 2];
        }
        // Roots of a x^2 + 2 b x + c without cancellation; infinities and NaN are outside of (0, 1).
        let q = -(b + discriminant.sqrt().copysign(b));
        let inside = |x: f64| if x > 0.0 && x < 1.0 { x } else { 1.0 };
        let (x0, x1) = (inside(q / a), inside(c / q));
        [x0.min(x1), x0.max(x1)]
    }

    /// Returns the position between `low` and `high` at which the cubic has the value `v`; the cubic must be monotone
    /// there.
    ///
    /// The solver is Newton's method within a shrinking bracket. It ends when the residual is as small as a rounding
    /// error, or the bracket is empty.
    pub fn solve(&self, v: f64, mut low: f64, mut high: f64, rising: bool) -> f64 {
        const MOST_STEPS: usize = 120;
        let shifted = Self([self.0[0] - v, self.0[1], self.0[2], self.0[3]]);
        let rounding = f64::EPSILON * (v.abs() + self.0.iter().map(|c| c.abs()).sum::<f64>()) * 0.5;
        let (at_low, at_high) = (shifted.at(low), shifted.at(high));
        let secant = low + (high - low) * (at_low / (at_low - at_high));
        let mut x = if secant > low && secant < high { secant } else { 0.5 * (low + high) };
        for _ in 0..MOST_STEPS {
            let residual = shifted.at(x);
            if residual.abs() <= rounding {
                break;
            }
            if (residual < 0.0) == rising {
                low = x;
            } else {
                high = x;
            }
            let newton = x - residual / shifted.slope_at(x);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let done = (next - x).abs() <= f64::EPSILON * high;
            x = next;
            if done {
                break;
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_points_are_where_the_slope_vanishes() {
        // (x - 1/4)(x - 3/4) is the slope.
        let cubic = Cubic([7.0, 0.1875, -0.5, 1.0 / 3.0]);
        let [a, b] = cubic.turning_points();
        assert!((a - 0.25).abs() < 1e-15 && (b - 0.75).abs() < 1e-15, "{a} {b}");
        assert_eq!(Cubic([1.0, 2.0, 0.0, 0.0]).turning_points(), [1.0, 1.0]);
        assert_eq!(Cubic([5.0, 0.0, 0.0, 0.0]).turning_points(), [1.0, 1.0]);
        let [a, b] = Cubic([0.0, -1.0, 1.0, 0.0]).turning_points();
        assert_eq!((a, b), (0.5, 1.0));
        let [a, b] = Cubic([0.0, -1.0, 1.0, 1e-18]).turning_points();
        assert!((a - 0.5).abs() < 1e-15 && b == 1.0);
    }

    #[test]
    fn solve_reaches_rounding() {
        let cubic = Cubic([-3.0, 1.0, 40.0, 500.0]);
        for v in [-3.0, -2.999_999, 0.0, 17.3, 537.9, 538.0] {
            let x = cubic.solve(v, 0.0, 1.0, true);
            assert!((cubic.at(x) - v).abs() <= 1e-12, "{v}: {x} gives {}", cubic.at(x));
        }
        // A root at an inflexion, where Newton's step is slow.
        let flat = Cubic([-0.125, 0.75, -1.5, 1.0]);
        assert!((flat.solve(0.0, 0.0, 1.0, true) - 0.5).abs() < 1e-5);
        assert_eq!(flat.solve(0.0, 0.0, 1.0, true), flat.solve(0.0, 0.0, 1.0, true));
    }

    #[test]
    fn restrict_keeps_the_curve() {
        let cubic = Cubic([1.0, -2.0, 3.0, -4.0]);
        let part = cubic.restrict(0.25, 0.75);
        for y in [0.0, 0.3, 1.0] {
            assert!((part.at(y) - cubic.at(0.25 + 0.5 * y)).abs() < 1e-15);
        }
    }
}
