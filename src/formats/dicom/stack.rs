//! Stacks DICOM slices into a volume: sorts them, computes the affine, and handles repeated, missing and unevenly
//! spaced slices.

use super::series::{Series, Slice};
use crate::formats::common::affine;
use crate::volume::AffineSource;
use dicom_core::Tag;
use dicom_dictionary_std::tags;
use glam::{DAffine3, DVec3};

/// Distance below which two DICOM slices count as being at one position: in mm, and as a fraction of the median slice
/// spacing.
const SAME_MM: f64 = 1e-3;
const SAME: f64 = 0.05;
/// Largest deviation of DICOM slice positions from even spacing that is tolerated, as a fraction of the spacing.
const EVEN: f64 = 0.02;
/// Largest deviation of DICOM slice positions from even spacing that is attributed to rounding to 0.1 mm: in mm, and
/// as a fraction of the spacing.
const ROUNDED_MM: f64 = 0.06;
const MAX_ROUNDED: f64 = 0.25;
/// Largest deviation of DICOM slice positions from even spacing that is attributed to rounding to the written
/// decimals, as a fraction of the spacing.
const MAX_WRITTEN: f64 = 0.45;
/// Distance from a DICOM slice below which a layer of the resampled volume copies this slice, as a fraction of the
/// layer spacing.
const SNAP: f64 = 0.01;
/// Distance of DICOM slice positions from a straight line, in mm, above which the reader warns.
const ASIDE_MM: f64 = 0.05;
/// Largest accepted ratio of the number of layers in a resampled volume to the number of DICOM slices.
const MAX_GROWTH: usize = 4;

/// Source of one z layer of a volume: a DICOM slice, or two neighbouring slices and the weight of the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Layer {
    Slice(usize),
    Between(usize, f64),
}

/// DICOM slices of one frame (time point), ordered along the slice normal, with the affine of the volume.
pub(super) struct Stack {
    pub(super) slices: Vec<Slice>,
    pub(super) layers: Vec<Layer>,
    pub(super) world_from_index: DAffine3,
    pub(super) affine_source: AffineSource,
    pub(super) frames: usize,
    pub(super) warnings: Vec<String>,
}

/// Orders the slices of a DICOM series and computes the affine of the volume.
///
/// # Errors
/// The DICOM slices do not form a regular grid.
pub(super) fn stack(series: &Series, frame: usize) -> Result<Stack, String> {
    let slices = series.slices();
    let first = slices.first().ok_or("it has no slices")?;
    let set = &series.images[first.image].set;
    let numbers = |tag| set.of_frame(first.frame, tag).and_then(|a| a.numbers(tag));
    let mut warnings = Vec::new();
    let Plane { across, normal, thickness } = Plane::new(numbers, &mut warnings)?;
    one_grid(series, &slices)?;
    let unplaced = slices.iter().filter(|s| s.position.is_none()).count();
    let mut slices = slices;
    if unplaced > 0 && unplaced < slices.len() {
        slices.retain(|s| s.position.is_some());
        warnings.push(format!("{unplaced} slices have no position: skipped"));
    }
    let placed: Option<Vec<DVec3>> = slices.iter().map(|s| s.position).collect();
    let Some(placed) = placed else {
        return in_order(slices, &Plane { across, normal, thickness }, frame, warnings);
    };
    let depth_mm = |slice: &Slice| slice.position.map_or(0.0, |p| (p - placed[0]).dot(normal));
    let mut by_depth = slices;
    by_depth.sort_by(|a, b| depth_mm(a).total_cmp(&depth_mm(b)).then(a.order.cmp(&b.order)));
    let mut gaps: Vec<f64> = by_depth.windows(2).map(|s| depth_mm(&s[1]) - depth_mm(&s[0])).collect();
    gaps.retain(|gap| *gap > SAME_MM);
    gaps.sort_by(f64::total_cmp);
    let same_mm = gaps.get(gaps.len() / 2).map_or(SAME_MM, |usual| (SAME * usual).max(SAME_MM));
    let mut places: Vec<Vec<Slice>> = Vec::new();
    for slice in by_depth {
        match places.last_mut() {
            Some(place) if (depth_mm(&slice) - depth_mm(&place[0])).abs() < same_mm => place.push(slice),
            _ => places.push(vec![slice]),
        }
    }
    places.iter_mut().for_each(|place| place.sort_by_key(|s| s.order));
    let grouping = frames_of(&places, &mut warnings);
    let frames = match &grouping {
        FrameGrouping::One => 1,
        FrameGrouping::ByRank(n) => *n,
        FrameGrouping::ByTime(times) => times.len(),
    };
    if frame >= frames {
        return Err(format!("--frame {frame} is beyond its {frames} frames (counted from 0)"));
    }
    let of_frame = |place: &Vec<Slice>| match &grouping {
        FrameGrouping::One => place.first().copied(),
        FrameGrouping::ByRank(_) => place.get(frame).copied(),
        FrameGrouping::ByTime(times) => place.iter().find(|s| s.order[..2] == times[frame]).copied(),
    };
    let slices: Vec<Slice> = places.iter().filter_map(of_frame).collect();
    let depths: Vec<f64> = slices.iter().map(depth_mm).collect();
    let (layers, count) = layers(&depths, written_mm(series, &slices, normal), &mut warnings)?;
    let at = |slice: &Slice| slice.position.unwrap_or_default();
    let (from, to) = (at(&slices[0]), at(&slices[slices.len() - 1]));
    // A tilted gantry gives a sheared affine, which is exact.
    let along = match count {
        1 => {
            let thickness = thickness.unwrap_or_else(|| {
                warnings.push("one slice without a thickness: taken as 1 mm".into());
                1.0
            });
            normal * thickness
        }
        n => (to - from) / (n - 1) as f64,
    };
    warn_of_placement(&slices, &depths, along.angle_between(normal).to_degrees(), &mut warnings);
    Ok(Stack {
        world_from_index: affine([across[0], across[1], along], from, true),
        affine_source: AffineSource::Axes,
        frames,
        slices,
        layers,
        warnings,
    })
}

