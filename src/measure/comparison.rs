//! Result of comparing shadow methods: comparison table rows with their pictures, notes and failures.

use super::cell::Cell;
use super::facts::Facts;
use super::job::name_of;
use super::stats::image_difference;
use super::table::Row;
use crate::error::{Error, Result};
use crate::render::Omission;
use crate::shadow::{Method, NodeMap, ShadowRays};
use ndarray::{Array2, Array3};
use std::borrow::BorrowMut;

/// Row of the comparison table, together with the shadow method's picture.
pub struct Compared {
    /// Row of the comparison table, with the measured values.
    pub row: Row,
    /// Shadow method with its settings as the user requested them. The shadow map size is listed only if the user
    /// requested one.
    pub method: String,
    /// Unique text in the names of this shadow method's files, such as its picture.
    pub slug: String,
    /// Picture rendered with the shadow method: `height x width x 4`, linear RGBA. `None` where the method failed
    /// before the picture was rendered.
    pub picture: Option<Array3<f32>>,
    /// Kinds of rendering work, such as gradients, that the renderer skipped because the scene does not need them.
    pub left_out: Vec<Omission>,
    /// Largest colour channel difference at each pixel from the picture of the reference method `rays`, `height x
    /// width`; `None` without that method.
    pub difference: Option<Array2<f32>>,
    /// Number of transmittance curve nodes in each shadow map texel; `None` where the method stores no nodes or they
    /// were not counted.
    pub nodes: Option<NodeMap>,
}

/// Result of comparing shadow methods on one or several scenes.
#[derive(Default)]
pub struct Comparison {
    /// Table rows and pictures of the compared shadow methods, scene by scene, in the requested order. Failed methods
    /// are included.
    pub compared: Vec<Compared>,
    /// Notes on the measurement for the reader of the comparison table.
    pub notes: Vec<String>,
    /// Failed measurements of the comparison of shadow methods: pairs of a name, such as `dsm epsilon=0.02`, and an
    /// error.
    pub failures: Vec<(String, Error)>,
    /// Measured trials of the searches for method settings within memory or time budgets.
    pub trials: Vec<Row>,
    /// Shadow methods with the settings that searches within budgets chose. Their comparison table rows follow those
    /// of the requested methods.
    pub tuned: Vec<Box<dyn Method>>,
}

impl Comparison {
    /// Returns the rows of the comparison table of shadow methods.
    pub fn rows(&self) -> Vec<Row> {
        self.compared.iter().map(|c| c.row.clone()).collect()
    }

    /// Puts the name of the scene before each note and failure of a comparison of shadow methods.
    pub fn name_scene(&mut self, name: &str) {
        self.notes.iter_mut().for_each(|note| *note = format!("{name}: {note}"));
        self.failures.iter_mut().for_each(|(what, _)| *what = format!("{name}: {what}"));
    }

    /// Appends the comparison of shadow methods on another scene.
    pub fn append(&mut self, mut other: Self) {
        self.compared.append(&mut other.compared);
        self.notes.append(&mut other.notes);
        self.failures.append(&mut other.failures);
        self.trials.append(&mut other.trials);
        self.tuned.append(&mut other.tuned);
    }

    /// Creates the result of comparing shadow methods on a scene that cannot be rendered at all: a failed row for
    /// each method.
    pub fn failed(
        facts: &Facts,
        scene_name: &str,
        size: [u32; 2],
        methods: &[Box<dyn Method>],
        error: &Error,
    ) -> Self {
        let mut comparison = Self::default();
        for method in methods {
            let method = method.as_ref();
            comparison.compared.push(Compared::failed(
                facts.row(scene_name, size, method),
                method,
                String::new(),
                error,
            ));
            comparison.failures.push((format!("{scene_name}: {}", name_of(method)), error.clone()));
        }
        comparison
    }
}

impl Compared {
    /// Whether the comparison table row is of the reference method `rays`, marched cell by cell and without random numbers.
    /// The pictures of the other methods are compared with its picture.
    pub fn is_reference(&self) -> bool {
        let is_set = |key: &str, word: &str| self.row.setting(key) == Cell::from(word.to_owned());
        let is_exact = !is_set("march", "samples") && is_set("estimator", "off");
        self.row.method == ShadowRays::default().name() && is_exact
    }

    pub(super) fn failed(mut row: Row, method: &dyn Method, slug: String, error: &Error) -> Self {
        row.set_failed(error);
        Self {
            row,
            method: method.spec().to_string(),
            slug,
            picture: None,
            difference: None,
            nodes: None,
            left_out: Vec::new(),
        }
    }
}

/// Computes the pixel-wise difference of each shadow method's picture from the picture of the reference method
/// `rays`.
///
/// # Errors
/// The pictures differ in size.
pub fn take_differences(compared: &mut [impl BorrowMut<Compared>], reference: &Array3<f32>) -> Result<()> {
    for c in compared {
        let c = c.borrow_mut();
        if let Some(picture) = c.picture.as_ref().filter(|_| !c.is_reference()) {
            c.difference = Some(image_difference(picture.view(), reference.view())?);
        }
    }
    Ok(())
}
