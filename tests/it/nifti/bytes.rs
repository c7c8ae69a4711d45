//! Writes NIfTI files byte by byte, independently of the reader and writer under test.

use flate2::{Compression, write::GzEncoder};
use std::io::Write;

/// Header fields and voxel bytes of a NIfTI file; `bytes()` encodes them.
#[derive(Clone)]
pub struct NiftiBytes {
    pub version: u8,
    pub big_endian: bool,
    pub magic: Vec<u8>,
    pub dim: [i64; 8],
    pub datatype: i16,
    pub bitpix: i16,
    pub pixdim: [f64; 8],
    pub vox_offset: f64,
    pub scl: [f64; 2],
    pub xyzt_units: u8,
    pub codes: [i16; 2],
    pub quatern: [f64; 3],
    pub qoffset: [f64; 3],
    pub srow: [[f64; 4]; 3],
    pub data: Vec<u8>,
}

impl NiftiBytes {
    /// Creates a little-endian NIfTI-1 file with `uint8` voxels that count up from 0, and an sform of 1, 2 and 3 mm.
    pub fn new(dims: [usize; 3]) -> Self {
        let count: usize = dims.iter().product();
        let [nx, ny, nz] = dims.map(|n| n as i64);
        Self {
            version: 1,
            big_endian: false,
            magic: b"n+1\0".to_vec(),
            dim: [3, nx, ny, nz, 1, 1, 1, 1],
            datatype: 2,
            bitpix: 8,
            pixdim: [1.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0],
            vox_offset: 352.0,
            scl: [0.0, 0.0],
            xyzt_units: 2,
            codes: [0, 1],
            quatern: [0.0; 3],
            qoffset: [0.0; 3],
            srow: [[1.0, 0.0, 0.0, -4.0], [0.0, 2.0, 0.0, -5.0], [0.0, 0.0, 3.0, -6.0]],
            data: (0..count).map(|i| i as u8).collect(),
        }
    }

    /// Turns the header into one of NIfTI-2.
    pub fn version_2(mut self) -> Self {
        self.version = 2;
        self.magic = b"n+2\0\r\n\x1a\n".to_vec();
        self.vox_offset = 544.0;
        self
    }

    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    fn put(&self, out: &mut [u8], at: usize, little_endian: &[u8]) {
        let mut bytes = little_endian.to_vec();
        if self.big_endian {
            bytes.reverse();
        }
        out[at..at + bytes.len()].copy_from_slice(&bytes);
    }

    pub fn header(&self) -> Vec<u8> {
        if self.version == 2 { self.header_2() } else { self.header_1() }
    }

    fn header_1(&self) -> Vec<u8> {
        let mut h = vec![0; 348];
        self.put(&mut h, 0, &348i32.to_le_bytes());
        for i in 0..8 {
            self.put(&mut h, 40 + 2 * i, &(self.dim[i] as i16).to_le_bytes());
            self.put(&mut h, 76 + 4 * i, &(self.pixdim[i] as f32).to_le_bytes());
        }
        self.put(&mut h, 70, &self.datatype.to_le_bytes());
        self.put(&mut h, 72, &self.bitpix.to_le_bytes());
        self.put(&mut h, 108, &(self.vox_offset as f32).to_le_bytes());
        self.put(&mut h, 112, &(self.scl[0] as f32).to_le_bytes());
        self.put(&mut h, 116, &(self.scl[1] as f32).to_le_bytes());
        h[123] = self.xyzt_units;
        self.put(&mut h, 252, &self.codes[0].to_le_bytes());
        self.put(&mut h, 254, &self.codes[1].to_le_bytes());
        for i in 0..3 {
            self.put(&mut h, 256 + 4 * i, &(self.quatern[i] as f32).to_le_bytes());
            self.put(&mut h, 268 + 4 * i, &(self.qoffset[i] as f32).to_le_bytes());
            for j in 0..4 {
                self.put(&mut h, 280 + 16 * i + 4 * j, &(self.srow[i][j] as f32).to_le_bytes());
            }
        }
        h[344..348].copy_from_slice(&self.magic);
        h
    }

    fn header_2(&self) -> Vec<u8> {
        let mut h = vec![0; 540];
        self.put(&mut h, 0, &540i32.to_le_bytes());
        h[4..12].copy_from_slice(&self.magic);
        self.put(&mut h, 12, &self.datatype.to_le_bytes());
        self.put(&mut h, 14, &self.bitpix.to_le_bytes());
        for i in 0..8 {
            self.put(&mut h, 16 + 8 * i, &self.dim[i].to_le_bytes());
            self.put(&mut h, 104 + 8 * i, &self.pixdim[i].to_le_bytes());
        }
        self.put(&mut h, 168, &(self.vox_offset as i64).to_le_bytes());
        self.put(&mut h, 176, &self.scl[0].to_le_bytes());
        self.put(&mut h, 184, &self.scl[1].to_le_bytes());
        self.put(&mut h, 344, &i32::from(self.codes[0]).to_le_bytes());
        self.put(&mut h, 348, &i32::from(self.codes[1]).to_le_bytes());
        for i in 0..3 {
            self.put(&mut h, 352 + 8 * i, &self.quatern[i].to_le_bytes());
            self.put(&mut h, 376 + 8 * i, &self.qoffset[i].to_le_bytes());
            for j in 0..4 {
                self.put(&mut h, 400 + 32 * i + 8 * j, &self.srow[i][j].to_le_bytes());
            }
        }
        self.put(&mut h, 500, &i32::from(self.xyzt_units).to_le_bytes());
        h
    }

    /// Returns all bytes of the single NIfTI file.
    pub fn bytes(&self) -> Vec<u8> {
        let mut file = self.header();
        let offset =
            if self.vox_offset > 0.0 && self.vox_offset < 1e6 { self.vox_offset as usize } else { 0 };
        file.resize(offset.max(file.len() + 4), 0);
        file.extend(&self.data);
        file
    }
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}
