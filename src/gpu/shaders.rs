//! WGSL modules, put together by naga_oil: which files make a pipeline is decided here by name.

use crate::error::{Error, Result};
use naga_oil::compose::{
    ComposableModuleDescriptor, Composer, NagaModuleDescriptor, ShaderDefValue, ShaderLanguage, ShaderType,
};

macro_rules! shader {
    ($path:literal) => {
        ($path, include_str!(concat!("../../shaders/", $path)))
    };
}

/// Every WGSL file: path under `shaders/` and text.
pub const fn sources() -> &'static [(&'static str, &'static str)] {
    &[
        shader!("common/field.wgsl"),
        shader!("common/transfer.wgsl"),
        shader!("common/light.wgsl"),
        shader!("common/march.wgsl"),
        shader!("shadow/total.wgsl"),
        shader!("shadow/rays.wgsl"),
        shader!("shadow/deep_layout.wgsl"),
        shader!("shadow/deep_nodes.wgsl"),
        shader!("shadow/deep_sink.wgsl"),
        shader!("shadow/deep.wgsl"),
        shader!("shadow/deep_build.wgsl"),
        shader!("shadow/deep_count.wgsl"),
        shader!("shadow/layers_layout.wgsl"),
        shader!("shadow/layers_read.wgsl"),
        shader!("shadow/layers_sink.wgsl"),
        shader!("shadow/layers_build.wgsl"),
        shader!("shadow/start_sink.wgsl"),
        shader!("shadow/layers_start.wgsl"),
        shader!("shadow/mass_sink.wgsl"),
        shader!("shadow/layers_mass.wgsl"),
        shader!("shadow/opacity.wgsl"),
        shader!("shadow/deep_opacity.wgsl"),
        shader!("shadow/layers_ratio.wgsl"),
        shader!("raycast.wgsl"),
        shader!("query.wgsl"),
        shader!("display.wgsl"),
    ]
}

/// Which files and definitions make one pipeline.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct ShaderVariant {
    /// File with the entry point, e.g. `raycast.wgsl`.
    pub entry: &'static str,
    /// Modules added in order; two files may offer one import path (`umbravox::sink`, `umbravox::method`): the variant
    /// names the one it means.
    pub modules: Vec<&'static str>,
    /// Names defined for `#ifdef`.
    pub defs: Vec<&'static str>,
}

/// Composes a variant to a naga module.
///
/// # Errors
/// A shader that does not compose is a fault of this program: runtime error with naga's message.
pub fn compose(variant: &ShaderVariant) -> Result<wgpu::naga::Module> {
    let fail = |file: &str, why: String| Error::runtime("cannot compose shader", file, why);
    let source = |path: &str| {
        sources()
            .iter()
            .find(|(p, _)| *p == path)
            .map(|(_, text)| *text)
            .ok_or_else(|| fail(path, "no such file".into()))
    };
    let defs = || variant.defs.iter().map(|d| (d.to_string(), ShaderDefValue::Bool(true))).collect();
    // Half floats packed in words: a part of WebGPU, which only OpenGL's older adapters lack.
    let capabilities = wgpu::naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32;
    let mut composer = Composer::default().with_capabilities(capabilities);
    for path in &variant.modules {
        composer
            .add_composable_module(ComposableModuleDescriptor {
                source: source(path)?,
                file_path: path,
                language: ShaderLanguage::Wgsl,
                shader_defs: defs(),
                ..Default::default()
            })
            .map(|_| ())
            .map_err(|e| fail(path, e.emit_to_string(&composer)))?;
    }
    composer
        .make_naga_module(NagaModuleDescriptor {
            source: source(variant.entry)?,
            file_path: variant.entry,
            shader_type: ShaderType::Wgsl,
            shader_defs: defs(),
            ..Default::default()
        })
        .map_err(|e| fail(variant.entry, e.emit_to_string(&composer)))
}
