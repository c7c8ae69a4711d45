//! How well a picture can be drawn in the time that a moving hand leaves, from what pictures have cost so far.

use super::device::OnDevice;
use super::messages::Subject;
use crate::engine::method_choice::MethodChoice;
use crate::render::Pace;

/// What a picture may take while a hand moves, shadow map included.
const MOVING_MS: f64 = 75.0;
/// A whole picture that takes no longer is drawn at once.
const AT_ONCE_MS: f64 = 90.0;
/// Sides of a coarse map and divisors of a coarse picture: few, so that neighbouring pictures look alike.
const MAP_SIDES: [u32; 7] = [512, 384, 256, 192, 128, 96, 64];
const DIVISORS: [f64; 9] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0, 12.0];
/// The eye-ray step is this much longer while a hand moves, and longer still where pixels alone would become too large.
const MOVING_STEP: f64 = 2.0;
const LONGEST_MOVING_STEP: f64 = 5.0;
/// Pixels so large ask for the longer step, and pixels so small for the shorter one.
const TOO_LARGE: f64 = 6.0;
const SMALL_ENOUGH: f64 = 2.0;

/// How a picture is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    pub width: u32,
    pub height: u32,
    pub step: f64,
    /// For each of the two methods.
    pub choices: Vec<MethodChoice>,
}

impl Quality {
    /// All that is wanted.
    pub fn whole(subject: &Subject) -> Self {
        let scene = &subject.scene;
        let choices = subject.methods.clone();
        Self { width: scene.width, height: scene.height, step: scene.step, choices }
    }

    fn pixels(&self) -> f64 {
        f64::from(self.width) * f64::from(self.height)
    }
}

/// What the last pictures have taught about this adapter and scene.
pub struct Speeds {
    pub whole: Pace,
    pub moving: Pace,
    /// Milliseconds that a texel of a shadow map takes to build, by method and how light rays are marched.
    build_ms_per_texel: Vec<(String, f64)>,
    /// Texels a side of the last map that chose them for itself.
    chosen_map: u32,
    /// How much longer the step is while a hand moves.
    moving_step: f64,
}

impl Speeds {
    /// Nothing is known yet; a submission keeps the queue no longer than about `submission_ms`.
    pub fn new(submission_ms: f64) -> Self {
        let pace = || Pace::new(submission_ms);
        Self {
            whole: pace(),
            moving: pace(),
            build_ms_per_texel: Vec::new(),
            chosen_map: MAP_SIDES[0],
            moving_step: MOVING_STEP,
        }
    }

    /// Notes what a map of so many texels a side took to build.
    pub fn learn_build(&mut self, choice: &MethodChoice, map: u32, ms: f64) {
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

    /// Milliseconds that maps of all lights would take to build, where they have to be; unknown before the first of its kind.
    fn build_ms(&self, choice: &MethodChoice, subject: &Subject, device: &OnDevice) -> f64 {
        let map = self.map(choice);
        let missing = device.missing(choice, &subject.scene) as f64;
        if map == 0 || missing == 0.0 {
            return 0.0;
        }
        let kind = kind(choice);
        let known = self.build_ms_per_texel.iter().find(|(known, _)| *known == kind);
        known.map_or(MOVING_MS, |(_, ms)| missing * ms * f64::from(map) * f64::from(map))
    }

    /// Whether a picture is expected to be done so soon that nothing coarser has to come before it.
    pub fn at_once(&self, quality: &Quality, subject: &Subject, device: &OnDevice) -> bool {
        let build_ms: f64 = quality.choices.iter().map(|c| self.build_ms(c, subject, device)).sum();
        let pixels = quality.pixels() * quality.choices.len() as f64;
        build_ms + pixels / self.whole.pixels_per_ms() <= AT_ONCE_MS
    }

    /// What can be drawn in the time that a moving hand leaves.
    pub fn moving(&mut self, whole: &Quality, subject: &Subject, device: &OnDevice) -> Quality {
        let count = whole.choices.len() as f64;
        let build_ms = |choice: &MethodChoice| self.build_ms(choice, subject, device);
        let coarse = |choice: &MethodChoice| {
            // What is made already is finer, and costs nothing.
            if build_ms(choice) == 0.0 {
                return choice.clone();
            }
            let own = self.map(choice);
            let fits = |side: &&u32| build_ms(&choice.coarse(own, **side)) <= 0.5 * MOVING_MS / count;
            let side = MAP_SIDES.iter().find(fits).copied().unwrap_or(MAP_SIDES[MAP_SIDES.len() - 1]);
            choice.coarse(own, side)
        };
        let choices: Vec<MethodChoice> = whole.choices.iter().map(coarse).collect();
        let left_ms = (MOVING_MS - choices.iter().map(build_ms).sum::<f64>()).max(0.3 * MOVING_MS) / count;
        let fits = |d: &&f64| whole.pixels() / (*d * *d) <= left_ms * self.moving.pixels_per_ms();
        let divisor = DIVISORS.iter().find(fits).copied().unwrap_or(DIVISORS[DIVISORS.len() - 1]);
        if divisor > TOO_LARGE {
            self.moving_step = LONGEST_MOVING_STEP;
        } else if divisor <= SMALL_ENOUGH {
            self.moving_step = MOVING_STEP;
        }
        let side = |n: u32| ((f64::from(n) / divisor).round() as u32).max(1);
        Quality {
            width: side(whole.width),
            height: side(whole.height),
            step: (whole.step * self.moving_step).min(8.0).max(whole.step),
            choices,
        }
    }
}

/// What costs alike: a method, with how it marches light rays.
fn kind(choice: &MethodChoice) -> String {
    format!("{} {}", choice.name, choice.get("march").unwrap_or_default())
}
