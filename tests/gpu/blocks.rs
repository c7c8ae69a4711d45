//! Volumes whose pages exceed the device memory: block by block, pictures, shadows and nodes are those of the whole volume,
//! to the last bit.

use crate::pages::{Kind, assert_same, devices, limited, shell, special, waves};
use crate::volume_of;
use glam::{DAffine3, DVec3};
use ndarray::Array3;
use std::sync::Arc;
use umbravox::render::{DisabledOptimizations, Session};
use umbravox::scene::{Camera, Light, LightSource, Scene, Shading};
use umbravox::shadow;
use umbravox::transfer::TransferFunction;
use umbravox::volume::Volume;

/// Returns sessions with the whole volume on the device, and with at most `pages` pages of it; `None` without a device.
fn sessions(volume: &Arc<Volume>, tf: &TransferFunction, pages: u64) -> Option<[Session; 2]> {
    let [whole, _] = devices()?;
    let limited = Arc::new(limited(whole, pages));
    let on = |renderer| Session::on(renderer, Arc::clone(volume), tf, DisabledOptimizations::NONE).unwrap();
    let both = [on(whole), on(&limited)];
    assert!(both[1].transfer.stream().is_some(), "{:?}", both[1].transfer.pages);
    Some(both)
}

/// Returns the number of blocks that have become resident.
fn blocks_loaded(session: &Session) -> u64 {
    session.transfer.stream().unwrap().usage().blocks
}

#[test]
fn blocks_are_the_volume_to_the_last_bit() {
    for (dims, kind, pages, shading) in [
        ([170, 140, 100], Kind::Unsigned, 18, Shading::None),
        ([170, 40, 230], Kind::Float, 34, Shading::Lambert),
    ] {
        let volume = waves(dims, kind);
        let Some(both) = sessions(&volume, &shell(), pages) else { return };
        let scene = Scene { width: 96, height: 80, shading, ..Scene::framing(&volume) };
        let methods = ["none", "dsm:map=64", "dsm:map=64,segments=transmittance,near=8"];
        assert_same(&volume, &both, &scene, &methods);
        println!("{dims:?} {kind:?}: {:?}, {} loaded", both[1].transfer.pages, blocks_loaded(&both[1]));
        assert!(blocks_loaded(&both[1]) > 20);
    }
}

#[test]
fn methods_march_block_by_block() {
    let volume = waves([130, 70, 110], Kind::Unsigned);
    let Some(both) = sessions(&volume, &shell(), 16) else { return };
    let scene = Scene { width: 40, height: 32, ..Scene::framing(&volume) };
    let methods = [
        "osm:map=48",
        "osm:map=48,slicing=gamma,bits=32",
        "dom:map=48,layers=4",
        "bom:map=48",
        "fourier:map=48",
        "fourier:map=48,range=texel",
        "moments:map=48",
        "moments:map=48,measure=light",
        "wavelet:map=48,range=map",
        "wavelet:map=48,range=texel",
        "beer:map=48",
    ];
    assert_same(&volume, &both, &scene, &methods);
}

/// Two layers with a gap of more than a page: a light interval in front of the gap is lit before its pages make room.
#[test]
fn light_intervals_end_before_gaps() {
    let value = |(k, j, i): (usize, usize, usize)| {
        let layer = (20..23).contains(&k) || (170..174).contains(&k);
        let noise = ((i * 7 + j * 13 + k * 29) % 17) as f32;
        if layer { 300.0 + 10.0 * noise } else { noise }
    };
    let volume = Array3::from_shape_fn((200, 130, 130), value);
    let volume = Arc::new(volume_of(volume.into(), DAffine3::IDENTITY));
    let Some(both) = sessions(&volume, &shell(), 30) else { return };
    let framing = Scene::framing(&volume);
    let center = volume.center_mm();
    let camera = Camera { eye: center + DVec3::new(20.0, -60.0, -300.0), ..framing.camera };
    for step in [0.5, 2.0] {
        let scene = Scene { width: 64, height: 64, camera, step, ..framing.clone() };
        assert_same(&volume, &both, &scene, &["beer:map=64,near=4", "osm:map=64,near=8", "dsm:map=64"]);
    }
    assert!(blocks_loaded(&both[1]) > 20);
}

/// Cameras and lights inside and outside the volume, and several lights at once.
#[test]
fn blocks_follow_cameras_and_lights() {
    let volume = waves([130, 100, 110], Kind::Unsigned);
    let Some(both) = sessions(&volume, &shell(), 32) else { return };
    let mut random = fastrand::Rng::with_seed(21);
    let center = volume.center_mm();
    for round in 0..6 {
        let mut vector = |scale: f64| DVec3::from_array([0; 3].map(|_| scale * (random.f64() - 0.5)));
        let framing = Scene::framing(&volume);
        let camera = Camera { eye: center + vector(300.0), target: center + vector(40.0), ..framing.camera };
        let light = match round % 2 {
            0 => Light::Directional { toward: vector(1.0).normalize() },
            _ => Light::Point { position: center + vector(250.0) },
        };
        let fill = LightSource::from(Light::Directional { toward: vector(1.0).normalize() });
        let lights = if round == 4 { vec![light.into(), fill] } else { vec![light.into()] };
        let scene = Scene { width: 48, height: 40, camera, lights, ambient: 0.2, ..framing };
        let method = shadow::parse("dsm:map=48").unwrap();
        let [a, b] = both.each_ref().map(|session| {
            let maps = session.shadows_of(method.as_ref(), &scene).unwrap();
            let nodes: Vec<_> = maps.iter().map(|map| map.report.nodes_total).collect();
            (session.render(&maps, &scene).unwrap().pixels, nodes)
        });
        assert!(a == b, "round {round}");
    }
}

#[test]
fn blocks_have_labels_clip_planes_and_gradient_opacity() {
    // Pages of these volumes take 2 bytes a voxel, and 3 with labels.
    for ((volume, tf), pages) in special([130, 100, 110]).into_iter().zip([28, 18]) {
        let Some(both) = sessions(&volume, &tf, pages) else { return };
        let scene = Scene { width: 64, height: 48, ..Scene::framing(&volume) };
        assert_same(&volume, &both, &scene, &["none", "dsm:map=64"]);
    }
}

#[test]
fn what_needs_the_whole_volume_is_refused() {
    let volume = waves([130, 70, 70], Kind::Unsigned);
    let Some([_, session]) = sessions(&volume, &shell(), 16) else { return };
    let scene = Scene { width: 16, height: 16, ..Scene::framing(&volume) };
    for name in ["rays", "lightvolume", "sat", "dsm:march=samples", "dsm:compress=optimal", "dsm:enclose=on"]
    {
        let refused = session.shadow(shadow::parse(name).unwrap().as_ref(), scene.light()).err();
        let refused = refused.unwrap_or_else(|| panic!("{name} was built"));
        assert!(refused.exit_status() == 2 && refused.why.contains("all at once"), "{name}: {refused}");
    }
    let far = session.shadow(shadow::parse("dsm:map=32,near=31").unwrap().as_ref(), scene.light()).unwrap();
    let refused = session.render(&far, &scene).err().unwrap();
    assert!(refused.exit_status() == 2 && refused.why.contains("reach over"), "{refused}");
    let refused = session.renderer.portable(&session.loaded, &session.transfer, &far, &scene).err().unwrap();
    assert!(refused.exit_status() == 2 && refused.why.contains("a page holds all"), "{refused}");
}
