//! A shadow method with a known delay and a known error is measured like any other: both show in the table.

use crate::common;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::sleep;
use std::time::Duration;
use umbravox::error::{Error, Result};
use umbravox::exact::ExactField;
use umbravox::measure::budget::Budget;
use umbravox::measure::compare::compare_within;
use umbravox::measure::comparison::Comparison;
use umbravox::measure::job::{Checked, Effort, Job};
use umbravox::measure::journal::Journal;
use umbravox::measure::progress::Progress;
use umbravox::open::{VolumeSpec, load};
use umbravox::render::{DeviceTransfer, DisabledOptimizations, LoadedVolume, Session};
use umbravox::scene::{Light, Scene};
use umbravox::shadow::{BuildContext, Entry, Lookup, Method, ShadowMap, Value, parse, parse_list};
use umbravox::transfer::{Quantity, TransferFunction};
use umbravox::volume::Volume;

const DELAY_MS: f64 = 250.0;
/// Delay of the first builds, ms: the build that errors are measured on, and the warm-up.
const FIRST_DELAY_MS: f64 = 4000.0;
const FIRST_BUILDS: usize = 2;

/// Fault of a planted shadow method.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    /// Delayed build of a map with twice the extinction: every transmittance is squared.
    LateAndDark,
    /// All builds fail from this one on.
    FailsFrom(usize),
}

/// Real shadow method with a planted fault.
#[derive(Debug)]
struct Planted {
    inner: Box<dyn Method>,
    fault: Fault,
    builds: AtomicUsize,
}

impl Planted {
    fn boxed(inner: &str, fault: Fault) -> Box<dyn Method> {
        Box::new(Self { inner: parse(inner).unwrap(), fault, builds: AtomicUsize::new(0) })
    }
}

impl Method for Planted {
    fn entry(&self) -> &'static Entry {
        self.inner.entry()
    }

    fn name(&self) -> &'static str {
        "planted"
    }

    fn values(&self) -> Vec<Value> {
        self.inner.values()
    }

    fn lookup(&self) -> Option<Lookup> {
        self.inner.lookup()
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let build = self.builds.fetch_add(1, Ordering::Relaxed);
        match self.fault {
            Fault::FailsFrom(first) if build >= first => {
                Err(Error::runtime("planted failure", "build", build))
            }
            Fault::FailsFrom(_) => self.inner.build(context),
            Fault::LateAndDark => {
                let loaded = LoadedVolume::new(context.gpu(), Arc::new(context.volume.clone()))?;
                let dark = haze(2.0 * EXTINCTION);
                let transfer =
                    DeviceTransfer::new(context.gpu(), &loaded, &dark, DisabledOptimizations::NONE)?;
                let late = if build < FIRST_BUILDS { FIRST_DELAY_MS } else { DELAY_MS };
                sleep(Duration::from_secs_f64(1e-3 * late));
                self.inner.build(&BuildContext { transfer: &transfer, ..*context })
            }
        }
    }
}

/// Constant extinction of the test volume, 1/mm.
pub const EXTINCTION: f64 = 0.05;

pub fn haze(extinction: f64) -> TransferFunction {
    TransferFunction::new(Quantity::Extinction, &[(-1e5, extinction), (1e5, extinction)])
}

fn compared(volume: &Arc<Volume>, scene: &Scene, methods: &[Box<dyn Method>]) -> Option<Comparison> {
    compared_within(volume, scene, methods, &[])
}

pub fn compared_within(
    volume: &Arc<Volume>,
    scene: &Scene,
    methods: &[Box<dyn Method>],
    budgets: &[Budget],
) -> Option<Comparison> {
    if !common::has_adapter() {
        return None;
    }
    let tf = haze(EXTINCTION);
    let session = Session::open(None, Arc::clone(volume), &tf, DisabledOptimizations::NONE).unwrap();
    let effort = Effort {
        repeats: 5,
        short_repeats: 0,
        points: 4000,
        rays: 60,
        depths: 200,
        check: Checked::Sample,
        flicker: 0,
    };
    let job = Job::new(&session, (volume, &tf), scene, "haze", effort);
    let mut journal = Journal::nowhere();
    Some(compare_within(&job, methods, budgets, &mut journal, &mut Progress::unseen()).unwrap())
}

pub fn scene(volume: &Volume) -> Scene {
    let light = Light::Directional { toward: glam::DVec3::Z };
    Scene { lights: vec![light.into()], width: 32, height: 32, ..Scene::framing(volume) }
}

