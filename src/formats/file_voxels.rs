//! Voxels of an uncompressed file that are read in parts.

use super::common::refusal;
use crate::error::Result;
use crate::files::output::TemporaryFile;
use crate::volume::read::with_element;
use crate::volume::{ByteOrder, Element, IndexBox, Voxel, VoxelSource, Voxels};
use ndarray::Array3;
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::PathBuf;

/// Share of a row of voxels from which on whole rows are read: fewer, larger reads are faster.
const WHOLE_ROWS: usize = 8;

/// Number of bytes that a thread reads together.
const READ_BYTES: usize = 1 << 20;

/// Voxels in a file, x fastest, from a byte offset on.
#[derive(Debug)]
pub(super) struct FileVoxels {
    pub path: PathBuf,
    /// Byte offset of the first voxel.
    pub offset: u64,
    /// Number of voxels along x, y and z.
    pub dims: [usize; 3],
    /// Number type and byte order of the voxels in the file.
    pub element: Element,
    pub byte_order: ByteOrder,
    /// Decompressed copy at `path`, which is removed with the volume.
    #[expect(dead_code, reason = "removes the file when it is dropped")]
    pub copy: Option<TemporaryFile>,
}

impl VoxelSource for FileVoxels {
    fn dims(&self) -> [usize; 3] {
        self.dims
    }

    fn element(&self) -> Element {
        self.element.in_memory()
    }

    fn read(&self, part: &IndexBox) -> Result<Voxels> {
        let voxels = with_element!(self.element, self.byte_order, convert => self.gather(part, convert));
        voxels.map_err(|e: io::Error| {
            refusal(&self.path)(match e.kind() {
                io::ErrorKind::UnexpectedEof => "it became shorter while it was in use".into(),
                _ => e.to_string(),
            })
        })
    }
}

impl FileVoxels {
    /// Reads the voxels of a box, slice by slice in parallel.
    fn gather<T: Voxel, const N: usize>(
        &self,
        [xs, ys, zs]: &IndexBox,
        convert: impl Fn([u8; N]) -> T + Sync,
    ) -> io::Result<Array3<T>> {
        let [nx, ny, _] = self.dims;
        let (width, height) = (xs.len(), ys.len());
        let mut values = Vec::new();
        values.try_reserve_exact(width * height * zs.len()).map_err(io::Error::other)?;
        values.resize(width * height * zs.len(), T::from_f64(0.0));
        // Rows that are read together, and the number of voxels from one row to the next in what was read.
        let most_rows = (READ_BYTES / (nx * N)).clamp(1, height.max(1));
        let (rows, stride) = if width * WHOLE_ROWS >= nx { (most_rows, nx) } else { (1, width) };
        let read_slice = |(file, bytes): &mut (Option<File>, Vec<u8>), (k, slice): (usize, &mut [T])| {
            let file = match file {
                Some(file) => file,
                None => file.insert(File::open(&self.path)?),
            };
            for (j, out) in ys.clone().step_by(rows).zip(slice.chunks_mut(rows * width)) {
                let first = ((k * ny + j) * nx + xs.start) as u64;
                bytes.resize(((out.len() / width - 1) * stride + width) * N, 0);
                file.seek(SeekFrom::Start(self.offset + first * N as u64))?;
                file.read_exact(bytes)?;
                let numbers = bytes.as_chunks::<N>().0.chunks(stride);
                for (row, numbers) in out.chunks_exact_mut(width).zip(numbers) {
                    row.iter_mut().zip(numbers).for_each(|(value, &number)| *value = convert(number));
                }
            }
            Ok(())
        };
        let slices = zs.clone().into_par_iter().zip(values.par_chunks_mut((width * height).max(1)));
        slices
            .map_init(|| (None, Vec::new()), |state, slice| read_slice(state, slice))
            .collect::<io::Result<()>>()?;
        Array3::from_shape_vec((zs.len(), height, width), values).map_err(io::Error::other)
    }
}
