//! NIfTI-1 and NIfTI-2 headers brought to one form, and the affine that they give.

use crate::volume::element::{ByteOrder, Element};
use crate::volume::{AffineSource, Scaling, ValuesSaid};
use glam::{DAffine3, DMat3, DVec3};

/// Size in bytes of a NIfTI-1 and of a NIfTI-2 header.
pub const HEADER_BYTES: [usize; 2] = [348, 540];
/// Where the voxels of a single file begin at the earliest: the header and four bytes that announce extensions.
const EXTENDER_BYTES: u64 = 4;

/// What both versions of the format say, wide enough for either.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// 1 or 2.
    pub version: u8,
    /// It is the header of Analyze 7.5, from which that of NIfTI-1 was made: without forms and a magic.
    pub is_analyze: bool,
    pub byte_order: ByteOrder,
    /// Voxels are in a second file (`.img`).
    pub paired: bool,
    pub dim: [i64; 8],
    pub intent_code: i32,
    /// Free text; converters put the sequence of an MR scan there.
    pub descrip: String,
    pub datatype: i16,
    pub bitpix: i16,
    pub pixdim: [f64; 8],
    pub vox_offset: f64,
    pub scl_slope: f64,
    pub scl_inter: f64,
    pub xyzt_units: i32,
    pub qform_code: i32,
    pub sform_code: i32,
    pub quatern: [f64; 3],
    pub qoffset: [f64; 3],
    pub srow: [[f64; 4]; 3],
}

