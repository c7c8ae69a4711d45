//! Python class `Scene`: a volume, its settings, and the data that stay on the device between queries.

use crate::arguments::Asked;
use crate::attended::{attended, interruptible};
use crate::comparing::{self, Table};
use crate::device;
use crate::fault::{Fault, Outcome};
use crate::stage::Stage;
use crate::volume::{Held, PyVolume, read_held, reading, refuse_masked, tell};
use glam::DVec3;
use ndarray::{Array3, s};
use numpy::{IntoPyArray, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString};
use rayon::prelude::*;
use std::path::PathBuf;
use umbravox::engine::MapCoverage;
use umbravox::error::{Error, Result};
use umbravox::files::output::check_output;
use umbravox::files::picture::{Backdrop, PICTURE_EXTENSIONS, write_picture_with};
use umbravox::open::{SceneRequest, SceneSettings};

/// Rows of an exact picture between checks for an interrupt.
const EXACT_ROWS: u32 = 4;
/// Points, or segments, between checks for an interrupt.
const EXACT_POINTS: usize = 4096;

/// A volume with scene settings; every argument is named like the flag of the command line.
#[pyclass(frozen, module = "umbravox", name = "Scene")]
pub struct PyScene {
    base: Asked,
    stage: Stage,
}

#[pymethods]
impl PyScene {
    #[new]
    #[pyo3(signature = (volume=None, affine=None, *, axes=None, **arguments))]
    fn new(
        py: Python<'_>,
        volume: Option<&Bound<'_, PyAny>>,
        affine: Option<&Bound<'_, PyAny>>,
        axes: Option<&str>,
        arguments: Option<&Bound<'_, PyDict>>,
    ) -> Outcome<Self> {
        let arguments = arguments.map_or_else(|| Ok(PyDict::new(py)), |given| given.copy())?;
        let named =
            |v: &Bound<'_, PyAny>| Ok::<_, PyErr>(v.cast::<PyString>().is_ok() || v.hasattr("__fspath__")?);
        let held = match volume {
            Some(array) if !named(array)? && array.cast::<PyVolume>().is_err() => {
                Some(of_array(py, array, affine, axes, &arguments)?)
            }
            _ if affine.is_some() || axes.is_some() => return Err(unnamed(affine)),
            Some(given) => match given.cast::<PyVolume>() {
                Ok(volume) => Some(volume.get().held.clone()),
                Err(_) => {
                    arguments.set_item("volume", given)?;
                    None
                }
            },
            None => None,
        };
        // The flag `labels` takes no array.
        let labels = arguments.get_item("labels")?.filter(|labels| !labels.is_none());
        let labels = match labels {
            Some(labels) if !named(&labels)? || held.is_some() => {
                arguments.del_item("labels")?;
                Some(labels)
            }
            _ => None,
        };
        Self::begin(py, held, labels.as_ref(), Asked::of(Some(&arguments))?)
    }

    /// Scene of a file; arguments win.
    #[staticmethod]
    #[pyo3(signature = (path, **arguments))]
    fn read(py: Python<'_>, path: PathBuf, arguments: Option<&Bound<'_, PyDict>>) -> Outcome<Self> {
        let below = Asked::of_file(SceneRequest::read(&path)?);
        Self::begin(py, None, None, Asked::of(arguments)?.over(&below)?)
    }

    /// Volume.
    #[getter]
    fn volume(&self) -> PyVolume {
        PyVolume { held: self.stage.held.clone() }
    }

