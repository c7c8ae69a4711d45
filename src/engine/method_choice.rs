//! A shadow method and its settings as the registry describes them: what the shadows panel edits.

use crate::error::Result;
use crate::shadow::{self, Entry, METHODS, Method, MethodSpec};

/// A method of the registry with a text for every key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MethodChoice {
    /// Its name in the registry.
    pub name: &'static str,
    /// As many as the method has keys, in their order.
    pub values: Vec<String>,
}

impl Default for MethodChoice {
    /// The first of the registry.
    fn default() -> Self {
        Self::of(METHODS[0])
    }
}

impl MethodChoice {
    /// A method with its defaults.
    pub fn of(entry: &Entry) -> Self {
        Self { name: entry.name, values: entry.keys.iter().map(|k| k.default.to_owned()).collect() }
    }

    /// From `METHOD[:key=value,...]`.
    ///
    /// # Errors
    /// As [`shadow::parse`].
    pub fn parse(text: &str) -> Result<Self> {
        let spec: MethodSpec = text.parse()?;
        Ok(Self { name: spec.entry().name, values: spec.values().iter().map(ToString::to_string).collect() })
    }

    /// The method's entry in the registry.
    pub fn entry(&self) -> &'static Entry {
        METHODS.iter().find(|m| m.name == self.name).copied().unwrap_or(METHODS[0])
    }

    /// The value of a key, where the method has it.
    pub fn get(&self, key: &str) -> Option<&str> {
        let at = self.entry().keys.iter().position(|k| k.name == key)?;
        self.values.get(at).map(String::as_str)
    }

    /// Sets a key, where the method has it.
    pub fn set(&mut self, key: &str, value: String) {
        if let Some(at) = self.entry().keys.iter().position(|k| k.name == key) {
            self.values[at] = value;
        }
    }

    /// `METHOD[:key=value,...]`, with what differs from the defaults.
    pub fn spec(&self) -> String {
        let keys = self.entry().keys;
        let changed = keys.iter().zip(&self.values).filter(|(key, value)| key.default != value.as_str());
        let settings = changed.map(|(key, value)| format!("{}={value}", key.name)).collect::<Vec<_>>();
        match settings.is_empty() {
            true => self.name.to_owned(),
            false => format!("{}:{}", self.name, settings.join(",")),
        }
    }

    /// The method itself.
    ///
    /// # Errors
    /// A value out of range.
    pub fn method(&self) -> Result<Box<dyn Method>> {
        shadow::parse(&self.spec())
    }

    /// A cheaper one for while a hand moves: its keys' coarse values, and no more than `map` texels a side where it has
    /// `own` of them.
    #[must_use]
    pub fn coarse(&self, own: u32, map: u32) -> Self {
        let mut coarse = self.clone();
        for (key, value) in self.entry().keys.iter().zip(&mut coarse.values) {
            if let Some(now) = key.parse(value) {
                *value = key.coarser(now).to_string();
            }
        }
        if own > map && self.get("map").is_some() {
            coarse.set("map", map.to_string());
        }
        coarse
    }

    /// Texels a side, where the method has a map: as set, or as many as maps have chosen for themselves.
    pub fn map(&self, chosen: u32) -> Option<u32> {
        self.get("map").map(|m| m.parse().unwrap_or(chosen))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_of_the_registry_comes_back_from_its_own_text() {
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
        assert_eq!(choice.coarse(256, 512).map(512), Some(256), "a coarser map is never a finer one");
        let choice = MethodChoice::parse("dsm").unwrap();
        assert_eq!((choice.map(300), choice.coarse(300, 512).map(300)), (Some(300), Some(300)));
        assert_eq!(choice.coarse(300, 192).map(300), Some(192));
        assert_eq!(MethodChoice::parse("rays").unwrap().map(300), None);
    }

    #[test]
    fn a_bad_value_is_refused_with_its_reason() {
        let mut choice = MethodChoice::parse("dsm").unwrap();
        choice.set("epsilon", "-3".into());
        assert!(choice.method().unwrap_err().to_string().contains("epsilon"));
        assert!(MethodChoice::parse("dsn").is_err());
    }
}
