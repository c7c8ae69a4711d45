//! Chooses a graphics adapter, and opens its device with the highest limits that the adapter supports.

use super::clock_rate::ClockRate;
use super::counters::DeviceCounters;
use super::sharing::{Sharing, Uncaptured};
use super::tuning::Tuning;
use crate::error::{Error, Result};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::time::Instant;

/// Open graphics device with the highest limits that its adapter supports. Features beyond the WebGPU core are
/// optional.
#[derive(Debug)]
pub struct Gpu {
    /// Open graphics device of wgpu.
    pub device: wgpu::Device,
    /// Command queue of the graphics device.
    pub queue: wgpu::Queue,
    /// Name, backend and driver of the graphics adapter.
    pub info: wgpu::AdapterInfo,
    /// Choices of shader variants and of work order that suit the type of the adapter.
    pub tuning: Tuning,
    /// Limit on the memory for the voxels of a volume, bytes; `None`: what the device has.
    pub memory_limit: Option<u64>,
    /// Part of the limit that stays free while blocks of a volume's pages take turns, bytes.
    pub memory_reserve: u64,
    /// Whether the adapter can filter textures of 32-bit floats.
    pub filters_float32: bool,
    /// Nanoseconds per tick of the device timestamps; `None` for a software adapter or one without timestamps.
    pub timestamp_period_ns: Option<f32>,
    /// Source of the card's clock rate; `None` where the system reports none.
    pub clock_rate: Option<ClockRate>,
    /// Counters that shaders write: loops that reach their iteration limit, and executed operations.
    pub counters: DeviceCounters,
    /// State that threads share: device errors that wgpu reports outside of calls (validation, out of memory), and
    /// the time until which submissions are held back.
    pub sharing: Sharing,
    /// Number of submissions to the device, and of waits for it.
    pub traffic: Traffic,
    lost: DeviceLoss,
}

/// Numbers of submissions to a graphics device, and of waits of the host for it, since it was opened.
#[derive(Debug, Default)]
pub struct Traffic {
    submissions: AtomicU64,
    waits: AtomicU64,
}

impl Traffic {
    /// Returns the number of submissions, and the number of waits.
    pub fn counts(&self) -> [u64; 2] {
        [&self.submissions, &self.waits].map(|count| count.load(Ordering::Relaxed))
    }
}

/// Reason why the graphics device was lost; empty while it works. All clones refer to the same device.
#[derive(Debug, Clone, Default)]
pub struct DeviceLoss(Arc<Mutex<Option<String>>>);

