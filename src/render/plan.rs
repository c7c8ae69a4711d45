//! Plan of a picture: the work that its scene needs, such as queries for transmittance, and the work that is skipped.
//! `--explain` prints the plan.

use super::device_tiles::DeviceTiles;
use super::eye_tiles::EyeTiles;
use super::mesh::with_mesh;
use super::shader::{CONSTANTS, DEVICE_TILES};
use crate::error::{Error, Result};
use crate::field::{DeviceDirections, DeviceTransfer, LoadedVolume, Optimization, View, field_shader};
use crate::gpu::{Kernels, ShaderVariant};
use crate::scene::{LightSource, Scene, Shading, Skip};
use crate::shadow::{Lookup, Sections, ShadowMap, TOWARDS_EYE, occlusion_lookup};
use crate::transfer::{PAIR_BINS, TABLE_BINS};
use crate::volume::Volume;
use glam::DVec3;
use std::fmt;

/// Work that is skipped in drawing a picture, since its scene does not need it, with the reason.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Omission {
    /// Name of the work that is skipped in drawing a picture, such as `gradients`.
    pub what: String,
    /// Reason why the scene of a picture does not need the skipped work.
    pub why: String,
    /// Bytes or operations that were saved by skipping work of a picture, as a text; `None` if unknown.
    pub saved: Option<String>,
    /// Optimization by which the work of a picture was skipped, if `--no-skip` can disable it.
    pub optional: Option<Optimization>,
}

impl Omission {
    /// Returns a text that names the skipped work of a picture, the reason and the saving.
    pub fn text(&self) -> String {
        let saved = self.saved.as_ref().map_or(String::new(), |s| format!(", {s}"));
        format!("{} ({}){saved}", self.what, self.why)
    }
}

/// Writes the skipped work of a picture with the reason and the saving, and in brackets the name of its optimization
/// for `--no-skip`.
impl fmt::Display for Omission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "skipped: {}", self.text())?;
        self.optional.map_or(Ok(()), |name| write!(f, " [{name}]"))
    }
}

/// Plan of a picture: which work its scene needs (queries for transmittance, shading), and which work is skipped.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Whether the picture needs queries for the transmittance from its lights.
    pub shadows: bool,
    /// Whether eye rays skip bricks without extinction.
    pub skip_bricks: bool,
    /// Shading of the picture. If the scene has none and [`Optimization::Gradients`] is disabled, gradients are
    /// computed with weight 0.
    pub shading: Shading,
    /// Whether the picture's scene has a mesh.
    pub mesh: bool,
    /// List of the work that is skipped for this picture, since its scene does not need it.
    pub left_out: Vec<Omission>,
    /// Place in the list of skipped work for the tiles of the picture in which nothing is visible.
    tiles_place: usize,
}

/// Tiles of a picture in which eye rays are cast, with their depth ranges.
pub(super) enum PictureTiles {
    /// Tiles that the host has found.
    Listed(EyeTiles),
    /// Tiles that a pass on the device finds.
    OnDevice(DeviceTiles),
}

/// Decides, before any shadow map is built, whether a visible point of a scene may lie in shadow.
///
/// # Errors
/// Returns the reason why no visible point is in shadow.
pub fn needs_shadows(
    scene: &Scene,
    volume: &Volume,
    transfer: &DeviceTransfer,
) -> std::result::Result<(), &'static str> {
    if transfer.disabled.has(Optimization::Shadows) {
        return Ok(());
    }
    // A mesh outside the active bricks is lit and casts shadows too.
    let active = transfer.active.index_box(volume.dims());
    if active.is_none() && scene.mesh.is_none() {
        Err("no value has extinction")
    } else if scene.ambient >= 1.0 {
        Err("ambient 1")
    } else if !scene.lights.iter().any(LightSource::shines) {
        Err("no light shines")
    } else if scene.mesh.is_none() && !active.is_some_and(|bounds| in_view(scene, volume, bounds)) {
        Err("nothing is in view")
    } else {
        Ok(())
    }
}

