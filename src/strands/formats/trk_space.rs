//! Converts the coordinates of a TrackVis file (`.trk`) to world mm.
//!
//! The file uses *voxel mm*: indices times voxel sizes, counted from the corner of the first voxel, along the axes
//! that `voxel_order` names. The steps to world mm, RAS+, are those of `nibabel.streamlines`: divide by the voxel
//! sizes; subtract half a voxel, since `vox_to_ras` has its zero in a voxel's centre; reorder and flip axes to match
//! those of `vox_to_ras`, whose directions are those of the nearest rotation; apply `vox_to_ras`.

use glam::{DAffine3, DMat3, DVec3};
use nalgebra::Matrix3;

/// Voxel grid that the header of a TrackVis file describes.
pub(super) struct TrackGrid<'a> {
    /// Number of voxels along each axis of the TrackVis grid, in the order of the file's `voxel_order`.
    pub dims: [f64; 3],
    /// Size of a voxel of the TrackVis grid along each axis, mm.
    pub voxel_mm: DVec3,
    /// Direction of each axis of the TrackVis grid, three letters such as `LPS` (`voxel_order` of the header).
    pub order: &'a str,
    /// Transform from voxel indices to world mm (`vox_to_ras` of the TrackVis header); index 0 is a voxel's centre.
    pub world_from_voxel: DAffine3,
}

/// Anatomical direction of a voxel grid axis: the nearest world axis, and the sign 1 along it or -1 against it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Direction {
    axis: usize,
    sign: f64,
}

/// Returns the transform from the coordinates of a TrackVis file to world mm, and whether the transform permutes the
/// grid's axes.
pub(super) fn world_from_trackvis(grid: &TrackGrid) -> Result<(DAffine3, bool), String> {
    let from = directions_of_letters(grid.order).ok_or_else(|| {
        format!("the voxel order `{}` is no three axes, one of R L, A P, S I each", grid.order)
    })?;
    let to = directions_of_matrix(grid.world_from_voxel.matrix3)
        .ok_or_else(|| "vox_to_ras leaves the directions of its axes open".to_owned())?;
    let reordered = reordered(from, to, grid.dims)?;
    let index_from_mm = DAffine3::from_scale(grid.voxel_mm.recip());
    let centre_from_corner = DAffine3::from_translation(DVec3::splat(-0.5));
    let all = grid.world_from_voxel * reordered * centre_from_corner * index_from_mm;
    let change_places = from.iter().zip(to).any(|(from, to)| from.axis != to.axis);
    match all.is_finite() {
        true => Ok((all, change_places)),
        false => Err("vox_to_ras has numbers that are not finite".into()),
    }
}

/// Parses the directions of the three axes of a TrackVis grid from letters such as `LPS`; `None` unless each axis
/// occurs once.
fn directions_of_letters(order: &str) -> Option<[Direction; 3]> {
    let direction = |letter: char| {
        let place = "RLAPSI".find(letter.to_ascii_uppercase())?;
        Some(Direction { axis: place / 2, sign: if place % 2 == 0 { 1.0 } else { -1.0 } })
    };
    let directions: Vec<Direction> = order.chars().map(direction).collect::<Option<_>>()?;
    <[Direction; 3]>::try_from(directions).ok().filter(each_axis_once)
}

fn each_axis_once(directions: &[Direction; 3]) -> bool {
    (0..3).all(|axis| directions.iter().any(|d| d.axis == axis))
}

/// Assigns a different world axis to each column of a matrix: the nearest one, beginning with the column closest to
/// an axis. The columns are those of the matrix's nearest rotation.
fn directions_of_matrix(matrix: DMat3) -> Option<[Direction; 3]> {
    if !matrix.is_finite() {
        return None;
    }
    let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|c| c.normalize_or_zero());
    let scaled = Matrix3::from_fn(|row, column| columns[column][row]);
    let svd = scaled.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    if svd.singular_values.min() <= 3.0 * f64::from(f32::EPSILON) * svd.singular_values.max() {
        return None;
    }
    let mut rotation = u * v_t;
    let mut order = [0, 1, 2];
    let clearest = |column: usize| rotation.column(column).amax();
    order.sort_by(|a, b| clearest(*b).total_cmp(&clearest(*a)));
    let mut directions = [None; 3];
    for column in order {
        let axis = (0..3).reduce(|best, axis| {
            let larger = rotation[(axis, column)].abs() > rotation[(best, column)].abs();
            if larger { axis } else { best }
        })?;
        directions[column] = Some(Direction { axis, sign: rotation[(axis, column)].signum() });
        rotation.row_mut(axis).fill(0.0);
    }
    let [x, y, z] = directions;
    Some([x?, y?, z?]).filter(each_axis_once)
}

/// Returns the transform of voxel indices from a grid with axes along `from` to one with axes along `to`. `dims` are
/// the numbers of voxels along `from`.
fn reordered(from: [Direction; 3], to: [Direction; 3], dims: [f64; 3]) -> Result<DAffine3, String> {
    let (mut matrix, mut shift) = (DMat3::ZERO, DVec3::ZERO);
    for (row, direction) in from.iter().enumerate() {
        let column = to.iter().position(|t| t.axis == direction.axis).unwrap_or(row);
        let along = direction.sign * to[column].sign;
        matrix.col_mut(column)[row] = along;
        if along < 0.0 {
            if dims[row] < 1.0 {
                let n = dims[row];
                return Err(format!("axes are to be turned about, and there are {n} voxels along one"));
            }
            shift[row] = dims[row] - 1.0;
        }
    }
    Ok(DAffine3::from_mat3_translation(matrix, shift))
}
