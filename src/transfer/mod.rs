//! Transfer functions: extinction (1/mm) and colour (linear RGB) as functions of a volume's scalar value, with rules
//! for segmentation labels and clip planes.

mod change;
mod clip;
mod file;
pub mod formats;
mod gradient;
mod labels;
mod pairs;
pub mod presets;
mod ranges;
mod tables;

pub use change::TransferChange;
pub use clip::{ClipPlane, MOST_CLIP_PLANES};
pub use gradient::{GradientLength, GradientOpacity, GradientPoint, MOST_GRADIENT_POINTS};
pub use labels::{LabelClass, MOST_LABEL_FUNCTIONS, SideBySide};
pub use pairs::{MORE_NODES, PAIR_BINS, PairTable};
pub use ranges::ExtinctionRanges;
pub(crate) use tables::extinction_range;
pub use tables::{MAX_INTERVALS, TABLE_BINS, TexelMapping, TransferTables, VALUE_BINS};

/// Quantity that a transfer function stores at its control points and interpolates linearly: opacity or extinction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Transfer function stores opacity in `[0, 1]` per reference length.
    Opacity,
    /// Transfer function stores extinction in 1/mm.
    Extinction,
}

/// Largest opacity of a transfer function, just below 1; opacity 1 would mean infinite extinction.
pub const MAX_OPACITY: f64 = 1.0 - 1.0 / 16_777_216.0;

/// Control point of a transfer function: scalar value, opacity or extinction, and colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlPoint {
    /// Scalar value at which the transfer function's control point lies, in the volume's scaled units (HU for CT).
    pub value: f64,
    /// Opacity or extinction of the transfer function at the control point; [`TransferFunction::quantity`] says
    /// which.
    pub amount: f64,
    /// Colour of the transfer function at the control point, linear RGB.
    pub color: [f64; 3],
}

/// Transfer function: piecewise linear between its control points, constant before the first and after the last. Two
/// points of equal value are a jump: the first holds below the value, the second from it on.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    /// Name of the transfer function for display.
    pub name: String,
    /// Unit of the transfer function's scalar values, e.g. `HU`.
    pub units: String,
    /// Length to which the transfer function's opacities refer, mm.
    pub reference_length_mm: f64,
    /// Quantity that the transfer function's control points store: opacity or extinction.
    pub quantity: Quantity,
    /// Control points of the transfer function by non-decreasing value: at least one, at most two of equal value.
    pub points: Vec<ControlPoint>,
    /// Factor on the extinction by the gradient magnitude of the value, also for segmentation labels; `None` where it is 1
    /// everywhere. The extinctions that functions here return are those before this factor.
    pub gradient_opacity: Option<GradientOpacity>,
    /// Rules of the transfer function for segmentation labels. Transfer-function files store neither such rules nor
    /// clip planes.
    pub rules: Vec<LabelRule>,
    /// Clip planes that cut away parts of the volume, at most [`MOST_CLIP_PLANES`].
    pub clip: Vec<ClipPlane>,
}

/// Visibility that a rule gives to the voxels of some segmentation labels: hidden, or with their own transfer
/// function.
#[derive(Debug, Clone, PartialEq)]
pub enum LabelVisibility {
    /// Voxels with these segmentation labels are hidden: they have no extinction.
    Hidden,
    /// Voxels with these segmentation labels have their own transfer function. Rules for labels inside that function
    /// are ignored.
    Visible(Box<TransferFunction>),
}

/// Rule for the voxels of some segmentation labels: they are hidden, or have their own transfer function.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelRule {
    /// Segmentation labels to which the rule applies.
    pub labels: Vec<u32>,
    /// Visibility that this rule gives to the voxels of its segmentation labels: hidden, or with their own transfer
    /// function.
    pub visibility: LabelVisibility,
}

/// Number of scalar values at which [`TransferFunction::leaves_extinction`] evaluates a transfer function, and
/// relative tolerance of that test.
const TESTED_VALUES: u32 = 64;
const SAME_EXTINCTION: f64 = 1e-4;

