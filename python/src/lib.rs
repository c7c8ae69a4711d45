//! Python module `umbravox`: volumes, pictures, exact results and comparison tables for NumPy. It has no rendering
//! logic; arguments mean the same as the command-line flags of their names.

mod arguments;
mod comparing;
mod device;
mod fault;
mod interrupts;
mod points;
mod readback;
mod scene;
mod scene_volume;
mod state;
mod volume;

use numpy::{PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ffi::OsString;
use std::path::PathBuf;
use umbravox::files::picture::{Backdrop, write_picture_with};
use umbravox::open::SceneRequest;
use umbravox::open::presets::PRESETS;
use umbravox::shadow::{COMPARED, METHODS, MethodSpec};

#[pymodule]
mod _umbravox {
    #[pymodule_export]
    use super::scene::PyScene;
    #[pymodule_export]
    use super::volume::{PyVolume, read};
    #[pymodule_export]
    use super::{arguments_of_scenes, command, method_specs, methods, presets, write_picture};

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}

/// Runs a command line of the program `umbravox`, whose first argument is the program name. Prints its output and any
/// error, and returns the exit status.
#[pyfunction]
fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    let no_window = |_| {
        let why = "the Python package has no window";
        Err(umbravox::Error::input("cannot open the window", "view", why)
            .hint("`cargo install --path .` in the sources builds the program with its window"))
    };
    py.detach(|| umbravox::cli::main(arguments, no_window))
}

/// Names of the built-in transfer functions (presets), with descriptions.
#[pyfunction]
fn presets(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    PRESETS.iter().try_for_each(|preset| dict.set_item(preset.name, preset.about))?;
    Ok(dict)
}

/// Names of the shadow methods, with descriptions.
#[pyfunction]
fn methods(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    METHODS.iter().try_for_each(|method| dict.set_item(method.name, method.summary))?;
    Ok(dict)
}

/// Shadow methods of a table, one text for each row: every combination of settings, once.
#[pyfunction]
#[pyo3(signature = (methods=None))]
fn method_specs(methods: Option<&Bound<'_, PyAny>>) -> fault::Outcome<Vec<String>> {
    let list = comparing::texts(methods, "methods", ";")?;
    let specs = MethodSpec::parse_list(list.as_deref().unwrap_or(&COMPARED)).map_err(|e| e.at("methods"))?;
    let mut texts: Vec<String> = Vec::new();
    for text in specs.iter().map(ToString::to_string) {
        if !texts.contains(&text) {
            texts.push(text);
        }
    }
    Ok(texts)
}

/// Names of the keyword arguments with which a scene is made, with their help texts.
#[pyfunction(name = "arguments")]
fn arguments_of_scenes(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    for (key, help) in SceneRequest::keys() {
        if !arguments::COMMAND_LINE_ONLY.contains(&key.as_str()) {
            dict.set_item(key.replace('-', "_"), help)?;
        }
    }
    Ok(dict)
}

/// Writes a picture (height x width x 4, linear RGB and opacity) in the format of the file extension: .png, .exr or
/// .npy.
#[pyfunction]
#[pyo3(signature = (path, picture, *, transparent=false))]
fn write_picture(path: PathBuf, picture: &Bound<'_, PyAny>, transparent: bool) -> fault::Outcome<()> {
    let refuse = |why: String| fault::Fault::input("cannot write picture", "picture", why);
    let picture = points::aligned_array(picture, Some("f4")).map_err(|e| refuse(e.to_string()))?;
    let shape = picture.cast::<PyUntypedArray>().map_err(PyErr::from)?.shape().to_vec();
    if !matches!(shape[..], [_, _, 4]) {
        return Err(refuse(format!("its shape is {shape:?}; expected height x width x 4")));
    }
    let picture: PyReadonlyArray3<'_, f32> = picture.extract().map_err(|e: PyErr| refuse(e.to_string()))?;
    let backdrop = if transparent { Backdrop::LeftOut } else { Backdrop::Drawn };
    Ok(write_picture_with(&path, &picture.as_array().to_owned(), backdrop, &[])?)
}
