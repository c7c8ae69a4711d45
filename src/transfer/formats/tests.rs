//! Tests of the transfer-function formats: small handmade files of each format, round trips, and damaged copies of
//! all of them.

use super::write::{COLOR_WARNING, OPACITY_WARNING};
use super::*;
use crate::files::color::{linear_from_srgb, srgb_from_linear};
use crate::transfer::{GradientLength, MAX_OPACITY, Quantity};
use proptest::prelude::*;

const PARAVIEW: &str = include_str!("../../../tests/formats/transfer/paraview.json");
const PARAVIEW_BENT: &str = include_str!("../../../tests/formats/transfer/paraview_bent.json");
const VP: &str = include_str!("../../../tests/formats/transfer/slicer.vp");
const VP_JSON: &str = include_str!("../../../tests/formats/transfer/slicer.vp.json");
const NIIVUE: &str = include_str!("../../../tests/formats/transfer/niivue.json");
const NIIVUE_RANGE: &str = include_str!("../../../tests/formats/transfer/niivue_range.json");
const INVIWO: &str = include_str!("../../../tests/formats/transfer/inviwo.itf");
const INVIWO_OLD: &str = include_str!("../../../tests/formats/transfer/inviwo_old.itf");
/// Gradient opacity of the file [`VP`].
const GRADIENT: &str = "0:0.5,255:1,per=voxel";
const OWN: &str = include_str!("../../../tests/formats/transfer/own.json");

const ALL: [(&str, &str); 9] = [
    (PARAVIEW, "paraview"),
    (PARAVIEW_BENT, "paraview"),
    (VP, "vp"),
    (VP_JSON, "vp.json"),
    (NIIVUE, "niivue"),
    (NIIVUE_RANGE, "niivue"),
    (INVIWO, "inviwo"),
    (INVIWO_OLD, "inviwo"),
    (OWN, "umbravox"),
];

fn read(text: &str) -> Imported {
    from_text(text, "").unwrap_or_else(|why| panic!("{text}: {why}"))
}

/// Opacity over the reference length, and gamma-encoded colour, of a transfer function at a scalar value.
fn opacity_and_color(tf: &TransferFunction, value: f64) -> (f64, [f64; 3]) {
    (tf.amount(value), tf.color(value).map(srgb_from_linear))
}

fn check(tf: &TransferFunction, wanted: &[(f64, f64, [f64; 3])]) {
    for (value, opacity, rgb) in wanted {
        let (o, c) = opacity_and_color(tf, *value);
        assert!((o - opacity).abs() < 1e-6, "opacity at {value}: {o}, not {opacity}");
        let off = (0..3).map(|i| (c[i] - rgb[i]).abs()).fold(0.0, f64::max);
        assert!(off < 1.05 / 255.0, "colour at {value}: {c:?}, not {rgb:?}");
    }
}

#[test]
fn content_decides_the_format_whatever_the_name() {
    for (text, format) in ALL {
        for name in ["", "x.json", "x.itf", "x.vp", "noise"] {
            assert_eq!(from_text(text, name).unwrap().format, format, "{name}");
        }
    }
    // Without content the name decides, and the reader says what is missing.
    for (name, why) in
        [("a.vp", "line 1"), ("a.itf", "XML"), ("a.vp.json", "not JSON"), ("a.json", "EOF"), ("a", "EOF")]
    {
        let said = from_text("", name).unwrap_err();
        assert!(said.contains(why), "{name}: {said}");
    }
}

#[test]
fn paraviews_lists_are_read() {
    let imported = read(PARAVIEW);
    assert_eq!((imported.tf.name.as_str(), imported.tf.units.as_str()), ("Bones", ""));
    check(
        &imported.tf,
        &[
            (-500.0, 0.0, [0.0; 3]),
            (100.0, 0.125, [0.4, 0.2, 0.0]),
            (299.999, 0.249_999_375, [0.8, 0.4, 0.0]),
            (300.000_01, 0.75, [0.8, 0.4, 0.0]),
            (650.0, 0.895_833_329_861, [1.0, 0.75, 0.5]),
            (2000.0, 1.0, [1.0; 3]),
        ],
    );
    // Only the length to which opacities refer was assumed.
    assert_eq!((imported.warnings.len(), imported.tf.reference_length_mm), (1, 1.0));
    assert!(imported.warnings[0].contains("1 mm is assumed"));
}

