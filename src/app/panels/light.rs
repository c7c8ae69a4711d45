//! Lighting section of the side panel: lights, ambient light and shading.

use crate::app::camera;
use crate::app::document::Document;
use crate::app::model::Model;
use crate::files::color;
use crate::files::input::source_name;
use crate::open::values::MOST_INTENSITY;
use crate::scene::{AmbientOcclusion, Camera, Extent, Light, LightSource, Scene, Shading, SkyMap};
use clap::ValueEnum;
use eframe::egui::{self, Color32, Painter, Pos2, Sense, Stroke, vec2};
use glam::DVec3;

/// Shows the lighting section of the side panel: lights, ambient light and shading.
pub fn show(ui: &mut egui::Ui, model: &mut Model) {
    let Some(document) = &mut model.document else { return };
    let (center, radius) = document.bounding_sphere();
    let camera = document.scene.camera;
    list(ui, document);
    ui.horizontal(|ui| {
        let LightSource { light, extent, .. } = document.light_mut();
        let toward = match *light {
            Light::Directional { toward } => toward,
            Light::Point { position } => position - center,
        };
        // The map of a sky turns by its own setting.
        if matches!(extent, Extent::Map(_)) {
            ui.disable();
        }
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
                (*light, *extent) =
                    (Light::Directional { toward: toward.normalize_or(DVec3::Z) }, Extent::None);
            }
            if ui.radio(is_point, "At a point").clicked() && !is_point {
                let position = center + toward.normalize_or(DVec3::Z) * 1.6 * radius;
                (*light, *extent) = (Light::Point { position }, Extent::None);
            }
            let (mut v, speed, unit, names) = match *light {
                Light::Directional { toward } => (toward, 0.01, "", ["light R", "light A", "light S"]),
                Light::Point { position } => {
                    (position, 0.005 * radius, " mm", ["light x", "light y", "light z"])
                }
            };
            let mut changed = false;
            for (axis, name) in [&mut v.x, &mut v.y, &mut v.z].into_iter().zip(names) {
                let drag =
                    egui::DragValue::new(axis).speed(speed).max_decimals(3).suffix(unit).range(-1e6..=1e6);
                changed |= ui.add(drag.prefix(format!("{} ", &name[6..]))).accessible_name(name).changed();
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
        ui.label("Ambient").on_hover_text("Fraction of the light without shadows, 0 to 1");
        ui.add(egui::Slider::new(&mut document.scene.ambient, 0.0..=1.0).max_decimals(3))
            .accessible_name("ambient");
    });
    if document.scene.mesh.is_none() {
        occlusion(ui, &mut document.scene.ambient_occlusion, radius);
    }
    shading(ui, document);
    size(ui, document, center);
    ui.weak("Shift-drag in the view moves the edited light");
}

/// Shows the shading models and, for a phase function, its mean cosine.
fn shading(ui: &mut egui::Ui, document: &mut Document) {
    ui.horizontal_wrapped(|ui| {
        let help =
            "From the gradient, from the direction of strands (kajiya-kay), or by a phase function (phase)";
        ui.label("Shading").on_hover_text(help);
        let of_strands = document.strands.is_some();
        for shading in Shading::ALL.into_iter().filter(|shading| of_strands || !shading.is_of_strands()) {
            let Some(value) = shading.to_possible_value() else { continue };
            ui.selectable_value(&mut document.scene.shading, shading, value.get_name())
                .accessible_name(format!("shading {}", value.get_name()));
        }
        if document.scene.shading == Shading::Phase {
            let cosine =
                egui::DragValue::new(&mut document.scene.mean_cosine).speed(0.01).range(-0.95..=0.95);
            ui.add(cosine.prefix("g "))
                .on_hover_text("Mean cosine of the phase function: above 0 light is scattered forwards")
                .accessible_name("mean cosine");
        }
    });
}

/// Shows the size of the edited light: the radius of a disc at a point, or the angular diameter of a light at infinity.
fn size(ui: &mut egui::Ui, document: &mut Document, center_mm: DVec3) {
    let maps = document.scene.lights.iter().map(LightSource::sample_count).sum::<usize>();
    let others = maps - document.light().sample_count();
    let left = Scene::MOST_SHADOW_MAPS.saturating_sub(others).max(1) as u32;
    let source = document.light_mut();
    ui.horizontal(|ui| {
        match &mut source.extent {
            Extent::Map(map) => {
                turn(ui, map);
                source.light = Light::Directional { toward: map.mean_direction() };
            }
            _ => diameter(ui, source, center_mm),
        }
        if source.is_soft() {
            source.samples = source.samples.min(left);
            let samples =
                egui::DragValue::new(&mut source.samples).range(1..=LightSource::MOST_SAMPLES.min(left));
            ui.add(samples.prefix("samples "))
                .on_hover_text("Lights without a size that represent it, each with a shadow map")
                .accessible_name("light samples");
        }
    });
}

