//! Python class `Volume`: volumes from NumPy arrays and from files.

use crate::arguments::{Request, text};
use crate::fault::{Fault, Outcome};
use crate::interrupts::interruptible;
use crate::points::aligned_array;
use glam::{DAffine3, DMat3, DVec3};
use ndarray::Array3;
use numpy::{IntoPyArray, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::PathBuf;
use std::sync::Arc;
use umbravox::error::Error;
use umbravox::files::loading::Loading;
use umbravox::files::memory_budget::check_grid;
use umbravox::formats::write_volume;
use umbravox::open::{Diagnostic, Level, Read, SceneSettings, VolumeSpec, load};
use umbravox::strands::VoxelisedStrands;
use umbravox::volume::{AffineSource, Labels, Provenance, Scaling, Volume, Voxel, Voxels};
use umbravox::with_voxels;

const WHAT: &str = "cannot use volume";
/// Largest magnitude up to which a 64-bit float represents every integer.
const MAX_EXACT_INTEGER: f64 = (1_u64 << f64::MANTISSA_DIGITS) as f64;

/// Volume in memory, with the settings with which it was read from a file (none for an array).
#[derive(Clone)]
pub struct InputVolume {
    pub volume: Arc<Volume>,
    pub strands: Option<Arc<VoxelisedStrands>>,
    /// Settings with which the volume was read from a file; `None` for an array.
    pub read_by: Option<SceneSettings>,
    pub diagnostics: Vec<Diagnostic>,
    /// Whether the segmentation labels were given separately from the volume's file.
    pub has_own_labels: bool,
}

impl InputVolume {
    /// Whether the volume and its labels come from files, so that a scene file can name them.
    pub fn is_of_files(&self) -> bool {
        self.read_by.is_some() && !self.has_own_labels
    }

    /// Adds the labels of a segmentation, resampled to the volume: a file or an image with a place of its own, or an array
    /// of the grid of the volume.
    pub fn labelled(self, labels: &Bound<'_, PyAny>, axes: &str) -> Outcome<Self> {
        let py = labels.py();
        let (file, stored) = match text(labels)? {
            Some(file) => (Some(file), None),
            None => {
                let (array, affine) = of_image(labels, "labels")?;
                let affine = affine.map(|affine| affine_of(&affine, "labels")).transpose()?;
                let axes = if affine.is_some() { "ijk" } else { axes };
                (None, Some((self::stored(&array, axes, "labels")?, affine)))
            }
        };
        let is_array = file.is_none();
        let Self { volume, strands, read_by, diagnostics, .. } = self;
        let volume = interruptible(
            py,
            || (),
            move |_| {
                let segmentation = match (file, stored) {
                    (Some(file), _) => load(&VolumeSpec::new(file))?,
                    (None, Some(((voxels, kind, _), affine))) => {
                        let about = Provenance::new("labels", "array", kind);
                        let place = affine.unwrap_or_else(|| volume.world_from_index());
                        let segmentation = Volume::new(voxels, Scaling::IDENTITY, place, about)?;
                        if affine.is_none() && segmentation.dims() != volume.dims() {
                            let [theirs, ours] = [segmentation.dims(), volume.dims()];
                            let why = format!("their shape is {theirs:?}, and the volume's {ours:?}");
                            return Err(Error::input("cannot use labels", "labels", why));
                        }
                        segmentation
                    }
                    (None, None) => return Ok(volume),
                };
                let labels = Labels::sampled(&segmentation, &volume)?;
                Arc::unwrap_or_clone(volume).labelled(Arc::new(labels)).map(Arc::new)
            },
        )?;
        let has_own_labels = is_array || read_by.is_some();
        Ok(Self { volume, strands, read_by, diagnostics, has_own_labels })
    }
}

/// Volume: a scalar field on a regular grid, with an affine to world millimetres (RAS+).
///
/// `voxels` has the axes i, j, k, as nibabel's arrays do; `axes="kji"` says that the first axis is the slowest, as in
/// SimpleITK's arrays. Integers of 32 and 64 bits become float64; NaN and infinities the smallest finite value, with a
/// warning. Images of nibabel, SimpleITK, ITK, VTK and PyVista, arrays of xarray, layers of napari and Zarr groups of
/// OME-Zarr images bring their affine along. `labels` is a segmentation: an array of the same grid, or an image or a file
/// of any.
///
/// >>> volume = umbravox.Volume(array, affine, name="chest")
/// >>> picture = umbravox.render(volume, units="hu", tf="bone")
#[pyclass(frozen, module = "umbravox", name = "Volume")]
pub struct PyVolume {
    pub input: InputVolume,
}

#[pymethods]
impl PyVolume {
    #[new]
    #[pyo3(signature = (voxels, affine=None, *, spacing=None, labels=None, axes=None, name=None))]
    fn new(
        voxels: &Bound<'_, PyAny>,
        affine: Option<&Bound<'_, PyAny>>,
        spacing: Option<&Bound<'_, PyAny>>,
        labels: Option<&Bound<'_, PyAny>>,
        axes: Option<&str>,
        name: Option<&str>,
    ) -> Outcome<Self> {
        let (py, name) = (voxels.py(), name.unwrap_or("array"));
        let spacing = spacing.map(|given| spacing_of(given, name)).transpose()?;
        let (voxels, own) = of_image(voxels, name)?;
        if own.is_some() && axes.is_some() {
            return Err(Fault::input(WHAT, name, "`axes` is about arrays; an image says what its axes are"));
        }
        let axes = axes.unwrap_or("ijk");
        let affine = affine.or(own.as_ref().filter(|_| spacing.is_none()));
        let world_from_index = match (affine, spacing) {
            (Some(_), Some(_)) => {
                return Err(Fault::input(WHAT, name, "both an affine and a spacing are given"));
            }
            (Some(affine), None) => affine_of(affine, name)?,
            (None, spacing) => DAffine3::from_scale(DVec3::from_array(spacing.unwrap_or([1.0; 3]))),
        };
        let source = if affine.is_some() { AffineSource::Axes } else { AffineSource::Spacing };
        let (stored, stored_type, warning) = stored(&voxels, axes, name)?;
        let mut provenance = Provenance::new(name, "array", stored_type);
        provenance.affine_source = source;
        provenance.warnings.extend(warning);
        let volume = interruptible(
            py,
            || (),
            |_| Volume::new(stored, Scaling::IDENTITY, world_from_index, provenance),
        )?;
        let warnings = volume.provenance.warnings.iter();
        let mut diagnostics: Vec<_> = warnings.cloned().map(Diagnostic::warning).collect();
        if affine.is_none() && spacing.is_none() {
            let text = "no affine and no spacing given: voxels taken as 1 mm";
            diagnostics.push(Diagnostic::note(text.into()));
        }
        warn(py, &diagnostics)?;
        let has_own_labels = false;
        let input = InputVolume {
            volume: Arc::new(volume),
            strands: None,
            read_by: None,
            diagnostics,
            has_own_labels,
        };
        let input =
            labels.map_or_else(|| Ok(input.clone()), |labels| input.clone().labelled(labels, axes))?;
        Ok(Self { input })
    }

    /// Number of voxels along the axes i, j and k.
    #[getter]
    fn shape(&self) -> (usize, usize, usize) {
        self.input.volume.dims().into()
    }

    /// Affine transform from index coordinates to world mm (RAS+), 4 x 4.
    #[getter]
    fn affine<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let affine = self.input.volume.world_from_index();
        let row = |r: usize| {
            let m = affine.matrix3;
            [m.x_axis[r], m.y_axis[r], m.z_axis[r], affine.translation[r]]
        };
        let rows = ndarray::arr2(&[row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]);
        rows.into_pyarray(py).into_any()
    }

    /// Distance between voxel centres along i, j and k, mm.
    #[getter]
    fn spacing(&self) -> (f64, f64, f64) {
        self.input.volume.spacing_mm().into()
    }

    /// Smallest and largest value of the volume.
    #[getter]
    fn value_range(&self) -> (f64, f64) {
        self.input.volume.value_range().into()
    }

    /// Name of the volume: its file, or the name of the array.
    #[getter]
    fn name(&self) -> String {
        self.input.volume.provenance.source.clone()
    }

    /// Assumptions made while reading the volume, one line each.
    #[getter]
    fn notes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, self.input.diagnostics.iter().map(|d| &d.message))
    }

    /// Label numbers of the volume's segmentation; empty without a segmentation.
    #[getter]
    fn labels(&self) -> Vec<u32> {
        self.input.volume.labels().map_or_else(Vec::new, |labels| labels.ids().to_vec())
    }

    /// Returns a copy of the voxel values with axes i, j, k: in the stored type without scaling, else float64.
    fn voxels<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let volume = &self.input.volume;
        let scaling = volume.scaling();
        check_grid(volume.dims(), volume.element().memory_bytes())
            .map_err(|why| Error::runtime("cannot copy voxels", &volume.provenance.source, why))?;
        let block = volume.block(&volume.dims().map(|n| 0..n))?;
        let array = with_voxels!(block.voxels(), a => match scaling == Scaling::IDENTITY {
            true => a.clone().into_pyarray(py).into_any(),
            false => a.mapv(|v| scaling.apply(v.to_f64())).into_pyarray(py).into_any(),
        });
        Ok(array.getattr("T")?)
    }

    /// Returns the voxel values as a NumPy array.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if copy == Some(false) {
            let why = "the voxels of a Volume are copied";
            return Err(pyo3::exceptions::PyValueError::new_err(why));
        }
        let array = self.voxels(py)?;
        match dtype {
            Some(dtype) => array.call_method1("astype", (dtype,)),
            None => Ok(array),
        }
    }

    /// Writes the volume without labels, in the format of the file extension, like `umbravox convert`.
    fn save(&self, py: Python<'_>, path: PathBuf) -> Outcome<()> {
        interruptible(py, || (), |_| write_volume(&self.input.volume, &path))
    }

    fn __repr__(&self) -> String {
        let volume = &self.input.volume;
        let ([nx, ny, nz], [x, y, z]) = (volume.dims(), volume.spacing_mm());
        let about = &volume.provenance;
        format!(
            "<Volume {}, {nx} x {ny} x {nz} of {}, {x:.4} x {y:.4} x {z:.4} mm>",
            about.source, about.stored_type
        )
    }
}

