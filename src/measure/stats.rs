//! Statistics: medians of times, weighted statistics of transmittance errors, and differences between pictures.

use crate::error::{Error, Result};
use crate::random::Chance;
use ndarray::{Array2, ArrayView3, Axis};

/// Median, minimum and maximum of a repeated measurement, such as a time in ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Median of a repeated measurement. It is the mean of the middle two values if their number is even.
    pub median: f64,
    /// Smallest value of a repeated measurement.
    pub min: f64,
    /// Largest value of a repeated measurement.
    pub max: f64,
}

impl Spread {
    /// Creates the median, minimum and maximum of a single exact value: all three are equal.
    pub const fn exactly(value: f64) -> Self {
        Self { median: value, min: value, max: value }
    }

    /// Computes the median, minimum and maximum of a repeated measurement; `None` without values.
    pub fn of(readings: &[f64]) -> Option<Self> {
        let mut sorted = readings.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        let half = sorted.len() / 2;
        let median =
            if sorted.len() % 2 == 1 { sorted[half] } else { 0.5 * (sorted[half - 1] + sorted[half]) };
        Some(Self { median, min, max })
    }
}

/// Returns the ends of a 95 % interval of the median of repeated measurements, from their order statistics: it assumes
/// nothing about their distribution. `None` for fewer than six, whose extremes cover the median less often.
pub fn median_interval(readings: &[f64]) -> Option<[f64; 2]> {
    let mut sorted = readings.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    // Probability that at most `rank` of n readings lie below the median.
    let mut beyond = 0.5_f64.powi(i32::try_from(n).ok()?);
    let mut term = beyond;
    let mut rank = None;
    for k in 0..n / 2 {
        if 2.0 * beyond > 0.05 {
            break;
        }
        rank = Some(k);
        term *= (n - k) as f64 / (k + 1) as f64;
        beyond += term;
    }
    rank.map(|k| [sorted[k], sorted[n - 1 - k]])
}

/// Rounding tolerance for sums of weights in a weighted percentile, relative to the total weight. It exceeds the
/// rounding error of the sum and is far below any single weight.
const RANK_SLACK: f64 = 1e-12;

/// Weighted percentile by the nearest-rank method: the smallest value such that all values up to it carry at least
/// `fraction` of the total weight. There is no interpolation, so the result is always one of the values.
///
/// For unit weights and `fraction = 0.99`, it is the 99th smallest of 100 values, or the 50th of 50 values. Values of
/// weight 0 are ignored. Returns `None` where no value has weight.
pub fn weighted_percentile(value_and_weight: &[(f64, f64)], fraction: f64) -> Option<f64> {
    let mut sorted: Vec<_> = value_and_weight.iter().copied().filter(|&(_, w)| w > 0.0).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = sorted.iter().map(|&(_, w)| w).sum();
    let rank = (fraction - RANK_SLACK) * total;
    let mut carried = 0.0;
    for &(value, weight) in &sorted {
        carried += weight;
        if carried >= rank {
            return Some(value);
        }
    }
    sorted.last().map(|&(value, _)| value)
}

/// Number of samples of the bootstrap, fewest points, largest number of groups of points, and seed.
const BOOTSTRAP_SAMPLES: usize = 1000;
const FEWEST_POINTS: usize = 30;
const BOOTSTRAP_GROUPS: usize = 500;
const BOOTSTRAP_SEED: u64 = 17;

/// Weighted statistics of transmittance errors with sign, `T_method - T_exact`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorStats {
    /// Number of points with nonzero weight in the statistics of transmittance errors.
    pub count: usize,
    /// Number of points with nonzero weight whose transmittance error is NaN or infinite. Each counts as an infinite
    /// error.
    pub non_finite: usize,
    /// Largest absolute transmittance error over the points with nonzero weight.
    pub max_abs: f64,
    /// Weighted root mean square of the transmittance errors `e`: `sqrt(sum w e^2 / sum w)`.
    pub rms: f64,
    /// Ends of the 95 % interval of `rms` by a bootstrap over the points; `None` for fewer than 30 points.
    pub rms_interval: Option<[f64; 2]>,
    /// 99th percentile of the absolute transmittance errors, weighted as the points are; see [`weighted_percentile`].
    pub p99_abs: f64,
    /// Weighted mean of the transmittance errors with sign, `sum w e / sum w`. Negative where the shadow method is
    /// too dark.
    pub mean: f64,
}

