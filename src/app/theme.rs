//! Colours of the window: every text has a contrast of at least [`LEAST_CONTRAST`] against what it lies on, also where it
//! is dim or disabled, in both themes and over any picture.

use eframe::egui::style::{NumberFormatter, ScrollStyle};
use eframe::egui::{self, Color32, Theme, Visuals};
use std::ops::RangeInclusive;

/// What WCAG 2.1 (AA) asks of text.
pub const LEAST_CONTRAST: f64 = 4.5;

/// Behind text that lies over a picture.
pub const PLATE: Color32 = Color32::from_black_alpha(190);
/// Text on a [`PLATE`].
pub const OVER_PICTURE: Color32 = Color32::from_gray(235);
/// Text on a [`PLATE`] that is not what one looks for.
pub const DIM_OVER_PICTURE: Color32 = Color32::from_gray(205);
/// Where no picture is yet.
pub const NO_PICTURE: Color32 = Color32::from_gray(12);

/// Colours that egui has no name for.
#[derive(Debug, Clone, Copy)]
pub struct Colors {
    /// Curves and names of the first and the second method.
    pub methods: [Color32; 2],
    /// The probed point, and the text beside its line.
    pub probe: Color32,
    /// The histogram's columns.
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

/// Those of the theme that is shown.
pub fn colors(visuals: &Visuals) -> &'static Colors {
    if visuals.dark_mode { &DARK } else { &LIGHT }
}

/// Shows one of the two themes, whose colours are told to egui the first time.
pub fn show(context: &egui::Context, dark: bool) {
    let told = egui::Id::unique("umbravox theme");
    if !context.data(|d| d.get_temp::<bool>(told).unwrap_or(false)) {
        for theme in [Theme::Dark, Theme::Light] {
            context.set_visuals_of(theme, visuals(theme));
            // Bars beside what scrolls, not over it.
            context.style_mut_of(theme, |style| {
                style.spacing.scroll = scroll_bars();
                style.number_formatter = NumberFormatter::new(number);
            });
        }
        context.data_mut(|d| d.insert_temp(told, true));
    }
    context.set_theme(if dark { Theme::Dark } else { Theme::Light });
}

/// As egui writes it, but that nothing is no negative number, which turned axes are full of.
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

/// A colour over another, as the window blends them: by sRGB codes.
pub fn over(color: Color32, back: Color32) -> Color32 {
    back.blend(color)
}

/// WCAG's contrast of two opaque colours, 1 to 21.
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
    fn nothing_is_no_negative_number() {
        let shown = [-0.0, -1e-9, -0.004, -0.006, 1.5, -12.0].map(|x| number(x, 0..=2));
        assert_eq!(shown, ["0", "0", "0.00", "-0.01", "1.5", "-12"]);
    }

    #[test]
    fn contrast_is_that_of_wcag() {
        // The document's own example pairs.
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

    /// Text colours with the surfaces that they are drawn on.
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
            // Keys beside the entries of menus, which have no frame until a hand is over them.
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
                let seen = contrast(text, back);
                assert!(seen >= LEAST_CONTRAST, "{theme:?}: {name}: {seen:.2}");
                // What is disabled fades, with what it lies on, into the panel.
                if never_disabled
                    .iter()
                    .any(|part| name.starts_with(part) || name.contains(&format!(", {part}")))
                {
                    continue;
                }
                let [text, back] =
                    [text, back].map(|c| over(c.gamma_multiply(v.disabled_alpha), v.panel_fill));
                let seen = contrast(text, back);
                assert!(seen >= LEAST_CONTRAST, "{theme:?}: disabled {name}: {seen:.2}");
            }
        }
    }

    #[test]
    fn text_over_pictures_can_be_read_on_any_picture() {
        for text in [OVER_PICTURE, DIM_OVER_PICTURE] {
            for picture in [Color32::BLACK, NO_PICTURE, Color32::from_gray(128), Color32::WHITE] {
                let seen = contrast(text, over(PLATE, picture));
                assert!(seen >= LEAST_CONTRAST, "{text:?} over {picture:?}: {seen:.2}");
            }
        }
    }
}
