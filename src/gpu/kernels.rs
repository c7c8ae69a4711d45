//! Compute pipelines of one device, compiled when first needed, and running them timed.

use super::quirks::SOFTWARE_ADAPTER;
use super::{Gpu, Group, PassTimer, PipelineStore, ShaderVariant, Slot, Span, Work, compose, read_back};
use crate::error::{Error, Result};
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// What a pipeline was compiled for: its shader and the kinds of what groups 0, 1 and 2 bind.
type Key = (ShaderVariant, Vec<Vec<wgpu::BindGroupLayoutEntry>>);

/// A device with its compiled pipelines; immutable apart from that cache.
pub struct Kernels {
    gpu: Gpu,
    timer: PassTimer,
    store: Option<PipelineStore>,
    /// Uniforms of groups 1 and 2 are read as storage, see [`Self::new`].
    live: bool,
    /// Pipelines count their work, see [`Self::counting_work`].
    counting: AtomicBool,
    pipelines: Mutex<HashMap<Key, Arc<wgpu::ComputePipeline>>>,
}

impl Kernels {
    /// `live`: a software adapter binds uniforms of groups 1 and 2 as read-only storage. llvmpipe compiles the values of
    /// uniforms into its code, which makes a picture faster, but the first one under every other light slower by hundreds of
    /// milliseconds.
    pub fn new(gpu: Gpu, live: bool) -> Self {
        let timer = PassTimer::new(&gpu);
        let store = PipelineStore::open(&gpu.device, &gpu.info);
        let live = live && gpu.is_software();
        Self { gpu, timer, store, live, counting: AtomicBool::new(false), pipelines: Mutex::default() }
    }

    /// The device itself.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The slot of a `var<uniform>` of group 1 or 2.
    pub fn uniform<'a>(&self, uniform: &'a wgpu::Buffer) -> Slot<'a> {
        if self.live { Slot::read(uniform.as_entire_binding()) } else { Slot::uniform(uniform) }
    }

    /// A bind group of slots by their `@binding`.
    pub fn group(&self, label: &str, slots: &[(u32, Slot<'_>)]) -> Group {
        Group::new(&self.gpu, label, slots)
    }

    /// The pipeline of a variant over groups of these shapes.
    ///
    /// # Errors
    /// A shader that does not compile, which is a fault of this program or of the driver.
    pub fn pipeline(&self, variant: &ShaderVariant, groups: &[&Group]) -> Result<Arc<wgpu::ComputePipeline>> {
        let mut variant = variant.clone();
        if !self.gpu.filters_float32 {
            variant.defs.push("MANUAL_TRILINEAR");
        }
        if self.gpu.is_software() {
            variant.defs.push(SOFTWARE_ADAPTER);
        }
        if self.counting.load(Ordering::Relaxed) {
            variant.defs.push("COUNT_WORK");
        }
        let label = Some(variant.entry);
        let key = (variant, groups.iter().map(|g| g.kinds.clone()).collect());
        let poisoned =
            || Error::runtime("cannot compile shader", key.0.entry, "an earlier compilation panicked");
        if let Some(found) = self.pipelines.lock().map_err(|_| poisoned())?.get(&key) {
            return Ok(Arc::clone(found));
        }
        let module = compose(&key.0, self.live)?;
        let module = self.gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(module)),
        });
        let layouts: Vec<_> = groups.iter().map(|g| Some(&g.layout)).collect();
        let layout = self.gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &layouts,
            immediate_size: 0,
        });
        let pipeline = Arc::new(self.gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&layout),
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            cache: self.store.as_ref().map(|s| &s.cache),
        }));
        self.gpu.take_error()?;
        self.pipelines.lock().map_err(|_| poisoned())?.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }

    /// What passes do, counted by variants of their shaders that are slower for it: nothing of `passes` is to be timed.
    ///
    /// # Errors
    /// Those of `passes`, or a lost device.
    pub fn counting_work<T>(&self, passes: impl FnOnce() -> Result<T>) -> Result<(T, Work)> {
        self.take_work()?;
        self.counting.store(true, Ordering::Relaxed);
        let made = passes();
        self.counting.store(false, Ordering::Relaxed);
        Ok((made?, self.take_work()?))
    }

    fn take_work(&self) -> Result<Work> {
        let counters = self.gpu.watch.counters();
        let words = read_back::<u32>(&self.gpu, counters, (counters.size() / 4) as usize)?;
        Ok(self.gpu.watch.take_work(&self.gpu.queue, &words))
    }

    /// Runs so many workgroups of a pipeline and waits for them; nothing runs where there are none.
    ///
    /// # Errors
    /// As [`Self::pipeline`], or a lost device.
    pub fn run(
        &self,
        label: &str,
        variant: &ShaderVariant,
        groups: &[&Group],
        size: [u32; 3],
    ) -> Result<Span> {
        self.run_all(label, &[(variant, size)], groups)
    }

    /// Runs pipelines one after another over the same groups, as [`Self::run`] does one.
    ///
    /// # Errors
    /// As there.
    pub fn run_all(
        &self,
        label: &str,
        passes: &[(&ShaderVariant, [u32; 3])],
        groups: &[&Group],
    ) -> Result<Span> {
        let useful = passes.iter().filter(|(_, size)| size.iter().all(|n| *n > 0));
        let pipelines = useful.map(|(variant, size)| Ok((self.pipeline(variant, groups)?, *size)));
        let pipelines = pipelines.collect::<Result<Vec<_>>>()?;
        self.timer.compute(&self.gpu, label, |pass| {
            pipelines.iter().for_each(|(pipeline, size)| record(pass, pipeline, groups, *size));
        })
    }

    /// Runs a pipeline once a step, each with a last group and a size of its own, and waits for all: each step sees what
    /// those before it have stored.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_steps(
        &self,
        label: &str,
        variant: &ShaderVariant,
        groups: &[&Group],
        steps: &[(Group, [u32; 3])],
    ) -> Result<Span> {
        let all = |last| groups.iter().copied().chain([last]).collect::<Vec<&Group>>();
        let Some((first, _)) = steps.first() else { return Ok(Span::default()) };
        let pipeline = self.pipeline(variant, &all(first))?;
        self.timer.compute(&self.gpu, label, |pass| {
            steps.iter().for_each(|(last, size)| record(pass, &pipeline, &all(last), *size));
        })
    }

    /// Runs as [`Self::run`] does, without waiting: the submission can be waited for.
    ///
    /// # Errors
    /// As [`Self::pipeline`].
    pub fn submit(
        &self,
        variant: &ShaderVariant,
        groups: &[&Group],
        workgroups: [u32; 3],
    ) -> Result<wgpu::SubmissionIndex> {
        let pipeline = self.pipeline(variant, groups)?;
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        record(&mut encoder.begin_compute_pass(&Default::default()), &pipeline, groups, workgroups);
        Ok(self.gpu.submit([encoder.finish()]))
    }
}

fn record(
    pass: &mut wgpu::ComputePass<'_>,
    pipeline: &wgpu::ComputePipeline,
    groups: &[&Group],
    [x, y, z]: [u32; 3],
) {
    pass.set_pipeline(pipeline);
    for (index, group) in (0..).zip(groups) {
        pass.set_bind_group(index, &group.group, &[]);
    }
    pass.dispatch_workgroups(x, y, z);
}
