//! Random scenes that try to violate the error bound of a shadow method on its light rays, then changed for the
//! worse.
//!
//! A scene is small (up to 16 voxels a side) and otherwise anything: values smooth, noisy, sparse or in planes; any
//! transfer function; voxels up to 1 : 100, turned and sheared; any light; epsilon from 0.001 to 0.1; a deep shadow
//! map, in some scenes pre-filtered, or shadow rays. `Attack::run` builds the map, asks every texel's ray at many
//! depths, and says how far outside (above 0) or inside the band the worst of them is.

mod search;

pub use search::{search, setting};

use fastrand::Rng;
use glam::{DAffine3, DMat3, DVec3, EulerRot};
use ndarray::Array3;
use std::sync::Arc;
use umbravox::exact::ExactField;
use umbravox::measure::bound_check::BoundReport;
use umbravox::measure::enclosure_check::EnclosureTest;
use umbravox::measure::errors::RayTest;
use umbravox::measure::point_bound::PointTest;
use umbravox::measure::point_report::PointReport;
use umbravox::render::{DisabledOptimizations, Renderer, Session};
use umbravox::scene::Light;
use umbravox::shadow::{self, Bound};
use umbravox::transfer::{Quantity, TransferFunction};
use umbravox::volume::{Provenance, Scaling, Volume, Voxels};

/// Number of queried depths on each light ray.
const DEPTHS: usize = 64;
/// Largest number of cells between texel centres in which points are queried.
const CELLS: usize = 12;

/// Scene that may violate an error bound.
#[derive(Debug, Clone)]
pub struct Attack {
    pub dims: [usize; 3],
    pub spacing_mm: [f64; 3],
    /// Euler angles and shears of the volume's affine.
    pub turn: [f64; 3],
    pub shear: [f64; 3],
    /// Voxel values, x fastest: from 0 to 1, or integers if `whole`.
    pub values: Vec<f32>,
    pub whole: bool,
    pub quantity: Quantity,
    pub reference_length_mm: f64,
    pub points: Vec<(f64, f64)>,
    pub light: Light,
    pub epsilon: f64,
    pub map: u32,
    /// Filter of the map, with settings of the query.
    pub filter: &'static str,
    /// Number of rays whose mean a texel stores; `None` for shadow rays instead of a map.
    pub prefilter: Option<u32>,
    /// Compression of the map's curves to nodes, with settings.
    pub compress: &'static str,
    /// Whether the map also encloses the exact transmittance.
    pub encloses: bool,
}

/// Result of one attack scene.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub report: BoundReport,
    /// Test of the bound at points between the rays of texels.
    pub points: PointReport,
    pub enclosure: PointReport,
    pub bound: Bound,
    pub min_spacing_mm: f64,
}

impl Outcome {
    /// Largest excess over the error band of all depths, in transmittance; negative inside the band.
    pub fn margin(&self) -> f64 {
        self.report.margin.into_iter().chain(self.points.margin).fold(-1.0, f64::max)
    }

    pub fn held(&self) -> bool {
        self.report.violations == 0 && self.points.violations == 0 && self.enclosure.violations == 0
    }
}

fn log_uniform(rng: &mut Rng, low: f64, high: f64) -> f64 {
    (low.ln() + rng.f64() * (high / low).ln()).exp()
}

fn one_of<T: Copy>(rng: &mut Rng, all: &[T]) -> T {
    all[rng.usize(..all.len())]
}

