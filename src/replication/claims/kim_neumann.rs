//! Kim and Neumann 2001, *Opacity Shadow Maps*: `osm`.

use super::claim::{Claim, Finding, Paper};
use super::figures::Figures;
use super::rules::{EQUAL, Holds, at_least, at_most, exponent, falls, line};
use super::scenes::{AS_IS, BONES, CHEST, EVEN, FUR, LOCKS, OPAQUE, STRAIGHT, Variant};
use crate::error::{Error, Result};

/// Maps of Figure 4's range.
const SERIES: &str = "osm:layers=8,16,32,64,128,map=256";
const LAYERS: [f64; 5] = [8.0, 16.0, 32.0, 64.0, 128.0];
/// The three ways of slicing of Figure 3.
const SLICING: &str = "osm:layers=16,slicing=uniform,density,gamma,map=256";

fn claim(place: &'static str, claim: &str, claimed: &str) -> Claim {
    Claim::new(Paper::KimNeumann, place, claim, claimed)
}

pub fn claims() -> Vec<Claim> {
    [time_and_memory(), slicing(), accuracy()].into_iter().flatten().collect()
}

/// A figure of each of a series by its number of layers.
fn by_layers(series: &[&Figures], of: impl Fn(&Figures) -> Result<f64>) -> Result<Vec<(f64, f64)>> {
    LAYERS.into_iter().zip(series).map(|(n, f)| Ok((n, of(f)?))).collect()
}

fn no_fit() -> Error {
    Error::runtime("no line fits", "claims", "a figure is zero")
}

