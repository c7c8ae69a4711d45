//! Tests on a graphics device: against the exact reference, invariances, extreme volumes.
//!
//! Most tests share one device.

mod attack;
mod authors;
mod blocks;
mod bound;
#[path = "../common/browser.rs"]
mod browser;
mod certified;
mod checks;
mod cli;
mod clip;
#[path = "../common/mod.rs"]
mod common;
mod comparability;
mod compare;
mod degenerate;
mod enclosure;
mod estimators;
mod exact_pictures;
mod filters;
mod forced;
mod golden;
mod gradient_opacity;
mod halfangle;
mod invariance;
mod joint;
mod kajiya_kay;
mod labels;
mod layers;
mod light_volume;
mod lights;
mod lines;
mod map_methods;
mod mean_error;
mod mesh;
mod minimal_polyline;
mod near;
mod nodes;
mod occlusion;
mod page;
mod pages;
mod points;
mod pool;
#[path = "../common/program.rs"]
mod program;
mod samples;
mod sat;
#[path = "../common/attack/mod.rs"]
mod scenes;
mod shading;
mod shadow_cache;
mod soft_lights;
mod split_builds;
mod strands;
mod tolerance;
mod tubes;
mod tuning;
mod tunnel;
mod view;
mod wavelet;
mod work_shares;

use glam::{DAffine3, DVec3};
use ndarray::Array3;
use std::sync::{Arc, OnceLock};
use umbravox::exact::ExactField;
use umbravox::gpu::Gpu;
use umbravox::open::{VolumeSpec, load};
use umbravox::render::{DisabledOptimizations, Renderer, Session};
use umbravox::scene::{Light, Scene};
use umbravox::shadow::{self, ShadowMap};
use umbravox::transfer::{Quantity, TransferFunction};
use umbravox::volume::{Provenance, Scaling, Volume, Voxels};

/// Device that all tests share; `None` and a printed line if no adapter is expected.
fn renderer() -> Option<&'static Arc<Renderer>> {
    // Opened once: compiling pipelines takes longer than most tests.
    static RENDERER: OnceLock<Arc<Renderer>> = OnceLock::new();
    if RENDERER.get().is_none() {
        let gpu = common::gpu()?;
        RENDERER.get_or_init(|| Arc::new(Renderer::new(gpu)));
    }
    RENDERER.get()
}

/// NVIDIA's driver finds no adapter for the 31st instance of a process; forty devices still open.
#[test]
fn forty_devices_open_one_after_the_other() {
    if renderer().is_none() {
        return;
    }
    for n in 0..40 {
        Gpu::open(None).unwrap_or_else(|e| panic!("device {n}: {e}"));
    }
}

/// Volume and transfer function on the shared device.
struct Setup {
    session: Session,
    tf: TransferFunction,
}

impl Setup {
    /// Opens a volume on the shared device; `None` and a printed line if there is no adapter.
    fn open(volume: &Arc<Volume>, tf: &TransferFunction) -> Option<Self> {
        Self::forced(volume, tf, DisabledOptimizations::NONE)
    }

    /// Opens a volume with some skipped work forced on.
    fn forced(volume: &Arc<Volume>, tf: &TransferFunction, forced: DisabledOptimizations) -> Option<Self> {
        Some(Self {
            session: Session::on(renderer()?, Arc::clone(volume), tf, forced).unwrap(),
            tf: tf.clone(),
        })
    }

    /// Whether the adapter's filter has float32 weights, as software adapters do; graphics cards use 8 bits of a
    /// weight.
    fn weighs_finely(&self) -> bool {
        renderer().is_some_and(|r| r.gpu().info.device_type == wgpu::DeviceType::Cpu)
    }

    fn volume(&self) -> &Volume {
        &self.session.loaded.volume
    }

    fn exact(&self) -> ExactField<'_> {
        ExactField::new(self.volume(), &self.tf)
    }

    fn shadow(&self, method: &str, light: Light) -> ShadowMap {
        let method = shadow::parse(method).unwrap();
        self.session.shadow(method.as_ref(), light).unwrap()
    }

    fn picture_of(&self, map: &ShadowMap, scene: &Scene) -> Array3<f32> {
        self.session.render(map, scene).unwrap().pixels
    }

    fn picture(&self, method: &str, scene: &Scene) -> Array3<f32> {
        self.picture_of(&self.shadow(method, scene.light()), scene)
    }

    fn query(&self, map: &ShadowMap, points_mm: &[DVec3]) -> Vec<f32> {
        self.session.query(map, points_mm).unwrap()
    }

    /// Scene of `width x height` pixels that frames the volume, lit from the side, with a background.
    fn scene(&self, width: u32, height: u32) -> Scene {
        let background = [0.1, 0.25, 0.4];
        Scene { width, height, background, ambient: 0.15, ..Scene::framing(self.volume()) }
    }
}

