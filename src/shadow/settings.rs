//! Typed settings (keys) of shadow methods. Each method declares the names, values, defaults and help of its settings
//! once. Parser, error messages, `--help`, table columns, the window's controls and shader tests read them from
//! there.

use std::fmt;

/// Type and range of the values of a shadow method's setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Setting of a shadow method whose value is a whole number.
    Whole {
        /// Smallest whole number that the setting of a shadow method allows.
        least: u32,
        /// Largest whole number that the setting of a shadow method allows.
        most: u32,
    },
    /// Setting of a shadow method whose value is a whole number, or a word such as `auto` for a number chosen from
    /// the scene.
    WholeOr {
        /// Smallest whole number that the setting of a shadow method allows.
        least: u32,
        /// Largest whole number that the setting of a shadow method allows.
        most: u32,
        /// Word, such as `auto`, with which a user leaves the number of a shadow method's setting to be chosen from
        /// the scene.
        word: &'static str,
    },
    /// Setting of a shadow method whose value is a real number.
    Number {
        /// Smallest number that the setting of a shadow method allows.
        least: f64,
        /// Largest number that the setting of a shadow method allows.
        most: f64,
    },
    /// Setting of a shadow method whose value is a real number, or a word such as `light` for a number that follows from
    /// the scene.
    NumberOr {
        /// Smallest number that the setting of a shadow method allows.
        least: f64,
        /// Largest number that the setting of a shadow method allows.
        most: f64,
        /// Word for a number that follows from the scene.
        word: &'static str,
    },
    /// Setting of a shadow method whose value is one of the listed words (or numbers).
    Choice(&'static [&'static str]),
}

/// Value of a shadow method's setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// Whole number, the value of a setting of [`Kind::Whole`] or [`Kind::WholeOr`].
    Whole(u32),
    /// Real number, the value of a setting of [`Kind::Number`] or [`Kind::NumberOr`].
    Number(f64),
    /// Word, the value of a setting of [`Kind::Choice`], [`Kind::WholeOr`] or [`Kind::NumberOr`].
    Choice(&'static str),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole(value) => value.fmt(f),
            Self::Number(value) => value.fmt(f),
            Self::Choice(value) => value.fmt(f),
        }
    }
}

/// Condition on the value of another setting under which a setting of a shadow method has an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum When {
    /// Condition that always holds: the setting of a shadow method always has an effect.
    Always,
    /// The setting of a shadow method has an effect only if another setting (first text) has a value (second text);
    /// it is refused otherwise.
    Is(&'static str, &'static str),
    /// The setting of a shadow method has an effect unless another setting (first text) has a value (second text); it
    /// is ignored then.
    Unless(&'static str, &'static str),
    /// The setting of a shadow method has an effect unless one of several other settings has the value listed with it.
    UnlessAny(&'static [(&'static str, &'static str)]),
}

/// Description of one setting of a shadow method: name, allowed values, default and help.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// Name of the setting of a shadow method, such as `epsilon`.
    pub name: &'static str,
    /// Type and range of the values that a setting of a shadow method allows.
    pub kind: Kind,
    /// Default value of the setting of a shadow method, as text.
    pub default: &'static str,
    /// Help text of the setting of a shadow method, in one line.
    pub help: &'static str,
    /// Whether the labels of shadow methods in tables show this setting even at its default.
    pub in_label: bool,
    /// Condition under which the setting of a shadow method has an effect.
    pub when: When,
    /// Coarser value of a shadow method's setting while the user interacts with the window: a lower limit of numbers,
    /// a replacement otherwise.
    pub coarse: Option<&'static str>,
    /// Values of a shadow method's setting that a search within a budget of memory or time tries, including the
    /// default. Numbers are in the order of non-decreasing memory.
    pub search_space: &'static [&'static str],
}

impl Key {
    const fn new(kind: Kind, default: &'static str, help: &'static str) -> Self {
        let (when, search_space): (_, &[&str]) = (When::Always, &[]);
        Self { name: "", kind, default, help, in_label: false, when, coarse: None, search_space }
    }

