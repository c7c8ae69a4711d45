//! Reads numbers from the JSON objects of transfer-function files, with errors that name the key.

use serde_json::{Map, Value};

/// JSON object of a transfer-function file.
pub type Object = Map<String, Value>;

/// Returns the array of numbers at a key of a JSON object; `None` if the key is missing.
///
/// # Errors
/// The value is no array of numbers.
pub fn list(object: &Object, key: &str) -> Result<Option<Vec<f64>>, String> {
    let Some(value) = object.get(key) else { return Ok(None) };
    let numbers = value.as_array().map(|all| all.iter().map(Value::as_f64).collect::<Option<Vec<_>>>());
    numbers.flatten().map(Some).ok_or_else(|| format!("`{key}` is not an array of numbers"))
}

/// Returns the number at a key of a JSON object; `None` if the key is missing.
///
/// # Errors
/// The value is no number.
pub fn number(object: &Object, key: &str) -> Result<Option<f64>, String> {
    let Some(value) = object.get(key).filter(|v| !v.is_null()) else { return Ok(None) };
    value.as_f64().map(Some).ok_or_else(|| format!("`{key}` is not a number"))
}

/// Splits a list of numbers from a transfer-function file into groups of `N`, such as a value with its opacity.
///
/// # Errors
/// The list's length is no multiple of `N`.
pub fn groups<const N: usize>(numbers: &[f64], key: &str) -> Result<Vec<[f64; N]>, String> {
    let (groups, rest) = numbers.as_chunks::<N>();
    match rest.is_empty() {
        true => Ok(groups.to_vec()),
        false => Err(format!("`{key}` has {} numbers, which are no groups of {N}", numbers.len())),
    }
}

/// Whether a key of a JSON object exists with a true value: `true` or a number other than 0.
pub fn is_set(object: &Object, key: &str) -> bool {
    object.get(key).is_some_and(|v| v.as_bool().unwrap_or_else(|| v.as_f64().is_some_and(|x| x != 0.0)))
}

/// Returns the length in mm at a key of a JSON object; `None` if the key is missing.
///
/// # Errors
/// The length is not above 0.
pub fn length_mm(object: &Object, key: &str) -> Result<Option<f64>, String> {
    match number(object, key)? {
        Some(mm) if !(mm > 0.0 && mm.is_finite()) => Err(format!("`{key}` must be above 0, not {mm}")),
        length => Ok(length),
    }
}
