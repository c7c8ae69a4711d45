//! Settings of methods as typed records. What a key is called, may be, is by default and does stands once, in the
//! method's own file; parsing, refusals, `--help`, `params`, table columns, the window's controls, shader tests and
//! default rows all read it from there.

use super::spec::Setting;
use crate::error::{Error, Result};
use crate::field::{MapShape, March};
use std::fmt;

/// What values a key takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A whole number.
    Whole {
        /// The smallest.
        least: u32,
        /// The largest.
        most: u32,
    },
    /// A whole number, or a word for one that a scene chooses.
    WholeOr {
        /// The smallest.
        least: u32,
        /// The largest.
        most: u32,
        /// The word.
        word: &'static str,
    },
    /// Any number.
    Number {
        /// The smallest.
        least: f64,
        /// The largest.
        most: f64,
    },
    /// One of these words (or numbers).
    Choice(&'static [&'static str]),
}

/// The value of a key.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// Of [`Kind::Whole`] and [`Kind::WholeOr`].
    Whole(u32),
    /// Of [`Kind::Number`].
    Number(f64),
    /// Of [`Kind::Choice`], and the word of [`Kind::WholeOr`].
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

/// Under which value of another key a key has an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum When {
    /// Whatever the others are.
    Always,
    /// Only under this value of that key; given elsewhere it is a slip, and refused.
    Is(&'static str, &'static str),
    /// Everywhere but under this value of that key, where it is passed over.
    Unless(&'static str, &'static str),
    /// The same of either of two.
    UnlessEither([(&'static str, &'static str); 2]),
}

/// A setting of a method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// As it is written: `epsilon`.
    pub name: &'static str,
    /// What it may be.
    pub kind: Kind,
    /// As it would be written.
    pub default: &'static str,
    /// One line.
    pub help: &'static str,
    /// Stands in `params` also where it is the default.
    pub telling: bool,
    /// Where it has an effect.
    pub when: When,
    /// While a hand moves: a number is no smaller than this, anything else is this.
    pub coarse: Option<&'static str>,
}

impl Key {
    const fn new(kind: Kind, default: &'static str, help: &'static str) -> Self {
        Self { name: "", kind, default, help, telling: false, when: When::Always, coarse: None }
    }

    /// A whole number between two, these included.
    pub const fn whole([least, most]: [u32; 2], default: &'static str, help: &'static str) -> Self {
        Self::new(Kind::Whole { least, most }, default, help)
    }

    /// The same, or a word.
    pub const fn whole_or(
        [least, most]: [u32; 2],
        word: &'static str,
        default: &'static str,
        help: &'static str,
    ) -> Self {
        Self::new(Kind::WholeOr { least, most, word }, default, help)
    }

    /// A number between two, these included.
    pub const fn number([least, most]: [f64; 2], default: &'static str, help: &'static str) -> Self {
        Self::new(Kind::Number { least, most }, default, help)
    }

    /// One of some words.
    pub const fn choice(names: &'static [&'static str], default: &'static str, help: &'static str) -> Self {
        Self::new(Kind::Choice(names), default, help)
    }

    /// The same, always in `params`.
    pub const fn telling(self) -> Self {
        Self { telling: true, ..self }
    }

    /// The same, with an effect only there.
    pub const fn when(self, when: When) -> Self {
        Self { when, ..self }
    }

    /// The same, and this while a hand moves.
    pub const fn coarse(self, coarse: &'static str) -> Self {
        Self { coarse: Some(coarse), ..self }
    }

    /// The values as help and refusals say them: `1..512`, `0..1`, `nearest|bilinear`.
    pub fn values(&self) -> String {
        match self.kind {
            Kind::Whole { least, most } => format!("{least}..{most}"),
            Kind::WholeOr { least, most, word } => format!("{word}|{least}..{most}"),
            Kind::Number { least, most } => format!("{least}..{most}"),
            Kind::Choice(names) => names.join("|"),
        }
    }

    /// The value that a text says, where it is one of the key's.
    pub fn parse(&self, text: &str) -> Option<Value> {
        match self.kind {
            Kind::WholeOr { word, .. } if text == word => Some(Value::Choice(word)),
            Kind::Whole { least, most } | Kind::WholeOr { least, most, .. } => {
                text.parse().ok().filter(|n| (least..=most).contains(n)).map(Value::Whole)
            }
            Kind::Number { least, most } => {
                text.parse().ok().filter(|n| (least..=most).contains(n)).map(Value::Number)
            }
            Kind::Choice(names) => names.iter().find(|name| **name == text).map(|name| Value::Choice(name)),
        }
    }

    /// What a value of this key becomes while a hand moves.
    pub fn coarser(&self, value: Value) -> Value {
        match (value, self.coarse.and_then(|coarse| self.parse(coarse))) {
            (value, None) => value,
            (Value::Number(value), Some(Value::Number(least))) => Value::Number(value.max(least)),
            (_, Some(coarse)) => coarse,
        }
    }
}