/// Orientation and pixel spacing of DICOM slices.
pub(super) struct Plane {
    /// Vectors from a pixel of a DICOM slice to the next one along rows and columns, LPS mm.
    pub(super) across: [DVec3; 2],
    /// Unit normal of the DICOM slices.
    pub(super) normal: DVec3,
    /// Distance between DICOM slices by their attributes (SpacingBetweenSlices or SliceThickness), mm.
    pub(super) thickness: Option<f64>,
}

impl Plane {
    pub(super) fn new(
        numbers: impl Fn(Tag) -> Option<Vec<f64>>,
        warnings: &mut Vec<String>,
    ) -> Result<Self, String> {
        let spacing = [tags::PIXEL_SPACING, tags::NOMINAL_SCANNED_PIXEL_SPACING, tags::IMAGER_PIXEL_SPACING]
            .into_iter()
            .find_map(|tag| numbers(tag).filter(|v| v.len() == 2 && v.iter().all(|s| *s > 0.0)));
        let spacing = spacing.unwrap_or_else(|| {
            warnings.push("no pixel spacing is given: pixels taken as 1 mm".into());
            vec![1.0, 1.0]
        });
        let thickness = [tags::SPACING_BETWEEN_SLICES, tags::SLICE_THICKNESS]
            .into_iter()
            .find_map(|tag| numbers(tag).map(|v| v[0].abs()).filter(|mm| *mm > 0.0));
        let orientation = numbers(tags::IMAGE_ORIENTATION_PATIENT).filter(|v| v.len() == 6);
        let (row, column) = orientation
            .map_or((DVec3::X, DVec3::Y), |v| (DVec3::new(v[0], v[1], v[2]), DVec3::new(v[3], v[4], v[5])));
        let normal = row.cross(column);
        if (normal.length() - 1.0).abs() > 1e-2 {
            return Err(
                "its rows and columns are not perpendicular directions (ImageOrientationPatient)".into()
            );
        }
        // PixelSpacing lists the distance between rows first.
        let across = [row * spacing[1], column * spacing[0]];
        if numbers(tags::IMAGE_ORIENTATION_PATIENT).is_none() {
            warnings
                .push("no orientation is given: rows taken to run to the left, columns to the back".into());
        }
        Ok(Self { across, normal, thickness })
    }
}

/// Stacks DICOM slices that have no positions, in the order of their instance numbers.
fn in_order(
    slices: Vec<Slice>,
    plane: &Plane,
    frame: usize,
    mut warnings: Vec<String>,
) -> Result<Stack, String> {
    if frame > 0 {
        return Err(format!("--frame {frame} is beyond its 1 frame (counted from 0)"));
    }
    let thickness = plane.thickness.unwrap_or_else(|| {
        warnings.push("no distance between slices is given: taken as 1 mm".into());
        1.0
    });
    if slices.len() > 1 {
        warnings.push("its slices have no positions: placed in the order of their numbers".into());
    }
    let origin = slices.iter().find_map(|s| s.position).unwrap_or(DVec3::ZERO);
    let layers = (0..slices.len()).map(Layer::Slice).collect();
    Ok(Stack {
        world_from_index: affine([plane.across[0], plane.across[1], plane.normal * thickness], origin, true),
        affine_source: AffineSource::Spacing,
        frames: 1,
        slices,
        layers,
        warnings,
    })
}

