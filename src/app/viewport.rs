//! The view: the picture, and what hands do in it.

use super::camera::{self, AXIS_VIEWS};
use super::jobs::Aim;
use super::method_choice::MethodChoice;
use super::shown::Place;
use super::worker::Side;
use super::{App, flicker, shown};
use crate::scene::{Camera, Light};
use eframe::egui::{self, Align2, Color32, CornerRadius, FontId, Pos2, Rect, Sense, Stroke, Vec2, vec2};
use eframe::egui_wgpu::RenderState;
use glam::DVec3;

/// Radians that a drag across the height of the view turns.
const TURN: f64 = 1.2 * std::f64::consts::PI;
/// A notch of the wheel (50 points) zooms by this factor.
const NOTCH: f64 = 1.15;
/// No picture on screen is larger, whatever the display.
const MOST_PIXELS: u32 = 8192;

/// What the view remembers between frames.
#[derive(Default)]
pub struct ViewState {
    /// The camera that reset goes back to.
    pub home: Option<Camera>,
    /// The method that comes with the volume that is being opened.
    pub next_method: Option<MethodChoice>,
    /// The last picture is whole and of what is wanted.
    pub settled: bool,
    /// The view on screen, points; for scripts.
    pub rect: Option<Rect>,
}

impl App {
    /// The view in what the panels leave.
    pub(super) fn central(&mut self, ui: &mut egui::Ui, render_state: Option<&RenderState>) {
        egui::CentralPanel::no_frame().show(ui, |ui| {
            let mut rect = ui.available_rect_before_wrap();
            if self.settings.slices && self.document.is_some() {
                let slices =
                    Rect::from_min_max(egui::pos2(rect.right() - rect.width() * 0.3, rect.top()), rect.max);
                rect.max.x = slices.left() - 2.0;
                self.slices_column(ui, slices);
            }
            self.view(ui, rect, render_state);
        });
    }

