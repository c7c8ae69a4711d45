//! Result of a comparison: rows with their pictures, notes and failures.

use super::facts::Facts;
use super::job::name_of;
use super::stats::image_difference;
use super::table::Row;
use crate::error::{Error, Result};
use crate::render::Omission;
use crate::shadow::{Method, NodeMap, ShadowRays};
use ndarray::{Array2, Array3};
use std::borrow::BorrowMut;

/// Row of a table with its picture.
pub struct Compared {
    /// Measured row.
    pub row: Row,
    /// Method with its requested settings: the scene may choose the size of the map, which the row then states.
    pub method: String,
    /// A name for its files, different for every row.
    pub slug: String,
    /// `height x width x 4`, linear RGBA; `None` where the row failed before it was drawn.
    pub picture: Option<Array3<f32>>,
    /// Work that the plan skipped.
    pub left_out: Vec<Omission>,
    /// Largest channel difference to the picture of the scene's `rays` row, `height x width`, where there is one.
    pub difference: Option<Array2<f32>>,
    /// Nodes by texel, where the method stores nodes and they were counted.
    pub nodes: Option<NodeMap>,
}

/// Everything that came of a comparison.
#[derive(Default)]
pub struct Comparison {
    /// Scene by scene, in the order of the methods; failed rows too.
    pub compared: Vec<Compared>,
    /// Notes on the measurement for the reader of the table.
    pub notes: Vec<String>,
    /// Failed parts of the comparison by name, such as `dsm epsilon=0.02`, each with its error.
    pub failures: Vec<(String, Error)>,
    /// Trials of the searches within budgets.
    pub trials: Vec<Row>,
    /// Methods of the rows behind the requested ones: the choices of the searches.
    pub tuned: Vec<Box<dyn Method>>,
}

impl Comparison {
    /// The table.
    pub fn rows(&self) -> Vec<Row> {
        self.compared.iter().map(|c| c.row.clone()).collect()
    }

    /// Says of which scene the notes and failures are.
    pub fn name_scene(&mut self, name: &str) {
        self.notes.iter_mut().for_each(|note| *note = format!("{name}: {note}"));
        self.failures.iter_mut().for_each(|(what, _)| *what = format!("{name}: {what}"));
    }

    /// Adds another scene's.
    pub fn append(&mut self, mut other: Self) {
        self.compared.append(&mut other.compared);
        self.notes.append(&mut other.notes);
        self.failures.append(&mut other.failures);
        self.trials.append(&mut other.trials);
        self.tuned.append(&mut other.tuned);
    }

    /// Comparison of a scene that cannot be drawn at all, with a failed row for each method.
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
    /// Whether the row is by `rays`, which others are compared with.
    pub fn is_reference(&self) -> bool {
        self.row.method == ShadowRays::default().name()
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

/// Fills the differences of the rows' pictures from the reference.
///
/// # Errors
/// Pictures of different sizes.
pub fn take_differences(compared: &mut [impl BorrowMut<Compared>], reference: &Array3<f32>) -> Result<()> {
    for c in compared {
        let c = c.borrow_mut();
        if let Some(picture) = c.picture.as_ref().filter(|_| !c.is_reference()) {
            c.difference = Some(image_difference(picture.view(), reference.view())?);
        }
    }
    Ok(())
}
