//! Shadow method and setting texts as the window edits them.

use crate::error::{Error, Result};
use crate::shadow::{self, Entry, METHODS, Method, MethodSpec};
use std::sync::Arc;

/// Method of the registry with one text per setting, valid or not. The method is parsed once per edit.
#[derive(Debug, Clone)]
pub struct MethodChoice {
    /// Name in the registry.
    pub name: &'static str,
    values: Vec<String>,
    method: Result<Arc<dyn Method>>,
}

impl PartialEq for MethodChoice {
    fn eq(&self, other: &Self) -> bool {
        (self.name, &self.values) == (other.name, &other.values)
    }
}

impl Default for MethodChoice {
    fn default() -> Self {
        Self::of(METHODS[0])
    }
}

impl MethodChoice {
    /// Method with its default settings.
    pub fn of(entry: &Entry) -> Self {
        Self::new(entry.name, entry.keys.iter().map(|k| k.default.to_owned()).collect())
    }

    fn new(name: &'static str, values: Vec<String>) -> Self {
        let unparsed = Error::input("bad shadow method", name, "it is not parsed");
        let mut choice = Self { name, values, method: Err(unparsed) };
        choice.method = shadow::parse(&choice.spec()).map(Arc::from);
        choice
    }

    /// Parses `METHOD[:key=value,...]`.
    ///
    /// # Errors
    /// See [`shadow::parse`].
    pub fn parse(text: &str) -> Result<Self> {
        let spec: MethodSpec = text.parse()?;
        let values = spec.values().iter().map(ToString::to_string).collect();
        Ok(Self::new(spec.entry().name, values))
    }

    /// The method's entry in the registry.
    pub fn entry(&self) -> &'static Entry {
        METHODS.iter().find(|m| m.name == self.name).copied().unwrap_or(METHODS[0])
    }

    /// Texts of the settings, in the order of the entry's keys.
    pub fn values(&self) -> &[String] {
        &self.values
    }

    /// Replaces the texts of the settings.
    pub fn set_values(&mut self, values: Vec<String>) {
        if values != self.values {
            *self = Self::new(self.name, values);
        }
    }

    /// Text of a setting; `None` where the method does not have it.
    pub fn get(&self, key: &str) -> Option<&str> {
        let at = self.entry().keys.iter().position(|k| k.name == key)?;
        self.values.get(at).map(String::as_str)
    }

    /// `METHOD[:key=value,...]`, without defaults.
    pub fn spec(&self) -> String {
        let keys = self.entry().keys;
        let changed = keys.iter().zip(&self.values).filter(|(key, value)| key.default != value.as_str());
        let settings = changed.map(|(key, value)| format!("{}={value}", key.name)).collect::<Vec<_>>();
        match settings.is_empty() {
            true => self.name.to_owned(),
            false => format!("{}:{}", self.name, settings.join(",")),
        }
    }

    /// The parsed method.
    ///
    /// # Errors
    /// A value out of range.
    pub fn method(&self) -> Result<&dyn Method> {
        self.method.as_deref().map_err(Clone::clone)
    }

    /// Cheaper variant for use during interaction: coarse values, and at most `map` texels a side where the method has
    /// `own` of them.
    #[must_use]
    pub fn coarse(&self, own: u32, map: u32) -> Self {
        let coarse = self.entry().keys.iter().zip(&self.values).map(|(key, value)| {
            if key.name == "map" && own > map {
                return map.to_string();
            }
            key.parse(value).map_or_else(|| value.clone(), |now| key.coarser(now).to_string())
        });
        Self::new(self.name, coarse.collect())
    }

    /// Texels a side, or `chosen` where the map size is automatic; `None` where the method has no map.
    pub fn map(&self, chosen: u32) -> Option<u32> {
        self.get("map").map(|m| m.parse().unwrap_or(chosen))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_is_parsed_from_its_own_text() {
        for entry in METHODS {
            let choice = MethodChoice::of(entry);
            assert_eq!(choice.spec(), entry.name);
            assert_eq!(MethodChoice::parse(&choice.spec()).unwrap(), choice);
            choice.method().unwrap();
            choice.coarse(512, 64).method().unwrap();
        }
        let choice = MethodChoice::parse("dsm:epsilon=0.01,map=256").unwrap();
        assert_eq!(choice.spec(), "dsm:epsilon=0.01,map=256");
        assert_eq!(choice.map(512), Some(256));
        assert_eq!(choice.coarse(256, 128).map(512), Some(128));
        assert_eq!(choice.coarse(256, 512).map(512), Some(256), "coarse maps are never finer");
        let choice = MethodChoice::parse("dsm").unwrap();
        assert_eq!((choice.map(300), choice.coarse(300, 512).map(300)), (Some(300), Some(300)));
        assert_eq!(choice.coarse(300, 192).map(300), Some(192));
        assert_eq!(MethodChoice::parse("rays").unwrap().map(300), None);
    }

    #[test]
    fn bad_values_are_refused_with_a_reason() {
        let mut choice = MethodChoice::parse("dsm").unwrap();
        let values = choice.entry().keys.iter().zip(choice.values());
        let values = values.map(|(key, v)| if key.name == "epsilon" { "-3".into() } else { v.clone() });
        let values = values.collect();
        choice.set_values(values);
        assert!(choice.method().unwrap_err().to_string().contains("epsilon"));
        assert!(MethodChoice::parse("dsn").is_err());
    }
}
