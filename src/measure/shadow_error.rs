//! Errors of a picture that the shadows alone cause: against a picture with the same integration along eye rays, in which
//! shadow rays answer each query for light. Both pictures have the full size.

use super::errors::VisiblePointsByLight;
use super::flip::{FilteredPicture, flip};
use super::job::Job;
use super::progress::Progress;
use super::similarity::ssim;
use super::stats::{ImageError, image_error};
use crate::error::Result;
use crate::render::Picture;
use crate::shadow::{Lookup, ShadowMap, parse};
use ndarray::ArrayView3;

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
    picture: Picture,
    filtered: FilteredPicture,
    /// Largest error of the shadow rays at the visible points.
    rays_error: f64,
}

impl Reference {
    /// Renders the picture, with a shadow ray for each sample of an eye ray or for several together.
    fn new(job: &Job, visible: &VisiblePointsByLight, each: bool) -> Result<Self> {
        let rays = parse(if each { "rays:lookup=each" } else { "rays" })?;
        let maps = job.session.shadows_of(rays.as_ref(), job.scene)?;
        let picture = job.session.render(&maps, job.scene)?;
        let filtered = FilteredPicture::of(picture.pixels.view());
        let rays_error = visible.errors(job.session, &maps)?.map_or(0.0, |stats| stats.max_abs);
        Ok(Self { picture, filtered, rays_error })
    }
}

/// Pictures of a scene by shadow rays, each rendered when it is first needed: one in which samples of an eye ray share
/// queries for light (`lookup=shared`), and one in which they do not (`lookup=each`).
#[derive(Default)]
pub(super) struct ShadowReferences([Option<Result<Reference>>; 2]);

impl ShadowReferences {
    /// Measures a picture of the job's scene, which was rendered with the shadow maps of a method. `None` if there is no
    /// picture by shadow rays; [`Self::note`] says why.
    ///
    /// # Errors
    /// The user cancelled the measurement.
    pub fn measure(
        &mut self,
        job: &Job,
        visible: &VisiblePointsByLight,
        (shadows, picture): (&[ShadowMap], ArrayView3<f32>),
        progress: &mut Progress,
    ) -> Result<Option<ShadowError>> {
        progress.check("shadows in the picture")?;
        let each = shadows.iter().any(|map| map.lookup.as_ref().is_some_and(Lookup::answers_each_sample));
        let Ok(Reference { picture: exact, filtered, .. }) = self.get(job, visible, each) else {
            return Ok(None);
        };
        let exact = &exact.pixels;
        Ok(Some(ShadowError {
            image: image_error(picture, exact.view())?,
            ssim: ssim(picture, exact.view())?,
            flip: flip(picture, (exact.view(), filtered))?,
        }))
    }

    /// Returns the picture of the method `rays` with its default settings.
    ///
    /// # Errors
    /// The device cannot render it.
    pub fn picture_by_rays(&mut self, job: &Job, visible: &VisiblePointsByLight) -> Result<&Picture> {
        self.get(job, visible, false).as_ref().map(|reference| &reference.picture).map_err(Clone::clone)
    }

    fn get(&mut self, job: &Job, visible: &VisiblePointsByLight, each: bool) -> &Result<Reference> {
        self.0[usize::from(each)].get_or_insert_with(|| Reference::new(job, visible, each))
    }

    /// Returns a note on the accuracy of the pictures by shadow rays, or on why there is none.
    pub fn note(&self) -> Option<String> {
        let what = "shadow_rmse, shadow_psnr, shadow_ssim and flip";
        let known = || self.0.iter().flatten();
        if let Some(error) = known().find_map(|reference| reference.as_ref().err()) {
            return Some(format!("{what} are left out: {error}"));
        }
        let error = known().flatten().map(|reference| reference.rays_error).reduce(f64::max)?;
        Some(format!(
            "{what} are against a picture by shadow rays of the same size and step, whose transmittance is off by at most \
            {error:.1e} at the visible points"
        ))
    }
}
