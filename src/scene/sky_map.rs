//! Sky whose radiance depends on the direction, given by an equirectangular map.

use glam::{DQuat, DVec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Weights of linear RGB (sRGB primaries) in luminance (ITU-R BT.709).
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Equirectangular map of a sky, as a scene names it.
#[derive(Debug, Clone, PartialEq)]
pub struct SkyMap {
    /// File of the map.
    pub path: String,
    /// Rotation of the map about the z axis (superior), degrees, counterclockwise from above.
    pub turn_deg: f64,
    /// Radiance of the map: `None` until the scene is opened, which then counts as a uniform sky.
    pub radiance: Option<Arc<SkyRadiance>>,
}

impl SkyMap {
    /// Returns a direction of the sky for two numbers in `[0, 1)`, and the linear RGB of the light from there.
    /// Directions are as dense as luminance, so that equal shares of the unit square contribute equal luminance.
    pub(super) fn sample(&self, position: [f64; 2]) -> Option<(DVec3, [f64; 3])> {
        let (direction, color) = self.radiance.as_ref()?.sample(position);
        Some((self.turn() * direction, color))
    }

    /// Returns the mean direction of the sky's light, by luminance: +z if there is none.
    pub fn mean_direction(&self) -> DVec3 {
        let mean = self.radiance.as_ref().map_or(DVec3::Z, |radiance| radiance.mean_direction);
        self.turn() * mean
    }

    fn turn(&self) -> DQuat {
        DQuat::from_rotation_z(self.turn_deg.to_radians())
    }
}

/// Radiance of a sky by direction: constant in each pixel of an equirectangular map.
///
/// The first row of the map is +z (superior). The centre of the map is +y (anterior), and columns to its right turn
/// towards +x (right). Radiance relative to that of the uniform sky: a map of ones is a uniform sky.
#[derive(Debug, PartialEq)]
pub struct SkyRadiance {
    width: usize,
    /// Linear RGB of the pixels, row by row.
    rgb: Vec<[f32; 3]>,
    /// Sums of luminance times solid angle (steradians) of all pixels before each pixel, and their total.
    sums: Vec<f64>,
    /// Mean of the linear RGB over all directions.
    mean: [f64; 3],
    mean_direction: DVec3,
}

// No radiance is NaN, so that equality is reflexive, and two handles of one map are equal at once.
impl Eq for SkyRadiance {}

impl SkyRadiance {
    /// Creates the radiance from the linear RGB of an equirectangular map with `width` columns, row by row.
    ///
    /// # Errors
    /// The map is not twice as wide as it is high, has a negative or infinite value or NaN, or is black: the reason in words.
    pub fn new(width: usize, rgb: Vec<[f32; 3]>) -> Result<Self, String> {
        let height = rgb.len() / width.max(1);
        if width == 0 || width != 2 * height || width * height != rgb.len() {
            return Err(format!(
                "expected an equirectangular map, twice as wide as it is high, not {width} x {height}"
            ));
        }
        let is_radiance = |x: &f32| x.is_finite() && *x >= 0.0;
        if let Some(pixel) = rgb.iter().position(|color| !color.iter().all(is_radiance)) {
            let (row, column) = (pixel / width, pixel % width);
            return Err(format!("pixel {column},{row} has a value that is negative, infinite or no number"));
        }
        let (mut sums, mut mean, mut toward) = (Vec::with_capacity(rgb.len() + 1), [0.0; 3], DVec3::ZERO);
        let mut total = 0.0;
        sums.push(0.0);
        for (pixel, color) in rgb.iter().enumerate() {
            let [above, below] = heights(pixel / width, height);
            let solid_angle = TAU / width as f64 * (above - below);
            let color = color.map(f64::from);
            let share = luminance(color) * solid_angle;
            total += share;
            sums.push(total);
            (0..3).for_each(|c| mean[c] += color[c] * solid_angle / (4.0 * PI));
            toward += share * direction(0.5 * (above + below), (pixel % width) as f64 + 0.5, width);
        }
        match total > 0.0 {
            true => Ok(Self { width, rgb, sums, mean, mean_direction: toward.normalize_or(DVec3::Z) }),
            false => Err("the map is black".into()),
        }
    }

    /// Mean of the linear RGB over all directions: the light that reaches an unoccluded point.
    pub fn mean(&self) -> [f64; 3] {
        self.mean
    }

    /// Returns a direction for two numbers in `[0, 1)`, with a density proportional to luminance, and the linear RGB of
    /// the pixel there divided by the density relative to that of a uniform sky. Its mean over the unit square is
    /// [`Self::mean`].
    fn sample(&self, [across, along]: [f64; 2]) -> (DVec3, [f64; 3]) {
        let height = self.rgb.len() / self.width;
        let total = self.sums[self.rgb.len()];
        let (row, share) = self.find(across * total, self.width, 0..height);
        let first = row * self.width;
        let [start, end] = [self.sums[first], self.sums[first + self.width]];
        let (pixel, column_share) = self.find(start + along * (end - start), 1, first..first + self.width);
        let [above, below] = heights(row, height);
        let z = above + share * (below - above);
        let color = self.rgb[pixel].map(f64::from);
        let relative_density = (luminance(color) * 4.0 * PI / total).max(f64::MIN_POSITIVE);
        let toward = direction(z, (pixel - first) as f64 + column_share, self.width);
        (toward, color.map(|c| c / relative_density))
    }

    /// Returns the group of `size` pixels, among those of the given indices, in which the sums reach `sum`, and the
    /// share of the group before it.
    fn find(&self, sum: f64, size: usize, groups: std::ops::Range<usize>) -> (usize, f64) {
        let (mut low, mut high) = (groups.start, groups.end - 1);
        while low < high {
            let middle = low.midpoint(high);
            match self.sums[(middle + 1) * size] > sum {
                true => high = middle,
                false => low = middle + 1,
            }
        }
        let [start, end] = [self.sums[low * size], self.sums[(low + 1) * size]];
        (low, ((sum - start) / (end - start).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0))
    }
}

/// Returns the heights (z of the unit sphere) of the upper and lower edge of a row.
fn heights(row: usize, rows: usize) -> [f64; 2] {
    [row, row + 1].map(|edge| (PI * edge as f64 / rows as f64).cos())
}

/// Returns the unit direction of a height z and a position between the columns of a map.
fn direction(z: f64, column: f64, width: usize) -> DVec3 {
    let (sin, cos) = (TAU * (column / width as f64 - 0.5)).sin_cos();
    let across = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(across * sin, across * cos, z)
}

fn luminance(color: [f64; 3]) -> f64 {
    (0..3).map(|c| LUMINANCE[c] * color[c]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::low_discrepancy;

    fn samples(radiance: &SkyRadiance, count: u64) -> Vec<(DVec3, [f64; 3])> {
        let position = |i| low_discrepancy(i, [0.1, 0.2, 0.3]);
        (0..count).map(|i| radiance.sample([position(i)[0], position(i)[1]])).collect()
    }

    #[test]
    fn a_map_of_equal_pixels_is_uniform() {
        let radiance = SkyRadiance::new(8, vec![[2.0, 1.0, 0.5]; 32]).unwrap();
        assert!((0..3).all(|c| (radiance.mean()[c] - [2.0, 1.0, 0.5][c]).abs() < 1e-12));
        let (mut mean, mut squares) = (DVec3::ZERO, DVec3::ZERO);
        for (toward, color) in samples(&radiance, 10_000) {
            assert!((toward.length() - 1.0).abs() < 1e-12);
            assert!((0..3).all(|c| (color[c] - radiance.mean()[c]).abs() < 1e-9), "{color:?}");
            mean += toward / 1e4;
            squares += toward * toward / 1e4;
        }
        assert!(mean.length() < 2e-3 && (squares - 1.0 / 3.0).length() < 2e-3, "{mean} {squares}");
    }

    #[test]
    fn samples_are_as_dense_as_luminance() {
        let (width, height) = (8, 4);
        let rgb: Vec<[f32; 3]> =
            (0..32).map(|i| [(i % 5) as f32, (i % 3) as f32, 0.3 * (i % 7) as f32]).collect();
        let radiance = SkyRadiance::new(width, rgb.clone()).unwrap();
        let (mut counts, mut mean, count) = (vec![0.0; 32], [0.0; 3], 200_000);
        for (toward, color) in samples(&radiance, count) {
            let row = (height as f64 * toward.z.acos() / PI) as usize;
            let turn = (toward.x.atan2(toward.y) / TAU + 0.5) * width as f64;
            counts[row.min(height - 1) * width + turn as usize % width] += 1.0 / count as f64;
            (0..3).for_each(|c| mean[c] += color[c] / count as f64);
        }
        let total = radiance.sums[32];
        for (i, share) in counts.into_iter().enumerate() {
            let expected = (radiance.sums[i + 1] - radiance.sums[i]) / total;
            assert!((share - expected).abs() < 1e-3, "{i}: {share}, {expected}");
        }
        assert!(
            (0..3).all(|c| (mean[c] - radiance.mean()[c]).abs() < 2e-3),
            "{mean:?} {:?}",
            radiance.mean()
        );
    }

    #[test]
    fn a_bright_pixel_is_a_light_from_its_direction() {
        let mut rgb = vec![[0.0; 3]; 64 * 32];
        // Row 8 is 45 degrees above the horizon; three quarters of the columns are a quarter turn to the right of the centre.
        rgb[8 * 64 + 48] = [0.0, 4.0, 0.0];
        let radiance = Arc::new(SkyRadiance::new(64, rgb).unwrap());
        let map = SkyMap { path: String::new(), turn_deg: 0.0, radiance: Some(radiance) };
        let expected = DVec3::new(0.5_f64.sqrt(), 0.0, 0.5_f64.sqrt());
        assert!(map.mean_direction().distance(expected) < 0.1, "{}", map.mean_direction());
        for position in [[0.0; 2], [0.999_999; 2], [0.3, 0.9]] {
            let (toward, color) = map.sample(position).unwrap();
            assert!(toward.distance(expected) < 0.15 && color[0] == 0.0 && color[2] == 0.0);
            assert!((color[1] - map.radiance.as_ref().unwrap().mean()[1]).abs() < 1e-12, "{color:?}");
        }
        // Counterclockwise from above: from +x to +y.
        let turned = SkyMap { turn_deg: 90.0, ..map };
        assert!(turned.sample([0.5; 2]).unwrap().0.distance(DVec3::new(0.0, expected.x, expected.z)) < 0.1);
    }

    #[test]
    fn bad_maps_are_refused() {
        for (width, rgb, why) in [
            (3, vec![[1.0; 3]; 6], "twice as wide"),
            (0, vec![], "twice as wide"),
            (4, vec![[0.0; 3]; 8], "black"),
            (2, vec![[1.0; 3], [0.0, -1.0, 0.0]], "pixel 1,0"),
            (2, vec![[f32::NAN; 3], [1.0; 3]], "pixel 0,0"),
            (2, vec![[f32::INFINITY; 3], [1.0; 3]], "pixel 0,0"),
        ] {
            let refused = SkyRadiance::new(width, rgb).unwrap_err();
            assert!(refused.contains(why), "{refused}");
        }
    }
}
