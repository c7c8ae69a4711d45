//! Geometry of clip planes for display: their intersection with the volume's bounding box, and the handles to drag
//! them.

use crate::scene::AxisView;
use crate::transfer::ClipPlane;
use glam::DVec3;

/// Edges of a box as pairs of corner indices, 0 to 7. Bits 0, 1 and 2 of an index select the lower or upper side
/// along x, y and z.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// Polygon where a clip plane cuts a box, world mm; empty if the plane does not cut the box.
pub fn outline(corners: &[DVec3; 8], plane: &ClipPlane) -> Vec<DVec3> {
    let above = corners.map(|c| plane.normal.dot(c) - plane.offset_mm);
    let cut = |[a, b]: [usize; 2]| {
        let crosses = (above[a] < 0.0) != (above[b] < 0.0);
        crosses.then(|| corners[a].lerp(corners[b], above[a] / (above[a] - above[b])))
    };
    let mut points: Vec<DVec3> = EDGES.into_iter().filter_map(cut).collect();
    let center = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let [right, up] = <[DVec3; 2]>::from(plane.normal.any_orthonormal_pair());
    let angle = |p: &DVec3| (*p - center).dot(up).atan2((*p - center).dot(right));
    points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    points
}

/// Centre of a box.
fn center(corners: &[DVec3; 8]) -> DVec3 {
    corners.iter().sum::<DVec3>() / 8.0
}

/// Position of the handle of a clip plane, world mm: the centre of the polygon inside the box, or else the plane's
/// point nearest to the box centre.
pub fn handle(corners: &[DVec3; 8], plane: &ClipPlane) -> DVec3 {
    let points = outline(corners, plane);
    let on_plane = |p: DVec3| p + plane.normal * (plane.offset_mm - plane.normal.dot(p));
    match points.len() {
        0 => on_plane(center(corners)),
        n => on_plane(points.iter().sum::<DVec3>() / n as f64),
    }
}

/// Clip plane through the centre of a box. It cuts away the half towards the camera of an axis view (anterior, left,
/// ...).
pub fn from_side(corners: &[DVec3; 8], view: &AxisView) -> ClipPlane {
    through_middle(corners, -view.away)
}

/// Clip plane through the centre of a box with a given normal.
pub fn through_middle(corners: &[DVec3; 8], normal: DVec3) -> ClipPlane {
    let normal = normal.normalize_or(DVec3::Z);
    ClipPlane { normal, offset_mm: normal.dot(center(corners)) }
}

/// Smallest and largest signed distance from the world origin at which a clip plane with a given normal cuts a box,
/// mm.
pub fn offsets_mm(corners: &[DVec3; 8], normal: DVec3) -> [f64; 2] {
    let along = corners.map(|c| normal.dot(c));
    [along.into_iter().fold(f64::INFINITY, f64::min), along.into_iter().fold(f64::NEG_INFINITY, f64::max)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::AXIS_VIEWS;

    fn unit_box() -> [DVec3; 8] {
        std::array::from_fn(|c| DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64))
    }

    #[test]
    fn outlines_go_around_what_is_cut() {
        for (text, sides) in [("0,0,1,0.25", 4), ("1,1,1,0.5", 3), ("1,1,1,1.5", 6), ("1,0,0,2", 0)] {
            let plane: ClipPlane = text.parse().unwrap();
            let points = outline(&unit_box(), &plane);
            assert_eq!(points.len(), sides, "{text}");
            assert!(points.iter().all(|p| (plane.normal.dot(*p) - plane.offset_mm).abs() < 1e-12));
            // Convex and in order: every turn has the same sign.
            let turn = |i: usize| {
                let [a, b, c] = [0, 1, 2].map(|k| points[(i + k) % sides]);
                (b - a).cross(c - b).dot(plane.normal)
            };
            assert!((0..sides).all(|i| turn(i) * turn(0) > 0.0), "{text}");
            let point = handle(&unit_box(), &plane);
            assert!((plane.normal.dot(point) - plane.offset_mm).abs() < 1e-12);
        }
    }

    #[test]
    fn a_cut_from_a_side_takes_that_side_away() {
        for view in &AXIS_VIEWS {
            let plane = from_side(&unit_box(), view);
            let side = DVec3::splat(0.5) + 0.4 * view.away;
            assert!(plane.normal.dot(side) < plane.offset_mm, "{}", view.name);
            let [low, high] = offsets_mm(&unit_box(), plane.normal);
            assert!((plane.offset_mm - 0.5 * (low + high)).abs() < 1e-12);
        }
    }
}