impl TransferFunction {
    /// Creates a white transfer function through points of scalar value and opacity or extinction, by non-decreasing
    /// value. Opacities are per mm; name and units are empty.
    pub fn new(quantity: Quantity, points: &[(f64, f64)]) -> Self {
        let white = |&(value, amount): &(f64, f64)| ControlPoint { value, amount, color: [1.0; 3] };
        Self {
            name: String::new(),
            units: String::new(),
            reference_length_mm: 1.0,
            quantity,
            points: points.iter().map(white).collect(),
            gradient_opacity: None,
            rules: Vec::new(),
            clip: Vec::new(),
        }
    }

    /// Opacity or extinction of the transfer function at a scalar value; [`Self::quantity`] says which.
    pub fn amount(&self, value: f64) -> f64 {
        self.interpolate(value, |p| p.amount)
    }

    /// Extinction of the transfer function at a scalar value, 1/mm.
    pub fn extinction(&self, value: f64) -> f64 {
        self.extinction_of_amount(self.amount(value))
    }

    /// Converts an opacity or extinction stored in the transfer function to extinction in 1/mm. An opacity becomes
    /// `-ln(1 - min(opacity, 1 - 2^-24)) / reference_length_mm`.
    pub fn extinction_of_amount(&self, amount: f64) -> f64 {
        match self.quantity {
            Quantity::Opacity => -(-amount.min(MAX_OPACITY)).ln_1p() / self.reference_length_mm,
            Quantity::Extinction => amount,
        }
    }

    /// Whether this transfer function and another one store the same quantity: extinction, or opacity for the same
    /// reference length. Only then can one set of device tables store both.
    pub fn has_quantity_of(&self, other: &Self) -> bool {
        let same_length = self.reference_length_mm == other.reference_length_mm;
        self.quantity == other.quantity && (self.quantity == Quantity::Extinction || same_length)
    }

    /// Whether the transfer function is the identity: each scalar value from 0 to `largest` is its own extinction in
    /// 1/mm, up to rounding.
    pub fn leaves_extinction(&self, largest: f64) -> bool {
        let value = |i: u32| largest * f64::from(i) / f64::from(TESTED_VALUES);
        (0..=TESTED_VALUES).map(value).all(|v| (self.extinction(v) - v).abs() <= SAME_EXTINCTION * largest)
    }

    /// Colour of the transfer function at a scalar value, linear RGB.
    pub fn color(&self, value: f64) -> [f64; 3] {
        std::array::from_fn(|c| self.interpolate(value, |p| p.color[c]))
    }

    /// Least and largest extinction of the transfer function over the scalar values `[min, max]`, 1/mm. Both sides of a
    /// jump at `min` count, since rounding may move a value from `min` to just below it.
    pub fn extinction_bounds(&self, min: f64, max: f64) -> [f64; 2] {
        let inside = self.points.iter().filter(|p| p.value >= min && p.value <= max).map(|p| p.amount);
        let amounts = inside.chain([min, max].map(|v| self.interpolate(v, |p| p.amount)));
        let [least, largest] =
            amounts.fold([f64::INFINITY, 0.0], |[a, b], amount| [a.min(amount), b.max(amount)]);
        [least, largest].map(|amount| self.extinction_of_amount(amount))
    }

    /// Largest extinction of the transfer function over the scalar values `[min, max]`, 1/mm
    /// ([`Self::extinction_bounds`]).
    pub fn max_extinction(&self, min: f64, max: f64) -> f64 {
        self.extinction_bounds(min, max)[1]
    }

    /// Returns the colour (linear RGB) shared by all scalar values with extinction; `None` if their colours differ. A
    /// control point counts if it or a neighbour has extinction.
    pub fn one_color(&self) -> Option<[f64; 3]> {
        let positive = |i: usize| self.points.get(i).is_some_and(|p| p.amount > 0.0);
        let counts = |i: usize| positive(i) || positive(i + 1) || (i > 0 && positive(i - 1));
        let mut colors = (0..self.points.len()).filter(|i| counts(*i)).map(|i| self.points[i].color);
        let first = colors.next().or_else(|| self.points.first().map(|p| p.color))?;
        colors.all(|c| c == first).then_some(first)
    }

    /// Whether two transfer functions are equal apart from clip planes and rules for segmentation labels.
    pub fn is_same_function(&self, other: &Self) -> bool {
        Self { rules: other.rules.clone(), clip: other.clip.clone(), ..self.clone() } == *other
    }

