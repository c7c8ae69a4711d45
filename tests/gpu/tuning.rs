//! Shader variants of graphics cards: same shadow maps and pictures as those of software adapters, on every adapter.

use super::*;
use umbravox::gpu::{Filler, Tuning};
use umbravox::open::presets;
use umbravox::scene::{Camera, LightSource, Shading};

/// Renderers with the shaders of software adapters and of graphics cards, for one texture filter.
fn both() -> Option<[Arc<Renderer>; 2]> {
    Some([tuned(Tuning::SOFTWARE)?, tuned(Tuning { coarse_filter: false, ..Tuning::CARD })?])
}

/// Renderer with the shaders of a tuning.
fn tuned(tuning: Tuning) -> Option<Arc<Renderer>> {
    let mut gpu = common::gpu()?;
    gpu.tuning = tuning;
    Some(Arc::new(Renderer::new(gpu)))
}

/// Renderer with the arithmetic and the shaders of graphics cards, which a software adapter imitates.
fn with_card_arithmetic() -> Option<Arc<Renderer>> {
    let card_arithmetic = renderer()?.gpu().is_software();
    tuned(Tuning { card_arithmetic, ..Tuning::CARD })
}

/// Methods, each with the largest difference of pictures. An atlas that is filtered stores its tiles in another order,
/// and the filter's weights round with the place in the texture.
const METHODS: [(&str, f32); 12] = [
    ("none", 0.0),
    ("rays", 0.0),
    ("dsm:map=96,epsilon=0.01", 0.0),
    ("dsm:map=64,compress=optimal", 0.0),
    ("dsm:map=48,prefilter=5", 0.0),
    ("dsm:map=64,march=samples", 0.0),
    ("dsm:map=64,precompress=off", 0.0),
    ("osm:map=64,slicing=lit", 0.0),
    ("bom:map=64,layers=7", 0.0),
    ("lightvolume:scale=4", 0.0),
    ("avsm:map=64", 1e-4),
    ("fourier:map=64", 1e-4),
];

/// Cameras and lights: from outside, among the bricks, from far away, and past the volume's edge.
fn scenes(volume: &Volume) -> Vec<Scene> {
    let framed = Scene { width: 90, height: 70, ambient: 0.15, ..Scene::framing(volume) };
    let Camera { eye, target, .. } = framed.camera;
    let camera = |eye: DVec3, target: DVec3, fov_deg: f64| Camera { eye, target, fov_deg, ..framed.camera };
    let away = eye - target;
    let position = target + 150.0 * away.any_orthonormal_vector();
    let lights = vec![
        framed.lights[0].clone(),
        LightSource { light: Light::Point { position }, ..framed.lights[0].clone() },
    ];
    vec![
        Scene { camera: camera(target + 0.05 * away, target - away, 110.0), ..framed.clone() },
        Scene { camera: camera(target + 40.0 * away, target, 2.0), ..framed.clone() },
        Scene { camera: camera(eye, target + 40.0 * away.any_orthonormal_vector(), 12.0), ..framed.clone() },
        Scene { lights, shading: Shading::BlinnPhong, ..framed },
    ]
}

#[test]
fn cards_and_software_adapters_draw_the_same_pictures() {
    let Some(renderers) = both() else { return };
    let volume = phantom("thorax:48");
    let tf = opacity(&[(-600.0, 0.0), (-200.0, 0.05), (200.0, 0.3), (600.0, 0.6)]);
    let open =
        |r: &Arc<Renderer>| Session::on(r, Arc::clone(&volume), &tf, DisabledOptimizations::NONE).unwrap();
    let sessions = renderers.each_ref().map(open);
    for (method, most) in METHODS {
        let method = shadow::parse(method).unwrap();
        for scene in scenes(&volume) {
            let [software, card] = sessions.each_ref().map(|session| {
                let maps = session.shadows_of(method.as_ref(), &scene).unwrap();
                let reports: Vec<_> =
                    maps.iter().map(|map| (map.report.nodes_total, map.report.nodes_max)).collect();
                (session.render(&maps, &scene).unwrap(), reports)
            });
            let off = (&software.0.pixels - &card.0.pixels).iter().fold(0.0_f32, |most, d| most.max(d.abs()));
            assert!(off <= most, "{method:?}: {off}, {:?}", scene.camera);
            assert_eq!(software.1, card.1, "{method:?}");
            assert_eq!(software.0.plan, card.0.plan, "{method:?}: skipped work, {:?}", scene.camera);
        }
    }
}

#[test]
fn a_device_is_kept_busy_while_the_host_works() {
    let Some(renderer) = renderer() else { return };
    let filler = Filler::new(renderer.gpu());
    for host_ms in [0, 60] {
        let start = std::time::Instant::now();
        let host = || std::thread::sleep(std::time::Duration::from_millis(host_ms));
        filler.keep_busy(renderer.gpu(), host).unwrap();
        assert!(start.elapsed().as_millis() >= u128::from(host_ms.max(20)));
    }
}

