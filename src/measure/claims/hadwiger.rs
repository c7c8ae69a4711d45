//! Hadwiger, Kratz, Sigg and Bühler 2006, *GPU-Accelerated Deep Shadow Maps for Direct Volume Rendering*: `dsm`.

use super::claim::{Claim, Finding, Paper};
use super::figures::Figures;
use super::rules::{EQUAL, Holds, at_least, at_most, exponent, within};
use super::scenes::{AS_IS, BONES, CHEST, NO_SKIPPING, STRAIGHT};
use crate::error::{Error, Result};
use crate::shadow::TILE;

/// Table 1: two error bounds by three maps.
const TABLE_1: &str = "dsm:epsilon=0.02,0.06,map=128,256,512";
const EPSILONS: [f64; 2] = [0.02, 0.06];
const MAPS: [u32; 3] = [128, 256, 512];
/// Its frames a second, slowest and fastest.
const FPS: [[[f64; 2]; 3]; 2] = [[[2.0, 3.0], [1.0, 2.0], [0.3, 0.5]], [[5.0, 6.0], [2.0, 3.0], [1.0, 1.5]]];
/// Points that light reaches as good as unhindered.
const LIT: f64 = 0.95;

fn claim(place: &'static str, claim: impl Into<String>, claimed: impl Into<String>) -> Claim {
    Claim::new(Paper::Hadwiger, place, claim, claimed)
}

pub fn claims() -> Vec<Claim> {
    [table_1(), nodes(), precompression(), prefilter(), rendering()].into_iter().flatten().collect()
}

/// What two ranges of frame rates leave for the ratio of the first to the second.
fn ratio_range(faster: [f64; 2], slower: [f64; 2]) -> [f64; 2] {
    [faster[0] / slower[1], faster[1] / slower[0]]
}

/// Table 1 as ratios between its rows and columns.
fn table_1() -> Vec<Claim> {
    let cells = |cheap: [usize; 2], dear: [usize; 2], what: String, note: &'static str| {
        let range = ratio_range(FPS[cheap[0]][cheap[1]], FPS[dear[0]][dear[1]]);
        claim("Table 1", what, format!("{:.2} to {:.2} times the time", range[0], range[1]))
            .on(&[CHEST])
            .needs(AS_IS, TABLE_1)
            .judged(
                "Yes where the ratio of build_ms is within the range that the table's figures leave (and 15 %), partly where it \
                 is on that side of 1.",
                move |m| {
                    let ms = |[epsilon, map]: [usize; 2]| m[0][3 * epsilon + map].build_ms();
                    let (cheap, dear) = (ms(cheap)?, ms(dear)?);
                    let figures = [("ratio", dear / cheap), ("dearer [ms]", dear), ("cheaper [ms]", cheap)];
                    Ok(Finding::new(within(dear / cheap, range), figures).note(note))
                },
            )
    };
    let mut claims = Vec::new();
    for (e, epsilon) in EPSILONS.iter().enumerate() {
        for m in 0..2 {
            let what = format!(
                "Map construction at epsilon {epsilon}: {} texels a side take longer than {}",
                MAPS[m + 1],
                MAPS[m]
            );
            claims.push(cells([e, m], [e, m + 1], what, "Four times the texels."));
        }
    }
    for (m, map) in MAPS.iter().enumerate() {
        let what = format!("Map construction at {map} x {map}: epsilon 0.02 takes longer than 0.06");
        claims.push(cells(
            [1, m],
            [0, m],
            what,
            "The march is the same at any epsilon, and here it is one pass however many nodes.",
        ));
    }
    claims
}

