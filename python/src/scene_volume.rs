//! Volume of a scene from the arguments of `Scene`: an array with its place, and errors for arguments that contradict it.

use crate::fault::{Fault, Outcome};
use crate::volume::{InputVolume, PyVolume};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

/// Creates a volume from a NumPy array, with `spacing` and `labels` from the arguments.
pub fn of_array(
    py: Python<'_>,
    array: &Bound<'_, PyAny>,
    affine: Option<&Bound<'_, PyAny>>,
    axes: Option<&str>,
    arguments: &Bound<'_, PyDict>,
) -> Outcome<InputVolume> {
    let own = PyDict::new(py);
    for (name, given) in
        [("affine", affine.cloned()), ("axes", axes.map(|a| PyString::new(py, a).into_any()))]
    {
        if let Some(given) = given {
            own.set_item(name, given)?;
        }
    }
    for name in ["spacing", "labels", "name"] {
        if let Some(given) = arguments.get_item(name)? {
            own.set_item(name, given)?;
            // `name` also names the scene.
            if name != "name" {
                arguments.del_item(name)?;
            }
        }
    }
    let made = py.get_type::<PyVolume>().call((array,), Some(&own))?;
    let made = made.cast::<PyVolume>().map_err(PyErr::from)?;
    Ok(made.get().input.clone())
}

/// Error for a place of the volume that is given with a file or a `Volume`, which have their own.
pub fn unnamed(affine: Option<&Bound<'_, PyAny>>) -> Fault {
    let name = if affine.is_some() { "affine" } else { "axes" };
    Fault::input("bad argument", name, "it belongs to arrays: files and volumes have their own")
}

/// Error for reading arguments in a call to a scene that has its volume.
pub fn another_volume() -> Fault {
    let why = "the volume is there already: arguments about reading a file belong to `read`, or to a scene of that file";
    Fault::input("bad argument", "volume", why)
}
