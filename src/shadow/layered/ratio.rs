//! Choice of the ratio of linear to logarithmic layers (Voicu 2011, 5.2.3, 5.2.4 and 7) for `dom` and `bom` shadow
//! maps.
//!
//! The thesis renders the shadow map with each of eleven ratios, reads the images of the layers back and compares
//! those of neighbouring layers. Here a coarse shadow map with many layers approximates the exact transmittance
//! curves. The device sums over its texels, and only the sums are read back (16 bytes for each layer and ratio).

use super::{Average, Built, LayeredMap, Record, Split, SplitSearch, SplitTable};
use crate::error::Result;
use crate::field::{BuildContext, MapShape, TileMarch};
use crate::gpu::{Constant, ShaderVariant, Slot, Span, StorageBuffer, read_back};
use crate::shadow::filter::Filter;
use crate::shadow::method::SplitChoice;
use crate::shadow::settings::choices;

/// Number of candidate ratios 0, 0.1, ... 1 between linear and logarithmic layers that the search for the best ratio
/// compares.
pub const RATIOS: u32 = 11;
/// Number of layers of the coarse shadow map from which the ratio of linear to logarithmic layers is chosen.
const CURVE_LAYERS: u32 = 128;
/// Number of texels per side of the coarse shadow map from which one ratio of linear to logarithmic layers is chosen
/// for a whole shadow map.
const CURVE_MAP: u32 = 64;
/// Upper end of the interval `[1, N]` to which depth is scaled before its logarithm spaces the layers of the coarse
/// shadow map.
const CURVE_LOG_SIZE: f64 = 256.0;
/// Width, in shadow map texels, of the square regions with a ratio of linear to logarithmic layers of their own.
pub const REGION_TEXELS: u32 = 4;

choices! {
    /// Criterion by which the ratio of linear to logarithmic layers is chosen for a shadow map.
    pub enum Measure {
        /// Chooses the ratio of linear to logarithmic layers at which neighbouring layers are least correlated (Voicu
        /// 2011, Equation 5.2.3.1), averaged over all pairs.
        Correlation = "correlation",
        /// Chooses the ratio with the greatest sum of absolute differences between neighbouring layers. Opacity never
        /// falls from one plane to the next, so this sum telescopes: the ratio with the least opacity in the first
        /// layer wins. On 8-bit images, as in the thesis, ratios with equally empty first layers tie, and the most
        /// linear of them is chosen.
        Difference = "difference",
    }
}

/// Returns the division of depth into layers at a ratio from linear (0) to logarithmic (1). The logarithm is taken
/// over `[1, log_size]`.
pub fn hybrid(ratio: f64, log_size: f64) -> SplitTable {
    let log = |x: f64| (1.0 + (log_size - 1.0) * x).log2() / log_size.log2();
    SplitTable::of(|x| (1.0 - ratio) * x + ratio * log(x))
}

fn ratio_of(row: u32) -> f64 {
    f64::from(row) / f64::from(RATIOS - 1)
}

/// Returns the divisions of depth into layers at all candidate ratios, from linear (0) to logarithmic (1).
pub fn all_splits(log_size: f64) -> Vec<SplitTable> {
    (0..RATIOS).map(|row| hybrid(ratio_of(row), log_size)).collect()
}

/// Returns the description of a coarse shadow map with many layers. It approximates the exact transmittance curves in
/// the depth ranges of the final shadow map.
fn coarse_map(map: &LayeredMap) -> LayeredMap {
    let depths = map.record.depths;
    LayeredMap {
        record: Record { layers: CURVE_LAYERS, bits: 16, depths, depth_bits: 32, own_split: false },
        // Many thin layers near the start, since any ratio may place planes there.
        split: Split::Tables(vec![hybrid(0.5, CURVE_LOG_SIZE)]),
        reach: map.reach,
        last_takes_rest: map.last_takes_rest,
        filter: Filter::Nearest,
        average: Average::Depth,
        kernel: 1,
        shape: map.shape,
    }
}

fn curves<'a>(context: &BuildContext<'a>, layered_map: &LayeredMap, map: u32) -> Result<Built<'a>> {
    let shape = MapShape { texels: Some(map), ..layered_map.shape };
    let context = &context.at_once();
    coarse_map(layered_map).build(context, TileMarch::fit(context, shape)?, None)
}

/// Returns the two shaders that search for the best ratio of linear to logarithmic layers: one for a whole shadow
/// map, one for each region of it.
pub fn shaders(layered_map: &LayeredMap) -> [ShaderVariant; 2] {
    let constants = [Constant::unsigned("RATIOS", RATIOS)];
    let whole = coarse_map(layered_map).read_shader("shadow/layered/ratio.wgsl").constants(&constants);
    [whole.clone(), whole.defs(["PER_REGION"])]
}

