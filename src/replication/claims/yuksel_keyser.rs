//! Yuksel and Keyser 2008, *Deep Opacity Maps*: `dom`.
//!
//! The paper states no layer sizes but that they grow. Where it speaks of 3 layers, four values of `spread` are tried and the
//! one whose picture is closest is taken, since its authors chose theirs by eye.

use super::claim::{Claim, Finding, Measured, Paper};
use super::figures::Figures;
use super::rules::{EQUAL, Holds, at_least, at_most};
use super::scenes::{AS_IS, CURLY, LOCKS, STRAIGHT, StandIn};
use crate::error::Result;

/// Three layers of several sizes, then slices.
const THREE_AND_SLICES: &str =
    "dom:layers=3,spread=0.125,0.25,0.5,1,map=256;osm:layers=8,16,32,64,128,256,map=256";
/// Among them, the first slices.
const FIRST_SLICES: usize = 4;
const SLICES: [f64; 6] = [8.0, 16.0, 32.0, 64.0, 128.0, 256.0];
const FIGURES_1_AND_5: &[StandIn] = &[STRAIGHT, CURLY];
/// Points that light reaches as good as unhindered.
const LIT: f64 = 0.95;

fn claim(place: &'static str, claim: &str, claimed: &str) -> Claim {
    Claim::new(Paper::YukselKeyser, place, claim, claimed)
}

pub fn claims() -> Vec<Claim> {
    [three_layers(), cost(), clustering(), layers_and_depths(), locks()].into_iter().flatten().collect()
}

/// The one whose picture is closest.
fn closest<'a>(among: &[&'a Figures]) -> Result<&'a Figures> {
    let mut best = among[0];
    for f in among {
        if f.image_rmse()? < best.image_rmse()? {
            best = f;
        }
    }
    Ok(best)
}

/// Three layers at their best, and so many slices.
fn three_and<'a>(all: &[&'a Figures], slices: f64) -> Result<(&'a Figures, &'a Figures)> {
    let place = SLICES.iter().position(|n| *n == slices).unwrap_or(0);
    Ok((closest(&all[..FIRST_SLICES])?, all[FIRST_SLICES + place]))
}

fn taken(dom: &Figures) -> String {
    let spread = dom.name.split_whitespace().find_map(|s| s.strip_prefix("spread=")).unwrap_or("1");
    format!("Three layers over {spread} of the depth, the best of 1/8, 1/4, 1/2 and 1.")
}

