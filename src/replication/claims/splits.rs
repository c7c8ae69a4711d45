//! Voicu 2011, how bounding opacity maps share out their layers: sections 5.2 and 7, tables 5.2.3.1 and A.11.

use super::claim::{Claim, Finding, Paper};
use super::figures::Figures;
use super::rules::{EQUAL, Holds, at_least, beside, falls, rises};
use super::scenes::{
    AS_IS, DENSER, FROM_ABOVE, FROM_THE_SIDE, FUR, LOCKS, SPARSE_FUR, SPARSER, SPARSEST_FUR, StandIn, Variant,
};
use crate::error::Result;

/// Numbers of layers of its tables.
pub(super) const LAYERS: [u32; 4] = [4, 8, 16, 32];
/// Table 5.2.3.1: correlation of neighbouring layers on trees, and on grass.
const CORRELATION: [[f64; 4]; 2] = [[0.66, 0.83, 0.92, 0.96], [0.72, 0.86, 0.93, 0.96]];
/// What stands in for trees, and for grass.
pub(super) const TREES_AND_GRASS: &[StandIn] = &[LOCKS, FUR];
/// Ratios chosen for few and many layers.
const CHOSEN: &str = "bom:layers=4,8,16,32,split=auto,map=256";
const CHOSEN_BY_BOTH: &str = "bom:layers=4,16,32,split=auto,measure=correlation,difference,map=256";

/// A claim of the thesis.
pub(super) fn claim(place: &'static str, claim: impl Into<String>, claimed: impl Into<String>) -> Claim {
    Claim::new(Paper::Voicu, place, claim, claimed)
}

pub(super) fn claims() -> Vec<Claim> {
    [ratio(), tables_a_11(), splits()].into_iter().flatten().collect()
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
            format!("Splitting becomes more logarithmic for denser objects ({measure}; extinction scaled)"),
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
                Ok(Finding::new(rises(&series, 0.05), figures)
                    .note("A correlation does not see a common factor: only what saturates changes it."))
            },
        )
    };
    let thinned = |index: usize, measure: &str| {
        claim(
            "section 5.2.3, Figure 5.2.3.5",
            format!("Sparser objects map better to linear splitting ({measure}; strands thinned out)"),
            "the ratio rises with density",
        )
        .on(&[FUR])
        .needs_structure(Variant::instead(&SPARSEST_FUR), DENSITIES)
        .needs_structure(Variant::instead(&SPARSE_FUR), DENSITIES)
        .needs_structure(AS_IS, DENSITIES)
        .judged(
            "Yes where the ratio chosen for 16 layers never falls from the sparsest to the full fur, and rises by more than 0.05; partly \
             where only the whole rises.",
            move |m| {
                let series: Vec<f64> = m.iter().map(|f| Ok(f[index].chosen()?.ratio)).collect::<Result<_>>()?;
                let figures = [("ratio, sparsest", series[0]), ("sparse", series[1]), ("full", series[2])];
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
        thinned(0, "correlation"),
        thinned(1, "sum of absolute differences"),
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
