//! Voxelisation of a million segments of curls into 256 voxels along the longest side, with both kernels.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use umbravox::files::loading::Loading;
use umbravox::strands::{Kernel, StrandGrid, StrandSet, voxelise};

const SEGMENTS: usize = 1_000_000;

fn spread(criterion: &mut Criterion) {
    let strands = StrandSet::Curly.build(SEGMENTS).expect("it can be built");
    let grid = StrandGrid::around(strands.bounds_mm().expect("there are points"), 256).expect("it fits");
    let mut group = criterion.benchmark_group("voxelise/hair-curly:1000000");
    group.sample_size(10);
    group.throughput(Throughput::Elements(SEGMENTS as u64));
    for (name, kernel) in [("box", Kernel::Box), ("tent", Kernel::Tent)] {
        group.bench_function(name, |b| {
            b.iter(|| voxelise(black_box(&strands), &grid, kernel, &Loading::default()))
        });
    }
    group.finish();
}

criterion_group!(benches, spread);
criterion_main!(benches);