fn random_values(rng: &mut Rng, [nx, ny, nz]: [usize; 3]) -> Vec<f32> {
    let kind = rng.u32(..10);
    let direction = DVec3::from_array(std::array::from_fn(|_| rng.f64() - 0.5)) * 2.0;
    let whole = DVec3::from_array(std::array::from_fn(|_| f64::from(rng.i32(-1..=1))));
    let middle =
        DVec3::new(nx as f64, ny as f64, nz as f64) * DVec3::from_array(std::array::from_fn(|_| rng.f64()));
    let size = rng.f64() * 8.0 + 0.5;
    let plane = f64::from(rng.i32(-8..24));
    let share = rng.f64();
    let mut values = Vec::with_capacity(nx * ny * nz);
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let p = DVec3::new(i as f64, j as f64, k as f64);
                let v = match kind {
                    0 => rng.f64(),
                    1 => f64::from(u8::from(rng.f64() < share)),
                    2 => 0.5 + 0.5 * (p.dot(direction) * size * 0.3).sin(),
                    3 => 1.0 - (p.distance(middle) / size).min(1.0),
                    4 => f64::from(u8::from(p.distance(middle) < size)),
                    5 => f64::from(u8::from(p.dot(whole) == plane)),
                    6 => (p.dot(direction) * 0.2 + 0.5).clamp(0.0, 1.0),
                    7 if rng.f64() < 0.05 => rng.f64(),
                    7 => 0.0,
                    8 => f64::from(u8::from(i % 2 + j % 2 + k % 2 == 3)),
                    _ => f64::from((i + j + k) as u32 % 2),
                };
                values.push(v as f32);
            }
        }
    }
    values
}

fn random_points(rng: &mut Rng, quantity: Quantity) -> Vec<(f64, f64)> {
    let top = match quantity {
        Quantity::Opacity if rng.f64() < 0.3 => 1.0,
        Quantity::Opacity => 1.0 - log_uniform(rng, 1e-6, 1.0),
        Quantity::Extinction => log_uniform(rng, 1e-3, 1e6),
    };
    let amount = |rng: &mut Rng| if rng.f64() < 0.3 { 0.0 } else { top * rng.f64() };
    match rng.u32(..7) {
        0 => vec![(0.0, 0.0), (1.0, top)],
        1 => {
            let at = rng.f64();
            vec![(at, 0.0), (at, top)]
        }
        2 => {
            let at = rng.f64();
            let width = log_uniform(rng, 1e-6, 0.5);
            vec![(at, 0.0), (at + width, top)]
        }
        3 => {
            let width = log_uniform(rng, 1e-5, 0.1);
            let n = rng.usize(1..6);
            (0..n)
                .flat_map(|_| {
                    let at = rng.f64();
                    [(at, 0.0), (at + width, top), (at + 2.0 * width, 0.0)]
                })
                .collect()
        }
        4 => (0..rng.usize(2..10)).map(|_| (rng.f64(), amount(rng))).collect(),
        5 => {
            let n = rng.usize(20..300);
            let waves = rng.f64() * 20.0;
            let points = (0..n).map(|i| i as f64 / n as f64);
            points.map(|v| (v, top * (0.5 + 0.5 * (v * waves).sin()))).collect()
        }
        _ => vec![(0.0, top * rng.f64()), (1.0, top * rng.f64())],
    }
}

/// Sorts transfer-function points by value, at most two at a value.
fn tidy(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for p in points {
        if !(kept.len() > 1 && kept[kept.len() - 2].0 == p.0) {
            kept.push(p);
        }
    }
    kept
}

fn random_direction(rng: &mut Rng) -> DVec3 {
    let any = DVec3::from_array(std::array::from_fn(|_| rng.f64() * 2.0 - 1.0));
    let axis = DVec3::from_array(std::array::from_fn(|_| f64::from(rng.i32(-1..=1))));
    let d = match rng.u32(..3) {
        0 if axis != DVec3::ZERO => axis,
        1 if axis != DVec3::ZERO => axis + any * log_uniform(rng, 1e-7, 0.1),
        _ => any,
    };
    if d.length() > 1e-9 { d } else { DVec3::Z }
}

