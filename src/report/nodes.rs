//! Figures of the curve nodes stored in a deep shadow map: the largest number per tile (Hadwiger et al. 2006, Figure
//! 5), and the histogram of nodes per texel.

use super::canvas::{Anchor, Drawing, INK, Rect, Rgb, encode_png};
use super::heat::{false_colour, with_legend};
use super::number::significant;
use super::plot::axis::{Axis, axis_titles, draw_axes};
use super::plot::page::TEXT;
use crate::error::Result;
use crate::shadow::NodeMap;
use image::imageops;

/// Approximate side length of the image that shows the curve nodes in each tile of a deep shadow map, pixels.
const PICTURE_SIDE_PX: usize = 384;
/// Colour of tiles without stored curves in the image of a deep shadow map's curve nodes. The `inferno` colour map
/// does not contain it.
const LEFT_OUT: Rgb = [150, 150, 150];
/// Largest number of bars in the histogram of curve nodes per texel; if there are more node counts, each bar covers
/// several.
const MOST_BARS: usize = 40;

/// Summary of a deep shadow map's curve nodes in one sentence: total, mean, largest number, and tiles without stored
/// curves.
pub fn summary(map: &NodeMap) -> String {
    let histogram = map.histogram();
    let total: u64 = histogram.iter().zip(0..).map(|(texels, nodes)| texels * nodes).sum();
    let hit: u64 = histogram[1..].iter().sum();
    let left_out = map.stored.iter().filter(|s| !**s).count();
    let mean = if hit == 0 { 0.0 } else { total as f64 / hit as f64 };
    format!(
        "{total} nodes in {hit} of {} texels: {} a texel that meets anything, at most {}; {left_out} of {} tiles \
        skipped",
        map.nodes.len(),
        significant(mean, 3),
        histogram.len() - 1,
        map.stored.len()
    )
}

/// Draws the largest number of curve nodes of any texel in each tile of a deep shadow map, as a false-colour PNG
/// file. Tiles without stored curves are grey. Texel (0, 0) is at the top left.
///
/// # Errors
/// The image cannot be drawn or encoded.
pub fn tile_png(map: &NodeMap) -> Result<Vec<u8>> {
    let most = map.most_by_tile();
    // A multiple of 4 gives whole numbers at the four steps of the legend.
    let max = most.iter().copied().max().unwrap_or(0).max(1).next_multiple_of(4) as f32;
    let mut tiles = false_colour(&most.mapv(|n| n as f32), max);
    for ((y, x), stored) in map.stored.indexed_iter() {
        if !stored {
            tiles.put_pixel(x as u32, y as u32, image::Rgb(LEFT_OUT));
        }
    }
    let zoom = (PICTURE_SIDE_PX / most.dim().0.max(1)).max(1) as u32;
    let (width, height) = (tiles.width() * zoom, tiles.height() * zoom);
    let picture = imageops::resize(&tiles, width, height, imageops::FilterType::Nearest);
    let side = crate::shadow::TILE;
    let label = format!("most nodes in a texel, tiles of {side} × {side}");
    encode_png(&with_legend(&picture, max, &label)?)
}

/// Draws the histogram of curve nodes per texel of a deep shadow map, in percent of all texels with nodes.
pub(super) fn histogram(map: &NodeMap, color: Rgb) -> Drawing {
    const FRAME: Rect = Rect { left: 96.0, top: 20.0, right: 548.0, bottom: 300.0 };
    let mut drawing = Drawing::new(560.0, 360.0);
    let (shares, nodes_a_bar) = bars(&map.histogram());
    let x_title = match nodes_a_bar {
        1 => "nodes in a texel".to_string(),
        n => format!("nodes in a texel, {n} numbers a bar"),
    };
    let titles = [x_title.as_str(), "texels that meet anything [%]"];
    let highest = shares.iter().copied().fold(0.0, f64::max);
    if highest <= 0.0 {
        axis_titles(&mut drawing, FRAME, titles);
        drawing.outline(FRAME, 1.2, INK);
        drawing.text(FRAME.middle(), Anchor::Middle, TEXT, INK, "no texel meets anything");
        return drawing;
    }
    // The first bar is centred on 1; each bar spans its node counts.
    let last = (shares.len() * nodes_a_bar) as f64 + 0.5;
    let mut x = Axis::linear([0.5, last], FRAME.left, FRAME.right, 10);
    x.ticks.retain(|tick| tick.value.fract() == 0.0);
    let y = Axis::linear([0.0, 1.06 * highest], FRAME.bottom, FRAME.top, 7);
    draw_axes(&mut drawing, FRAME, [&x, &y], titles);
    for (i, share) in shares.iter().enumerate() {
        let edge = |n: usize| x.place((n * nodes_a_bar) as f64 + 0.5);
        let air = 0.1 * (edge(1) - edge(0));
        let (left, right) = (edge(i) + air, edge(i + 1) - air);
        drawing.polygon(&Rect { left, right, top: y.place(*share), bottom: FRAME.bottom }.corners(), color);
    }
    drawing
}

