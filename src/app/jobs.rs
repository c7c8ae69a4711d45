//! What the render thread does besides pictures on the screen: probes and exports.

use super::engine::Engine;
use super::method_choice::MethodChoice;
use super::worker::{Event, Speaker};
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::files::picture::{Backdrop, write_picture_as};
use crate::render::Work;
use crate::scene::{Light, Scene};
use crate::transfer::TransferFunction;
use glam::DVec3;
use std::path::PathBuf;
use std::sync::Arc;

/// Depths along the light ray at which a method is asked.
const PROBE_DEPTHS: usize = 320;
/// A pixel that stops less of the light than this shows nothing to probe.
const LEAST_OPACITY: f64 = 0.004;
/// While an export runs, a submission keeps the queue no longer than about this.
const EXPORT_BAND_MS: f64 = 25.0;

/// Where to probe.
#[derive(Debug, Clone)]
pub enum Aim {
    /// What is seen through a pixel's middle: along a ray from the eye, unit direction.
    Ray { origin: DVec3, direction: DVec3 },
    /// A point, world mm.
    Point(DVec3),
}

/// A question about one point.
#[derive(Debug, Clone)]
pub struct ProbeRequest {
    pub aim: Aim,
    pub tf: Arc<TransferFunction>,
    pub light: Light,
    pub ambient: f64,
    pub methods: Vec<MethodChoice>,
}

/// A method's answer along the light ray.
#[derive(Debug, Clone)]
pub struct MethodCurve {
    pub spec: String,
    /// Depth in mm and transmittance.
    pub points: Vec<[f64; 2]>,
    /// Transmittance at the point itself.
    pub at_point: f64,
}

/// Transmittance against depth along the light ray through a point.
#[derive(Debug, Clone)]
pub struct ProbeResult {
    /// World mm.
    pub point: DVec3,
    /// The scalar value there.
    pub value: f64,
    /// Depth of the point along its light ray, mm; 0 is where the ray comes to the volume (or leaves the light).
    pub depth_mm: f64,
    /// Depth in mm and exact transmittance.
    pub exact: Vec<[f64; 2]>,
    pub exact_at_point: f64,
    pub methods: Vec<MethodCurve>,
}

/// A picture to write.
#[derive(Debug, Clone)]
pub struct Export {
    pub path: PathBuf,
    pub tf: Arc<TransferFunction>,
    pub method: MethodChoice,
    /// With the picture's own size.
    pub scene: Scene,
    pub backdrop: Backdrop,
}

/// How an export ended; `false`: it was cancelled.
pub struct Exported {
    pub path: PathBuf,
    pub result: Result<bool>,
}

impl Engine {
    /// Answers a probe; says nothing where the ray meets nothing.
    pub fn probe(&mut self, request: &ProbeRequest, speaker: &Speaker) -> Result<()> {
        let Some(loaded) = &self.loaded else { return Ok(()) };
        let volume = Arc::clone(&loaded.volume);
        let field = ExactField::new(&volume, &request.tf);
        let point = match request.aim {
            Aim::Point(point) => point,
            Aim::Ray { origin, direction } => {
                let seen = field.seen_along(origin, direction, 0.5).filter(|s| s.weight >= LEAST_OPACITY);
                let Some(seen) = seen else { return Ok(()) };
                seen.position
            }
        };
        let (toward, distance_mm) = request.light.from_point(point);
        let corners = volume.corners_mm();
        let reach = |along: DVec3| corners.iter().map(|c| (*c - point).dot(along)).fold(0.0, f64::max);
        let (before_mm, behind_mm) = (reach(toward).min(distance_mm), reach(-toward));
        let start = point + toward * before_mm;
        let length_mm = before_mm + behind_mm;
        let curve = field.curve_along(start, -toward, length_mm);
        let depths: Vec<f64> =
            (0..PROBE_DEPTHS).map(|i| length_mm * i as f64 / (PROBE_DEPTHS - 1) as f64).collect();
        let exact = depths.iter().map(|&z| [z, curve.transmittance_at(z)]).collect();
        let mut points: Vec<DVec3> = depths.iter().map(|&z| start - toward * z).collect();
        points.push(point);
        let mut work = Work::default();
        self.kept.set_transfer(&self.renderer, loaded, &request.tf, &mut work)?;
        let scene = Scene { light: request.light, ambient: request.ambient, ..Scene::framing(&volume) };
        let mut methods = Vec::new();
        for choice in &request.methods {
            let (spec, method) = (choice.spec(), choice.method()?);
            self.kept.prepare(&self.renderer, loaded, (&spec, method.as_ref()), &scene, &mut work)?;
            let (Some(transfer), Some(shadow)) =
                (self.kept.transfer(), self.kept.shadow(&spec, request.light))
            else {
                continue;
            };
            let found = self.renderer.query(loaded, transfer, shadow, &points)?;
            let at_point = found.last().copied().map_or(1.0, f64::from);
            let curve = depths.iter().zip(&found).map(|(&z, &t)| [z, f64::from(t)]).collect();
            methods.push(MethodCurve { spec, points: curve, at_point });
        }
        let index = volume.index_from_world().transform_point3(point);
        speaker.say(Event::Probed(Box::new(ProbeResult {
            point,
            value: volume.value_at(index),
            depth_mm: before_mm,
            exact,
            exact_at_point: curve.transmittance_at(before_mm),
            methods,
        })));
        Ok(())
    }

    /// Draws and writes a picture; `false` where `go_on` ended it, and then no file.
    pub fn export(&mut self, export: &Export, speaker: &Speaker, go_on: impl Fn() -> bool) -> Result<bool> {
        let nothing = || Error::runtime("cannot export", export.path.display(), "no volume is open");
        let loaded = self.loaded.as_ref().ok_or_else(nothing)?;
        let mut work = Work::default();
        self.kept.set_transfer(&self.renderer, loaded, &export.tf, &mut work)?;
        let (spec, method) = (export.method.spec(), export.method.method()?);
        self.kept.prepare(&self.renderer, loaded, (&spec, method.as_ref()), &export.scene, &mut work)?;
        let transfer = self.kept.transfer().ok_or_else(nothing)?;
        let shadow = self.kept.shadow(&spec, export.scene.light).ok_or_else(nothing)?;
        let mut last = -1.0_f32;
        let picture = self.renderer.render_in_bands(
            loaded,
            transfer,
            shadow,
            &export.scene,
            EXPORT_BAND_MS,
            |share| {
                if share - last >= 0.01 {
                    last = share;
                    speaker.say(Event::ExportProgress(share));
                }
                go_on()
            },
        )?;
        match picture {
            Some(picture) => write_picture_as(&export.path, &picture.pixels, export.backdrop).map(|()| true),
            None => Ok(false),
        }
    }
}
