//! Registers, spills and instructions of the compute shaders of graphics cards, as AMD's compiler in Mesa sees them.
//!
//! Mesa's RADV driver compiles for a chosen card on its null device, which executes nothing. The figures depend on the
//! version of Mesa: `registers.tsv` names the one that it was made with, and another version skips the comparison.
//! `UMBRAVOX_REWRITE=1` writes the file anew.

use crate::common;
use ash::vk;
use std::collections::{BTreeMap, HashSet};
use std::ffi::CStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use umbravox::gpu::{ShaderVariant, Tuning, compose};
use umbravox::render::shaders;
use umbravox::shadow::parse;
use wgpu::naga::{self, back::spv, proc::BoundsCheckPolicy};

/// Card for which Mesa compiles.
const CARD: &str = "NAVI21";
/// Methods whose shaders are compiled: every method, and the settings with the largest shaders.
const METHODS: [&str; 22] = [
    "rays",
    "dsm",
    "dsm:march=samples",
    "dsm:compress=optimal",
    "dsm:prefilter=5",
    "dsm:precompress=off",
    "osm:layers=32",
    "dom:layers=15",
    "bom:layers=15",
    "clusters:clusters=4",
    "clusters:clusters=8",
    "fourier:terms=7",
    "fourier:terms=15",
    "avsm:nodes=8",
    "avsm:nodes=16",
    "moments:moments=6",
    "moments:moments=8",
    "wavelet:rank=4",
    "beer",
    "lightvolume:scale=4",
    "sat",
    "halfangle",
];
/// Largest relative difference from the table.
const TOLERANCE: f64 = 0.1;
/// Environment variable of the child process that compiles the shaders.
const CHILD: &str = "UMBRAVOX_COMPILE_FOR_CARD";

/// Figures of one shader.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Statistics {
    /// Vector registers.
    registers: u64,
    /// Scalar and vector registers that are spilled.
    spills: u64,
    /// Bytes of scratch memory of each subgroup.
    scratch: u64,
    instructions: u64,
}

/// Shaders of the build passes and of a picture with shadows, for each method.
fn wanted() -> BTreeMap<String, ShaderVariant> {
    let mut all = BTreeMap::new();
    // Settings that only change another pass share a shader.
    let mut seen = HashSet::new();
    let mut add = |method: &str, variant: ShaderVariant| {
        if !seen.insert(variant.clone()) {
            return;
        }
        let pass = Path::new(variant.entry).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        all.entry(format!("{method} {pass}")).or_insert(variant);
    };
    let picture = |list: Vec<ShaderVariant>| {
        let plain = |v: &ShaderVariant| {
            ["SKIP_BRICKS", "ONE_COLOR", "DEVICE_TILES"].iter().all(|def| v.defs.contains(def))
                && !v.defs.contains(&"SHADING")
        };
        list.into_iter().find(|v| v.entry == "render/raycast.wgsl" && plain(v))
    };
    picture(shaders(None)).into_iter().for_each(|variant| add("none", variant));
    for name in METHODS {
        let method = parse(name).unwrap();
        method.passes().into_iter().for_each(|variant| add(name, variant));
        picture(shaders(method.lookup().as_ref())).into_iter().for_each(|variant| add(name, variant));
    }
    all
}

/// Translates a shader to SPIR-V as wgpu does for an adapter with robust access to buffers and images.
fn spirv(variant: &ShaderVariant) -> (naga::Module, Vec<u32>) {
    let module = compose(variant, &Tuning::CARD).unwrap();
    let capabilities = naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32;
    let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities);
    let info = validator.validate(&module).unwrap();
    let options = spv::Options {
        lang_version: (1, 5),
        bounds_check_policies: naga::proc::BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            buffer: BoundsCheckPolicy::Unchecked,
            image_load: BoundsCheckPolicy::Unchecked,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::Polyfill,
        force_loop_bounding: Tuning::CARD.bounded_loops,
        ..Default::default()
    };
    let words = spv::write_vec(&module, &info, &options, None).unwrap();
    (module, words)
}

