//! World mm from the coordinates of a TrackVis file.
//!
//! They are *voxel mm*: indices times voxel sizes, counted from the corner of the first voxel, in the axes that `voxel_order`
//! names. To world mm, RAS+, in these steps: divided by the voxel sizes; half a voxel less, since `vox_to_ras` has its zero in
//! a voxel's centre; axes put in the order and the direction of those of `vox_to_ras`, whose directions are those of the nearest
//! rotation; then `vox_to_ras` itself. That is what `nibabel.streamlines` does, also where axes change places.

use glam::{DAffine3, DMat3, DVec3};
use nalgebra::Matrix3;

/// What the header says of the voxels.
pub(super) struct Grid<'a> {
    /// Voxels along each axis, in the order of `order`.
    pub dims: [f64; 3],
    /// Edges of a voxel, mm.
    pub voxel_mm: DVec3,
    /// Three letters: where each axis goes.
    pub order: &'a str,
    /// World mm from indices whose zero is a voxel's centre.
    pub world_from_voxel: DAffine3,
}

/// Where an axis goes: the world's axis, and whether along it (1) or against it (-1).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Way {
    axis: usize,
    sign: f64,
}

/// World mm from the file's coordinates, and whether axes change places on the way; or why not.
pub(super) fn world_from_trackvis(grid: &Grid) -> Result<(DAffine3, bool), String> {
    let from = ways_of_letters(grid.order).ok_or_else(|| {
        format!("the voxel order `{}` is no three axes, one of R L, A P, S I each", grid.order)
    })?;
    let to = ways_of_affine(grid.world_from_voxel.matrix3)
        .ok_or_else(|| "vox_to_ras leaves the directions of its axes open".to_owned())?;
    let turned = turned(from, to, grid.dims)?;
    let index_from_mm = DAffine3::from_scale(grid.voxel_mm.recip());
    let centre_from_corner = DAffine3::from_translation(DVec3::splat(-0.5));
    let all = grid.world_from_voxel * turned * centre_from_corner * index_from_mm;
    let change_places = from.iter().zip(to).any(|(from, to)| from.axis != to.axis);
    match all.is_finite() {
        true => Ok((all, change_places)),
        false => Err("vox_to_ras has numbers that are not finite".into()),
    }
}

fn ways_of_letters(order: &str) -> Option<[Way; 3]> {
    let way = |letter: char| {
        let place = "RLAPSI".find(letter.to_ascii_uppercase())?;
        Some(Way { axis: place / 2, sign: if place % 2 == 0 { 1.0 } else { -1.0 } })
    };
    let ways: Vec<Way> = order.chars().map(way).collect::<Option<_>>()?;
    let ways = <[Way; 3]>::try_from(ways).ok()?;
    let each_once = (0..3).all(|axis| ways.iter().any(|w| w.axis == axis));
    each_once.then_some(ways)
}

/// The world axes that the columns of a matrix go along most, each taken once: those of the nearest rotation, the clearest
/// column first.
fn ways_of_affine(matrix: DMat3) -> Option<[Way; 3]> {
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
    let mut ways = [None; 3];
    for column in order {
        let axis = (0..3).reduce(|best, axis| {
            let larger = rotation[(axis, column)].abs() > rotation[(best, column)].abs();
            if larger { axis } else { best }
        })?;
        ways[column] = Some(Way { axis, sign: rotation[(axis, column)].signum() });
        rotation.row_mut(axis).fill(0.0);
    }
    let [Some(x), Some(y), Some(z)] = ways else { return None };
    let each_once = (0..3).all(|axis| [x, y, z].iter().any(|w| w.axis == axis));
    each_once.then_some([x, y, z])
}

/// Indices in the axes of `to` from those in the axes of `from`, which have `dims` voxels.
fn turned(from: [Way; 3], to: [Way; 3], dims: [f64; 3]) -> Result<DAffine3, String> {
    let (mut matrix, mut shift) = (DMat3::ZERO, DVec3::ZERO);
    for (row, way) in from.iter().enumerate() {
        let column = to.iter().position(|t| t.axis == way.axis).unwrap_or(row);
        let along = way.sign * to[column].sign;
        matrix.col_mut(column)[row] = along;
        if along < 0.0 {
            if dims[row] < 1.0 {
                return Err(format!(
                    "axes are to be turned about, and there are {} voxels along one",
                    dims[row]
                ));
            }
            shift[row] = dims[row] - 1.0;
        }
    }
    Ok(DAffine3::from_mat3_translation(matrix, shift))
}
