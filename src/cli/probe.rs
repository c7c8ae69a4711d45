//! `umbravox probe`: exact answers along segments, and a method's at points.

use super::probe_rays::{parse_points, probe_rays};
use super::scene_args::SceneArgs;
use super::{Loaded, load, print_result};
use crate::error::Result;
use crate::exact::ExactField;
use crate::input::read_text;
use crate::render::Session;
use clap::Args;
use glam::DVec3;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Print the exact optical depth of segments, or a shadow method's transmittance at points
#[derive(Debug, Args)]
pub struct ProbeArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub what: What,
}

/// Which question to answer.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub struct What {
    /// Segments, `x0 y0 z0 x1 y1 z1` a line, world mm; prints `optical_depth transmittance`, exact, 17 digits
    #[arg(long, value_name = "FILE")]
    pub rays: Option<PathBuf>,
    /// Points, `x y z` a line, world mm; prints `T_method T_exact` from the light to each, for the --shadow method
    #[arg(long, value_name = "FILE")]
    pub points: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or a failure of the device.
pub fn run(args: ProbeArgs) -> Result<()> {
    let request = args.scene.into_request()?;
    // Read before the volume: it is the quicker one to find wanting.
    if let Some(path) = &args.what.rays {
        let text = read_text(path, "cannot read rays")?;
        let loaded = load(&request)?;
        let field = ExactField::new(&loaded.volume, &loaded.tf);
        print_result(&probe_rays(&field, &text, &path.display().to_string())?)?;
    }
    if let Some(path) = &args.what.points {
        let method = request.method()?;
        let points = parse_points(&read_text(path, "cannot read points")?, &path.display().to_string())?;
        let Loaded { volume, tf, scene } = load(&request)?;
        let exact = {
            let field = ExactField::new(&volume, &tf);
            let to_light = |p: &DVec3| field.transmittance_to_light(*p, &scene.light);
            points.par_iter().map(to_light).collect::<Vec<_>>()
        };
        let session = Session::open(request.adapter.as_deref(), Arc::new(volume), &tf, request.forced)?;
        let shadow = session.shadow(method.as_ref(), scene.light)?;
        let found = session.query(&shadow, &points)?;
        let lines = found.iter().zip(&exact).map(|(m, e)| format!("{m:.9} {e:.17}\n"));
        print_result(&lines.collect::<String>())?;
    }
    Ok(())
}
