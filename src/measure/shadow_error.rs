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
    fn new(job: &Job, visible: &VisiblePointsByLight, light: LightOnEyeRays) -> Result<Self> {
        let rays = parse(if light.each_sample { "rays:lookup=each" } else { "rays" })?;
        let mut maps = job.session.shadows_of(rays.as_ref(), job.scene)?;
        let rays_error = visible.errors(job.session, &maps)?.map_or(0.0, |stats| stats.max_abs);
        if light.is_linear {
            maps.iter_mut().for_each(|map| map.lookup = map.lookup.take().map(Lookup::with_linear_light));
        }
        let picture = job.session.render(&maps, job.scene)?;
        let filtered = FilteredPicture::of(picture.pixels.view());
        Ok(Self { picture, filtered, rays_error })
    }
}

/// Way in which a picture integrates light along its eye rays.
#[derive(Clone, Copy, Default)]
struct LightOnEyeRays {
    /// Whether each sample of an eye ray has a query for light of its own (`lookup=each`).
    each_sample: bool,
    /// Whether the light between two queries is linear in both, as with random estimators.
    is_linear: bool,
}

impl LightOnEyeRays {
    fn of(shadows: &[ShadowMap]) -> Self {
        let any = |is: fn(&Lookup) -> bool| shadows.iter().any(|map| map.lookup.as_ref().is_some_and(is));
        Self { each_sample: any(Lookup::answers_each_sample), is_linear: any(Lookup::has_linear_light) }
    }
}

/// Pictures of a scene by shadow rays, one for each way to integrate light along eye rays, rendered when it is first
/// needed.
#[derive(Default)]
pub(super) struct ShadowReferences([Option<Result<Reference>>; 4]);

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
        let light = LightOnEyeRays::of(shadows);
        let Ok(Reference { picture: exact, filtered, .. }) = self.get(job, visible, light) else {
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
        self.get(job, visible, LightOnEyeRays::default())
            .as_ref()
            .map(|reference| &reference.picture)
            .map_err(Clone::clone)
    }

    fn get(
        &mut self,
        job: &Job,
        visible: &VisiblePointsByLight,
        light: LightOnEyeRays,
    ) -> &Result<Reference> {
        let place = usize::from(light.each_sample) + 2 * usize::from(light.is_linear);
        self.0[place].get_or_insert_with(|| Reference::new(job, visible, light))
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