impl ErrorStats {
    /// Computes the statistics of transmittance errors from pairs `(error, weight)`; `None` where no point has
    /// weight.
    ///
    /// # Errors
    /// A weight is negative or not finite.
    pub fn of(error_and_weight: impl IntoIterator<Item = (f64, f64)>) -> Result<Option<Self>> {
        let (mut total, mut sum, mut sum_of_squares) = (0.0, 0.0, 0.0);
        let mut non_finite = 0;
        let mut sized = Vec::new();
        for (index, (error, weight)) in error_and_weight.into_iter().enumerate() {
            if !weight.is_finite() || weight < 0.0 {
                return Err(Error::runtime(
                    "cannot weigh errors",
                    format!("point {index}"),
                    format!("its weight is {weight}"),
                ));
            }
            if weight == 0.0 {
                continue;
            }
            let error = if error.is_finite() {
                error
            } else {
                non_finite += 1;
                f64::INFINITY
            };
            total += weight;
            sum += weight * error;
            sum_of_squares += weight * error * error;
            sized.push((error.abs(), weight));
        }
        let Some(p99_abs) = weighted_percentile(&sized, 0.99) else { return Ok(None) };
        Ok(Some(Self {
            count: sized.len(),
            non_finite,
            max_abs: sized.iter().fold(0.0, |m, &(e, _)| m.max(e)),
            rms: (sum_of_squares / total).sqrt(),
            rms_interval: rms_interval(&sized),
            p99_abs,
            mean: sum / total,
        }))
    }
}

/// Returns the ends of the 95 % interval of a weighted root mean square of `(error, weight)`, by a percentile bootstrap (Efron
/// 1979). Points are resampled in [`BOOTSTRAP_GROUPS`] groups, each spread over all points, and alike for all rows that share
/// their points.
fn rms_interval(errors: &[(f64, f64)]) -> Option<[f64; 2]> {
    if errors.len() < FEWEST_POINTS {
        return None;
    }
    let mut groups = vec![[0.0; 2]; errors.len().min(BOOTSTRAP_GROUPS)];
    let count = groups.len();
    for (i, (error, weight)) in errors.iter().enumerate() {
        let group = &mut groups[i % count];
        *group = [group[0] + weight * error * error, group[1] + weight];
    }
    Some(bootstrap(&groups, |[squares, weight]| (squares / weight).sqrt()))
}

/// Returns the ends of the 95 % interval of the difference of two weighted root mean squares, `rms(a) - rms(b)`, for errors
/// `(error, weight)` at the same points, by a paired percentile bootstrap with the groups of [`rms_interval`]. `None` for
/// fewer than 30 points.
pub fn rms_difference_interval(a: &[(f64, f64)], b: &[(f64, f64)]) -> Option<[f64; 2]> {
    if a.len() < FEWEST_POINTS || a.len() != b.len() {
        return None;
    }
    let mut groups = vec![[0.0; 3]; a.len().min(BOOTSTRAP_GROUPS)];
    let count = groups.len();
    for (i, ((first, weight), (second, _))) in a.iter().zip(b).enumerate() {
        let [squares, others, weights] = groups[i % count];
        groups[i % count] =
            [squares + weight * first * first, others + weight * second * second, weights + weight];
    }
    Some(bootstrap(&groups, |[first, second, weight]| (first / weight).sqrt() - (second / weight).sqrt()))
}

/// Returns the ends of the 95 % interval of a function of the sums of groups, by a percentile bootstrap over the groups.
fn bootstrap<const N: usize>(groups: &[[f64; N]], of_sums: impl Fn([f64; N]) -> f64) -> [f64; 2] {
    let mut chance = Chance::new(BOOTSTRAP_SEED, 0);
    let mut resampled: Vec<f64> = (0..BOOTSTRAP_SAMPLES)
        .map(|_| {
            let mut sums = [0.0; N];
            for _ in 0..groups.len() {
                let group = groups[chance.below(groups.len())];
                sums.iter_mut().zip(group).for_each(|(sum, part)| *sum += part);
            }
            of_sums(sums)
        })
        .collect();
    resampled.sort_by(f64::total_cmp);
    let tail = BOOTSTRAP_SAMPLES / 40;
    [resampled[tail], resampled[BOOTSTRAP_SAMPLES - 1 - tail]]
}

/// Difference between two pictures in linear RGBA: rms, peak signal-to-noise ratio and maximum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageError {
    /// Root mean square difference between two pictures over all pixels and channels.
    pub rmse: f64,
    /// Peak signal-to-noise ratio (PSNR) between two pictures, `-20 log10(rmse)`, dB. The peak is 1 for all pictures.
    /// Infinite for identical pictures.
    pub psnr_db: f64,
    /// Largest absolute difference between two pictures in any pixel and channel.
    pub max_abs: f64,
}

