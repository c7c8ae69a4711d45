//! Cases in which a promise was once broken, or a loop once went on for ever.

use super::case::{Case, Concerns, case};
use super::fields::*;
use crate::error::Result;
use crate::transfer::TransferFunction;
use glam::DVec3;
use std::sync::Arc;

/// Where a promise was once broken, or a loop once went on for ever.
// Long: a table of cases.
pub fn promises() -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    // Oblique planes one voxel thick: inside a cell extinction goes low, high, low.
    let sheet = volume([SIDE; 3], |p| if p.x + p.y + p.z == 37.0 { 200.0 } else { 3.0 })?;
    for (text, sigma) in [("0.5", 0.5), ("5", 5.0)] {
        cases.push(
            case(
                format!("saddle-cells-{text}"),
                "an oblique sheet lit across its cells' diagonals, extinction up to this, 1/mm",
                Arc::clone(&sheet),
                extinction(&[(0.0, 0.0), (255.0, sigma)]),
            )
            .lit(&[
                ("light along x, y and z", along(1.0, 1.0, 1.0)),
                ("light along z", along(0.0, 0.0, 1.0)),
                ("oblique light", along(0.5, -0.5, std::f64::consts::FRAC_1_SQRT_2)),
            ])
            .set(&[("epsilon", "0.002")], Concerns::All),
        );
    }
    let block =
        |p: DVec3| if p.x.min(p.y) >= 8.0 && p.x.max(p.y) < 16.0 && p.z < 12.0 { 1000.0 } else { -100.0 };
    let tall = volume_under(spacing([0.4, 0.4, 5.0]), [SIDE; 3], block)?;
    cases.push(
        case(
            "long-chords",
            "opaque matter that begins within cells 12 times as long as they are wide",
            tall,
            extinction(&[(0.0, 0.0), (0.0, 16.6)]),
        )
        .lit(&[("light along z", along(0.0, 0.0, 1.0)), ("oblique light", along(0.1, 0.2, 0.9))])
        .set(&[("epsilon", "0.002")], Concerns::All),
    );
    let waves: Vec<_> =
        (0..300).map(|i| f64::from(i) / 299.0).map(|v| (v, 0.2 + 0.2 * (40.0 * v).sin())).collect();
    cases.push(case(
        "function-of-300-points",
        "many breakpoints inside every cell",
        volume([SIDE; 3], ball)?,
        extinction(&waves),
    ));
    let solid = volume([SIDE; 3], |p| if p.distance(middle()) < 8.0 { 1.0 } else { 0.0 })?;
    cases.push(case(
        "opaque-ball-grazing",
        "light grazes an opaque ball: float32 decides what is met",
        solid,
        extinction(&[(0.5, 0.0), (0.5, 1e4)]),
    ));
    let lone = |p: DVec3| if p.x % 2.0 + p.y % 2.0 + p.z % 2.0 == 3.0 { 1.0 } else { 0.0 };
    for (name, about, voxels, top, reference_length_mm) in [
        (
            "lone-voxels",
            "every cell's opacity rises from 0 with the third power of depth",
            volume([SIDE; 3], lone)?,
            0.5,
            0.5,
        ),
        (
            "lone-holes",
            "every cell's opacity leaves 1 with the third power of depth",
            volume([SIDE; 3], |p| 1.0 - lone(p))?,
            1.0,
            1e3,
        ),
    ] {
        let tf = TransferFunction { reference_length_mm, ..opacity(&[(0.0, 0.0), (1.0, top)]) };
        let lights = [
            ("light along x, y and z", along(1.0, 1.0, 1.0)),
            ("light along x and y", along(1.0, 1.0, 0.0)),
            ("oblique light", along(0.5, -0.5, std::f64::consts::FRAC_1_SQRT_2)),
        ];
        cases.push(case(name, about, voxels, tf).lit(&lights).set(&[("epsilon", "0.002")], Concerns::All));
    }
    let stripes = volume([400, 4, 4], |p| p.x % 2.0)?;
    cases.push(
        case(
            "opacity-1-in-400-cells",
            "opacity nears 1 in every cell of a long ray that loses next to nothing",
            stripes,
            TransferFunction { reference_length_mm: 1.7e5, ..opacity(&[(0.0, 0.0), (1.0, 1.0)]) },
        )
        .lit(&[("light along x", along(1.0, 0.0, 0.0)), ("oblique light", along(0.9, 0.003, -0.002))])
        .set(&[("epsilon", "0.002")], Concerns::All),
    );
    for (name, about, key) in [
        (
            "voxels-1-1-1000-mean",
            "means of rays on a regular lattice, voxels of 1 x 1 x 1000 mm",
            "prefilter",
        ),
        ("voxels-1-1-1000-samples", "regular samples, voxels of 1 x 1 x 1000 mm", "precompress"),
    ] {
        let long = volume_under(spacing([1.0, 1.0, 1000.0]), [SIDE; 3], ball)?;
        let value = if key == "prefilter" { "5" } else { "off" };
        cases.push(
            case(name, about, long, extinction(&[(0.1, 0.0), (1.0, 0.002)]))
                .lit(&[("light along z", along(0.0, 0.0, 1.0)), ("oblique light", along(0.3, -0.2, 0.9))])
                .set(&[(key, value)], Concerns::ThoseWithKeys),
        );
    }
    cases.push(
        case(
            "huge-extinction-by-mass",
            "planes placed by an optical depth of 1e12 per mm",
            volume([SIDE; 3], |p| 100.0 * rough(p))?,
            extinction(&[(0.0, 0.0), (100.0, 1e12)]),
        )
        .set(&[("slicing", "density")], Concerns::ThoseWithKeys),
    );
    Ok(cases)
}
