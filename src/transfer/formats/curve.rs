//! Curves as other programs have them: nodes by value, and between two of them a mixture that may be bent.

/// The side from which a value is approached: both differ at a jump.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// What the curve tends to just below the value.
    Below,
    /// What it is at the value, and just above.
    From,
}

/// A node, and how the curve goes on from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node<const N: usize> {
    /// The scalar value.
    pub value: f64,
    /// What the curve is there.
    pub amounts: [f64; N],
    /// Share of the way to the next node at which the curve is halfway between both, in `(0, 1)`; VTK's midpoint.
    pub midpoint: f64,
    /// 0: straight to the next node, 1: one step at the midpoint; VTK's sharpness.
    pub sharpness: f64,
}

impl<const N: usize> Node<N> {
    /// A node from which the curve goes straight on.
    pub fn straight(value: f64, amounts: [f64; N]) -> Self {
        Self { value, amounts, midpoint: 0.5, sharpness: 0.0 }
    }
}

/// How two nodes are mixed: amounts at both, and the share of the second.
pub type Mix<const N: usize> = fn(&[f64; N], &[f64; N], f64) -> [f64; N];

/// A curve through nodes, constant beyond the first and the last.
#[derive(Debug, Clone)]
pub struct Curve<const N: usize> {
    nodes: Vec<Node<N>>,
    mix: Mix<N>,
    /// Ways between nodes are taken in the logarithm of the value.
    is_log: bool,
    /// Nodes that were left out because there were more than two of one value.
    pub left_out: usize,
}

/// How ways between nodes are gone.
#[derive(Debug, Clone, Copy, Default)]
pub struct Ways {
    /// In the logarithm of the value, where all values are above 0.
    pub are_logarithmic: bool,
    /// The sharpest are steps, as VTK has it in colours; in opacities they stay a steep curve.
    pub may_be_steps: bool,
}

/// Nodes that a curve may have; no program's editor makes more.
pub const MOST_NODES: usize = 1 << 14;
/// Beyond this a value no longer fits 32-bit arithmetic.
pub const MOST_VALUE: f64 = 1e30;
/// Share of the range of values below which two values count as one: VTK wants each value once, and programs that build
/// on it write jumps as two values which differ by a last digit of 32 bits at most.
const ONE_VALUE: f64 = 1e-7;
/// VTK's own limits of a midpoint, and the sharpness from which on it takes a segment as a step.
const MIDPOINTS: [f64; 2] = [1e-5, 1.0 - 1e-5];
const STEP_FROM: f64 = 0.99;
/// The sharpness below which VTK takes a segment as straight.
const STRAIGHT_BELOW: f64 = 0.01;

/// The straight mixture.
pub fn linear<const N: usize>(a: &[f64; N], b: &[f64; N], share: f64) -> [f64; N] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share)
}

impl<const N: usize> Curve<N> {
    /// Puts nodes in order; several that count as one value become a jump from the first of them to the last.
    ///
    /// # Errors
    /// No node, too many, or a number that is not finite or beyond 32-bit arithmetic.
    pub fn new(mut nodes: Vec<Node<N>>, mix: Mix<N>, ways: Ways) -> Result<Self, String> {
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
        let mut kept: Vec<Node<N>> = Vec::with_capacity(nodes.len());
        let mut left_out = 0;
        let mut rest = &nodes[..];
        while let Some(first) = rest.first() {
            let count = rest.partition_point(|n| n.value - first.value <= ONE_VALUE * range);
            let last = rest[count - 1];
            if count > 1 && first.amounts != last.amounts {
                kept.push(Node { value: last.value, ..*first });
            }
            kept.push(last);
            left_out += count.saturating_sub(2);
            rest = &rest[count..];
        }
        let is_log = ways.are_logarithmic && kept[0].value > 0.0;
        let mut curve = Self { nodes: Vec::with_capacity(kept.len()), mix, is_log, left_out };
        for (i, node) in kept.iter().enumerate() {
            let (sharpness, next) = (node.sharpness.clamp(0.0, 1.0), kept.get(i + 1));
            let midpoint = node.midpoint.clamp(MIDPOINTS[0], MIDPOINTS[1]);
            let is_step = ways.may_be_steps && sharpness > STEP_FROM;
            match next.filter(|next| is_step && next.value > node.value) {
                Some(next) => {
                    let at = curve.on_the_way(node.value, next.value, midpoint);
                    curve.nodes.push(Node::straight(node.value, node.amounts));
                    curve.nodes.push(Node::straight(at, node.amounts));
                    curve.nodes.push(Node::straight(at, next.amounts));
                }
                None => curve.nodes.push(Node { midpoint, sharpness, ..*node }),
            }
        }
        Ok(curve)
    }