/// Computes the differences between two pictures in linear RGBA, each `height x width x 4`. A difference that is not
/// finite counts as infinite.
///
/// # Errors
/// The pictures are empty or differ in size.
pub fn image_error(picture: ArrayView3<f32>, reference: ArrayView3<f32>) -> Result<ImageError> {
    same_size(&picture, &reference)?;
    let (mut sum_of_squares, mut max_abs) = (0.0, 0.0_f64);
    ndarray::Zip::from(&picture).and(&reference).for_each(|&a, &b| {
        let e = difference(a, b);
        sum_of_squares += e * e;
        max_abs = max_abs.max(e);
    });
    let rmse = (sum_of_squares / picture.len() as f64).sqrt();
    Ok(ImageError { rmse, psnr_db: -20.0 * rmse.log10(), max_abs })
}

/// Returns the largest channel difference between two pictures at each pixel, `height x width`, for display in false
/// colours.
///
/// # Errors
/// The pictures are empty or differ in size.
pub fn image_difference(picture: ArrayView3<f32>, reference: ArrayView3<f32>) -> Result<Array2<f32>> {
    same_size(&picture, &reference)?;
    let mut largest = Array2::zeros((picture.dim().0, picture.dim().1));
    ndarray::Zip::from(&mut largest).and(picture.lanes(Axis(2))).and(reference.lanes(Axis(2))).for_each(
        |out, a, b| {
            *out = a.iter().zip(b).map(|(&a, &b)| difference(a, b)).fold(0.0, f64::max) as f32;
        },
    );
    Ok(largest)
}

/// Returns `|a - b|`, or infinity where that is not finite.
fn difference(a: f32, b: f32) -> f64 {
    let e = (f64::from(a) - f64::from(b)).abs();
    if e.is_finite() { e } else { f64::INFINITY }
}