    /// Multiplies the extinction of the transfer function by `factor` at every scalar value, also for segmentation
    /// labels.
    #[must_use]
    pub fn scale_extinction(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        scaled.rules = self.with_each(|tf| tf.scale_extinction(factor));
        match self.quantity {
            // Only the reference length changes, so that the interpolation of opacities stays the same.
            Quantity::Opacity => scaled.reference_length_mm /= factor,
            Quantity::Extinction => scaled.points.iter_mut().for_each(|p| p.amount *= factor),
        }
        scaled
    }

    /// Maps the scalar values of all control points of the transfer function by an increasing linear function, such as a
    /// conversion of units. Gradient magnitudes are scaled by its slope.
    #[must_use]
    pub fn scale_values(&self, map: impl Fn(f64) -> f64) -> Self {
        let moved =
            |tf: &Self| tf.points.iter().map(|p| ControlPoint { value: map(p.value), ..*p }).collect();
        let rules = self.with_each(|tf| Self { points: moved(tf), ..tf.clone() });
        let slope = map(1.0) - map(0.0);
        let gradient_opacity = self.gradient_opacity.as_ref().map(|g| g.scale_magnitudes(slope));
        Self { points: moved(self), gradient_opacity, rules, ..self.clone() }
    }

    /// Sets the factor on the extinction by the gradient magnitude of the value.
    #[must_use]
    pub fn with_gradient_opacity(self, opacity: GradientOpacity) -> Self {
        Self { gradient_opacity: Some(opacity).filter(|opacity| !opacity.is_one()), ..self }
    }

    /// Distinct scalar values of the transfer function's control points, ascending.
    fn point_values(&self) -> Vec<f64> {
        let mut values: Vec<f64> = self.points.iter().map(|p| p.value).collect();
        values.dedup();
        values
    }