fn nodes() -> Vec<Claim> {
    vec![
        claim("Table 1, caption", "A larger epsilon decreases the resulting number of nodes", "fewer nodes")
            .on(&[CHEST, STRAIGHT])
            .needs(AS_IS, TABLE_1)
            .judged("Yes where epsilon 0.02 has at least 1.2 times the nodes of 0.06 at 512 texels a side, partly from 1.05 on.", |m| {
                let (tight, loose) = (m[0][2].nodes_total()?, m[0][5].nodes_total()?);
                let figures = [("nodes, 0.02 / 0.06", tight / loose), ("0.02", tight), ("0.06", loose)];
                Ok(Finding::new(at_least(tight / loose, 1.2), figures))
            }),
        claim(
            "section 4",
            "A major performance factor is the number of nodes in the compressed visibility function",
            "time follows nodes",
        )
        .on(&[CHEST])
        .needs(AS_IS, "dsm:epsilon=0.002,0.02,0.06,0.2,map=256")
        .judged("Yes where build_ms grows with the number of nodes to the power 0.5 or more, partly from 0.1 on.", |m| {
            let points: Vec<_> =
                m[0].iter().map(|f| Ok((f.nodes_total()?, f.build_ms()?))).collect::<Result<_>>()?;
            let none = || Error::runtime("no power fits", "claims", "every epsilon has as many nodes");
            let power = exponent(&points).ok_or_else(none)?;
            let last = points[points.len() - 1];
            let figures = [
                ("exponent", power),
                ("most nodes / least", points[0].0 / last.0),
                ("its time / least", points[0].1 / last.1),
            ];
            Ok(Finding::new(Holds::of(power >= 0.5, power >= 0.1), figures).note(
                "The paper's passes of eight nodes resume the march and copy what they made; here one pass marches each ray \
                 once, and a node costs a store.",
            ))
        }),
        claim(
            "Figure 5",
            "Many tiles require only a small number of nodes, depending on epsilon",
            "a small number in many tiles",
        )
        .on(&[CHEST, BONES])
        .needs(AS_IS, "dsm:epsilon=0.02,0.06,map=256")
        .judged(
            "Yes where at least half of all tiles (none stored counts as few) need at most a quarter of the nodes of the fullest \
             tile at both epsilons, partly at one or where a quarter of them do.",
            |m| {
                let shares: Vec<_> = m[0].iter().map(|f| share_of_small_tiles(f)).collect::<Result<_>>()?;
                let holds = Holds::of(shares.iter().all(|s| *s >= 0.5), shares.iter().any(|s| *s >= 0.25));
                let figures = [("share of tiles, epsilon 0.02", shares[0]), ("0.06", shares[1])];
                Ok(Finding::new(holds, figures).note(format!("Tiles of {TILE} x {TILE} texels, as there.")))
            },
        ),
        claim(
            "section 3",
            "A direct mapping of nodes into a 3D texture has a significant memory overhead: as many layers as the longest sequence",
            "more than blocks by tile",
        )
        .on(&[CHEST, STRAIGHT])
        .needs(AS_IS, "dsm:epsilon=0.02,map=256")
        .judged("Yes where the longest sequence in every texel takes twice the bytes of the tiled map or more, partly from 1.05 on.", |m| {
            let figures = m[0][0];
            let longest = figures.row.nodes_max.map(|n| n as f64);
            let direct = 4.0 * 256.0 * 256.0 * longest.unwrap_or(f64::NAN);
            let tiled = figures.bytes()?;
            let list = [("direct / tiled", direct / tiled), ("direct [bytes]", direct), ("tiled [bytes]", tiled)];
            Ok(Finding::new(at_least(direct / tiled, 2.0), list).note("Nodes of 4 bytes in both."))
        }),
        claim("sections 3 and 3.3", "The visibility function is captured within a specified accuracy", "error within epsilon")
            .on(&[CHEST, BONES, STRAIGHT])
            .needs(AS_IS, "dsm:epsilon=0.06,0.02,0.005,map=256")
            .judged(
                "Yes where the promise of docs/methods.md (epsilon and stated small terms, within a hair's breadth of depth) held at \
                 every depth of every light ray tested, partly where it did for one epsilon.",
                move |m| {
                    let errors: Vec<_> = m[0].iter().map(|f| f.ray_max()).collect::<Result<_>>()?;
                    let held = m[0].iter().filter(|f| f.row.bound_held == Some(true)).count();
                    let figures = [
                        ("promises kept of 3", held as f64),
                        ("ray_err_max, epsilon 0.06", errors[0]),
                        ("0.02", errors[1]),
                        ("0.005", errors[2]),
                    ];
                    Ok(Finding::new(Holds::of(held == 3, held > 0), figures)
                        .note("ray_err_max has no tolerance in depth: at an opaque surface it may be 1 where the promise is kept."))
                },
            ),
        claim(
            "sections 1 and 2",
            "Opacity shadow maps sample regularly and store without compression: deep shadow maps take less memory",
            "less memory for the same accuracy",
        )
        .on(&[CHEST, STRAIGHT])
        .needs(AS_IS, "dsm:epsilon=0.02,map=256;osm:layers=8,16,32,64,128,256,map=256")
        .judged(
            "The fewest of 8 to 256 maps of osm that are as close on light rays (ray_err_max): yes where they take twice the bytes \
             of dsm (epsilon 0.02) or more, or where even 256 are not as close; partly from 1.05 times on.",
            |m| {
                let (dsm, maps) = (m[0][0], &m[0][1..]);
                let mut enough = None;
                for f in maps {
                    if enough.is_none() && f.ray_max()? <= dsm.ray_max()? {
                        enough = Some(f);
                    }
                }
                let most = maps[maps.len() - 1];
                let osm = enough.unwrap_or(&most);
                let ratio = osm.bytes()? / dsm.bytes()?;
                let holds = if enough.is_some() { at_least(ratio, 2.0) } else { Holds::Yes };
                let figures = [
                    ("bytes, osm / dsm", ratio),
                    ("ray_err_max, dsm", dsm.ray_max()?),
                    ("osm", osm.ray_max()?),
                ];
                let name = osm.name.replace("slicing=uniform", "");
                let note = match enough {
                    Some(_) => format!("Enough: {}.", name.trim()),
                    None => "256 maps are not as close.".into(),
                };
                Ok(Finding::new(holds, figures).note(note))
            },
        ),
        claim(
            "section 2",
            "Shadow information on a regular 3D grid consumes much memory even for medium quality",
            "more than deep shadow maps",
        )
        .on(&[CHEST, STRAIGHT])
        .needs(AS_IS, "dsm:epsilon=0.02,map=256;lightvolume:scale=2,1,bits=8")
        .judged(
            "A light at every second voxel is medium quality: yes where the lattice takes more bytes than the deep shadow map and \
             is further from the exact light, partly where it does one of both.",
            move |m| {
                let (dsm, medium) = (m[0][0], m[0][1]);
                let (bytes, error) = (medium.bytes()? / dsm.bytes()?, medium.point_rms()? / dsm.point_rms()?);
                let figures = [
                    ("bytes, every second voxel / dsm", bytes),
                    ("every voxel / dsm", m[0][2].bytes()? / dsm.bytes()?),
                    ("point_err_rms, every second voxel / dsm", error),
                ];
                Ok(Finding::new(Holds::of(bytes > 1.0 && error > 1.0, bytes > 1.0 || error > 1.0), figures))
            },
        ),
    ]
}

