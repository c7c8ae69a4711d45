//! Build passes of shadow maps that wait for the submission of a picture, so that a moved light takes one submission.

use crate::error::Result;
use crate::gpu::{Kernels, RecordedPass, Span, Words};
use std::sync::{Mutex, PoisonError};

/// Compute passes of shadow-map builds that are recorded, and submitted together with the picture that needs the maps.
#[derive(Default)]
pub struct DeferredPasses(Mutex<Vec<Entry>>);

struct Entry {
    label: &'static str,
    count: u32,
    /// Expected duration of the pass, as a share of the intended duration of a submission.
    share: f64,
    state: State,
}

enum State {
    Recorded(Box<RecordedPass>),
    /// The pass was submitted, and the device failed.
    Lost,
    Done(Span, Words),
}

/// Result of a deferred pass that the device has run.
pub struct DeferredResult {
    /// Name of the pass.
    pub label: &'static str,
    /// Number of list entries (such as shadow-map tiles) that the pass processed.
    pub count: u32,
    /// Duration of the pass.
    pub span: Span,
    /// Words that the pass read for the host.
    pub words: Words,
}

impl DeferredPasses {
    /// Number of passes that were deferred so far.
    pub fn len(&self) -> usize {
        self.entries(|entries| entries.len())
    }

    /// Whether no pass was deferred.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sum of the expected durations of all deferred passes, as a share of the intended duration of a submission.
    pub(super) fn share(&self) -> f64 {
        self.entries(|entries| entries.iter().map(|entry| entry.share).sum())
    }

    /// Defers a pass over `count` list entries, with its expected share of a submission.
    pub(super) fn push(&self, label: &'static str, count: u32, share: f64, pass: RecordedPass) {
        let state = State::Recorded(Box::new(pass));
        self.entries(|entries| entries.push(Entry { label, count, share, state }));
    }

    /// Submits all passes that are not yet submitted, and `last` after them, in one submission. Returns the result of
    /// `last`.
    ///
    /// # Errors
    /// The device is lost, or a loop of a shader reached its iteration limit.
    pub fn submit_with(&self, kernels: &Kernels, last: RecordedPass) -> Result<(Span, Words)> {
        let take = |entry: &mut Entry| match std::mem::replace(&mut entry.state, State::Lost) {
            State::Recorded(pass) => Some(*pass),
            done => {
                entry.state = done;
                None
            }
        };
        let mut passes: Vec<_> = self.entries(|entries| entries.iter_mut().filter_map(take).collect());
        passes.push(last);
        let mut results = kernels.submit(passes)?;
        let last = results.pop();
        self.entries(|entries| {
            let lost = entries.iter_mut().filter(|entry| matches!(entry.state, State::Lost));
            lost.zip(results).for_each(|(entry, (span, words))| entry.state = State::Done(span, words));
        });
        Ok(last.unwrap_or_default())
    }

    /// Returns the results of all deferred passes, in order; `None` for a pass that the device has not run.
    pub fn into_results(self) -> Vec<Option<DeferredResult>> {
        let entries = self.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        let result = |Entry { label, count, state, .. }| match state {
            State::Done(span, words) => Some(DeferredResult { label, count, span, words }),
            State::Recorded(_) | State::Lost => None,
        };
        entries.into_iter().map(result).collect()
    }

    fn entries<T>(&self, act: impl FnOnce(&mut Vec<Entry>) -> T) -> T {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
