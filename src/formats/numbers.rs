//! Numbers that are written to volume files: stored values, or physical values of a suitable type.

use super::raw_layout::{RawLayout, Sidecar};
use crate::volume::{ByteOrder, Element, Scaling, Volume, Voxel};
use crate::with_voxels;
use std::io::{self, Write};

/// Voxels to write to a volume file: the stored numbers, or their physical values converted to number type `scaled`.
pub(super) struct Numbers<'a> {
    volume: &'a Volume,
    scaled: Option<Element>,
}

impl<'a> Numbers<'a> {
    /// Selects the numbers to write to a volume format without slope and intercept: physical values in the smallest
    /// suitable type.
    pub(super) fn values(volume: &'a Volume) -> Self {
        let scaling = volume.scaling();
        if scaling == Scaling::IDENTITY {
            return Self::stored(volume);
        }
        let is_integer = |v: f64| v.fract() == 0.0;
        let stores_floats = matches!(volume.element(), Element::F32 | Element::F64);
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

    pub(super) fn element(&self) -> Element {
        self.scaled.unwrap_or_else(|| self.volume.element())
    }

    /// Selects the stored numbers.
    pub(super) fn stored(volume: &'a Volume) -> Self {
        Self { volume, scaled: None }
    }

    /// Writes all voxels of a volume as little-endian numbers, x fastest.
    pub(super) fn write(&self, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
        for slab in self.volume.slabs(0, 1) {
            let (_, block) = slab.map_err(io::Error::other)?;
            match self.scaled {
                None => out.write_all(block.voxels().bytes())?,
                Some(element) => with_voxels!(block.voxels(), a => {
                    a.rows().into_iter().try_for_each(|row| self.write_scaled(row.iter().copied(), element, out))?;
                }),
            }
        }
        Ok(())
    }

    /// Writes the physical values of a row of voxels as numbers of type `element`.
    fn write_scaled<T: Voxel>(
        &self,
        row: impl Iterator<Item = T>,
        element: Element,
        out: &mut (impl Write + ?Sized),
    ) -> io::Result<()> {
        let scaling = self.volume.scaling();
        let mut bytes = Vec::new();
        for value in row.map(|v| scaling.apply(v.to_f64())) {
            match element {
                Element::I16 => bytes.extend_from_slice(&(value as i16).to_le_bytes()),
                Element::I32 => bytes.extend_from_slice(&(value as i32).to_le_bytes()),
                _ => bytes.extend_from_slice(&value.to_le_bytes()),
            }
        }
        out.write_all(&bytes)
    }

    /// Creates the contents of the JSON sidecar file for the written voxels.
    pub(super) fn sidecar(&self) -> Sidecar {
        let layout =
            RawLayout { dims: self.volume.dims(), element: self.element(), byte_order: ByteOrder::Little };
        let sidecar = Sidecar::new(self.volume, &layout);
        if self.scaled.is_some() { Sidecar { slope: 1.0, intercept: 0.0, ..sidecar } } else { sidecar }
    }
}
