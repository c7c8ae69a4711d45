//! Values of DICOM attributes, found by tag.

use dicom_core::{PrimitiveValue, Tag};
use std::collections::BTreeMap;

/// Whether a character can be padding of a DICOM text value: white space or NUL.
pub(super) fn is_padding(c: char) -> bool {
    c.is_whitespace() || c == '\0'
}

/// DICOM attributes with their values, found by tag.
#[derive(Debug, Clone, Default)]
pub(super) struct Attributes {
    pub(super) values: BTreeMap<Tag, PrimitiveValue>,
    /// Items of each DICOM sequence (SQ), keyed by the tag of the sequence.
    pub(super) items: BTreeMap<Tag, Vec<Attributes>>,
}

impl Attributes {
    /// Returns the text of a DICOM attribute without padding; `None` if it is missing or empty.
    pub(super) fn text(&self, tag: Tag) -> Option<String> {
        let text = self.values.get(&tag)?.to_str();
        Some(text.trim_matches(is_padding).to_owned()).filter(|text| !text.is_empty())
    }

    /// Returns the numbers of a DICOM attribute; `None` if it is missing or a number is not finite.
    pub(super) fn numbers(&self, tag: Tag) -> Option<Vec<f64>> {
        let numbers = self.values.get(&tag)?.to_multi_float64().ok()?;
        (!numbers.is_empty() && numbers.iter().all(|n| n.is_finite())).then_some(numbers)
    }

    pub(super) fn number(&self, tag: Tag) -> Option<f64> {
        self.numbers(tag).map(|all| all[0])
    }

    pub(super) fn integer(&self, tag: Tag) -> Option<i64> {
        self.values.get(&tag)?.to_int().ok()
    }

    /// Returns the unsigned 16-bit numbers of a DICOM attribute.
    pub(super) fn words(&self, tag: Tag) -> Option<Vec<u16>> {
        self.values.get(&tag)?.to_multi_int().ok()
    }

    /// Returns the largest number of decimals among the numbers of a DICOM text attribute, which gives the precision
    /// of the written values. `None` if a number has an exponent.
    pub(super) fn decimals(&self, tag: Tag) -> Option<usize> {
        let numbers = self.values.get(&tag)?.strings().ok()?;
        let decimals = |n: &String| n.trim().split_once('.').map_or(0, |(_, decimals)| decimals.len());
        let is_plain = !numbers.iter().any(|n| n.contains(['e', 'E']));
        is_plain.then(|| numbers.iter().map(decimals).max().unwrap_or(0))
    }

    /// Returns the items of a DICOM sequence; empty if the sequence is missing.
    pub(super) fn items(&self, tag: Tag) -> &[Self] {
        self.items.get(&tag).map_or(&[], Vec::as_slice)
    }

    pub(super) fn has(&self, tag: Tag) -> bool {
        self.values.contains_key(&tag)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dicom_dictionary_std::tags;

    #[test]
    fn values_are_numbers_and_texts() {
        let mut root = Attributes::default();
        root.values.insert(tags::ROWS, PrimitiveValue::from(-2i16));
        root.values.insert(tags::PIXEL_SPACING, dicom_core::dicom_value!(Strs, ["0.50", " 0.125 "]));
        assert_eq!(root.integer(tags::ROWS), Some(-2));
        assert_eq!(root.numbers(tags::PIXEL_SPACING), Some(vec![0.5, 0.125]));
        assert_eq!(root.decimals(tags::PIXEL_SPACING), Some(3));
    }
}
