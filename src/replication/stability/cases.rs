//! The cases: what is stiff or extreme in a volume, a transfer function, a light or a setting.

use super::case::{Case, Concerns, case};
use super::fields::*;
use super::promises::promises;
use crate::error::Result;
use crate::volume::{BRICK_CELLS, Volume};
use glam::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

/// The name of the case that the costs of the others are compared with.
pub const ORDINARY: &str = "ordinary";

/// Every case, the ordinary one first.
///
/// # Errors
/// A volume that is refused, which none is.
pub fn all() -> Result<Vec<Case>> {
    let plain = volume([SIDE; 3], ball)?;
    let mut cases =
        vec![case(ORDINARY, "an uneven ball of haze: what costs are compared with", plain, haze(1.0))];
    cases.extend(extinctions()?);
    cases.extend(structures()?);
    cases.extend(grids()?);
    cases.extend(values()?);
    cases.extend(lights()?);
    cases.extend(settings()?);
    cases.extend(promises()?);
    Ok(cases)
}

fn extinctions() -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    for (text, sigma) in [("1", 1.0), ("1e2", 1e2), ("1e4", 1e4), ("1e6", 1e6)] {
        let half = volume([SIDE; 3], |p| if p.z < 12.0 { 1.0 } else { 0.0 })?;
        let about = "extinction rises from 0 to this, 1/mm, across one voxel";
        cases.push(case(
            format!("extinction-step-{text}"),
            about,
            half,
            extinction(&[(0.0, 0.0), (1.0, sigma)]),
        ));
    }
    for (text, sigma) in [("1e-6", 1e-6), ("1e-3", 1e-3), ("1", 1.0), ("1e3", 1e3), ("1e6", 1e6)] {
        let about = "the same extinction, 1/mm, everywhere";
        let tf = extinction(&[(0.0, sigma)]);
        cases.push(case(format!("uniform-{text}"), about, volume([SIDE; 3], rough)?, tf));
    }
    Ok(cases)
}

fn structures() -> Result<Vec<Case>> {
    let comb = volume([SIDE; 3], |p| p.z % 2.0)?;
    // Not at half: the layers' faces would then hold texel centres, and of a ray that lies within a jump's surface
    // rounding alone says on which side it is.
    let opaque = opacity(&[(0.47, 0.0), (0.47, 1.0)]);
    let peaks = [0.2003, 0.5, 0.80041]
        .into_iter()
        .flat_map(|v| [(v, 0.0), (v + 0.5e-4, 400.0), (v + 1e-4, 0.0)])
        .collect::<Vec<_>>();
    let ball = || volume([SIDE; 3], ball);
    Ok(vec![
        case(
            "comb",
            "opaque and clear layers in turn, each one voxel thick",
            Arc::clone(&comb),
            opaque.clone(),
        ),
        case("comb-edge-on", "the same layers lit along them", comb, opaque.clone())
            .lit(&[("light along x", along(1.0, 0.0, 0.0)), ("light along x and y", along(1.0, 1.0, 0.0))]),
        case(
            "shell-grazing",
            "a shell one voxel thick, whose limb the light grazes",
            volume([SIDE; 3], shell)?,
            extinction(&[(0.2, 0.0), (1.0, 3.0)]),
        ),
        case(
            "peaks-1e-4",
            "transfer-function peaks 1e-4 of the value range wide",
            ball()?,
            extinction(&peaks),
        ),
        case(
            "opacity-1-at-a-point",
            "opacity rises to 1 at one value only",
            ball()?,
            opacity(&[(0.2, 0.0), (0.5, 1.0), (0.8, 0.0)]),
        ),
        case("empty", "no value has extinction", ball()?, extinction(&[(0.0, 0.0)])),
        case("uniform-values", "every voxel has one value", volume([SIDE; 3], |_| 0.5)?, haze(1.0)),
        case("opaque", "opacity 1 everywhere", volume([SIDE; 3], rough)?, opacity(&[(0.0, 1.0)])),
    ])
}

