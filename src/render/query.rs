//! Queries a shadow map for the transmittance from the light at points, by the same shader code as pictures.

use super::Renderer;
use super::caster::voxels_within;
use super::pass::{each_section, section_groups, section_passes};
use super::shader::CONSTANTS;
use crate::error::{Error, Result};
use crate::field::{
    DeviceTransfer, LoadedVolume, PageReach, PassRays, RESIDENT_VOXELS, grid_from_world, line_of_workgroups,
    marches_samples,
};
use crate::gpu::{Group, Read, ShaderVariant, Slot, StorageBuffer};
use crate::shadow::{Lookup, SECTION_BINDING, Section, ShadowMap};
use glam::DVec3;

/// Order of blocks for points in no order.
const ANY_ORDER: (PassRays, PageReach) = (PassRays::Along(DVec3::Z), PageReach::Neighbours);

pub(super) fn shader(lookup: &Lookup) -> ShaderVariant {
    let shader = lookup.within("render/query.wgsl").constants(CONSTANTS);
    if marches_samples(&shader) { shader.with_ray_march(true) } else { shader }
}

impl Renderer {
    /// Returns the transmittance from the light to world points (mm), queried from a shadow map by the same shader
    /// code as in pictures.
    ///
    /// # Errors
    /// The device is lost.
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
        let gpu = self.gpu();
        let farthest = voxels_within(&loaded.volume, shadow.light_space.near_mm);
        if transfer.stream().is_some() && farthest > RESIDENT_VOXELS {
            let why = format!("near= reaches over {farthest:.0} voxels, and blocks over {RESIDENT_VOXELS}");
            return Err(Error::input("cannot query", shadow.method, why));
        }
        let shader = transfer.prepared(gpu, shader(lookup))?;
        let grid_from_world = grid_from_world(&loaded.volume);
        let mut results = Vec::with_capacity(points_mm.len());
        // A million points at a time limit the size of the buffers.
        for chunk in points_mm.chunks(1 << 20) {
            let grid = chunk
                .iter()
                .map(|p| grid_from_world.transform_point3(*p).as_vec3().extend(0.0).to_array())
                .collect::<Vec<_>>();
            let points = StorageBuffer::from_slice(gpu, "query points", &grid)?;
            // Negative results are not known yet.
            let values = StorageBuffer::from_slice(gpu, "query results", &vec![-1.0_f32; chunk.len()])?;
            let results_of_chunk = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &values,
                offset: 0,
                size: std::num::NonZeroU64::new(chunk.len() as u64 * 4),
            });
            let stage =
                [(0, Slot::read(points.as_entire_binding())), (1, Slot::read_write(results_of_chunk))];
            let group = |more: &[(u32, Slot<'_>)]| self.kernels.group("query", &[&stage[..], more].concat());
            let workgroups = line_of_workgroups(chunk.len());
            let read = Read { buffer: &values, words: chunk.len() };
            let sections = shadow.sections.as_ref();
            let stage = |section: Option<&Section>| {
                group(
                    section
                        .map(|section| (SECTION_BINDING, Slot::read(section.planes.as_entire_binding())))
                        .as_slice(),
                )
            };
            let stages: Vec<Group> = each_section(sections).map(stage).collect();
            let groups = section_groups(sections, [transfer.group(), &shadow.group], &stages, None);
            let passes = section_passes(&groups, &shader, workgroups);
            let mut words = Vec::new();
            let mut run = || -> Result<bool> {
                words = self.kernels.run("query", &passes, &[read])?.1;
                Ok(true)
            };
            match transfer.stream() {
                Some(stream) => stream.sweep(gpu, &loaded.volume, ANY_ORDER, run)?,
                None => run()?,
            };
            results.extend(words.into_iter().flatten().map(f32::from_bits));
        }
        Ok(results)
    }
}
