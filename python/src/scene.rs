//! Python class `Scene`: a volume, its settings, and the GPU data that stay loaded between pictures and queries.

use crate::arguments::Request;
use crate::comparing::{self, Table};
use crate::device;
use crate::fault::{Fault, Outcome};
use crate::interrupts::{Cancellation, interruptible, run_reporting};
use crate::points::{in_pieces, points_of, shaped};
use crate::readback::{camera_as_arguments, function_as_dict, settings_as_arguments};
use crate::scene_volume::{another_volume, of_array, unnamed};
use crate::state::SceneState;
use crate::volume::{InputVolume, PyVolume, read_input, reading, warn};
use glam::DVec3;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList, PyString};
use std::path::PathBuf;
use umbravox::engine::MapCoverage;
use umbravox::error::Result;
use umbravox::files::output::check_output;
use umbravox::files::picture::{Backdrop, PICTURE_EXTENSIONS, picture_png, with_texts, write_picture_with};
use umbravox::measure::errors::mean_of_maps;
use umbravox::open::presets::default_as;
use umbravox::open::{SceneRequest, SceneSettings};
use umbravox::shadow::ShadowMap;

/// Volume with scene settings, for pictures and queries; every argument has the name of a command-line flag.
///
/// Methods take the same arguments, for that call alone. `None` counts as absent; an empty list removes the values of the
/// scene (`clip=[]`). Data on the device are reused: a new camera costs a picture, a new light its map. No result depends on
/// earlier calls.
///
/// >>> scene = umbravox.Scene("ct.nii.gz", tf="bone", light="dir:0,1,1", shadow="dsm:epsilon=0.01")
/// >>> picture = scene.render(size=(640, 480))
#[pyclass(frozen, module = "umbravox", name = "Scene")]
pub struct PyScene {
    base: Request,
    state: SceneState,
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
        let input = match volume {
            Some(array) if !named(array)? && array.cast::<PyVolume>().is_err() => {
                Some(of_array(py, array, affine, axes, &arguments)?)
            }
            _ if affine.is_some() || axes.is_some() => return Err(unnamed(affine)),
            Some(given) => match given.cast::<PyVolume>() {
                Ok(volume) => Some(volume.get().input.clone()),
                Err(_) => {
                    arguments.set_item("volume", given)?;
                    None
                }
            },
            None => None,
        };
        // `Request::parse` accepts no array as `labels`.
        let labels = arguments.get_item("labels")?.filter(|labels| !labels.is_none());
        let labels = match labels {
            Some(labels) if !named(&labels)? || input.is_some() => {
                arguments.del_item("labels")?;
                Some(labels)
            }
            _ => None,
        };
        Self::begin(py, input, labels.as_ref(), Request::parse(Some(&arguments))?)
    }

    /// Reads a scene from a TOML file; arguments replace its settings.
    ///
    /// >>> scene = umbravox.Scene.read("scene.toml", size=(640, 480))
    #[staticmethod]
    #[pyo3(signature = (path, **arguments))]
    fn read(py: Python<'_>, path: PathBuf, arguments: Option<&Bound<'_, PyDict>>) -> Outcome<Self> {
        let below = Request::of_file(SceneRequest::read(&path)?);
        Self::begin(py, None, None, Request::parse(arguments)?.over(&below)?)
    }

    /// Volume that the scene renders.
    #[getter]
    fn volume(&self) -> PyVolume {
        PyVolume { input: self.state.input.clone() }
    }

    /// Assumptions that the library made about the scene, such as the units of the volume, one line each.
    #[getter]
    fn notes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, self.state.notes())
    }

    /// Renders the scene to an array, height x width x 4: linear RGB over the background, and opacity.
    ///
    /// >>> picture = scene.render(view="front", shadow="rays")
    #[pyo3(signature = (**arguments))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let request = self.request(arguments)?;
        let picture = self.done(py, |cancellation| self.state.drawn(&request, cancellation))?;
        Ok(picture.pixels.into_pyarray(py).into_any())
    }

    /// Renders a picture to a file, like `umbravox render`.
    #[pyo3(signature = (path, **arguments))]
    fn write(&self, py: Python<'_>, path: PathBuf, arguments: Option<&Bound<'_, PyDict>>) -> Outcome<()> {
        let request = self.request(arguments)?;
        check_output(&path, PICTURE_EXTENSIONS)?;
        self.done(py, |cancellation| {
            let picture = self.state.drawn(&request, cancellation)?;
            let settings = &request.settings;
            let backdrop = if settings.is_transparent() { Backdrop::LeftOut } else { Backdrop::Drawn };
            write_picture_with(&path, &picture.pixels, backdrop, &self.state.texts(&request, cancellation)?)
        })
    }

    /// Picture of the scene as a PNG file, which notebooks show.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyBytes>> {
        self.png(py, None)
    }

    /// Renders a picture to the bytes of a PNG file, over the background.
    #[pyo3(signature = (**arguments))]
    fn png<'py>(
        &self,
        py: Python<'py>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyBytes>> {
        let request = self.request(arguments)?;
        let png = self.done(py, |cancellation| {
            let picture = self.state.drawn(&request, cancellation)?;
            with_texts(picture_png(&picture.pixels)?, &self.state.texts(&request, cancellation)?)
        })?;
        Ok(PyBytes::new(py, &png))
    }

    /// Renders the exact reference picture, which takes minutes at large sizes; `progress` is called with each step.
    #[pyo3(signature = (*, progress=None, **arguments))]
    fn exact_picture<'py>(
        &self,
        py: Python<'py>,
        progress: Option<&Bound<'py, PyAny>>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let request = self.request(arguments)?;
        let listener = comparing::progress_listener(py, progress)?;
        let picture = run_reporting(
            py,
            || (),
            |py, step| listener.report(py, step),
            |cancellation, sender| {
                let (inputs, scene) = self.state.exact(&request, cancellation)?;
                // The send fails if nobody listens to the progress.
                let report = |row, rows| drop(sender.send(comparing::Step::of(row, rows, "exact picture")));
                inputs.picture(&scene, cancellation, report)
            },
        )?;
        self.warn(py)?;
        Ok(picture.into_pyarray(py).into_any())
    }

    /// Returns the transmittance from the light to points, n x 3 in world mm, by the scene's shadow method, another
    /// one, or `exact`.
    #[pyo3(signature = (points, method=None, **arguments))]
    fn transmittance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        method: Option<&str>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let mut request = self.request(arguments)?;
        request.settings.one_light("transmittance")?;
        let (points, shape) = points_of(points, "points")?;
        if method == Some("exact") {
            let found = self.done(py, |cancellation| {
                let (inputs, scene) = self.state.exact(&request, cancellation)?;
                let (field, source) = (inputs.field(), scene.lights.first().cloned().unwrap_or_default());
                let found =
                    in_pieces(&points, cancellation, |p| field.transmittance_from(*p, &source).value)?;
                field.volume().check_reads()?;
                Ok(found)
            })?;
            return Ok(shaped(py, found, shape)?);
        }
        if let Some(method) = method {
            request.settings.shadow = Some(method.parse()?);
        }
        let found = self.done(py, |cancellation| {
            self.state.prepared(&request, cancellation, MapCoverage::AnyPoint, |prepared, _, _| {
                let query = |map: &ShadowMap, points: &[DVec3]| {
                    prepared.renderer.query(prepared.loaded, prepared.transfer, map, points)
                };
                let found = mean_of_maps(&prepared.shadows, &points, query)?;
                Ok(found.into_iter().map(|t| t as f32).collect())
            })
        })?;
        Ok(shaped(py, found, shape)?)
    }

    /// Returns the exact optical depth of segments between points, each n x 3 in world mm.
    #[pyo3(signature = (starts, ends, **arguments))]
    fn optical_depth<'py>(
        &self,
        py: Python<'py>,
        starts: &Bound<'py, PyAny>,
        ends: &Bound<'py, PyAny>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let request = self.request(arguments)?;
        let ((starts, shape), (ends, _)) = (points_of(starts, "starts")?, points_of(ends, "ends")?);
        if starts.len() != ends.len() {
            let why = format!("{} starts and {} ends", starts.len(), ends.len());
            return Err(Fault::input("bad argument", "ends", why));
        }
        let segments: Vec<(DVec3, DVec3)> = starts.into_iter().zip(ends).collect();
        let found = self.done(py, |cancellation| {
            let (inputs, _) = self.state.exact(&request, cancellation)?;
            let field = inputs.field();
            let found = in_pieces(&segments, cancellation, |(a, b)| field.optical_depth(*a, *b))?;
            field.volume().check_reads()?;
            Ok(found)
        })?;
        Ok(shaped(py, found, shape)?)
    }

    /// Measures shadow methods on the scene (error, time, memory), and returns the rows of the comparison table as
    /// dictionaries: the columns of `compare.csv`, `None` for empty cells.
    ///
    /// With `output`, a folder, all files of `umbravox compare` are written as well. `progress` is called with a `Step`, or is
    /// `True` for a line on stderr.
    ///
    /// >>> rows = scene.compare("rays;dsm:epsilon=0.06,0.02", output="table")
    #[pyo3(signature = (methods=None, *, output=None, repeats=None, points=None, rays=None, depths=None, check="sample",
        flicker=None, budget=None, overwrite=false, resume=false, progress=None, **arguments))]
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
        flicker: Option<i64>,
        budget: Option<&Bound<'py, PyAny>>,
        overwrite: bool,
        resume: bool,
        progress: Option<&Bound<'py, PyAny>>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyList>> {
        let request = self.request(arguments)?;
        let effort = comparing::effort([repeats, points, rays, depths, flicker], check)?;
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
        let listener = comparing::progress_listener(py, progress)?;
        let rows = run_reporting(
            py,
            || (),
            |py, step| listener.report(py, step),
            |cancellation, sender| {
                let renderer = device::own(&request.run)?;
                let compared = self.state.with_scene(&request, cancellation, |loaded, scene| {
                    table.compared_scene(loaded, &request, scene, &self.state.input)
                })?;
                table.measured(compared, &renderer, cancellation, sender)
            },
        )?;
        self.warn(py)?;
        rows.warn(py)?;
        self.state.note(&rows.notes);
        rows.as_dicts(py)
    }

    /// Returns the scene's camera as keyword arguments: `eye`, `target`, `up`, `fov`, and a `zoom` of 1.
    #[pyo3(signature = (**arguments))]
    fn camera<'py>(
        &self,
        py: Python<'py>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyDict>> {
        let request = self.request(arguments)?;
        let scene = self
            .done(py, |cancellation| self.state.with_scene(&request, cancellation, |_, scene| Ok(scene)))?;
        Ok(camera_as_arguments(py, &scene.camera)?)
    }

    /// Returns all settings of the scene as keyword arguments, defaults included; those about reading the volume are
    /// absent.
    #[pyo3(signature = (**arguments))]
    fn settings<'py>(
        &self,
        py: Python<'py>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyDict>> {
        let request = self.request(arguments)?;
        let settings = self.done(py, |cancellation| self.state.resolved(&request, cancellation))?;
        settings_as_arguments(py, settings, request.function.as_ref())
    }

    /// Returns the transfer function, adapted to the volume, as a dictionary in the form of a transfer-function file.
    #[pyo3(signature = (**arguments))]
    fn transfer_function<'py>(
        &self,
        py: Python<'py>,
        arguments: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let request = self.request(arguments)?;
        let tf = self.done(py, |cancellation| {
            self.state.with_scene(&request, cancellation, |loaded, _| Ok(loaded.tf.clone()))
        })?;
        Ok(function_as_dict(py, &tf)?)
    }

    /// Creates a scene of the same volume; arguments replace settings.
    #[pyo3(signature = (**arguments))]
    fn copy(&self, py: Python<'_>, arguments: Option<&Bound<'_, PyDict>>) -> Outcome<Self> {
        let request = self.request(arguments)?;
        Self::begin(py, Some(self.state.input.clone()), None, request)
    }

    /// Returns the text of a TOML scene file with all settings of the scene, defaults included.
    #[pyo3(signature = (**arguments))]
    fn to_toml(&self, py: Python<'_>, arguments: Option<&Bound<'_, PyDict>>) -> Outcome<String> {
        let request = self.request(arguments)?;
        if !self.state.input.is_of_files() || request.function.is_some() {
            let why =
                "its volume or its transfer function is no file: save both, and make the scene of the files";
            return Err(Fault::input("cannot write scene", "to_toml", why));
        }
        self.done(py, |cancellation| self.state.resolved(&request, cancellation)?.to_toml())
    }

    /// Cost of the last rendered picture: times in milliseconds, memory in bytes, and rendering work that was
    /// skipped.
    #[getter]
    fn last<'py>(&self, py: Python<'py>) -> Outcome<Option<Bound<'py, PyDict>>> {
        let Some(cost) = self.state.last() else { return Ok(None) };
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
        let volume = &self.state.input.volume;
        let default = || default_as(volume, self.base.settings.units).0.to_owned();
        let function = self.base.function.as_ref().map(|f| f.name.clone());
        let tf = function.or_else(|| self.base.settings.tf.clone()).unwrap_or_else(default);
        format!("<Scene {}, tf {tf}>", volume.provenance.source)
    }
}

