//! Voxelisation of strands: section of the side panel.

use crate::app::document::Document;
use crate::app::model::Model;
use crate::engine::reading::OpenMode;
use crate::open::{StrandFlags, parse_resolution, parse_thickness_mm};
use crate::strands::{DEFAULT_RESOLUTION, Kernel, RESOLUTIONS, STRANDS_FORMAT};
use clap::ValueEnum;
use eframe::egui;

/// Texts of the fields, valid or not.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StrandsForm {
    /// Voxels along the longest side; empty: the default.
    resolution: String,
    kernel: Option<Kernel>,
    /// Diameter of all strands, mm; empty: from the file.
    thickness_mm: String,
}

/// Whether the open volume was made from strands.
pub fn are_shown(model: &Model) -> bool {
    model.document.as_ref().is_some_and(|d| d.volume.provenance.format == STRANDS_FORMAT)
}

impl StrandsForm {
    /// Fields for the flags of the open volume.
    pub fn of(document: &Document) -> Self {
        let StrandFlags { resolution, kernel, thickness } = document.spec.flags.strands;
        let text = |value: Option<String>| value.unwrap_or_default();
        Self {
            resolution: text(resolution.map(|n| n.to_string())),
            kernel,
            thickness_mm: text(thickness.map(|mm| mm.to_string())),
        }
    }

    /// Shows the fields.
    pub fn show(&mut self, ui: &mut egui::Ui, model: &mut Model) {
        let (mut resolution, mut thickness) = (Ok(None), Ok(None));
        egui::Grid::new("strands").num_columns(2).show(ui, |ui| {
            let tooltip = format!(
                "Voxels along the grid's longest side, {} to {} [default: {DEFAULT_RESOLUTION}]",
                RESOLUTIONS.start(),
                RESOLUTIONS.end()
            );
            ui.label("Resolution").on_hover_text(&tooltip);
            let hint = DEFAULT_RESOLUTION.to_string();
            ui.vertical(|ui| {
                let edit = egui::TextEdit::singleline(&mut self.resolution).hint_text(hint);
                named(ui, edit, "strands resolution", &tooltip);
                resolution = said(ui, typed(&self.resolution, parse_resolution));
            });
            ui.end_row();
            ui.label("Kernel").on_hover_text("Distribution of a strand's length over voxels");
            ui.horizontal(|ui| {
                for kernel in Kernel::value_variants() {
                    let Some(value) = kernel.to_possible_value() else { continue };
                    let tooltip = value.get_help().map(ToString::to_string).unwrap_or_default();
                    let chosen = self.kernel.unwrap_or_default() == *kernel;
                    let choice = ui.selectable_label(chosen, value.get_name()).on_hover_text(tooltip);
                    if choice.accessible_name(format!("strands kernel {}", value.get_name())).clicked() {
                        self.kernel = Some(*kernel);
                    }
                }
            });
            ui.end_row();
            let tooltip = "Diameter of all strands, mm; empty: from the file";
            ui.label("Thickness").on_hover_text(tooltip);
            ui.vertical(|ui| {
                let edit = egui::TextEdit::singleline(&mut self.thickness_mm).hint_text("from the file, mm");
                named(ui, edit, "strands thickness", tooltip);
                thickness = said(ui, typed(&self.thickness_mm, parse_thickness_mm));
            });
            ui.end_row();
        });
        let (Ok(resolution), Ok(thickness)) = (resolution, thickness) else {
            ui.add_enabled(false, egui::Button::new("Voxelise again"));
            return;
        };
        let wanted = StrandFlags { resolution, kernel: self.kernel, thickness };
        let idle = model.reading.is_none();
        let tooltip = "Transfer function, camera, light and method stay";
        let button = ui.add_enabled(idle, egui::Button::new("Voxelise again")).on_hover_text(tooltip);
        if button.clicked()
            && let Some(document) = &model.document
        {
            let mut spec = document.spec.clone();
            spec.flags.strands = wanted;
            model.open(spec, OpenMode::Revoxelise);
        }
    }
}

/// Parses a field; `None` where it is empty.
fn typed<T>(text: &str, parse: impl Fn(&str) -> Result<T, String>) -> Result<Option<T>, String> {
    let text = text.trim();
    if text.is_empty() { Ok(None) } else { parse(text).map(Some) }
}

/// Field with an accessible name.
fn named(ui: &mut egui::Ui, edit: egui::TextEdit<'_>, name: &str, tooltip: &str) {
    ui.add(edit.desired_width(110.0)).on_hover_text(tooltip).accessible_name(name);
}

/// Shows the error of an invalid field.
fn said<T>(ui: &mut egui::Ui, typed: Result<T, String>) -> Result<T, ()> {
    typed.map_err(|why| {
        let color = ui.visuals().error_fg_color;
        ui.add(egui::Label::new(egui::RichText::new(why).color(color)).wrap());
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_field_is_the_default_and_a_bad_one_says_why() {
        let typed_both = |resolution: &str, thickness: &str| {
            (typed(resolution, parse_resolution), typed(thickness, parse_thickness_mm))
        };
        assert_eq!(typed_both("", " "), (Ok(None), Ok(None)));
        assert_eq!(typed_both(" 64 ", "0.25"), (Ok(Some(64)), Ok(Some(0.25))));
        for (resolution, thickness) in [("3", "0"), ("1025", "-1"), ("64.5", "nan"), ("x", "1e10")] {
            let (bad, worse) = typed_both(resolution, thickness);
            assert!(bad.unwrap_err().contains("from 4 to 1024"));
            assert!(worse.unwrap_err().contains("mm"));
        }
    }
}
