//! Settings of every shadow method: how they are parsed, shown in tables and refused. A new method adds its rows
//! here.

use std::collections::BTreeSet;
use umbravox::shadow::{METHODS, MethodSpec, parse_list};

/// Lists of shadow methods as on the command line, and the `params` of their table rows. Defaults are not shown.
const ACCEPTED: &[(&str, &[&str])] = &[
    ("none", &[""]),
    ("rays", &[""]),
    (
        "rays:estimator=ratio,unbiased,samples=2,seed=7",
        &["estimator=ratio samples=2 seed=7", "estimator=unbiased samples=2 seed=7"],
    ),
    ("rays:march=samples,step=2", &["march=samples step=2"]),
    ("dsm", &["epsilon=0.02"]),
    ("osm", &["layers=32"]),
    (
        "osm:layers=8,512,slicing=density,gamma",
        &[
            "layers=8 slicing=density",
            "layers=8 slicing=gamma",
            "layers=512 slicing=density",
            "layers=512 slicing=gamma",
        ],
    ),
    ("osm:kernel=3,bits=16,filter=nearest,map=64", &["layers=32 kernel=3 bits=16 filter=nearest"]),
    ("osm:between=cubic,filter=gauss", &["layers=32 between=cubic filter=gauss"]),
    // The mean of `filter=pcf` is that of transmittance, over 3 x 3 texels.
    ("osm:kernel=3,filter=pcf,average=depth", &["layers=32 filter=pcf"]),
    ("dsm:filter=gauss,pcf,align=on", &["epsilon=0.02 filter=gauss", "epsilon=0.02 filter=pcf"]),
    ("dom", &["layers=15"]),
    (
        "dom:layers=3,7,beyond=extend,ignore,cover",
        &[
            "layers=3",
            "layers=3 beyond=ignore",
            "layers=3 beyond=cover",
            "layers=7",
            "layers=7 beyond=ignore",
            "layers=7 beyond=cover",
        ],
    ),
    (
        "dom:spread=0.5,depth_bits=8,bits=32,filter=nearest,map=64",
        &["layers=15 spread=0.5 depth_bits=8 bits=32 filter=nearest"],
    ),
    (
        "dom:layers=7,split=linear,growing,hybrid,auto",
        &["layers=7 split=linear", "layers=7", "layers=7 split=hybrid ratio=0.5", "layers=7 split=auto"],
    ),
    ("dom:spread=0.25,beyond=cover", &["layers=15 beyond=cover"]),
    ("bom", &["layers=15 ratio=0.5"]),
    (
        "bom:layers=7,split=linear,growing,log,hybrid,auto,texel",
        &[
            "layers=7 split=linear",
            "layers=7 split=growing",
            "layers=7 split=log",
            "layers=7 ratio=0.5",
            "layers=7 split=auto",
            "layers=7 split=texel",
        ],
    ),
    ("bom:ratio=0,0.25", &["layers=15 ratio=0", "layers=15 ratio=0.25"]),
    (
        "bom:split=auto,measure=difference,depth_bits=32,bits=16,filter=nearest",
        &["layers=15 split=auto measure=difference depth_bits=32 bits=16 filter=nearest"],
    ),
    ("clusters", &["clusters=4"]),
    (
        "clusters:clusters=2,iterations=1,4,bits=32,map=64",
        &["clusters=2 bits=32", "clusters=2 iterations=4 bits=32"],
    ),
    ("fourier", &["terms=7"]),
    (
        "fourier:terms=3,15,damping=lanczos,bits=32,map=64",
        &["terms=3 damping=lanczos bits=32", "terms=15 damping=lanczos bits=32"],
    ),
    ("fourier:range=texel", &["terms=7 range=texel"]),
    ("avsm", &["nodes=8"]),
    ("avsm:nodes=4,16,bits=32,map=64", &["nodes=4 bits=32", "nodes=16 bits=32"]),
    ("moments", &["moments=6"]),
    (
        "moments:moments=4,8,basis=trigonometric,beta=0.5,map=64",
        &["moments=4 basis=trigonometric beta=0.5", "moments=8 basis=trigonometric beta=0.5"],
    ),
    ("moments:bits=16", &["moments=6 bits=16"]),
    ("wavelet", &["rank=4"]),
    ("wavelet:rank=1,6,range=texel,bits=32", &["rank=1 range=texel bits=32", "rank=6 range=texel bits=32"]),
    ("beer", &[""]),
    ("beer:mean=matter,bits=16,32,map=64", &["mean=matter", "mean=matter bits=32"]),
    ("sat", &["scale=2 boxes=16"]),
    (
        "sat:scale=1,boxes=8,64,angle=3,filter=nearest",
        &["scale=1 boxes=8 angle=3 filter=nearest", "scale=1 boxes=64 angle=3 filter=nearest"],
    ),
    ("halfangle", &["slices=64"]),
    (
        "halfangle:slices=8,256,between=constant,map=64",
        &["slices=8 between=constant", "slices=256 between=constant"],
    ),
    ("lightvolume", &["scale=2 build=gather"]),
    (
        "lightvolume:scale=1,1.5,build=sweep,bits=8,average=depth",
        &["scale=1 build=sweep bits=8 average=depth", "scale=1.5 build=sweep bits=8 average=depth"],
    ),
];

