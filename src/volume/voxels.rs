//! Stored voxel values and their scaling.

use super::element::Element;
use ndarray::Array3;

/// Stored voxel values before scaling, contiguous in memory order `[[k, j, i]]` (`i` runs fastest).
///
/// Other types of files are widened to the next type that holds their values: `i8` to `i16`, 32- and 64-bit integers to
/// `f64`.
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

/// Runs `$body` with `$array` bound to the typed array of a [`Voxels`].
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

impl Voxels {
    /// Element type.
    pub fn element(&self) -> Element {
        match self {
            Self::U8(_) => Element::U8,
            Self::I16(_) => Element::I16,
            Self::U16(_) => Element::U16,
            Self::F32(_) => Element::F32,
            Self::F64(_) => Element::F64,
        }
    }

    /// Voxels as little-endian bytes, x fastest.
    pub fn bytes(&self) -> &[u8] {
        const { assert!(cfg!(target_endian = "little")) };
        with_voxels!(self, a => bytemuck::cast_slice(a.as_slice().unwrap_or_default()))
    }
}

/// Stored voxel type that converts to `f64` without loss.
pub trait Voxel: Copy + PartialOrd + Send + Sync + 'static {
    /// Converts without loss.
    fn to_f64(self) -> f64;

    /// Converts towards 0, and to the type's limit beyond its range.
    fn from_f64(value: f64) -> Self;

    /// Converts to the nearest value of the type.
    fn nearest(value: f64) -> Self;
}

macro_rules! voxel {
    ($round:expr => $($t:ty),*) => { $(impl Voxel for $t {
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
    })* };
}
voxel!(f64::round => u8, i16, u16);
voxel!(f64::from => f32, f64);

/// Linear scaling of stored values: `value = stored * slope + intercept`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Scaling {
    /// Factor of the stored value.
    pub slope: f64,
    /// Offset of the scaled value.
    pub intercept: f64,
}

impl Scaling {
    /// Identity scaling.
    pub const IDENTITY: Self = Self { slope: 1.0, intercept: 0.0 };

    /// Scales a stored value.
    #[inline]
    pub fn apply(&self, stored: f64) -> f64 {
        stored * self.slope + self.intercept
    }

    /// Returns the stored value of a scaled one.
    pub fn invert(&self, value: f64) -> f64 {
        (value - self.intercept) / self.slope
    }
}
