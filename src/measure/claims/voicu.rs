//! Voicu 2011, *Real-time volumetric shadows for dynamic rendering*: `bom`.
//!
//! Its trees and grass are polygons; strands in locks and fur stand in for them, as scattered and as dense.

use super::claim::{Claim, Finding, Measured, Paper};
use super::figures::Figures;
use super::rules::{EQUAL, Holds, at_least, at_most, beside, falls, rises, within};
use super::scenes::{AS_IS, DENSER, FROM_ABOVE, FROM_THE_SIDE, FUR, LOCKS, SPARSER, StandIn, Variant};
use crate::error::Result;

/// Tables 6.1.1, 6.2.1 and 6.3.1, in this order; the last four choose their ratio.
const TABLES_6: &str = "osm:layers=4,8,16,32,map=256;dom:layers=4,8,16,32,map=256;bom:layers=4,8,16,32,map=256;bom:layers=4,8,16,32,split=auto,map=256";
const LAYERS: [u32; 4] = [4, 8, 16, 32];
/// Their frames a second on trees, grass and dense grass.
const OSM: [[f64; 3]; 4] =
    [[147.58, 137.53, 107.76], [124.85, 110.00, 79.91], [86.68, 73.87, 59.53], [53.80, 39.83, 36.58]];
const DOM: [[f64; 3]; 4] =
    [[112.10, 77.38, 70.53], [90.66, 60.56, 61.23], [63.96, 47.93, 41.85], [43.90, 29.45, 27.28]];
const BOM: [[f64; 3]; 4] =
    [[73.41, 61.18, 49.80], [67.53, 55.13, 43.61], [58.91, 46.96, 34.66], [41.88, 31.93, 26.80]];
/// Table 5.2.3.1: correlation of neighbouring layers on trees, and on grass.
const CORRELATION: [[f64; 4]; 2] = [[0.66, 0.83, 0.92, 0.96], [0.72, 0.86, 0.93, 0.96]];
const TREES_AND_GRASS: &[StandIn] = &[LOCKS, FUR];
/// Ratios chosen for few and many layers.
const CHOSEN: &str = "bom:layers=4,8,16,32,split=auto,map=256";
const CHOSEN_BY_BOTH: &str = "bom:layers=4,16,32,split=auto,measure=correlation,difference,map=256";

fn claim(place: &'static str, claim: impl Into<String>, claimed: impl Into<String>) -> Claim {
    Claim::new(Paper::Voicu, place, claim, claimed)
}

pub fn claims() -> Vec<Claim> {
    [frame_rates(), pictures(), ratio(), tables_a_11(), splits(), other()].into_iter().flatten().collect()
}

/// Least and most of a ratio over the three scenes of a table.
fn range(above: [f64; 3], below: [f64; 3]) -> [f64; 2] {
    let ratios = above.iter().zip(below).map(|(a, b)| a / b);
    ratios.fold([f64::INFINITY, 0.0], |[low, high], r| [low.min(r), high.max(r)])
}

/// The ratio of two times against a range.
fn times(slow: f64, fast: f64, range: [f64; 2]) -> Finding {
    let figures = [("ratio", slow / fast), ("slower [ms]", slow), ("faster [ms]", fast)];
    Finding::new(within(slow / fast, range), figures)
}

