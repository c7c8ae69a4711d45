//! Heat maps of the error of each shadow method against an exact reference picture.

use super::cached_session::CachedSession;
use super::mailbox::EventSender;
use super::messages::{DifferenceRequest, DifferenceSide, Differences, Event};
use super::shadow_cache::{Building, MapCoverage, Work};
use crate::error::Result;
use crate::measure::certified;
use crate::measure::error_map::{ErrorMap, Quantity};
use crate::render::DisplayTexture;
use crate::report::heat::{inferno, round_max};
use std::sync::Arc;

/// Number of decades on the logarithmic colour scale of the error heat maps.
const DECADES: f32 = 3.0;
/// Colour of pixels without a visible point in the error heat map, sRGB and opacity.
const EMPTY_PIXEL: [u8; 4] = [28, 30, 34, 255];

/// Compares shadow methods with an exact reference picture and sends the error heat maps to the window. Stops early
/// if `proceed` returns `false`.
pub fn compare(
    session: &mut CachedSession,
    request: &Arc<DifferenceRequest>,
    proceed: impl Fn() -> bool,
    events: &EventSender,
) -> Result<()> {
    if session.loaded.is_none() {
        return Ok(());
    }
    let mut work = Work::default();
    session.set_transfer(&request.tf, &mut work)?;
    let scene = &request.view.scene;
    let bounds = request.view.quantity() == Quantity::Bound;
    if bounds {
        certified::check(scene)?;
    }
    let mut found = Vec::new();
    for spec in &request.methods {
        let spec = if bounds { spec.clone().enclosing()? } else { spec.clone() };
        let building = Building { go_on: Some(&proceed), ..Building::default() };
        let (method, extent) = (spec.method()?, (scene, MapCoverage::Picture));
        let map = match session.prepare_with(method.as_ref(), extent, &mut work, building) {
            Err(error) if error.is_cancelled() => None,
            Err(error) => return Err(error),
            Ok(made) => {
                request.view.errors(made.renderer, made.loaded, made.transfer, made.shadows, &proceed)?
            }
        };
        let Some(map) = map else {
            events.send(Event::DifferenceInterrupted(Arc::clone(request)));
            return Ok(());
        };
        found.push((format!("{spec:#}"), map));
    }
    let ends = found.iter().filter_map(|(_, map)| round_max(&map.errors.mapv(f32::abs)));
    let largest = ends.reduce(f32::max).unwrap_or(1.0);
    let side = |(spec, map): (String, ErrorMap)| {
        let colors = map.errors.iter().flat_map(|e| color(*e, largest, request.logarithmic));
        let (gpu, pixels) = (session.renderer.gpu(), colors.collect::<Vec<u8>>());
        let texture = Arc::new(DisplayTexture::from_srgb8(gpu, scene.width, scene.height, &pixels)?);
        Ok(DifferenceSide { spec, map, texture })
    };
    let sides = found.into_iter().map(side).collect::<Result<Vec<_>>>()?;
    let least = if request.logarithmic { largest / 10_f32.powf(DECADES) } else { 0.0 };
    let request = Arc::clone(request);
    events.send(Event::Differences(Box::new(Differences { request, sides, least, largest })));
    Ok(())
}

fn color(error: f32, largest: f32, logarithmic: bool) -> [u8; 4] {
    if error.is_nan() {
        return EMPTY_PIXEL;
    }
    let share = error.abs() / largest.max(f32::MIN_POSITIVE);
    let share = if logarithmic { 1.0 + share.log10() / DECADES } else { share };
    let [r, g, b] = inferno(f64::from(share)).0;
    [r, g, b, 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_errors_are_brighter_on_both_scales() {
        for logarithmic in [false, true] {
            let light = |error: f32| {
                let [r, g, b, _] = color(error, 0.5, logarithmic).map(f64::from);
                0.2126 * r + 0.7152 * g + 0.0722 * b
            };
            let steps = [0.01, 0.05, 0.1, 0.25, 0.5].map(light);
            assert!(steps.windows(2).all(|w| w[0] < w[1]), "{steps:?}");
            assert_eq!(color(-0.3, 0.5, logarithmic), color(0.3, 0.5, logarithmic));
            assert_eq!(color(f32::INFINITY, 0.5, logarithmic), color(0.5, 0.5, logarithmic));
            assert_eq!(color(0.0, 0.5, logarithmic), color(1e-9, 0.5, logarithmic), "start of the scale");
            assert_eq!(color(f32::NAN, 0.5, logarithmic), EMPTY_PIXEL);
        }
        // The logarithmic scale starts at a thousandth of the largest error.
        assert_eq!(color(0.5e-3, 0.5, true), color(0.0, 0.5, true));
        assert!(color(0.5e-2, 0.5, true)[0] > 50);
    }
}