fn time_and_memory() -> Vec<Claim> {
    vec![
        claim("section 3, Figure 4", "The rendering time is linear in the number of the maps", "time = a + b N")
            .on(&[STRAIGHT, CHEST])
            .needs(AS_IS, SERIES)
            .judged(
                "Yes where build_ms grows with N to the power 0.8 to 1.2; partly where a line a + b N fits within 10 % \
                 and b N is a fifth of it or more at 128 maps.",
                |m| {
                    let points = by_layers(&m[0], Figures::build_ms)?;
                    let power = exponent(&points).ok_or_else(no_fit)?;
                    let fit = line(&points).ok_or_else(no_fit)?;
                    let share = 128.0 * fit.slope / (fit.start + 128.0 * fit.slope);
                    let holds = Holds::of(
                        (0.8..=1.2).contains(&power),
                        fit.residual <= 0.1 && share >= 0.2 && fit.slope > 0.0,
                    );
                    let figures = [
                        ("exponent", power),
                        ("a [ms]", fit.start),
                        ("b [ms a map]", fit.slope),
                        ("misfit", fit.residual),
                    ];
                    Ok(Finding::new(holds, figures).note(
                        "Here one march along each texel's ray makes all planes, where the paper draws the scene once \
                         a map: a is the march, b what a plane adds.",
                    ))
                },
            ),
        claim(
            "section 2",
            "The memory requirement is independent of the total number of opacity maps",
            "the same for any N",
        )
        .on(&[STRAIGHT])
        .needs(AS_IS, SERIES)
        .judged("Yes where 128 maps take at most 1.1 times the bytes of 8, partly up to 2 times.", |m| {
            let bytes = by_layers(&m[0], Figures::bytes)?;
            let growth = bytes[4].1 / bytes[0].1;
            let figures =
                [("bytes of 128 / of 8", growth), ("8 maps [bytes]", bytes[0].1), ("128 maps", bytes[4].1)];
            Ok(Finding::new(at_most(growth, 1.1, 2.0), figures).note(
                "The paper sorts its samples by depth and keeps two maps at a time; a ray caster asks for depths in any \
                 order, so that all maps are kept.",
            ))
        }),
        claim("section 4", "A tradeoff between speed and quality is achieved by varying the number of maps", "slower and closer with more maps")
            .on(&[STRAIGHT, CHEST])
            .needs(AS_IS, SERIES)
            .judged(
                "Yes where build_ms + frame_ms of 128 maps is 1.05 times that of 8 or more, and point_err_rms never rises from 8 to \
                 128 maps and falls as a whole; partly where one of the two is so.",
                |m| {
                    let ms: Vec<_> = m[0].iter().map(|f| f.moving_ms()).collect::<Result<_>>()?;
                    let errors: Vec<_> = m[0].iter().map(|f| f.point_rms()).collect::<Result<_>>()?;
                    let slower = Holds::of(ms[4] >= EQUAL * ms[0], false);
                    let closer = falls(&errors, (EQUAL - 1.0) * errors[0]);
                    let figures = [
                        ("point_err_rms, 8 maps", errors[0]),
                        ("128 maps", errors[4]),
                        ("time of 128 / of 8", ms[4] / ms[0]),
                    ];
                    Ok(Finding::new(Holds::all([slower, closer]), figures))
                },
            ),
        claim(
            "section 2",
            "The cost of shadows is linear in the number of shadow samples",
            "time proportional to samples",
        )
        .on(&[STRAIGHT])
        .needs_times(Variant::pixels(128), "osm:layers=32,map=256")
        .needs_times(AS_IS, "osm:layers=32,map=256")
        .needs_times(Variant::pixels(512), "osm:layers=32,map=256")
        .judged("Yes where frame_ms grows with the number of pixels to the power 0.85 to 1.15, partly from 0.6 to 1.4.", |m| {
            let of = |i: usize| {
                let row = &m[i][0].row;
                Ok((f64::from(row.width) * f64::from(row.height), m[i][0].frame_ms()?))
            };
            let points = (0..3).map(of).collect::<Result<Vec<_>>>()?;
            let power = exponent(&points).ok_or_else(no_fit)?;
            let holds = Holds::of((0.85..=1.15).contains(&power), (0.6..=1.4).contains(&power));
            let figures = [("exponent", power), ("frame at the least pixels [ms]", points[0].1), ("at the most", points[2].1)];
            Ok(Finding::new(holds, figures).note("Each eye ray has as many samples at any size; frame_ms holds the casting as well."))
        }),
        claim(
            "section 1",
            "Deep shadow maps require a significant amount of data initialization time, which can cancel out their benefit",
            "more than opacity shadow maps",
        )
        .on(&[STRAIGHT, CHEST])
        .needs(AS_IS, "dsm:epsilon=0.02,map=256;osm:layers=64,map=256")
        .judged("Yes where dsm takes twice as long to make as 64 maps or longer, partly from 1.05 times on.", |m| {
            let (dsm, osm) = (m[0][0].build_ms()?, m[0][1].build_ms()?);
            let figures = [("build_ms, dsm / osm", dsm / osm), ("dsm [ms]", dsm), ("64 maps [ms]", osm)];
            Ok(Finding::new(at_least(dsm / osm, 2.0), figures)
                .note("The paper means Lokovic and Veach's off-line maps; here both come from the same march."))
        }),
        claim("section 3", "About 4 opacity maps per second are computed", "4 maps/s on an SGI 540")
            .untried("A figure of a machine of 2001 and of drawn lines."),
    ]
}

fn slicing() -> Vec<Claim> {
    let better = |place, what, scenes: &'static [_], index: usize, name: &'static str, note: &'static str| {
        claim(place, what, "closer than uniform slicing at the same number of maps")
            .on(scenes)
            .needs(AS_IS, SLICING)
            .judged(
                "Yes where point_err_rms of uniform slicing is at least 1.1 times as large (16 maps), partly from 1.05 on.",
                move |m| {
                    let (uniform, other) = (m[0][0].point_rms()?, m[0][index].point_rms()?);
                    let figures =
                        [(format!("uniform / {name}"), uniform / other), ("uniform".into(), uniform), (name.into(), other)];
                    Ok(Finding::new(at_least(uniform / other, 1.1), figures).note(note))
                },
            )
    };
    vec![
        better(
            "section 2, Figure 3b",
            "Adaptive slicing (1D BSP) puts tighter spacing in denser regions",
            &[STRAIGHT, LOCKS, CHEST],
            1,
            "density",
            "Matter that no light reaches has its share of the planes.",
        ),
        better(
            "section 2, Figure 3c",
            "A nonlinear partition, tighter near the light, suits the ever-decreasing variations of shadow behind",
            &[STRAIGHT, LOCKS, CHEST],
            2,
            "gamma",
            "Planes lie close where the map's range begins, D_0; in a rounded volume few rays meet matter there.",
        ),
        claim(
            "section 2, Figure 3a",
            "Uniform slice spacing is reasonable for evenly distributed volumes",
            "no worse than the other two",
        )
        .on(&[EVEN])
        .needs(AS_IS, SLICING)
        .judged(
            "Yes where point_err_rms of uniform slicing is within 1.05 of the better of the other two, partly within 1.5.",
            |m| {
                let errors: Vec<_> = m[0].iter().map(|f| f.point_rms()).collect::<Result<_>>()?;
                let ratio = errors[0] / errors[1].min(errors[2]);
                let figures = [
                    ("uniform / best other", ratio),
                    ("uniform", errors[0]),
                    ("density", errors[1]),
                    ("gamma", errors[2]),
                ];
                Ok(Finding::new(at_most(ratio, EQUAL, 1.5), figures))
            },
        ),
    ]
}

