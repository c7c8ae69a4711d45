//! Strands section of the side panel: settings of the voxelisation of strands (hair or fibres).

use crate::app::document::Document;
use crate::app::model::Model;
use crate::engine::reading::OpenMode;
use crate::open::{StrandFlags, parse_resolution, parse_thickness_mm};
use crate::strands::{DEFAULT_RESOLUTION, Kernel, RESOLUTIONS, STRANDS_FORMAT};
use clap::ValueEnum;
use eframe::egui;

/// Texts that the user typed into the voxelisation fields of the strands section, valid or not.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StrandsForm {
    /// Text of the number of voxels along the longest side of the voxelised volume. Empty selects the default.
    resolution: String,
    kernel: Option<Kernel>,
    /// Text of the diameter of all strands, mm. Empty uses the diameters from the file.
    thickness_mm: String,
}

/// Whether the open volume was voxelised from strands, so that the strands section is shown.
pub fn are_shown(model: &Model) -> bool {
    model.document.as_ref().is_some_and(|d| d.volume.provenance.format == STRANDS_FORMAT)
}

impl StrandsForm {
    /// Creates the voxelisation fields with the values by which the open volume was made from strands.
    pub fn of(document: &Document) -> Self {
        let StrandFlags { resolution, kernel, thickness } = document.spec.flags.strands;
        let text = |value: Option<String>| value.unwrap_or_default();
        Self {
            resolution: text(resolution.map(|n| n.to_string())),
            kernel,
            thickness_mm: text(thickness.map(|mm| mm.to_string())),
        }
    }

    /// Shows the voxelisation fields of the strands section.
    pub fn show(&mut self, ui: &mut egui::Ui, model: &mut Model) {
        let (mut resolution, mut thickness) = (None, None);
        egui::Grid::new("strands").num_columns(2).show(ui, |ui| {
            let [least, most] = [RESOLUTIONS.start(), RESOLUTIONS.end()];
            let (tooltip, hint) = (
                format!(
                    "Voxels along the grid's longest side, {least} to {most} [default: {DEFAULT_RESOLUTION}]"
                ),
                DEFAULT_RESOLUTION.to_string(),
            );
            resolution = field(ui, "Resolution", [&tooltip, &hint], &mut self.resolution, parse_resolution);
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
            let texts = ["Diameter of all strands, mm; empty: from the file", "from the file, mm"];
            thickness = field(ui, "Thickness", texts, &mut self.thickness_mm, parse_thickness_mm);
        });
        let (Some(resolution), Some(thickness)) = (resolution, thickness) else {
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

/// Parses the text of a voxelisation field; `None` if it is empty.
fn typed<T>(text: &str, parse: impl Fn(&str) -> Result<T, String>) -> Result<Option<T>, String> {
    let text = text.trim();
    if text.is_empty() { Ok(None) } else { parse(text).map(Some) }
}

/// Shows a voxelisation field, with an error below it if its text is invalid. Returns `None` in that case.
fn field<T>(
    ui: &mut egui::Ui,
    label: &str,
    [tooltip, hint]: [&str; 2],
    text: &mut String,
    parse: impl Fn(&str) -> Result<T, String>,
) -> Option<Option<T>> {
    ui.label(label).on_hover_text(tooltip);
    let value = ui.vertical(|ui| {
        let edit = egui::TextEdit::singleline(text).hint_text(hint).desired_width(110.0);
        let name = format!("strands {}", label.to_lowercase());
        ui.add(edit).on_hover_text(tooltip).accessible_name(name);
        let error = |why: String| {
            let color = ui.visuals().error_fg_color;
            ui.add(egui::Label::new(egui::RichText::new(why).color(color)).wrap());
        };
        typed(text, parse).map_err(error).ok()
    });
    ui.end_row();
    value.inner
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
