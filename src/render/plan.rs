//! What a scene needs, and what is left out: every decision is a line of `--explain`.

use super::eye_tiles::EyeTiles;
use super::mesh::with_mesh;
use super::shader::CONSTANTS;
use crate::field::{DeviceDirections, DeviceTransfer, LoadedVolume, Omittable, View, field_shader};
use crate::gpu::ShaderVariant;
use crate::scene::{LightSource, Scene, Shading, Skip};
use crate::shadow::{Lookup, ShadowMap};
use crate::transfer::{PAIR_BINS, TABLE_BINS};
use crate::volume::Volume;
use glam::DVec3;
use std::fmt;

/// Something that a scene did not need.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Omission {
    /// What is left out.
    pub what: String,
    /// Why the scene does not need it.
    pub why: String,
    /// Bytes or work saved, where known.
    pub saved: Option<String>,
    /// Its name for `--force`, where it can be forced.
    pub optional: Option<Omittable>,
}

impl Omission {
    /// What was left out, why, and what that saved.
    pub fn text(&self) -> String {
        let saved = self.saved.as_ref().map_or(String::new(), |s| format!(", {s}"));
        format!("{} ({}){saved}", self.what, self.why)
    }
}

/// The text, and in brackets the name for `--force` where there is one.
impl fmt::Display for Omission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "left out: {}", self.text())?;
        self.optional.map_or(Ok(()), |name| write!(f, " [{name}]"))
    }
}

/// The decisions for one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Whether light is looked up.
    pub shadows: bool,
    /// Whether empty bricks are leapt over.
    pub skip_bricks: bool,
    /// The shading that is computed: the scene's, or a forced one that does not count.
    pub shading: Shading,
    /// Whether there is a mesh that rays end at.
    pub mesh: bool,
    /// Everything that is left out.
    pub left_out: Vec<Omission>,
}

/// Whether any light can be kept from a sample that is seen: the one decision that is made before a shadow map is built.
/// The error is the reason why not.
pub fn needs_shadows(scene: &Scene, volume: &Volume, transfer: &DeviceTransfer) -> Result<(), &'static str> {
    if transfer.forced.has(Omittable::Shadows) {
        return Ok(());
    }
    // A mesh is lit wherever it is, and hides from the light what is behind it.
    let seen = transfer.active.index_box(volume.dims());
    if seen.is_none() && scene.mesh.is_none() {
        Err("no value has extinction")
    } else if scene.ambient >= 1.0 {
        Err("ambient 1")
    } else if !scene.lights.iter().any(LightSource::shines) {
        Err("no light shines")
    } else if scene.mesh.is_none() && !seen.is_some_and(|seen| in_view(scene, volume, seen)) {
        Err("nothing is in view")
    } else {
        Ok(())
    }
}

/// Whether a box of index coordinates may show in the picture.
fn in_view(scene: &Scene, volume: &Volume, [lo, hi]: [DVec3; 2]) -> bool {
    let sides = View::of(scene).sides(&volume.world_from_index());
    sides.may_show(0.5 * (lo + hi), 0.5 * (hi - lo))
}

/// Distance of a frame's plane from the eye, mm: through the volume's centre, so that far eyes cost no precision.
pub(super) fn plane_distance_mm(scene: &Scene, volume: &Volume) -> f64 {
    let center = volume.corners_mm().iter().sum::<DVec3>() / 8.0;
    (center - scene.camera.eye).dot(scene.camera.frame().forward).max(volume.min_spacing_mm())
}

