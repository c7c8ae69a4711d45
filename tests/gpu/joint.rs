//! Shadow maps that are built in the submission of the picture, as in a window on a graphics card.

use super::*;
use umbravox::engine::{Building, CachedSession, MapCoverage, ReusePolicy, ShadowCache, Work};
use umbravox::field::DeferredPasses;
use umbravox::gpu::read_back;
use umbravox::render::{DisplayTexture, LightMaps, Pace, Screen};
use umbravox::scene::LightSource;

/// Window's session: a renderer that reuses memory, and an empty cache of shadow maps.
fn window(volume: &Arc<Volume>, tf: &TransferFunction) -> Option<CachedSession> {
    let mut gpu = common::gpu()?;
    // Software adapters have timestamps, too, but they do not enclose the work.
    let has_timestamps = gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
    gpu.timestamp_period_ns = has_timestamps.then(|| gpu.queue.get_timestamp_period());
    let renderer = Arc::new(Renderer::live(gpu, f64::INFINITY));
    let cache = ShadowCache::new(ShadowCache::INTERACTIVE, ReusePolicy::Covering);
    let mut session = CachedSession::new(renderer, DisabledOptimizations::NONE, cache);
    session.load(Arc::clone(volume), None).unwrap();
    session.set_transfer(tf, &mut Work::default()).unwrap();
    Some(session)
}

/// Reads the picture of a window.
fn pixels(gpu: &Gpu, DisplayTexture { texture, width, height, .. }: &DisplayTexture) -> Vec<u8> {
    let size = texture.size();
    let bytes_per_row = Some(4 * width);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(4 * width * height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: None };
    let into = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), into, size);
    gpu.submit([encoder.finish()]);
    read_back(gpu, &buffer, (4 * width * height) as usize).unwrap()
}

/// Draws a picture whose maps are built with it. Returns whether the maps are complete.
fn draw(session: &mut CachedSession, method: &str, scene: &Scene, target: &DisplayTexture) -> bool {
    let method = shadow::parse(method).unwrap();
    let (deferred, extent) = (DeferredPasses::default(), (scene, MapCoverage::Picture));
    let mut work = Work::default();
    let building = Building { deferred: Some(&deferred), ..Building::default() };
    let made = session.prepare_with(method.as_ref(), extent, &mut work, building).unwrap();
    let shadows = LightMaps::from(made.shadows).after(&deferred);
    let mut pace = Pace::new(f64::INFINITY);
    let screen = Screen { target, pace: &mut pace };
    made.renderer.draw_to(screen, (made.loaded, made.transfer), shadows, scene, || true).unwrap().unwrap();
    session.complete(method.as_ref(), deferred, &mut work).unwrap()
}

fn reports(session: &mut CachedSession, method: &str, scene: &Scene) -> Vec<[Option<u64>; 4]> {
    let method = shadow::parse(method).unwrap();
    let mut work = Work::default();
    let made = session.prepare(method.as_ref(), (scene, MapCoverage::Picture), &mut work).unwrap();
    assert_eq!(work.built, 0, "{method:?}: the completed map is in the cache");
    let counts = |map: &&ShadowMap| {
        let report = &map.report;
        [report.nodes_total, report.nodes_max, report.texels_hit, Some(report.bytes_used)]
    };
    made.shadows.iter().map(counts).collect()
}

fn scene_at(volume: &Volume, turn: f64) -> Scene {
    let light = Light::Directional { toward: DVec3::new(turn.cos(), turn.sin(), 0.8).normalize() };
    let scene = Scene { width: WIDTH, height: 80, ..Scene::framing(volume) };
    Scene { lights: vec![LightSource { light, ..scene.lights[0].clone() }], ..scene }
}

/// Width of pictures whose rows a copy to a buffer may hold.
const WIDTH: u32 = 128;