/// Whether a box in voxel index coordinates may lie in the view of a scene's camera.
fn in_view(scene: &Scene, volume: &Volume, [lo, hi]: [DVec3; 2]) -> bool {
    let frustum = View::of(scene).frustum(&volume.world_from_index());
    frustum.may_intersect(0.5 * (lo + hi), 0.5 * (hi - lo))
}

/// Returns the distance from the eye to the plane across the view through the volume's centre, mm. Eye rays are
/// described from this plane, so that distant eyes lose no precision.
pub(super) fn plane_distance_mm(scene: &Scene, volume: &Volume) -> f64 {
    let center = volume.center_mm();
    (center - scene.camera.eye).dot(scene.camera.frame().forward).max(volume.min_spacing_mm())
}

impl Plan {
    /// Plans a picture with the given shadow maps: decides which work is skipped, and finds the tiles of the picture
    /// in which eye rays are cast, or prepares the pass that finds them on the device.
    ///
    /// # Errors
    /// The device is out of memory.
    pub(super) fn of(
        scene: &Scene,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        maps: &[&ShadowMap],
        kernels: &Kernels,
    ) -> Result<(Self, PictureTiles)> {
        let disabled = transfer.disabled;
        let mut left_out = Omissions(Vec::new());
        if transfer.one_color {
            let saved = Some(megabytes(12 * (TABLE_BINS as u64 + 1)));
            left_out.add("colour in the tables", "all has one colour", saved, Some(Optimization::Colors));
        }
        match transfer.march_table() {
            None => {
                let saved = Some(megabytes(8 * (PAIR_BINS as u64).pow(2)));
                let why = "no light ray is marched cell by cell";
                left_out.add("pre-compressed table", why, saved, Some(Optimization::MarchTable));
            }
            Some(table) if !table.many_breakpoints && !disabled.has(Optimization::BreakpointSearch) => {
                let why = "the pre-compressed table holds all";
                left_out.add("search for breakpoints", why, None, Some(Optimization::BreakpointSearch));
            }
            Some(_) => {}
        }
        let bricks = loaded.volume.bricks().len();
        let inactive = bricks - transfer.active.active;
        let skip_bricks = scene.skip == Skip::Bricks && !disabled.has(Optimization::Bricks);
        if skip_bricks && inactive > 0 {
            let share = 100.0 * inactive as f64 / bricks as f64;
            let what = format!("{inactive} of {bricks} bricks");
            let saved = Some(format!("{share:.1} % of the volume"));
            left_out.add(what, "no extinction in them", saved, Some(Optimization::Bricks));
        }
        if let Some(pages) = transfer.pages.filter(|pages| pages.needed < pages.total) {
            let empty = pages.total - pages.needed;
            let what = format!("{empty} of {} pages of the volume", pages.total);
            let saved = Some(megabytes(empty as u64 * pages.page_bytes));
            left_out.add(what, "no extinction in or near them", saved, None);
        }
        let tiles = picture_tiles(scene, loaded, transfer, kernels)?;
        let tiles_place = left_out.0.len();
        let needed = needs_shadows(scene, &loaded.volume, transfer);
        let shadows = needed.is_ok() && maps.iter().any(|map| map.lookup.is_some());
        match needed {
            Err(why) => left_out.add("shadow pass", why, None, Some(Optimization::Shadows)),
            Ok(()) if !shadows => left_out.add("shadow pass", "method none", None, None),
            Ok(()) => left_out.add_maps(maps),
        }
        let shading = match scene.shading {
            Shading::None if disabled.has(Optimization::Gradients) => Shading::Lambert,
            shading => shading,
        };
        left_out.add_shading(shading, loaded);
        left_out.add_lights(scene);
        let mut plan = Self {
            shadows,
            skip_bricks,
            shading,
            mesh: scene.mesh.is_some(),
            left_out: Vec::new(),
            tiles_place,
        };
        let lights = maps.len();
        if lights > 1 && !plan.depends_on_light() {
            let what = format!("{} of {lights} passes over the picture", lights - 1);
            left_out.add(what, "without shadows and shading lights add up", None, None);
        }
        plan.left_out = left_out.0;
        if let PictureTiles::Listed(tiles) = &tiles {
            plan.skip_tiles(tiles.counts());
        }
        Ok((plan, tiles))
    }

