//! Transmittance against depth along one light ray: the exact curve, and what methods make of it.
//!
//! The figure is that of Kim and Neumann 2001 (Figure 1: the opacity function and the maps that approximate it) and of
//! Hadwiger et al. 2006 (3.3: a visibility function and its nodes), with the exact function in it.

use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::scene::Light;
use glam::DVec3;
use serde::Serialize;

/// Depths in equal distances along the way through the volume.
const UNIFORM_DEPTHS: usize = 801;
/// Depths around each jump of the extinction, in units of the smallest voxel spacing.
const JUMP_OFFSETS: [f64; 9] = [-0.5, -0.1, -0.02, -1e-6, 0.0, 1e-6, 0.02, 0.1, 0.5];

/// The way of a light ray through the volume, with the exact transmittance along it.
///
/// Depth 0 is where the ray enters the volume, or the light itself where that lies inside.
#[derive(Debug, Clone, Serialize)]
pub struct LightCurve {
    /// The point that the ray was laid through, world mm.
    pub point_mm: DVec3,
    /// Depth of the point, mm; negative or beyond `length_mm` outside the volume.
    pub point_depth_mm: f64,
    /// World point of depth 0, mm.
    pub origin_mm: DVec3,
    /// Unit direction away from the light.
    pub direction: DVec3,
    /// Depth at which the ray leaves the volume.
    pub length_mm: f64,
    /// Ascending and distinct: evenly spaced, and more around the jumps of the exact curve.
    pub depth_mm: Vec<f64>,
    /// Transmittance from the light to each depth.
    pub exact: Vec<f64>,
}

/// A method's transmittance at the depths of a [`LightCurve`].
#[derive(Debug, Clone, Serialize)]
pub struct MethodCurve {
    /// Name of the method.
    pub method: String,
    /// `key=value` texts separated by spaces.
    pub params: String,
    /// Texels a side, where the method has a map.
    pub map: Option<u32>,
    /// One value a depth.
    pub transmittance: Vec<f32>,
}

/// The depth at which a method is farthest from the exact curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Farthest {
    /// Depth along the ray, mm.
    pub depth_mm: f64,
    /// The method's transmittance there.
    pub t_method: f64,
    /// The exact one.
    pub t_exact: f64,
}

impl LightCurve {
    /// Lays the light's ray through a world point and takes the exact curve along it.
    ///
    /// # Errors
    /// The ray misses the volume, or the point is where a point light is.
    pub fn through(field: &ExactField, light: &Light, point_mm: DVec3) -> Result<Self> {
        let [x, y, z] = point_mm.to_array();
        let refuse = |why: &str| Error::input("cannot probe a light ray", format!("{x},{y},{z}"), why);
        let corners = field.volume().corners_mm();
        let start = match *light {
            Light::Point { position } => position,
            Light::Directional { toward } => {
                // From before the volume, wherever the point lies.
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

    /// The world point of a depth, mm.
    pub fn at(&self, depth_mm: f64) -> DVec3 {
        self.origin_mm + depth_mm * self.direction
    }

    /// The world points of all depths, mm.
    pub fn points_mm(&self) -> Vec<DVec3> {
        self.depth_mm.iter().map(|&z| self.at(z)).collect()
    }

    /// First depth of the largest difference between a method and the exact curve; NaN counts as the largest.
    pub fn farthest(&self, of: &MethodCurve) -> Option<Farthest> {
        let far = |f: &Farthest| {
            let e = (f.t_method - f.t_exact).abs();
            if e.is_nan() { f64::INFINITY } else { e }
        };
        (self.depth_mm.iter().zip(&self.exact).zip(&of.transmittance))
            .map(|((&depth_mm, &t_exact), &t)| Farthest { depth_mm, t_method: f64::from(t), t_exact })
            .reduce(|best, next| if far(&next) > far(&best) { next } else { best })
    }

    /// `depth_mm, x_mm, y_mm, z_mm, exact` and a column a method as CSV with a header line, numbers in the fewest
    /// digits that read back as the same.
    ///
    /// # Errors
    /// The writer's own, which memory does not give.
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
    /// Method and parameters, with the map's size where that differs among `all`.
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

/// Depths from 0 to `length_mm`: evenly spaced, around every jump, and `also` where it lies among them.
fn depths(length_mm: f64, jumps_mm: &[f64], also: f64, spacing_mm: f64) -> Vec<f64> {
    let last = (UNIFORM_DEPTHS - 1) as f64;
    let even = (0..UNIFORM_DEPTHS).map(|i| length_mm * (i as f64 / last));
    let around = jumps_mm.iter().flat_map(|z| JUMP_OFFSETS.map(|o| z + o * spacing_mm));
    let mut depths: Vec<f64> =
        even.chain(around).chain([also]).filter(|z| (0.0..=length_mm).contains(z)).collect();
    depths.sort_by(f64::total_cmp);
    // Depths that only rounding tells apart are one.
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
        // A point outside is none of the depths.
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
    fn farthest_takes_what_is_no_number_for_the_worst() {
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
