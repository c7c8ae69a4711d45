//! DICOM modality lookup tables, which map stored pixel values to physical values non-linearly.
//!
//! Source: DICOM PS3.3, C.11.1.1.

use super::dataset::DataSet;
use dicom_dictionary_std::tags;

/// DICOM modality lookup table. Stored values outside the table map to its first or last entry.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table {
    first: i64,
    values: Vec<u16>,
    /// Number of bits of each value in the DICOM modality lookup table.
    pub(super) bits: u32,
}

impl Table {
    /// Reads the modality lookup table of a DICOM file, if it has one. `is_signed` tells whether the stored pixels
    /// are signed.
    ///
    /// # Errors
    /// The lookup table has no descriptor, or fewer values than its descriptor claims.
    pub(super) fn new(set: &DataSet, is_signed: bool) -> Result<Option<Self>, String> {
        let Some(table) = set.root.items(tags::MODALITY_LUT_SEQUENCE).first() else { return Ok(None) };
        let descriptor = table.numbers(tags::LUT_DESCRIPTOR).filter(|d| d.len() == 3);
        let descriptor = descriptor.ok_or("its modality lookup table has no descriptor")?;
        let [count, first, bits] = [0, 1, 2].map(|at| descriptor[at] as i64);
        // Numbers of 16 bits: 65536 does not fit, and a sign may have been lost.
        let count = if count == 0 { 1 << 16 } else { count & 0xffff } as usize;
        let first = if is_signed && first > 0x7fff { first - 0x1_0000 } else { first };
        let values = table.words(tags::LUT_DATA).unwrap_or_default();
        if values.len() < count {
            let found = values.len();
            return Err(format!("its modality lookup table has {found} of {count} values"));
        }
        let bits = u32::try_from(bits).ok().filter(|bits| (1..=16).contains(bits)).unwrap_or(16);
        Ok(Some(Self { first, values: values[..count].to_vec(), bits }))
    }

    /// Returns the entry of the DICOM lookup table for a stored pixel value.
    pub(super) fn value(&self, stored: i64) -> u16 {
        let at = usize::try_from(stored - self.first).unwrap_or(0);
        self.values[at.min(self.values.len() - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_beyond_the_table_have_its_end_values() {
        let table = Table { first: -2, values: vec![10, 20, 40], bits: 8 };
        assert_eq!([-9, -2, -1, 0, 1, 900].map(|v| table.value(v)), [10, 10, 20, 40, 40, 40]);
    }
}
