//! Errors of a picture that are the shadows' own: against a picture with the same integration along eye rays, in which
//! shadow rays answer each query for light. Both pictures have the full size.

use super::errors::VisiblePointsByLight;
use super::flip::{SeenPicture, flip};
use super::job::Job;
use super::similarity::ssim;
use super::stats::{ImageError, image_error};
use crate::error::Result;
use crate::shadow::{Lookup, ShadowMap, parse};
use ndarray::{Array3, ArrayView3};

/// Difference of a method's picture from that with exact shadows.
pub(super) struct ShadowError {
    pub image: ImageError,
    /// Mean structural similarity; `None` for pictures that are smaller than its window.
    pub ssim: Option<f64>,
    /// Mean FLIP of the pictures as they are displayed; `None` where a value is not finite.
    pub flip: Option<f64>,
}

/// Picture of a scene by shadow rays.
struct Reference {
    picture: Array3<f32>,
    seen: SeenPicture,
}

/// Pictures of a scene by shadow rays, each rendered when it is first needed: one in which samples of an eye ray share
/// queries for light (`lookup=shared`), and one in which they do not (`lookup=each`).
#[derive(Default)]
pub(super) struct ShadowReferences {
    shared: Option<Reference>,
    each: Option<Reference>,
    /// Largest error of the shadow rays at the visible points.
    rays_error: Option<f64>,
}

impl ShadowReferences {
    /// Measures a picture of the job's scene, which was rendered with the shadow maps of a method.
    ///
    /// # Errors
    /// The device is lost, or out of memory.
    pub fn measure(
        &mut self,
        job: &Job,
        visible: &VisiblePointsByLight,
        (shadows, picture): (&[ShadowMap], ArrayView3<f32>),
    ) -> Result<ShadowError> {
        let each = shadows.iter().any(|map| map.lookup.as_ref().is_some_and(Lookup::answers_each_sample));
        let known = if each { &mut self.each } else { &mut self.shared };
        if known.is_none() {
            let rays = parse(if each { "rays:lookup=each" } else { "rays" })?;
            let maps = job.session.shadows_of(rays.as_ref(), job.scene)?;
            let picture = job.session.render(&maps, job.scene)?.pixels;
            let seen = SeenPicture::of(picture.view());
            let stats = visible.errors(job.session, &maps)?;
            self.rays_error =
                stats.map(|stats| stats.max_abs).into_iter().chain(self.rays_error).reduce(f64::max);
            *known = Some(Reference { picture, seen });
        }
        let Some(Reference { picture: exact, seen }) = known else { unreachable!("it was rendered above") };
        Ok(ShadowError {
            image: image_error(picture, exact.view())?,
            ssim: ssim(picture, exact.view())?,
            flip: flip(picture, (exact.view(), seen))?,
        })
    }

    /// Returns a note on the accuracy of the pictures by shadow rays, once one has been rendered.
    pub fn note(&self) -> Option<String> {
        let error = self.rays_error?;
        Some(format!(
            "shadow_rmse, shadow_psnr, shadow_ssim and flip are against a picture by shadow rays of the same size and \
            step, whose transmittance is off by at most {error:.1e} at the visible points"
        ))
    }
}