#[test]
fn paraviews_curves_and_colour_spaces_are_sampled_with_warnings() {
    let imported = read(PARAVIEW_BENT);
    let tf = &imported.tf;
    assert_eq!((tf.units.as_str(), tf.reference_length_mm), (FRACTION, 2.5));
    // VTK's own answers.
    for (value, opacity) in [(0.1, 0.000_344), (0.3, 0.5), (0.5, 0.960_476), (0.7, 0.998_437)] {
        assert!((tf.amount(value) - opacity).abs() < 3e-4, "{value}: {}", tf.amount(value));
    }
    for (value, rgb) in [(0.25, [0.553_19, 0.689_04, 0.995_44]), (0.85, [0.893_78, 0.427_82, 0.334_54])] {
        let (_, got) = opacity_and_color(tf, value);
        assert!((0..3).all(|i| (got[i] - rgb[i]).abs() < 0.008), "{value}: {got:?}");
    }
    let said = imported.warnings.join("\n");
    assert!(
        said.contains("sharpness") && said.contains("diverging") && said.contains("opacities are off by"),
        "{said}"
    );
    assert!(!said.contains("1 mm"), "the file says the length: {said}");
    for (text, wanted) in [
        (r#"{"RGBPoints": [0, 0, 0, 0, 1, 1, 1, 1]}"#, "a ramp"),
        (r#"{"Points": [0, 0, 0.5, 0, 1, 1, 0.5, 0]}"#, "white"),
        (r#"[{"RGBPoints": [3, 0, 0, 0]}, {}]"#, "2 colour maps"),
        (r#"{"RGBPoints": [3, 0, 0, 0], "ColorSpace": "Oklab"}"#, "`Oklab` is not known"),
        (r#"{"RGBPoints": [3, 0, 0, 0], "ColorSpace": "Lab/CIEDE2000"}"#, "CIEDE2000, which differs"),
        (r#"{"RGBPoints": [-3, 0, 0, 0], "UseLogScale": 1}"#, "`UseLogScale` was skipped"),
        (r#"{"RGBPoints": [3, 0, 2, -1]}"#, "clamped"),
    ] {
        let said = read(text).warnings.join("\n");
        assert!(said.contains(wanted), "{text}: {said}");
    }
    let log = r#"{"UseLogScale": true, "RGBPoints": [1, 0, 0, 0, 100, 1, 1, 1], "Points": [1, 1, 0.5, 0]}"#;
    check(&read(log).tf, &[(10.0, 1.0, [0.5; 3]), (50.0, 1.0, [0.849_49; 3])]);
}

#[test]
fn slicers_lines_are_read_and_the_rest_causes_warnings() {
    let imported = read(VP);
    check(
        &imported.tf,
        &[
            (-2000.0, 0.0, [0.25, 0.5, 0.75]),
            (99.0, 0.0, [0.25 + 0.75 * 1099.0 / 1200.0, 0.5, 0.75 - 0.75 * 1099.0 / 1200.0]),
            (100.000_01, 0.5, [0.9375, 0.5, 0.0625]),
            (1550.0, 0.375, [1.0, 0.741_07, 0.482_14]),
        ],
    );
    let said = imported.warnings.join("\n");
    for wanted in ["diffuse 0.9, ambient 0.1, specular 0.2, power 10", "1 mm is assumed"] {
        assert!(said.contains(wanted), "{wanted}: {said}");
    }
    assert_eq!(imported.warnings.len(), 2, "{said}");
    assert_eq!(imported.tf.gradient_opacity, Some(GRADIENT.parse().unwrap()));
    // Its developer guide puts remarks behind the numbers, and 0 is nearest.
    let remarked: String = VP.lines().map(|line| format!("{line} => remark 1 2\n")).collect();
    assert_eq!(read(&remarked).tf, imported.tf);
    assert!(read(&VP.replacen('1', "0", 1)).warnings[0].contains("`nearest` interpolation"));
}

#[test]
fn slicers_json_also_gives_the_length() {
    let imported = read(VP_JSON);
    assert_eq!(imported.tf.reference_length_mm, 0.5);
    check(&imported.tf, &[(250.0, 0.125, [5.0 / 6.0, 5.0 / 6.0, 1.0 / 6.0]), (4000.0, 0.5, [1.0, 1.0, 0.0])]);
    let said = imported.warnings.join("\n");
    assert!(
        said.contains("`nearest`") && said.contains("diffuse 1,") && imported.warnings.len() == 2,
        "{said}"
    );
    assert_eq!(imported.tf.gradient_opacity, None, "it is 1 everywhere");
    let faint = VP_JSON.replace(r#"{"x": 0, "y": 1}, "#, r#"{"x": 0, "y": 0.5}, "#);
    let opacity = read(&faint).tf.gradient_opacity.unwrap();
    assert_eq!((opacity.factor(0.0), opacity.length()), (0.5, GradientLength::Voxel));
}

/// Gradient opacities of curves, negative gradients and many points stay within the tolerance, or cause a warning.
#[test]
fn slicers_gradient_opacity_is_sampled() {
    let with = |gradient: &str| format!("1\n0\n1\n0\n0\n1\n4 0 0 100 1\n{gradient}\n8 0 1 1 1 9 1 1 1\n");
    let opacity = |gradient: &str| read(&with(gradient)).tf.gradient_opacity;
    assert_eq!(opacity("4 0 1 255 1"), None);
    assert_eq!(opacity("4 -1e23 1 1e23 1"), None);
    assert_eq!(opacity("4 -10 0 10 1"), Some("0:0.5,10:1,per=voxel".parse().unwrap()));
    assert_eq!(opacity("2 5 0.25"), Some("0:0.25,5:0.25,per=voxel".parse().unwrap()));
    assert_eq!(opacity("6 0 0 8 0.5 8 1"), Some("0:0,8:0.5,8:1,per=voxel".parse().unwrap()));
    let many: Vec<String> = (0..40).map(|i| format!("{i} {}", f64::from(i * 7 % 40) / 40.0)).collect();
    let imported = read(&with(&format!("80 {}", many.join(" "))));
    assert!(imported.warnings.iter().any(|w| w.contains("gradient opacities are off by")));
    let line: Vec<String> = (0..40).map(|i| format!("{i} {}", f64::from(i) / 40.0)).collect();
    assert_eq!(
        opacity(&format!("80 {}", line.join(" "))),
        Some("0:0,39:0.975,per=voxel".parse().unwrap()),
        "points on a line are one segment"
    );
    let write = |name: &str, tf: &TransferFunction| {
        TRANSFER_FORMATS.iter().find(|f| f.name == name).unwrap().write.unwrap()(tf)
    };
    for text in ["0:0.25,5:0.25,8:1,per=voxel", "0:0,10:0.75,40:0.75,40:0,per=voxel"] {
        let mut tf = read(VP).tf;
        tf.gradient_opacity = Some(text.parse().unwrap());
        let written = write("vp", &tf).unwrap();
        let again = read(&written.text).tf.gradient_opacity.unwrap();
        for g in [0.0, 3.0, 7.0, 9.0, 39.0, 41.0] {
            let want = tf.gradient_opacity.as_ref().unwrap().factor(g);
            assert!((again.factor(g) - want).abs() < 1e-3, "{text} at {g}: {again}");
        }
        assert!(!written.warnings.join("").contains("gradient"));
        assert!(write("paraview", &tf).unwrap().warnings.join("").contains("gradient opacity was left out"));
        tf.gradient_opacity = Some("0:0,3:1".parse().unwrap());
        assert!(write("vp", &tf).unwrap().warnings.join("").contains("voxels of 1 mm"));
    }
}

#[test]
fn niivue_is_over_the_range_or_over_its_own() {
    let imported = read(NIIVUE);
    assert_eq!(imported.tf.units, FRACTION);
    check(
        &imported.tf,
        &[
            (0.2, 32.0 / 255.0, [0.5, 64.0 / 255.0, 0.0]),
            (0.4, 64.0 / 255.0, [1.0, 128.0 / 255.0, 0.0]),
            (1.0, 128.0 / 255.0, [1.0; 3]),
        ],
    );
    let imported = read(NIIVUE_RANGE);
    assert_eq!(imported.tf.units, "");
    check(
        &imported.tf,
        &[(-200.0, 0.0, [0.0; 3]), (55.0, 0.1, [0.5, 0.0, 0.0]), (310.0, 0.2, [1.0, 0.0, 0.0])],
    );
}

#[test]
fn inviwos_points_are_fractions_within_a_mask() {
    let imported = read(INVIWO);
    assert_eq!(imported.tf.units, FRACTION);
    check(
        &imported.tf,
        &[
            (0.249, 0.0, [0.8016, 0.0, 0.1984]),
            (0.25, 0.375, [0.8, 0.0, 0.2]),
            (0.5, 0.625, [0.4, 0.0, 0.6]),
            (0.9, 0.875, [0.0, 0.0, 1.0]),
        ],
    );
    assert!(imported.warnings[0].contains("150th"));
    check(&read(INVIWO_OLD).tf, &[(0.5, 0.25, [0.5; 3]), (1.0, 0.5, [1.0; 3])]);
    let absolute = INVIWO.replace(r#"<type content="0" />"#, r#"<type content="1"/>"#);
    assert_eq!(read(&absolute).tf.units, "");
    let dark = INVIWO.replace(r#"<maskMax content="1" />"#, r#"<maskMax content="0.1" />"#);
    assert_eq!(
        read(&dark).tf.max_extinction(f64::NEG_INFINITY, f64::INFINITY),
        0.0,
        "nothing is inside of the mask"
    );
}

#[test]
fn broken_files_are_refused_in_one_line() {
    for (text, why) in [
        ("[]", "invalid length"),
        (r#"{"RGBPoints": [1, 2, 3]}"#, "`RGBPoints` has 3 numbers"),
        (r#"{"RGBPoints": "x"}"#, "not an array of numbers"),
        (r#"{"RGBPoints": []}"#, "neither"),
        (r#"{"IndexedColors": [0, 0, 0], "Annotations": []}"#, "of categories"),
        (r#"{"RGBPoints": [1e40, 0, 0, 0]}"#, "too large"),
        (r#"{"RGBPoints": [1, 0, 0, 0], "ScalarOpacityUnitDistance": 0}"#, "above 0"),
        (r#"{"R": [0], "G": [0], "B": [0, 1]}"#, "not of one length"),
        (r#"{"R": [0, 1], "G": [0, 1], "B": [0, 1], "I": [255, 0]}"#, "goes down"),
        (r#"{"R": [0, 1], "G": [0, 1], "B": [0, 1], "min": 5, "max": 4}"#, "no range"),
        (r#"{"R": [], "G": [], "B": []}"#, "no points"),
        (r#"{"R": [0], "G": [0], "B": [0], "labels": ["a"]}"#, "labels"),
        (r#"{"volumeProperties": []}"#, "empty"),
        (r#"{"volumeProperties": [{"components": [{}]}]}"#, "`scalarOpacity` is missing"),
        ("<a/>", "no `Points`"),
        ("<a><Points/></a>", "no points"),
        ("<a><Points><Point/></Points></a>", "no `pos`"),
        ("<!DOCTYPE a [<!ENTITY x \"y\">]><a><Points/></a>", "not the XML"),
        ("1\n1\n1\n1\n1\n1\n4 0 0 1\n", "4 numbers are announced, 3 are there"),
        ("1\n1\n1\n1\n1\n1\n3 0 0 1\n4 0 1 1 1\n4 0 0 0 0", "no groups of 2"),
        ("1\n1\n1\n1\n1\n1\n4 0 0 1 x\n", "`x` is not a number"),
        ("1\n1\n1\n1\n1\n1\n2 0 0\n2 0 1\n", "line 9, the colour is missing"),
        ("1\n1\n1\n1\n1\n1\n99999999999999999999 0 0\n", "count"),
        (r#"{"points": [], "RGB": 1}"#, "unknown field"),
    ] {
        let said = from_text(text, "x.json").expect_err(text);
        assert!(said.contains(why) && !said.contains('\n'), "{text}\n gave: {said}");
    }
}

/// Reading a damaged transfer-function file gives an error, or a function that obeys the rules of this program's own
/// files.
#[test]
fn mutants_of_every_file_are_read_or_refused() {
    let mut random = fastrand::Rng::with_seed(1);
    let mut valid = 0;
    for (text, _) in ALL {
        for _ in 0..4000 {
            let mut bytes = text.as_bytes().to_vec();
            for _ in 0..random.usize(1..6) {
                if bytes.len() < 2 {
                    break;
                }
                let at = random.usize(0..bytes.len());
                match random.u8(0..6) {
                    0 => bytes[at] = random.u8(32..127),
                    1 => bytes[at] = b"0123456789eE+-.,[]{}<>\" "[random.usize(0..24)],
                    2 => _ = bytes.remove(at),
                    3 => bytes.insert(at, random.u8(32..127)),
                    4 => bytes.truncate(at.max(1)),
                    _ => {
                        let piece = bytes[at..(at + random.usize(0..40)).min(bytes.len())].to_vec();
                        bytes.splice(at..at, piece);
                    }
                }
            }
            let Ok(mutant) = String::from_utf8(bytes) else { continue };
            match from_text(&mutant, "") {
                Ok(Imported { tf, .. }) => {
                    TransferFunction::from_json(&tf.to_json())
                        .unwrap_or_else(|why| panic!("{mutant}: {why}"));
                    valid += 1;
                }
                Err(why) => assert!(!why.contains('\n'), "{why}"),
            }
        }
    }
    assert!(valid > 1000, "some mutants are still functions: {valid}");
}

/// Transfer-function files with many points or long text are read quickly, and give functions small enough for a
/// device.
#[test]
fn large_files_become_functions_that_a_device_can_hold() {
    let wild = |i: usize| (i * 7919 % 1000) as f64 / 1000.0;
    let list: Vec<String> = (0..16_000).map(|i| format!("{i}, {}, 0.5, 0.3", wild(i))).collect();
    let colors: Vec<String> = (0..16_000).map(|i| format!("{i}, {0}, {0}, {0}", wild(i + 3))).collect();
    let text = format!(r#"{{"Points": [{}], "RGBPoints": [{}]}}"#, list.join(","), colors.join(","));
    let imported = read(&text);
    assert!(imported.tf.points.len() <= 1000);
    assert!(imported.warnings.iter().any(|w| w.contains("opacities are off by")), "{:?}", imported.warnings);
    let deep = "[".repeat(100_000);
    assert!(from_text(&deep, "x.json").is_err());
    let many = format!("<a>{}</a>", "<b/>".repeat(600_000));
    assert!(from_text(&many, "x.itf").is_err());
}

fn functions() -> impl Strategy<Value = TransferFunction> {
    let point = (-50..300i32, 0..=1000u32, any::<[u8; 3]>());
    (proptest::collection::vec(point, 1..12), any::<bool>(), 0.05..20.0f64).prop_map(
        |(mut raw, of_opacity, length)| {
            raw.sort_by_key(|p| p.0);
            let quantity = if of_opacity { Quantity::Opacity } else { Quantity::Extinction };
            let mut tf = TransferFunction::new(quantity, &[]);
            tf.reference_length_mm = if of_opacity { length } else { 1.0 };
            for (value, amount, rgb) in raw {
                let value = f64::from(value) * 7.3;
                if tf.points.iter().filter(|p| p.value == value).count() < 2 {
                    let color = rgb.map(|c| linear_from_srgb(f64::from(c) / 255.0));
                    tf.points.push(crate::transfer::ControlPoint {
                        value,
                        amount: f64::from(amount) / 1000.0,
                        color,
                    });
                }
            }
            tf
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn own_files_are_read_back_unchanged(tf in functions()) {
        let text = (TRANSFER_FORMATS.iter().find(|f| f.name == "umbravox").unwrap().write.unwrap())(&tf).unwrap().text;
        let again = from_text(&text, "").unwrap().tf;
        prop_assert_eq!(again.points, tf.points);
        prop_assert_eq!(again.reference_length_mm, tf.reference_length_mm);
    }

    #[test]
    fn written_files_are_read_back(tf in functions()) {
        for name in ["paraview", "vp"] {
            let format = TRANSFER_FORMATS.iter().find(|f| f.name == name).unwrap();
            let written = (format.write.unwrap())(&tf).unwrap();
            let again = from_text(&written.text, "").unwrap();
            prop_assert_eq!(again.format, name);
            let is_rough = written.warnings.iter().any(|w| w.contains("no room"));
            for i in -400..2300 {
                let value = f64::from(i) + 0.123;
                // Compared as opacities over 1 mm, where differences near 1 are invisible.
                let [want, got] = [&tf, &again.tf].map(|f| -(-f.extinction(value)).exp_m1());
                // A .vp line that is too short causes no warning below these errors; the error between points is
                // estimated to a tenth.
                let allowed = if is_rough { 0.2 } else { 1.1 * OPACITY_WARNING * want + 3e-4 };
                prop_assert!((want.min(MAX_OPACITY) - got).abs() <= allowed, "{}: {} {} {}", name, value, want, got);
                if want > 1e-9 && !is_rough {
                    let off = (1.1 * COLOR_WARNING + 1.1) / 255.0;
                    let [a, b] = [&tf, &again.tf].map(|f| f.color(value).map(srgb_from_linear));
                    prop_assert!((0..3).all(|c| (a[c] - b[c]).abs() < off), "{}: {} {:?} {:?}", name, value, a, b);
                }
            }
        }
    }
}

#[test]
fn fractions_stay_fractions_in_paraview_and_need_a_range_in_vp() {
    for preset in crate::transfer::presets::PRESETS {
        let tf = preset.transfer_function();
        let write =
            |name: &str| TRANSFER_FORMATS.iter().find(|f| f.name == name).unwrap().write.unwrap()(&tf);
        let again = read(&write("paraview").unwrap().text).tf;
        assert_eq!(has_fractions(&again), has_fractions(&tf), "{}", preset.name);
        assert_eq!(write("vp").is_err(), has_fractions(&tf), "{}", preset.name);
        for i in -10..20 {
            let (value, far) = (f64::from(i) * 0.1 + 0.05, 3.0);
            assert!(
                (again.amount(value) - (1.0 - (-tf.extinction(value)).exp())).abs() < 2e-3,
                "{} {value}",
                preset.name
            );
            assert!((again.extinction(far) - tf.extinction(far)).abs() <= 2e-3 * tf.extinction(far));
        }
    }
}

#[test]
fn every_line_of_a_vp_is_short_enough_for_slicer() {
    let mut tf = TransferFunction::new(Quantity::Opacity, &[]);
    for i in 0..300 {
        let color = [0.0, 0.5, 1.0].map(|c| (c + f64::from(i) * 0.37) % 1.0);
        let amount = f64::from(i * 37 % 100) / 100.0;
        tf.points.push(crate::transfer::ControlPoint { value: f64::from(i) * 1.1, amount, color });
    }
    let written = TRANSFER_FORMATS.iter().find(|f| f.name == "vp").unwrap().write.unwrap()(&tf).unwrap();
    assert!(written.text.lines().all(|line| line.len() <= 1023));
    assert_eq!(
        written.warnings.iter().filter(|w| w.contains("no room")).count(),
        2,
        "{:?}",
        written.warnings
    );
    read(&written.text);
}
