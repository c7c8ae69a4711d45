//! Page for browsers: one HTML file that draws a scene with the shaders of this program, in WebGPU and offline.
//!
//! The page holds what the device holds: volume, lookup tables, shadow maps and composed shaders. Its script writes the
//! uniforms of camera and light, and runs the passes of [`PortablePicture`].

mod build;
mod contents;
mod function;
mod html;

use crate::error::{Error, Result};
use crate::field::{FAR, RecordedBuild, grid_from_world};
use crate::render::{PortablePicture, Session};
use crate::scene::{Light, Scene};
use crate::shadow::{Lookup, Method, ShadowMap};
use crate::volume::BRICK_CELLS;
use build::{BuildRecord, map_record, recorded_maps};
use contents::{Contents, UniformRecord};
use flate2::Compression;
use flate2::write::GzEncoder;
pub use function::page_optimizations;
use function::{FunctionRecord, function_record};
use glam::DVec3;
pub use html::{PageTexts, html};
use serde::Serialize;
use std::io::Write;

/// Largest size of the data of a page, bytes. Texts of browsers end near 512 MiB, and the data become base64.
const MOST_DATA: usize = 300_000_000;

/// Largest size of the same data when they are unpacked, bytes.
const MOST_UNPACKED: usize = 1 << 30;

/// Camera of a picture, lengths in mm.
#[derive(Debug, Serialize)]
struct CameraRecord {
    eye: [f64; 3],
    target: [f64; 3],
    up: [f64; 3],
    fov_deg: f64,
}

/// Affine transforms of a volume as 12 numbers, column by column, and other constants of the scene.
#[derive(Debug, Serialize)]
struct SpaceRecord {
    grid_from_world: [f64; 12],
    world_from_grid: [f64; 12],
    volume_center: [f64; 3],
    /// Corners of the convex hulls of all slices of active bricks in grid space, which a shadow map covers.
    hull: Vec<[f64; 3]>,
    min_spacing_mm: f64,
    /// Number of voxels along each axis.
    dims: [usize; 3],
    /// Corners of the box of active bricks (blocks of cells with extinction) in grid space, or of the volume if none is
    /// active.
    active: [[f64; 3]; 2],
    brick_cells: usize,
    far: f32,
}

/// Offsets of the members of the uniforms that the page writes.
#[derive(Debug, Serialize)]
struct Uniforms {
    field: UniformRecord,
    frame: UniformRecord,
    projection: UniformRecord,
    /// `None`: no shader reads the light.
    light: Option<UniformRecord>,
}

/// Pass that finds the depth ranges of the picture's tiles.
#[derive(Debug, Serialize)]
struct ProjectRecord {
    pipeline: usize,
    group: usize,
    workgroups: [u32; 3],
}

/// Pass that casts the eye rays of one light.
#[derive(Debug, Serialize)]
struct PassRecord {
    pipeline: usize,
    shadow: usize,
    frame: Vec<u8>,
    resumable: bool,
}

/// Pictures of one shadow method.
#[derive(Debug, Serialize)]
struct MethodRecord {
    label: String,
    /// Whether the page draws the method under other lights: it has no shadow map, or the page builds its maps.
    follows_light: bool,
    /// Passes that build the shadow map of each light; empty if the page cannot build them.
    builds: Vec<BuildRecord>,
    /// Whether the method is the reference of difference pictures.
    is_reference: bool,
    /// Bind groups 0, 2 and 3. The page replaces bindings 0 to 3 of group 2.
    field: usize,
    stage: usize,
    mesh: Option<usize>,
    background: usize,
    project: Option<ProjectRecord>,
    passes: Vec<PassRecord>,
}

/// Everything that the script of a page needs.
#[derive(Serialize)]
struct PageRecord<'a> {
    size: [u32; 2],
    picture_side: u32,
    block_side: u32,
    not_started: f32,
    camera: CameraRecord,
    /// Direction towards each directional light; `None` for a point light.
    lights: Vec<Option<[f64; 3]>>,
    space: SpaceRecord,
    /// `None`: the page does not edit the transfer function.
    function: Option<FunctionRecord>,
    uniforms: Uniforms,
    methods: Vec<MethodRecord>,
    contents: &'a Contents<'a>,
}

/// Returns the data of a page. The session has the optimizations of [`page_optimizations`]. The data are a gzip file of the length of a JSON text as four bytes, the text, and the bytes of all
/// resources from the next multiple of 16 bytes on.
///
/// # Errors
/// The device cannot hold a shadow map, or is lost.
pub fn page_data(session: &Session, methods: &[Box<dyn Method>], scene: &Scene) -> Result<Vec<u8>> {
    let Session { renderer, loaded, transfer } = session;
    let mut contents = Contents::new(renderer.kernels());
    let (mut records, mut pictures) = (Vec::new(), Vec::new());
    for method in methods {
        let (maps, builds) = recorded_maps(session, method.as_ref(), scene)?;
        let picture = renderer.portable(loaded, transfer, &maps, scene)?;
        records.push(method_record(&mut contents, method.as_ref(), &picture, (&maps, builds))?);
        pictures.push(picture);
    }
    let function = function_record(&mut contents, session, scene);
    let toward = |light: Light| match light {
        Light::Directional { toward } => Some(toward.to_array()),
        Light::Point { .. } => None,
    };
    let record = PageRecord {
        size: [scene.width, scene.height],
        picture_side: PortablePicture::TILE_SIDE,
        block_side: PortablePicture::BLOCK_SIDE,
        not_started: PortablePicture::NOT_STARTED,
        camera: CameraRecord {
            eye: scene.camera.eye.to_array(),
            target: scene.camera.target.to_array(),
            up: scene.camera.up.to_array(),
            fov_deg: scene.camera.fov_deg,
        },
        lights: scene.shining().into_iter().map(|source| toward(source.light)).collect(),
        space: space_record(session),
        function,
        uniforms: uniform_records(&contents, &pictures)?,
        methods: records,
        contents: &contents,
    };
    let check = |bytes: usize, most: usize, what: &str| {
        let why = format!(
            "its {what} have {} MB, and a page holds at most {}",
            bytes / 1_000_000,
            most / 1_000_000
        );
        let source = &loaded.volume.provenance.source;
        let error = Error::input("cannot write page", source, why)
            .hint("--downsample makes the volume smaller; fewer --methods need less");
        if bytes > most { Err(error) } else { Ok(()) }
    };
    check(contents.bytes.len(), MOST_UNPACKED, "unpacked data")?;
    let data = packed(&record, &contents.bytes)?;
    check(data.len(), MOST_DATA, "data").map(|()| data)
}

