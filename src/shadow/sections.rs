//! Sections of a shadow structure: slabs of the volume for which it answers one after the other, while the picture is
//! drawn.

use crate::error::{Error, Result};
use crate::field::{BuildContext, View, grid_from_world};
use crate::gpu::{Group, ShaderVariant, StorageBuffer};
use crate::scene::Light;
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, DVec4};

/// Binding of a section, in bind group 2 of every shader that reads it.
pub const SECTION_BINDING: u32 = 7;
/// WGSL module of the present section.
pub(super) const SECTION: &str = "field/section.wgsl";
/// Shader definition (`#ifdef`) of queries that answer for one section.
pub const SECTIONS: &str = "SECTIONS";
/// Shader definition (`#ifdef`) of pictures whose light comes from behind the volume.
pub const TOWARDS_EYE: &str = "TOWARDS_EYE";
/// Smallest cosine between the normal of sections and a light ray or eye ray.
const LEAST_COSINE: f64 = 0.02;

/// Sections of a shadow structure, in the order of the light. All eye rays pass them in this order, or all in the opposite
/// one.
pub struct Sections {
    /// View for which the sections are made; `None`: for queries at points only.
    pub view: Option<View>,
    /// Sections in the order of the light.
    pub list: Vec<Section>,
}

impl Sections {
    /// Whether the sections can be drawn in a view.
    pub fn serves(&self, view: Option<&View>) -> bool {
        self.view.as_ref().zip(view).is_some_and(|(own, view)| own.holds(view))
    }
}

/// Section of a shadow structure.
pub struct Section {
    /// Buffer with the planes of the section: struct `Section` of `shaders/field/section.wgsl`.
    pub planes: wgpu::Buffer,
    /// Bind group 1 of queries in the section.
    pub group: Group,
    /// Pass that prepares the structure for the section, after the section before.
    pub advance: SectionPass,
}

/// Compute pass that prepares a shadow structure for a section.
pub struct SectionPass {
    /// Shader of the pass.
    pub variant: ShaderVariant,
    /// Bind groups 1 and 2 of the pass.
    pub groups: [Group; 2],
    /// Number of workgroups along each axis.
    pub workgroups: [u32; 3],
}

/// Planes of a section: `Section` of `shaders/field/section.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct SectionPlanes {
    plane: [f32; 4],
    start: f32,
    end: f32,
    is_first: u32,
    is_last: u32,
}

/// Parallel planes that cut the active bricks of a volume into sections of equal thickness, such that every light ray
/// crosses them in one direction, and every eye ray too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Slices {
    /// Coefficients that turn a grid-space point into a coordinate, which is 0 at the first plane and rises by 1 from plane
    /// to plane.
    plane: DVec4,
    /// Number of sections.
    count: u32,
    /// Whether eye rays cross the planes against the light.
    pub is_towards_eye: bool,
}

impl Slices {
    /// Returns planes across the half vector: the direction in the middle between those of the light and of the view, or
    /// of the opposite view if that is closer to the light (Kniss et al. 2003). Without a view, planes are
    /// perpendicular to the light.
    ///
    /// # Errors
    /// No such planes exist: the light lies among the active bricks, or eye rays differ too much in direction.
    pub fn of(context: &BuildContext<'_>, count: u32) -> Result<Self> {
        let dims = context.volume.dims();
        let grid_from_world = grid_from_world(context.volume);
        let world_from_grid = grid_from_world.inverse();
        let hull = context.transfer.active.hull(dims);
        let corners: Vec<DVec3> = hull.map_or_else(Vec::new, |hull| hull.corners.clone());
        let world: Vec<DVec3> = corners.iter().map(|g| world_from_grid.transform_point3(*g)).collect();
        let center = world.iter().sum::<DVec3>() / world.len().max(1) as f64;
        let along_light = |point: DVec3| match context.light {
            Light::Directional { toward } => -toward.normalize_or_zero(),
            Light::Point { position } => (point - position).normalize_or_zero(),
        };
        let light = along_light(center);
        let eye_rays = context.view.map_or_else(Vec::new, View::ray_directions);
        let view = eye_rays.first().copied().unwrap_or(light);
        let is_towards_eye = light.dot(view) < 0.0;
        let sense = if is_towards_eye { -1.0 } else { 1.0 };
        let normal = (light + sense * view).normalize_or(light);
        let crosses = |direction: DVec3| normal.dot(direction) > LEAST_COSINE;
        let is_crossed = world.iter().all(|point| crosses(along_light(*point)))
            && eye_rays.iter().all(|direction| crosses(sense * *direction));
        if !is_crossed {
            let why = "its slices would be crossed in both directions by light rays or by eye rays";
            let hint = "a point light must lie outside the matter, and the camera must not see a wide angle from inside";
            return Err(Error::input("cannot draw", "halfangle", why).hint(hint));
        }
        let along = world.iter().map(|point| normal.dot(*point));
        let [first, last] =
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], x| [lo.min(x), hi.max(x)]);
        // Without active bricks any planes will do.
        let first = if first.is_finite() { first } else { 0.0 };
        let scale = f64::from(count) / (last - first).max(1e-9);
        let direction = world_from_grid.matrix3.transpose() * normal;
        let offset = normal.dot(world_from_grid.translation) - first;
        Ok(Self { plane: scale * direction.extend(offset), count, is_towards_eye })
    }

    /// Creates the buffers with the planes of all sections.
    ///
    /// # Errors
    /// The device is out of memory.
    pub fn buffers(&self, context: &BuildContext<'_>) -> Result<Vec<wgpu::Buffer>> {
        let buffer = |i: u32| {
            let planes = SectionPlanes {
                plane: self.plane.as_vec4().to_array(),
                start: i as f32,
                end: (i + 1) as f32,
                is_first: u32::from(i == 0),
                is_last: u32::from(i + 1 == self.count),
            };
            StorageBuffer::from_slice(context.gpu(), "section", &[planes])
        };
        (0..self.count).map(buffer).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::assert_layout;

    #[test]
    fn section_layout_is_that_of_the_shader() {
        let shader = crate::shadow::parse("halfangle").unwrap().passes().remove(0);
        assert_layout!(&shader, "Section", SectionPlanes: plane, start, end, is_first, is_last);
    }
}