/// Adds warnings for DICOM slices that are off a straight line or sheared (tilted gantry).
fn warn_of_placement(slices: &[Slice], depths: &[f64], tilt_deg: f64, warnings: &mut Vec<String>) {
    let at = |slice: &Slice| slice.position.unwrap_or_default();
    let (from, to) = (at(&slices[0]), at(&slices[slices.len() - 1]));
    let aside = slices.iter().zip(depths).map(|(slice, depth)| {
        let share = if depths[depths.len() - 1] > depths[0] {
            (depth - depths[0]) / (depths[depths.len() - 1] - depths[0])
        } else {
            0.0
        };
        (at(slice) - (from + (to - from) * share)).length()
    });
    let aside = aside.fold(0.0, f64::max);
    if aside > ASIDE_MM {
        warnings.push(format!("its slices are up to {aside:.2} mm off a straight line: placed on it"));
    }
    if tilt_deg > 0.05 {
        warnings
            .push(format!("its slices are sheared by {tilt_deg:.2} degrees (tilted gantry): the affine keeps the shear exactly"));
    }
}

/// Returns an error if the slices of a DICOM series have several orientations or pixel sizes.
fn one_grid(series: &Series, slices: &[Slice]) -> Result<(), String> {
    let of = |slice: &Slice, tag| {
        let set = &series.images[slice.image].set;
        set.of_frame(slice.frame, tag).and_then(|a| a.numbers(tag))
    };
    for (tag, tolerance, what) in [
        (tags::IMAGE_ORIENTATION_PATIENT, 1e-2, "have several orientations"),
        (tags::PIXEL_SPACING, 1e-3, "have pixels of several sizes"),
    ] {
        let first = slices.first().and_then(|s| of(s, tag));
        let differs = |other: Option<Vec<f64>>| match (&first, other) {
            (Some(a), Some(b)) => {
                a.len() != b.len()
                    || a.iter().zip(b).any(|(a, b)| (a - b).abs() > tolerance * a.abs().max(1.0))
            }
            _ => false,
        };
        if slices.iter().any(|s| differs(of(s, tag))) {
            return Err(format!("its slices {what}; one grid cannot hold them"));
        }
    }
    Ok(())
}

/// Method that separates DICOM slices at the same position into frames (time points).
enum FrameGrouping {
    One,
    /// Assigns DICOM slices at the same position to frames (time points) by their rank; every position has this
    /// number of slices.
    ByRank(usize),
    /// Assigns DICOM slices at the same position to frames (time points) by temporal position and acquisition number.
    ByTime(Vec<[i64; 2]>),
}

/// Selects the method that separates DICOM slices at the same position into frames (time points).
fn frames_of(places: &[Vec<Slice>], warnings: &mut Vec<String>) -> FrameGrouping {
    let (least, most) = places.iter().map(Vec::len).fold((usize::MAX, 1), |(a, b), n| (a.min(n), b.max(n)));
    if most == 1 {
        return FrameGrouping::One;
    }
    let mut warn = || {
        warnings.push(format!("{most} slices have the same position: {most} frames, --frame selects one"));
    };
    let time = |s: &Slice| [s.order[0], s.order[1]];
    let mut times: Vec<[i64; 2]> = places.iter().flatten().map(time).collect();
    times.sort_unstable();
    times.dedup();
    if times.len() == most {
        warn();
        return FrameGrouping::ByTime(times);
    }
    if least == most {
        warn();
        return FrameGrouping::ByRank(most);
    }
    let doubled: usize = places.iter().map(|place| place.len() - 1).sum();
    warnings.push(format!("{doubled} slices repeat the position of others: the lowest number was used"));
    FrameGrouping::One
}

/// Returns the uncertainty of DICOM slice positions along the slice normal, in mm, due to the number of written
/// decimals; 0 if unknown.
fn written_mm(series: &Series, slices: &[Slice], normal: DVec3) -> f64 {
    let decimals = |slice: &Slice| {
        let of = series.images[slice.image].set.of_frame(slice.frame, tags::IMAGE_POSITION_PATIENT);
        of.and_then(|attributes| attributes.decimals(tags::IMAGE_POSITION_PATIENT))
    };
    // Trailing zeros may be missing, so the largest number of decimals counts.
    let most = slices.iter().map(decimals).try_fold(0, |most, decimals| Some(most.max(decimals?)));
    let unit_mm = most.map_or(0.0, |decimals| 10f64.powi(-(decimals.min(300) as i32)));
    // Half a unit for each coordinate of both slices that are compared.
    unit_mm * normal.abs().element_sum()
}

