//! Conversion of NumPy arrays to points in world mm, and of results for the points to arrays of the same shape.

use crate::fault::{Fault, Outcome};
use crate::interrupts::Cancellation;
use crate::volume::refuse_masked;
use glam::DVec3;
use numpy::{IntoPyArray, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use rayon::prelude::*;
use umbravox::error::{Error, Result};

/// Number of points or segments that are computed between two checks for Ctrl-C.
const POINTS_PER_CHECK: usize = 4096;

/// Converts a Python object to a NumPy array of aligned elements. Arrays that another process has sent may lie at any
/// byte.
pub fn aligned_array<'py>(given: &Bound<'py, PyAny>, dtype: Option<&str>) -> PyResult<Bound<'py, PyAny>> {
    given.py().import("numpy")?.call_method1("require", (given, dtype, ("ALIGNED", "ENSUREARRAY")))
}

/// Returns the points of a NumPy array whose last axis is x, y and z (world mm), and the shape of its other axes.
pub fn points_of(given: &Bound<'_, PyAny>, name: &str) -> Outcome<(Vec<DVec3>, Vec<usize>)> {
    let refuse =
        || Fault::input("bad argument", name, "expected points in world mm, the last axis of length 3");
    refuse_masked(given, name)?;
    let array = aligned_array(given, Some("f8")).map_err(|_| refuse())?;
    let array: PyReadonlyArrayDyn<'_, f64> = array.extract().map_err(|_| refuse())?;
    let points = array.as_array();
    if points.is_empty() && points.ndim() == 1 {
        return Ok((Vec::new(), vec![0]));
    }
    if points.shape().last() != Some(&3) {
        return Err(refuse());
    }
    // A single point gives an array of one number.
    let shape = if points.ndim() == 1 { vec![1] } else { points.shape()[..points.ndim() - 1].to_vec() };
    let points: Vec<DVec3> = points.rows().into_iter().map(|p| DVec3::new(p[0], p[1], p[2])).collect();
    if points.iter().any(|p| !p.is_finite()) {
        return Err(Fault::input("bad argument", name, "a point is not finite"));
    }
    Ok((points, shape))
}

/// Reshapes the results for points to the shape of the input array.
pub fn shaped<'py, T: numpy::Element>(
    py: Python<'py>,
    answers: Vec<T>,
    shape: Vec<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    answers.into_pyarray(py).call_method1("reshape", (shape,))
}

/// Computes results for points or segments in chunks. Ctrl-C can end the computation between two chunks.
pub fn in_pieces<Q: Sync>(
    request: &[Q],
    cancellation: &Cancellation,
    answer: impl Fn(&Q) -> f64 + Sync,
) -> Result<Vec<f64>> {
    let mut found = Vec::with_capacity(request.len());
    for piece in request.chunks(POINTS_PER_CHECK) {
        if !cancellation.goes_on() {
            return Err(Error::cancelled("exact answers"));
        }
        found.par_extend(piece.par_iter().map(&answer));
    }
    Ok(found)
}
