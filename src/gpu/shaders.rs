//! Shader variants: the WGSL modules of a compute pipeline, composed by naga_oil.

use super::Tuning;
use crate::error::{Error, Result};
use include_dir::{Dir, include_dir};
use naga_oil::compose::{
    ComposableModuleDescriptor, Composer, NagaModuleDescriptor, ShaderDefValue, ShaderLanguage, ShaderType,
};
use wgpu::naga;

static SHADERS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/shaders");

/// Numeric constant with a name that host and shaders share; WGSL code refers to it as `#{NAME}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Constant {
    name: &'static str,
    value: Literal,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Literal {
    Unsigned(u32),
    Signed(i32),
    /// Bit pattern of a shader constant of type `f32`.
    Float(u32),
}

impl Constant {
    /// Creates a shader constant of type `u32`.
    pub const fn unsigned(name: &'static str, value: u32) -> Self {
        Self { name, value: Literal::Unsigned(value) }
    }

    /// Creates a shader constant of type `i32`.
    pub const fn signed(name: &'static str, value: i32) -> Self {
        Self { name, value: Literal::Signed(value) }
    }

    /// Creates a shader constant of type `f32`.
    pub const fn float(name: &'static str, value: f32) -> Self {
        Self { name, value: Literal::Float(value.to_bits()) }
    }

    /// Returns the value of a shader constant of type `u32` with this name; `None` for other constants.
    pub fn unsigned_value(&self, name: &str) -> Option<u32> {
        match self.value {
            Literal::Unsigned(value) if self.name == name => Some(value),
            _ => None,
        }
    }

    fn text(self) -> String {
        match self.value {
            Literal::Unsigned(value) => format!("{value}u"),
            Literal::Signed(value) => format!("{value}i"),
            // Rust's exponent form is the shortest text that reads back as the same float.
            Literal::Float(bits) => format!("{:e}f", f32::from_bits(bits)),
        }
    }
}

/// Shader of one compute pipeline: its WGSL files, definitions and constants.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct ShaderVariant {
    /// WGSL file with the shader's entry point, e.g. `render/raycast.wgsl`.
    pub entry: &'static str,
    /// WGSL modules of the shader variant, in the order of composition. Where several files define one import path,
    /// such as `umbravox::sink` and `umbravox::method`, a variant lists one of these files.
    pub modules: Vec<&'static str>,
    /// Names that are defined in the shader variant, for `#ifdef` in WGSL.
    pub defs: Vec<&'static str>,
    /// Values of the constants in the shader variant to which WGSL code refers as `#{NAME}`.
    pub constants: Vec<Constant>,
}

impl ShaderVariant {
    /// Creates a shader variant of one WGSL file, without modules.
    pub fn of(entry: &'static str) -> Self {
        Self { entry, modules: Vec::new(), defs: Vec::new(), constants: Vec::new() }
    }

