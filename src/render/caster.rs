//! Inputs for casting the eye rays of a picture: its passes, their resources, and the tiles of each part.

use super::Renderer;
use super::frame_uniform::{FrameUniform, frame_uniform};
use super::lights::LightPass;
use super::pass::Pass;
use super::plan::{PictureTiles, Plan};
use super::shader::PICTURE_SIDE;
use crate::error::{Error, Result};
use crate::field::{
    DeferredPasses, DeviceDirections, DeviceTransfer, LoadedVolume, RAY_STATE_BINDING, RAY_STATES,
    RESIDENT_VOXELS, ray_states,
};
use crate::gpu::tuning::BLOCK_SIDE;
use crate::gpu::{Gpu, Group, Slot, StorageBuffer};
use crate::scene::{LightSource, Scene};
use crate::shadow::{SECTION_BINDING, Section, ShadowMap};
use crate::volume::Volume;
use std::cell::Cell;
use std::time::Instant;

/// Inputs for casting the eye rays of a picture, which all of its submissions share.
pub(super) struct Caster<'a> {
    pub loaded: &'a LoadedVolume,
    pub transfer: &'a DeviceTransfer,
    pub scene: &'a Scene,
    /// Build passes of shadow maps, which the first submission of the picture runs too.
    pub deferred: &'a DeferredPasses,
    pub tiles: PictureTiles,
    /// Number of all tiles of the picture and of empty ones, once the device has found them.
    pub counts: Cell<Option<[usize; 2]>>,
    pub passes: Vec<Pass<'a>>,
    /// Bind group 3 with the triangles of the scene's mesh, if there is one.
    pub mesh: Option<Group>,
    /// Directions of the strands (hair or fibres) on the device, if the shading reads them.
    directions: Option<&'a DeviceDirections>,
}

/// Tiles of the part of a picture that one submission draws.
pub(super) struct PartTiles {
    /// List of tiles, or depth ranges of all tiles of the picture.
    pub buffer: wgpu::Buffer,
    /// Number of workgroups that cast eye rays, and of those that fill tiles with the background.
    pub cast: u32,
    pub left_out: u32,
}

/// Number of words in the state of an eye ray that waits for a page of the volume: `render/eye_state.wgsl`.
const EYE_STATE_WORDS: u32 = 20;
/// Number of steps of an eye ray that may lie between its last step and the farthest sample that is read after it: those
/// of a light interval, and one on each side.
const STEPS_OF_INTERVAL: f64 = 6.0;

impl Caster<'_> {
    /// Whether each part of a picture needs a sweep of its own over the volume.
    pub fn needs_sweeps(&self) -> bool {
        self.transfer.stream().is_some() || self.passes.iter().any(|pass| pass.sections.is_some())
    }

    /// Returns the number of bytes of the largest buffer for each pixel.
    pub fn pixel_bytes(&self) -> u64 {
        4 * if self.transfer.stream().is_some() { u64::from(EYE_STATE_WORDS) + 2 } else { 4 }
    }

    /// Creates the states of eye rays that wait for pages of the volume; `None` if all pages are resident.
    pub fn ray_states(&self, gpu: &Gpu, pixels: u32) -> Result<Option<wgpu::Buffer>> {
        self.transfer.stream().map(|_| ray_states(gpu, pixels, EYE_STATE_WORDS)).transpose()
    }

    /// Returns the tiles of a part of the picture, which begins at a pixel and has a size in pixels.
    pub fn part(&self, gpu: &Gpu, first: [u32; 2], size: [u32; 2]) -> Result<PartTiles> {
        match &self.tiles {
            PictureTiles::Listed(tiles) => {
                let (list, cast) = tiles.part(first, size, gpu.tuning.order);
                let left_out = list.len() as u32 - cast;
                let buffer = StorageBuffer::from_slice(gpu, "tiles of the picture", &list)?;
                Ok(PartTiles { buffer, cast, left_out })
            }
            PictureTiles::OnDevice(tiles) => {
                let [across, down] = size.map(|n| n.div_ceil(PICTURE_SIDE).div_ceil(BLOCK_SIDE));
                let cast = across * down * BLOCK_SIDE.pow(2);
                Ok(PartTiles { buffer: tiles.depths().clone(), cast, left_out: cast })
            }
        }
    }

    /// Returns the uniform of one rendering pass over a picture. The first pass draws the ambient light and the
    /// background; later passes add their light to it.
    pub fn frame_uniform(&self, pass: usize) -> FrameUniform {
        let frame = frame_uniform(&self.loaded.volume, self.scene);
        let radiance = self.passes[pass].radiance.unwrap_or(LightSource::WHITE);
        let lit = if self.passes[pass].is_ambient { 1.0 } else { 1.0 - self.scene.ambient };
        // Passes of their own add occluded ambient light.
        let ambient = if self.scene.occlusion().is_some() { 0.0 } else { frame.ambient };
        let frame = FrameUniform { light: radiance.map(|c| (lit * c) as f32), ambient, ..frame };
        match pass {
            0 => frame,
            _ => FrameUniform { ambient: 0.0, background: [0.0; 3], adds: 1, ..frame },
        }
    }
}

