//! Shares of several processes: together they give the map and the picture of one process, to the last bit.

use crate::pages::limited;
use crate::{extinction, renderer};
use std::sync::Arc;
use umbravox::field::WorkShare;
use umbravox::open::{VolumeSpec, load};
use umbravox::render::{DisabledOptimizations, Renderer, Session};
use umbravox::scene::{Light, LightSource, Scene, Shading};
use umbravox::shadow::{self, MapShare, Method, ShadowMap};

fn session(renderer: &Arc<Renderer>, phantom: &str) -> Session {
    let volume = Arc::new(load(&VolumeSpec::new(phantom)).unwrap());
    let tf = extinction(&[(300.0, 0.0), (900.0, 0.4)]);
    Session::on(renderer, volume, &tf, DisabledOptimizations::NONE).unwrap()
}

/// Builds a map by shares, each as if by a process of its own.
fn by_shares(session: &Session, method: &dyn Method, source: &LightSource, count: u32) -> ShadowMap {
    let Session { renderer, loaded, transfer } = session;
    let field = (loaded, transfer);
    let share = |i| {
        let share = WorkShare::new(i, count).unwrap();
        let map = renderer.shadow_share(field, method, source, None, share).unwrap();
        let words = MapShare::of(renderer.gpu(), &map).unwrap().unwrap().to_words();
        MapShare::from_words(&words).unwrap()
    };
    let shares: Vec<MapShare> = (0..count).map(share).collect();
    renderer.merged_shadow(field, method, source, None, &shares).unwrap()
}

#[test]
fn shares_form_the_map_and_the_picture_of_one_process() {
    let Some(renderer) = renderer() else { return };
    let session = session(renderer, "phantom:struts:64");
    let volume = &session.loaded.volume;
    let scene = Scene { width: 100, height: 90, shading: Shading::Lambert, ..Scene::framing(volume) };
    for light in [scene.light(), Light::Point { position: volume.center_mm() + 60.0 }] {
        for name in ["dsm:map=100", "dsm:map=70,compress=optimal,near=0"] {
            let method = shadow::parse(name).unwrap();
            let whole = session.shadow(method.as_ref(), light).unwrap();
            let picture = session.render(&whole, &scene).unwrap().pixels;
            assert!(picture.iter().any(|c| *c > 0.05));
            for count in [1, 2, 5] {
                let map = by_shares(&session, method.as_ref(), &light.into(), count);
                let counts = |map: &ShadowMap| session.node_map(map).unwrap().unwrap().nodes;
                assert!(counts(&map) == counts(&whole), "{name}: nodes of {count} shares");
                let [own, of_whole] = [&map, &whole].map(|map| {
                    let report = &map.report;
                    [report.nodes_total, report.nodes_max, report.texels_hit, Some(report.bytes_used)]
                });
                assert_eq!(own, of_whole, "{name}, {count} shares");
                let rows = (0..count).flat_map(|i| {
                    let share = WorkShare::new(i, count).unwrap();
                    let (loaded, transfer) = (&session.loaded, &session.transfer);
                    let rows = renderer.rows_of_share(loaded, transfer, &scene, share);
                    let drawn = renderer.render_rows(loaded, transfer, &map, &scene, rows).unwrap();
                    drawn.pixels.into_raw_vec_and_offset().0
                });
                assert!(rows.eq(picture.iter().copied()), "{name}: picture of {count} shares");
            }
        }
    }
    let osm = shadow::parse("osm").unwrap();
    let refused = renderer.merged_shadow(
        (&session.loaded, &session.transfer),
        osm.as_ref(),
        &scene.light().into(),
        None,
        &[],
    );
    assert_eq!(refused.err().unwrap().exit_status(), 2);
    // Too few blocks, part of a quad, a block without nodes, and one with fewer than its texels need.
    let damaged: [&[u32]; 4] = [
        &[9, 0, 0, 0, 0, 1],
        &[0, 0, 0, 0, 0, 1],
        &[1, 0, 0, 0, 0, 0, 1, 5],
        &[1, 0, 0, 0, 0, 0, 3, 0, 1, 0, 0, 0],
    ];
    for words in damaged {
        assert!(MapShare::from_words(words).is_err(), "{words:?}");
    }
}

/// The light rays of eight shares march through almost equally many cells.
#[test]
fn shares_without_tiles_add_nothing() {
    let Some(renderer) = renderer() else { return };
    let session = session(renderer, "phantom:sphere:24");
    let source = Scene::framing(&session.loaded.volume).light().into();
    let method = shadow::parse("dsm:map=32").unwrap();
    let maps = [1, 40].map(|count| by_shares(&session, method.as_ref(), &source, count));
    let [whole, many] = maps.map(|map| [map.report.nodes_total, map.report.nodes_max, map.report.texels_hit]);
    assert!(whole[0].unwrap() > 0);
    assert_eq!(many, whole);
}

#[test]
fn shares_have_equal_work() {
    let Some(renderer) = renderer() else { return };
    // A device of its own: work counters add up the passes of all tests that share a device.
    let renderer = Arc::new(limited(renderer, 1 << 20));
    let session = session(&renderer, "phantom:struts:96");
    let method = shadow::parse("dsm:map=192,epsilon=0.3").unwrap();
    let field = (&session.loaded, &session.transfer);
    let source = Scene::framing(&session.loaded.volume).light().into();
    let cells = |i| {
        let share = WorkShare::new(i, 8).unwrap();
        let build = || renderer.shadow_share(field, method.as_ref(), &source, None, share);
        let (map, work) = renderer.kernels().counting_work(build).unwrap();
        // Tiles that are built again would count twice.
        assert_eq!(map.report.pool_growths, 0);
        work.cells
    };
    let cells: Vec<u64> = (0..8).map(cells).collect();
    let mean = cells.iter().sum::<u64>() as f64 / 8.0;
    let most = *cells.iter().max().unwrap() as f64;
    println!("cells by share {cells:?}, largest / mean {:.3}", most / mean);
    assert!(mean > 1e4 && most <= 1.1 * mean, "{cells:?}");
}
