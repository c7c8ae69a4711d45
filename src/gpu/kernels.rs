//! Compute pipelines of one graphics device: compiles each at first use, runs it and measures its time.

use super::{
    Gpu, Group, PassTimer, PipelineStore, Read, ShaderVariant, Slot, Span, Tuning, Work, compose, read_back,
};
use crate::error::{Error, Result};
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Cache key of a compiled compute pipeline: its shader variant and the layouts of its bind groups.
type PipelineKey = (ShaderVariant, Vec<Vec<wgpu::BindGroupLayoutEntry>>);

/// Compute pass of a submission: shader, bind groups and number of workgroups along each axis.
#[derive(Clone, Copy)]
pub struct DevicePass<'a> {
    /// Shader of the pass.
    pub variant: &'a ShaderVariant,
    /// Bind groups of the pass, from group 0 on.
    pub groups: &'a [&'a Group],
    /// Number of workgroups along each axis. The pass is skipped if one of them is 0.
    pub workgroups: [u32; 3],
}

/// Graphics device with a cache of its compiled compute pipelines.
pub struct Kernels {
    gpu: Gpu,
    timer: PassTimer,
    store: Option<PipelineStore>,
    /// Choices of shader variants that suit the type of the adapter and the use of the device.
    tuning: Tuning,
    /// Whether shaders count the operations that they execute, such as volume samples and texture reads.
    counting: AtomicBool,
    /// Operations that shaders executed since the count began. Submissions are counted one by one, since blocks of
    /// threads have the same numbers in each.
    counted: Mutex<Work>,
    pipelines: Mutex<HashMap<PipelineKey, Arc<wgpu::ComputePipeline>>>,
}

impl Kernels {
    /// Creates an empty cache of compute pipelines for a graphics device. With `live`, a software adapter binds
    /// uniforms of bind groups 1 and 2 as read-only storage buffers. Otherwise llvmpipe compiles uniform values into
    /// its code: pictures become faster, but the first one after each change of a light takes hundreds of
    /// milliseconds longer.
    pub fn new(gpu: Gpu, live: bool) -> Self {
        let timer = PassTimer::new(&gpu);
        let store = PipelineStore::open(&gpu.device, &gpu.info);
        let tuning = Tuning { storage_uniforms: live && gpu.is_software(), ..gpu.tuning };
        Self {
            gpu,
            timer,
            store,
            tuning,
            counting: AtomicBool::new(false),
            counted: Mutex::default(),
            pipelines: Mutex::default(),
        }
    }

