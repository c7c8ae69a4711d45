//! Built-in sets of hair and fur strands, identical on every run for a name and a number of segments.
//!
//! Hair grows from the upper half of a ball of radius 80 mm and falls; fur covers a ball of radius 60 mm. The total
//! area of a set does not depend on the number of segments (each strand represents a lock of hair), unless strands
//! would become thicker than 1 mm. Pictures therefore look alike from thousands of segments to millions.

use super::{Attribute, StrandArrays, Strands};
use crate::error::{Error, Result};
use crate::files::loading::{Loading, ReadingStage};
use crate::random::Chance;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::fmt;

/// Built-in strand set (`phantom:hair-...`): hair or fur that grows from a ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StrandSet {
    /// Built-in strand set of straight hair.
    Straight,
    /// Built-in strand set of curly hair.
    Curly,
    /// Built-in strand set of hair in locks.
    Clustered,
    /// Built-in strand set of short fur on a ball.
    Fur,
}

/// Radius of the ball from which the built-in hair grows, mm.
const HEAD_MM: f64 = 80.0;
/// Radius of the ball from which the built-in fur grows, mm.
const FUR_BALL_MM: f64 = 60.0;
/// Approximate number of strands in one lock of the built-in set `hair-clustered`.
const LOCK: usize = 24;
/// Largest diameter of a strand in the built-in sets, mm.
const MAX_THICKNESS_MM: f64 = 1.0;

/// Parameters of each built-in strand set: name, description, number of segments of a strand, area of all strands
/// viewed from the side (mm^2), and relative loss of diameter from root to tip.
const SETS: [(&str, &str, usize, f64, f64); 4] = [
    ("hair-straight", "straight hair that falls from a ball", 48, 250_000.0, 0.0),
    ("hair-curly", "curls", 128, 250_000.0, 0.0),
    ("hair-clustered", "hair in locks that narrow to the tips, a little translucent", 64, 300_000.0, 0.5),
    ("hair-fur", "short combed fur on a ball, thinner to the tips", 12, 120_000.0, 0.85),
];

impl StrandSet {
    /// List of all built-in strand sets.
    pub const ALL: [Self; 4] = [Self::Straight, Self::Curly, Self::Clustered, Self::Fur];

    /// Default number of segments of a built-in strand set.
    pub const DEFAULT_SEGMENTS: usize = 100_000;

    /// Largest number of segments of a built-in strand set.
    pub const MAX_SEGMENTS: usize = 1 << 25;