/// Share of a map's tiles whose fullest texel has at most a quarter of the nodes of the fullest of all.
fn share_of_small_tiles(figures: &Figures) -> Result<f64> {
    let none = || Error::runtime("no nodes", &figures.name, "the map was not counted");
    let most = figures.nodes.as_ref().ok_or_else(none)?.most_by_tile();
    let fullest = most.iter().copied().max().unwrap_or(0);
    let small = most.iter().filter(|n| 4 * **n <= fullest).count();
    Ok(small as f64 / most.len().max(1) as f64)
}

fn precompression() -> Vec<Claim> {
    const STEPS: &str = "dsm:precompress=table,map=256;dsm:precompress=off,step=1,0.5,0.25,0.125,map=256";
    let lit = |f: &Figures| Ok::<f64, Error>(f.errors_where(|t| t >= LIT)?.rms);
    vec![
        claim(
            "section 3.2, Figures 3 and 6",
            "Equidistant samples of isosurface discontinuities result in erroneous self-shadowing, which pre-computed nodes remove",
            "with against without, same samples",
        )
        .on(&[BONES])
        .needs(AS_IS, "dsm:precompress=table,off,map=256")
        .judged(
            "Yes where the rms error at points seen that the light reaches (exact transmittance 0.95 or more) is at least twice as \
             large without the table, partly from 1.05 on.",
            move |m| {
                let (table, off) = (lit(m[0][0])?, lit(m[0][1])?);
                let figures = [
                    ("off / table".to_owned(), off / table),
                    ("lit points, table".into(), table),
                    ("off".into(), off),
                    ("nodes, off / table".into(), m[0][1].nodes_total()? / m[0][0].nodes_total()?),
                ];
                Ok(Finding::new(at_least(off / table, 2.0), figures)
                    .note("Without: half a voxel between samples. With the table every cell is taken whole, not at a step."))
            },
        ),
        claim(
            "section 3.2",
            "The required number of nodes is much smaller than a high number of equidistant samples for similar results",
            "fewer",
        )
        .on(&[BONES, CHEST])
        .needs(AS_IS, STEPS)
        .judged(
            "The longest of four steps (1 to 1/8 voxel) whose point_err_rms is within 1.1 of the table's: yes where the map then takes \
             twice as long to make or longer, or where none of them is as close; partly from 1.05 times on.",
            |m| {
                let (table, sampled) = (m[0][0], &m[0][1..]);
                let limit = 1.1 * table.point_rms()?;
                let mut enough = None;
                for (step, f) in [1.0, 0.5, 0.25, 0.125].into_iter().zip(sampled) {
                    if enough.is_none() && f.point_rms()? <= limit {
                        enough = Some((step, f));
                    }
                }
                let (step, f) = enough.unwrap_or((0.125, &sampled[3]));
                let ratio = f.build_ms()? / table.build_ms()?;
                let holds = if enough.is_some() { at_least(ratio, 2.0) } else { Holds::Yes };
                let figures = [
                    ("build_ms, sampled / table", ratio),
                    ("step [voxels]", step),
                    ("point_err_rms, table", table.point_rms()?),
                    ("sampled", f.point_rms()?),
                ];
                let note = if enough.is_some() { "" } else { "Not even an eighth of a voxel is as close." };
                Ok(Finding::new(holds, figures).note(note))
            },
        ),
        claim(
            "section 3.2",
            "The table decouples the sampling rate from the frequencies in the transfer function",
            "a longer step costs no accuracy",
        )
        .on(&[BONES])
        .needs(AS_IS, "dsm:precompress=table,prefilter=5,step=0.5,2,map=128;dsm:precompress=off,prefilter=5,step=0.5,2,map=128")
        .judged(
            "Yes where, from a step of half a voxel to 2, point_err_rms grows by at most 1.1 with the table and by 1.5 or more without; \
             partly where it grows less with the table than without.",
            |m| {
                let grows = |i: usize| Ok::<f64, Error>(m[0][i + 1].point_rms()? / m[0][i].point_rms()?);
                let (table, off) = (grows(0)?, grows(2)?);
                let figures = [("growth with table", table), ("without", off)];
                Ok(Finding::new(Holds::of(table <= 1.1 && off >= 1.5, table * EQUAL < off), figures)
                    .note("With 5 taps, whose means need a regular lattice with the table too (half the step)."))
            },
        ),
    ]
}

