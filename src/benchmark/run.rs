//! Run of the benchmark: measures the selected cells one after the other, and records each.

use super::answer::CellResult;
use super::definition::{Cell, Definition, Source};
use super::external::{External, export_cell};
use super::folder::{Conditions, Folder};
use super::measure::{CellJob, compared, effort};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::files::output::prepare_output_dir;
use crate::formats::write_nifti;
use crate::gpu::Gpu;
use crate::measure::budget::Budget;
use crate::measure::facts::{Facts, REVISION};
use crate::measure::job::Job;
use crate::measure::small_scene::small_scene;
use crate::open::{Loaded, SceneSettings, VolumeSpec};
use crate::render::{DisabledOptimizations, Renderer, Session};
use crate::report::verify::Verified;
use crate::scene::Scene;
use crate::shadow::{Entry, parse};
use crate::volume::Volume;
use itertools::Itertools as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Function that is called with a description of each step of a benchmark run, and may end the run.
pub type Watch<'a> = &'a mut dyn FnMut(&str) -> Result<()>;

/// Parameters of a run of the benchmark.
pub struct Run<'a> {
    /// Definition of the benchmark.
    pub definition: &'a Definition,
    /// Cells to measure.
    pub cells: &'a [Cell],
    /// Shadow methods to measure.
    pub methods: &'a [&'static Entry],
    /// Budgets within which settings are searched, smaller ones of each kind first.
    pub budgets: &'a [Budget],
    /// External programs that answer the points of every cell.
    pub externals: &'a [External],
    /// Folder of the volumes that are files.
    pub data: PathBuf,
    /// Results of an earlier run. Methods that it has in a cell are measured with its settings, without a search.
    pub settings: Option<&'a Folder<'a>>,
}

/// Volume of the benchmark that has been read, with the settings of its scenes.
struct Subject {
    index: usize,
    settings: SceneSettings,
    volume: Arc<Volume>,
}

/// Volume and transfer function on the graphics device. All cells beside the named one use them.
struct OnDevice {
    cell: Cell,
    session: Session,
}

