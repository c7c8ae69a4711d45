//! Jobs of the render thread other than pictures on the screen: transmittance probes, thumbnails of transfer-function
//! presets, picture exports.

use super::cached_session::CachedSession;
use super::mailbox::EventSender;
use super::messages::{
    Event, Export, MethodCurve, ProbeRequest, ProbeResult, ProbeTarget, Thumbnail, ThumbnailRequest,
};
use super::probe_bound::test_bound;
use super::shadow_cache::{Building, MapCoverage, Work};
use crate::error::{Error, Result};
use crate::exact::ExactField;
use crate::files::picture::write_picture_with;
use crate::render::{DisabledOptimizations, DisplayTexture, Pace, Screen};
use crate::scene::Scene;
use crate::shadow::NoShadows;
use glam::DVec3;
use std::sync::Arc;

/// Number of depths along the light ray in a transmittance curve for the probe.
const PROBE_DEPTHS: usize = 320;
/// Minimum opacity of a pixel at which the user can probe its visible point.
const MIN_OPACITY: f64 = 0.004;
/// Target duration of one GPU submission while a picture is exported or a thumbnail is rendered, ms.
const BAND_MS: f64 = 25.0;

/// Computes the transmittance curves along the light ray through a probed point and sends them to the window. Sends
/// nothing if the view ray hits nothing visible.
pub fn probe(session: &mut CachedSession, request: &ProbeRequest, events: &EventSender) -> Result<()> {
    let Some(loaded) = &session.loaded else { return Ok(()) };
    let volume = Arc::clone(&loaded.volume);
    let field = ExactField::new(&volume, &request.tf);
    let point = match request.target {
        ProbeTarget::Point(point) => point,
        ProbeTarget::Ray { origin, direction } => {
            let seen = field
                .visible_point_along(origin, direction, f64::INFINITY, 0.5)
                .filter(|s| s.weight >= MIN_OPACITY);
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
    volume.check_reads()?;
    let mut points: Vec<DVec3> = depths.iter().map(|&z| start - toward * z).collect();
    points.push(point);
    let mut work = Work::default();
    session.set_transfer(&request.tf, &mut work)?;
    let scene = Scene { ambient: request.ambient, ..Scene::framing(&volume).under(request.light.into()) };
    let mut methods = Vec::new();
    for spec in &request.methods {
        let method = spec.method()?;
        let made = session.prepare(method.as_ref(), (&scene, MapCoverage::AnyPoint), &mut work)?;
        let Some(shadow) = made.shadows.first() else { continue };
        let found = made.renderer.query(made.loaded, made.transfer, shadow, &points)?;
        let at_point = found.last().copied().map_or(1.0, f64::from);
        let curve = depths.iter().zip(&found).map(|(&z, &t)| [z, f64::from(t)]).collect();
        let bound = test_bound(&made, method.taps(), &field, request.light, point)?;
        methods.push(MethodCurve { spec: format!("{spec:#}"), points: curve, at_point, bound });
    }
    let index = volume.index_from_world().transform_point3(point);
    events.send(Event::Probed(Box::new(ProbeResult {
        point,
        value: volume.value_at(index),
        depth_mm: before_mm,
        exact,
        exact_at_point: curve.transmittance_at(before_mm),
        methods,
    })));
    Ok(())
}

/// Renders the thumbnail of a transfer-function preset with separate lookup tables. The tables of the picture on
/// screen stay. A reduced copy of the volume takes its place.
pub fn thumbnail(
    (session, copy): (&CachedSession, Option<&CachedSession>),
    request: ThumbnailRequest,
    events: &EventSender,
) -> Result<()> {
    let ThumbnailRequest { index, tf, scene, volume } = request;
    if session.loaded.as_ref().is_none_or(|loaded| !Arc::ptr_eq(&loaded.volume, &volume)) {
        return Ok(());
    }
    let Some(loaded) = copy.unwrap_or(session).loaded.as_ref() else { return Ok(()) };
    let renderer = &session.renderer;
    let transfer = renderer.transfer(loaded, &tf, DisabledOptimizations::NONE)?;
    let shadows = renderer.shadows_in(loaded, &transfer, &NoShadows, &scene, None)?;
    let texture = Arc::new(DisplayTexture::new(renderer.gpu(), scene.width, scene.height)?);
    let mut pace = Pace::new(BAND_MS);
    let screen = Screen { target: &texture, pace: &mut pace };
    let drawn = renderer.draw_to(screen, (loaded, &transfer), &shadows, &scene, || true)?;
    if drawn.is_some() {
        events.send(Event::Thumbnail(Box::new(Thumbnail { index, scene, volume, texture })));
    }
    Ok(())
}

/// Renders a picture and writes it to a file. Returns `false`, and writes no file, if `proceed` stopped it.
pub fn export(
    session: &mut CachedSession,
    export: &Export,
    events: &EventSender,
    proceed: impl Fn() -> bool,
) -> Result<bool> {
    if session.loaded.is_none() {
        return Err(Error::runtime("cannot export", export.path.display(), "no volume is open"));
    }
    let mut work = Work::default();
    session.set_transfer(&export.tf, &mut work)?;
    let (method, extent) = (export.method.method()?, (&export.scene, MapCoverage::Picture));
    let building = Building { go_on: Some(&proceed), ..Building::default() };
    let made = match session.prepare_with(method.as_ref(), extent, &mut work, building) {
        Err(error) if error.is_cancelled() => return Ok(false),
        made => made?,
    };
    let mut last = -1.0_f32;
    let go_on = |share: f32| {
        if share - last >= 0.01 {
            last = share;
            events.send(Event::ExportProgress(share));
        }
        proceed()
    };
    let (renderer, scene) = (made.renderer, &export.scene);
    let picture =
        renderer.render_in_bands(made.loaded, made.transfer, made.shadows, scene, BAND_MS, go_on)?;
    match picture {
        Some(picture) => {
            write_picture_with(&export.path, &picture.pixels, export.backdrop, &[]).map(|()| true)
        }
        None => Ok(false),
    }
}