/// Reads a volume from a file; arguments have the names of command-line flags.
///
/// >>> volume = umbravox.read("foot.raw", raw="256x256x256:u8", spacing=(1, 1, 1))
#[pyfunction]
#[pyo3(signature = (path, **arguments))]
pub fn read(
    py: Python<'_>,
    path: &Bound<'_, PyAny>,
    arguments: Option<&Bound<'_, PyDict>>,
) -> Outcome<PyVolume> {
    let all = PyDict::new(py);
    if let Some(arguments) = arguments {
        all.update(arguments.as_mapping())?;
    }
    all.set_item("volume", path)?;
    let Request { settings, function, .. } = Request::parse(Some(&all))?;
    let reads = reading(&settings);
    if settings != reads || function.is_some() {
        let why = "it takes arguments about reading a file, and labels; others belong to a scene";
        return Err(Fault::input("bad argument", "read", why));
    }
    let input = read_input(py, reads)?;
    warn(py, &input.diagnostics)?;
    Ok(PyVolume { input })
}

/// Returns the settings that concern the reading of a volume, out of all settings of a scene.
pub fn reading(settings: &SceneSettings) -> SceneSettings {
    let mut reads = SceneSettings {
        volume: settings.volume.clone(),
        read_flags: settings.read_flags.clone(),
        sha256: settings.sha256.clone(),
        ..SceneSettings::default()
    };
    reads.masking.labels = settings.masking.labels.clone();
    reads
}