#[test]
fn a_moved_light_takes_one_submission_and_one_wait() {
    let volume = phantom("thorax:48");
    let tf = opacity(&[(-600.0, 0.0), (-200.0, 0.05), (200.0, 0.3), (600.0, 0.6)]);
    let Some(mut joint) = window(&volume, &tf) else { return };
    let Some(mut alone) = window(&volume, &tf) else { return };
    let targets =
        [&joint, &alone].map(|session| DisplayTexture::new(session.renderer.gpu(), WIDTH, 80).unwrap());
    for method in
        ["dsm:map=64", "osm:map=64", "bom:map=64", "fourier:map=64", "avsm:map=64", "lightvolume:scale=4"]
    {
        for step in 0..3 {
            // The last picture has two lights, and so two rendering passes.
            let mut scene = scene_at(&volume, 0.02 * f64::from(step));
            if step == 2 {
                let other = scene_at(&volume, 2.0).lights[0].clone();
                scene.lights.push(other);
            }
            let before = joint.renderer.gpu().traffic.counts();
            assert!(draw(&mut joint, method, &scene, &targets[0]), "{method}");
            let after = joint.renderer.gpu().traffic.counts();
            // Before the first picture, the size of the pool is unknown, and a light volume packs its nodes.
            let counted = step == 1 && !method.starts_with("lightvolume");
            if counted && joint.renderer.gpu().timestamp_period_ns.is_some() {
                assert_eq!([0, 1].map(|i| after[i] - before[i]), [1, 1], "{method}: submissions and waits");
            }
            let reported = reports(&mut joint, method, &scene);
            let parsed = shadow::parse(method).unwrap();
            let extent = (&scene, MapCoverage::Picture);
            alone.prepare(parsed.as_ref(), extent, &mut Work::default()).unwrap();
            assert_eq!(reported, reports(&mut alone, method, &scene), "{method}");
            assert!(draw(&mut alone, method, &scene, &targets[1]), "{method}");
            let [a, b] = [(&joint, &targets[0]), (&alone, &targets[1])]
                .map(|(session, target)| pixels(session.renderer.gpu(), target));
            assert!(a.iter().any(|c| *c > 60), "{method}: the picture is dark");
            assert_eq!(a, b, "{method}");
        }
    }
}

#[test]
fn a_map_that_lacks_memory_is_built_again() {
    // Across the layers, a light ray has two nodes; along z, it has hundreds.
    let value = |(k, _, _): (usize, usize, usize)| 1000.0 * (k % 2) as f32;
    let volume = volume_of(Voxels::F32(Array3::from_shape_fn((96, 32, 32), value)), DAffine3::IDENTITY);
    let volume = Arc::new(volume);
    let haze = extinction(&[(0.0, 0.002), (1000.0, 0.03)]);
    let Some(mut session) = window(&volume, &haze) else { return };
    let target = DisplayTexture::new(session.renderer.gpu(), WIDTH, 80).unwrap();
    let scene = |toward: DVec3| {
        let scene = Scene { width: WIDTH, height: 80, ..Scene::framing(&volume) };
        Scene {
            lights: vec![LightSource { light: Light::Directional { toward }, ..scene.lights[0].clone() }],
            ..scene
        }
    };
    let [across, along] = [scene(DVec3::X), scene(DVec3::new(0.0, 0.0, -1.0))];
    let method = "dsm:epsilon=0.0002,map=64";
    assert!(draw(&mut session, method, &across, &target));
    assert!(!draw(&mut session, method, &along, &target), "the pool is too small for this light");
    let mut work = Work::default();
    let extent = (&along, MapCoverage::Picture);
    let made = session.prepare(shadow::parse(method).unwrap().as_ref(), extent, &mut work).unwrap();
    assert_eq!((work.built, made.shadows[0].report.pool_growths), (1, 0), "its size is known now");
    assert!(made.shadows[0].report.nodes_max.unwrap() > 14, "more than two rows");
}

#[test]
fn a_map_whose_picture_is_not_drawn_is_discarded() {
    let volume = phantom("sphere:24");
    let tf = extinction(&[(300.0, 0.0), (700.0, 0.2)]);
    let Some(mut session) = window(&volume, &tf) else { return };
    let (method, scene) = (shadow::parse("osm:map=32").unwrap(), scene_at(&volume, 0.0));
    let extent = (&scene, MapCoverage::Picture);
    let deferred = DeferredPasses::default();
    let building = Building { deferred: Some(&deferred), ..Building::default() };
    session.prepare_with(method.as_ref(), extent, &mut Work::default(), building).unwrap();
    assert!(!deferred.is_empty());
    let mut work = Work::default();
    session.prepare(method.as_ref(), extent, &mut work).unwrap();
    assert_eq!(work.built, 1);
}
