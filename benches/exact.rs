//! Float64 reference: rays across a volume, curves and their inverse, visible points.
//!
//! On CT_AVM if available (`../shared/data` or `UMBRAVOX_DATA`), else on the built-in chest.

#[path = "../tests/common/mod.rs"]
mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use std::hint::black_box;
use umbravox::exact::ExactField;
use umbravox::open::{VolumeSpec, load};
use umbravox::scene::Scene;
use umbravox::transfer::{Quantity, TransferFunction};
use umbravox::volume::Volume;

const RAYS: usize = 2_000;

fn volume() -> Volume {
    let spec = common::scan_if_present("CT_AVM")
        .map_or_else(VolumeSpec::default, |scan| VolumeSpec::new(scan.to_string_lossy()));
    println!("volume: {}", spec.source);
    load(&spec).expect("the volume loads")
}

/// Transfer function over shares of the volume's value range.
fn transfer(quantity: Quantity, volume: &Volume, points: &[(f64, f64)]) -> TransferFunction {
    let [min, max] = volume.value_range();
    TransferFunction::new(quantity, points).scale_values(|share| min + share * (max - min))
}

/// Random segments across the whole volume, each through a point inside.
fn segments(volume: &Volume) -> Vec<(DVec3, DVec3)> {
    let corners = volume.corners_mm();
    let diagonal_mm = corners[0].distance(corners[7]);
    let mut random = fastrand::Rng::with_seed(1);
    let mut vector = || DVec3::new(random.f64(), random.f64(), random.f64());
    (0..RAYS)
        .map(|_| {
            let w = vector();
            let middle = corners[0]
                + (corners[1] - corners[0]) * w.x
                + (corners[2] - corners[0]) * w.y
                + (corners[4] - corners[0]) * w.z;
            let half = (vector() - 0.5).normalize() * diagonal_mm;
            (middle - half, middle + half)
        })
        .collect()
}

fn exact(c: &mut Criterion) {
    let volume = volume();
    let segments = segments(&volume);
    let comb: Vec<_> = (0..20)
        .map(|k| 0.07 + 0.045 * f64::from(k))
        .flat_map(|v| [(v - 0.004, 0.0), (v, 0.5), (v + 0.004, 0.0)])
        .collect();
    let functions = [
        ("opacity_ramp", transfer(Quantity::Opacity, &volume, &[(0.15, 0.0), (0.85, 0.6)])),
        ("extinction_ramp", transfer(Quantity::Extinction, &volume, &[(0.15, 0.0), (0.85, 0.3)])),
        ("jump", transfer(Quantity::Extinction, &volume, &[(0.4013, 0.0), (0.4013, 0.25)])),
        ("comb", transfer(Quantity::Opacity, &volume, &comb)),
    ];
    let mut group = c.benchmark_group("exact");
    group.sample_size(20);
    group.throughput(Throughput::Elements(RAYS as u64));
    for (name, tf) in &functions {
        let field = ExactField::new(&volume, tf);
        group.bench_function(format!("optical_depths/{name}"), |b| {
            b.iter(|| field.optical_depths(black_box(&segments)));
        });
    }
    let field = ExactField::new(&volume, &functions[0].1);
    let (a, b) = *segments
        .iter()
        .max_by(|x, y| field.optical_depth(x.0, x.1).total_cmp(&field.optical_depth(y.0, y.1)))
        .expect("there are segments");
    let curve = field.curve(a, b);
    group.throughput(Throughput::Elements(1));
    group.bench_function("curve", |bench| bench.iter(|| field.curve(black_box(a), b)));
    group.bench_function("curve/optical_depth_at", |bench| {
        bench.iter(|| curve.optical_depth_at(black_box(0.4713 * a.distance(b))));
    });
    group.bench_function("curve/depth_of_optical_depth", |bench| {
        bench.iter(|| curve.depth_of_optical_depth(black_box(0.4713 * curve.total())));
    });
    let scene = Scene::framing(&volume);
    group.throughput(Throughput::Elements(RAYS as u64));
    group.bench_function("visible_points", |bench| {
        bench.iter(|| field.visible_points(black_box(&scene), RAYS, 1));
    });
    group.finish();
}

criterion_group!(benches, exact);
criterion_main!(benches);
