//! Search for scenes that violate the error bound.

use super::Attack;
use fastrand::Rng;
use std::sync::Arc;
use umbravox::Error;
use umbravox::gpu::Gpu;
use umbravox::render::Renderer;
use umbravox::shadow::Bound;

/// Reads a number from an environment variable, or returns the default.
pub fn setting(name: &str, usual: usize) -> usize {
    std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(usual)
}

/// Results of a search for violations of the error bound.
#[derive(Default)]
pub struct Found {
    pub tries: usize,
    pub depths: usize,
    /// Number of points between the rays of texels.
    pub points: usize,
    /// Number of depths whose error only neighbouring curves explain.
    pub limited: usize,
    /// Distance of the worst depth to the edge of its error band, relative to the bound; above 0 is outside.
    pub nearest: f64,
    /// Number of scenes with pre-filtered rays that the adapter's loop limit ended.
    pub refused: usize,
    /// Scenes that violate the error bound, or whose bound is larger than requested.
    pub broken: Vec<String>,
    pub adapter: String,
    pub seconds: f64,
}

impl Found {
    pub fn summary(&self) -> String {
        let Self { tries, depths, points, limited, nearest, refused, adapter, seconds, .. } = self;
        format!(
            "{tries} scenes on {adapter}, {depths} depths, {limited} of them limited by float32, {points} points, the \
            nearest depth to its edge {nearest:.4} of the bound, {refused} refused by the adapter, {} broken, {seconds:.0} s\n{}",
            self.broken.len(),
            self.broken[..self.broken.len().min(12)].join("\n")
        )
    }
}

/// Returns whether the hint of an error has a text.
fn hints_at(error: &Error, text: &str) -> bool {
    error.hint.as_deref().is_some_and(|hint| hint.contains(text))
}

/// Number of tries for each climb to a worse scene.
const STARTS_A_CLIMB: usize = 20;

/// Searches `tries` scenes with one compression of maps: half of them at random, half by changing the worst.
pub fn search(gpu: Gpu, tries: usize, seed: u64, compress: &'static str) -> Found {
    let mut found = Found { adapter: gpu.info.name.clone(), nearest: f64::NEG_INFINITY, ..Found::default() };
    // Constants that change from scene to scene are read from storage buffers: llvmpipe would compile each anew.
    let renderer = Arc::new(Renderer::live(gpu, f64::INFINITY));
    let clock = std::time::Instant::now();
    let mut rng = Rng::with_seed(seed);
    let climbs = (tries / 2 / STARTS_A_CLIMB).max(1);
    let mut worst: Vec<(f64, Attack)> = Vec::new();
    for start in 0..tries / 2 {
        let attack = Attack { compress, ..Attack::random(&mut rng) };
        let nearness = found.attempt(&renderer, &attack, &format!("start {start}"));
        worst.push((nearness, attack));
        if worst.len() > 2 * climbs {
            worst.sort_by(|a, b| b.0.total_cmp(&a.0));
            worst.truncate(climbs);
        }
    }
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    worst.truncate(climbs);
    let steps = (tries - tries / 2) / worst.len().max(1);
    for (climb, (mut nearness, mut attack)) in worst.into_iter().enumerate() {
        for step in 0..steps {
            let next = attack.changed(&mut rng);
            let reached = found.attempt(&renderer, &next, &format!("climb {climb} step {step}"));
            if reached > nearness {
                (nearness, attack) = (reached, next);
            }
        }
    }
    found.seconds = clock.elapsed().as_secs_f64();
    found
}

impl Found {
    /// Runs one scene, and returns its distance to the edge of its error band.
    fn attempt(&mut self, renderer: &Arc<Renderer>, attack: &Attack, what: &str) -> f64 {
        let outcome = match attack.run(renderer) {
            Ok(outcome) => outcome,
            // Nine marches for each step may exceed the loop limit of a software adapter, which reports it.
            Err(e) if attack.prefilter.is_some_and(|n| n > 1) && hints_at(&e, "fewer pre-filter taps") => {
                self.refused += 1;
                return f64::NEG_INFINITY;
            }
            // So may prisms that meet many voxels.
            Err(e) if attack.encloses && hints_at(&e, "prisms of a larger map") => {
                self.refused += 1;
                let without = Attack { encloses: false, ..attack.clone() };
                return self.attempt(renderer, &without, what);
            }
            Err(e) => {
                self.broken.push(format!("{what}: {e}\n  {}", attack.shown()));
                return f64::NEG_INFINITY;
            }
        };
        let Bound { transmittance, depth_mm, align_mm, .. } = outcome.bound;
        let nearness = outcome.margin() / transmittance;
        self.tries += 1;
        self.depths += outcome.report.depths;
        self.points += outcome.points.points;
        self.limited += outcome.report.limited;
        self.nearest = self.nearest.max(nearness);
        // Pre-filtered curves have a larger depth tolerance, by the step of their lattice. Rounding of texel coordinates
        // takes a share of the alignment of neighbours.
        let deepest_mm = 0.25 * outcome.min_spacing_mm + 1e-3 * align_mm;
        let deep = attack.prefilter.is_none_or(|n| n == 1) && depth_mm > deepest_mm;
        let wide = transmittance > attack.epsilon + 0.005 || deep;
        if !outcome.held() || wide {
            self.broken.push(format!("{what}: {outcome:?}\n  {}", attack.shown()));
        }
        nearness
    }
}