/// Returns the layouts of the uniforms that a page writes.
fn uniform_records(contents: &Contents<'_>, pictures: &[PortablePicture]) -> Result<Uniforms> {
    let passes = || pictures.iter().flat_map(|picture| &picture.passes);
    let first = passes()
        .next()
        .ok_or_else(|| Error::input("cannot write page", "--methods", "no method is given"))?;
    let light = passes().map(|pass| contents.uniform(&pass.shader, "LightSpace")).find_map(Result::transpose);
    let of = |shader, name: &str| {
        let missing = || Error::runtime("cannot write page", "shader", format!("no struct {name}"));
        contents.uniform(shader, name)?.ok_or_else(missing)
    };
    Ok(Uniforms {
        field: of(&first.shader, "Field")?,
        frame: of(&first.shader, "Frame")?,
        projection: of(&PortablePicture::projection_shader(), "Projection")?,
        light: light.transpose()?,
    })
}

fn method_record(
    contents: &mut Contents<'_>,
    method: &dyn Method,
    picture: &PortablePicture,
    (maps, builds): (&[ShadowMap], Option<Vec<RecordedBuild>>),
) -> Result<MethodRecord> {
    let PortablePicture { field, stage, mesh, .. } = picture;
    let groups = |shadow| [field, shadow, stage].into_iter().chain(mesh).collect::<Vec<_>>();
    let (mut passes, mut build_records) = (Vec::new(), Vec::new());
    for (i, pass) in picture.passes.iter().enumerate() {
        let shadow = match builds.as_ref().and_then(|builds| builds.get(i)) {
            None => contents.group(&pass.shadow)?,
            Some(build) => {
                let (group, record) = map_record(contents, build, (&pass.shadow, &pass.shader))?;
                build_records.push(record);
                group
            }
        };
        passes.push(PassRecord {
            pipeline: contents.pipeline(&pass.shader, &groups(&pass.shadow))?,
            shadow,
            frame: pass.frame.clone(),
            resumable: pass.resumable,
        });
    }
    let project = match &picture.project {
        None => None,
        Some(project) => Some(ProjectRecord {
            pipeline: contents.pipeline(&project.shader, &[&project.group])?,
            group: contents.group(&project.group)?,
            workgroups: project.workgroups,
        }),
    };
    let is_ray = |map: &ShadowMap| map.lookup.as_ref().is_some_and(Lookup::marches_cells);
    let has_no_map = |map: &ShadowMap| map.group.entries().len() == 1;
    Ok(MethodRecord {
        label: method.spec().to_string(),
        follows_light: builds.is_some() || maps.iter().all(has_no_map),
        builds: build_records,
        is_reference: maps.iter().all(|map| has_no_map(map) && is_ray(map)),
        field: contents.group(field)?,
        stage: contents.group(stage)?,
        mesh: mesh.as_ref().map(|mesh| contents.group(mesh)).transpose()?,
        background: contents.pipeline(&picture.background, &groups(&picture.passes[0].shadow))?,
        project,
        passes,
    })
}

fn space_record(session: &Session) -> SpaceRecord {
    let volume = &session.loaded.volume;
    let grid_from_world = grid_from_world(volume);
    let dims = volume.dims();
    let active = session.transfer.active.index_box(dims);
    let whole = [DVec3::splat(-0.5), DVec3::from(dims.map(|n| n as f64 - 0.5))];
    let active = active.unwrap_or(whole).map(|index| index + 1.0);
    let hull = session.transfer.active.hull(dims).map_or(&active[..], |hull| &hull.corners);
    SpaceRecord {
        grid_from_world: grid_from_world.to_cols_array(),
        world_from_grid: grid_from_world.inverse().to_cols_array(),
        volume_center: volume.center_mm().to_array(),
        min_spacing_mm: volume.min_spacing_mm(),
        dims,
        hull: hull.iter().map(DVec3::to_array).collect(),
        active: active.map(|corner| corner.to_array()),
        brick_cells: BRICK_CELLS,
        far: FAR,
    }
}

fn packed(record: &PageRecord<'_>, bytes: &[u8]) -> Result<Vec<u8>> {
    let fail = |e: &dyn std::fmt::Display| Error::runtime("cannot write page", "data", e);
    let mut text = serde_json::to_vec(record).map_err(|e| fail(&e))?;
    text.resize((text.len() + 4).next_multiple_of(16) - 4, b' ');
    let length = u32::try_from(text.len()).map_err(|e| fail(&e))?;
    let mut gzip = GzEncoder::new(Vec::new(), Compression::best());
    let written =
        [&length.to_le_bytes()[..], &text, bytes].into_iter().try_for_each(|all| gzip.write_all(all));
    written.and_then(|()| gzip.finish()).map_err(|e| fail(&e))
}
