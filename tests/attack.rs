//! The search that tries to break the promise of `dsm`: 2,000 scenes, always the same ones.

#[path = "common/attack.rs"]
mod attack;

use attack::Attack;
use fastrand::Rng;
use std::sync::Arc;
use umbravox::gpu::Gpu;
use umbravox::render::Renderer;

/// Scenes at random, and steps that make the worst of each few of them worse.
const STARTS: usize = 1000;
const CLIMBS: usize = 50;
const STEPS: usize = 20;

#[test]
fn no_scene_breaks_the_promise() {
    let renderer = match Gpu::open(None) {
        // Values that change from scene to scene are read as storage: llvmpipe would compile anew for each.
        Ok(gpu) => Arc::new(Renderer::live(gpu, f64::INFINITY)),
        Err(e) if e.what == "no graphics adapter" => return println!("skipped: no graphics adapter"),
        Err(e) => panic!("{e}"),
    };
    let count =
        |name: &str, usual: usize| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(usual);
    let (starts, seed) = (count("ATTACK_STARTS", STARTS), count("ATTACK_SEED", 1) as u64);
    let mut rng = Rng::with_seed(seed);
    let mut broken = Vec::new();
    let mut worst: Vec<(f64, Attack)> = Vec::new();
    let (mut depths, mut limited) = (0, 0);
    let mut attempt = |attack: Attack, what: String, worst: &mut Vec<(f64, Attack)>| {
        let outcome = attack.run(&renderer).unwrap_or_else(|e| panic!("{what}: {e}: {attack:?}"));
        depths += outcome.report.depths;
        limited += outcome.report.limited;
        let Bound { transmittance, depth_mm, .. } = outcome.bound;
        if !outcome.held()
            || transmittance > attack.epsilon + 0.005
            || depth_mm > 0.25 * outcome.min_spacing_mm
        {
            broken.push(format!("{what}: {:?}\n  {:?}", outcome, Shown(&attack)));
        }
        worst.push((outcome.margin() / transmittance, attack));
        outcome.margin() / transmittance
    };
    let clock = std::time::Instant::now();
    for start in 0..starts {
        let attack = Attack::random(&mut rng);
        attempt(attack, format!("start {start}"), &mut worst);
    }
    println!("{starts} starts in {:.1} s", clock.elapsed().as_secs_f64());
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    worst.truncate(CLIMBS);
    for (climb, (mut margin, mut attack)) in std::mem::take(&mut worst).into_iter().enumerate() {
        for step in 0..STEPS {
            let next = attack.changed(&mut rng);
            let reached = attempt(next.clone(), format!("climb {climb} step {step}"), &mut worst);
            if reached > margin {
                (margin, attack) = (reached, next);
            }
        }
    }
    println!("{depths} depths, {limited} of them limited by float32; {:.1} s", clock.elapsed().as_secs_f64());
    assert!(broken.is_empty(), "{} broken\n{}", broken.len(), broken[..broken.len().min(12)].join("\n"));
}

use umbravox::shadow::Bound;

/// A scene without its voxels.
struct Shown<'a>(&'a Attack);

impl std::fmt::Debug for Shown<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let a = self.0;
        let points = &a.points[..a.points.len().min(12)];
        write!(
            f,
            "{:?} voxels of {:?} mm turn {:?} shear {:?} whole {} {:?}/{} {:?} ({} points) {:?} {}",
            a.dims,
            a.spacing_mm,
            a.turn,
            a.shear,
            a.whole,
            a.quantity,
            a.reference_length_mm,
            points,
            a.points.len(),
            a.light,
            a.method()
        )
    }
}