/// Shows the radius of the ambient occlusion; 0 stands for none. `extent_mm` is that of the volume.
fn occlusion(ui: &mut egui::Ui, occlusion: &mut Option<AmbientOcclusion>, extent_mm: f64) {
    let mut radius_mm = occlusion.map_or(0.0, |occlusion| occlusion.radius_mm);
    let drag = egui::DragValue::new(&mut radius_mm).speed(0.002 * extent_mm).max_decimals(2).suffix(" mm");
    let help = "Matter within this distance of a point occludes ambient light; 0: none does";
    let response = ui.horizontal(|ui| {
        ui.label("Occlusion within").on_hover_text(help);
        ui.add(drag.range(0.0..=1e6)).on_hover_text(help).accessible_name("ambient occlusion")
    });
    if response.inner.changed() {
        let samples = occlusion.map_or(AmbientOcclusion::DEFAULT_SAMPLES, |occlusion| occlusion.samples);
        *occlusion = (radius_mm > 0.0).then_some(AmbientOcclusion { radius_mm, samples });
    }
}

/// Shows the map of a sky and its rotation about the z axis.
fn turn(ui: &mut egui::Ui, map: &mut SkyMap) {
    ui.label(source_name(&map.path)).on_hover_text(&map.path);
    let drag = egui::DragValue::new(&mut map.turn_deg).speed(0.5).max_decimals(2).prefix("turn ").suffix("°");
    ui.add(drag.range(-360.0..=360.0))
        .on_hover_text("Rotation of the sky about the z axis, counterclockwise from above")
        .accessible_name("sky turn");
}

/// Shows the radius of a disc at a point, or the angular diameter of a light at infinity.
fn diameter(ui: &mut egui::Ui, source: &mut LightSource, center_mm: DVec3) {
    let is_point = matches!(source.light, Light::Point { .. });
    let mut size = match source.extent {
        Extent::None | Extent::Map(_) => 0.0,
        Extent::Disc { radius_mm, .. } => radius_mm,
        Extent::Cone { angle_deg } => angle_deg,
    };
    let (prefix, unit, most) = if is_point { ("radius ", " mm", 1e6) } else { ("angle ", "°", 360.0) };
    let drag = egui::DragValue::new(&mut size).speed(0.5).max_decimals(2).prefix(prefix).suffix(unit);
    let help = "Size of the light, for soft shadows; 0: none. All directions (360°) are a sky";
    if ui.add(drag.range(0.0..=most)).on_hover_text(help).accessible_name("light size").changed() {
        source.extent = match (size > 0.0, is_point) {
            (false, _) => Extent::None,
            (true, true) => Extent::Disc { radius_mm: size, facing_mm: center_mm },
            (true, false) => Extent::Cone { angle_deg: size },
        };
    }
}

/// Shows the direction of the edited light on a disc in camera space. Returns the new direction when the user drags
/// it.
fn sphere(ui: &mut egui::Ui, camera: &Camera, toward: DVec3) -> Option<DVec3> {
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
    paint_light(painter, (center, radius), camera, toward, visuals.extreme_bg_color);
    let p = response.interact_pointer_pos().filter(|_| response.dragged() || response.clicked());
    let tooltip = "Direction of the light in camera space: the centre is behind the eye, the inner circle is \
        perpendicular to the view, the rim is behind the volume";
    response.on_hover_text(tooltip);
    p.map(|p| {
        let offset = (p - center) / radius;
        camera::direction_from_disc(camera, [f64::from(offset.x), f64::from(-offset.y)])
    })
}

/// Paints the direction of a light as a dot on a disc. If the light is behind the volume, the dot is filled with the
/// colour `behind`.
pub fn paint_light(
    painter: &Painter,
    (center, radius): (Pos2, f32),
    camera: &Camera,
    toward: DVec3,
    behind: Color32,
) {
    let Some([x, y]) = camera::disc_from_direction(camera, toward) else { return };
    let at = center + vec2(x as f32, -y as f32) * radius;
    let color = Color32::from_rgb(255, 205, 70);
    painter.line_segment([center, at], Stroke::new(1.5, color.gamma_multiply(0.6)));
    let fill = if x.hypot(y) > 0.5 { behind } else { color };
    painter.circle(at, 6.5, fill, Stroke::new(2.0, color));
}

/// Shows the list of lights of the scene, with buttons to add and remove lights.
fn list(ui: &mut egui::Ui, document: &mut Document) {
    let chosen = document.chosen_light();
    ui.horizontal_wrapped(|ui| {
        for (place, source) in document.scene.lights.iter().enumerate() {
            let text = egui::RichText::new(format!("{}", place + 1));
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
        let tooltip =
            format!("Add a light, at most {}: each needs a shadow map and a pass", Scene::MOST_LIGHTS);
        if add.on_hover_text(tooltip).clicked() {
            document.add_light();
        }
        let remove = ui.add_enabled(count > 1, egui::Button::new("−")).accessible_name("remove light");
        if remove.on_hover_text("Remove the edited light").clicked() {
            document.remove_light();
        }
    });
    ui.horizontal(|ui| {
        let source = document.light_mut();
        let mut rgb = source.color.map(color::srgb8_from_linear);
        if ui.color_edit_button_srgb(&mut rgb).on_hover_text("Colour of the light").changed() {
            source.color = rgb.map(|code| color::linear_from_srgb(f64::from(code) / 255.0));
        }
        let intensity = egui::DragValue::new(&mut source.intensity).speed(0.01).max_decimals(3);
        ui.add(intensity.prefix("intensity ").range(0.0..=MOST_INTENSITY))
            .on_hover_text("Factor of the light's colour; 0 turns the light off")
            .accessible_name("light intensity");
    });
}