    /// Returns the graphics device for which the compute pipelines are compiled.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Creates the binding of a `var<uniform>` buffer in bind group 1 or 2.
    pub fn uniform<'a>(&self, uniform: &'a wgpu::Buffer) -> Slot<'a> {
        if self.tuning.storage_uniforms {
            Slot::read(uniform.as_entire_binding())
        } else {
            Slot::uniform(uniform)
        }
    }

    /// Creates a bind group of shader resources, each with its `@binding` number.
    pub fn group(&self, label: &str, slots: &[(u32, Slot<'_>)]) -> Group {
        Group::new(&self.gpu, label, slots)
    }

    /// Returns the compute pipeline of a shader variant with the given bind groups; the first call compiles it.
    ///
    /// # Errors
    /// The shader does not compile: a fault of this program or of the driver.
    pub fn pipeline(&self, variant: &ShaderVariant, groups: &[&Group]) -> Result<Arc<wgpu::ComputePipeline>> {
        let mut variant = variant.clone();
        if !self.gpu.filters_float32 {
            variant.defs.push("MANUAL_TRILINEAR");
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
        let module = compose(&key.0, &self.tuning)?;
        let module = self.shader_module(label, module);
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

    fn shader_module(&self, label: Option<&str>, module: wgpu::naga::Module) -> wgpu::ShaderModule {
        let source = wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(module));
        let descriptor = wgpu::ShaderModuleDescriptor { label, source };
        if self.tuning.bounded_loops {
            return self.gpu.device.create_shader_module(descriptor);
        }
        let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..Default::default() };
        // SAFETY: Only the limit on loop iterations is switched off, and every loop of these shaders has a limit of
        // its own. Accesses to buffers and textures stay checked.
        unsafe { self.gpu.device.create_shader_module_trusted(descriptor, checks) }
    }

    /// Runs compute passes with shaders that count their operations, such as volume samples and texture reads, and
    /// returns the counts. These shaders are slower: do not time them.
    ///
    /// # Errors
    /// `passes` fails, or the device is lost.
    pub fn counting_work<T>(&self, passes: impl FnOnce() -> Result<T>) -> Result<(T, Work)> {
        self.take_work()?;
        *self.counted.lock().unwrap_or_else(PoisonError::into_inner) = Work::default();
        self.counting.store(true, Ordering::Relaxed);
        let made = passes();
        self.counting.store(false, Ordering::Relaxed);
        Ok((made?, *self.counted.lock().unwrap_or_else(PoisonError::into_inner)))
    }

    /// Runs a submission with the timer, and adds its work if shaders count it.
    fn timed(
        &self,
        label: &str,
        record_all: impl FnOnce(&mut wgpu::ComputePass<'_>),
        reads: &[Read<'_>],
    ) -> Result<(Span, Vec<Vec<u32>>)> {
        let ran = self.timer.compute(&self.gpu, label, record_all, reads)?;
        if self.counting.load(Ordering::Relaxed) {
            let work = self.take_work()?;
            let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
            *counted = counted.plus(work);
        }
        Ok(ran)
    }

    fn take_work(&self) -> Result<Work> {
        let counters = self.gpu.counters.buffer();
        let words = read_back::<u32>(&self.gpu, counters, (counters.size() / 4) as usize)?;
        Ok(self.gpu.counters.take_work(&self.gpu.queue, &words))
    }

    /// Runs a compute pipeline with `size` workgroups, and waits until it is done. It runs nothing if a component of
    /// `size` is 0. Returns the duration, and the words that `reads` requests.
    ///
    /// # Errors
    /// The shader does not compile, or the device is lost.
    pub fn run(
        &self,
        label: &str,
        variant: &ShaderVariant,
        groups: &[&Group],
        size: [u32; 3],
        reads: &[Read<'_>],
    ) -> Result<(Span, Vec<Vec<u32>>)> {
        self.run_all(label, &[DevicePass { variant, groups, workgroups: size }], reads)
    }

    /// Runs compute pipelines one after another in one submission, and waits until they are done. Returns the duration,
    /// and the words that `reads` requests.
    ///
    /// # Errors
    /// The shader does not compile, or the device is lost.
    pub fn run_all(
        &self,
        label: &str,
        passes: &[DevicePass<'_>],
        reads: &[Read<'_>],
    ) -> Result<(Span, Vec<Vec<u32>>)> {
        let useful = passes.iter().filter(|pass| pass.workgroups.iter().all(|n| *n > 0));
        let pipelines = useful.map(|pass| Ok((self.pipeline(pass.variant, pass.groups)?, pass)));
        let pipelines = pipelines.collect::<Result<Vec<_>>>()?;
        let record_all = |recorded: &mut wgpu::ComputePass<'_>| {
            for (pipeline, pass) in &pipelines {
                record(recorded, pipeline, pass.groups, pass.workgroups);
            }
        };
        self.timed(label, record_all, reads)
    }

    /// Runs a compute pipeline once per step in one submission, and waits until all steps are done. Each step has its
    /// own last bind group and dispatch size, and reads what earlier steps stored.
    ///
    /// # Errors
    /// The shader does not compile, or the device is lost.
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
        let record_all = |pass: &mut wgpu::ComputePass<'_>| {
            steps.iter().for_each(|(last, size)| record(pass, &pipeline, &all(last), *size));
        };
        Ok(self.timed(label, record_all, &[])?.0)
    }

    /// Submits a compute pipeline to the device, without waiting for it.
    ///
    /// # Errors
    /// The shader does not compile.
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
