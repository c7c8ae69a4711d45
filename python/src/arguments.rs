//! Conversion of Python keyword arguments to scene settings. Each argument is parsed like the command-line flag of
//! the same name.

use crate::fault::{Fault, Outcome};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict, PyFloat, PyInt, PyString};
use toml::{Table, Value};
use umbravox::open::{Layer, RunFlags, SceneRequest, SceneSettings};
use umbravox::transfer::TransferFunction;

const WHAT: &str = "bad argument";

/// Names of command-line flags for text output, which Python calls do not accept as arguments.
pub const COMMAND_LINE_ONLY: [&str; 2] = ["explain", "json"];

/// Scene settings that a call from Python requests by keyword arguments.
#[derive(Clone, Default)]
pub struct Request {
    pub settings: SceneSettings,
    /// Choice of the graphics adapter, and the limit on its memory.
    pub run: RunFlags,
    /// Transfer function given as a dictionary in the argument `tf`, instead of a name.
    pub function: Option<TransferFunction>,
    /// Names of settings given as empty lists, which remove the scene's own values of these settings.
    pub cleared: Vec<String>,
}

impl Request {
    /// Reads scene settings from keyword arguments; arguments that are `None` count as absent.
    pub fn parse(arguments: Option<&Bound<'_, PyDict>>) -> Outcome<Self> {
        let (mut table, mut function, mut cleared) = (Table::new(), None, Vec::new());
        for (name, given) in arguments.into_iter().flatten() {
            let name: String = name.extract()?;
            let key = name.replace('_', "-");
            // `downsample=False` counts as absent.
            if given.is_none()
                || (key == "downsample" && given.cast::<PyBool>().is_ok_and(|on| !on.is_true()))
            {
                continue;
            }
            if COMMAND_LINE_ONLY.contains(&key.as_str()) {
                return Err(Fault::input(WHAT, name, "it belongs to the command line alone"));
            }
            if key == "tf" && given.cast::<PyDict>().is_ok() {
                function = Some(transfer_function(&given)?);
                continue;
            }
            match value(&name, &key, &given)? {
                Value::Array(items) if items.is_empty() => cleared.push(key),
                value => {
                    table.insert(key, value);
                }
            }
        }
        let SceneRequest { settings, run } = SceneRequest::from_table(&table).map_err(|mut e| {
            e.what = WHAT.into();
            (e.place, e.hint) = (e.place.replace('-', "_"), e.hint.map(|hint| as_names(&hint)));
            e
        })?;
        Ok(Self { settings, run, function, cleared })
    }

    /// Takes over the scene settings that a scene file contains.
    pub fn of_file(SceneRequest { settings, run }: SceneRequest) -> Self {
        Self { settings, run, ..Self::default() }
    }

    /// Combines two layers of scene settings: a value in `self` wins over one in `below`.
    pub fn over(&self, below: &Self) -> Outcome<Self> {
        let mut left = below.settings.clone();
        // A given `eye` replaces an earlier `view`, and a given `view` replaces earlier `eye`, `target` and `up`.
        left.view = left.view.filter(|_| self.settings.eye.is_none());
        if self.settings.view.is_some() {
            (left.eye, left.target, left.up) = (None, None, None);
        }
        if !self.cleared.is_empty() {
            let unwritable = |e: toml::ser::Error| Fault::input(WHAT, "settings", e);
            let mut table = Table::try_from(&left).map_err(unwritable)?;
            table.retain(|key, _| !self.cleared.iter().any(|cleared| cleared == key));
            left = SceneRequest::from_table(&table)?.settings;
        }
        let settings = self.settings.over(&left);
        let named = self.settings.tf.is_some();
        let function = self.function.clone().or_else(|| below.function.clone().filter(|_| !named));
        // A transfer function given as a dictionary wins over a name given earlier.
        let tf = settings.tf.clone().filter(|_| function.is_none());
        let run = self.run.over(&below.run);
        Ok(Self { settings: SceneSettings { tf, ..settings }, run, function, cleared: Vec::new() })
    }
}

/// Replaces command-line names of settings in the hint of an error message by the names of Python arguments.
fn as_names(hint: &str) -> String {
    match hint.strip_prefix("keys: ") {
        Some(keys) => {
            let names = keys.split(", ").filter(|key| !COMMAND_LINE_ONLY.contains(key));
            let names: Vec<String> = names.map(|key| key.replace('-', "_")).collect();
            format!("arguments: {}", names.join(", "))
        }
        None => hint.to_owned(),
    }
}

