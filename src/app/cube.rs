//! Geometry of the orientation cube under a parallel projection. A face has nine cells: the centre for its own direction, the
//! others for its edges and corners.
//!
//! Lengths are in half edges, on screen x to the right and y up.

use crate::scene::{AXIS_VIEWS, CameraFrame};
use glam::{DVec2, DVec3, IVec3};

/// Half size of a face's centre cell.
const MIDDLE: f64 = 0.7;
/// Minimum cosine between a visible face and the view direction.
const EDGE_ON: f64 = 1e-3;

/// Visible cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// View direction: -1, 0 or 1 along each axis, RAS+.
    pub away: IVec3,
    /// Direction of the face.
    pub face: IVec3,
    /// Corners on screen, in order.
    pub corners: [DVec2; 4],
}

/// Axes along a face.
fn sides(face: IVec3) -> [IVec3; 2] {
    match face.abs() {
        IVec3::X => [IVec3::Y, IVec3::Z],
        IVec3::Y => [IVec3::X, IVec3::Z],
        _ => [IVec3::X, IVec3::Y],
    }
}

/// Visible faces by their directions, with the cosine to the view direction.
pub fn faces(frame: &CameraFrame) -> impl Iterator<Item = (IVec3, f64)> {
    let away = -frame.forward;
    let facing = move |view: &crate::scene::AxisView| (view.away.as_ivec3(), view.away.dot(away));
    AXIS_VIEWS.iter().map(facing).filter(|(_, cosine)| *cosine > EDGE_ON)
}

/// Projection of a point.
pub fn on_screen(frame: &CameraFrame, point: DVec3) -> DVec2 {
    DVec2::new(point.dot(frame.right), point.dot(frame.up))
}

/// Corners of a face, in order.
pub fn outline(face: IVec3) -> [DVec3; 4] {
    let [u, v] = sides(face).map(|side| side.as_dvec3());
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(a, b)| face.as_dvec3() + a * u + b * v)
}

/// Visible cells.
pub fn cells(frame: &CameraFrame) -> Vec<Cell> {
    let range = |i: i32| match i {
        -1 => [-1.0, -MIDDLE],
        0 => [-MIDDLE, MIDDLE],
        _ => [MIDDLE, 1.0],
    };
    let mut cells = Vec::with_capacity(27);
    for (face, _) in faces(frame) {
        let [u, v] = sides(face);
        for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j))) {
            let ([u0, u1], [v0, v1]) = (range(i), range(j));
            let corner =
                |[a, b]: [f64; 2]| on_screen(frame, face.as_dvec3() + a * u.as_dvec3() + b * v.as_dvec3());
            let corners = [[u0, v0], [u1, v0], [u1, v1], [u0, v1]].map(corner);
            cells.push(Cell { away: face + i * u + j * v, face, corners });
        }
    }
    cells
}

/// Direction of the cell at a point on screen; `None` beside the cube.
pub fn hit(frame: &CameraFrame, at: DVec2) -> Option<IVec3> {
    let contains = |cell: &Cell| {
        let sides = [0, 1, 2, 3].map(|i| {
            let [from, to] = [cell.corners[i], cell.corners[(i + 1) % 4]];
            (to - from).perp_dot(at - from)
        });
        sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
    };
    cells(frame).into_iter().find(contains).map(|cell| cell.away)
}

/// Direction from the target to the eye and up vector for a direction of the cube; the anatomical view where there is one.
pub fn view(away: IVec3) -> (DVec3, DVec3) {
    match AXIS_VIEWS.iter().find(|view| view.away.as_ivec3() == away) {
        Some(view) => (view.away, view.up),
        None => (away.as_dvec3().normalize_or(DVec3::Y), DVec3::Z),
    }
}

/// Name of a direction: `anterior`, `anterior left superior`.
pub fn name(away: IVec3) -> String {
    let parts = AXIS_VIEWS.iter().filter(|view| view.away.as_ivec3().dot(away) > 0);
    parts.map(|view| view.name.to_lowercase()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Camera;

    fn frame(away: DVec3, up: DVec3) -> CameraFrame {
        Camera { eye: 9.0 * away, target: DVec3::ZERO, up, fov_deg: 40.0 }.frame()
    }

    #[test]
    fn from_each_anatomical_side_that_face_alone_is_seen_upright() {
        for side in &AXIS_VIEWS {
            let frame = frame(side.away, side.up);
            let faces: Vec<_> = faces(&frame).collect();
            assert_eq!(faces.len(), 1);
            assert_eq!(hit(&frame, DVec2::ZERO), Some(side.away.as_ivec3()), "{}", side.name);
            assert_eq!(view(side.away.as_ivec3()), (side.away, side.up));
            assert_eq!(name(side.away.as_ivec3()), side.name.to_lowercase());
            // The corners form a square.
            for corner in cells(&frame).iter().flat_map(|cell| cell.corners) {
                assert!(corner.abs().max_element() <= 1.0 + 1e-12);
            }
            assert_eq!(hit(&frame, DVec2::new(1.01, 0.0)), None);
        }
    }

    #[test]
    fn a_place_in_a_cell_hits_that_cell() {
        for i in 0..60 {
            let t = f64::from(i);
            let away = DVec3::new((1.3 * t).sin(), (2.1 * t).cos(), (0.7 * t).sin() + 0.01).normalize();
            let frame = frame(away, DVec3::Z);
            let cells = cells(&frame);
            assert!(cells.len() >= 9 && cells.len() <= 27);
            let mut hits = 0;
            for cell in &cells {
                let middle = cell.corners.iter().sum::<DVec2>() / 4.0;
                let [a, b, _, d] = cell.corners;
                // Too thin to contain its own centre.
                if (b - a).perp_dot(d - a).abs() < 1e-6 {
                    continue;
                }
                assert_eq!(hit(&frame, middle), Some(cell.away), "{away} {cell:?}");
                hits += 1;
            }
            assert!(hits >= 9);
            // The eye is on the side that is hit in the centre.
            assert!(hit(&frame, DVec2::ZERO).unwrap().as_dvec3().dot(away) > 0.0);
            assert_eq!(hit(&frame, DVec2::splat(3.0_f64.sqrt())), None);
        }
    }

    #[test]
    fn edges_and_corners_are_looked_at_upright() {
        let (away, up) = view(IVec3::new(-1, 1, 1));
        assert!((away - DVec3::new(-1.0, 1.0, 1.0).normalize()).length() < 1e-12 && up == DVec3::Z);
        assert_eq!(name(IVec3::new(-1, 1, 1)), "anterior left superior");
        let frame = frame(away, up);
        assert!(frame.right.z.abs() < 1e-12 && frame.right.is_finite());
        // All three of its faces are visible, and it lies in the centre.
        assert_eq!(faces(&frame).count(), 3);
        assert_eq!(hit(&frame, DVec2::new(0.0, 1e-6)), Some(IVec3::new(-1, 1, 1)));
    }
}
