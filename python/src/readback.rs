//! Camera, settings and transfer function of a scene as Python objects, in the form of keyword arguments.

use crate::fault::{Fault, Outcome};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use toml::{Table, Value};
use umbravox::open::{ReadFlags, SceneSettings};
use umbravox::scene::Camera;
use umbravox::transfer::TransferFunction;

/// Returns a camera as keyword arguments: `eye`, `target`, `up`, `fov`, and a `zoom` of 1.
pub fn camera_as_arguments<'py>(py: Python<'py>, camera: &Camera) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (name, v) in [("eye", camera.eye), ("target", camera.target), ("up", camera.up)] {
        dict.set_item(name, (v.x, v.y, v.z))?;
    }
    dict.set_item("fov", camera.fov_deg)?;
    // The field of view includes the zoom.
    dict.set_item("zoom", 1.0)?;
    Ok(dict)
}

/// Returns scene settings as keyword arguments, without those about reading the volume. A transfer function that was
/// given as a dictionary is one again.
pub fn settings_as_arguments<'py>(
    py: Python<'py>,
    settings: SceneSettings,
    function: Option<&TransferFunction>,
) -> Outcome<Bound<'py, PyDict>> {
    let own = SceneSettings { volume: None, read_flags: ReadFlags::default(), sha256: None, ..settings };
    let table = Table::try_from(&own).map_err(|e| Fault::input("cannot return settings", "settings", e))?;
    let dict = PyDict::new(py);
    for (key, value) in &table {
        // A segmentation belongs to the volume.
        if key != "labels" {
            dict.set_item(key.replace('-', "_"), python_value(py, value)?)?;
        }
    }
    if let Some(function) = function {
        dict.set_item("tf", function_as_dict(py, function)?)?;
    }
    Ok(dict)
}

/// Returns a transfer function as a dictionary in the form of a transfer-function file.
pub fn function_as_dict<'py>(py: Python<'py>, tf: &TransferFunction) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (tf.to_json(),))
}

/// Converts a value of a scene file to Python.
fn python_value<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Boolean(on) => on.into_pyobject(py)?.to_owned().into_any(),
        Value::Integer(n) => n.into_pyobject(py)?.into_any(),
        Value::Float(x) => x.into_pyobject(py)?.into_any(),
        Value::Array(items) => {
            let items = items.iter().map(|item| python_value(py, item));
            PyList::new(py, items.collect::<PyResult<Vec<_>>>()?)?.into_any()
        }
        Value::String(text) => text.into_pyobject(py)?.into_any(),
        Value::Table(_) | Value::Datetime(_) => value.to_string().into_pyobject(py)?.into_any(),
    })
}
