//! Error bounds of shadow methods on light rays through texel centres.

/// Error bound of a shadow method on light rays through texel centres, at every depth `z`: `T_exact(z + depth_mm) -
/// transmittance <= T_method(z) <= T_exact(z - depth_mm) + transmittance`.
///
/// `T_exact` is the transmittance along a ray within `lateral_mm` of the texel's ray, through a volume whose values
/// differ by at most `value`. These terms are the limits of float32: a ray that grazes a surface may miss it because
/// of them (`docs/bound.md`).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bound {
    /// Bound on the error of the shadow method in transmittance.
    pub transmittance: f64,
    /// Bound on the error of the shadow method in depth along the light ray, mm.
    pub depth_mm: f64,
    /// Bound on the distance by which a light ray is displaced sideways by rounding, mm.
    pub lateral_mm: f64,
    /// Bound on the error of the interpolated volume value along a light ray, in units of that value.
    pub value: f64,
    /// Distance from a point light within which the error bound of the shadow method does not hold, mm: float32 does
    /// not resolve texels there.
    pub from_light_mm: f64,
    /// Number of texels per side whose curves a query combines at a point: 2 with bilinear filtering, 1 for the
    /// nearest texel, 0 for a shadow ray of the point's own.
    pub texels_a_side: u32,
    /// Bound on the shift in depth by which a query aligns these texels between their light rays, mm.
    pub align_mm: f64,
    /// Bound on the distance from a point to the light rays whose transmittance bounds that at the point, mm.
    pub reach_mm: f64,
}

impl Bound {
    /// Returns the distance of a transmittance from the interval that the bound allows around exact ones, from the
    /// least to the largest; negative inside. NaN lies outside every interval, at an infinite distance.
    pub fn distance(&self, t: f64, [least, most]: [f64; 2]) -> f64 {
        let outside = (least - self.transmittance - t).max(t - most - self.transmittance);
        if t.is_nan() { f64::INFINITY } else { outside }
    }

    /// Returns the bound that the shadow maps of all lights satisfy; `None` if one of them has no bound.
    pub fn of_all(bounds: impl IntoIterator<Item = Option<Self>>) -> Option<Self> {
        let looser = |a: Self, b: Self| Self {
            transmittance: a.transmittance.max(b.transmittance),
            depth_mm: a.depth_mm.max(b.depth_mm),
            lateral_mm: a.lateral_mm.max(b.lateral_mm),
            value: a.value.max(b.value),
            from_light_mm: a.from_light_mm.max(b.from_light_mm),
            texels_a_side: a.texels_a_side.max(b.texels_a_side),
            align_mm: a.align_mm.max(b.align_mm),
            reach_mm: a.reach_mm.max(b.reach_mm),
        };
        bounds.into_iter().collect::<Option<Vec<_>>>()?.into_iter().reduce(looser)
    }
}