    fn view(&mut self, ui: &mut egui::Ui, rect: Rect, render_state: Option<&RenderState>) {
        self.view.rect = Some(rect);
        let response = ui.interact(rect, ui.scope_id().with("view"), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "3-D view"));
        let painter = ui.painter_at(rect);
        // Where a picture will cover it all, a software adapter is spared the pixels below.
        if self.frame.is_none() || render_state.is_none() {
            painter.rect_filled(rect, CornerRadius::ZERO, Color32::from_gray(12));
        }
        if let Some(document) = &mut self.document {
            let pixels = rect.size() * ui.ctx().pixels_per_point();
            let side = |n: f32| (n.round().max(1.0) as u32).min(MOST_PIXELS);
            document.scene.width = side(pixels.x);
            document.scene.height = side(pixels.y);
            self.move_camera(ui, rect, &response);
        }
        self.paint_pictures(ui, rect, render_state);
        self.paint_flicker(ui, rect);
        if self.document.is_some() {
            self.paint_overlays(&painter, rect, ui);
        } else if self.opening.is_none() {
            let text = "Drop a volume here, or choose File › Open";
            painter.text(
                rect.center(),
                Align2::CENTER_CENTER,
                text,
                FontId::proportional(18.0),
                Color32::GRAY,
            );
        }
        self.paint_opening(ui, rect);
        self.paint_messages(ui, rect);
    }

    fn move_camera(&mut self, ui: &egui::Ui, rect: Rect, response: &egui::Response) {
        let Some(document) = &mut self.document else { return };
        let height = f64::from(rect.height().max(1.0));
        let delta = response.drag_delta();
        let (right, down) = (f64::from(delta.x) / height, f64::from(delta.y) / height);
        let modifiers = ui.input(|i| i.modifiers);
        let (_, radius) = document.bounding_sphere();
        let near_wipe = self.split.filter(|_| self.flicker.is_none()).is_some_and(|share| {
            let x = rect.left() + share * rect.width();
            let from = response.interact_pointer_pos().or_else(|| response.hover_pos());
            from.is_some_and(|p| (p.x - x).abs() < 8.0)
        });
        if near_wipe {
            ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
        }
        let wipe = ui.scope_id().with("wipe");
        if response.drag_started_by(egui::PointerButton::Primary) {
            ui.data_mut(|d| d.insert_temp(wipe, near_wipe));
        }
        let wiping = ui.data(|d| d.get_temp::<bool>(wipe)).unwrap_or(false);
        if response.dragged_by(egui::PointerButton::Primary) {
            if wiping && let Some(p) = response.interact_pointer_pos() {
                self.split = self.split.map(|_| ((p.x - rect.left()) / rect.width()).clamp(0.0, 1.0));
            } else if modifiers.shift {
                let scale = match document.scene.light {
                    Light::Directional { .. } => TURN,
                    Light::Point { .. } => 2.0 * (0.5 * document.scene.camera.fov_deg.to_radians()).tan(),
                };
                camera::drag_light(
                    &mut document.scene.light,
                    &document.scene.camera,
                    scale * right,
                    scale * down,
                );
            } else if modifiers.ctrl || modifiers.command {
                camera::pan(&mut document.scene.camera, right, down);
            } else {
                camera::orbit(&mut document.scene.camera, self.settings.orbit, TURN * right, TURN * down);
            }
        }
        if response.dragged_by(egui::PointerButton::Middle)
            || response.dragged_by(egui::PointerButton::Secondary)
        {
            camera::pan(&mut document.scene.camera, right, down);
        }
        if let Some(p) = response.hover_pos() {
            let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
            let factor = NOTCH.powf(-f64::from(scroll) / 50.0) / f64::from(pinch);
            if factor != 1.0 {
                let half = 0.5 * rect.height();
                let cursor = [(p.x - rect.center().x) / half, (rect.center().y - p.y) / half].map(f64::from);
                camera::zoom(&mut document.scene.camera, factor, cursor, radius);
            }
        }
        if response.clicked()
            && let Some(p) = response.interact_pointer_pos()
        {
            let scene = &document.scene;
            let pixel =
                (p - rect.min) / rect.size() * vec2(scene.width as f32, scene.height as f32) - vec2(0.5, 0.5);
            let direction =
                scene.camera.ray_direction(f64::from(pixel.x), f64::from(pixel.y), scene.width, scene.height);
            let aim = Aim::Ray { origin: scene.camera.eye, direction };
            self.probe(aim);
        }
    }

    fn paint_pictures(&self, ui: &egui::Ui, rect: Rect, render_state: Option<&RenderState>) {
        let (Some(frame), Some(state)) = (&self.frame, render_state) else { return };
        let painter = ui.painter_at(rect);
        // A picture of another shape (the view was resized) fills the height until the next comes.
        let size = vec2(frame.main.texture.width as f32, frame.main.texture.height as f32);
        let place =
            Rect::from_center_size(rect.center(), vec2(rect.height() * size.x / size.y, rect.height()));
        let place = if (place.width() / rect.width() - 1.0).abs() < 0.02 { rect } else { place };
        // Heat maps of the error take the pictures' places.
        let errors = |side: usize| {
            let found = self.difference.found.as_ref().filter(|_| self.difference.shows.is_some())?;
            found.sides.get(side).map(|s| &s.texture)
        };
        let shape = |side: usize, drawn: &Side| {
            let texture = errors(side).unwrap_or(&drawn.texture);
            shown::shape(place, texture, Place::Side(side), state)
        };
        if let Some(side) = self.flicker_side(ui.ctx()) {
            painter.add(shape(side, flicker::side_of(frame, side)));
            return;
        }
        painter.add(shape(0, &frame.main));
        let (Some(other), Some(share)) = (&frame.other, self.split) else { return };
        let x = rect.left() + share * rect.width();
        let right = ui.painter_at(Rect::from_min_max(egui::pos2(x, rect.top()), rect.max));
        right.add(shape(1, other));
        painter.vline(x, rect.y_range(), Stroke::new(1.5, Color32::from_white_alpha(200)));
        painter.circle_filled(egui::pos2(x, rect.center().y), 5.0, Color32::from_white_alpha(220));
        let label = |at: Pos2, align, side: &Side| tag(&painter, at, align, &side.spec);
        label(egui::pos2(x - 8.0, rect.top() + 8.0), Align2::RIGHT_TOP, &frame.main);
        label(egui::pos2(x + 8.0, rect.top() + 8.0), Align2::LEFT_TOP, other);
    }

    /// Anatomical letters, the light while it is dragged, the probed point, and how the picture stands.
    fn paint_overlays(&mut self, painter: &egui::Painter, rect: Rect, ui: &egui::Ui) {
        let Some(document) = &self.document else { return };
        let camera = document.scene.camera;
        let frame = camera.frame();
        if self.settings.marks {
            let c = rect.center();
            for (at, align, direction) in [
                (egui::pos2(rect.left() + 10.0, c.y), Align2::LEFT_CENTER, -frame.right),
                (egui::pos2(rect.right() - 10.0, c.y), Align2::RIGHT_CENTER, frame.right),
                (egui::pos2(c.x, rect.top() + 10.0), Align2::CENTER_TOP, frame.up),
                (egui::pos2(c.x, rect.bottom() - 10.0), Align2::CENTER_BOTTOM, -frame.up),
            ] {
                let letters = camera::marks(direction);
                shadowed_text(painter, at, align, &letters, 15.0, Color32::from_gray(225));
            }
            axes(painter, egui::pos2(rect.left() + 42.0, rect.bottom() - 44.0), &camera);
        }
        if let Some(p) = self.probe.as_ref().and_then(|probe| project(&camera, rect, probe.point)) {
            painter.circle_stroke(p, 7.0, Stroke::new(3.0, Color32::from_black_alpha(160)));
            painter.circle_stroke(p, 7.0, Stroke::new(1.5, Color32::from_rgb(255, 200, 60)));
        }
        if let Light::Point { position } = document.scene.light
            && let Some(p) = project(&camera, rect, position)
        {
            painter.circle_filled(p, 6.0, Color32::from_rgb(255, 230, 140));
            painter.circle_stroke(p, 9.0, Stroke::new(1.5, Color32::from_rgb(255, 230, 140)));
        }
        self.paint_difference_legend(ui, painter, rect);
        let Some(picture) = &self.frame else { return };
        let (w, h) = (picture.main.texture.width, picture.main.texture.height);
        let quality = if picture.whole { format!("{w} x {h}") } else { format!("{w} x {h}, refining …") };
        let at = rect.right_bottom() - vec2(10.0, 10.0);
        shadowed_text(painter, at, Align2::RIGHT_BOTTOM, &quality, 11.5, Color32::from_gray(170));
        let shift = ui.input(|i| i.modifiers.shift);
        if shift && let Light::Directional { toward } = document.scene.light {
            light_arrow(painter, rect, &camera, toward);
        }
    }

    fn paint_messages(&mut self, ui: &mut egui::Ui, rect: Rect) {
        if self.messages.is_empty() {
            return;
        }
        let mut closed = None;
        egui::Area::new(ui.scope_id().with("messages"))
            .pivot(Align2::LEFT_BOTTOM)
            .fixed_pos(rect.left_bottom() + vec2(96.0, -10.0))
            .order(egui::Order::Foreground)
            .show(ui.ctx(), |ui| {
                for (i, message) in self.messages.iter().enumerate() {
                    egui::Frame::popup(ui.style()).show(ui, |ui| {
                        ui.set_max_width((rect.width() - 140.0).max(200.0));
                        ui.horizontal_wrapped(|ui| {
                            if ui.small_button("×").on_hover_text("Close").clicked() {
                                closed = Some(i);
                            }
                            let text = egui::RichText::new(&message.text);
                            let color = ui.visuals().error_fg_color;
                            ui.label(if message.is_error { text.color(color) } else { text });
                            if let Some(hint) = &message.hint {
                                ui.label(egui::RichText::new(format!("hint: {hint}")).weak());
                            }
                        });
                    });
                }
            });
        if let Some(i) = closed {
            self.messages.remove(i);
        }
    }

    /// Looks from one of the six directions.
    pub fn look_from(&mut self, index: usize) {
        if let (Some(document), Some(view)) = (&mut self.document, AXIS_VIEWS.get(index)) {
            camera::look_from(&mut document.scene.camera, view);
        }
    }

    /// Back to the camera that the volume was opened with.
    pub fn reset_camera(&mut self) {
        if let (Some(document), Some(home)) = (&mut self.document, self.view.home) {
            document.scene.camera = home;
        }
    }

    /// The view on screen, points.
    pub fn view_rect(&self) -> Option<Rect> {
        self.view.rect
    }
}