    /// Notes, one line each.
    #[getter]
    fn notes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, self.stage.notes())
    }

    /// Renders a picture, height x width x 4: linear RGB over the background, and opacity.
    #[pyo3(signature = (**arguments))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let asked = self.asked(arguments)?;
        let picture = self.done(py, |ending| self.stage.drawn(&asked, ending))?;
        Ok(picture.pixels.into_pyarray(py).into_any())
    }

    /// Draws a picture into a file as `umbravox render` does.
    #[pyo3(signature = (path, **arguments))]
    fn write(&self, py: Python<'_>, path: PathBuf, arguments: Option<&Bound<'_, PyDict>>) -> Outcome<()> {
        let asked = self.asked(arguments)?;
        check_output(&path, PICTURE_EXTENSIONS)?;
        self.done(py, |ending| {
            let picture = self.stage.drawn(&asked, ending)?;
            let settings = &asked.settings;
            let backdrop = if settings.is_transparent() { Backdrop::LeftOut } else { Backdrop::Drawn };
            write_picture_with(&path, &picture.pixels, backdrop, &self.stage.texts(&asked, ending)?)
        })
    }

    /// Renders the exact reference picture, which takes minutes at large sizes; `progress` receives its steps.
    #[pyo3(signature = (*, progress=None, **arguments))]
    fn exact_picture<'py>(
        &self,
        py: Python<'py>,
        progress: Option<&Bound<'py, PyAny>>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let asked = self.asked(arguments)?;
        let hear = comparing::listener(py, progress)?;
        let picture = attended(
            py,
            || (),
            |py, step| hear.hear(py, step),
            |ending, say| {
                let (looks, scene) = self.stage.exact(&asked, ending)?;
                let (field, height) = (looks.field(), scene.height);
                let mut picture = Array3::zeros((height as usize, scene.width as usize, 4));
                for row in (0..height).step_by(EXACT_ROWS as usize) {
                    let rows = row..(row + EXACT_ROWS).min(height);
                    if !ending.goes_on() {
                        return Err(Error::cancelled("exact picture"));
                    }
                    // There may be no listener.
                    let _ = say.send(comparing::Step::of(row as usize, height as usize, "exact picture"));
                    let part = field.picture_rows(&scene, rows.clone());
                    picture.slice_mut(s![rows.start as usize..rows.end as usize, .., ..]).assign(&part);
                }
                Ok(picture)
            },
        )?;
        self.tell(py)?;
        Ok(picture.into_pyarray(py).into_any())
    }

    /// Transmittance from the light to points, n x 3 in world mm, by the scene's method, another one, or `exact`.
    #[pyo3(signature = (points, method=None, **arguments))]
    fn transmittance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        method: Option<&str>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let mut asked = self.asked(arguments)?;
        asked.settings.one_light("transmittance")?;
        let (points, shape) = points_of(points, "points")?;
        if method == Some("exact") {
            let found = self.done(py, |ending| {
                let (looks, scene) = self.stage.exact(&asked, ending)?;
                let (field, light) = (looks.field(), scene.light());
                in_pieces(&points, ending, |p| field.transmittance_to_light(*p, &light))
            })?;
            return Ok(shaped(py, found, shape)?);
        }
        if let Some(method) = method {
            asked.settings.shadow = Some(method.parse()?);
        }
        let found = self.done(py, |ending| {
            self.stage.prepared(&asked, ending, MapCoverage::AnyPoint, |prepared, _, _| {
                let [map] = prepared.shadows[..] else { return Ok(vec![1.0; points.len()]) };
                prepared.renderer.query(prepared.loaded, prepared.transfer, map, &points)
            })
        })?;
        Ok(shaped(py, found, shape)?)
    }

    /// Exact optical depth of segments between points, each n x 3 in world mm.
    #[pyo3(signature = (starts, ends, **arguments))]
    fn optical_depth<'py>(
        &self,
        py: Python<'py>,
        starts: &Bound<'py, PyAny>,
        ends: &Bound<'py, PyAny>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let asked = self.asked(arguments)?;
        let ((starts, shape), (ends, _)) = (points_of(starts, "starts")?, points_of(ends, "ends")?);
        if starts.len() != ends.len() {
            let why = format!("{} starts and {} ends", starts.len(), ends.len());
            return Err(Fault::input("bad argument", "ends", why));
        }
        let segments: Vec<(DVec3, DVec3)> = starts.into_iter().zip(ends).collect();
        let found = self.done(py, |ending| {
            let (looks, _) = self.stage.exact(&asked, ending)?;
            let field = looks.field();
            in_pieces(&segments, ending, |(a, b)| field.optical_depth(*a, *b))
        })?;
        Ok(shaped(py, found, shape)?)
    }

    /// Rows of the error-against-time table, as dictionaries.
    #[pyo3(signature = (methods=None, *, output=None, repeats=None, points=None, rays=None, depths=None, check="sample",
        budget=None, overwrite=false, resume=false, progress=None, **arguments))]
    #[expect(clippy::too_many_arguments, reason = "each is a flag of the command")]
    fn compare<'py>(
        &self,
        py: Python<'py>,
        methods: Option<&Bound<'py, PyAny>>,
        output: Option<PathBuf>,
        repeats: Option<i64>,
        points: Option<i64>,
        rays: Option<i64>,
        depths: Option<i64>,
        check: &str,
        budget: Option<&Bound<'py, PyAny>>,
        overwrite: bool,
        resume: bool,
        progress: Option<&Bound<'py, PyAny>>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyList>> {
        let asked = self.asked(arguments)?;
        let effort = comparing::effort([repeats, points, rays, depths], check)?;
        let methods = comparing::texts(methods, "methods", ";")?;
        let budgets = comparing::texts(budget, "budget", ",")?;
        if overwrite && resume {
            return Err(Fault::input(
                "bad argument",
                "resume",
                "overwrite removes the rows that it continues",
            ));
        }
        if resume && output.is_none() {
            return Err(Fault::input("bad argument", "resume", "it needs output, the folder to resume in"));
        }
        let table = Table { methods, budgets, effort, output, overwrite, resume };
        let hear = comparing::listener(py, progress)?;
        let rows = attended(
            py,
            || (),
            |py, step| hear.hear(py, step),
            |ending, say| {
                let renderer = device::own(asked.adapter.as_deref())?;
                let wanted = self.stage.looked_at(&asked, ending, |loaded, scene| {
                    table.asked(loaded, &asked, scene, &self.stage.held)
                })?;
                table.measured(wanted, &renderer, ending, say)
            },
        )?;
        self.tell(py)?;
        rows.warn(py)?;
        self.stage.note(&rows.notes);
        rows.as_dicts(py)
    }

    /// Camera of the arguments, as arguments: `eye`, `target`, `up`, `fov`, and a `zoom` of 1.
    #[pyo3(signature = (**arguments))]
    fn camera<'py>(
        &self,
        py: Python<'py>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyDict>> {
        let asked = self.asked(arguments)?;
        let scene = self.done(py, |ending| self.stage.looked_at(&asked, ending, |_, scene| Ok(scene)))?;
        let camera = scene.camera;
        let dict = PyDict::new(py);
        for (name, v) in [("eye", camera.eye), ("target", camera.target), ("up", camera.up)] {
            dict.set_item(name, (v.x, v.y, v.z))?;
        }
        dict.set_item("fov", camera.fov_deg)?;
        // The field of view includes the zoom.
        dict.set_item("zoom", 1.0)?;
        Ok(dict)
    }

    /// Text of a scene file with the same settings, without defaults.
    #[pyo3(signature = (**arguments))]
    fn to_toml(&self, py: Python<'_>, arguments: Option<&Bound<'_, PyDict>>) -> Outcome<String> {
        let asked = self.asked(arguments)?;
        if !self.stage.held.is_of_files() || asked.function.is_some() {
            let why =
                "its volume or its transfer function is no file: save both, and make the scene of the files";
            return Err(Fault::input("cannot write scene", "to_toml", why));
        }
        self.done(py, |ending| self.stage.resolved(&asked, ending)?.to_toml())
    }

    /// Cost of the last picture: milliseconds, bytes, and skipped work.
    #[getter]
    fn last<'py>(&self, py: Python<'py>) -> Outcome<Option<Bound<'py, PyDict>>> {
        let Some(cost) = self.stage.last() else { return Ok(None) };
        let dict = PyDict::new(py);
        dict.set_item("adapter", cost.adapter)?;
        dict.set_item("clock", cost.clock)?;
        dict.set_item("table_ms", cost.work.table_ms)?;
        dict.set_item("classify_ms", cost.work.classify_ms)?;
        dict.set_item("build_ms", cost.work.build_ms)?;
        dict.set_item("frame_ms", cost.frame_ms)?;
        dict.set_item("bytes", cost.bytes)?;
        dict.set_item("left_out", cost.left_out)?;
        Ok(Some(dict))
    }

    fn __repr__(&self) -> String {
        let about = &self.stage.held.volume.provenance;
        let function = self.base.function.as_ref().map(|f| f.name.clone());
        let tf = function.or_else(|| self.base.settings.tf.clone()).unwrap_or_else(|| "default".into());
        format!("<Scene {}, tf {tf}>", about.source)
    }
}