    /// Name of the built-in strand set, used in `phantom:NAME`.
    pub fn name(self) -> &'static str {
        SETS[self as usize].0
    }

    /// Short description of the built-in strand set.
    pub fn description(self) -> &'static str {
        SETS[self as usize].1
    }

    /// Parses a built-in strand set and its number of segments from `NAME[:SEGMENTS]`.
    ///
    /// # Errors
    /// The name is unknown, or the number of segments is not in `1..=33554432`.
    pub fn parse(text: &str) -> Result<(Self, usize)> {
        let refuse = |why: String| Error::input("cannot build strands", format!("phantom:{text}"), why);
        let (name, count) = text.split_once(':').map_or((text, None), |(name, count)| (name, Some(count)));
        let set = Self::ALL.into_iter().find(|s| s.name() == name).ok_or_else(|| {
            let hint = format!("there are {}", Self::ALL.map(Self::name).join(", "));
            refuse(format!("no strand set is named `{name}`")).hint(hint)
        })?;
        let Some(count) = count else { return Ok((set, Self::DEFAULT_SEGMENTS)) };
        let most = Self::MAX_SEGMENTS;
        match count.parse() {
            Ok(n) if (1..=most).contains(&n) => Ok((set, n)),
            _ => Err(refuse(format!("segments `{count}` is not a whole number in 1..={most}"))),
        }
    }

    /// Diameter of a built-in strand relative to that at its root, at the fraction `u` of the strand's length.
    fn taper(self, u: f64) -> f64 {
        1.0 - SETS[self as usize].4 * u
    }

    /// Builds a built-in strand set with exactly `segments` segments.
    ///
    /// # Errors
    /// `segments` is not in `1..=33554432`.
    pub fn build(self, segments: usize) -> Result<Strands> {
        self.build_with(segments, &Loading::default())
    }

    /// Builds a built-in strand set with exactly `segments` segments; `loading` shows progress and can cancel it.
    pub fn build_with(self, segments: usize, loading: &Loading) -> Result<Strands> {
        let source = format!("phantom:{self}:{segments}");
        let refuse = |why: String| Error::input("cannot build strands", &source, why);
        if !(1..=Self::MAX_SEGMENTS).contains(&segments) {
            return Err(refuse(format!("{segments} segments is not in 1..={}", Self::MAX_SEGMENTS)));
        }
        let (_, _, each, area_mm2, _) = SETS[self as usize];
        let each = each.min(segments);
        let strands = segments.div_ceil(each);
        let last = segments - (strands - 1) * each;
        let count = |s: usize| if s + 1 == strands { last } else { each };
        let pieces = loading.pieces(ReadingStage::ReadingStrands, strands);
        let grow = |s: usize| {
            if pieces.is_cancelled() {
                return Vec::new();
            }
            let line = self.strand(s, strands, Steps { each, count: count(s) });
            pieces.done();
            line
        };
        let lines: Vec<Vec<DVec3>> = (0..strands).into_par_iter().map(grow).collect();
        loading.go_on(&source)?;
        let share = |line: &[DVec3], i: usize| i as f64 / (line.len() - 1) as f64;
        // Area of the strands if their diameter were 1 at the roots.
        let area_of = |line: &Vec<DVec3>| -> f64 {
            let area = |(i, ends): (usize, &[DVec3])| {
                let middle = 0.5 * (self.taper(share(line, i)) + self.taper(share(line, i + 1)));
                middle * ends[0].distance(ends[1])
            };
            line.windows(2).enumerate().map(area).sum()
        };
        let area: f64 = lines.par_iter().map(area_of).collect::<Vec<f64>>().iter().sum();
        let root = (area_mm2 / area).min(MAX_THICKNESS_MM);
        let tapers = self.taper(1.0) != 1.0;
        let thickness = tapers.then(|| {
            let shares = lines.iter().flat_map(|line| (0..line.len()).map(|i| share(line, i)));
            shares.map(|u| (root * self.taper(u)) as f32).collect()
        });
        let mut info = [0; 88];
        let text = format!("umbravox {self}:{segments}");
        info[..text.len()].copy_from_slice(text.as_bytes());
        let counts = (last != each).then(|| (0..strands).map(|s| count(s) as u32).collect());
        let fur_color = [0.55, 0.42, 0.30];
        let arrays = StrandArrays {
            strands: strands as u32,
            segments: Attribute { default: each as u32, values: counts },
            points: lines.iter().flatten().map(|p| p.as_vec3().to_array()).collect(),
            thickness_mm: Attribute { default: root as f32, values: thickness },
            transparency: Attribute::constant(if self == Self::Clustered { 0.2 } else { 0.0 }),
            color: Attribute::constant(if self == Self::Fur { fur_color } else { [0.35, 0.20, 0.10] }),
            info,
        };
        Strands::new(&source, arrays).map_err(|flaw| refuse(flaw.why))
    }

    /// Computes the points (mm) of the strand with this index in a built-in set of `strands` strands.
    fn strand(self, index: usize, strands: usize, steps: Steps) -> Vec<DVec3> {
        let mut chance = Chance::new(self as u64 + 1, index as u64);
        match self {
            Self::Straight => {
                let root = chance.direction(0.0);
                Fall::new(root, &mut chance).points(chance.between(170.0, 210.0), steps, |_, _| DVec3::ZERO)
            }
            Self::Curly => {
                let root = chance.direction(0.0);
                let fall = Fall::new(root, &mut chance);
                let (phase, pitch_mm) = (TAU * chance.unit(), chance.between(16.0, 24.0));
                let radius_mm = chance.between(4.0, 7.0);
                fall.points(chance.between(150.0, 200.0), steps, |s, [across, up]| {
                    let angle = phase + TAU * s / pitch_mm;
                    radius_mm * (1.0 - (-s / 25.0).exp()) * (across * angle.cos() + up * angle.sin())
                })
            }
            Self::Clustered => {
                let locks = strands.div_ceil(LOCK);
                let mut lock = Chance::new(100, (index % locks) as u64);
                let center = lock.direction(0.0);
                let fall = Fall::new(center, &mut lock);
                let (length_mm, phase) = (lock.between(160.0, 220.0), TAU * lock.unit());
                let scatter = 9.0 * chance.direction(-1.0) * chance.unit().cbrt();
                let wave = chance.between(2.5, 4.0);
                fall.points(length_mm * chance.between(0.9, 1.0), steps, |s, [across, up]| {
                    let narrow = 1.0 - 0.85 * (s / length_mm).min(1.0);
                    let angle = phase + TAU * s / 60.0;
                    scatter * narrow
                        + wave * (1.0 - (-s / 40.0).exp()) * (across * angle.cos() + up * angle.sin())
                })
            }
            Self::Fur => fur(&mut chance, steps),
        }
    }
}

