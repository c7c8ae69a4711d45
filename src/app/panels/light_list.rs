//! The scene's lights: which is edited, one more, one less; colour and intensity of the one that is edited.

use crate::app::document::Document;
use crate::files::color;
use crate::open::values::MOST_INTENSITY;
use crate::scene::{Light, LightSource, Scene};
use eframe::egui;

/// The list, with what adds to it and takes from it.
pub fn show(ui: &mut egui::Ui, document: &mut Document) {
    let chosen = document.chosen_light();
    ui.horizontal_wrapped(|ui| {
        for (place, source) in document.scene.lights.iter().enumerate() {
            let text = egui::RichText::new(format!("{}", place + 1));
            // One that gives no light is not drawn.
            let text = if source.shines() { text } else { text.strikethrough() };
            let kind = match source.light {
                Light::Directional { .. } => "at infinity",
                Light::Point { .. } => "at a point",
            };
            let button =
                ui.selectable_label(place == chosen, text).accessible_name(format!("light {}", place + 1));
            if button.on_hover_text(format!("Edit this light, {kind}")).clicked() {
                document.chosen = place;
            }
        }
        let count = document.scene.lights.len();
        let add =
            ui.add_enabled(count < Scene::MOST_LIGHTS, egui::Button::new("+")).accessible_name("add light");
        let tooltip = format!(
            "Add a light, at most {}: each is a shadow map and a pass of its own",
            Scene::MOST_LIGHTS
        );
        if add.on_hover_text(tooltip).clicked() {
            document.add_light();
        }
        let remove = ui.add_enabled(count > 1, egui::Button::new("−")).accessible_name("remove light");
        if remove.on_hover_text("Remove the light that is edited").clicked() {
            document.remove_light();
        }
    });
    ui.horizontal(|ui| factors(ui, document.light_mut()));
}

/// Colour and intensity.
fn factors(ui: &mut egui::Ui, source: &mut LightSource) {
    let mut rgb = source.color.map(color::srgb8_from_linear);
    if ui.color_edit_button_srgb(&mut rgb).on_hover_text("The light's colour").changed() {
        source.color = rgb.map(|code| color::linear_from_srgb(f64::from(code) / 255.0));
    }
    let intensity = egui::DragValue::new(&mut source.intensity).speed(0.01).max_decimals(3);
    ui.add(intensity.prefix("intensity ").range(0.0..=MOST_INTENSITY))
        .on_hover_text("A factor on the light's colour; a light of 0 is not drawn")
        .accessible_name("light intensity");
}
