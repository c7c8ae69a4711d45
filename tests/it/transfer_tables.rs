//! Device tables of a transfer function: integrals, search of intervals, breakpoints between pairs of values.

use umbravox::transfer::{PairTable, Quantity, TexelMapping, TransferFunction, TransferTables};

/// Mapping in which texels 0 to 1000 hold the values -200 to 300.
const MAPPING: TexelMapping = TexelMapping { scale: 0.5, offset: -200.0 };
const TEXELS: [f64; 2] = [0.0, 1000.0];

fn tf(quantity: Quantity, points: &[(f64, f64)]) -> TransferFunction {
    let mut tf = TransferFunction { reference_length_mm: 2.0, ..TransferFunction::new(quantity, points) };
    let color = |v: f64| [0.5 + v / 1000.0, 0.25, (v / 50.0).sin().abs()];
    tf.points.iter_mut().for_each(|p| p.color = color(p.value));
    tf
}

fn functions() -> [TransferFunction; 4] {
    let comb: Vec<_> = (0..30).map(|k| (f64::from(k) * 16.3 - 190.0, 0.7 * f64::from(k % 2))).collect();
    [
        tf(Quantity::Opacity, &[(-50.0, 0.0), (250.0, 0.95)]),
        tf(
            Quantity::Extinction,
            &[(-100.0, 0.2), (-100.0, 0.0), (40.5, 0.0), (40.5, 3.0), (90.0, 0.5), (280.0, 0.0)],
        ),
        tf(Quantity::Opacity, &[(0.0, 1.0)]),
        tf(Quantity::Extinction, &comb),
    ]
}

fn tables(tf: &TransferFunction) -> TransferTables {
    TransferTables::build(tf, MAPPING, TEXELS)
}

#[test]
fn integrals_agree_with_fine_sums() {
    const FINE: usize = 400;
    for tf in functions() {
        let tables = tables(&tf);
        let bins = tables.integrals.len() - 1;
        let width = 1000.0 / (bins * FINE) as f64;
        let mut sum = [0.0; 4];
        for (bin, next) in tables.integrals[1..].iter().enumerate() {
            for sub in 0..FINE {
                let value = MAPPING.value_from_texel(((bin * FINE + sub) as f64 + 0.5) * width);
                let (sigma, color) = (tf.extinction(value) * width, tf.color(value));
                (0..3).for_each(|c| sum[c] += sigma * color[c]);
                sum[3] += sigma;
            }
            for c in 0..4 {
                // A jump inside a strip of the sum misplaces half a strip at the most; float32 the rest.
                let allowed = 3.0 * width + 2e-7 * sum[c];
                assert!(
                    (f64::from(next[c]) - sum[c]).abs() <= allowed,
                    "bin {bin}, channel {c}: {} {}",
                    next[c],
                    sum[c]
                );
            }
        }
    }
}

/// Finds the interval of a texel value like `interval_at` of `shaders/field/transfer.wgsl`.
fn interval_at(tables: &TransferTables, texel: f32) -> usize {
    let last = tables.interval_of_bin.len() - 1;
    let bin = ((texel - tables.bin_origin) * tables.bins_per_value).clamp(0.0, last as f32) as usize;
    let mut j = tables.interval_of_bin[bin] as usize;
    while j + 1 < tables.intervals.len() && texel >= tables.intervals[j + 1][0] {
        j += 1;
    }
    j
}

#[test]
fn every_value_finds_its_interval_and_extinction() {
    for tf in functions() {
        let tables = tables(&tf);
        let edges = tables.intervals.iter().map(|i| i[0]);
        let near = edges.flat_map(|e| [e.next_down(), e, e.next_up()]);
        for texel in (0..5000).map(|i| i as f32 * 0.21 - 20.0).chain(near) {
            let j = interval_at(&tables, texel);
            let [start, amount, slope, lacking] = tables.intervals[j];
            assert!((lacking - (1.0 - amount)).abs() < 1e-7);
            let end = tables.intervals.get(j + 1).map_or(f32::INFINITY, |next| next[0]);
            assert!(texel < end && (j == 0 || texel >= start), "{texel} in {j}: {start}..{end}");
            let value = MAPPING.value_from_texel(f64::from(texel));
            let got = tf.extinction_of_amount(f64::from(amount + slope * (texel - start)).max(0.0));
            // At a jump rounding decides the side; elsewhere float32 of a steep slope.
            let sides = [-1e-4, 0.0, 1e-4].map(|d| tf.extinction(value + d));
            let (low, high) = (
                sides.iter().copied().fold(f64::INFINITY, f64::min),
                sides.iter().copied().fold(0.0, f64::max),
            );
            assert!((low - 1e-4..=high + 1e-4).contains(&got), "{texel}: {got} not in {low}..{high}");
            let inside = texel > tables.first_value && texel < tables.last_value;
            assert!(inside || tf.extinction(value) < 1e-5, "{texel} has extinction");
        }
    }
}

#[test]
fn pair_nodes_hold_the_breakpoints_between_two_values() {
    let mut more = 0;
    // A breakpoint between constant parts bends nothing, and is no node.
    for tf in functions().into_iter().filter(|tf| tf.points.len() > 1) {
        let tables = tables(&tf);
        let pairs = PairTable::build(&tf, MAPPING);
        let side = pairs.nodes.len().isqrt();
        let per_value = tables.bins_per_value * side as f32 / tables.interval_of_bin.len() as f32;
        let bin = |t: f32| ((t - tables.bin_origin) * per_value).clamp(0.0, side as f32 - 1.0) as usize;
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 40) as f32 / (1u64 << 24) as f32 * 1000.0
        };
        for _ in 0..20_000 {
            let (a, b) = (random(), random());
            let [low, high] = pairs.nodes[bin(a) * side + bin(b)];
            let packed = [low & 0xffff, low >> 16, high & 0xffff, high >> 16];
            let (from, to) = (a.min(b), a.max(b));
            let mut wanted: Vec<u32> = (1..tables.intervals.len() as u32)
                .filter(|&i| (from..to).contains(&tables.intervals[i as usize][0]))
                .collect();
            if a > b {
                wanted.reverse();
            }
            let nodes: Vec<u32> = packed.iter().copied().filter(|n| *n < 0xfffe).collect();
            // Breakpoints come in the order in which a value from a to b meets them.
            let ordered = nodes.windows(2).all(|w| if a < b { w[0] < w[1] } else { w[0] > w[1] });
            assert!(ordered || bin(a) == bin(b), "{packed:?}");
            if packed[3] == 0xfffe {
                more += 1;
                assert!(nodes.is_empty() && (wanted.len() > 2 || bin(a) == bin(b)), "{a} {b} {packed:?}");
            } else {
                let missing = wanted.iter().find(|w| !nodes.contains(w));
                assert_eq!(missing, None, "{a} to {b}: {packed:?}");
            }
        }
    }
    assert!(more > 1000, "the comb has more than fit: {more}");
}

#[test]
fn no_extinction_and_nothing_but_one_point() {
    let none = tables(&tf(Quantity::Extinction, &[(0.0, 0.0)]));
    assert!(none.first_value > none.last_value, "no value lies between them");
    assert!(none.integrals.iter().flatten().all(|v| *v == 0.0));
    let every = tables(&tf(Quantity::Extinction, &[(0.0, 1.0)]));
    assert!(every.first_value < -1e20 && every.last_value > 1e20);
}
