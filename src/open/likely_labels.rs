//! Recognises segmentations that are opened as images.

use crate::volume::{MAX_LABELS, Volume, Voxel};
use crate::with_voxels;
use std::collections::HashSet;

/// Largest number of voxels that are examined.
const MOST_EXAMINED: usize = 1 << 20;
/// Smallest share of equal values among neighbours above 0. The scans of the tests have at most a quarter, and segmentations of
/// 3D Slicer 0.94.
const EQUAL_SHARE: f64 = 0.8;
/// Number of different values from which images of few grey levels are possible.
const MANY_VALUES: usize = 17;
/// Largest share of steps by 1 among unequal neighbours, where images are possible: smooth images have mostly such steps.
const MOST_UNIT_STEPS: f64 = 0.5;

/// Returns the reason why a volume is probably a segmentation; `None` if it probably is an image. Volumes that are read in parts
/// are not examined, since that would read them again.
pub fn likely_labels(volume: &Volume) -> Option<String> {
    let segments = volume.provenance.segments.len();
    if segments > 0 {
        return Some(format!("the file names segments: {segments}"));
    }
    if volume.value_range()[0] < 0.0 {
        return None;
    }
    let mut pairs = NeighbourPairs::default();
    let (scaling, width) = (volume.scaling(), volume.dims()[0]);
    with_voxels!(volume.resident()?, array => {
        let values = array.as_slice()?;
        let rows = values.chunks(width);
        let stride = values.len().div_ceil(MOST_EXAMINED).max(1);
        for row in rows.step_by(stride) {
            pairs.add_row(row.iter().map(|v| scaling.apply(v.to_f64())))?;
        }
    });
    pairs.are_labels().then(|| format!("{} different integers fill large regions", pairs.values.len()))
}

/// Statistics of voxels that are neighbours along a row.
#[derive(Debug, Default)]
struct NeighbourPairs {
    /// Different values, as bits of float64.
    values: HashSet<u64>,
    most: f64,
    /// Pairs above 0, and those of them with equal values.
    above_zero: usize,
    equal: usize,
    /// Pairs of different values, and those of them that differ by 1.
    unequal: usize,
    unit_steps: usize,
}

impl NeighbourPairs {
    /// Adds the pairs of a row. `None`: a value is no integer, or there are more values than a segmentation may have.
    fn add_row(&mut self, row: impl Iterator<Item = f64>) -> Option<()> {
        let mut last = None;
        for value in row {
            if last != Some(value) {
                self.values.insert(value.to_bits());
                self.most = self.most.max(value);
                if value.fract() != 0.0 || self.values.len() > MAX_LABELS {
                    return None;
                }
            }
            if let Some(last) = last.replace(value) {
                self.above_zero += usize::from(last > 0.0 && value > 0.0);
                self.equal += usize::from(last > 0.0 && last == value);
                self.unequal += usize::from(last != value);
                self.unit_steps += usize::from((last - value).abs() == 1.0);
            }
        }
        Some(())
    }

    fn are_labels(&self) -> bool {
        // Two values other than 0 and 1 are a phantom or a mask that is drawn as an image.
        let is_mask = self.values.len() == 2 && self.most == 1.0;
        let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
        let is_smooth =
            self.values.len() >= MANY_VALUES && share(self.unit_steps, self.unequal) > MOST_UNIT_STEPS;
        (is_mask || self.values.len() > 2) && share(self.equal, self.above_zero) >= EQUAL_SHARE && !is_smooth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Provenance, Scaling, Segment, Voxels};
    use glam::DAffine3;
    use ndarray::Array3;

    const SIDE: usize = 40;

    /// Creates a volume whose voxels are a function of the position from -1 to 1.
    fn volume(value: impl Fn([f64; 3]) -> f64) -> Volume {
        let at = |i: usize| 2.0 * i as f64 / (SIDE - 1) as f64 - 1.0;
        let values = Array3::from_shape_fn((SIDE, SIDE, SIDE), |(k, j, i)| value([at(i), at(j), at(k)]));
        let provenance = Provenance::new("test", "raw", "test");
        Volume::new(Voxels::F64(values), Scaling::IDENTITY, DAffine3::IDENTITY, provenance).unwrap()
    }

    fn radius([x, y, z]: [f64; 3]) -> f64 {
        (x * x + y * y + z * z).sqrt()
    }

    #[test]
    fn regions_of_integers_are_labels() {
        let mask = volume(|at| f64::from(radius(at) < 0.6));
        assert_eq!(likely_labels(&mask).unwrap(), "2 different integers fill large regions");
        let nested = volume(|at| (3.0 * (0.9 - radius(at))).ceil().max(0.0));
        let parcels = volume(|at| {
            let [x, y, z] = at.map(|a| (2.0 * (a + 1.0)).floor());
            if radius(at) < 0.9 { 1.0 + (x + 4.0 * y + 16.0 * z) * 37.0 % 101.0 } else { 0.0 }
        });
        for labels in [&nested, &parcels] {
            assert!(likely_labels(labels).is_some());
        }
    }

    #[test]
    fn images_are_no_labels() {
        let noise = |at: [f64; 3]| (1e4 * (at[0] + 3.0 * at[1] + 7.0 * at[2]).sin()).rem_euclid(1.0);
        let images: [(&str, Volume); 5] = [
            ("slab of 0 and 1000", volume(|at| if at[2] < 0.0 { 0.0 } else { 1000.0 })),
            ("constant", volume(|_| 1.0)),
            ("noise", volume(|at| (8.0 * noise(at)).floor())),
            ("many values", volume(|at| (900.0 * radius(at)).floor())),
            ("fractions", volume(|at| if radius(at) < 0.6 { 0.5 } else { 0.0 })),
        ];
        for (name, image) in images {
            assert_eq!(likely_labels(&image), None, "{name}");
        }
    }

    #[test]
    fn smooth_images_of_many_levels_are_no_labels() {
        let mut pairs = NeighbourPairs::default();
        // Each value fills ten voxels, and the next one is larger by 1.
        pairs.add_row((0..2000).map(|i| f64::from(i / 10))).unwrap();
        assert!(!pairs.are_labels());
    }

    #[test]
    fn a_file_with_named_segments_is_a_segmentation() {
        let mut named = volume(|_| 1.0);
        named.provenance.segments = vec![Segment { label: 1, name: "liver".into(), color: None }];
        assert_eq!(likely_labels(&named).unwrap(), "the file names segments: 1");
    }
}