impl PyScene {
    fn begin(
        py: Python<'_>,
        held: Option<Held>,
        labels: Option<&Bound<'_, PyAny>>,
        asked: Asked,
    ) -> Outcome<Self> {
        let nothing = SceneSettings::default();
        let held = match held {
            Some(held) => held,
            None => {
                // Other arguments are checked before a large file is read.
                asked.settings.functions(labels.is_some())?;
                let reads = reading(&asked.settings);
                let held = read_held(py, reads)?;
                tell(py, &held.diagnostics)?;
                held
            }
        };
        let held = labels.map_or_else(|| Ok(held.clone()), |labels| held.clone().labelled(labels, "ijk"))?;
        let reads = held.read_by.clone().unwrap_or_else(|| nothing.clone());
        let base = match asked.settings.reads_as(&nothing) {
            true => asked.over(&Asked { settings: reads, ..Asked::default() })?,
            false if held.read_by.as_ref().is_some_and(|by| asked.settings.reads_as(by)) => asked,
            false => return Err(another_volume()),
        };
        let scene = Self { base, stage: Stage::new(held) };
        // Contradicting arguments fail now, not with the first picture.
        scene.done(py, |ending| scene.stage.looked_at(&scene.base, ending, |_, _| Ok(())))?;
        scene.base.settings.method()?;
        Ok(scene)
    }

