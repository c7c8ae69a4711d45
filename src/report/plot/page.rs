//! Text sizes and colours that all plots share.

use crate::report::canvas::{Rgb, text_width};

// All sizes are in points of the drawing, which an SVG viewer shows as CSS pixels.
pub const TITLE: f64 = 23.0;
pub const TEXT: f64 = 16.5;
pub const SMALL: f64 = 14.5;

pub const GREY: Rgb = [110, 110, 110];
pub const GRID: Rgb = [225, 225, 225];

/// Shortens a text at its end until it is at most `width` points wide.
pub fn shorten(mut text: String, size: f64, width: f64) -> String {
    if text_width(&text, size) <= width {
        return text;
    }
    while text_width(&text, size) + text_width("…", size) > width && text.pop().is_some() {}
    text.trim_end().to_string() + "…"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_titles_are_cut() {
        let cut = shorten("volume ".repeat(200), TITLE, 400.0);
        assert!(cut.ends_with('…') && text_width(&cut, TITLE) <= 400.0);
        assert_eq!(shorten("short".into(), TITLE, 400.0), "short");
    }
}