impl Plan {
    /// Decides for one picture, and in which tiles of it rays are cast; the shadow structures of its lights are made.
    pub(super) fn of(
        scene: &Scene,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        maps: &[&ShadowMap],
    ) -> (Self, EyeTiles) {
        let forced = transfer.forced;
        let mut left_out = Vec::new();
        let mut omit = omitting(&mut left_out);
        if transfer.one_color {
            let saved = Some(megabytes(12 * (TABLE_BINS as u64 + 1)));
            omit("colour in the tables".into(), "all has one colour", saved, Some(Omittable::Colors));
        }
        match transfer.march_table() {
            None => {
                let saved = Some(megabytes(8 * (PAIR_BINS as u64).pow(2)));
                let why = "no light ray is marched cell by cell";
                omit("pre-compressed table".into(), why, saved, Some(Omittable::MarchTable));
            }
            Some(table) if !table.many_breakpoints && !forced.has(Omittable::BreakpointSearch) => {
                let why = "the pre-compressed table holds all";
                omit("search for breakpoints".into(), why, None, Some(Omittable::BreakpointSearch));
            }
            Some(_) => {}
        }
        let bricks = loaded.bricks.len();
        let inactive = bricks - transfer.active.active;
        let skip_bricks = scene.skip == Skip::Bricks && !forced.has(Omittable::Bricks);
        if skip_bricks && inactive > 0 {
            let share = 100.0 * inactive as f64 / bricks as f64;
            let what = format!("{inactive} of {bricks} bricks");
            let saved = Some(format!("{share:.1} % of the volume"));
            omit(what, "no extinction in them", saved, Some(Omittable::Bricks));
        }
        let plane_mm = plane_distance_mm(scene, &loaded.volume);
        let tiles = match scene.skip == Skip::Bricks && !forced.has(Omittable::EyeTiles) {
            true => EyeTiles::of(scene, &loaded.volume, &transfer.active, plane_mm),
            false => EyeTiles::all(scene),
        };
        let tiles = match &scene.mesh {
            Some(mesh) => tiles.with_mesh(scene, mesh),
            None => tiles,
        };
        let [all, empty] = tiles.counts();
        if empty > 0 {
            let what = format!("{empty} of {all} tiles of the picture");
            let saved = Some(format!("{:.1} % of them", 100.0 * empty as f64 / all as f64));
            let why = match scene.mesh {
                Some(_) => "neither an active brick nor a mesh may show in them",
                None => "no active brick may show in them",
            };
            omit(what, why, saved, Some(Omittable::EyeTiles));
        }
        let needed = needs_shadows(scene, &loaded.volume, transfer);
        let shadows = needed.is_ok() && maps.iter().any(|map| map.lookup.is_some());
        match needed {
            Err(why) => omit("shadow pass".into(), why, None, Some(Omittable::Shadows)),
            Ok(()) if !shadows => omit("shadow pass".into(), "method none", None, None),
            Ok(()) => omit_of_maps(maps, &mut omit),
        }
        let shading = match scene.shading {
            Shading::None if forced.has(Omittable::Gradients) => Shading::Lambert,
            shading => shading,
        };
        omit_of_shading(shading, loaded, &mut omit);
        omit_of_lights(scene, &mut omit);
        drop(omit);
        let plan = Self { shadows, skip_bricks, shading, mesh: scene.mesh.is_some(), left_out };
        (plan.with_passes_left_out(scene), tiles)
    }

    /// Says how many passes over the picture are spared, where nothing tells its lights apart.
    fn with_passes_left_out(mut self, scene: &Scene) -> Self {
        let lights = scene.shining().len();
        if lights > 1 && !self.tells_lights_apart() {
            let what = format!("{} of {lights} passes over the picture", lights - 1);
            omitting(&mut self.left_out)(what, "without shadows and shading lights add up", None, None);
        }
        self
    }

    /// Whether the picture is another under another light.
    pub(super) fn tells_lights_apart(&self) -> bool {
        self.shadows || self.mesh || self.shading != Shading::None
    }

    /// Whether the picture is made in several dispatches.
    pub(super) fn resumable(&self, shadow: &ShadowMap) -> bool {
        self.shadows && shadow.lookup.as_ref().is_some_and(|lookup| self.mesh || lookup.marches())
    }

    /// The ray caster that does just this.
    pub(super) fn raycast_shader(
        &self,
        transfer: &DeviceTransfer,
        shadow: &ShadowMap,
        light_factor: bool,
    ) -> ShaderVariant {
        let lookup = shadow.lookup.as_ref().filter(|_| self.shadows);
        let shader = raycast_shader(lookup, self.shading, self.skip_bricks, transfer.one_color, light_factor);
        match self.mesh {
            true => with_mesh(shader, lookup.is_some()).defs(lookup.map(|_| "RESUMABLE")),
            false => shader,
        }
    }
}

/// What adds to a list: what is left out, why, what that saves, and its name for `--force`.
fn omitting(list: &mut Vec<Omission>) -> impl FnMut(String, &str, Option<String>, Option<Omittable>) + '_ {
    |what, why, saved, optional| list.push(Omission { what, why: why.into(), saved, optional })
}

