//! Hardware, driver and program of a measurement, which every row states, and the key that identifies recorded rows.

use super::defaults::settings;
use super::job::{Effort, Job};
use super::table::{OK, Row};
use crate::gpu::Gpu;
use crate::shadow::Method;
use crate::volume::Volume;
use crate::with_voxels;
use std::hash::{DefaultHasher, Hash, Hasher};

/// The commit that this program was built from, `+changes` where the sources differed from it; `unknown` for a build
/// outside a checkout.
pub const REVISION: &str = env!("UMBRAVOX_REVISION");

/// The machine and the program.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Facts {
    /// Name of the graphics adapter.
    pub adapter: String,
    /// The adapter's driver with its version.
    pub driver: String,
    /// Threads of the host's parallel work.
    pub threads: u32,
    /// `release` or `debug`.
    pub profile: &'static str,
    /// Version of this program.
    pub version: &'static str,
    /// [`REVISION`].
    pub revision: &'static str,
}

impl Facts {
    /// Collects the facts of this program on a device.
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

    /// A row of which nothing is measured yet.
    pub fn row(&self, scene_name: &str, [width, height]: [u32; 2], method: &dyn Method) -> Row {
        Row {
            scene: scene_name.into(),
            adapter: self.adapter.clone(),
            method: method.name().into(),
            params: method.params(),
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

/// Everything about a job that decides its rows, as one number: machine, program, voxels, transfer function, scene and
/// how much is measured. Repeats are left out: they are counted.
pub(super) fn job_key(job: &Job, facts: &Facts) -> u64 {
    let mut hasher = DefaultHasher::new();
    facts.hash(&mut hasher);
    hash_volume(job.volume, &mut hasher);
    let effort = Effort { repeats: 0, ..job.effort };
    // `Debug` writes reals in digits that read back as the same number.
    let forced = job.session.transfer.disabled;
    // The voxels say which strands they are of.
    let strands = job.strands.is_some();
    format!("{:?} {:?} {} {effort:?} {forced:?} {strands}", job.tf, job.scene, job.scene_name)
        .hash(&mut hasher);
    hasher.finish()
}

/// The key of a row; `slug` tells a method given twice from itself.
pub(super) fn row_key(job_key: u64, method: &dyn Method, slug: &str) -> String {
    let mut hasher = DefaultHasher::new();
    (job_key, slug, method.spec()).hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}

fn hash_volume(volume: &Volume, hasher: &mut DefaultHasher) {
    format!("{:?} {:?} {:?}", volume.dims(), volume.scaling(), volume.index_from_world()).hash(hasher);
    with_voxels!(volume.voxels(), a => {
        hasher.write(bytemuck::cast_slice(a.as_slice().unwrap_or_default()));
    });
}
