//! Storage of voxel values as texels, without loss for integers of 8 and 16 bits and for 32-bit floats.

use crate::transfer::TexelMapping;
use crate::volume::{Element, Volume, Voxel};
use half::f16;
use wgpu::TextureFormat;

/// Difference between a stored signed integer and its texel of the format `R16Uint`.
const SIGNED_OFFSET: f64 = 32_768.0;

/// Linear conversion from stored voxel values to texel values: `texel = (stored - center) * per_stored`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TexelPacking {
    /// Format of the texels.
    pub format: TextureFormat,
    center: f64,
    per_stored: f64,
    /// Number that is added to stored values in the format `R16Uint`.
    whole_offset: f64,
}

impl TexelPacking {
    /// Chooses how a volume's values are stored as 16-bit or 32-bit floats, which the adapter may filter.
    ///
    /// A 16-bit float is exact for whole numbers from -2048 to 2048: integer volumes whose stored values span at most
    /// 4096 (12-bit CT) are stored as differences from their middle. A 32-bit float is exact for whole numbers up to
    /// 2^24, and so for other 16-bit volumes. Values of 32-bit volumes are scaled by a power of 2 to `[-1, 1]`, without
    /// rounding. Values of 64-bit volumes are scaled to `[0, 1]` and rounded to 24 bits.
    pub fn of(volume: &Volume) -> Self {
        let [lo, hi] = volume.stored_range();
        // A negative slope is negated, so that texels always rise with values.
        let sign = volume.scaling().slope.signum();
        let single =
            Self { format: TextureFormat::R32Float, center: 0.0, per_stored: sign, whole_offset: 0.0 };
        match volume.element() {
            Element::F32 => {
                let largest = lo.abs().max(hi.abs());
                let exponent = if largest > 0.0 { largest.log2().ceil() } else { 0.0 };
                Self { per_stored: sign * (-exponent).exp2(), ..single }
            }
            Element::F64 => {
                let span = if hi > lo { hi - lo } else { 1.0 };
                Self { center: lo, per_stored: sign / span, ..single }
            }
            _ if hi - lo <= 4096.0 => {
                Self { format: TextureFormat::R16Float, center: (0.5 * (lo + hi)).floor(), ..single }
            }
            _ => single,
        }
    }

    /// Returns the storage of the same texel values in the fewest bytes, for shaders that filter themselves.
    #[must_use]
    pub fn compact(self, volume: &Volume) -> Self {
        let whole_offset = match volume.element() {
            Element::U16 => 0.0,
            Element::I16 => SIGNED_OFFSET,
            _ => return self,
        };
        match self.format {
            TextureFormat::R32Float => Self { format: TextureFormat::R16Uint, whole_offset, ..self },
            _ => self,
        }
    }

    /// Returns the linear mapping from texel values to a volume's values.
    pub fn mapping(&self, volume: &Volume) -> TexelMapping {
        let scaling = volume.scaling();
        TexelMapping { scale: scaling.slope / self.per_stored, offset: scaling.apply(self.center) }
    }

    /// Returns the texel value of a stored value.
    pub fn texel(&self, stored: f64) -> f64 {
        (stored - self.center) * self.per_stored
    }

    /// Returns sign and offset of the texel values in the format `R16Uint`: `texel = sign * (word - offset)`.
    pub fn of_words(&self) -> [f32; 2] {
        [self.per_stored, self.whole_offset].map(|number| number as f32)
    }

    /// Number of bytes of a texel.
    pub fn bytes(&self) -> u64 {
        self.format.block_copy_size(None).unwrap_or_default().into()
    }

    /// Appends the texels of stored values to `bytes`.
    pub fn append<T: Voxel>(&self, stored: impl Iterator<Item = T>, bytes: &mut Vec<u8>) {
        let texel = |v: T| self.texel(v.to_f64()) as f32;
        match self.format {
            TextureFormat::R16Float => {
                stored.for_each(|v| bytes.extend_from_slice(&f16::from_f32(texel(v)).to_le_bytes()));
            }
            TextureFormat::R16Uint => {
                let word = |v: T| (v.to_f64() + self.whole_offset) as u16;
                stored.for_each(|v| bytes.extend_from_slice(&word(v).to_le_bytes()));
            }
            _ => stored.for_each(|v| bytes.extend_from_slice(&texel(v).to_le_bytes())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Provenance, Scaling, Voxels};
    use glam::DAffine3;
    use ndarray::Array3;

    /// Words of 16 bits stand for the same texel values as 32-bit floats.
    #[test]
    fn words_have_the_values_of_floats() {
        let of = |voxels: Voxels| {
            Volume::new(voxels, Scaling::IDENTITY, DAffine3::IDENTITY, Provenance::new("", "", "")).unwrap()
        };
        let signed = [-32_768_i16, -3, 0, 7, 32_767];
        let unsigned = [0_u16, 3, 40_000, 65_534, 65_535];
        for volume in [
            of(Array3::from_shape_fn((1, 1, 5), |(_, _, i)| signed[i]).into()),
            of(Array3::from_shape_fn((1, 1, 5), |(_, _, i)| unsigned[i]).into()),
        ] {
            let floats = TexelPacking::of(&volume);
            let words = floats.compact(&volume);
            assert_eq!((floats.format, words.format), (TextureFormat::R32Float, TextureFormat::R16Uint));
            let [sign, offset] = words.of_words();
            crate::with_voxels!(volume.resident().unwrap(), a => for v in a.iter() {
                let mut bytes = Vec::new();
                words.append(std::iter::once(*v), &mut bytes);
                let word = u16::from_le_bytes(bytes.try_into().unwrap());
                assert_eq!(sign * (f32::from(word) - offset), floats.texel(v.to_f64()) as f32);
            });
            assert_eq!(floats.mapping(&volume), words.mapping(&volume));
        }
        let narrow = of(Array3::from_elem((2, 2, 2), 5_u16).into());
        assert_eq!(TexelPacking::of(&narrow).compact(&narrow).format, TextureFormat::R16Float);
    }
}