impl Attack {
    pub fn random(rng: &mut Rng) -> Self {
        let dims =
            std::array::from_fn(|_| if rng.f64() < 0.15 { rng.usize(1..=2) } else { rng.usize(3..=16) });
        let ratio = log_uniform(rng, 1.0, 100.0);
        let mut spacing_mm = [1.0; 3];
        match rng.u32(..3) {
            0 => {}
            1 => spacing_mm[rng.usize(..3)] = ratio,
            _ => spacing_mm = std::array::from_fn(|_| log_uniform(rng, 1.0, ratio.max(1.01))),
        }
        let size = log_uniform(rng, 0.01, 100.0);
        spacing_mm = spacing_mm.map(|s| s * size);
        let turned = rng.f64() < 0.3;
        let sheared = rng.f64() < 0.15;
        let angles = std::array::from_fn(|_| if turned { rng.f64() * 6.0 } else { 0.0 });
        let shear = std::array::from_fn(|_| if sheared { rng.f64() - 0.5 } else { 0.0 });
        let quantity = if rng.bool() { Quantity::Extinction } else { Quantity::Opacity };
        let whole = rng.f64() < 0.4;
        let mut attack = Self {
            dims,
            spacing_mm,
            turn: angles,
            shear,
            values: random_values(rng, dims),
            whole,
            quantity,
            reference_length_mm: size * log_uniform(rng, 0.01, 1000.0),
            points: tidy(random_points(rng, quantity)),
            light: Light::Directional { toward: DVec3::Z },
            epsilon: log_uniform(rng, 0.001, 0.1),
            map: rng.u32(3..20),
            filter: one_of(
                rng,
                &[
                    "nearest",
                    "nearest",
                    "bilinear",
                    "bilinear,align=on",
                    "bilinear,near=0",
                    "bilinear,near=0,align=on",
                    "bilinear,near=1.5",
                ],
            ),
            prefilter: match rng.u32(..20) {
                0..=4 => None,
                5 => Some(one_of(rng, &[5, 9])),
                _ => Some(1),
            },
            compress: "greedy",
            encloses: rng.u32(..4) == 0,
        };
        if quantity == Quantity::Extinction {
            attack.points.iter_mut().for_each(|p| p.1 /= size);
        }
        attack.light = attack.random_light(rng);
        attack
    }

    fn random_light(&self, rng: &mut Rng) -> Light {
        let d = random_direction(rng);
        if rng.f64() < 0.6 {
            return Light::Directional { toward: d };
        }
        let (center, radius) = self.volume().bounding_sphere_mm();
        Light::Point { position: center + d.normalize() * radius * log_uniform(rng, 0.01, 1000.0) }
    }

    /// Returns the scene with one random change.
    pub fn changed(&self, rng: &mut Rng) -> Self {
        let mut new = self.clone();
        match rng.u32(..10) {
            0 => new.light = new.random_light(rng),
            1 => {
                let nudge =
                    DVec3::from_array(std::array::from_fn(|_| rng.f64() - 0.5)) * log_uniform(rng, 1e-6, 0.5);
                new.light = match new.light {
                    Light::Directional { toward } => {
                        Light::Directional { toward: toward + nudge * toward.length() }
                    }
                    Light::Point { position } => {
                        Light::Point { position: position + nudge * self.spacing_mm.iter().sum::<f64>() }
                    }
                };
            }
            2 => new.epsilon = log_uniform(rng, 0.001, 0.1),
            3 => new.map = rng.u32(3..20),
            4 => {
                for _ in 0..rng.usize(1..20) {
                    let i = rng.usize(..new.values.len());
                    let any = rng.f32();
                    new.values[i] = one_of(rng, &[0.0, 1.0, any, any]);
                }
            }
            5 => {
                let factor = log_uniform(rng, 0.3, 3.0);
                let opacity = self.quantity == Quantity::Opacity;
                new.points
                    .iter_mut()
                    .for_each(|p| p.1 = if opacity { (p.1 * factor).min(1.0) } else { p.1 * factor });
            }
            6 => {
                let i = rng.usize(..new.points.len());
                new.points[i].0 += (rng.f64() - 0.5) * log_uniform(rng, 1e-4, 1.0);
                new.points = tidy(new.points);
            }
            7 => new.reference_length_mm *= log_uniform(rng, 0.3, 3.0),
            8 => new.spacing_mm[rng.usize(..3)] *= log_uniform(rng, 0.5, 2.0),
            _ => new.points = tidy(random_points(rng, new.quantity)),
        }
        let [least, most] =
            [f64::min, f64::max].map(|f| new.spacing_mm.iter().copied().reduce(f).unwrap_or(1.0));
        if most / least > 100.0 { self.clone() } else { new }
    }