    /// Adds the tiles of the picture in which nothing is visible to the list of skipped work, from the number of all
    /// tiles and of empty ones.
    pub(super) fn skip_tiles(&mut self, [all, empty]: [usize; 2]) {
        if empty == 0 {
            return;
        }
        let why = match self.mesh {
            true => "neither an active brick nor a mesh may show in them",
            false => "no active brick may show in them",
        };
        let omission = Omission {
            what: format!("{empty} of {all} tiles of the picture"),
            why: why.into(),
            saved: Some(format!("{:.1} % of them", 100.0 * empty as f64 / all as f64)),
            optional: Some(Optimization::EyeTiles),
        };
        self.left_out.insert(self.tiles_place, omission);
    }

    /// Whether the picture differs between directions of its lights, by shading or by shadows.
    pub(super) fn depends_on_light(&self) -> bool {
        self.shadows || self.mesh || self.shading != Shading::None
    }

    /// Whether eye rays of a rendering pass may need several dispatches, each of which continues the rays where the
    /// last one stopped.
    pub(super) fn resumable(&self, shadow: &ShadowMap) -> bool {
        self.shadows && shadow.lookup.as_ref().is_some_and(|lookup| self.mesh || lookup.marches())
    }

    /// Returns the sections of the volume that a rendering pass draws one after the other.
    ///
    /// # Errors
    /// The sections were made for another view, or for points only.
    pub(super) fn sections<'a>(&self, shadow: &'a ShadowMap, scene: &Scene) -> Result<Option<&'a Sections>> {
        let Some(sections) = shadow.sections.as_ref().filter(|_| self.shadows) else { return Ok(None) };
        if sections.serves(View::of_shadows(scene).as_ref()) && !self.mesh {
            return Ok(Some(sections));
        }
        let why = if self.mesh {
            "scenes with surfaces have no slices"
        } else {
            "its slices are those of another view"
        };
        Err(Error::input("cannot draw", shadow.method, why))
    }

    /// Returns the shader that casts the eye rays of a picture under this plan.
    pub(super) fn raycast_shader(
        &self,
        transfer: &DeviceTransfer,
        shadow: &ShadowMap,
        light_factor: bool,
        device_tiles: bool,
    ) -> ShaderVariant {
        let lookup = shadow.lookup.as_ref().filter(|_| self.shadows);
        let shader = raycast_shader(lookup, self.shading, self.skip_bricks, transfer.one_color, light_factor);
        let shader = shader.defs(device_tiles.then_some(DEVICE_TILES));
        match self.mesh {
            true => with_mesh(shader, lookup.is_some()).defs(lookup.map(|_| "RESUMABLE")),
            false => shader,
        }
    }

    /// Returns the shader of the pass that adds occluded ambient light.
    pub(super) fn occlusion_shader(
        &self,
        transfer: &DeviceTransfer,
        occlusion: &ShadowMap,
        device_tiles: bool,
    ) -> ShaderVariant {
        let lookup = occlusion.lookup.as_ref();
        raycast_shader(lookup, Shading::None, self.skip_bricks, transfer.one_color, true)
            .defs(device_tiles.then_some(DEVICE_TILES))
    }
}

/// List of the work that is skipped for a picture, since its scene does not need it, with the reasons.
struct Omissions(Vec<Omission>);

impl Omissions {
    fn add(
        &mut self,
        what: impl Into<String>,
        why: &str,
        saved: Option<String>,
        optional: Option<Optimization>,
    ) {
        self.0.push(Omission { what: what.into(), why: why.into(), saved, optional });
    }