fn prefilter() -> Vec<Claim> {
    const TAPS: &str = "dsm:prefilter=1,5,map=128,filter=nearest;dsm:prefilter=1,map=256,filter=nearest";
    vec![
        claim("section 3.1, Figures 4 and 6", "Pre-filtering with several sub-pixel rays anti-aliases the shadow map", "5 taps, better than 1")
            .on(&[CHEST, BONES])
            .needs(AS_IS, TAPS)
            .judged(
                "Yes where image_rmse of 1 tap is at least 1.1 times that of 5 (128 texels a side, nearest texel as in the paper), \
                 partly from 1.05 on.",
                |m| {
                    let (one, five) = (m[0][0].image_rmse()?, m[0][1].image_rmse()?);
                    let figures = [("1 tap / 5 taps", one / five), ("1 tap", one), ("5 taps", five)];
                    Ok(Finding::new(at_least(one / five, 1.1), figures))
                },
            ),
        claim(
            "section 3.1, Figures 4 and 6",
            "5 taps a texel give high quality with little memory (here: against a map of four times the texels)",
            "as good with fewer bytes",
        )
        .on(&[CHEST, BONES])
        .needs(AS_IS, TAPS)
        .judged(
            "Yes where 5 taps at 128 texels a side are as close in the picture (image_rmse within 1.05) as 1 tap at 256 with at most \
             half its bytes, partly where closer than 1 tap at 128.",
            |m| {
                let errors: Vec<_> = m[0].iter().map(|f| f.image_rmse()).collect::<Result<_>>()?;
                let bytes = m[0][1].bytes()? / m[0][2].bytes()?;
                let time = m[0][1].build_ms()? / m[0][2].build_ms()?;
                let holds =
                    Holds::of(errors[1] <= EQUAL * errors[2] && bytes <= 0.5, errors[1] * EQUAL <= errors[0]);
                let figures = [
                    ("image_rmse, 5 taps at 128 / 1 tap at 256", errors[1] / errors[2]),
                    ("bytes", bytes),
                    ("build_ms", time),
                    ("1 tap at 128", errors[0]),
                    ("5 taps at 128", errors[1]),
                    ("1 tap at 256", errors[2]),
                ];
                Ok(Finding::new(holds, figures))
            },
        ),
    ]
}

