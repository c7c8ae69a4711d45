//! The side panel: shadow method, light and picture.

use super::App;
use super::camera::{self, AXIS_VIEWS, Orbit};
use super::document::name_of;
use super::method_choice::MethodChoice;
use crate::files::color;
use crate::scene::{Light, Shading};
use crate::shadow::{Key, METHODS};
use eframe::egui::{self, Color32, Sense, Stroke, vec2};
use glam::DVec3;

/// Width of the panel, points.
const WIDTH: f32 = 330.0;
/// Width of the buttons beside a setting with the space between them, points.
const BUTTONS_WIDTH: f32 = 122.0;

/// Named values of a setting that fit beside each other.
const MOST_ABREAST: usize = 4;

impl App {
    pub(super) fn side_panel(&mut self, ui: &mut egui::Ui) {
        if self.document.is_none() {
            return;
        }
        egui::Panel::right("side").frame(super::unfilled(ui)).exact_size(WIDTH).show(ui, |ui| {
            let width = ui.available_width();
            // Scrolled sideways, too, so that whatever is too wide does not push the panel into the view.
            egui::ScrollArea::both().auto_shrink(false).show(ui, |ui| {
                ui.set_max_width(width);
                ui.add_space(6.0);
                section(ui, "Shadows", |ui| self.shadows(ui));
                if self.shows_strands() {
                    section(ui, "Strands", |ui| self.strands(ui));
                }
                section(ui, "Light", |ui| self.light(ui));
                section(ui, "Picture", |ui| self.picture(ui));
                section(ui, "Times", |ui| self.times(ui));
                section(ui, "Volume", |ui| self.volume(ui));
            });
        });
    }

    fn shadows(&mut self, ui: &mut egui::Ui) {
        let Some(document) = &mut self.document else { return };
        method_editor(ui, "method", &mut document.method);
        ui.add_space(2.0);
        let mut split = self.split.is_some();
        let toggle = ui.checkbox(&mut split, "Split view with a second method");
        if toggle.on_hover_text("Drag the line in the view; X switches sides").changed() {
            self.set_split(split);
        }
        if self.split.is_some()
            && let Some(document) = &mut self.document
        {
            ui.indent("second", |ui| method_editor(ui, "second method", &mut document.other));
            self.flicker_controls(ui);
        }
        self.difference_choice(ui);
        let Some(frame) = &self.frame else { return };
        ui.add_space(4.0);
        for side in std::iter::once(&frame.main).chain(&frame.other) {
            egui::Grid::new(("report", &side.spec, frame.other.is_some())).num_columns(2).show(ui, |ui| {
                let mut row = |name: &str, value: String, tooltip: &str| {
                    ui.weak(name).on_hover_text(tooltip);
                    ui.add(egui::Label::new(value).wrap());
                    ui.end_row();
                };
                if frame.other.is_some() || !frame.whole {
                    row("as drawn", side.spec.clone(), "While a hand moves, coarser settings keep the pace");
                }
                row(
                    "memory",
                    format!("{:.2} MB", side.report.bytes as f64 * 1e-6),
                    "Bytes that lookups read",
                );
                if let (Some(total), Some(most)) = (side.report.nodes_total, side.report.nodes_max) {
                    let per = total as f64 / side.report.texels_hit.unwrap_or(1).max(1) as f64;
                    row(
                        "nodes",
                        format!("{total}, {per:.1} a texel, at most {most}"),
                        "Of texels that meet anything",
                    );
                }
                if let Some(bound) = side.bound {
                    let text = format!("± {:.4} within {:.3} mm", bound.transmittance, bound.depth_mm);
                    row("promise", text, "Of the exact transmittance, on light rays through texel centres");
                }
            });
        }
        egui::CollapsingHeader::new(format!("Left out: {}", frame.main.left_out.len())).show(ui, |ui| {
            for omission in &frame.main.left_out {
                let saved = omission.saved.as_ref().map_or(String::new(), |s| format!(" – {s}"));
                ui.label(format!("{}{saved}", omission.what)).on_hover_text(&omission.why);
                ui.weak(format!("    {}", omission.why));
            }
        });
    }