/// Reads the volume file that is named in the scene settings.
pub fn read_input(py: Python<'_>, settings: SceneSettings) -> Outcome<InputVolume> {
    let loading = Loading::default();
    let mut diagnostics = Vec::new();
    let Read { volume, strands } =
        interruptible(py, || loading.cancel(), |_| settings.read_volume(&mut diagnostics, &loading))?;
    let (volume, read_by) = (Arc::new(volume), Some(settings));
    Ok(InputVolume { volume, strands, read_by, diagnostics, has_own_labels: false })
}

/// Issues a Python warning for each diagnostic message whose level is a warning.
pub fn warn(py: Python<'_>, diagnostics: &[Diagnostic]) -> PyResult<()> {
    for warning in diagnostics.iter().filter(|d| d.level == Level::Warning) {
        py.import("warnings")?.call_method1("warn", (&warning.message,))?;
    }
    Ok(())
}

/// Returns the array and the affine of an image of another package; other objects are returned unchanged, without
/// affine.
fn of_image<'py>(
    given: &Bound<'py, PyAny>,
    name: &str,
) -> Outcome<(Bound<'py, PyAny>, Option<Bound<'py, PyAny>>)> {
    let py = given.py();
    let objects = py.import("umbravox._objects")?;
    let found =
        objects.call_method1("array_and_affine", (given,)).map_err(|e| match e
            .is_instance_of::<pyo3::exceptions::PyValueError>(py)
        {
            true => Fault::input(WHAT, name, e.value(py).to_string()),
            false => Fault::Raised(e),
        })?;
    Ok(found.extract()?)
}