fn three_layers() -> Vec<Claim> {
    type Error = fn(&Figures) -> Result<f64>;
    let against = |place, what, claimed, scenes, slices: f64, error: Error, rule| {
        claim(place, what, claimed).on(scenes).needs(AS_IS, THREE_AND_SLICES).judged(rule, move |m| {
            let (dom, osm) = three_and(&m[0], slices)?;
            let ratio = error(dom)? / error(osm)?;
            let figures = [
                (format!("3 layers / {slices} slices"), ratio),
                ("3 layers".into(), error(dom)?),
                (format!("{slices} slices"), error(osm)?),
            ];
            Ok(Finding::new(at_most(ratio, EQUAL, 2.0), figures).note(taken(dom)))
        })
    };
    vec![
        against(
            "Figure 1, section 4",
            "3 layers give an artifact-free picture, where 128 slices of opacity shadow maps still have visible layers",
            "3 layers as good as 128 slices (picture)",
            FIGURES_1_AND_5,
            128.0,
            Figures::image_rmse,
            "Yes where image_rmse of 3 layers is within 1.05 of that of 128 slices, partly up to twice that.",
        ),
        against(
            "Figure 1, section 4",
            "3 layers give better shadows than 128 slices",
            "3 layers as good as 128 slices (light at points seen)",
            FIGURES_1_AND_5,
            128.0,
            Figures::point_rms,
            "Yes where point_err_rms of 3 layers is within 1.05 of that of 128 slices, partly up to twice that.",
        ),
        against(
            "Figure 1, section 4",
            "16 slices have severe artifacts, 3 layers have none",
            "3 layers better than 16 slices",
            &[STRAIGHT],
            16.0,
            Figures::image_rmse,
            "Yes where image_rmse of 3 layers is within 1.05 of that of 16 slices, partly up to twice that.",
        ),
        against(
            "Figures 3 and 5, section 4",
            "8 slices have dark stripes, 3 layers have none",
            "3 layers better than 8 slices",
            &[CURLY],
            8.0,
            Figures::image_rmse,
            "Yes where image_rmse of 3 layers is within 1.05 of that of 8 slices, partly up to twice that.",
        ),
        claim(
            "section 4",
            "With 256 slices layering artifacts visually disappear and the shadows approach the correct values",
            "256 slices against 8",
        )
        .on(FIGURES_1_AND_5)
        .needs(AS_IS, THREE_AND_SLICES)
        .judged("Yes where 256 slices leave a tenth of the point_err_rms of 8 or less, partly a third.", |m| {
            let (few, many) = (m[0][FIRST_SLICES].point_rms()?, m[0][FIRST_SLICES + 5].point_rms()?);
            let figures = [("256 slices / 8", many / few), ("256 slices", many), ("8 slices", few)];
            Ok(Finding::new(at_most(many / few, 0.1, 1.0 / 3.0), figures))
        }),
        claim(
            "section 1",
            "The direct illumination that is not shadowed is captured correctly, unlike with opacity shadow maps",
            "guaranteed",
        )
        .on(FIGURES_1_AND_5)
        .needs(AS_IS, THREE_AND_SLICES)
        .judged(
            "At points seen whose exact transmittance is 0.95 or more: yes where the rms error of 3 layers is at most 0.02 and at most half \
             that of 16 slices, partly where it is smaller by 1.05 times or more.",
            |m| {
                let (dom, osm) = three_and(&m[0], 16.0)?;
                let (three, sixteen) = (dom.errors_where(|t| t >= LIT)?.rms, osm.errors_where(|t| t >= LIT)?.rms);
                let half = three <= 0.5 * sixteen;
                let figures = [("lit points, 3 layers", three), ("16 slices", sixteen)];
                Ok(Finding::new(Holds::of(three <= 0.02 && half, EQUAL * three <= sixteen), figures).note(taken(dom)))
            },
        ),
    ]
}

fn cost() -> Vec<Claim> {
    vec![
        claim(
            "section 1, abstract",
            "Far fewer layers are necessary for high-quality shadows than slices of opacity shadow maps",
            "far fewer",
        )
        .on(FIGURES_1_AND_5)
        .needs(AS_IS, THREE_AND_SLICES)
        .judged(
            "The fewest of 8 to 256 slices whose picture is as close as that of 3 layers: yes where they are 4 times as many as 3 or more, \
             or where 256 are not as close.",
            |m| {
                let (dom, _) = three_and(&m[0], 8.0)?;
                let mut needed = f64::INFINITY;
                for (slices, osm) in SLICES.iter().zip(&m[0][FIRST_SLICES..]).rev() {
                    if osm.image_rmse()? > dom.image_rmse()? {
                        break;
                    }
                    needed = *slices;
                }
                let eight_do = needed <= SLICES[0];
                let holds = if eight_do { Holds::No } else { at_least(needed / 3.0, 4.0) };
                let figures =
                    [("slices / layers", needed / 3.0), ("slices needed", needed), ("image_rmse, 3 layers", dom.image_rmse()?)];
                let note = if eight_do { "8 slices, the fewest tried, are as close already. " } else { "" };
                Ok(Finding::new(holds, figures).note(format!("{note}{}", taken(dom))))
            },
        ),
        claim("section 4", "Significantly higher frame rates than 256 slices", "about two seconds a frame with 256 slices")
            .on(FIGURES_1_AND_5)
            .needs(AS_IS, THREE_AND_SLICES)
            .judged(
                "Yes where build_ms + frame_ms of 256 slices is 1.5 times that of 3 layers or more, partly from 1.05 on.",
                |m| {
                    let (dom, osm) = three_and(&m[0], 256.0)?;
                    let (three, many) = (dom.moving_ms()?, osm.moving_ms()?);
                    let figures = [("256 slices / 3 layers", many / three), ("256 slices [ms]", many), ("3 layers [ms]", three)];
                    Ok(Finding::new(at_least(many / three, 1.5), figures)
                        .note("Here one march makes all slices, where the paper draws the hair once for each 16 of them."))
                },
            ),
        claim("sections 4 and 5", "Less memory consumption: all information in a single texture for 3 layers", "less than 128 slices")
            .on(FIGURES_1_AND_5)
            .needs(AS_IS, THREE_AND_SLICES)
            .judged("Yes where 128 slices take twice the bytes of 3 layers or more, partly from 1.05 times on.", |m| {
                let (dom, osm) = three_and(&m[0], 128.0)?;
                let (three, many) = (dom.bytes()?, osm.bytes()?);
                let figures = [("128 slices / 3 layers", many / three), ("128 slices [bytes]", many), ("3 layers [bytes]", three)];
                Ok(Finding::new(at_least(many / three, 2.0), figures))
            }),
        claim("section 3", "More than three layers require multiple texture lookups during final rendering", "slower frames")
            .on(&[STRAIGHT])
            .needs(AS_IS, "dom:layers=3,15,map=256")
            .judged("Yes where a frame with 15 layers takes 1.05 times as long as with 3 or longer.", |m| {
                let (three, many) = (m[0][0].frame_ms()?, m[0][1].frame_ms()?);
                let figures = [("frame_ms, 15 layers / 3", many / three), ("15 layers [ms]", many), ("3 layers [ms]", three)];
                Ok(Finding::new(at_least(many / three, EQUAL), figures)
                    .note("A texel's layers lie side by side here, and a lookup reads the two around a depth, however many there are."))
            }),
    ]
}

