//! Colours of the viewer window. Every text has a contrast of at least [`MIN_CONTRAST`], also dim or disabled text,
//! in both themes and over any picture.

use eframe::egui::style::{NumberFormatter, ScrollStyle};
use eframe::egui::{self, Color32, Theme, Visuals};
use std::ops::RangeInclusive;

/// Minimum contrast of text to its background that WCAG 2.1 (AA) requires.
pub const MIN_CONTRAST: f64 = 4.5;

/// Dark translucent background of text over a rendered picture.
pub const PLATE: Color32 = Color32::from_black_alpha(190);
/// Colour of text on a dark [`PLATE`] over a rendered picture.
pub const OVER_PICTURE: Color32 = Color32::from_gray(235);
/// Colour of less important text on a dark [`PLATE`] over a rendered picture.
pub const DIM_OVER_PICTURE: Color32 = Color32::from_gray(205);
/// Background colour of the picture area while there is no picture.
pub const NO_PICTURE: Color32 = Color32::from_gray(12);

/// Colours of the viewer window that egui's themes do not define.
#[derive(Debug, Clone, Copy)]
pub struct Colors {
    /// Colours of the curves and names of the two shadow methods in a split view.
    pub methods: [Color32; 2],
    /// Colour of the marks for the probed point in plots, and of their text.
    pub probe: Color32,
    /// Colour of the histogram bars in the transfer-function editor.
    pub histogram: Color32,
}

const DARK: Colors = Colors {
    methods: [Color32::from_rgb(240, 150, 50), Color32::from_rgb(80, 165, 245)],
    probe: Color32::from_rgb(255, 200, 60),
    histogram: Color32::from_gray(68),
};
const LIGHT: Colors = Colors {
    methods: [Color32::from_rgb(150, 75, 0), Color32::from_rgb(0, 90, 165)],
    probe: Color32::from_rgb(115, 70, 0),
    histogram: Color32::from_gray(205),
};

/// Returns the viewer's own colours for the current theme, dark or light.
pub fn colors(visuals: &Visuals) -> &'static Colors {
    if visuals.dark_mode { &DARK } else { &LIGHT }
}

/// Applies the dark or light colour theme to the user interface.
pub fn show(context: &egui::Context, dark: bool) {
    let applied = egui::Id::unique("umbravox theme");
    if !context.data(|d| d.get_temp::<bool>(applied).unwrap_or(false)) {
        for theme in [Theme::Dark, Theme::Light] {
            context.set_visuals_of(theme, visuals(theme));
            // Scroll bars beside the content, not over it.
            context.style_mut_of(theme, |style| {
                style.spacing.scroll = scroll_bars();
                style.number_formatter = NumberFormatter::new(number);
            });
        }
        context.data_mut(|d| d.insert_temp(applied, true));
    }
    context.set_theme(if dark { Theme::Dark } else { Theme::Light });
}

/// Formats a number in a field of the window as egui does, but never as negative zero.
fn number(x: f64, decimals: RangeInclusive<usize>) -> String {
    let text = egui::emath::format_with_decimals_in_range(x, decimals);
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
        _ => text,
    }
}

fn scroll_bars() -> ScrollStyle {
    ScrollStyle { bar_width: 7.0, bar_inner_margin: 3.0, ..ScrollStyle::solid() }
}

fn visuals(theme: Theme) -> Visuals {
    let mut v = theme.default_visuals();
    match theme {
        Theme::Dark => {
            v.widgets.noninteractive.fg_stroke.color = Color32::from_gray(205);
            v.weak_text_color = Some(Color32::from_gray(180));
            v.selection.bg_fill = Color32::from_rgb(0, 80, 115);
            v.selection.stroke.color = Color32::from_rgb(215, 235, 255);
            v.error_fg_color = Color32::from_rgb(255, 140, 130);
            v.warn_fg_color = Color32::from_rgb(255, 165, 60);
            v.disabled_alpha = 0.75;
        }
        Theme::Light => {
            v.widgets.noninteractive.fg_stroke.color = Color32::from_gray(50);
            v.weak_text_color = Some(Color32::from_gray(80));
            v.widgets.active.bg_fill = Color32::from_gray(205);
            v.widgets.active.weak_bg_fill = Color32::from_gray(205);
            v.selection.stroke.color = Color32::from_rgb(0, 45, 75);
            v.error_fg_color = Color32::from_rgb(175, 15, 15);
            v.warn_fg_color = Color32::from_rgb(130, 65, 0);
            v.disabled_alpha = 0.85;
        }
    }
    v
}