fn pass(
    context: &BuildContext<'_>,
    (layers, log_size): (u32, f64),
    curves: &Built<'_>,
    stage: &wgpu::Buffer,
    shader: &ShaderVariant,
    [across, down]: [u32; 2],
) -> Result<Span> {
    let planes: Vec<f32> = all_splits(log_size)
        .iter()
        .flat_map(|split| {
            let [_, planes] = split.rows(layers);
            planes.into_iter().skip(1)
        })
        .collect();
    let planes = StorageBuffer::from_slice(context.gpu(), "planes of all ratios", &planes)?;
    let stage =
        [(0, Slot::read(planes.as_entire_binding())), (1, Slot::read_write(stage.as_entire_binding()))];
    let groups = [&curves.group(context), &context.kernels.group("split ratio", &stage)];
    context.run("split ratio", shader, groups, [across, down, 1])
}

/// Returns the GPU time and memory taken to choose a ratio of linear to logarithmic layers: those of the coarse shadow
/// map, and of the search.
fn search_costs(curves: &Built<'_>, search: Span, stage: &wgpu::Buffer) -> SplitSearch {
    SplitSearch {
        device: curves.report.device.map_or(search, |build| build.plus(search)),
        bytes: curves.report.bytes + stage.size(),
    }
}

/// Chooses one ratio of linear to logarithmic layers for a whole shadow map. Returns the index of the ratio, its
/// entry in the build report, and the costs of the search.
pub fn choose(
    context: &BuildContext<'_>,
    layered_map: &LayeredMap,
    log_size: f64,
    measure: Measure,
) -> Result<(u32, SplitChoice, SplitSearch)> {
    let (gpu, layers) = (context.gpu(), layered_map.record.layers);
    let curves = curves(context, layered_map, CURVE_MAP)?;
    let count = (RATIOS * layers) as usize;
    let stage = StorageBuffer::zeroed(gpu, "sums over layers", 16 * count as u64)?;
    let span =
        pass(context, (layers, log_size), &curves, &stage, &shaders(layered_map)[0], [layers, RATIOS])?;
    let sums = read_back::<[f32; 4]>(gpu, &stage, count)?;
    let (row, correlation) = best(&sums, layers as usize, f64::from(CURVE_MAP).powi(2), measure);
    let costs = search_costs(&curves, span, &stage);
    Ok((row, SplitChoice { ratio: ratio_of(row), correlation }, costs))
}

/// Chooses a ratio of linear to logarithmic layers for every region of a shadow map. Returns a buffer with the ratios
/// for the build, and the costs of the search.
pub fn choose_by_region(
    context: &BuildContext<'_>,
    layered_map: &LayeredMap,
    log_size: f64,
    map: u32,
) -> Result<(wgpu::Buffer, SplitSearch)> {
    let layers = layered_map.record.layers;
    let regions = map.div_ceil(REGION_TEXELS);
    let curves = curves(context, layered_map, regions)?;
    let mut words = vec![0, REGION_TEXELS, regions];
    words.resize(3 + (regions * regions) as usize, 0);
    let stage = StorageBuffer::from_slice(context.gpu(), "ratios of regions", &words)?;
    let span = pass(
        context,
        (layers, log_size),
        &curves,
        &stage,
        &shaders(layered_map)[1],
        [regions.div_ceil(8); 2],
    )?;
    let costs = search_costs(&curves, span, &stage);
    Ok((stage, costs))
}

/// Returns the index of the best ratio of linear to logarithmic layers, and the mean correlation of neighbouring
/// layers at it. `sums` holds, for each ratio and layer, the sums over all texels of `I_k`, `I_k^2`, `I_k I_(k+1)`
/// and `|I_(k+1) - I_k|`, where `I_k` is the opacity image of layer `k`. Of equally good ratios the most linear wins.
fn best(sums: &[[f32; 4]], layers: usize, texels: f64, measure: Measure) -> (u32, f64) {
    let mut best = (0, 1.0, f64::INFINITY);
    for (row, sums) in (0..).zip(sums.chunks(layers)) {
        let pairs = sums.windows(2).map(|w| correlation(w[0], w[1], texels));
        let correlation = if layers > 1 { pairs.sum::<f64>() / (layers - 1) as f64 } else { 1.0 };
        // The difference of the last layer is 0.
        let difference: f64 = sums.iter().map(|s| f64::from(s[3])).sum();
        tracing::debug!(
            "ratio {:.1}: correlation {correlation:.4}, difference {difference:.1}",
            ratio_of(row)
        );
        let cost = match measure {
            Measure::Correlation => correlation,
            Measure::Difference => -difference,
        };
        if cost < best.2 - 1e-9 {
            best = (row, correlation, cost);
        }
    }
    (best.0, best.1)
}

