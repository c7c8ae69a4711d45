//! Writes volumes as NIfTI, NRRD, raw or NumPy files, with their physical values and affine.
//!
//! NIfTI and raw files store the voxels with slope and intercept. NRRD and `.npy` have neither: if the mapping is not
//! the identity, physical values are written, as 16- or 32-bit integers if exact and otherwise as 64-bit floats.

use super::nifti::write_nifti;
use super::raw_layout::{RawLayout, Sidecar};
use crate::error::{Error, Result};
use crate::files::output::{check_output, write_whole};
use crate::volume::{ByteOrder, Element, Scaling, Volume};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::{self, Write};
use std::path::Path;

/// File extensions that [`write_volume`] accepts.
pub const VOLUME_EXTENSIONS: &[&str] = &["nii.gz", "nii", "nrrd", "raw", "npy"];

/// Writes a volume in the format that the file extension names. A [`Sidecar`] file complements `.raw` and `.npy`. A
/// failed write leaves no partial volume file.
///
/// # Errors
/// The extension is unknown, the format cannot hold the size, or the file cannot be written.
pub fn write_volume(volume: &Volume, path: &Path) -> Result<()> {
    check_output(path, VOLUME_EXTENSIONS)?;
    match path.extension().unwrap_or_default().to_ascii_lowercase().to_str() {
        Some("nrrd") => write_nrrd(volume, path),
        Some("raw") => write_raw(volume, path),
        Some("npy") => write_npy(volume, path),
        _ => write_nifti(volume, path),
    }
}

/// Voxels to write to a volume file: the stored numbers, or their physical values converted to number type `scaled`.
struct Numbers<'a> {
    volume: &'a Volume,
    scaled: Option<Element>,
}

impl<'a> Numbers<'a> {
    /// Selects the numbers to write to a volume format without slope and intercept: physical values in the smallest
    /// suitable type.
    fn values(volume: &'a Volume) -> Self {
        let scaling = volume.scaling();
        if scaling == Scaling::IDENTITY {
            return Self { volume, scaled: None };
        }
        let is_integer = |v: f64| v.fract() == 0.0;
        let stores_floats = matches!(volume.voxels().element(), Element::F32 | Element::F64);
        let [lo, hi] = volume.value_range();
        let within = |min: f64, max: f64| lo >= min && hi <= max;
        let integers = !stores_floats && is_integer(scaling.slope) && is_integer(scaling.intercept);
        let element = match integers {
            true if within(i16::MIN.into(), i16::MAX.into()) => Element::I16,
            true if within(i32::MIN.into(), i32::MAX.into()) => Element::I32,
            _ => Element::F64,
        };
        Self { volume, scaled: Some(element) }
    }

    fn element(&self) -> Element {
        self.scaled.unwrap_or_else(|| self.volume.voxels().element())
    }

    /// Writes all voxels of a volume as little-endian numbers, x fastest.
    fn write(&self, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
        let Some(element) = self.scaled else { return out.write_all(self.volume.voxels().bytes()) };
        let [nx, ny, nz] = self.volume.dims();
        let mut row = Vec::new();
        for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
            row.clear();
            for value in (0..nx).map(|i| self.volume.value(i, j, k)) {
                match element {
                    Element::I16 => row.extend_from_slice(&(value as i16).to_le_bytes()),
                    Element::I32 => row.extend_from_slice(&(value as i32).to_le_bytes()),
                    _ => row.extend_from_slice(&value.to_le_bytes()),
                }
            }
            out.write_all(&row)?;
        }
        Ok(())
    }

    /// Creates the contents of the JSON sidecar file for the written voxels.
    fn sidecar(&self) -> Sidecar {
        let layout =
            RawLayout { dims: self.volume.dims(), element: self.element(), byte_order: ByteOrder::Little };
        let sidecar = Sidecar::new(self.volume, &layout);
        if self.scaled.is_some() { Sidecar { slope: 1.0, intercept: 0.0, ..sidecar } } else { sidecar }
    }
}

/// Writes an NRRD file: a header in RAS+ mm and gzipped voxels.
fn write_nrrd(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers::values(volume);
    let affine = volume.world_from_index();
    let vector = |v: glam::DVec3| format!("({},{},{})", v.x, v.y, v.z);
    let m = affine.matrix3;
    let [nx, ny, nz] = volume.dims();
    let name = match numbers.element() {
        Element::F32 => "float",
        Element::F64 => "double",
        other => other.name(),
    };
    let header = format!(
        "NRRD0004\ntype: {name}\ndimension: 3\nspace: right-anterior-superior\nsizes: {nx} {ny} {nz}\n\
         space directions: {} {} {}\nkinds: domain domain domain\nendian: little\nencoding: gzip\n\
         space origin: {}\n\n",
        vector(m.x_axis),
        vector(m.y_axis),
        vector(m.z_axis),
        vector(affine.translation),
    );
    write_whole(path, |file| {
        file.write_all(header.as_bytes())?;
        let mut stream = GzEncoder::new(file, Compression::fast());
        numbers.write(&mut stream)?;
        stream.finish().map(|_| ())
    })
}

/// Writes a raw volume file of the stored voxels, and its JSON sidecar file.
fn write_raw(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers { volume, scaled: None };
    write_with_sidecar(&numbers.sidecar(), path, |file| numbers.write(file))
}

/// Writes a NumPy array `[k, j, i]` of the physical values, and its JSON sidecar file.
fn write_npy(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers::values(volume);
    let element = numbers.element();
    let kind = format!("{}{}", if element.bytes() == 1 { '|' } else { '<' }, element.numpy_name());
    let [nx, ny, nz] = volume.dims();
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({nz}, {ny}, {nx}), }}");
    // The header ends with a line end, and the voxels begin at a multiple of 64 bytes.
    let unpadded = 10 + header.len() + 1;
    header.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(64) - unpadded));
    header.push('\n');
    write_with_sidecar(&numbers.sidecar(), path, |file| {
        file.write_all(b"\x93NUMPY\x01\x00")?;
        file.write_all(&(header.len() as u16).to_le_bytes())?;
        file.write_all(header.as_bytes())?;
        numbers.write(file)
    })
}

/// Writes a volume file and its JSON sidecar file, both only after the voxels are written. An existing JSON file that
/// is no sidecar file gives an error.
fn write_with_sidecar(
    sidecar: &Sidecar,
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<()> {
    let beside = Sidecar::path_of(path);
    if beside.exists() && Sidecar::beside(path).ok().flatten().is_none() {
        let why = "it is no sidecar, and writing the volume would overwrite it";
        return Err(Error::input("cannot write volume", beside.display(), why)
            .hint("give another name, or move that file away"));
    }
    let text = serde_json::to_string_pretty(sidecar)
        .map_err(|e| Error::runtime("cannot write volume", path.display(), e))?;
    write_whole(path, |file| {
        write(file)?;
        write_whole(&beside, |file| writeln!(file, "{text}")).map_err(io::Error::other)
    })
}
