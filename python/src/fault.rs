//! Conversion of the library's errors to Python exceptions with the same texts.

use pyo3::prelude::*;
use umbravox::error::Fault as Cause;

/// Error of a function that Python calls: an error of the library, or an exception that Python has raised.
pub enum Fault {
    Library(umbravox::Error),
    Raised(PyErr),
}

/// Result type of Rust functions that Python calls.
pub type Outcome<T> = Result<T, Fault>;

impl Fault {
    /// Creates an error about invalid input from three texts: what failed, where, and why.
    pub fn input(what: &str, place: impl ToString, why: impl ToString) -> Self {
        Self::Library(umbravox::Error::input(what, place, why))
    }
}

impl From<umbravox::Error> for Fault {
    fn from(e: umbravox::Error) -> Self {
        Self::Library(e)
    }
}

impl From<PyErr> for Fault {
    fn from(e: PyErr) -> Self {
        Self::Raised(e)
    }
}

impl From<Fault> for PyErr {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Raised(e) => e,
            Fault::Library(e) => Python::attach(|py| exception(py, e).unwrap_or_else(|broken| broken)),
        }
    }
}

/// Converts an error of the library to a Python exception from `umbravox._errors`, whose exception classes can be
/// pickled.
fn exception(py: Python<'_>, e: umbravox::Error) -> PyResult<PyErr> {
    let name = match e.fault {
        Cause::Input => "InputError",
        Cause::Runtime | Cause::Cancelled => "RunError",
    };
    let class = py.import("umbravox._errors")?.getattr(name)?;
    Ok(PyErr::from_value(class.call1((e.what, e.place, e.why, e.hint))?))
}