impl Renderer {
    /// Plans a picture with the given shadow maps. Returns the plan, the inputs of its passes, and the time of the plan
    /// in ms.
    pub(super) fn caster<'a>(
        &self,
        (loaded, transfer): (&'a LoadedVolume, &'a DeviceTransfer),
        maps: &[&'a ShadowMap],
        scene: &'a Scene,
        deferred: &'a DeferredPasses,
    ) -> Result<(Plan, Caster<'a>, f64)> {
        if transfer.stream().is_some() {
            check_blocks((scene, loaded), maps)?;
        }
        let start = Instant::now();
        let occlusion = scene.occlusion().map(|occlusion| self.occlusion((loaded, transfer), occlusion));
        let occlusion = occlusion.transpose()?.unwrap_or_default();
        let occlusion_ms = start.elapsed().as_secs_f64() * 1e3;
        let occluded = occlusion.iter().map(|(map, _)| map);
        let lookups = maps.iter().copied().chain(occluded).filter_map(|map| map.lookup.as_ref());
        for lookup in lookups {
            // The plan needs to know the pre-compressed table.
            transfer.prepared(self.gpu(), lookup.within(""))?;
        }
        let start = Instant::now();
        let (plan, tiles) = Plan::of(scene, loaded, transfer, maps, &self.kernels)?;
        let device_tiles = matches!(tiles, PictureTiles::OnDevice(_));
        let host_ms = occlusion_ms + start.elapsed().as_secs_f64() * 1e3;
        let mut passes = Vec::new();
        let samples: Vec<usize> = maps.iter().map(|map| map.samples()).collect();
        for LightPass { map, radiance } in LightPass::all(scene, &samples, plan.depends_on_light()) {
            let shadow = maps[map];
            let shader = plan.raycast_shader(transfer, shadow, radiance.is_some(), device_tiles);
            let shader = transfer.prepared(self.gpu(), shader)?;
            let group = shadow.group.clone();
            let (resumable, sections) = (plan.resumable(shadow), plan.sections(shadow, scene)?);
            let shader = shader.defs(transfer.stream().map(|_| RAY_STATES));
            passes.push(Pass { group, radiance, is_ambient: false, shader, resumable, sections });
        }
        for (map, share) in occlusion {
            let shader =
                transfer.prepared(self.gpu(), plan.occlusion_shader(transfer, &map, device_tiles))?;
            let radiance = Some([scene.ambient * share; 3]);
            let group = map.group;
            passes.push(Pass { group, radiance, is_ambient: true, shader, resumable: true, sections: None });
        }
        let mesh =
            scene.mesh.as_ref().map(|mesh| self.mesh.group(self.gpu(), mesh, &loaded.volume)).transpose()?;
        let directions = plan.shading.is_of_strands().then(|| loaded.directions(self.gpu())).transpose()?;
        let counts = Cell::new(None);
        let caster = Caster { loaded, transfer, scene, deferred, tiles, counts, passes, mesh, directions };
        Ok((plan, caster, host_ms))
    }

    /// Creates bind group 2 of the passes that cast eye rays: frame uniform, band of the picture, progress of its rays,
    /// tiles, directions of strands, and the section of the volume that a pass draws.
    pub(super) fn stage(
        &self,
        caster: &Caster<'_>,
        frame: &wgpu::Buffer,
        others: [&wgpu::Buffer; 3],
        (section, states): (Option<&Section>, Option<&wgpu::Buffer>),
    ) -> Group {
        let [picture, progress, tiles] = others.map(wgpu::Buffer::as_entire_binding);
        let stage = [
            (0, self.kernels.uniform(frame)),
            (1, Slot::read_write(picture)),
            (2, Slot::read_write(progress)),
            (3, Slot::read(tiles)),
        ];
        let strands = caster.directions.map(DeviceDirections::slots).into_iter().flatten();
        let section =
            section.map(|section| (SECTION_BINDING, Slot::read(section.planes.as_entire_binding())));
        let states = states.map(|states| (RAY_STATE_BINDING, Slot::read_write(states.as_entire_binding())));
        let slots = stage.into_iter().chain((4..).zip(strands)).chain(section).chain(states);
        self.kernels.group("frame", &slots.collect::<Vec<_>>())
    }
}

/// Returns the number of voxels along an axis within which interpolation at a distance of `mm` from a point reads.
pub(super) fn voxels_within(volume: &Volume, mm: f64) -> f64 {
    let rows = volume.index_from_world().matrix3.transpose();
    let per_mm = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.length());
    mm * per_mm.into_iter().fold(0.0, f64::max) + 1.0
}

/// Checks that a picture can be drawn block by block.
///
/// # Errors
/// Its eye rays or shadow rays read farther than the pages around a block, or its scene needs the whole volume at once.
fn check_blocks((scene, loaded): (&Scene, &LoadedVolume), maps: &[&ShadowMap]) -> Result<()> {
    let volume = &loaded.volume;
    let near_mm = maps.iter().map(|map| map.light_space.near_mm).fold(0.0, f64::max);
    let steps_mm = STEPS_OF_INTERVAL * scene.step * volume.min_spacing_mm();
    let farthest = voxels_within(volume, steps_mm + near_mm);
    let why = if scene.mesh.is_some() {
        "surfaces are not drawn block by block".into()
    } else if scene.occlusion().is_some() {
        "ambient occlusion is not computed block by block".into()
    } else if maps.iter().any(|map| map.sections.is_some()) {
        "slices of half-angle shadows are not drawn block by block".into()
    } else if farthest > RESIDENT_VOXELS {
        format!("--step and near= reach over {farthest:.0} voxels, and blocks over {RESIDENT_VOXELS}")
    } else {
        return Ok(());
    };
    let hint = "its pages with extinction exceed the device memory; --device-memory sets the limit";
    Err(Error::input("cannot render", &volume.provenance.source, why).hint(hint))
}