    fn light(&mut self, ui: &mut egui::Ui) {
        let Some(document) = &mut self.document else { return };
        let (center, radius) = document.bounding_sphere();
        let camera = document.scene.camera;
        ui.horizontal(|ui| {
            let light = &mut document.scene.light;
            let toward = match *light {
                Light::Directional { toward } => toward,
                Light::Point { position } => position - center,
            };
            ui.vertical(|ui| {
                if let Some(dragged) = sphere(ui, &camera, toward) {
                    *light = match *light {
                        Light::Directional { .. } => Light::Directional { toward: dragged },
                        Light::Point { position } => {
                            Light::Point { position: center + dragged * position.distance(center).max(1e-6) }
                        }
                    };
                }
            });
            ui.vertical(|ui| {
                let is_point = matches!(light, Light::Point { .. });
                if ui.radio(!is_point, "At infinity").clicked() && is_point {
                    *light = Light::Directional { toward: toward.normalize_or(DVec3::Z) };
                }
                if ui.radio(is_point, "At a point").clicked() && !is_point {
                    *light = Light::Point { position: center + toward.normalize_or(DVec3::Z) * 1.6 * radius };
                }
                let (mut v, speed, unit, names) = match *light {
                    Light::Directional { toward } => (toward, 0.01, "", ["light R", "light A", "light S"]),
                    Light::Point { position } => {
                        (position, 0.005 * radius, " mm", ["light x", "light y", "light z"])
                    }
                };
                let mut changed = false;
                for (axis, name) in [&mut v.x, &mut v.y, &mut v.z].into_iter().zip(names) {
                    let drag = egui::DragValue::new(axis)
                        .speed(speed)
                        .max_decimals(3)
                        .suffix(unit)
                        .range(-1e6..=1e6);
                    changed |=
                        ui.add(drag.prefix(format!("{} ", &name[6..]))).accessible_name(name).changed();
                }
                if changed {
                    *light = match light {
                        Light::Directional { .. } => Light::Directional { toward: v.normalize_or(DVec3::Z) },
                        Light::Point { .. } => Light::Point { position: v },
                    };
                }
            });
        });
        ui.horizontal(|ui| {
            ui.label("Ambient").on_hover_text("Share of the light that shadows do not touch, 0 to 1");
            ui.add(egui::Slider::new(&mut document.scene.ambient, 0.0..=1.0).max_decimals(3))
                .accessible_name("ambient");
        });
        ui.horizontal(|ui| {
            ui.label("Shading").on_hover_text("Surface shading by the gradient");
            for shading in [Shading::None, Shading::Lambert, Shading::BlinnPhong] {
                ui.selectable_value(&mut document.scene.shading, shading, name_of(shading))
                    .accessible_name(format!("shading {}", name_of(shading)));
            }
        });
        ui.weak("Shift-drag in the view moves the light");
    }

