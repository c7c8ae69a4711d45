//! Map of a shadow method's errors over the pixels of a picture: errors of the picture, or of the transmittance from
//! the light to the visible point behind each pixel; or bounds on the errors of the certified picture.

use super::certified::{CertifiedScene, DEFAULT_ETA};
use super::errors::mean_of_maps;
use super::stats::ErrorStats;
use crate::error::{Error, Result};
use crate::exact::{ExactField, VisiblePoint};
use crate::render::{DeviceTransfer, LightMaps, LoadedVolume, Renderer};
use crate::scene::Scene;
use crate::shadow::ShadowMap;
use crate::transfer::TransferFunction;
use crate::volume::DirectionMoments;
use glam::DVec3;
use ndarray::{Array2, Array3, Axis, concatenate};
use rayon::prelude::*;
use std::sync::Arc;

/// Number of picture rows whose exact result is computed between two tests for cancellation.
const ROWS_AT_ONCE: u32 = 4;
/// Maximum number of points per query for transmittance. A small number lets other threads render between queries.
const POINTS_AT_ONCE: usize = 1 << 13;
const BAND_MS: f64 = 25.0;

/// Quantity whose error an error map shows at each pixel: transmittance from the light or picture colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Error of the transmittance from the scene's first light to the visible point behind each pixel. Half of the
    /// pixel's opacity lies in front of this point.
    Light,
    /// Error of the rendered picture: the signed difference of the linear RGB channel with the largest absolute
    /// difference.
    Picture,
    /// Bound on the error of the certified picture, partly estimated, with ETA 0.03. The method stores enclosures
    /// (`enclose=on`).
    Bound,
}

/// Exact results for the pixels of one scene: a picture, or the transmittance from the light to the visible point
/// behind each pixel.
#[derive(Debug, Clone)]
pub struct ExactView {
    /// Scene for which the exact results were computed; its width and height are those of the error map.
    pub scene: Scene,
    answer: Answer,
}

#[derive(Debug, Clone)]
enum Answer {
    /// Data of each pixel with opacity, row by row: pixel index, visible point behind the pixel, and exact
    /// transmittance from the light to that point.
    Light(Vec<(u32, VisiblePoint, f64)>),
    Picture(Array3<f32>),
    /// Transfer function and strand directions for a certified picture: its bounds need no exact results.
    Bound(Box<TransferFunction>, Option<Arc<DirectionMoments>>),
}

/// Errors of one shadow method at each pixel of a picture.
#[derive(Debug, Clone)]
pub struct ErrorMap {
    /// Error at each pixel, shadow method minus exact result, or the bound on it, `height x width`. NaN where the pixel
    /// has no opacity, infinite where the method gives NaN.
    pub errors: Array2<f32>,
    /// Statistics of a shadow method's errors over the pixels with opacity, weighted by opacity; `None` where no
    /// pixel has opacity.
    pub stats: Option<ErrorStats>,
}

impl ExactView {
    /// Computes the exact picture or transmittance for every pixel of a scene. `go_on` is called every few rows; if
    /// it returns `false`, the computation stops and gives `None`.
    ///
    /// [`Quantity::Light`] takes two rays per pixel: the camera ray, and one from the visible point to the light.
    /// [`Quantity::Picture`] takes a hundred or more. [`Quantity::Bound`] takes none.
    pub fn new(
        field: &ExactField<'_>,
        scene: &Scene,
        quantity: Quantity,
        go_on: impl Fn() -> bool,
    ) -> Option<Self> {
        let (scene, source) = (scene.clone(), scene.lights.first().cloned().unwrap_or_default());
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
                        let exact = field.transmittance_from(point.position, &source).value;
                        Some((pixel, point, exact))
                    }));
                }
                Quantity::Picture => rows_done.push(field.picture_rows(&scene, rows)),
                Quantity::Bound => break,
            }
        }
        let answer = match quantity {
            Quantity::Bound => {
                let tf = Box::new(field.transfer_function().clone());
                Answer::Bound(tf, field.directions().cloned())
            }
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

    /// Returns the quantity whose errors are compared.
    pub fn quantity(&self) -> Quantity {
        match self.answer {
            Answer::Light(_) => Quantity::Light,
            Answer::Picture(_) => Quantity::Picture,
            Answer::Bound(..) => Quantity::Bound,
        }
    }

    /// Computes a shadow method's errors at each pixel against the exact results. `shadows` are the shadow maps of
    /// the scene's lights, in order. `go_on` is called repeatedly; if it returns `false`, the computation stops and
    /// gives `None`.
    ///
    /// # Errors
    /// The device is lost, or bounds are asked of a shadow map without enclosures.
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
                for some in visible.chunks(POINTS_AT_ONCE) {
                    if !go_on() {
                        return Ok(None);
                    }
                    let points_mm: Vec<_> = some.iter().map(|(_, point, _)| point.position).collect();
                    let query =
                        |map: &ShadowMap, points: &[DVec3]| renderer.query(loaded, transfer, map, points);
                    let values = mean_of_maps(shadows.maps(), &points_mm, query)?;
                    for ((pixel, point, exact), value) in some.iter().zip(values) {
                        let error = known(value - exact);
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
            Answer::Bound(tf, directions) => {
                let field = ExactField::new(&loaded.volume, tf).with_directions(directions.clone());
                let shadows = shadows.maps();
                let certified = CertifiedScene { renderer, loaded, transfer, shadows, field: &field };
                let proceed = || if go_on() { Ok(()) } else { Err(Error::cancelled("certified picture")) };
                let certified = match certified.render(&self.scene, DEFAULT_ETA, &|_| proceed()) {
                    Err(e) if e.is_cancelled() => return Ok(None),
                    found => found?,
                };
                for ((row, column), error) in errors.indexed_iter_mut() {
                    let opacity = f64::from(certified.pixels[[row, column, 3]]);
                    if opacity > 0.0 {
                        *error = certified.error[[row, column]];
                        weighted.push((f64::from(*error), opacity));
                    }
                }
            }
        }
        loaded.volume.check_reads()?;
        Ok(Some(ErrorMap { errors, stats: ErrorStats::of(weighted)? }))
    }
}
