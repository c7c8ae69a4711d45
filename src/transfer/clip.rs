//! Clip planes, which cut away parts of a volume: it has no extinction on their hidden side.

use glam::{DAffine3, DVec3};
use std::fmt;
use std::str::FromStr;

/// Largest number of clip planes of a volume: enough for the six sides of a box and two cuts.
pub const MOST_CLIP_PLANES: usize = 8;
/// Length of a clip plane's normal below which its direction is undefined.
const SHORTEST_NORMAL: f64 = 1e-9;
/// Largest number accepted in the text of a clip plane, mm.
const MAX_COORDINATE: f64 = 1e9;

/// Clip plane; points `x` (world mm) with `normal · x >= offset_mm` stay visible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClipPlane {
    /// Unit normal of the clip plane, towards the visible side.
    pub normal: DVec3,
    /// Signed distance of the clip plane from the world's origin along the normal, mm.
    pub offset_mm: f64,
}

impl ClipPlane {
    /// Returns the clip plane's normal and offset in other coordinates; `world` maps them to world mm. Points `p`
    /// with `normal · p >= offset` stay visible there.
    pub fn in_coordinates(&self, world: DAffine3) -> (DVec3, f64) {
        (world.matrix3.transpose() * self.normal, self.offset_mm - self.normal.dot(world.translation))
    }

    /// Clips the interval `[from, to]` of the parameter `t` on the line `origin + t direction` to the visible side of
    /// the clip plane. The interval is empty if its end is below its start.
    pub fn cut(&self, origin: DVec3, direction: DVec3, [from, to]: [f64; 2]) -> [f64; 2] {
        let (rise, above) = (self.normal.dot(direction), self.normal.dot(origin) - self.offset_mm);
        if rise > 0.0 {
            [from.max(-above / rise), to]
        } else if rise < 0.0 {
            [from, to.min(-above / rise)]
        } else if above >= 0.0 {
            [from, to]
        } else {
            [f64::INFINITY, f64::NEG_INFINITY]
        }
    }
}

impl FromStr for ClipPlane {
    type Err = String;

    /// Parses a clip plane from `nx,ny,nz,d`: points with `n · x >= d` stay visible. The normal may have any length
    /// except 0.
    fn from_str(text: &str) -> Result<Self, String> {
        let refuse =
            || format!("`{text}` is not nx,ny,nz,d: four numbers; the plane keeps n·x >= d in world mm");
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
        let numbers: [f64; 4] = numbers.map_err(|_| refuse())?.try_into().map_err(|_| refuse())?;
        if !numbers.iter().all(|x| x.abs() <= MAX_COORDINATE) {
            return Err(format!("`{text}` has a number that is not finite or beyond {MAX_COORDINATE:e}"));
        }
        let [x, y, z, d] = numbers;
        let normal = DVec3::new(x, y, z);
        let length = normal.length();
        if length < SHORTEST_NORMAL {
            return Err(format!("`{text}` has a normal of length 0"));
        }
        // A normalised plane that was written is read back bit by bit.
        let length = if (length - 1.0).abs() < 1e-14 { 1.0 } else { length };
        Ok(Self { normal: normal / length, offset_mm: d / length })
    }
}

impl fmt::Display for ClipPlane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let DVec3 { x, y, z } = self.normal;
        write!(f, "{x:?},{y:?},{z:?},{:?}", self.offset_mm)
    }
}

impl serde::Serialize for ClipPlane {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_parsed_and_written() {
        let plane: ClipPlane = "0, 0,-2,10".parse().unwrap();
        assert_eq!((plane.normal, plane.offset_mm), (DVec3::NEG_Z, 5.0));
        let plane: ClipPlane = "0.3,-0.2,0.7,1.5".parse().unwrap();
        assert_eq!(plane.to_string().parse::<ClipPlane>().unwrap(), plane);
        for bad in ["", "1,2,3", "1,2,3,4,5", "0,0,0,1", "1,0,0,nan", "1,0,0,inf", "1e300,0,0,1", "x,0,0,1"] {
            assert!(bad.parse::<ClipPlane>().is_err(), "{bad}");
        }
    }

    #[test]
    fn lines_are_clipped_and_planes_are_transformed() {
        let plane: ClipPlane = "1,1,0,2".parse().unwrap();
        let whole = [0.0, 100.0];
        assert_eq!(plane.cut(DVec3::ZERO, DVec3::X, whole), [2.0_f64.sqrt() / 0.5_f64.sqrt(), 100.0]);
        assert_eq!(plane.cut(DVec3::new(5.0, 0.0, 0.0), DVec3::NEG_X, whole)[0], 0.0);
        assert!((plane.cut(DVec3::new(5.0, 0.0, 0.0), DVec3::NEG_X, whole)[1] - 3.0).abs() < 1e-12);
        assert_eq!(plane.cut(DVec3::new(3.0, 0.0, 0.0), DVec3::Z, whole), whole);
        let [from, to] = plane.cut(DVec3::ZERO, DVec3::Z, whole);
        assert!(from > to);
        let world = DAffine3::from_mat3_translation(
            glam::DMat3::from_cols_array(&[1.0, 0.2, 0.0, 0.0, 2.0, 0.1, 0.3, 0.0, 3.0]),
            DVec3::new(4.0, -5.0, 6.0),
        );
        let (normal, offset) = plane.in_coordinates(world);
        for p in [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-4.0, 0.5, 2.0)] {
            let x = world.transform_point3(p);
            assert!((normal.dot(p) - offset - (plane.normal.dot(x) - plane.offset_mm)).abs() < 1e-12);
        }
    }
}
