//! Construction and classification of min/max bricks, on the default phantom (256x192x128 `i16`) and on CT_AVM if available.

#[path = "../tests/common/mod.rs"]
mod common;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use umbravox::field::ActiveBricks;
use umbravox::open::{VolumeSpec, load};
use umbravox::transfer::{Quantity, TransferFunction};

fn vessels() -> TransferFunction {
    TransferFunction::new(Quantity::Opacity, &[(180.0, 0.0), (300.0, 0.6)])
}

fn bricks(criterion: &mut Criterion) {
    let mut sources = vec![("thorax", "phantom:thorax".to_string())];
    sources.extend(common::scan_if_present("CT_AVM").map(|scan| ("CT_AVM", scan.display().to_string())));
    for (name, source) in sources {
        let volume = match load(&VolumeSpec::new(source)) {
            Ok(volume) => volume,
            Err(error) => panic!("{error}"),
        };
        let tf = vessels();
        let mut group = criterion.benchmark_group(format!("bricks/{name}"));
        group.sample_size(20);
        group.bench_function("build", |b| {
            // A clone of a volume without bricks builds its own.
            b.iter_batched(|| volume.clone(), |volume| volume.bricks().len(), BatchSize::PerIteration)
        });
        group.bench_function("classify", |b| b.iter(|| ActiveBricks::of(volume.bricks(), black_box(&tf))));
        group.finish();
    }
}

criterion_group!(benches, bricks);
criterion_main!(benches);
