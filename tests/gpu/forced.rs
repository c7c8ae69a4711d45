//! Skipped work that is forced on with `--no-skip`: nothing is skipped any more, and no picture changes.

use super::*;
use clap::ValueEnum;
use umbravox::render::Optimization;
use umbravox::scene::{Camera, Shading};

/// Scene in which an optimization skips work.
struct Case {
    what: Optimization,
    volume: Arc<Volume>,
    tf: TransferFunction,
    methods: &'static [&'static str],
    edit: fn(Scene) -> Scene,
}

fn cases(volume: &Arc<Volume>, range: [f64; 2]) -> Vec<Case> {
    let [ramp, jumps, _] = transfer_functions(range);
    let mut gray = jumps.clone();
    gray.points.iter_mut().for_each(|p| p.color = [0.8, 0.5, 0.2]);
    let same = |s: Scene| s;
    let case = |what, tf: &TransferFunction, methods, edit| Case {
        what,
        volume: Arc::clone(volume),
        tf: tf.clone(),
        methods,
        edit,
    };
    let maps: &[_] = &[
        "dsm:map=192",
        "dsm:map=192,march=samples",
        "osm:layers=8,map=192",
        "dom:layers=7,map=192",
        "bom:layers=7,map=192",
        "bom:layers=7,map=192,march=samples",
    ];
    vec![
        case(Optimization::Bricks, &jumps, maps, same),
        case(Optimization::EyeTiles, &jumps, &["none", "rays", "dsm:map=64", "dsm:map=64,lookup=each"], same),
        case(Optimization::EyeTiles, &jumps, &["none", "osm:map=64"], |s| {
            // A camera inside the volume, so that some bricks lie beside and behind the eye.
            let eye = s.camera.target + 0.12 * (s.camera.eye - s.camera.target);
            Scene { camera: Camera { eye, fov_deg: 110.0, ..s.camera }, ..s }
        }),
        case(Optimization::Tiles, &jumps, maps, same),
        case(Optimization::Gradients, &ramp, &["none", "dsm:map=64"], same),
        case(Optimization::MarchTable, &ramp, &["none", "dsm:map=64,precompress=off"], same),
        case(Optimization::BreakpointSearch, &jumps, &["dsm:map=64", "rays", "dom:layers=7,map=64"], same),
        case(Optimization::Colors, &gray, &["none", "dsm:map=64"], same),
        case(Optimization::Shadows, &gray, &["none", "dsm:map=64"], |s| Scene { ambient: 1.0, ..s }),
        case(Optimization::DepthPass, &jumps, &["dom:layers=7,map=64", "bom:layers=7,map=64"], same),
    ]
}

/// Asserts that forcing skipped work changes no picture, and returns the optimizations that had skipped it.
fn forcing_changes_nothing(volume: &Arc<Volume>, range: [f64; 2], name: &str) -> Vec<Optimization> {
    let mut seen = Vec::new();
    for Case { what, volume, tf, methods, edit } in cases(volume, range) {
        let Some(lean) = Setup::open(&volume, &tf) else { return seen };
        let Some(forced) = Setup::forced(&volume, &tf, DisabledOptimizations::only(what)) else {
            return seen;
        };
        for method in methods {
            let scene = edit(lean.scene(61, 47));
            let [a, b] = [&lean, &forced].map(|setup| {
                let map = setup.shadow(method, scene.light());
                setup
                    .session
                    .renderer
                    .render(&setup.session.loaded, &setup.session.transfer, &map, &scene)
                    .unwrap()
            });
            let named =
                |plan: &umbravox::render::Plan| plan.left_out.iter().any(|o| o.optional == Some(what));
            seen.extend(named(&a.plan).then_some(what));
            assert!(!named(&b.plan), "{name}, {what}, {method}: {:?}", b.plan.left_out);
            let off = largest_difference(&a.pixels, &b.pixels);
            assert!(off <= tolerance::FORCED, "{name}, {what}, {method}: {off:e}");
        }
    }
    seen
}

#[test]
fn forcing_phantoms() {
    let mut seen = forcing_changes_nothing(&phantom("thorax:96"), [-900.0, 1200.0], "thorax");
    seen.extend(forcing_changes_nothing(&phantom("shell:64"), [0.0, 1000.0], "shell"));
    let never: Vec<_> = Optimization::value_variants().iter().filter(|o| !seen.contains(o)).collect();
    assert!(renderer().is_none() || never.is_empty(), "nothing was left out by {never:?}");
}

#[test]
fn forcing_scans() {
    for (name, range) in [("CT_AVM", [0.0, 900.0]), ("engine", [60.0, 250.0])] {
        let Some(volume) = scan(name) else { continue };
        forcing_changes_nothing(&volume, range, name);
    }
}

#[test]
fn disabling_all_optimizations_changes_no_picture() {
    let volume = phantom("thorax:80");
    let [ramp, ..] = transfer_functions([-900.0, 1200.0]);
    let Some(lean) = Setup::open(&volume, &ramp) else { return };
    let Some(forced) = Setup::forced(&volume, &ramp, "all".parse().unwrap()) else { return };
    for method in ["none", "rays", "dsm:map=64", "osm:layers=16,map=64", "bom:layers=15,map=64"] {
        let scene = lean.scene(51, 37);
        let off = largest_difference(&lean.picture(method, &scene), &forced.picture(method, &scene));
        assert!(off <= tolerance::FORCED, "{method}: {off:e}");
    }
}

#[test]
fn points_outside_the_view_need_no_shadows() {
    let volume = phantom("shell:40");
    let [ramp, ..] = transfer_functions([0.0, 1000.0]);
    let Some(setup) = Setup::open(&volume, &ramp) else { return };
    let framed = setup.scene(40, 30);
    let needs = |camera: Camera| {
        let scene = Scene { camera, ..framed.clone() };
        umbravox::render::needs_shadows(&scene, setup.volume(), &setup.session.transfer)
    };
    let Camera { eye, target, up, .. } = framed.camera;
    let side = (target - eye).cross(up);
    assert_eq!(needs(framed.camera), Ok(()));
    assert_eq!(needs(Camera { target: eye + side, ..framed.camera }), Err("nothing is in view"));
    assert_eq!(needs(Camera { target: 2.0 * eye - target, ..framed.camera }), Err("nothing is in view"));
    assert_eq!(needs(Camera { eye: target, target: target + side, ..framed.camera }), Ok(()), "inside");
    let away = Scene { camera: Camera { target: eye + side, ..framed.camera }, ..framed.clone() };
    let picture = setup.picture("dsm:map=64", &away);
    assert!(picture.index_axis(ndarray::Axis(2), 3).iter().all(|a| *a == 0.0), "and nothing is seen");
}

#[test]
fn shading_counts_only_when_enabled() {
    // The forced gradients must not be mistaken for a shading that was asked for, nor the other way round.
    let volume = phantom("shell:40");
    let [ramp, ..] = transfer_functions([0.0, 1000.0]);
    let Some(plain) = Setup::open(&volume, &ramp) else { return };
    let Some(forced) = Setup::forced(&volume, &ramp, DisabledOptimizations::only(Optimization::Gradients))
    else {
        return;
    };
    let scene = Scene { shading: Shading::Lambert, ..plain.scene(40, 30) };
    let [lambert, also] = [&plain, &forced].map(|s| s.picture("none", &scene));
    assert_eq!(largest_difference(&lambert, &also), 0.0);
    let flat = plain.picture("none", &plain.scene(40, 30));
    assert!(largest_difference(&lambert, &flat) > 0.05);
}
