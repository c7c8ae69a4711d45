//! Stored voxel values, and their linear mapping to physical values.

use super::element::Element;
use ndarray::Array3;

/// Stored voxel values before the mapping to physical values, contiguous in memory order `[[k, j, i]]` (`i` runs
/// fastest).
///
/// Other voxel types of files are widened to the next type that holds their values: `i8` to `i16`, 32- and 64-bit
/// integers to `f64`.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "names of standard types")]
pub enum Voxels {
    U8(Array3<u8>),
    I16(Array3<i16>),
    U16(Array3<u16>),
    F32(Array3<f32>),
    F64(Array3<f64>),
}

macro_rules! from_arrays {
    ($($kind:ident($t:ty)),*) => { $(
        impl From<Array3<$t>> for Voxels {
            fn from(array: Array3<$t>) -> Self {
                Self::$kind(array)
            }
        }
    )* };
}
from_arrays!(U8(u8), I16(i16), U16(u16), F32(f32), F64(f64));

/// Runs `$body` with `$array` bound to the typed array inside a [`Voxels`].
#[macro_export]
macro_rules! with_voxels {
    ($voxels:expr, $array:ident => $body:expr) => {
        match $voxels {
            $crate::volume::Voxels::U8($array) => $body,
            $crate::volume::Voxels::I16($array) => $body,
            $crate::volume::Voxels::U16($array) => $body,
            $crate::volume::Voxels::F32($array) => $body,
            $crate::volume::Voxels::F64($array) => $body,
        }
    };
}

/// Runs `$body` with `$voxel` as the number type of voxels in memory, given as an [`Element`].
#[macro_export]
macro_rules! with_voxel_type {
    ($element:expr, $voxel:ident => $body:expr) => {
        $crate::with_voxel_type!(@of $element, $voxel, $body, (U8, u8), (I16, i16), (U16, u16), (F32, f32) else f64)
    };
    (@of $element:expr, $voxel:ident, $body:expr, $(($kind:ident, $t:ty)),* else $last:ty) => {
        match $element {
            $($crate::volume::Element::$kind => { type $voxel = $t; $body })*
            _ => { type $voxel = $last; $body }
        }
    };
}

impl Voxels {
    /// Returns the number type of the voxels.
    pub fn element(&self) -> Element {
        match self {
            Self::U8(_) => Element::U8,
            Self::I16(_) => Element::I16,
            Self::U16(_) => Element::U16,
            Self::F32(_) => Element::F32,
            Self::F64(_) => Element::F64,
        }
    }

    /// Returns voxels of value 0, with x fastest.
    pub(crate) fn zeros(element: Element, [nx, ny, nz]: [usize; 3]) -> Self {
        let shape = (nz, ny, nx);
        match element {
            Element::U8 => Self::U8(Array3::zeros(shape)),
            Element::I8 | Element::I16 => Self::I16(Array3::zeros(shape)),
            Element::U16 => Self::U16(Array3::zeros(shape)),
            Element::F32 => Self::F32(Array3::zeros(shape)),
            _ => Self::F64(Array3::zeros(shape)),
        }
    }

    /// Returns the number of voxels along x, y and z.
    pub fn dims(&self) -> [usize; 3] {
        let (nz, ny, nx) = with_voxels!(self, a => a.dim());
        [nx, ny, nz]
    }

    /// Returns the value of a voxel.
    #[inline]
    pub fn stored(&self, [i, j, k]: [usize; 3]) -> f64 {
        with_voxels!(self, a => a[[k, j, i]].to_f64())
    }

    /// Returns the voxels as little-endian bytes, x fastest.
    pub fn bytes(&self) -> &[u8] {
        const { assert!(cfg!(target_endian = "little")) };
        with_voxels!(self, a => bytemuck::cast_slice(a.as_slice().unwrap_or_default()))
    }
}

/// Number type of stored voxels, which converts to `f64` without loss.
pub trait Voxel: Copy + PartialOrd + Send + Sync + 'static {
    /// Converts the voxel value to `f64` without loss.
    fn to_f64(self) -> f64;

    /// Converts a number to the voxel type. Integer types truncate towards 0 and clamp to their range.
    fn from_f64(value: f64) -> Self;

    /// Converts a number to the nearest value of the voxel type.
    fn nearest(value: f64) -> Self;

    /// Returns voxels of this type as a slice, x fastest; `None` for voxels of another type.
    fn slice_of(voxels: &Voxels) -> Option<&[Self]>;

    /// Returns voxels of this type as a slice that can be written, x fastest; `None` for voxels of another type.
    fn slice_mut_of(voxels: &mut Voxels) -> Option<&mut [Self]>;
}

macro_rules! voxel {
    ($round:expr => $($kind:ident($t:ty)),*) => { $(impl Voxel for $t {
        #[inline(always)]
        fn to_f64(self) -> f64 {
            f64::from(self)
        }

        #[inline(always)]
        fn from_f64(value: f64) -> Self {
            value as $t
        }

        #[inline(always)]
        fn nearest(value: f64) -> Self {
            $round(value) as $t
        }

        #[inline]
        fn slice_of(voxels: &Voxels) -> Option<&[Self]> {
            match voxels {
                Voxels::$kind(array) => array.as_slice(),
                _ => None,
            }
        }

        fn slice_mut_of(voxels: &mut Voxels) -> Option<&mut [Self]> {
            match voxels {
                Voxels::$kind(array) => array.as_slice_mut(),
                _ => None,
            }
        }
    })* };
}
voxel!(f64::round => U8(u8), I16(i16), U16(u16));
voxel!(f64::from => F32(f32), F64(f64));

/// Linear mapping from stored voxel values to physical values: `value = stored * slope + intercept`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Scaling {
    /// Slope of the linear mapping from stored to physical values (DICOM Rescale Slope).
    pub slope: f64,
    /// Intercept of the linear mapping from stored to physical values (DICOM Rescale Intercept).
    pub intercept: f64,
}

impl Scaling {
    /// Identity mapping: physical values equal stored values.
    pub const IDENTITY: Self = Self { slope: 1.0, intercept: 0.0 };

    /// Returns the physical value of a stored voxel value.
    #[inline]
    pub fn apply(&self, stored: f64) -> f64 {
        stored * self.slope + self.intercept
    }

    /// Returns the stored value that maps to a physical value.
    pub fn invert(&self, value: f64) -> f64 {
        (value - self.intercept) / self.slope
    }
}
