//! Transmittance against depth along one light ray: the exact curve and the curves of shadow methods.
//!
//! The plot follows Kim and Neumann 2001 (Figure 1: the opacity function and the maps that approximate it) and
//! Hadwiger et al. 2006 (3.3: a visibility function and its nodes), with the exact function added.

use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::scene::Light;
use glam::DVec3;
use serde::Serialize;

/// Number of evenly spaced depths at which transmittance is plotted along a light ray through the volume.
const UNIFORM_DEPTHS: usize = 801;
/// Distances of additional plotted depths from each jump of the extinction, in units of the smallest voxel spacing.
const JUMP_OFFSETS: [f64; 9] = [-0.5, -0.1, -0.02, -1e-6, 0.0, 1e-6, 0.02, 0.1, 0.5];

/// Segment of a light ray inside the volume, with the exact transmittance along it.
///
/// Depth 0 is where the ray enters the volume, or the light itself if it lies inside the volume.
#[derive(Debug, Clone, Serialize)]
pub struct LightCurve {
    /// Given world point that the light ray passes through, mm.
    pub point_mm: DVec3,
    /// Depth of the given point `point_mm` along the light ray, mm. Negative or greater than `length_mm` where the
    /// point lies outside the volume.
    pub point_depth_mm: f64,
    /// World point on the light ray at depth 0, mm.
    pub origin_mm: DVec3,
    /// Unit direction of the light ray, pointing away from the light.
    pub direction: DVec3,
    /// Depth at which the light ray leaves the volume, mm.
    pub length_mm: f64,
    /// Sample depths along the light ray, mm, strictly ascending. Evenly spaced, and denser around jumps of the exact
    /// transmittance curve.
    pub depth_mm: Vec<f64>,
    /// Exact transmittance from the light to each sample depth on the light ray.
    pub exact: Vec<f64>,
}

/// Transmittance by a shadow method at the sample depths of a [`LightCurve`].
#[derive(Debug, Clone, Serialize)]
pub struct MethodCurve {
    /// Name of the shadow method.
    pub method: String,
    /// Settings of the shadow method as `key=value` texts separated by spaces.
    pub params: String,
    /// Number of texels per side of the shadow map; `None` where the shadow method has no map.
    pub map: Option<u32>,
    /// Transmittance by the shadow method at each sample depth of the light ray.
    pub transmittance: Vec<f32>,
}

/// Largest deviation of a shadow method from the exact transmittance curve along a light ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Farthest {
    /// Depth along the light ray at which a method's transmittance deviates most from the exact one, mm.
    pub depth_mm: f64,
    /// Transmittance by the shadow method at the depth of its largest deviation from the exact curve.
    pub t_method: f64,
    /// Exact transmittance at the depth where the shadow method deviates most.
    pub t_exact: f64,
}

impl LightCurve {
    /// Creates the light ray through a world point and computes the exact transmittance along it.
    ///
    /// # Errors
    /// The light ray misses the volume, or the point is the position of the point light.
    pub fn through(field: &ExactField, light: &Light, point_mm: DVec3) -> Result<Self> {
        let [x, y, z] = point_mm.to_array();
        let refuse = |why: &str| Error::input("cannot probe a light ray", format!("{x},{y},{z}"), why);
        let corners = field.volume().corners_mm();
        let start = match *light {
            Light::Point { position } => position,
            Light::Directional { toward } => {
                // The ray starts in front of the volume, wherever the point lies.
                let reach = corners.iter().map(|c| c.distance(point_mm)).fold(0.0, f64::max);
                point_mm + 2.0 * reach * toward.normalize()
            }
        };
        let direction = (point_mm - start)
            .try_normalize()
            .ok_or_else(|| refuse("the light is at this very point, so no ray passes through it"))?;
        let Some([enter_mm, exit_mm]) = field.span_in_domain(start, direction) else {
            let low = corners.iter().copied().fold(DVec3::INFINITY, DVec3::min);
            let high = corners.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
            let range = |axis: usize| format!("{} to {}", low[axis], high[axis]);
            return Err(refuse("the light ray through it misses the volume").hint(format_args!(
                "the volume lies within x {}, y {}, z {} mm",
                range(0),
                range(1),
                range(2)
            )));
        };
        let curve = field.curve_along(start, direction, f64::INFINITY);
        let jumps: Vec<f64> = curve.jumps().into_iter().map(|z| z - enter_mm).collect();
        let length_mm = exit_mm - enter_mm;
        let point_depth_mm = (point_mm - start).dot(direction) - enter_mm;
        let depth_mm = depths(length_mm, &jumps, point_depth_mm, field.volume().min_spacing_mm());
        let exact = depth_mm.iter().map(|z| curve.transmittance_at(enter_mm + z)).collect();
        let origin_mm = start + enter_mm * direction;
        Ok(Self { point_mm, point_depth_mm, origin_mm, direction, length_mm, depth_mm, exact })
    }

    /// Returns the world position at a given depth along the light ray, mm.
    pub fn at(&self, depth_mm: f64) -> DVec3 {
        self.origin_mm + depth_mm * self.direction
    }

    /// Returns the world positions of all sample depths along the light ray, mm.
    pub fn points_mm(&self) -> Vec<DVec3> {
        self.depth_mm.iter().map(|&z| self.at(z)).collect()
    }

