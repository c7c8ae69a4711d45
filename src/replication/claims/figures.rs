//! Measurements of shadow methods on a scene, made once for all claims of papers that are tested there.

use super::scenes::{Subject, Variant};
use crate::error::Result;
use crate::exact::ExactField;
use crate::measure::compare::compare;
use crate::measure::errors::VisiblePoints;
use crate::measure::job::{Effort, Job, name_of};
use crate::measure::journal::Journal;
use crate::measure::progress::Progress;
use crate::measure::similarity::ssim;
use crate::measure::stats::ErrorStats;
use crate::measure::table::{Cell, Row};
use crate::render::{DisabledOptimizations, Renderer, Session};
use crate::scene::Light;
use crate::shadow::{Method, NodeMap, ShadowMap, SplitChoice};
use ndarray::Array3;
use serde::Deserialize;
use std::collections::HashMap;
use std::sync::Arc;

/// Exact transmittance and a shadow method's transmittance from the light to one visible point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtPoint {
    /// Exact transmittance from the light to the visible point.
    pub exact: f64,
    /// Transmittance from the light to the visible point, by the shadow method.
    pub method: f64,
    /// Weight of the visible point in error statistics: the opacity of the pixel in which it is visible.
    pub weight: f64,
}

/// Measurements of one shadow method on one scene, from which claims of papers are tested.
#[derive(Debug, Clone, Default)]
pub struct Figures {
    /// Name of the shadow method with its settings.
    pub name: String,
    /// Comparison table row with the method's errors, times and memory. Mostly empty, apart from memory and node
    /// count, if only the shadow map was built.
    pub row: Row,
    /// Picture rendered with the shadow method, if any: `height x width x 4`, linear RGBA.
    pub picture: Option<Array3<f32>>,
    /// Exact transmittance and the shadow method's transmittance at each point visible to the camera.
    pub points: Vec<AtPoint>,
    /// Spacing of layers that the shadow method chose automatically for its map; `None` for a method that chooses
    /// none.
    pub split: Option<SplitChoice>,
    /// Number of transmittance curve nodes in each shadow map texel; `None` for a shadow method without nodes.
    pub nodes: Option<NodeMap>,
}

/// Smallest exact transmittance at which a visible point counts as lit almost without attenuation.
const LIT: f64 = 0.95;

impl Figures {
    /// Whether the formulas of papers' claims may use a name: a column of `compare.csv` or another measured quantity.
    #[cfg(test)]
    pub fn has(name: &str) -> bool {
        Self::default().quantity(name, None).is_some()
            || crate::measure::table::COLUMNS.iter().any(|c| c.name == name)
    }

    /// Returns a measurement of the shadow method by name, for the formulas of papers' claims. The name is a column
    /// of `compare.csv` (Booleans are 0 or 1) or a quantity of this table:
    ///
    /// | name | value |
    /// |---|---|
    /// | `moving_ms` | `build_ms + frame_ms` |
    /// | `split_ratio`, `split_correlation` | chosen split of layers, and correlation of its neighbouring layers |
    /// | `darkest` | smallest transmittance at any visible point |
    /// | `rms_lit`, `rms_bright`, `rms_dark` | rms error at points of exact transmittance >= 0.95, > 0.5, <= 0.5 |
    /// | `small_tiles` | fraction of tiles whose fullest texel has at most 1/4 of the nodes of the fullest tile |
    /// | `ssim_to_next` | structural similarity with the picture of the claim's next method |
    ///
    /// # Errors
    /// The value was not measured; the error states why.
    pub fn number(&self, name: &str, next: Option<&Self>) -> Result<f64, String> {
        let value = self.quantity(name, next).unwrap_or_else(|| match self.row.cell(name) {
            Cell::Integer(n) => Some(n as f64),
            Cell::Real(x) => Some(x),
            Cell::Flag(yes) => Some(f64::from(u8::from(yes))),
            Cell::Empty | Cell::Text(_) => None,
        });
        let why = || if self.row.note.is_empty() { "it has none" } else { &self.row.note };
        value.filter(|v| !v.is_nan()).ok_or_else(|| format!("no {name} ({}): {}", self.name, why()))
    }