    pub fn volume(&self) -> Volume {
        let [nx, ny, nz] = self.dims;
        let index = |(k, j, i): (usize, usize, usize)| (k * ny + j) * nx + i;
        let [a, b, c] = self.turn;
        let [p, q, r] = self.shear;
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(p, 1.0, 0.0), DVec3::new(q, r, 1.0));
        let matrix = DMat3::from_euler(EulerRot::XYZ, a, b, c)
            * shear
            * DMat3::from_diagonal(DVec3::from_array(self.spacing_mm));
        let voxels = if self.whole {
            Voxels::U8(Array3::from_shape_fn((nz, ny, nx), |at| (self.values[index(at)] * 255.0) as u8))
        } else {
            Voxels::F32(Array3::from_shape_fn((nz, ny, nx), |at| self.values[index(at)]))
        };
        let scaling =
            if self.whole { Scaling { slope: 1.0 / 255.0, intercept: 0.0 } } else { Scaling::IDENTITY };
        Volume::new(
            voxels,
            scaling,
            DAffine3::from_mat3(matrix),
            Provenance::new("attack", "attack", "attack"),
        )
        .expect("a volume")
    }

    pub fn transfer_function(&self) -> TransferFunction {
        TransferFunction {
            reference_length_mm: self.reference_length_mm,
            ..TransferFunction::new(self.quantity, &self.points)
        }
    }

    pub fn method(&self) -> String {
        let filter = self.filter;
        match self.prefilter {
            None => "rays".into(),
            Some(n) => format!(
                "dsm:epsilon={},compress={},map={},filter={filter},prefilter={n},enclose={}",
                self.epsilon,
                self.compress,
                self.map,
                if self.encloses { "on" } else { "off" }
            ),
        }
    }

    /// Builds the shadow map and queries every texel's ray.
    pub fn run(&self, renderer: &Arc<Renderer>) -> umbravox::error::Result<Outcome> {
        self.run_as(renderer, &self.method())
    }

    pub fn run_as(&self, renderer: &Arc<Renderer>, method: &str) -> umbravox::error::Result<Outcome> {
        let volume = Arc::new(self.volume());
        let tf = self.transfer_function();
        let session = Session::on(renderer, Arc::clone(&volume), &tf, DisabledOptimizations::NONE)?;
        let field = ExactField::new(&volume, &tf);
        let map = session.shadow(shadow::parse(method)?.as_ref(), self.light)?;
        let side = map.light_space.map_size;
        // All texels of the map; shadow rays have no map of that size.
        let asked = self.map.min(side);
        let at = |i: u32| i * side / asked;
        let texels: Vec<[u32; 2]> = (0..asked * asked).map(|i| [at(i % asked), at(i / asked)]).collect();
        let min_spacing_mm = volume.min_spacing_mm();
        let test = RayTest {
            texels: &texels,
            taps: shadow::Taps::Within(self.prefilter.unwrap_or(1)),
            depths: DEPTHS,
            default_depth_mm: 0.02 * min_spacing_mm,
            nodes_mm: &[],
        };
        let report = test.run(&field, self.light, &session, &map)?;
        let step = texels.len().div_ceil(CELLS);
        let cells: Vec<[u32; 2]> = texels.iter().copied().step_by(step).collect();
        let between = PointTest { cells: &cells, points_a_cell: 8 * DEPTHS, taps: test.taps };
        let points = between.run(&field, self.light, &session, &map)?;
        let prisms = EnclosureTest { texels: &cells, points_a_texel: 8 * DEPTHS };
        let enclosure = prisms.run(&field, self.light, &session, &map)?;
        Ok(Outcome { report, points, enclosure, bound: map.bound.expect("a bound"), min_spacing_mm })
    }
}

impl Attack {
    /// Description of the scene without its voxels.
    pub fn shown(&self) -> String {
        let points = &self.points[..self.points.len().min(12)];
        format!(
            "{:?} voxels of {:?} mm, turn {:?}, shear {:?}, whole {}, {:?} per {} mm {points:?} ({} points), {:?}, {}",
            self.dims,
            self.spacing_mm,
            self.turn,
            self.shear,
            self.whole,
            self.quantity,
            self.reference_length_mm,
            self.points.len(),
            self.light,
            self.method()
        )
    }
}
