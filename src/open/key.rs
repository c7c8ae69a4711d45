//! Deserializers of scene keys: strings, numbers and arrays of numbers are parsed like the value of a flag.

use super::values::{self, Background, Size};
use crate::formats::RawLayout;
use crate::render::DisabledOptimizations;
use crate::scene::{AxisView, LightSource};
use crate::shadow::MethodSpec;
use clap::ValueEnum;
use glam::DVec3;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use std::fmt::Display;
use std::str::FromStr;
use toml::Value;

macro_rules! keys {
    ($($name:ident: $get:ident of $parse:expr => $ty:ty;)*) => { $(
        pub fn $name<'de, D: Deserializer<'de>>(source: D) -> Result<Option<$ty>, D::Error> {
            $get(source, $parse)
        }
    )* };
}

keys! {
    sha256: one of values::sha256 => String;
    opacity_scale: one of values::opacity_scale => f64;
    shadow: one of values::shadow => MethodSpec;
    size: one of values::size => Size;
    point: one of values::point => DVec3;
    direction: one of values::direction => DVec3;
    view: one of values::view => AxisView;
    zoom: one of values::zoom => f64;
    fov_deg: one of values::fov_deg => f64;
    light: several of values::light => Vec<LightSource>;
    ambient: one of values::ambient => f64;
    background: one of values::background => Background;
    step: one of values::step => f64;
    disabled_optimizations: one of values::disabled_optimizations => DisabledOptimizations;
    raw_layout: one of values::raw_layout => RawLayout;
    spacing_mm: one of values::spacing_mm => [f64; 3];
    resolution: one of values::resolution => usize;
    thickness_mm: one of values::thickness_mm => f64;
}

pub fn text<'de, D: Deserializer<'de>, T: FromStr<Err: Display>>(source: D) -> Result<Option<T>, D::Error> {
    one(source, T::from_str)
}

pub fn texts<'de, D: Deserializer<'de>, T: FromStr<Err: Display>>(
    source: D,
) -> Result<Option<Vec<T>>, D::Error> {
    several(source, T::from_str)
}

pub fn choice<'de, D: Deserializer<'de>, T: ValueEnum>(source: D) -> Result<Option<T>, D::Error> {
    one(source, |text| {
        T::from_str(text, false).map_err(|_| {
            let names = T::value_variants().iter().filter_map(T::to_possible_value);
            format!(
                "it is not one of {}",
                names.map(|n| n.get_name().to_owned()).collect::<Vec<_>>().join(", ")
            )
        })
    })
}

pub fn switch<'de, D: Deserializer<'de>>(source: D) -> Result<bool, D::Error> {
    Value::deserialize(source)?.as_bool().ok_or_else(|| D::Error::custom("expected true or false"))
}

fn one<'de, D: Deserializer<'de>, T, E: Display>(
    source: D,
    parse: impl Fn(&str) -> Result<T, E>,
) -> Result<Option<T>, D::Error> {
    parsed(&Value::deserialize(source)?, &parse).map(Some).map_err(D::Error::custom)
}

/// A key that may be given several times takes a list of strings, too.
fn several<'de, D: Deserializer<'de>, T, E: Display>(
    source: D,
    parse: impl Fn(&str) -> Result<T, E>,
) -> Result<Option<Vec<T>>, D::Error> {
    let values = match Value::deserialize(source)? {
        Value::Array(items) if !items.is_empty() && items.iter().all(Value::is_str) => items,
        value => vec![value],
    };
    let values = values.iter().map(|value| parsed(value, &parse)).collect::<Result<_, _>>();
    values.map(Some).map_err(D::Error::custom)
}

fn parsed<T, E: Display>(value: &Value, parse: &impl Fn(&str) -> Result<T, E>) -> Result<T, String> {
    let text = text_of(value).ok_or("expected a string, a number or an array of numbers")?;
    parse(&text).map_err(|e| match e.to_string() {
        why if why.contains(&format!("`{text}`")) => why,
        why => format!("`{text}`: {why}"),
    })
}

/// Text of a value on the command line.
fn text_of(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Integer(n) => Some(n.to_string()),
        Value::Float(x) => Some(x.to_string()),
        Value::Array(items) => {
            let is_number = |item: &&Value| item.is_integer() || item.is_float();
            let texts: Vec<String> = items.iter().filter(is_number).filter_map(text_of).collect();
            (texts.len() == items.len()).then(|| texts.join(","))
        }
        _ => None,
    }
}
