//! Float64 reference against closed forms, invariances, brute force and an independent implementation.

mod brute_force;
mod closed_forms;
mod curve;
mod gradient;
mod invariances;
mod light_mean;
mod phantoms;
mod picture;
mod real_scans;

use fastrand::Rng;
use glam::{DAffine3, DVec3};
use ndarray::Array3;
use umbravox::transfer::{Quantity, TransferFunction};
use umbravox::volume::{Provenance, Scaling, Volume, Voxels};

/// Allowed relative error of the float64 reference against closed forms: its error bound of 1e-12 and some rounding.
const EXACT: f64 = 2e-12;

fn volume_of(voxels: Voxels, scaling: Scaling, world_from_index: DAffine3) -> Volume {
    Volume::new(voxels, scaling, world_from_index, Provenance::new("test", "phantom", "test")).unwrap()
}

/// Creates a volume with the values `f(i, j, k)`.
fn volume([nx, ny, nz]: [usize; 3], affine: DAffine3, f: impl Fn(f64, f64, f64) -> f64) -> Volume {
    let values = Array3::from_shape_fn((nz, ny, nx), |(k, j, i)| f(i as f64, j as f64, k as f64));
    volume_of(Voxels::F64(values), Scaling::IDENTITY, affine)
}

fn transfer(quantity: Quantity, reference_length_mm: f64, points: &[(f64, f64)]) -> TransferFunction {
    TransferFunction { reference_length_mm, ..TransferFunction::new(quantity, points) }
}

fn extinction(points: &[(f64, f64)]) -> TransferFunction {
    transfer(Quantity::Extinction, 1.0, points)
}

fn opacity(points: &[(f64, f64)]) -> TransferFunction {
    transfer(Quantity::Opacity, 1.0, points)
}

#[track_caller]
fn assert_close(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance * want.abs().max(1.0), "got {got}, want {want}");
}

fn in_box(random: &mut Rng, low: DVec3, high: DVec3) -> DVec3 {
    low + (high - low) * DVec3::new(random.f64(), random.f64(), random.f64())
}

/// Creates a rough field with values 0 to 100.
fn rough_volume(affine: DAffine3) -> Volume {
    volume([9, 7, 6], affine, |i, j, k| (i * i * 7.0 + j * 13.0 * k + k * 29.0 + i * j * k * 3.0) % 101.0)
}

fn oblique() -> DAffine3 {
    DAffine3::from_cols(
        DVec3::new(0.8, -0.2, 0.15),
        DVec3::new(0.1, 1.1, -0.25),
        DVec3::new(-0.3, 0.4, 2.3),
        DVec3::new(-20.0, 31.0, 7.5),
    )
}

fn transfer_functions() -> Vec<TransferFunction> {
    let comb: Vec<_> = (4..100)
        .step_by(5)
        .map(f64::from)
        .flat_map(|c| [(c - 0.4, 0.0), (c + 0.1, 2.0), (c + 0.6, 0.0)])
        .collect();
    let of_opacity = |points: &[(f64, f64)]| transfer(Quantity::Opacity, 1.5, points);
    vec![
        of_opacity(&[(20.0, 0.0), (90.5, 0.7)]),
        extinction(&[(20.0, 0.0), (60.0, 0.4), (90.0, 0.1)]),
        of_opacity(&[(50.5, 0.01), (50.5, 0.5)]),
        extinction(&comb),
        of_opacity(&[(10.0, 0.0), (95.5, 1.0), (98.5, 1.0), (100.5, 0.2)]),
    ]
}
