//! Parses the headers of NIfTI-1, NIfTI-2 and Analyze 7.5, and computes the affine of the volume.

use crate::files::binary::BinaryFields;
use crate::volume::{AffineSource, ByteOrder, Element, Scaling, ValueMeaning};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use nifti::{Endianness, NiftiHeader};

/// Sizes of NIfTI-1 and NIfTI-2 headers, in bytes.
pub(super) const HEADER_BYTES: [usize; 2] = [348, 540];
/// Size of the extension flags after the header of a single-file NIfTI volume, in bytes.
const EXTENDER_BYTES: u64 = 4;

/// NIfTI datatype codes of the supported voxel types.
pub(super) const DATATYPES: [(i16, Element); 10] = [
    (2, Element::U8),
    (4, Element::I16),
    (8, Element::I32),
    (16, Element::F32),
    (64, Element::F64),
    (256, Element::I8),
    (512, Element::U16),
    (768, Element::U32),
    (1024, Element::I64),
    (1280, Element::U64),
];

/// Header of a NIfTI-1, NIfTI-2 or Analyze 7.5 volume, with the field names of NIfTI.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    /// Version of the NIfTI format, 1 or 2.
    pub(super) version: u8,
    /// Whether the header is Analyze 7.5, the predecessor of NIfTI without qform, sform and magic bytes.
    pub(super) is_analyze: bool,
    pub(super) byte_order: ByteOrder,
    /// Whether the voxels of the NIfTI volume are in a second file (`.img`).
    pub(super) is_pair: bool,
    pub(super) dim: [i64; 8],
    pub(super) intent_code: i32,
    /// Free text of the NIfTI header. Converters write the parameters of an MR sequence there.
    pub(super) descrip: String,
    pub(super) datatype: i16,
    pub(super) bitpix: i16,
    pub(super) pixdim: [f64; 8],
    pub(super) vox_offset: f64,
    pub(super) scl_slope: f64,
    pub(super) scl_inter: f64,
    pub(super) xyzt_units: i32,
    pub(super) qform_code: i32,
    pub(super) sform_code: i32,
    pub(super) quatern: [f64; 3],
    pub(super) qoffset: [f64; 3],
    pub(super) srow: [[f64; 4]; 3],
}

/// Finds NIfTI version and byte order from the first four bytes of a file, which hold the size of the header.
pub(super) fn recognise(start: [u8; 4]) -> Option<(u8, ByteOrder)> {
    [(1, HEADER_BYTES[0]), (2, HEADER_BYTES[1])].into_iter().find_map(|(version, bytes)| {
        if u32::from_le_bytes(start) as usize == bytes {
            Some((version, ByteOrder::Little))
        } else if u32::from_be_bytes(start) as usize == bytes {
            Some((version, ByteOrder::Big))
        } else {
            None
        }
    })
}

impl Header {
    /// Parses a complete NIfTI header that [`recognise`] has accepted.
    ///
    /// # Errors
    /// The magic bytes are missing, or the number of dimensions is invalid.
    pub(super) fn parse(bytes: &[u8], version: u8, byte_order: ByteOrder) -> Result<Self, String> {
        if version == 1 { Self::parse_v1(bytes, byte_order) } else { Self::parse_v2(bytes, byte_order) }
    }

    /// Parses a NIfTI-1 or Analyze header with the `nifti` crate.
    fn parse_v1(bytes: &[u8], byte_order: ByteOrder) -> Result<Self, String> {
        let magic = &bytes[344..348];
        let is_nifti = [b"n+1\0", b"ni1\0"].iter().any(|known| magic == *known);
        let mut bytes = bytes.to_vec();
        if !is_nifti {
            // The crate accepts no Analyze header without a magic.
            bytes[344..348].copy_from_slice(b"ni1\0");
        }
        let header = NiftiHeader::from_reader(&bytes[..]).map_err(|e| e.to_string())?;
        let found = if header.endianness == Endianness::Big { ByteOrder::Big } else { ByteOrder::Little };
        if found != byte_order {
            // The crate tells the byte order from the number of dimensions, which is then invalid.
            let count = (header.dim[0] as i16).swap_bytes();
            return Err(if is_nifti { dimensions_error(count.into()) } else { no_magic() });
        }
        // The crate reads dimensions as unsigned numbers.
        let dim = header.dim.map(|n| i64::from(n as i16));
        let types = [(2, 8), (4, 16), (8, 32), (16, 32), (64, 64)];
        let is_plausible = (1..=7).contains(&dim[0]) && types.contains(&(header.datatype, header.bitpix));
        if !is_nifti && !is_plausible {
            return Err(no_magic());
        }
        // Analyze stores the history of a scan where NIfTI has its codes.
        let code = |code: i32| if is_nifti { code } else { 0 };
        let wide = |values: [f32; 3]| values.map(f64::from);
        Ok(Self {
            version: 1,
            is_analyze: !is_nifti,
            byte_order,
            is_pair: &header.magic == b"ni1\0",
            dim,
            intent_code: code(header.intent_code.into()),
            descrip: String::from_utf8_lossy(&header.descrip).into_owned(),
            datatype: header.datatype,
            bitpix: header.bitpix,
            pixdim: header.pixdim.map(f64::from),
            vox_offset: header.vox_offset.into(),
            scl_slope: header.scl_slope.into(),
            scl_inter: if is_nifti { header.scl_inter.into() } else { 0.0 },
            xyzt_units: code(header.xyzt_units.into()),
            qform_code: code(header.qform_code.into()),
            sform_code: code(header.sform_code.into()),
            quatern: wide([header.quatern_b, header.quatern_c, header.quatern_d]),
            qoffset: wide([header.quatern_x, header.quatern_y, header.quatern_z]),
            srow: [header.srow_x, header.srow_y, header.srow_z].map(|row| row.map(f64::from)),
        })
    }