/// Bindings of a shader in each bind group.
fn bindings(module: &naga::Module) -> BTreeMap<u32, Vec<vk::DescriptorSetLayoutBinding<'static>>> {
    let mut groups: BTreeMap<u32, Vec<_>> = (0..4).map(|group| (group, Vec::new())).collect();
    for (_, global) in module.global_variables.iter() {
        let Some(at) = global.binding else { continue };
        let ty = match (global.space, &module.types[global.ty].inner) {
            (naga::AddressSpace::Uniform, _) => vk::DescriptorType::UNIFORM_BUFFER,
            (naga::AddressSpace::Storage { .. }, _) => vk::DescriptorType::STORAGE_BUFFER,
            (_, naga::TypeInner::Sampler { .. }) => vk::DescriptorType::SAMPLER,
            (_, naga::TypeInner::Image { class: naga::ImageClass::Storage { .. }, .. }) => {
                vk::DescriptorType::STORAGE_IMAGE
            }
            _ => vk::DescriptorType::SAMPLED_IMAGE,
        };
        let binding = vk::DescriptorSetLayoutBinding::default();
        let binding = binding.binding(at.binding).descriptor_type(ty).descriptor_count(1);
        groups.entry(at.group).or_default().push(binding.stage_flags(vk::ShaderStageFlags::COMPUTE));
    }
    groups
}

/// Null device of RADV, on which shaders are compiled and nothing is executed.
struct NullDevice {
    _entry: ash::Entry,
    device: ash::Device,
    statistics: ash::khr::pipeline_executable_properties::Device,
    /// Name and version of the driver.
    driver: String,
}

impl NullDevice {
    /// Opens the null device; `None` if Mesa's driver or the Vulkan loader is not installed.
    fn open() -> Option<Self> {
        // SAFETY: Vulkan is used as its specification says; all handles live until the process ends.
        unsafe {
            let entry = ash::Entry::load().ok()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let create = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&create, None).ok()?;
            let physical = *instance.enumerate_physical_devices().ok()?.first()?;
            let mut driver = vk::PhysicalDeviceDriverProperties::default();
            let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
            instance.get_physical_device_properties2(physical, &mut properties);
            let text =
                |chars: &[std::ffi::c_char]| CStr::from_ptr(chars.as_ptr()).to_string_lossy().into_owned();
            let driver = format!("{} {}", text(&driver.driver_name), text(&driver.driver_info));
            let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
            let extensions = [ash::khr::pipeline_executable_properties::NAME.as_ptr()];
            let mut executables = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
                .pipeline_executable_info(true);
            let features = vk::PhysicalDeviceFeatures::default().robust_buffer_access(true);
            let create = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
            let create = create.enabled_extension_names(&extensions).enabled_features(&features);
            let device = instance.create_device(physical, &create.push_next(&mut executables), None).ok()?;
            let statistics = ash::khr::pipeline_executable_properties::Device::new(&instance, &device);
            Some(Self { _entry: entry, device, statistics, driver })
        }
    }

    /// Compiles a shader and returns its figures.
    fn compile(&self, variant: &ShaderVariant) -> Result<Statistics, vk::Result> {
        let (module, words) = spirv(variant);
        // SAFETY: As in `open`; the module and the layouts come from one shader.
        unsafe {
            let mut layouts = Vec::new();
            for bindings in bindings(&module).values() {
                let create = vk::DescriptorSetLayoutCreateInfo::default().bindings(bindings);
                layouts.push(self.device.create_descriptor_set_layout(&create, None)?);
            }
            let create = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
            let layout = self.device.create_pipeline_layout(&create, None)?;
            let shader = self
                .device
                .create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None)?;
            let name = std::ffi::CString::new(module.entry_points[0].name.clone()).unwrap_or_default();
            let stage = vk::PipelineShaderStageCreateInfo::default().stage(vk::ShaderStageFlags::COMPUTE);
            let create = vk::ComputePipelineCreateInfo::default()
                .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
                .stage(stage.module(shader).name(&name))
                .layout(layout);
            let made = self.device.create_compute_pipelines(vk::PipelineCache::null(), &[create], None);
            let pipeline = made.map_err(|(_, error)| error)?[0];
            let executable = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
            let found = self.statistics.get_pipeline_executable_statistics(&executable)?;
            let figure = |names: &[&[u8]]| {
                let is = |s: &&vk::PipelineExecutableStatisticKHR<'_>| {
                    let name = s.name_as_c_str().unwrap_or_default().to_bytes();
                    names.contains(&name)
                };
                found.iter().filter(is).map(|s| s.value.u64).sum()
            };
            Ok(Statistics {
                registers: figure(&[b"VGPRs"]),
                spills: figure(&[b"Spilled SGPRs", b"Spilled VGPRs"]),
                scratch: figure(&[b"Scratch size"]),
                instructions: figure(&[b"Instructions"]),
            })
        }
    }
}

