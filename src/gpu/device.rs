//! Choosing an adapter and opening a device with all the limits that it has.

use super::sharing::{Sharing, Uncaptured};
use super::watch::Watch;
use crate::error::{Error, Result};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::time::Instant;

/// An open device. Limits are the adapter's own; features beyond the core are optional.
#[derive(Debug)]
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// What the adapter says of itself.
    pub info: wgpu::AdapterInfo,
    /// Whether 32-bit float textures can be filtered by the hardware.
    pub filters_float32: bool,
    /// Nanoseconds a timestamp tick, where the adapter has timestamps and is no software one.
    pub timestamp_period_ns: Option<f32>,
    /// Counts loops of shaders that reach their bound.
    pub watch: Watch,
    /// Errors that no call returned (validation, out of memory), and who submits when.
    pub sharing: Sharing,
    lost: DeviceLoss,
}

/// Whether a device has been lost, and why; clones know what the first one knows.
#[derive(Debug, Clone, Default)]
pub struct DeviceLoss(Arc<Mutex<Option<String>>>);

impl DeviceLoss {
    /// The driver's reason, once the device is lost: nothing that is on it can be used any more.
    pub fn reason(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

const NO_ADAPTER_HINT: &str = "install a Vulkan driver; without a GPU a software one will do \
    (Debian/Ubuntu: apt-get install mesa-vulkan-drivers libvulkan1)";

impl Gpu {
    /// Opens the adapter whose name contains `name` (any case), or the one the system prefers.
    ///
    /// # Errors
    /// No adapter, none of that name, or one without compute, with a hint on how to get a software one.
    pub fn open(name: Option<&str>) -> Result<Self> {
        let adapter = choose(name)?;
        let info = adapter.get_info();
        let (device, queue) = pollster::block_on(adapter.request_device(&Self::device_descriptor(&adapter)))
            .map_err(|e| Error::runtime("cannot open the graphics device", &info.name, e))?;
        Ok(Self::from_parts(&adapter, device, queue))
    }

    /// What a device is asked for: all the adapter's limits, and the optional features that are used where they exist.
    pub fn device_descriptor(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
        let wanted = wgpu::Features::TIMESTAMP_QUERY
            | wgpu::Features::FLOAT32_FILTERABLE
            | wgpu::Features::PIPELINE_CACHE;
        wgpu::DeviceDescriptor {
            label: Some("umbravox"),
            required_features: adapter.features() & wanted,
            required_limits: adapter.limits(),
            ..Default::default()
        }
    }

    /// Works on a device that someone else opened with [`Self::device_descriptor`], such as a window that shows
    /// pictures from the very same device.
    pub fn from_parts(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let info = adapter.get_info();
        let features = device.features();
        let sharing = Sharing::default();
        let sink = sharing.clone();
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            tracing::debug!("uncaptured device error: {e}");
            sink.note(&e);
        }));
        let lost = DeviceLoss::default();
        let sink = lost.clone();
        device.set_device_lost_callback(move |reason, why| {
            let why = if why.is_empty() { format!("{reason:?}").to_lowercase() } else { why };
            sink.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(why);
        });
        let timestamp_period_ns = features
            .contains(wgpu::Features::TIMESTAMP_QUERY)
            .then(|| queue.get_timestamp_period())
            // A software adapter's timestamps need not enclose the work (lavapipe has said 0.04 ms of a 75 ms pass), and
            // its work is the host's own: there the wall clock is the true one.
            .filter(|p| *p > 0.0 && info.device_type != wgpu::DeviceType::Cpu);
        tracing::info!("adapter: {} ({:?}, {} {})", info.name, info.backend, info.driver, info.driver_info);
        Self {
            watch: Watch::new(&device),
            device,
            queue,
            info,
            filters_float32: features.contains(wgpu::Features::FLOAT32_FILTERABLE),
            timestamp_period_ns,
            sharing,
            lost,
        }
    }

    /// Knows when the device is lost.
    pub fn loss(&self) -> DeviceLoss {
        self.lost.clone()
    }

    /// The first error of this thread's calls that none of them returned, if there was one since the last time.
    pub fn take_error(&self) -> Result<()> {
        let failed =
            |e: Uncaptured| Err(Error::runtime("the graphics device failed", &self.info.name, e.why));
        self.sharing.take_error().map_or(Ok(()), failed)
    }

    /// Submits, once nobody holds submissions back.
    pub fn submit<I: IntoIterator<Item = wgpu::CommandBuffer>>(&self, commands: I) -> wgpu::SubmissionIndex {
        self.sharing.unheld(|| self.queue.submit(commands))
    }

    /// The same, with when that was.
    pub fn submit_timed<I: IntoIterator<Item = wgpu::CommandBuffer>>(
        &self,
        commands: I,
    ) -> (Instant, wgpu::SubmissionIndex) {
        self.sharing.unheld(|| (Instant::now(), self.queue.submit(commands)))
    }

    /// Submits and waits until the device has done it all.
    pub fn submit_and_wait(&self, encoder: wgpu::CommandEncoder) -> Result<()> {
        let submission = self.submit([encoder.finish()]);
        self.wait_for(submission)
    }

    /// Waits until the device has done a submission, whatever others have submitted since.
    pub fn wait_for(&self, submission: wgpu::SubmissionIndex) -> Result<()> {
        self.device
            .poll(wgpu::PollType::Wait { submission_index: Some(submission), timeout: None })
            .map_err(|e| Error::runtime("the graphics device failed", &self.info.name, e))?;
        self.take_error()
    }

    /// Refuses a 2-D texture that the adapter cannot hold.
    pub fn check_texture(&self, what: &str, sides: [u32; 2]) -> Result<()> {
        let limit = self.device.limits().max_texture_dimension_2d;
        if sides.iter().any(|s| *s > limit) {
            return Err(Error::runtime(
                format!("cannot allocate {what}"),
                &self.info.name,
                format!("{} x {} texels, the adapter's textures end at {limit}", sides[0], sides[1]),
            ));
        }
        Ok(())
    }

    /// Refuses a buffer that the adapter cannot bind.
    pub fn check_storage(&self, what: &str, bytes: u64) -> Result<()> {
        let limits = self.device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if bytes > limit {
            return Err(Error::runtime(
                format!("cannot allocate {what}"),
                &self.info.name,
                format!("{bytes} bytes are more than the {limit} that the adapter can bind"),
            ));
        }
        Ok(())
    }
}