pub(super) fn same_size(picture: &ArrayView3<f32>, reference: &ArrayView3<f32>) -> Result<()> {
    let (a, b) = (picture.dim(), reference.dim());
    if a == b && !picture.is_empty() {
        return Ok(());
    }
    Err(Error::runtime(
        "cannot compare pictures",
        "image error",
        format!("they are {}x{}x{} and {}x{}x{}", a.1, a.0, a.2, b.1, b.0, b.2),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    #[test]
    fn median_of_odd_even_and_no_readings() {
        assert_eq!(Spread::of(&[5.0, 1.0, 3.0]), Some(Spread { median: 3.0, min: 1.0, max: 5.0 }));
        assert_eq!(Spread::of(&[4.0, 1.0, 2.0, 10.0]), Some(Spread { median: 3.0, min: 1.0, max: 10.0 }));
        assert_eq!(Spread::of(&[]), None);
    }

    #[test]
    fn percentile_is_the_nearest_rank() {
        let unit = |n: usize| (1..=n).rev().map(|v| (v as f64, 1.0)).collect::<Vec<_>>();
        for (n, fraction, expected) in [
            (100, 0.99, 99.0),
            (100, 0.07, 7.0), // 0.07 * 100 rounds up to 7.000000000000001
            (50, 0.99, 50.0),
            (200, 0.99, 198.0),
            (201, 0.99, 199.0),
            (4, 0.5, 2.0),
            (4, 0.51, 3.0),
            (7, 0.0, 1.0),
            (7, 1.0, 7.0),
        ] {
            assert_eq!(weighted_percentile(&unit(n), fraction), Some(expected), "{fraction} of {n}");
        }
        assert_eq!(weighted_percentile(&[], 0.5), None);
        assert_eq!(weighted_percentile(&[(1.0, 0.0)], 0.5), None);
    }

    #[test]
    fn percentile_follows_the_weights() {
        // Weights 0.2, 0.3, 0.5: each value covers the cumulative weight up to and including its own.
        let values = [(30.0, 5.0), (10.0, 2.0), (20.0, 3.0), (99.0, 0.0)];
        for (fraction, expected) in [(0.2, 10.0), (0.21, 20.0), (0.5, 20.0), (0.51, 30.0), (1.0, 30.0)] {
            assert_eq!(weighted_percentile(&values, fraction), Some(expected), "{fraction}");
        }
    }

    #[test]
    fn a_weight_is_as_good_as_repeating_a_point() {
        let errors = [0.5, -0.25, 0.125, 1.0];
        let weights = [3, 1, 2, 4];
        let weighted = ErrorStats::of(errors.iter().zip(weights).map(|(&e, w)| (e, f64::from(w))));
        let repeated = ErrorStats::of(
            errors.iter().zip(weights).flat_map(|(&e, w)| std::iter::repeat_n((e, 1.0), w as usize)),
        );
        let (a, b) = (weighted.unwrap().unwrap(), repeated.unwrap().unwrap());
        assert_eq!((a.max_abs, a.rms, a.p99_abs, a.mean), (b.max_abs, b.rms, b.p99_abs, b.mean));
        assert_eq!((a.count, b.count), (4, 10));
    }

    #[test]
    fn a_planted_error_comes_out() {
        // 98 points are exact, one is 0.3 too dark, one 0.1 too bright.
        let mut errors = vec![(0.0, 1.0); 98];
        errors.extend([(-0.3, 1.0), (0.1, 1.0)]);
        let s = ErrorStats::of(errors).unwrap().unwrap();
        assert_eq!((s.count, s.non_finite, s.max_abs, s.p99_abs), (100, 0, 0.3, 0.1));
        assert!((s.rms - (0.1_f64 / 100.0).sqrt()).abs() < 1e-15);
        assert!((s.mean + 0.002).abs() < 1e-15);
    }

    #[test]
    fn nan_error_counts_as_infinite() {
        let s = ErrorStats::of([(0.0, 1.0), (f64::NAN, 1e-6), (f64::NAN, 0.0)]).unwrap().unwrap();
        assert_eq!((s.count, s.non_finite, s.max_abs, s.rms), (2, 1, f64::INFINITY, f64::INFINITY));
        assert_eq!(s.p99_abs, 0.0);
    }

    #[test]
    fn weights_that_make_no_sense_are_refused() {
        assert!(ErrorStats::of([(0.0, -1.0)]).is_err());
        assert!(ErrorStats::of([(0.0, f64::NAN)]).is_err());
        assert_eq!(ErrorStats::of([(1.0, 0.0)]).unwrap(), None);
    }

    #[test]
    fn intervals_of_medians_are_those_of_the_sign_test() {
        let readings = |n: usize| (1..=n).rev().map(|k| k as f64).collect::<Vec<_>>();
        assert_eq!([0, 1, 5].map(|n| median_interval(&readings(n))), [None; 3]);
        // Tables of the binomial distribution: ranks 1, 2, 6 and 40 from each end.
        for (n, expected) in [(6, [1.0, 6.0]), (10, [2.0, 9.0]), (20, [6.0, 15.0]), (100, [40.0, 61.0])] {
            assert_eq!(median_interval(&readings(n)), Some(expected), "{n}");
        }
    }

    /// Nineteen of twenty intervals contain the value of a much larger sample, also for errors with a heavy tail.
    #[test]
    fn bootstrap_intervals_cover_as_often_as_they_say() {
        let error =
            |chance: &mut Chance| (chance.unit().powi(8) * chance.between(-1.0, 1.0), 0.5 + chance.unit());
        let sample = |index: u64, count: usize| {
            let mut chance = Chance::new(3, index);
            ErrorStats::of((0..count).map(|_| error(&mut chance))).unwrap().unwrap()
        };
        let all = sample(0, 2_000_000).rms;
        let covered = (1..=300).filter(|index| {
            let [low, high] = sample(*index, 3000).rms_interval.unwrap();
            (low..=high).contains(&all)
        });
        let share = covered.count() as f64 / 300.0;
        assert!((0.9..=0.98).contains(&share), "{share}");
        let of = |count: usize| ErrorStats::of(vec![(-0.5, 2.0); count]).unwrap().unwrap().rms_interval;
        assert_eq!([of(29), of(30)], [None, Some([0.5; 2])]);
    }

    #[test]
    fn image_error_by_hand() {
        let black = Array3::<f32>::zeros((2, 5, 4));
        let mut one_off = black.clone();
        one_off[[1, 3, 2]] = 0.5;
        let e = image_error(one_off.view(), black.view()).unwrap();
        // 0.25 over 40 values.
        assert!((e.rmse - 0.00625_f64.sqrt()).abs() < 1e-15);
        assert!((e.psnr_db - 22.041_199_826_559_25).abs() < 1e-9);
        assert_eq!(e.max_abs, 0.5);
        let difference = image_difference(one_off.view(), black.view()).unwrap();
        assert_eq!((difference[[1, 3]], difference.sum()), (0.5, 0.5));
        let tenth = Array3::<f32>::from_elem((2, 5, 4), 0.1);
        assert!((image_error(tenth.view(), black.view()).unwrap().psnr_db - 20.0).abs() < 1e-6);
        assert_eq!(image_error(black.view(), black.view()).unwrap().psnr_db, f64::INFINITY);
    }

    #[test]
    fn pictures_that_cannot_be_compared() {
        let a = Array3::<f32>::zeros((2, 5, 4));
        assert!(image_error(a.view(), Array3::zeros((5, 2, 4)).view()).is_err());
        let mut nan = a.clone();
        nan[[0, 0, 0]] = f32::NAN;
        assert_eq!(image_error(nan.view(), a.view()).unwrap().rmse, f64::INFINITY);
        assert_eq!(image_difference(nan.view(), a.view()).unwrap()[[0, 0]], f32::INFINITY);
    }
}
