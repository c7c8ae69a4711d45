//! Values of DICOM attributes.

use dicom_core::{PrimitiveValue, Tag};
use std::collections::BTreeMap;

/// Whether a character only fills a text up to an even length.
pub(super) fn is_padding(c: char) -> bool {
    c.is_whitespace() || c == '\0'
}

/// Attributes by tag.
#[derive(Debug, Clone, Default)]
pub(super) struct Attributes {
    pub(super) values: BTreeMap<Tag, PrimitiveValue>,
    /// Items of sequences.
    pub(super) items: BTreeMap<Tag, Vec<Attributes>>,
}

impl Attributes {
    /// Text that is not empty.
    pub(super) fn text(&self, tag: Tag) -> Option<String> {
        let text = self.values.get(&tag)?.to_str();
        Some(text.trim_matches(is_padding).to_owned()).filter(|text| !text.is_empty())
    }

    /// Finite numbers; `None` if one of them is not.
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

    /// Unsigned 16-bit numbers.
    pub(super) fn words(&self, tag: Tag) -> Option<Vec<u16>> {
        self.values.get(&tag)?.to_multi_int().ok()
    }

    /// Largest number of decimals of numbers written as text without exponents: the resolution that they were rounded to.
    pub(super) fn decimals(&self, tag: Tag) -> Option<usize> {
        let numbers = self.values.get(&tag)?.strings().ok()?;
        let decimals = |n: &String| n.trim().split_once('.').map_or(0, |(_, decimals)| decimals.len());
        let is_plain = !numbers.iter().any(|n| n.contains(['e', 'E']));
        is_plain.then(|| numbers.iter().map(decimals).max().unwrap_or(0))
    }

    /// Items of a sequence.
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