#[test]
fn pictures_in_bands_find_their_tiles_once() {
    let Some([_, card]) = both() else { return };
    let volume = phantom("sphere:40");
    let tf = extinction(&[(300.0, 0.0), (700.0, 0.2)]);
    let session = Session::on(&card, Arc::clone(&volume), &tf, DisabledOptimizations::NONE).unwrap();
    let scene = Scene { width: 200, height: 150, ..Scene::framing(&volume) };
    let maps = session.shadows_of(shadow::parse("dsm:map=64").unwrap().as_ref(), &scene).unwrap();
    let whole = session.render(&maps, &scene).unwrap();
    let mut bands = 0;
    let banded = card.render_in_bands(&session.loaded, &session.transfer, &maps, &scene, 0.01, |_| {
        bands += 1;
        true
    });
    let banded = banded.unwrap().unwrap();
    assert!(bands > 4, "{bands}");
    assert_eq!(whole.pixels, banded.pixels);
    assert_eq!(whole.plan, banded.plan);
}

/// Work is counted for each submission: maps of several lights and resumed rays have blocks of the same numbers.
#[test]
fn divergence_is_a_share_with_several_lights_and_with_resumed_rays() {
    let Some(renderer) = renderer() else { return };
    let volume = phantom("sphere:24");
    let tf = extinction(&[(300.0, 0.0), (700.0, 0.2)]);
    let session = Session::on(renderer, Arc::clone(&volume), &tf, DisabledOptimizations::NONE).unwrap();
    let framed = Scene { width: 64, height: 48, ..Scene::framing(&volume) };
    let lit_from =
        |toward: DVec3| LightSource { light: Light::Directional { toward }, ..framed.lights[0].clone() };
    let lights = [DVec3::X, DVec3::new(0.3, 1.0, 0.2), DVec3::NEG_Z].map(lit_from).to_vec();
    let scene = Scene { lights, ..framed };
    for method in ["dsm:map=32", "rays"] {
        let method = shadow::parse(method).unwrap();
        let kernels = renderer.kernels();
        let (maps, build) = kernels.counting_work(|| session.shadows_of(method.as_ref(), &scene)).unwrap();
        let (_, frame) = kernels.counting_work(|| session.render(&maps, &scene)).unwrap();
        let counted = [build, frame].map(|work| (work.divergence(), work.longest_ray));
        assert_eq!(counted[0].0.is_some(), method.name() == "dsm");
        for (divergence, longest) in counted.into_iter().filter(|(d, _)| d.is_some()) {
            assert!(
                (0.0..1.0).contains(&divergence.unwrap()) && longest > 5,
                "{method:?}: {divergence:?}, {longest}"
            );
        }
    }
}

/// Opaque surfaces are lit where eye rays meet them, although the texture filter of a card has weights of 8 bits. On an
/// H100 they lay in their own shadow (33 dB) before the search interpolated in float32.
#[test]
fn opaque_surfaces_are_met_with_the_filter_of_a_card() {
    let Some(renderer) = with_card_arithmetic() else { return };
    for volume in ["thorax:64", "sphere", "shell:40", "comb:32"]
        .map(|name| Some(phantom(name)))
        .into_iter()
        .chain([scan("engine")])
    {
        let Some(volume) = volume else { continue };
        let tf = presets::resolve("isosurface", &volume).unwrap().tf;
        let session = Session::on(&renderer, Arc::clone(&volume), &tf, DisabledOptimizations::NONE).unwrap();
        let scene = Scene { width: 100, height: 75, ..Scene::framing(&volume) };
        let map = session.shadow(shadow::parse("rays").unwrap().as_ref(), scene.light()).unwrap();
        let picture = session.render(&map, &scene).unwrap().pixels;
        let rms = rms_difference(&picture, &ExactField::new(&volume, &tf).picture(&scene));
        println!("{:?} voxels: {:.1} dB", volume.dims(), -20.0 * rms.log10());
        assert!(-20.0 * rms.log10() >= 45.0, "{rms}");
    }
}

/// Every march ends where quotients are not rounded correctly. On an H100 some eye rays met the same surface until they
/// reached their iteration limit.
#[test]
fn marches_end_with_the_arithmetic_of_a_card() {
    let Some(renderer) = with_card_arithmetic() else { return };
    for (name, range) in [("CT_AVM", [0.0, 900.0]), ("CT_pitch", [-500.0, 1100.0]), ("engine", [60.0, 250.0])]
    {
        let Some(volume) = scan(name) else { continue };
        for tf in transfer_functions(range) {
            let session =
                Session::on(&renderer, Arc::clone(&volume), &tf, DisabledOptimizations::NONE).unwrap();
            let map = session
                .shadow(shadow::parse("dsm:map=128").unwrap().as_ref(), Scene::framing(&volume).light());
            let map = map.unwrap();
            for camera in invariance::cameras(&volume) {
                let scene = Scene { camera, width: 45, height: 29, ..Scene::framing(&volume) };
                session.render(&map, &scene).unwrap();
            }
        }
    }
}