impl PyScene {
    fn begin(
        py: Python<'_>,
        input: Option<InputVolume>,
        labels: Option<&Bound<'_, PyAny>>,
        request: Request,
    ) -> Outcome<Self> {
        let nothing = SceneSettings::default();
        let input = match input {
            Some(input) => input,
            None => {
                // Checks the other arguments before a large file is read.
                request.settings.functions(labels.is_some())?;
                let reads = reading(&request.settings);
                let input = read_input(py, reads)?;
                warn(py, &input.diagnostics)?;
                input
            }
        };
        let input =
            labels.map_or_else(|| Ok(input.clone()), |labels| input.clone().labelled(labels, "ijk"))?;
        let reads = input.read_by.clone().unwrap_or_else(|| nothing.clone());
        let base = match request.settings.reads_as(&nothing) {
            true => request.over(&Request { settings: reads, ..Request::default() })?,
            false if input.read_by.as_ref().is_some_and(|by| request.settings.reads_as(by)) => request,
            false => return Err(another_volume()),
        };
        let scene = Self { base, state: SceneState::new(input) };
        // Contradicting arguments fail now, not with the first picture.
        scene.done(py, |cancellation| scene.state.with_scene(&scene.base, cancellation, |_, _| Ok(())))?;
        scene.base.settings.method()?;
        Ok(scene)
    }

    /// Combines the keyword arguments of a call with the settings of the scene; arguments win.
    fn request(&self, arguments: Option<&Bound<'_, PyDict>>) -> Outcome<Request> {
        let request = Request::parse(arguments)?.over(&self.base)?;
        if !request.settings.reads_as(&self.base.settings) {
            return Err(another_volume());
        }
        if request.run != self.base.run {
            let name = if request.run.adapter == self.base.run.adapter { "device_memory" } else { "adapter" };
            return Err(Fault::input("bad argument", name, "the scene is on another: make a scene for each"));
        }
        Ok(request)
    }

    /// Runs a computation that Ctrl-C can end, and issues warnings about the scene in Python.
    fn done<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Cancellation) -> Result<T> + Send,
    ) -> Outcome<T> {
        let done = interruptible(py, || (), work)?;
        self.warn(py)?;
        Ok(done)
    }

    fn warn(&self, py: Python<'_>) -> PyResult<()> {
        warn(py, &self.state.take_pending())
    }
}
