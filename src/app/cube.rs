//! Geometry of the orientation cube of the viewer, in parallel projection. Each cube face has nine clickable cells:
//! the centre for the face's own direction, the others for its edges and corners.
//!
//! Lengths are in half edges, on screen x to the right and y up.

use crate::scene::{AXIS_VIEWS, CameraFrame};
use glam::{DVec2, DVec3, IVec3};

/// Half size of the centre cell on a face of the orientation cube, in half edge lengths.
const MIDDLE: f64 = 0.7;
/// Minimum cosine between the normal of a cube face and the view direction at which the face counts as visible.
const EDGE_ON: f64 = 1e-3;

/// Visible clickable cell on a face of the orientation cube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Direction from the target to the camera that a click on this cell of the orientation cube selects: -1, 0 or 1
    /// along each axis, RAS+.
    pub away: IVec3,
    /// Outward normal of the cube face that contains this cell.
    pub face: IVec3,
    /// Corners on screen of this clickable cell of the orientation cube, in order around the cell, in half edge
    /// lengths of the cube.
    pub corners: [DVec2; 4],
}

/// Returns the two axes parallel to a face of the orientation cube.
fn sides(face: IVec3) -> [IVec3; 2] {
    match face.abs() {
        IVec3::X => [IVec3::Y, IVec3::Z],
        IVec3::Y => [IVec3::X, IVec3::Z],
        _ => [IVec3::X, IVec3::Y],
    }
}

/// Visible faces of the orientation cube: the normal of each, with its cosine to the direction towards the camera.
pub fn faces(frame: &CameraFrame) -> impl Iterator<Item = (IVec3, f64)> {
    let away = -frame.forward;
    let facing = move |view: &crate::scene::AxisView| (view.away.as_ivec3(), view.away.dot(away));
    AXIS_VIEWS.iter().map(facing).filter(|(_, cosine)| *cosine > EDGE_ON)
}

/// Projects a point of the orientation cube to the screen.
pub fn on_screen(frame: &CameraFrame, point: DVec3) -> DVec2 {
    DVec2::new(point.dot(frame.right), point.dot(frame.up))
}

/// Corners of a face of the orientation cube, in order around the face.
pub fn outline(face: IVec3) -> [DVec3; 4] {
    let [u, v] = sides(face).map(|side| side.as_dvec3());
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(a, b)| face.as_dvec3() + a * u + b * v)
}

/// Visible clickable cells of the orientation cube.
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

/// Direction of the orientation-cube cell at a point on screen; `None` outside the cube.
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

/// Camera placement for a direction picked on the orientation cube: direction from the target to the camera, and up
/// vector. Directions along an axis use the anatomical axis view.
pub fn view(away: IVec3) -> (DVec3, DVec3) {
    match AXIS_VIEWS.iter().find(|view| view.away.as_ivec3() == away) {
        Some(view) => (view.away, view.up),
        None => (away.as_dvec3().normalize_or(DVec3::Y), DVec3::Z),
    }
}

/// Anatomical name of a direction picked on the orientation cube: `anterior`, `anterior left superior`.
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
