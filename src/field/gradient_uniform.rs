//! Gradient opacity of a transfer function on the graphics device.

use crate::gpu::{Gpu, uniform_buffer};
use crate::transfer::{GradientOpacity, MOST_GRADIENT_POINTS, TexelMapping, TransferFunction};
use crate::volume::Volume;
use bytemuck::{Pod, Zeroable};
use glam::DMat3;

/// Binding of the gradient opacity in bind group 0, behind those of segmentation labels.
pub(super) const GRADIENT_BINDING: u32 = 11;
/// Number of vectors of four segments between the points of a gradient opacity.
pub(super) const GRADIENT_VECTORS: usize = MOST_GRADIENT_POINTS / 4;
/// Length of the segment that replaces a jump, relative to its gradient magnitude.
const JUMP: f64 = 1e-6;

/// Uniform of a gradient opacity: `GradientOpacity` of `shaders/field/gradient_opacity.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
struct GradientUniform {
    pub world_x: [f32; 3],
    pub first_factor: f32,
    pub world_y: [f32; 3],
    pub vectors: u32,
    pub world_z: [f32; 3],
    pub padding: f32,
    pub starts: [[f32; 4]; GRADIENT_VECTORS],
    pub lengths: [[f32; 4]; GRADIENT_VECTORS],
    pub slopes: [[f32; 4]; GRADIENT_VECTORS],
}

/// Segment of a gradient opacity between two points.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Segment {
    start: f64,
    length: f64,
    slope: f64,
}

/// Returns the factor at gradient magnitude 0, and the segments on which the factor changes. A jump becomes a short
/// segment that ends at it.
fn segments(opacity: &GradientOpacity) -> (f64, Vec<Segment>) {
    let points = opacity.points();
    // The later point of a jump at 0 holds from 0 on.
    let first = points.iter().rfind(|p| p.magnitude == 0.0).or(points.first()).map_or(1.0, |p| p.factor);
    let between = points.windows(2).filter(|ab| ab[1].magnitude > 0.0 && ab[0].factor != ab[1].factor);
    let segment = |ab: &[crate::transfer::GradientPoint]| {
        let least = JUMP * ab[1].magnitude;
        let length = (ab[1].magnitude - ab[0].magnitude).max(least);
        let start = ab[1].magnitude - length;
        Segment { start, length, slope: (ab[1].factor - ab[0].factor) / length }
    };
    (first, between.map(segment).collect())
}

impl GradientUniform {
    fn new(opacity: &GradientOpacity, index_from_world: DMat3, mapping: TexelMapping) -> Self {
        let (first, segments) = segments(opacity);
        // With index = M world, the gradient in world is the transpose of M times that in index space. Grid space is index
        // space plus one.
        let world = index_from_world.transpose() * mapping.scale;
        let [world_x, world_y, world_z] =
            [world.x_axis, world.y_axis, world.z_axis].map(|axis| axis.as_vec3().to_array());
        let vectors = segments.len().div_ceil(4).max(1) as u32;
        let mut uniform =
            Self { world_x, world_y, world_z, first_factor: first as f32, vectors, ..Self::zeroed() };
        for (i, segment) in segments.iter().enumerate() {
            uniform.starts[i / 4][i % 4] = segment.start as f32;
            uniform.lengths[i / 4][i % 4] = segment.length as f32;
            uniform.slopes[i / 4][i % 4] = segment.slope as f32;
        }
        uniform
    }
}

/// Creates the uniform of a transfer function's gradient opacity for a volume; `None` if it has none.
pub(super) fn gradient_uniform(
    gpu: &Gpu,
    volume: &Volume,
    tf: &TransferFunction,
    mapping: TexelMapping,
) -> Option<wgpu::Buffer> {
    let opacity = tf.gradient_opacity.as_ref()?.per_mm(volume.spacing_mm());
    let uniform = GradientUniform::new(&opacity, volume.index_from_world().matrix3, mapping);
    Some(uniform_buffer(gpu, "gradient opacity", &uniform))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::field_shader;
    use crate::gpu::assert_layout;

    #[test]
    fn the_uniform_has_one_layout() {
        let shader = field_shader("render/query.wgsl")
            .with_depth_march()
            .modules(&["shadow/rays/lookup.wgsl", "shadow/direct.wgsl"])
            .defs(["GRADIENT_OPACITY"]);
        assert_layout!(&shader, "GradientOpacity", GradientUniform: world_x, first_factor, world_y, vectors,
            world_z, starts, lengths, slopes);
    }

    /// Sums of clamped segments, as the shader evaluates them, have the factors of the function.
    #[test]
    fn segments_add_up_to_the_factor() {
        for text in
            ["0:0,50:1", "5:0.2", "0:1,0:0.25,4:0.75", "2:0.1,6:0.9,6:0.3,9:1,12:0", "0:0.5,3:0.5,9:0.1"]
        {
            let opacity: GradientOpacity = text.parse().unwrap();
            let uniform =
                GradientUniform::new(&opacity, DMat3::IDENTITY, TexelMapping { scale: 1.0, offset: 0.0 });
            for i in 0..600 {
                let g = f64::from(i) * 0.025;
                let sum: f64 = (0..4 * GRADIENT_VECTORS)
                    .map(|i| {
                        let of = |all: [[f32; 4]; GRADIENT_VECTORS]| f64::from(all[i / 4][i % 4]);
                        of(uniform.slopes) * (g - of(uniform.starts)).clamp(0.0, of(uniform.lengths))
                    })
                    .sum();
                let (got, want) = (f64::from(uniform.first_factor) + sum, opacity.factor(g));
                assert!((got - want).abs() < 1e-5, "{text} at {g}: {got} {want}");
            }
        }
    }
}