/// Number of segments of a full strand in a built-in set (`each`), and of the strand that is being built (`count`),
/// which may be shorter.
#[derive(Debug, Clone, Copy)]
struct Steps {
    each: usize,
    count: usize,
}

/// Shape of a built-in hair strand, which grows out of a ball and then falls.
struct Fall {
    root: DVec3,
    /// Unit normal of the vertical plane in which the built-in hair strand bends.
    across: DVec3,
    /// Length over which the built-in hair strand bends from the ball's normal to straight down, mm.
    bend_mm: f64,
    sway: DVec3,
}

impl Fall {
    fn new(root: DVec3, chance: &mut Chance) -> Self {
        let across = root.cross(DVec3::Z).try_normalize().unwrap_or(DVec3::X);
        Self { root, across, bend_mm: chance.between(25.0, 45.0), sway: 0.12 * chance.direction(-1.0) }
    }

    /// Computes points at equal steps along a built-in hair strand. `offset(distance from the root in mm, [across,
    /// normal])` displaces each point, for curls.
    fn points(&self, length_mm: f64, steps: Steps, offset: impl Fn(f64, [DVec3; 2]) -> DVec3) -> Vec<DVec3> {
        let step = length_mm / steps.each as f64;
        let mut at = self.root * HEAD_MM;
        (0..=steps.count)
            .map(|i| {
                let s = i as f64 * step;
                let fallen = 1.0 - (-s / self.bend_mm).exp();
                let along = (self.root * (1.0 - fallen) - DVec3::Z * fallen + self.sway).normalize();
                let place = at + offset(s, [self.across, along.cross(self.across)]);
                at += along * step;
                // The strand stays outside the ball.
                if at.length() < HEAD_MM {
                    at = at.normalize_or(self.root) * HEAD_MM;
                }
                place
            })
            .collect()
    }
}

/// Computes the points of one built-in fur hair, which is upright at its root and bends along a combing direction.
fn fur(chance: &mut Chance, steps: Steps) -> Vec<DVec3> {
    let root = chance.direction(-1.0);
    let comb = DVec3::new(0.35, 0.2, -1.0) + 0.35 * chance.direction(-1.0);
    let lean = comb - comb.dot(root) * root;
    let length_mm = chance.between(18.0, 26.0);
    let step = length_mm / steps.each as f64;
    let mut at = root * FUR_BALL_MM;
    let mut points = Vec::with_capacity(steps.count + 1);
    for i in 0..=steps.count {
        points.push(at);
        let u = i as f64 / steps.each as f64;
        at += (root * (1.0 - 0.6 * u) + lean * (0.35 + u)).normalize() * step;
    }
    points
}

impl fmt::Display for StrandSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