/// Reads a transfer function from a Python dictionary that has the structure of a transfer function file (JSON).
fn transfer_function(given: &Bound<'_, PyAny>) -> Outcome<TransferFunction> {
    let py = given.py();
    let options = PyDict::new(py);
    options.set_item("allow_nan", false)?;
    // Converts NumPy's numbers and arrays to Python's.
    options.set_item("default", py.import("operator")?.call_method1("methodcaller", ("tolist",))?)?;
    let json = py.import("json")?.call_method("dumps", (given,), Some(&options));
    let json: String = json.map_err(|e| Fault::input(WHAT, "tf", e.value(py)))?.extract()?;
    TransferFunction::from_json(&json).map_err(|why| Fault::input(WHAT, "tf", why))
}

/// Converts a Python object to a value of a scene file (TOML).
fn value(name: &str, key: &str, given: &Bound<'_, PyAny>) -> Outcome<Value> {
    if let Ok(on) = given.cast::<PyBool>() {
        let on = on.is_true();
        return Ok(if key == "downsample" && on { Value::String("auto".into()) } else { Value::Boolean(on) });
    }
    if let Some(text) = text(given)? {
        return Ok(Value::String(text));
    }
    if let Some(number) = number(given) {
        return Ok(number);
    }
    // A dictionary of transfer functions by labels.
    if let (true, Ok(functions)) = (key == "label-tf", given.cast::<PyDict>()) {
        let texts = functions.iter().map(|(labels, tf)| {
            let tf = text(&tf)?.ok_or_else(|| unusable(name, &tf))?;
            Ok(Value::String(format!("{}={tf}", joined(&element(name, &labels)?))))
        });
        return Ok(Value::Array(texts.collect::<Outcome<_>>()?));
    }
    let items: Vec<Bound<'_, PyAny>> = match given.try_iter() {
        Ok(items) => items.collect::<PyResult<_>>()?,
        Err(_) => return Err(unusable(name, given)),
    };
    let values = items.iter().map(|item| element(name, item)).collect::<Outcome<Vec<_>>>()?;
    match (key, &values[..]) {
        ("size", [Value::Integer(width), Value::Integer(height)]) => {
            Ok(Value::String(format!("{width}x{height}")))
        }
        ("light", [x, y, z]) if !values.iter().any(Value::is_str) => {
            Ok(Value::String(format!("{x},{y},{z}")))
        }
        _ => Ok(Value::Array(values)),
    }
}

/// Converts a TOML value of a scene file to plain text, for use inside a longer text.
fn joined(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// Converts an element of a Python list to a value of a scene file: a text, a number, or several numbers, such as
/// those of a clip plane.
fn element(name: &str, item: &Bound<'_, PyAny>) -> Outcome<Value> {
    if item.cast::<PyBool>().is_ok() {
        return Err(unusable(name, item));
    }
    if let Some(text) = text(item)? {
        return Ok(Value::String(text));
    }
    if let Some(number) = number(item) {
        return Ok(number);
    }
    let numbers = item.try_iter().map_err(|_| unusable(name, item))?;
    let mut texts = Vec::new();
    for one in numbers {
        let one = one?;
        let one = number(&one).ok_or_else(|| unusable(name, &one))?;
        texts.push(one.to_string());
    }
    Ok(Value::String(texts.join(",")))
}

/// Returns the text of a Python string or path; `None` for other objects.
pub fn text(given: &Bound<'_, PyAny>) -> Outcome<Option<String>> {
    if let Ok(text) = given.cast::<PyString>() {
        return Ok(Some(text.extract()?));
    }
    if given.cast::<PyBytes>().is_ok() {
        return Err(Fault::input(WHAT, "text", "expected a text, got bytes: os.fsdecode converts them"));
    }
    if given.hasattr("__fspath__")? {
        return Ok(Some(given.py().import("os")?.call_method1("fsdecode", (given,))?.extract()?));
    }
    Ok(None)
}

/// Converts a number of Python or NumPy to a value of a scene file; refuses arrays, even those of one element.
fn number(given: &Bound<'_, PyAny>) -> Option<Value> {
    if given.cast::<PyInt>().is_err() && given.cast::<PyFloat>().is_err() && given.try_iter().is_ok() {
        return None;
    }
    let whole = given.extract::<i64>().ok().map(Value::Integer);
    whole.or_else(|| given.extract::<f64>().ok().map(Value::Float))
}

fn unusable(name: &str, given: &Bound<'_, PyAny>) -> Fault {
    let kind = given.get_type().name().map_or_else(|_| "object".into(), |name| name.to_string());
    Fault::input(WHAT, name, format!("expected a text, a number or several of them, got {kind}"))
}