    /// Describes a setting of a shadow method whose value is a whole number in a closed range.
    pub const fn whole([least, most]: [u32; 2], default: &'static str, help: &'static str) -> Self {
        Self::new(Kind::Whole { least, most }, default, help)
    }

    /// Describes a setting of a shadow method whose value is a whole number in a closed range, or a word.
    pub const fn whole_or(
        [least, most]: [u32; 2],
        word: &'static str,
        default: &'static str,
        help: &'static str,
    ) -> Self {
        Self::new(Kind::WholeOr { least, most, word }, default, help)
    }

    /// Describes a setting of a shadow method whose value is a real number in a closed range.
    pub const fn number([least, most]: [f64; 2], default: &'static str, help: &'static str) -> Self {
        Self::new(Kind::Number { least, most }, default, help)
    }

    /// Describes a setting of a shadow method whose value is a real number in a closed range, or a word.
    pub const fn number_or(
        [least, most]: [f64; 2],
        word: &'static str,
        default: &'static str,
        help: &'static str,
    ) -> Self {
        Self::new(Kind::NumberOr { least, most, word }, default, help)
    }

    /// Describes a setting of a shadow method whose value is one of several words.
    pub const fn choice(names: &'static [&'static str], default: &'static str, help: &'static str) -> Self {
        Self::new(Kind::Choice(names), default, help)
    }

    /// Makes the labels of shadow methods in tables show this setting even at its default.
    pub const fn in_label(self) -> Self {
        Self { in_label: true, ..self }
    }

    /// Sets the condition under which the setting of a shadow method has an effect.
    pub const fn when(self, when: When) -> Self {
        Self { when, ..self }
    }

    /// Sets the coarser value of a shadow method's setting for use while the user interacts with the window.
    pub const fn coarse(self, coarse: &'static str) -> Self {
        Self { coarse: Some(coarse), ..self }
    }

    /// Sets the values of a shadow method's setting that a search within a budget of memory or time tries.
    pub const fn search(self, search_space: &'static [&'static str]) -> Self {
        Self { search_space, ..self }
    }

    /// Makes a search within a budget of memory or time try every word that a shadow method's setting allows.
    pub const fn search_all(self) -> Self {
        match self.kind {
            Kind::Choice(names) => self.search(names),
            _ => self,
        }
    }

    /// Returns the allowed values of a shadow method's setting as help and errors show them: `1..512`, `0..1`,
    /// `nearest|bilinear`.
    pub fn values(&self) -> String {
        match self.kind {
            Kind::Whole { least, most } => format!("{least}..{most}"),
            Kind::WholeOr { least, most, word } => format!("{word}|{least}..{most}"),
            Kind::NumberOr { least, most, word } => format!("{word}|{least}..{most}"),
            Kind::Number { least, most } => format!("{least}..{most}"),
            Kind::Choice(names) => names.join("|"),
        }
    }

    /// Parses a value of a shadow method's setting; returns `None` if the setting does not allow it.
    pub fn parse(&self, text: &str) -> Option<Value> {
        match self.kind {
            Kind::WholeOr { word, .. } | Kind::NumberOr { word, .. } if text == word => {
                Some(Value::Choice(word))
            }
            Kind::Whole { least, most } | Kind::WholeOr { least, most, .. } => {
                text.parse().ok().filter(|n| (least..=most).contains(n)).map(Value::Whole)
            }
            Kind::Number { least, most } | Kind::NumberOr { least, most, .. } => {
                // Negative zero becomes zero, so that equal values have one text.
                text.parse().ok().filter(|n| (least..=most).contains(n)).map(|n: f64| Value::Number(n + 0.0))
            }
            Kind::Choice(names) => names.iter().find(|name| **name == text).map(|name| Value::Choice(name)),
        }
    }

    /// Returns the value of a shadow method's setting to use while the user interacts with the window; it may be
    /// coarser.
    pub fn coarser(&self, value: Value) -> Value {
        match (value, self.coarse.and_then(|coarse| self.parse(coarse))) {
            (value, None) => value,
            (Value::Number(value), Some(Value::Number(least))) => Value::Number(value.max(least)),
            (_, Some(coarse)) => coarse,
        }
    }
}

