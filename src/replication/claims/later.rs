//! Mertens et al. 2004 (`clusters`), Jansen and Bavoil 2010 (`fourier`), Salvi et al. 2010 (`avsm`) and Münstermann et al. 2018
//! (`moments`): what their abstracts, and the authors' pages, state of the pictures.

use super::claim::{Claim, Finding, Measured, Paper};
use super::figures::Figures;
use super::rules::{EQUAL, Holds, at_most, falls};
use super::scenes::{AS_IS, BONES, CHEST, CURLY, EVEN, LOCKS, SPARSER, STRAIGHT, StandIn, Variant};
use crate::error::Result;

const HAIR: &[StandIn] = &[STRAIGHT, CURLY, LOCKS];
const MEDIA: &[StandIn] = &[CHEST, STRAIGHT];
/// A picture whose error nobody sees: two steps of 8 bits.
const UNSEEN: f64 = 2.0 / 255.0;
/// One that a reader would still call close.
const CLOSE: f64 = 4.0 * UNSEEN;

pub fn claims() -> Vec<Claim> {
    [mertens(), jansen_bavoil(), salvi(), muenstermann()].into_iter().flatten().collect()
}

/// The error of the first of two pictures by that of the second.
fn beside(own: &Figures, other: &Figures) -> Result<[(&'static str, f64); 3]> {
    let (a, b) = (own.image_rmse()?, other.image_rmse()?);
    Ok([("image_rmse, ratio", a / b), ("its own", a), ("the other's", b)])
}

/// Whether the first of a need's settings is as good as the second.
fn as_good(m: &Measured) -> Result<Finding> {
    let figures = beside(m[0][0], m[0][1])?;
    let ratio = figures[0].1;
    Ok(Finding::new(Holds::of(ratio <= EQUAL, ratio <= 1.5), figures))
}

const AS_GOOD: &str =
    "Yes where image_rmse is no larger than the other's (and 5 %), partly up to one and a half times that.";

fn mertens() -> Vec<Claim> {
    let claim = |place, claim: &str, claimed: &str| Claim::new(Paper::Mertens, place, claim, claimed);
    vec![
        claim(
            "authors' page, Results",
            "Four clusters are equal to or better than opacity shadow maps of 256 slices",
            "4 clusters and 256 slices",
        )
        .on(HAIR)
        .needs(AS_IS, "clusters:clusters=4,map=256;osm:layers=256,map=256")
        .judged(AS_GOOD, as_good),
    ]
}

fn jansen_bavoil() -> Vec<Claim> {
    const FEW: &str = "fourier:terms=7,map=256";
    const EQUAL_NUMBERS: &str = "fourier:terms=7,map=256;osm:layers=15,map=256";
    let claim = |place, claim: &str, claimed: &str| Claim::new(Paper::JansenBavoil, place, claim, claimed);
    let close = |variant: Variant, scenes, what: &str, claimed: &str| {
        claim("Figure 1c", what, claimed).on(scenes).needs(variant, FEW).judged(
            "Yes where image_rmse is within two steps of 8 bits, partly within eight.",
            |m| {
                let error = m[0][0].image_rmse()?;
                let figures = [("image_rmse", error), ("ray_err_max", m[0][0].ray_max()?)];
                Ok(Finding::new(at_most(error, UNSEEN, CLOSE), figures))
            },
        )
    };
    vec![
        close(AS_IS, &[EVEN], "15 coefficients coincide with the exact transmittance almost exactly", "15 coefficients"),
        close(SPARSER, MEDIA, "So they do in low-opacity media", "15 coefficients"),
        claim(
            "abstract",
            "Slice-based methods need many slices where opacity varies smoothly; Fourier opacity maps do not",
            "closer with as many numbers",
        )
        .on(MEDIA)
        .needs(SPARSER, EQUAL_NUMBERS)
        .judged(
            "Yes where image_rmse with 15 coefficients is no larger than with 15 slices (and 5 %), partly up to one and a half times \
             that.",
            as_good,
        ),
        claim(
            "abstract",
            "It is for smooth variations of opacity: around sharp ones the series rings",
            "smoke, gas and low-opacity hair; not surfaces",
        )
        .on(&[BONES])
        .needs(AS_IS, "fourier:terms=7,map=256;fourier:terms=7,damping=lanczos,map=256;osm:layers=15,map=256")
        .judged(
            "Yes where the largest error on light rays is above 0.5 and Lanczos' damping lowers it by a fifth, partly where it is \
             above 0.5.",
            |m| {
                let [own, damped] = [m[0][0].ray_max()?, m[0][1].ray_max()?];
                let figures = [
                    ("ray_err_max", own),
                    ("damped", damped),
                    ("15 slices", m[0][2].ray_max()?),
                ];
                Ok(Finding::new(Holds::of(own > 0.5 && damped < 0.8 * own, own > 0.5), figures))
            },
        ),
    ]
}

fn salvi() -> Vec<Claim> {
    let claim = |place, claim: &str, claimed: &str| Claim::new(Paper::Salvi, place, claim, claimed);
    let scenes: &[StandIn] = &[CHEST, CURLY];
    vec![
        claim("abstract", "A small fixed memory footprint closely approximates the ground truth", "8 nodes a texel")
            .on(scenes)
            .needs(AS_IS, "avsm:nodes=8,map=256;rays")
            .judged(
                "By how much image_rmse exceeds that of shadow rays: yes within two steps of 8 bits, partly within eight.",
                |m| {
                    let [own, rays] = [m[0][0].image_rmse()?, m[0][1].image_rmse()?];
                    let figures = [("image_rmse over rays'", own - rays), ("8 nodes", own), ("rays", rays)];
                    Ok(Finding::new(at_most(own - rays, UNSEEN, CLOSE), figures))
                },
            ),
        claim("abstract", "Shadows are of higher quality than those of opacity shadow maps", "at as many bytes")
            .on(scenes)
            .needs(AS_IS, "avsm:nodes=8,bits=16,map=256;osm:layers=16,map=256")
            .judged(AS_GOOD, as_good),
        claim("abstract", "Shadows are of higher quality than those of Fourier opacity maps", "at as many bytes")
            .on(scenes)
            .needs(AS_IS, "avsm:nodes=8,bits=16,map=256;fourier:terms=7,map=256")
            .judged(AS_GOOD, as_good),
        claim("abstract", "It performs competitively to existing real-time techniques", "about the same time")
            .on(scenes)
            .needs(AS_IS, "avsm:nodes=8,map=256;osm:layers=16,map=256")
            .judged("Build and frame by those of 16 slices: yes up to 1.5, partly up to 3.", |m| {
                let [own, slices] = [m[0][0].moving_ms()?, m[0][1].moving_ms()?];
                let figures = [("avsm / osm", own / slices), ("avsm [ms]", own)];
                Ok(Finding::new(at_most(own / slices, 1.5, 3.0), figures))
            }),
        claim(
            "chapter of the same name, abstract",
            "A constant-storage, variable-error representation: a deep shadow map's memory varies and its error does not",
            "avsm: error follows the scene, memory does not",
        )
        .on(&[CHEST])
        .needs(AS_IS, "avsm:nodes=8,map=256;dsm:epsilon=0.02,map=256")
        .needs(SPARSER, "avsm:nodes=8,map=256;dsm:epsilon=0.02,map=256")
        .judged(
            "Between the medium and an eighth of it: yes where bytes of avsm stay within 1 % and its largest error on light rays \
             changes by more than a tenth while dsm's nodes change by more than a tenth, partly where one does.",
            |m| {
                let ratio = |i: usize, of: fn(&Figures) -> Result<f64>| Ok::<f64, crate::error::Error>(of(m[1][i])? / of(m[0][i])?);
                let (bytes, error) = (ratio(0, Figures::bytes)?, ratio(0, Figures::ray_max)?);
                let nodes = ratio(1, Figures::nodes_total)?;
                let moves = |r: f64| (r - 1.0).abs() > 0.1;
                let (steady, both) = ((bytes - 1.0).abs() < 0.01, moves(error) && moves(nodes));
                let figures = [("avsm bytes, thin / dense", bytes), ("avsm error", error), ("dsm nodes", nodes)];
                Ok(Finding::new(Holds::of(steady && both, steady || both), figures))
            },
        ),
    ]
}

fn muenstermann() -> Vec<Claim> {
    let claim = |place, claim: &str, claimed: &str| Claim::new(Paper::Muenstermann, place, claim, claimed);
    vec![
        claim("abstract", "It works well for participating media", "6 power moments")
            .on(MEDIA)
            .needs(SPARSER, "moments:moments=6,map=256")
            .judged("Yes where image_rmse is within two steps of 8 bits, partly within eight.", |m| {
                let error = m[0][0].image_rmse()?;
                Ok(Finding::new(at_most(error, UNSEEN, CLOSE), [("image_rmse", error)]))
            }),
        claim("abstract", "It works well for transparent surfaces", "6 power moments")
            .on(&[BONES])
            .needs(AS_IS, "moments:moments=6,map=256")
            .judged("Yes where image_rmse is within two steps of 8 bits, partly within eight.", |m| {
                let error = m[0][0].image_rmse()?;
                let note = "Behind several surfaces light leaks, as in every moment shadow map.";
                Ok(Finding::new(at_most(error, UNSEEN, CLOSE), [("image_rmse", error)]).note(note))
            }),
        claim(
            "abstract",
            "Variants provide different tradeoffs: more moments are closer",
            "4, 6 and 8 power moments",
        )
        .on(MEDIA)
        .needs(AS_IS, "moments:moments=4,6,8,map=256")
        .judged("Yes where image_rmse falls with each, partly where it falls from 4 to 8.", |m| {
            let errors = m[0].iter().map(|f| f.image_rmse()).collect::<Result<Vec<_>>>()?;
            let figures = [("4 moments", errors[0]), ("6", errors[1]), ("8", errors[2])];
            Ok(Finding::new(falls(&errors, 0.0), figures))
        }),
        claim(
            "abstract, Figure 1",
            "Variants provide different tradeoffs: three trigonometric moments, in more memory, are closer than six power moments",
            "3 trigonometric and 6 power moments",
        )
        .on(&[CHEST, STRAIGHT, BONES])
        .needs(AS_IS, "moments:moments=6,basis=trigonometric,map=256;moments:moments=6,map=256")
        .judged(AS_GOOD, as_good),
    ]
}
