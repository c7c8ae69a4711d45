//! Voicu 2011, *Real-time volumetric shadows for dynamic rendering*: `bom`.
//!
//! Its trees and grass are polygons; strands in locks and fur stand in for them, as scattered and as dense.

use super::claim::{Claim, Finding, Measured};
use super::rules::{EQUAL, Holds, at_least, at_most, within};
use super::scenes::AS_IS;
use super::splits::{self, LAYERS, TREES_AND_GRASS, claim};
use crate::error::Result;

/// Tables 6.1.1, 6.2.1 and 6.3.1, in this order; the last four choose their ratio.
const TABLES_6: &str = "osm:layers=4,8,16,32,map=256;dom:layers=4,8,16,32,map=256;bom:layers=4,8,16,32,map=256;bom:layers=4,8,16,32,split=auto,map=256";
/// Their frames a second on trees, grass and dense grass.
const OSM: [[f64; 3]; 4] =
    [[147.58, 137.53, 107.76], [124.85, 110.00, 79.91], [86.68, 73.87, 59.53], [53.80, 39.83, 36.58]];
const DOM: [[f64; 3]; 4] =
    [[112.10, 77.38, 70.53], [90.66, 60.56, 61.23], [63.96, 47.93, 41.85], [43.90, 29.45, 27.28]];
const BOM: [[f64; 3]; 4] =
    [[73.41, 61.18, 49.80], [67.53, 55.13, 43.61], [58.91, 46.96, 34.66], [41.88, 31.93, 26.80]];

pub fn claims() -> Vec<Claim> {
    [frame_rates(), pictures(), splits::claims(), other()].into_iter().flatten().collect()
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
        .note("The thesis draws the scene once for each depth map and for every 32 layers; here one march makes them all.")
}

/// Tables 6.x as ratios: between methods at each number of layers, and between numbers of layers.
fn frame_rates() -> Vec<Claim> {
    const RULE: &str = "Yes where the ratio of build_ms + frame_ms is within the range over the three scenes of the tables (and 15 %), \
        partly where it is on that side of 1 or as good as 1; never yes on the other side of 1 than the range.";
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
            let more =
                if range[0] > 1.0 { "more frames a second than" } else { "about as many frames a second as" };
            let what = format!("{} have {more} {} at {layers} layers", names[0], names[1]);
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
            "section 5.2.3",
            "A significant decrease in performance between the best and the worst frame rate, 4 and 32 layers",
            "50 % on average",
        )
        .on(TREES_AND_GRASS)
        .needs(AS_IS, TABLES_6)
        .judged(
            "Yes where the frames a second of bom (build_ms + frame_ms) fall by 35 to 65 %, partly from 10 % on.",
            |m| {
                let loss = 1.0 - m[0][8].moving_ms()? / m[0][11].moving_ms()?;
                let holds = Holds::of((0.35..=0.65).contains(&loss), loss >= 0.1);
                Ok(Finding::new(holds, [("loss [%]", 100.0 * loss)])
                    .note("The table there, 5.2.3.1, has 31 to 39 %, and Table 6.3.1 43 to 48 %."))
            },
        ),
    );
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
