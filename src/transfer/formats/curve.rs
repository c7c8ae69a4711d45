//! Opacity and colour curves of other programs' transfer functions: nodes by scalar value, with VTK's midpoint and
//! sharpness between them.

/// Side from which an opacity or colour curve is evaluated at a scalar value; the two limits differ at a jump.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LimitSide {
    /// Limit of the opacity or colour curve from below the scalar value.
    Below,
    /// Opacity or colour curve at the scalar value itself, which is also its limit from above.
    From,
}

/// Node of an opacity or colour curve, with the shape of the curve segment behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurveNode<const N: usize> {
    /// Scalar value at which the node of the opacity or colour curve lies.
    pub value: f64,
    /// Opacity, or colour channels, at this node of an opacity or colour curve.
    pub amounts: [f64; N],
    /// Position in `(0, 1)` within the segment behind a curve node where the opacity or colour is halfway between
    /// both nodes (VTK's midpoint).
    pub midpoint: f64,
    /// Shape of the segment behind a curve node: 0 is a straight line, 1 a step at the midpoint (VTK's sharpness).
    pub sharpness: f64,
}

impl<const N: usize> CurveNode<N> {
    /// Creates a node of an opacity or colour curve with a straight segment behind it.
    pub fn straight(value: f64, amounts: [f64; N]) -> Self {
        Self { value, amounts, midpoint: 0.5, sharpness: 0.0 }
    }
}

/// Function that interpolates the opacities or colours of two curve nodes; its last argument is the weight of the
/// second node.
pub type Mix<const N: usize> = fn(&[f64; N], &[f64; N], f64) -> [f64; N];

/// Way in which an opacity or colour curve is interpolated between its nodes.
#[derive(Debug, Clone, Copy)]
pub struct Interpolation<const N: usize> {
    /// Function that interpolates the opacities or colours of two curve nodes.
    pub mix: Mix<N>,
    /// Whether interpolation weights between curve nodes are linear in the logarithm of the scalar value, which needs
    /// values above 0.
    pub is_logarithmic: bool,
    /// Whether curve segments of the largest sharpness are steps, as in VTK's colour functions; otherwise they are
    /// steep curves.
    pub has_steps: bool,
}

impl<const N: usize> Interpolation<N> {
    /// Linear interpolation between the nodes of an opacity or colour curve, without steps.
    pub const LINEAR: Self = Self { mix: linear, is_logarithmic: false, has_steps: false };
}

/// Opacity or colour curve of a transfer function: interpolated between its nodes, constant before the first and
/// after the last.
#[derive(Debug, Clone)]
pub struct NodeCurve<const N: usize> {
    nodes: Vec<CurveNode<N>>,
    mix: Mix<N>,
    is_logarithmic: bool,
    /// Number of nodes of the opacity or colour curve that were skipped, since only two may share a scalar value.
    pub skipped: usize,
}

/// Largest number of nodes of an imported opacity or colour curve, more than the editors of other programs make.
pub const MOST_NODES: usize = 1 << 14;
/// Largest scalar value in an opacity or colour curve; 32-bit arithmetic cannot handle larger ones.
pub const MOST_VALUE: f64 = 1e30;
/// Largest difference of two scalar values that count as equal, relative to the curve's value range. VTK requires
/// distinct values, so programs write jumps as two values that differ by about one 32-bit rounding step.
const ONE_VALUE: f64 = 1e-7;
/// VTK's limits on the midpoint of a segment between two curve nodes.
const MIDPOINTS: [f64; 2] = [1e-5, 1.0 - 1e-5];
/// Sharpness above which VTK treats a segment between two curve nodes as a step.
const STEP_FROM: f64 = 0.99;
/// Sharpness below which VTK treats a segment between two curve nodes as straight.
const STRAIGHT_BELOW: f64 = 0.01;

/// Interpolates two opacities or colours linearly; `share` is the weight of the second one.
pub fn linear<const N: usize>(a: &[f64; N], b: &[f64; N], share: f64) -> [f64; N] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share)
}

