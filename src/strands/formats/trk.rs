//! Reader of TrackVis track files (`.trk`) of versions 1 to 3. The header's size field tells the byte order.
//!
//! The tracks follow a header of 1000 bytes. Each track stores its number of points (i32), then for each point three
//! coordinates and `n_scalars` numbers (f32), then `n_properties` numbers (f32). If the header's `n_count` is 0, the
//! tracks extend to the end of the file. `trk_space.rs` converts coordinates to world mm.
//!
//! Source: <http://trackvis.org/docs/?subsect=fileformat>. The `trk-io` crate is not used: it allocates memory for
//! the point count that a track claims before reading the points, and panics if the file ends within a track.

use super::input::at_byte;
use super::lines::Polylines;
use super::trk_space::{TrackGrid, world_from_trackvis};
use crate::error::Result;
use crate::files::binary::BinaryFields;
use glam::{DAffine3, DMat3, DVec3};

/// First bytes of every TrackVis track file (`.trk`).
pub(super) const MAGIC: &[u8] = b"TRACK";

/// Size of the header of a TrackVis file, bytes.
const HEADER_BYTES: usize = 1000;

/// Byte offset of the grid dimensions in the header of a TrackVis file. The next constants are byte offsets of other
/// header fields.
const DIMENSIONS: usize = 6;
const VOXEL_SIZE: usize = 12;
const SCALARS: usize = 36;
const PROPERTIES: usize = 238;
const VOX_TO_RAS: usize = 440;
const VOXEL_ORDER: usize = 948;
const COUNT: usize = 988;
const VERSION: usize = 992;
const HEADER_SIZE: usize = 996;

/// Converts a count read at byte offset `at` of a TrackVis file. A negative count is an error.
fn count_of(n: i32, at: usize, what: &str) -> Result<usize> {
    usize::try_from(n).map_err(|_| at_byte(at, format!("{n} {what} are fewer than none")))
}

/// Returns the transform from the coordinates of a TrackVis file to world mm. It adds warnings about the file's
/// header to those of `lines`.
fn space(file: BinaryFields, version: i32, lines: &mut Polylines) -> Result<DAffine3> {
    let voxel_mm: [f64; 3] = file.floats(VOXEL_SIZE);
    if !voxel_mm.iter().all(|mm| mm.is_finite() && *mm > 0.0) {
        let [x, y, z] = voxel_mm;
        return Err(at_byte(VOXEL_SIZE, format!("a voxel of {x} x {y} x {z} mm has no size")));
    }
    let matrix: [f64; 16] = file.floats(VOX_TO_RAS);
    let world_from_voxel = if version > 1 && matrix[15] != 0.0 {
        let column = |c: usize| DVec3::from_array([0, 4, 8].map(|row| matrix[row + c]));
        let linear = DMat3::from_cols(column(0), column(1), column(2));
        DAffine3::from_mat3_translation(linear, column(3))
    } else {
        let warning = "its header has no vox_to_ras: positions are in voxels, and each is taken to be 1 mm";
        lines.warnings.push(warning.into());
        DAffine3::IDENTITY
    };
    let order = String::from_utf8_lossy(&file.bytes[VOXEL_ORDER..VOXEL_ORDER + 4]);
    let mut order = order.trim_end_matches(['\0', ' ']);
    if order.is_empty() {
        lines.warnings.push("its header has no voxel_order: LPS is assumed, TrackVis' own".into());
        order = "LPS";
    }
    let dims = [0, 2, 4].map(|next| f64::from(file.short(DIMENSIONS + next)));
    let grid = TrackGrid { dims, voxel_mm: voxel_mm.into(), order, world_from_voxel };
    let (world, change_places) = world_from_trackvis(&grid).map_err(|why| at_byte(VOXEL_ORDER, why))?;
    if change_places {
        let how = "programs differ on what that means: positions are as nibabel reads them";
        lines.warnings.push(format!(
            "the axes of voxel_order {order} are in another order than those of vox_to_ras; {how}"
        ));
    }
    Ok(world)
}

/// Parses the tracks of a TrackVis file (`.trk`).
///
/// # Errors
/// The file breaks its format, or ends before the last track that its header counts.
pub(super) fn parse(bytes: &[u8]) -> Result<Polylines> {
    let length = bytes.len();
    if length < HEADER_BYTES {
        return Err(at_byte(length, format!("the file ends within the header of {HEADER_BYTES} bytes")));
    }
    if !bytes.starts_with(MAGIC) {
        return Err(at_byte(0, "it does not begin with `TRACK`"));
    }
    let orders = [false, true].map(|big_endian| BinaryFields { bytes, big_endian });
    let file = orders.into_iter().find(|b| b.integer(HEADER_SIZE) == HEADER_BYTES as i32);
    let file = file.ok_or_else(|| {
        let size = orders[0].integer(HEADER_SIZE);
        at_byte(HEADER_SIZE, format!("the header says that it has {size} bytes, not {HEADER_BYTES}"))
    })?;
    let version = file.integer(VERSION);
    if !(1..=3).contains(&version) {
        return Err(at_byte(VERSION, format!("version {version} is none of 1, 2 and 3")));
    }
    let point_numbers = 3 + count_of(file.short(SCALARS).into(), SCALARS, "scalars")?;
    let properties = count_of(file.short(PROPERTIES).into(), PROPERTIES, "properties")?;
    // 0 if the header does not give the number of tracks.
    let count = count_of(file.integer(COUNT), COUNT, "tracks")?;
    let mut lines = Polylines::default();
    let world_from_trackvis = space(file, version, &mut lines)?;
    let mut at = HEADER_BYTES;
    lines.reserve((length - at) / (4 * point_numbers))?;
    while at < length && (count == 0 || lines.count() < count) {
        let left = length - at;
        if left < 4 {
            return Err(at_byte(at, format!("{left} bytes are left there, too few for a track")));
        }
        let claimed = file.integer(at);
        let points = u64::try_from(claimed)
            .map_err(|_| at_byte(at, format!("a track of {claimed} points has fewer than none")))?;
        // At most 2^31 points of 2^15 + 2 numbers.
        let wanted = 4 + 4 * (points * point_numbers as u64 + properties as u64);
        if wanted > left as u64 {
            let why = format!("a track of {points} points takes {wanted} bytes, but {left} are left");
            return Err(at_byte(at, why));
        }
        for point in 0..points as usize {
            let place = at + 4 + 4 * point * point_numbers;
            let world = world_from_trackvis.transform_point3(file.floats(place).into());
            lines.point(world).map_err(|why| at_byte(place, why))?;
        }
        lines.end();
        at += wanted as usize;
    }
    if lines.count() < count {
        let why = format!("the file ends there, after {} of {count} tracks", lines.count());
        return Err(at_byte(at, why).hint("where n_count of the header is 0, all that is there is read"));
    }
    if at < length {
        let left = length - at;
        let warning = format!("{left} bytes behind the {count} tracks that its header counts were not read");
        lines.warnings.push(warning);
    }
    Ok(lines)
}