/// The values of a method's keys, in their order: the given ones, and defaults.
///
/// # Errors
/// An unknown key, a value out of range, or one without effect, naming it and what there is.
pub(super) fn read(name: &str, keys: &[Key], setting: &Setting) -> Result<Vec<Value>> {
    let place = |key: &str| format!("{name}:{key}");
    for (key, _) in &setting.params {
        if !keys.iter().any(|k| k.name == key) {
            let names = keys.iter().map(|k| k.name).collect::<Vec<_>>().join(", ");
            let why =
                if names.is_empty() { "the method has no keys".into() } else { format!("there is: {names}") };
            return Err(Error::input("unknown key", place(key), why));
        }
    }
    let given = |key: &Key| setting.params.iter().find(|(k, _)| k == key.name).map(|(_, value)| value);
    let value = |key: &Key| {
        let text = given(key).map_or(key.default, String::as_str);
        let refused = || {
            Error::input(
                "bad value",
                place(&format!("{}={text}", key.name)),
                format!("expected {}", key.values()),
            )
        };
        key.parse(text).ok_or_else(refused)
    };
    let values = keys.iter().map(value).collect::<Result<Vec<_>>>()?;
    for key in keys {
        if let (When::Is(other, wanted), Some(_)) = (key.when, given(key))
            && !applies(keys, &values, key)
        {
            let why = format!("it is of {other}={wanted} only");
            return Err(Error::input("bad value", place(key.name), why));
        }
    }
    Ok(values)
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
    /// The field that a key's value stands for.
    fn from_value(value: Value) -> Option<Self>;
    /// The value under a key.
    fn to_value(self, key: &Key) -> Option<Value>;
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
            /// As they are written, in the order of the variants.
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

/// Declares the settings of a method: a public struct, and its keys, which are named like the fields.
macro_rules! settings {
    ($(#[$meta:meta])* $vis:vis struct $name:ident { $($(#[$doc:meta])* $field:ident: $ty:ty = $key:expr,)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        $vis struct $name { $($(#[$doc])* pub $field: $ty,)* }

        impl $name {
            /// What can be set, in the order of the fields.
            pub const KEYS: &'static [$crate::shadow::Key] =
                &[$($crate::shadow::Key { name: stringify!($field), ..$key }),*];

            /// From the values of [`Self::KEYS`].
            fn from_values(values: &[$crate::shadow::Value]) -> Option<Self> {
                let mut values = values.iter().copied();
                Some(Self { $($field: $crate::shadow::settings::Field::from_value(values.next()?)?,)* })
            }

            /// Values of [`Self::KEYS`].
            fn to_values(self) -> Vec<$crate::shadow::Value> {
                let mut keys = Self::KEYS.iter();
                let values = [$(keys.next().and_then(|k| $crate::shadow::settings::Field::to_value(self.$field, k))),*];
                // A field that code has set to what no key allows shows as the default.
                let or_default = |(k, v): (&$crate::shadow::Key, Option<_>)| v.or_else(|| k.parse(k.default));
                Self::KEYS.iter().zip(values).filter_map(or_default).collect()
            }
        }

        impl Default for $name {
            fn default() -> Self {
                let values: Vec<_> = Self::KEYS.iter().filter_map(|k| k.parse(k.default)).collect();
                Self::from_values(&values).expect("defaults are values of their keys: a test reads them all")
            }
        }
    };
}

pub(super) use {choices, settings};

choices! {
    /// How light rays are marched.
    pub enum MarchBy {
        /// Cell by cell, every one exactly.
        Cells = "cells",
        /// By regular samples.
        Samples = "samples",
    }
}

impl MarchBy {
    /// With the distance of samples, in smallest voxel spacings.
    pub fn with_step(self, step: f64) -> March {
        match self {
            Self::Cells => March::Cells,
            Self::Samples => March::Samples { step },
        }
    }
}

choices! {
    /// What casts the shadows of a map.
    pub enum DrawnFrom {
        /// The volume.
        Voxels = "voxels",
        /// The strands that it was made from, every segment.
        Lines = "lines",
    }
}

impl DrawnFrom {
    /// How light rays are marched, with the distance of samples in smallest voxel spacings.
    pub fn march(self, march: MarchBy, step: f64) -> March {
        match self {
            Self::Voxels => march.with_step(step),
            Self::Lines => March::Lines,
        }
    }
}

/// Name of the key for what is marched through.
const FROM: &str = "from";
/// Where a key has no effect since nothing is marched through.
pub(super) const UNLESS_LINES: When = When::Unless(FROM, "lines");
/// Key of methods that have a map.
pub(super) const FROM_KEY: Key = Key::choice(
    DrawnFrom::NAMES,
    "voxels",
    "what casts shadows: the volume, or the strands that it was made from, drawn into the map",
);

/// Name of the key for texels a side.
pub(super) const MAP: &str = "map";
/// Key of methods that have a map.
pub(super) const MAP_KEY: Key = Key::whole_or(
    [1, 8192],
    "auto",
    "auto",
    "texels a side; auto: about a voxel each, finer where zoomed in",
);

choices! {
    /// What a map is fitted across.
    pub enum Fit {
        /// What of the active bricks the camera sees.
        View = "view",
        /// All of them.
        Volume = "volume",
    }
}

impl Fit {
    /// A map with so many texels a side (`None`: by the scene), marched so.
    pub fn shape(self, texels: Option<u32>, march: March) -> MapShape {
        MapShape { texels, fits_view: self == Self::View, reach: 1, march }
    }
}

/// Key of methods that have a map.
pub(super) const FIT_KEY: Key = Key::choice(
    Fit::NAMES,
    "view",
    "texels across what the picture shows, or across all that has extinction",
);

choices! {
    /// How the four texels around a point are used.
    pub enum Filter {
        /// The nearest one.
        Nearest = "nearest",
        /// All of them, by how near they are.
        Bilinear = "bilinear",
    }
}

choices! {
    /// How samples of an eye ray ask for light.
    pub enum Lookups {
        /// Up to four neighbours share a lookup.
        Shared = "shared",
        /// Each has its own.
        Each = "each",
    }
}

/// Name of the key for how light rays are marched.
pub(super) const MARCH: &str = "march";
/// Key of methods that have a map.
pub(super) const MARCH_KEY: Key =
    Key::choice(MarchBy::NAMES, "cells", "light rays cell by cell, exactly, or by regular samples")
        .coarse("samples")
        .when(UNLESS_LINES);
/// Key of methods that have a map.
pub(super) const STEP_KEY: Key = Key::number(
    [0.01, 8.0],
    "0.5",
    "distance of samples along light rays, in smallest spacings (march=samples)",
)
.when(When::Is(MARCH, "samples"));

/// Key of every method that is looked up.
pub(super) const LOOKUP_KEY: Key = Key::choice(
    Lookups::NAMES,
    "shared",
    "lookups of light by eye samples: shared by up to four, or one for each",
);

/// Key of methods whose maps are filtered.
pub(super) const FILTER_KEY: Key = Key::choice(Filter::NAMES, "bilinear", "texels used for a point");
