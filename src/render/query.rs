//! Transmittance at points, by the lookup that pictures use.

use super::{COMMON, DeviceTransfer, LoadedVolume, Renderer, grid_from_world};
use crate::error::Result;
use crate::gpu::{ShaderVariant, StorageBuffer, read_back};
use crate::shadow::ShadowMap;
use glam::DVec3;

impl Renderer {
    /// Transmittance from the light to world points, by the lookup that pictures use.
    ///
    /// # Errors
    /// A lost device.
    pub fn query(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadow: &ShadowMap,
        points_mm: &[DVec3],
    ) -> Result<Vec<f32>> {
        let Some(lookup) = shadow.lookup.as_ref().filter(|_| !transfer.empty) else {
            return Ok(vec![1.0; points_mm.len()]);
        };
        let mut modules = COMMON.to_vec();
        modules.extend(lookup.modules);
        let mut defs = lookup.defs.clone();
        if lookup.marches {
            self.march_table(transfer)?;
            defs.extend(transfer.march_defs());
        }
        let variant = ShaderVariant { entry: "query.wgsl", modules, defs };
        let pipeline = self.pipeline(&variant, &self.layouts.query)?;
        let grid_from_world = grid_from_world(&loaded.volume);
        let mut results = Vec::with_capacity(points_mm.len());
        // A million points at a time bounds the buffers.
        for chunk in points_mm.chunks(1 << 20) {
            let grid = chunk
                .iter()
                .map(|p| grid_from_world.transform_point3(*p).as_vec3().extend(0.0).to_array())
                .collect::<Vec<_>>();
            let points = StorageBuffer::from_slice(&self.gpu, "query points", &grid)?;
            let values = StorageBuffer::zeroed(&self.gpu, "query results", chunk.len() as u64 * 4)?;
            let group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("query"),
                layout: &self.layouts.query,
                entries: &[
                    wgpu::BindGroupEntry { binding: 0, resource: points.as_entire_binding() },
                    wgpu::BindGroupEntry {
                        binding: 1,
                        resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                            buffer: &values,
                            offset: 0,
                            size: std::num::NonZeroU64::new(chunk.len() as u64 * 4),
                        }),
                    },
                ],
            });
            let groups = (chunk.len() as u32).div_ceil(64);
            let across = groups.clamp(1, 1024);
            self.timer.compute(&self.gpu, "query", |pass| {
                pass.set_pipeline(&pipeline);
                pass.set_bind_group(0, transfer.bind_group(), &[]);
                pass.set_bind_group(1, &shadow.bind_group, &[]);
                pass.set_bind_group(2, &group, &[]);
                pass.dispatch_workgroups(across, groups.div_ceil(across), 1);
            })?;
            results.extend(read_back::<f32>(&self.gpu, &values, chunk.len())?);
        }
        Ok(results)
    }
}
