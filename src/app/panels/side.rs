//! Side panel of the viewer: shadow method, light, picture, times and volume.

use super::difference::Difference;
use super::strands::StrandsForm;
use super::times::Times;
use super::widgets::{property, unfilled};
use super::{clip, labels, light, shadows, strands};
use crate::app::camera::{self, Orbit};
use crate::app::model::Model;
use crate::files::color;
use crate::scene::AXIS_VIEWS;
use eframe::egui;

/// Width of the side panel, screen points.
const WIDTH: f32 = 330.0;

/// Shows the side panel while a volume is open.
pub fn show(
    ui: &mut egui::Ui,
    model: &mut Model,
    difference: &mut Difference,
    form: &mut StrandsForm,
    times: &Times,
) {
    if model.document.is_none() {
        return;
    }
    egui::Panel::right("side").frame(unfilled(ui)).resizable(false).exact_size(WIDTH).show(ui, |ui| {
        let width = ui.available_width() - ui.spacing().scroll.allocated_width();
        // Horizontal scrolling keeps wide contents from widening the panel.
        egui::ScrollArea::both().auto_shrink(false).show(ui, |ui| {
            ui.set_max_width(width);
            ui.add_space(6.0);
            section(ui, "Shadows", |ui| shadows::show(ui, model, difference));
            if strands::are_shown(model) {
                section(ui, "Strands", |ui| form.show(ui, model));
            }
            section(ui, "Light", |ui| light::show(ui, model));
            section(ui, "Clipping", |ui| clip::show(ui, model));
            if model.document.as_ref().is_some_and(|d| d.volume.labels().is_some()) {
                section(ui, "Labels", |ui| labels::show(ui, model));
            }
            section(ui, "Picture", |ui| picture(ui, model));
            section(ui, "Times", |ui| times.show(ui, model));
            section(ui, "Volume", |ui| volume(ui, model));
        });
    });
}

fn section(ui: &mut egui::Ui, title: &str, contents: impl FnOnce(&mut egui::Ui)) {
    egui::CollapsingHeader::new(egui::RichText::new(title).strong()).default_open(title != "Volume").show(
        ui,
        |ui| {
            contents(ui);
            ui.add_space(4.0);
        },
    );
}

fn picture(ui: &mut egui::Ui, model: &mut Model) {
    let Some(document) = &mut model.document else { return };
    let scene = &mut document.scene;
    let mut frame = false;
    egui::Grid::new("picture").num_columns(2).show(ui, |ui| {
        ui.label("Field of view");
        let fov = egui::Slider::new(&mut scene.camera.fov_deg, 5.0..=120.0).suffix("°").max_decimals(1);
        ui.add(fov).on_hover_text("Vertical, degrees");
        ui.end_row();
        ui.label("Eye-ray step");
        let step = egui::Slider::new(&mut scene.step, 0.1..=4.0).suffix(" voxels").max_decimals(2);
        ui.add(step).on_hover_text("In units of the smallest voxel spacing, at full quality");
        ui.end_row();
        ui.label("Background");
        ui.horizontal(|ui| {
            ui.add_enabled_ui(!document.transparent, |ui| {
                let mut rgb = scene.background.map(color::srgb8_from_linear);
                if ui.color_edit_button_srgb(&mut rgb).on_hover_text("sRGB").changed() {
                    scene.background = rgb.map(|c| color::linear_from_srgb(f64::from(c) / 255.0));
                }
            });
            let none = ui.checkbox(&mut document.transparent, "none").accessible_name("no background");
            let tooltip = "Black here; transparent in picture files";
            if none.on_hover_text(tooltip).changed() && document.transparent {
                scene.background = [0.0; 3];
            }
        });
        ui.end_row();
        ui.label("Rotation");
        ui.horizontal(|ui| {
            ui.selectable_value(&mut model.settings.orbit, Orbit::Turntable, "turntable")
                .on_hover_text("The horizon stays level");
            ui.selectable_value(&mut model.settings.orbit, Orbit::Trackball, "trackball")
                .on_hover_text("Free rotation");
        });
        ui.end_row();
        ui.label("Look from");
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 3.0;
            for (i, view) in AXIS_VIEWS.iter().enumerate() {
                if ui.small_button(view.mark).on_hover_text(format!("{} ({})", view.name, i + 1)).clicked() {
                    camera::look_from(&mut scene.camera, view);
                }
            }
        });
        ui.end_row();
        ui.label("Camera");
        ui.horizontal(|ui| {
            if ui.small_button("reset").on_hover_text("Initial view (Home)").clicked() {
                scene.camera = document.home;
            }
            frame =
                ui.small_button("frame").on_hover_text("Fit the visible part into the picture (0)").clicked();
        });
        ui.end_row();
    });
    if frame {
        document.frame_visible();
    }
}

fn volume(ui: &mut egui::Ui, model: &Model) {
    let Some(document) = &model.document else { return };
    let volume = &document.volume;
    egui::Grid::new("volume").num_columns(2).show(ui, |ui| {
        let mut row = |name, value| property(ui, name, value, "");
        let [x, y, z] = volume.dims();
        let [sx, sy, sz] = volume.spacing_mm();
        let [lo, hi] = volume.value_range();
        row("source", volume.provenance.source.clone());
        row("voxels", format!("{x} x {y} x {z}, {}", volume.provenance.stored_type));
        row("spacing", format!("{sx:.3} x {sy:.3} x {sz:.3} mm"));
        row("values", format!("{lo:.6} to {hi:.6} {}", document.tf.units));
        row("memory", format!("{:.1} MB", volume.bytes() as f64 * 1e-6));
    });
    for warning in &volume.provenance.warnings {
        ui.colored_label(ui.visuals().warn_fg_color, warning);
    }
}
