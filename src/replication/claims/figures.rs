//! What is measured of a method on a scene, once for all claims that ask for it.

use super::scenes::{Subject, Variant};
use crate::error::{Error, Result};
use crate::exact::{ExactField, SeenPoint};
use crate::measure::compare::compare;
use crate::measure::job::{Effort, Job, name_of};
use crate::measure::journal::Journal;
use crate::measure::progress::Progress;
use crate::measure::similarity::ssim;
use crate::measure::stats::ErrorStats;
use crate::measure::table::Row;
use crate::render::{Forced, Renderer, Session};
use crate::scene::Light;
use crate::shadow::{Method, NodeMap, ShadowMap, SplitChoice};
use ndarray::Array3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// The points are those of the table's `point_err_*`.
const SEED: u64 = 1;

/// What a method gives at a point that the camera sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtPoint {
    /// Exact transmittance from the light.
    pub exact: f64,
    /// The method's.
    pub method: f64,
    /// As the camera sees it.
    pub weight: f64,
}

/// Everything that claims ask of one method on one scene.
#[derive(Debug, Clone, Default)]
pub struct Figures {
    /// Method and settings.
    pub name: String,
    /// Its row of a comparison: errors, times, bytes. Empty where only its structure was asked for.
    pub row: Row,
    /// `height x width x 4`, linear RGBA.
    pub picture: Option<Array3<f32>>,
    /// At the points that the camera sees.
    pub points: Vec<AtPoint>,
    /// How it chose to split layers, where it chose.
    pub split: Option<SplitChoice>,
    /// Nodes by texel, where it has nodes.
    pub nodes: Option<NodeMap>,
}

impl Figures {
    /// A figure, or that it was not measured and why.
    fn need(&self, what: &str, value: Option<f64>) -> Result<f64> {
        let why = || if self.row.note.is_empty() { "it has none" } else { &self.row.note };
        let found = value.filter(|v| !v.is_nan());
        found.ok_or_else(|| Error::runtime(format!("no {what}"), &self.name, why()))
    }

    /// `point_err_rms`.
    pub fn point_rms(&self) -> Result<f64> {
        self.need("point error", self.row.point_err_rms)
    }

    /// `ray_err_max`.
    pub fn ray_max(&self) -> Result<f64> {
        self.need("error on light rays", self.row.ray_err_max)
    }

    /// `image_rmse`.
    pub fn image_rmse(&self) -> Result<f64> {
        self.need("picture error", self.row.image_rmse)
    }

    /// `build_ms`.
    pub fn build_ms(&self) -> Result<f64> {
        self.need("build time", self.row.build_ms)
    }

    /// `frame_ms`.
    pub fn frame_ms(&self) -> Result<f64> {
        self.need("frame time", self.row.frame_ms)
    }

    /// `build_ms` and `frame_ms` together: what a picture costs while the light moves.
    pub fn moving_ms(&self) -> Result<f64> {
        self.need("time", self.row.moving_ms())
    }

    /// `bytes`.
    pub fn bytes(&self) -> Result<f64> {
        self.need("bytes", self.row.bytes.map(|b| b as f64))
    }

    /// `nodes_total`.
    pub fn nodes_total(&self) -> Result<f64> {
        self.need("nodes", self.row.nodes_total.map(|n| n as f64))
    }

    /// The chosen split of layers.
    pub fn chosen(&self) -> Result<SplitChoice> {
        let none = || Error::runtime("no ratio was chosen", &self.name, "the method chooses none");
        self.split.ok_or_else(none)
    }

    /// Errors at those points whose exact transmittance `keep` names.
    pub fn errors_where(&self, keep: impl Fn(f64) -> bool) -> Result<ErrorStats> {
        let kept = self.points.iter().filter(|p| keep(p.exact));
        let stats = ErrorStats::of(kept.map(|p| (p.method - p.exact, p.weight)))?;
        stats.ok_or_else(|| Error::runtime("no point error", &self.name, "the camera sees no such point"))
    }

    /// The least transmittance that the method gives at any point.
    pub fn darkest(&self) -> Result<f64> {
        self.need("points", self.points.iter().map(|p| p.method).reduce(f64::min))
    }

    /// How alike its picture and another's are, as `image_ssim`.
    pub fn similarity(&self, other: &Self) -> Result<f64> {
        let pictures = self.picture.as_ref().zip(other.picture.as_ref());
        let alike = pictures.map(|(a, b)| ssim(a.view(), b.view())).transpose()?.flatten();
        self.need("similarity of pictures", alike)
    }
}

/// How much is asked of a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Depth {
    /// Its times alone, in turn with those of the claim's other needs.
    Times,
    /// Its structure: bytes, nodes, how layers are split.
    Structure,
    /// Errors, times and pictures as well.
    Whole,
}

/// What is asked for of a scene.
pub struct Wanted {
    /// How it is changed.
    pub variant: Variant,
    /// Methods of which everything is measured.
    pub whole: Vec<Box<dyn Method>>,
    /// Methods of which only the structure is made.
    pub structure: Vec<Box<dyn Method>>,
}

impl Wanted {
    /// Nothing of a variant yet.
    pub fn nothing(variant: Variant) -> Self {
        Self { variant, whole: Vec::new(), structure: Vec::new() }
    }
}