    fn picture(&mut self, ui: &mut egui::Ui) {
        let Some(document) = &mut self.document else { return };
        let scene = &mut document.scene;
        egui::Grid::new("picture").num_columns(2).show(ui, |ui| {
            ui.label("Field of view");
            let fov = egui::Slider::new(&mut scene.camera.fov_deg, 5.0..=120.0).suffix("°").max_decimals(1);
            ui.add(fov).on_hover_text("Vertical, degrees");
            ui.end_row();
            ui.label("Eye-ray step");
            let step = egui::Slider::new(&mut scene.step, 0.1..=4.0).suffix(" voxels").max_decimals(2);
            ui.add(step).on_hover_text("In units of the smallest voxel spacing, when the hand rests");
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
                let tooltip = "Black here; picture files are transparent where there is nothing";
                if none.on_hover_text(tooltip).changed() && document.transparent {
                    scene.background = [0.0; 3];
                }
            });
            ui.end_row();
            ui.label("Turning");
            ui.horizontal(|ui| {
                ui.selectable_value(&mut self.settings.orbit, Orbit::Turntable, "turntable")
                    .on_hover_text("The horizon stays level");
                ui.selectable_value(&mut self.settings.orbit, Orbit::Trackball, "trackball")
                    .on_hover_text("Freely");
            });
            ui.end_row();
            ui.label("Look from");
            ui.horizontal(|ui| {
                ui.spacing_mut().item_spacing.x = 3.0;
                for (i, view) in AXIS_VIEWS.iter().enumerate() {
                    if ui
                        .small_button(view.mark)
                        .on_hover_text(format!("{} ({})", view.name, i + 1))
                        .clicked()
                    {
                        camera::look_from(&mut scene.camera, view);
                    }
                }
                if ui.small_button("reset").on_hover_text("The first view (Home)").clicked()
                    && let Some(home) = self.view.home
                {
                    scene.camera = home;
                }
            });
            ui.end_row();
        });
    }

    fn volume(&mut self, ui: &mut egui::Ui) {
        let Some(document) = &self.document else { return };
        let volume = &document.volume;
        egui::Grid::new("volume").num_columns(2).show(ui, |ui| {
            let mut row = |name: &str, value: String| {
                ui.weak(name);
                ui.add(egui::Label::new(value).wrap());
                ui.end_row();
            };
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

/// A method of the registry with whatever settings it lists.
fn method_editor(ui: &mut egui::Ui, name: &str, choice: &mut MethodChoice) {
    let response =
        egui::ComboBox::from_id_salt(name).selected_text(choice.name).width(200.0).show_ui(ui, |ui| {
            for entry in METHODS {
                let label =
                    ui.selectable_label(entry.name == choice.name, entry.name).on_hover_text(entry.summary);
                if label.clicked() && entry.name != choice.name {
                    *choice = MethodChoice::of(entry);
                }
            }
        });
    response.response.accessible_name(name);
    let entry = choice.entry();
    ui.add(egui::Label::new(egui::RichText::new(entry.summary).weak().small()).wrap());
    egui::Grid::new((name, choice.name)).num_columns(2).show(ui, |ui| {
        for (key, value) in entry.keys.iter().zip(&mut choice.values) {
            ui.label(key.name).on_hover_text(format!("{} [default: {}]", key.help, key.default));
            setting(ui, name, key, value);
            ui.end_row();
        }
    });
    if let Err(e) = choice.method() {
        ui.colored_label(ui.visuals().error_fg_color, format!("{}: {}", e.place, e.why));
    }
}

/// One setting: a list where the registry names its values, a field with a slider's range otherwise.
fn setting(ui: &mut egui::Ui, method: &str, key: &Key, value: &mut String) {
    let tooltip = format!("{} ({}) [default: {}]", key.help, key.values, key.default);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let options: Vec<&str> = key.values.split('|').collect();
        if options.len() > MOST_ABREAST {
            let list = egui::ComboBox::from_id_salt((method, key.name)).selected_text(value.as_str());
            let list = list.show_ui(ui, |ui| {
                for option in options {
                    ui.selectable_value(value, option.to_owned(), option);
                }
            });
            list.response.on_hover_text(&tooltip).accessible_name(format!("{method} {}", key.name));
            return;
        }
        if options.len() > 1 {
            for option in options {
                if ui.selectable_label(value == option, option).on_hover_text(&tooltip).clicked() {
                    *value = option.to_owned();
                }
            }
            return;
        }
        // What the buttons leave.
        let width = (ui.available_width() - BUTTONS_WIDTH).clamp(36.0, 90.0);
        let edit = egui::TextEdit::singleline(value).desired_width(width);
        ui.add(edit).on_hover_text(&tooltip).accessible_name(format!("{method} {}", key.name));
        // Halves and doubles are what a hand wants of sizes and tolerances alike.
        let number = value.parse::<f64>().ok();
        for (text, factor) in [("÷2", 0.5), ("×2", 2.0)] {
            let button = ui.add_enabled(number.is_some_and(|n| n != 0.0), egui::Button::new(text).small());
            if let Some(number) = number.filter(|_| button.clicked()) {
                let scaled = number * factor;
                let whole = !key.default.contains('.') && number.fract() == 0.0;
                *value = if whole { scaled.round().max(1.0).to_string() } else { scaled.to_string() };
            }
        }
        if value != key.default
            && ui.small_button("reset").on_hover_text(format!("Back to {}", key.default)).clicked()
        {
            *value = key.default.to_owned();
        }
    });
}

/// The light on a sphere as seen from the camera; a new direction while it is dragged.
fn sphere(ui: &mut egui::Ui, camera: &crate::scene::Camera, toward: DVec3) -> Option<DVec3> {
    let (rect, response) = ui.allocate_exact_size(vec2(104.0, 104.0), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, "light direction"));
    let (center, radius) = (rect.center(), 48.0_f32);
    let painter = ui.painter();
    let visuals = ui.visuals();
    painter.circle(center, radius, visuals.extreme_bg_color, Stroke::new(1.0, visuals.weak_text_color()));
    painter.circle_filled(center, 0.5 * radius, visuals.faint_bg_color.gamma_multiply(1.5));
    painter.circle_stroke(
        center,
        0.5 * radius,
        Stroke::new(1.0, visuals.weak_text_color().gamma_multiply(0.6)),
    );
    if let Some([x, y]) = camera::disc_from_direction(camera, toward) {
        let at = center + vec2(x as f32, -y as f32) * radius;
        let behind = x.hypot(y) > 0.5;
        let color = Color32::from_rgb(255, 205, 70);
        painter.line_segment([center, at], Stroke::new(1.5, color.gamma_multiply(0.6)));
        painter.circle(
            at,
            6.5,
            if behind { visuals.extreme_bg_color } else { color },
            Stroke::new(2.0, color),
        );
    }
    let p = response.interact_pointer_pos().filter(|_| response.dragged() || response.clicked());
    let tooltip = "Where the light comes from, seen from the camera: the middle is behind the eye, the inner circle is \
        square to the view, the rim is behind the volume";
    response.on_hover_text(tooltip);
    p.map(|p| {
        let offset = (p - center) / radius;
        camera::direction_from_disc(camera, [f64::from(offset.x), f64::from(-offset.y)])
    })
}
