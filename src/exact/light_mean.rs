//! Mean transmittance from a light with a size to a point, by nested quadrature over the light.
//!
//! The light is sampled by Fibonacci lattices (see [`LightSource::lattice`]) with several random shifts. The means of
//! the shifts are independent and unbiased, so that their scatter gives the standard error of their mean (randomised
//! quasi-Monte Carlo; L'Ecuyer and Lemieux 2002, *Recent advances in randomized quasi-Monte Carlo methods*). Lattices
//! are made finer until it is small. The result comes from other shifts of a lattice twice as fine, since the shifts
//! that ended the refinement would give too small an error.

use super::ExactField;
use crate::random::{mix, mix_to_unit};
use crate::scene::LightSource;
use glam::DVec3;

/// Number of random shifts of a lattice.
const SHIFTS: u64 = 8;
/// Numbers of points of a lattice by which the number for the result is chosen, from the first to the finest.
const LATTICES: [usize; 3] = [64, 256, 1024];
/// Factor on the number of points for the result.
const FINER: usize = 2;
/// Standard error at which the lattice is fine enough.
const TOLERANCE: f64 = 5e-4;

/// Mean transmittance over a light with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanTransmittance {
    /// Mean transmittance from all points or directions of a light, in `[0, 1]`.
    pub value: f64,
    /// Standard error of the mean transmittance; 0 for a light without a size. It is estimated from 8 independent means,
    /// so errors divided by it have Student's distribution with 7 degrees of freedom: 2 % of them exceed 3.
    pub standard_error: f64,
}

impl ExactField<'_> {
    /// Returns the mean transmittance from a light source to the point `x` (world mm). For a light with a size, the
    /// lattice is refined until the standard error is estimated at 5e-4 or less, or up to 16,384 rays. An occluder that
    /// covers less than a thousandth of the light may be missed. Without a size the transmittance is exact
    /// ([`Self::transmittance_to_light`]).
    pub fn transmittance_from(&self, x: DVec3, source: &LightSource) -> MeanTransmittance {
        if !source.is_soft() {
            let value = self.transmittance_to_light(x, &source.light);
            return MeanTransmittance { value, standard_error: 0.0 };
        }
        let [a, b, c] = x.to_array().map(f64::to_bits);
        let seed = mix(a ^ mix(b ^ mix(c)));
        let is_fine = |count: &usize| {
            self.mean_over_lattices(x, source, *count, mix(seed ^ *count as u64)).standard_error <= TOLERANCE
        };
        let last = LATTICES[LATTICES.len() - 1];
        let count = LATTICES.into_iter().find(is_fine).unwrap_or(last);
        self.mean_over_lattices(x, source, FINER * count, seed)
    }

    fn mean_over_lattices(
        &self,
        x: DVec3,
        source: &LightSource,
        count: usize,
        seed: u64,
    ) -> MeanTransmittance {
        let mean_of_shift = |shift: u64| {
            let shift = [2 * shift, 2 * shift + 1].map(|i| mix_to_unit(seed ^ i));
            let lights = source.lattice(count, shift);
            lights.map(|sample| self.transmittance_to_light(x, &sample.light)).sum::<f64>() / count as f64
        };
        let means: Vec<f64> = (0..SHIFTS).map(mean_of_shift).collect();
        let n = SHIFTS as f64;
        let value = means.iter().sum::<f64>() / n;
        let variance = means.iter().map(|mean| (mean - value).powi(2)).sum::<f64>() / (n - 1.0);
        MeanTransmittance { value, standard_error: (variance / n).sqrt() }
    }

    /// Returns the mean transmittances from a light source to points (world mm), and the root mean square of their
    /// standard errors ([`Self::transmittance_from`]).
    pub fn transmittances_from(&self, points_mm: &[DVec3], source: &LightSource) -> (Vec<f64>, f64) {
        let ray = |number: usize| {
            let (direction, length_mm) = source.light.from_point(points_mm[number]);
            (points_mm[number], direction, length_mm)
        };
        let mean = |number: usize| self.transmittance_from(points_mm[number], source);
        let found = self.of_rays(points_mm.len(), ray, mean);
        let squares = found.iter().map(|mean| mean.standard_error.powi(2)).sum::<f64>();
        let rms = (squares / found.len().max(1) as f64).sqrt();
        (found.iter().map(|mean| mean.value).collect(), rms)
    }
}