/// Where a world point is on screen; `None` behind the eye.
fn project(camera: &Camera, rect: Rect, point: DVec3) -> Option<Pos2> {
    let frame = camera.frame();
    let d = point - camera.eye;
    let depth = d.dot(frame.forward);
    if depth <= 0.0 {
        return None;
    }
    let half = f64::from(0.5 * rect.height()) / (0.5 * camera.fov_deg.to_radians()).tan() / depth;
    let offset = vec2((d.dot(frame.right) * half) as f32, (-d.dot(frame.up) * half) as f32);
    Some(rect.center() + offset).filter(|p| rect.contains(*p))
}

fn shadowed_text(painter: &egui::Painter, at: Pos2, align: Align2, text: &str, size: f32, color: Color32) {
    let font = FontId::proportional(size);
    painter.text(at + vec2(1.0, 1.0), align, text, font.clone(), Color32::from_black_alpha(200));
    painter.text(at, align, text, font, color);
}

pub(super) fn tag(painter: &egui::Painter, at: Pos2, align: Align2, text: &str) {
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::monospace(12.0), Color32::from_gray(235));
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand(4.0), 3.0, Color32::from_black_alpha(150));
    painter.galley(rect.min, galley, Color32::WHITE);
}

/// The patient's axes, seen as the volume is.
fn axes(painter: &egui::Painter, center: Pos2, camera: &Camera) {
    const LENGTH: f32 = 26.0;
    let frame = camera.frame();
    let on_screen = |v: DVec3| vec2(v.dot(frame.right) as f32, -v.dot(frame.up) as f32) * LENGTH;
    let mut arms = [
        (DVec3::X, "R", Color32::from_rgb(235, 95, 85)),
        (DVec3::Y, "A", Color32::from_rgb(110, 200, 100)),
        (DVec3::Z, "S", Color32::from_rgb(95, 150, 245)),
    ];
    // What points away is painted first.
    arms.sort_by(|a, b| b.0.dot(frame.forward).total_cmp(&a.0.dot(frame.forward)));
    for (axis, letter, color) in arms {
        let end = on_screen(axis);
        painter.line_segment([center, center + end], Stroke::new(2.0, color));
        shadowed_text(painter, center + end * 1.3, Align2::CENTER_CENTER, letter, 12.0, color);
    }
}

/// Where the light comes from, while it is dragged.
fn light_arrow(painter: &egui::Painter, rect: Rect, camera: &Camera, toward: DVec3) {
    let Some([x, y]) = camera::disc_from_direction(camera, toward) else { return };
    let radius = 0.4 * rect.height().min(rect.width());
    let color = Color32::from_rgb(255, 220, 110);
    let from = rect.center() + Vec2::new(x as f32, -y as f32) * radius;
    painter.line_segment([rect.center(), from], Stroke::new(1.0, color.gamma_multiply(0.6)));
    let behind = x.hypot(y) > 0.5;
    let fill = if behind { Color32::from_black_alpha(120) } else { color };
    painter.circle(from, 8.0, fill, Stroke::new(2.0, color));
}
