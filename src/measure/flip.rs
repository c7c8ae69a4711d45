//! FLIP, the difference that an observer sees when two pictures alternate on a display (Andersson et al. 2020, "FLIP: A
//! Difference Evaluator for Alternating Images", HPG). Constants are those of the paper, section 4, with the Hunt
//! adjustment and the filters of sections 4.1 and 4.2.

use super::stats::same_size;
use crate::error::Result;
use crate::files::color::{linear_from_srgb, srgb8_from_linear};
use glam::{DMat3, DVec3};
use ndarray::{Array2, ArrayView2, ArrayView3, Axis};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Pixels a degree of visual angle: a display of 3840 pixels on 0.7 m, seen from 0.7 m.
const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;
/// Exponent of colour differences, and the ends of the two linear pieces that map them to `[0, 1]`.
const COLOR_EXPONENT: f64 = 0.7;
const PIECE_END: f64 = 0.4;
const PIECE_END_VALUE: f64 = 0.95;
/// Width of an edge or a point to which the eye is most sensitive, degrees, and the exponent of feature differences.
const FEATURE_DEG: f64 = 0.082;
const FEATURE_EXPONENT: f64 = 0.5;
/// Contrast sensitivity of the channels Y, Cx and Cz of `YCxCz`: sums of Gaussians, each with amplitude and width.
const SENSITIVITY: [&[[f64; 2]]; 3] = [&[[1.0, 0.0047]], &[[1.0, 0.0053]], &[[34.1, 0.04], [13.5, 0.025]]];
/// Largest width of these Gaussians, which decides the radius of the filters.
const WIDEST: f64 = 0.04;
/// Linear sRGB to XYZ, over the denominators of the paper's supplement, and the white point D65.
const XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// XYZ to linear sRGB.
static LINEAR_FROM_XYZ: LazyLock<DMat3> =
    LazyLock::new(|| DMat3::from_cols_array_2d(&XYZ).transpose().inverse());

/// Picture after the filters of the model of the observer, `height x width`.
pub struct FilteredPicture {
    /// Filtered colours in CIE L*a*b* with the Hunt adjustment.
    lab: Array2<[f32; 3]>,
    /// Strengths of edges and of points.
    features: Array2<[f32; 2]>,
}

impl FilteredPicture {
    /// Filters a linear RGBA picture, `height x width x 4`, as it is displayed: sRGB of 8 bits.
    pub fn of(picture: ArrayView3<f32>) -> Self {
        let mut opponent = opponent_colors(picture);
        let features = features(&opponent.mapv(|color| (f64::from(color[0]) + 16.0) / 116.0));
        for (c, gaussians) in SENSITIVITY.iter().enumerate() {
            let filtered = filter_channel(&opponent.mapv(|color| f64::from(color[c])), gaussians);
            opponent.zip_mut_with(&filtered, |color, value| color[c] = *value as f32);
        }
        let lab = opponent.mapv(|color| {
            let rgb = linear_from_opponent(color.map(f64::from)).map(|v| v.clamp(0.0, 1.0));
            hunt_lab(rgb).map(|v| v as f32)
        });
        Self { lab, features }
    }

    /// Returns the mean FLIP over the pixels: 0 for pictures that look the same, at most 1.
    pub fn mean_flip(&self, other: &Self) -> f64 {
        let largest =
            color_distance(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
        let pixels = self.lab.iter().zip(&other.lab).zip(self.features.iter().zip(&other.features));
        let sum: f64 = pixels
            .map(|((a, b), (f, g))| {
                let color = piecewise(
                    color_distance(a.map(f64::from), b.map(f64::from)).powf(COLOR_EXPONENT),
                    largest,
                );
                let feature = f64::from((f[0] - g[0]).abs().max((f[1] - g[1]).abs())) / 2f64.sqrt();
                color.powf(1.0 - feature.clamp(0.0, 1.0).powf(FEATURE_EXPONENT))
            })
            .sum();
        sum / self.lab.len() as f64
    }
}

/// Returns the mean FLIP of a linear RGBA picture, `height x width x 4`, against another one that an observer sees.
/// `None` where a value is not finite.
///
/// # Errors
/// The pictures are empty or differ in size.
pub fn flip(picture: ArrayView3<f32>, reference: (ArrayView3<f32>, &FilteredPicture)) -> Result<Option<f64>> {
    same_size(&picture, &reference.0)?;
    let finite = picture.iter().chain(reference.0).all(|v| v.is_finite());
    Ok(finite.then(|| FilteredPicture::of(picture).mean_flip(reference.1)))
}

/// Returns the colours in `YCxCz` of a picture that a display of 8 bits shows.
fn opponent_colors(picture: ArrayView3<f32>) -> Array2<[f32; 3]> {
    let linear: Vec<f64> = (0..=255_u8).map(|code| linear_from_srgb(f64::from(code) / 255.0)).collect();
    picture.map_axis(Axis(2), |pixel| {
        let rgb = [0, 1, 2].map(|c| linear[usize::from(srgb8_from_linear(f64::from(pixel[c])))]);
        opponent_from_xyz(xyz_from_linear(rgb)).map(|v| v as f32)
    })
}

fn xyz_from_linear(rgb: [f64; 3]) -> [f64; 3] {
    XYZ.map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2])
}

