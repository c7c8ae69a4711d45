//! Analytic media for comparisons of shadow methods: a cloud, smoke and thin sheets.
//!
//! Positions are in units of half the cube's edge, so that the cube is `[-1, 1]^3`. The functions use basic arithmetic and
//! square roots only, whose results do not depend on the machine's mathematical library.

use crate::random::{Chance, mix};
use glam::DVec3;

/// Seeds of the random shapes. A change of a seed changes the frozen benchmark.
const CLOUD_SEED: u64 = 101;
const SMOKE_SEED: u64 = 102;
const SHEETS_SEED: u64 = 104;

/// Soft ball of density, with a smooth polynomial profile (metaball; Wyvill, McPheeters and Wyvill 1986, *Data structure
/// for soft objects*).
#[derive(Debug)]
struct Ball {
    centre: DVec3,
    radius: f64,
    density: f64,
}

impl Ball {
    fn density_at(&self, at: DVec3) -> f64 {
        let squared = (at - self.centre).length_squared() / (self.radius * self.radius);
        let share = (1.0 - squared).max(0.0);
        self.density * share * share * share
    }
}

/// Sum of the densities of metaballs.
#[derive(Debug)]
pub struct Metaballs(Vec<Ball>);

impl Metaballs {
    /// Cumulus cloud: many large balls in a flat ellipsoid, densest in the middle.
    pub fn cloud() -> Self {
        let ball = |index: u64| {
            let mut chance = Chance::new(CLOUD_SEED, index);
            let [x, y] = [(); 2].map(|()| chance.between(-0.6, 0.6));
            let z = chance.between(-0.35, 0.3) * (1.0 - 0.8 * (x * x + y * y));
            let radius = chance.between(0.16, 0.36);
            Ball { centre: DVec3::new(x, y, z), radius, density: chance.between(0.3, 0.7) }
        };
        Self((0..90).map(ball).collect())
    }

    /// Rising smoke: small dense puffs at the bottom, wide thin ones at the top, around a winding path.
    pub fn smoke() -> Self {
        const PUFFS: u64 = 260;
        let puff = |index: u64| {
            let mut chance = Chance::new(SMOKE_SEED, index);
            let height = index as f64 / PUFFS as f64;
            let path = DVec3::new(
                0.9 * height * (height - 0.35) * (1.0 - height),
                0.35 * height * (1.3 - 2.0 * height),
                1.35 * height - 0.85,
            );
            let spread = 0.04 + 0.3 * height;
            let aside = DVec3::from_array([(); 3].map(|()| chance.between(-1.0, 1.0))) * spread;
            let radius = chance.between(0.05, 0.09) + 0.12 * height;
            Ball { centre: path + aside, radius, density: chance.between(0.4, 1.0) * (1.0 - 0.7 * height) }
        };
        Self((0..PUFFS).map(puff).collect())
    }

    /// Share of the largest density at a position, in `[0, 1]`.
    pub fn share(&self, at: DVec3) -> f64 {
        self.0.iter().map(|ball| ball.density_at(at)).sum::<f64>().min(1.0)
    }
}

/// Number of sheets per unit of height, half thickness of a sheet, and share of the rectangles of a sheet that are absent.
const SHEETS: f64 = 4.5;
const SHEET_THICKNESS: f64 = 0.03;
const SHEET_GAPS: f64 = 0.4;

/// Share of the largest density of thin curved sheets with rectangular gaps, in `[0, 1]`.
pub fn sheets(at: DVec3) -> f64 {
    let bend = 0.35 * (at.x * at.x - at.y * at.y) + 0.2 * at.x;
    let phase = (at.z + bend) * SHEETS;
    let sheet = phase.round();
    let [column, row] = [at.x, at.y].map(|n| (n * 3.0).floor());
    let rectangle = [sheet, column, row].iter().fold(0_u64, |index, n| mix(index ^ (*n as i64) as u64));
    if at.abs().max_element() > 0.95 || Chance::new(SHEETS_SEED, rectangle).unit() < SHEET_GAPS {
        return 0.0;
    }
    (1.0 - (phase - sheet).abs() / (SHEETS * SHEET_THICKNESS)).max(0.0)
}
