//! Picture quality during interaction, chosen from the measured cost of earlier pictures.

use super::cached_session::CachedSession;
use super::messages::FrameSettings;
use super::method_choice::MethodChoice;
use crate::render::Pace;

/// Time budget of a picture during interaction, shadow map included.
const MOVING_MS: f64 = 75.0;
/// Full pictures up to this time are drawn without a coarse one before.
const FAST_MS: f64 = 90.0;
/// Sides of coarse maps and divisors of coarse pictures. Few values keep successive pictures similar.
const MAP_SIDES: [u32; 7] = [512, 384, 256, 192, 128, 96, 64];
const DIVISORS: [f64; 9] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0, 12.0];
/// Factor of the eye-ray step during interaction; the larger one applies where pixels would become too large.
const MOVING_STEP: f64 = 2.0;
const MAX_MOVING_STEP: f64 = 5.0;
/// Pixel sizes above and below which the step factor changes.
const TOO_LARGE: f64 = 6.0;
const SMALL_ENOUGH: f64 = 2.0;

/// Resolution, step and methods of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    pub width: u32,
    pub height: u32,
    pub step: f64,
    /// Methods, coarse or as requested.
    pub choices: Vec<MethodChoice>,
}

impl Quality {
    /// Full quality.
    pub fn full(settings: &FrameSettings) -> Self {
        let scene = &settings.scene;
        let choices = settings.methods.clone();
        Self { width: scene.width, height: scene.height, step: scene.step, choices }
    }

    fn pixels(&self) -> f64 {
        f64::from(self.width) * f64::from(self.height)
    }
}

/// Measured speeds of this adapter and scene.
pub struct Speeds {
    pub full: Pace,
    pub moving: Pace,
    /// Build time per texel, by method and marching mode.
    build_ms_per_texel: Vec<(String, f64)>,
    /// Texels a side of the last map with an automatic size.
    chosen_map: u32,
    /// Current step factor during interaction.
    moving_step: f64,
}

impl Speeds {
    /// Creates an estimator for submissions of about `submission_ms`.
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

    /// Records the build time of a map of `map` texels a side.
    pub fn record_build(&mut self, choice: &MethodChoice, map: u32, ms: f64) {
        let Some(set) = choice.map(0) else { return };
        if set == 0 {
            self.chosen_map = map;
        }
        let now = ms / (f64::from(map) * f64::from(map)).max(1.0);
        let kind = kind(choice);
        match self.build_ms_per_texel.iter_mut().find(|(known, _)| *known == kind) {
            Some((_, known)) => *known = 0.5 * (*known + now),
            None => self.build_ms_per_texel.push((kind, now)),
        }
    }

    /// Texels a side; 0 where the method has no map.
    fn map(&self, choice: &MethodChoice) -> u32 {
        choice.map(self.chosen_map).unwrap_or(0)
    }

    /// Estimated time to build the missing maps of all lights.
    fn build_ms(&self, choice: &MethodChoice, settings: &FrameSettings, session: &CachedSession) -> f64 {
        let map = self.map(choice);
        let missing = choice.method().map_or(0, |method| session.missing(method, &settings.scene)) as f64;
        if map == 0 || missing == 0.0 {
            return 0.0;
        }
        let kind = kind(choice);
        let known = self.build_ms_per_texel.iter().find(|(known, _)| *known == kind);
        known.map_or(MOVING_MS, |(_, ms)| missing * ms * f64::from(map) * f64::from(map))
    }

    /// Whether a picture is expected soon enough to need no coarse one before it.
    pub fn is_fast(&self, quality: &Quality, settings: &FrameSettings, session: &CachedSession) -> bool {
        let build_ms: f64 = quality.choices.iter().map(|c| self.build_ms(c, settings, session)).sum();
        let pixels = quality.pixels() * quality.choices.len() as f64;
        build_ms + pixels / self.full.pixels_per_ms() <= FAST_MS
    }

    /// Quality that fits the time budget during interaction.
    pub fn coarse(&mut self, full: &Quality, settings: &FrameSettings, session: &CachedSession) -> Quality {
        let count = full.choices.len() as f64;
        let build_ms = |choice: &MethodChoice| self.build_ms(choice, settings, session);
        let coarse = |choice: &MethodChoice| {
            // A cached map is finer and costs nothing.
            if build_ms(choice) == 0.0 {
                return choice.clone();
            }
            let own = self.map(choice);
            let fits = |side: &&u32| build_ms(&choice.coarse(own, **side)) <= 0.5 * MOVING_MS / count;
            let side = MAP_SIDES.iter().find(fits).copied().unwrap_or(MAP_SIDES[MAP_SIDES.len() - 1]);
            choice.coarse(own, side)
        };
        let choices: Vec<MethodChoice> = full.choices.iter().map(coarse).collect();
        let left_ms = (MOVING_MS - choices.iter().map(build_ms).sum::<f64>()).max(0.3 * MOVING_MS) / count;
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
            choices,
        }
    }
}

/// Name of the methods that share a build time: method and marching mode.
fn kind(choice: &MethodChoice) -> String {
    format!("{} {}", choice.name, choice.get("march").unwrap_or_default())
}
