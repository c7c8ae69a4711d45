//! Gradient opacity: a factor on the extinction of a transfer function, by the gradient magnitude of the value.
//!
//! Extinction is `sigma(s) w(g)`, with the scalar value `s` and the magnitude `g` of its gradient. This is the gradient
//! opacity of VTK and 3D Slicer. There it multiplies the opacity of a step, which is `sigma w` times the step's length for
//! short steps. VTK measures gradients in value units per mean voxel spacing (`vtkVolumeShaderComposer.h`), so both units
//! exist here.

use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Largest number of points of a gradient opacity: the device evaluates all segments between them at once.
pub const MOST_GRADIENT_POINTS: usize = 16;
/// Largest gradient magnitude of a point. Squares of larger ones overflow 32-bit floats.
const MAX_MAGNITUDE: f64 = 1e15;
/// Smallest gradient magnitude of a point above 0. The square of a smaller one vanishes in 32-bit floats.
const MIN_MAGNITUDE: f64 = 1e-15;
/// Name of the factor that is 1 everywhere.
const NONE: &str = "none";

/// Length over which gradient magnitudes of a gradient opacity are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GradientLength {
    /// Gradient magnitudes are value units per mm.
    #[default]
    Mm,
    /// Gradient magnitudes are value units per mean voxel spacing, as in VTK and 3D Slicer.
    Voxel,
}

/// Point of a gradient opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GradientPoint {
    /// Gradient magnitude of the point, value units per [`GradientLength`].
    pub magnitude: f64,
    /// Factor on the extinction at this gradient magnitude, in `[0, 1]`.
    pub factor: f64,
}

/// Factor on the extinction of a transfer function, by the gradient magnitude of the value. It is piecewise linear
/// between its points, and constant before the first and after the last. Two points of equal magnitude are a jump: the
/// first holds below the magnitude, the second from it on.
#[derive(Debug, Clone, PartialEq)]
pub struct GradientOpacity {
    points: Vec<GradientPoint>,
    per: GradientLength,
}

impl GradientOpacity {
    /// Creates a gradient opacity from its points, `(magnitude, factor)` by non-decreasing magnitude, value units per mm.
    ///
    /// # Errors
    /// There is no point or too many, a number is out of range, magnitudes decrease, or more than two are equal.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Result<Self, String> {
        let mut list: Vec<GradientPoint> = Vec::new();
        for (magnitude, factor) in points {
            if !(0.0..=MAX_MAGNITUDE).contains(&magnitude) {
                return Err(format!("a gradient must be from 0 to {MAX_MAGNITUDE:e}, not {magnitude}"));
            }
            if magnitude > 0.0 && magnitude < MIN_MAGNITUDE {
                return Err(format!("gradient {magnitude:e} is neither 0 nor at least {MIN_MAGNITUDE:e}"));
            }
            if !(0.0..=1.0).contains(&factor) {
                return Err(format!("a factor must be in [0, 1], not {factor}"));
            }
            if list.last().is_some_and(|last| last.magnitude > magnitude) {
                return Err(format!("gradient {magnitude} is less than the one before"));
            }
            if list.len() >= 2 && list[list.len() - 2].magnitude == magnitude {
                return Err(format!("gradient {magnitude} occurs more than twice; a jump is two points"));
            }
            list.push(GradientPoint { magnitude, factor });
        }
        if list.is_empty() {
            return Err("it has no points".into());
        }
        if list.len() > MOST_GRADIENT_POINTS {
            return Err(format!("it has {} points, and at most {MOST_GRADIENT_POINTS} are used", list.len()));
        }
        if list.iter().all(|p| p.factor == 1.0) {
            return Ok(Self::none());
        }
        Ok(Self { points: list, per: GradientLength::Mm })
    }

    /// Returns the factor 1 everywhere.
    pub fn none() -> Self {
        Self { points: vec![GradientPoint { magnitude: 0.0, factor: 1.0 }], per: GradientLength::Mm }
    }

    /// Sets the length over which the gradient magnitudes of the points are measured.
    #[must_use]
    pub fn per(self, per: GradientLength) -> Self {
        Self { per: if self.is_one() { GradientLength::Mm } else { per }, ..self }
    }

    /// Returns the length over which the gradient magnitudes of the points are measured.
    pub fn length(&self) -> GradientLength {
        self.per
    }

    /// Returns the gradient opacity with magnitudes in value units per mm, for a volume with the given voxel spacing.
    #[must_use]
    pub fn per_mm(&self, spacing_mm: [f64; 3]) -> Self {
        match self.per {
            GradientLength::Mm => self.clone(),
            GradientLength::Voxel => {
                let mean_mm = spacing_mm.iter().sum::<f64>() / 3.0;
                Self { per: GradientLength::Mm, ..self.scale_magnitudes(mean_mm.recip()) }
            }
        }
    }

    /// Returns the points, by non-decreasing gradient magnitude.
    pub fn points(&self) -> &[GradientPoint] {
        &self.points
    }

    /// Whether the factor is 1 at every gradient magnitude.
    pub fn is_one(&self) -> bool {
        self.points.iter().all(|p| p.factor == 1.0)
    }

    /// Returns the factor on the extinction at a gradient magnitude, in the unit of the points.
    pub fn factor(&self, magnitude: f64) -> f64 {
        let after = self.points.partition_point(|p| p.magnitude <= magnitude);
        match (after.checked_sub(1).map(|i| &self.points[i]), self.points.get(after)) {
            (Some(a), Some(b)) => {
                let share = (magnitude - a.magnitude) / (b.magnitude - a.magnitude);
                a.factor + (b.factor - a.factor) * share
            }
            (Some(only), None) | (None, Some(only)) => only.factor,
            (None, None) => 1.0,
        }
    }

    /// Multiplies the gradient magnitudes of all points by `factor > 0`, as for values in other units.
    #[must_use]
    pub fn scale_magnitudes(&self, factor: f64) -> Self {
        let scaled = |p: &GradientPoint| GradientPoint { magnitude: p.magnitude * factor, ..*p };
        Self { points: self.points.iter().map(scaled).collect(), per: self.per }
    }
}