/// How figures of a method are found again.
pub fn key(method: &dyn Method) -> String {
    method.spec().to_string()
}

/// Measures methods on a variant of a scene; a method that fails has a row that says why.
///
/// # Errors
/// A volume that the device cannot hold, or it was ended on request.
pub fn measure(
    renderer: &Arc<Renderer>,
    (name, subject): (&str, &Subject),
    wanted: &Wanted,
    effort: Effort,
    progress: &mut Progress,
) -> Result<HashMap<String, Figures>> {
    let Subject { volume, tf, scene } = wanted.variant.of(subject);
    let session = Session::on(renderer, Arc::clone(&volume), &tf, Forced::default())?;
    let field = ExactField::new(&volume, &tf);
    let mut all = HashMap::new();
    if !wanted.whole.is_empty() {
        let job = Job {
            session: &session,
            volume: &volume,
            tf: &tf,
            strands: None,
            scene: &scene,
            scene_name: name.into(),
            file_prefix: String::new(),
            remark: String::new(),
            effort,
        };
        let compared = compare(&job, &wanted.whole, &mut Journal::nowhere(), progress)?.compared;
        let seen = field.seen_points(&scene, effort.points, SEED);
        let exact: Vec<f64> =
            seen.par_iter().map(|p| field.transmittance_to_light(p.position, &scene.light())).collect();
        for (method, compared) in wanted.whole.iter().zip(compared) {
            progress.check("claims")?;
            let mut figures = Figures { row: compared.row, picture: compared.picture, ..Figures::default() };
            if !figures.row.has_failed() {
                let shadow = figures.build(&session, method.as_ref(), scene.light())?;
                figures.points = at_points(&session, &shadow, &seen, &exact)?;
                figures.nodes = session.node_map(&shadow)?;
            }
            figures.name = name_of(method.as_ref());
            all.insert(key(method.as_ref()), figures);
        }
    }
    for method in &wanted.structure {
        progress.check("claims")?;
        let mut figures = Figures { name: name_of(method.as_ref()), ..Figures::default() };
        if let Err(e) = figures.build(&session, method.as_ref(), scene.light()) {
            figures.row.set_failed(&e);
        }
        all.insert(key(method.as_ref()), figures);
    }
    Ok(all)
}

impl Figures {
    /// Builds a method's structure and takes over what it says of itself.
    fn build(&mut self, session: &Session, method: &dyn Method, light: Light) -> Result<ShadowMap> {
        let shadow = session.shadow(method, light)?;
        self.split = shadow.report.split_choice;
        self.row.bytes.get_or_insert(shadow.report.bytes);
        self.row.nodes_total = self.row.nodes_total.or(shadow.report.nodes_total);
        Ok(shadow)
    }
}

fn at_points(
    session: &Session,
    shadow: &ShadowMap,
    seen: &[SeenPoint],
    exact: &[f64],
) -> Result<Vec<AtPoint>> {
    let positions: Vec<_> = seen.iter().map(|p| p.position).collect();
    let values = session.query(shadow, &positions)?;
    let point = |((seen, exact), value): ((&SeenPoint, &f64), &f32)| AtPoint {
        exact: *exact,
        method: f64::from(*value),
        weight: seen.weight,
    };
    Ok(seen.iter().zip(exact).zip(&values).map(point).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_of_the_points_that_are_named() {
        let point = |exact, method, weight| AtPoint { exact, method, weight };
        let points = vec![point(1.0, 0.9, 1.0), point(0.99, 0.89, 3.0), point(0.1, 0.5, 2.0)];
        let figures = Figures { points, ..Figures::default() };
        let lit = figures.errors_where(|t| t >= 0.95).unwrap();
        assert!((lit.rms - 0.1).abs() < 1e-12 && (lit.mean + 0.1).abs() < 1e-12, "{lit:?}");
        assert!((figures.errors_where(|t| t < 0.5).unwrap().mean - 0.4).abs() < 1e-12);
        assert!(figures.errors_where(|t| t > 1.0).is_err());
        assert_eq!(figures.darkest().unwrap(), 0.5);
    }

    #[test]
    fn what_was_not_measured_says_why() {
        let mut figures = Figures { name: "osm layers=8".into(), ..Figures::default() };
        let e = figures.point_rms().unwrap_err();
        assert!(e.place == "osm layers=8" && e.what == "no point error", "{e}");
        figures.row.set_failed(&"device lost");
        assert_eq!(figures.moving_ms().unwrap_err().why, "device lost");
        figures.row.image_rmse = Some(f64::NAN);
        assert!(figures.image_rmse().is_err() && figures.similarity(&figures).is_err());
        assert!(figures.chosen().is_err() && figures.darkest().is_err());
    }

    #[test]
    fn a_picture_is_like_itself() {
        let mut picture = Array3::from_elem((16, 16, 4), 0.5);
        let same = Figures { picture: Some(picture.clone()), ..Figures::default() };
        assert_eq!(same.similarity(&same).unwrap(), 1.0);
        picture.slice_mut(ndarray::s![..8, .., ..]).fill(0.0);
        let other = Figures { picture: Some(picture), ..Figures::default() };
        assert!(same.similarity(&other).unwrap() < 0.9);
    }
}