    fn interpolate(&self, value: f64, get: impl Fn(&ControlPoint) -> f64) -> f64 {
        let after = self.points.partition_point(|p| p.value <= value);
        match (after.checked_sub(1).map(|i| &self.points[i]), self.points.get(after)) {
            (Some(a), Some(b)) => {
                let w = (value - a.value) / (b.value - a.value);
                get(a) + (get(b) - get(a)) * w
            }
            (Some(only), None) | (None, Some(only)) => get(only),
            (None, None) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tf(quantity: Quantity, points: &[(f64, f64)]) -> TransferFunction {
        let mut tf = TransferFunction { reference_length_mm: 2.0, ..TransferFunction::new(quantity, points) };
        tf.points.iter_mut().for_each(|p| p.color = [p.value / 100.0, 0.5, 0.0]);
        tf
    }

    #[test]
    fn constant_beyond_the_ends_and_linear_between() {
        let tf = tf(Quantity::Extinction, &[(10.0, 1.0), (20.0, 3.0), (40.0, 0.5)]);
        for (value, expected) in
            [(-1e9, 1.0), (10.0, 1.0), (15.0, 2.0), (20.0, 3.0), (30.0, 1.75), (40.0, 0.5), (f64::MAX, 0.5)]
        {
            assert_eq!(tf.extinction(value), expected, "at {value}");
        }
        assert_eq!(tf.color(20.0), [0.2, 0.5, 0.0]);
        assert_eq!(tf.color(1e9), [0.4, 0.5, 0.0]);
    }

    #[test]
    fn the_later_point_of_a_jump_holds_from_it_on() {
        let tf = tf(Quantity::Extinction, &[(0.0, 0.0), (10.0, 1.0), (10.0, 5.0), (20.0, 5.0), (20.0, 2.0)]);
        assert!((tf.extinction(10.0_f64.next_down()) - 1.0).abs() < 1e-12);
        assert_eq!(tf.extinction(10.0), 5.0);
        assert_eq!(tf.extinction(20.0_f64.next_down()), 5.0);
        assert_eq!(tf.extinction(20.0), 2.0, "a jump at the last value");
    }

    #[test]
    fn opacity_is_interpolated_not_extinction() {
        let tf = tf(Quantity::Opacity, &[(0.0, 0.0), (1.0, 0.8)]);
        assert!((tf.extinction(0.5) - -(0.6_f64.ln()) / 2.0).abs() < 1e-15);
        assert_eq!(tf.extinction(0.0), 0.0);
    }

    #[test]
    fn full_opacity_stays_finite() {
        let tf = tf(Quantity::Opacity, &[(0.0, 1.0)]);
        assert!((tf.extinction(0.0) - 12.0 * std::f64::consts::LN_2).abs() < 1e-12, "2^-24 left after 2 mm");
    }

    #[test]
    fn largest_extinction_of_a_range() {
        let tf = tf(Quantity::Extinction, &[(0.0, 0.0), (10.0, 4.0), (20.0, 0.0), (30.0, 0.0), (30.0, 9.0)]);
        for (min, max, expected) in [
            (-5.0, 0.0, 0.0),
            (-5.0, 5.0, 2.0),
            (5.0, 15.0, 4.0),
            (12.5, 17.5, 3.0),
            (10.0, 10.0, 4.0),
            (20.0, 29.9, 0.0),
            (20.0, 30.0, 9.0),
            (40.0, 50.0, 9.0),
        ] {
            assert_eq!(tf.max_extinction(min, max), expected, "[{min}, {max}]");
        }
        let falling = self::tf(Quantity::Extinction, &[(5.0, 7.0), (5.0, 0.0)]);
        assert_eq!(falling.max_extinction(5.0, 9.0), 7.0, "both sides of a jump at the lower end");
        assert_eq!(falling.max_extinction(6.0, 9.0), 0.0);
    }

    #[test]
    fn the_extinctions_of_a_range_bound_all_its_values() {
        let tf = tf(Quantity::Opacity, &[(-3.0, 0.2), (1.0, 0.9), (1.0, 0.0), (4.0, 0.4), (9.0, 0.0)]);
        for a in -20..40 {
            for b in a..40 {
                let (min, max) = (f64::from(a) * 0.3, f64::from(b) * 0.3);
                let [least, largest] = tf.extinction_bounds(min, max);
                for k in 0..=50 {
                    let value = (min + (max - min) * f64::from(k) / 50.0).min(max);
                    let extinction = tf.extinction(value);
                    assert!((least..=largest).contains(&extinction), "{value} in [{min}, {max}]");
                }
            }
        }
    }

    #[test]
    fn one_color_of_all_values_with_extinction() {
        let mut tf =
            tf(Quantity::Extinction, &[(0.0, 0.0), (10.0, 0.0), (20.0, 1.0), (30.0, 0.0), (40.0, 0.0)]);
        assert_eq!(tf.one_color(), None);
        (1..4).for_each(|i| tf.points[i].color = [0.1, 0.2, 0.3]);
        assert_eq!(tf.one_color(), Some([0.1, 0.2, 0.3]), "the outer points have none");
        tf.points[0].amount = 0.5;
        assert_eq!(tf.one_color(), None);
    }

    #[test]
    fn scaled_extinction_is_a_multiple_at_every_value() {
        for quantity in [Quantity::Opacity, Quantity::Extinction] {
            let tf = tf(quantity, &[(0.0, 0.0), (10.0, 0.7), (10.0, 0.2), (20.0, 1.0)]);
            for factor in [1e-6, 0.3, 1.0, 7.0, 1e6] {
                let scaled = tf.scale_extinction(factor);
                for i in -5..50 {
                    let (want, got) =
                        (tf.extinction(f64::from(i) * 0.5) * factor, scaled.extinction(f64::from(i) * 0.5));
                    assert!((want - got).abs() <= 1e-15 * want, "{quantity:?} {factor} {i}: {want} {got}");
                }
                assert_eq!(scaled.color(13.0), tf.color(13.0));
            }
        }
    }

    #[test]
    fn mapped_values_keep_amounts_and_jumps() {
        let tf =
            tf(Quantity::Extinction, &[(0.0, 1.0), (10.0, 2.0), (10.0, 3.0)]).scale_values(|v| v * 0.1 - 1.0);
        assert_eq!(tf.points.iter().map(|p| p.value).collect::<Vec<_>>(), [-1.0, 0.0, 0.0]);
        assert_eq!((tf.extinction(-0.5), tf.extinction(0.0)), (1.5, 3.0));
    }
}