fn rendering() -> Vec<Claim> {
    vec![
        claim(
            "section 4",
            "3 to 6 pictures a second with the light at rest, 1 to 2 with the light moving (lower resolution, higher epsilon)",
            "1.5 to 6 times the time",
        )
        .on(&[CHEST])
        .needs(AS_IS, "dsm:epsilon=0.02,map=512;dsm:epsilon=0.06,map=256")
        .judged(
            "Yes where build_ms + frame_ms at epsilon 0.06 and 256 texels over frame_ms at epsilon 0.02 and 512 is within the range \
             (and 15 %), partly above 1.05.",
            |m| {
                let (moving, rest) = (m[0][1].moving_ms()?, m[0][0].frame_ms()?);
                let figures = [("moving / at rest", moving / rest), ("moving [ms]", moving), ("at rest [ms]", rest)];
                Ok(Finding::new(within(moving / rest, [1.5, 6.0]), figures))
            },
        ),
        claim(
            "section 3.5",
            "Bilinear interpolation of four neighbouring visibility values could be done with some additional cost",
            "some additional cost",
        )
        .on(&[CHEST])
        .needs(AS_IS, "dsm:filter=nearest,bilinear,map=256")
        .judged("Yes where a frame takes 1.05 to 2 times as long with all four texels, partly above 2.", |m| {
            let ratio = m[0][1].frame_ms()? / m[0][0].frame_ms()?;
            let figures = [
                ("frame_ms, bilinear / nearest", ratio),
                ("point_err_rms, nearest", m[0][0].point_rms()?),
                ("bilinear", m[0][1].point_rms()?),
            ];
            Ok(Finding::new(Holds::of((EQUAL..=2.0).contains(&ratio), ratio > 2.0), figures))
        }),
        claim("section 3", "Fast empty space skipping by bricks, for construction and rendering", "faster")
            .on(&[CHEST, STRAIGHT])
            .needs_times(AS_IS, "dsm:map=256")
            .needs_times(NO_SKIPPING, "dsm:map=256")
            .judged("Yes where a frame without skipping takes 1.2 times as long or longer, partly from 1.05 on.", |m| {
                let (with, without) = (m[0][0].frame_ms()?, m[1][0].frame_ms()?);
                let figures = [("without / with", without / with), ("without [ms]", without), ("with [ms]", with)];
                Ok(Finding::new(at_least(without / with, 1.2), figures).note("What is seen decides: docs/results/time-and-memory has 3.9 for the vessels of a CT scan."))
            }),
        claim("section 4", "Shadow map quality is improved considerably by pre-compressed visibility functions", "considerably")
            .on(&[BONES, CHEST])
            .needs(AS_IS, "dsm:precompress=table,off,map=256")
            .judged("Yes where image_rmse against the exact picture is at most half of that without, partly up to 1 / 1.05.", |m| {
                let (table, off) = (m[0][0].image_rmse()?, m[0][1].image_rmse()?);
                let figures = [("table / off", table / off), ("table", table), ("off", off)];
                Ok(Finding::new(at_most(table / off, 0.5, 1.0 / EQUAL), figures))
            }),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_frame_rates_leave_a_range_of_ratios() {
        assert_eq!(ratio_range([5.0, 6.0], [2.0, 3.0]), [5.0 / 3.0, 3.0]);
        assert_eq!(table_1().len(), 7);
        let claimed: Vec<_> = table_1().iter().map(|c| c.claimed.clone()).collect();
        assert_eq!(claimed[0], "1.00 to 3.00 times the time");
        assert_eq!(claimed[6], "2.00 to 5.00 times the time");
    }
}