impl Run<'_> {
    /// Checks that the files of all selected cells are there and have the expected SHA-256.
    ///
    /// # Errors
    /// A file is missing or another one.
    pub fn check(&self) -> Result<()> {
        for volume in self.cells.iter().map(|cell| cell.volume).unique() {
            let settings = self.definition.volume_settings(&self.definition.volume[volume], &self.data)?;
            let found = settings.spec().sha256()?;
            if found != settings.sha256 {
                let [found, expected] = [found, settings.sha256.clone()].map(Option::unwrap_or_default);
                let why = format!("its SHA-256 is {found}, not {expected}");
                let error = Error::input("cannot use volume", settings.spec().source, why);
                return Err(error.hint("data/README.md says where to get the scans of the benchmark"));
            }
        }
        Ok(())
    }

    /// Measures all selected cells that the folder has no result of. A cell that others take their settings from is
    /// measured before them, whether it is selected or not.
    ///
    /// # Errors
    /// A volume cannot be read, a file cannot be written, the device is lost, or `watch` ends the run.
    pub fn measure(&self, folder: &Folder, renderer: &Arc<Renderer>, watch: Watch) -> Result<()> {
        let all = self.definition.cells();
        let (mut subject, mut on_device) = (None, None);
        for cell in self.cells {
            for cell in self.needed(cell, &all, folder)? {
                watch(&cell.name)?;
                let begun = Instant::now();
                let subject = self.subject(cell, &mut subject)?;
                let loaded = self.load(cell, subject)?;
                let session = session(cell, &loaded, renderer, &mut on_device)?;
                let source = self.settings_source(cell, &all, folder)?;
                let open = |is_live| open(&loaded, renderer, is_live);
                let mut result =
                    self.measure_cell(cell, (&loaded, &subject.settings), (session, &open), &source, watch)?;
                result.elapsed_s = Some(begun.elapsed().as_secs_f64());
                folder.record(cell, &result)?;
            }
        }
        Ok(())
    }

    /// Returns the cells to measure for a selected one: those that its settings depend on, then itself, without those
    /// whose results are known.
    fn needed<'b>(&self, cell: &'b Cell, all: &'b [Cell], folder: &Folder) -> Result<Vec<&'b Cell>> {
        let mut needed = Vec::new();
        if folder.result(cell)?.is_some() {
            return Ok(needed);
        }
        let mut next = Some(cell);
        while let Some(cell) = next {
            needed.insert(0, cell);
            next = cell.source(all).cell().copied().filter(|_| !self.methods.is_empty());
            let is_recorded = self.recorded(cell)?.is_some_and(|result| self.has_all(&result));
            if let Some(other) = next
                && (is_recorded || self.known(other, folder)?.is_some())
            {
                next = None;
            }
        }
        Ok(needed)
    }

    /// Returns where a cell takes its settings from, with the result that has them.
    fn settings_source(&self, cell: &Cell, all: &[Cell], folder: &Folder) -> Result<Source<CellResult>> {
        if self.methods.is_empty() {
            return Ok(Source::Full);
        }
        // Without it, all methods have settings of their own in the earlier run.
        cell.source(all).try_map(|other| Ok(self.known(other, folder)?.unwrap_or_default()))
    }

    /// Returns the known result of a cell: that of this run, else that of the earlier one if it has all methods.
    fn known(&self, cell: &Cell, folder: &Folder) -> Result<Option<CellResult>> {
        let own = folder.result(cell)?;
        Ok(if own.is_some() { own } else { self.recorded(cell)?.filter(|result| self.has_all(result)) })
    }

    /// Whether a result has an answer of all methods within all budgets.
    fn has_all(&self, result: &CellResult) -> bool {
        self.methods.iter().all(|method| result.has(method.name, self.budgets))
    }

    /// Returns the result of a cell in the earlier run.
    fn recorded(&self, cell: &Cell) -> Result<Option<CellResult>> {
        Ok(self.settings.map(|folder| folder.result(cell)).transpose()?.flatten())
    }

    /// Returns the volume of a cell; reads it unless it is that of the cell before.
    fn subject<'a>(&self, cell: &Cell, known: &'a mut Option<Subject>) -> Result<&'a Subject> {
        if known.as_ref().is_none_or(|subject| subject.index != cell.volume) {
            *known = None;
            let settings =
                self.definition.volume_settings(&self.definition.volume[cell.volume], &self.data)?;
            let volume = Arc::new(settings.read_volume(&mut Vec::new(), &Loading::default())?.volume);
            *known = Some(Subject { index: cell.volume, settings, volume });
        }
        // It was set above.
        known.as_ref().ok_or_else(|| Error::runtime("cannot read volume", &cell.name, "unknown"))
    }

    /// Prepares the scene of a cell.
    fn load(&self, cell: &Cell, subject: &Subject) -> Result<Loaded> {
        let settings = self.definition.cell_settings(cell, &subject.settings, &subject.volume)?;
        let tf = self.definition.volume[cell.volume].function(cell.function);
        let functions = settings.functions(false)?.with_whole("function.json", tf);
        settings.look_at((Arc::clone(&subject.volume), None), functions, Vec::new(), &Loading::default())
    }

    fn measure_cell(
        &self,
        cell: &Cell,
        (loaded, settings): (&Loaded, &SceneSettings),
        (session, open): (&Session, &dyn Fn(bool) -> Result<Session>),
        source: &Source<CellResult>,
        watch: Watch,
    ) -> Result<CellResult> {
        let subject = (&*loaded.volume, &loaded.tf);
        let effort = effort(self.definition.points_of(cell));
        let job = Job::new(session, subject, &loaded.scene, &cell.name, effort);
        let mut cell_job = CellJob::new(job)?;
        cell_job.with_pictures = !self.externals.is_empty();
        let mut of_externals = Vec::new();
        for external in self.externals {
            watch(&format!("{}: {}", cell.name, external.name))?;
            let scenes = [loaded.scene.clone(), small_scene(&loaded.scene)];
            let spec = VolumeSpec::new("volume.nii");
            let [scene, small] =
                scenes.map(|scene| scene_text(loaded, spec.clone(), None, &scene, &cell.name));
            let failed = |e: std::io::Error| Error::runtime("cannot run external program", &external.name, e);
            // Each program has a folder of its own, which other processes do not use.
            let exchange = tempfile::tempdir().map_err(failed)?;
            of_externals.push(external.answer(&cell_job, [&scene?, &small?], exchange.path())?);
        }
        let recorded = self.recorded(cell)?.map(Source::Known);
        let mut found = Vec::new();
        for entry in self.methods {
            watch(&format!("{}: {}", cell.name, entry.name))?;
            let is_live = self.builds_with_pictures(entry, session)?;
            // Under a light with a size a search builds thousands of maps.
            let own = (cell.is_soft || is_live).then(|| open(is_live)).transpose()?;
            let job = own.as_ref().map(|session| cell_job.on(session));
            let recorded =
                recorded.as_ref().filter(|r| r.cell().is_some_and(|r| r.has(entry.name, self.budgets)));
            let source = recorded.unwrap_or(source);
            found.extend(job.as_ref().unwrap_or(&cell_job).answer(entry, self.budgets, source)?);
        }
        let answers = compared(self.budgets, found, &of_externals);
        let mut spec = settings.spec();
        if let Some(file) =
            Path::new(&spec.source).file_name().filter(|_| !spec.source.starts_with("phantom:"))
        {
            spec.source = file.to_string_lossy().into_owned();
        }
        Ok(CellResult {
            cell: cell.name.clone(),
            volume: self.definition.volume[cell.volume].name.clone(),
            function: cell.function.into(),
            points: cell_job.visible().len(),
            exact_hash: cell_job.hash.clone(),
            revision: REVISION.into(),
            elapsed_s: None,
            scene: scene_text(loaded, spec, settings.sha256.clone(), &loaded.scene, &cell.name)?,
            transfer_function: loaded.tf.to_json(),
            answers,
        })
    }

    /// Whether a method builds its map in hundreds of passes with each picture, on a software adapter and without a limit
    /// of time. llvmpipe keeps a copy of the shader of each pass with its uniforms; a [`Renderer::live`] avoids that, but
    /// draws other pictures more slowly.
    fn builds_with_pictures(&self, entry: &Entry, session: &Session) -> Result<bool> {
        let in_sections = parse(entry.name)?.lookup().is_some_and(|lookup| lookup.has_sections());
        let is_timed = self.budgets.iter().any(Budget::is_of_time);
        Ok(in_sections && !is_timed && session.renderer.gpu().is_software())
    }

    /// Computes the hashes of the exact transmittances of all selected cells, as lines of `exact.tsv`.
    ///
    /// # Errors
    /// See [`Self::visit`].
    pub fn hashes(&self, renderer: &Arc<Renderer>, watch: Watch) -> Result<String> {
        let mut lines = String::new();
        self.visit(renderer, watch, &mut |cell, _, job| {
            lines += &format!("{}\t{}\n", cell.name, job.hash);
            Ok(())
        })?;
        Ok(lines)
    }

    /// Writes volumes, scene files, visible points and exact transmittances of all selected cells into a folder: the
    /// volume `NAME.nii` once, and a folder for each cell.
    ///
    /// # Errors
    /// See [`Self::visit`]; or a file cannot be written.
    pub fn export(&self, folder: &Path, renderer: &Arc<Renderer>, watch: Watch) -> Result<()> {
        prepare_output_dir(folder)?;
        let mut written = None;
        self.visit(renderer, watch, &mut |cell, loaded, job| {
            let volume = format!("{}.nii", self.definition.volume[cell.volume].name);
            if written != Some(cell.volume) {
                write_nifti(&loaded.volume, &folder.join(&volume))?;
                written = Some(cell.volume);
            }
            let own = folder.join(&cell.name);
            prepare_output_dir(&own)?;
            let spec = VolumeSpec::new(format!("../{volume}"));
            export_cell(job, &scene_text(loaded, spec, None, &loaded.scene, &cell.name)?, &own)
        })
    }

    /// Measures the recorded settings of all selected cells again, and compares errors and memory. `before` says
    /// on which adapter and driver they were recorded.
    ///
    /// # Errors
    /// See [`Self::visit`]; or a result cannot be read.
    pub fn verify(
        &self,
        folder: &Folder,
        before: &Conditions,
        renderer: &Arc<Renderer>,
        watch: Watch,
    ) -> Result<Verified> {
        let (mut verified, facts) = (Verified::default(), Facts::of(renderer.gpu()));
        self.visit(renderer, watch, &mut |cell, loaded, job| {
            let Some(recorded) = folder.result(cell)? else { return Ok(()) };
            let open_for = |entry: &Entry| {
                let is_live = self.builds_with_pictures(entry, job.job().session)?;
                is_live.then(|| open(loaded, renderer, true)).transpose()
            };
            job.verify(&recorded, (before, &facts), &open_for, &mut verified)
        })?;
        Ok(verified)
    }

    /// Computes the exact transmittances of all selected cells one after the other, and calls `each` for each.
    ///
    /// # Errors
    /// A volume cannot be read, the device is lost, or `watch` or `each` ends the run.
    fn visit(
        &self,
        renderer: &Arc<Renderer>,
        watch: Watch,
        each: &mut dyn FnMut(&Cell, &Loaded, &CellJob) -> Result<()>,
    ) -> Result<()> {
        let (mut subject, mut on_device) = (None, None);
        for cell in self.cells {
            watch(&cell.name)?;
            let loaded = self.load(cell, self.subject(cell, &mut subject)?)?;
            let session = session(cell, &loaded, renderer, &mut on_device)?;
            let subject = (&*loaded.volume, &loaded.tf);
            let effort = effort(self.definition.points_of(cell));
            let job = Job::new(session, subject, &loaded.scene, &cell.name, effort);
            each(cell, &loaded, &CellJob::new(job)?)?;
        }
        Ok(())
    }
}