    /// Parses a NIfTI-2 header, which the `nifti` crate does not support.
    fn parse_v2(bytes: &[u8], byte_order: ByteOrder) -> Result<Self, String> {
        let is_pair = match &bytes[4..12] {
            b"n+2\0\r\n\x1a\n" => false,
            b"ni2\0\r\n\x1a\n" => true,
            _ => return Err("its header has no NIfTI-2 magic, or line ends were converted in it".into()),
        };
        let f = BinaryFields { bytes, big_endian: byte_order == ByteOrder::Big };
        let [scl_slope, scl_inter] = f.doubles(176);
        Ok(Self {
            version: 2,
            is_analyze: false,
            byte_order,
            is_pair,
            dim: std::array::from_fn(|i| f.long(16 + 8 * i)),
            intent_code: f.integer(504),
            descrip: String::from_utf8_lossy(&bytes[240..320]).into_owned(),
            datatype: f.short(12),
            bitpix: f.short(14),
            pixdim: f.doubles(104),
            vox_offset: f.long(168) as f64,
            scl_slope,
            scl_inter,
            xyzt_units: f.integer(500),
            qform_code: f.integer(344),
            sform_code: f.integer(348),
            quatern: f.doubles(352),
            qoffset: f.doubles(376),
            srow: std::array::from_fn(|row| f.doubles(400 + 32 * row)),
        })
    }

    /// Returns the grid size and the number of frames of a NIfTI volume. Frames are the product of all dimensions
    /// beyond the third.
    ///
    /// # Errors
    /// A dimension is below 1, or the product overflows.
    pub(super) fn grid(&self) -> Result<([usize; 3], usize), String> {
        let count = self.dim[0];
        if !(1..=7).contains(&count) {
            return Err(dimensions_error(count));
        }
        let mut dims = [1usize; 7];
        for (axis, size) in dims.iter_mut().enumerate().take(count as usize) {
            let n = self.dim[axis + 1];
            *size = usize::try_from(n)
                .ok()
                .filter(|&n| n > 0)
                .ok_or_else(|| format!("dimension {} is {n}", axis + 1))?;
        }
        let frames = dims[3..]
            .iter()
            .try_fold(1usize, |frames, &n| frames.checked_mul(n))
            .ok_or("its number of frames cannot be counted")?;
        Ok(([dims[0], dims[1], dims[2]], frames))
    }

    /// Returns the voxel type of a NIfTI volume.
    ///
    /// # Errors
    /// The voxels are colours, complex numbers, or of another unsupported type.
    pub(super) fn element(&self) -> Result<Element, String> {
        let known = DATATYPES.iter().find(|(code, _)| *code == self.datatype);
        known.map(|(_, element)| *element).ok_or_else(|| {
            let name = match self.datatype {
                1 => "single bits",
                32 | 1792 | 2048 => "complex numbers",
                128 | 2304 => "RGB colours",
                1536 => "128-bit floats",
                _ => "of an unknown type",
            };
            format!("its voxels are {name} (datatype {}); scalars are needed", self.datatype)
        })
    }

    /// Returns the linear mapping from stored to physical values of a NIfTI volume (`scl_slope`, `scl_inter`). A
    /// slope that is 0 or not finite means the identity.
    ///
    /// # Errors
    /// The slope is valid but the intercept is not finite.
    pub(super) fn scaling(&self) -> Result<Scaling, String> {
        if self.scl_slope == 0.0 || !self.scl_slope.is_finite() {
            return Ok(Scaling::IDENTITY);
        }
        if !self.scl_inter.is_finite() {
            return Err(format!("its scl_slope is {} but its scl_inter {}", self.scl_slope, self.scl_inter));
        }
        Ok(Scaling { slope: self.scl_slope, intercept: self.scl_inter })
    }

    /// Derives the meaning of the voxel values from the NIfTI intent code or the description text. NIfTI has no code
    /// for HU.
    pub(super) fn value_meaning(&self) -> ValueMeaning {
        match self.intent_code {
            2..=24 => ValueMeaning::Other(format!("NIfTI intent {}, a statistic", self.intent_code)),
            1002 => ValueMeaning::Other("NIfTI intent 1002, labels".into()),
            // Only MR has an echo time; dcm2niix and SPM write it.
            _ if self.descrip.contains("TE=") => {
                ValueMeaning::Other("its description gives an echo time: MR".into())
            }
            _ => ValueMeaning::Unknown,
        }
    }

