//! Numbers out of JSON, with errors that name the key.

use serde_json::{Map, Value};

/// A JSON object.
pub type Object = Map<String, Value>;

/// The numbers of a key, where it is there.
///
/// # Errors
/// It is no array of numbers.
pub fn list(object: &Object, key: &str) -> Result<Option<Vec<f64>>, String> {
    let Some(value) = object.get(key) else { return Ok(None) };
    let numbers = value.as_array().map(|all| all.iter().map(Value::as_f64).collect::<Option<Vec<_>>>());
    numbers.flatten().map(Some).ok_or_else(|| format!("`{key}` is not an array of numbers"))
}

/// The number of a key, where it is there.
///
/// # Errors
/// It is no number.
pub fn one(object: &Object, key: &str) -> Result<Option<f64>, String> {
    let Some(value) = object.get(key).filter(|v| !v.is_null()) else { return Ok(None) };
    value.as_f64().map(Some).ok_or_else(|| format!("`{key}` is not a number"))
}

/// The same numbers in groups of `N`.
///
/// # Errors
/// They do not come out even.
pub fn groups<const N: usize>(numbers: &[f64], key: &str) -> Result<Vec<[f64; N]>, String> {
    let (groups, rest) = numbers.as_chunks::<N>();
    match rest.is_empty() {
        true => Ok(groups.to_vec()),
        false => Err(format!("`{key}` has {} numbers, which are no groups of {N}", numbers.len())),
    }
}

/// Whether a key is there and true, as a boolean or a number.
pub fn is_set(object: &Object, key: &str) -> bool {
    object.get(key).is_some_and(|v| v.as_bool().unwrap_or_else(|| v.as_f64().is_some_and(|x| x != 0.0)))
}

/// A length in mm that a key gives; 1 mm with a line that says so where there is none.
///
/// # Errors
/// It is not above 0.
pub fn unit_distance(object: &Object, key: &str, warnings: &mut Vec<String>) -> Result<f64, String> {
    match one(object, key)? {
        Some(mm) if mm > 0.0 && mm.is_finite() => Ok(mm),
        Some(mm) => Err(format!("`{key}` must be above 0, not {mm}")),
        None => {
            warnings.push(per_mm("the file"));
            Ok(1.0)
        }
    }
}

/// The line that says that opacities are taken to be per mm.
pub fn per_mm(who: &str) -> String {
    format!(
        "{who} does not say over what length its opacities are: 1 mm is assumed (--opacity-scale changes it)"
    )
}