/// Tables 6.x as ratios: between methods at each number of layers, and between numbers of layers.
fn frame_rates() -> Vec<Claim> {
    const RULE: &str = "Yes where the ratio of build_ms + frame_ms is within the range over the three scenes of the tables (and 15 %), \
        partly where it is on that side of 1.";
    let text = |[low, high]: [f64; 2]| format!("{low:.2} to {high:.2} times");
    let mut claims = Vec::new();
    for (i, layers) in LAYERS.into_iter().enumerate() {
        for (names, fast, slow) in [
            (["Opacity shadow maps", "bounding opacity maps"], 0, 2),
            (["Deep opacity maps", "bounding opacity maps"], 1, 2),
            (["Opacity shadow maps", "deep opacity maps"], 0, 1),
        ] {
            let fps = [OSM, DOM, BOM];
            let range = range(fps[fast][i], fps[slow][i]);
            let what = format!("{} have more frames a second than {} at {layers} layers", names[0], names[1]);
            let judge = move |m: &Measured| {
                Ok(times(m[0][4 * slow + i].moving_ms()?, m[0][4 * fast + i].moving_ms()?, range))
            };
            let table = claim("Tables 6.1.1, 6.2.1, 6.3.1", what, text(range));
            claims.push(table.on(TREES_AND_GRASS).needs(AS_IS, TABLES_6).judged(RULE, judge));
        }
    }
    for (method, name, fps, place) in [
        (0, "opacity shadow maps", OSM, "Table 6.1.1"),
        (1, "deep opacity maps", DOM, "Table 6.2.1"),
        (2, "bounding opacity maps", BOM, "Table 6.3.1"),
    ] {
        let range = range(fps[0], fps[3]);
        let what = format!("Frames a second of {name} fall from 4 to 32 layers");
        let judge = move |m: &Measured| {
            Ok(times(m[0][4 * method + 3].moving_ms()?, m[0][4 * method].moving_ms()?, range))
        };
        let table = claim(place, what, text(range));
        claims.push(table.on(TREES_AND_GRASS).needs(AS_IS, TABLES_6).judged(RULE, judge));
    }
    claims.push(
        claim(
            "section 6.3, Figure 6.3.1",
            "For a larger number of layers bounding opacity maps tend to the performance of deep opacity maps",
            "the gap closes",
        )
        .on(TREES_AND_GRASS)
        .needs(AS_IS, TABLES_6)
        .judged(
            "Yes where build_ms + frame_ms of the two differ by at most 10 % at 32 layers and by less than at 4, partly where one is so.",
            |m| {
                let ratio = |i: usize| Ok::<f64, crate::error::Error>(m[0][8 + i].moving_ms()? / m[0][4 + i].moving_ms()?);
                let (few, many) = (ratio(0)?, ratio(3)?);
                let (close, closer) = ((many - 1.0).abs() <= 0.1, (many - 1.0).abs() < (few - 1.0).abs());
                let figures = [("bom / dom, 32 layers", many), ("4 layers", few)];
                Ok(Finding::new(Holds::of(close && closer, close || closer), figures))
            },
        ),
    );
    claims
}

fn pictures() -> Vec<Claim> {
    /// The better of an even mixture and the chosen ratio, as the thesis would choose it.
    fn bom(m: &Measured, i: usize) -> Result<f64> {
        Ok(m[0][8 + i].image_rmse()?.min(m[0][12 + i].image_rmse()?))
    }
    vec![
        claim("section 6.3, Figure 5.5", "Bounding opacity maps give better pictures than deep opacity maps", "better at equal layers")
            .on(TREES_AND_GRASS)
            .needs(AS_IS, TABLES_6)
            .judged(
                "Yes where image_rmse of dom is 1.05 times that of bom (the better of ratio 0.5 and the chosen one) or more at 4, 8, 16 and \
                 32 layers, no where at none of them.",
                |m| {
                    let mut figures = Vec::new();
                    for (i, layers) in LAYERS.iter().enumerate() {
                        figures.push((format!("dom / bom, {layers} layers"), m[0][4 + i].image_rmse()? / bom(m, i)?));
                    }
                    let cases = figures.iter().map(|(_, ratio)| Holds::of(*ratio >= EQUAL, false));
                    Ok(Finding::new(Holds::all(cases.collect::<Vec<_>>()), figures))
                },
            ),
        claim("sections 5.1 and 6.3", "Fewer layers than in deep opacity maps give as much detail", "half the layers")
            .on(TREES_AND_GRASS)
            .needs(AS_IS, TABLES_6)
            .judged(
                "Yes where image_rmse of bom is within 1.05 of that of dom with twice the layers (8, 16 and 32), no where in none of the \
                 three.",
                |m| {
                    let mut figures = Vec::new();
                    for i in 1..4 {
                        let name = format!("bom {} / dom {}", LAYERS[i - 1], LAYERS[i]);
                        figures.push((name, bom(m, i - 1)? / m[0][4 + i].image_rmse()?));
                    }
                    let cases = figures.iter().map(|(_, ratio)| Holds::of(*ratio <= EQUAL, false));
                    Ok(Finding::new(Holds::all(cases.collect::<Vec<_>>()), figures))
                },
            ),
        claim("Figure 4.3", "Deep opacity maps with 16 layers are free of the artifacts of opacity shadow maps with 64", "16 against 64")
            .on(TREES_AND_GRASS)
            .needs(AS_IS, "dom:layers=16,map=256;osm:layers=64,map=256")
            .judged("Yes where image_rmse of 16 layers is within 1.05 of that of 64 slices, partly up to twice that.", |m| {
                let (dom, osm) = (m[0][0].image_rmse()?, m[0][1].image_rmse()?);
                let figures = [("16 layers / 64 slices", dom / osm), ("16 layers", dom), ("64 slices", osm)];
                Ok(Finding::new(at_most(dom / osm, EQUAL, 2.0), figures))
            }),
    ]
}

