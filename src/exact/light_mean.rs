//! Mean transmittance from a light with a size to a point, by nested quadrature over the light.
//!
//! The light is sampled by Fibonacci lattices (see [`LightSource::lattice`]) with several random shifts. The means of the
//! shifts are independent and unbiased, so that their scatter gives the standard error of their mean (randomised
//! quasi-Monte Carlo; L'Ecuyer and Lemieux 2002, *Recent advances in randomized quasi-Monte Carlo methods*). Lattices are
//! made finer until it is small.

use super::ExactField;
use crate::random::mix_to_unit;
use crate::scene::LightSource;
use glam::DVec3;
use rayon::prelude::*;

/// Number of random shifts of a lattice.
const SHIFTS: u64 = 8;
/// Numbers of points of a lattice, from the first to the finest.
const LATTICES: [usize; 4] = [64, 256, 1024, 4096];
/// Standard error at which the lattice is fine enough.
const TOLERANCE: f64 = 5e-4;

/// Mean transmittance over a light with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanTransmittance {
    /// Mean transmittance from all points or directions of a light, in `[0, 1]`.
    pub value: f64,
    /// Standard error of the mean transmittance; 0 for a light without a size.
    pub standard_error: f64,
}

impl ExactField<'_> {
    /// Returns the mean transmittance from a light source to the point `x` (world mm). For a light with a size, its
    /// standard error is about 5e-4 or less, unless a few ten thousand rays do not suffice. Without a size it is exact
    /// ([`Self::transmittance_to_light`]).
    pub fn transmittance_from(&self, x: DVec3, source: &LightSource) -> MeanTransmittance {
        if !source.is_soft() {
            let value = self.transmittance_to_light(x, &source.light);
            return MeanTransmittance { value, standard_error: 0.0 };
        }
        let mut found = MeanTransmittance { value: f64::NAN, standard_error: f64::INFINITY };
        for count in LATTICES {
            found = self.mean_over_lattices(x, source, count);
            if found.standard_error <= TOLERANCE {
                break;
            }
        }
        found
    }

    fn mean_over_lattices(&self, x: DVec3, source: &LightSource, count: usize) -> MeanTransmittance {
        let mean_of_shift = |shift: u64| {
            let shift = [2 * shift, 2 * shift + 1].map(mix_to_unit);
            let lights = source.lattice(count, shift);
            lights.map(|light| self.transmittance_to_light(x, &light)).sum::<f64>() / count as f64
        };
        let means: Vec<f64> = (0..SHIFTS).map(mean_of_shift).collect();
        let n = SHIFTS as f64;
        let value = means.iter().sum::<f64>() / n;
        let variance = means.iter().map(|mean| (mean - value).powi(2)).sum::<f64>() / (n - 1.0);
        MeanTransmittance { value, standard_error: (variance / n).sqrt() }
    }

    /// Returns the mean transmittances from a light source to points (world mm), and the root mean square of their standard
    /// errors ([`Self::transmittance_from`]).
    pub fn transmittances_from(&self, points_mm: &[DVec3], source: &LightSource) -> (Vec<f64>, f64) {
        let found: Vec<_> = points_mm.par_iter().map(|x| self.transmittance_from(*x, source)).collect();
        let squares = found.iter().map(|mean| mean.standard_error.powi(2)).sum::<f64>();
        let rms = (squares / found.len().max(1) as f64).sqrt();
        (found.iter().map(|mean| mean.value).collect(), rms)
    }
}