    /// Adds the skipped tiles and build passes of all shadow maps to the list of skipped work. Tiles are summed over
    /// the lights; a build pass is listed once.
    fn add_maps(&mut self, maps: &[&ShadowMap]) {
        let sum = |of: &dyn Fn(&ShadowMap) -> u64| maps.iter().map(|map| of(map)).sum::<u64>();
        let left_out = sum(&|map| map.report.tiles_left_out.into());
        if left_out > 0 {
            let what = format!("{left_out} of {} shadow tiles", sum(&|map| map.report.tiles.into()));
            let why = match maps.iter().any(|map| map.light_space.is_of_view()) {
                true => "no active brick under them, or out of view",
                false => "no active brick under them",
            };
            let saved = megabytes(sum(&|map| map.report.bytes_left_out));
            self.add(what, why, Some(saved), Some(Optimization::Tiles));
        }
        let first = self.0.len();
        for pass in maps.iter().flat_map(|map| map.report.passes_left_out) {
            if self.0[first..].iter().all(|omission| omission.what != pass.what) {
                self.add(pass.what, pass.why, None, pass.optional);
            }
        }
    }

    /// Adds the black lights of a scene to the list of skipped work, since they need neither a shadow map nor a
    /// rendering pass.
    fn add_lights(&mut self, scene: &Scene) {
        for (i, light) in scene.lights.iter().enumerate().filter(|(_, light)| !light.shines()) {
            let why = if light.intensity == 0.0 { "its intensity is 0" } else { "it is black" };
            self.add(format!("light {} of {}", i + 1, scene.lights.len()), why, None, None);
        }
    }

    /// Adds to the list of skipped work the gradients or strand directions that the shading does not read.
    fn add_shading(&mut self, shading: Shading, loaded: &LoadedVolume) {
        let samples = Some("6 samples a lit sample".into());
        match shading {
            Shading::None => self.add("gradients", "shading none", samples, Some(Optimization::Gradients)),
            Shading::KajiyaKay => self.add("gradients", "shading kajiya-kay", samples, None),
            Shading::Phase => self.add("gradients", "shading phase", samples, None),
            Shading::Lambert | Shading::BlinnPhong => {}
        }
        if loaded.strands.is_some() && !shading.is_of_strands() {
            let saved = megabytes(DeviceDirections::bytes_of(loaded.on_device.dims));
            self.add("directions of strands", "no shading by them", Some(saved), None);
        }
    }
}

/// Finds the tiles of a picture in which eye rays are cast. Those of a mesh are found by the host.
fn picture_tiles(
    scene: &Scene,
    loaded: &LoadedVolume,
    transfer: &DeviceTransfer,
    kernels: &Kernels,
) -> Result<PictureTiles> {
    let plane_mm = plane_distance_mm(scene, &loaded.volume);
    let skips = scene.skip == Skip::Bricks && !transfer.disabled.has(Optimization::EyeTiles);
    if skips && kernels.gpu().tuning.device_tiles && scene.mesh.is_none() {
        let tiles = DeviceTiles::new(kernels, loaded, transfer, scene, plane_mm)?;
        return Ok(PictureTiles::OnDevice(tiles));
    }
    let tiles = match skips {
        true => EyeTiles::of(scene, &loaded.volume, &transfer.active, plane_mm),
        false => EyeTiles::all(scene),
    };
    Ok(PictureTiles::Listed(match &scene.mesh {
        Some(mesh) => tiles.with_mesh(scene, mesh),
        None => tiles,
    }))
}