/// Blends a translucent colour over a background colour in sRGB values, as egui does in the window.
pub fn over(color: Color32, back: Color32) -> Color32 {
    back.blend(color)
}

/// Contrast ratio of two opaque colours by WCAG, 1 to 21.
pub fn contrast(text: Color32, back: Color32) -> f64 {
    let luminance = |c: Color32| {
        let [r, g, b] = [c.r(), c.g(), c.b()].map(|code| {
            let c = f64::from(code) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let (a, b) = (luminance(text), luminance(back));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_has_no_sign() {
        let shown = [-0.0, -1e-9, -0.004, -0.006, 1.5, -12.0].map(|x| number(x, 0..=2));
        assert_eq!(shown, ["0", "0", "0.00", "-0.01", "1.5", "-12"]);
    }

    #[test]
    fn contrast_is_that_of_wcag() {
        // Examples of the standard.
        for (text, back, expected) in [
            (Color32::WHITE, Color32::BLACK, 21.0),
            (Color32::from_gray(0x77), Color32::WHITE, 4.48),
            (Color32::from_rgb(255, 0, 0), Color32::WHITE, 4.0),
            (Color32::WHITE, Color32::WHITE, 1.0),
        ] {
            assert!((contrast(text, back) - expected).abs() < 0.01, "{}", contrast(text, back));
            assert_eq!(contrast(text, back), contrast(back, text));
        }
    }

    /// Text colours of a window theme, each with the background that it is drawn on.
    fn pairs(v: &Visuals) -> Vec<(String, Color32, Color32)> {
        let colors = colors(v);
        let stripe = over(v.faint_bg_color, v.panel_fill);
        let w = &v.widgets;
        let mut pairs = Vec::new();
        let mut on = |name: &str, text: Color32, backs: &[(&str, Color32)]| {
            for (surface, back) in backs {
                pairs.push((format!("{name} on {surface}"), text, over(*back, v.panel_fill)));
            }
        };
        let plain = [("panel", v.panel_fill), ("window", v.window_fill), ("stripe", stripe)];
        let field = [("field", v.text_edit_bg_color())];
        on("text", v.text_color(), &plain);
        on("strong", v.strong_text_color(), &plain);
        on("error", v.error_fg_color, &plain);
        on("warning", v.warn_fg_color, &plain);
        on("weak", v.weak_text_color(), &[&plain[..], &field].concat());
        let selection = [("selection", v.selection.bg_fill)];
        on("selected", v.selection.stroke.color, &selection);
        for (name, state) in
            [("inactive", &w.inactive), ("hovered", &w.hovered), ("active", &w.active), ("open", &w.open)]
        {
            let own = [("button", state.weak_bg_fill), ("box", state.bg_fill)];
            on(name, state.fg_stroke.color, &[&own[..], &plain].concat());
            // Shortcuts in menus have no frame until the pointer is over them.
            let entry = if name == "inactive" { v.window_fill } else { state.weak_bg_fill };
            on(&format!("key, {name}"), v.weak_text_color(), &[("entry", entry)]);
        }
        for method in colors.methods {
            on("method", method, &plain);
        }
        let plot = [("curve", v.extreme_bg_color), ("histogram", colors.histogram)];
        on("probe", colors.probe, &plot);
        pairs
    }

    #[test]
    fn all_text_can_be_read_in_both_themes() {
        for theme in [Theme::Dark, Theme::Light] {
            let v = visuals(theme);
            let found = pairs(&v);
            assert!(found.len() > 40);
            let never_disabled = ["active", "hovered", "open", "probe", "method"];
            for (name, text, back) in found {
                let ratio = contrast(text, back);
                assert!(ratio >= MIN_CONTRAST, "{theme:?}: {name}: {ratio:.2}");
                // Disabled text fades with its background into the panel.
                if never_disabled
                    .iter()
                    .any(|part| name.starts_with(part) || name.contains(&format!(", {part}")))
                {
                    continue;
                }
                let [text, back] =
                    [text, back].map(|c| over(c.gamma_multiply(v.disabled_alpha), v.panel_fill));
                let ratio = contrast(text, back);
                assert!(ratio >= MIN_CONTRAST, "{theme:?}: disabled {name}: {ratio:.2}");
            }
        }
    }

    #[test]
    fn text_over_pictures_can_be_read_on_any_picture() {
        for text in [OVER_PICTURE, DIM_OVER_PICTURE] {
            for picture in [Color32::BLACK, NO_PICTURE, Color32::from_gray(128), Color32::WHITE] {
                let ratio = contrast(text, over(PLATE, picture));
                assert!(ratio >= MIN_CONTRAST, "{text:?} over {picture:?}: {ratio:.2}");
            }
        }
    }
}