/// Against density clustering (Mertens et al. 2004), with the four clusters that both papers have.
fn clustering() -> Vec<Claim> {
    const METHODS: &str = "dom:layers=3,spread=0.125,0.25,0.5,1,map=256;clusters:clusters=4,map=256";
    type Figure = fn(&Figures) -> Result<f64>;
    let against = |place, what, claimed, name: &'static str, figure: Figure, rule| {
        claim(place, what, claimed).on(FIGURES_1_AND_5).needs(AS_IS, METHODS).judged(rule, move |m| {
            let (dom, clusters) = (closest(&m[0][..FIRST_SLICES])?, m[0][FIRST_SLICES]);
            let (layers, clusters) = (figure(dom)?, figure(clusters)?);
            let figures = [
                (format!("{name}, 3 layers / 4 clusters"), layers / clusters),
                ("3 layers".into(), layers),
                ("4 clusters".into(), clusters),
            ];
            // Two errors of 0 are equal.
            let ratio = if layers == clusters { 1.0 } else { layers / clusters };
            Ok(Finding::new(at_most(ratio, 1.0 / EQUAL, EQUAL), figures).note(taken(dom)))
        })
    };
    vec![
        against(
            "Figures 1, 3 and 5",
            "Significantly higher frame rates than density clustering",
            "faster than 4 clusters",
            "build and frame [ms]",
            Figures::moving_ms,
            "Yes where building and drawing take less than with 4 clusters by 1.05 times, partly where they are within that.",
        ),
        against(
            "Figures 1, 3 and 5",
            "Less noise than density clustering at comparable quality",
            "closer than 4 clusters (picture)",
            "image_rmse",
            Figures::image_rmse,
            "Yes where image_rmse is smaller than with 4 clusters by 1.05 times, partly where it is within that.",
        ),
        against(
            "section 4",
            "Less memory than density clustering",
            "fewer bytes than 4 clusters",
            "bytes",
            Figures::bytes,
            "Yes where the map takes fewer bytes than with 4 clusters by 1.05 times, partly where they are within that.",
        ),
        against(
            "section 2",
            "Density clustering cannot guarantee that light which is not shadowed is captured correctly, deep opacity maps do",
            "closer at lit points",
            "lit points, point_err_rms",
            |f| Ok(f.errors_where(|t| t >= LIT)?.rms),
            "At points seen whose exact transmittance is 0.95 or more: yes where the rms error is smaller than with 4 clusters by \
             1.05 times, partly where it is within that.",
        ),
    ]
}

