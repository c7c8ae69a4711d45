//! Every shader composes and validates without a device, for all flags, settings of shadow methods, and adapters.

use crate::common::{self, Requirement, SIZES};
use rayon::prelude::*;
use std::collections::hash_map::DefaultHasher;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::hash::{Hash, Hasher};
use std::io::Write;
use std::process::{Command, Stdio};
use umbravox::field::marches_cells;
use umbravox::gpu::{ShaderVariant, Tuning, compose, shader_paths};
use umbravox::render::shaders;
use umbravox::shadow::{Entry, Kind, METHODS, Method, When, parse_list};
use wgpu::naga::{self, back};

/// Settings of shadow methods whose code is independent of the other settings: each is tried with their defaults.
const ALONE: [&str; 7] = ["lookup", "average", "march", "compress", "from", "kernel", "between"];

/// Tunings of shaders: for software adapters, for those in a window, and for graphics cards.
const TUNINGS: [Tuning; 3] =
    [Tuning::SOFTWARE, Tuning { storage_uniforms: true, ..Tuning::SOFTWARE }, Tuning::CARD];

/// Whether a setting is combined with all others: one that always has an effect, or has one on every march.
fn is_common(when: When) -> bool {
    matches!(when, When::Always | When::Unless("from", _))
}

/// Every combination of a shadow method's word settings, with small and large values of its counts.
fn settings(entry: &Entry) -> Vec<Box<dyn Method>> {
    let values = |kind: Kind| match kind {
        Kind::Choice(names) => names.iter().map(|n| n.to_string()).collect(),
        // Records are packed by how many layers there are; sides of maps make no other shader, nor do numbers.
        // Other counts are constants of their shaders.
        Kind::Whole { least, most } if most <= 512 => {
            let few = if most == 512 { 9 } else { 3 };
            (least..least + few).map(|n| n.to_string()).collect()
        }
        Kind::Whole { .. } | Kind::WholeOr { .. } | Kind::Number { .. } | Kind::NumberOr { .. } => Vec::new(),
    };
    let keys = entry.keys.iter().filter(|k| is_common(k.when) && !ALONE.contains(&k.name));
    let keys = keys.map(|k| (k.name, values(k.kind))).filter(|(_, v)| !v.is_empty());
    let mut keys: Vec<(&str, Vec<String>)> = keys.collect();
    let alone = entry.keys.iter().filter(|k| ALONE.contains(&k.name));
    let alone = alone.map(|k| format!("{}:{}={}", entry.name, k.name, values(k.kind).join(",")));
    let mut specs: Vec<String> = alone.collect();
    if entry.keys.iter().any(|k| k.name == "near") {
        let filters = entry.keys.iter().find(|k| k.name == "filter").map_or(Vec::new(), |k| values(k.kind));
        specs.push(format!("{}:near=0,4,filter={}", entry.name, filters.join(",")));
    }
    // One value at a time, since a list has a largest length.
    match keys.pop() {
        Some((first, values)) => {
            let rest: String =
                keys.iter().map(|(name, values)| format!(",{name}={}", values.join(","))).collect();
            specs.extend(values.iter().map(|v| format!("{}:{first}={v}{rest}", entry.name)));
        }
        None => specs.push(entry.name.into()),
    }
    specs.iter().flat_map(|spec| parse_list(spec).unwrap()).collect()
}

/// All shader variants of scenes and settings, each with all that adapters and transfer functions add, and with
/// the tuning for a type of adapter.
fn variants() -> Vec<(ShaderVariant, Tuning)> {
    let mut wanted: HashSet<ShaderVariant> = shaders(None).into_iter().collect();
    for entry in METHODS {
        for method in settings(entry) {
            wanted.extend(method.passes());
            wanted.extend(shaders(method.lookup().as_ref()));
        }
    }
    let mut wanted: Vec<_> = wanted.into_iter().collect();
    wanted.sort_by_cached_key(|variant| format!("{variant:?}"));
    let mut list = Vec::new();
    for variant in wanted {
        let search: &[&[&str]] = if marches_cells(&variant) { &[&[], &["MANY_BREAKPOINTS"]] } else { &[&[]] };
        for more in search {
            let adapters = [&[][..], &["MANUAL_TRILINEAR", "CLIP", "LABELS"]];
            let functions = [&[][..], &["GRADIENT_OPACITY"]];
            for defs in adapters.iter().flat_map(|adapter| functions.map(|of| [*adapter, of].concat())) {
                let variant = variant.clone().defs([more.to_vec(), defs].concat());
                let paged = variant.clone().defs(["PAGED", "MANUAL_TRILINEAR"]);
                list.push((paged.clone(), Tuning::SOFTWARE));
                list.extend(streamed(&paged).map(|variant| (variant, Tuning::SOFTWARE)));
                // Whole numbers change the type of the volume texture.
                list.push((paged.defs(["WHOLE_TEXELS"]), Tuning::SOFTWARE));
                list.extend(TUNINGS.map(|tuning| (variant.clone(), tuning)));
            }
        }
    }
    list
}

