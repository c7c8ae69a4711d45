//! Segmentation labels: the section of the side panel that shows or hides each label.

use crate::app::model::Model;
use crate::transfer::LabelClass;
use eframe::egui;

/// Height of the list of segmentation labels in the side panel, screen points.
const HEIGHT: f32 = 170.0;

/// Size of the square in the colour of a segment, screen points.
const SQUARE: egui::Vec2 = egui::Vec2::splat(10.0);

/// Shows the side panel section of the segmentation labels, if the volume has any.
pub fn show(ui: &mut egui::Ui, model: &mut Model) {
    let Some(document) = &mut model.document else { return };
    let Some(labels) = document.volume.labels().cloned() else { return };
    let mut hidden: Vec<u32> =
        labels.ids().iter().copied().filter(|id| document.tf.class_of(*id) == LabelClass::Hidden).collect();
    let before = hidden.clone();
    ui.horizontal(|ui| {
        if ui.small_button("all").accessible_name("show all labels").clicked() {
            hidden.clear();
        }
        if ui.small_button("none").accessible_name("hide all labels").clicked() {
            hidden = labels.ids().to_vec();
        }
        if ui.small_button("others").on_hover_text("Invert the selection").clicked() {
            hidden = labels.ids().iter().copied().filter(|id| !before.contains(id)).collect();
        }
    });
    egui::ScrollArea::vertical().id_salt("labels").max_height(HEIGHT).show(ui, |ui| {
        egui::Grid::new("labels").num_columns(2).show(ui, |ui| {
            for (id, count) in labels.ids().iter().zip(labels.counts()) {
                let mut shown = !hidden.contains(id);
                let name = match labels.segment(*id) {
                    Some(segment) => format!("{id}, {}", segment.name),
                    None if *id == 0 => "0, no label".to_owned(),
                    None => id.to_string(),
                };
                let function = match document.tf.class_of(*id) {
                    LabelClass::Function(i) if i > 0 => format!(" ({})", document.tf.function(i).name),
                    _ => String::new(),
                };
                ui.horizontal(|ui| {
                    if let Some(color) = labels.segment(*id).and_then(|segment| segment.color) {
                        let [red, green, blue] = color.map(|c| (255.0 * c).round() as u8);
                        // The fonts have no square.
                        let (square, _) = ui.allocate_exact_size(SQUARE, egui::Sense::hover());
                        ui.painter().rect_filled(square, 0.0, egui::Color32::from_rgb(red, green, blue));
                    }
                    let check = ui.checkbox(&mut shown, format!("{name}{function}"));
                    let accessible = labels.segment(*id).map_or_else(|| id.to_string(), |_| name);
                    if check.accessible_name(format!("label {accessible}")).changed() {
                        if shown { hidden.retain(|other| other != id) } else { hidden.push(*id) }
                    }
                });
                ui.weak(format!("{count} voxels"));
                ui.end_row();
            }
        });
    });
    if hidden != before {
        hidden.sort_unstable();
        document.hide_labels(hidden);
    }
}
