//! Uniform of a picture's camera, light and background.

use super::plan::plane_distance_mm;
use crate::field::grid_from_world;
use crate::scene::{Scene, Shading};
use crate::volume::Volume;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// Uniform of the camera, the light and the background of a picture: `Frame` of `shaders/render/frame.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct FrameUniform {
    pub plane_center: [f32; 3],
    pub plane_distance_mm: f32,
    pub grid_forward: [f32; 3],
    pub step_mm: f32,
    pub grid_right: [f32; 3],
    pub ambient: f32,
    pub grid_up: [f32; 3],
    pub first_row: u32,
    pub background: [f32; 3],
    pub rows: u32,
    pub half_extent: [f32; 2],
    pub size: [u32; 2],
    pub world_x: [f32; 3],
    pub shading_weight: f32,
    pub world_y: [f32; 3],
    pub tiles_cast: u32,
    pub world_z: [f32; 3],
    pub mean_cosine: f32,
    pub light: [f32; 3],
    pub adds: u32,
    pub first_tile: [u32; 2],
    pub part_tiles: [u32; 2],
}

/// Returns the uniform of a picture's camera and scene, with the values that do not differ between submissions.
pub(super) fn frame_uniform(volume: &Volume, scene: &Scene) -> FrameUniform {
    let grid_from_world = grid_from_world(volume);
    let world_from_grid = grid_from_world.inverse().matrix3;
    let frame = scene.camera.frame();
    let distance = plane_distance_mm(scene, volume);
    let plane_center = scene.camera.eye + distance * frame.forward;
    let f32s = |v: DVec3| v.as_vec3().to_array();
    let grid = |v: DVec3| f32s(grid_from_world.transform_vector3(v));
    let tan = (0.5 * scene.camera.fov_deg.to_radians()).tan();
    let aspect = f64::from(scene.width) / f64::from(scene.height);
    FrameUniform {
        plane_center: f32s(grid_from_world.transform_point3(plane_center)),
        plane_distance_mm: distance as f32,
        grid_forward: grid(frame.forward),
        step_mm: (scene.step * volume.min_spacing_mm()) as f32,
        grid_right: grid(frame.right),
        ambient: scene.ambient as f32,
        grid_up: grid(frame.up),
        background: scene.background.map(|c| c as f32),
        half_extent: [(aspect * tan) as f32, tan as f32],
        size: [scene.width, scene.height],
        world_x: f32s(world_from_grid.x_axis),
        shading_weight: if scene.shading == Shading::None { 0.0 } else { 1.0 },
        world_y: f32s(world_from_grid.y_axis),
        world_z: f32s(world_from_grid.z_axis),
        mean_cosine: scene.mean_cosine as f32,
        ..Zeroable::zeroed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::assert_layout;
    use crate::render::eye_tiles::TileUniform;

    #[test]
    fn frames_have_one_layout() {
        let shader = &crate::render::shaders(None)[0];
        assert_layout!(shader, "Tile", TileUniform: at, nearest_mm, farthest_mm);
        assert_layout!(shader, "Frame", FrameUniform: plane_center, plane_distance_mm, grid_forward, step_mm, grid_right,
            ambient, grid_up, first_row, background, rows, half_extent, size, world_x, shading_weight, world_y,
            tiles_cast, world_z, mean_cosine, light, adds, first_tile, part_tiles);
    }
}