/// Returns the correlation of the opacity images of two shadow map layers, from sums over their texels (Voicu 2011,
/// 5.2.4); 1 for images without contrast.
fn correlation(a: [f32; 4], b: [f32; 4], texels: f64) -> f64 {
    let [sum_a, square_a, product, _] = a.map(f64::from);
    let [sum_b, square_b, ..] = b.map(f64::from);
    let covariance = product - sum_a * sum_b / texels;
    let variances = (square_a - sum_a * sum_a / texels) * (square_b - sum_b * sum_b / texels);
    if variances <= 1e-12 * texels * texels { 1.0 } else { (covariance / variances.sqrt()).clamp(-1.0, 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computes on the CPU the sums over layer images that the search shader computes, from
    /// `images[ratio][layer][texel]`.
    fn sums(images: &[Vec<Vec<f32>>]) -> Vec<[f32; 4]> {
        let of = |layers: &Vec<Vec<f32>>, k: usize| {
            let next = &layers[(k + 1).min(layers.len() - 1)];
            layers[k]
                .iter()
                .zip(next)
                .fold([0.0; 4], |s, (a, b)| [s[0] + a, s[1] + a * a, s[2] + a * b, s[3] + (b - a).abs()])
        };
        images.iter().flat_map(|layers| (0..layers.len()).map(move |k| of(layers, k))).collect()
    }

    #[test]
    fn correlation_by_hand() {
        let image = |texels: &[f32]| texels.to_vec();
        let of = |a: &[f32], b: &[f32]| {
            let s = sums(&[vec![image(a), image(b)]]);
            correlation(s[0], s[1], a.len() as f64)
        };
        assert!((of(&[0.0, 0.5, 1.0], &[0.1, 0.3, 0.5]) - 1.0).abs() < 1e-6, "a straight line");
        assert!((of(&[0.0, 0.5, 1.0], &[1.0, 0.5, 0.0]) + 1.0).abs() < 1e-6);
        assert!(of(&[0.0, 1.0, 0.0, 1.0], &[0.0, 0.0, 1.0, 1.0]).abs() < 1e-6);
        assert_eq!(of(&[0.5, 0.5], &[0.0, 1.0]), 1.0, "no contrast");
    }

    #[test]
    fn the_ratio_with_the_least_alike_layers_is_found() {
        let alike = vec![vec![0.0, 0.5, 1.0, 0.5], vec![0.0, 0.5, 1.0, 0.5]];
        let apart = vec![vec![0.0, 1.0, 0.0, 1.0], vec![0.0, 0.0, 1.0, 1.0]];
        let images = [alike.clone(), apart.clone(), alike.clone(), apart];
        let (row, c) = best(&sums(&images), 2, 4.0, Measure::Correlation);
        assert_eq!((row, c.abs() < 1e-6), (1, true), "of two alike the more linear");
        assert_eq!(best(&sums(&images), 2, 4.0, Measure::Difference).0, 1);
        let same = [alike.clone(), alike];
        assert_eq!(best(&sums(&same), 2, 4.0, Measure::Difference).0, 0);
        assert_eq!(best(&sums(&[vec![vec![1.0]], vec![vec![0.5]]]), 1, 1.0, Measure::Correlation), (0, 1.0));
    }

    #[test]
    fn the_hybrid_split_goes_from_linear_to_logarithmic() {
        let planes = |ratio: f64| hybrid(ratio, 256.0).rows(4)[1].clone();
        assert_eq!(planes(0.0), [0.0, 0.25, 0.5, 0.75, 1.0]);
        // log2(1 + 255 x) / 8 = 1/4, 1/2, 3/4: x = (4 - 1) / 255, ...
        for (got, exact) in planes(1.0).iter().zip([0.0, 3.0 / 255.0, 15.0 / 255.0, 63.0 / 255.0, 1.0]) {
            assert!((got - exact as f32).abs() < 1e-5, "{got} {exact}");
        }
        // log2(1 + 15 x) / 4 = 1/4: x = 1 / 15.
        assert!((hybrid(1.0, 16.0).rows(4)[1][1] - 1.0 / 15.0).abs() < 1e-5);
        let middle = planes(0.5);
        assert!((1..4).all(|k| middle[k] < planes(0.0)[k] && middle[k] > planes(1.0)[k]));
    }
}