/// Compiles all shaders and prints their figures, in a process that has RADV's null device as its only adapter.
#[test]
fn child_that_compiles_for_a_card() {
    if std::env::var(CHILD).is_err() {
        return;
    }
    let Some(device) = NullDevice::open() else { return };
    println!("driver\t{CARD} {}", device.driver);
    for (name, variant) in wanted() {
        let Statistics { registers, spills, scratch, instructions } = device.compile(&variant).unwrap();
        println!("shader\t{name}\t{registers}\t{spills}\t{scratch}\t{instructions}");
    }
}

/// Returns the driver and the figures of each shader; `None` if Mesa's driver for AMD's cards is not installed.
fn compiled() -> Option<(String, BTreeMap<String, Statistics>)> {
    let folders = ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"];
    let driver = folders.iter().find_map(|folder| {
        let file = Path::new(folder).join("radeon_icd.x86_64.json");
        file.exists().then_some(file)
    })?;
    let cache = tempfile::tempdir().unwrap();
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "registers::child_that_compiles_for_a_card", "--nocapture", "--test-threads=1"])
        .env(CHILD, "1")
        .env("RADV_FORCE_FAMILY", CARD)
        .envs(["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|name| (name, &driver)))
        .env("MESA_SHADER_CACHE_DISABLE", "true")
        .env("XDG_CACHE_HOME", cache.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}{errors}");
    parsed(&text)
}

/// Parses lines `driver NAME` and `shader NAME REGISTERS SPILLS SCRATCH INSTRUCTIONS`, with tabs.
fn parsed(text: &str) -> Option<(String, BTreeMap<String, Statistics>)> {
    let fields = |line: &str| line.split('\t').map(str::to_owned).collect::<Vec<_>>();
    // The test harness may have begun a line.
    let driver = text.lines().find_map(|line| Some(line.split_once("driver\t")?.1.to_owned()))?;
    let shaders = text.lines().map(fields).filter(|f| f[0] == "shader").map(|f| {
        let [registers, spills, scratch, instructions] = [2, 3, 4, 5].map(|i| f[i].parse().unwrap());
        (f[1].clone(), Statistics { registers, spills, scratch, instructions })
    });
    Some((driver, shaders.collect()))
}

/// Whether a figure is at most 10 % and 8 units larger than in the table. Smaller figures are welcome.
fn is_near(figure: u64, table: u64) -> bool {
    figure as f64 <= table as f64 * (1.0 + TOLERANCE) + 8.0
}

#[test]
fn shaders_for_cards_need_few_registers() {
    let Some((driver, found)) = compiled() else {
        return common::skip("Mesa's driver for AMD's cards is not installed");
    };
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/it/registers.tsv");
    if std::env::var_os("UMBRAVOX_REWRITE").is_some() {
        let mut text = format!("driver\t{driver}\n");
        for (name, Statistics { registers, spills, scratch, instructions }) in &found {
            text += &format!("shader\t{name}\t{registers}\t{spills}\t{scratch}\t{instructions}\n");
        }
        return std::fs::write(file, text).unwrap();
    }
    let (made_with, table) = parsed(&std::fs::read_to_string(file).unwrap()).unwrap();
    if driver != made_with {
        return common::skip(&format!("the table of registers is of {made_with}, and this is {driver}"));
    }
    for (name, s) in &found {
        let most = match name.as_str() {
            "dsm build" => 96,
            // Its corners were faster in registers and local memory than in workgroup memory, on an H100.
            "dsm:compress=optimal build" => 192,
            "rays raycast" => 128,
            _ => u64::MAX,
        };
        assert!(s.registers <= most && s.scratch == 0, "{name}: {s:?}, at most {most} registers");
    }
    assert!(found.keys().eq(table.keys()), "UMBRAVOX_REWRITE=1 lists the shaders anew");
    for (name, s) in &found {
        let t = &table[name];
        let near = [(s.registers, t.registers), (s.spills, t.spills), (s.instructions, t.instructions)];
        assert!(near.iter().all(|(s, t)| is_near(*s, *t)), "{name}: {s:?}, in the table {t:?}");
    }
}
