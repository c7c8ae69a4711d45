//! Transfer function of a page, for the editor of its points.

use super::contents::Contents;
use crate::field::{ActiveBricks, DisabledOptimizations, FAR, LINE_THREADS, Optimization};
use crate::render::Session;
use crate::scene::{Light, Scene};
use crate::transfer::{
    ControlPoint, MAX_INTERVALS, MAX_OPACITY, MORE_NODES, PAIR_BINS, Quantity, TABLE_BINS, TransferFunction,
    VALUE_BINS,
};
use crate::volume::{Histogram, Volume};
use serde::Serialize;

/// Largest number of control points of a function that the page edits. `MOST_POINTS` of `editor.js` is the same.
const MOST_POINTS: usize = 64;
/// Number of bins of the histogram behind the curve.
const HISTOGRAM_BINS: usize = 240;

/// Control point of the transfer function, with its colour in linear RGB.
#[derive(Debug, Serialize)]
struct PointRecord {
    value: f64,
    amount: f64,
    color: [f64; 3],
}

/// Number of voxels in bins of equal width over a range of values.
#[derive(Debug, Serialize)]
struct HistogramRecord {
    range: [f64; 2],
    counts: Vec<u64>,
}

/// Transfer function whose points the page edits, and what its lookup tables depend on.
#[derive(Debug, Serialize)]
pub(super) struct FunctionRecord {
    name: String,
    units: String,
    quantity: &'static str,
    reference_length_mm: f64,
    points: Vec<PointRecord>,
    /// Range of the volume's values.
    range: [f64; 2],
    histogram: HistogramRecord,
    /// Value of a texel: `texel * scale + offset`.
    scale: f64,
    offset: f64,
    /// Texel value at which the tables of integrals begin, and the width of all their bins.
    table_origin: f64,
    table_width: f64,
    value_bins: usize,
    table_bins: usize,
    pair_bins: usize,
    max_intervals: usize,
    max_opacity: f64,
    more_nodes: u16,
    far: f32,
    line_threads: u32,
    /// Offset of the smallest, then the largest values of all bricks (blocks of voxel cells) in the data, as 64-bit floats.
    /// `None`: all are 0.
    brick_ranges: Option<usize>,
}

/// Returns optimizations with those disabled that an edited function may not allow: a page always has the table of
/// breakpoints and the search for them.
pub fn page_optimizations(disabled: DisabledOptimizations) -> DisabledOptimizations {
    let excluded = [Optimization::BreakpointSearch, Optimization::MarchTable];
    excluded.map(DisabledOptimizations::only).into_iter().fold(disabled, DisabledOptimizations::and)
}

/// Returns the transfer function of a page; `None` if the page cannot edit it: labels have functions, it has too many
/// points, nothing has extinction, bricks are not skipped, or a light is not directional.
pub(super) fn function_record(
    contents: &mut Contents<'_>,
    session: &Session,
    scene: &Scene,
) -> Option<FunctionRecord> {
    let Session { loaded, transfer, .. } = session;
    let tf = transfer.function();
    let is_directional = |light: Light| matches!(light, Light::Directional { .. });
    let is_editable = !transfer.has_labels
        // Other functions may need pages that are not stored.
        && transfer.pages.is_none()
        && !transfer.empty
        && !transfer.disabled.has(Optimization::Bricks)
        && tf.points.len() <= MOST_POINTS
        && scene.shining().into_iter().all(|source| is_directional(source.light));
    if !is_editable {
        return None;
    }
    // Shaders for one colour read it from a uniform. Points without extinction may have another one.
    let one_color = tf.one_color().filter(|_| transfer.one_color);
    let point = |&ControlPoint { value, amount, color }: &ControlPoint| {
        let color = one_color.unwrap_or(color);
        PointRecord { value, amount, color }
    };
    let (mapping, [origin, end]) = (loaded.on_device.mapping, loaded.on_device.texel_range);
    let Histogram { range, counts, .. } = Histogram::of(&loaded.volume, HISTOGRAM_BINS).ok()?;
    Some(FunctionRecord {
        name: tf.name.clone(),
        units: tf.units.clone(),
        quantity: match tf.quantity {
            Quantity::Opacity => "opacity",
            Quantity::Extinction => "extinction",
        },
        reference_length_mm: tf.reference_length_mm,
        points: tf.points.iter().map(point).collect(),
        range: loaded.volume.value_range(),
        histogram: HistogramRecord { range, counts },
        scale: mapping.scale,
        offset: mapping.offset,
        table_origin: origin,
        table_width: if end > origin { end - origin } else { 1.0 },
        value_bins: VALUE_BINS,
        table_bins: TABLE_BINS,
        pair_bins: PAIR_BINS,
        max_intervals: MAX_INTERVALS,
        max_opacity: MAX_OPACITY,
        more_nodes: MORE_NODES,
        far: FAR,
        line_threads: LINE_THREADS,
        brick_ranges: contents.push(bytemuck::cast_slice(&brick_ranges(&loaded.volume, tf))),
    })
}

/// Returns the smallest values in all bricks (blocks of voxel cells) of a volume, then the largest. A brick that clip planes
/// remove has an empty range.
fn brick_ranges(volume: &Volume, tf: &TransferFunction) -> Vec<f64> {
    let bricks = volume.bricks();
    let everywhere = TransferFunction {
        clip: tf.clip.clone(),
        ..TransferFunction::new(Quantity::Extinction, &[(0.0, 1.0)])
    };
    let kept = ActiveBricks::of(bricks, &everywhere).distance;
    let ranges = bricks.all_ranges();
    let ends = |end: usize, of_clipped: f64| {
        let value =
            |(range, distance): (&[f64; 2], &u8)| if *distance == 0 { range[end] } else { of_clipped };
        ranges.iter().zip(&kept).map(value).collect::<Vec<_>>()
    };
    [ends(0, f64::INFINITY), ends(1, f64::NEG_INFINITY)].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;
    use crate::transfer::ClipPlane;
    use glam::DVec3;

    #[test]
    fn clipped_bricks_have_no_values() {
        let volume = Phantom::Shell.build(24).unwrap();
        let bricks = volume.bricks();
        let mut tf = TransferFunction::new(Quantity::Opacity, &[(0.0, 0.5)]);
        let all = [0, 1].map(|end| bricks.all_ranges().iter().map(|range| range[end]).collect::<Vec<_>>());
        assert_eq!(brick_ranges(&volume, &tf), all.concat());
        tf.clip = vec![ClipPlane { normal: DVec3::X, offset_mm: volume.center_mm().x }];
        let ranges = brick_ranges(&volume, &tf);
        let (min, max) = ranges.split_at(bricks.len());
        let empty = min.iter().zip(max).filter(|(min, max)| min > max).count();
        assert!((1..bricks.len()).contains(&empty), "{empty} of {}", bricks.len());
        let [first, last] = [0, bricks.counts[0] - 1];
        assert_eq!((min[first], max[first]), (f64::INFINITY, f64::NEG_INFINITY));
        assert_eq!((min[last], max[last]), bricks.range(last).into());
    }
}