/// Shadow methods that are refused, and a part of the error message.
const REFUSED: &[(&str, &str)] = &[
    ("osm:layers=0", "osm:layers=0): expected 1..512"),
    ("osm:layers=513", "expected 1..512"),
    ("osm:layers=2.5", "expected 1..512"),
    ("osm:slicing=bsp", "expected uniform|density|lit|gamma"),
    ("osm:kernel=2", "expected 1|3"),
    ("osm:bits=24", "expected 8|16|32"),
    ("osm:map=0", "expected auto|1..8192"),
    ("osm:filter=linear", "expected nearest|bilinear|gauss|pcf"),
    ("osm:between=spline", "expected linear|cubic"),
    ("dom:between=cubic", "there is: layers, split"),
    ("lightvolume:filter=pcf", "there is: scale, build"),
    ("halfangle:slices=0", "expected 1..1024"),
    ("halfangle:between=cubic", "expected linear|constant"),
    ("halfangle:near=4", "there is: slices, between, march, step, map, fit, filter, lookup"),
    ("sat:filter=pcf", "expected nearest|bilinear"),
    ("sat:scale=0.4", "expected 0.5..8"),
    ("sat:boxes=1", "expected 2..1024"),
    ("sat:angle=121", "expected light|0..120"),
    ("sat:map=64", "there is: scale, boxes, angle, filter, near, lookup"),
    (
        "osm:epsilon=0.1",
        "there is: layers, slicing, kernel, between, bits, from, march, step, map, fit, filter, near, average, lookup",
    ),
    ("dom:layers=0", "dom:layers=0): expected 1..512"),
    ("dom:spread=0", "expected 0.001..1"),
    ("dom:spread=nan", "expected 0.001..1"),
    ("dom:beyond=clamp", "expected extend|ignore|cover"),
    ("dom:depth_bits=12", "expected 8|16|32"),
    (
        "dom:slicing=uniform",
        "there is: layers, split, ratio, log_size, measure, spread, beyond, depth_bits, bits, from, march, step, map, \
        fit, filter, near, align, average, lookup",
    ),
    ("bom:layers=600", "bom:layers=600): expected 1..512"),
    ("bom:ratio=1.1", "expected 0..1"),
    ("bom:split=quadratic", "expected linear|growing|log|hybrid|auto|texel"),
    ("bom:split=auto,measure=entropy", "expected correlation|difference"),
    ("bom:split=log,ratio=0.5", "bom:ratio): it has an effect with split=hybrid only"),
    ("bom:split=auto,ratio=0.5", "bom:ratio): it has an effect with split=hybrid only"),
    ("bom:measure=correlation", "bom:measure): it has an effect with split=auto only"),
    ("bom:split=texel,measure=difference", "bom:measure): it has an effect with split=auto only"),
    ("bom:beyond=extend", "there is: layers, split, ratio"),
    ("clusters:clusters=17", "expected 1..16"),
    ("clusters:iterations=3", "expected 1|2|4|8"),
    ("fourier:terms=0", "expected 1..31"),
    ("fourier:bits=8", "expected 16|32"),
    ("fourier:damping=gauss", "expected none|lanczos"),
    ("avsm:nodes=5", "expected 4|6|8|12|16|24|32"),
    ("avsm:epsilon=0.1", "there is: nodes, bits, from, march, step, map, fit, filter, near, align, lookup"),
    ("wavelet:rank=0", "expected 1..6"),
    ("wavelet:rank=7", "expected 1..6"),
    ("wavelet:terms=7", "there is: rank, range, bits, from, march, step, map, fit, filter, near, lookup"),
    ("beer:mean=median", "expected extent|matter"),
    ("beer:layers=8", "there is: mean, bits, from, march, step, map, fit, filter, near, align, lookup"),
    ("moments:moments=5", "expected 4|6|8"),
    ("dsm:segments=linear", "expected transmittance|optical_depth"),
    (
        "dsm:compress=optimal,segments=optical_depth",
        "dsm:segments): it has an effect with compress=greedy only",
    ),
    ("dsm:enclose=yes", "expected off|on"),
    ("moments:measure=mass", "expected depth|light"),
    ("moments:beta=2", "expected 0..1"),
    ("moments:bias=-1", "expected 0..10000"),
    ("lightvolume:scale=0.4", "expected 0.5..64"),
    ("lightvolume:build=both", "expected gather|sweep"),
    ("lightvolume:map=64", "there is: scale, build, bits, average, march, step, lookup"),
];