impl<const N: usize> NodeCurve<N> {
    /// Builds an opacity or colour curve from nodes, which it sorts by scalar value. Nodes with equal values become a
    /// jump from the first to the last of them.
    ///
    /// # Errors
    /// There are no nodes or too many, or a number is not finite or too large.
    pub fn new(mut nodes: Vec<CurveNode<N>>, interpolation: &Interpolation<N>) -> Result<Self, String> {
        if nodes.is_empty() {
            return Err("it has no points".into());
        }
        if nodes.len() > MOST_NODES {
            return Err(format!("it has {} points, at most {MOST_NODES} are read", nodes.len()));
        }
        for node in &nodes {
            let numbers = [node.value, node.midpoint, node.sharpness];
            if !numbers.iter().chain(&node.amounts).all(|x| x.is_finite()) || node.value.abs() > MOST_VALUE {
                return Err(format!("a point at {} is not finite or too large", node.value));
            }
        }
        nodes.sort_by(|a, b| a.value.total_cmp(&b.value));
        let range = nodes[nodes.len() - 1].value - nodes[0].value;
        let mut merged: Vec<CurveNode<N>> = Vec::with_capacity(nodes.len());
        let mut skipped = 0;
        let mut rest = &nodes[..];
        while let [first, ..] = rest {
            let count = rest.partition_point(|n| n.value - first.value <= ONE_VALUE * range);
            let last = rest[count - 1];
            if first.amounts != last.amounts {
                merged.push(CurveNode { value: last.value, ..*first });
            }
            merged.push(last);
            skipped += count.saturating_sub(2);
            rest = &rest[count..];
        }
        let Interpolation { mix, is_logarithmic, has_steps } = *interpolation;
        let is_logarithmic = is_logarithmic && merged[0].value > 0.0;
        let mut curve = Self { nodes: Vec::with_capacity(merged.len()), mix, is_logarithmic, skipped };
        for (i, node) in merged.iter().enumerate() {
            let (sharpness, next) = (node.sharpness.clamp(0.0, 1.0), merged.get(i + 1));
            let midpoint = node.midpoint.clamp(MIDPOINTS[0], MIDPOINTS[1]);
            let is_step = has_steps && sharpness > STEP_FROM;
            match next.filter(|next| is_step && next.value > node.value) {
                Some(next) => {
                    let at = curve.value_between(node.value, next.value, midpoint);
                    let corners = [(node.value, node.amounts), (at, node.amounts), (at, next.amounts)];
                    curve.nodes.extend(corners.map(|(value, amounts)| CurveNode::straight(value, amounts)));
                }
                None => curve.nodes.push(CurveNode { midpoint, sharpness, ..*node }),
            }
        }
        Ok(curve)
    }

    /// Creates a piecewise-linear opacity or colour curve through points of non-decreasing scalar value.
    pub fn through(points: impl Iterator<Item = (f64, [f64; N])>) -> Self {
        let nodes = points.map(|(value, amounts)| CurveNode::straight(value, amounts)).collect();
        Self { nodes, mix: linear, is_logarithmic: false, skipped: 0 }
    }

    /// Scalar values at which the nodes of the opacity or colour curve lie.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.nodes.iter().map(|n| n.value)
    }

    /// Whether any segment of the opacity or colour curve is not straight, according to its midpoint or sharpness.
    pub fn is_bent(&self) -> bool {
        self.nodes.iter().any(|n| n.sharpness >= STRAIGHT_BELOW || n.midpoint != 0.5)
    }

    /// Evaluates the opacity or colour of the curve at a scalar value.
    pub fn at(&self, value: f64, side: LimitSide) -> [f64; N] {
        let after = match side {
            LimitSide::Below => self.nodes.partition_point(|n| n.value < value),
            LimitSide::From => self.nodes.partition_point(|n| n.value <= value),
        };
        match (after.checked_sub(1).map(|i| &self.nodes[i]), self.nodes.get(after)) {
            (Some(a), Some(b)) => (self.mix)(&a.amounts, &b.amounts, bent(self.share(a, b, value), a)),
            (Some(only), None) | (None, Some(only)) => only.amounts,
            (None, None) => [0.0; N],
        }
    }

    fn share(&self, a: &CurveNode<N>, b: &CurveNode<N>, value: f64) -> f64 {
        let share = match self.is_logarithmic {
            true => (value / a.value).ln() / (b.value / a.value).ln(),
            false => (value - a.value) / (b.value - a.value),
        };
        if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    }

    /// Returns the scalar value at a given interpolation weight between two curve nodes, the inverse of
    /// [`Self::share`].
    fn value_between(&self, a: f64, b: f64, share: f64) -> f64 {
        if self.is_logarithmic { a * (b / a).powf(share) } else { a + (b - a) * share }
    }
}