/// Whether a setting of a shadow method has an effect under the values of the other settings.
pub(super) fn applies(keys: &[Key], values: &[Value], key: &Key) -> bool {
    // A setting without an effect has no value.
    let is = |other, wanted| {
        let mut all = keys.iter().zip(values);
        all.any(|(k, v)| k.name == other && *v == Value::Choice(wanted) && applies(keys, values, k))
    };
    match key.when {
        When::Always => true,
        When::Is(other, wanted) => is(other, wanted),
        When::Unless(other, wanted) => !is(other, wanted),
        When::UnlessAny(cases) => !cases.iter().any(|(other, wanted)| is(other, wanted)),
    }
}

/// Type of a field in a shadow method's settings struct, convertible to and from the [`Value`] of a setting.
pub(super) trait Field: Copy {
    /// Converts the value of a shadow method's setting to the type of its field in the settings struct.
    fn from_value(value: Value) -> Option<Self>;
    /// Converts a field of a shadow method's settings struct to the value of the given setting.
    fn to_value(self, key: &Key) -> Option<Value>;
    /// Appends the value of this field to the list of a shadow method's setting values. It appends the setting's
    /// default if the value is not allowed.
    fn push_to(self, values: &mut Vec<Value>, keys: &[Key]) {
        let key = &keys[values.len()];
        values.extend(self.to_value(key).or_else(|| key.parse(key.default)));
    }
}

impl Field for u32 {
    fn from_value(value: Value) -> Option<Self> {
        match value {
            Value::Whole(value) => Some(value),
            Value::Choice(name) => name.parse().ok(),
            Value::Number(_) => None,
        }
    }

    fn to_value(self, key: &Key) -> Option<Value> {
        key.parse(&self.to_string())
    }
}

/// Field for a shadow method's setting whose value is a number, or `None` if the number is chosen from the scene.
impl Field for Option<u32> {
    fn from_value(value: Value) -> Option<Self> {
        match value {
            Value::Whole(value) => Some(Some(value)),
            Value::Choice(_) => Some(None),
            Value::Number(_) => None,
        }
    }

    fn to_value(self, key: &Key) -> Option<Value> {
        match (self, key.kind) {
            (Some(number), _) => key.parse(&number.to_string()),
            (None, Kind::WholeOr { word, .. }) => Some(Value::Choice(word)),
            (None, _) => None,
        }
    }
}

impl Field for f64 {
    fn from_value(value: Value) -> Option<Self> {
        if let Value::Number(value) = value { Some(value) } else { None }
    }

    fn to_value(self, _: &Key) -> Option<Value> {
        Some(Value::Number(self))
    }
}

/// Field for a shadow method's setting whose value is a number, or `None` if the number follows from the scene.
impl Field for Option<f64> {
    fn from_value(value: Value) -> Option<Self> {
        match value {
            Value::Number(value) => Some(Some(value)),
            Value::Choice(_) => Some(None),
            Value::Whole(_) => None,
        }
    }

    fn to_value(self, key: &Key) -> Option<Value> {
        match (self, key.kind) {
            (Some(number), _) => Some(Value::Number(number)),
            (None, Kind::NumberOr { word, .. }) => Some(Value::Choice(word)),
            (None, _) => None,
        }
    }
}

/// Declares an enum whose variants are the words that a setting of a shadow method allows.
macro_rules! choices {
    ($(#[$meta:meta])* $vis:vis enum $name:ident { $($(#[$doc:meta])* $variant:ident = $text:literal,)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        $vis enum $name { $($(#[$doc])* $variant,)* }

        impl $name {
            /// Words that a setting of a shadow method allows, in the order of the enum's variants.
            pub const NAMES: &'static [&'static str] = &[$($text),*];
        }

        impl $crate::shadow::settings::Field for $name {
            fn from_value(value: $crate::shadow::Value) -> Option<Self> {
                match value {
                    $($crate::shadow::Value::Choice($text) => Some(Self::$variant),)*
                    _ => None,
                }
            }

            fn to_value(self, _: &$crate::shadow::Key) -> Option<$crate::shadow::Value> {
                Some($crate::shadow::Value::Choice(Self::NAMES[self as usize]))
            }
        }
    };
}

pub(super) use choices;
