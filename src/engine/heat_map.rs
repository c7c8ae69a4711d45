//! Heat maps of the shown methods' errors against an exact answer.

use super::device::OnDevice;
use super::mailbox::Speaker;
use super::messages::{DifferenceRequest, DifferenceSide, Differences, Event};
use crate::engine::{MapCoverage, Work};
use crate::error::Result;
use crate::render::DisplayTexture;
use crate::report::heat::{inferno, round_max};
use std::sync::Arc;

/// Of a logarithmic scale.
const DECADES: f32 = 3.0;
/// Where nothing is seen there is no error.
const NOTHING_SEEN: [u8; 4] = [28, 30, 34, 255];

/// Compares methods with an exact answer, unless something else comes up meanwhile.
pub fn compare(
    device: &mut OnDevice,
    request: &Arc<DifferenceRequest>,
    go_on: impl Fn() -> bool,
    speaker: &Speaker,
) -> Result<()> {
    if device.loaded.is_none() {
        return Ok(());
    }
    let mut work = Work::default();
    device.set_transfer(&request.tf, &mut work)?;
    let scene = &request.view.scene;
    let mut found = Vec::new();
    for choice in &request.methods {
        let made = device.prepare(choice, (scene, MapCoverage::Picture), &mut work)?;
        let map = request.view.errors(made.renderer, made.loaded, made.transfer, made.shadows, &go_on)?;
        let Some(map) = map else {
            speaker.say(Event::DifferenceUnfinished(Arc::clone(request)));
            return Ok(());
        };
        found.push((made.spec, map));
    }
    let largest = found.iter().map(|(_, map)| round_max(&map.errors.mapv(f32::abs))).fold(0.0, f32::max);
    let side = |(spec, map): (String, crate::measure::error_map::ErrorMap)| {
        let colours = map.errors.iter().flat_map(|e| colour(*e, largest, request.logarithmic));
        let (gpu, pixels) = (device.renderer.gpu(), colours.collect::<Vec<u8>>());
        let texture = Arc::new(DisplayTexture::from_srgb8(gpu, scene.width, scene.height, &pixels)?);
        Ok(DifferenceSide { spec, map, texture })
    };
    let sides = found.into_iter().map(side).collect::<Result<Vec<_>>>()?;
    let least = if request.logarithmic { largest / 10_f32.powf(DECADES) } else { 0.0 };
    let request = Arc::clone(request);
    speaker.say(Event::Differences(Box::new(Differences { request, sides, least, largest })));
    Ok(())
}

fn colour(error: f32, largest: f32, logarithmic: bool) -> [u8; 4] {
    if error.is_nan() {
        return NOTHING_SEEN;
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
    fn larger_errors_are_lighter_on_both_scales() {
        for logarithmic in [false, true] {
            let light = |error: f32| {
                let [r, g, b, _] = colour(error, 0.5, logarithmic).map(f64::from);
                0.2126 * r + 0.7152 * g + 0.0722 * b
            };
            let steps = [0.01, 0.05, 0.1, 0.25, 0.5].map(light);
            assert!(steps.windows(2).all(|w| w[0] < w[1]), "{steps:?}");
            assert_eq!(colour(-0.3, 0.5, logarithmic), colour(0.3, 0.5, logarithmic));
            assert_eq!(colour(f32::INFINITY, 0.5, logarithmic), colour(0.5, 0.5, logarithmic));
            assert_eq!(
                colour(0.0, 0.5, logarithmic),
                colour(1e-9, 0.5, logarithmic),
                "the scale's beginning"
            );
            assert_eq!(colour(f32::NAN, 0.5, logarithmic), NOTHING_SEEN);
        }
        // A thousandth of the largest is the beginning of the logarithmic scale.
        assert_eq!(colour(0.5e-3, 0.5, true), colour(0.0, 0.5, true));
        assert!(colour(0.5e-2, 0.5, true)[0] > 50);
    }
}
