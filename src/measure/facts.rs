//! Hardware, driver and program version of a measurement, as every comparison table row states them, and keys that
//! identify measurements recorded in the journal file.

use super::defaults::settings;
use super::job::{Effort, Job};
use super::table::{OK, Row};
use crate::gpu::Gpu;
use crate::shadow::Method;
use crate::volume::Volume;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Git commit that this program was built from, with `+changes` for modified sources, or `unknown` for a build
/// outside a checkout.
pub const REVISION: &str = env!("BUILT_REVISION");

/// Hardware, driver and program version that a measurement was made with.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Facts {
    /// Name of the graphics adapter on which the measurement ran.
    pub adapter: String,
    /// Driver of the graphics adapter, with its version.
    pub driver: String,
    /// Number of CPU threads that the program uses for parallel work.
    pub threads: u32,
    /// Build profile of this program: `release` or `debug`.
    pub profile: &'static str,
    /// Version of this program (umbravox).
    pub version: &'static str,
    /// Git commit that this program was built from; see [`REVISION`].
    pub revision: &'static str,
}

impl Facts {
    /// Collects the hardware, driver and program version for a graphics device.
    pub fn of(gpu: &Gpu) -> Self {
        Self {
            adapter: gpu.info.name.clone(),
            driver: format!("{} {}", gpu.info.driver, gpu.info.driver_info).trim().to_owned(),
            threads: rayon::current_num_threads() as u32,
            profile: if cfg!(debug_assertions) { "debug" } else { "release" },
            version: env!("CARGO_PKG_VERSION"),
            revision: REVISION,
        }
    }

    /// Returns the conditions of a measurement in one line: adapter, driver, threads, build profile and revision.
    pub fn conditions(&self) -> String {
        let Self { threads, profile, revision, .. } = self;
        format!("{}, {threads} threads, {profile} build, revision {revision}", self.device())
    }

    /// Returns the adapter and its driver in one text.
    pub fn device(&self) -> String {
        format!("Adapter {} ({})", self.adapter, self.driver)
    }

    /// Creates a comparison table row for a shadow method, without measured values.
    pub fn row(&self, scene_name: &str, [width, height]: [u32; 2], method: &dyn Method) -> Row {
        Row {
            scene: scene_name.into(),
            adapter: self.adapter.clone(),
            method: method.name().into(),
            params: method.params(),
            published: method.spec().paper().unwrap_or_default().into(),
            map: method.map_size(),
            settings: settings(method),
            width,
            height,
            driver: self.driver.clone(),
            threads: Some(self.threads),
            profile: self.profile.into(),
            version: self.version.into(),
            revision: self.revision.into(),
            status: OK.into(),
            ..Row::default()
        }
    }
}

/// Returns a hash of everything that determines the measured table rows: machine, program, voxels, transfer function,
/// scene, and numbers of points, rays and depths. The number of timed repeats is excluded.
pub(super) fn job_key(job: &Job, facts: &Facts) -> u64 {
    let mut hasher = DefaultHasher::new();
    facts.hash(&mut hasher);
    hash_volume(job.volume, &mut hasher);
    let effort = Effort { repeats: 0, short_repeats: 0, ..job.effort };
    // `Debug` writes real numbers with digits that parse to the same number.
    let forced = job.session.transfer.disabled;
    // The voxels identify the strands, so a flag is enough.
    let strands = job.strands.is_some();
    format!("{:?} {:?} {} {effort:?} {forced:?} {strands}", job.tf, job.scene, job.scene_name)
        .hash(&mut hasher);
    hasher.finish()
}

/// Returns the key that identifies a comparison table row in the journal file of measurements. `slug` distinguishes a
/// shadow method that is listed twice.
pub(super) fn row_key(job_key: u64, method: &dyn Method, slug: &str) -> String {
    let mut hasher = DefaultHasher::new();
    (job_key, slug, method.spec()).hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}

fn hash_volume(volume: &Volume, hasher: &mut DefaultHasher) {
    format!("{:?} {:?} {:?}", volume.dims(), volume.scaling(), volume.index_from_world()).hash(hasher);
    match volume.resident() {
        Some(voxels) => hasher.write(voxels.bytes()),
        // Value ranges of all bricks tell volumes apart without reading all voxels again.
        None => volume.bricks().range_bytes().into_iter().for_each(|bytes| hasher.write(bytes)),
    }
}