    /// Returns the offset of the voxels in the NIfTI data file, in bytes.
    ///
    /// # Errors
    /// `vox_offset` is negative, not a number, or inside the header of a single file.
    pub(super) fn data_offset(&self) -> Result<u64, String> {
        let offset = self.vox_offset;
        if !(0.0..9.0e18).contains(&offset) {
            return Err(format!("its vox_offset is {offset}"));
        }
        let first = HEADER_BYTES[usize::from(self.version) - 1] as u64 + EXTENDER_BYTES;
        match offset as u64 {
            0 if !self.is_pair => Ok(first),
            offset if !self.is_pair && offset < first => {
                Err(format!("its vox_offset {offset} lies inside the header"))
            }
            offset => Ok(offset),
        }
    }

    /// Returns the affine of a NIfTI volume from voxel indices to world coordinates (RAS+, mm), and its source. The
    /// sform is used if its code is above 0, else the qform if its code is above 0, else the voxel sizes. A form that
    /// is singular or not finite is skipped with a warning.
    pub(super) fn affine(&self, warnings: &mut Vec<String>) -> (DAffine3, AffineSource) {
        let usable =
            |a: &DAffine3| a.is_finite() && a.inverse().is_finite() && a.matrix3.determinant() != 0.0;
        if self.sform_code > 0 {
            let affine = self.sform();
            if usable(&affine) {
                return (affine, AffineSource::Sform);
            }
            warnings.push("the sform is singular or not finite and was skipped".into());
        }
        if self.qform_code > 0 {
            let affine = self.qform(warnings);
            if usable(&affine) {
                return (affine, AffineSource::Qform);
            }
            warnings.push("the qform is not finite and was skipped".into());
        }
        let affine = self.voxel_size_affine(warnings);
        warnings.push(
            "no usable sform or qform: voxel sizes only, centred, x running to the left (the Analyze convention)"
                .into(),
        );
        (affine, AffineSource::Spacing)
    }

    fn sform(&self) -> DAffine3 {
        let column = |c: usize| DVec3::from_array(self.srow.map(|row| row[c]));
        DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3))
    }

    fn qform(&self, warnings: &mut Vec<String>) -> DAffine3 {
        let [b, c, d] = self.quatern;
        let w_squared = 1.0 - (b * b + c * c + d * d);
        // Three f32 roundings of 1: closer to a half turn than the header can represent.
        let is_half_turn = w_squared.abs() < 3.0 * f64::from(f32::EPSILON);
        if w_squared < 0.0 && !is_half_turn {
            warnings
                .push(format!("the qform's quaternion is too long by {:.3e} and was normalised", -w_squared));
        }
        let w = if is_half_turn || w_squared < 0.0 { 0.0 } else { w_squared.sqrt() };
        let rotation = DMat3::from_quat(DQuat::from_xyzw(b, c, d, w).normalize());
        let mut size = self.voxel_sizes_mm(warnings);
        if self.pixdim[0] == -1.0 {
            size.z = -size.z;
        }
        DAffine3::from_mat3_translation(
            rotation * DMat3::from_diagonal(size),
            DVec3::from_array(self.qoffset),
        )
    }

    fn voxel_size_affine(&self, warnings: &mut Vec<String>) -> DAffine3 {
        let mut size = self.voxel_sizes_mm(warnings);
        // Missing axes count 1 mm.
        for axis in 0..3 {
            if self.dim[0] <= axis as i64 {
                size[axis] = 1.0;
            }
        }
        size.x = -size.x;
        let centre = DVec3::from_array(std::array::from_fn(|axis| {
            let has_axis = self.dim[0] > axis as i64;
            if has_axis { (self.dim[axis + 1] as f64 - 1.0) / 2.0 } else { 0.0 }
        }));
        DAffine3::from_mat3_translation(DMat3::from_diagonal(size), -(size * centre))
    }

    /// Returns the voxel sizes of a NIfTI volume in mm: the absolute values of `pixdim[1..=3]`. A size that is 0 or
    /// not finite becomes 1 mm.
    fn voxel_sizes_mm(&self, warnings: &mut Vec<String>) -> DVec3 {
        let mut warn = |text: String| {
            if !warnings.contains(&text) {
                warnings.push(text);
            }
        };
        DVec3::from_array(std::array::from_fn(|axis| match self.pixdim[axis + 1] {
            size if size == 0.0 || !size.is_finite() => {
                // A 2-D file need not give the thickness of its slice.
                if self.dim[0] > axis as i64 {
                    warn(format!("voxel size {} along axis {} was taken as 1 mm", size, axis + 1));
                }
                1.0
            }
            size => {
                if size < 0.0 {
                    warn(format!("voxel size {} along axis {} was made positive", size, axis + 1));
                }
                size.abs()
            }
        }))
    }
}

fn dimensions_error(count: i64) -> String {
    format!("its number of dimensions is {count}, not in 1..=7")
}

fn no_magic() -> String {
    "its header has no NIfTI magic, nor is it one of Analyze 7.5".into()
}