/// Texels along an axis of the largest 3-D texture of the adapter that the system prefers; `None` where there is none.
pub fn texture_side() -> Option<usize> {
    choose(None).ok().map(|adapter| adapter.limits().max_texture_dimension_3d as usize)
}

/// One for the process: NVIDIA's driver (580.159) finds no adapter for the 31st, though all before it are dropped.
static INSTANCE: LazyLock<wgpu::Instance> =
    LazyLock::new(|| wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle()));

fn choose(name: Option<&str>) -> Result<wgpu::Adapter> {
    let instance = &*INSTANCE;
    let Some(name) = name else {
        return pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        }))
        .map_err(|_| {
            Error::runtime("no graphics adapter", "Vulkan, Metal or DirectX 12", "none was found")
                .hint(NO_ADAPTER_HINT)
        });
    };
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let names = adapters.iter().map(|a| a.get_info().name).collect::<Vec<_>>();
    let wanted = name.to_lowercase();
    adapters.into_iter().find(|a| a.get_info().name.to_lowercase().contains(&wanted)).ok_or_else(|| {
        let e = Error::input("no such graphics adapter", format!("--adapter {name}"), "no name contains it");
        e.hint(if names.is_empty() {
            NO_ADAPTER_HINT.into()
        } else {
            format!("there is: {}", names.join(", "))
        })
    })
}