/// Interpolation weight of the second node of a curve segment, after midpoint and sharpness of the first node are
/// applied.
///
/// VTK's `vtkAbstractPiecewiseFunction` documents the segment as a Hermite curve, whose tangents are `1 - sharpness`
/// of those of the straight line. Before that, the weight is remapped so that the midpoint lies halfway, then drawn
/// towards the midpoint by a power.
fn bent<const N: usize>(share: f64, node: &CurveNode<N>) -> f64 {
    let (m, sharpness) = (node.midpoint, node.sharpness);
    let mut s = if share < m { 0.5 * share / m } else { 0.5 + 0.5 * (share - m) / (1.0 - m) };
    if sharpness < STRAIGHT_BELOW {
        return s;
    }
    let power = 1.0 + 10.0 * sharpness;
    s = if s < 0.5 { 0.5 * (2.0 * s).powf(power) } else { 1.0 - 0.5 * (2.0 * (1.0 - s)).powf(power) };
    let (s2, s3) = (s * s, s * s * s);
    let tangents = (s3 - 2.0 * s2 + s) + (s3 - s2);
    (3.0 * s2 - 2.0 * s3 + (1.0 - sharpness) * tangents).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(nodes: &[(f64, f64, f64, f64)]) -> NodeCurve<1> {
        let node = |&(value, amount, midpoint, sharpness)| CurveNode {
            value,
            amounts: [amount],
            midpoint,
            sharpness,
        };
        NodeCurve::new(nodes.iter().map(node).collect(), &Interpolation::LINEAR).unwrap()
    }

    /// Segments of opacity curves agree with those of VTK 9.7's `vtkPiecewiseFunction`.
    #[test]
    fn segments_are_bent_like_those_of_vtk() {
        let curve = curve(&[
            (0.0, 0.0, 0.3, 0.5),
            (1.0, 1.0, 0.5, 0.0),
            (2.0, 0.25, 0.5, 1.0),
            (3.0, 0.75, 0.5, 0.0),
        ]);
        for (value, expected) in [
            (0.1, 0.000_344),
            (0.2, 0.024_754),
            (0.3, 0.5),
            (0.5, 0.960_476),
            (0.7, 0.998_437),
            (0.9, 0.999_998),
            (1.5, 0.625),
            (2.0, 0.25),
            (2.4, 0.252_688),
            (2.6, 0.747_312),
            (3.0, 0.75),
        ] {
            let got = curve.at(value, LimitSide::From)[0];
            assert!((got - expected).abs() < 1e-6, "at {value}: {got}, not {expected}");
        }
        let steps = Interpolation { has_steps: true, ..Interpolation::LINEAR };
        let curve = NodeCurve::new(curve.nodes, &steps).unwrap();
        assert_eq!([2.4, 2.6].map(|v| curve.at(v, LimitSide::From)[0]), [0.25, 0.75]);
        assert_eq!([LimitSide::Below, LimitSide::From].map(|side| curve.at(2.5, side)[0]), [0.25, 0.75]);
    }

    #[test]
    fn values_that_differ_by_a_last_digit_are_one() {
        let curve = curve(&[
            (154.266_082_7, 0.9, 0.5, 0.0),
            (0.0, 0.1, 0.5, 0.0),
            (154.266_067_5, 0.3, 0.5, 0.0),
            (154.266_07, 0.5, 0.5, 0.0),
            (228.0, 1.0, 0.5, 0.0),
        ]);
        assert_eq!(curve.skipped, 1);
        assert_eq!(
            [LimitSide::Below, LimitSide::From].map(|side| curve.at(154.266_082_7, side)[0]),
            [0.3, 0.9]
        );
        assert_eq!([-5.0, 500.0].map(|v| curve.at(v, LimitSide::From)[0]), [0.1, 1.0]);
    }

    #[test]
    fn invalid_nodes_are_refused() {
        let node = |value: f64, amount: f64| CurveNode::straight(value, [amount]);
        for (nodes, why) in [
            (vec![], "no points"),
            (vec![node(f64::NAN, 0.0)], "not finite"),
            (vec![node(0.0, f64::INFINITY)], "not finite"),
            (vec![node(1e31, 0.0)], "too large"),
            (vec![node(0.0, 0.0); MOST_NODES + 1], "at most"),
        ] {
            assert!(NodeCurve::new(nodes, &Interpolation::LINEAR).unwrap_err().contains(why), "{why}");
        }
    }
}
