//! Writing volumes as NIfTI-1 (`.nii` or `.nii.gz`).
//!
//! Written here and not by the `nifti` crate, whose writer drops the value scaling and writes in place.

use crate::error::{Error, Result};
use crate::files::output::{check_output, write_whole};
use crate::volume::{Volume, Voxels};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::{self, Write};
use std::path::Path;

/// Header, and four bytes that say that no extensions follow.
const VOX_OFFSET: usize = 352;

/// File-name endings that [`write_nifti`] knows.
pub const NIFTI_EXTENSIONS: &[&str] = &["nii", "nii.gz"];

/// Writes a volume with its scaling and, as sform, its affine (both in `f32`, as the format has them).
///
/// The file appears whole or not at all.
///
/// # Errors
/// The name does not end in `.nii` or `.nii.gz`, a dimension is beyond 32767, or the file cannot be written.
pub fn write_nifti(volume: &Volume, path: &Path) -> Result<()> {
    check_output(path, NIFTI_EXTENSIONS)?;
    let header = header(volume).map_err(|why| Error::input("cannot write volume", path.display(), why))?;
    let gzipped = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    write_whole(path, |file| {
        if gzipped {
            let mut stream = GzEncoder::new(file, Compression::fast());
            write_all(&mut stream, &header, volume)?;
            stream.finish().map(|_| ())
        } else {
            write_all(file, &header, volume)
        }
    })
}

fn header(volume: &Volume) -> std::result::Result<[u8; VOX_OFFSET], String> {
    let mut header = [0u8; VOX_OFFSET];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    let (datatype, bits): (i16, i16) = match volume.voxels() {
        Voxels::U8(_) => (2, 8),
        Voxels::I16(_) => (4, 16),
        Voxels::U16(_) => (512, 16),
        Voxels::F32(_) => (16, 32),
        Voxels::F64(_) => (64, 64),
    };
    put(0, &348i32.to_le_bytes());
    put(40, &3i16.to_le_bytes());
    for axis in 0..7 {
        let n = volume.dims().get(axis).copied().unwrap_or(1);
        let n =
            i16::try_from(n).map_err(|_| format!("{n} voxels along an axis are more than NIfTI-1 holds"))?;
        put(42 + 2 * axis, &n.to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(72, &bits.to_le_bytes());
    put(76, &1f32.to_le_bytes());
    for (axis, mm) in volume.spacing_mm().into_iter().enumerate() {
        put(80 + 4 * axis, &(mm as f32).to_le_bytes());
    }
    put(108, &(VOX_OFFSET as f32).to_le_bytes());
    put(112, &(volume.scaling().slope as f32).to_le_bytes());
    put(116, &(volume.scaling().intercept as f32).to_le_bytes());
    // Millimetres.
    put(123, &[2]);
    // sform_code 1: scanner coordinates.
    put(254, &1i16.to_le_bytes());
    let affine = volume.world_from_index();
    for row in 0..3 {
        for column in 0..4 {
            let value = if column < 3 { affine.matrix3.col(column)[row] } else { affine.translation[row] };
            put(280 + 16 * row + 4 * column, &(value as f32).to_le_bytes());
        }
    }
    put(344, b"n+1\0");
    Ok(header)
}

fn write_all(out: &mut (impl Write + ?Sized), header: &[u8], volume: &Volume) -> io::Result<()> {
    out.write_all(header)?;
    macro_rules! write_voxels {
        ($array:expr) => {{
            let mut bytes = Vec::with_capacity(1 << 16);
            for chunk in $array.as_slice().unwrap_or_default().chunks(1 << 13) {
                bytes.clear();
                chunk.iter().for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()));
                out.write_all(&bytes)?;
            }
        }};
    }
    match volume.voxels() {
        Voxels::U8(a) => write_voxels!(a),
        Voxels::I16(a) => write_voxels!(a),
        Voxels::U16(a) => write_voxels!(a),
        Voxels::F32(a) => write_voxels!(a),
        Voxels::F64(a) => write_voxels!(a),
    }
    Ok(())
}
