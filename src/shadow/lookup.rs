//! Shader code of transmittance queries.

use super::filter::{Filter, GAUSS_SIGMA};
use super::keys::{Align, Lookups};
use super::sections::SECTIONS;
use crate::field::{LightSpace, marches_cells, marches_samples};
use crate::gpu::{Constant, ShaderVariant};

/// Largest difference in depth at which neighbouring shadow map texels still count as one surface, in widths of a
/// texel.
const STEEPEST_SURFACE: f32 = 4.0;

/// Returns the largest shift in depth that the alignment of texels makes, mm.
pub(super) fn steepest_mm(light_space: &LightSpace) -> f64 {
    f64::from(STEEPEST_SURFACE) * light_space.texel_mm()
}

/// WGSL module of random estimates of the transmittance of a shadow ray.
pub(super) const RANDOM_RAYS: &str = "shadow/rays/random_rays.wgsl";

/// Definition by which the light between two queries on an eye ray is linear in both. Without it, its logarithm is.
const LINEAR_LIGHT: &str = "LINEAR_LIGHT";

/// Shader code of a transmittance query: modules, definitions and constants that provide
/// `umbravox::shadow::transmittance`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lookup {
    shader: ShaderVariant,
    /// File of the module `umbravox::shadow`, which answers a scene's queries with those of the shadow method.
    module: &'static str,
}

impl Lookup {
    /// Creates the shader code of a transmittance query from a [`field_shader`](crate::field::field_shader) with the
    /// module `umbravox::method` of a shadow method; the entry point of that shader is ignored.
    pub fn new(shader: ShaderVariant) -> Self {
        Self { shader, module: "shadow/direct.wgsl" }
    }

    /// Creates the shader code of a query for a bound on transmittance. The shader marches light rays, and its method is
    /// a deep shadow map of enclosing curves.
    pub(super) fn enclosing(shader: ShaderVariant) -> Self {
        Self { shader, module: "shadow/enclosed.wgsl" }
    }

    /// Adds preprocessor definitions.
    #[must_use]
    pub(super) fn defs(self, defs: impl IntoIterator<Item = &'static str>) -> Self {
        Self { shader: self.shader.defs(defs), ..self }
    }

    /// Adds a march from the point towards the light, `near` smallest voxel spacings long, before the query of the
    /// shadow method; none if `near` is 0.
    #[must_use]
    pub fn with_near(self, near: f64) -> Self {
        Self { module: if near > 0.0 { "shadow/near.wgsl" } else { self.module }, ..self }
    }

    /// Sets whether neighbouring samples of a camera ray share one transmittance query.
    #[must_use]
    pub fn with_lookup_mode(self, samples: Lookups) -> Self {
        self.defs((samples == Lookups::Each).then_some("LOOKUP_EACH"))
    }

    /// Makes pictures interpolate the light between two queries on a camera ray linearly, and not its logarithm.
    #[must_use]
    pub fn with_linear_light(self) -> Self {
        self.defs([LINEAR_LIGHT])
    }

    /// Whether pictures interpolate the light between two queries on a camera ray linearly.
    pub fn has_linear_light(&self) -> bool {
        self.shader.defs.contains(&LINEAR_LIGHT)
    }

    /// Whether each sample of a camera ray has a transmittance query of its own.
    pub fn answers_each_sample(&self) -> bool {
        self.shader.defs.contains(&"LOOKUP_EACH")
    }

    /// Makes a query answer for one section of the volume at a time.
    #[must_use]
    pub(super) fn in_sections(self) -> Self {
        self.defs([SECTIONS])
    }

    /// Whether a query answers for one section of the volume at a time ([`Sections`](super::sections::Sections)).
    pub fn has_sections(&self) -> bool {
        self.shader.defs.contains(&SECTIONS)
    }

    /// Returns the shader with the given entry file, together with the code of the transmittance query.
    pub fn within(&self, entry: &'static str) -> ShaderVariant {
        ShaderVariant { entry, ..self.shader.clone() }.modules(&[self.module])
    }

    /// Whether a transmittance query marches a whole light ray, so that a picture takes several GPU dispatches.
    pub fn marches(&self) -> bool {
        let is_random = self.shader.modules.contains(&RANDOM_RAYS);
        is_random || marches_cells(&self.shader) || marches_samples(&self.shader)
    }

    /// Whether a transmittance query marches a light ray cell by cell, with the table of breakpoints.
    pub fn marches_cells(&self) -> bool {
        marches_cells(&self.shader)
    }
}

impl ShaderVariant {
    /// Adds the filter of texels around a point, which interpolates means of `kernel x kernel` texels, and the
    /// alignment of four texels at their first depths. The module of the query follows.
    #[must_use]
    pub(super) fn with_filter(self, filter: Filter, kernel: u32, align: Align) -> Self {
        let constants = [
            Constant::unsigned("TAPS_ACROSS", filter.taps_across(kernel)),
            Constant::float("GAUSS_SIGMA", GAUSS_SIGMA as f32),
            Constant::float("STEEPEST_SURFACE", STEEPEST_SURFACE),
        ];
        let def = match filter {
            Filter::Bilinear => Some("FILTER_BILINEAR"),
            Filter::Gauss => Some("FILTER_GAUSS"),
            Filter::Nearest | Filter::Pcf => None,
        };
        let is_aligned = align == Align::On && filter == Filter::Bilinear;
        let shader = self.modules(&["shadow/taps.wgsl", "shadow/align.wgsl"]).constants(&constants);
        shader.defs(def).defs(is_aligned.then_some("ALIGN"))
    }
}
