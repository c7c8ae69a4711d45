//! Hot stages of the device: tables, an opacity edit, deep shadow map, frames. On the built-in chest, and on CT_AVM if
//! available (`../shared/data` or `UMBRAVOX_DATA`); `UMBRAVOX_BENCH_VOLUME` names another volume instead.

#[path = "../tests/common/mod.rs"]
mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::sync::Arc;
use umbravox::open::presets;
use umbravox::open::{VolumeSpec, load};
use umbravox::render::{DisabledOptimizations, Session};
use umbravox::scene::Scene;
use umbravox::shadow;
use umbravox::transfer::{PairTable, TransferTables};

fn stages(criterion: &mut Criterion) {
    let mut sources = vec![("thorax", "phantom:thorax:128".to_string())];
    sources.extend(common::scan_if_present("CT_AVM").map(|scan| ("CT_AVM", scan.display().to_string())));
    let own = std::env::var("UMBRAVOX_BENCH_VOLUME").ok();
    if let Some(volume) = &own {
        sources = vec![(volume, volume.clone())];
    }
    for (name, source) in sources {
        let volume = Arc::new(load(&VolumeSpec::new(source)).expect("the volume loads"));
        let tf = presets::resolve("vessels", &volume).expect("a preset").tf;
        let mut group = criterion.benchmark_group(format!("gpu/{name}"));
        group.sample_size(10);
        let session = match Session::open(None, Arc::clone(&volume), &tf, DisabledOptimizations::NONE) {
            Ok(session) => session,
            Err(e) if e.what == "no graphics adapter" => {
                println!("skipped: no graphics adapter");
                return;
            }
            Err(e) => panic!("{e}"),
        };
        let on_device = &session.loaded.on_device;
        group.bench_function("tables", |b| {
            b.iter(|| {
                (
                    TransferTables::build(black_box(&tf), on_device.mapping, on_device.texel_range),
                    PairTable::build(black_box(&tf), on_device.mapping),
                )
            });
        });
        let mut edited = tf.clone();
        edited.points.iter_mut().for_each(|point| point.value += 1.0);
        group.bench_function("opacity edit", |b| b.iter(|| session.fresh_transfer(black_box(&edited))));
        let scene = Scene { width: 256, height: 256, ..Scene::framing(&volume) };
        let [none, dsm] = ["none", "dsm:map=256"].map(|m| shadow::parse(m).expect("a method"));
        group.bench_function("build dsm", |b| b.iter(|| session.shadow(dsm.as_ref(), scene.light())));
        group.bench_function("opacity edit to picture", |b| {
            b.iter(|| {
                let transfer = session.fresh_transfer(&edited).expect("tables");
                let renderer = &session.renderer;
                let map = renderer.shadow(&session.loaded, &transfer, dsm.as_ref(), scene.light());
                renderer.render(&session.loaded, &transfer, &map.expect("a map"), &scene).map(|p| p.span)
            })
        });
        for method in [none, dsm] {
            let map = session.shadow(method.as_ref(), scene.light()).expect("a map");
            group.bench_function(format!("frame {}", method.name()), |b| {
                b.iter(|| session.render(&map, &scene))
            });
        }
        group.finish();
    }
}

criterion_group!(benches, stages);
criterion_main!(benches);