fn raycast_shader(
    lookup: Option<&Lookup>,
    shading: Shading,
    skip_bricks: bool,
    one_color: bool,
    light_factor: bool,
) -> ShaderVariant {
    let entry = "render/raycast.wgsl";
    let shader = lookup.map_or_else(
        || field_shader(entry),
        |l| l.within(entry).defs(["SHADOWS"]).defs(l.marches().then_some("RESUMABLE")),
    );
    let in_sections = lookup.filter(|lookup| lookup.has_sections()).map(|_| "render/section_ray.wgsl");
    shader
        .modules(&[
            "render/tile_depths.wgsl",
            "render/frame.wgsl",
            "render/resumption.wgsl",
            "render/mean_light.wgsl",
        ])
        .modules(shading_module(shading))
        .constants(CONSTANTS)
        .defs(shading_defs(shading).iter().copied())
        .with_ray_march(skip_bricks)
        .modules(in_sections.as_slice())
        .modules(&["render/eye_state.wgsl", "render/between_samples.wgsl", "render/segment_mean.wgsl"])
        .defs(["SURFACES"])
        .defs(one_color.then_some("ONE_COLOR"))
        .defs(light_factor.then_some("LIGHT_FACTOR"))
}

/// Returns the shaders of the pass that adds occluded ambient light, under all plans.
pub(super) fn occlusion_shaders() -> Vec<ShaderVariant> {
    let lookup = occlusion_lookup();
    let shader = |(skip, one_color)| raycast_shader(Some(&lookup), Shading::None, skip, one_color, true);
    [(true, false), (false, true)].map(shader).to_vec()
}

/// Returns the shaders that cast eye rays under all plans. Options that do not affect each other are not combined.
pub(super) fn raycast_shaders(lookup: Option<&Lookup>) -> Vec<ShaderVariant> {
    let mut list = Vec::new();
    // Lookups do not depend on the kind of shading, only on its presence: the most complex one stands for all.
    let shadings: &[Shading] =
        if lookup.is_some() { &[Shading::None, Shading::BlinnPhong] } else { &Shading::ALL };
    for &shading in shadings {
        for (skip_bricks, one_color) in [(false, false), (false, true), (true, false), (true, true)] {
            list.push(raycast_shader(lookup, shading, skip_bricks, one_color, false));
        }
        // The tiles of the picture do not depend on anything else.
        list.push(raycast_shader(lookup, shading, true, true, false).defs([DEVICE_TILES]));
        // A factor on the light depends neither on bricks nor on colours in tables.
        list.push(raycast_shader(lookup, shading, true, false, true));
        let has_sections = lookup.is_some_and(Lookup::has_sections);
        // A mesh surface does not depend on bricks and colours in tables either.
        for light_factor in [false, true] {
            let shader = raycast_shader(lookup, shading, true, false, light_factor);
            if has_sections {
                list.extend(
                    [shader.clone().defs([DEVICE_TILES]), shader].map(|shader| shader.defs([TOWARDS_EYE])),
                );
                continue;
            }
            list.push(with_mesh(shader, lookup.is_some()).defs(lookup.map(|_| "RESUMABLE")));
        }
    }
    list
}

/// Returns the file of the module `umbravox::shading` of a kind of shading.
fn shading_module(shading: Shading) -> &'static [&'static str] {
    match shading {
        Shading::None => &[],
        Shading::Lambert | Shading::BlinnPhong => &["render/gradient.wgsl"],
        Shading::KajiyaKay => &["render/strand.wgsl"],
        Shading::Phase => &["render/phase.wgsl"],
    }
}

/// Returns the names that a kind of shading defines in the shader, for `#ifdef`.
fn shading_defs(shading: Shading) -> &'static [&'static str] {
    match shading {
        Shading::None => &[],
        Shading::Lambert => &["SHADED", "SHADING_FACTOR", "SHADING"],
        Shading::BlinnPhong => &["SHADED", "SHADING_FACTOR", "SHADING", "BLINN_PHONG"],
        Shading::KajiyaKay => &["SHADED", "SHADING_FACTOR", "SHADING"],
        Shading::Phase => &["SHADED", "SHADING_FACTOR"],
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.2} MB", bytes as f64 * 1e-6)
}
