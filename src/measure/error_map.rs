//! A method's error pixel by pixel: its picture, or the light on what each pixel sees, less the exact one.

use super::stats::ErrorStats;
use crate::error::Result;
use crate::exact::{ExactField, VisiblePoint};
use crate::render::{DeviceTransfer, LightMaps, LoadedVolume, Renderer};
use crate::scene::Scene;
use ndarray::{Array2, Array3, Axis, concatenate};
use rayon::prelude::*;

/// Rows that are computed between two times that someone may end the work.
const ROWS_AT_ONCE: u32 = 4;
/// Points queried at once, few enough that other threads can draw in between.
const POINTS_AT_ONCE: usize = 1 << 13;
const BAND_MS: f64 = 25.0;

/// Quantity whose error the map shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Transmittance from the scene's first light to the point that half of a pixel's opacity lies in front of.
    Light,
    /// Error of the picture: the largest over the channels of linear RGB.
    Picture,
}

/// Exact results for the pixels of one scene.
#[derive(Debug, Clone)]
pub struct ExactView {
    /// Scene, with the size of the result.
    pub scene: Scene,
    answer: Answer,
}

#[derive(Debug, Clone)]
enum Answer {
    /// Pixels with opacity, row by row: their numbers, visible points, and the exact transmittance there.
    Light(Vec<(u32, VisiblePoint, f64)>),
    Picture(Array3<f32>),
}

/// Errors of one method, pixel by pixel.
#[derive(Debug, Clone)]
pub struct ErrorMap {
    /// `height x width`, method less exact; NaN without extinction, infinite where the method gives no number.
    pub errors: Array2<f32>,
    /// Over the pixels with opacity, each weighted by it; `None` where there are none.
    pub stats: Option<ErrorStats>,
}

impl ExactView {
    /// Computes the answer at the scene's size; `None` where `go_on` ended it, which is called every few rows.
    ///
    /// [`Quantity::Light`] takes a ray from each pixel and one from what it sees; [`Quantity::Picture`] a hundred or more.
    pub fn new(
        field: &ExactField<'_>,
        scene: &Scene,
        quantity: Quantity,
        go_on: impl Fn() -> bool,
    ) -> Option<Self> {
        let (scene, light) = (scene.clone(), scene.light());
        let mut visible = Vec::new();
        let mut rows_done: Vec<Array3<f32>> = Vec::new();
        for first in (0..scene.height).step_by(ROWS_AT_ONCE as usize) {
            if !go_on() {
                return None;
            }
            let rows = first..(first + ROWS_AT_ONCE).min(scene.height);
            match quantity {
                Quantity::Light => {
                    let first_pixel = first * scene.width;
                    let found = field.visible_points_of_pixels(&scene, rows);
                    let lit = (first_pixel..).zip(found).collect::<Vec<_>>().into_par_iter();
                    visible.par_extend(lit.filter_map(|(pixel, point)| {
                        let point = point?;
                        let exact = field.transmittance_to_light(point.position, &light);
                        Some((pixel, point, exact))
                    }));
                }
                Quantity::Picture => rows_done.push(field.picture_rows(&scene, rows)),
            }
        }
        let answer = match quantity {
            Quantity::Light => Answer::Light(visible),
            Quantity::Picture => {
                let parts: Vec<_> = rows_done.iter().map(|rows| rows.view()).collect();
                // Rows of one width in order make a picture.
                let empty = || Array3::zeros((0, scene.width as usize, 4));
                Answer::Picture(concatenate(Axis(0), &parts).unwrap_or_else(|_| empty()))
            }
        };
        Some(Self { scene, answer })
    }

    /// A method's errors; `shadows` are of this scene's lights, in their order. `None` where `go_on`, which is called now and
    /// then, ended it.
    ///
    /// # Errors
    /// A lost device.
    pub fn errors<'a>(
        &self,
        renderer: &Renderer,
        loaded: &LoadedVolume,
        transfer: &DeviceTransfer,
        shadows: impl Into<LightMaps<'a>>,
        go_on: impl Fn() -> bool,
    ) -> Result<Option<ErrorMap>> {
        let shadows = shadows.into();
        let (width, height) = (self.scene.width as usize, self.scene.height as usize);
        let mut errors = Array2::from_elem((height, width), f32::NAN);
        let known = |error: f64| if error.is_nan() { f64::INFINITY } else { error };
        let mut weighted = Vec::new();
        match &self.answer {
            Answer::Light(visible) => {
                let Some(shadow) = shadows.maps().first() else { return Ok(None) };
                for some in visible.chunks(POINTS_AT_ONCE) {
                    if !go_on() {
                        return Ok(None);
                    }
                    let points_mm: Vec<_> = some.iter().map(|(_, point, _)| point.position).collect();
                    let values = renderer.query(loaded, transfer, shadow, &points_mm)?;
                    for ((pixel, point, exact), value) in some.iter().zip(values) {
                        let error = known(f64::from(value) - exact);
                        errors[[*pixel as usize / width, *pixel as usize % width]] = error as f32;
                        weighted.push((error, point.weight));
                    }
                }
            }
            Answer::Picture(exact) => {
                let drawn =
                    renderer.render_in_bands(loaded, transfer, shadows, &self.scene, BAND_MS, |_| go_on())?;
                let Some(picture) = drawn.map(|drawn| drawn.pixels) else { return Ok(None) };
                for (((row, column), error), exact) in errors.indexed_iter_mut().zip(exact.lanes(Axis(2))) {
                    let off = |c: usize| known(f64::from(picture[[row, column, c]]) - f64::from(exact[c]));
                    let opacity = f64::from(exact[3]);
                    let farthest = (0..3).map(off).max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
                    if opacity > 0.0 {
                        *error = farthest as f32;
                        weighted.push((farthest, opacity));
                    }
                }
            }
        }
        Ok(Some(ErrorMap { errors, stats: ErrorStats::of(weighted)? }))
    }
}
