//! Search for random scenes that violate the error bounds of `dsm` and `rays` (`docs/bound.md`); it repeats the same
//! scenes. Methods without an error bound must return a transmittance in time.

use crate::common::{self, SIZES};
use crate::scenes::{self as attack, Attack};
use fastrand::Rng;
use glam::DVec3;
use std::sync::Arc;
use std::time::{Duration, Instant};
use umbravox::render::{DisabledOptimizations, Renderer, Session};
use umbravox::scene::Light;
use umbravox::shadow;

/// Time limit of one build and query: a graphics driver would reset the device after a longer one.
const LONGEST: Duration = Duration::from_secs(20);

fn search(tries: usize, compress: &'static str) {
    let seed = attack::setting("ATTACK_SEED", 1) as u64;
    let Some(gpu) = common::gpu() else { return };
    let found = attack::search(gpu, tries, seed, compress);
    println!("{}", found.summary());
    assert!(found.tries > tries / 2 && found.depths > 1000 * found.tries, "{}", found.summary());
    assert!(found.broken.is_empty(), "{}", found.summary());
}

#[test]
fn no_scene_violates_the_error_bound() {
    search(attack::setting("ATTACK_TRIES", SIZES.bound_search_scenes), "greedy");
}

#[test]
fn no_scene_violates_the_error_bound_with_lines_of_transmittance() {
    search(attack::setting("ATTACK_TRIES", SIZES.bound_search_scenes) / 4, "greedy,segments=transmittance");
}

#[test]
fn no_scene_violates_the_error_bound_with_the_fewest_nodes() {
    search(attack::setting("ATTACK_TRIES", SIZES.bound_search_scenes) / 4, "optimal");
}

/// Random `osm`, `dom` or `bom` method with its own split; few other settings vary, since each variant compiles a
/// shader.
fn layered_method(rng: &mut Rng) -> String {
    let one_of = |rng: &mut Rng, all: &[&str]| all[rng.usize(..all.len())].to_owned();
    let name = one_of(rng, &["osm", "dom", "bom"]);
    let split = if name == "osm" {
        format!("slicing={}", one_of(rng, &["uniform", "density", "gamma", "lit"]))
    } else {
        format!("split={}", one_of(rng, &["linear", "growing", "log", "hybrid", "auto", "texel"]))
    };
    format!("{name}:{split},layers={},map={}", one_of(rng, &["1", "7", "32"]), rng.u32(2..40))
}

/// Describes the fault of a shadow method on a scene; `None` if there is none.
fn fault(renderer: &Arc<Renderer>, attack: &Attack, method: &str, rng: &mut Rng) -> Option<String> {
    let clock = Instant::now();
    let volume = Arc::new(attack.volume());
    let tf = attack.transfer_function();
    let corners = volume.corners_mm();
    let (low, high) =
        corners.iter().fold((corners[0], corners[0]), |(low, high), c| (low.min(*c), high.max(*c)));
    let points: Vec<_> =
        (0..200).map(|_| low + (high - low) * DVec3::new(rng.f64(), rng.f64(), rng.f64())).collect();
    let asked = || {
        let session = Session::on(renderer, volume, &tf, DisabledOptimizations::NONE)?;
        let map = session.shadow(shadow::parse(method)?.as_ref(), attack.light)?;
        session.query(&map, &points)
    };
    match asked() {
        Err(e) => Some(e.to_string()),
        Ok(_) if clock.elapsed() > LONGEST => Some(format!("it took {:?}", clock.elapsed())),
        Ok(found) => {
            found.iter().find(|t| !(0.0..=1.0).contains(*t)).map(|t| format!("a transmittance of {t}"))
        }
    }
}

#[test]
fn methods_without_an_error_bound_end_with_a_transmittance() {
    let Some(gpu) = common::gpu() else { return };
    let renderer = Arc::new(Renderer::live(gpu, f64::INFINITY));
    let mut rng = Rng::with_seed(attack::setting("ATTACK_SEED", 1) as u64);
    let mut faults = Vec::new();
    for _ in 0..attack::setting("ATTACK_OTHERS", SIZES.unbounded_scenes) {
        let mut scene = Attack::random(&mut rng);
        // Extinction and voxels of any size: extreme scenes are intended here.
        let factor = 10f64.powf(rng.f64() * 12.0 - 6.0);
        scene.spacing_mm = scene.spacing_mm.map(|mm| mm * factor);
        if let Light::Point { position } = &mut scene.light {
            *position *= factor;
        }
        let method = layered_method(&mut rng);
        if let Some(why) = fault(&renderer, &scene, &method, &mut rng) {
            faults.push(format!("{method}: {why}\n  {}", scene.shown()));
        }
    }
    assert!(faults.is_empty(), "{} faults\n{}", faults.len(), faults[..faults.len().min(8)].join("\n"));
}
