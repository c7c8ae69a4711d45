//! Bind group 0 of all shaders: the volume and its transfer function.

use crate::gpu::{Gpu, Group, Slot};

/// Resources of bind group 0 (the volume and its transfer function), except the lookup table of transfer-function
/// breakpoints.
#[derive(Clone)]
pub(super) struct FieldBindings {
    pub field: wgpu::Buffer,
    pub volume: wgpu::TextureView,
    /// Place of each page of the volume in its texture; `None` for a volume that is one texture.
    pub page_table: Option<wgpu::TextureView>,
    /// Pages for which rays wait; `None` if all needed pages are resident.
    pub waiting_pages: Option<wgpu::Buffer>,
    /// Whether texels of the volume are whole numbers.
    pub has_words: bool,
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
        let values = match self.has_words {
            true => wgpu::TextureSampleType::Uint,
            // Shaders filter pages themselves.
            false => wgpu::TextureSampleType::Float { filterable: filterable && self.page_table.is_none() },
        };
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
        // Bindings of labels, gradient opacity and pages. Others stand for those that are missing before one of them: Mesa
        // 22.3's lavapipe reads wild addresses in groups with gaps.
        let (ranks, shifts) = self.labels.as_ref().map_or((&self.distances, &self.field), |(r, s)| (r, s));
        let further = [
            (self.labels.is_some(), Slot::texture(ranks, wgpu::TextureSampleType::Uint, solid)),
            (self.labels.is_some(), Slot::uniform(shifts)),
            (self.gradient.is_some(), Slot::uniform(self.gradient.as_ref().unwrap_or(&self.field))),
            (self.page_table.is_some(), {
                let table = self.page_table.as_ref().unwrap_or(&self.distances);
                Slot::texture(table, wgpu::TextureSampleType::Uint, solid)
            }),
            (self.waiting_pages.is_some(), {
                let waiting = self.waiting_pages.as_ref().unwrap_or(&self.field);
                Slot::read_write(waiting.as_entire_binding())
            }),
        ];
        let count = further.iter().rposition(|(is_needed, _)| *is_needed).map_or(0, |last| last + 1);
        slots.extend(further.into_iter().take(count).map(|(_, slot)| slot));
        let slots: Vec<_> = (0..).zip(slots).collect();
        Group::new(gpu, "field", &slots)
    }
}