fn grids() -> Result<Vec<Case>> {
    let dims = [SIDE; 3];
    let haze_1 = || extinction(&[(0.1, 0.0), (1.0, 0.02)]);
    let thin = extinction(&[(0.3, 0.0), (0.3, 0.1), (1.0, 0.4)]);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.6, 1.0, 0.0), DVec3::new(-0.4, 0.5, 1.0));
    let mut cases = vec![
        case(
            "voxels-1-1-100",
            "voxels of 1 x 1 x 100 mm",
            volume_under(spacing([1.0, 1.0, 100.0]), dims, ball)?,
            haze_1(),
        ),
        case(
            "voxels-100-1-1",
            "voxels of 100 x 1 x 1 mm",
            volume_under(spacing([100.0, 1.0, 1.0]), dims, ball)?,
            haze_1(),
        ),
        case(
            "offset-1e6",
            "an affine whose origin is 1e6 mm away",
            volume_under(DAffine3::from_translation(DVec3::new(1e6, -1e6, 1e6)), dims, ball)?,
            haze(1.0),
        ),
        case("shear", "a sheared affine", volume_under(DAffine3::from_mat3(shear), dims, ball)?, haze(1.0)),
        case(
            "flip",
            "an affine that flips x",
            volume_under(spacing([-1.0, 1.0, 1.0]), dims, ball)?,
            haze(1.0),
        ),
    ];
    // A brick of c cells interpolates c - 1 voxels.
    for (name, about, dims) in [
        ("grid-1x1xN", "voxels in one line along z", [1, 1, 32]),
        ("grid-1xNx1", "voxels in one line along y", [1, 32, 1]),
        ("grid-one-voxel", "a single voxel", [1, 1, 1]),
        ("grid-one-brick", "voxels that fill one brick exactly", [BRICK_CELLS - 1; 3]),
        ("grid-one-brick-and-one", "one voxel more than a brick", [BRICK_CELLS; 3]),
    ] {
        cases.push(case(name, about, volume(dims, |p| 0.5 + 0.5 * rough(p))?, thin.clone()));
    }
    Ok(cases)
}

fn values() -> Result<Vec<Case>> {
    let dims = [SIDE; 3];
    let in_the_middle = |p: DVec3| p == DVec3::splat(12.0);
    let holes = |bad: [f64; 2]| {
        move |p: DVec3| match (p.x * 5.0 + p.y * 3.0 + p.z) as usize % 17 {
            0 => bad[0],
            8 => bad[1],
            _ => ball(p),
        }
    };
    Ok(vec![
        case("values-1e-30", "values from 0 to 1e-30", volume(dims, |p| 1e-30 * ball(p))?, haze(1e-30)),
        case("values-1e30", "values from 0 to 1e30", volume(dims, |p| 1e30 * ball(p))?, haze(1e30)),
        case(
            "outlier",
            "values from 0 to 1 but for one voxel of 1e6",
            volume(dims, |p| if in_the_middle(p) { 1e6 } else { ball(p) })?,
            haze(1.0),
        ),
        case("nan", "some voxels are not a number", volume(dims, holes([f64::NAN; 2]))?, haze(1.0)),
        case(
            "infinities",
            "some voxels are infinite, of both signs",
            volume(dims, holes([f64::INFINITY, f64::NEG_INFINITY]))?,
            haze(1.0),
        ),
    ])
}

fn lights() -> Result<Vec<Case>> {
    let plain = volume([SIDE; 3], ball)?;
    let solid = volume([SIDE; 3], rough)?;
    let fog = || extinction(&[(0.0, 0.05), (1.0, 0.3)]);
    let lit = |name: &str, about, volume: &Arc<Volume>, tf, lights: &[_]| {
        case(name, about, Arc::clone(volume), tf).lit(lights)
    };
    // Two columns of matter, whose bricks and themselves share one edge: x = y = 3 in index space.
    let touching = volume([7; 3], |p| {
        let inside = |v: f64, low: f64| v >= low && v <= low + 1.0;
        let one = inside(p.x, 1.0) && inside(p.y, 1.0) || inside(p.x, 4.0) && inside(p.y, 4.0);
        if one { 1.0 } else { 0.0 }
    })?;
    let edge = DVec3::new(3.0, 3.0, 3.0);
    Ok(vec![
        lit(
            "light-inside",
            "the light is inside the volume",
            &plain,
            haze(1.0),
            &[("point light", point(middle() + DVec3::new(2.3, -1.1, 3.7)))],
        ),
        lit(
            "light-along-an-axis",
            "the light is exactly along an axis",
            &plain,
            haze(1.0),
            &[("light along z", along(0.0, 0.0, 1.0)), ("light along -x", along(-1.0, 0.0, 0.0))],
        ),
        lit(
            "light-along-a-diagonal",
            "the light is exactly along a diagonal",
            &plain,
            haze(1.0),
            &[
                ("light along x, y and z", along(1.0, 1.0, 1.0)),
                ("light along x and -y", along(1.0, -1.0, 0.0)),
            ],
        ),
        lit(
            "light-0.1-voxel-away",
            "the light is 0.1 voxel from the surface",
            &solid,
            fog(),
            &[("point light", point(DVec3::new(9.3, 11.8, SIDE as f64 - 0.4)))],
        ),
        lit(
            "light-1e5-mm-away",
            "the light is 1e5 mm away",
            &plain,
            haze(1.0),
            &[("point light", point(middle() + 1e5 * DVec3::new(0.48, -0.6, 0.64)))],
        ),
        // The middle of a map with an odd number of texels is a texel's centre.
        lit(
            "light-touches-an-edge",
            "a light ray runs along, or just touches, the edge that two bricks of matter share",
            &touching,
            extinction(&[(0.0, 0.0), (0.0, 50.0)]),
            &[
                ("light along x and -y", along(1.0, -1.0, 0.0)),
                ("light along z", along(0.0, 0.0, 1.0)),
                ("point light", point(edge + 20.0 * DVec3::new(1.0, -1.0, 0.0))),
            ],
        )
        .set(&[("map", "65")], Concerns::All),
    ])
}

