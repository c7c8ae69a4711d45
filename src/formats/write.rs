//! Writing volumes: values and affine are kept, whatever the format.
//!
//! NIfTI and raw files keep the stored numbers beside their scaling. NRRD and `.npy` have no scaling: values are written as
//! 16- or 32-bit integers where they are such, and as 64-bit floats otherwise.

use super::nifti_write::write_nifti;
use super::raw_layout::RawLayout;
use super::sidecar::Sidecar;
use crate::error::{Error, Result};
use crate::files::output::{check_output, write_whole};
use crate::volume::{ByteOrder, Element, Scaling, Volume, Voxels};
use flate2::Compression;
use flate2::write::GzEncoder;
use ndarray::Array3;
use std::io::{self, Write};
use std::path::Path;

/// Writes a volume to a file, whole or not at all.
type Writer = fn(&Volume, &Path) -> Result<()>;

/// Every format that is written, by the ending that asks for it.
const WRITERS: [(&str, Writer); 5] = [
    ("nii.gz", write_nifti),
    ("nii", write_nifti),
    ("nrrd", write_nrrd),
    ("raw", write_raw),
    ("npy", write_npy),
];

/// File-name endings that [`write_volume`] knows.
pub const VOLUME_EXTENSIONS: &[&str] = &["nii.gz", "nii", "nrrd", "raw", "npy"];

/// Writes a volume by the ending of the file's name. Beside `.raw` and `.npy` a [`Sidecar`] says what these cannot.
///
/// # Errors
/// Another ending, a size that the format cannot hold, or a file that cannot be written.
pub fn write_volume(volume: &Volume, path: &Path) -> Result<()> {
    check_output(path, VOLUME_EXTENSIONS)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let writer = WRITERS.iter().find(|(ending, _)| name.ends_with(&format!(".{ending}")));
    let (_, writer) = writer.ok_or_else(|| {
        Error::input("cannot write volume", path.display(), "its name ends in no known format")
    })?;
    writer(volume, path)
}

/// Numbers as they are written: the stored ones, or the values that they scale to.
enum Numbers<'a> {
    Stored(&'a Volume),
    Scaled(&'a Volume, Element),
}

impl<'a> Numbers<'a> {
    /// Values where no scaling can be said: the narrowest type that holds them all exactly.
    fn of_values(volume: &'a Volume) -> Self {
        let scaling = volume.scaling();
        if scaling == Scaling::IDENTITY {
            return Self::Stored(volume);
        }
        let is_whole = |v: f64| v.fract() == 0.0;
        let integers = !matches!(volume.voxels(), Voxels::F32(_) | Voxels::F64(_));
        let [lo, hi] = volume.value_range();
        let within = |least: f64, most: f64| lo >= least && hi <= most;
        let whole = integers && is_whole(scaling.slope) && is_whole(scaling.intercept);
        let element = match whole {
            true if within(f64::from(i16::MIN), f64::from(i16::MAX)) => Element::I16,
            true if within(f64::from(i32::MIN), f64::from(i32::MAX)) => Element::I32,
            _ => Element::F64,
        };
        Self::Scaled(volume, element)
    }

    fn element(&self) -> Element {
        match self {
            Self::Scaled(_, element) => *element,
            Self::Stored(volume) => match volume.voxels() {
                Voxels::U8(_) => Element::U8,
                Voxels::I16(_) => Element::I16,
                Voxels::U16(_) => Element::U16,
                Voxels::F32(_) => Element::F32,
                Voxels::F64(_) => Element::F64,
            },
        }
    }

    /// All of them, little-endian, x fastest.
    fn write(&self, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
        fn stored<T: Copy, const N: usize>(
            out: &mut (impl Write + ?Sized),
            array: &Array3<T>,
            bytes: impl Fn(T) -> [u8; N],
        ) -> io::Result<()> {
            let mut buffer = Vec::with_capacity(1 << 16);
            for chunk in array.as_slice().unwrap_or_default().chunks(1 << 13) {
                buffer.clear();
                chunk.iter().for_each(|v| buffer.extend_from_slice(&bytes(*v)));
                out.write_all(&buffer)?;
            }
            Ok(())
        }
        let (volume, element) = match self {
            Self::Stored(volume) => {
                return match volume.voxels() {
                    Voxels::U8(a) => stored(out, a, u8::to_le_bytes),
                    Voxels::I16(a) => stored(out, a, i16::to_le_bytes),
                    Voxels::U16(a) => stored(out, a, u16::to_le_bytes),
                    Voxels::F32(a) => stored(out, a, f32::to_le_bytes),
                    Voxels::F64(a) => stored(out, a, f64::to_le_bytes),
                };
            }
            Self::Scaled(volume, element) => (volume, element),
        };
        let [nx, ny, nz] = volume.dims();
        let mut row = Vec::new();
        for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
            row.clear();
            for value in (0..nx).map(|i| volume.value(i, j, k)) {
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

    fn layout(&self, volume: &Volume) -> RawLayout {
        RawLayout { dims: volume.dims(), element: self.element(), byte_order: ByteOrder::Little }
    }
}

/// Gzipped voxels behind a header in RAS+ mm.
fn write_nrrd(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers::of_values(volume);
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

/// The stored numbers, and a sidecar.
fn write_raw(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers::Stored(volume);
    let sidecar = Sidecar::of(volume, &numbers.layout(volume));
    write_both(&sidecar, path, |file| numbers.write(file))
}

/// An array `[k, j, i]` of the values, and a sidecar.
fn write_npy(volume: &Volume, path: &Path) -> Result<()> {
    let numbers = Numbers::of_values(volume);
    let kind = match numbers.element() {
        Element::U8 => "|u1",
        Element::I16 => "<i2",
        Element::U16 => "<u2",
        Element::I32 => "<i4",
        Element::F32 => "<f4",
        _ => "<f8",
    };
    let [nx, ny, nz] = volume.dims();
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({nz}, {ny}, {nx}), }}");
    // The voxels begin at a multiple of 64 bytes, behind a line end.
    let unpadded = 10 + header.len() + 1;
    header.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(64) - unpadded));
    header.push('\n');
    let mut sidecar = Sidecar::of(volume, &numbers.layout(volume));
    if matches!(numbers, Numbers::Scaled(..)) {
        (sidecar.slope, sidecar.intercept) = (1.0, 0.0);
    }
    write_both(&sidecar, path, |file| {
        file.write_all(b"\x93NUMPY\x01\x00")?;
        file.write_all(&(header.len() as u16).to_le_bytes())?;
        file.write_all(header.as_bytes())?;
        numbers.write(file)
    })
}

/// A file and its sidecar: neither takes its name before the voxels are written, and a file of somebody else is not
/// overwritten by a sidecar.
fn write_both(
    sidecar: &Sidecar,
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<()> {
    let beside = Sidecar::path_of(path);
    if beside.exists() && Sidecar::beside(path).ok().flatten().is_none() {
        let why = "it says something else, and what is known of the volume would be written over it";
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
