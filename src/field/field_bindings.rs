//! Bind group 0 of all shaders: the volume and its transfer function.

use super::gradient_uniform::GRADIENT_BINDING;
use crate::gpu::{Gpu, Group, Slot};

/// Resources of bind group 0 (the volume and its transfer function), except the lookup table of transfer-function
/// breakpoints.
#[derive(Clone)]
pub(super) struct FieldBindings {
    pub field: wgpu::Buffer,
    pub volume: wgpu::TextureView,
    pub sampler: wgpu::Sampler,
    pub distances: wgpu::TextureView,
    pub intervals: wgpu::Buffer,
    pub integrals: wgpu::TextureView,
    pub extinction: wgpu::TextureView,
    /// Texture with the segmentation label of each voxel, and the offset that shaders add to the voxel values of each
    /// label. `None` without labels.
    pub labels: Option<(wgpu::TextureView, wgpu::Buffer)>,
    /// Uniform of the gradient opacity; `None` without one.
    pub gradient: Option<wgpu::Buffer>,
}

impl FieldBindings {
    /// Creates bind group 0 with a lookup table of transfer-function breakpoints.
    pub fn group(&self, gpu: &Gpu, pair_nodes: &wgpu::TextureView) -> Group {
        let solid = wgpu::TextureViewDimension::D3;
        // Pipelines do not depend on the volume: all formats are bound as the least capable one.
        let filterable = gpu.filters_float32;
        let values = wgpu::TextureSampleType::Float { filterable };
        let mut slots = vec![
            Slot::uniform(&self.field),
            Slot::texture(&self.volume, values, solid),
            Slot::sampler(&self.sampler, filterable),
            Slot::texture(&self.distances, wgpu::TextureSampleType::Uint, solid),
            if gpu.tuning.storage_tables {
                Slot::read(self.intervals.as_entire_binding())
            } else {
                Slot::uniform(&self.intervals)
            },
            Slot::floats(&self.integrals),
            Slot::words(pair_nodes),
            Slot::read_write(gpu.counters.binding()),
            Slot::floats(&self.extinction),
        ];
        // Without labels, others stand for them: Mesa 22.3's lavapipe reads wild addresses in groups with gaps.
        let label_slots = match (&self.labels, &self.gradient) {
            (Some((ranks, shifts)), _) => Some((ranks, shifts)),
            (None, Some(gradient)) => Some((&self.distances, gradient)),
            (None, None) => None,
        };
        if let Some((ranks, shifts)) = label_slots {
            slots.extend([Slot::texture(ranks, wgpu::TextureSampleType::Uint, solid), Slot::uniform(shifts)]);
        }
        let mut slots: Vec<_> = (0..).zip(slots).collect();
        slots.extend(self.gradient.iter().map(|gradient| (GRADIENT_BINDING, Slot::uniform(gradient))));
        Group::new(gpu, "field", &slots)
    }
}
