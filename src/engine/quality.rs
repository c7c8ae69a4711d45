//! Picture quality during interaction, chosen from the measured times of earlier pictures.

use super::cached_session::CachedSession;
use super::messages::FrameSettings;
use crate::render::Pace;
use crate::shadow::{Key, MethodSpec, Value};

/// Time budget of one picture during interaction, including its shadow maps, ms.
const MOVING_MS: f64 = 75.0;
/// Maximum expected time of a full-quality picture that is rendered without a coarse picture before it, ms.
const FAST_MS: f64 = 90.0;
/// Resolutions (texels per side) of coarse shadow maps during interaction. Few distinct values keep successive
/// pictures similar.
const MAP_SIDES: [u32; 7] = [512, 384, 256, 192, 128, 96, 64];
const DIVISORS: [f64; 9] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0, 12.0];
/// Factor on the ray-casting step during interaction. The larger `MAX_MOVING_STEP` applies where the pixels of coarse
/// pictures would become too large.
const MOVING_STEP: f64 = 2.0;
const MAX_MOVING_STEP: f64 = 5.0;
/// Size of a coarse pixel, in pixels of the window's picture, above which the ray-casting step is lengthened to
/// `MAX_MOVING_STEP`. Up to `SMALL_ENOUGH` it is shortened again.
const TOO_LARGE: f64 = 6.0;
const SMALL_ENOUGH: f64 = 2.0;

/// Quality of a picture: resolution, ray-casting step and settings of the shadow methods.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    pub width: u32,
    pub height: u32,
    pub step: f64,
    /// Shadow methods of the picture, with the requested settings or coarser ones.
    pub methods: Vec<MethodSpec>,
}

impl Quality {
    /// Full quality of a picture: resolution, step and shadow methods as requested.
    pub fn full(settings: &FrameSettings) -> Self {
        let scene = &settings.scene;
        let methods = settings.methods.clone();
        Self { width: scene.width, height: scene.height, step: scene.step, methods }
    }

    fn pixels(&self) -> f64 {
        f64::from(self.width) * f64::from(self.height)
    }
}

/// Measured speeds of rendering pictures and building shadow maps, used to choose the picture quality.
pub struct Speeds {
    pub full: Pace,
    pub moving: Pace,
    /// Build time of a shadow map per texel, ms, for each shadow method with its ray-marching mode.
    build_ms_per_texel: Vec<(String, f64)>,
    /// Resolution of the last shadow map whose size was chosen automatically, texels per side.
    chosen_map: u32,
    /// Current factor on the ray-casting step during interaction.
    moving_step: f64,
}

impl Speeds {
    /// Creates the estimator of render speeds for GPU submissions of about `submission_ms` milliseconds.
    pub fn new(submission_ms: f64) -> Self {
        let pace = || Pace::new(submission_ms);
        Self {
            full: pace(),
            moving: pace(),
            build_ms_per_texel: Vec::new(),
            chosen_map: MAP_SIDES[0],
            moving_step: MOVING_STEP,
        }
    }

    /// Records the measured build time of a shadow map with `map` texels per side, ms.
    pub fn record_build(&mut self, spec: &MethodSpec, map: u32, ms: f64) {
        if self.map(spec) == 0 {
            return;
        }
        if spec.map_size().is_none() {
            self.chosen_map = map;
        }
        let now = ms / (f64::from(map) * f64::from(map)).max(1.0);
        let kind = kind(spec);
        match self.build_ms_per_texel.iter_mut().find(|(known, _)| *known == kind) {
            Some((_, known)) => *known = 0.5 * (*known + now),
            None => self.build_ms_per_texel.push((kind, now)),
        }
    }

    /// Resolution of a method's shadow map, texels per side; 0 if the method has no map.
    fn map(&self, spec: &MethodSpec) -> u32 {
        spec.value("map").map_or(0, |_| spec.map_size().unwrap_or(self.chosen_map))
    }