fn layers_and_depths() -> Vec<Claim> {
    vec![
        claim("section 2", "Usually 3 layers are sufficient", "3 layers")
            .on(FIGURES_1_AND_5)
            .needs(AS_IS, "dom:layers=3,spread=0.125,0.25,0.5,1,map=256;dom:layers=15,spread=0.25,0.5,1,map=256")
            .judged("Yes where image_rmse of 3 layers is within 1.25 of that of 15, partly within 2, each over its best share of the depth.", |m| {
                let (three, many) = (closest(&m[0][..4])?.image_rmse()?, closest(&m[0][4..])?.image_rmse()?);
                let figures = [("3 layers / 15", three / many), ("3 layers", three), ("15 layers", many)];
                Ok(Finding::new(at_most(three / many, 1.25, 2.0), figures))
            }),
        claim("section 3", "An 8-bit depth map visually performs the same as a 16-bit one", "the same picture")
            .on(FIGURES_1_AND_5)
            .needs(AS_IS, "dom:layers=3,spread=0.5,depth_bits=8,16,map=256")
            .judged(
                "Yes where the two pictures are alike to a structural similarity of 0.99 or more, partly where their image_rmse against the \
                 exact one is within 1.1 of each other.",
                |m| {
                    let alike = m[0][0].similarity(m[0][1])?;
                    let ratio = m[0][0].image_rmse()? / m[0][1].image_rmse()?;
                    let holds = Holds::of(alike >= 0.99, (1.0 / 1.1..=1.1).contains(&ratio));
                    let figures = [
                        ("similarity of the pictures", alike),
                        ("image_rmse, 8 bits / 16", ratio),
                        ("point_err_rms, 8 bits / 16", m[0][0].point_rms()? / m[0][1].point_rms()?),
                    ];
                    Ok(Finding::new(holds, figures).note("16 bits are steps of the map's range here, a float there."))
                },
            ),
        claim(
            "section 3",
            "Mapping points beyond the last layer onto it usually gives reasonable results; leaving them out, or layers that reach behind all, do less",
            "the best of three ways",
        )
        .on(FIGURES_1_AND_5)
        .needs(AS_IS, "dom:layers=3,spread=0.25,beyond=extend,ignore,map=256;dom:layers=3,beyond=cover,map=256")
        .judged(
            "Yes where image_rmse of the first way is within 1.05 of the better of the other two (layers over a quarter of the depth), \
             partly where it is better than one of them.",
            |m| {
                let errors: Vec<_> = m[0].iter().map(|f| f.image_rmse()).collect::<Result<_>>()?;
                let (least, most) = (errors[1].min(errors[2]), errors[1].max(errors[2]));
                let figures = [("in the last layer", errors[0]), ("left out", errors[1]), ("layers behind all", errors[2])];
                Ok(Finding::new(Holds::of(errors[0] <= EQUAL * least, errors[0] <= most), figures))
            },
        ),
        claim(
            "section 5",
            "Linearly increasing layer sizes provide high accuracy around bright regions, where transmittance begins to decay",
            "closer than equal sizes",
        )
        .on(FIGURES_1_AND_5)
        .needs(AS_IS, "dom:layers=7,spread=0.5,split=growing,linear,map=256")
        .judged(
            "At points seen whose exact transmittance is above 0.5: yes where layers of equal size over the same depth have 1.1 times the \
             rms error or more, partly from 1.05 on.",
            |m| {
                let bright = |f: &Figures| f.errors_where(|t| t > 0.5).map(|errors| errors.rms);
                let (growing, equal) = (bright(m[0][0])?, bright(m[0][1])?);
                let figures = [
                    ("bright points, equal / growing", equal / growing),
                    ("growing", growing),
                    ("equal", equal),
                    ("point_err_rms of all, equal / growing", m[0][1].point_rms()? / m[0][0].point_rms()?),
                ];
                Ok(Finding::new(at_least(equal / growing, 1.1), figures))
            },
        ),
        claim(
            "section 5",
            "Varying layer sizes would not provide any visual enhancement for opacity shadow maps",
            "no better than equal slices",
        )
        .on(FIGURES_1_AND_5)
        .needs(AS_IS, "osm:layers=16,slicing=uniform,density,gamma,map=256")
        .judged("Yes where image_rmse of the better of density and gamma is at least 0.95 of that of equal slices, partly 0.8.", |m| {
            let errors: Vec<_> = m[0].iter().map(|f| f.image_rmse()).collect::<Result<_>>()?;
            let ratio = errors[1].min(errors[2]) / errors[0];
            let figures = [("best / equal", ratio), ("equal", errors[0]), ("density", errors[1]), ("gamma", errors[2])];
            Ok(Finding::new(Holds::of(ratio >= 0.95, ratio >= 0.8), figures))
        }),
        claim(
            "section 5",
            "A smoothing filter on the depth and opacity maps reduces aliasing but does not remove it",
            "less, not none",
        )
        .on(FIGURES_1_AND_5)
        .needs(AS_IS, "dom:layers=3,spread=0.5,filter=nearest,bilinear,map=256")
        .judged("Yes where point_err_rms of the nearest texel is 1.05 times that of four or more, and four leave an error.", |m| {
            let (nearest, four) = (m[0][0].point_rms()?, m[0][1].point_rms()?);
            let figures = [("nearest / four texels", nearest / four), ("nearest", nearest), ("four", four)];
            Ok(Finding::new(Holds::of(nearest >= EQUAL * four && four > 0.0, false), figures)
                .note("Bilinear interpolation stands in for the smoothing; flicker in motion is not measured."))
        }),
    ]
}