/// Version and byte order, told from the first four bytes of a file: the header's own size.
pub fn recognise(start: [u8; 4]) -> Option<(u8, ByteOrder)> {
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
    /// From a whole header as [`recognise`] saw it.
    ///
    /// # Errors
    /// The magic is missing; the reason in words.
    pub fn parse(bytes: &[u8], version: u8, byte_order: ByteOrder) -> Result<Self, String> {
        let f = Fields { bytes, version, byte_order };
        let magic: &[u8] = if version == 1 { &bytes[344..348] } else { &bytes[4..12] };
        let (paired, is_analyze) = match magic {
            b"n+1\0" | b"n+2\0\r\n\x1a\n" => (false, false),
            b"ni1\0" | b"ni2\0\r\n\x1a\n" => (true, false),
            // Nothing marks such a header: sizes and types that go together must do.
            _ if version == 1 && f.is_plausible_analyze() => (true, true),
            _ if version == 1 => {
                return Err("its header has no NIfTI magic, nor is it one of Analyze 7.5".into());
            }
            _ => return Err("its header has no NIfTI-2 magic, or line ends were converted in it".into()),
        };
        let first = version == 1;
        // Where NIfTI has its codes Analyze has the scan's history.
        let code = |code: i32| if is_analyze { 0 } else { code };
        Ok(Self {
            version,
            is_analyze,
            byte_order,
            paired,
            dim: std::array::from_fn(|i| if first { f.short(40 + 2 * i).into() } else { f.long(16 + 8 * i) }),
            intent_code: code(if first { f.short(68).into() } else { f.integer(504) }),
            descrip: {
                let at = if first { 148 } else { 240 };
                String::from_utf8_lossy(bytes.get(at..at + 80).unwrap_or_default()).into_owned()
            },
            datatype: f.short(if first { 70 } else { 12 }),
            bitpix: f.short(if first { 72 } else { 14 }),
            pixdim: f.reals([76, 104]),
            vox_offset: if first { f.reals::<1>([108, 0])[0] } else { f.long(168) as f64 },
            scl_slope: f.reals::<1>([112, 176])[0],
            scl_inter: if is_analyze { 0.0 } else { f.reals::<1>([116, 184])[0] },
            xyzt_units: code(if first { bytes[123].into() } else { f.integer(500) }),
            qform_code: code(if first { f.short(252).into() } else { f.integer(344) }),
            sform_code: code(if first { f.short(254).into() } else { f.integer(348) }),
            quatern: f.reals([256, 352]),
            qoffset: f.reals([268, 376]),
            srow: std::array::from_fn(|row| f.reals([280 + 16 * row, 400 + 32 * row])),
        })
    }

    /// Grid size and number of frames (the product of every dimension beyond the third).
    ///
    /// # Errors
    /// A dimension below 1 or a product that overflows.
    pub fn grid(&self) -> Result<([usize; 3], usize), String> {
        let count = self.dim[0];
        if !(1..=7).contains(&count) {
            return Err(format!("its number of dimensions is {count}, not in 1..=7"));
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

    /// The element type.
    ///
    /// # Errors
    /// Colours, complex numbers and types that no other format of this program knows.
    pub fn element(&self) -> Result<Element, String> {
        Ok(match self.datatype {
            2 => Element::U8,
            4 => Element::I16,
            8 => Element::I32,
            16 => Element::F32,
            64 => Element::F64,
            256 => Element::I8,
            512 => Element::U16,
            768 => Element::U32,
            1024 => Element::I64,
            1280 => Element::U64,
            other => {
                let name = match other {
                    1 => "single bits",
                    32 | 1792 | 2048 => "complex numbers",
                    128 | 2304 => "RGB colours",
                    1536 => "128-bit floats",
                    _ => "of an unknown type",
                };
                return Err(format!("its voxels are {name} (datatype {other}); scalars are needed"));
            }
        })
    }

    /// The value scaling; a slope that is 0 or not finite means none.
    ///
    /// # Errors
    /// A slope with an intercept that is not finite.
    pub fn scaling(&self) -> Result<Scaling, String> {
        if self.scl_slope == 0.0 || !self.scl_slope.is_finite() {
            return Ok(Scaling::IDENTITY);
        }
        if !self.scl_inter.is_finite() {
            return Err(format!("its scl_slope is {} but its scl_inter {}", self.scl_slope, self.scl_inter));
        }
        Ok(Scaling { slope: self.scl_slope, intercept: self.scl_inter })
    }

    /// What the values are, where an intent code or a description tells. The format has no word for HU.
    pub fn values_said(&self) -> ValuesSaid {
        match self.intent_code {
            2..=24 => ValuesSaid::Other(format!("NIfTI intent {}, a statistic", self.intent_code)),
            1002 => ValuesSaid::Other("NIfTI intent 1002, labels".into()),
            // Only MR has an echo time; dcm2niix and SPM write it.
            _ if self.descrip.contains("TE=") => {
                ValuesSaid::Other("its description gives an echo time: MR".into())
            }
            _ => ValuesSaid::Nothing,
        }
    }

    /// Byte at which the voxels begin in the file that holds them.
    ///
    /// # Errors
    /// An offset that is negative, not a number, or inside the header of a single file.
    pub fn data_offset(&self) -> Result<u64, String> {
        let offset = self.vox_offset;
        if !(0.0..9.0e18).contains(&offset) {
            return Err(format!("its vox_offset is {offset}"));
        }
        let first = HEADER_BYTES[usize::from(self.version) - 1] as u64 + EXTENDER_BYTES;
        match offset as u64 {
            0 if !self.paired => Ok(first),
            offset if !self.paired && offset < first => {
                Err(format!("its vox_offset {offset} lies inside the header"))
            }
            offset => Ok(offset),
        }
    }

    /// World mm (RAS+) from index coordinates: sform if its code is above 0, else qform if its code is above 0, else
    /// voxel sizes. A form that is not finite or singular is passed over with a warning.
    pub fn affine(&self, warnings: &mut Vec<String>) -> (DAffine3, AffineSource) {
        let usable =
            |a: &DAffine3| a.is_finite() && a.inverse().is_finite() && a.matrix3.determinant() != 0.0;
        if self.sform_code > 0 {
            let affine = self.sform();
            if usable(&affine) {
                return (affine, AffineSource::Sform);
            }
            warnings.push("the sform is singular or not finite and was passed over".into());
        }
        if self.qform_code > 0 {
            let affine = self.qform(warnings);
            if usable(&affine) {
                return (affine, AffineSource::Qform);
            }
            warnings.push("the qform is not finite and was passed over".into());
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
        let [mut b, mut c, mut d] = self.quatern;
        let w_squared = 1.0 - (b * b + c * c + d * d);
        // Three f32 roundings of 1: closer to a half turn than the header can say.
        let resolution = 3.0 * f64::from(f32::EPSILON);
        let w = if w_squared.abs() < resolution {
            0.0
        } else if w_squared < 0.0 {
            warnings
                .push(format!("the qform's quaternion is too long by {:.3e} and was normalised", -w_squared));
            let length = (1.0 - w_squared).sqrt();
            [b, c, d] = [b / length, c / length, d / length];
            0.0
        } else {
            w_squared.sqrt()
        };
        let norm = w * w + b * b + c * c + d * d;
        let s = 2.0 / norm;
        let rotation = DMat3::from_cols(
            DVec3::new(1.0 - s * (c * c + d * d), s * (b * c + w * d), s * (b * d - w * c)),
            DVec3::new(s * (b * c - w * d), 1.0 - s * (b * b + d * d), s * (c * d + w * b)),
            DVec3::new(s * (b * d + w * c), s * (c * d - w * b), 1.0 - s * (b * b + c * c)),
        );
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
        // Axes that the file does not have count 1 mm.
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

    /// `pixdim[1..=3]` made positive; 0 or not finite counts 1 mm.
    fn voxel_sizes_mm(&self, warnings: &mut Vec<String>) -> DVec3 {
        let mut warn = |text: String| {
            if !warnings.contains(&text) {
                warnings.push(text);
            }
        };
        DVec3::from_array(std::array::from_fn(|axis| match self.pixdim[axis + 1] {
            size if size == 0.0 || !size.is_finite() => {
                // A 2-D file need not say how thick its one slice is.
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

/// Numbers of a header by their place in it.
struct Fields<'a> {
    bytes: &'a [u8],
    version: u8,
    byte_order: ByteOrder,
}

impl Fields<'_> {
    /// `N` bytes in little-endian order; zeros beyond the header's end.
    fn little_endian<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut field = [0; N];
        if let Some(bytes) = self.bytes.get(at..at + N) {
            field.copy_from_slice(bytes);
        }
        if self.byte_order == ByteOrder::Big {
            field.reverse();
        }
        field
    }

    /// Whether a header without a magic is sound as one of Analyze 7.5.
    fn is_plausible_analyze(&self) -> bool {
        let types = [(2, 8), (4, 16), (8, 32), (16, 32), (64, 64)];
        (1..=7).contains(&self.short(40)) && types.contains(&(self.short(70), self.short(72)))
    }

    fn short(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.little_endian(at))
    }

    fn integer(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.little_endian(at))
    }

    fn long(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.little_endian(at))
    }

    /// Neighbouring real numbers, by their place in either version: 32 bits wide in the first, 64 in the second.
    fn reals<const M: usize>(&self, at: [usize; 2]) -> [f64; M] {
        std::array::from_fn(|i| match self.version {
            1 => f64::from(f32::from_le_bytes(self.little_endian(at[0] + 4 * i))),
            _ => f64::from_le_bytes(self.little_endian(at[1] + 8 * i)),
        })
    }
}
