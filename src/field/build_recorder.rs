//! Record of the compute passes that build a shadow map, for another program that builds the map again under another light.

use crate::gpu::{Group, ShaderVariant};
use std::sync::{Mutex, PoisonError};

/// Compute pass of a recorded build.
pub struct BuildPass {
    /// Shader of the pass.
    pub shader: ShaderVariant,
    /// Bind groups 0 to 2 of the pass: volume and transfer function, shadow map, and the pass's own resources.
    pub groups: [Group; 3],
    /// Number of workgroups along each axis.
    pub workgroups: [u32; 3],
}

/// Memory of a recorded build that may be too small under another light.
pub struct BuildLimit {
    /// Counters that the passes of the build increase from 0.
    pub counters: wgpu::Buffer,
    /// Indices of the counters that stay 0 in a complete build: entries without memory, and rays that ended early.
    pub missing: [usize; 2],
    /// Index of the counter of entries that the finished map needs.
    pub needed: usize,
    /// Number of entries for which the finished map has memory.
    pub most: u32,
}

/// Passes of a recorded build, in order.
#[derive(Default)]
pub struct RecordedBuild {
    /// Compute passes of the build.
    pub passes: Vec<BuildPass>,
    /// Memory that may be too small; `None` if it is large enough under every light.
    pub limit: Option<BuildLimit>,
}

/// Recorder of the passes of a shadow-map build, which run as well.
#[derive(Default)]
pub struct BuildRecorder(Mutex<RecordedBuild>);

impl BuildRecorder {
    /// Factor by which memory of a recorded build exceeds the needs under its light.
    pub const RESERVE: f64 = 2.0;

    /// Appends a pass.
    pub(super) fn push(&self, shader: &ShaderVariant, groups: [&Group; 3], workgroups: [u32; 3]) {
        let pass = BuildPass { shader: shader.clone(), groups: groups.map(Clone::clone), workgroups };
        self.edit(|build| build.passes.push(pass));
    }

    /// Sets the memory that may be too small under another light.
    pub fn limit(&self, limit: BuildLimit) {
        self.edit(|build| build.limit = Some(limit));
    }

    /// Returns the recorded passes.
    pub fn into_build(self) -> RecordedBuild {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    fn edit(&self, edit: impl FnOnce(&mut RecordedBuild)) {
        edit(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }
}
