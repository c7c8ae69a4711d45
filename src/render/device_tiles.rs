//! Depth ranges of the tiles of a picture, found by a pass on the device: the outer active bricks (blocks of cells with
//! extinction) are projected as spheres. [`super::eye_tiles`] does the same on the host.

use super::brick_projection::{BrickProjection, PIXELS_AROUND};
use super::shader::{CONSTANTS, PICTURE_SIDE};
use crate::error::Result;
use crate::field::{DeviceTransfer, FAR, LoadedVolume, line_of_workgroups};
use crate::gpu::{
    Constant, DevicePass, Group, Kernels, Read, ShaderVariant, Slot, StorageBuffer, uniform_buffer,
};
use crate::scene::Scene;
use bytemuck::{Pod, Zeroable};

/// Uniform of the projection of bricks: `Projection` of `shaders/render/project.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct ProjectionUniform {
    pub brick_x: [f32; 3],
    pub radius_mm: f32,
    pub brick_y: [f32; 3],
    pub plane_distance_mm: f32,
    pub brick_z: [f32; 3],
    pub bricks: u32,
    pub first_center: [f32; 3],
    pub inside: u32,
    pub pixels_per_tangent: [f32; 2],
    pub size: [f32; 2],
    pub tiles: [u32; 2],
    pub padding: [u32; 2],
}

/// Number of words before the depth ranges of the tiles: `TileDepths` of `shaders/render/tile_depths.wgsl`.
const HEAD_WORDS: usize = 4;

/// Depth ranges of the tiles of a picture, on the device.
pub struct DeviceTiles {
    depths: wgpu::Buffer,
    group: Group,
    shader: ShaderVariant,
    bricks: u32,
    tiles: [u32; 2],
}

pub(super) fn project_shader() -> ShaderVariant {
    let constants = [Constant::float("PIXELS_AROUND", PIXELS_AROUND as f32), Constant::float("FAR", FAR)];
    let shader = ShaderVariant::of("render/project.wgsl").modules(&["render/tile_depths.wgsl"]);
    shader.constants(CONSTANTS).constants(&constants)
}

impl DeviceTiles {
    /// Prepares the pass that projects the outer active bricks (blocks of cells with extinction) into the picture of a
    /// scene. Depths count from a plane across the view at `plane_mm` from the eye.
    ///
    /// # Errors
    /// The device is out of memory.
    pub fn new(
        kernels: &Kernels,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        scene: &Scene,
        plane_mm: f64,
    ) -> Result<Self> {
        let gpu = kernels.gpu();
        let projection = BrickProjection::of(scene, &loaded.volume, &transfer.active);
        let (bricks, positions) = transfer.outer_bricks(gpu)?;
        let tiles = [scene.width, scene.height].map(|n| n.div_ceil(PICTURE_SIDE));
        let axis = |i: usize| projection.brick.col(i).as_vec3().to_array();
        let [x, y, z] = projection.first_center.to_array();
        let uniform = ProjectionUniform {
            brick_x: axis(0),
            radius_mm: projection.radius_mm as f32,
            brick_y: axis(1),
            plane_distance_mm: plane_mm as f32,
            brick_z: axis(2),
            bricks,
            first_center: [x, y, z - plane_mm].map(|mm| mm as f32),
            inside: projection.inside.into(),
            pixels_per_tangent: projection.pixels_per_tangent.map(|n| n as f32),
            size: projection.size.map(|n| n as f32),
            tiles,
            padding: [0; 2],
        };
        let uniform = uniform_buffer(gpu, "projection of bricks", &uniform);
        let words = HEAD_WORDS as u64 + 2 * u64::from(tiles[0]) * u64::from(tiles[1]);
        let depths = StorageBuffer::zeroed(gpu, "depths of picture tiles", 4 * words)?;
        let slots = [
            (0, Slot::uniform(&uniform)),
            (1, Slot::read(positions.as_entire_binding())),
            (2, Slot::read_write(depths.as_entire_binding())),
        ];
        let group = kernels.group("projection of bricks", &slots);
        Ok(Self { depths, group, shader: project_shader(), bricks, tiles })
    }

