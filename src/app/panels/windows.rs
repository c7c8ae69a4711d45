//! The windows that are opened over the view from the menus and by keys.

use super::comparison::Comparison;
use super::prompt::Prompt;

/// Each is open or not.
#[derive(Default)]
pub struct Windows {
    pub prompt: Prompt,
    pub comparison: Comparison,
    /// The list of keys and hands.
    pub help: bool,
    /// A field was being typed into when the last frame ended: egui takes the cursor away before it shows Escape.
    pub typing: bool,
}
