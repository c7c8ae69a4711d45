//! Compute pipelines of one graphics device: compiles each at first use, runs it and measures its time.

use super::{
    Gpu, Group, PassTimer, PipelineStore, Read, RecordedPass, ShaderVariant, Slot, Span, Tuning, Words, Work,
    compose, read_back, write_wgsl,
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

impl DevicePass<'_> {
    /// Whether this pass certainly has the pipeline of another one.
    fn has_pipeline_of(&self, other: &Self) -> bool {
        let kinds = |pass: &Self| pass.groups.iter().map(|group| group.kinds.as_slice()).collect::<Vec<_>>();
        std::ptr::eq(self.variant, other.variant) && kinds(self) == kinds(other)
    }
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
        let variant = self.adapted(variant);
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

    /// Returns a shader variant with the definitions that suit this device.
    fn adapted(&self, variant: &ShaderVariant) -> ShaderVariant {
        let manual =
            (!self.gpu.filters_float32 || variant.defs.contains(&"PAGED")).then_some("MANUAL_TRILINEAR");
        let counting = self.counting.load(Ordering::Relaxed).then_some("COUNT_WORK");
        variant.clone().defs(manual).defs(counting)
    }

    /// Returns a shader as this device runs it, as one WGSL module without imports.
    ///
    /// # Errors
    /// The shader does not compile, which is a fault of this program.
    pub fn wgsl(&self, variant: &ShaderVariant) -> Result<String> {
        write_wgsl(variant.entry, &self.composed(variant)?)
    }

    /// Composes a shader as this device runs it.
    ///
    /// # Errors
    /// The shader cannot be composed, which is a fault of this program.
    pub fn composed(&self, variant: &ShaderVariant) -> Result<wgpu::naga::Module> {
        compose(&self.adapted(variant), &self.tuning)
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

    /// Submits recorded passes in one submission, and waits until they are done. Returns the duration of each, and the
    /// words that it read.
    ///
    /// # Errors
    /// The device is lost.
    pub fn submit(&self, passes: Vec<RecordedPass>) -> Result<Vec<(Span, Words)>> {
        let results = self.timer.submit(&self.gpu, passes)?;
        if self.counting.load(Ordering::Relaxed) {
            let work = self.take_work()?;
            let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
            *counted = counted.plus(work);
        }
        Ok(results)
    }

    fn take_work(&self) -> Result<Work> {
        let counters = self.gpu.counters.buffer();
        let words = read_back::<u32>(&self.gpu, counters, (counters.size() / 4) as usize)?;
        Ok(self.gpu.counters.take_work(&self.gpu.queue, &words))
    }

    /// Runs compute pipelines one after another in one submission, and waits until they are done. Returns the duration,
    /// and the words that `reads` requests.
    ///
    /// # Errors
    /// The shader does not compile, or the device is lost.
    pub fn run(
        &self,
        label: &'static str,
        passes: &[DevicePass<'_>],
        reads: &[Read<'_>],
    ) -> Result<(Span, Words)> {
        let results = self.submit(vec![self.record(label, passes, reads)?])?;
        Ok(results.into_iter().next().unwrap_or_default())
    }

    /// Records compute pipelines, one after another, for a later submission.
    ///
    /// # Errors
    /// The shader does not compile.
    pub fn record(
        &self,
        label: &'static str,
        passes: &[DevicePass<'_>],
        reads: &[Read<'_>],
    ) -> Result<RecordedPass> {
        let mut pipelines: Vec<(Arc<wgpu::ComputePipeline>, &DevicePass<'_>)> =
            Vec::with_capacity(passes.len());
        for pass in passes.iter().filter(|pass| pass.workgroups.iter().all(|n| *n > 0)) {
            let pipeline = match pipelines.last().filter(|(_, last)| pass.has_pipeline_of(last)) {
                Some((pipeline, _)) => Arc::clone(pipeline),
                None => self.pipeline(pass.variant, pass.groups)?,
            };
            pipelines.push((pipeline, pass));
        }
        let record_all = |recorded: &mut wgpu::ComputePass<'_>| {
            for (pipeline, pass) in &pipelines {
                dispatch(recorded, pipeline, pass.groups, pass.workgroups);
            }
        };
        Ok(self.timer.record(&self.gpu, label, record_all, reads))
    }
}

fn dispatch(
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