/// What was left out of shadow structures, of those of several lights together; what their passes leave out is said once.
fn omit_of_maps(maps: &[&ShadowMap], omit: &mut impl FnMut(String, &str, Option<String>, Option<Omittable>)) {
    let sum = |of: &dyn Fn(&ShadowMap) -> u64| maps.iter().map(|map| of(map)).sum::<u64>();
    let left_out = sum(&|map| map.report.tiles_left_out.into());
    if left_out > 0 {
        let what = format!("{left_out} of {} shadow tiles", sum(&|map| map.report.tiles.into()));
        let why = match maps.iter().any(|map| map.light_space.is_of_view()) {
            true => "no active brick under them, or out of view",
            false => "no active brick under them",
        };
        omit(what, why, Some(megabytes(sum(&|map| map.report.bytes_left_out))), Some(Omittable::Tiles));
    }
    let mut said = Vec::new();
    for pass in maps.iter().flat_map(|map| map.report.passes_left_out) {
        if !said.contains(&pass.what) {
            said.push(pass.what);
            omit(pass.what.into(), pass.why, None, pass.optional);
        }
    }
}

/// Lights that give none: no structure is built for them, and no pass is made.
fn omit_of_lights(scene: &Scene, omit: &mut impl FnMut(String, &str, Option<String>, Option<Omittable>)) {
    for (i, light) in scene.lights.iter().enumerate().filter(|(_, light)| !light.shines()) {
        let why = if light.intensity == 0.0 { "its intensity is 0" } else { "it is black" };
        omit(format!("light {} of {}", i + 1, scene.lights.len()), why, None, None);
    }
}

/// What the shading does not read: gradients, or the directions of strands.
fn omit_of_shading(
    shading: Shading,
    loaded: &LoadedVolume,
    omit: &mut impl FnMut(String, &str, Option<String>, Option<Omittable>),
) {
    let samples = Some("6 samples a lit sample".into());
    match shading {
        Shading::None => omit("gradients".into(), "shading none", samples, Some(Omittable::Gradients)),
        Shading::KajiyaKay => omit("gradients".into(), "shading kajiya-kay", samples, None),
        Shading::Lambert | Shading::BlinnPhong => {}
    }
    if loaded.strands.is_some() && !shading.is_of_strands() {
        let saved = megabytes(DeviceDirections::bytes_of(loaded.on_device.dims));
        omit("directions of strands".into(), "no shading by them", Some(saved), None);
    }
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
    shader
        .modules(&["render/frame.wgsl"])
        .modules(if shading.is_of_strands() { &["render/strand.wgsl"] } else { &[] })
        .constants(CONSTANTS)
        .defs(shading_defs(shading).iter().copied())
        .with_ray_march(skip_bricks)
        .defs(one_color.then_some("ONE_COLOR"))
        .defs(light_factor.then_some("LIGHT_FACTOR"))
}

/// Every ray caster that a plan can ask for, but for combinations of parts that do not meet.
pub(super) fn raycast_shaders(lookup: Option<&Lookup>) -> Vec<ShaderVariant> {
    let mut list = Vec::new();
    // A shading's own factor does not meet the lookup: that there is one does, and this one has most to it.
    let shadings: &[Shading] =
        if lookup.is_some() { &[Shading::None, Shading::BlinnPhong] } else { &Shading::ALL };
    for &shading in shadings {
        for (skip_bricks, one_color) in [(false, false), (false, true), (true, false), (true, true)] {
            list.push(raycast_shader(lookup, shading, skip_bricks, one_color, false));
        }
        // What a factor on the light touches knows neither of bricks nor of colours in tables.
        list.push(raycast_shader(lookup, shading, true, false, true));
        // Nor does a surface.
        for light_factor in [false, true] {
            let shader = raycast_shader(lookup, shading, true, false, light_factor);
            list.push(with_mesh(shader, lookup.is_some()).defs(lookup.map(|_| "RESUMABLE")));
        }
    }
    list
}

/// Definitions of a shading.
fn shading_defs(shading: Shading) -> &'static [&'static str] {
    match shading {
        Shading::None => &[],
        Shading::Lambert => &["SHADED", "SHADING"],
        Shading::BlinnPhong => &["SHADED", "SHADING", "BLINN_PHONG"],
        Shading::KajiyaKay => &["SHADED", "SHADING", "KAJIYA_KAY"],
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.2} MB", bytes as f64 * 1e-6)
}