/// Computes the z layers of the volume from the ascending positions of DICOM slices along their normal, and returns
/// the number of layers too. `written_mm` is the rounding error of the positions.
fn layers(
    depths: &[f64],
    written_mm: f64,
    warnings: &mut Vec<String>,
) -> Result<(Vec<Layer>, usize), String> {
    let n = depths.len();
    let gaps: Vec<f64> = depths.windows(2).map(|d| d[1] - d[0]).collect();
    let mean = (depths[n - 1] - depths[0]) / gaps.len().max(1) as f64;
    // Positions are compared, not distances, since the rounding of positions does not accumulate.
    let rounded_mm = ROUNDED_MM.min(MAX_ROUNDED * mean).max(written_mm.min(MAX_WRITTEN * mean));
    let tolerance = rounded_mm.max(EVEN * mean);
    let is_even = |(k, depth): (usize, &f64)| (depth - depths[0] - k as f64 * mean).abs() <= tolerance;
    if depths.iter().enumerate().all(is_even) {
        return Ok(((0..n).map(Layer::Slice).collect(), n));
    }
    let smallest = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let length = depths[n - 1] - depths[0];
    let count = ((length / smallest).round() as usize).saturating_add(1);
    let largest = gaps.iter().copied().fold(0.0, f64::max);
    let spacing = format!("its slices are {smallest:.3} to {largest:.3} mm apart");
    if count > MAX_GROWTH * n {
        return Err(format!("{spacing}: an even grid of them would take {count} slices for {n}"));
    }
    let step = length / (count - 1) as f64;
    let layers = (0..count)
        .map(|k| {
            let depth = depths[0] + k as f64 * step;
            let above = depths.partition_point(|d| *d < depth - SNAP * step).clamp(1, n - 1);
            let share = ((depth - depths[above - 1]) / gaps[above - 1]).clamp(0.0, 1.0);
            match share {
                s if s * gaps[above - 1] <= SNAP * step => Layer::Slice(above - 1),
                s if (1.0 - s) * gaps[above - 1] <= SNAP * step => Layer::Slice(above),
                s => Layer::Between(above - 1, s),
            }
        })
        .collect::<Vec<_>>();
    let made = layers.iter().filter(|l| matches!(l, Layer::Between(..))).count();
    warnings.push(format!(
        "{spacing}: resampled linearly to {count} slices {step:.3} mm apart, {made} of them between slices of the series"
    ));
    Ok((layers, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layers_of(depths: &[f64]) -> Result<(Vec<Layer>, Vec<String>), String> {
        let mut warnings = Vec::new();
        layers(depths, 0.0, &mut warnings).map(|(layers, _)| (layers, warnings))
    }

    #[test]
    fn rounding_to_written_decimals_is_even() {
        for spacing in [0.3, 0.125] {
            let depths: Vec<f64> = (0..40).map(|k| (f64::from(k) * spacing * 10.0).round() / 10.0).collect();
            let mut warnings = Vec::new();
            assert_eq!(layers(&depths, 0.1, &mut warnings).unwrap().1, 40, "{spacing}");
            assert!(warnings.is_empty(), "{warnings:?}");
        }
        // Rounding does not hide a missing slice.
        let mut warnings = Vec::new();
        layers(&[0.0, 0.3, 0.6, 1.2, 1.5], 0.1, &mut warnings).unwrap();
        assert!(warnings[0].contains("resampled"), "{warnings:?}");
    }

    #[test]
    fn even_slices_are_not_resampled() {
        let thirds: Vec<f64> = (0..40).map(|k| (f64::from(k) / 3.0 * 100.0).round() / 100.0).collect();
        assert!(layers_of(&thirds).unwrap().1.is_empty());
        let (layers, warnings) = layers_of(&[0.0, 2.0, 4.001, 6.0]).unwrap();
        assert_eq!(layers, [0, 1, 2, 3].map(Layer::Slice));
        assert!(warnings.is_empty());
        assert_eq!(layers_of(&[5.0]).unwrap().0, [Layer::Slice(0)]);
    }

    #[test]
    fn a_missing_slice_is_interpolated_with_a_warning() {
        let (layers, warnings) = layers_of(&[0.0, 1.0, 3.0, 4.0]).unwrap();
        assert_eq!(layers.len(), 5);
        assert_eq!(layers[2], Layer::Between(1, 0.5));
        assert_eq!([layers[1], layers[3], layers[4]], [1, 2, 3].map(Layer::Slice));
        assert!(warnings[0].contains("resampled"), "{warnings:?}");
    }

    #[test]
    fn widely_uneven_slices_are_refused() {
        assert!(layers_of(&[0.0, 1e15, 1e300]).is_err());
        assert!(layers_of(&[0.0, 0.1, 50.0]).unwrap_err().contains("apart"));
    }
}