#[test]
fn a_planted_delay_and_a_planted_error_come_out() {
    let volume = Arc::new(load(&VolumeSpec::new("phantom:slab:24")).unwrap());
    let scene = scene(&volume);
    let real = "dsm:map=128,epsilon=0.002";
    let methods = [parse(real).unwrap(), Planted::boxed(real, Fault::LateAndDark)];
    let Some(result) = compared(&volume, &scene, &methods) else { return };
    assert!(result.failures.is_empty());
    let [real, planted] = [0, 1].map(|i| &result.compared[i].row);

    // The planted delay shows in the times that count, and no other one.
    let build_min = planted.build_ms_min.unwrap();
    let added = build_min - real.build_ms_min.unwrap();
    assert!(build_min >= DELAY_MS && added < 6.0 * DELAY_MS, "{build_min} ms, {added} ms more");
    assert!(planted.build_ms_max.unwrap() < FIRST_DELAY_MS, "the warm-up does not count");
    let (build, wall) = (planted.build_ms.unwrap(), planted.build_wall_ms.unwrap());
    assert!(wall >= DELAY_MS && (build - wall).abs() < 0.05 * wall, "{build} {wall}");
    assert!(planted.build_first_ms.unwrap() >= FIRST_DELAY_MS);
    assert!(planted.fps_moving.unwrap() <= 1000.0 / DELAY_MS && planted.repeats == Some(5));

    // The planted error on rays: T^2 - T is farthest from 0 where T is a half.
    let ray_err = planted.ray_err_max.unwrap();
    assert!((ray_err - 0.25).abs() < 0.01, "{ray_err}");
    assert!(real.ray_err_max.unwrap() < 0.01);
    assert_eq!((real.bound_held, planted.bound_held), (Some(true), Some(false)));
    assert!(result.notes.iter().any(|n| n.starts_with("planted") && n.contains("bound does not hold")));

    // The planted error at visible points: by the exact field, at points of another seed.
    let tf = haze(EXTINCTION);
    let field = ExactField::new(&volume, &tf);
    let (mut weight, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for point in field.visible_points(&scene, 20_000, 77) {
        let t = field.transmittance_to_light(point.position, &scene.light());
        weight += point.weight;
        sum += point.weight * (t * t - t);
        squares += point.weight * (t * t - t).powi(2);
    }
    let (mean, rms) = (sum / weight, (squares / weight).sqrt());
    let signed = planted.point_err_mean_signed.unwrap();
    assert!(mean < -0.02 && (signed - mean).abs() < 0.1 * mean.abs(), "{signed}, planted {mean}");
    let got = planted.point_err_rms.unwrap();
    assert!((got - rms).abs() < 0.1 * rms, "{got}, planted {rms}");
    assert!(planted.image_rmse.unwrap() > 3.0 * real.image_rmse.unwrap());
    assert!(planted.image_ssim.unwrap() < real.image_ssim.unwrap());
    assert!(planted.shadow_rmse.unwrap() > 3.0 * real.shadow_rmse.unwrap());
    assert!(planted.shadow_ssim.unwrap() < real.shadow_ssim.unwrap());
    assert!(planted.flip.unwrap() > 3.0 * real.flip.unwrap());
}

#[test]
fn planted_failures_are_rows_that_say_why() {
    let volume = Arc::new(load(&VolumeSpec::new("phantom:slab:8")).unwrap());
    let mut methods = parse_list("none;dsm:map=32").unwrap();
    methods.insert(0, Planted::boxed("dsm:map=32", Fault::FailsFrom(0)));
    methods.insert(2, Planted::boxed("dsm:map=32,epsilon=0.1", Fault::FailsFrom(3)));
    let Some(result) = compared(&volume, &scene(&volume), &methods) else { return };
    let rows = result.rows();
    let status: Vec<_> =
        rows.iter().map(|r| (r.method.as_str(), r.status.as_str(), r.note.as_str())).collect();
    let expected = [
        ("planted", "failed", "planted failure (build): 0"),
        ("none", "ok", ""),
        ("planted", "failed", "planted failure (build): 3"),
        ("dsm", "ok", ""),
    ];
    assert_eq!(status, expected);
    assert!(result.compared[0].picture.is_none() && rows[0].point_err_rms.is_none());
    // Values measured before the failure remain in the row.
    assert!(rows[2].point_err_rms.is_some() && rows[2].frame_ms.is_none() && rows[3].frame_ms.is_some());
    assert_eq!(result.failures.len(), 2);
}