/// Variant for volumes whose pages become resident block by block; `None` if the shader needs the whole volume.
fn streamed(paged: &ShaderVariant) -> Option<ShaderVariant> {
    let needs_all = |def: &&str| ["RESUMABLE", "SECTIONS", "MESH"].contains(def);
    let waits = match paged.entry {
        "render/query.wgsl" => return Some(paged.clone().defs(["STREAMED"])),
        "render/raycast.wgsl" => !paged.defs.iter().any(needs_all),
        _ => paged.ray_state_words().is_some(),
    };
    waits.then(|| paged.clone().defs(["STREAMED", "RAY_STATES"]))
}

/// Text of a file below `shaders/`.
fn source(path: &str) -> String {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders").join(path);
    std::fs::read_to_string(file).unwrap()
}

fn hash(value: &impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}

/// Selects shader variants that together contain every pair of settings of each shader. A setting is a definition
/// that is present or not, the value of a constant, or the tuning for a type of adapter. All combinations would be
/// ten times
/// as many.
fn pairwise(mut variants: Vec<(ShaderVariant, Tuning)>) -> Vec<(ShaderVariant, Tuning)> {
    let files: HashMap<&str, String> = shader_paths().into_iter().map(|path| (path, source(path))).collect();
    let all: BTreeSet<&str> = variants.iter().flat_map(|(variant, _)| variant.defs.iter().copied()).collect();
    // In a shuffled order, variants that follow each other differ in many settings, and fewer have every pair.
    variants.sort_by_cached_key(hash);
    let mut used: HashMap<u64, Vec<&str>> = HashMap::new();
    let mut pairs = HashSet::new();
    variants.retain(|(variant, tuning)| {
        let shader = hash(&(variant.entry, &variant.modules));
        let defs = used.entry(shader).or_insert_with(|| {
            let paths = || variant.modules.iter().chain([&variant.entry]);
            let mentions = |def: &&str| paths().any(|path| files[path].contains(*def));
            all.iter().copied().filter(mentions).collect()
        });
        let mut settings = vec![hash(tuning)];
        settings.extend(defs.iter().map(|def| hash(&(def, variant.defs.contains(def)))));
        settings.extend(variant.constants.iter().map(hash));
        let mut adds = false;
        for (n, one) in settings.iter().enumerate() {
            for other in &settings[n..] {
                adds |= pairs.insert((shader, *one, *other));
            }
        }
        adds
    });
    variants
}

/// Composes a shader variant and validates the module.
fn validated(variant: &ShaderVariant, tuning: &Tuning) -> (naga::Module, naga::valid::ModuleInfo) {
    let module = compose(variant, tuning).unwrap_or_else(|e| panic!("{variant:?}: {e}"));
    let mut validator = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        // Half floats packed in words, which every adapter but OpenGL's older ones has.
        naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32,
    );
    let info =
        validator.validate(&module).unwrap_or_else(|e| panic!("{variant:?}: {}", e.emit_to_string("")));
    assert_eq!(module.entry_points.len(), 1, "{variant:?}");
    for (_, global) in module.global_variables.iter() {
        let moves = global.binding.is_some_and(|b| b.group > 0);
        let uniform = global.space == naga::AddressSpace::Uniform;
        assert!(!(tuning.storage_uniforms && moves && uniform), "{:?} of {variant:?}", global.name);
    }
    (module, info)
}

