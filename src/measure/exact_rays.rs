//! Light rays through the texels of a shadow map, with their exact transmittance and the depths at which it is tested.

use crate::exact::{ExactField, OpticalDepthCurve};
use crate::scene::Light;
use crate::shadow::{LightSpace, Taps};
use glam::{DVec2, DVec3};

/// Margin of the tested depth interval on a light ray, before its first and behind its last extinction, as a fraction
/// of the shadow map's depth range.
const MARGIN: f64 = 0.02;

/// Light ray through a shadow map texel, parameterized by the map's depth in mm.
#[derive(Clone, Copy)]
pub struct LightRay {
    /// World position of depth 0 on the light ray through a shadow map texel, mm.
    origin: DVec3,
    /// Unit direction of the light ray, pointing away from the light.
    pub direction: DVec3,
    /// Depth on the light ray where the exact integration of extinction starts, mm: at the point light, or before the
    /// volume for a directional light.
    pub start_mm: f64,
}

impl LightRay {
    pub fn new(space: &LightSpace, light: Light, texel: DVec2) -> Self {
        let (origin, direction) = space.world_ray(texel);
        let start_mm = match light {
            Light::Point { position } => (position - origin).dot(direction),
            // The map's depth range may cover active bricks only; the exact ray must not depend on them.
            Light::Directional { .. } => space.z_range[0] - BEFORE_ANYTHING_MM,
        };
        Self { origin, direction, start_mm }
    }

    pub fn at(&self, depth_mm: f64) -> DVec3 {
        self.origin + depth_mm * self.direction
    }
}

/// Distance in front of the shadow map at which the exact integration along rays of directional lights starts, mm. It
/// exceeds the extent of any volume.
const BEFORE_ANYTHING_MM: f64 = 1e5;

/// Exact transmittance along a light ray, as a function of depth in the shadow map.
pub struct ExactRay<'a> {
    curve: OpticalDepthCurve<'a>,
    start_mm: f64,
}

impl<'a> ExactRay<'a> {
    pub fn new(field: &'a ExactField, ray: LightRay) -> Self {
        let curve = field.curve_along(ray.at(ray.start_mm), ray.direction, f64::INFINITY);
        Self { curve, start_mm: ray.start_mm }
    }

    pub fn jumps(&self) -> Vec<f64> {
        self.curve.jumps().into_iter().map(|z| z + self.start_mm).collect()
    }

    pub fn transmittance(&self, z: f64) -> f64 {
        self.curve.transmittance_at(z - self.start_mm)
    }
}

/// Returns the depth range in which a light ray is tested: from a little before its first extinction to a little
/// behind its last, within the shadow map's range. Returns the whole range where there is no extinction.
pub fn tested_range<'a>(
    curves: impl Iterator<Item = &'a ExactRay<'a>> + Clone,
    [z_min, z_max]: [f64; 2],
    tolerance_mm: f64,
) -> [f64; 2] {
    let start = curves.clone().map(|c| c.start_mm).fold(z_min, f64::max);
    let margin = MARGIN * (z_max - z_min) + 2.0 * tolerance_mm;
    let jumps = curves.map(ExactRay::jumps).filter(|j| !j.is_empty());
    let met = jumps.map(|j| [j[0], j[j.len() - 1]]).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    match met {
        Some([first, last]) => [(first - margin).max(start), (last + margin).min(z_max)],
        None => [start, z_max],
    }
}

/// Returns the offsets from a shadow map texel's centre to the light rays that a query averages there, in texels, each
/// with its weight. Weights need not add up to 1.
pub fn tap_offsets(taps: Taps) -> Vec<(DVec2, f64)> {
    let grid = |n: u32, spacing: f64| {
        let half = 0.5 * f64::from(n - 1);
        let at = move |i: u32| DVec2::new(f64::from(i % n) - half, f64::from(i / n) - half) * spacing;
        (0..n * n).map(at).collect::<Vec<_>>()
    };
    let equal = |offsets: Vec<DVec2>| offsets.into_iter().map(|offset| (offset, 1.0)).collect();
    equal(match taps {
        Taps::Within(9) => grid(3, 1.0 / 3.0),
        Taps::Within(5) => [vec![DVec2::ZERO], grid(2, 0.5)].concat(),
        Taps::Within(_) => vec![DVec2::ZERO],
        Taps::Texels(side) => grid(side, 1.0),
        Taps::Around(filter, rays) => {
            let weights = filter.weights(0.0);
            let weight = |at: DVec2| weights[(at.x + 1.0) as usize] * weights[(at.y + 1.0) as usize];
            let within = tap_offsets(Taps::Within(rays));
            let texel = |at: DVec2| within.iter().map(move |(offset, _)| (at + offset, weight(at)));
            return grid(3, 1.0).into_iter().flat_map(texel).collect();
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::Filter;

    #[test]
    fn taps_are_spread_evenly_around_the_centre() {
        for (taps, count, reach) in [
            (Taps::Within(1), 1, 0.0),
            (Taps::Within(5), 5, 0.25),
            (Taps::Within(9), 9, 1.0 / 3.0),
            (Taps::Texels(1), 1, 0.0),
            (Taps::Texels(3), 9, 1.0),
            (Taps::Around(Filter::Pcf, 1), 9, 1.0),
            (Taps::Around(Filter::Gauss, 5), 45, 1.25),
        ] {
            let offsets: Vec<DVec2> = tap_offsets(taps).into_iter().map(|(offset, _)| offset).collect();
            assert_eq!(offsets.len(), count);
            assert!(offsets.iter().sum::<DVec2>().length() < 1e-12);
            let farthest = offsets.iter().map(|o| o.abs().max_element()).fold(0.0, f64::max);
            assert!((farthest - reach).abs() < 1e-12, "{taps:?}");
        }
    }

    /// At a texel centre, the filters average three columns: equally, or by a Gaussian that ends at two texels.
    #[test]
    fn wide_filters_have_known_weights() {
        let weights = |filter| tap_offsets(Taps::Around(filter, 1)).into_iter().map(|tap| tap.1).collect();
        let (equal, gauss): (Vec<f64>, Vec<f64>) = (weights(Filter::Pcf), weights(Filter::Gauss));
        assert!(equal.iter().all(|weight| (weight - 1.0 / 9.0).abs() < 1e-12), "{equal:?}");
        let side = (0.606_530_66 - 0.135_335_28) / (1.0 - 0.135_335_28);
        assert!((gauss[3] / gauss[4] - side).abs() < 1e-7 && gauss[3] == gauss[1], "{gauss:?}");
        assert!((gauss.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{gauss:?}");
    }
}