/// Parses `G:F,G:F,...`: gradient magnitudes (value units per mm) with their factors in `[0, 1]`, then optionally
/// `,per=voxel` for value units per mean voxel spacing; or `none`, the factor 1 everywhere.
impl FromStr for GradientOpacity {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.trim() == NONE {
            return Ok(Self::none());
        }
        let expected = || format!("`{text}` is not a list of GRADIENT:FACTOR such as 0:0,50:1, or {NONE}");
        let (text, per) = match text.rsplit_once(",per=").map(|(list, per)| (list, per.trim())) {
            None => (text, GradientLength::Mm),
            Some((list, "mm")) => (list, GradientLength::Mm),
            Some((list, "voxel")) => (list, GradientLength::Voxel),
            Some((_, other)) => return Err(format!("`per={other}` is neither per=mm nor per=voxel")),
        };
        let point = |pair: &str| {
            let (magnitude, factor) = pair.split_once(':')?;
            Some((magnitude.trim().parse().ok()?, factor.trim().parse().ok()?))
        };
        let points = text.split(',').map(point).collect::<Option<Vec<_>>>().ok_or_else(expected)?;
        Ok(Self::new(points)?.per(per))
    }
}

/// Formats the points in the syntax that [`FromStr`] parses.
impl fmt::Display for GradientOpacity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_one() {
            return f.write_str(NONE);
        }
        let points = self.points.iter().map(|p| format!("{}:{}", p.magnitude, p.factor));
        f.write_str(&points.collect::<Vec<_>>().join(","))?;
        f.write_str(if self.per == GradientLength::Voxel { ",per=voxel" } else { "" })
    }
}

impl Serialize for GradientOpacity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_linear_between_points_and_constant_beyond() {
        let opacity: GradientOpacity = "10:0.2, 20:0.6,20:1,40:0".parse().unwrap();
        for (magnitude, expected) in
            [(0.0, 0.2), (10.0, 0.2), (15.0, 0.4), (20.0, 1.0), (30.0, 0.5), (40.0, 0.0), (1e9, 0.0)]
        {
            assert!((opacity.factor(magnitude) - expected).abs() < 1e-15, "{magnitude}");
        }
        assert!((opacity.factor(20.0_f64.next_down()) - 0.6).abs() < 1e-12);
        let doubled = opacity.scale_magnitudes(2.0);
        assert!((0..100).map(f64::from).all(|g| (doubled.factor(2.0 * g) - opacity.factor(g)).abs() < 1e-15));
        // A gradient of 10 per voxel is one of 5 per mm where voxels are 2 mm wide in the mean.
        let per_voxel = opacity.clone().per(GradientLength::Voxel).per_mm([1.0, 2.0, 3.0]);
        assert_eq!((per_voxel.points()[0].magnitude, per_voxel.length()), (5.0, GradientLength::Mm));
        assert_eq!(opacity.per_mm([1.0, 2.0, 3.0]), opacity);
    }

    #[test]
    fn text_is_read_and_written_alike() {
        for text in ["0:0,50:1", "1e-3:0.25", "0:1,7.5:1,7.5:0", "0:0,50:1,per=voxel"] {
            let opacity: GradientOpacity = text.parse().unwrap();
            assert_eq!(opacity.to_string().parse::<GradientOpacity>().unwrap(), opacity, "{text}");
            assert!(!opacity.is_one());
        }
        assert_eq!("0:0,50:1,per=mm".parse::<GradientOpacity>().unwrap().to_string(), "0:0,50:1");
        for text in ["none", "0:1", "3:1,8:1", "3:1,per=voxel"] {
            let opacity: GradientOpacity = text.parse().unwrap();
            assert!(opacity.is_one() && opacity.to_string() == "none" && opacity.factor(5.0) == 1.0);
        }
    }

    #[test]
    fn each_broken_rule_is_named() {
        let many = (0..=MOST_GRADIENT_POINTS).map(|i| format!("{i}:0.5")).collect::<Vec<_>>().join(",");
        for (text, expected) in [
            ("", "is not a list"),
            ("5", "is not a list"),
            ("0:0,50", "is not a list"),
            ("0:x", "is not a list"),
            ("0:0,per=inch", "neither per=mm nor per=voxel"),
            ("-1:0", "from 0 to"),
            ("nan:0", "from 0 to"),
            ("1e16:0", "from 0 to"),
            ("1e-16:0", "neither 0 nor"),
            ("0:1.5", "in [0, 1], not 1.5"),
            ("0:-0.1", "in [0, 1], not -0.1"),
            ("5:0,4:1", "less than the one before"),
            ("5:0,5:1,5:0", "more than twice"),
            (&*many, "at most 16"),
        ] {
            let why = text.parse::<GradientOpacity>().expect_err(text);
            assert!(why.contains(expected) && !why.contains('\n'), "{text}: {why}");
        }
    }
}
