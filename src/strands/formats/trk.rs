//! TrackVis track files, `.trk`, of versions 1 to 3, little- or big-endian (which is told by the header's own size).
//!
//! A header of 1000 bytes, then track after track: the number of its points (i32), for each point three coordinates and
//! `n_scalars` numbers (f32), and `n_properties` numbers. Where `n_count` is 0 tracks go on to the end of the file. How
//! coordinates become world mm is told in `trk_space.rs`.
//!
//! Source: <http://trackvis.org/docs/?subsect=fileformat>. Read here and not by the `trk-io` crate, which allocates what a
//! track claims before it has seen any of it, and panics where the file ends within one.

use super::input::Trouble;
use super::lines::Lines;
use super::trk_space::{Grid, world_from_trackvis};
use glam::{DAffine3, DMat3, DVec3};

/// How a file begins.
pub(super) const MAGIC: &[u8] = b"TRACK";

/// Bytes of the header, which is what the header says of itself.
const HEADER_BYTES: usize = 1000;

/// First bytes of the header's parts.
const DIMENSIONS: usize = 6;
const VOXEL_SIZE: usize = 12;
const SCALARS: usize = 36;
const PROPERTIES: usize = 238;
const VOX_TO_RAS: usize = 440;
const VOXEL_ORDER: usize = 948;
const COUNT: usize = 988;
const VERSION: usize = 992;
const HEADER_SIZE: usize = 996;

/// The bytes of a file, and their order.
#[derive(Clone, Copy)]
struct Bytes<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl Bytes<'_> {
    fn word<const N: usize>(self, at: usize) -> [u8; N] {
        let mut word = [0; N];
        word.copy_from_slice(&self.bytes[at..at + N]);
        if self.big_endian {
            word.reverse();
        }
        word
    }

    fn short(self, at: usize) -> i16 {
        i16::from_le_bytes(self.word(at))
    }

    fn integer(self, at: usize) -> i32 {
        i32::from_le_bytes(self.word(at))
    }

    fn float(self, at: usize) -> f64 {
        f64::from(f32::from_le_bytes(self.word(at)))
    }

    fn vector(self, at: usize) -> DVec3 {
        DVec3::from_array([0, 4, 8].map(|next| self.float(at + next)))
    }
}

/// What the header says of the tracks.
struct Header {
    world_from_trackvis: DAffine3,
    /// Numbers of a point, the coordinates among them.
    point_numbers: usize,
    /// Numbers behind the points of a track.
    properties: usize,
    /// 0: it is not said.
    count: usize,
}

impl Header {
    fn of(bytes: Bytes, lines: &mut Lines) -> Result<Self, Trouble> {
        let version = bytes.integer(VERSION);
        if !(1..=3).contains(&version) {
            return Err(Trouble::at_byte(VERSION, format!("version {version} is none of 1, 2 and 3")));
        }
        let many = |at: usize, what: &str| {
            let n = bytes.short(at);
            usize::try_from(n).map_err(|_| Trouble::at_byte(at, format!("{n} {what} are fewer than none")))
        };
        let (scalars, properties) = (many(SCALARS, "scalars")?, many(PROPERTIES, "properties")?);
        let count = bytes.integer(COUNT);
        let count = usize::try_from(count)
            .map_err(|_| Trouble::at_byte(COUNT, format!("{count} tracks are fewer than none")))?;
        Ok(Self {
            world_from_trackvis: space(bytes, version, lines)?,
            point_numbers: 3 + scalars,
            properties,
            count,
        })
    }
}