    /// Appends WGSL modules to the shader variant.
    #[must_use]
    pub fn modules(mut self, modules: &[&'static str]) -> Self {
        self.modules.extend(modules);
        self
    }

    /// Appends names that WGSL code tests with `#ifdef` to the shader variant.
    #[must_use]
    pub fn defs(mut self, defs: impl IntoIterator<Item = &'static str>) -> Self {
        self.defs.extend(defs);
        self
    }

    /// Appends constants, to which WGSL code refers as `#{NAME}`, to the shader variant.
    #[must_use]
    pub fn constants(mut self, constants: &[Constant]) -> Self {
        self.constants.extend(constants);
        self
    }

    /// Returns the source of a WGSL file, with the values of its constants inserted.
    fn source(&self, path: &str, tuning: &Tuning) -> Result<String> {
        let fail = |why: String| Error::runtime("cannot compose shader", path, why);
        let file = SHADERS.get_file(path).and_then(|f| f.contents_utf8());
        let mut parts = file.ok_or_else(|| fail("no such file".into()))?.split("#{");
        let mut text = parts.next().unwrap_or_default().to_owned();
        let constants = tuning.constants().map(|(name, value)| Constant::unsigned(name, value));
        for part in parts {
            let (name, rest) = part.split_once('}').ok_or_else(|| fail("`#{` without `}`".into()))?;
            let value = self.constants.iter().chain(&constants).find(|c| c.name == name);
            text += &value.ok_or_else(|| fail(format!("no constant {name} is given")))?.text();
            text += rest;
        }
        Ok(text)
    }
}

/// Returns the paths of all WGSL files under `shaders/`, except those of the window.
pub fn shader_paths() -> Vec<&'static str> {
    let mut folders = vec![&SHADERS];
    let mut paths = Vec::new();
    while let Some(folder) = folders.pop() {
        folders.extend(folder.dirs());
        paths.extend(folder.files().filter_map(|f| f.path().to_str()));
    }
    paths.retain(|p| p.ends_with(".wgsl") && !p.starts_with("app/"));
    paths.sort_unstable();
    paths
}

/// Binding, in bind group 0, of the table of transfer-function intervals.
const TABLE_BINDING: u32 = 4;

/// Half floats packed in words are a part of WebGPU; only old OpenGL adapters lack them.
const CAPABILITIES: naga::valid::Capabilities = naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32;

/// Writes a composed module as WGSL; `entry` is the name of its file for errors.
///
/// # Errors
/// The module is not valid, or WGSL cannot express it: a fault of this program.
pub fn write_wgsl(entry: &str, module: &naga::Module) -> Result<String> {
    let fail = |why: String| Error::runtime("cannot write shader as WGSL", entry, why);
    let flags = naga::valid::ValidationFlags::all();
    let info = naga::valid::Validator::new(flags, CAPABILITIES).validate(module);
    let info = info.map_err(|e| fail(e.into_inner().to_string()))?;
    let options = naga::back::wgsl::WriterFlags::empty();
    naga::back::wgsl::write_string(module, &info, options).map_err(|e| fail(e.to_string()))
}

/// Composes the WGSL files of a shader variant to one naga module, with the choices that suit an adapter.
///
/// # Errors
/// The shader cannot be composed, which is a fault of this program. The error has naga's message.
pub fn compose(variant: &ShaderVariant, tuning: &Tuning) -> Result<naga::Module> {
    let fail = |file: &str, why: String| Error::runtime("cannot compose shader", file, why);
    let defs = || {
        let all = variant.defs.iter().copied().chain(tuning.defs());
        all.map(|d| (d.to_string(), ShaderDefValue::Bool(true))).collect()
    };
    let mut composer = Composer::default().with_capabilities(CAPABILITIES);
    for path in &variant.modules {
        composer
            .add_composable_module(ComposableModuleDescriptor {
                source: &variant.source(path, tuning)?,
                file_path: path,
                language: ShaderLanguage::Wgsl,
                shader_defs: defs(),
                ..Default::default()
            })
            .map(|_| ())
            .map_err(|e| fail(path, e.emit_to_string(&composer)))?;
    }
    let mut module = composer
        .make_naga_module(NagaModuleDescriptor {
            source: &variant.source(variant.entry, tuning)?,
            file_path: variant.entry,
            shader_type: ShaderType::Wgsl,
            shader_defs: defs(),
            ..Default::default()
        })
        .map_err(|e| fail(variant.entry, e.emit_to_string(&composer)))?;
    for (_, global) in module.global_variables.iter_mut() {
        let moves = global.binding.is_some_and(|b| match b.group {
            0 => tuning.storage_tables && b.binding == TABLE_BINDING,
            _ => tuning.storage_uniforms,
        });
        if moves && global.space == naga::AddressSpace::Uniform {
            global.space = naga::AddressSpace::Storage { access: naga::StorageAccess::LOAD };
        }
    }
    Ok(module)
}