/// Returns the bar heights of the curve-node histogram, in percent of the texels with nodes, and the number of node
/// counts that each bar covers.
fn bars(histogram: &[u64]) -> (Vec<f64>, usize) {
    let with_nodes = &histogram[1..];
    let texels: u64 = with_nodes.iter().sum();
    let nodes_a_bar = with_nodes.len().div_ceil(MOST_BARS).max(1);
    let share = |bar: &[u64]| 100.0 * bar.iter().sum::<u64>() as f64 / texels as f64;
    (with_nodes.chunks(nodes_a_bar).map(share).collect(), nodes_a_bar)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::heat::inferno;
    use ndarray::{Array2, arr2};

    fn sample() -> NodeMap {
        let mut nodes = Array2::zeros((32, 32));
        nodes.slice_mut(ndarray::s![..16, ..16]).fill(2);
        nodes[[3, 3]] = 8;
        nodes[[20, 2]] = 4;
        NodeMap { nodes, stored: arr2(&[[true, false], [true, true]]) }
    }

    #[test]
    fn tiles_have_the_colour_of_their_fullest_texel_and_grey_where_left_out() {
        let picture = image::load_from_memory(&tile_png(&sample()).unwrap()).unwrap().to_rgb8();
        // 2 tiles of 192 pixels a side, centred over a wider legend.
        let left = (picture.width() - 384) / 2;
        let at = |x: u32, y: u32| *picture.get_pixel(left + x, y);
        assert_eq!(at(10, 10), inferno(1.0));
        assert_eq!(at(200, 10), image::Rgb(LEFT_OUT));
        assert_eq!(at(10, 380), inferno(0.5));
        assert_eq!(at(380, 380), inferno(0.0));
    }

    #[test]
    fn shares_are_of_texels_that_meet_anything() {
        let (shares, nodes_a_bar) = bars(&sample().histogram());
        assert_eq!((shares.len(), nodes_a_bar), (8, 1));
        assert!((shares[1] - 100.0 * 255.0 / 257.0).abs() < 1e-9 && shares[0] == 0.0);
        assert!((shares.iter().sum::<f64>() - 100.0).abs() < 1e-9);
        let (shares, nodes_a_bar) = bars(&[vec![5], vec![1; 95]].concat());
        assert_eq!((shares.len(), nodes_a_bar), (32, 3));
        assert!((shares.iter().sum::<f64>() - 100.0).abs() < 1e-9);
    }

    #[test]
    fn the_histogram_names_its_axes_and_survives_an_empty_map() {
        let svg = |map: &NodeMap| histogram(map, INK).svg(None).into_string();
        let text = svg(&sample());
        assert!(text.contains("nodes in a texel") && text.contains("texels that meet anything [%]"));
        assert_eq!(
            summary(&sample()),
            "522 nodes in 257 of 1024 texels: 2.03 a texel that meets anything, at most 8; 1 of 4 tiles skipped"
        );
        let empty = NodeMap { nodes: Array2::zeros((16, 16)), stored: arr2(&[[false]]) };
        assert!(svg(&empty).contains("no texel meets anything"));
        assert!(summary(&empty).starts_with("0 nodes in 0 of 256 texels"));
        tile_png(&empty).unwrap();
    }
}
