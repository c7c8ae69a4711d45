//! Values of DICOM attributes.

use dicom_core::{Tag, VR};
use std::collections::BTreeMap;

/// Value of an attribute.
#[derive(Debug, Clone)]
pub(super) enum Value {
    Text(String),
    Integers(Vec<i64>),
    Floats(Vec<f64>),
}

impl Value {
    pub(super) fn new(bytes: &[u8], vr: VR, big_endian: bool) -> Self {
        fn numbers<const N: usize, T>(bytes: &[u8], big: bool, number: impl Fn([u8; N]) -> T) -> Vec<T> {
            let little = |mut word: [u8; N]| {
                if big {
                    word.reverse();
                }
                word
            };
            bytes.as_chunks().0.iter().map(|word| number(little(*word))).collect()
        }
        match vr {
            VR::US | VR::OW => Self::Integers(numbers(bytes, big_endian, |b| u16::from_le_bytes(b).into())),
            VR::SS => Self::Integers(numbers(bytes, big_endian, |b| i16::from_le_bytes(b).into())),
            VR::UL | VR::OL => Self::Integers(numbers(bytes, big_endian, |b| u32::from_le_bytes(b).into())),
            VR::SL => Self::Integers(numbers(bytes, big_endian, |b| i32::from_le_bytes(b).into())),
            VR::SV => Self::Integers(numbers(bytes, big_endian, i64::from_le_bytes)),
            VR::OB | VR::UN => Self::Integers(bytes.iter().map(|b| (*b).into()).collect()),
            VR::FL | VR::OF => Self::Floats(numbers(bytes, big_endian, |b| f32::from_le_bytes(b).into())),
            VR::FD | VR::OD => Self::Floats(numbers(bytes, big_endian, f64::from_le_bytes)),
            _ => Self::Text(String::from_utf8_lossy(bytes).trim_matches(is_padding).to_owned()),
        }
    }
}

/// Whether a character only fills a text up to an even length.
pub(super) fn is_padding(c: char) -> bool {
    c.is_whitespace() || c == '\0'
}

/// Attributes by tag.
#[derive(Debug, Clone, Default)]
pub(super) struct Attributes(pub(super) BTreeMap<Tag, Value>);

impl Attributes {
    /// Text that is not empty.
    pub(super) fn text(&self, tag: Tag) -> Option<String> {
        match self.0.get(&tag)? {
            Value::Text(text) if !text.is_empty() => Some(text.clone()),
            _ => None,
        }
    }

    /// Finite numbers; `None` if one of them is not.
    pub(super) fn numbers(&self, tag: Tag) -> Option<Vec<f64>> {
        let numbers: Vec<f64> = match self.0.get(&tag)? {
            Value::Text(text) => {
                text.split('\\').map(|n| n.trim_matches(is_padding).parse().ok()).collect::<Option<_>>()?
            }
            Value::Integers(all) => all.iter().map(|n| *n as f64).collect(),
            Value::Floats(all) => all.clone(),
        };
        (!numbers.is_empty() && numbers.iter().all(|n| n.is_finite())).then_some(numbers)
    }

    pub(super) fn number(&self, tag: Tag) -> Option<f64> {
        self.numbers(tag).map(|all| all[0])
    }

    pub(super) fn integer(&self, tag: Tag) -> Option<i64> {
        match self.0.get(&tag)? {
            Value::Text(text) => text.split('\\').next()?.trim_matches(is_padding).parse().ok(),
            Value::Integers(all) => all.first().copied(),
            Value::Floats(all) => all.first().map(|n| *n as i64),
        }
    }

    /// Unsigned 16-bit numbers.
    pub(super) fn words(&self, tag: Tag) -> Option<Vec<u16>> {
        match self.0.get(&tag)? {
            Value::Integers(all) => all.iter().map(|n| u16::try_from(*n).ok()).collect(),
            _ => None,
        }
    }

    /// Largest number of decimals of numbers written as text without exponents: the resolution that they were rounded to.
    pub(super) fn decimals(&self, tag: Tag) -> Option<usize> {
        let Value::Text(text) = self.0.get(&tag)? else { return None };
        let decimals = |n: &str| n.trim().split_once('.').map_or(0, |(_, decimals)| decimals.len());
        (!text.contains(['e', 'E'])).then(|| text.split('\\').map(decimals).max().unwrap_or(0))
    }

    pub(super) fn has(&self, tag: Tag) -> bool {
        self.0.contains_key(&tag)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dicom_dictionary_std::tags;

    #[test]
    fn values_follow_their_types() {
        let mut root = Attributes::default();
        root.0.insert(tags::ROWS, Value::new(&[0xff, 0xfe], VR::SS, true));
        root.0.insert(tags::PIXEL_SPACING, Value::new(b"0.50\\ 0.125 ", VR::DS, false));
        assert_eq!(root.integer(tags::ROWS), Some(-2));
        assert_eq!(root.numbers(tags::PIXEL_SPACING), Some(vec![0.5, 0.125]));
        assert_eq!(root.decimals(tags::PIXEL_SPACING), Some(3));
    }
}
