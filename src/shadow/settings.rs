//! Typed settings of shadow methods. Each method declares the name, values, default and help of its keys once; parsing,
//! errors, `--help`, table columns, the window's controls and shader tests read them from there.

use std::fmt;

/// Values that a key takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A whole number.
    Whole {
        /// Smallest value.
        least: u32,
        /// Largest value.
        most: u32,
    },
    /// A whole number, or a word that leaves it to the scene.
    WholeOr {
        /// Smallest value.
        least: u32,
        /// Largest value.
        most: u32,
        /// Word for the choice by the scene.
        word: &'static str,
    },
    /// Any number.
    Number {
        /// Smallest value.
        least: f64,
        /// Largest value.
        most: f64,
    },
    /// One of these words (or numbers).
    Choice(&'static [&'static str]),
}

/// The value of a key.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// Value of [`Kind::Whole`] and [`Kind::WholeOr`].
    Whole(u32),
    /// Value of [`Kind::Number`].
    Number(f64),
    /// Value of [`Kind::Choice`], and the word of [`Kind::WholeOr`].
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

/// Condition on another key under which a key has an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum When {
    /// No condition.
    Always,
    /// Effective only with this value of that key; refused otherwise.
    Is(&'static str, &'static str),
    /// Effective unless that key has this value; ignored then.
    Unless(&'static str, &'static str),
    /// Effective unless one of two keys has its value.
    UnlessEither([(&'static str, &'static str); 2]),
}

/// A setting of a method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// Name, such as `epsilon`.
    pub name: &'static str,
    /// Values that it takes.
    pub kind: Kind,
    /// Text of the default value.
    pub default: &'static str,
    /// One line of help.
    pub help: &'static str,
    /// Whether labels show the key even at its default.
    pub in_label: bool,
    /// Condition under which it has an effect.
    pub when: When,
    /// Value during interaction: a lower limit of numbers, a replacement otherwise.
    pub coarse: Option<&'static str>,
    /// Values that a search within a budget tries, the default among them; numbers in the order of non-decreasing memory.
    pub search_space: &'static [&'static str],
}

impl Key {
    const fn new(kind: Kind, default: &'static str, help: &'static str) -> Self {
        let (when, search_space): (_, &[&str]) = (When::Always, &[]);
        Self { name: "", kind, default, help, in_label: false, when, coarse: None, search_space }
    }

    /// Key of a whole number in a closed range.
    pub const fn whole([least, most]: [u32; 2], default: &'static str, help: &'static str) -> Self {
        Self::new(Kind::Whole { least, most }, default, help)
    }

    /// Key of a whole number in a closed range, or a word.
    pub const fn whole_or(
        [least, most]: [u32; 2],
        word: &'static str,
        default: &'static str,
        help: &'static str,
    ) -> Self {
        Self::new(Kind::WholeOr { least, most, word }, default, help)
    }

    /// Key of a number in a closed range.
    pub const fn number([least, most]: [f64; 2], default: &'static str, help: &'static str) -> Self {
        Self::new(Kind::Number { least, most }, default, help)
    }

    /// Key of one of several words.
    pub const fn choice(names: &'static [&'static str], default: &'static str, help: &'static str) -> Self {
        Self::new(Kind::Choice(names), default, help)
    }

    /// Shows the key in labels even at its default.
    pub const fn in_label(self) -> Self {
        Self { in_label: true, ..self }
    }

    /// Sets the condition under which the key has an effect.
    pub const fn when(self, when: When) -> Self {
        Self { when, ..self }
    }

    /// Sets the value during interaction.
    pub const fn coarse(self, coarse: &'static str) -> Self {
        Self { coarse: Some(coarse), ..self }
    }

    /// Sets the values that a search tries.
    pub const fn search(self, search_space: &'static [&'static str]) -> Self {
        Self { search_space, ..self }
    }

    /// Lets a search try every word of a choice.
    pub const fn search_all(self) -> Self {
        match self.kind {
            Kind::Choice(names) => self.search(names),
            _ => self,
        }
    }

    /// Values as help and errors show them: `1..512`, `0..1`, `nearest|bilinear`.
    pub fn values(&self) -> String {
        match self.kind {
            Kind::Whole { least, most } => format!("{least}..{most}"),
            Kind::WholeOr { least, most, word } => format!("{word}|{least}..{most}"),
            Kind::Number { least, most } => format!("{least}..{most}"),
            Kind::Choice(names) => names.join("|"),
        }
    }

    /// Parses a value of the key.
    pub fn parse(&self, text: &str) -> Option<Value> {
        match self.kind {
            Kind::WholeOr { word, .. } if text == word => Some(Value::Choice(word)),
            Kind::Whole { least, most } | Kind::WholeOr { least, most, .. } => {
                text.parse().ok().filter(|n| (least..=most).contains(n)).map(Value::Whole)
            }
            Kind::Number { least, most } => {
                // Negative zero becomes zero, so that equal values have one text.
                text.parse().ok().filter(|n| (least..=most).contains(n)).map(|n: f64| Value::Number(n + 0.0))
            }
            Kind::Choice(names) => names.iter().find(|name| **name == text).map(|name| Value::Choice(name)),
        }
    }

    /// Value of this key during interaction.
    pub fn coarser(&self, value: Value) -> Value {
        match (value, self.coarse.and_then(|coarse| self.parse(coarse))) {
            (value, None) => value,
            (Value::Number(value), Some(Value::Number(least))) => Value::Number(value.max(least)),
            (_, Some(coarse)) => coarse,
        }
    }
}

/// Whether a key has an effect under the values of the others.
pub(super) fn applies(keys: &[Key], values: &[Value], key: &Key) -> bool {
    let is =
        |other, wanted| keys.iter().zip(values).any(|(k, v)| k.name == other && *v == Value::Choice(wanted));
    match key.when {
        When::Always => true,
        When::Is(other, wanted) => is(other, wanted),
        When::Unless(other, wanted) => !is(other, wanted),
        When::UnlessEither(cases) => !cases.into_iter().any(|(other, wanted)| is(other, wanted)),
    }
}

/// A typed field of a method's settings.
pub(super) trait Field: Copy {
    /// Field from the value of its key.
    fn from_value(value: Value) -> Option<Self>;
    /// Value of a key from its field.
    fn to_value(self, key: &Key) -> Option<Value>;
    /// Appends the value to those of the keys before; the default where code has set a value that the key does not allow.
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

/// A number, or none where a word leaves it to the scene.
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

/// Declares an enum whose variants are the words of a key.
macro_rules! choices {
    ($(#[$meta:meta])* $vis:vis enum $name:ident { $($(#[$doc:meta])* $variant:ident = $text:literal,)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        $vis enum $name { $($(#[$doc])* $variant,)* }

        impl $name {
            /// Words, in the order of the variants.
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