/// World mm from the file's coordinates.
fn space(bytes: Bytes, version: i32, lines: &mut Lines) -> Result<DAffine3, Trouble> {
    let voxel_mm = bytes.vector(VOXEL_SIZE);
    if !voxel_mm.to_array().iter().all(|mm| mm.is_finite() && *mm > 0.0) {
        let [x, y, z] = voxel_mm.to_array();
        return Err(Trouble::at_byte(VOXEL_SIZE, format!("a voxel of {x} x {y} x {z} mm has no size")));
    }
    let row =
        |row: usize| bytes.vector(VOX_TO_RAS + 16 * row).extend(bytes.float(VOX_TO_RAS + 16 * row + 12));
    let rows = [row(0), row(1), row(2)];
    let recorded = version > 1 && bytes.float(VOX_TO_RAS + 60) != 0.0;
    let world_from_voxel = if recorded {
        let matrix = DMat3::from_cols_array_2d(&rows.map(|r| r.truncate().to_array())).transpose();
        DAffine3::from_mat3_translation(matrix, DVec3::from_array(rows.map(|r| r.w)))
    } else {
        lines.warn(
            "its header has no vox_to_ras: positions are in voxels, and each is taken to be 1 mm".into(),
        );
        DAffine3::IDENTITY
    };
    let letters = &bytes.bytes[VOXEL_ORDER..VOXEL_ORDER + 4];
    let order = String::from_utf8_lossy(letters);
    let order = order.trim_end_matches(['\0', ' ']);
    let order = if order.is_empty() {
        lines.warn("its header has no voxel_order: LPS is assumed, TrackVis' own".into());
        "LPS"
    } else {
        order
    };
    let dims = [0, 2, 4].map(|next| f64::from(bytes.short(DIMENSIONS + next)));
    let grid = Grid { dims, voxel_mm, order, world_from_voxel };
    let (world, change_places) =
        world_from_trackvis(&grid).map_err(|why| Trouble::at_byte(VOXEL_ORDER, why))?;
    if change_places {
        let how = "programs differ on what that means: positions are as nibabel reads them";
        lines.warn(format!(
            "the axes of voxel_order {order} are in another order than those of vox_to_ras; {how}"
        ));
    }
    Ok(world)
}

/// The tracks of a file.
///
/// # Errors
/// It is not as the format has it, or ends within a track or before all that its header counts.
pub(super) fn parse(bytes: &[u8]) -> Result<Lines, Trouble> {
    if bytes.len() < HEADER_BYTES {
        let why = format!("the file ends within the header of {HEADER_BYTES} bytes");
        return Err(Trouble::at_byte(bytes.len(), why));
    }
    if !bytes.starts_with(MAGIC) {
        return Err(Trouble::at_byte(0, "it does not begin with `TRACK`"));
    }
    let orders = [false, true].map(|big_endian| Bytes { bytes, big_endian });
    let file =
        orders.into_iter().find(|b| b.integer(HEADER_SIZE) == HEADER_BYTES as i32).ok_or_else(|| {
            let size = orders[0].integer(HEADER_SIZE);
            Trouble::at_byte(
                HEADER_SIZE,
                format!("the header says that it has {size} bytes, not {HEADER_BYTES}"),
            )
        })?;
    let mut lines = Lines::default();
    let header = Header::of(file, &mut lines)?;
    let mut at = HEADER_BYTES;
    lines.reserve((bytes.len() - at) / (4 * header.point_numbers)).map_err(Trouble::of_file)?;
    while at < bytes.len() && (header.count == 0 || lines.count() < header.count) {
        at = track(file, at, &header, &mut lines)?;
    }
    if lines.count() < header.count {
        let why = format!("the file ends there, after {} of {} tracks", lines.count(), header.count);
        return Err(
            Trouble::at_byte(at, why).hint("where n_count of the header is 0, all that is there is read")
        );
    }
    if at < bytes.len() {
        let (left, count) = (bytes.len() - at, header.count);
        lines.warn(format!("{left} bytes behind the {count} tracks that its header counts were not read"));
    }
    Ok(lines)
}

/// Reads the track at a byte; gives the byte behind it.
fn track(file: Bytes, at: usize, header: &Header, lines: &mut Lines) -> Result<usize, Trouble> {
    let left = file.bytes.len() - at;
    if left < 4 {
        return Err(Trouble::at_byte(at, format!("{left} bytes are left there, too few for a track")));
    }
    let claimed = file.integer(at);
    let points = u64::try_from(claimed)
        .map_err(|_| Trouble::at_byte(at, format!("a track of {claimed} points has fewer than none")))?;
    // At most 2^31 points of 2^15 + 2 numbers.
    let wanted = 4 + 4 * (points * header.point_numbers as u64 + header.properties as u64);
    if wanted > left as u64 {
        let why = format!("a track of {points} points takes {wanted} bytes, but {left} are left");
        return Err(Trouble::at_byte(at, why));
    }
    let first = at + 4;
    for point in 0..points as usize {
        let place = first + 4 * point * header.point_numbers;
        let world = header.world_from_trackvis.transform_point3(file.vector(place));
        lines.point(world).map_err(|why| Trouble::at_byte(place, why))?;
    }
    lines.end().map_err(Trouble::of_file)?;
    Ok(at + wanted as usize)
}
