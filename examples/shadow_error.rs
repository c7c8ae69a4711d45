//! Error of a shadow method on a volume: renders a picture, and compares the light at visible points with the exact
//! answer.
//!
//! ```text
//! cargo run --release --example shadow_error -- [VOLUME [METHOD [PICTURE]]]
//! cargo run --release --example shadow_error -- ct.nii.gz dsm:epsilon=0.01,map=256 ct.png
//! ```

use std::path::PathBuf;
use std::sync::Arc;
use umbravox::exact::ExactField;
use umbravox::files::picture::write_picture;
use umbravox::open::{self, VolumeSpec, presets};
use umbravox::render::{DisabledOptimizations, Session};
use umbravox::scene::Scene;
use umbravox::shadow;

fn main() -> umbravox::Result<()> {
    let mut args = std::env::args().skip(1);
    let source = args.next().unwrap_or_else(|| "phantom:thorax:96".into());
    let method = shadow::parse(&args.next().unwrap_or_else(|| "dsm:epsilon=0.02,map=256".into()))?;
    let path = PathBuf::from(args.next().unwrap_or_else(|| "shadow_error.png".into()));

    // A preset for the values, a camera that frames the volume, and the default light.
    let volume = Arc::new(open::load(&VolumeSpec::new(source))?);
    let tf = presets::resolve(presets::default_name(&volume), &volume)?.tf;
    let scene = Scene::framing(&volume);

    // The volume is uploaded once; each light and method has its own shadow structure.
    let session = Session::open(None, Arc::clone(&volume), &tf, DisabledOptimizations::NONE)?;
    let shadow = session.shadow(method.as_ref(), scene.light())?;
    write_picture(&path, &session.render(&shadow, &scene)?.pixels)?;
    println!("{} {}: {} bytes, {}", method.name(), method.params(), shadow.report.bytes, path.display());

    // Visible points (world mm) with weights, and the exact transmittance from the light to them.
    let field = ExactField::new(&volume, &tf);
    let visible = field.visible_points(&scene, 1000, 1);
    let points: Vec<_> = visible.iter().map(|p| p.position).collect();
    let (mut squares, mut weights, mut worst) = (0.0, 0.0, 0.0_f64);
    for (point, transmittance) in visible.iter().zip(session.query(&shadow, &points)?) {
        let error = f64::from(transmittance) - field.transmittance_to_light(point.position, &scene.light());
        squares += point.weight * error * error;
        weights += point.weight;
        worst = worst.max(error.abs());
    }
    let rms = (squares / weights).sqrt();
    println!("error of transmittance at {} points: rms {rms:.4}, largest {worst:.4}", points.len());
    Ok(())
}