fn phantom(name: &str) -> Arc<Volume> {
    Arc::new(load(&VolumeSpec::new(format!("phantom:{name}"))).unwrap())
}

/// Loads a real scan; `None` and a printed line if it is not expected.
fn scan(name: &str) -> Option<Arc<Volume>> {
    let path = common::scan(name)?;
    Some(Arc::new(load(&VolumeSpec::new(path.to_string_lossy())).unwrap()))
}

fn volume_of(voxels: Voxels, world_from_index: DAffine3) -> Volume {
    let provenance = Provenance::new("test", "phantom", "test");
    Volume::new(voxels, Scaling::IDENTITY, world_from_index, provenance).unwrap()
}

/// Voxels of a phantom under another affine.
fn under(affine: DAffine3, name: &str) -> Arc<Volume> {
    Arc::new(volume_of(phantom(name).resident().unwrap().clone(), affine))
}

fn transfer(quantity: Quantity, points: &[(f64, f64)]) -> TransferFunction {
    // Colours that differ in every channel, so that no channel is checked by another.
    let last = points.len().max(2) as f64 - 1.0;
    let mut tf = TransferFunction::new(quantity, points);
    for (i, point) in tf.points.iter_mut().enumerate() {
        let w = i as f64 / last;
        point.color = [1.0 - 0.7 * w, 0.3 + 0.5 * w, 0.9 - 0.9 * (w - 0.5).abs()];
    }
    tf
}

fn extinction(points: &[(f64, f64)]) -> TransferFunction {
    transfer(Quantity::Extinction, points)
}

fn opacity(points: &[(f64, f64)]) -> TransferFunction {
    transfer(Quantity::Opacity, points)
}

/// Transfer functions over the values `[low, high]`: a ramp, two jumps, and a comb of narrow peaks.
fn transfer_functions([low, high]: [f64; 2]) -> [TransferFunction; 3] {
    let at = |w: f64| low + (high - low) * w;
    let peaks = (0..6)
        .map(|k| 0.13 + 0.14 * f64::from(k))
        .flat_map(|w| [(at(w), 0.0), (at(w + 0.01), 0.5), (at(w + 0.02), 0.0)])
        .collect::<Vec<_>>();
    [
        opacity(&[(at(0.3), 0.0), (at(0.9), 0.35)]),
        extinction(&[(at(0.35), 0.0), (at(0.35), 0.03), (at(0.62), 0.06), (at(0.62), 0.4)]),
        extinction(&peaks),
    ]
}

/// Lights: directional; point outside; point just outside (perspective or octahedral); point inside.
fn lights(volume: &Volume) -> [(&'static str, Light); 4] {
    let (center, radius) = volume.bounding_sphere_mm();
    let toward = DVec3::new(0.4, -0.5, 0.75);
    let point = |distance: f64| Light::Point { position: center + toward.normalize() * distance * radius };
    [
        ("directional", Light::Directional { toward }),
        ("point outside", point(3.0)),
        ("point near", point(0.9)),
        ("point inside", point(0.23)),
    ]
}

/// Largest difference of two pictures.
#[track_caller]
fn largest_difference(a: &Array3<f32>, b: &Array3<f32>) -> f64 {
    assert_eq!(a.dim(), b.dim());
    a.iter()
        .zip(b)
        .map(|(a, b)| f64::from((a - b).abs()))
        .map(|d| if d.is_nan() { f64::INFINITY } else { d })
        .fold(0.0, f64::max)
}

fn rms_difference(a: &Array3<f32>, b: &Array3<f32>) -> f64 {
    assert_eq!(a.dim(), b.dim());
    let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

/// Volume of grains of several sizes, with empty space between them, under an oblique affine.
fn grains() -> Arc<Volume> {
    let value = |(k, j, i): (usize, usize, usize)| {
        let wave = |n: usize, rate: f64| (n as f64 * rate).sin();
        let v = wave(i, 0.71) * wave(j, 0.53) + wave(k, 0.37) + 0.4 * wave(i + 2 * j + 3 * k, 1.9);
        if i > 30 && j < 20 { 0.0 } else { (500.0 * v).max(0.0) as f32 }
    };
    let affine = DAffine3::from_translation(DVec3::new(-20.0, 7.0, 3.0))
        * DAffine3::from_rotation_z(0.3)
        * DAffine3::from_scale(DVec3::new(0.8, 1.1, 1.5));
    Arc::new(volume_of(Voxels::F32(Array3::from_shape_fn((30, 36, 44), value)), affine))
}