/// Opens a session with a volume and transfer function, with its own device on the adapter of `renderer`: with Mesa's
/// lavapipe, memory grows by up to a megabyte for each shadow map that is built, until the device is closed.
fn open(loaded: &Loaded, renderer: &Renderer, is_live: bool) -> Result<Session> {
    let gpu = Gpu::open(Some(&renderer.gpu().info.name))?;
    let own = if is_live { Renderer::live(gpu, f64::INFINITY) } else { Renderer::new(gpu) };
    Session::on(&Arc::new(own), Arc::clone(&loaded.volume), &loaded.tf, DisabledOptimizations::default())
}

/// Returns the session of a cell's volume and transfer function; opens it unless it is that of the cell before.
fn session<'a>(
    cell: &Cell,
    loaded: &Loaded,
    renderer: &Arc<Renderer>,
    known: &'a mut Option<OnDevice>,
) -> Result<&'a Session> {
    if known.as_ref().is_none_or(|on_device| !on_device.cell.is_beside(cell)) {
        // The device may not hold two volumes.
        *known = None;
        *known = Some(OnDevice { cell: cell.clone(), session: open(loaded, renderer, false)? });
    }
    // It was set above.
    let unknown = || Error::runtime("cannot use device", &cell.name, "no session");
    known.as_ref().map(|on_device| &on_device.session).ok_or_else(unknown)
}

/// Returns the text of the scene file of a cell, with its volume named as in `spec`.
fn scene_text(
    loaded: &Loaded,
    spec: VolumeSpec,
    sha256: Option<String>,
    scene: &Scene,
    name: &str,
) -> Result<String> {
    let settings = SceneSettings { name: Some(name.into()), sha256, ..SceneSettings::of_volume(&spec) };
    settings.resolved(scene, "function.json", loaded.suiting).to_toml()
}