    /// Arguments over the settings of the scene.
    fn asked(&self, arguments: Option<&Bound<'_, PyDict>>) -> Outcome<Asked> {
        let asked = Asked::of(arguments)?.over(&self.base)?;
        if !asked.settings.reads_as(&self.base.settings) {
            return Err(another_volume());
        }
        if asked.adapter != self.base.adapter {
            return Err(Fault::input(
                "bad argument",
                "adapter",
                "the scene is on another: make a scene for each",
            ));
        }
        Ok(asked)
    }

    /// Runs work that Ctrl-C ends, and issues its warnings.
    fn done<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&crate::attended::Ending) -> Result<T> + Send,
    ) -> Outcome<T> {
        let done = interruptible(py, || (), work)?;
        self.tell(py)?;
        Ok(done)
    }

    fn tell(&self, py: Python<'_>) -> PyResult<()> {
        tell(py, &self.stage.take_untold())
    }
}

/// Volume of an array, with its `spacing` and `labels` from the arguments.
fn of_array(
    py: Python<'_>,
    array: &Bound<'_, PyAny>,
    affine: Option<&Bound<'_, PyAny>>,
    axes: Option<&str>,
    arguments: &Bound<'_, PyDict>,
) -> Outcome<Held> {
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
    Ok(made.get().held.clone())
}

fn unnamed(affine: Option<&Bound<'_, PyAny>>) -> Fault {
    let name = if affine.is_some() { "affine" } else { "axes" };
    Fault::input("bad argument", name, "it belongs to arrays: files and volumes have their own")
}

fn another_volume() -> Fault {
    let why = "the volume is there already: arguments about reading a file belong to `read`, or to a scene of that file";
    Fault::input("bad argument", "volume", why)
}

/// Points of an array whose last axis is x, y and z, and the shape of its other axes.
fn points_of(given: &Bound<'_, PyAny>, name: &str) -> Outcome<(Vec<DVec3>, Vec<usize>)> {
    let refuse =
        || Fault::input("bad argument", name, "expected points in world mm, the last axis of length 3");
    refuse_masked(given, name)?;
    let numpy = given.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (given, "f8")).map_err(|_| refuse())?;
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

/// Reshapes results to the shape of the input.
fn shaped<'py, T: numpy::Element>(
    py: Python<'py>,
    answers: Vec<T>,
    shape: Vec<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    answers.into_pyarray(py).call_method1("reshape", (shape,))
}

/// Computes results in chunks, between which an interrupt can end the work.
fn in_pieces<Q: Sync>(
    asked: &[Q],
    ending: &crate::attended::Ending,
    answer: impl Fn(&Q) -> f64 + Sync,
) -> Result<Vec<f64>> {
    let mut found = Vec::with_capacity(asked.len());
    for piece in asked.chunks(EXACT_POINTS) {
        if !ending.goes_on() {
            return Err(Error::cancelled("exact answers"));
        }
        found.par_extend(piece.par_iter().map(&answer));
    }
    Ok(found)
}