impl DeviceLoss {
    /// Returns the driver's reason why the graphics device was lost; `None` while it works. No resource of a lost
    /// device can be used any more.
    pub fn reason(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

const NO_ADAPTER_HINT: &str = "install a Vulkan driver; without a GPU a software one will do \
    (Debian/Ubuntu: apt-get install mesa-vulkan-drivers libvulkan1)";

impl Gpu {
    /// Opens the graphics adapter whose name contains `name` (any case), or the system's preferred adapter.
    ///
    /// # Errors
    /// There is no adapter, none has that name, or it has no compute shaders. A hint says how to get a software
    /// adapter.
    pub fn open(name: Option<&str>) -> Result<Self> {
        let adapter = choose(name)?;
        let info = adapter.get_info();
        let (device, queue) = pollster::block_on(adapter.request_device(&Self::device_descriptor(&adapter)))
            .map_err(|e| Error::runtime("cannot open the graphics device", &info.name, e))?;
        Self::from_parts(&adapter, device, queue)
    }

    /// Returns the descriptor with which the graphics device is opened: the adapter's highest limits, and the
    /// optional features that it supports.
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

    /// Creates the graphics device from an open wgpu device, such as that of a window. It must have been opened with
    /// [`Self::device_descriptor`].
    ///
    /// # Errors
    /// The environment variable `UMBRAVOX_TUNING` has an unknown value ([`Tuning`]).
    pub fn from_parts(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Result<Self> {
        let info = adapter.get_info();
        let tuning = Tuning::of(&info)?;
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
            // A software adapter's timestamps need not enclose the work (lavapipe reported 0.04 ms for a pass of 75
            // ms). Its work runs on the host, and so the wall clock is right.
            .filter(|p| *p > 0.0 && info.device_type != wgpu::DeviceType::Cpu);
        tracing::info!("adapter: {} ({:?}, {} {})", info.name, info.backend, info.driver, info.driver_info);
        Ok(Self {
            counters: DeviceCounters::new(&device),
            clock_rate: ClockRate::of(&info),
            device,
            queue,
            info,
            tuning,
            memory_limit: None,
            memory_reserve: 0,
            filters_float32: features.contains(wgpu::Features::FLOAT32_FILTERABLE),
            timestamp_period_ns,
            sharing,
            traffic: Traffic::default(),
            lost,
        })
    }

    /// Limits the memory for the voxels of a volume, bytes. A larger volume is stored as pages
    /// ([`crate::field::DeviceVolume`]).
    #[must_use]
    pub fn with_memory_limit(self, memory_limit: Option<u64>) -> Self {
        Self { memory_limit, ..self }
    }

    /// Keeps a part of the limit on memory free, bytes, while blocks of a volume's pages take turns.
    #[must_use]
    pub fn with_memory_reserve(self, memory_reserve: u64) -> Self {
        Self { memory_reserve, ..self }
    }

    /// Whether the graphics adapter is a software adapter, which runs on the processor.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Returns the texture side to allocate for `side` texels ([`Tuning::odd_textures`]).
    pub fn texture_side(&self, side: u32) -> u32 {
        let padded = if side.is_power_of_two() { (side + 1).max(3) } else { side };
        let fits = padded <= self.device.limits().max_texture_dimension_2d;
        if fits && self.tuning.odd_textures { padded } else { side }
    }

    /// Returns a handle that tells later whether and why the graphics device was lost.
    pub fn loss(&self) -> DeviceLoss {
        self.lost.clone()
    }

    /// Returns the first device error that wgpu has reported outside of a call for this thread, and clears it.
    pub fn take_error(&self) -> Result<()> {
        let failed =
            |e: Uncaptured| Err(Error::runtime("the graphics device failed", &self.info.name, e.why));
        self.sharing.take_error().map_or(Ok(()), failed)
    }

    /// Submits commands to the graphics device. While another thread holds submissions back, it waits first.
    pub fn submit<I: IntoIterator<Item = wgpu::CommandBuffer>>(&self, commands: I) -> wgpu::SubmissionIndex {
        self.submit_timed(commands).1
    }

    /// Submits commands to the graphics device, and returns the time of the submission on the host.
    pub fn submit_timed<I: IntoIterator<Item = wgpu::CommandBuffer>>(
        &self,
        commands: I,
    ) -> (Instant, wgpu::SubmissionIndex) {
        self.traffic.submissions.fetch_add(1, Ordering::Relaxed);
        self.sharing.unheld(|| (Instant::now(), self.queue.submit(commands)))
    }

    /// Waits until the device has finished a submission, but not for later submissions of other threads.
    pub fn wait_for(&self, submission: wgpu::SubmissionIndex) -> Result<()> {
        self.traffic.waits.fetch_add(1, Ordering::Relaxed);
        self.device
            .poll(wgpu::PollType::Wait { submission_index: Some(submission), timeout: None })
            .map_err(|e| Error::runtime("the graphics device failed", &self.info.name, e))?;
        self.take_error()
    }

    /// Returns an error if a 2-D texture is larger than the adapter allows.
    pub fn check_texture(&self, label: &str, [width, height]: [u32; 2]) -> Result<()> {
        let limit = self.device.limits().max_texture_dimension_2d;
        if width.max(height) > limit {
            let why = format!("{width} x {height} texels, the adapter's textures end at {limit}");
            return Err(self.cannot_allocate(label, why));
        }
        Ok(())
    }

    /// Returns an error if a storage buffer is larger than the adapter can bind.
    pub(super) fn check_storage(&self, label: &str, bytes: u64) -> Result<()> {
        let limits = self.device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if bytes > limit {
            let why = format!("{bytes} bytes are more than the {limit} that the adapter can bind");
            return Err(self.cannot_allocate(label, why));
        }
        Ok(())
    }

    pub(super) fn cannot_allocate(&self, label: &str, why: String) -> Error {
        Error::runtime(format!("cannot allocate {label}"), &self.info.name, why)
    }
}

/// Returns the largest side of 3-D textures on the system's preferred graphics adapter, in texels; `None` without an
/// adapter.
pub fn texture_side() -> Option<usize> {
    choose(None).ok().map(|adapter| adapter.limits().max_texture_dimension_3d as usize)
}

/// Single wgpu instance of this program. NVIDIA's driver (580.159) finds no adapter for the 31st instance, even if
/// all others are dropped.
static INSTANCE: LazyLock<wgpu::Instance> =
    LazyLock::new(|| wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle()));

fn choose(name: Option<&str>) -> Result<wgpu::Adapter> {
    let instance = &*INSTANCE;
    let Some(name) = name else {
        return pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        }))
        .map_err(|_| no_adapter());
    };
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let names = adapters.iter().map(|a| a.get_info().name).collect::<Vec<_>>();
    if names.is_empty() {
        return Err(no_adapter());
    }
    let wanted = name.to_lowercase();
    adapters.into_iter().find(|a| a.get_info().name.to_lowercase().contains(&wanted)).ok_or_else(|| {
        Error::input("no such graphics adapter", format!("--adapter {name}"), "no name contains it")
            .hint(format!("there is: {}", names.join(", ")))
    })
}

/// Environment variables that replace the system's Vulkan drivers. The loader prefers the first.
const DRIVER_VARIABLES: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

/// Returns the error for a system without a graphics adapter. It names the variable that replaces the system's drivers.
fn no_adapter() -> Error {
    let value = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(|value| (name, value));
    let error = |why: &str| Error::runtime("no graphics adapter", "Vulkan, Metal or DirectX 12", why);
    let Some((name, value)) = DRIVER_VARIABLES.into_iter().find_map(value) else {
        return error("none was found").hint(NO_ADAPTER_HINT);
    };
    let missing = std::env::split_paths(&value).find(|file| !file.exists());
    let missing = missing.map_or(String::new(), |file| format!(", and {} does not exist", file.display()));
    error(&format!("none was found by the drivers that {name} names{missing}"))
        .hint(format!("unset {name} to use the system's drivers, or let it name the .json file of a driver"))
}