    /// Straight through points of non-decreasing value, as they are.
    pub fn through(points: impl Iterator<Item = (f64, [f64; N])>) -> Self {
        let nodes = points.map(|(value, amounts)| Node::straight(value, amounts)).collect();
        Self { nodes, mix: linear, is_log: false, left_out: 0 }
    }

    /// The values of its nodes.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.nodes.iter().map(|n| n.value)
    }

    /// Whether some way between nodes is bent.
    pub fn is_bent(&self) -> bool {
        self.nodes.iter().any(|n| n.sharpness >= STRAIGHT_BELOW || n.midpoint != 0.5)
    }

    /// What it is at a value.
    pub fn at(&self, value: f64, side: Side) -> [f64; N] {
        let after = match side {
            Side::Below => self.nodes.partition_point(|n| n.value < value),
            Side::From => self.nodes.partition_point(|n| n.value <= value),
        };
        match (after.checked_sub(1).map(|i| &self.nodes[i]), self.nodes.get(after)) {
            (Some(a), Some(b)) => (self.mix)(&a.amounts, &b.amounts, bent(self.share(a, b, value), a)),
            (Some(only), None) | (None, Some(only)) => only.amounts,
            (None, None) => [0.0; N],
        }
    }

    fn share(&self, a: &Node<N>, b: &Node<N>, value: f64) -> f64 {
        let share = if self.is_log {
            (value / a.value).ln() / (b.value / a.value).ln()
        } else {
            (value - a.value) / (b.value - a.value)
        };
        if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    }

    /// The value at a share of the way between two.
    fn on_the_way(&self, a: f64, b: f64, share: f64) -> f64 {
        if self.is_log { a * (b / a).powf(share) } else { a + (b - a) * share }
    }
}

/// The share of the second node, bent by the first one's midpoint and sharpness: VTK's `vtkAbstractPiecewiseFunction`
/// says that a piecewise Hermite curve is used. Its tangents are `1 - sharpness` of the straight line's, and the way is
/// first moved so that its midpoint lies halfway, then drawn towards it by a power.
fn bent<const N: usize>(share: f64, node: &Node<N>) -> f64 {
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

    fn curve(nodes: &[(f64, f64, f64, f64)]) -> Curve<1> {
        let node =
            |&(value, amount, midpoint, sharpness)| Node { value, amounts: [amount], midpoint, sharpness };
        Curve::new(nodes.iter().map(node).collect(), linear, Ways::default()).unwrap()
    }

    /// The numbers are what VTK 9.7's `vtkPiecewiseFunction` answers for these nodes.
    #[test]
    fn it_is_bent_as_vtk_bends_it() {
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
            let got = curve.at(value, Side::From)[0];
            assert!((got - expected).abs() < 1e-6, "at {value}: {got}, not {expected}");
        }
        let steps = Ways { may_be_steps: true, ..Ways::default() };
        let curve = Curve::new(curve.nodes, linear, steps).unwrap();
        assert_eq!([2.4, 2.6].map(|v| curve.at(v, Side::From)[0]), [0.25, 0.75]);
        assert_eq!([Side::Below, Side::From].map(|side| curve.at(2.5, side)[0]), [0.25, 0.75]);
    }

    #[test]
    fn values_that_differ_by_a_last_digit_are_one_and_more_than_two_are_said() {
        let curve = curve(&[
            (154.266_082_7, 0.9, 0.5, 0.0),
            (0.0, 0.1, 0.5, 0.0),
            (154.266_067_5, 0.3, 0.5, 0.0),
            (154.266_07, 0.5, 0.5, 0.0),
            (228.0, 1.0, 0.5, 0.0),
        ]);
        assert_eq!(curve.left_out, 1);
        assert_eq!([Side::Below, Side::From].map(|side| curve.at(154.266_082_7, side)[0]), [0.3, 0.9]);
        assert_eq!([-5.0, 500.0].map(|v| curve.at(v, Side::From)[0]), [0.1, 1.0]);
    }

    #[test]
    fn what_is_no_curve_is_refused() {
        let node = |value: f64, amount: f64| Node::straight(value, [amount]);
        for (nodes, why) in [
            (vec![], "no points"),
            (vec![node(f64::NAN, 0.0)], "not finite"),
            (vec![node(0.0, f64::INFINITY)], "not finite"),
            (vec![node(1e31, 0.0)], "too large"),
            (vec![node(0.0, 0.0); MOST_NODES + 1], "at most"),
        ] {
            assert!(Curve::new(nodes, linear, Ways::default()).unwrap_err().contains(why), "{why}");
        }
    }
}
