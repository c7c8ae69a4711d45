//! Interpolation of transfer-function colours in the colour spaces of VTK and ParaView: HSV, CIE L*a*b* and Msh.
//!
//! Definitions: HSV after Smith (1978); CIE L*a*b* with the D65 white; Msh, polar L*a*b*, after Moreland (2009),
//! *Diverging color maps for scientific visualization*, section 5.

use super::curve::linear;
use palette::convert::FromColorUnclamped;
use palette::white_point::D65;
use palette::{Hsv, Lab};
use std::f64::consts::{FRAC_PI_3, PI, TAU};

/// Gamma-encoded sRGB colour, channels in `[0, 1]`.
type Srgb = [f64; 3];

/// Interpolates two colours in HSV along the shorter arc of hues, like VTK's `vtkColorTransferFunction` with HSVWrap.
pub fn hsv_wrapped(a: &Srgb, b: &Srgb, share: f64) -> Srgb {
    let (a, mut b) = (hsv_from_rgb(a), hsv_from_rgb(b));
    if (b[0] - a[0]).abs() > 0.5 {
        b[0] += if b[0] < a[0] { 1.0 } else { -1.0 };
    }
    let [h, s, v] = linear(&a, &b, share);
    rgb_from_hsv([h.rem_euclid(1.0), s, v])
}

/// Interpolates two colours linearly in HSV.
pub fn hsv(a: &Srgb, b: &Srgb, share: f64) -> Srgb {
    rgb_from_hsv(linear(&hsv_from_rgb(a), &hsv_from_rgb(b), share))
}

/// Interpolates two colours linearly in CIE L*a*b*.
pub fn lab(a: &Srgb, b: &Srgb, share: f64) -> Srgb {
    rgb_from_lab(linear(&lab_from_rgb(a), &lab_from_rgb(b), share))
}

/// Returns the second of two colours, the step interpolation of VTK's `vtkColorTransferFunction`: between two nodes
/// the colour is that of the upper node.
pub fn step(_: &Srgb, b: &Srgb, _: f64) -> Srgb {
    *b
}

/// Interpolates two colours like Moreland's diverging colour maps: through white if both colours are saturated and
/// differ in hue.
pub fn diverging(a: &Srgb, b: &Srgb, share: f64) -> Srgb {
    // Saturation from which on a colour is not grey, and angle from which on two hues differ.
    const SATURATED: f64 = 0.05;
    const DIFFERENT_HUES: f64 = FRAC_PI_3;
    const WHITE: f64 = 88.0;
    let (mut a, mut b, mut share) = (msh_from_lab(lab_from_rgb(a)), msh_from_lab(lab_from_rgb(b)), share);
    if a[1] > SATURATED && b[1] > SATURATED && angle_between(a[2], b[2]) > DIFFERENT_HUES {
        let white = [a[0].max(b[0]).max(WHITE), 0.0, 0.0];
        if share < 0.5 {
            b = white;
            share *= 2.0;
        } else {
            a = white;
            share = 2.0 * share - 1.0;
        }
    }
    if a[1] < SATURATED && b[1] > SATURATED {
        a[2] = spun_hue(b, a[0]);
    } else if b[1] < SATURATED && a[1] > SATURATED {
        b[2] = spun_hue(a, b[0]);
    }
    // The hue of a dark colour is spun by more than half a turn. VTK then takes the shorter angle, always upwards.
    // Towards a grey the direction does not matter; where it would miss the second colour, the sign is changed.
    let turn = b[2] - a[2];
    if turn.abs() > PI {
        let angle = angle_between(a[2], b[2]);
        let misses =
            b[1] >= SATURATED && (turn - angle).rem_euclid(TAU).min((angle - turn).rem_euclid(TAU)) > 1e-9;
        b[2] = a[2] + if misses { -angle } else { angle };
    }
    rgb_from_lab(lab_from_msh(linear(&a, &b, share)))
}

/// Returns the angle between two hues or other angles in the plane, 0 to pi.
fn angle_between(a: f64, b: f64) -> f64 {
    let angle = (a - b).abs() % TAU;
    angle.min(TAU - angle)
}

/// Returns the hue for a grey of Msh magnitude `m` next to a saturated colour, so that the interpolation between them
/// looks even (Moreland 2009).
fn spun_hue([m_saturated, s, h]: [f64; 3], m: f64) -> f64 {
    if m_saturated >= m - 0.1 {
        return h;
    }
    let spin = s * (m * m - m_saturated * m_saturated).sqrt() / (m_saturated * s.sin());
    // Away from purple.
    if h > -0.3 * PI { h + spin } else { h - spin }
}

fn hsv_from_rgb(rgb: &Srgb) -> [f64; 3] {
    let hsv = Hsv::from_color_unclamped(palette::Srgb::from(*rgb));
    [hsv.hue.into_positive_degrees() / 360.0, hsv.saturation, hsv.value]
}