#[test]
fn accepted_methods_show_what_is_not_default() {
    for (text, params) in ACCEPTED {
        let shown: Vec<_> = parse_list(text).unwrap().iter().map(|m| m.params()).collect();
        assert_eq!(shown, *params, "{text}");
    }
    for method in ["osm", "dom"] {
        assert_eq!(parse_list(&format!("{method}:map=64")).unwrap()[0].map_size(), Some(64));
    }
}

#[test]
fn bad_settings_are_refused_with_the_values_that_are_possible() {
    for (text, part) in REFUSED {
        let error = parse_list(text).unwrap_err();
        assert!(error.to_string().contains(part), "{error}");
        assert_eq!(error.exit_status(), 2);
    }
}

/// `march` has no effect with an estimator, and so `step` has none, although `march=samples` is stored.
#[test]
fn settings_without_effect_are_not_written() {
    let spec: MethodSpec = "rays:march=samples,step=8".parse().unwrap();
    let random = spec.with("estimator", "ratio").unwrap();
    let text = random.to_string();
    assert!(!text.contains("step") && !text.contains("march"), "{text}");
    let read: MethodSpec = text.parse().unwrap();
    assert_eq!(read.to_string(), text);
    assert_eq!(random.with("estimator", "off").unwrap().to_string(), "rays:march=samples,step=8");
}

#[test]
fn every_method_has_its_rows() {
    let names = |rows: &mut dyn Iterator<Item = &'static str>| -> BTreeSet<&'static str> {
        rows.map(|text| text.split(':').next().unwrap()).collect()
    };
    let accepted = names(&mut ACCEPTED.iter().map(|row| row.0));
    let refused = names(&mut REFUSED.iter().map(|row| row.0));
    for method in METHODS.iter().filter(|m| m.name != "half") {
        assert!(accepted.contains(method.name), "ACCEPTED has no row for {}", method.name);
        // Settings of `rays` and `dsm` are tested beside their code.
        let plain = method.keys.is_empty() || ["rays", "dsm"].contains(&method.name);
        assert!(plain || refused.contains(method.name), "REFUSED has no row for {}", method.name);
    }
}