    /// Estimated time to build all shadow maps of a picture that are not in the cache, ms.
    fn build_ms(&self, spec: &MethodSpec, settings: &FrameSettings, session: &CachedSession) -> f64 {
        let map = self.map(spec);
        let missing =
            spec.method().map_or(0, |method| session.missing(method.as_ref(), &settings.scene)) as f64;
        if map == 0 || missing == 0.0 {
            return 0.0;
        }
        let kind = kind(spec);
        let known = self.build_ms_per_texel.iter().find(|(known, _)| *known == kind);
        known.map_or(MOVING_MS, |(_, ms)| missing * ms * f64::from(map) * f64::from(map))
    }

    /// Whether a picture of this quality is expected to finish so soon that no coarse picture is needed before it.
    pub fn is_fast(&self, quality: &Quality, settings: &FrameSettings, session: &CachedSession) -> bool {
        let build_ms: f64 = quality.methods.iter().map(|c| self.build_ms(c, settings, session)).sum();
        let pixels = quality.pixels() * quality.methods.len() as f64;
        build_ms + pixels / self.full.pixels_per_ms() <= FAST_MS
    }

    /// Chooses a picture quality that fits the time budget during interaction.
    pub fn coarse(&mut self, full: &Quality, settings: &FrameSettings, session: &CachedSession) -> Quality {
        let count = full.methods.len() as f64;
        let build_ms = |spec: &MethodSpec| self.build_ms(spec, settings, session);
        let coarse = |spec: &MethodSpec| {
            // A cached map is finer and costs nothing.
            if build_ms(spec) == 0.0 {
                return spec.clone();
            }
            let own = self.map(spec);
            let fits = |side: &&u32| build_ms(&coarse_method(spec, own, **side)) <= 0.5 * MOVING_MS / count;
            let side = MAP_SIDES.iter().find(fits).copied().unwrap_or(MAP_SIDES[MAP_SIDES.len() - 1]);
            coarse_method(spec, own, side)
        };
        let methods: Vec<MethodSpec> = full.methods.iter().map(coarse).collect();
        let left_ms = (MOVING_MS - methods.iter().map(build_ms).sum::<f64>()).max(0.3 * MOVING_MS) / count;
        let fits = |d: &&f64| full.pixels() / (*d * *d) <= left_ms * self.moving.pixels_per_ms();
        let divisor = DIVISORS.iter().find(fits).copied().unwrap_or(DIVISORS[DIVISORS.len() - 1]);
        if divisor > TOO_LARGE {
            self.moving_step = MAX_MOVING_STEP;
        } else if divisor <= SMALL_ENOUGH {
            self.moving_step = MOVING_STEP;
        }
        let side = |n: u32| ((f64::from(n) / divisor).round() as u32).max(1);
        Quality {
            width: side(full.width),
            height: side(full.height),
            step: (full.step * self.moving_step).min(8.0).max(full.step),
            methods,
        }
    }
}

/// Key of the measured build times of shadow maps: name of the shadow method and its ray-marching mode.
fn kind(spec: &MethodSpec) -> String {
    let march = spec.value("march").map_or(String::new(), |march| march.to_string());
    format!("{} {march}", spec.entry().name)
}

/// Coarser and faster variant of a shadow method for use during interaction, with at most `map` texels per side.
/// `own` is the resolution of the requested method's shadow map.
fn coarse_method(spec: &MethodSpec, own: u32, map: u32) -> MethodSpec {
    let coarse = |(key, value): (&Key, Value)| match key.name {
        "map" if own > map => Value::Whole(map),
        _ => key.coarser(value),
    };
    MethodSpec::new(spec.entry(), spec.settings().map(coarse).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shadow::METHODS;

    #[test]
    fn coarse_methods_are_valid_and_their_maps_never_finer() {
        for entry in METHODS {
            coarse_method(&MethodSpec::default_of(entry), 512, 64).method().unwrap();
        }
        let map = |own, map| coarse_method(&"dsm:epsilon=0.01,map=256".parse().unwrap(), own, map).map_size();
        assert_eq!((map(256, 128), map(256, 512)), (Some(128), Some(256)));
        assert_eq!(coarse_method(&MethodSpec::default(), 300, 512).map_size(), None);
    }
}