fn settings() -> Result<Vec<Case>> {
    let plain = volume([SIDE; 3], ball)?;
    let with = |name: &str, about, settings: &[(&'static str, &str)], concerns| {
        case(name, about, Arc::clone(&plain), haze(1.0)).set(settings, concerns)
    };
    let mut cases = Vec::new();
    for epsilon in ["0", "1e-6", "0.5", "1"] {
        let about = "the bound that compression keeps";
        let settings = [("epsilon", epsilon)];
        cases.push(with(&format!("epsilon-{epsilon}"), about, &settings, Concerns::ThoseWithKeys));
    }
    cases.push(with("map-1", "a map of one texel", &[("map", "1")], Concerns::ThoseWithKeys));
    // Matter at two far ends of the diagonal: most tiles of so large a map stay empty.
    let corners = volume([48; 3], |p| {
        if p.max_element() <= 2.0 || p.min_element() >= 45.0 { 0.5 + 0.5 * rough(p) } else { 0.0 }
    })?;
    cases.push(
        case("map-4096", "a map of 4096 texels a side", corners, haze(1.0))
            .lit(&[
                ("light along -z", along(0.0, 0.0, -1.0)),
                ("point light", point(DVec3::new(20.0, 26.0, -90.0))),
            ])
            .set(&[("map", "4096")], Concerns::ThoseWithKeys),
    );
    for (name, about, step, light_step) in [
        ("step-too-long", "steps of 64 (eye) and 8 (light) smallest spacings", 64.0, "8"),
        ("step-too-short", "steps of 0.01 smallest spacing", 0.01, "0.01"),
    ] {
        let settings = [("precompress", "off"), ("march", "samples"), ("step", light_step)];
        cases.push(Case { step, ..with(name, about, &settings, Concerns::All) });
    }
    let sheet = volume([SIDE; 3], |p| if p.x + p.y + p.z == 37.0 { 1.0 } else { 0.0 })?;
    for (name, about, field, tf) in [
        (
            "samples-rough",
            "light rays by regular samples through noise",
            volume([SIDE; 3], rough)?,
            haze(1.0),
        ),
        (
            "samples-opaque",
            "the same, where all is opaque at once",
            Arc::clone(&sheet),
            extinction(&[(0.3, 0.0), (0.3, 1e6)]),
        ),
        (
            "samples-peak",
            "the same, through a peak that lies between samples",
            sheet,
            extinction(&[(0.49, 0.0), (0.5, 50.0), (0.51, 0.0)]),
        ),
    ] {
        cases.push(case(name, about, field, tf).set(&[("march", "samples")], Concerns::ThoseWithKeys));
    }
    let depth_100 = extinction(&[(0.0, 100.0 / SIDE as f64)]);
    cases.push(
        case("bits-8", "optical depth 100 in 8 bits", volume([SIDE; 3], rough)?, depth_100)
            .set(&[("bits", "8")], Concerns::ThoseWithKeys),
    );
    Ok(cases)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn names_differ_and_can_be_written_on_a_command_line() {
        let cases = all().unwrap();
        assert_eq!(cases[0].name, ORDINARY);
        let names: HashSet<_> = cases.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names.len(), cases.len());
        assert!(names.iter().all(|n| n.chars().all(|c| c.is_ascii_alphanumeric() || "-.".contains(c))));
    }

    #[test]
    fn what_a_name_promises_is_in_the_volume() {
        let cases = all().unwrap();
        let find = |name: &str| cases.iter().find(|c| c.name == name).unwrap();
        assert!(find("nan").volume.provenance.non_finite > 100);
        assert!(find("infinities").volume.provenance.non_finite > 1000);
        let [low, high] = find("values-1e-30").volume.value_range();
        assert!(low == 0.0 && high > 0.9e-30 && high < 1.1e-30);
        assert_eq!(find("outlier").volume.value_range()[1], 1e6);
        assert_eq!(find("grid-one-brick").volume.dims(), [3; 3]);
        assert_eq!(find("uniform-1e6").tf.extinction(0.3), 1e6);
        // Both lights wherever the case is not about the light itself.
        assert!(
            cases
                .iter()
                .filter(|c| c.lights.len() < 2)
                .all(|c| c.name.contains("light-") || c.name == "map-4096")
        );
    }
}