    /// Returns a measured quantity that only formulas of papers' claims use, beside the columns of `compare.csv`. The
    /// inner value is `None` if it was not measured, the outer one for an unknown name.
    fn quantity(&self, name: &str, next: Option<&Self>) -> Option<Option<f64>> {
        Some(match name {
            "moving_ms" => self.row.moving_ms(),
            "split_ratio" => self.split.map(|s| s.ratio),
            "split_correlation" => self.split.map(|s| s.correlation),
            "darkest" => self.points.iter().map(|p| p.method).reduce(f64::min),
            "rms_lit" => self.rms_where(|exact| exact >= LIT),
            "rms_bright" => self.rms_where(|exact| exact > 0.5),
            "rms_dark" => self.rms_where(|exact| exact <= 0.5),
            "small_tiles" => self.nodes.as_ref().map(|nodes| share_of_small_tiles(nodes.most_by_tile())),
            "ssim_to_next" => {
                let pictures = self.picture.as_ref().zip(next.and_then(|n| n.picture.as_ref()));
                pictures.and_then(|(a, b)| ssim(a.view(), b.view()).ok().flatten())
            }
            _ => return None,
        })
    }

    /// Weighted rms error of the shadow method's transmittance at those visible points whose exact transmittance
    /// satisfies `keep`.
    fn rms_where(&self, keep: impl Fn(f64) -> bool) -> Option<f64> {
        let points = self.points.iter().filter(|p| keep(p.exact));
        ErrorStats::of(points.map(|p| (p.method - p.exact, p.weight))).ok()?.map(|stats| stats.rms)
    }
}

fn share_of_small_tiles(most_by_tile: impl IntoIterator<Item = u32>) -> f64 {
    let most: Vec<u32> = most_by_tile.into_iter().collect();
    let fullest = most.iter().copied().max().unwrap_or(0);
    most.iter().filter(|n| 4 * **n <= fullest).count() as f64 / most.len().max(1) as f64
}

/// Extent of the measurement of shadow methods for testing a paper's claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Depth {
    /// Only the times of the shadow methods are measured, in interleaved rounds.
    Times,
    /// Only the shadow map is built, for its memory, curve nodes and spacing of layers.
    Structure,
    /// Errors, times, memory and pictures of the shadow methods are measured.
    #[default]
    Whole,
}

/// Shadow methods to be measured on one variant of a scene, for all claims of papers that need it.
pub struct Wanted {
    /// Variant of the scene on which the shadow methods are measured.
    pub variant: Variant,
    /// Shadow methods whose errors, times, memory and pictures are measured.
    pub whole: Vec<Box<dyn Method>>,
    /// Shadow methods whose shadow map is only built, without measuring errors and times.
    pub structure: Vec<Box<dyn Method>>,
}

impl Wanted {
    /// Creates an empty list of shadow methods to be measured on a variant of a scene.
    pub fn nothing(variant: Variant) -> Self {
        Self { variant, whole: Vec::new(), structure: Vec::new() }
    }
}

/// Returns the text that identifies a shadow method with all its settings. Methods with equal settings have equal
/// texts.
pub fn key(method: &dyn Method) -> String {
    method.spec().to_string()
}

