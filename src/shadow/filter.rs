//! Filters of shadow map texels.

use super::settings::choices;

choices! {
    /// Filter of the texels of a shadow map around a point.
    pub enum Filter {
        /// Reads the shadow map texel that is nearest to the point.
        Nearest = "nearest",
        /// Interpolates between the four shadow map texels around the point.
        Bilinear = "bilinear",
        /// Averages 4 x 4 shadow map texels with the weights of a Gaussian.
        Gauss = "gauss",
        /// Percentage-closer filtering (Voicu 2011, 3.5): averages the transmittances of 4 x 4 shadow map texels.
        Pcf = "pcf",
    }
}

/// Standard deviation of the Gaussian of `filter=gauss`, in texels: half the distance at which its weights end.
pub(super) const GAUSS_SIGMA: f64 = 1.0;

impl Filter {
    /// Whether the filter averages 4 x 4 texels.
    pub fn is_wide(self) -> bool {
        matches!(self, Self::Gauss | Self::Pcf)
    }

    /// Returns the number of texels per side of the square that a query reads. `kernel` is the width of the mean that
    /// a filter of up to 2 x 2 texels interpolates.
    pub(super) fn taps_across(self, kernel: u32) -> u32 {
        match self {
            Self::Nearest => kernel,
            Self::Bilinear => kernel + 1,
            Self::Gauss | Self::Pcf => 4,
        }
    }

    /// Returns the light rays whose mean is the result of a query at a texel centre, from those for a filter of up to
    /// 2 x 2 texels.
    pub(super) fn taps(self, narrow: Taps) -> Taps {
        match narrow {
            _ if !self.is_wide() => narrow,
            Taps::Within(rays) => Taps::Around(self, rays),
            _ => Taps::Around(self, 1),
        }
    }

    /// Returns the weights of the four columns (or rows) of texels that a filter of 4 x 4 texels averages, at a
    /// coordinate that lies `w` texels past the centre of the second one. They add up to 1.
    pub fn weights(self, w: f64) -> [f64; 4] {
        let weight = |distance: f64| {
            let gauss = |d: f64| (-0.5 * (d / GAUSS_SIGMA).powi(2)).exp();
            if self == Self::Gauss { gauss(distance) - gauss(2.0) } else { (2.0 - distance.abs()).min(1.0) }
        };
        let weights = [-1.0, 0.0, 1.0, 2.0].map(|column: f64| weight(column - w));
        weights.map(|weight| weight / weights.iter().sum::<f64>())
    }
}

/// Light rays whose (weighted) mean transmittance is the result of a query at the centre of a shadow map texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Taps {
    /// Light rays within one shadow map texel: 1, 5 or 9 of them (`tap_offset` of `shaders/shadow/dsm/build.wgsl`).
    Within(u32),
    /// Light rays through the centres of `n x n` neighbouring shadow map texels, given `n`.
    Texels(u32),
    /// Light rays through 3 x 3 shadow map texels, with the weights of a filter of 4 x 4 texels at the centre of the
    /// middle one, and the number of light rays within each texel.
    Around(Filter, u32),
}