/// Converts a Python array with three axes to voxels; also returns its stored type, and a warning if values were
/// rounded.
fn stored(given: &Bound<'_, PyAny>, axes: &str, name: &str) -> Outcome<(Voxels, String, Option<String>)> {
    let refuse = |why: String| Fault::input(WHAT, name, why);
    let py = given.py();
    refuse_masked(given, name)?;
    let array = aligned_array(given, None);
    let array = array.map_err(|e| refuse(format!("it is no array: {}", e.value(py))))?;
    let untyped = array.cast::<PyUntypedArray>().map_err(PyErr::from)?;
    let dtype = untyped.dtype();
    let stored_type = dtype.str()?.to_string();
    if untyped.ndim() != 3 {
        return Err(refuse(format!("its shape is {:?}; a volume has three axes", untyped.shape())));
    }
    let array = match axes {
        "ijk" => array.getattr("T")?,
        "kji" => array.clone(),
        other => return Err(refuse(format!("its axes are `{other}`; expected ijk or kji"))),
    };
    let (kind, bytes): (String, usize) =
        (dtype.getattr("kind")?.extract()?, dtype.getattr("itemsize")?.extract()?);
    // Other types are converted to the next wider type, as in files.
    let to = match (kind.as_str(), bytes) {
        ("b", _) | ("u", 1) => "u1",
        ("i", 1 | 2) => "i2",
        ("u", 2) => "u2",
        ("f", 2 | 4) => "f4",
        ("u" | "i", 4 | 8) | ("f", _) => "f8",
        _ => return Err(refuse(format!("its values are {stored_type}, which is not a real number type"))),
    };
    let array = array.call_method1("astype", (to,))?;
    macro_rules! voxels {
        ($type:ty) => {
            Voxels::from(owned(array.extract::<PyReadonlyArray3<'_, $type>>()?))
        };
    }
    let voxels = match to {
        "u1" => voxels!(u8),
        "i2" => voxels!(i16),
        "u2" => voxels!(u16),
        "f4" => voxels!(f32),
        _ => voxels!(f64),
    };
    let inexact = matches!((&voxels, kind.as_str(), bytes), (Voxels::F64(a), "u" | "i", 8) if a.iter().any(|v| v.abs() >= MAX_EXACT_INTEGER));
    Ok((voxels, stored_type, inexact.then(|| "integers beyond 2^53 were rounded to 53 bits".into())))
}

/// Returns an error for a masked NumPy array, whose masked values are undefined.
pub fn refuse_masked(given: &Bound<'_, PyAny>, name: &str) -> Outcome<()> {
    let masked = given.py().import("numpy")?.getattr("ma")?.getattr("MaskedArray")?;
    match given.is_instance(&masked)? {
        true => Err(Fault::input(WHAT, name, "it is masked: array.filled(value) sets the masked values")),
        false => Ok(()),
    }
}

/// Reads a voxel spacing (mm) from a Python object: three numbers or a text.
fn spacing_of(given: &Bound<'_, PyAny>, name: &str) -> Outcome<[f64; 3]> {
    let refuse = || Fault::input(WHAT, name, "its spacing is not three lengths in mm");
    match text(given)? {
        Some(text) => {
            let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
            numbers.ok().and_then(|n| n.try_into().ok()).ok_or_else(refuse)
        }
        None => given.extract().map_err(|_| refuse()),
    }
}

/// Returns a copy of a NumPy array whose last axis varies fastest in memory.
fn owned<T: numpy::Element + Clone>(array: PyReadonlyArray3<'_, T>) -> Array3<T> {
    array.as_array().as_standard_layout().into_owned()
}

/// Reads an affine transform from a 4 x 4 matrix in a Python array.
fn affine_of(given: &Bound<'_, PyAny>, name: &str) -> Outcome<DAffine3> {
    let refuse = |why: &str| Fault::input(WHAT, name, why);
    let array = aligned_array(given, Some("f8")).map_err(|_| refuse("its affine is not a 4 x 4 matrix"))?;
    let matrix: PyReadonlyArray2<'_, f64> =
        array.extract().map_err(|_| refuse("its affine is not a 4 x 4 matrix"))?;
    let m = matrix.as_array();
    if m.dim() != (4, 4) || [m[[3, 0]], m[[3, 1]], m[[3, 2]], m[[3, 3]]] != [0.0, 0.0, 0.0, 1.0] {
        return Err(refuse("its affine is not a 4 x 4 matrix whose last row is 0 0 0 1"));
    }
    let column = |c: usize| DVec3::new(m[[0, c]], m[[1, c]], m[[2, c]]);
    Ok(DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3)))
}