fn ratios(figures: &[&Figures]) -> Result<Vec<f64>> {
    figures.iter().map(|f| Ok(f.chosen()?.ratio)).collect()
}

fn correlations(figures: &[&Figures]) -> Result<Vec<f64>> {
    figures.iter().map(|f| Ok(f.chosen()?.correlation)).collect()
}

fn by_layers(values: &[f64]) -> Vec<(String, f64)> {
    LAYERS.iter().zip(values).map(|(n, v)| (format!("{n} layers"), *v)).collect()
}

/// How the chosen ratio and the correlation there go with layers and density.
fn ratio() -> Vec<Claim> {
    let correlation = |scenes, row: usize, name: &str| {
        let claimed = CORRELATION[row];
        let text = claimed.map(|c| c.to_string()).join(", ");
        claim("Table 5.2.3.1", format!("Correlation of neighbouring layers at 4, 8, 16 and 32 layers ({name})"), text)
            .on(scenes)
            .needs_structure(AS_IS, CHOSEN)
            .judged("Yes where each of the four is within 0.05 of the table's, partly where two are.", move |m| {
                let measured = correlations(&m[0])?;
                Ok(Finding::new(beside(&measured, &claimed, 0.05), by_layers(&measured))
                    .note("Images of opacity are compared; the thesis compares 8-bit images of what each layer holds."))
            })
    };
    const DENSITIES: &str = "bom:layers=16,split=auto,measure=correlation,difference,map=256";
    let denser = |index: usize, measure: &str| {
        claim(
            "section 5.2.3, Figure 5.2.3.5",
            format!("Splitting becomes more logarithmic for denser objects ({measure})"),
            "the ratio rises with density",
        )
        .on(TREES_AND_GRASS)
        .needs_structure(SPARSER, DENSITIES)
        .needs_structure(AS_IS, DENSITIES)
        .needs_structure(DENSER, DENSITIES)
        .judged(
            "Yes where the ratio chosen for 16 layers never falls from an eighth of the extinction to eight times it, and rises by more than \
             0.05; partly where only the whole rises.",
            move |m| {
                let series: Vec<f64> = m.iter().map(|f| Ok(f[index].chosen()?.ratio)).collect::<Result<_>>()?;
                let figures = [("ratio, extinction / 8", series[0]), ("as it is", series[1]), ("times 8", series[2])];
                Ok(Finding::new(rises(&series, 0.05), figures))
            },
        )
    };
    vec![
        correlation(&[LOCKS], 0, "trees"),
        correlation(&[FUR], 1, "grass"),
        claim("Table 5.2.3.1", "More layers always increase the correlation of neighbouring ones", "monotonic increase")
            .on(TREES_AND_GRASS)
            .needs_structure(AS_IS, CHOSEN)
            .judged("Yes where it never falls from 4 to 32 layers and rises by more than 0.01, partly where only the whole rises.", |m| {
                let measured = correlations(&m[0])?;
                Ok(Finding::new(rises(&measured, 0.01), by_layers(&measured)))
            }),
        claim("section 5.2.3, Figure 5.2.3.6", "Splitting tends to be more linear when the number of layers increases", "the ratio falls")
            .on(TREES_AND_GRASS)
            .needs_structure(AS_IS, CHOSEN)
            .judged("Yes where the chosen ratio never rises from 4 to 32 layers and falls by more than 0.05, partly where only the whole falls.", |m| {
                let measured = ratios(&m[0])?;
                Ok(Finding::new(falls(&measured, 0.05), by_layers(&measured)))
            }),
        denser(0, "correlation"),
        denser(1, "sum of absolute differences"),
        claim(
            "section 5.2.3",
            "Cross-correlation covers a wider range of ratios than the sum of absolute differences",
            "a wider range",
        )
        .on(TREES_AND_GRASS)
        .needs_structure(SPARSER, CHOSEN_BY_BOTH)
        .needs_structure(AS_IS, CHOSEN_BY_BOTH)
        .needs_structure(DENSER, CHOSEN_BY_BOTH)
        .judged("Over 4, 16 and 32 layers and three densities: yes where the ratios by correlation span 0.05 more, no otherwise.", |m| {
            let span = |measure: usize| -> Result<f64> {
                let all = m.iter().flat_map(|f| f.iter().skip(measure).step_by(2));
                let ratios: Vec<f64> = all.map(|f| Ok(f.chosen()?.ratio)).collect::<Result<_>>()?;
                let (least, most) = (ratios.iter().copied().fold(1.0, f64::min), ratios.iter().copied().fold(0.0, f64::max));
                Ok(most - least)
            };
            let (correlation, difference) = (span(0)?, span(1)?);
            let figures = [("range by correlation", correlation), ("by differences", difference)];
            Ok(Finding::new(Holds::of(correlation >= difference + 0.05, false), figures))
        }),
    ]
}

