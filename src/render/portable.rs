//! Passes and resources of a picture for another program, which draws it from any camera: a page for browsers.

use super::device_tiles::project_shader;
use super::picture::NOT_STARTED;
use super::plan::PictureTiles;
use super::shader::{DEVICE_TILES, PICTURE_SIDE, background_shader};
use super::{LightMaps, Renderer};
use crate::error::{Error, Result};
use crate::field::{DeferredPasses, DeviceTransfer, LoadedVolume};
use crate::gpu::tuning::BLOCK_SIDE;
use crate::gpu::{Group, ShaderVariant, StorageBuffer, uniform_buffer};
use crate::scene::Scene;

/// Passes and resources of the pictures of a scene. A program that draws them writes the uniforms of its camera, and
/// runs first `project`, then `background` and the first of `passes` over the same tiles, then the other passes.
pub struct PortablePicture {
    /// Pass that finds the depth ranges of the picture's tiles. `None`: rays are cast over all depths in all tiles.
    pub project: Option<PortableProjection>,
    /// Shader that fills tiles in which nothing is visible. Its bind groups are those of the first pass.
    pub background: ShaderVariant,
    /// Passes that cast eye rays, one per light.
    pub passes: Vec<PortablePass>,
    /// Bind group 0 of `background` and `passes`: volume and transfer function.
    pub field: Group,
    /// Bind group 2 of `background` and `passes`: 0 frame uniform, 1 picture, 2 progress of the rays, 3 depth ranges of
    /// the tiles, and from 4 on the directions of strands. Buffers 0 to 3 depend on the camera and on the size of the
    /// picture.
    pub stage: Group,
    /// Bind group 3 of `background` and `passes`: triangles of the mesh, if there is one.
    pub mesh: Option<Group>,
}

impl PortablePicture {
    /// Value with which the progress of each ray begins.
    pub const NOT_STARTED: f32 = NOT_STARTED;
    /// Side of a tile of the picture, pixels.
    pub const TILE_SIDE: u32 = PICTURE_SIDE;
    /// Side of a block of tiles that one dispatch covers as a whole, tiles.
    pub const BLOCK_SIDE: u32 = BLOCK_SIDE;

    /// Returns the shader of all passes that find the depth ranges of tiles.
    pub fn projection_shader() -> ShaderVariant {
        project_shader()
    }
}

/// Pass that finds the depth ranges of the picture's tiles.
pub struct PortableProjection {
    /// Shader that projects bricks (blocks of cells with extinction) into the picture.
    pub shader: ShaderVariant,
    /// Bind group 0 of the projection: 0 uniform, 1 positions of the bricks, 2 depth ranges of the tiles.
    pub group: Group,
    /// Number of workgroups along each axis.
    pub workgroups: [u32; 3],
}

/// Pass that casts the eye rays of a picture under one light.
pub struct PortablePass {
    /// Shader that casts eye rays.
    pub shader: ShaderVariant,
    /// Bind group 1: light space and shadow map.
    pub shadow: Group,
    /// Bytes of the frame uniform. Its members for camera, size and part of the picture differ between pictures.
    pub frame: Vec<u8>,
    /// Whether the pass has to be repeated until the first word of the progress stays 0.
    pub resumable: bool,
}

impl Renderer {
    /// Returns passes and resources of the pictures of a scene with the given shadow maps. The tuning of the device must
    /// find tiles on the device ([`Tuning::device_tiles`](crate::gpu::Tuning)).
    ///
    /// # Errors
    /// The device is out of memory, or the numbers of lights and shadow maps differ.
    pub fn portable<'a>(
        &self,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadows: impl Into<LightMaps<'a>>,
        scene: &Scene,
    ) -> Result<PortablePicture> {
        if transfer.stream().is_some() {
            let why = "its pages with extinction exceed the device memory, and a page holds all of them";
            return Err(Error::input("cannot export", &loaded.volume.provenance.source, why));
        }
        let shadows = shadows.into().checked(scene)?;
        let none = DeferredPasses::default();
        let (_, caster, _) = self.caster((loaded, transfer), shadows.maps(), scene, &none)?;
        let project = match &caster.tiles {
            PictureTiles::Listed(_) => None,
            PictureTiles::OnDevice(tiles) => tiles.with_pass(|pass| {
                let [x, y, z] = pass.workgroups;
                let group = pass.groups.first().filter(|_| x * y * z > 0)?;
                let (shader, group) = (pass.variant.clone(), (*group).clone());
                Some(PortableProjection { shader, group, workgroups: pass.workgroups })
            }),
        };
        let passes = caster.passes.iter().enumerate().map(|(i, pass)| {
            let has_device_tiles = pass.shader.defs.contains(&DEVICE_TILES);
            PortablePass {
                shader: pass.shader.clone().defs((!has_device_tiles).then_some(DEVICE_TILES)),
                shadow: pass.group.clone(),
                frame: bytemuck::bytes_of(&caster.frame_uniform(i)).to_vec(),
                resumable: pass.resumable,
            }
        });
        let frame = uniform_buffer(self.gpu(), "frame", &caster.frame_uniform(0));
        let other = StorageBuffer::zeroed(self.gpu(), "picture, progress or tiles", 0)?;
        Ok(PortablePicture {
            project,
            background: background_shader(true),
            passes: passes.collect(),
            field: transfer.group().clone(),
            stage: self.stage(&caster, &frame, [&other; 3], (None, None)),
            mesh: caster.mesh.clone(),
        })
    }
}