/// Returns the white point: the sum of each row.
fn white() -> [f64; 3] {
    xyz_from_linear([1.0; 3])
}

/// Returns `YCxCz`, in which luminance and the two opponent colours are filtered.
fn opponent_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    let white = white();
    let [x, y, z] = [0, 1, 2].map(|c| xyz[c] / white[c]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn linear_from_opponent([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let white = white();
    let y = (y + 16.0) / 116.0;
    let xyz = [white[0] * (y + cx / 500.0), white[1] * y, white[2] * (y - cz / 200.0)];
    (*LINEAR_FROM_XYZ * DVec3::from_array(xyz)).to_array()
}

/// Returns CIE L*a*b* of a linear colour, with chromaticity in proportion to lightness (Hunt).
fn hunt_lab(rgb: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let curve = |t: f64| {
        if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let (xyz, white) = (xyz_from_linear(rgb), white());
    let [x, y, z] = [0, 1, 2].map(|c| curve(xyz[c] / white[c]));
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// Returns the distance HyAB of two colours: absolute in lightness, Euclidean in chromaticity.
fn color_distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Maps a colour difference to `[0, 1]`: small differences take most of the range.
fn piecewise(difference: f64, largest: f64) -> f64 {
    let end = PIECE_END * largest;
    if difference < end {
        PIECE_END_VALUE / end * difference
    } else {
        PIECE_END_VALUE + (difference - end) / (largest - end) * (1.0 - PIECE_END_VALUE)
    }
}

/// Filters a channel by the contrast sensitivity of the eye, a sum of Gaussians that adds up to 1.
fn filter_channel(channel: &Array2<f64>, gaussians: &[[f64; 2]]) -> Array2<f64> {
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let part = |[amplitude, width]: [f64; 2]| {
        let degrees = |x: i32| f64::from(x) / PIXELS_PER_DEGREE;
        let taps: Vec<f64> = (-radius..=radius).map(|x| (-(PI * degrees(x)).powi(2) / width).exp()).collect();
        let sum: f64 = taps.iter().sum();
        (amplitude * (PI / width).sqrt(), sum * sum, taps)
    };
    let parts: Vec<_> = gaussians.iter().map(|gaussian| part(*gaussian)).collect();
    let all: f64 = parts.iter().map(|(weight, sum, _)| weight * sum).sum();
    let mut filtered = Array2::zeros(channel.dim());
    for (weight, _, taps) in &parts {
        filtered.scaled_add(weight / all, &convolve(channel, taps, taps));
    }
    filtered
}

/// Returns the strengths of edges and points of a picture's luminance: lengths of its filtered first and second
/// derivatives.
fn features(luminance: &Array2<f64>) -> Array2<[f32; 2]> {
    let deviation = 0.5 * FEATURE_DEG * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as i32;
    let gaussian = |x: i32| (-0.5 * (f64::from(x) / deviation).powi(2)).exp();
    let taps = |of: &dyn Fn(f64) -> f64| -> Vec<f64> {
        (-radius..=radius).map(|x| of(f64::from(x)) * gaussian(x)).collect()
    };
    let across = taps(&|_| 1.0);
    let across: Vec<f64> = across.iter().map(|tap| tap / across.iter().sum::<f64>()).collect();
    let strength = |taps: Vec<f64>| {
        // Positive and negative weights add up to 1 and -1.
        let [positive, negative] =
            [1.0, -1.0].map(|sign| taps.iter().map(|tap| (sign * tap).max(0.0)).sum::<f64>());
        let taps: Vec<f64> =
            taps.iter().map(|tap| tap / if *tap > 0.0 { positive } else { negative }).collect();
        let (x, y) = (convolve(luminance, &taps, &across), convolve(luminance, &across, &taps));
        ndarray::Zip::from(&x).and(&y).map_collect(|x, y| x.hypot(*y))
    };
    let edges = strength(taps(&|x| -x));
    let points = strength(taps(&|x| (x / deviation).powi(2) - 1.0));
    ndarray::Zip::from(&edges).and(&points).map_collect(|edge, point| [*edge as f32, *point as f32])
}

/// Convolves an image with a separable filter; pixels beyond the border repeat those on it.
fn convolve(image: &Array2<f64>, along_x: &[f64], along_y: &[f64]) -> Array2<f64> {
    convolve_rows(convolve_rows(image.view(), along_x).t(), along_y).reversed_axes()
}

fn convolve_rows(image: ArrayView2<f64>, taps: &[f64]) -> Array2<f64> {
    let mut convolved = Array2::zeros(image.dim());
    let radius = taps.len() / 2;
    let rows: Vec<_> = convolved.outer_iter_mut().zip(image.outer_iter()).collect();
    rows.into_par_iter().for_each(|(mut convolved, row)| {
        for (x, value) in convolved.iter_mut().enumerate() {
            // Taps run backwards in a convolution.
            let pixel = |i: usize| row[(x + radius).saturating_sub(i).min(row.len() - 1)];
            *value = taps.iter().enumerate().map(|(i, tap)| tap * pixel(i)).sum();
        }
    });
    convolved
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    /// Creates a picture of 60 x 40 pixels from a function of sRGB codes.
    fn picture(code: impl Fn(usize, usize, usize) -> usize) -> Array3<f32> {
        Array3::from_shape_fn((40, 60, 4), |(j, i, c)| linear_from_srgb(code(j, i, c) as f64 / 255.0) as f32)
    }

    fn mean(reference: &Array3<f32>, test: &Array3<f32>) -> f64 {
        flip(test.view(), (reference.view(), &FilteredPicture::of(reference.view()))).unwrap().unwrap()
    }

    /// Means of NVIDIA's `flip-evaluator` 1.7 (PyPI) of the same pictures, LDR, default settings.
    #[test]
    fn means_are_those_of_the_authors_program() {
        let ramps = |j: usize, i: usize, c: usize| (4 * i + 2 * j * (c + 1) + 37 * c) % 256;
        let checks = |shift: usize| move |j: usize, i: usize, _| 255 * (((i + shift) / 5 + j / 5) % 2);
        let cases = [
            (picture(ramps), picture(|j, i, c| (ramps(j, i, c) + 12).min(255)), 0.250_885_9),
            (
                picture(|_, _, _| 128),
                picture(|_, i, _| if (20..24).contains(&i) { 96 } else { 128 }),
                0.036_534_7,
            ),
            (picture(|_, _, c| [200, 120, 60, 0][c]), picture(|_, _, c| [190, 130, 60, 0][c]), 0.217_622_9),
            (picture(checks(0)), picture(checks(1)), 0.379_302_6),
        ];
        for (reference, test, expected) in cases {
            let got = mean(&reference, &test);
            assert!((got - expected).abs() < 1e-3, "{got}, not {expected}");
            assert_eq!(mean(&test, &test), 0.0);
        }
    }

    #[test]
    fn black_and_white_differ_as_much_as_pictures_can() {
        let [black, white] = [0, 255].map(|code| picture(move |_, _, _| code));
        let most = mean(&black, &white);
        assert!((0.9..=1.0).contains(&most), "{most}");
    }

    #[test]
    fn pictures_that_cannot_be_compared() {
        let black = picture(|_, _, _| 0);
        let filtered = FilteredPicture::of(black.view());
        assert!(flip(Array3::zeros((3, 3, 4)).view(), (black.view(), &filtered)).is_err());
        let mut nan = black.clone();
        nan[[3, 3, 1]] = f32::NAN;
        assert_eq!(flip(nan.view(), (black.view(), &filtered)).unwrap(), None);
    }
}