/// Measures shadow methods on a variant of a scene, for testing claims of papers. A method that fails gets a row with
/// its error message.
///
/// # Errors
/// The device cannot store the volume, or the user cancelled the measurement.
pub fn measure(
    renderer: &Arc<Renderer>,
    (name, subject): (&str, &Subject),
    wanted: &Wanted,
    effort: Effort,
    progress: &mut Progress,
) -> Result<HashMap<String, Figures>> {
    let Subject { volume, tf, scene } = wanted.variant.of(subject);
    let session = Session::on(renderer, Arc::clone(&volume), &tf, DisabledOptimizations::NONE)?;
    let mut all = HashMap::new();
    if !wanted.whole.is_empty() {
        let job = Job::new(&session, (&volume, &tf), &scene, name, effort);
        let compared = compare(&job, &wanted.whole, &mut Journal::nowhere(), progress)?.compared;
        let visible = VisiblePoints::new(&ExactField::new(&volume, &tf), &scene, effort.points);
        for (method, compared) in wanted.whole.iter().zip(compared) {
            progress.check("claims")?;
            let mut figures = Figures { row: compared.row, picture: compared.picture, ..Figures::default() };
            if !figures.row.has_failed() {
                let shadow = figures.build(&session, method.as_ref(), scene.light())?;
                figures.points = at_points(&session, &shadow, &visible)?;
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
    /// Builds a method's shadow map and stores its memory, number of curve nodes and spacing of layers.
    fn build(&mut self, session: &Session, method: &dyn Method, light: Light) -> Result<ShadowMap> {
        let shadow = session.shadow(method, light)?;
        self.split = shadow.report.split_choice;
        self.row.bytes.get_or_insert(shadow.report.bytes);
        self.row.nodes_total = self.row.nodes_total.or(shadow.report.nodes_total);
        Ok(shadow)
    }
}

fn at_points(session: &Session, shadow: &ShadowMap, visible: &VisiblePoints) -> Result<Vec<AtPoint>> {
    let values = session.query(shadow, visible.points_mm())?;
    let points = values.iter().zip(visible.exact()).zip(visible.weights());
    Ok(points
        .map(|((value, exact), weight)| AtPoint { exact: *exact, method: f64::from(*value), weight: *weight })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_of_the_named_points() {
        let point = |exact, method, weight| AtPoint { exact, method, weight };
        let points = vec![point(1.0, 0.9, 1.0), point(0.99, 0.89, 3.0), point(0.1, 0.5, 2.0)];
        let figures = Figures { points, ..Figures::default() };
        for (name, expected) in [("rms_lit", 0.1), ("rms_bright", 0.1), ("rms_dark", 0.4), ("darkest", 0.5)] {
            assert!((figures.number(name, None).unwrap() - expected).abs() < 1e-12, "{name}");
        }
    }

    #[test]
    fn missing_figures_have_a_reason() {
        let mut figures = Figures { name: "osm layers=8".into(), ..Figures::default() };
        let e = figures.number("point_err_rms", None).unwrap_err();
        assert_eq!(e, "no point_err_rms (osm layers=8): it has none");
        figures.row.set_failed(&"device lost");
        assert!(figures.number("moving_ms", None).unwrap_err().ends_with("device lost"));
        figures.row.image_rmse = Some(f64::NAN);
        for name in ["image_rmse", "ssim_to_next", "split_ratio", "darkest", "rms_lit", "small_tiles"] {
            assert!(figures.number(name, Some(&figures)).is_err(), "{name}");
        }
        figures.row.bound_held = Some(true);
        assert_eq!(figures.number("bound_held", None), Ok(1.0));
    }

    #[test]
    fn a_picture_is_similar_to_itself() {
        let mut picture = Array3::from_elem((16, 16, 4), 0.5);
        let same = Figures { picture: Some(picture.clone()), ..Figures::default() };
        assert_eq!(same.number("ssim_to_next", Some(&same)), Ok(1.0));
        picture.slice_mut(ndarray::s![..8, .., ..]).fill(0.0);
        let other = Figures { picture: Some(picture), ..Figures::default() };
        assert!(same.number("ssim_to_next", Some(&other)).unwrap() < 0.9);
    }

    #[test]
    fn tiles_with_a_quarter_of_the_nodes_are_small() {
        assert_eq!(share_of_small_tiles([0, 4, 16, 5]), 0.5);
        assert_eq!(share_of_small_tiles([]), 0.0);
    }
}