fn accuracy() -> Vec<Claim> {
    vec![
        claim("section 2", "exp(-kappa) = 2^-d: kappa is about 5.56 for an 8-bit buffer", "5.56")
            .on(&[STRAIGHT])
            .needs(OPAQUE, "osm:layers=16,bits=8,map=256")
            .judged(
                "kappa is minus the logarithm of the least transmittance at any point seen in opaque matter; yes within \
                 1 %, partly within 5 %.",
                |m| {
                    let kappa = -m[0][0].darkest()?.ln();
                    let off = (kappa / 5.56 - 1.0).abs();
                    Ok(Finding::new(Holds::of(off <= 0.01, off <= 0.05), [("kappa", kappa)])
                        .note("8 ln 2 = 5.545: the paper's third digit is rounded up."))
                },
            ),
        claim(
            "Plate 3",
            "Artifacts are visible at brighter regions, but only with a relatively small number of maps (N = 6)",
            "N = 6 and N = 500",
        )
        .on(&[FUR])
        .needs(AS_IS, "osm:layers=6,500,map=128")
        .judged(
            "Yes where, at 6 maps, errors are larger where the exact transmittance is above 0.5 than below it (rms, 1.2 times), \
             and 500 maps leave a third of the bright error or less; partly where one of the two is so.",
            |m| {
                let bright = m[0][0].errors_where(|t| t > 0.5)?.rms;
                let dark = m[0][0].errors_where(|t| t <= 0.5)?.rms;
                let many = m[0][1].errors_where(|t| t > 0.5)?.rms;
                let (brighter, fewer) = (bright / dark >= 1.2, many <= bright / 3.0);
                let figures = [
                    ("6 maps, bright / dark", bright / dark),
                    ("6 maps, bright", bright),
                    ("6 maps, dark", dark),
                    ("500 maps, bright", many),
                ];
                Ok(Finding::new(Holds::of(brighter && fewer, brighter || fewer), figures))
            },
        ),
        claim(
            "section 2",
            "Step functions take a large number of maps; opaque objects are more efficiently integrated by adding a depth map",
            "a depth map instead of many maps",
        )
        .on(&[BONES])
        .needs(AS_IS, "osm:layers=16,64,128,map=256;dom:layers=3,map=256")
        .judged(
            "Yes where a start depth and 3 layers (dom) are as close (point_err_rms within 1.05) as 64 maps, partly as 16.",
            |m| {
                let errors: Vec<_> = m[0].iter().map(|f| f.point_rms()).collect::<Result<_>>()?;
                let holds = Holds::of(errors[3] <= EQUAL * errors[1], errors[3] <= EQUAL * errors[0]);
                let figures = [
                    ("depth map + 3 layers", errors[3]),
                    ("16 maps", errors[0]),
                    ("64 maps", errors[1]),
                    ("128 maps", errors[2]),
                ];
                Ok(Finding::new(holds, figures)
                    .note("dom is the method here that adds a depth map; its layers start at the opaque surface."))
            },
        ),
    ]
}