    /// Calls `act` with the pass that finds the depth ranges of the tiles. It runs before the first pass that casts
    /// eye rays.
    pub fn with_pass<T>(&self, act: impl FnOnce(DevicePass<'_>) -> T) -> T {
        let workgroups = line_of_workgroups(self.bricks as usize);
        act(DevicePass { variant: &self.shader, groups: &[&self.group], workgroups })
    }

    /// Returns the buffer with the depth ranges, for passes that cast eye rays.
    pub fn depths(&self) -> &wgpu::Buffer {
        &self.depths
    }

    /// Returns the request for the words from which [`Self::counts`] counts tiles.
    pub fn read(&self) -> Read<'_> {
        Read { buffer: &self.depths, words: HEAD_WORDS }
    }

    /// Returns the number of all tiles of the picture, and the number of tiles in which nothing is visible.
    pub fn counts(&self, words: &[u32]) -> [usize; 2] {
        let all = self.tiles[0] as usize * self.tiles[1] as usize;
        let [touched, _, everywhere, _] = [0, 1, 2, 3].map(|i| words.get(i).copied().unwrap_or(0));
        [all, if everywhere > 0 { 0 } else { all - (touched as usize).min(all) }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common;
    use crate::field::DisabledOptimizations;
    use crate::gpu::{assert_layout, read_back};
    use crate::phantom::Phantom;
    use crate::render::Session;
    use crate::render::eye_tiles::EyeTiles;
    use crate::scene::Camera;
    use crate::transfer::{Quantity, TransferFunction};
    use glam::DVec3;
    use std::sync::Arc;

    /// Depth of a key, as `key_depth` of `shaders/render/tile_depths.wgsl`.
    fn key_depth(key: u32) -> f32 {
        f32::from_bits(if key >> 31 == 1 { key & 0x7fff_ffff } else { !key })
    }

    #[test]
    fn device_and_host_find_the_same_tiles() {
        let Some(gpu) = common::gpu() else { return };
        let renderer = Arc::new(crate::render::Renderer::new(gpu));
        let volume = Arc::new(Phantom::Shell.build(48).unwrap());
        let tf = TransferFunction::new(Quantity::Opacity, &[(400.0, 0.0), (600.0, 0.5)]);
        let session = Session::on(&renderer, Arc::clone(&volume), &tf, DisabledOptimizations::NONE).unwrap();
        let framing = Scene::framing(&volume);
        let away = framing.camera.eye - framing.camera.target;
        let center = framing.camera.target;
        let at = |eye: DVec3, target: DVec3, fov_deg: f64| Camera { eye, target, fov_deg, ..framing.camera };
        let cameras = [
            framing.camera,
            at(center, center + DVec3::new(1.0, 0.4, -0.3), 100.0),
            at(center + 0.2 * away, center, 130.0),
            at(center + 50.0 * away, center, 1.0),
            at(center + DVec3::new(27.0, 0.0, 3.0), center + DVec3::new(27.0, 100.0, 0.0), 60.0),
        ];
        for camera in cameras {
            let scene = Scene { camera, width: 190, height: 75, ..framing.clone() };
            let plane_mm = 50.0;
            let host = EyeTiles::of(&scene, &volume, &session.transfer.active, plane_mm);
            let kernels = renderer.kernels();
            let tiles =
                DeviceTiles::new(kernels, &session.loaded, &session.transfer, &scene, plane_mm).unwrap();
            tiles.with_pass(|pass| kernels.run("project", &[pass], &[])).unwrap();
            let [across, down] = tiles.tiles.map(|n| n as usize);
            let words =
                read_back::<u32>(renderer.gpu(), tiles.depths(), HEAD_WORDS + 2 * across * down).unwrap();
            assert_eq!(tiles.counts(&words), host.counts(), "{camera:?}");
            for (i, [nearest, farthest]) in host.depths().iter().enumerate() {
                let key = |k: usize| words[HEAD_WORDS + 2 * i + k].max(words[2 + k]);
                assert_eq!(key(0) == 0, nearest > farthest, "tile {i}: {camera:?}");
                if key(0) > 0 {
                    let off = (-key_depth(key(0)) - nearest).abs().max((key_depth(key(1)) - farthest).abs());
                    assert!(
                        off < 1e-3,
                        "tile {i}: {} {nearest}, {} {farthest}",
                        -key_depth(key(0)),
                        key_depth(key(1))
                    );
                }
            }
        }
    }

    #[test]
    fn uniforms_match_their_shaders() {
        assert_layout!(&project_shader(), "Projection", ProjectionUniform: brick_x, radius_mm, brick_y, plane_distance_mm,
            brick_z, bricks, first_center, inside, pixels_per_tangent, size, tiles);
    }
}