    /// Returns the largest deviation between a shadow method's transmittance and the exact one along the light ray,
    /// at the first depth where it occurs. NaN counts as the largest.
    pub fn farthest(&self, of: &MethodCurve) -> Option<Farthest> {
        let far = |f: &Farthest| {
            let e = (f.t_method - f.t_exact).abs();
            if e.is_nan() { f64::INFINITY } else { e }
        };
        (self.depth_mm.iter().zip(&self.exact).zip(&of.transmittance))
            .map(|((&depth_mm, &t_exact), &t)| Farthest { depth_mm, t_method: f64::from(t), t_exact })
            .reduce(|best, next| if far(&next) > far(&best) { next } else { best })
    }

    /// Writes the transmittance curves of a light ray as CSV with the columns `depth_mm, x_mm, y_mm, z_mm, exact` and
    /// one per shadow method. Numbers have the fewest digits that parse to the same value.
    ///
    /// # Errors
    /// The CSV writer fails, which does not happen in memory.
    pub fn csv(&self, methods: &[MethodCurve]) -> Result<Vec<u8>> {
        let failed = |e: &dyn std::fmt::Display| Error::runtime("cannot write table", "CSV", e);
        let mut writer = csv::Writer::from_writer(Vec::new());
        let header = ["depth_mm", "x_mm", "y_mm", "z_mm", "exact"].map(String::from);
        let names = methods.iter().map(|m| m.name(methods));
        writer.write_record(header.into_iter().chain(names)).map_err(|e| failed(&e))?;
        for (i, (&z, exact)) in self.depth_mm.iter().zip(&self.exact).enumerate() {
            let [x, y, w] = self.at(z).to_array();
            let exact = [z, x, y, w, *exact].map(|v| format!("{v:?}"));
            let values = methods.iter().map(|m| format!("{:?}", m.transmittance[i]));
            writer.write_record(exact.into_iter().chain(values)).map_err(|e| failed(&e))?;
        }
        writer.into_inner().map_err(|e| failed(&e))
    }
}

impl MethodCurve {
    /// Returns the label of a transmittance curve: the shadow method with its settings, and the shadow map size if it
    /// differs among the curves.
    pub fn name(&self, all: &[Self]) -> String {
        let mut name = [self.method.as_str(), &self.params].join(" ").trim_end().to_string();
        let mut sizes = all.iter().filter_map(|m| m.map);
        if let (Some(map), Some(first)) = (self.map, sizes.next())
            && sizes.any(|size| size != first)
        {
            name += &format!(" map={map}");
        }
        name
    }
}

/// Returns sample depths on a light ray from 0 to `length_mm`: evenly spaced ones, some around every jump of
/// extinction, and the depth `also` if it lies in this range.
fn depths(length_mm: f64, jumps_mm: &[f64], also: f64, spacing_mm: f64) -> Vec<f64> {
    let last = (UNIFORM_DEPTHS - 1) as f64;
    let even = (0..UNIFORM_DEPTHS).map(|i| length_mm * (i as f64 / last));
    let around = jumps_mm.iter().flat_map(|z| JUMP_OFFSETS.map(|o| z + o * spacing_mm));
    let mut depths: Vec<f64> =
        even.chain(around).chain([also]).filter(|z| (0.0..=length_mm).contains(z)).collect();
    depths.sort_by(f64::total_cmp);
    // Depths that differ only by rounding are merged.
    depths.dedup_by(|a, b| (*a - *b).abs() <= 1e-9 * length_mm);
    depths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_even_crowded_at_jumps_and_hold_the_point() {
        let found = depths(100.0, &[-3.0, 30.06, 99.99], 12.345, 1.0);
        assert!(found.windows(2).all(|p| p[0] < p[1]));
        assert_eq!((found[0], found[found.len() - 1]), (0.0, 100.0));
        assert!(found.contains(&12.345) && found.contains(&30.06) && found.contains(&99.99));
        let near = |z: f64| found.iter().filter(|d| (*d - z).abs() < 0.03).count();
        assert_eq!((near(30.06), near(70.06)), (5, 0));
        assert!(found.windows(2).all(|p| p[1] - p[0] <= 0.125 + 1e-12));
        // A point outside the range adds no depth.
        assert_eq!(depths(100.0, &[], -1.0, 1.0).len(), UNIFORM_DEPTHS);
    }

    #[test]
    fn names_say_the_map_where_maps_differ() {
        let of = |params: &str, map| MethodCurve {
            method: "dsm".into(),
            params: params.into(),
            map,
            transmittance: Vec::new(),
        };
        let all = [of("epsilon=0.1", Some(64)), of("epsilon=0.1", Some(128)), of("", None)];
        let names: Vec<_> = all.iter().map(|m| m.name(&all)).collect();
        assert_eq!(names, ["dsm epsilon=0.1 map=64", "dsm epsilon=0.1 map=128", "dsm"]);
        assert_eq!(all[0].name(&all[..1]), "dsm epsilon=0.1");
    }

    #[test]
    fn nan_is_the_largest_deviation() {
        let curve = LightCurve {
            point_mm: DVec3::ZERO,
            point_depth_mm: 0.0,
            origin_mm: DVec3::ZERO,
            direction: DVec3::X,
            length_mm: 2.0,
            depth_mm: vec![0.0, 1.0, 2.0],
            exact: vec![1.0, 0.5, 0.25],
        };
        let of = |values: [f32; 3]| {
            let m = MethodCurve {
                method: "m".into(),
                params: String::new(),
                map: None,
                transmittance: values.into(),
            };
            curve.farthest(&m).map(|f| f.depth_mm)
        };
        assert_eq!(of([1.0, 0.75, 0.375]), Some(1.0));
        assert_eq!(of([0.0, 0.5, f32::NAN]), Some(2.0));
        let text = String::from_utf8(curve.csv(&[]).unwrap()).unwrap();
        assert_eq!(text.lines().nth(2), Some("1.0,1.0,0.0,0.0,0.5"));
    }
}
