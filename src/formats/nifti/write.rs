//! Writes NIfTI-1 volumes (`.nii` and `.nii.gz`).
//!
//! The writer of the `nifti` crate is not used: it drops the slope and intercept of the values, and overwrites files
//! in place.

use super::header::DATATYPES;
use crate::error::{Error, Result};
use crate::files::output::{check_output, write_whole};
use crate::formats::numbers::Numbers;
use crate::volume::Volume;
use flate2::Compression;
use flate2::write::GzEncoder;
use glam::{DMat3, DQuat};
use std::io::Write;
use std::path::Path;

/// Offset of the voxels in a written NIfTI-1 file, in bytes: header and four extension flags.
const VOX_OFFSET: usize = 352;
/// Largest deviation from a rotation at which an affine is still written as a NIfTI qform: a few roundings of `f32`.
const QFORM_TOLERANCE: f64 = 1e-6;

/// File extensions that [`write_nifti`] accepts.
pub const NIFTI_EXTENSIONS: &[&str] = &["nii", "nii.gz"];

/// Writes a volume as NIfTI-1 with its slope, intercept and affine in `f32`. The affine is written as sform, and as
/// qform too if it has no shear.
///
/// A failed write leaves no partial file.
///
/// # Errors
/// The name does not end in `.nii` or `.nii.gz`, a dimension is beyond 32767, or the file cannot be written.
pub fn write_nifti(volume: &Volume, path: &Path) -> Result<()> {
    check_output(path, NIFTI_EXTENSIONS)?;
    let header = header(volume).map_err(|why| Error::input("cannot write volume", path.display(), why))?;
    let is_gzipped = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let voxels = Numbers::stored(volume);
    write_whole(path, |file| {
        if is_gzipped {
            let mut stream = GzEncoder::new(file, Compression::fast());
            stream.write_all(&header)?;
            voxels.write(&mut stream)?;
            stream.finish().map(|_| ())
        } else {
            file.write_all(&header)?;
            voxels.write(file)
        }
    })
}

fn header(volume: &Volume) -> std::result::Result<[u8; VOX_OFFSET], String> {
    let mut header = [0u8; VOX_OFFSET];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    let element = volume.element();
    let datatype = DATATYPES.iter().find(|(_, known)| *known == element).map_or(0, |(code, _)| *code);
    put(0, &348i32.to_le_bytes());
    put(40, &3i16.to_le_bytes());
    for axis in 0..7 {
        let n = volume.dims().get(axis).copied().unwrap_or(1);
        let n =
            i16::try_from(n).map_err(|_| format!("{n} voxels along an axis are more than NIfTI-1 holds"))?;
        put(42 + 2 * axis, &n.to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(72, &(8 * element.bytes() as i16).to_le_bytes());
    let affine = volume.world_from_index();
    let qform = qform(affine.matrix3);
    let mut put_reals = |at: usize, values: &[f64]| {
        values.iter().enumerate().for_each(|(i, v)| put(at + 4 * i, &(*v as f32).to_le_bytes()));
    };
    put_reals(76, &[qform.map_or(1.0, |(_, qfac)| qfac)]);
    put_reals(80, &volume.spacing_mm());
    put_reals(108, &[VOX_OFFSET as f64, volume.scaling().slope, volume.scaling().intercept]);
    if let Some((rotation, _)) = qform {
        put_reals(256, &[rotation.x, rotation.y, rotation.z]);
        put_reals(268, &affine.translation.to_array());
    }
    for row in 0..3 {
        let m = affine.matrix3.row(row);
        put_reals(280 + 16 * row, &[m.x, m.y, m.z, affine.translation[row]]);
    }
    // Units of mm, and codes of scanner coordinates.
    put(123, &[2]);
    put(252, &i16::from(qform.is_some()).to_le_bytes());
    put(254, &1i16.to_le_bytes());
    put(344, b"n+1\0");
    Ok(header)
}

/// Returns the quaternion (`w >= 0`) and `qfac` of a NIfTI qform for the matrix of an affine; `None` if it has shear.
fn qform(matrix: DMat3) -> Option<(DQuat, f64)> {
    let qfac = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis * qfac].map(|axis| axis.normalize());
    let rotation = DMat3::from_cols(columns[0], columns[1], columns[2]);
    let is_rotation = (rotation.transpose() * rotation).abs_diff_eq(DMat3::IDENTITY, QFORM_TOLERANCE);
    let quaternion = DQuat::from_mat3(&rotation).normalize();
    is_rotation.then_some((if quaternion.w < 0.0 { -quaternion } else { quaternion }, qfac))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::nifti::header::Header;
    use crate::volume::{AffineSource, ByteOrder, Provenance, Scaling};
    use glam::{DAffine3, DVec3, EulerRot};

    fn header_of(matrix: DMat3) -> (Header, DAffine3) {
        let affine = DAffine3::from_mat3_translation(matrix, DVec3::new(-120.5, 33.25, 7.125));
        let voxels = ndarray::Array3::<u8>::zeros((2, 3, 4));
        let provenance = Provenance::new("test", "test", "uint8");
        let volume = Volume::new(voxels.into(), Scaling::IDENTITY, affine, provenance).unwrap();
        let bytes = header(&volume).unwrap();
        (Header::parse(&bytes[..348], 1, ByteOrder::Little).unwrap(), affine)
    }

    #[test]
    fn qform_gives_the_affine_of_the_sform() {
        let scale = DMat3::from_diagonal(DVec3::new(0.7, 1.3, 2.5));
        for angles in [[0.0; 3], [0.3, -0.8, 2.1], [3.1, 0.01, -3.0], [std::f64::consts::PI, 0.0, 0.0]] {
            let rotation = DMat3::from_euler(EulerRot::XYZ, angles[0], angles[1], angles[2]);
            for mirror in [DVec3::ONE, DVec3::new(-1.0, 1.0, 1.0), DVec3::new(-1.0, -1.0, 1.0)] {
                let (header, affine) = header_of(rotation * DMat3::from_diagonal(mirror) * scale);
                let by_qform = Header { sform_code: 0, ..header.clone() };
                let mut warnings = Vec::new();
                let (found, source) = by_qform.affine(&mut warnings);
                assert_eq!((source, warnings.len()), (AffineSource::Qform, 0));
                assert!(found.abs_diff_eq(affine, 2e-5), "{angles:?} {mirror}: {found} is not {affine}");
                assert_eq!(header.affine(&mut warnings).1, AffineSource::Sform);
            }
        }
    }

    #[test]
    fn sheared_affines_have_no_qform() {
        let sheared = DMat3::from_cols(DVec3::X, DVec3::new(0.01, 1.0, 0.0), DVec3::Z);
        assert_eq!(header_of(sheared).0.qform_code, 0);
    }
}