fn rgb_from_hsv([h, s, v]: [f64; 3]) -> Srgb {
    palette::Srgb::from_color_unclamped(Hsv::new_srgb(360.0 * h, s, v)).into()
}

fn lab_from_rgb(rgb: &Srgb) -> [f64; 3] {
    Lab::<D65, f64>::from_color_unclamped(palette::Srgb::from(*rgb)).into()
}

fn rgb_from_lab(lab: [f64; 3]) -> Srgb {
    let encoded: Srgb = palette::Srgb::from_color_unclamped(Lab::<D65, f64>::from(lab)).into();
    // `vtkMath` divides colours out of gamut by their brightest channel.
    let brightest = encoded.iter().fold(1.0, |a: f64, b| a.max(*b));
    encoded.map(|c| c.max(0.0) / brightest)
}

fn msh_from_lab([l, a, b]: [f64; 3]) -> [f64; 3] {
    let m = (l * l + a * a + b * b).sqrt();
    let s = if m > 1e-3 { (l / m).clamp(-1.0, 1.0).acos() } else { 0.0 };
    [m, s, if s > 1e-3 { b.atan2(a) } else { 0.0 }]
}

fn lab_from_msh([m, s, h]: [f64; 3]) -> [f64; 3] {
    [m * s.cos(), m * s.sin() * h.cos(), m * s.sin() * h.sin()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Interpolated colours agree with those of VTK 9.7's `vtkColorTransferFunction`.
    #[test]
    fn interpolation_is_that_of_vtk() {
        let (a, b) = ([0.2, 0.3, 0.8], [0.8, 0.25, 0.1]);
        let (cool, warm) = ([0.23, 0.299, 0.754], [0.706, 0.016, 0.15]);
        type Mixed = fn(&Srgb, &Srgb, f64) -> Srgb;
        type Case = (&'static str, Mixed, [Srgb; 2], &'static [(f64, Srgb)]);
        let cases: [Case; 6] = [
            (
                "hsv wrapped",
                hsv_wrapped,
                [a, b],
                &[(0.25, [0.44286, 0.175, 0.8]), (0.5, [0.8, 0.15, 0.78452]), (0.75, [0.8, 0.125, 0.38214])],
            ),
            (
                "hsv",
                hsv,
                [a, b],
                &[(0.25, [0.175, 0.8, 0.75536]), (0.5, [0.15, 0.8, 0.16548]), (0.75, [0.71964, 0.8, 0.125])],
            ),
            (
                "lab",
                lab,
                [a, b],
                &[
                    (0.25, [0.49956, 0.28139, 0.62732]),
                    (0.5, [0.63735, 0.26737, 0.45937]),
                    (0.75, [0.72969, 0.25726, 0.29257]),
                ],
            ),
            (
                "diverging out of gamut",
                diverging,
                [a, b],
                &[
                    (0.25, [0.62114, 0.67631, 1.0]),
                    (0.5, [0.8688, 0.86881, 0.8688]),
                    (0.75, [1.0, 0.64733, 0.53404]),
                ],
            ),
            (
                "diverging from dark",
                diverging,
                [[0.12016, 0.08061, 0.2473], [0.36815, 0.95709, 0.48698]],
                &[
                    (0.1, [0.3764, 0.1616, 0.3934]),
                    (0.3, [0.978, 0.5908, 0.6826]),
                    (0.7, [0.8088, 1.0, 0.8178]),
                ],
            ),
            (
                "diverging",
                diverging,
                [cool, warm],
                &[
                    (0.125, [0.38329, 0.50962, 0.91756]),
                    (0.25, [0.55319, 0.68904, 0.99544]),
                    (0.5, [0.8654, 0.86541, 0.8654]),
                    (0.65, [0.96629, 0.74171, 0.63878]),
                    (0.85, [0.89378, 0.42782, 0.33454]),
                ],
            ),
        ];
        for (name, mix, [a, b], expected) in cases {
            for (share, want) in expected {
                close(name, mix(&a, &b, *share), *want);
            }
        }
        assert_eq!([0.0, 0.01, 1.0].map(|share| step(&a, &b, share)), [b, b, b]);
    }

    fn close(name: &str, got: Srgb, want: Srgb) {
        for c in 0..3 {
            assert!((got[c] - want[c]).abs() < 2e-3, "{name}: {got:?}, not {want:?}");
        }
    }

    #[test]
    fn every_mixture_keeps_its_ends_and_stays_in_range() {
        let corners: Vec<Srgb> =
            (0..27).map(|i| [i % 3, i / 3 % 3, i / 9].map(|k| f64::from(k) / 2.0)).collect();
        for mix in [hsv_wrapped, hsv, lab, diverging] {
            for a in &corners {
                for b in &corners {
                    close("an end", mix(a, b, 0.0), *a);
                    close("an end", mix(a, b, 1.0), *b);
                    let middle = mix(a, b, 0.37);
                    assert!(middle.iter().all(|c| (0.0..=1.0).contains(c)), "{a:?} {b:?}: {middle:?}");
                }
            }
        }
    }
}