/// Figure 8. A first layer of the same size: `d_1 = d_K 2 / (K (K + 1))`, so that 7 layers reach 28 / 6 as deep as 3.
fn locks() -> Vec<Claim> {
    const LAYERS: &str =
        "dom:layers=3,spread=0.15,map=256;dom:layers=7,spread=0.7,map=256;dom:layers=3,spread=0.7,map=256";
    let darkness = |f: &Figures| f.row.point_err_mean_signed.map_or(f64::NAN, |mean| -mean);
    let eliminated = move |index: usize, name: &'static str| {
        move |m: &Measured| {
            let (few, more) = (darkness(m[0][0]), darkness(m[0][index]));
            let figures = [
                ("too dark by, 3 layers", few),
                (name, more),
                ("point_err_rms, 3 layers", m[0][0].point_rms()?),
                (name, m[0][index].point_rms()?),
            ];
            let holds = Holds::of(few > 0.0 && more.abs() <= 0.5 * few, few > 0.0 && more * EQUAL <= few);
            Ok(Finding::new(holds, figures))
        }
    };
    const RULE: &str = "Yes where 3 layers are too dark in the mean over points seen (they reach 0.15 of the depth) and the other is off by \
        half as much or less, partly where it is less dark.";
    vec![
        claim("Figure 8b", "3 layers do not cover clustered strands, which then shadow themselves; 7 layers eliminate it", "7 layers against 3")
            .on(&[LOCKS])
            .needs(AS_IS, LAYERS)
            .judged(RULE, eliminated(1, "7 layers")),
        claim("Figure 8c", "Larger layers eliminate it as well", "3 larger layers against 3")
            .on(&[LOCKS])
            .needs(AS_IS, LAYERS)
            .judged(RULE, eliminated(2, "3 larger layers")),
        claim("Figure 8c", "Larger layers also reduce the accuracy of shadows", "3 larger layers against 7")
            .on(&[LOCKS])
            .needs(AS_IS, LAYERS)
            .judged("Yes where 3 layers have 1.1 times the point_err_rms of 7 that reach as deep (0.7) or more, partly from 1.05 on.", |m| {
                let (seven, three) = (m[0][1].point_rms()?, m[0][2].point_rms()?);
                let figures = [("3 larger layers / 7", three / seven), ("3 larger layers", three), ("7 layers", seven)];
                Ok(Finding::new(at_least(three / seven, 1.1), figures))
            }),
    ]
}
