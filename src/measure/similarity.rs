//! Structural similarity (SSIM) of two pictures, as a measure of visible difference.

use crate::error::{Error, Result};
use crate::files::color::srgb_from_linear;
use iqa::{Image, Srgb16, SsimOptions};
use ndarray::ArrayView3;

/// Width and height of the window in which SSIM (structural similarity) is computed, pixels. SSIM is undefined for
/// smaller pictures.
pub const SSIM_WINDOW: usize = 11;

/// Mean structural similarity (SSIM) of two linear RGBA pictures of `height x width x 4`; 1 for identical pictures.
///
/// Method: Wang, Bovik, Sheikh and Simoncelli 2004, with a Gaussian window of 11 x 11 pixels (standard deviation
/// 1.5), K1 = 0.01 and K2 = 0.03. SSIM is computed on the red, green and blue channels, sRGB-encoded with 16 bits,
/// and averaged over the three.
///
/// Returns `None` for pictures smaller than the window, and where a value is not finite, because it cannot be
/// encoded.
///
/// # Errors
/// The pictures differ in size.
pub fn ssim(picture: ArrayView3<f32>, reference: ArrayView3<f32>) -> Result<Option<f64>> {
    let (height, width, _) = picture.dim();
    if height < SSIM_WINDOW || width < SSIM_WINDOW || picture.iter().chain(reference).any(|v| !v.is_finite())
    {
        return Ok(None);
    }
    let failed = |e: iqa::Error| Error::runtime("cannot compare pictures", "SSIM", e);
    let encoded = |picture: ArrayView3<f32>| -> Result<Image<Srgb16>> {
        let (height, width, _) = picture.dim();
        let code = |v: f32| (srgb_from_linear(f64::from(v)) * f64::from(u16::MAX)).round() as u16;
        let codes = picture.rows().into_iter().flat_map(|pixel| [0, 1, 2].map(|c| code(pixel[c]))).collect();
        Image::srgb16(width as u32, height as u32, codes).map_err(failed)
    };
    iqa::ssim(&encoded(reference)?, &encoded(picture)?, SsimOptions::default()).map(Some).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::color::linear_from_srgb;
    use ndarray::Array3;

    /// Creates a linear test picture from a function of sRGB-encoded values in `[0, 1]`.
    fn picture(size: usize, encoded: impl Fn(usize, usize, usize) -> f64) -> Array3<f32> {
        Array3::from_shape_fn((size, size, 4), |(j, i, c)| linear_from_srgb(encoded(j, i, c)) as f32)
    }

    #[test]
    fn flat_pictures_by_hand() {
        // No variance: (2 a b + C1) / (a^2 + b^2 + C1), C1 = 1e-4 of full scale squared, a channel at a time.
        let (a, b) = (picture(16, |_, _, _| 0.5), picture(16, |_, _, c| if c == 0 { 0.4 } else { 0.5 }));
        let red = (2.0 * 0.5 * 0.4 + 1e-4) / (0.25 + 0.16 + 1e-4);
        let got = ssim(a.view(), b.view()).unwrap().unwrap();
        assert!((got - (red + 2.0) / 3.0).abs() < 1e-5, "{got}");
        assert_eq!(ssim(a.view(), a.view()).unwrap(), Some(1.0));
    }

    #[test]
    fn one_window_by_its_definition() {
        // The formula evaluated independently, over the only window in 11 x 11 pixels.
        let x = |j: usize, i: usize| 0.5 + 0.3 * ((3 * j + 5 * i) as f64).sin();
        let y = |j: usize, i: usize| 0.45 + 0.2 * ((3 * j + 5 * i) as f64 + 0.4).sin();
        let weight = |j: usize, i: usize| {
            let squared = |n: usize| (n as f64 - 5.0).powi(2);
            (-(squared(j) + squared(i)) / 4.5).exp()
        };
        let places = || (0..121).map(|n| (n / 11, n % 11));
        let total: f64 = places().map(|(j, i)| weight(j, i)).sum();
        let mean = |f: &dyn Fn(usize, usize) -> f64| {
            places().map(|(j, i)| weight(j, i) * f(j, i)).sum::<f64>() / total
        };
        let (mx, my) = (mean(&x), mean(&y));
        let (vx, vy) = (mean(&|j, i| (x(j, i) - mx).powi(2)), mean(&|j, i| (y(j, i) - my).powi(2)));
        let cov = mean(&|j, i| (x(j, i) - mx) * (y(j, i) - my));
        let expected =
            (2.0 * mx * my + 1e-4) * (2.0 * cov + 9e-4) / ((mx * mx + my * my + 1e-4) * (vx + vy + 9e-4));
        let got = ssim(picture(11, |j, i, _| x(j, i)).view(), picture(11, |j, i, _| y(j, i)).view());
        let got = got.unwrap().unwrap();
        assert!((got - expected).abs() < 1e-4, "{got}, {expected}");
        assert!(expected < 0.9, "the planted difference shows");
    }

    #[test]
    fn what_has_no_similarity() {
        let small = picture(10, |_, _, _| 0.5);
        assert_eq!(ssim(small.view(), small.view()).unwrap(), None);
        let mut broken = picture(16, |_, _, _| 0.5);
        let whole = broken.clone();
        broken[[3, 3, 0]] = f32::NAN;
        assert_eq!(ssim(broken.view(), whole.view()).unwrap(), None);
        assert!(ssim(whole.view(), picture(17, |_, _, _| 0.5).view()).is_err());
    }
}