/// Tables A.11.1 to A.11.6: the ratios chosen by differences and by correlation, for 1, 16 and 32 layers.
fn tables_a_11() -> Vec<Claim> {
    type Table = (&'static str, &'static str, &'static [StandIn], Variant, [f64; 3], [f64; 3]);
    let dense = |v: Variant| v.dense(4.0);
    let tables: [Table; 6] = [
        ("Table A.11.1", "a tree from above", &[LOCKS], FROM_ABOVE, [1.0, 0.4, 0.2], [0.7, 0.2, 0.2]),
        ("Table A.11.2", "a tree from the side", &[LOCKS], FROM_THE_SIDE, [1.0, 0.6, 0.2], [0.7, 0.3, 0.1]),
        ("Table A.11.3", "grass from above", &[FUR], FROM_ABOVE, [1.0, 0.9, 1.0], [0.7, 0.3, 0.2]),
        ("Table A.11.4", "grass from the side", &[FUR], FROM_THE_SIDE, [1.0, 1.0, 1.0], [1.0, 0.8, 0.7]),
        ("Table A.11.5", "dense grass from above", &[FUR], dense(FROM_ABOVE), [1.0; 3], [0.8, 0.4, 0.3]),
        (
            "Table A.11.6",
            "dense grass from the side",
            &[FUR],
            dense(FROM_THE_SIDE),
            [1.0; 3],
            [1.0, 0.9, 0.8],
        ),
    ];
    let mut claims = Vec::new();
    for (place, what, scenes, light, by_difference, by_correlation) in tables {
        for (measure, name, claimed) in
            [(0, "correlation", by_correlation), (1, "sum of absolute differences", by_difference)]
        {
            let text = claimed.map(|r| r.to_string()).join(", ");
            let table = claim(place, format!("Ratio chosen by {name} for 1, 16 and 32 layers: {what}"), text);
            claims.push(table.on(scenes).needs_structure(light, CHOSEN_BY_BOTH).judged(
                "Yes where each of the three is within 0.2 of the table's, partly where two are.",
                move |m| {
                    let own: Vec<&Figures> = m[0].iter().copied().skip(measure).step_by(2).collect();
                    let measured = ratios(&own)?;
                    let names = ["4 layers", "16 layers", "32 layers"];
                    let figures: Vec<_> = names.into_iter().zip(measured.iter().copied()).collect();
                    Ok(Finding::new(beside(&measured, &claimed, 0.2), figures).note(
                        "A single layer has no neighbour to differ from: the table's 1 is read as one render target, 4 layers.",
                    ))
                },
            ));
        }
    }
    claims
}

/// Which split gives the better picture.
fn splits() -> Vec<Claim> {
    const SPLITS: &str = "bom:layers=16,split=linear,log,auto,map=256";
    let better = |place, what, claimed, variant, good: usize, names: [&'static str; 2]| {
        claim(place, what, claimed).on(TREES_AND_GRASS).needs(variant, SPLITS).judged(
            "Yes where image_rmse of the other is 1.05 times as large or more (16 layers), no otherwise.",
            move |m| {
                let (good, other) = (m[0][good].image_rmse()?, m[0][1 - good].image_rmse()?);
                let figures = [
                    (format!("{} / {}", names[1], names[0]), other / good),
                    (names[0].into(), good),
                    (names[1].into(), other),
                ];
                Ok(Finding::new(at_least(other / good, EQUAL), figures))
            },
        )
    };
    vec![
        better(
            "section 5.2.1, Figure 5.2.5",
            "For uniform shapes and high alpha the logarithmic split gives better pictures than the linear one",
            "logarithmic better where dense",
            DENSER,
            1,
            ["logarithmic", "linear"],
        ),
        better(
            "section 5.2.3, Figure 5.2.3.4",
            "For scattered geometry or low alpha the linear split gives better pictures than the logarithmic one",
            "linear better where sparse",
            SPARSER,
            0,
            ["linear", "logarithmic"],
        ),
        claim("section 6.3", "With the chosen hybrid split better pictures are obtained", "no worse than either split")
            .on(TREES_AND_GRASS)
            .needs(DENSER, SPLITS)
            .needs(SPARSER, SPLITS)
            .judged(
                "In dense and in sparse matter, image_rmse of the chosen ratio is within 1.05 of the better of linear and logarithmic: yes in both, \
                 no in none.",
                |m| {
                    let mut ratios = Vec::new();
                    for (own, name) in m.iter().zip(["dense", "sparse"]) {
                        let least = own[0].image_rmse()?.min(own[1].image_rmse()?);
                        ratios.push((format!("chosen / better, {name}"), own[2].image_rmse()? / least));
                    }
                    let cases = ratios.iter().map(|(_, r)| Holds::of(*r <= EQUAL, false)).collect::<Vec<_>>();
                    Ok(Finding::new(Holds::all(cases), ratios))
                },
            ),
        claim("section 7", "A ratio for each ray corrects pictures of objects of different density", "better than one ratio for all")
            .on(TREES_AND_GRASS)
            .needs(AS_IS, "bom:layers=8,split=texel,auto,map=256")
            .judged("Yes where image_rmse of one ratio for all is 1.05 times as large or more (8 layers), no otherwise.", |m| {
                let (texel, one) = (m[0][0].image_rmse()?, m[0][1].image_rmse()?);
                let figures = [("one ratio / by region", one / texel), ("by region", texel), ("one ratio", one)];
                Ok(Finding::new(at_least(one / texel, EQUAL), figures))
            }),
        claim("section 7", "Computing the splitting texture will probably decrease performance", "slower")
            .on(TREES_AND_GRASS)
            .needs(AS_IS, "bom:layers=8,split=texel,hybrid,map=256")
            .judged("Yes where build_ms + frame_ms is 1.05 times that of a given ratio or more (8 layers), no otherwise.", |m| {
                let (texel, given) = (m[0][0].moving_ms()?, m[0][1].moving_ms()?);
                let figures = [("by region / given", texel / given), ("by region [ms]", texel), ("given [ms]", given)];
                Ok(Finding::new(at_least(texel / given, EQUAL), figures))
            }),
    ]
}

fn other() -> Vec<Claim> {
    vec![
        claim(
            "sections 5.2.3 and 5.2.4",
            "Choosing the ratio is a bottleneck that exceeds real time: 11 frames, each read back",
            "11 times",
        )
        .on(TREES_AND_GRASS)
        .needs(AS_IS, "bom:layers=16,split=hybrid,auto,map=256")
        .judged("Yes where the map takes 5 times as long to make with the choice or longer, partly from 1.05 on.", |m| {
            let (given, chosen) = (m[0][0].build_ms()?, m[0][1].build_ms()?);
            let figures = [("build_ms, chosen / given", chosen / given), ("chosen [ms]", chosen), ("given [ms]", given)];
            Ok(Finding::new(at_least(chosen / given, 5.0), figures)
                .note("Here one coarse map stands for the eleven, and only sums are read back."))
        }),
        claim("section 3.5", "With percentage-closer filtering lower resolution maps do without significant artifacts", "lower resolution, as good")
            .on(TREES_AND_GRASS)
            .needs(AS_IS, "osm:layers=16,kernel=1,3,map=128,256")
            .judged(
                "Yes where 3 x 3 texels of a map of 128 are as close in the picture (image_rmse within 1.05) as one of a map of 256, partly where \
                 closer than one of 128.",
                |m| {
                    let errors: Vec<_> = m[0].iter().map(|f| f.image_rmse()).collect::<Result<_>>()?;
                    let (plain, fine, filtered) = (errors[0], errors[1], errors[2]);
                    let figures = [
                        ("3 x 3 at 128 / one at 256", filtered / fine),
                        ("one at 128", plain),
                        ("one at 256", fine),
                        ("3 x 3 at 128", filtered),
                    ];
                    Ok(Finding::new(Holds::of(filtered <= EQUAL * fine, filtered < plain), figures)
                        .note("The mean of 3 x 3 optical depths stands in for 4 x 4 comparisons."))
                },
            ),
        claim("section 6", "Frames a second on a GeForce GT 335M", "26.8 to 147.58")
            .untried("Figures of a machine; their ratios are the rows above."),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_leave_ranges() {
        let [low, high] = range(OSM[0], BOM[0]);
        assert!((low - 147.58 / 73.41).abs() < 1e-12 && (high - 137.53 / 61.18).abs() < 1e-12);
        let [low, high] = range(DOM[3], BOM[3]);
        assert!((low - 29.45 / 31.93).abs() < 1e-12 && (high - 43.90 / 41.88).abs() < 1e-12);
        assert_eq!(times(2.0, 1.0, [2.0, 2.3]).holds, Holds::Yes);
        assert_eq!(times(1.0, 1.0, [2.0, 2.3]).holds, Holds::No);
        assert_eq!(times(1.3, 1.0, [2.0, 2.3]).holds, Holds::Partly);
    }
}
