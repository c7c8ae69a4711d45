//! Error map of a shadow method, pixel by pixel: its picture, or its transmittance at the visible point, minus the
//! exact result.

use super::stats::ErrorStats;
use crate::error::Result;
use crate::exact::{ExactField, VisiblePoint};
use crate::render::{DeviceTransfer, LightMaps, LoadedVolume, Renderer};
use crate::scene::Scene;
use ndarray::{Array2, Array3, Axis, concatenate};
use rayon::prelude::*;

/// Number of picture rows computed between two checks for cancellation.
const ROWS_AT_ONCE: u32 = 4;
/// Number of points per query for transmittance, small enough that other threads can render between queries.
const POINTS_AT_ONCE: usize = 1 << 13;
const BAND_MS: f64 = 25.0;

/// Quantity whose error an error map shows: transmittance or picture colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Error of the transmittance from the scene's first light to the visible point of each pixel, in front of which
    /// half of the pixel's opacity lies.
    Light,
    /// Error of the rendered picture: the signed difference of the linear RGB channel with the largest absolute
    /// difference.
    Picture,
}

/// Exact results for the pixels of one scene: a picture, or the transmittance at visible points.
#[derive(Debug, Clone)]
pub struct ExactView {
    /// Scene of the exact results; its width and height are those of the error map.
    pub scene: Scene,
    answer: Answer,
}

#[derive(Debug, Clone)]
enum Answer {
    /// Pixels with opacity, row by row: pixel index, visible point, and exact transmittance from the light to that
    /// point.
    Light(Vec<(u32, VisiblePoint, f64)>),
    Picture(Array3<f32>),
}

/// Errors of one shadow method, pixel by pixel.
#[derive(Debug, Clone)]
pub struct ErrorMap {
    /// Error of each pixel, method minus exact, `height x width`. NaN where the pixel has no opacity, infinite where
    /// the method gives NaN.
    pub errors: Array2<f32>,
    /// Statistics of the errors over pixels with opacity, weighted by opacity; `None` where no pixel has opacity.
    pub stats: Option<ErrorStats>,
}

impl ExactView {
    /// Computes the exact results for every pixel of a scene. `go_on` is called every few rows; returns `None` if it
    /// returned false.
    ///
    /// [`Quantity::Light`] takes two rays per pixel: the camera ray, and one from the visible point to the light.
    /// [`Quantity::Picture`] takes a hundred or more.
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
                // Bands of equal width, in order, make a picture.
                let empty = || Array3::zeros((0, scene.width as usize, 4));
                Answer::Picture(concatenate(Axis(0), &parts).unwrap_or_else(|_| empty()))
            }
        };
        Some(Self { scene, answer })
    }

    /// Computes a shadow method's errors against the exact results. `shadows` are the shadow maps of the scene's
    /// lights, in order. `go_on` is called repeatedly; returns `None` if it returned false.
    ///
    /// # Errors
    /// The device is lost.
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
