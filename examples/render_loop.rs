//! Loop of pictures of one scene from a moving camera, and milliseconds per picture through the library.
//! `scripts/python_loop.py` compares it with the same loop in Python.
//!
//! usage: render_loop VOLUME METHOD SIZE COUNT

use std::time::Instant;
use umbravox::files::loading::Loading;
use umbravox::open::{Loaded, SceneSettings};
use umbravox::render::{DisabledOptimizations, Session};
use umbravox::scene::{Camera, Scene};
use umbravox::{Error, shadow};

fn main() -> umbravox::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [volume, method, size, count] = &args[..] else {
        return Err(Error::input("bad command line", "render_loop", "expected VOLUME METHOD SIZE COUNT"));
    };
    let number = |text: &str| text.parse::<u32>().map_err(|e| Error::input("bad command line", text, e));
    let (size, count) = (number(size)?, number(count)?);
    let settings = SceneSettings { volume: Some(volume.clone()), ..SceneSettings::default() };
    let Loaded { volume, tf, scene, .. } = settings.load(&Loading::default())?;
    let scene = Scene { width: size, height: size, ..scene };
    let session = Session::open(None, volume, &tf, DisabledOptimizations::NONE)?;
    let map = session.shadow(shadow::parse(method)?.as_ref(), scene.light())?;
    session.render(&map, &scene)?;
    let start = Instant::now();
    let mut sum = 0.0;
    for k in 0..count {
        let turn = f64::from(k) / f64::from(count) * std::f64::consts::TAU;
        let away = scene.camera.eye - scene.camera.target;
        let eye = scene.camera.target + glam::DQuat::from_rotation_z(turn) * away;
        let camera = Camera { eye, ..scene.camera };
        sum += session.render(&map, &Scene { camera, ..scene.clone() })?.pixels.mean().unwrap_or(0.0);
    }
    println!("{:.4} ms a picture, mean {:.6}", start.elapsed().as_secs_f64() * 1e3 / f64::from(count), sum);
    Ok(())
}