/// Translates a shader module for each kind of driver. None of these drivers is needed on the test machine.
fn translate(
    variant: &ShaderVariant,
    module: &naga::Module,
    info: &naga::valid::ModuleInfo,
    spirv_val: bool,
) {
    let fail = |driver: &str, e: &dyn std::fmt::Display| -> ! { panic!("{driver} of {variant:?}: {e}") };
    let words = back::spv::write_vec(module, info, &back::spv::Options::default(), None)
        .unwrap_or_else(|e| fail("SPIR-V", &e));
    if spirv_val {
        let mut run = Command::new("spirv-val")
            .args(["--target-env", "vulkan1.1"])
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        run.stdin.take().unwrap().write_all(&bytes).unwrap();
        let output = run.wait_with_output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        if !output.status.success() {
            fail("SPIR-V", &String::from_utf8_lossy(&said));
        }
    }
    // The slot in which wgpu binds the lengths of buffers.
    let resources = back::msl::EntryPointResources { sizes_buffer: Some(30), ..Default::default() };
    let metal = back::msl::Options {
        lang_version: (2, 4),
        per_entry_point_map: [(module.entry_points[0].name.clone(), resources)].into(),
        fake_missing_bindings: true,
        ..Default::default()
    };
    let (metal_text, _) =
        back::msl::write_string(module, info, &metal, &back::msl::PipelineOptions::default())
            .unwrap_or_else(|e| fail("MSL", &e));
    let mut direct_text = String::new();
    let direct = back::hlsl::Options::default();
    back::hlsl::Writer::new(&mut direct_text, &direct, &Default::default())
        .write(module, info, None)
        .unwrap_or_else(|e| fail("HLSL", &e));
    assert!(metal_text.contains("kernel void") && direct_text.contains("numthreads"), "{variant:?}");
}

/// Selected shader variants for tests, with the number of all.
pub fn tried() -> (Vec<(ShaderVariant, Tuning)>, usize) {
    let variants = variants();
    let count = variants.len();
    (pairwise(variants).into_iter().step_by(SIZES.shader_stride).collect(), count)
}

#[test]
fn every_shader_composes_validates_and_translates_for_every_driver() {
    let spirv_val = common::starts("spirv-val");
    if !spirv_val {
        Requirement::SpirvVal.missing("there is no spirv-val");
    }
    let start = std::time::Instant::now();
    let variants = variants();
    let count = variants.len();
    let chosen = pairwise(variants);
    println!("{} of {count} variants have every pair, {:?}", chosen.len(), start.elapsed());
    let tried: Vec<_> = chosen.iter().step_by(SIZES.shader_stride).collect();
    tried.par_iter().for_each(|(variant, tuning)| {
        let (module, info) = validated(variant, tuning);
        translate(variant, &module, &info, spirv_val);
    });
    println!("{} of them tried, {:?}", tried.len(), start.elapsed());
    let used: BTreeSet<_> =
        chosen.iter().flat_map(|(v, _)| v.modules.iter().chain([&v.entry])).copied().collect();
    // The example method is compiled under its own feature only.
    let compiled = |p: &&str| cfg!(feature = "half") || !p.starts_with("shadow/half/");
    let unused: Vec<_> = shader_paths().into_iter().filter(compiled).filter(|p| !used.contains(p)).collect();
    assert!(unused.is_empty(), "no variant is made of {unused:?}");
}

#[test]
fn combined_requests_are_composed_together() {
    let variants = variants();
    let has = |names: &[&str], tuning: Tuning| {
        variants.iter().any(|(v, t)| *t == tuning && names.iter().all(|n| v.defs.contains(n)))
    };
    for tuning in TUNINGS {
        assert!(has(&["ONE_COLOR", "SHADOWS", "BLINN_PHONG", "SKIP_BRICKS"], tuning));
        assert!(has(&["MANUAL_TRILINEAR", "MANY_BREAKPOINTS", "RESUMABLE"], tuning));
        assert!(has(&["MANUAL_TRILINEAR", "MANY_BREAKPOINTS", "SPLIT_ROWS", "WORDS_2"], tuning));
    }
    assert!(has(&["PAGED", "WHOLE_TEXELS", "MANY_BREAKPOINTS", "SPLIT_ROWS"], Tuning::SOFTWARE));
    assert!(has(&["RAY_STATES", "LABELS", "OPTICAL_DEPTH"], Tuning::SOFTWARE));
}

#[test]
fn a_number_that_two_files_know_comes_from_the_host() {
    let mut homes = BTreeMap::<String, BTreeSet<&str>>::new();
    for path in shader_paths() {
        let text = source(path);
        let constants = text.lines().filter_map(|l| l.strip_prefix("const ")?.split_once(':'));
        for (name, rest) in constants.filter(|(_, rest)| !rest.contains("#{")) {
            assert!(rest.contains('='), "{path}: {name}");
            homes.entry(name.into()).or_default().insert(path);
        }
    }
    assert!(homes.len() > 10, "{homes:?}");
    let shared: Vec<_> = homes.iter().filter(|(_, paths)| paths.len() > 1).collect();
    assert!(shared.is_empty(), "{shared:?}");
}
